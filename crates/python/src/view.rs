//! `View`: the live view of a cell that Python steps.

use crate::cells::Cells;
use crate::error::wrong;
use crate::viewers::{Shared, taken};
use pyo3::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};
use trocar_view::Follower;

/// The live view of a cell. It ends with its cells.
#[pyclass(frozen, module = "trocar._native")]
pub struct View {
    viewer: Shared,
    /// The page's address, with the token.
    #[pyo3(get)]
    url: String,
    /// The address of the wire.
    #[pyo3(get)]
    wire: String,
    /// Whether this build has the page.
    #[pyo3(get)]
    page: bool,
}

#[pymethods]
impl View {
    /// Shows cell `k` under `name`, on `port` of this machine (0: a free one).
    #[new]
    #[pyo3(signature = (cells, k, *, name, port=0))]
    fn new(py: Python<'_>, cells: &mut Cells, k: usize, name: &str, port: u16) -> PyResult<Self> {
        cells.at(k)?;
        let episode = &cells.episodes[k];
        let follower = py.detach(|| Follower::start(name, episode, port)).map_err(wrong)?;
        let (url, wire, page) = (follower.address(), follower.wire(), follower.has_page());
        let viewer = Arc::new(Mutex::new(Some(follower)));
        cells.viewers.add(k, Arc::clone(&viewer));
        Ok(Self { viewer, url, wire, page })
    }

    /// Whether it has ended.
    #[getter]
    fn closed(&self) -> bool {
        self.viewer.lock().unwrap_or_else(PoisonError::into_inner).is_none()
    }

    /// Ends it.
    fn close(&self, py: Python<'_>) {
        let viewer = &self.viewer;
        py.detach(|| drop(taken(viewer)));
    }
}
