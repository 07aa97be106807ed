//! Analyses that are written in Python, in the list of all: sweeps name their numbers like ours.

use crate::arrays::of;
use crate::errors::Why;
use crate::manifest::Manifest;
use consumers::analysis::{Analysis, Beginning, Meaning, Offer, Outlet, Refusal};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use schemas::frame::Frame;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// The function of each name that begins to look at a run.
static BEGIN: Mutex<BTreeMap<&'static str, Py<PyAny>>> = Mutex::new(BTreeMap::new());

thread_local! {
    /// The first exception in the work of this thread, and the flag that stops all of that work.
    static RAISED: RefCell<(Option<PyErr>, Arc<AtomicBool>)> = RefCell::default();
}

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
    // the one before may run Python where it is dropped, which is after the lock
    let _before = BEGIN.lock().unwrap_or_else(PoisonError::into_inner).insert(name, begin);
    Ok(())
}

/// Does `work` in this thread; an exception of an analysis sets `stop`, and is the error.
pub(crate) fn raising(stop: &Arc<AtomicBool>, work: impl FnOnce() -> Result<(), Why>) -> Result<(), Why> {
    RAISED.set((None, Arc::clone(stop)));
    let done = work();
    RAISED.take().0.map_or(done, |error| Err(error.into()))
}

fn begun(beginning: &Beginning<'_>) -> Result<Box<dyn Analysis>, Refusal> {
    let row = Python::attach(|py| {
        // the lock is free again when Python runs: another thread waits for it with the interpreter in its hands
        let found = {
            let all = BEGIN.lock().unwrap_or_else(PoisonError::into_inner);
            all.get(beginning.name).map(|begin| begin.clone_ref(py))
        };
        let manifest = Manifest::new(beginning.manifest.clone(), None);
        found.map(|begin| begin.call1(py, (manifest,))).transpose()
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
                RAISED.with_borrow_mut(|(raised, stop)| {
                    stop.store(true, Ordering::Relaxed);
                    raised.get_or_insert(error);
                });
            }
        }
    }
}
