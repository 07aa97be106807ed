//! An orbit file: a configuration with a table `[orbit]`, and perhaps `[continue]` or `[grid]`.

mod grid;
mod runs;
mod schema;

pub use grid::Grid;
pub use schema::schema;

use crate::branch::Stretch;
use crate::spectra::Spectrum;
use crate::{Asked, MapError, Options, Orbit, Problem};
use producer::sweep::KeyPath;
use schemars::JsonSchema;
use schemas::config::{ConfigError, Initial, RunConfig, Strikers, TimeConfig};
use schemas::drive::Waveform;
use schemas::manifest::Physics;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use toml::{Table, Value};
use waves::linear::{LinearChain, check_beads_are_free};
use waves::modes::Modes;

/// A configuration with everything in it that it only names, looked for beside a file.
pub type Prepare = fn(RunConfig, Option<&Path>) -> Result<RunConfig, ConfigError>;

/// The table `[orbit]`.
#[derive(Debug, Clone, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
#[schemars(inline)]
struct Written {
    /// The period (s); beside another quantity a first guess of it. A drive gives it.
    #[schemars(extend("exclusiveMinimum" = 0))]
    period_s: Option<f64>,
    /// The energy (J), in place of the period.
    #[schemars(extend("exclusiveMinimum" = 0))]
    energy_j: Option<f64>,
    /// The displacement (m) at the beginning of the bead that the seed displaces most, in place of the period.
    amplitude_m: Option<f64>,
    /// Periods of the drive in one of the orbit [default: 1].
    #[schemars(range(min = 1, max = 1000))]
    periods: Option<u64>,
    /// Beads by which the state has moved after a period.
    shift_beads: u64,
    /// Steps of a period, an even number [default: those that a run takes for it].
    #[schemars(range(min = 1, max = 100_000_000))]
    steps: Option<u64>,
    /// Parts of the period, each with a beginning of its own [default: 1].
    #[schemars(range(min = 1, max = 1000))]
    segments: Option<u64>,
    /// A linear mode as the seed [default: the initial state].
    mode: Option<SeedMode>,
}

/// A linear mode as a seed.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
struct SeedMode {
    /// Its number, from 1, as `beadline modes` counts them.
    #[schemars(range(min = 1))]
    number: u64,
    /// Its largest displacement (m).
    displacement_m: f64,
}

/// The table `[continue]`.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(inline)]
struct Continue {
    /// The key of the parameter, such as `orbit.energy_j`.
    key: String,
    /// Its value at the first orbit.
    from: f64,
    /// Its value at which the branch ends.
    to: f64,
    /// Length of the first step, as a part of the whole way.
    #[serde(default = "usual_step")]
    #[schemars(range(min = 1e-6, max = 1))]
    step: f64,
    /// The most orbits of the branch.
    #[serde(default = "usual_most")]
    #[schemars(range(min = 2, max = 1_000_000))]
    most: usize,
    /// True if the branches that are born at its changes of stability are followed, too [default: false].
    #[serde(default)]
    branches: bool,
    /// Runs that are compared with the branch.
    spectra: Option<runs::Runs>,
}

fn usual_step() -> f64 {
    0.02
}

fn usual_most() -> usize {
    1000
}

/// An orbit file, read.
#[derive(Debug, Clone)]
pub struct File {
    path: PathBuf,
    document: Table,
    written: Written,
    follow: Option<(KeyPath, Continue)>,
    /// The seed as lists.
    seed: Initial,
    /// The period (s) of a mode that is the seed.
    mode_period_s: Option<f64>,
    grid: Option<Grid>,
}

const TABLES: [&str; 3] = ["orbit", "continue", "grid"];

impl File {
    /// Reads the file `path` with the contents `text`.
    ///
    /// # Errors
    /// With the key, the value and what is allowed.
    pub fn read(path: &Path, text: &str, prepare: Prepare) -> Result<Self, ConfigError> {
        let read = || -> Result<Self, ConfigError> {
            let document: Table = text.parse().map_err(|error| ConfigError::of_toml(&error, text))?;
            let tables: Tables = toml::from_str(text).map_err(|error| ConfigError::of_toml(&error, text))?;
            let follow = tables.r#continue.map(Continue::checked).transpose()?;
            let Some(axes) = Grid::axes(text, path)? else {
                let written = tables.orbit.unwrap_or_default();
                return Self::of((path, document, written), follow, prepare);
            };
            if follow.is_some() {
                return Err(refused("continue", "[grid] beside it", "one of the two"));
            }
            let number = |value: &Value| value.as_float().or(value.as_integer().map(|whole| whole as f64));
            let end = axes[1].values.last().and_then(|(value, _)| number(value));
            let line = |changed: Table, key: &KeyPath, from: f64| {
                let to = end.unwrap_or(from);
                let written = Written::in_document(&changed)?;
                let (name, step, most) = (key.to_string(), usual_step(), usual_most());
                let follow = Continue { key: name, from, to, step, most, branches: false, spectra: None };
                Self::of((path, changed, written), Some((key.clone(), follow)), prepare)
            };
            let grid = Grid::of(&axes, &document, line)?;
            let first = grid.first().clone();
            Ok(Self { grid: Some(grid), ..first })
        };
        read().map_err(|error| error.located(text, Some(path)))
    }

    fn of(
        (path, document, written): (&Path, Table, Written),
        follow: Option<(KeyPath, Continue)>,
        prepare: Prepare,
    ) -> Result<Self, ConfigError> {
        let (path, seed) = (path.to_owned(), Initial::default());
        let mut file = Self { path, document, written, follow, seed, mode_period_s: None, grid: None };
        file.check()?;
        file.find_seed(prepare)?;
        file.check_key(&file.problem(file.from())?)?;
        file.asked_spectra().map_or(Ok(()), |asked| asked.check(&file))?;
        Ok(file)
    }

    fn asked_spectra(&self) -> Option<&runs::Runs> {
        self.follow.as_ref()?.1.spectra.as_ref()
    }

    /// Makes the runs from the seed whose spectra are asked for beside a branch; none if there are no such.
    ///
    /// # Errors
    /// When a run leaves the range of doubles, or is stopped.
    pub fn spectra(&self, stop: &AtomicBool) -> Result<Vec<Spectrum>, MapError> {
        self.asked_spectra().map_or(Ok(Vec::new()), |asked| asked.make(self, stop))
    }

    /// The grid, if orbits at all points of one are asked for.
    pub fn grid(&self) -> Option<&Grid> {
        self.grid.as_ref()
    }

    /// The parameter at the first orbit.
    pub fn from(&self) -> f64 {
        self.follow.as_ref().map_or(0.0, |(_, follow)| follow.from)
    }

    /// The key that a branch is followed along, and the stretch of it; none if one orbit is asked for.
    pub fn stretch(&self) -> Option<(&str, Stretch)> {
        let (_, Continue { key, from, to, step, most, .. }) = self.follow.as_ref()?;
        Some((key, Stretch { from: *from, to: *to, step: *step, most: *most }))
    }

    /// True if branches that are born on the way are followed.
    pub fn has_branches(&self) -> bool {
        self.follow.as_ref().is_some_and(|(_, follow)| follow.branches)
    }

    /// Settings of the search.
    pub fn options(&self) -> Options {
        let Written { steps, segments, shift_beads, period_s, .. } = self.written;
        Options { steps, segments, shift_beads, period_s: period_s.or(self.mode_period_s), most_dense: None }
    }

    /// The problem at a value of the parameter.
    ///
    /// # Errors
    /// When no chain has it.
    pub fn problem(&self, parameter: f64) -> Result<Problem, ConfigError> {
        let (config, written) = self.at(parameter)?;
        let physics = Physics::resolve(&config)?;
        let asked = match (written.energy_j, written.amplitude_m) {
            (Some(energy_j), _) => Asked::EnergyJ(energy_j),
            (_, Some(amplitude_m)) => Asked::AmplitudeM(amplitude_m),
            _ => Asked::PeriodS(config.time.duration_s),
        };
        Ok(Problem { physics, asked })
    }

    /// The configuration of a run over one period of `orbit`.
    ///
    /// # Errors
    /// When the file cannot be read any more.
    pub fn config_of(&self, orbit: &Orbit) -> Result<RunConfig, ConfigError> {
        let (mut config, _) = self.at(orbit.unknown.parameter)?;
        config.initial = orbit.initial();
        config.time = TimeConfig { duration_s: orbit.period_s(), dt_s: Some(orbit.physics.dt_s) };
        Ok(config)
    }

    /// The configuration at a value of the parameter, with the seed, and the table of the orbit.
    fn at(&self, parameter: f64) -> Result<(RunConfig, Written), ConfigError> {
        let mut document = self.document.clone();
        if let Some((key, follow)) = &self.follow {
            let refuse =
                |why: String| ConfigError { path: None, line: None, key: follow.key.clone(), message: why };
            key.set(&mut document, Value::Float(parameter)).map_err(refuse)?;
        }
        let written = Written::in_document(&document).map_err(|error| match &self.follow {
            Some((_, follow)) => refused(
                &follow.key,
                &parameter.to_string(),
                "a key that takes every number: a branch, or a line of a map, goes through those in between",
            ),
            None => error,
        })?;
        for table in TABLES.into_iter().chain(["initial", "striker"]) {
            document.remove(table);
        }
        give_duration(&mut document);
        let seed = Value::try_from(&self.seed).unwrap_or_else(|_| Value::Table(Table::new()));
        document.extend([("initial".to_owned(), seed)]);
        let mut config = RunConfig::from_table(&document)?;
        config.time.duration_s = self.period_s(&config, &written)?;
        Ok((config, written))
    }

    /// The period (s), or a first guess of it.
    fn period_s(&self, config: &RunConfig, written: &Written) -> Result<f64, ConfigError> {
        let key = "orbit.period_s";
        if config.drive.is_empty() {
            let allowed = "a period; or orbit.energy_j or orbit.amplitude_m beside a first guess of it, or beside a mode as the seed (orbit.mode)";
            let is_asked = written.energy_j.is_some() || written.amplitude_m.is_some();
            let of_mode = self.mode_period_s.filter(|_| is_asked);
            return written.period_s.or(of_mode).ok_or_else(|| refused(key, "nothing", allowed));
        }
        if let Some(period_s) = written.period_s {
            return Err(refused(
                key,
                &period_s.to_string(),
                "nothing beside [[drive]], which gives the period; orbit.periods is a multiple of it",
            ));
        }
        let mut first_hz = None;
        let periods = written.periods.unwrap_or(1) as f64;
        for (d, drive) in config.drive.iter().enumerate() {
            let key = format!("drive[{d}].{}", drive.prescribes.key());
            let allowed = "a sine without ramps and end, or a constant: others have no period";
            match &drive.waveform {
                Waveform::Constant(_) => {}
                Waveform::Sine(sine) if sine.ramp_s == 0.0 && sine.until_s.is_none() => {
                    let first_hz = *first_hz.get_or_insert(sine.frequency_hz);
                    let turns = periods * sine.frequency_hz / first_hz;
                    if (turns - turns.round()).abs() > 1e-9 {
                        let allowed =
                            "a frequency that makes whole turns in a period of the orbit; see orbit.periods";
                        return Err(refused(&key, &format!("{} Hz", sine.frequency_hz), allowed));
                    }
                }
                other => return Err(refused(&key, other.kind(), allowed)),
            }
        }
        let no_period = || refused("drive", "no sine", "at least one, which gives the period");
        first_hz.map(|frequency_hz| periods / frequency_hz).ok_or_else(no_period)
    }

    /// Refuses tables that ask for nothing that can be found.
    fn check(&self) -> Result<(), ConfigError> {
        let Written { period_s, energy_j, amplitude_m, periods, steps, segments, .. } = self.written;
        if energy_j.is_some() && amplitude_m.is_some() {
            return Err(refused("orbit.energy_j", "amplitude_m beside it", "one of the two"));
        }
        let numbers = [("period_s", period_s), ("energy_j", energy_j), ("amplitude_m", amplitude_m)];
        for (name, number) in numbers {
            let is_possible = |x: f64| x.is_finite() && (x > 0.0 || name == "amplitude_m" && x != 0.0);
            if let Some(number) = number.filter(|number| !is_possible(*number)) {
                let allowed =
                    if name == "amplitude_m" { "a number other than 0" } else { "a number above 0" };
                return Err(refused(&format!("orbit.{name}"), &number.to_string(), allowed));
            }
        }
        for (name, count, most) in
            [("periods", periods, 1000), ("steps", steps, 100_000_000), ("segments", segments, 1000)]
        {
            if let Some(count) = count.filter(|count| !(1..=most).contains(count)) {
                let allowed = format!("a whole number from 1 to {most}");
                return Err(refused(&format!("orbit.{name}"), &count.to_string(), &allowed));
            }
        }
        let parts = 2 * segments.unwrap_or(1);
        if let Some(steps) = steps.filter(|steps| !steps.is_multiple_of(parts)) {
            let allowed = format!("a multiple of {parts}: twice the segments");
            return Err(refused("orbit.steps", &steps.to_string(), &allowed));
        }
        if let Some(periods) = periods.filter(|_| !self.document.contains_key("drive")) {
            return Err(refused(
                "orbit.periods",
                &periods.to_string(),
                "nothing without [[drive]], whose periods they are",
            ));
        }
        Ok(())
    }

    /// Refuses a key that changes nothing: the seed and the steps are those of the first orbit, which is `first`.
    fn check_key(&self, first: &Problem) -> Result<(), ConfigError> {
        let Some((_, Continue { key, from, to, .. })) = &self.follow else { return Ok(()) };
        // a branch may begin where there is no chain at its end
        let Ok(Problem { physics, asked }) = self.problem(*to) else { return Ok(()) };
        let Physics { dt_s, step_count, .. } = first.physics;
        if asked != first.asked || (Physics { dt_s, step_count, ..physics }) != first.physics {
            return Ok(());
        }
        let allowed = "a key that changes the chain, its drives, or what is asked for (orbit.energy_j, orbit.amplitude_m, or else \
                       orbit.period_s): the seed, the first guess of the period and the steps are those of the first orbit";
        Err(refused(key, &format!("no effect from {from:?} to {to:?}"), allowed))
    }

    /// Finds the seed: a mode, or the initial state of the configuration.
    fn find_seed(&mut self, prepare: Prepare) -> Result<(), ConfigError> {
        let mut document = self.document.clone();
        document.retain(|table, _| !TABLES.contains(&table));
        give_duration(&mut document);
        // the line is that of the key in the file
        let unplaced = |error: ConfigError| ConfigError { line: None, ..error };
        let config =
            RunConfig::of_chain(&toml::to_string(&document).unwrap_or_default()).map_err(unplaced)?;
        let mut config = prepare(config, self.path.parent())?;
        let period_s = self.written.period_s.unwrap_or(1.0);
        config.time.duration_s = config.time.dt_s.map_or(period_s, |dt_s| period_s.max(dt_s));
        let beads = usize::try_from(config.chain.beads).unwrap_or(0);
        let Some(mode) = self.written.mode else {
            if config.initial.is_none() && config.drive.is_empty() && config.striker.velocity_m_s == 0.0 {
                let allowed = "a seed: { number, displacement_m } of a mode; or [initial], or [striker]";
                return Err(refused("orbit.mode", "nothing", allowed));
            }
            let (u_m, v_m_s) = Physics::resolve(&config)?.initial_state();
            let velocities_m_s = if v_m_s.iter().all(|v| *v == 0.0) { Vec::new() } else { v_m_s };
            let Initial { resonator_displacements_m, resonator_velocities_m_s, .. } = config.initial;
            self.seed = Initial {
                displacements_m: u_m,
                velocities_m_s,
                resonator_displacements_m,
                resonator_velocities_m_s,
                ..Initial::default()
            };
            return Ok(());
        };
        config.striker = Strikers::default();
        // overlaps of the size that is asked for, until the mode is known
        let overlaps = (0..beads).map(|bead| (0.5 - (bead % 2) as f64) * mode.displacement_m);
        config.initial = Initial { displacements_m: overlaps.collect(), ..Initial::default() };
        let refuse =
            |why: String| ConfigError { path: None, line: None, key: "orbit.mode".to_owned(), message: why };
        let physics = Physics::resolve(&config)?;
        check_beads_are_free(&physics).map_err(&refuse)?;
        let linear = LinearChain::of(&physics.chain()).map_err(|error| refuse(error.to_string()))?;
        let modes = Modes::of(&linear).map_err(|error| refuse(error.to_string()))?;
        let place = usize::try_from(mode.number).ok().and_then(|number| number.checked_sub(1));
        let Some(place) = place.filter(|place| *place < modes.count()) else {
            let allowed = format!("a mode from 1 to {}; `beadline modes` lists them", modes.count());
            return Err(refused("orbit.mode.number", &mode.number.to_string(), &allowed));
        };
        let shape = modes.shape(place).into_iter().map(|u| u * mode.displacement_m);
        self.seed = Initial { displacements_m: shape.collect(), ..Initial::default() };
        self.mode_period_s = Some(1.0 / modes.frequency_hz(place)).filter(|period_s| period_s.is_finite());
        Ok(())
    }
}

impl Written {
    fn in_document(document: &Table) -> Result<Self, ConfigError> {
        let orbit = document.get("orbit").cloned().unwrap_or_else(|| Value::Table(Table::new()));
        Self::deserialize(orbit).map_err(|error| ConfigError::of_toml(&error, ""))
    }
}

impl Continue {
    fn checked(self) -> Result<(KeyPath, Self), ConfigError> {
        let refuse =
            |why| ConfigError { path: None, line: None, key: "continue.key".to_owned(), message: why };
        let key = KeyPath::parse(&self.key).map_err(refuse)?;
        let is_there = self.from.is_finite() && self.to.is_finite() && self.from != self.to;
        if !is_there {
            return Err(refused("continue.to", &self.to.to_string(), "a number other than continue.from"));
        }
        if !(1e-6..=1.0).contains(&self.step) {
            return Err(refused("continue.step", &self.step.to_string(), "a part of the way from 1e-6 to 1"));
        }
        if !(2..=1_000_000).contains(&self.most) {
            return Err(refused("continue.most", &self.most.to_string(), "a whole number from 2 to 1000000"));
        }
        Ok((key, self))
    }
}

/// Gives the run of a file a duration that decides nothing, where the file has none.
fn give_duration(document: &mut Table) {
    if let Value::Table(time) = document.entry("time").or_insert_with(|| Value::Table(Table::new())) {
        time.entry("duration_s").or_insert(Value::Float(1.0));
    }
}

fn refused(key: &str, found: &str, allowed: &str) -> ConfigError {
    ConfigError::value(key, found, allowed)
}

/// The tables of an orbit file that a configuration does not have.
#[derive(Deserialize, JsonSchema)]
struct Tables {
    /// The orbit that is looked for, and how.
    orbit: Option<Written>,
    /// The parameter along which orbits are followed.
    r#continue: Option<Continue>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Search;

    fn read(text: &str) -> Result<File, ConfigError> {
        File::read(Path::new("orbit.toml"), text, |config, _| Ok(config))
    }

    const RING: &str = "chain = { beads = 16, bead_mass_kg = 1.0, bonds = { linear = 1.0, cubic = 1.0 } }\n\
        ends = { left = 'periodic', right = 'periodic' }\n";

    #[test]
    fn the_documented_orbit_is_one() {
        let page = include_str!("../../../docs/CONFIGURATION.md");
        let section = page.split("## Orbits").nth(1).expect("the section");
        let block =
            section.split("```toml").nth(1).and_then(|rest| rest.split("```").next()).expect("an example");
        let file = read(&format!("{RING}{block}")).expect("valid");
        let (key, stretch) = file.stretch().expect("a branch");
        assert_eq!((key, stretch.from, stretch.to, stretch.most), ("orbit.energy_j", 0.16, 0.3, 1000));
        assert_eq!(file.problem(0.2).expect("a problem").asked, Asked::EnergyJ(0.2));
    }

    #[test]
    fn errors_have_the_line_of_the_key() {
        for (text, expected) in [
            (format!("{RING}[orbit]\nperiod_s = -1.0\n"), "orbit.toml:4: orbit.period_s"),
            (
                format!("{RING}[orbit]\nmode = {{ number = 17, displacement_m = 1.0 }}\n"),
                "orbit.toml:4: orbit.mode.number",
            ),
            (format!("{RING}[orbit]\nsegments = 0\n"), "orbit.toml:4: orbit.segments"),
            (
                format!("{RING}[orbit]\nmode = {{ number = 1, displacement_m = 1.0 }}\n[time]\ndt_s = -1\n"),
                "orbit.toml:6: time.dt_s",
            ),
            (
                RING.replace("beads = 16", "beads = 1")
                    + "[orbit]\nmode = { number = 1, displacement_m = 1.0 }\n",
                "orbit.toml:1: chain.beads",
            ),
        ] {
            let Err(error) = read(&text) else { unreachable!("{text}") };
            assert!(error.to_string().starts_with(expected), "{error}");
        }
    }

    #[test]
    fn a_key_that_changes_nothing_is_refused() {
        let energy = "[orbit]\nenergy_j = 0.1\nmode = { number = 16, displacement_m = 0.05 }\n";
        let period = "[orbit]\nperiod_s = 3.0\nmode = { number = 16, displacement_m = 0.05 }\n";
        for (orbit, key, from, to, has_effect) in [
            (energy, "orbit.energy_j", 0.04, 0.05, true),
            (energy, "chain.bonds.cubic", 0.5, 1.5, true),
            (energy, "orbit.mode.displacement_m", 0.04, 0.05, false),
            (energy, "orbit.period_s", 3.0, 3.5, false),
            (energy, "orbit.amplitude_m", 0.04, 0.05, false),
            (energy, "striker.velocity_m_s", 0.04, 0.05, false),
            (energy, "time.dt_s", 0.01, 0.02, false),
            (period, "orbit.period_s", 3.0, 3.5, true),
            (period, "orbit.mode.displacement_m", 0.04, 0.05, false),
        ] {
            let told = |more: &str| {
                read(&format!("{RING}{orbit}{more}")).err().map_or(String::new(), |error| error.to_string())
            };
            let is_told = |told: String| {
                let expected = format!("{key}: found no effect from {from:?} to {to:?}");
                assert!(if has_effect { told.is_empty() } else { told.contains(&expected) }, "{key}: {told}");
            };
            is_told(told(&format!("[continue]\nkey = '{key}'\nfrom = {from:?}\nto = {to:?}\n")));
            if has_effect || key.starts_with("orbit.mode") {
                is_told(told(&format!(
                    "[grid]\n'chain.bonds.linear' = [1.0, 2.0]\n'{key}' = [{from:?}, {to:?}]\n"
                )));
            }
        }
    }

    /// Two beads that swing against each other with ω² = 3, any number of times.
    #[test]
    fn an_orbit_that_is_run_through_several_times_is_refused() {
        let stop = AtomicBool::new(false);
        for times in [1, 2, 3, 5, 7, 11, 13] {
            let period_s = 3.6276 * f64::from(times);
            let file = read(&format!(
                "chain = {{ beads = 2, bead_mass_kg = 1.0, bonds = {{ linear = 1.0, cubic = 1.0 }} }}\n\
                 ends = {{ left = 'fixed', right = 'fixed' }}\ninitial = {{ displacements_m = [0.001, -0.001] }}\n\
                 orbit = {{ amplitude_m = 0.001, period_s = {period_s:?} }}\n"
            ))
            .expect("valid");
            let family = |parameter: f64| file.problem(parameter);
            let search = Search::begin(&family, file.from(), file.options(), &stop).expect("a seed");
            let told = search.find().err().map_or(String::new(), |why| why.to_string());
            assert_eq!(told.contains("comes back after"), times > 1, "{times}: {told}");
        }
    }
}
