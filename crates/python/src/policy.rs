//! The program's own controllers, acting on a cell of a Python environment.

use crate::cells::Cells;
use crate::error::{task, wrong};
use numpy::PyArray1;
use pyo3::prelude::*;
use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard};
use trocar_cell::{Action, ActionSpace};
use trocar_task::policy::{POLICIES, named};

/// A controller and the rest of its chunk.
struct Inner {
    policy: Box<dyn trocar_task::Policy + Send>,
    chunk: VecDeque<Action>,
}

/// A controller of the program by its name.
#[pyclass(frozen, module = "trocar._native")]
pub struct Controller(Mutex<Inner>);

/// Names of the controllers.
#[pyfunction]
pub fn policies() -> Vec<&'static str> {
    POLICIES.to_vec()
}

impl Controller {
    fn inner(&self) -> PyResult<MutexGuard<'_, Inner>> {
        self.0.lock().map_err(|_| wrong("the policy failed before; make another"))
    }
}

#[pymethods]
impl Controller {
    #[new]
    fn new(name: &str) -> PyResult<Self> {
        let policy = named(name).map_err(|e| task(&e))?;
        Ok(Self(Mutex::new(Inner { policy, chunk: VecDeque::new() })))
    }

    /// Forgets the episode before: cell `k` has just been reset.
    fn begin(&self, cells: &Cells, k: usize) -> PyResult<()> {
        let mut inner = self.inner()?;
        inner.chunk.clear();
        let episode = cells.at(k)?;
        inner.policy.begin(episode, episode.seed()).map_err(|e| task(&e))
    }

    /// The next action in cell `k`: absolute targets, five numbers an arm.
    fn act<'py>(&self, py: Python<'py>, cells: &Cells, k: usize) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let mut inner = self.inner()?;
        let episode = cells.at(k)?;
        if inner.chunk.is_empty() {
            inner.chunk = inner.policy.act(episode).map_err(|e| task(&e))?.into();
        }
        let action = inner.chunk.pop_front().ok_or_else(|| wrong("the policy gave no action"))?;
        if action.space != ActionSpace::Pivots {
            return Err(wrong("the policy gave steps of the tip; absolute targets are needed"));
        }
        Ok(PyArray1::from_vec(py, action.numbers))
    }
}
