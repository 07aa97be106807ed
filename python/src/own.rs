//! Analyses that are written in Python, in the list of all: sweeps name their numbers like ours.

use crate::arrays::of;
use crate::manifest::Manifest;
use consumers::analysis::{Analysis, Beginning, Meaning, Offer, Outlet, Refusal};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use schemas::frame::Frame;
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

/// The function of each name that begins to look at a run.
static BEGIN: Mutex<BTreeMap<&'static str, Py<PyAny>>> = Mutex::new(BTreeMap::new());

/// The first exception since the last look.
static RAISED: Mutex<Option<PyErr>> = Mutex::new(None);

/// Adds an analysis to the list, or puts it in the place of one of this name. `begin` takes a [`Manifest`] and gives a function
/// from `(frame, step, time_s, u, v, extra)` to a row; `columns` are names and meanings.
#[pyfunction]
pub(crate) fn add_analysis(
    name: String,
    about: String,
    columns: Vec<(String, String)>,
    begin: Py<PyAny>,
) -> PyResult<()> {
    // the list is of things that stay
    let columns = columns.into_iter().map(|(name, meaning)| Meaning::number(name.leak(), meaning.leak()));
    let columns: &[Meaning] = Vec::leak(columns.collect());
    let name: &'static str = name.leak();
    let offer = Offer { name, about: about.leak(), columns, begin: begun, ..Offer::PLAIN };
    analyses::add(Box::leak(Box::new(offer))).map_err(PyValueError::new_err)?;
    BEGIN.lock().unwrap_or_else(PoisonError::into_inner).insert(name, begin);
    Ok(())
}

/// The exception that an analysis raised since the last look.
pub(crate) fn raised() -> Option<PyErr> {
    RAISED.lock().unwrap_or_else(PoisonError::into_inner).take()
}

fn begun(beginning: &Beginning<'_>) -> Result<Box<dyn Analysis>, Refusal> {
    let row = Python::attach(|py| {
        let begin = BEGIN.lock().unwrap_or_else(PoisonError::into_inner);
        let begin = begin.get(beginning.name).map(|begin| begin.clone_ref(py));
        let manifest = Manifest::new(beginning.manifest.clone(), None);
        begin.map(|begin| begin.call1(py, (manifest,))).transpose()
    });
    match row {
        Ok(Some(row)) => Ok(Box::new(Own { row: Some(row) })),
        Ok(None) => Err(format!("{} is no analysis of this process", beginning.name).into()),
        Err(error) => Err(error.to_string().into()),
    }
}

/// An analysis of one run; it ends with the first exception.
struct Own {
    row: Option<Py<PyAny>>,
}

impl Analysis for Own {
    fn observe(&mut self, frame: &Frame<'_>, out: &mut dyn Outlet) {
        let Some(row) = &self.row else { return };
        let called = Python::attach(|py| -> PyResult<Vec<f64>> {
            let arrays = (of(py, frame.u_m)?, of(py, frame.v_m_s)?, of(py, frame.extra)?);
            let state = (frame.frame, frame.step, frame.time_s, arrays.0, arrays.1, arrays.2);
            row.call1(py, state)?.extract(py)
        });
        match called {
            Ok(row) => out.row(frame, &row),
            Err(error) => {
                self.row = None;
                RAISED.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
            }
        }
    }
}
