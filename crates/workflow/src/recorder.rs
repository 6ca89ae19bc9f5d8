//! Pictures of an episode while it runs, for its page.

use crate::moving::webp;
use crate::rendering::colors::{averaged, shown};
use crate::{Error, Result};
use std::time::{Duration, Instant};
use trocar_camera::ColorImage;
use trocar_cell::{Cell, CellEvent};
use trocar_render::RenderSettings;
use trocar_sensors::{CameraRig, DepthNoise, SensorNoise};
use trocar_task::{Episode, Step};

/// Size of the stills and of the moving picture (px). Each is rendered at twice the size and averaged.
const STILL: [usize; 2] = [640, 360];
const FILM: [usize; 2] = [448, 252];

/// Time between frames of the moving picture (s), and most of them.
const FRAME_INTERVAL: f64 = 0.1;
const MAX_FRAMES: usize = 150;

/// What was seen.
#[derive(Clone, Debug, Default)]
pub struct Pictures {
    /// Captions and pictures.
    pub stills: Vec<(String, ColorImage)>,
    /// Animated WebP and its size.
    pub film: Option<(Vec<u8>, [usize; 2])>,
}

/// Watches an episode through the scene's cameras.
pub(crate) struct Recorder {
    rig: CameraRig,
    /// The camera that watches, and the one that measures depth.
    camera: String,
    depth: Option<String>,
    stills: Vec<(String, ColorImage)>,
    frames: Vec<(ColorImage, i32)>,
    lifted: bool,
    spent: Duration,
    failed: Option<Error>,
}

impl Recorder {
    /// Through the camera `endoscope` or else the first one.
    pub fn new(rig: CameraRig) -> Self {
        let name = |wanted: &str| rig.cameras().iter().find(|c| **c == wanted).map(|c| (*c).to_owned());
        let camera = name("endoscope").or_else(|| rig.cameras().first().map(|c| (*c).to_owned()));
        let depth = name("d405");
        let (stills, frames) = (Vec::new(), Vec::new());
        let camera = camera.unwrap_or_default();
        Self { rig, camera, depth, stills, frames, lifted: false, spent: Duration::ZERO, failed: None }
    }

    /// Sees the episode at its start or after a step.
    pub fn record(&mut self, episode: &Episode, step: Option<&Step>) {
        let clock = Instant::now();
        if self.failed.is_none()
            && let Err(error) = self.try_record(episode.cell(), step)
        {
            self.failed = Some(error);
        }
        self.spent += clock.elapsed();
    }

    /// Wall time that pictures took.
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
        if !self.lifted && step.progress.stage >= 2 {
            self.lifted = true;
            self.still(cell, "Lifted")?;
        }
        if cell.time() >= FRAME_INTERVAL * self.frames.len() as f64 - 1e-9 && self.frames.len() < MAX_FRAMES {
            let picture = self.rig.render(cell, &self.camera, FILM.map(|n| 2 * n), &RenderSettings::preview())?;
            self.frames.push((averaged(&picture.color, 2), (1e3 * cell.time()).round() as i32));
        }
        Ok(())
    }

    fn still(&mut self, cell: &Cell, what: &str) -> Result<()> {
        let picture = self.rig.render(cell, &self.camera, STILL.map(|n| 2 * n), &RenderSettings::preview())?;
        let caption = format!("{what}, {:.2} s; {}", cell.time(), self.camera);
        self.stills.push((caption, averaged(&picture.color, 2)));
        Ok(())
    }

    /// All pictures, the last of the end.
    ///
    /// # Errors
    /// What went wrong while it watched.
    pub fn finish(mut self, cell: &Cell) -> Result<Pictures> {
        if let Some(error) = self.failed {
            return Err(error);
        }
        self.still(cell, "At the end")?;
        if let Some(depth) = self.depth.clone() {
            let picture = self.rig.render(cell, &depth, STILL.map(|n| 2 * n), &RenderSettings::preview())?;
            self.stills.push((format!("{depth} at the end"), averaged(&picture.color, 2)));
            self.rig.noise = SensorNoise { depth: Some(DepthNoise::default()), ..SensorNoise::default() };
            let picture = self.rig.render(cell, &depth, STILL, &RenderSettings::Preview { shadows: false })?;
            self.stills.push((format!("Depth of {depth} with its noise, near is bright"), shown(&picture.depth)));
        }
        let film = if self.frames.len() > 1 { Some((webp(&self.frames)?, FILM)) } else { None };
        Ok(Pictures { stills: self.stills, film })
    }
}
