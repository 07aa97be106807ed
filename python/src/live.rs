//! Live runs: frames as views into shared memory, and results about them.

use crate::errors::{Why, of_panic};
use crate::patience::{LOOK, stoppable};
use crate::run::set_writeable;
use crate::states::field_of;
use bus::{
    AttachOptions, BORROWED, Bus, Delivery, HeldState, LiveSource, ResultPublisher, ResultsError, RunInfo,
    list_runs,
};
use numpy::ndarray::ArrayView1;
use numpy::npyffi::NPY_ARRAY_WRITEABLE;
use numpy::{PyArray1, PyArrayMethods as _, PyUntypedArrayMethods as _, ToPyArray as _};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use rustix::io::Errno;
use rustix::mm::{MapFlags, MprotectFlags, MremapFlags, ProtFlags, mmap_anonymous, mprotect, mremap_fixed};
use schemas::chain::Chain;
use schemas::frame::{EndReason, Frame as StateFrame, FrameSource as _, HeldFrame, Received};
use schemas::results::{ResultColumns, Topic};
use schemas::run_name::RunName;
use std::process;
use std::ptr::{copy_nonoverlapping, null_mut};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, Weak};
use std::thread::{self, JoinHandle};
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

/// What stays the same while a run goes.
struct Run {
    name: RunName,
    json: String,
    chain: Chain,
    first_frame: u64,
    mass_kg: Py<PyArray1<f64>>,
}

/// A frame in shared memory.
struct Shared {
    frame: StateFrame<'static>,
    /// Keeps the memory; needed by nobody but `frame`.
    state: Mutex<Option<HeldState>>,
    /// The process that is attached; one that was forked from it gives nothing back.
    process: u32,
}

impl Drop for Shared {
    fn drop(&mut self) {
        if self.process != process::id() {
            std::mem::forget(self.state.get_mut().unwrap_or_else(PoisonError::into_inner).take());
        }
    }
}

impl Shared {
    fn new(state: HeldState) -> Self {
        #[expect(unsafe_code, reason = "the frame and what it borrows from live together")]
        // SAFETY: the slices lie in shared memory that is mapped for as long as `state` lives, wherever `state` itself
        // moves, and nobody writes to it until the source leaves; `seal` comes before that. They leave this struct only
        // as arrays that own a reference to it.
        let frame = unsafe { std::mem::transmute::<StateFrame<'_>, StateFrame<'static>>(state.frame()) };
        Self { frame, state: Mutex::new(Some(state)), process: process::id() }
    }

    /// Puts a copy of this process's own in the place of the pages under the frame: a producer that goes on without us takes
    /// its memory back, but arrays stay as they are.
    fn seal(&self) -> Result<(), Errno> {
        let page = rustix::param::page_size();
        let parts = [self.frame.u_m, self.frame.v_m_s, self.frame.extra].map(<[f64]>::as_ptr_range);
        let parts = || parts.iter().filter(|part| !part.is_empty());
        let (Some(first), Some(last)) =
            (parts().map(|part| part.start).min(), parts().map(|part| part.end).max())
        else {
            return Ok(());
        };
        let begin = first.cast::<u8>().wrapping_sub(first.addr() % page).cast_mut();
        let bytes = (last.addr() - begin.addr()).next_multiple_of(page);
        #[expect(
            unsafe_code,
            reason = "arrays point to these addresses, so the memory has to change under them"
        )]
        // SAFETY: mappings begin and end at pages, so all these pages belong to the mapping of the frame, which this
        // consumer has alone and only reads. Afterwards each byte of a frame that is held has the value that it had:
        // all frames are sealed before the source leaves. Bytes between frames may be written by the producer
        // meanwhile; nobody reads them. The exchange of the pages is atomic to other threads.
        unsafe {
            let copy =
                mmap_anonymous(null_mut(), bytes, ProtFlags::READ | ProtFlags::WRITE, MapFlags::PRIVATE)?;
            copy_nonoverlapping(begin, copy.cast(), bytes);
            mprotect(copy, bytes, MprotectFlags::READ)?;
            mremap_fixed(copy, bytes, bytes, MremapFlags::MAYMOVE, begin.cast())?;
        }
        Ok(())
    }
}

enum Memory {
    Shared(Arc<Shared>),
    Own(HeldFrame),
}

/// A published state. Its arrays are read-only; displacements and velocities are views into shared memory.
#[pyclass(frozen, module = "beadline")]
struct Frame {
    memory: Memory,
    run: Arc<Run>,
    missed: u64,
}

type Array<'py> = Bound<'py, PyArray1<f64>>;

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
        let values =
            field_of(this.py(), &this.get().run.chain, name, &u_m.try_readonly()?, &v_m_s.try_readonly()?)?;
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

    /// How many frames right before this one did not come: 0, except with ``latest``.
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

    /// What else the method carries.
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

    /// The same frame in memory of its own: as many of these as you like can be kept.
    fn copy(&self) -> Self {
        let mut held = HeldFrame::default();
        held.hold(&self.state());
        Self { memory: Memory::Own(held), run: Arc::clone(&self.run), missed: self.missed }
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
    /// What came while somebody only waited for it.
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

    /// How many frames did not come.
    #[getter]
    fn missed(&self) -> u64 {
        self.missed.load(Ordering::Relaxed)
    }

    /// How it ended, ``None`` while it goes.
    #[getter]
    fn end(&self) -> Option<&'static str> {
        self.end.get().map(|reason| reason.as_str())
    }

    /// How many frames are published that have not been taken.
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
        self.run.chain.stiffness.to_pyarray(py)
    }

    /// Overlap of each contact at rest (m).
    #[getter]
    fn rest_overlap_m<'py>(&self, py: Python<'py>) -> Array<'py> {
        self.run.chain.rest_overlap_m.to_pyarray(py)
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
        json: manifest.to_json(),
        chain: source.chain().clone(),
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

/// Frame, step, time (s), values.
type Row = (u64, u64, f64, Vec<f64>);

/// Publishes rows in a thread of its own: subscribers may hold it back, and signals are to be seen meanwhile.
#[pyclass(frozen, module = "beadline._native")]
struct Results {
    /// None is the end in order; without one, subscribers hear that rows are missing.
    rows: Mutex<Option<SyncSender<Option<Row>>>>,
    worker: Mutex<Option<JoinHandle<Result<(), ResultsError>>>>,
    stop: Arc<AtomicBool>,
}

impl Results {
    /// Rows that may wait to be published.
    const WAITING: usize = 64;
    /// How long a full queue is left alone.
    const PAUSE: Duration = Duration::from_millis(1);

    fn new(mut publisher: ResultPublisher<f64>, stop: Arc<AtomicBool>) -> Self {
        let (rows, waiting) = sync_channel::<Option<Row>>(Self::WAITING);
        let worker = thread::spawn(move || {
            for row in waiting {
                let Some((frame, step, time_s, values)) = row else { return publisher.finish() };
                publisher.publish(frame, step, time_s, &values)?;
            }
            Ok(())
        });
        Self { rows: Mutex::new(Some(rows)), worker: Mutex::new(Some(worker)), stop }
    }

    fn send(&self, py: Python<'_>, mut row: Option<Row>) -> PyResult<()> {
        loop {
            // a look never waits, so that nobody holds the lock for long
            let sent = match &*self.rows.lock().unwrap_or_else(PoisonError::into_inner) {
                Some(rows) => rows.try_send(row),
                None => return Err(Why::new("LiveError", "these results are finished").into()),
            };
            match sent {
                Ok(()) => return Ok(()),
                Err(TrySendError::Full(back)) => row = back,
                Err(TrySendError::Disconnected(_)) => return self.end(py),
            }
            py.detach(|| thread::sleep(Self::PAUSE));
            py.check_signals()?;
        }
    }

    /// Waits for the end of the thread, and says what went wrong there.
    fn end(&self, py: Python<'_>) -> PyResult<()> {
        drop(self.rows.lock().unwrap_or_else(PoisonError::into_inner).take());
        let worker = self.worker.lock().unwrap_or_else(PoisonError::into_inner).take();
        let Some(worker) = worker else { return Ok(()) };
        while !worker.is_finished() {
            py.detach(|| thread::sleep(Self::PAUSE));
            py.check_signals().inspect_err(|_| self.stop.store(true, Ordering::Relaxed))?;
        }
        match worker.join() {
            Ok(done) => Ok(done.map_err(Why::from)?),
            Err(panic) => Err(of_panic(&*panic)),
        }
    }
}

#[pymethods]
impl Results {
    /// Publishes the row of a frame.
    fn publish(&self, py: Python<'_>, frame: &Frame, row: Vec<f64>) -> PyResult<()> {
        let StateFrame { frame, step, time_s, .. } = frame.state();
        self.send(py, Some((frame, step, time_s, row)))
    }

    /// Tells subscribers that no more rows come.
    fn finish(&self, py: Python<'_>) -> PyResult<()> {
        self.send(py, None)?;
        self.end(py)
    }
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
