//! Runs: recorded, kept in memory, or made step by step.

use crate::arrays::{self, StateTuple, state_of};
use crate::errors::Why;
use crate::manifest::Manifest;
use crate::patience::{Looks, detached, shared, stoppable};
use crate::states::States;
use bus::{Bus, PublishError, PublishOptions, StatePublisher, WaitOutcome};
use numpy::{PyArray1, PyArrayMethods as _};
use producer::integrator::Integrator;
use producer::run::{Conductor, Job, RunError, RunOutcome, Together};
use producer::state::ChainState;
use producer::tangents::Neighbours;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use recording::{RecordingWriter, WriteOptions};
use schemas::frame::{EndReason, Frame, FrameSink};
use schemas::manifest::{Physics, RunManifest};
use std::convert::Infallible;
use std::error::Error;
use std::num::NonZero;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Callbacks of Python while a run goes.
struct Listener {
    looks: Looks,
    /// Called with the step that was reached.
    on_progress: Option<Py<PyAny>>,
    /// Called with each frame that is a multiple of a number; ends the run by something true.
    on_frame: Option<(Py<PyAny>, u64)>,
    /// Ends the run.
    stop: Arc<AtomicBool>,
}

impl Listener {
    fn new(on_progress: Option<Py<PyAny>>, on_frame: Option<(Py<PyAny>, u64)>) -> Self {
        Self { looks: Looks::new(), on_progress, on_frame, stop: Arc::default() }
    }

    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    fn go_on(&mut self, step: u64) -> ControlFlow<()> {
        let on_progress = &self.on_progress;
        let go_on = self
            .looks
            .go_on(|py| on_progress.as_ref().map_or(Ok(()), |tell| tell.call1(py, (step,)).map(drop)));
        if go_on && !self.is_stopped() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    }
}

impl<R> Conductor<Publisher, R> for Listener {
    fn after_frame(&mut self, frame: &Frame<'_>, _: &mut Publisher, _: Option<&mut R>) -> ControlFlow<()> {
        if let Some((call, every)) = &self.on_frame
            && frame.frame.is_multiple_of(*every)
            && !self.looks.has_raised()
        {
            let stop = &self.stop;
            self.looks.call(|py| {
                let state = state_of(py, frame)?;
                if call.call1(py, state)?.is_truthy(py)? {
                    stop.store(true, Ordering::Relaxed);
                }
                Ok(())
            });
        }
        self.go_on(frame.step)
    }

    fn hears_every_frame(&self, publisher: &Publisher) -> bool {
        self.on_frame.is_some() || matches!(publisher, Publisher::Bus(_))
    }

    fn between_steps(&mut self, _: &mut Publisher) -> ControlFlow<()> {
        // no step is passed: what is told is whole frames
        let go_on = self.looks.go_on(|_| Ok(())) && !self.is_stopped();
        if go_on { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    }

    fn is_stop(&self, _: &PublishError) -> bool {
        // a publisher that a consumer holds back gives up then
        self.is_stopped()
    }
}

/// Destination of frames that somebody may listen to.
enum Publisher {
    Nobody,
    Bus(Box<StatePublisher>),
}

impl FrameSink for Publisher {
    type Error = PublishError;

    fn accept(&mut self, frame: &Frame<'_>) -> Result<(), PublishError> {
        match self {
            Self::Nobody => Ok(()),
            Self::Bus(publisher) => publisher.accept(frame),
        }
    }
}

impl Publisher {
    /// A publisher, and `wait_for` consumers attached to it; none if something was raised meanwhile.
    fn open(manifest: &Manifest, wait_for: usize, listener: &Listener) -> Result<Option<Self>, Why> {
        let options = PublishOptions { stop: Arc::clone(&listener.stop), ..PublishOptions::default() };
        let mut publisher =
            StatePublisher::create(&Bus::from_env()?, &manifest.run, &manifest.chain, &options)?;
        if wait_for > publisher.max_consumers() {
            let most = publisher.max_consumers();
            return Err(Why::new(
                "LiveError",
                format!("this run can have at most {most} consumers, not {wait_for}"),
            ));
        }
        if wait_for > 0 && publisher.wait_for(wait_for, &listener.stop, None)? != WaitOutcome::Ready {
            publisher.finish(EndReason::Interrupted)?;
            return Ok(None);
        }
        Ok(Some(Self::Bus(Box::new(publisher))))
    }

    fn finish(self, reason: EndReason) -> Result<(), PublishError> {
        match self {
            Self::Nobody => Ok(()),
            Self::Bus(publisher) => publisher.finish(reason).map(drop),
        }
    }
}

/// Simulates a run and records it at `path`. Whatever raises meanwhile ends the run in order: the file is whole and says so.
#[pyfunction]
#[pyo3(signature = (manifest, path, *, force=false, publish=false, wait_for=0, on_progress=None, on_frame=None))]
pub(crate) fn record<'py>(
    py: Python<'py>,
    manifest: &Manifest,
    path: PathBuf,
    force: bool,
    publish: bool,
    wait_for: usize,
    on_progress: Option<Py<PyAny>>,
    on_frame: Option<(Py<PyAny>, u64)>,
) -> PyResult<Bound<'py, PyDict>> {
    let mut listener = Listener::new(on_progress, on_frame);
    let stop = Arc::clone(&listener.stop);
    let work = || -> Result<_, Why> {
        let toml = manifest.toml.as_deref().unwrap_or_default();
        let options = WriteOptions { force, ..WriteOptions::default() };
        let mut recorder = RecordingWriter::create(&path, &manifest.run, toml, &options)?;
        let publisher = if publish {
            Publisher::open(manifest, wait_for, &listener)
        } else {
            Ok(Some(Publisher::Nobody))
        };
        let mut publisher = match publisher {
            Ok(Some(publisher)) => publisher,
            other => {
                recorder.discard();
                return other.map(|_| None);
            }
        };
        let result = producer::run::run(&manifest.run, &mut publisher, Some(&mut recorder), &mut listener);
        let reason = result.as_ref().map_or(EndReason::Failed, |outcome| outcome.reason);
        // both are finished even if one fails; the recording first, so that it is there when consumers hear of the end
        let finished = recorder.finish(reason);
        let published = publisher.finish(reason);
        let (outcome, finished) = (result?, finished?);
        published?;
        Ok(Some((outcome, finished)))
    };
    // a publisher may be held back; without one this thread does it, and signals and calls are its own
    let done = if publish { stoppable(py, &stop, work) } else { detached(py, work) }?;
    listener.looks.end()?;
    let summary = PyDict::new(py);
    if let Some((outcome, finished)) = done {
        summarize(&summary, &outcome)?;
        summary.set_item("path", finished.path)?;
        summary.set_item("bytes", finished.bytes)?;
    }
    Ok(summary)
}

fn summarize(summary: &Bound<'_, PyDict>, outcome: &RunOutcome) -> PyResult<()> {
    summary.set_item("end", outcome.reason.as_str())?;
    summary.set_item("last_step", outcome.last_step)?;
    summary.set_item("recorded_states", outcome.recorded_count)?;
    summary.set_item("relative_drift", outcome.relative_drift)
}

impl<P: Error + 'static, R: Error + Into<Why> + 'static> From<RunError<P, R>> for Why {
    fn from(error: RunError<P, R>) -> Self {
        match error {
            RunError::Record { source, .. } => source.into(),
            RunError::Publish { .. } => Self::of("LiveError", &error),
            RunError::NonFinite { step, bead, .. } => Self::of("RunError", &error).at_bead(step, bead),
        }
    }
}

impl From<Infallible> for Why {
    fn from(never: Infallible) -> Self {
        match never {}
    }
}

/// The states of a run in memory.
#[derive(Default)]
struct Memory(Vec<ChainState>);

impl FrameSink for Memory {
    type Error = Infallible;

    fn accept(&mut self, frame: &Frame<'_>) -> Result<(), Infallible> {
        self.0.push(ChainState::of_frame(frame));
        Ok(())
    }
}

/// Simulates a run and keeps the states that would be recorded in memory. What raises meanwhile is raised.
#[pyfunction]
#[pyo3(signature = (manifest, *, on_progress=None, on_frame=None))]
pub(crate) fn simulate<'py>(
    py: Python<'py>,
    manifest: &Manifest,
    on_progress: Option<Py<PyAny>>,
    on_frame: Option<(Py<PyAny>, u64)>,
) -> PyResult<(States, Bound<'py, PyDict>)> {
    let mut listener = Listener::new(on_progress, on_frame);
    let made = detached(py, || {
        let mut memory = Memory::default();
        let outcome =
            producer::run::run(&manifest.run, &mut Publisher::Nobody, Some(&mut memory), &mut listener)?;
        Ok((outcome, memory))
    })?;
    listener.looks.end()?;
    in_memory(py, manifest, made)
}

/// Simulates runs and keeps states of each in memory, as `simulate` does: alike chains beside each other, in `jobs` threads. `on_progress`
/// is called with how many are done. The first that fails ends all.
#[pyfunction]
#[pyo3(signature = (manifests, *, jobs=None, on_progress=None))]
pub(crate) fn simulate_all<'py>(
    py: Python<'py>,
    manifests: Vec<PyRef<'py, Manifest>>,
    jobs: Option<NonZero<usize>>,
    on_progress: Option<Py<PyAny>>,
) -> PyResult<Vec<(States, Bound<'py, PyDict>)>> {
    let runs: Vec<_> = manifests.iter().map(|manifest| Arc::clone(&manifest.run)).collect();
    let simulate = |stop: &Arc<AtomicBool>, batch: &[usize], done: &mut Vec<(usize, Made)>| {
        for together in Together::of(batch.iter().map(|number| &*runs[*number])) {
            let numbers: Vec<usize> = together.numbers().iter().map(|place| batch[*place]).collect();
            let takers = numbers.iter().map(|_| (Publisher::Nobody, Memory::default(), Stoppable(stop)));
            let mut takers: Vec<_> = takers.collect();
            let jobs = numbers.iter().zip(&mut takers).map(|(number, (publisher, memory, conductor))| Job {
                manifest: &runs[*number],
                publisher,
                recorder: Some(memory),
                conductor,
            });
            let mut failed = None;
            together.run(jobs, |place, job, outcome| {
                let number = batch[place];
                match outcome {
                    Ok(outcome) => {
                        done.push((number, (outcome, job.recorder.map(std::mem::take).unwrap_or_default())));
                        ControlFlow::Continue(())
                    }
                    Err(error) => {
                        failed = Some(Why::from(error).of_run(number));
                        ControlFlow::Break(())
                    }
                }
            });
            failed.map_or(Ok(()), Err)?;
        }
        Ok(())
    };
    let made = shared(py, runs.len(), jobs, on_progress.as_ref(), simulate)?;
    let kept = |(number, (manifest, made)): (usize, (&PyRef<'_, Manifest>, Option<Made>))| {
        let broken = || Why::new("BeadlineError", "Beadline went wrong: that is a bug, please report it");
        in_memory(py, manifest, made.ok_or_else(|| broken().of_run(number))?)
    };
    manifests.iter().zip(made).enumerate().map(kept).collect()
}

/// A run that was made, and its states.
type Made = (RunOutcome, Memory);

fn in_memory<'py>(
    py: Python<'py>,
    manifest: &Manifest,
    (outcome, Memory(states)): Made,
) -> PyResult<(States, Bound<'py, PyDict>)> {
    let summary = PyDict::new(py);
    summarize(&summary, &outcome)?;
    Ok((States::of_memory(manifest.clone(), states, outcome.reason), summary))
}

/// A run that others can end.
struct Stoppable<'a>(&'a AtomicBool);

impl<R> Conductor<Publisher, R> for Stoppable<'_> {
    fn after_frame(
        &mut self,
        _: &Frame<'_>,
        publisher: &mut Publisher,
        _: Option<&mut R>,
    ) -> ControlFlow<()> {
        Conductor::<Publisher, R>::between_steps(self, publisher)
    }

    fn hears_every_frame(&self, _: &Publisher) -> bool {
        false
    }

    fn between_steps(&mut self, _: &mut Publisher) -> ControlFlow<()> {
        if self.0.load(Ordering::Relaxed) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// A run that is made step by step.
#[pyclass(module = "beadline._native")]
pub(crate) struct Simulation {
    manifest: Arc<RunManifest>,
    integrator: Integrator,
    state: ChainState,
    /// Arrays that were lent, and are kept up to date: displacements, velocities.
    lent: [Option<Py<PyArray1<f64>>>; 2],
}

#[pymethods]
impl Simulation {
    /// Makes one that carries `tangents` with it, each of as many numbers as a change of the state has; or its derivatives by numbers of
    /// its configuration: each of `beside` has the runs with a smaller one and a larger one, and how far these are apart.
    #[new]
    #[pyo3(signature = (manifest, tangents=None, beside=Vec::new()))]
    fn new(
        manifest: &Manifest,
        tangents: Option<Vec<Vec<f64>>>,
        beside: Vec<(PyRef<'_, Manifest>, PyRef<'_, Manifest>, f64)>,
    ) -> PyResult<Self> {
        let physics = &manifest.run.physics;
        let neighbours: Vec<_> = beside
            .iter()
            .map(|(below, above, apart)| Neighbours {
                below: &below.run.physics,
                above: &above.run.physics,
                apart: *apart,
            })
            .collect();
        let integrator = match tangents {
            None if neighbours.is_empty() => Ok(Integrator::new(physics)),
            None => Integrator::with_derivatives(physics, &neighbours).map_err(|error| error.to_string()),
            Some(tangents) => carrying(physics, &tangents),
        };
        let integrator = integrator.map_err(PyValueError::new_err)?;
        let (state, manifest) = (ChainState::initial(physics), Arc::clone(&manifest.run));
        Ok(Self { integrator, state, manifest, lent: [None, None] })
    }

    /// The tangents of the state; none if it carries none.
    fn tangents(&mut self) -> Option<Vec<Vec<f64>>> {
        let tangents = self.integrator.tangents()?;
        Some((0..tangents.count()).map(|number| tangents.tangent(number)).collect())
    }

    /// Makes `steps` steps, at most up to the last one of the run; a signal ends it between two steps.
    fn step(&mut self, py: Python<'_>, steps: u64) -> PyResult<()> {
        let last = self.state.step.saturating_add(steps).min(self.manifest.physics.step_count);
        let Self { integrator, state, .. } = self;
        let mut looks = Looks::new();
        detached(py, || {
            while state.step < last && looks.go_on(|_| Ok(())) {
                integrator.advance(state, last);
            }
            Ok(())
        })?;
        let lost = integrator.first_non_finite(state);
        for (lent, values) in self.lent.iter().zip([&self.state.u_m, &self.state.v_m_s]) {
            if let Some(lent) = lent {
                copy_into(lent.bind(py), values)?;
            }
        }
        looks.end()?;
        let Some(bead) = lost.filter(|_| steps > 0) else { return Ok(()) };
        let step = self.state.step;
        let (u_m, v_m_s) = (self.state.u_m[bead], self.state.v_m_s[bead]);
        let why = self.manifest.physics.why_not_finite();
        Err(Why::from(RunError::<Infallible, Infallible>::NonFinite { step, bead, u_m, v_m_s, why }).into())
    }

    #[getter]
    fn step_number(&self) -> u64 {
        self.state.step
    }

    #[getter]
    fn time_s(&self) -> f64 {
        self.manifest.physics.time_s(self.state.step)
    }

    /// A copy of the state.
    fn state<'py>(&self, py: Python<'py>) -> PyResult<StateTuple<'py>> {
        state_of(py, &self.state.as_frame(&self.manifest, self.manifest.frame_at(self.state.step)))
    }

    /// The displacements (m), read-only, which go on with the run.
    fn u_m(&mut self, py: Python<'_>) -> PyResult<Py<PyArray1<f64>>> {
        lend(py, &mut self.lent[0], &self.state.u_m)
    }

    /// The velocities (m/s), read-only, which go on with the run.
    fn v_m_s(&mut self, py: Python<'_>) -> PyResult<Py<PyArray1<f64>>> {
        lend(py, &mut self.lent[1], &self.state.v_m_s)
    }
}

/// The integrator of a run that carries `tangents`.
fn carrying(physics: &Physics, tangents: &[Vec<f64>]) -> Result<Integrator, String> {
    let mut integrator =
        Integrator::with_tangents(physics, tangents.len()).map_err(|error| error.to_string())?;
    let Some(carried) = integrator.tangents() else { return Ok(integrator) };
    for (number, numbers) in tangents.iter().enumerate() {
        if numbers.len() != carried.dimension() {
            let (found, expected) = (numbers.len(), carried.dimension());
            return Err(format!(
                "tangents: found {found} numbers; expected {expected}: changes of all displacements, then of all velocities (and \
                 then those of resonators)"
            ));
        }
        carried.set(number, numbers);
    }
    Ok(integrator)
}

fn lend(py: Python<'_>, lent: &mut Option<Py<PyArray1<f64>>>, values: &[f64]) -> PyResult<Py<PyArray1<f64>>> {
    if let Some(array) = lent {
        return Ok(array.clone_ref(py));
    }
    let array = arrays::of(py, values)?;
    set_writeable(&array, false);
    Ok(lent.insert(array.unbind()).clone_ref(py))
}

fn copy_into(array: &Bound<'_, PyArray1<f64>>, values: &[f64]) -> PyResult<()> {
    set_writeable(array, true);
    let copied = array
        .try_readwrite()
        .map(|mut array| array.as_slice_mut().map(|array| array.copy_from_slice(values)));
    set_writeable(array, false);
    copied??;
    Ok(())
}

pub(crate) fn set_writeable(array: &Bound<'_, PyAny>, writeable: bool) {
    // an attribute of every array; those that own their memory take it
    let _ = array.getattr("flags").and_then(|flags| flags.setattr("writeable", writeable));
}
