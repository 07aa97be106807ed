//! Sweeps.

use pyo3::prelude::*;

pub(crate) fn add_to(_: &Bound<'_, PyModule>) -> PyResult<()> {
    Ok(())
}
