//! The row of a point.

use crate::configuration::origin;
use anyhow::Error;
use consumers::energies::{Energies, EnergyOutcome, Reflection, default_split_bead};
use consumers::table::{Cell, Column, Kind};
use producer::run::{Conductor, RunError, RunOutcome};
use producer::sweep::{ParameterKind, ParameterValue, Point, Sweep, Until};
use schemas::frame::{EndReason, Frame, FrameSink};
use schemas::manifest::RunManifest;
use schemas::recording::{RecordingWriter, WriteError, WriteOptions, state_hash};
use schemas::summary::Summarizer;
use std::convert::Infallible;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// The columns of the results, with units.
const RESULTS: [(&str, Kind); 27] = [
    ("end", Kind::Word),
    ("steps", Kind::Integer),
    ("time_s", Kind::Double),
    ("dt_s", Kind::Double),
    ("split_bead", Kind::Integer),
    // of the last frame
    ("kinetic_j", Kind::Double),
    ("potential_j", Kind::Double),
    ("total_j", Kind::Double),
    ("left_j", Kind::Double),
    ("split_j", Kind::Double),
    ("right_j", Kind::Double),
    // of the last frame before a front met an end, as `beadline energies` has them
    ("reflected_at_s", Kind::Double),
    ("reflected_over_total", Kind::Double),
    ("reflected_over_transmitted", Kind::Double),
    ("reflected_uncertainty_j", Kind::Double),
    ("stationary_since_s", Kind::Double),
    ("recoil_j", Kind::Double),
    ("recoil_uncertainty_j", Kind::Double),
    ("corrected_over_total", Kind::Double),
    ("corrected_over_transmitted", Kind::Double),
    ("corrected_over_incident", Kind::Double),
    ("relative_drift", Kind::Double),
    ("max_abs_relative_drift", Kind::Double),
    ("front_bead", Kind::Integer),
    ("physics_sha256", Kind::Word),
    ("state_sha256", Kind::Word),
    (ERROR_COLUMN, Kind::Word),
];

/// The column of why a point has no results.
pub(crate) const ERROR_COLUMN: &str = "error";

/// How long, in collision times T, the reflected energy must have been stationary for a point to end that ends
/// when it is: the window in which the uncertainty of the reflected energy is measured.
const STATIONARY_FOR: f64 = 100.0;

/// The columns of a sweep's rows: its parameters, then the results.
pub(crate) fn columns(sweep: &Sweep) -> Vec<Column> {
    let kind = |kind| match kind {
        ParameterKind::Integer => Kind::Integer,
        ParameterKind::Double => Kind::Double,
        ParameterKind::Word => Kind::Word,
    };
    let parameters = sweep.parameters().iter().map(|p| Column::new(p.key.clone(), kind(p.kind)));
    parameters.chain(RESULTS.map(|(name, kind)| Column::new(name, kind))).collect()
}

/// What a worker tells and is told while it computes a point.
pub(crate) struct Signals<'a> {
    /// Set when the point is to be given up.
    pub(crate) stop: &'a AtomicBool,
    /// The step that was reached.
    pub(crate) step: &'a AtomicU64,
}

/// Computes point `index` of `sweep`, and records it if there is a path for that. None if it was stopped.
///
/// The row depends on the sweep and the index alone. A run that fails has a row, too, which says why.
///
/// # Errors
/// When the recording cannot be written.
pub(crate) fn compute(
    sweep: &Sweep,
    index: u64,
    recording: Option<&Path>,
    signals: &Signals<'_>,
) -> Result<Option<Vec<Cell>>, Error> {
    let point = sweep.point(index)?;
    let manifest = RunManifest::new(&point.config, &format!("point-{index:06}"), origin())?;
    let mut analyses = Analyses::new(&manifest, sweep.split_bead());
    let mut recorder = recording.map(|path| record(path, &manifest, sweep, &point)).transpose()?;
    let mut conduct = Conduct::new(sweep, &manifest, signals);
    let result = producer::run::run(&manifest, &mut analyses, recorder.as_mut(), &mut conduct);
    let outcome = match result {
        Ok(outcome) if outcome.reason == EndReason::Interrupted && !conduct.is_stationary => {
            recorder.map(RecordingWriter::discard);
            return Ok(None);
        }
        Ok(outcome) => Ok(outcome),
        Err(error @ RunError::NonFinite { .. }) => Err(error.to_string()),
        Err(error) => return Err(error.into()),
    };
    let reason = outcome.as_ref().map_or(EndReason::Failed, |outcome| outcome.reason);
    recorder.map(|recorder| recorder.finish(reason)).transpose()?;
    Ok(Some(row(&manifest, &point, &analyses, outcome)))
}

fn record(
    path: &Path,
    manifest: &RunManifest,
    sweep: &Sweep,
    point: &Point,
) -> Result<RecordingWriter, WriteError> {
    let from = format!("# point {} of {}\n", point.index, sweep.path().display());
    // what is there is of an attempt that has no row
    let options = WriteOptions { force: true, ..WriteOptions::default() };
    RecordingWriter::create(path, manifest, &(from + &point.config.to_toml()), &options)
}

fn row(
    manifest: &RunManifest,
    point: &Point,
    analyses: &Analyses,
    outcome: Result<RunOutcome, String>,
) -> Vec<Cell> {
    let physics = &manifest.physics;
    let mut results = Results(vec![Cell::Empty; RESULTS.len()]);
    results.double("dt_s", physics.dt_s).word("physics_sha256", hex(&physics.hash()));
    match outcome {
        Ok(outcome) => {
            let reflection = analyses.energies.outcome().and_then(|energies| energies.reflection.ok());
            let end = match (outcome.reason, reflection) {
                (EndReason::Interrupted, Some(Reflection { stationary_since: Some(_), .. })) => "stationary",
                (EndReason::Interrupted, _) => "met end",
                (reason, _) => reason.as_str(),
            };
            results.word("end", end).integer("steps", outcome.last_step);
            results.double("time_s", physics.time_s(outcome.last_step));
            results.double("relative_drift", outcome.relative_drift);
            results.integer("front_bead", analyses.front_bead(manifest));
            results.word("state_sha256", state_hash(analyses.step, &analyses.state));
            if let Some(energies) = analyses.energies.outcome() {
                results.energies(&energies);
            }
        }
        Err(error) => {
            results.word("end", EndReason::Failed.as_str()).word(ERROR_COLUMN, error);
        }
    }
    point.parameters.iter().map(|value| parameter(value.as_ref())).chain(results.0).collect()
}

/// The values of [`RESULTS`].
struct Results(Vec<Cell>);

impl Results {
    fn set(&mut self, name: &str, cell: Cell) -> &mut Self {
        let column = RESULTS.iter().position(|(column, _)| *column == name);
        debug_assert!(column.is_some(), "there is no column `{name}`");
        if let Some(place) = column.and_then(|column| self.0.get_mut(column)) {
            *place = cell;
        }
        self
    }

    /// A double; a value that does not exist is NaN.
    fn double(&mut self, name: &str, value: f64) -> &mut Self {
        self.set(name, if value.is_nan() { Cell::Empty } else { Cell::Double(value) })
    }

    fn integer(&mut self, name: &str, value: u64) -> &mut Self {
        self.set(name, Cell::Integer(value))
    }

    fn word(&mut self, name: &str, word: impl Into<String>) -> &mut Self {
        self.set(name, Cell::Word(word.into()))
    }

    fn energies(&mut self, outcome: &EnergyOutcome) {
        let last = &outcome.last;
        self.integer("split_bead", outcome.split_bead);
        self.double("kinetic_j", last.kinetic_j).double("potential_j", last.potential_j);
        self.double("total_j", last.total_j);
        self.double("left_j", last.left_j).double("split_j", last.split_j).double("right_j", last.right_j);
        self.double("max_abs_relative_drift", outcome.max_abs_drift);
        if let Ok(reflection) = &outcome.reflection {
            self.reflection(reflection);
        }
    }

    fn reflection(&mut self, reflection: &Reflection) {
        if let Some(energies) = &reflection.energies {
            self.double("reflected_at_s", energies.at.time_s);
            self.double("reflected_over_total", energies.over_total());
            self.double("reflected_over_transmitted", energies.over_transmitted());
            self.double("reflected_uncertainty_j", energies.uncertainty_j);
        }
        if let Some(since) = reflection.stationary_since {
            self.double("stationary_since_s", since.time_s);
        }
        if let Some(recoil) = &reflection.recoil {
            self.double("recoil_j", recoil.energy_j).double("recoil_uncertainty_j", recoil.uncertainty_j);
        }
        if let Some(corrected) = reflection.corrected() {
            self.double("corrected_over_total", corrected.over_total);
            self.double("corrected_over_transmitted", corrected.over_transmitted);
            self.double("corrected_over_incident", corrected.over_incident);
        }
    }
}

fn parameter(value: Option<&ParameterValue>) -> Cell {
    match value {
        None => Cell::Empty,
        Some(ParameterValue::Integer(value)) => Cell::Integer(*value),
        Some(ParameterValue::Double(value)) => Cell::Double(*value),
        Some(ParameterValue::Word(word)) => Cell::Word(word.clone()),
    }
}

/// Bytes in hexadecimal.
pub(crate) fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Everything that looks at the frames of a point.
struct Analyses {
    energies: Energies,
    /// The last state, `[u | v | extra]`, and its step.
    state: Vec<f64>,
    step: u64,
}

impl Analyses {
    fn new(manifest: &RunManifest, split_bead: Option<u64>) -> Self {
        let split_bead = split_bead.unwrap_or_else(|| default_split_bead(manifest));
        Self { energies: Energies::new(manifest, split_bead), state: Vec::new(), step: 0 }
    }

    /// The front of the last state.
    fn front_bead(&self, manifest: &RunManifest) -> u64 {
        let (u_m, rest) = self.state.split_at(manifest.physics.chain().bead_count());
        let (v_m_s, extra) = rest.split_at(u_m.len());
        let time_s = manifest.physics.time_s(self.step);
        let frame = Frame { frame: 0, step: self.step, time_s, u_m, v_m_s, extra };
        Summarizer::new(&manifest.physics).summarize(&frame).front_bead
    }
}

impl FrameSink for Analyses {
    type Error = Infallible;

    fn accept(&mut self, frame: &Frame<'_>) -> Result<(), Infallible> {
        self.energies.observe(frame);
        self.step = frame.step;
        self.state.clear();
        for part in [frame.u_m, frame.v_m_s, frame.extra] {
            self.state.extend_from_slice(part);
        }
        Ok(())
    }
}

/// Tells how far a point is, and ends it when asked, or when there is nothing left to find out.
struct Conduct<'a> {
    signals: &'a Signals<'a>,
    /// How long (s) the reflected energy must have been stationary to end the point, if that ends it.
    stationary_for_s: Option<f64>,
    /// Whether that ended it.
    is_stationary: bool,
}

impl<'a> Conduct<'a> {
    fn new(sweep: &Sweep, manifest: &RunManifest, signals: &'a Signals<'a>) -> Self {
        let ends = sweep.until() == Until::Stationary;
        let stationary_for_s = ends.then(|| STATIONARY_FOR * manifest.physics.scales().time_s);
        Self { signals, stationary_for_s, is_stationary: false }
    }

    fn go_on(&self) -> ControlFlow<()> {
        if self.signals.stop.load(Ordering::Relaxed) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }

    /// Whether nothing more can be learnt of the reflected energy: it has been stationary for long enough, or a
    /// front has met an end of the chain, after which it is not looked at.
    fn is_settled(&self, energies: &Energies, time_s: f64) -> bool {
        let Some(wanted_s) = self.stationary_for_s else { return false };
        let reflection = energies.outcome().and_then(|outcome| outcome.reflection.ok());
        reflection.is_some_and(|reflection| {
            let since = reflection.stationary_since;
            reflection.met_end.is_some() || since.is_some_and(|since| time_s - since.time_s >= wanted_s)
        })
    }
}

impl<R> Conductor<Analyses, R> for Conduct<'_> {
    fn after_frame(
        &mut self,
        frame: &Frame<'_>,
        analyses: &mut Analyses,
        _: Option<&mut R>,
    ) -> ControlFlow<()> {
        self.signals.step.store(frame.step, Ordering::Relaxed);
        if self.is_settled(&analyses.energies, frame.time_s) {
            self.is_stationary = true;
            return ControlFlow::Break(());
        }
        self.go_on()
    }

    fn between_steps(&mut self, _: &mut Analyses) -> ControlFlow<()> {
        self.go_on()
    }
}
