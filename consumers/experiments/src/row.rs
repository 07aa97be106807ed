//! The row of a point.

use crate::columns::{ERROR_COLUMN, Results};
use crate::compare::compare;
use crate::point::PointAnalyses;
use crate::recorded::go_on;
use consumers::determination::TOLERANCE;
use consumers::energies::Energies;
use consumers::table::Cell;
use producer::run::{Conductor, Job, RunError, RunOutcome, Together};
use producer::sweep::{ParameterValue, Point, Sweep, Until};
use recording::hex;
use recording::{RecordingWriter, WriteError, WriteOptions, state_hash};
use schemas::config::{ConfigError, RunConfig};
use schemas::frame::{EndReason, Frame, FrameSink};
use schemas::manifest::{Origin, RunManifest};
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Instant;

/// Time, in collision times T, for which the reflected energy must be stationary before it ends a point. It is the
/// window in which the uncertainty of the reflected energy is measured.
const STATIONARY_FOR: f64 = 100.0;

/// Messages to and from a worker while it computes a point.
pub struct Signals<'a> {
    /// Set when the point is to be given up.
    pub stop: &'a AtomicBool,
    /// Progress of the point.
    pub at: &'a At,
}

/// Progress of a point.
#[derive(Debug, Default)]
pub struct At {
    /// Beads of its chain.
    pub beads: AtomicU64,
    /// Steps that it takes, unless it ends early.
    pub steps: AtomicU64,
    /// The step that was reached.
    pub step: AtomicU64,
}

/// A point to be computed.
pub struct Asked<'a> {
    /// Its number.
    pub index: u64,
    /// The path of its recording, if it is to have one.
    pub recording: Option<PathBuf>,
    /// Messages to and from whoever computes it.
    pub signals: Signals<'a>,
}

/// Computes points of `sweep`, those whose chains have a shape in common together, and records those that have a path for that. `done` is
/// given the place among `asked`, the row, in any order, and the time (s) of the computation; none of a point that was stopped.
///
/// A row depends on the sweep and the index alone. A run that fails or that cannot be has a row, too, which says why.
///
/// # Errors
/// When there is no such point, when a recording cannot be written, or when `done` fails.
pub fn compute<E>(
    sweep: &Sweep,
    asked: &[Asked<'_>],
    origin: &Origin,
    mut done: impl FnMut(usize, Vec<Cell>, f64) -> Result<(), E>,
) -> Result<(), E>
where
    E: From<ConfigError> + From<RunError<Infallible, WriteError>> + From<WriteError>,
{
    let (begin, mut points) = (Instant::now(), Vec::new());
    for (place, asked) in asked.iter().enumerate() {
        match Begun::of::<E>(sweep, asked, origin)? {
            Ok(begun) => points.push((place, begun)),
            Err(row) => done(place, row, 0.0)?,
        }
    }
    // the making of all is shared by those that are runs
    let made_s = begin.elapsed().as_secs_f64() / points.len() as f64;
    let (manifests, mut takers): (Vec<_>, Vec<_>) = points
        .into_iter()
        .map(|(place, begun)| (begun.manifest, Some((place, begun.parameters, begun.takers))))
        .unzip();
    for together in Together::of(&manifests) {
        let (mut since, mut wall_s, mut failure) = (Instant::now(), made_s, None);
        let numbers = together.numbers().to_vec();
        let mut left = numbers.len();
        let mut begun: Vec<_> = numbers.iter().filter_map(|number| takers[*number].take()).collect();
        let mut of: BTreeMap<usize, _> = BTreeMap::new();
        let mut jobs = Vec::new();
        for (number, (place, parameters, takers)) in numbers.iter().zip(&mut begun) {
            of.insert(*number, (*place, &*parameters));
            jobs.push(takers.job(&manifests[*number]));
        }
        together.run(jobs, |number, job, outcome| {
            let (place, parameters) = of[&number];
            let ended = row::<E>(sweep, parameters, job, outcome);
            // chains beside each other share the time for which they are
            wall_s += since.elapsed().as_secs_f64() / left as f64;
            (since, left) = (Instant::now(), left - 1);
            match ended.and_then(|row| row.map_or(Ok(()), |row| done(place, row, wall_s))) {
                Ok(()) => ControlFlow::Continue(()),
                Err(error) => {
                    failure = Some(error);
                    ControlFlow::Break(())
                }
            }
        });
        failure.map_or(Ok(()), Err)?;
    }
    Ok(())
}

/// A point that is a run, and all who take part in it.
struct Begun<'a> {
    manifest: RunManifest,
    parameters: Vec<Option<ParameterValue>>,
    takers: Takers<'a>,
}

/// All who take part in a run.
struct Takers<'a> {
    analyses: PointAnalyses,
    recorder: Recorder,
    conduct: Conduct<'a>,
}

/// A recording, if there is to be one.
struct Recorder(Option<RecordingWriter>);

impl FrameSink for Recorder {
    type Error = WriteError;

    fn accept(&mut self, frame: &Frame<'_>) -> Result<(), WriteError> {
        self.0.as_mut().map_or(Ok(()), |recorder| recorder.accept(frame))
    }
}

impl<'a> Begun<'a> {
    /// The run of a point, or the row of one that is none.
    fn of<E>(sweep: &Sweep, asked: &'a Asked<'a>, origin: &Origin) -> Result<Result<Self, Vec<Cell>>, E>
    where
        E: From<ConfigError> + From<WriteError>,
    {
        let (index, signals) = (asked.index, &asked.signals);
        let Point { parameters, config, physics, .. } = match sweep.point(index) {
            Ok(point) => point,
            Err(error) => return Ok(Err(impossible(sweep, &sweep.parameters_of(index)?, error))),
        };
        let manifest = RunManifest::of(physics, &config, &format!("point-{index:06}"), origin.clone())?;
        signals.at.begin(&manifest);
        let analyses = match PointAnalyses::new(sweep, &manifest) {
            Ok(analyses) => analyses,
            Err((key, message)) => {
                let error = ConfigError { path: None, line: None, key, message };
                return Ok(Err(impossible(sweep, &parameters, error)));
            }
        };
        let recorder = asked.recording.as_deref();
        let recorder = recorder.map(|path| record(path, &manifest, sweep, (index, &config))).transpose()?;
        let conduct = Conduct::new(sweep, &manifest, signals);
        Ok(Ok(Self {
            manifest,
            parameters,
            takers: Takers { analyses, recorder: Recorder(recorder), conduct },
        }))
    }
}

/// A run that somebody conducts as a point of a sweep.
type PointJob<'a, 'b> = Job<'a, PointAnalyses, Recorder, Conduct<'b>>;

impl<'b> Takers<'b> {
    fn job<'a>(&'a mut self, manifest: &'a RunManifest) -> PointJob<'a, 'b> {
        let Self { analyses, recorder, conduct } = self;
        let recorder = recorder.0.is_some().then_some(recorder);
        Job { manifest, publisher: analyses, recorder, conductor: conduct }
    }
}

/// The row of a run, which ended with `outcome`; none if it was stopped.
fn row<E>(
    sweep: &Sweep,
    parameters: &[Option<ParameterValue>],
    job: PointJob<'_, '_>,
    outcome: Result<RunOutcome, RunError<Infallible, WriteError>>,
) -> Result<Option<Vec<Cell>>, E>
where
    E: From<RunError<Infallible, WriteError>> + From<WriteError>,
{
    let Job { manifest, publisher: analyses, recorder, conductor } = job;
    let (recorder, settled) = (recorder.and_then(|recorder| recorder.0.take()), conductor.settled);
    let outcome = match outcome {
        Ok(outcome) if outcome.reason == EndReason::Interrupted && settled.is_none() => {
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
    let outcome = outcome.map(|outcome| (outcome, settled));
    let mut results = results(sweep, manifest, analyses, &outcome);
    if sweep.check() && !determine(&mut results, sweep, manifest, analyses.step, conductor.signals.stop) {
        return Ok(None);
    }
    Ok(Some(results.cells(parameters)))
}

/// The row of a point that no run can be.
fn impossible(sweep: &Sweep, parameters: &[Option<ParameterValue>], error: ConfigError) -> Vec<Cell> {
    let mut results = Results::of(sweep);
    // where the sweep file lies decides no row
    let error = ConfigError { path: None, line: None, ..error };
    results.word("end", EndReason::Failed.as_str()).word(ERROR_COLUMN, error.to_string());
    results.cells(parameters)
}

impl At {
    fn begin(&self, manifest: &RunManifest) {
        self.step.store(0, Ordering::Relaxed);
        self.beads.store(manifest.physics.beads, Ordering::Relaxed);
        self.steps.store(manifest.physics.step_count, Ordering::Relaxed);
    }
}

/// Finds out until when the run up to `last_step` is determined; false if it was stopped.
/// The reason why a run with baths is compared with no others.
pub const OTHER_NOISE: &str = "a run with baths is not determined: steps of another length have other noise; compare seeds instead, or leave [[bath]] out";

fn determine(
    results: &mut Results,
    sweep: &Sweep,
    manifest: &RunManifest,
    last_step: u64,
    stop: &AtomicBool,
) -> bool {
    if !manifest.physics.baths.is_empty() {
        results.word(ERROR_COLUMN, OTHER_NOISE.to_owned());
        return true;
    }
    match compare(manifest, sweep.split_bead(), (last_step, TOLERANCE), stop, |_| ()) {
        Ok(compared) => {
            if let Some(outcome) = compared.determination.outcome() {
                results.determined(&outcome);
            }
            !compared.stopped
        }
        Err(error) => {
            results.word(ERROR_COLUMN, error.to_string());
            true
        }
    }
}

fn record(
    path: &Path,
    manifest: &RunManifest,
    sweep: &Sweep,
    (index, config): (u64, &RunConfig),
) -> Result<RecordingWriter, WriteError> {
    let from = format!("# point {index} of {}\n", sweep.path().display());
    // what is there is of an attempt that has no row
    let options = WriteOptions { force: true, ..WriteOptions::default() };
    RecordingWriter::create(path, manifest, &(from + &config.to_toml()), &options)
}

fn results(
    sweep: &Sweep,
    manifest: &RunManifest,
    analyses: &mut PointAnalyses,
    outcome: &Result<(RunOutcome, Option<Settled>), String>,
) -> Results {
    let physics = &manifest.physics;
    let mut results = Results::of(sweep);
    results.double("dt_s", physics.dt_s).word("physics_sha256", hex(&physics.hash()));
    match outcome {
        Ok((outcome, settled)) => {
            let end = match (outcome.reason, settled) {
                (EndReason::Interrupted, Some(settled)) => settled.as_str(),
                (reason, _) => reason.as_str(),
            };
            results.word("end", end).integer("steps", outcome.last_step);
            results.double("time_s", physics.time_s(outcome.last_step));
            results.double("relative_drift", outcome.relative_drift);
            results.integer("front_bead", analyses.front_bead(manifest));
            results.word("state_sha256", state_hash(analyses.step, &analyses.state));
            if let Some(energies) = analyses.energies().outcome() {
                results.energies(&energies);
            }
            results.pulses(&analyses.pulses().counts(), &analyses.leading);
            results.measured(analyses.measured(manifest));
        }
        Err(error) => {
            results.word("end", EndReason::Failed.as_str()).word(ERROR_COLUMN, error.as_str());
        }
    }
    results
}

/// Reason why nothing more can be learnt of the reflected energy.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Settled {
    /// It has been stationary for [`STATIONARY_FOR`].
    Stationary,
    /// A front has met an end of the chain before that, after which it is not looked at.
    MetEnd,
    /// Energy was exchanged with the outside before that.
    Exchanged,
}

impl Settled {
    /// The word in the column `end`.
    fn as_str(self) -> &'static str {
        match self {
            Self::Stationary => "stationary",
            Self::MetEnd => "met end",
            Self::Exchanged => "exchanged",
        }
    }
}

/// Reports the progress of a point, and ends it when asked, or when nothing is left to find out.
struct Conduct<'a> {
    signals: &'a Signals<'a>,
    /// Time (s) for which the reflected energy must be stationary to end the point, if that ends it.
    stationary_for_s: Option<f64>,
    /// Reason for the end, unless the point was given up.
    settled: Option<Settled>,
}

impl<'a> Conduct<'a> {
    fn new(sweep: &Sweep, manifest: &RunManifest, signals: &'a Signals<'a>) -> Self {
        let ends = sweep.until() == Until::Stationary;
        let stationary_for_s = ends.then(|| STATIONARY_FOR * manifest.physics.scales().time_s);
        Self { signals, stationary_for_s, settled: None }
    }

    /// Reason why nothing more can be learnt of the reflected energy, if that ends the point.
    fn settled(&self, energies: &Energies, time_s: f64) -> Option<Settled> {
        let wanted_s = self.stationary_for_s?;
        let reflection = energies.outcome()?.reflection.ok()?;
        if reflection.met_end.is_some() {
            return Some(Settled::MetEnd);
        }
        let Some(since) = reflection.stationary_since else {
            return reflection.exchanged.map(|_| Settled::Exchanged);
        };
        (time_s - since.time_s >= wanted_s).then_some(Settled::Stationary)
    }
}

impl<R> Conductor<PointAnalyses, R> for Conduct<'_> {
    fn after_frame(
        &mut self,
        frame: &Frame<'_>,
        analyses: &mut PointAnalyses,
        _: Option<&mut R>,
    ) -> ControlFlow<()> {
        self.signals.at.step.store(frame.step, Ordering::Relaxed);
        self.settled = self.settled(analyses.energies(), frame.time_s);
        if self.settled.is_some() {
            return ControlFlow::Break(());
        }
        go_on(self.signals.stop)
    }

    fn between_steps(&mut self, _: &mut PointAnalyses) -> ControlFlow<()> {
        go_on(self.signals.stop)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::columns::columns;

    fn origin() -> Origin {
        Origin { program: "test".into(), host: "here".into(), started_unix_ns: 1 }
    }

    fn sweep(text: &str) -> Sweep {
        Sweep::from_toml(
            text,
            Path::new("s.toml"),
            |_| Err(std::io::ErrorKind::NotFound.into()),
            crate::HOOKS,
        )
        .expect("valid")
    }

    fn row(sweep: &Sweep, index: u64) -> Vec<Cell> {
        let signals = Signals { stop: &AtomicBool::new(false), at: &At::default() };
        let asked = Asked { index, recording: None, signals };
        let mut found = None;
        let computed: Result<(), Box<dyn std::error::Error>> =
            compute(sweep, &[asked], &origin(), |_, row, _| {
                found = Some(row);
                Ok(())
            });
        computed.expect("no recording");
        found.expect("not stopped")
    }

    /// The reflected energy becomes stationary in both chains, but in the shorter a front meets an end 4 T later.
    #[test]
    fn the_end_of_a_point_is_the_condition_that_ended_it() {
        let sweep = sweep(
            "until = \"stationary\"\n[base]\npreset = \"homogeneous\"\ntime.duration_s = 0.1\n\
             chain.impurities = [{ bead = 80, mass_kg = 2e-3 }]\n[grid]\n\"chain.beads\" = [100, 240]\n",
        );
        let columns = columns(&sweep);
        for (index, end, collision_times) in [(0, "met end", 0.0..10.0), (1, "stationary", 100.0..101.0)] {
            let cells = row(&sweep, index);
            let cell = |name| columns.iter().zip(&cells).find(|(c, _)| c.name == name).map(|(_, cell)| cell);
            let seconds = |name| match cell(name) {
                Some(Cell::Double(value)) => *value,
                found => panic!("{name}: {found:?}"),
            };
            assert_eq!(cell("end"), Some(&Cell::Word(end.to_owned())));
            let point = sweep.point(index).expect("point");
            let scales = point.physics.scales();
            let stationary_for = (seconds("time_s") - seconds("stationary_since_s")) / scales.time_s;
            assert!(collision_times.contains(&stationary_for), "{end} after {stationary_for} T");
        }
    }

    /// Chains beside each other have the rows that each has alone: those that end early, that leave the range of doubles, of other
    /// shapes, with and without a load, and with steps of their own.
    #[test]
    fn points_together_have_the_rows_of_points_alone() {
        let uneven = "until = \"stationary\"\n[base]\npreset = \"homogeneous\"\nchain.beads = 60\n\
                      chain.impurities = [{ bead = 30, mass_kg = 1e-3 }]\ntime.duration_s = 0.05\n[grid]\n\
                      \"chain.impurities[0].mass_kg\" = [2e-4, 4e-4, 6e-4, 9e-4, 2e-3, 5e-3, 1e-2, 3e-2]\n";
        let bursting = "[base]\nchain = { beads = 12, bead_mass_kg = 1e-3, bonds = { linear = 1e5, quadratic = 1e8 } }\n\
                        ends = { left = \"fixed\", right = \"fixed\" }\nstriker.bead = 0\ntime.duration_s = 2e-3\n[grid]\n\
                        \"striker.velocity_m_s\" = [0.1, 0.2, 0.5, 1.0, 30.0, 100.0, 0.7]\n";
        let shapes = "[base]\npreset = \"homogeneous\"\ntime.duration_s = 3e-3\n[grid]\n\
                      \"chain.alpha\" = [1.3, 1.5]\n\"chain.beads\" = [20, 21]\n\"load.precompression_n\" = [0, 1, 20]\n\
                      \"integrator.method\" = [\"rkn4\", \"velocity-verlet\"]\n";
        let (mut failed, mut settled) = (0, 0);
        for text in [uneven, bursting, shapes] {
            let sweep = sweep(text);
            let (stop, all) = (AtomicBool::new(false), 0..sweep.point_count());
            let at: Vec<_> = all.clone().map(|_| At::default()).collect();
            let asked =
                |index: u64, at| Asked { index, recording: None, signals: Signals { stop: &stop, at } };
            let together: Vec<_> = all.zip(&at).map(|(index, at)| asked(index, at)).collect();
            let mut rows = Vec::new();
            let computed: Result<(), Box<dyn std::error::Error>> =
                compute(&sweep, &together, &origin(), |place, row, _| {
                    rows.push((together[place].index, row));
                    Ok(())
                });
            computed.expect("no recording");
            assert_eq!(rows.len() as u64, sweep.point_count());
            for (index, row) in rows {
                assert_eq!(row, self::row(&sweep, index), "point {index} of {text}");
                failed += usize::from(row.contains(&Cell::Word("failed".into())));
                settled += usize::from(row.contains(&Cell::Word("met end".into())));
            }
        }
        assert!(failed == 2 && settled > 1, "{failed} failed, {settled} ended early");
    }

    /// A sweep starts before it has checked every point. A point that cannot run gets a row with the reason, wherever the
    /// sweep file lies.
    #[test]
    fn the_row_of_an_impossible_point_says_why() {
        let text = "[base]\npreset = \"homogeneous\"\nchain.beads = 2100\n\
                    chain.impurities = [{ bead = 0, mass_kg = 2e-3 }, { bead = 1, mass_kg = 2e-3 }]\n[grid]\n\
                    \"chain.impurities[0].bead\" = { from = 1, to = 2000, count = 2000 }\n\
                    \"chain.impurities[1].bead\" = { from = 2, to = 2001, count = 2000 }\n";
        let sweep = sweep(text);
        let cells = row(&sweep, 2000);
        let columns = columns(&sweep);
        assert_eq!(cells.len(), columns.len());
        let place = columns.iter().position(|column| column.name == ERROR_COLUMN).expect("a column");
        let Cell::Word(error) = &cells[place] else { panic!("{:?}", cells[place]) };
        assert_eq!(cells[..2], [2, 2].map(Cell::Integer));
        assert!(
            error.starts_with("chain.impurities[1].bead: found 2") && error.ends_with("(point 2000)"),
            "{error}"
        );
    }

    /// A run that leaves the range of doubles has no results, but a row like all others that says why.
    #[test]
    fn the_row_of_a_failed_run_says_why() {
        let text = "[base]\npreset = \"homogeneous\"\n[grid]\nchain.alpha = [1.5]\n";
        let sweep = sweep(text);
        let point = sweep.point(0).expect("point");
        let manifest = RunManifest::new(&point.config, "point", origin()).expect("valid");
        let mut analyses = PointAnalyses::new(&sweep, &manifest).unwrap_or_else(|(_, why)| panic!("{why}"));
        let failed = Err("bead 3 is not finite".to_owned());
        let cells = results(&sweep, &manifest, &mut analyses, &failed).cells(&point.parameters);
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
