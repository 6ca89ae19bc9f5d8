//! Films: frames of colour and depth in order, from a recording or a simulated episode.

use crate::{Error, Result};
use glam::DVec3;
use std::ops::RangeInclusive;
use trocar_camera::{Camera, Mask};
use trocar_recording::{InstrumentRule, Recording, RgbdFrame};
use trocar_segment::{MetalDetector, Picture, Segmenter, Target};

/// Frames of one camera that does not move.
pub trait Film {
    /// The camera of the frames.
    fn camera(&self) -> Camera;

    /// Unit vector against gravity, in the camera's frame.
    fn up(&self) -> DVec3;

    /// Shows the frames in order. A frame that cannot be read is left out.
    ///
    /// # Errors
    /// A source that cannot be read, or an error of `show`.
    fn play(
        &mut self,
        frames: RangeInclusive<usize>,
        show: &mut dyn FnMut(usize, RgbdFrame) -> Result<()>,
    ) -> Result<()>;

    /// One frame.
    ///
    /// # Errors
    /// A frame that cannot be read.
    fn frame(&mut self, index: usize) -> Result<RgbdFrame> {
        let mut found = None;
        self.play(index..=index, &mut |_, frame| {
            found = Some(frame);
            Ok(())
        })?;
        found.ok_or_else(|| Error::Film(format!("frame {index} cannot be read")))
    }
}

/// A recording as a film. Instruments are found by the recording's own rule.
pub struct RecordingFilm<'a> {
    recording: &'a Recording,
    metal: MetalDetector,
}

impl<'a> RecordingFilm<'a> {
    /// Of a recording.
    pub fn new(recording: &'a Recording) -> Self {
        Self { recording, metal: MetalDetector::default() }
    }

    fn instruments(&self, frame: &RgbdFrame, name: &str) -> Result<Option<Mask>> {
        match self.recording.info.instruments {
            InstrumentRule::Masks => Ok(None),
            InstrumentRule::None => Ok(Some(Mask::new(frame.color.width, frame.color.height))),
            InstrumentRule::Metal => {
                let picture = Picture { color: &frame.color, depth: Some(&frame.depth), name };
                let target = Target { name: "instruments".into(), ..Target::default() };
                Ok(Some(self.metal.segment(&picture, &target)?))
            }
        }
    }
}

impl Film for RecordingFilm<'_> {
    fn camera(&self) -> Camera {
        self.recording.camera()
    }

    fn up(&self) -> DVec3 {
        self.recording.info.up.into()
    }

    fn play(
        &mut self,
        frames: RangeInclusive<usize>,
        show: &mut dyn FnMut(usize, RgbdFrame) -> Result<()>,
    ) -> Result<()> {
        let wanted: Vec<usize> = frames.collect();
        for packet in self.recording.packets(&wanted) {
            let index = packet.frame;
            let decoded = packet.parts.and_then(|parts| self.recording.decode(index, &parts));
            let Ok(mut frame) = decoded else { continue };
            if let Some(found) = self.instruments(&frame, &self.recording.frame_name(index))? {
                frame.instruments = found;
            }
            show(index, frame)?;
        }
        Ok(())
    }
}
