//! Orbits at all points of a grid of two keys: a map of stability.
//!
//! A line of the grid has one value of the first key. The orbits on it are found one after the other, each from the state of the one before: rows of
//! a line depend on nothing but the file.

use super::{File, refused};
use crate::newton::Unknown;
use crate::{MapError, NoOrbit, Orbit, Search, shown};
use consumers::table::Cell;
use producer::sweep::{self, GridAxis, KeyPath, SweepError};
use schemas::amounts::counted;
use schemas::config::ConfigError;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use toml::{Table, Value};

/// Most points of a grid: each is checked before the first orbit is looked for.
const MOST_POINTS: u64 = 10_000;

/// A grid of two keys.
#[derive(Debug, Clone)]
pub struct Grid {
    /// The keys; the second one varies along a line.
    pub keys: [String; 2],
    /// Their values.
    pub values: [Vec<f64>; 2],
    /// The file at each value of the first key.
    lines: Vec<File>,
}

impl Grid {
    /// The two axes in a file, if it has a grid.
    pub(super) fn axes(text: &str, path: &Path) -> Result<Option<[GridAxis; 2]>, ConfigError> {
        let axes = sweep::grid(text, path, MOST_POINTS).map_err(|error| match error {
            SweepError::Config(error) => error,
            other => refused("grid", &other.to_string(), "two keys"),
        })?;
        let is_there = !axes.is_empty();
        let found = axes.len();
        let two: Option<[GridAxis; 2]> = axes.try_into().ok();
        if let Some(axis) = two.iter().flatten().find(|axis| axis.values.len() < 2) {
            return Err(refused(&axis.key.to_string(), "one value", "two or more along a key of [grid]"));
        }
        if is_there && two.is_none() {
            return Err(refused("grid", &counted(found as u64, "key"), "two; the second one varies fastest"));
        }
        Ok(two)
    }

    /// The grid of `axes` over `document`; `line` makes the file of a line from a document, the key along the line and its first value.
    pub(super) fn of(
        axes: &[GridAxis; 2],
        document: &Table,
        line: impl Fn(Table, &KeyPath, f64) -> Result<File, ConfigError>,
    ) -> Result<Self, ConfigError> {
        let [across, along] = axes;
        let values = [numbers(across)?, numbers(along)?];
        let (first, at_first) = &along.values[0];
        let mut lines = Vec::with_capacity(values[0].len());
        for (value, at) in &across.values {
            let mut document = document.clone();
            for (axis, value, at) in [(across, value, at), (along, first, at_first)] {
                let refuse = |message| {
                    let key = axis.key.to_string();
                    ConfigError { path: None, line: Some(*at), key, message }
                };
                axis.key.set(&mut document, value.clone()).map_err(refuse)?;
            }
            let at_point = |error, at_along: &usize| placed(placed(error, across, *at), along, *at_along);
            let file = line(document, &along.key, values[1][0]).map_err(|error| at_point(error, at_first))?;
            for (value, (_, at_along)) in values[1].iter().zip(&along.values) {
                file.problem(*value).map_err(|error| at_point(error, at_along))?;
            }
            lines.push(file);
        }
        Ok(Self { keys: axes.each_ref().map(|axis| axis.key.to_string()), values, lines })
    }

    /// The file of the first line.
    pub(super) fn first(&self) -> &File {
        &self.lines[0]
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.values[0].len() * self.values[1].len()
    }

    /// Looks for the orbits of line `line`, and tells `look` after each. Gives their rows, as [`shown::map_columns`] has them.
    ///
    /// # Errors
    /// When it is stopped.
    pub fn rows(&self, line: usize, stop: &AtomicBool, look: impl Fn()) -> Result<Vec<Vec<Cell>>, NoOrbit> {
        let file = &self.lines[line];
        let family = |parameter: f64| file.problem(parameter);
        let values = &self.values[1];
        let row = |value: f64, found: Result<&Orbit, &NoOrbit>| {
            shown::map_row([self.values[0][line], value], found)
        };
        let search = match Search::begin(&family, file.from(), file.options(), stop) {
            Ok(search) => search,
            Err(why @ NoOrbit::Map(MapError::Stopped)) => return Err(why),
            Err(why) => return Ok(values.iter().map(|value| row(*value, Err(&why))).collect()),
        };
        let mut rows: Vec<Vec<Cell>> = Vec::with_capacity(values.len());
        let mut all: Vec<Option<Unknown>> = Vec::with_capacity(values.len());
        for value in values {
            let known = all.iter().flatten().next_back();
            let mut orbit = found(&search, known, *value)?;
            if known.is_some() && orbit.is_err() {
                orbit = found(&search, None, *value)?;
            }
            rows.push(row(*value, orbit.as_ref()));
            all.push(orbit.ok().map(|orbit| orbit.unknown));
            look();
        }
        // beyond the end of a branch the next one may come back to where it was not yet found
        for place in (0..values.len() - 1).rev() {
            if let (None, Some(known)) = (&all[place], &all[place + 1])
                && let Ok(orbit) = found(&search, Some(known), values[place])?
            {
                rows[place] = row(values[place], Ok(&orbit));
                all[place] = Some(orbit.unknown);
            }
        }
        Ok(rows)
    }
}

/// The orbit at `value` near `seed`, or, for none, near that of the file; an error if it is stopped.
fn found(search: &Search<'_>, seed: Option<&Unknown>, value: f64) -> Result<Result<Orbit, NoOrbit>, NoOrbit> {
    match search.near(seed, value) {
        Err(why @ NoOrbit::Map(MapError::Stopped)) => Err(why),
        found => Ok(found),
    }
}

/// The values of an axis, which are rising or falling.
fn numbers(axis: &GridAxis) -> Result<Vec<f64>, ConfigError> {
    let key = axis.key.to_string();
    let mut numbers: Vec<f64> = Vec::new();
    for (value, line) in &axis.values {
        let number = match value {
            Value::Integer(whole) => Some(*whole as f64),
            Value::Float(number) => Some(*number).filter(|number| number.is_finite()),
            _ => None,
        };
        let goes_on = |number: &f64| match numbers[..] {
            [] => true,
            [only] => *number != only,
            [first, .., last] => (number - last) * (last - first) > 0.0,
        };
        let number = number.filter(goes_on).ok_or_else(|| {
            let error = refused(&key, &value.to_string(), "numbers that rise or fall along a key of [grid]");
            ConfigError { line: Some(*line), ..error }
        })?;
        numbers.push(number);
    }
    Ok(numbers)
}

/// `error` at the line of a value of `axis`, if it is about its key.
fn placed(error: ConfigError, axis: &GridAxis, line: usize) -> ConfigError {
    let is_about = error.key == axis.key.to_string();
    ConfigError { line: error.line.or(is_about.then_some(line)), ..error }
}
