//! Values as they are written on the command line.

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use figure::Options;
use recording::Split;
use std::fmt;
use std::num::NonZero;

/// Pace of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Pace {
    /// As fast as possible.
    Max,
    /// Simulated seconds per second of wall time.
    PerSecond(f64),
}

/// A whole number, with an error in plain words.
pub(super) fn parse_whole(text: &str) -> Result<u64, String> {
    text.parse().map_err(|_| "expected a whole number, 0 or more".to_owned())
}

/// A seed that a configuration can have: TOML has no larger numbers.
pub(super) fn parse_seed(text: &str) -> Result<u64, String> {
    let seed = text.parse::<i64>().ok().and_then(|seed| u64::try_from(seed).ok());
    seed.ok_or_else(|| "expected a whole number from 0 to 9223372036854775807 (2^63 − 1)".to_owned())
}

/// A whole number that something is divided by.
pub(super) fn parse_positive(text: &str) -> Result<NonZero<u64>, String> {
    text.parse().map_err(|_| "expected a whole number, 1 or more".to_owned())
}

/// A count for this machine, such as threads.
pub(super) fn parse_count(text: &str) -> Result<usize, String> {
    text.parse().map_err(|_| "expected a whole number, 0 or more".to_owned())
}

/// A number; its user checks the range.
pub(super) fn parse_number(text: &str) -> Result<f64, String> {
    text.parse().map_err(|_| "expected a number, such as 0.5 or 1e-3".to_owned())
}

/// A parser of the names of `all`, which shells can complete.
pub(super) fn one_of<T: Copy + Send + Sync + 'static, const N: usize>(
    all: [T; N],
    named: fn(T) -> PossibleValue,
) -> impl TypedValueParser<Value = T> {
    PossibleValuesParser::new(all.map(named)).map(move |name| {
        let found = all.into_iter().find(|one| named(*one).get_name() == name);
        found.unwrap_or(all[0]) // no other name gets here
    })
}

pub(super) fn parse_dpi(text: &str) -> Result<f64, String> {
    let dpi = text.parse().ok().filter(|dpi| Options::DPI.contains(dpi));
    let (least, most) = (Options::DPI.start(), Options::DPI.end());
    dpi.ok_or_else(|| format!("expected dots per inch from {least} to {most}"))
}

/// More threads than any machine has cores are a mistake.
pub(super) fn parse_jobs(text: &str) -> Result<NonZero<usize>, String> {
    let jobs = text.parse().ok().filter(|jobs: &NonZero<usize>| jobs.get() <= 1024);
    jobs.ok_or_else(|| "expected a number of threads from 1 to 1024".to_owned())
}

/// Parses a line of a script for sbatch.
pub(super) fn parse_directive(text: &str) -> Result<String, String> {
    let is_line = !text.is_empty() && !text.contains(char::is_control);
    is_line.then(|| text.to_owned()).ok_or_else(|| "expected one line".to_owned())
}

pub(super) fn parse_pace(text: &str) -> Result<Pace, String> {
    match text {
        "max" => Ok(Pace::Max),
        _ => parse_seconds(text).map(Pace::PerSecond).map_err(|_| {
            "expected `max` or a positive number of simulated seconds per second, such as 0.01".to_owned()
        }),
    }
}

/// `1000000`, `500kB`, `1.5GB`, `64MiB`: at most 2^53 bytes.
pub(super) fn parse_bytes(text: &str) -> Result<u64, String> {
    let expected = || "expected a size such as 500MB, 2GB, 64MiB, or a number of bytes".to_owned();
    let unit_at = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let (number, unit) = text.split_at(unit_at);
    let unit_bytes = match unit {
        "" | "B" => 1.0,
        "kB" | "KB" => 1e3,
        "MB" => 1e6,
        "GB" => 1e9,
        "TB" => 1e12,
        "KiB" => 1024.0,
        "MiB" => 1024.0 * 1024.0,
        "GiB" => 1024.0 * 1024.0 * 1024.0,
        _ => return Err(expected()),
    };
    let bytes = number.trim_end().parse::<f64>().map_err(|_| expected())? * unit_bytes;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole and in range")]
    let whole = (bytes >= 0.0 && bytes <= 2.0_f64.powi(53)).then_some(bytes.round() as u64);
    whole.ok_or_else(expected)
}

pub(super) fn parse_split_size(text: &str) -> Result<u64, String> {
    let least = Split::LEAST_BYTES;
    let large_enough = |bytes: &u64| *bytes >= least;
    Some(parse_bytes(text)?).filter(large_enough).ok_or_else(|| format!("expected at least {least} bytes"))
}

pub(super) fn parse_seconds(text: &str) -> Result<f64, String> {
    let seconds: f64 = text.parse().map_err(|_| "expected a positive number of seconds".to_owned())?;
    let allowed = seconds > 0.0 && seconds <= 1e9;
    if allowed { Ok(seconds) } else { Err("expected a positive number of seconds, at most 1e9".to_owned()) }
}

pub(super) fn parse_film_seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse().ok().filter(|seconds: &f64| *seconds > 0.0 && *seconds <= 120.0);
    seconds.ok_or_else(|| "expected a length in seconds, above 0 and at most 120".to_owned())
}

/// `1280x720`: some encoders take only even numbers.
pub(super) fn parse_size(text: &str) -> Result<(u32, u32), String> {
    let side = |text: &str| {
        text.parse().ok().filter(|side: &u32| (240..=4096).contains(side) && side.is_multiple_of(2))
    };
    let sides = text.split_once('x').and_then(|(width, height)| side(width).zip(side(height)));
    sides.ok_or_else(|| "expected WxH, two even numbers from 240 to 4096, such as 1280x720".to_owned())
}

pub(super) fn parse_tolerance(text: &str) -> Result<f64, String> {
    let tolerance = text.parse().ok().filter(|tolerance: &f64| (1e-15..=0.1).contains(tolerance));
    tolerance.ok_or_else(|| "expected a number from 1e-15 to 0.1".to_owned())
}

pub(super) fn parse_time(text: &str) -> Result<f64, String> {
    let time_s = text.parse().ok().filter(|time_s: &f64| time_s.is_finite() && *time_s >= 0.0);
    time_s.ok_or_else(|| "expected a simulated time in seconds, 0 or more".to_owned())
}

pub(super) fn parse_pair(text: &str) -> Result<(u64, f64), String> {
    let expected = || "expected BEAD=VALUE, such as 500=0.6e-3".to_owned();
    let (bead, value) = text.split_once('=').ok_or_else(expected)?;
    Ok((bead.parse().map_err(|_| expected())?, value.parse().map_err(|_| expected())?))
}

pub(super) fn parse_impurity(text: &str) -> Result<Option<(u64, f64)>, String> {
    if text == "none" { Ok(None) } else { parse_pair(text).map(Some) }
}

/// Ends of colours: one at or below 0, the other at or above 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct ColourRange {
    pub(crate) from: f64,
    pub(crate) to: f64,
}

/// `0.5` is −0.5 to 0.5; `-0.1..0.5` is as it says.
pub(super) fn parse_range(text: &str) -> Result<ColourRange, String> {
    let number = |text: &str| text.parse().ok().filter(|number: &f64| number.is_finite());
    let range = match text.split_once("..") {
        Some((from, to)) => number(from).zip(number(to)),
        None => number(text).map(|most| (-most, most)),
    };
    let range = range.filter(|(from, to)| *from <= 0.0 && *to >= 0.0 && from < to);
    range.map(|(from, to)| ColourRange { from, to }).ok_or_else(|| {
        "expected a number above 0, or two as in -0.1..0.5 with 0, which is white, between them".to_owned()
    })
}

pub(super) fn parse_slope(text: &str) -> Result<f64, String> {
    let slope = text.parse().ok().filter(|slope: &f64| slope.is_finite());
    slope.ok_or_else(|| "expected an exponent, such as 1.5 or -2".to_owned())
}

/// `1..5`, `1..` or `..5`: numbers from 0.
pub(super) fn parse_stretch(text: &str) -> Result<(f64, f64), String> {
    let number = |text: &str, none: f64| if text.is_empty() { Some(none) } else { text.parse().ok() };
    let ends = text.split_once("..").and_then(|(from, to)| number(from, 0.0).zip(number(to, f64::INFINITY)));
    let ends = ends.filter(|(from, to)| *from >= 0.0 && from < to);
    ends.ok_or_else(|| "expected A..B, A.. or ..B with numbers above 0, the smaller one first".to_owned())
}

/// A part of the points of a sweep: those whose index leaves the remainder `number` by `count`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Shard {
    pub(crate) number: u64,
    pub(crate) count: u64,
}

impl Shard {
    /// Every point.
    pub(crate) const WHOLE: Self = Self { number: 0, count: 1 };
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.count)
    }
}

pub(super) fn parse_shard(text: &str) -> Result<Shard, String> {
    let parsed = text
        .split_once('/')
        .and_then(|(number, count)| Some(Shard { number: number.parse().ok()?, count: count.parse().ok()? }));
    let expected = "expected I/N with I from 0 to N - 1, such as 0/2".to_owned();
    parsed.filter(|shard| shard.number < shard.count).ok_or(expected)
}
