//! Runs jobs one after the other: one cell, built once, and the policies that were asked for so far.

use crate::plan::Job;
use crate::remote::Remote;
use crate::served::Served;
use crate::source::PolicySpec;
use crate::store::Files;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use trocar_scene::Scene;
use trocar_specimen::Specimen;
use trocar_task::{Episode, Policy, policy, run};
use trocar_workflow::{Error, Result};

/// An episode's cell with policies.
pub struct Worker {
    specimen: Specimen,
    episode: Episode,
    /// By their names.
    policies: BTreeMap<String, Box<dyn Policy + Send>>,
    stop: Arc<AtomicBool>,
    /// The interpreter that serves Python policies, if `$TROCAR_PYTHON` names none.
    python: Option<String>,
    /// Servers of Python policies that run already, by the policies' names.
    served: BTreeMap<String, Served>,
}

impl Worker {
    /// Builds the cell of `scene` around `specimen`, stepped by one thread.
    ///
    /// # Errors
    /// A scene that cannot be built.
    pub fn new(scene: &Scene, specimen: &Specimen) -> Result<Self> {
        let episode = Episode::new(scene, specimen, 1)?;
        Ok(Self {
            specimen: specimen.clone(),
            episode,
            policies: BTreeMap::new(),
            stop: Arc::default(),
            python: None,
            served: BTreeMap::new(),
        })
    }

    /// The same, which gives up what it does when `flag` becomes true.
    #[must_use]
    pub fn stopped_by(mut self, flag: Arc<AtomicBool>) -> Self {
        self.stop = flag;
        self
    }

    /// The same, whose `python:` policies the interpreter `python` serves, unless `$TROCAR_PYTHON` names another.
    #[must_use]
    pub fn served_by(mut self, python: Option<String>) -> Self {
        self.python = python;
        self
    }

    /// The same, with servers of Python policies that run already, by the policies' names.
    #[must_use]
    pub(super) fn with_served(mut self, served: BTreeMap<String, Served>) -> Self {
        self.served = served;
        self
    }

    /// Makes `policies` ready, so that one that can never act is known before any episode is run.
    ///
    /// # Errors
    /// A Python policy that cannot be loaded; [`trocar_workflow::Error::Interrupted`] when the flag says so.
    pub fn start<'a>(&mut self, policies: impl IntoIterator<Item = &'a PolicySpec>) -> Result<()> {
        policies.into_iter().try_for_each(|spec| self.policy(spec).map(|_| ()))
    }

    /// The policy of `spec`, made when it is first asked for.
    fn policy(&mut self, spec: &PolicySpec) -> Result<(&mut Episode, &mut (dyn Policy + Send))> {
        let made = match self.policies.entry(spec.name.clone()) {
            Entry::Occupied(made) => made.into_mut(),
            Entry::Vacant(place) => place.insert(if spec.is_remote() {
                let stop = Arc::clone(&self.stop);
                let served = self.served.remove(&spec.name);
                Box::new(Remote::new(spec, &self.specimen, &self.episode, stop, self.python.as_deref(), served)?)
            } else {
                policy::named(&spec.source)?
            }),
        };
        Ok((&mut self.episode, made.as_mut()))
    }

    /// Runs `job` and gives the files of its episode. A policy that fails ends its episode, which is a result.
    ///
    /// # Errors
    /// An episode that cannot be begun, a Python policy that cannot be loaded; [`trocar_workflow::Error::Interrupted`] when the flag says so.
    pub fn run(&mut self, job: &Job) -> Result<Files> {
        self.run_until(job, &|| false)
    }

    /// The same, which also gives up between two steps when `given_up` says so.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn run_until(&mut self, job: &Job, given_up: &dyn Fn() -> bool) -> Result<Files> {
        let flag = Arc::clone(&self.stop);
        let stopped = || flag.load(Ordering::Relaxed) || given_up();
        let (episode, policy) = self.policy(&job.policy)?;
        let recording = run(episode, policy, job.seed, &mut |_| !stopped());
        if stopped() {
            // A policy that was waited for ends as one that failed; it did not.
            return Err(Error::Interrupted);
        }
        Files::of(&recording?)
    }
}
