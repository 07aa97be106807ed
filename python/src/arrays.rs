//! Arrays of our own, which other libraries take without a copy.

use numpy::{PyArray1, PyArrayMethods as _};
use pyo3::prelude::*;
use pyo3::types::PySlice;
use schemas::frame::Frame;

/// The alignment (bytes) of arrays: JAX copies those that begin elsewhere.
const ALIGNMENT_BYTES: usize = 64;

const DOUBLE_BYTES: usize = size_of::<f64>();

/// An array of `len` zeros that begins at a multiple of 64 bytes.
pub(crate) fn zeros(py: Python<'_>, len: usize) -> PyResult<Bound<'_, PyArray1<f64>>> {
    let all = PyArray1::<f64>::zeros(py, len + ALIGNMENT_BYTES / DOUBLE_BYTES - 1, false);
    let beyond_bytes = all.data().addr() % ALIGNMENT_BYTES;
    let begin = (ALIGNMENT_BYTES - beyond_bytes) % ALIGNMENT_BYTES / DOUBLE_BYTES;
    let part = PySlice::new(py, begin.cast_signed(), (begin + len).cast_signed(), 1);
    Ok(all.get_item(part)?.cast_into::<PyArray1<f64>>()?)
}

/// A copy of `values` that begins at a multiple of 64 bytes.
pub(crate) fn of<'py>(py: Python<'py>, values: &[f64]) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let array = zeros(py, values.len())?;
    array.try_readwrite()?.as_slice_mut()?.copy_from_slice(values);
    Ok(array)
}

type Array<'py> = Bound<'py, PyArray1<f64>>;

/// Frame, step, time (s), and copies of displacements, velocities and what else there is.
pub(crate) type StateTuple<'py> = (u64, u64, f64, Array<'py>, Array<'py>, Array<'py>);

/// The same of a frame.
pub(crate) fn state_of<'py>(py: Python<'py>, frame: &Frame<'_>) -> PyResult<StateTuple<'py>> {
    let [u, v, extra] = [frame.u_m, frame.v_m_s, frame.extra].map(|part| of(py, part));
    Ok((frame.frame, frame.step, frame.time_s, u?, v?, extra?))
}
