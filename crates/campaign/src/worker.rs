//! Runs jobs one after the other in one cell. Policies are made when first needed and reused.

use crate::manifest::Job;
use crate::policy_server::PolicyServer;
use crate::policy_spec::PolicySpec;
use crate::remote::RemotePolicy;
use crate::store::EpisodeFiles;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use trocar_scene::Scene;
use trocar_task::{Episode, Policy, policy, run_watched};
use trocar_workflow::{Error, Result, SpecimenCache, SurfaceWatch};

/// A cell with policies, which runs one job at a time.
pub struct Worker {
    episode: Episode,
    policies: BTreeMap<String, Box<dyn Policy + Send>>,
    stop: Arc<AtomicBool>,
    /// Interpreter of Python policies unless `$TROCAR_PYTHON` names one.
    python: Option<String>,
    /// Running servers of Python policies, by policy name.
    servers: BTreeMap<String, PolicyServer>,
    surfaces: bool,
}

impl Worker {
    /// Builds the cell of `scene`, whose episodes have `specimens`, stepped by one thread. It
    /// stands at the start of the episode of `seed`.
    ///
    /// # Errors
    /// A scene that cannot be built.
    pub fn new(scene: &Scene, specimens: &SpecimenCache, seed: u64) -> Result<Self> {
        let episode = Episode::begun(scene, Box::new(specimens.clone()), 1, seed, scene.draw(seed))?;
        let (policies, servers) = (BTreeMap::new(), BTreeMap::new());
        Ok(Self { episode, policies, stop: Arc::default(), python: None, servers, surfaces: false })
    }

    /// Stops running work when `flag` becomes true.
    #[must_use]
    pub fn with_stop_flag(mut self, flag: Arc<AtomicBool>) -> Self {
        self.stop = flag;
        self
    }

    /// Keeps the surfaces of every control period, see [`trocar_workflow::surfaces`].
    #[must_use]
    pub fn with_surfaces(mut self, keep: bool) -> Self {
        self.surfaces = keep;
        self
    }

    /// Serves `python:` policies by the interpreter `python`, unless `$TROCAR_PYTHON` names
    /// another.
    #[must_use]
    pub fn with_python(mut self, python: Option<String>) -> Self {
        self.python = python;
        self
    }

    /// Uses running servers of Python policies, by policy name.
    #[must_use]
    pub(super) fn with_servers(mut self, servers: BTreeMap<String, PolicyServer>) -> Self {
        self.servers = servers;
        self
    }

    /// Makes `policies` now, in order to report one that cannot act before the first episode.
    ///
    /// # Errors
    /// A Python policy that cannot be loaded; [`Error::Interrupted`] if the stop flag is set.
    pub fn prepare<'a>(&mut self, policies: impl IntoIterator<Item = &'a PolicySpec>) -> Result<()> {
        policies.into_iter().try_for_each(|spec| self.policy(spec).map(|_| ()))
    }

    /// The policy of `spec`; the first call makes it.
    fn policy(&mut self, spec: &PolicySpec) -> Result<(&mut Episode, &mut (dyn Policy + Send))> {
        let made = match self.policies.entry(spec.name.clone()) {
            Entry::Occupied(made) => made.into_mut(),
            Entry::Vacant(place) => place.insert(if spec.is_remote() {
                let stop = Arc::clone(&self.stop);
                let server = self.servers.remove(&spec.name);
                Box::new(RemotePolicy::new(spec, &self.episode, stop, self.python.as_deref(), server)?)
            } else {
                policy::named(&spec.source)?
            }),
        };
        Ok((&mut self.episode, made.as_mut()))
    }

    /// Runs `job` and returns the files of its episode. A policy that fails ends its episode, which
    /// is a result and not an error.
    ///
    /// # Errors
    /// An episode that cannot begin, a Python policy that cannot be loaded;
    /// [`Error::Interrupted`] if the stop flag is set.
    pub fn run(&mut self, job: &Job) -> Result<EpisodeFiles> {
        self.run_until(job, &|| false)
    }

    /// As [`run`](Self::run), and also stops between two steps when `interrupted` returns true.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn run_until(&mut self, job: &Job, interrupted: &dyn Fn() -> bool) -> Result<EpisodeFiles> {
        let flag = Arc::clone(&self.stop);
        let stopped = || flag.load(Ordering::Relaxed) || interrupted();
        let mut surfaces = SurfaceWatch::new(self.surfaces);
        let (episode, policy) = self.policy(&job.policy)?;
        let recording = run_watched(episode, policy, job.seed, &mut |episode, step| {
            surfaces.see(episode, step);
            !stopped()
        });
        if stopped() {
            // The stop flag ends a waiting policy like a failure; it is none.
            return Err(Error::Interrupted);
        }
        EpisodeFiles::of(&recording?, surfaces.finish()?)
    }
}
