//! The row of a point.

use crate::configuration::origin;
use anyhow::Error;
use consumers::energies::{Energies, EnergyOutcome, default_split_bead};
use consumers::table::{Cell, Column, Kind};
use producer::run::{Conductor, RunError, RunOutcome};
use producer::sweep::{ParameterKind, ParameterValue, Point, Sweep};
use schemas::frame::{EndReason, Frame, FrameSink};
use schemas::manifest::RunManifest;
use schemas::recording::{RecordingWriter, WriteError, WriteOptions, state_hash};
use schemas::summary::Summarizer;
use std::convert::Infallible;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// The columns of the results after `index` and the parameters, without those of the outcome.
const RESULTS: [(&str, Kind); 19] = [
    ("end", Kind::Word),
    ("steps", Kind::Integer),
    ("time_s", Kind::Double),
    ("dt_s", Kind::Double),
    ("split_bead", Kind::Integer),
    ("kinetic_j", Kind::Double),
    ("potential_j", Kind::Double),
    ("total_j", Kind::Double),
    ("left_j", Kind::Double),
    ("split_j", Kind::Double),
    ("right_j", Kind::Double),
    ("reflected_over_total", Kind::Double),
    ("reflected_over_transmitted", Kind::Double),
    ("relative_drift", Kind::Double),
    ("max_abs_relative_drift", Kind::Double),
    ("front_bead", Kind::Integer),
    ("physics_sha256", Kind::Word),
    ("state_sha256", Kind::Word),
    ("error", Kind::Word),
];

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

/// The column of why a point has no results; the last.
pub(crate) const ERROR_COLUMN: &str = "error";

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
    let mut conduct = Conduct { signals };
    let result = producer::run::run(&manifest, &mut analyses, recorder.as_mut(), &mut conduct);
    let outcome = match result {
        Ok(outcome) if outcome.reason == EndReason::Interrupted && signals.stop.load(Ordering::Relaxed) => {
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
    let mut cells: Vec<Cell> = point.parameters.iter().map(|value| parameter(value.as_ref())).collect();
    let word = |word: String| Cell::Word(word);
    match (outcome, analyses.energies.outcome()) {
        (Ok(outcome), Some(energies)) => {
            cells.extend([
                word(outcome.reason.as_str().to_owned()),
                Cell::Integer(outcome.last_step),
                Cell::Double(physics.time_s(outcome.last_step)),
                Cell::Double(physics.dt_s),
            ]);
            cells.extend(energy_cells(&energies));
            cells.extend([
                Cell::Double(outcome.relative_drift),
                Cell::Double(energies.max_abs_drift),
                Cell::Integer(analyses.front_bead(manifest)),
                word(hex(&physics.hash())),
                word(state_hash(analyses.step, &analyses.state)),
                Cell::Empty,
            ]);
        }
        (outcome, _) => {
            let error = outcome.err().unwrap_or_else(|| "the run had no frame".to_owned());
            let results = RESULTS.map(|(name, _)| match name {
                "end" => word(EndReason::Failed.as_str().to_owned()),
                "dt_s" => Cell::Double(physics.dt_s),
                "physics_sha256" => word(hex(&physics.hash())),
                ERROR_COLUMN => word(error.clone()),
                _ => Cell::Empty,
            });
            cells.extend(results);
        }
    }
    cells
}

fn energy_cells(energies: &EnergyOutcome) -> [Cell; 9] {
    let last = &energies.last;
    [
        Cell::Integer(energies.split_bead),
        Cell::Double(last.kinetic_j),
        Cell::Double(last.potential_j),
        Cell::Double(last.total_j),
        Cell::Double(last.left_j),
        Cell::Double(last.split_j),
        Cell::Double(last.right_j),
        Cell::Double(energies.reflected_over_total),
        Cell::Double(energies.reflected_over_transmitted),
    ]
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
        let (u_m, rest) = self.state.split_at(manifest.contact_count() + 1);
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

/// Tells how far a point is, and ends it when asked.
struct Conduct<'a> {
    signals: &'a Signals<'a>,
}

impl Conduct<'_> {
    fn go_on(&self) -> ControlFlow<()> {
        if self.signals.stop.load(Ordering::Relaxed) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    }
}

impl<R> Conductor<Analyses, R> for Conduct<'_> {
    fn after_frame(&mut self, frame: &Frame<'_>, _: &mut Analyses, _: Option<&mut R>) -> ControlFlow<()> {
        self.signals.step.store(frame.step, Ordering::Relaxed);
        self.go_on()
    }

    fn between_steps(&mut self, _: &mut Analyses) -> ControlFlow<()> {
        self.go_on()
    }
}
