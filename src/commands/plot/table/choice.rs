//! Choice of the columns that are drawn where nobody named them.

use super::columns::{Columns, Keys};
use crate::args::{AxisArg, PlotArgs};
use crate::failure::Failure;
use std::collections::{BTreeMap, BTreeSet};

/// Curves that are told apart in one panel.
const MOST_CURVES: usize = 8;

/// Columns of results that people look for first, in this order.
const FAVOURITES: [&str; 3] = ["corrected_over_incident", "reflected_over_total", "forward_v_peak_m_s"];

/// Columns of results that say how a run went, not what it found.
const ABOUT_RUNS: [&str; 6] =
    ["steps", "time_s", "dt_s", "split_bead", "relative_drift", "max_abs_relative_drift"];

/// Relative difference between runs up to which a quantity is conserved. Such a quantity is no result.
const ROUNDING: f64 = 1e-3;

/// The key that makes the members of an ensemble: no axis, if there is another.
const SEED: &str = "seed";

/// The word for no column.
const NONE: &str = "none";

/// Contents of a drawing.
#[derive(Debug)]
pub(super) struct Choice {
    pub(super) x: String,
    /// Columns of results, or of a heat map the one of its y axis.
    pub(super) y: Vec<String>,
    /// A curve for each value of this column; of a heat map there are none.
    pub(super) by: Option<String>,
    /// This column in colours, and no curves.
    pub(super) heat: Option<String>,
    /// Swept columns in which rows differ that fall on one point.
    pub(super) averaged: Vec<String>,
    /// Rows that lie beside each other differ in more than x.
    pub(super) scattered: bool,
    /// True if the x axis and the y axis are logarithmic.
    pub(super) log: [bool; 2],
}

impl Choice {
    pub(super) fn of(args: &PlotArgs, columns: &Columns) -> Result<Self, Failure> {
        // `none` is no column: all rows are of one curve
        let asked_by = args.by.as_ref().filter(|by| *by != NONE);
        for (flag, name) in [("--x", args.x.as_ref()), ("--by", asked_by), ("--heat", args.heat.as_ref())] {
            name.map(|name| columns.check(flag, name)).transpose()?;
        }
        args.y.iter().try_for_each(|name| columns.check("--y", name).map(drop))?;
        let varying = varying(columns)?;
        // numbers that may be an axis: those with most values, which a map has in their order in the table
        let asked = [asked_by, args.heat.as_ref()];
        let is_free =
            |name: &str| !asked.contains(&Some(&name.to_owned())) && !args.y.iter().any(|y| y == name);
        let mut axes: Vec<(&str, usize)> = varying
            .iter()
            .filter(|(name, _)| columns.is_numeric(name) && is_free(name))
            .map(|(name, keys)| (*name, keys.known.len()))
            .collect();
        if axes.len() > 1 {
            axes.retain(|(name, _)| *name != SEED);
        }
        let mut most = axes.clone();
        most.sort_by_key(|axis| std::cmp::Reverse(axis.1));
        let has_choice = args.x.is_none() && args.y.is_empty() && args.by.is_none() && args.band.is_none();
        let is_map = has_choice && axes.len() == 2 && axes.iter().all(|(_, count)| *count > MOST_CURVES);
        if args.heat.is_some() || is_map {
            most.truncate(2);
            axes.retain(|axis| most.contains(axis));
            return Self::map(args, columns, &axes, &varying);
        }
        let x = match (&args.x, most.first()) {
            (Some(x), _) => x.clone(),
            (None, Some((x, _))) => (*x).to_owned(),
            (None, None) => return Err(nothing_varies(columns)),
        };
        let y = if args.y.is_empty() { vec![default_result(columns, &x)?] } else { args.y.clone() };
        let few = |(name, keys): &&(&str, Keys)| {
            // each row would be a curve of one point
            let is_of_points = keys.known.len() == columns.row_count() && columns.is_numeric(name);
            *name != x && *name != SEED && keys.known.len() <= MOST_CURVES && !is_of_points
        };
        let by = asked_by.cloned().or_else(|| {
            let first = varying.iter().filter(|(name, _)| !y.iter().any(|y| y == name)).find(few);
            first.map(|(name, _)| (*name).to_owned()).filter(|_| args.by.is_none())
        });
        let taken: Vec<&str> = std::iter::once(x.as_str()).chain(by.as_deref()).collect();
        let (averaged, scattered) = rest(columns, &taken, &varying, args.fit.is_some())?;
        if args.fit.is_some() && scattered && averaged.iter().any(|name| name != SEED) {
            notice!(
                "--fit: the points of a curve differ in {} too, and a law through all of them may be that of none",
                averaged.join(", ")
            );
        }
        if let Some(by) = &by {
            let count = columns.keys(by)?.known.len();
            if count > 3 * MOST_CURVES {
                return Err(bad_input!(
                    "--by {by} has {count} values, too many curves; draw it as --x, or use --heat"
                ));
            }
        }
        let log = log(args, columns, [Some(&x), None])?;
        Ok(Self { x, y, by, heat: None, averaged, scattered, log })
    }

    fn map(
        args: &PlotArgs,
        columns: &Columns,
        axes: &[(&str, usize)],
        varying: &[(&str, Keys)],
    ) -> Result<Self, Failure> {
        let asked: Vec<&String> = args.x.iter().chain(args.y.first()).collect();
        let mut free =
            axes.iter().map(|(name, _)| *name).filter(|name| !asked.iter().any(|asked| asked == name));
        let mut side = |asked: Option<&String>| asked.cloned().or_else(|| free.next().map(str::to_owned));
        let (Some(x), Some(y)) = (side(args.x.as_ref()), side(args.y.first())) else {
            return Err(bad_input!(
                "a heat map needs two swept columns of numbers; name them with --x and --y"
            ));
        };
        let heat = match &args.heat {
            Some(heat) => heat.clone(),
            None => default_result(columns, &x)?,
        };
        let (averaged, _) = rest(columns, &[x.as_str(), y.as_str()], varying, false)?;
        let log = log(args, columns, [Some(&x), Some(&y)])?;
        Ok(Self { x, y: vec![y], by: None, heat: Some(heat), averaged, scattered: false, log })
    }
}

/// The axes that are logarithmic: those asked for, else both for a power law, else those with a swept column whose values follow each other by the
/// logarithm.
fn log(args: &PlotArgs, columns: &Columns, axes: [Option<&str>; 2]) -> Result<[bool; 2], Failure> {
    if !args.log.is_empty() {
        return Ok([AxisArg::X, AxisArg::Y].map(|axis| args.log.contains(&axis)));
    }
    if args.fit.is_some() || !args.slope.is_empty() {
        return Ok([true; 2]);
    }
    let swept = columns.swept();
    let mut log = [false; 2];
    for (log, name) in log.iter_mut().zip(axes) {
        let Some(name) = name.filter(|name| swept.contains(name)) else { continue };
        let mut values: Vec<f64> = columns.numbers(name)?.into_iter().flatten().collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        *log = is_logarithmic(&values);
    }
    Ok(log)
}

/// True if rising `values` span at least a factor of 4, and lie more evenly by their logarithms than by themselves.
fn is_logarithmic(values: &[f64]) -> bool {
    let [first, _, .., last] = values else { return false };
    if *first <= 0.0 || last / first < 4.0 {
        return false;
    }
    let unevenness = |place: fn(f64) -> f64| -> f64 {
        let (from, to, steps) = (place(*first), place(*last), values.len() as f64 - 1.0);
        let part = |value: &f64| (place(*value) - from) / (to - from);
        values.iter().enumerate().map(|(i, value)| (part(value) - i as f64 / steps).abs()).sum()
    };
    // to rounding, so that neither wins by it
    unevenness(f64::ln) + 1e-9 < unevenness(|value| value)
}

/// The swept columns with more than one value.
fn varying(columns: &Columns) -> Result<Vec<(&str, Keys)>, Failure> {
    let mut varying = Vec::new();
    for name in columns.swept() {
        let keys = columns.keys(name)?;
        if keys.known.len() > 1 {
            varying.push((name, keys));
        }
    }
    Ok(varying)
}

fn nothing_varies(columns: &Columns) -> Failure {
    let swept = columns.swept();
    bad_input!(
        "nothing that was swept is a number with several values ({}); name an axis with --x",
        swept.join(", ")
    )
}

/// The first result that is worth a look: one that was asked for, a favourite, or else any that differs from row to row.
fn default_result(columns: &Columns, x: &str) -> Result<String, Failure> {
    let results = columns.results();
    let varies = |name: &&str| -> bool {
        let Ok(found) = columns.result(name) else { return false };
        let means: Vec<f64> = found.means().into_iter().flatten().collect();
        let largest = means.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        let differs = |pair: &[f64]| (pair[0] - pair[1]).abs() > ROUNDING * largest;
        means.len() * 2 > columns.row_count() && means.windows(2).any(differs)
    };
    // what the sweep has asked for by name, such as `energies.driven_j`
    let asked = results.iter().filter(|name| name.contains('.'));
    let favourites = FAVOURITES.iter().filter(|name| results.contains(name));
    let others = results.iter().filter(|name| !ABOUT_RUNS.contains(name));
    let found = asked.chain(favourites).chain(others).filter(|name| **name != x).find(|name| varies(name));
    found.map(|name| (*name).to_owned()).ok_or_else(|| {
        bad_input!("no result differs from row to row; name one with --y: {}", results.join(", "))
    })
}

/// The swept columns beyond those `taken` in which rows differ, and whether they differ otherwise from one point to the next, as
/// samples do, so that rows are not repetitions of each other. A fit averages over these as well.
fn rest(
    columns: &Columns,
    taken: &[&str],
    varying: &[(&str, Keys)],
    is_fit: bool,
) -> Result<(Vec<String>, bool), Failure> {
    let rest: Vec<_> = varying.iter().filter(|(name, _)| !taken.contains(name)).collect();
    let keys: Vec<Keys> = taken.iter().map(|name| columns.keys(name)).collect::<Result<_, _>>()?;
    let point = |row: usize| keys.iter().map(|keys| keys.of[row]).collect::<Vec<usize>>();
    let mut points: BTreeMap<Vec<usize>, usize> = BTreeMap::new();
    let mut scattered = false;
    for (_, keys) in &rest {
        let mut values: BTreeMap<Vec<usize>, BTreeSet<usize>> = BTreeMap::new();
        for row in 0..columns.row_count() {
            values.entry(point(row)).or_default().insert(keys.of[row]);
        }
        // most points of a sample have a value of their own; a grid that is not complete yet has few
        let all: BTreeSet<usize> = values.values().flatten().copied().collect();
        let whole = values.values().filter(|found| found.len() == all.len()).count();
        scattered |= 2 * whole < values.len();
    }
    (0..columns.row_count()).for_each(|row| *points.entry(point(row)).or_default() += 1);
    let repeats = points.values().any(|count| *count > 1);
    let averaged = if repeats || is_fit {
        rest.iter().map(|(name, _)| (*name).to_owned()).collect()
    } else {
        Vec::new()
    };
    Ok((averaged, scattered))
}

#[cfg(test)]
mod tests {
    use super::is_logarithmic;

    #[test]
    fn values_that_follow_each_other_by_the_logarithm_are_told_from_others() {
        for log in [&[1.0, 10.0, 100.0][..], &[0.5e-3, 1e-3, 2e-3, 4e-3], &[1.0, 2.0, 5.0, 10.0, 20.0, 50.0]]
        {
            assert!(is_logarithmic(log), "{log:?}");
        }
        for plain in
            [&[1.0, 2.0, 3.0, 4.0][..], &[0.0, 1.0, 10.0], &[1.5, 2.0], &[1.0, 100.0], &[1.0, 1.1, 1.21]]
        {
            assert!(!is_logarithmic(plain), "{plain:?}");
        }
    }
}
