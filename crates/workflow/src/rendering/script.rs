//! The scripted grasp-lift of a scene, one control period at a time, for pictures.

use crate::Result;
use crate::specimen_scene::{grasp_lift, task_organ};
use trocar_cell::Cell;
use trocar_scene::Scene;
use trocar_specimen::Specimen;
use trocar_task::policy::{Script, Scripted};
use trocar_task::{Episode, Policy};

/// The scripted grasp-lift in progress.
pub struct ScriptedLift {
    episode: Episode,
    policy: Scripted,
    chunk: std::collections::VecDeque<trocar_cell::Action>,
}

impl ScriptedLift {
    /// The grasp-lift in the cell of `scene` with `specimen`. The organ of the scene's task is
    /// grasped in the middle with the scene's grasp design and lifted by 15 mm.
    ///
    /// # Errors
    /// A scene that cannot be built, a specimen without organs.
    pub fn new(scene: &Scene, specimen: &Specimen, threads: usize) -> Result<Self> {
        let mut scene = scene.clone();
        let own = specimen.organs.iter().any(|o| o.name == scene.task.organ).then(|| scene.task.organ.clone());
        let organ = task_organ(specimen, own.as_deref())?;
        scene.variation = trocar_scene::Variation::default();
        scene.task = trocar_scene::Task { grasp: scene.task.grasp, ..grasp_lift(organ) };
        let episode = Episode::new(&scene, specimen, threads)?;
        let mut policy = Scripted::following(Script::default());
        policy.begin(&episode, 0)?;
        Ok(Self { episode, policy, chunk: std::collections::VecDeque::new() })
    }

    /// The cell in its present state.
    pub fn cell(&self) -> &Cell {
        self.episode.cell()
    }

    /// Advances one control period. Returns false at the end.
    ///
    /// # Errors
    /// A place that cannot be grasped.
    pub fn advance(&mut self) -> Result<bool> {
        if self.chunk.is_empty() {
            self.chunk = self.policy.act(&self.episode)?.into();
        }
        let Some(action) = self.chunk.pop_front() else { return Ok(false) };
        Ok(self.episode.end().is_none() && self.episode.step(&action)?.end.is_none())
    }
}
