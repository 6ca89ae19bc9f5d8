//! Pictures of a grasp-lift in the cell while it runs, for its report.

use crate::moving::webp;
use crate::rendering::{averaged, shown};
use crate::{Error, Result};
use trocar_camera::ColorImage;
use trocar_cell::Cell;
use trocar_render::RenderSettings;
use trocar_sensors::{CameraRig, DepthNoise, SensorNoise};

/// Size of the stills and of the moving picture [px]; each is seen at twice the size and averaged.
const STILL: [usize; 2] = [640, 360];
const FILM: [usize; 2] = [448, 252];

/// Time between frames of the moving picture [s], and most of them.
const EVERY: f64 = 0.1;
const MOST: usize = 150;

/// What was seen.
#[derive(Clone, Debug, Default)]
pub struct Pictures {
    /// Captions and pictures.
    pub stills: Vec<(String, ColorImage)>,
    /// Animated WebP and its size.
    pub film: Option<(Vec<u8>, [usize; 2])>,
}

/// Watches a run through the scene's cameras.
pub(crate) struct Watched {
    sight: CameraRig,
    arm: String,
    /// The camera that watches, and the one that measures depth.
    camera: String,
    depth: Option<String>,
    stills: Vec<(String, ColorImage)>,
    frames: Vec<(ColorImage, i32)>,
    held: bool,
    lifted: bool,
    failed: Option<Error>,
}

impl Watched {
    pub fn new(sight: CameraRig, arm: &str) -> Self {
        let name = |wanted: &str| sight.cameras().iter().find(|c| **c == wanted).map(|c| (*c).to_owned());
        let camera = name("endoscope").or_else(|| sight.cameras().first().map(|c| (*c).to_owned()));
        let depth = name("d405");
        let camera = camera.unwrap_or_default();
        let (stills, frames) = (Vec::new(), Vec::new());
        let arm = arm.to_owned();
        Self { sight, arm, camera, depth, stills, frames, held: false, lifted: false, failed: None }
    }

    /// Sees the cell in a phase of its run.
    pub fn look(&mut self, cell: &Cell, phase: &str) {
        if self.failed.is_none()
            && let Err(error) = self.try_look(cell, phase)
        {
            self.failed = Some(error);
        }
    }

    fn try_look(&mut self, cell: &Cell, phase: &str) -> Result<()> {
        if self.stills.is_empty() {
            self.still(cell, "Before the task")?;
        }
        if !self.held && cell.held(&self.arm)?.is_some() {
            self.held = true;
            self.still(cell, "The jaws have hold of tissue")?;
        }
        if !self.lifted && phase == "hold" {
            self.lifted = true;
            self.still(cell, "Lifted")?;
        }
        if cell.time() >= EVERY * self.frames.len() as f64 - 1e-9 && self.frames.len() < MOST {
            let picture = self.sight.render(cell, &self.camera, FILM.map(|n| 2 * n), &RenderSettings::preview())?;
            self.frames.push((averaged(&picture.color, 2), (1e3 * cell.time()).round() as i32));
        }
        Ok(())
    }

    fn still(&mut self, cell: &Cell, what: &str) -> Result<()> {
        let picture = self.sight.render(cell, &self.camera, STILL.map(|n| 2 * n), &RenderSettings::preview())?;
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
            let picture = self.sight.render(cell, &depth, STILL.map(|n| 2 * n), &RenderSettings::preview())?;
            self.stills.push((format!("{depth} at the end"), averaged(&picture.color, 2)));
            self.sight.noise = SensorNoise { depth: Some(DepthNoise::default()), ..SensorNoise::default() };
            let picture = self.sight.render(cell, &depth, STILL, &RenderSettings::Preview { shadows: false })?;
            self.stills.push((format!("Depth of {depth} with its noise, near is bright"), shown(&picture.depth)));
        }
        let film = if self.frames.len() > 1 { Some((webp(&self.frames)?, FILM)) } else { None };
        Ok(Pictures { stills: self.stills, film })
    }
}
