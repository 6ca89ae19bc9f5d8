//! The native module of the Python package `trocar`: many cells in one process, stepped in parallel
//! without the interpreter's lock.
//!
//! It knows no Gymnasium and no dataset; `python/trocar` makes environments of it. Arrays are the
//! caller's and are written in place.

#![allow(clippy::needless_pass_by_value, reason = "what Python hands over arrives by value")]
#![allow(clippy::too_many_arguments, reason = "Python's arguments have names")]

mod campaign;
mod cells;
mod error;
mod frames;
mod pictures;
mod policy;
mod prepare;
mod progress;
mod recorded;
mod view;
mod viewers;

use pyo3::prelude::*;

/// The module.
#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_class::<cells::Cells>()?;
    module.add_class::<cells::State>()?;
    module.add_class::<policy::Controller>()?;
    module.add_class::<campaign::Campaign>()?;
    module.add_class::<campaign::Stop>()?;
    module.add_class::<campaign::Worker>()?;
    module.add_class::<recorded::Recorded>()?;
    module.add_class::<view::View>()?;
    module.add_function(wrap_pyfunction!(pictures::cameras, module)?)?;
    module.add_function(wrap_pyfunction!(policy::policies, module)?)?;
    module.add_function(wrap_pyfunction!(prepare::scenes, module)?)?;
    module.add_function(wrap_pyfunction!(prepare::phantoms_folder, module)?)?;
    module.add_function(wrap_pyfunction!(prepare::missing_specimens, module)?)?;
    Ok(())
}
