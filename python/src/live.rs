//! Live runs: frames as views into shared memory, and results about them.

mod results;
mod shared;

use crate::arrays::{StateTuple, state_of};
use crate::errors::Why;
use crate::fields::{field_of, of_contacts};
use crate::manifest::Manifest;
use crate::patience::{LOOK, stoppable};
use crate::run::set_writeable;
use bus::{AttachOptions, BORROWED, Bus, Delivery, LiveSource, RunInfo, list_runs};
use numpy::ndarray::ArrayView1;
use numpy::npyffi::NPY_ARRAY_WRITEABLE;
use numpy::{PyArray1, PyArrayMethods as _, PyUntypedArrayMethods as _, ToPyArray as _};
use pyo3::exceptions::{PyAttributeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use results::Results;
use schemas::chain::Chain;
use schemas::frame::{EndReason, Frame as StateFrame, FrameSource as _, HeldFrame, Received};
use schemas::results::{ResultColumns, Topic};
use schemas::run_name::RunName;
use shared::Shared;
use std::process;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, Weak};
use std::time::Duration;

pub(crate) fn add_to(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_class::<Frame>()?;
    module.add_class::<Live>()?;
    module.add_class::<Results>()?;
    module.add_class::<Stop>()?;
    module.add_function(wrap_pyfunction!(attach, module)?)?;
    module.add_function(wrap_pyfunction!(live_runs, module)?)
}

/// Ends waiting from another thread.
#[pyclass(frozen, module = "beadline._native")]
#[derive(Default)]
struct Stop(Arc<AtomicBool>);

#[pymethods]
impl Stop {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    fn set(&self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Constant properties of a run.
struct Run {
    name: RunName,
    manifest: Manifest,
    json: String,
    first_frame: u64,
    mass_kg: Py<PyArray1<f64>>,
}

enum Memory {
    Shared(Arc<Shared>),
    Own(HeldFrame),
}

/// A published state, with all that a ``State`` has. Its arrays are read-only; displacements and velocities are views into shared
/// memory.
#[pyclass(frozen, module = "beadline")]
struct Frame {
    memory: Memory,
    run: Arc<Run>,
    missed: u64,
}

type Array<'py> = Bound<'py, PyArray1<f64>>;

/// The manifest as JSON, and the state.
type Pickled<'py> = (Bound<'py, PyBytes>, StateTuple<'py>);

impl Frame {
    fn state(&self) -> StateFrame<'_> {
        match &self.memory {
            Memory::Shared(shared) => shared.frame,
            Memory::Own(held) => held.frame(),
        }
    }

    /// A read-only array of `values`, which are this frame's.
    fn view<'py>(this: &Bound<'py, Self>, values: &[f64]) -> Array<'py> {
        #[expect(unsafe_code, reason = "arrays without copies")]
        // SAFETY: the memory of a frame neither moves nor changes while the frame lives, and the array owns a reference to
        // the frame. Nobody else has the new array yet, so that its flags can be changed.
        unsafe {
            let array = PyArray1::borrow_from_array(&ArrayView1::from(values), this.clone().into_any());
            (*array.as_array_ptr()).fields.flags &= !NPY_ARRAY_WRITEABLE;
            array
        }
    }

    fn field<'py>(this: &Bound<'py, Self>, name: &str) -> PyResult<Array<'py>> {
        let state = this.get().state();
        let [u_m, v_m_s] = [state.u_m, state.v_m_s].map(|values| Self::view(this, values));
        let chain = &this.get().run.manifest.chain;
        let values = field_of(this.py(), chain, name, &u_m.try_readonly()?, &v_m_s.try_readonly()?)?;
        set_writeable(&values, false);
        Ok(values)
    }
}

#[pymethods]
impl Frame {
    /// Number of the frame.
    #[getter]
    fn frame(&self) -> u64 {
        self.state().frame
    }

    /// Number of the step.
    #[getter]
    fn step(&self) -> u64 {
        self.state().step
    }

    /// Its time (s).
    #[getter]
    fn time_s(&self) -> f64 {
        self.state().time_s
    }

    /// Number of frames right before this one that did not come: 0, except with ``latest``.
    #[getter]
    fn missed(&self) -> u64 {
        self.missed
    }

    /// Displacement of each bead (m), N values.
    #[getter]
    fn displacement_m<'py>(slf: &Bound<'py, Self>) -> Array<'py> {
        Self::view(slf, slf.get().state().u_m)
    }

    /// Velocity of each bead (m/s), N values.
    #[getter]
    fn velocity_m_s<'py>(slf: &Bound<'py, Self>) -> Array<'py> {
        Self::view(slf, slf.get().state().v_m_s)
    }

    /// Further values that the method carries.
    #[getter]
    fn extra<'py>(slf: &Bound<'py, Self>) -> Array<'py> {
        Self::view(slf, slf.get().state().extra)
    }

    /// Overlap of each contact (m), computed now; below 0 it is open.
    #[getter]
    fn overlap_m<'py>(slf: &Bound<'py, Self>) -> PyResult<Array<'py>> {
        Self::field(slf, "overlap")
    }

    /// Force of each contact (N), computed now, damping and load included.
    #[getter]
    fn force_n<'py>(slf: &Bound<'py, Self>) -> PyResult<Array<'py>> {
        Self::field(slf, "force")
    }

    /// Mass of each bead (kg), N values.
    #[getter]
    fn mass_kg(&self, py: Python<'_>) -> Py<PyArray1<f64>> {
        self.run.mass_kg.clone_ref(py)
    }

    /// Any other attribute of a ``State``, computed now.
    fn __getattr__<'py>(slf: &Bound<'py, Self>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        if name.starts_with('_') {
            return Err(PyAttributeError::new_err(format!("'Frame' object has no attribute '{name}'")));
        }
        let StateFrame { frame, step, time_s, u_m, v_m_s, extra, .. } = slf.get().state();
        let [u_m, v_m_s, extra] = [u_m, v_m_s, extra].map(|values| Self::view(slf, values));
        let state = (frame, step, time_s, u_m, v_m_s, extra);
        let class = slf.py().import("beadline._recording")?.getattr("State")?;
        class.call1((slf.get().run.manifest.clone(), state))?.getattr(name)
    }

    /// The same frame in memory of its own: as many of these as you like can be kept.
    fn copy(&self) -> Self {
        let mut held = HeldFrame::default();
        held.hold(&self.state());
        Self { memory: Memory::Own(held), run: Arc::clone(&self.run), missed: self.missed }
    }

    /// In another process it is a ``State``.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Pickled<'py>)> {
        let make = py.import("beadline._recording")?.getattr("of_frame")?;
        Ok((make, (PyBytes::new(py, self.run.json.as_bytes()), state_of(py, &self.state())?)))
    }

    fn __repr__(&self) -> String {
        let StateFrame { frame, step, time_s, u_m, .. } = self.state();
        format!("<Frame {frame} at step {step}, {time_s:e} s, of {} beads>", u_m.len())
    }
}

/// Frames on their way from the bus.
struct Stream {
    /// The process that is attached; one that was forked from it is not.
    process: u32,
    source: Option<LiveSource>,
    /// Frame that came while somebody only waited for it.
    ahead: Option<Frame>,
    held: Vec<Weak<Shared>>,
    next_frame: u64,
    /// Frames missed since the last one that came.
    missed: u64,
}

impl Stream {
    /// Leaves the run. Frames that are held stay as they are.
    fn leave(&mut self) {
        self.ahead = None;
        let Some(source) = self.source.take() else { return };
        if self.process != process::id() {
            std::mem::forget(source);
            return;
        }
        let sealed = self.held.iter().filter_map(Weak::upgrade).try_for_each(|frame| frame.seal());
        if sealed.is_err() {
            // no memory: better hold the run back until it drops us than let frames change
            std::mem::forget(source);
        }
    }
}

impl Drop for Stream {
    fn drop(&mut self) {
        self.leave();
    }
}

/// A live run that this process is attached to: iterating gives its frames as they come, until it ends.
///
/// Every frame from ``first_frame`` on comes, and the run waits where the loop is slower; with ``latest`` it never waits, and what
/// is missed is counted. A loop that ends without an error has seen all frames, and ``end`` is "complete" or "interrupted" (or
/// "stopped" after ``close``). Otherwise ``LostError`` is raised: the run failed, was killed, or has dropped this consumer.
///
/// Two frames can be held at a time, the one that comes included; keep ``frame.copy()``, or copies of arrays.
#[pyclass(frozen, module = "beadline")]
struct Live {
    run: Arc<Run>,
    stop: Arc<AtomicBool>,
    stream: Mutex<Stream>,
    missed: AtomicU64,
    end: OnceLock<EndReason>,
}

impl Live {
    fn stream(&self) -> MutexGuard<'_, Stream> {
        self.stream.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The next frame; none if none came within `patience`, or the run is over.
    fn receive(&self, stream: &mut Stream, patience: Duration) -> Result<Option<Frame>, Why> {
        if let Some(frame) = stream.ahead.take() {
            return Ok(Some(frame));
        }
        if stream.process != process::id() {
            let what = format!(
                "this process was forked from the one that is attached to run {}: attach again",
                self.run.name
            );
            return Err(Why::new("LiveError", what));
        }
        let Stream { source: Some(source), held, next_frame, missed, .. } = stream else {
            return self.over(stream);
        };
        held.retain(|frame| frame.strong_count() > 0);
        if held.len() >= BORROWED {
            let what = format!(
                "{BORROWED} frames of run {} are held, and no more can be; keep copies: frame.velocity_m_s.copy(), or \
                 frame.copy()",
                self.run.name
            );
            return Err(Why::new("LiveError", what));
        }
        let reason = loop {
            match source.receive_soon(patience)? {
                None => return Ok(None),
                Some(Received::Missed { from, to }) => {
                    *missed += to - from + 1;
                    self.missed.fetch_add(to - from + 1, Ordering::Relaxed);
                }
                Some(Received::Frame(frame)) => {
                    *next_frame = frame.frame + 1;
                    let Some(state) = source.hold() else { return Ok(None) };
                    let shared = Arc::new(Shared::new(state));
                    held.push(Arc::downgrade(&shared));
                    return Ok(Some(Frame {
                        memory: Memory::Shared(shared),
                        run: Arc::clone(&self.run),
                        missed: std::mem::take(missed),
                    }));
                }
                Some(Received::End(reason)) => break reason,
            }
        };
        self.leave(stream, reason);
        self.over(stream)
    }

    fn leave(&self, stream: &mut Stream, reason: EndReason) {
        stream.leave();
        self.end.get_or_init(|| reason);
    }

    fn over(&self, stream: &Stream) -> Result<Option<Frame>, Why> {
        match self.end.get() {
            Some(EndReason::Complete | EndReason::Interrupted | EndReason::Stopped) | None => Ok(None),
            Some(reason) => {
                let (name, missed) = (&self.run.name, self.missed.load(Ordering::Relaxed));
                let what =
                    format!("run {name}: {reason} at frame {}, {missed} frames missed", stream.next_frame);
                Err(Why::new("LostError", what).at_frame(stream.next_frame))
            }
        }
    }
}

#[pymethods]
impl Live {
    /// Name of the run.
    #[getter]
    fn name(&self) -> &str {
        self.run.name.as_str()
    }

    /// The manifest of the run.
    #[getter]
    fn manifest<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        py.import("json")?.call_method1("loads", (&self.run.json,))
    }

    /// The first frame that is guaranteed to come.
    #[getter]
    fn first_frame(&self) -> u64 {
        self.run.first_frame
    }

    /// Number of frames that did not come.
    #[getter]
    fn missed(&self) -> u64 {
        self.missed.load(Ordering::Relaxed)
    }

    /// Kind of its end, ``None`` while it goes.
    #[getter]
    fn end(&self) -> Option<&'static str> {
        self.end.get().map(|reason| reason.as_str())
    }

    /// Number of published frames that have not been taken.
    #[getter]
    fn behind(&self, py: Python<'_>) -> u64 {
        py.detach(|| self.stream().source.as_ref().map_or(0, LiveSource::behind))
    }

    /// Mass of each bead (kg), N values.
    #[getter]
    fn mass_kg(&self, py: Python<'_>) -> Py<PyArray1<f64>> {
        self.run.mass_kg.clone_ref(py)
    }

    /// Stiffness of each contact (N·m^−α).
    #[getter]
    fn stiffness<'py>(&self, py: Python<'py>) -> Array<'py> {
        of_contacts(py, &self.run.manifest.chain, Chain::own_stiffness)
    }

    /// Overlap of each contact at rest (m).
    #[getter]
    fn rest_overlap_m<'py>(&self, py: Python<'py>) -> Array<'py> {
        of_contacts(py, &self.run.manifest.chain, Chain::rest_m)
    }

    /// The next frame, if it is there.
    fn take(&self, py: Python<'_>) -> PyResult<Option<Frame>> {
        if let Ok(mut stream) = self.stream.try_lock() {
            // takes some microseconds: others would need longer to get the interpreter and give it back
            return Ok(self.receive(&mut stream, Duration::ZERO)?);
        }
        Ok(py.detach(|| self.receive(&mut self.stream(), Duration::ZERO))?)
    }

    /// Waits for the next frame, at most 50 ms.
    fn wait(&self, py: Python<'_>) -> PyResult<()> {
        py.detach(|| -> Result<(), Why> {
            let mut stream = self.stream();
            stream.ahead = self.receive(&mut stream, LOOK)?;
            Ok(())
        })?;
        Ok(())
    }

    fn __iter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<Frame>> {
        let mut found = self.take(py)?;
        while found.is_none() && self.end.get().is_none() {
            self.wait(py)?;
            py.check_signals()?;
            found = self.take(py)?;
        }
        Ok(found)
    }

    /// Leaves the run. A loop in another thread ends. Frames that are held stay as they are.
    fn close(&self, py: Python<'_>) {
        self.stop.store(true, Ordering::Relaxed);
        py.detach(|| self.leave(&mut self.stream(), EndReason::Stopped));
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(&self, py: Python<'_>, _exception: &Bound<'_, pyo3::types::PyTuple>) {
        self.close(py);
    }

    /// A publisher of results about these frames, as ``own/TOPIC``.
    fn results(&self, py: Python<'_>, topic: &str, columns: Vec<String>, width: usize) -> PyResult<Results> {
        let topic = Topic::own(topic).map_err(PyValueError::new_err)?;
        let columns = ResultColumns { width, names: columns.join(","), tolerance_m: None };
        let publisher = stoppable(py, &self.stop, || {
            let stream = self.stream();
            let over = || Why::new("LiveError", format!("run {} is over", self.run.name));
            Ok(stream.source.as_ref().ok_or_else(over)?.results(topic, &columns)?)
        })?;
        Ok(Results::new(publisher, Arc::clone(&self.stop)))
    }

    fn __repr__(&self) -> String {
        format!("<Live run {}, {}>", self.run.name, self.end().unwrap_or("attached"))
    }
}

/// Attaches to a run, and waits for it.
#[pyfunction]
#[pyo3(signature = (name, latest, timeout_s, label, stop))]
fn attach(
    py: Python<'_>,
    name: Option<&str>,
    latest: bool,
    timeout_s: Option<f64>,
    label: String,
    stop: &Stop,
) -> PyResult<Live> {
    let name: Option<RunName> = name.map(str::parse).transpose().map_err(PyValueError::new_err)?;
    let timeout = timeout_s.map(Duration::try_from_secs_f64).transpose();
    let timeout = timeout.map_err(|error| PyValueError::new_err(format!("timeout_s: {error}")))?;
    let delivery = if latest { Delivery::Latest } else { Delivery::Lossless };
    let stop = Arc::clone(&stop.0);
    let options = AttachOptions { label, timeout, stop: Arc::clone(&stop), ..AttachOptions::default() };
    let source = stoppable(py, &stop, || {
        Ok(LiveSource::attach(&Bus::from_env()?, name.as_ref(), delivery, &options)?)
    })?;
    let mass_kg = source.chain().mass_kg.to_pyarray(py);
    set_writeable(&mass_kg, false);
    let (first_frame, manifest) = (source.first_frame(), source.manifest());
    let run = Run {
        name: manifest.provenance.name.clone(),
        manifest: Manifest::new(manifest.clone(), None),
        json: manifest.to_json(),
        first_frame,
        mass_kg: mass_kg.unbind(),
    };
    let stream = Stream {
        process: process::id(),
        source: Some(source),
        ahead: None,
        held: Vec::new(),
        next_frame: first_frame,
        missed: 0,
    };
    Ok(Live {
        run: Arc::new(run),
        stop,
        stream: Mutex::new(stream),
        missed: AtomicU64::new(0),
        end: OnceLock::new(),
    })
}

/// The runs on the bus.
#[pyfunction]
fn live_runs(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    let runs = py.detach(|| -> Result<_, Why> { Ok(list_runs(&Bus::from_env()?)?) })?;
    runs.iter().map(|run| told(py, run)).collect()
}

fn told<'py>(py: Python<'py>, run: &RunInfo) -> PyResult<Bound<'py, PyDict>> {
    let consumers = run.consumers.iter().map(|consumer| {
        let about = PyDict::new(py);
        about.set_item("label", &consumer.label)?;
        about.set_item("delivery", consumer.delivery.as_str())?;
        about.set_item("pid", consumer.pid)?;
        about.set_item("behind", consumer.lag_frames)?;
        about.set_item("missed", consumer.missed)?;
        Ok(about)
    });
    let about = PyDict::new(py);
    about.set_item("name", run.name.as_str())?;
    about.set_item("run_id", run.run_id.to_string())?;
    about.set_item("state", run.state.as_str())?;
    about.set_item("frame", run.frame)?;
    about.set_item("step", run.step)?;
    about.set_item("step_count", run.step_count)?;
    about.set_item("time_s", run.time_s)?;
    about.set_item("ends_in_s", run.ends_in.map(|left| left.as_secs_f64()))?;
    about.set_item("pid", run.pid)?;
    about.set_item("consumers", consumers.collect::<PyResult<Vec<_>>>()?)?;
    Ok(about)
}
