//! The row of a point.

use super::analyses::Analyses;
use super::columns::{ERROR_COLUMN, Results};
use super::hex;
use crate::configuration::origin;
use anyhow::Error;
use consumers::energies::{Energies, Reflection};
use consumers::table::Cell;
use producer::run::{Conductor, RunError, RunOutcome};
use producer::sweep::{Point, Sweep, Until};
use schemas::frame::{EndReason, Frame};
use schemas::manifest::RunManifest;
use schemas::recording::{RecordingWriter, WriteError, WriteOptions, state_hash};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// How long, in collision times T, the reflected energy must have been stationary for a point to end that ends
/// when it is: the window in which the uncertainty of the reflected energy is measured.
const STATIONARY_FOR: f64 = 100.0;

/// What a worker tells and is told while it computes a point.
pub(super) struct Signals<'a> {
    /// Set when the point is to be given up.
    pub(super) stop: &'a AtomicBool,
    /// The step that was reached.
    pub(super) step: &'a AtomicU64,
}

/// Computes point `index` of `sweep`, and records it if there is a path for that. None if it was stopped.
///
/// The row depends on the sweep and the index alone. A run that fails has a row, too, which says why.
///
/// # Errors
/// When the recording cannot be written.
pub(super) fn compute(
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
            if let Some(recorder) = recorder {
                recorder.discard();
            }
            return Ok(None);
        }
        Ok(outcome) => Ok(outcome),
        Err(error @ RunError::NonFinite { .. }) => Err(error.to_string()),
        Err(error) => return Err(error.into()),
    };
    analyses.finish();
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
    let mut results = Results::default();
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
            results.pulses(&analyses.pulses.counts(), &analyses.leading);
        }
        Err(error) => {
            results.word("end", EndReason::Failed.as_str()).word(ERROR_COLUMN, error);
        }
    }
    results.cells(point)
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

#[cfg(test)]
mod tests {
    use super::super::columns::columns;
    use super::*;

    /// A run that leaves the range of doubles has no results, but a row like all others that says why.
    #[test]
    fn the_row_of_a_failed_run_says_why() {
        let text = "[base]\npreset = \"homogeneous\"\n[grid]\nchain.alpha = [1.5]\n";
        let sweep = Sweep::from_toml(text, Path::new("s.toml"), |_| Err(std::io::ErrorKind::NotFound.into()));
        let sweep = sweep.expect("valid");
        let point = sweep.point(0).expect("point");
        let manifest = RunManifest::new(&point.config, "point", origin()).expect("valid");
        let analyses = Analyses::new(&manifest, None);
        let cells = row(&manifest, &point, &analyses, Err("bead 3 is not finite".to_owned()));
        let columns = columns(&sweep);
        assert_eq!(cells.len(), columns.len());
        let value = |name: &str| {
            columns.iter().zip(&cells).find(|(column, _)| column.name == name).map(|(_, cell)| cell)
        };
        assert_eq!(value("chain.alpha"), Some(&Cell::Double(1.5)));
        assert_eq!(value("end"), Some(&Cell::Word("failed".to_owned())));
        assert_eq!(value("error"), Some(&Cell::Word("bead 3 is not finite".to_owned())));
        assert_eq!(
            (value("dt_s"), value("total_j")),
            (Some(&Cell::Double(manifest.physics.dt_s)), Some(&Cell::Empty))
        );
    }
}
