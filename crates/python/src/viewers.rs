//! The viewers that cells feed while they step.

use crate::error::wrong;
use pyo3::prelude::*;
use std::sync::{Arc, Mutex, PoisonError};
use trocar_task::Episode;
use trocar_view::Follower;

/// A viewer, which its handle closes and the cells feed.
pub(crate) type Shared = Arc<Mutex<Option<Follower>>>;

/// The viewer, taken out of its place: it ends when it is dropped.
pub(crate) fn taken(viewer: &Shared) -> Option<Follower> {
    viewer.lock().unwrap_or_else(PoisonError::into_inner).take()
}

/// The viewers of cells.
#[derive(Default)]
pub struct Viewers(Vec<(usize, Shared)>);

impl Viewers {
    /// Adds a viewer of cell `k`.
    pub(crate) fn add(&mut self, k: usize, viewer: Shared) {
        self.0.push((k, viewer));
    }

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
        // The cells no longer exist: there is nothing to show.
        self.0.iter().for_each(|(_, viewer)| drop(taken(viewer)));
    }
}
