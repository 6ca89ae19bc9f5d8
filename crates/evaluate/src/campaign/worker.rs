//! Runs jobs one after the other: one cell, built once, and the policies that were asked for so far.

use super::remote::Remote;
use super::{Files, Job};
use crate::{Error, Result};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use trocar_scene::Scene;
use trocar_specimen::Specimen;
use trocar_task::{Episode, Policy, policy, run};

/// An episode's cell with policies.
pub struct Worker {
    specimen: Specimen,
    episode: Episode,
    /// By their names.
    policies: BTreeMap<String, Box<dyn Policy + Send>>,
    stop: Arc<AtomicBool>,
}

impl Worker {
    /// Builds the cell of `scene` around `specimen`, stepped by one thread.
    ///
    /// # Errors
    /// A scene that cannot be built.
    pub fn new(scene: &Scene, specimen: &Specimen) -> Result<Self> {
        let episode = Episode::new(scene, specimen, 1)?;
        Ok(Self { specimen: specimen.clone(), episode, policies: BTreeMap::new(), stop: Arc::default() })
    }

    /// The same, which gives up what it does when `flag` becomes true.
    #[must_use]
    pub fn stopped_by(mut self, flag: Arc<AtomicBool>) -> Self {
        self.stop = flag;
        self
    }

    /// Runs `job` and gives the files of its episode. A policy that fails ends its episode, which is a result.
    ///
    /// # Errors
    /// An episode that cannot be begun; [`crate::Error::Interrupted`] when the flag says so.
    pub fn run(&mut self, job: &Job) -> Result<Files> {
        self.run_until(job, &|| false)
    }

    /// The same, which also gives up between two steps when `given_up` says so.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn run_until(&mut self, job: &Job, given_up: &dyn Fn() -> bool) -> Result<Files> {
        let (name, source) = (job.policy.name.as_str(), job.policy.source.as_str());
        if !self.policies.contains_key(name) {
            let made: Box<dyn Policy + Send> = if source.contains(':') {
                Box::new(Remote::new(&job.policy, &self.specimen, &self.episode, Arc::clone(&self.stop))?)
            } else {
                policy::named(source)?
            };
            self.policies.insert(name.to_owned(), made);
        }
        let Some(policy) = self.policies.get_mut(name) else { return Ok(Files::default()) };
        let flag = &self.stop;
        let stopped = || flag.load(Ordering::Relaxed) || given_up();
        let recording = run(&mut self.episode, policy.as_mut(), job.seed, &mut |_| !stopped());
        if stopped() {
            // A policy that was waited for ends as one that failed; it did not.
            return Err(Error::Interrupted);
        }
        Files::of(&recording?)
    }
}
