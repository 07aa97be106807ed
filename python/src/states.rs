//! The states of a recording or of a run in memory: any step, any part of any array of them, recomputed and proven.

mod reader;

use crate::arrays::{self, StateTuple, state_of};
use crate::errors::Why;
use crate::fields::{Field, Places, Wanted};
use crate::manifest::Manifest;
use crate::patience::{abandonable, detached, interruptible};
use numpy::ndarray::Array2;
use numpy::{IntoPyArray as _, PyArray1, PyArray2, PyArrayMethods as _, PyReadonlyArray1, PyReadonlyArray2};
use producer::resimulation::{Lend, OtherKernel, Resimulation, check_kernel};
use producer::state::ChainState;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use reader::Reader;
use recording::{RecordingInfo, RecordingSource, RecordingWriter, WriteOptions};
use schemas::frame::{EndReason, Frame, FrameSink as _, FrameSource, Received};
use schemas::manifest::RunManifest;
use std::num::NonZero;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

/// The calling thread does work of fewer steps of beads than this at once, by itself.
const LITTLE_WORK: u64 = 1_000_000;

/// Fewest steps that one thread takes at a time.
const PIECE_STEPS: u64 = 1024;

/// Chunks of a recording that are read on through rather than looked up in its index.
const CHUNKS_READ_THROUGH: u64 = 2;

/// States that can be had by their step.
#[pyclass(frozen, module = "beadline._native")]
pub(crate) struct States {
    kept: Kept,
    manifest: Manifest,
    first_step: u64,
    last_step: u64,
    /// Reason why only kept states can be had, if so.
    other_kernel: Option<OtherKernel>,
    /// Readers that nobody uses now, and the process that they are of.
    idle: Mutex<(u32, Vec<Reader>)>,
}

impl Drop for States {
    fn drop(&mut self) {
        forget_others(self.idle.get_mut().unwrap_or_else(PoisonError::into_inner));
    }
}

/// Lets go of the readers of the process that this one was forked from, without a word: it reads on at the same places of the
/// same files, and their threads are only there.
fn forget_others((process, readers): &mut (u32, Vec<Reader>)) {
    if *process != std::process::id() {
        std::mem::forget(std::mem::take(readers));
        *process = std::process::id();
    }
}

/// Steps, doubles (a row a state), and how the run ended.
type KeptStates<'py> = (Bound<'py, PyArray1<u64>>, Bound<'py, PyArray2<f64>>, &'static str);

/// Place of the states.
enum Kept {
    File(Box<RecordingInfo>),
    Memory(Arc<Vec<ChainState>>, EndReason),
}

/// Steps that one thread does in one go, and where their values go: a row a step.
type Piece<'a> = (&'a [u64], &'a mut [f64]);

impl States {
    pub(crate) fn of_memory(manifest: Manifest, states: Vec<ChainState>, end: EndReason) -> Self {
        let (first_step, last_step) =
            (states.first().map_or(0, |state| state.step), states.last().map_or(0, |state| state.step));
        let other_kernel = check_kernel(&manifest.run).err();
        let kept = Kept::Memory(Arc::new(states), end);
        Self { kept, manifest, first_step, last_step, other_kernel, idle: Mutex::default() }
    }

    fn run(&self) -> &RunManifest {
        &self.manifest.run
    }

    fn reader(&self) -> Result<Reader, Why> {
        let mut idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        forget_others(&mut idle);
        let reader = idle.1.pop();
        drop(idle);
        if let Some(reader) = reader {
            return Ok(reader);
        }
        match &self.kept {
            Kept::File(info) => {
                let file = RecordingSource::open_all(&info.path)?;
                // results of another run would be wrong, and its chain may be another
                if file.manifest().physics != self.run().physics {
                    let what = format!("{} is of another run now: open it again", info.path.display());
                    return Err(Why::new("RecordingError", what));
                }
                Ok(Reader::File(Box::new(file)))
            }
            Kept::Memory(states, _) => Ok(Reader::Memory {
                run: Arc::clone(&self.manifest.run),
                states: Arc::clone(states),
                next: 0,
            }),
        }
    }

    /// Keeps a reader for later; one that has failed is dropped instead.
    fn give_back(&self, reader: Reader) {
        self.idle.lock().unwrap_or_else(PoisonError::into_inner).1.push(reader);
    }

    /// True if the state of `step` is kept, provided that nothing is missing.
    fn is_kept(&self, step: u64) -> bool {
        self.run().is_recorded(step) || step == self.first_step || step == self.last_step
    }

    /// Splits `steps` and their rows into pieces: at gaps that are better jumped over, and so that all cores have work.
    fn pieces<'a>(&self, steps: &'a [u64], mut rows: &'a mut [f64], width: usize) -> Vec<Piece<'a>> {
        let record_every = self.run().provenance.record_every_steps;
        let state_bytes = 8 * self.run().frame_doubles() as u64;
        let most_gap = record_every.saturating_mul((CHUNKS_READ_THROUGH << 20).div_ceil(state_bytes).max(2));
        let most_recomputed = record_every.saturating_mul(2);
        let span = steps.last().zip(steps.first()).map_or(0, |(last, first)| last - first);
        let cores = std::thread::available_parallelism().map_or(1, NonZero::get) as u64;
        let most_steps = PIECE_STEPS.max(span / (4 * cores));
        let mut pieces = Vec::new();
        let mut rest = steps;
        while let Some(first) = rest.first() {
            let ends = |pair: &[u64]| {
                let gap = pair[1] - pair[0];
                let kept = self.is_kept(pair[0]) && self.is_kept(pair[1]);
                gap > if kept { most_gap } else { most_recomputed } || pair[1] - first >= most_steps
            };
            let len = rest.windows(2).position(ends).map_or(rest.len(), |before| before + 1);
            let (piece, others) = rest.split_at(len);
            let (piece_rows, other_rows) = rows.split_at_mut(len * width);
            pieces.push((piece, piece_rows));
            (rest, rows) = (others, other_rows);
        }
        pieces
    }

    /// Fills the rows of a piece.
    fn fill(
        &self,
        reader: &mut Reader,
        (steps, rows): Piece<'_>,
        wanted: &Wanted<'_>,
        stop: &AtomicBool,
    ) -> Result<(), Why> {
        let kept = steps.iter().all(|step| self.is_kept(*step));
        if kept && self.fill_from_kept(reader, steps, rows, wanted, stop)? {
            return Ok(());
        }
        self.fill_by_recomputing(reader, steps, rows, wanted, stop)
    }

    /// Fills rows with states that are kept; false if one of them is missing.
    fn fill_from_kept(
        &self,
        reader: &mut Reader,
        steps: &[u64],
        rows: &mut [f64],
        wanted: &Wanted<'_>,
        stop: &AtomicBool,
    ) -> Result<bool, Why> {
        let width = wanted.width();
        let Some(first) = steps.first() else { return Ok(true) };
        reader.seek(*first)?;
        let mut missing = steps.iter().zip(rows.chunks_exact_mut(width.max(1)));
        let mut next = missing.next();
        while let Some((step, row)) = &mut next {
            check(stop)?;
            match reader.receive()? {
                Received::Frame(frame) if frame.step == **step => wanted.write(&frame, row),
                Received::Frame(frame) if frame.step < **step => continue,
                Received::Missed { .. } if self.other_kernel.is_some() => continue,
                _ => return Ok(false),
            }
            next = missing.next();
        }
        Ok(true)
    }

    /// Fills rows with states that are recomputed from the one before, and proven by the one after.
    fn fill_by_recomputing(
        &self,
        reader: &mut Reader,
        steps: &[u64],
        rows: &mut [f64],
        wanted: &Wanted<'_>,
        stop: &AtomicBool,
    ) -> Result<(), Why> {
        if let Some(error) = self.other_kernel {
            return Err(error.into());
        }
        let (Some(first), Some(last)) = (steps.first(), steps.last()) else { return Ok(()) };
        reader.seek(*first)?;
        // steps before the first one are lent, too, so that a stop is seen between them
        let mut states = Resimulation::new(reader, Lend::Steps)?.ending_with_the_last_state();
        let width = wanted.width();
        let mut missing = steps.iter().zip(rows.chunks_exact_mut(width.max(1))).peekable();
        // all are proven once the state at or after the last one was
        while missing.peek().is_some() || states.proven_step().is_none_or(|proven| proven < *last) {
            check(stop)?;
            match states.receive()? {
                Received::Frame(frame) => {
                    if let Some((_, row)) = missing.next_if(|(step, _)| **step == frame.step) {
                        wanted.write(&frame, row);
                    }
                }
                Received::Missed { .. } => {}
                Received::End(_) => {
                    let step = missing.peek().map_or(*last, |(step, _)| **step);
                    let what = format!("step {step} is not in the recording, and no later state proves it");
                    return Err(Why::new("RecordingError", what));
                }
            }
        }
        Ok(())
    }

    /// Fills all rows, on all cores if that is worth it.
    fn fill_all(&self, py: Python<'_>, pieces: Vec<Piece<'_>>, wanted: &Wanted<'_>) -> PyResult<()> {
        let every = self.run().provenance.record_every_steps;
        let steps = pieces.iter().map(|(steps, _)| steps[steps.len() - 1] - steps[0] + every).sum::<u64>();
        if steps.saturating_mul(self.run().physics.beads) <= LITTLE_WORK {
            let never = AtomicBool::new(false);
            return detached(py, || self.work(&Mutex::new(pieces.into_iter()), wanted, &never));
        }
        interruptible(py, |stop| {
            let cores = std::thread::available_parallelism().map_or(1, NonZero::get).min(pieces.len());
            let pieces = Mutex::new(pieces.into_iter());
            let pieces = &pieces;
            std::thread::scope(|scope| {
                let workers: Vec<_> =
                    (1..cores).map(|_| scope.spawn(move || self.work(pieces, wanted, stop))).collect();
                let mut done = self.work(pieces, wanted, stop);
                for worker in workers {
                    let other = worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
                    done = done.and(other);
                }
                done
            })
        })
    }

    /// Takes pieces until there are none; one that fails is the last one for all.
    fn work(
        &self,
        pieces: &Mutex<std::vec::IntoIter<Piece<'_>>>,
        wanted: &Wanted<'_>,
        stop: &AtomicBool,
    ) -> Result<(), Why> {
        let mut reader = self.reader()?;
        loop {
            let Some(piece) = pieces.lock().unwrap_or_else(PoisonError::into_inner).next() else { break };
            if let Err(why) = self.fill(&mut reader, piece, wanted, stop) {
                pieces.lock().unwrap_or_else(PoisonError::into_inner).by_ref().for_each(drop);
                return Err(why);
            }
        }
        self.give_back(reader);
        Ok(())
    }

    /// Wanted values of the states at `steps`: a row a step.
    fn rows<'py>(
        &self,
        py: Python<'py>,
        steps: &[u64],
        wanted: &Wanted<'_>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let are_there = steps.first().is_none_or(|step| *step >= self.first_step)
            && steps.last().is_none_or(|step| *step <= self.last_step);
        if !steps.is_sorted_by(|a, b| a < b) || !are_there {
            return Err(PyValueError::new_err("steps must ascend and exist"));
        }
        let rows = arrays::zeros(py, steps.len() * wanted.width())?;
        let mut values = rows.try_readwrite()?;
        let values = values.as_slice_mut()?;
        if !values.is_empty() {
            let pieces = self.pieces(steps, values, wanted.width());
            self.fill_all(py, pieces, wanted)?;
        }
        rows.reshape([steps.len(), wanted.width()])
    }
}

/// An error that nobody sees, because what stopped the work is raised.
fn check(stop: &AtomicBool) -> Result<(), Why> {
    if stop.load(Ordering::Relaxed) { Err(Why::new("BeadlineError", "stopped")) } else { Ok(()) }
}

#[pymethods]
impl States {
    /// Opens a recording: whole, cut short, or still being written.
    #[staticmethod]
    fn open(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        abandonable(py, move || {
            // an object may be another one since it was opened last
            storage::forget(&path);
            let info = RecordingInfo::read(&path)?;
            let (Some(first_step), Some(last_step)) = (info.first_step, info.last_step) else {
                let why = Why::new("RecordingError", format!("{} holds no states", path.display()));
                return Err(why);
            };
            let manifest = Manifest::new(info.manifest.clone(), info.run_toml.clone());
            let other_kernel = check_kernel(&manifest.run).err();
            let kept = Kept::File(Box::new(info));
            Ok(Self { kept, manifest, first_step, last_step, other_kernel, idle: Mutex::default() })
        })
    }

    #[getter]
    fn manifest(&self) -> Manifest {
        self.manifest.clone()
    }

    /// The file, if there is one.
    #[getter]
    fn path(&self) -> Option<String> {
        match &self.kept {
            Kept::File(info) => Some(info.path.display().to_string()),
            Kept::Memory(..) => None,
        }
    }

    #[getter]
    fn first_step(&self) -> u64 {
        self.first_step
    }

    #[getter]
    fn last_step(&self) -> u64 {
        self.last_step
    }

    /// True if the steps between kept ones can be had.
    #[getter]
    fn recomputes(&self) -> bool {
        self.other_kernel.is_none()
    }

    /// Description of the states, in words and numbers.
    fn about<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let about = PyDict::new(py);
        match &self.kept {
            Kept::File(info) => {
                about.set_item("states", info.frames())?;
                about.set_item("bytes", info.file_bytes)?;
                about.set_item("end", info.end.as_ref().map(|end| end.reason.as_str()))?;
                about.set_item("is_finished", info.finished)?;
                about.set_item("is_complete", info.is_complete())?;
                about.set_item("damage", &info.damage)?;
                let channels = info.channels.iter().map(|channel| (channel.topic.clone(), channel.messages));
                about.set_item("channels", channels.collect::<Vec<_>>())?;
            }
            Kept::Memory(states, end) => {
                about.set_item("states", states.len())?;
                about.set_item("bytes", 8 * self.run().frame_doubles() * states.len())?;
                about.set_item("end", end.as_str())?;
                about.set_item("is_finished", true)?;
                about.set_item("is_complete", *end == EndReason::Complete)?;
                about.set_item("damage", None::<String>)?;
                about.set_item("channels", Vec::<(String, u64)>::new())?;
            }
        }
        Ok(about)
    }

    /// The state of a step: frame, step, time (s), displacements, velocities, what else the method needs.
    fn state<'py>(&self, py: Python<'py>, step: u64) -> PyResult<StateTuple<'py>> {
        let wanted = Wanted::States(self.run());
        let mut doubles = vec![0.0; wanted.width()];
        self.fill_all(py, vec![(&[step], &mut doubles)], &wanted)?;
        let (run, beads) = (self.run(), self.manifest.chain.bead_count());
        let head = (run.frame_at(step), step, run.physics.time_s(step));
        state_of(py, &Frame::of_doubles(head, beads, &doubles))
    }

    /// Values of `field` at `steps`, which ascend, and `places`: one row a step.
    fn gather<'py>(
        &self,
        py: Python<'py>,
        field: &str,
        steps: PyReadonlyArray1<'_, u64>,
        places: PyReadonlyArray1<'_, u64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let field = Field::named(field)?;
        let chain = &*self.manifest.chain;
        let steps = steps.as_slice()?;
        let list: Vec<usize> =
            places.as_slice()?.iter().map(|place| usize::try_from(*place)).collect::<Result<_, _>>()?;
        if list.iter().any(|place| *place >= field.places(chain)) {
            return Err(PyValueError::new_err("a place does not exist"));
        }
        let is_range = list.windows(2).all(|pair| pair[1] == pair[0] + 1);
        let places = match list.as_slice() {
            [first, ..] if is_range => Places::Range(*first, first + list.len()),
            list => Places::List(list),
        };
        self.rows(py, steps, &Wanted::Part { chain, field, places })
    }

    /// All doubles of the states at `steps`, which ascend: a row a step.
    fn gather_states<'py>(
        &self,
        py: Python<'py>,
        steps: PyReadonlyArray1<'_, u64>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        self.rows(py, steps.as_slice()?, &Wanted::States(self.run()))
    }

    /// Steps and doubles (a row a state) of a run in memory, and how it ended.
    fn kept<'py>(&self, py: Python<'py>) -> PyResult<KeptStates<'py>> {
        let Kept::Memory(states, end) = &self.kept else {
            return Err(PyValueError::new_err("it is a file"));
        };
        let steps = PyArray1::from_iter(py, states.iter().map(|state| state.step));
        let width = self.run().frame_doubles();
        let mut rows = Array2::<f64>::zeros((states.len(), width));
        for (mut row, state) in rows.rows_mut().into_iter().zip(states.iter()) {
            let doubles = state.u_m.iter().chain(&*state.v_m_s).chain(&*state.extra);
            row.iter_mut().zip(doubles).for_each(|(value, double)| *value = *double);
        }
        Ok((steps, rows.into_pyarray(py), end.as_str()))
    }

    /// A run in memory, from what [`kept`](Self::kept) gave.
    #[staticmethod]
    fn of_kept(
        manifest: Manifest,
        steps: PyReadonlyArray1<'_, u64>,
        doubles: PyReadonlyArray2<'_, f64>,
        end: &str,
    ) -> PyResult<Self> {
        let (steps, doubles) = (steps.as_slice()?, doubles.as_slice()?);
        let (beads, width) = (manifest.chain.bead_count(), manifest.run.frame_doubles());
        if steps.is_empty() || steps.len() * width != doubles.len() || !steps.is_sorted_by(|a, b| a < b) {
            return Err(PyValueError::new_err("these are no states of this run"));
        }
        let rows = steps.iter().zip(doubles.chunks_exact(width));
        let states =
            rows.map(|(step, row)| ChainState::of_frame(&Frame::of_doubles((0, *step, 0.0), beads, row)));
        let complete = end == EndReason::Complete.as_str();
        let end = if complete { EndReason::Complete } else { EndReason::Interrupted };
        Ok(Self::of_memory(manifest.clone(), states.collect(), end))
    }

    /// Writes the kept states of a run in memory as a recording.
    #[pyo3(signature = (path, force=false))]
    fn save(&self, py: Python<'_>, path: PathBuf, force: bool) -> PyResult<()> {
        let Kept::Memory(states, end) = &self.kept else {
            return Err(PyValueError::new_err("it is a file already"));
        };
        interruptible(py, |stop| {
            let run = self.run();
            let options = WriteOptions { force, ..WriteOptions::default() };
            let toml = self.manifest.toml.as_deref().unwrap_or_default();
            let mut recorder = RecordingWriter::create(&path, run, toml, &options)?;
            for state in states.iter() {
                if stop.load(Ordering::Relaxed) {
                    recorder.discard();
                    return Ok(());
                }
                recorder.accept(&state.as_frame(run, run.frame_at(state.step)))?;
            }
            recorder.finish(*end)?;
            Ok(())
        })
    }
}
