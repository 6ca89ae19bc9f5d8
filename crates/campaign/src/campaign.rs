//! A campaign on this machine: runs the missing episodes, several at once.

use crate::by::By;
use crate::csv_table::csv_table;
use crate::manifest::{self, Manifest};
use crate::page;
use crate::policy_server::{POLL_INTERVAL, PolicyServer, start_servers};
use crate::policy_spec::PolicySpec;
use crate::remote::check_servers;
use crate::store::{self, Store};
use crate::table::CampaignResult;
use crate::videos;
use crate::worker::Worker;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use trocar_core::{Progress, Silent};
use trocar_scene::{BackendName, Scene, Split, TissueSource, VariationSet};
use trocar_workflow::{Error, Result, SpecimenCache, drawn_specimens, read_varied, refuse_scene_overlap};

/// Maximum number of parallel episodes per core. Each has its own cell in memory.
const JOBS_PER_CORE: usize = 8;
/// This many parallel episodes are allowed on any machine, because waiting for a server needs no
/// core.
const MIN_JOB_LIMIT: usize = 32;

/// The set by which campaigns and environments vary unless the scene or the user names another.
pub const DEFAULT_VARIATION: VariationSet = VariationSet::Standard;

/// A campaign on this machine.
///
/// ```
/// use trocar_campaign::{Campaign, PolicySpec};
/// # use trocar_core::Silent;
/// # let dir = tempfile::tempdir()?;
/// # let file = trocar_testing::tube::reach(dir.path(), "reach.toml", 0.2, &["endoscope"]);
/// # let (file, output, phantoms) = (file.display().to_string(), dir.path().join("campaign"), dir.path().join("phantoms"));
///
/// let campaign = Campaign {
///     scene: file,
///     policies: vec![PolicySpec::parse("scripted")?, PolicySpec::parse("random")?],
///     episodes: 2,
///     split: Default::default(),
///     seed: 0,
///     variation: None,
///     tissue: None,
///     backend: None,
///     cell_mm: None,
///     by: Vec::new(),
///     jobs: 1,
///     retry_failed: false,
///     surfaces: false,
///     phantoms,
/// };
/// let result = campaign.run(&output, &Silent)?;
/// assert_eq!(result.policies.iter().map(|p| p.episodes).sum::<usize>(), 4);
/// assert!(output.join("report.html").is_file());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Campaign {
    /// Scene file or name of a built-in scene.
    pub scene: String,
    /// The policies.
    pub policies: Vec<PolicySpec>,
    /// Number of episodes per policy.
    pub episodes: usize,
    /// Which episodes: seen, unseen or both in turn.
    pub split: Split,
    /// Number of the first episode in the split; the following episodes have the following numbers.
    /// All policies have the same seeds.
    pub seed: u64,
    /// The set of factors that vary between episodes, instead of the scene's. Without one, a scene
    /// that has no set varies by [`DEFAULT_VARIATION`].
    pub variation: Option<VariationSet>,
    /// The source of the organs' support and tissue, instead of the scene's.
    pub tissue: Option<TissueSource>,
    /// The model of the tissue, instead of the scene's backend.
    pub backend: Option<BackendName>,
    /// Edge of the lattice's cells (mm), instead of the scene's; for the lattice only.
    pub cell_mm: Option<f64>,
    /// By what success is shown: factors, groups, drawn numbers; everything that varies if empty.
    pub by: Vec<String>,
    /// Number of parallel episodes; 0 for one per core. Results do not depend on it.
    pub jobs: usize,
    /// Runs episodes again whose policy failed.
    pub retry_failed: bool,
    /// Keep the surfaces of every control period beside each episode.
    pub surfaces: bool,
    /// Folder of made phantoms. The scene's phantom is made there once and reused.
    pub phantoms: PathBuf,
}

impl Campaign {
    /// Runs the missing episodes of the campaign in the folder `output`, then writes its table and
    /// report.
    ///
    /// # Errors
    /// One line that names the file, field or option. Finished episodes stay. An interruption
    /// ([`Error::Stopped`]) loses only running episodes; table and report then show the finished
    /// ones.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<CampaignResult> {
        let (store, manifest, by) = self.run_episodes(output, None, progress)?;
        store.write_results(&manifest, &by)
    }

    /// Runs the missing episodes of the campaign in `output`, at most `max_episodes` in total, and
    /// renders videos of some failures and successes. Returns the campaign's store and manifest,
    /// and what success is shown by.
    ///
    /// # Errors
    /// As [`run`](Self::run).
    pub fn run_episodes(
        &self,
        output: &Path,
        max_episodes: Option<usize>,
        progress: &dyn Progress,
    ) -> Result<(Store, Manifest, Vec<By>)> {
        let mut scene = read_varied(&self.scene, self.variation, DEFAULT_VARIATION)?;
        scene.variation.tissue = self.tissue.unwrap_or(scene.variation.tissue);
        if let Some(backend) = self.backend {
            scene.tissue = scene.tissue.on(backend);
        }
        if self.cell_mm.is_some() {
            scene.tissue.cell_mm = self.cell_mm;
            scene.validate()?;
        }
        refuse_scene_overlap(&self.scene, output)?;
        // Making a specimen takes minutes, so everything that does not need it is checked first.
        manifest::check(&self.policies, self.episodes, self.seed, max_episodes)?;
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let allowed = JOBS_PER_CORE.saturating_mul(cores).max(MIN_JOB_LIMIT);
        if self.jobs > allowed {
            let reason = format!("--jobs {}: it must be at most {allowed} on {cores} cores", self.jobs);
            return Err(Error::Mismatch(reason));
        }
        let by = By::parse(&self.by, &scene, self.split)?;
        let first = (self.split, self.seed);
        store::check_compatible(output, &self.policies, first, &scene.variation)?;
        // Policies are loaded before anything is built or written.
        let missing = |p: &&PolicySpec| self.retry_failed || !store::has_episodes(output, &p.name, self.episodes);
        let policies: Vec<&PolicySpec> = self.policies.iter().filter(missing).collect();
        check_servers(&policies, progress)?;
        let servers = start_servers(&policies, progress)?;
        let specimens = SpecimenCache::new(&scene, &self.phantoms);
        let named = manifest::named_specimen(&scene, self.split);
        specimens.make_all(std::slice::from_ref(&named), progress)?;
        let specimen = specimens.read(&named, &Silent)?;
        let mut manifest = Manifest::new(&scene, &specimen, &self.policies, self.episodes, first)?;
        manifest.max_episodes = max_episodes;
        specimens.make_all(&drawn_specimens(&scene, manifest.seeds()), progress)?;
        let store = Store::open(output, &manifest)?;
        let workers = if self.jobs == 0 { cores } else { self.jobs };
        let done = self
            .run_missing(&scene, &specimens, &manifest, &store, workers, servers, progress)
            .and_then(|()| store.write_videos(&manifest, &scene, &specimens, progress));
        match done {
            Ok(()) => Ok((store, manifest, by)),
            Err(Error::Interrupted) => {
                progress.end();
                let kept = store.write_results(&manifest, &by)?.episodes;
                Err(Error::Stopped { kept, planned: manifest.count() })
            }
            Err(why) => Err(why),
        }
    }

    /// Runs the episodes that are not stored yet, `workers` in parallel.
    #[allow(clippy::too_many_arguments, reason = "the parts of one campaign")]
    fn run_missing(
        &self,
        scene: &Scene,
        specimens: &SpecimenCache,
        manifest: &Manifest,
        store: &Store,
        workers: usize,
        servers: BTreeMap<String, PolicyServer>,
        progress: &dyn Progress,
    ) -> Result<()> {
        let missing = store.missing(manifest, self.retry_failed)?;
        let workers = workers.min(missing.len());
        progress.begin("episodes", missing.len() as u64);
        let (next, stop) = (AtomicUsize::new(0), Arc::new(AtomicBool::new(false)));
        let running = AtomicUsize::new(workers);
        let first_error: Mutex<Option<Error>> = Mutex::new(None);
        let servers = Mutex::new(servers);
        let work = |first: bool| -> Result<()> {
            let worker = Worker::new(scene, specimens, manifest.first_seed())?;
            let mut worker = worker.with_stop_flag(Arc::clone(&stop)).with_surfaces(self.surfaces);
            if first {
                let servers = servers.lock().map(|mut s| std::mem::take(&mut *s)).unwrap_or_default();
                worker = worker.with_servers(servers);
                // Policies that fail to load must stop the campaign before its first episode.
                worker.prepare(missing.iter().map(|job| &job.policy))?;
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
                let (work, running, stop, first_error) = (&work, &running, &stop, &first_error);
                scope.spawn(move || {
                    let _guard = RunningGuard(running);
                    if let Err(why) = work(k == 0) {
                        // Errors of other workers follow from this one, so it is stored before the
                        // stop flag is set.
                        if let Ok(mut first) = first_error.lock() {
                            first.get_or_insert(why);
                        }
                        stop.store(true, Ordering::SeqCst);
                    }
                });
            }
            // A worker that waits for a server checks only the flag.
            while running.load(Ordering::Relaxed) > 0 {
                if progress.interrupted() {
                    stop.store(true, Ordering::SeqCst);
                }
                std::thread::sleep(POLL_INTERVAL);
            }
        });
        if let Some(why) = first_error.into_inner().ok().flatten() {
            return Err(why);
        }
        progress.end();
        Ok(())
    }
}

/// Counts a worker as ended when it is dropped, also by a panic.
struct RunningGuard<'a>(&'a AtomicUsize);

impl Drop for RunningGuard<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

impl Store {
    /// Renders videos of the first failures and successes that have none yet, for the report.
    ///
    /// # Errors
    /// A damaged episode, a video that cannot be written, an interruption.
    pub fn write_videos(
        &self,
        manifest: &Manifest,
        scene: &Scene,
        specimens: &SpecimenCache,
        progress: &dyn Progress,
    ) -> Result<()> {
        videos::write(self, manifest, &self.records(manifest)?, scene, specimens, progress)
    }

    /// Writes table, report and `result.json` of the stored episodes, with success shown `by`.
    ///
    /// # Errors
    /// A damaged episode, by its folder; a file that cannot be written.
    pub fn write_results(&self, manifest: &Manifest, by: &[By]) -> Result<CampaignResult> {
        let records = self.records(manifest)?;
        let result = CampaignResult::of(manifest, by, &records, self.folder());
        // All three are made before the first is written: they must show the same episodes.
        let csv = csv_table(&records)?;
        let page = page::campaign(manifest, &result, &records, self)
            .map_err(|why| self.unreadable_channels(&records).unwrap_or(why))?;
        let text = serde_json::to_vec_pretty(&result).map_err(|e| Error::Format(e.to_string()))?;
        self.write("table.csv", csv.as_bytes())?;
        self.write("report.html", page.as_bytes())?;
        self.write("result.json", &text)?;
        Ok(result)
    }
}
