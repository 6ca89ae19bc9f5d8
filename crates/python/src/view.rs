//! `View`: the live view of a cell that Python steps.

use crate::cells::Cells;
use crate::error::wrong;
use pyo3::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};
use trocar_task::Episode;
use trocar_view::Follower;

/// A viewer, which its handle closes and the cells feed.
type Shared = Arc<Mutex<Option<Follower>>>;

fn taken(viewer: &Shared) -> Option<Follower> {
    viewer.lock().unwrap_or_else(PoisonError::into_inner).take()
}

/// The viewers of cells.
#[derive(Default)]
pub struct Viewers(Vec<(usize, Shared)>);

impl Viewers {
    /// Shows the cells that have `changed`. A cell that cannot be shown ends its viewer with a
    /// warning. The step itself does not fail.
    pub fn see(
        &mut self,
        py: Python<'_>,
        episodes: &[Episode],
        changed: impl Fn(usize) -> Option<bool> + Sync,
    ) -> PyResult<()> {
        if self.0.is_empty() {
            return Ok(());
        }
        let mut ended = Vec::new();
        py.detach(|| {
            self.0.retain(|(k, viewer)| {
                let mut guard = viewer.lock().unwrap_or_else(PoisonError::into_inner);
                let Some(follower) = guard.as_mut() else { return false };
                let Some(fresh) = changed(*k) else { return true };
                let seen = follower.see(&episodes[*k], fresh);
                if let Err(why) = &seen {
                    ended.push(why.to_string());
                    *guard = None;
                }
                seen.is_ok()
            });
        });
        let category = py.get_type::<pyo3::exceptions::PyRuntimeWarning>();
        for why in ended {
            let text = std::ffi::CString::new(format!("the live view has ended: {why}")).map_err(wrong)?;
            PyErr::warn(py, &category, &text, 1)?;
        }
        Ok(())
    }
}

impl Drop for Viewers {
    fn drop(&mut self) {
        // The cells are gone: there is nothing more to show.
        self.0.iter().for_each(|(_, viewer)| drop(taken(viewer)));
    }
}

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
        cells.viewers.0.push((k, Arc::clone(&viewer)));
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
