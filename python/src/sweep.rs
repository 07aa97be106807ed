//! Sweeps: rows of many runs, computed here or in other processes.

use crate::errors::Why;
use crate::own;
use crate::patience::{abandonable, shared};
use consumers::table::{Cell, Kind};
use experiments::pool::NoThread;
use experiments::row::{self, Asked, At, Signals};
use experiments::{ERROR_COLUMN, columns};
use producer::sweep::{ParameterValue, SweepError};
use pyo3::IntoPyObjectExt as _;
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use std::num::NonZero;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

pub(crate) fn add_to(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Sweep>()
}

impl From<SweepError> for Why {
    fn from(error: SweepError) -> Self {
        match error {
            SweepError::Config(error) => error.into(),
            SweepError::Unreadable { path, source } => Self::of_io(&source, &path),
            SweepError::TooMany { .. } => Self::of("ConfigError", &error),
        }
    }
}

impl From<NoThread> for Why {
    fn from(error: NoThread) -> Self {
        Self::of("BeadlineError", &error)
    }
}

/// A value of a row; none where there is none.
enum Value {
    Cell(Cell),
    Parameter(Option<ParameterValue>),
}

impl<'py> IntoPyObject<'py> for Value {
    type Target = PyAny;
    type Output = Bound<'py, PyAny>;
    type Error = PyErr;

    fn into_pyobject(self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        match self {
            Self::Cell(Cell::Empty) | Self::Parameter(None) => Ok(py.None().into_bound(py)),
            Self::Cell(Cell::Integer(value)) | Self::Parameter(Some(ParameterValue::Integer(value))) => {
                value.into_bound_py_any(py)
            }
            Self::Cell(Cell::Double(value)) | Self::Parameter(Some(ParameterValue::Double(value))) => {
                value.into_bound_py_any(py)
            }
            Self::Cell(Cell::Word(word)) | Self::Parameter(Some(ParameterValue::Word(word))) => {
                word.into_bound_py_any(py)
            }
        }
    }
}

/// A sweep file of which every point is a possible run.
#[pyclass(frozen, module = "beadline._native")]
pub(crate) struct Sweep {
    sweep: producer::sweep::Sweep,
}

#[pymethods]
impl Sweep {
    /// Reads a sweep; `path` is where it was read, or would be: what it names is found from there.
    #[staticmethod]
    fn from_toml(py: Python<'_>, text: String, path: PathBuf) -> PyResult<Self> {
        // what checks thousands of points does not stop, and holds nothing
        abandonable(py, move || {
            let read =
                producer::sweep::Sweep::from_toml(&text, &path, schemas::text::read, experiments::HOOKS);
            Ok(Self { sweep: read? })
        })
    }

    #[getter]
    fn point_count(&self) -> u64 {
        self.sweep.point_count()
    }

    /// True if the file asks for recordings.
    #[getter]
    fn record(&self) -> bool {
        self.sweep.record()
    }

    /// Names of the columns of a row, and what their values are: `integer`, `double` or `word`.
    #[getter]
    fn columns(&self) -> Vec<(String, &'static str)> {
        let kind = |kind| match kind {
            Some(Kind::Integer) => "integer",
            Some(Kind::Double) => "double",
            Some(Kind::Word) | None => "word",
        };
        columns(&self.sweep).into_iter().map(|column| (column.name, kind(column.kind))).collect()
    }

    /// The rows of points, in the order of `indices`, computed in `jobs` threads; `on_progress` is called with how many
    /// there are. Whatever raises meanwhile gives all of them up.
    #[pyo3(signature = (indices, *, jobs=None, on_progress=None))]
    fn rows(
        &self,
        py: Python<'_>,
        indices: Vec<u64>,
        jobs: Option<NonZero<usize>>,
        on_progress: Option<Py<PyAny>>,
    ) -> PyResult<Vec<Vec<Value>>> {
        if let Some(index) = indices.iter().find(|index| **index >= self.point_count()) {
            return Err(PyIndexError::new_err(format!("there is no point {index}")));
        }
        let compute = |stop: &Arc<AtomicBool>, batch: &[usize], rows: &mut Vec<(usize, Vec<Cell>)>| {
            let at = At::default();
            let asked = batch.iter().map(|job| {
                let signals = Signals { stop, at: &at };
                Asked { index: indices[*job], recording: None, signals }
            });
            let asked = asked.collect::<Vec<_>>();
            own::raising(stop, || {
                row::compute::<Why>(&self.sweep, &asked, &beadline::origin(), |place, row, _| {
                    rows.push((batch[place], row));
                    Ok(())
                })
            })
        };
        let rows = shared(py, indices.len(), jobs, on_progress.as_ref(), compute)?;
        let values = |(row, index): (Option<Vec<Cell>>, u64)| match row {
            Some(cells) => Ok(cells.into_iter().map(Value::Cell).collect()),
            None => self.of_broken(index),
        };
        rows.into_iter().zip(indices).map(values).collect()
    }
}

impl Sweep {
    /// The row of a point at which this program went wrong.
    fn of_broken(&self, index: u64) -> PyResult<Vec<Value>> {
        let parameters = self.sweep.parameters_of(index).map_err(Why::from)?;
        let mut row: Vec<Value> = parameters.into_iter().map(Value::Parameter).collect();
        let results = columns(&self.sweep).into_iter().skip(row.len());
        row.extend(results.map(|column| {
            let is_error = column.name == ERROR_COLUMN;
            let why = "Beadline went wrong here: that is a bug, please report it";
            Value::Cell(if is_error { Cell::Word(why.to_owned()) } else { Cell::Empty })
        }));
        Ok(row)
    }
}
