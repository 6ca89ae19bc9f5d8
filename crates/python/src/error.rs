//! Errors of the simulator as Python's.

use pyo3::PyErr;
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError, PyValueError};

/// An invalid input: a scene, a name, an action, an array.
pub fn wrong(why: impl std::fmt::Display) -> PyErr {
    PyValueError::new_err(why.to_string())
}

/// Cells that a forked child has from its parent.
pub fn forked() -> PyErr {
    PyRuntimeError::new_err("this environment was made in another process, before a fork; make it anew in this one")
}

/// An error of making or reading a specimen or scene.
pub fn evaluate(error: &trocar_workflow::Error) -> PyErr {
    match error {
        trocar_workflow::Error::Interrupted => PyKeyboardInterrupt::new_err(()),
        other => wrong(other),
    }
}

/// An error of an episode.
pub fn task(error: &trocar_task::Error) -> PyErr {
    match error {
        trocar_task::Error::Ended(_) => PyRuntimeError::new_err(error.to_string()),
        other => wrong(other),
    }
}
