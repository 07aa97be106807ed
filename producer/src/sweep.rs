//! Sweeps: a grid of runs over any keys of a configuration.
//!
//! A sweep file has a `[base]` configuration, a `[grid]` of lists and ranges, every combination of which is a
//! point, `[[case]]` tables of keys that are set together, and a `[sample]` of values that are drawn together; every case is
//! combined with every sample and the whole grid.
//! [`Sweep::point`] is a pure function of the file and an index, so that points can be computed in any
//! order, anywhere.
//!
//! Keys are applied to the TOML document of the base, which is then read as a configuration: whatever
//! [`RunConfig`] knows can be swept.

mod blame;
mod definition;
mod document;
mod ensemble;
mod identity;
mod keys;
mod sobol;
mod values;

pub use definition::{Grid, GridAxis, Series, Until, grid, schema};
pub use document::KeyPath;
pub use ensemble::Ensemble;
pub use identity::MOST_CHECKED;

use definition::{Axis, Definition, Setting};
use schemas::config::{ConfigError, RunConfig};
use schemas::manifest::{Origin, Physics, RunManifest};
use schemas::text;
use std::io;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Most points of one sweep: memory holds a bit for each.
pub const MAX_POINTS: u64 = 10_000_000;

/// Time between two analysed frames as a fraction of the collision time T, unless the base says
/// otherwise: a solitary wave of α = 1.5 passes a bead in about 2 T.
pub const FRAME_INTERVAL: f64 = 0.1;

/// Steps between two recorded frames, unless the base says otherwise.
const RECORD_EVERY_STEPS: u64 = 100;

/// Functions that complete the configurations of a sweep and check its measures.
#[derive(Debug, Clone, Copy)]
pub struct Hooks {
    /// Completes a configuration with parts from elsewhere, such as tables in files beside the given directory.
    pub prepare: fn(RunConfig, Option<&Path>) -> Result<RunConfig, ConfigError>,
    /// The whole name of a column that `measure` names. Refuses a name that is no column of an analysis, or none of
    /// the given run, with the allowed ones.
    pub measure: fn(MeasureOf, &str, Option<&RunManifest>) -> Result<String, String>,
}

/// The numbers of an analysis that a list names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeasureOf {
    /// Those of its summary: `measure`.
    Summary,
    /// Those of its rows, over time: `measure` of `[series]`.
    Rows,
}

impl MeasureOf {
    /// The key of the entry at `place`.
    pub fn key(self, place: usize) -> String {
        let table = if self == Self::Rows { "series." } else { "" };
        format!("{table}measure[{place}]")
    }
}

impl Hooks {
    /// Hooks for complete configurations, without analyses.
    pub const NONE: Self = Self {
        prepare: |config, _| Ok(config),
        measure: |_, _, _| Err("nothing looks at these runs".to_owned()),
    };
}

/// A sweep file. Each of its points is computed from its index; the checked points are possible runs.
#[derive(Debug)]
pub struct Sweep {
    text: String,
    path: PathBuf,
    hooks: Hooks,
    definition: Definition,
    parameters: Vec<Parameter>,
    identity: [u8; 32],
}

/// A key that differs from point to point.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Parameter {
    /// The key, such as `chain.alpha`.
    pub key: String,
    /// Kind of its values.
    pub kind: ParameterKind,
}

/// Kind of all values of a parameter.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ParameterKind {
    /// Whole numbers from 0.
    Integer,
    /// Numbers.
    Double,
    /// Anything else, as TOML.
    Word,
}

/// The value of a parameter at a point.
#[derive(Debug, Clone, PartialEq)]
pub enum ParameterValue {
    /// A whole number.
    Integer(u64),
    /// A number.
    Double(f64),
    /// Anything else, as TOML.
    Word(String),
}

/// One run of a sweep.
#[derive(Debug, Clone, PartialEq)]
pub struct Point {
    /// Number of the point, from 0.
    pub index: u64,
    /// The values in the order of [`Sweep::parameters`]; none where the point does not set the key.
    pub parameters: Vec<Option<ParameterValue>>,
    /// Its configuration, with the intervals of frames filled in.
    pub config: RunConfig,
    /// The physics of that configuration.
    pub physics: Physics,
}

/// Why a sweep file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum SweepError {
    /// Something in the file is impossible.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A file cannot be read.
    #[error("{} cannot be read", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The operating system's error.
        source: io::Error,
    },
    /// More points than [`MAX_POINTS`].
    #[error(
        "{} has {found} points; at most {MAX_POINTS} are allowed: make several sweeps of it, for example of other seeds",
        path.display()
    )]
    TooMany {
        /// The sweep file.
        path: PathBuf,
        /// Number of points.
        found: u64,
    },
}

impl Sweep {
    /// Reads a sweep file and the configuration that it begins with, and checks its points. `hooks` complete each
    /// point from the directory of the sweep file. If there are more than [`MOST_CHECKED`] points, some are checked,
    /// among them those that have each value of a list.
    ///
    /// # Errors
    /// When a file cannot be read, when something in it is impossible (with the file, the line and the key),
    /// or when there are too many points.
    pub fn read(path: &Path, hooks: Hooks) -> Result<Self, SweepError> {
        let unreadable = |source| SweepError::Unreadable { path: path.to_owned(), source };
        let text = text::read(path).map_err(unreadable)?;
        Self::from_toml(&text, path, text::read, hooks)
    }

    /// Like [`Sweep::read`] for the contents `text` of the file `path`; `read` gives the contents of the file
    /// that the base names.
    ///
    /// # Errors
    /// As [`Sweep::read`].
    pub fn from_toml(
        text: &str,
        path: &Path,
        read: impl Fn(&Path) -> io::Result<String>,
        hooks: Hooks,
    ) -> Result<Self, SweepError> {
        let mut definition = Definition::read(text, path, read)?;
        keys::check(path, &definition)?;
        definition.name_measures(path, &hooks)?;
        let mut sweep = Self {
            text: text.to_owned(),
            path: path.to_owned(),
            hooks,
            parameters: parameters(&definition),
            definition,
            identity: [0; 32],
        };
        let found = sweep.point_count();
        if found > MAX_POINTS {
            return Err(SweepError::TooMany { path: path.to_owned(), found });
        }
        sweep.identity = sweep.check_points()?;
        Ok(sweep)
    }

    /// Text of the sweep file.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Path of the sweep file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// SHA-256 of everything that decides the results: the base, the varied values, the end of points, and the physics
    /// of the checked points, which includes the contents of files. Comments, layout and `record` do not count.
    pub fn identity(&self) -> [u8; 32] {
        self.identity
    }

    /// The keys that differ from point to point: those of the cases, of the sample, of the grid.
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// End of points.
    pub fn until(&self) -> Until {
        self.definition.until
    }

    /// True if points are to be recorded.
    pub fn record(&self) -> bool {
        self.definition.record
    }

    /// True if each row tells the time until which its run is determined.
    pub fn check(&self) -> bool {
        self.definition.check
    }

    /// Columns of analyses that each row has beside the usual ones.
    pub fn measure(&self) -> &[String] {
        &self.definition.measure
    }

    /// The time (s) from which the analyses of these look at frames.
    pub fn measure_from_s(&self) -> f64 {
        self.definition.measure_from_s
    }

    /// Columns of analyses that each row has over time.
    pub fn series(&self) -> &Series {
        &self.definition.series
    }

    /// The ends (s) of the intervals of time in which they are averaged, in the run of `manifest`; none where there are no columns.
    ///
    /// # Errors
    /// When they would begin after the run.
    pub fn series_edges_s(&self, manifest: &RunManifest) -> Result<Vec<f64>, String> {
        let (physics, series) = (&manifest.physics, self.series());
        let time_s = |steps| physics.time_s(steps);
        if series.measure.is_empty() {
            return Ok(Vec::new());
        }
        series.edges_s(time_s(manifest.provenance.publish_every_steps), time_s(physics.step_count))
    }

    /// The bead that divides left from right, if the file names one.
    pub fn split_bead(&self) -> Option<u64> {
        self.definition.split_bead
    }

    /// Number of points.
    pub fn point_count(&self) -> u64 {
        let Definition { cases, samples, axes, .. } = &self.definition;
        let counts = axes.iter().map(Axis::count).chain([cases.len() as u64, samples.count()]);
        counts.fold(1, u64::saturating_mul)
    }

    /// Point `index`. The last key of the grid varies fastest, then the sample, the cases slowest.
    ///
    /// # Errors
    /// When there is no such point, or its values are impossible. The latter happens only for points that were not
    /// checked.
    pub fn point(&self, index: u64) -> Result<Point, ConfigError> {
        let settings = self.settings(index)?;
        let document = self.document(&settings)?;
        let parameters = self.parameters.iter().map(|parameter| parameter.of(&settings)).collect();
        match self.resolved(&document) {
            Ok((config, physics)) => Ok(Point { index, parameters, config, physics }),
            Err(error) => Err(blame::blame(self, error, &settings, &document, index)),
        }
    }

    /// The document of a point with these settings.
    fn document(&self, settings: &[Setting]) -> Result<Table, ConfigError> {
        let mut document = self.definition.base.clone();
        for setting in settings {
            setting.key.set(&mut document, setting.value.clone()).map_err(|message| ConfigError {
                path: Some(self.path.clone()),
                line: Some(setting.line),
                key: setting.key.to_string(),
                message,
            })?;
        }
        Ok(document)
    }

    /// The parameters of point `index`, possible or not.
    ///
    /// # Errors
    /// When there is no such point.
    pub fn parameters_of(&self, index: u64) -> Result<Vec<Option<ParameterValue>>, ConfigError> {
        let settings = self.settings(index)?;
        Ok(self.parameters.iter().map(|parameter| parameter.of(&settings)).collect())
    }

    /// The configuration and the physics of the `document` of a point.
    fn resolved(&self, document: &Table) -> Result<(RunConfig, Physics), ConfigError> {
        let config = (self.hooks.prepare)(RunConfig::from_table(document)?, self.path.parent())?;
        let physics = Physics::resolve(&config)?;
        let config = with_intervals(config, document, &physics);
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let manifest = RunManifest::of(physics, &config, "sweep", origin)?;
        self.check_split(&manifest)?;
        let refuse = |key: String, message| ConfigError { path: None, line: None, key, message };
        for (kind, names) in [(MeasureOf::Summary, self.measure()), (MeasureOf::Rows, &self.series().measure)]
        {
            for (place, name) in names.iter().enumerate() {
                (self.hooks.measure)(kind, name, Some(&manifest))
                    .map_err(|message| refuse(kind.key(place), message))?;
            }
        }
        let (from_s, duration_s) =
            (self.measure_from_s(), manifest.physics.time_s(manifest.physics.step_count));
        if from_s >= duration_s {
            let message = format!("found {from_s:?}; allowed: less than the duration, {duration_s:?} s");
            return Err(refuse("measure_from_s".to_owned(), message));
        }
        self.series_edges_s(&manifest).map_err(|message| refuse("series.from_s".to_owned(), message))?;
        Ok((config, manifest.physics))
    }

    fn check_split(&self, manifest: &RunManifest) -> Result<(), ConfigError> {
        let (Some(bead), beads) = (self.split_bead(), manifest.physics.beads) else { return Ok(()) };
        if bead < beads {
            return Ok(());
        }
        Err(ConfigError {
            path: None,
            line: None,
            key: "split_bead".to_owned(),
            message: format!("found {bead}; allowed: beads 0 to {} of this chain", beads - 1),
        })
    }

    /// The settings of point `index`, in the order in which they are applied.
    fn settings(&self, index: u64) -> Result<Vec<Setting>, ConfigError> {
        if index >= self.point_count() {
            let message = format!("there is no point {index}; there are {}", self.point_count());
            return Err(ConfigError {
                path: Some(self.path.clone()),
                line: None,
                key: String::new(),
                message,
            });
        }
        let Definition { cases, samples, axes, .. } = &self.definition;
        let mut rest = index;
        let mut of_grid = Vec::with_capacity(axes.len());
        for axis in axes.iter().rev() {
            of_grid.push(axis.at(rest % axis.count()));
            rest /= axis.count();
        }
        let mut settings = cases[index_of(rest / samples.count())].clone();
        settings.extend(samples.at(rest % samples.count()));
        settings.extend(of_grid.into_iter().rev());
        Ok(settings)
    }
}

impl Parameter {
    fn of(&self, settings: &[Setting]) -> Option<ParameterValue> {
        let setting = settings.iter().find(|setting| setting.key.to_string() == self.key)?;
        Some(match (self.kind, &setting.value) {
            (ParameterKind::Integer, Value::Integer(value)) => {
                ParameterValue::Integer(u64::try_from(*value).unwrap_or_default())
            }
            (ParameterKind::Double, Value::Integer(value)) => ParameterValue::Double(*value as f64),
            (ParameterKind::Double, Value::Float(value)) => ParameterValue::Double(*value),
            (_, Value::String(word)) => ParameterValue::Word(word.clone()),
            (_, value) => ParameterValue::Word(value.to_string()),
        })
    }
}

/// The keys of all settings, each once, with the type of its values.
fn parameters(definition: &Definition) -> Vec<Parameter> {
    let Definition { cases, samples, axes, .. } = definition;
    let of_cases = cases.iter().flatten().cloned();
    let of_grid = axes.iter().flat_map(|axis| axis.telling().map(|place| axis.at(place)));
    let mut parameters: Vec<Parameter> = Vec::new();
    for setting in of_cases.chain(samples.ends()).chain(of_grid) {
        let (key, kind) = (setting.key.to_string(), kind(&setting.value));
        match parameters.iter_mut().find(|parameter| parameter.key == key) {
            Some(parameter) if parameter.kind == kind => {}
            Some(parameter) if parameter.kind == ParameterKind::Word || kind == ParameterKind::Word => {
                parameter.kind = ParameterKind::Word;
            }
            Some(parameter) => parameter.kind = ParameterKind::Double,
            None => parameters.push(Parameter { key, kind }),
        }
    }
    parameters
}

fn kind(value: &Value) -> ParameterKind {
    match value {
        Value::Integer(0..) => ParameterKind::Integer,
        Value::Integer(_) | Value::Float(_) => ParameterKind::Double,
        _ => ParameterKind::Word,
    }
}

/// `config`, which leads to `physics`, completed by the intervals of frames that its `document` leaves open.
fn with_intervals(mut config: RunConfig, document: &Table, physics: &Physics) -> RunConfig {
    let is_written = |key| document.get("stream").and_then(|stream| stream.get(key)).is_some();
    let record_written = is_written("record_every_steps");
    if !is_written("publish_every_steps") {
        let steps = (FRAME_INTERVAL * physics.scales().time_s / physics.dt_s).round();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 1 to 10000")]
        let steps = if (1.0..=1e4).contains(&steps) { steps as u64 } else { 1 };
        let recorded = config.stream.record_every_steps;
        let divides = |every: &u64| !record_written || recorded.is_multiple_of(*every);
        config.stream.publish_every_steps = (1..=steps).rev().find(divides).unwrap_or(1);
    }
    if !record_written {
        let published = config.stream.publish_every_steps.max(1); // integers
        config.stream.record_every_steps = RECORD_EVERY_STEPS.next_multiple_of(published);
    }
    config
}

/// An index of something that is in memory.
fn index_of(index: u64) -> usize {
    usize::try_from(index).unwrap_or(usize::MAX)
}

#[cfg(test)]
mod tests;
