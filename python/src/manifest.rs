//! A run before it runs: its configuration, and what the engine makes of it.

use crate::errors::Why;
use crate::fields::{Parts, energy_j, field_of, of_contacts, parts_of, wall_forces_n};
use numpy::{PyArray1, PyReadonlyArray1, ToPyArray};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use schemas::chain::Chain;
use schemas::config::RunConfig;
use schemas::manifest::RunManifest;
use schemas::presets::PRESETS;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Arguments of [`Manifest::from_json`].
type Arguments<'py> = (Bound<'py, PyBytes>, Option<String>);

/// A validated run.
#[pyclass(frozen, module = "beadline._native", from_py_object)]
#[derive(Clone)]
pub(crate) struct Manifest {
    pub(crate) run: Arc<RunManifest>,
    pub(crate) chain: Arc<Chain>,
    /// As it is written into recordings; none of a recording that has none.
    #[pyo3(get)]
    pub(crate) toml: Option<String>,
}

impl Manifest {
    pub(crate) fn new(run: RunManifest, toml: Option<String>) -> Self {
        Self { chain: Arc::new(run.physics.chain()), run: Arc::new(run), toml }
    }
}

#[pymethods]
impl Manifest {
    /// Reads a configuration; `name` is that of the run if the text has none. What it names is looked for in `folder`, by default
    /// where `path` is.
    #[staticmethod]
    #[pyo3(signature = (text, path=None, name="run", folder=None))]
    fn from_toml(text: String, path: Option<PathBuf>, name: &str, folder: Option<PathBuf>) -> PyResult<Self> {
        let located = |error: schemas::config::ConfigError| Why::from(error.located(&text, path.as_deref()));
        let config = RunConfig::from_toml(&text).map_err(located)?;
        let beside = folder.as_deref().or_else(|| path.as_deref().and_then(Path::parent));
        let config = experiments::prepared(config, beside).map_err(located)?;
        let run = RunManifest::new(&config, name, beadline::origin()).map_err(located)?;
        Ok(Self::new(run, Some(text)))
    }

    /// A manifest as it stands in a recording.
    #[staticmethod]
    fn from_json(json: &[u8], toml: Option<String>) -> PyResult<Self> {
        Ok(Self::new(RunManifest::from_json(json).map_err(Why::from)?, toml))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Arguments<'py>)> {
        let make = py.get_type::<Self>().getattr("from_json")?;
        Ok((make, (PyBytes::new(py, self.run.to_json().as_bytes()), self.toml.clone())))
    }

    /// The values of a field in a state of this run.
    fn field_of<'py>(
        &self,
        py: Python<'py>,
        field: &str,
        u_m: PyReadonlyArray1<'_, f64>,
        v_m_s: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        field_of(py, &self.chain, field, &u_m, &v_m_s)
    }

    /// The parts of a state's `extra`: displacements (m) and velocities (m/s) of resonators and dissipated work (J), a value for each bead
    /// or none; work (J) and displacement (m) of each drive; heat (J) that baths have given, a value for each bead or none.
    fn parts_of<'py>(&self, py: Python<'py>, extra: PyReadonlyArray1<'_, f64>) -> PyResult<Parts<'py>> {
        parts_of(py, &self.chain, self.run.physics.drives.len(), &extra)
    }

    /// Forces (N) of the contacts with the left and the right wall in a state at a time.
    fn wall_forces_n<'py>(
        &self,
        py: Python<'py>,
        time_s: f64,
        u_m: PyReadonlyArray1<'_, f64>,
        v_m_s: PyReadonlyArray1<'_, f64>,
        extra: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        wall_forces_n(py, &self.chain, time_s, [&u_m, &v_m_s, &extra])
    }

    /// Kinetic and potential energy (J) of a state.
    fn energy_j(
        &self,
        u_m: PyReadonlyArray1<'_, f64>,
        v_m_s: PyReadonlyArray1<'_, f64>,
        extra: PyReadonlyArray1<'_, f64>,
    ) -> PyResult<(f64, f64)> {
        energy_j(&self.chain, [&u_m, &v_m_s, &extra])
    }

    /// Wall time (s) that the run takes at least on this machine, found by making some steps; 0 of a short one.
    fn computing_s(&self, py: Python<'_>) -> f64 {
        py.detach(|| beadline::computing_s(&self.run))
    }

    /// Doubles of a state.
    #[getter]
    fn frame_doubles(&self) -> usize {
        self.run.frame_doubles()
    }

    /// Presence of resonators, presence of dissipated work, and number of drives.
    #[getter]
    fn rows(&self) -> (bool, bool, usize) {
        let rows = self.chain.rows;
        (rows.resonators, rows.work, self.run.physics.drives.len())
    }

    /// The same run, under an id of its own, with a state recorded every `steps` steps.
    fn begun(&self, steps: u64) -> PyResult<Self> {
        let mut run = (*self.run).clone();
        run.provenance.run_id = schemas::manifest::RunId::random();
        run.provenance.started_unix_ns = beadline::origin().started_unix_ns;
        let run = run.recorded_every(steps).map_err(Why::from)?;
        Ok(Self { run: Arc::new(run), ..self.clone() })
    }

    /// The manifest as JSON.
    #[getter]
    fn json(&self) -> String {
        self.run.to_json()
    }

    #[getter]
    fn name(&self) -> &str {
        self.run.provenance.name.as_str()
    }

    #[getter]
    fn beads(&self) -> u64 {
        self.run.physics.beads
    }

    #[getter]
    fn step_count(&self) -> u64 {
        self.run.physics.step_count
    }

    #[getter]
    fn dt_s(&self) -> f64 {
        self.run.physics.dt_s
    }

    /// The frame at a step; between two frames, the one before.
    fn frame_at(&self, step: u64) -> u64 {
        self.run.frame_at(step)
    }

    #[getter]
    fn publish_every_steps(&self) -> u64 {
        self.run.provenance.publish_every_steps
    }

    #[getter]
    fn record_every_steps(&self) -> u64 {
        self.run.provenance.record_every_steps
    }

    /// Collision length L (m) and time T (s).
    #[getter]
    fn scales(&self) -> (f64, f64) {
        let scales = self.run.physics.scales();
        (scales.length_m, scales.time_s)
    }

    #[getter]
    fn absorbing_drag_n_s_per_m(&self) -> f64 {
        self.run.physics.absorbing_drag_n_s_per_m()
    }

    #[getter]
    fn mass_kg<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        self.chain.mass_kg.to_pyarray(py)
    }

    #[getter]
    fn stiffness<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        of_contacts(py, &self.chain, Chain::own_stiffness)
    }

    #[getter]
    fn rest_overlap_m<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        of_contacts(py, &self.chain, Chain::rest_m)
    }

    #[getter]
    fn rest_force_n<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        of_contacts(py, &self.chain, Chain::rest_n)
    }
}

/// Name, summary and configuration of each preset.
#[pyfunction]
pub(crate) fn presets() -> Vec<(&'static str, &'static str, String)> {
    PRESETS.iter().map(|preset| (preset.name, preset.about, preset.config().to_toml())).collect()
}
