//! A campaign run on this machine: what is missing, many at once.

use crate::page;
use crate::pictures;
use crate::plan::{self, Plan};
use crate::served::{Served, serve_all};
use crate::source::PolicySpec;
use crate::store::{self, Store};
use crate::table::{self, CampaignResult};
use crate::worker::Worker;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;
use trocar_core::Progress;
use trocar_scene::Scene;
use trocar_specimen::Specimen;
use trocar_workflow::{Error, Result, refuse_overlap, scene_specimen};

/// How often it is looked whether the user asks to stop.
const GLANCE: Duration = Duration::from_millis(50);

/// Most episodes at once for each core; each has a cell of its own. Up to [`LEAST_JOBS`] are always allowed: policies that are waited for need no core.
const JOBS_PER_CORE: usize = 8;
/// See there.
const LEAST_JOBS: usize = 32;

/// What a campaign is to do on this machine.
#[derive(Clone, Debug)]
pub struct Campaign {
    /// Scene file or name of a built-in scene.
    pub scene: String,
    /// The policies.
    pub policies: Vec<PolicySpec>,
    /// Episodes of each.
    pub episodes: usize,
    /// Seed of the first episode; the next have the next. All policies get the same.
    pub seed: u64,
    /// Episodes at once, 0 for as many as the machine has cores. Results do not depend on it.
    pub jobs: usize,
    /// Episodes that ended because their policy failed are done again.
    pub retry_failed: bool,
    /// Folder in which a scene's phantom is recorded and reconstructed; what is there is used again.
    pub phantoms: PathBuf,
}

impl Campaign {
    /// Runs what is missing in the campaign folder `output`, then writes the table and the report there.
    ///
    /// # Errors
    /// One line that names the file, field or option. Finished episodes stay; an interruption ([`Error::Stopped`]) loses only those under way, and leaves table and report of what is kept.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<CampaignResult> {
        let (store, plan) = self.keep(output, None, progress)?;
        store.finish(&plan)
    }

    /// Runs what is missing, no more than `most` episodes in all, and films failures: what is kept, and of what.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn keep(&self, output: &Path, most: Option<usize>, progress: &dyn Progress) -> Result<(Store, Plan)> {
        let scene = Scene::read(&self.scene)?;
        refuse_overlap(Path::new(&self.scene), output)?;
        // What can be said without the specimen is said before one is made, which takes minutes.
        plan::check(&self.policies, self.episodes, self.seed, most)?;
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let allowed = JOBS_PER_CORE.saturating_mul(cores).max(LEAST_JOBS);
        if self.jobs > allowed {
            let reason =
                format!("--jobs {}: at most {allowed} on {cores} cores; each has a cell of its own", self.jobs);
            return Err(Error::Mismatch(reason));
        }
        store::look(output, &self.policies, self.seed)?;
        // A policy that cannot be loaded is reported before anything is built or written.
        let missing = |p: &&PolicySpec| self.retry_failed || !store::has_episodes(output, &p.name, self.episodes);
        let policies: Vec<&PolicySpec> = self.policies.iter().filter(missing).collect();
        let served = serve_all(&policies, progress)?;
        let specimen = scene_specimen(&scene, &self.phantoms, progress)?;
        let plan = Plan::new(&scene, &specimen, &self.policies, self.episodes, self.seed)?;
        let plan = most.map_or(plan.clone(), |most| plan.at_most(most));
        let store = Store::open(output, &plan)?;
        let workers = if self.jobs == 0 { cores } else { self.jobs };
        let done = self
            .run_missing(&scene, &specimen, &plan, &store, workers, served, progress)
            .and_then(|()| store.film(&plan, &scene, &specimen, progress));
        match done {
            Ok(()) => Ok((store, plan)),
            Err(Error::Interrupted) => {
                progress.end();
                let kept = store.finish(&plan)?.episodes;
                Err(Error::Stopped { kept, planned: plan.count() })
            }
            Err(why) => Err(why),
        }
    }

    /// Runs the episodes that are not kept yet, `workers` at once.
    #[allow(clippy::too_many_arguments, reason = "the parts of one campaign")]
    fn run_missing(
        &self,
        scene: &Scene,
        specimen: &Specimen,
        plan: &Plan,
        store: &Store,
        workers: usize,
        served: BTreeMap<String, Served>,
        progress: &dyn Progress,
    ) -> Result<()> {
        let missing = store.missing(plan, self.retry_failed)?;
        let workers = workers.min(missing.len());
        progress.begin("episodes", missing.len() as u64);
        let (next, stop) = (AtomicUsize::new(0), Arc::new(AtomicBool::new(false)));
        let at_work = AtomicUsize::new(workers);
        let first_error: Mutex<Option<Error>> = Mutex::new(None);
        let served = Mutex::new(served);
        let work = |first: bool| -> Result<()> {
            let mut worker = Worker::new(scene, specimen)?.stopped_by(Arc::clone(&stop));
            if first {
                let served = served.lock().map(|mut s| std::mem::take(&mut *s)).unwrap_or_default();
                worker = worker.with_served(served);
                // All policies are made ready at once, not when their first jobs come.
                worker.start(missing.iter().map(|job| &job.policy))?;
            }
            while let Some(job) = missing.get(next.fetch_add(1, Ordering::Relaxed)) {
                let files = worker.run_until(job, &|| progress.interrupted())?;
                store.put(job, &files)?;
                progress.advance(1);
            }
            Ok(())
        };
        std::thread::scope(|scope| {
            for k in 0..workers {
                let (work, at_work, stop, first_error) = (&work, &at_work, &stop, &first_error);
                scope.spawn(move || {
                    let _leaves = Leaves(at_work);
                    if let Err(why) = work(k == 0) {
                        // The first is told; those of the others are its consequence. So it is kept before they hear that they are to stop.
                        if let Ok(mut told) = first_error.lock() {
                            told.get_or_insert(why);
                        }
                        stop.store(true, Ordering::SeqCst);
                    }
                });
            }
            // Whoever waits for a server is told by the flag.
            while at_work.load(Ordering::Relaxed) > 0 {
                if progress.interrupted() {
                    stop.store(true, Ordering::SeqCst);
                }
                std::thread::sleep(GLANCE);
            }
        });
        if let Some(why) = first_error.into_inner().ok().flatten() {
            return Err(why);
        }
        progress.end();
        Ok(())
    }
}

/// Counts a worker less when it goes, however it goes.
struct Leaves<'a>(&'a AtomicUsize);

impl Drop for Leaves<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

impl Store {
    /// Films the first failures that have no moving picture yet, for the report.
    ///
    /// # Errors
    /// A kept episode that is damaged, a picture that cannot be written, an interruption.
    pub fn film(&self, plan: &Plan, scene: &Scene, specimen: &Specimen, progress: &dyn Progress) -> Result<()> {
        pictures::film(self, plan, &self.kept(plan)?, scene, specimen, progress)
    }

    /// Makes the table and the report out of the episodes that are kept.
    ///
    /// # Errors
    /// A kept episode that is damaged, by its name; a file that cannot be written.
    pub fn finish(&self, plan: &Plan) -> Result<CampaignResult> {
        let kept = self.kept(plan)?;
        let result = CampaignResult::of(plan, &kept, self.folder());
        // All three are made before the first is written, so that they are of the same episodes.
        let csv = table::csv(&kept)?;
        let page =
            page::campaign(plan, &result, &kept, self).map_err(|why| self.unreadable_channels(&kept).unwrap_or(why))?;
        let text = serde_json::to_vec_pretty(&result).map_err(|e| Error::Format(e.to_string()))?;
        self.write("table.csv", csv.as_bytes())?;
        self.write("report.html", page.as_bytes())?;
        self.write("result.json", &text)?;
        Ok(result)
    }
}
