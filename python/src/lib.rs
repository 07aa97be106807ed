//! The native part of the Python package `beadline`: everything that computes, reads or waits. `beadline/*.py` is what
//! users see of it; `beadline/_native.pyi` says what is here.
//!
//! Nothing here holds the interpreter while it computes, reads or waits, and signals are looked at every 50 ms:
//! [`patience`].

mod arrays;
mod errors;
mod fields;
mod live;
mod manifest;
mod own;
mod patience;
mod run;
mod states;
mod sweep;

use pyo3::prelude::*;
use std::ffi::OsString;

/// Does what the command `beadline` does with these arguments, of which the first one is its name, and ends the process.
/// `program` is how such a process is started.
#[pyfunction]
fn command(py: Python<'_>, arguments: Vec<OsString>, program: Vec<OsString>) {
    py.detach(|| std::process::exit(beadline::command(&arguments, Some(program)).into()));
}

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(command, module)?)?;
    module.add_function(wrap_pyfunction!(manifest::presets, module)?)?;
    module.add_function(wrap_pyfunction!(own::add_analysis, module)?)?;
    module.add_function(wrap_pyfunction!(run::record, module)?)?;
    module.add_function(wrap_pyfunction!(run::simulate, module)?)?;
    module.add_function(wrap_pyfunction!(run::simulate_all, module)?)?;
    module.add_class::<manifest::Manifest>()?;
    module.add_class::<run::Simulation>()?;
    module.add_class::<states::States>()?;
    live::add_to(module)?;
    sweep::add_to(module)
}
