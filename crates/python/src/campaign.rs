//! Campaigns in pieces, so that Python may spread their jobs over machines: the plan with its store here, workers anywhere.
//!
//! Jobs and results are JSON text and bytes, which any transport carries. Plan, store, table and report are those of `trocar evaluate`.

use crate::error::{evaluate, wrong};
use crate::prepare;
use crate::progress::Signals;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard};
use trocar_evaluate::{Files, Job, Plan, PolicySpec, Store};
use trocar_progress::Progress;
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

    /// Films failures, makes table and report, and gives `result.json` as text.
    fn finish(&self, py: Python<'_>) -> PyResult<String> {
        py.detach(|| {
            let store = self.store()?;
            store.film(&self.plan, &self.scene, &self.specimen, &Signals::new()).map_err(|e| evaluate(&e))?;
            let result = store.finish(&self.plan).map_err(|e| evaluate(&e))?;
            serde_json::to_string_pretty(&result).map_err(wrong)
        })
    }
}

/// A cell that runs one job after the other.
#[pyclass(frozen, module = "trocar._native")]
pub struct Worker(Mutex<trocar_evaluate::Worker>);

#[pymethods]
impl Worker {
    /// Builds the cell of `scene`; it must be what `plan` is of.
    #[new]
    fn new(py: Python<'_>, scene: &str, phantoms: PathBuf, plan: &str) -> PyResult<Self> {
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
            let worker = trocar_evaluate::Worker::new(&scene, &specimen).map_err(|e| evaluate(&e))?;
            Ok(Self(Mutex::new(worker)))
        })
    }

    /// Runs a job and gives its episode's files: names and bytes.
    fn run<'py>(&self, py: Python<'py>, job: &str) -> PyResult<Vec<(String, Bound<'py, PyBytes>)>> {
        let job = self::job(job)?;
        let signals = Signals::new();
        let files = py.detach(|| {
            let mut worker = self.0.lock().map_err(|_| wrong("the worker failed before; make another"))?;
            worker.run_until(&job, &|| signals.interrupted()).map_err(|e| evaluate(&e))
        })?;
        Ok(files.0.into_iter().map(|(name, bytes)| (name, PyBytes::new(py, &bytes))).collect())
    }
}
