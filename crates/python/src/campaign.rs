//! Campaigns in pieces, so that Python may spread their jobs over machines: the plan with its store
//! here, workers anywhere.
//!
//! Jobs and results are JSON text and bytes, which any transport carries. Plan, store, table and
//! report are those of `trocar evaluate`.

use crate::error::{evaluate, wrong};
use crate::prepare;
use crate::progress::Signals;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard};
use trocar_campaign::{Error, Files, Job, Plan, PolicySpec, Store};
use trocar_core::Progress;
use trocar_scene::Scene;
use trocar_specimen::Specimen;

/// A campaign's plan and its folder, which no other process writes meanwhile.
#[pyclass(frozen, module = "trocar._native")]
pub struct Campaign {
    scene: Scene,
    specimen: Specimen,
    plan: Plan,
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

/// An episode's files as they cross: (name, bytes).
type Crossing = Vec<(String, Vec<u8>)>;

#[pymethods]
impl Campaign {
    /// Begins the campaign in the folder `output`, or goes on with it.
    #[new]
    fn new(
        py: Python<'_>,
        scene: &str,
        policies: Vec<String>,
        episodes: usize,
        seed: u64,
        phantoms: PathBuf,
        output: PathBuf,
    ) -> PyResult<Self> {
        py.detach(|| {
            let specs: Result<Vec<PolicySpec>, _> = policies.iter().map(|p| PolicySpec::parse(p)).collect();
            let specs = specs.map_err(|e| evaluate(&e))?;
            if Path::new(scene).exists() && output.exists() {
                let (scene, output) = (std::fs::canonicalize(scene), std::fs::canonicalize(&output));
                if scene.is_ok_and(|s| output.is_ok_and(|o| s.starts_with(o))) {
                    return Err(wrong("output: the scene file is in this folder; write into another"));
                }
            }
            let scene = prepare::scene(scene, None, None)?;
            let specimen = prepare::specimen(&scene, &phantoms)?;
            let plan = Plan::new(&scene, &specimen, &specs, episodes, seed).map_err(|e| evaluate(&e))?;
            let store = Mutex::new(Store::open(&output, &plan).map_err(|e| evaluate(&e))?);
            Ok(Self { scene, specimen, plan, store })
        })
    }

    /// The plan as JSON text, which workers compare with what they have.
    #[getter]
    fn plan(&self) -> PyResult<String> {
        serde_json::to_string(&self.plan).map_err(wrong)
    }

    /// Jobs that are not done, as JSON texts.
    #[pyo3(signature = (retry_failed=false))]
    fn missing(&self, retry_failed: bool) -> PyResult<Vec<String>> {
        let jobs = self.store()?.missing(&self.plan, retry_failed).map_err(|e| evaluate(&e))?;
        jobs.iter().map(|j| serde_json::to_string(j).map_err(wrong)).collect()
    }

    /// Keeps a finished episode.
    #[pyo3(signature = (job, files))]
    fn put(&self, py: Python<'_>, job: &str, files: Crossing) -> PyResult<()> {
        let job = self::job(job)?;
        if !self.plan.jobs().any(|j| j == job) {
            return Err(wrong("job: is none of this campaign"));
        }
        py.detach(|| self.store()?.put(&job, &Files(files)).map_err(|e| evaluate(&e)))
    }

    /// Films failures unless that takes too long now, makes table and report, and gives
    /// `result.json` as text.
    #[pyo3(signature = (films=true))]
    fn finish(&self, py: Python<'_>, films: bool) -> PyResult<String> {
        py.detach(|| {
            let store = self.store()?;
            if films {
                store.film(&self.plan, &self.scene, &self.specimen, &Signals::new()).map_err(|e| evaluate(&e))?;
            }
            let result = store.finish(&self.plan).map_err(|e| evaluate(&e))?;
            serde_json::to_string_pretty(&result).map_err(wrong)
        })
    }
}

/// What tells workers to give up: Python shows its signals to its main thread alone, and a worker
/// that waits for a policy looks at nothing else.
#[pyclass(frozen, module = "trocar._native")]
#[derive(Default)]
pub struct Stop(Arc<AtomicBool>);

#[pymethods]
impl Stop {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    /// Ends within moments whatever workers with this do or wait for; it cannot be taken back.
    fn set(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// A cell that runs one job after the other.
#[pyclass(frozen, module = "trocar._native")]
pub struct Worker {
    worker: Mutex<trocar_campaign::Worker>,
    stop: Arc<AtomicBool>,
}

impl Worker {
    fn worker(&self) -> PyResult<MutexGuard<'_, trocar_campaign::Worker>> {
        self.worker.lock().map_err(|_| wrong("the worker failed before; make another"))
    }
}

/// Gives up what has been asked to stop.
fn go_on(stop: &AtomicBool) -> PyResult<()> {
    if stop.load(Ordering::Relaxed) { Err(evaluate(&Error::Interrupted)) } else { Ok(()) }
}

#[pymethods]
impl Worker {
    /// Builds the cell of `scene`; it must be what `plan` is of. `stop` ends what it does; `python`
    /// serves `python:` policies, unless `$TROCAR_PYTHON` names another interpreter.
    #[new]
    #[pyo3(signature = (scene, phantoms, plan, *, stop=None, python=None))]
    fn new(
        py: Python<'_>,
        scene: &str,
        phantoms: PathBuf,
        plan: &str,
        stop: Option<&Stop>,
        python: Option<String>,
    ) -> PyResult<Self> {
        let stop = stop.map(|s| Arc::clone(&s.0)).unwrap_or_default();
        let plan: Plan = serde_json::from_str(plan).map_err(|e| wrong(format!("plan: {e}")))?;
        py.detach(|| {
            let scene = prepare::scene(scene, None, None)?;
            let specimen = prepare::specimen(&scene, &phantoms)?;
            let own = Plan::new(&scene, &specimen, &plan.policies, plan.episodes, plan.seed).map_err(|e| evaluate(&e))?;
            if own != plan {
                return Err(wrong(
                    "this worker has another scene, specimen or program than the campaign; give all machines the same files",
                ));
            }
            go_on(&stop)?;
            let worker = trocar_campaign::Worker::new(&scene, &specimen).map_err(|e| evaluate(&e))?;
            let worker = Mutex::new(worker.stopped_by(Arc::clone(&stop)).served_by(python));
            Ok(Self { worker, stop })
        })
    }

    /// Makes the policies of `jobs` ready; ValueError for a Python policy that cannot be loaded.
    fn start(&self, py: Python<'_>, jobs: Vec<String>) -> PyResult<()> {
        let jobs: Vec<Job> = jobs.iter().map(|j| job(j)).collect::<PyResult<_>>()?;
        py.detach(|| self.worker()?.start(jobs.iter().map(|j| &j.policy)).map_err(|e| evaluate(&e)))
    }

    /// Runs a job and gives its episode's files: names and bytes.
    fn run<'py>(&self, py: Python<'py>, job: &str) -> PyResult<Vec<(String, Bound<'py, PyBytes>)>> {
        let job = self::job(job)?;
        let signals = Signals::new();
        let files = py.detach(|| {
            // A job may have waited for its turn.
            go_on(&self.stop)?;
            self.worker()?.run_until(&job, &|| signals.interrupted()).map_err(|e| evaluate(&e))
        })?;
        Ok(files.0.into_iter().map(|(name, bytes)| (name, PyBytes::new(py, &bytes))).collect())
    }
}
