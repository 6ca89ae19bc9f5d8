//! Parts of campaigns for Python, which distributes their jobs over machines: the manifest with its
//! store, and workers.
//!
//! Jobs and results are JSON text and bytes, which any transport carries. Manifest, store, table
//! and report are those of `trocar evaluate`.

use crate::error::{evaluate, wrong};
use crate::prepare;
use crate::progress::Signals;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use trocar_campaign::{By, EpisodeFiles, Error, Job, Manifest, PolicySpec, Store};
use trocar_core::Progress;
use trocar_scene::Scene;
use trocar_workflow::{SpecimenCache, drawn_specimens};

/// A campaign's manifest and its folder, which is locked against other processes.
#[pyclass(frozen, module = "trocar._native")]
pub struct Campaign {
    scene: Scene,
    specimens: SpecimenCache,
    manifest: Manifest,
    by: Vec<By>,
    store: Mutex<Store>,
}

impl Campaign {
    fn store(&self) -> PyResult<MutexGuard<'_, Store>> {
        self.store.lock().map_err(|_| wrong("the campaign failed before"))
    }
}

/// A job as JSON text.
fn job(text: &str) -> PyResult<Job> {
    serde_json::from_str(text).map_err(|e| wrong(format!("job: {e}")))
}

/// An episode's files as (name, bytes).
type FileList = Vec<(String, Vec<u8>)>;

#[pymethods]
impl Campaign {
    /// Opens or creates the campaign in the folder `output`.
    #[new]
    #[pyo3(signature = (scene, policies, episodes, seed, phantoms, output, *, split="seen", variation=None, by=Vec::new(), backend=None))]
    fn new(
        py: Python<'_>,
        scene: &str,
        policies: Vec<String>,
        episodes: usize,
        seed: u64,
        phantoms: PathBuf,
        output: PathBuf,
        split: &str,
        variation: Option<&str>,
        by: Vec<String>,
        backend: Option<&str>,
    ) -> PyResult<Self> {
        py.detach(|| {
            let split = prepare::split(split)?;
            let specs: Result<Vec<PolicySpec>, _> = policies.iter().map(|p| PolicySpec::parse(p)).collect();
            let specs = specs.map_err(|e| evaluate(&e))?;
            if Path::new(scene).exists() && output.exists() {
                let (scene, output) = (std::fs::canonicalize(scene), std::fs::canonicalize(&output));
                if scene.is_ok_and(|s| output.is_ok_and(|o| s.starts_with(o))) {
                    return Err(wrong("output: the scene file is in this folder; write into another"));
                }
            }
            let scene = prepare::varied(scene, variation, backend)?;
            let by = By::parse(&by, &scene, split).map_err(|e| evaluate(&e))?;
            let (specimens, named) = prepare::named_specimens(&scene, split, &phantoms)?;
            let manifest = Manifest::new(&scene, &named, &specs, episodes, (split, seed)).map_err(|e| evaluate(&e))?;
            let drawn = drawn_specimens(&scene, manifest.seeds());
            specimens.make_all(&drawn, &Signals::new()).map_err(|e| evaluate(&e))?;
            let store = Mutex::new(Store::open(&output, &manifest).map_err(|e| evaluate(&e))?);
            Ok(Self { scene, specimens, manifest, by, store })
        })
    }

    /// The manifest as JSON text, which workers compare with their own.
    #[getter]
    fn plan(&self) -> PyResult<String> {
        serde_json::to_string(&self.manifest).map_err(wrong)
    }

    /// Jobs without a stored episode, as JSON texts.
    #[pyo3(signature = (retry_failed=false))]
    fn missing(&self, retry_failed: bool) -> PyResult<Vec<String>> {
        let jobs = self.store()?.missing(&self.manifest, retry_failed).map_err(|e| evaluate(&e))?;
        jobs.iter().map(|j| serde_json::to_string(j).map_err(wrong)).collect()
    }

    /// Stores a finished episode.
    #[pyo3(signature = (job, files))]
    fn put(&self, py: Python<'_>, job: &str, files: FileList) -> PyResult<()> {
        let job = self::job(job)?;
        if !self.manifest.jobs().any(|j| j == job) {
            return Err(wrong("job: it is not part of this campaign"));
        }
        py.detach(|| self.store()?.put(&job, &EpisodeFiles(files)).map_err(|e| evaluate(&e)))
    }

    /// Writes table and report, and returns `result.json` as text. `films` renders missing videos
    /// first, which takes long.
    #[pyo3(signature = (films=true))]
    fn finish(&self, py: Python<'_>, films: bool) -> PyResult<String> {
        py.detach(|| {
            let store = self.store()?;
            if films {
                store
                    .write_videos(&self.manifest, &self.scene, &self.specimens, &Signals::new())
                    .map_err(|e| evaluate(&e))?;
            }
            let result = store.write_results(&self.manifest, &self.by).map_err(|e| evaluate(&e))?;
            serde_json::to_string_pretty(&result).map_err(wrong)
        })
    }
}

/// A flag that stops workers. Python delivers signals only to its main thread, and a worker that
/// waits for a policy checks only this flag.
#[pyclass(frozen, module = "trocar._native")]
#[derive(Default)]
pub struct Stop(Arc<AtomicBool>);

#[pymethods]
impl Stop {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// Stops all workers with this flag soon. It cannot be reset.
    fn set(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// A cell that runs one job at a time.
#[pyclass(frozen, module = "trocar._native")]
pub struct Worker {
    worker: Mutex<trocar_campaign::Worker>,
    stop: Arc<AtomicBool>,
}

impl Worker {
    fn worker(&self) -> PyResult<MutexGuard<'_, trocar_campaign::Worker>> {
        self.worker.lock().map_err(|_| wrong("the worker failed before; make a new one"))
    }
}

/// Returns an error if the flag is set.
fn check_stop(stop: &AtomicBool) -> PyResult<()> {
    if stop.load(Ordering::Relaxed) { Err(evaluate(&Error::Interrupted)) } else { Ok(()) }
}

#[pymethods]
impl Worker {
    /// Builds the cell of `scene`, which must be that of the manifest `plan`. `stop` stops its
    /// work. `python` serves `python:` policies, unless `$TROCAR_PYTHON` names another interpreter.
    /// `surfaces` keeps those of every control period.
    #[new]
    #[pyo3(signature = (scene, phantoms, plan, *, stop=None, python=None, surfaces=false))]
    fn new(
        py: Python<'_>,
        scene: &str,
        phantoms: PathBuf,
        plan: &str,
        stop: Option<&Stop>,
        python: Option<String>,
        surfaces: bool,
    ) -> PyResult<Self> {
        let stop = stop.map(|s| Arc::clone(&s.0)).unwrap_or_default();
        let manifest: Manifest = serde_json::from_str(plan).map_err(|e| wrong(format!("plan: {e}")))?;
        py.detach(|| {
            let scene = prepare::varied(scene, Some(manifest.variation.set.name()), Some(manifest.backend.name()))?;
            let (specimens, named) = prepare::named_specimens(&scene, manifest.split, &phantoms)?;
            let first = (manifest.split, manifest.seed);
            let own = Manifest::new(&scene, &named, &manifest.policies, manifest.episodes, first);
            let own = own.map_err(|e| evaluate(&e))?;
            if own != manifest {
                return Err(wrong(
                    "this worker has another scene, specimen or program than the campaign; give all machines the same files",
                ));
            }
            check_stop(&stop)?;
            let worker = trocar_campaign::Worker::new(&scene, &specimens, manifest.first_seed()).map_err(|e| evaluate(&e))?;
            let worker = Mutex::new(worker.with_stop_flag(Arc::clone(&stop)).with_python(python).with_surfaces(surfaces));
            Ok(Self { worker, stop })
        })
    }

    /// Makes the policies of `jobs`. Raises ValueError for a Python policy that cannot be loaded.
    fn start(&self, py: Python<'_>, jobs: Vec<String>) -> PyResult<()> {
        let jobs: Vec<Job> = jobs.iter().map(|j| job(j)).collect::<PyResult<_>>()?;
        py.detach(|| self.worker()?.prepare(jobs.iter().map(|j| &j.policy)).map_err(|e| evaluate(&e)))
    }

    /// Runs a job and returns its episode's files: names and bytes.
    fn run<'py>(&self, py: Python<'py>, job: &str) -> PyResult<Vec<(String, Bound<'py, PyBytes>)>> {
        let job = self::job(job)?;
        let signals = Signals::new();
        let files = py.detach(|| {
            // The flag may have been set while this job waited for the worker.
            check_stop(&self.stop)?;
            self.worker()?.run_until(&job, &|| signals.interrupted()).map_err(|e| evaluate(&e))
        })?;
        Ok(files.0.into_iter().map(|(name, bytes)| (name, PyBytes::new(py, &bytes))).collect())
    }
}
