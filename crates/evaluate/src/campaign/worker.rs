//! Runs jobs one after the other: a new cell for each, and the policies that were asked for so far.

use super::remote::Remote;
use super::{Files, Job};
use crate::Result;
use std::collections::BTreeMap;
use trocar_scene::Scene;
use trocar_specimen::Specimen;
use trocar_task::{Episode, Policy, policy, run};

/// An episode's cell with policies.
pub struct Worker {
    scene: Scene,
    specimen: Specimen,
    episode: Episode,
    policies: BTreeMap<String, Box<dyn Policy + Send>>,
    /// The cell has done an episode.
    used: bool,
}

impl Worker {
    /// Builds the cell of `scene` around `specimen`, stepped by one thread.
    ///
    /// # Errors
    /// A scene that cannot be built.
    pub fn new(scene: &Scene, specimen: &Specimen) -> Result<Self> {
        let episode = Episode::new(scene, specimen, 1)?;
        Ok(Self { scene: scene.clone(), specimen: specimen.clone(), episode, policies: BTreeMap::new(), used: false })
    }

    /// Runs `job` and gives the files of its episode. A policy that fails ends its episode, which is a result.
    ///
    /// # Errors
    /// An episode that cannot be begun; [`crate::Error::Cell`] (interrupted) when `stop` says so.
    pub fn run(&mut self, job: &Job, stop: &dyn Fn() -> bool) -> Result<Files> {
        // A cell that has done an episode keeps something of it in its solver: the next may differ in the last bits, and then in all. A new one is what a replay has, too.
        if std::mem::replace(&mut self.used, true) {
            self.episode = Episode::new(&self.scene, &self.specimen, 1)?;
        }
        let source = job.policy.source.as_str();
        if !self.policies.contains_key(source) {
            let made: Box<dyn Policy + Send> = if source.contains(':') {
                Box::new(Remote::new(&job.policy, &self.scene, &self.specimen, &self.episode)?)
            } else {
                policy::named(source)?
            };
            self.policies.insert(source.to_owned(), made);
        }
        let Some(policy) = self.policies.get_mut(source) else { return Ok(Files::default()) };
        let recording = run(&mut self.episode, policy.as_mut(), job.seed, &mut |_| !stop())?;
        Files::of(&recording)
    }
}
