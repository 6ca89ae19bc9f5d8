//! Pictures of an episode while it runs, for its page.

use crate::video::webp;
use crate::{Error, Result};
use std::time::{Duration, Instant};
use trocar_camera::ColorImage;
use trocar_cell::{Cell, CellEvent};
use trocar_render::RenderSettings;
use trocar_report::picture_colors::shown;
use trocar_sensors::{CameraNoise, CameraRig, DepthNoise};
use trocar_task::{Episode, Step};

/// Sizes of stills and video (px).
const STILL_SIZE: [usize; 2] = [640, 360];
const VIDEO_SIZE: [usize; 2] = [448, 252];

/// Maximum number of stills of an episode, without the last: jaws may close many times.
const MAX_STILLS: usize = 7;

/// Time between frames of the video (s), and maximum number of frames.
const FRAME_INTERVAL: f64 = 0.1;
const MAX_FRAMES: usize = 150;

#[derive(Clone, Debug, Default)]
pub struct Pictures {
    /// Captions and pictures.
    pub stills: Vec<(String, ColorImage)>,
    /// Animated WebP and its size (px).
    pub video: Option<(Vec<u8>, [usize; 2])>,
}

/// Records pictures of an episode through the scene's cameras.
pub(crate) struct Recorder {
    rig: CameraRig,
    /// The camera of stills and video.
    camera: String,
    /// The camera of the depth picture.
    depth: Option<String>,
    stills: Vec<(String, ColorImage)>,
    frames: Vec<(ColorImage, i32)>,
    /// Whether a video is recorded.
    records_video: bool,
    lifted: bool,
    spent: Duration,
    failed: Option<Error>,
}

impl Recorder {
    /// Records stills and a video through the camera `endoscope`, or the first camera without one,
    /// and the depth of `d405` at the end.
    pub fn new(rig: CameraRig) -> Self {
        let name = |wanted: &str| rig.cameras().iter().find(|c| **c == wanted).map(|c| (*c).to_owned());
        let camera = name("endoscope").or_else(|| rig.cameras().first().map(|c| (*c).to_owned()));
        Self {
            camera: camera.unwrap_or_default(),
            depth: name("d405"),
            rig,
            stills: Vec::new(),
            frames: Vec::new(),
            records_video: true,
            lifted: false,
            spent: Duration::ZERO,
            failed: None,
        }
    }

    #[must_use]
    pub fn stills_only(self) -> Self {
        Self { records_video: false, depth: None, ..self }
    }

    /// Records the episode at its start or after `step`.
    pub fn record(&mut self, episode: &Episode, step: Option<&Step>) {
        let clock = Instant::now();
        if self.failed.is_none()
            && let Err(error) = self.try_record(episode.cell(), step)
        {
            self.failed = Some(error);
        }
        self.spent += clock.elapsed();
    }

    /// Wall time spent on pictures.
    pub fn spent(&self) -> Duration {
        self.spent
    }

    fn try_record(&mut self, cell: &Cell, step: Option<&Step>) -> Result<()> {
        let Some(step) = step else { return self.still(cell, "Before the task") };
        for event in &step.events {
            match event {
                CellEvent::Attached { .. } => self.still(cell, "The jaws have taken hold of tissue")?,
                CellEvent::Cut { .. } => self.still(cell, "The blades have closed")?,
                _ => {}
            }
        }
        if !self.lifted && step.progress.stages.iter().any(|s| s.stage == "lift" && s.passed) {
            self.lifted = true;
            self.still(cell, "Lifted")?;
        }
        if self.records_video
            && cell.time() >= FRAME_INTERVAL * self.frames.len() as f64 - 1e-9
            && self.frames.len() < MAX_FRAMES
        {
            let picture = self.rig.render(cell, &self.camera, VIDEO_SIZE, &RenderSettings::Smooth)?;
            self.frames.push((picture.color.clone(), (1e3 * cell.time()).round() as i32));
        }
        Ok(())
    }

    fn still(&mut self, cell: &Cell, what: &str) -> Result<()> {
        if self.stills.len() < MAX_STILLS { self.add_still(cell, what) } else { Ok(()) }
    }

    fn add_still(&mut self, cell: &Cell, what: &str) -> Result<()> {
        let picture = self.rig.render(cell, &self.camera, STILL_SIZE, &RenderSettings::Smooth)?;
        let caption = format!("{what}, {:.2} s; {}", cell.time(), self.camera);
        self.stills.push((caption, picture.color.clone()));
        Ok(())
    }

    /// Returns all pictures, with one of the end.
    pub fn finish(mut self, cell: &Cell) -> Result<Pictures> {
        if let Some(error) = self.failed {
            return Err(error);
        }
        self.add_still(cell, "At the end")?;
        if let Some(depth) = self.depth.clone() {
            let picture = self.rig.render(cell, &depth, STILL_SIZE, &RenderSettings::Smooth)?;
            self.stills.push((format!("{depth} at the end"), picture.color.clone()));
            self.rig.noise = CameraNoise { depth: Some(DepthNoise::default()), ..CameraNoise::default() };
            let picture = self.rig.render(cell, &depth, STILL_SIZE, &RenderSettings::Preview { shadows: false })?;
            self.stills.push((format!("Depth of {depth} with its noise, near is bright"), shown(&picture.depth)));
        }
        let video = if self.frames.len() > 1 { Some((webp(&self.frames)?, VIDEO_SIZE)) } else { None };
        Ok(Pictures { stills: self.stills, video })
    }
}
