//! Records an episode's surfaces while it runs.

use super::format::{ActionLimits, Encoder, RecordedArm, RecordedCamera, SurfacesHeader};
use crate::Result;
use std::time::{Duration, Instant};
use trocar_cell::ActionSpace;
use trocar_sensors::{ArmPosture, Skins};
use trocar_task::{Bounds, Episode, STATE_NAMES, STATE_SIZE, Step, prompt};

/// Records an episode's surfaces: [`begin`](Self::begin) at its start, [`record`](Self::record)
/// after every step.
pub struct SurfaceRecorder {
    header: SurfacesHeader,
    skins: Skins,
    encoder: Encoder,
}

impl SurfaceRecorder {
    /// Records the start of an episode, at which `episode` stands.
    ///
    /// # Errors
    /// A camera without a lens.
    pub fn begin(episode: &Episode) -> Result<Self> {
        let (scene, specimen, cell) = (episode.arranged_scene(), episode.specimen(), episode.cell());
        let mut arms = Vec::new();
        for (side, _) in cell.arms() {
            let name = side.name();
            let (model, links) = (cell.arm_model(name)?.to_owned(), cell.link_poses(name)?.len());
            arms.push(RecordedArm { name: name.to_owned(), model, links });
        }
        // A camera with the lens of a recording that the specimen does not have takes no pictures.
        let camera = |camera: &trocar_scene::CellCamera| {
            Some(RecordedCamera {
                name: camera.name.clone(),
                pose: camera.view.pose(&scene.placement),
                model: camera.model(specimen.camera.as_ref())?,
                policy_size_px: camera.policy_size_px,
            })
        };
        let mut actions = Vec::new();
        for (space, name) in [(ActionSpace::Pivots, "pivots"), (ActionSpace::Tip, "tip")] {
            let Bounds { names, low, high, .. } = Bounds::new(cell, space)?;
            actions.push(ActionLimits { space: name.to_owned(), names, low, high });
        }
        let header = SurfacesHeader {
            program: env!("CARGO_PKG_VERSION").to_owned(),
            seed: episode.seed(),
            start_hash: format!("{:016x}", episode.state_hash()),
            period_s: cell.period(),
            frames: 0,
            prompt: prompt(scene),
            stages: episode.progress().stages.len(),
            organs: specimen.organs.iter().map(|o| o.name.clone()).collect(),
            arms,
            cameras: scene.cameras.iter().filter_map(camera).collect(),
            state_names: STATE_NAMES[..STATE_SIZE].iter().map(|n| (*n).to_owned()).collect(),
            actions,
        };
        let mut made = Self { header, skins: Skins::new(scene, specimen)?, encoder: Encoder::new() };
        made.record(episode)?;
        Ok(made)
    }

    /// Records the episode as it is now.
    ///
    /// # Errors
    /// A cell that has lost an arm.
    pub fn record(&mut self, episode: &Episode) -> Result<()> {
        let cell = episode.cell();
        let same = self.skins.update(cell)?;
        let posture = |arm: &RecordedArm| Ok(ArmPosture::of(cell, &arm.name)?);
        let arms = self.header.arms.iter().map(posture).collect::<Result<Vec<_>>>()?;
        let numbers = (cell.time(), episode.progress().score(), &episode.observe().to_vec()[..]);
        self.encoder.add(numbers, &arms, &self.skins, same)
    }

    /// The bytes of the file.
    ///
    /// # Errors
    /// A header that cannot be written.
    pub fn finish(self) -> Result<Vec<u8>> {
        self.encoder.finish(self.header)
    }
}

/// Keeps the surfaces of an episode that [`trocar_task::run_watched`] runs, if they are wanted.
pub struct SurfaceWatch {
    wanted: bool,
    recorder: Option<Result<SurfaceRecorder>>,
    spent: Duration,
}

impl SurfaceWatch {
    /// Of an episode that begins.
    pub fn new(wanted: bool) -> Self {
        Self { wanted, recorder: None, spent: Duration::ZERO }
    }

    /// Sees the episode at its start or after `step`. The first error ends the recording.
    pub fn see(&mut self, episode: &Episode, step: Option<&Step>) {
        if !self.wanted {
            return;
        }
        let clock = Instant::now();
        if step.is_none() {
            self.recorder = Some(SurfaceRecorder::begin(episode));
        } else if let Some(Ok(recorder)) = &mut self.recorder
            && let Err(why) = recorder.record(episode)
        {
            self.recorder = Some(Err(why));
        }
        self.spent += clock.elapsed();
    }

    /// Wall time spent.
    pub fn spent(&self) -> Duration {
        self.spent
    }

    /// The bytes of the file; `None` if none is wanted.
    ///
    /// # Errors
    /// The first error.
    pub fn finish(self) -> Result<Option<Vec<u8>>> {
        self.recorder.map(|recorder| recorder?.finish()).transpose()
    }
}
