//! Films of a lift for pages: the recording with what is measured drawn into it, alone or beside
//! the simulated lift seen by the same camera, and below them the lift profiles, which move with
//! the frames.

mod frame;
mod moment;
mod panel;
mod simulated;
#[cfg(test)]
mod tests;

pub use simulated::Simulated;

use crate::video::webp;
use crate::{Result, check_interrupted};
use frame::FrameLayout;
use moment::{Moment, shares};
use panel::{Panel, Seen};
use simulated::SimulatedView;
use std::time::Instant;
use trocar_camera::ColorImage;
use trocar_core::Progress;
use trocar_measure::{Film, MeasuredLift};
use trocar_report::{colors, figures, page};

/// Maximum number of frames; a longer lift leaves some out.
const MAX_FRAMES: usize = 48;

/// Frames in a second, if it is not known.
const USUAL_HZ: f64 = 30.0;

/// Time for which the last frame stays (ms).
const LAST_MS: i32 = 1500;

/// Colours of the filmed and of the simulated lift.
pub const FILMED: [u8; 3] = colors::organ(1);
/// See [`FILMED`].
pub const SIMULATED: [u8; 3] = colors::organ(0);

/// A film of a lift.
#[derive(Clone, Debug)]
pub struct LiftFilm {
    /// Animated WebP.
    pub bytes: Vec<u8>,
    /// Width and height (px).
    pub size: [usize; 2],
    /// Number of frames.
    pub frames: usize,
    /// Wall time that it took (s).
    pub seconds: f64,
}

/// The lift to show.
#[derive(Clone, Copy, Debug)]
pub struct ShownLift<'a> {
    /// Its number.
    pub number: usize,
    /// Frames of the source in a second, if that is known.
    pub rate_hz: Option<f64>,
    /// As it was measured.
    pub lift: &'a MeasuredLift,
}

impl ShownLift<'_> {
    /// The film of the recording, and of the simulated lift at its right.
    ///
    /// # Errors
    /// A film that cannot be read or encoded, a specimen that cannot be rendered or simulated, an
    /// interruption.
    pub fn film(
        &self,
        source: &mut dyn Film,
        simulated: Option<&Simulated<'_>>,
        progress: &dyn Progress,
    ) -> Result<LiftFilm> {
        let clock = Instant::now();
        let wanted = self.wanted();
        progress.begin("film", wanted.len() as u64);
        let made = self.frames(source, &wanted, simulated, progress);
        progress.end();
        let frames = made?;
        let size = frames.first().map_or([0; 2], |(frame, _)| [frame.width, frame.height]);
        // The last frame is there twice, so that it stays.
        let frame_count = frames.len().saturating_sub(1);
        Ok(LiftFilm { bytes: webp(&frames)?, size, frames: frame_count, seconds: clock.elapsed().as_secs_f64() })
    }

    /// The frames of the source that are shown.
    fn wanted(&self) -> Vec<usize> {
        let tracked = &self.lift.tracks.frames;
        tracked.iter().copied().step_by(tracked.len().div_ceil(MAX_FRAMES).max(1)).collect()
    }

    fn frames(
        &self,
        source: &mut dyn Film,
        wanted: &[usize],
        simulated: Option<&Simulated<'_>>,
        progress: &dyn Progress,
    ) -> Result<Vec<(ColorImage, i32)>> {
        let measured: Vec<Moment> = wanted.iter().map(|frame| Moment::measured(self.lift, *frame)).collect();
        let mut view = match simulated {
            Some(simulated) => Some(SimulatedView::new(simulated, (wanted, &shares(self.lift, wanted)), progress)?),
            None => None,
        };
        let layout = FrameLayout::of(self.lift, view.as_ref().map(SimulatedView::moments));
        let panel = Panel::around(source.camera(), self.lift, &measured, layout.panel());
        let mut frames: Vec<(ColorImage, i32)> = Vec::new();
        let mut failed = None;
        let played = source.play(self.lift.info.rest..=self.lift.info.last, &mut |index, frame| {
            if progress.interrupted() {
                return Err(trocar_measure::Error::Interrupted);
            }
            let Some(k) = wanted.iter().position(|w| *w == index) else { return Ok(()) };
            let drawn = (|| {
                let mut panels = vec![panel.filmed(Seen { color: &frame.color, depth: &frame.depth }, &measured[k])?];
                if let Some(view) = &mut view {
                    panels.push(view.panel(&panel, k, &measured[k])?);
                }
                layout.frame(self, index, &panels, &measured[k], view.as_ref().map(|v| &v.moments()[k]))
            })();
            match drawn {
                Ok(picture) => {
                    let rate_hz = self.rate_hz.filter(|hz| *hz > 0.1).unwrap_or(USUAL_HZ);
                    let at = 1e3 * (index - self.lift.info.rest) as f64 / rate_hz;
                    frames.push((picture, at.round() as i32));
                    progress.advance(1);
                    Ok(())
                }
                Err(error) => {
                    failed = Some(error);
                    Err(trocar_measure::Error::Interrupted)
                }
            }
        });
        match (failed, played) {
            (Some(error), _) => return Err(error),
            (None, played) => played?,
        }
        check_interrupted(progress)?;
        if let Some((picture, at)) = frames.last().cloned() {
            frames.push((picture, at + LAST_MS));
        }
        Ok(frames)
    }
}

impl LiftFilm {
    /// The film above its caption (HTML), as wide as the page.
    pub fn figure(&self, alt: &str, caption: &str) -> String {
        let img = figures::img_of_bytes("webp", &self.bytes, self.size[0], self.size[1], alt);
        page::figure(&img, caption)
    }
}
