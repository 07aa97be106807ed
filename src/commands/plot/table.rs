//! `beadline plot` of a table: what a sweep has found, over what was swept.

mod choice;
mod columns;

use crate::args::{AxisArg, BandArg, ColoursArg, PlotArgs};
use crate::display::{self, count, counted};
use crate::failure::{BadInput, Done, Failure};
use crate::outputs::{check_figures, check_places, extension};
use crate::report::{Rows, report};
use choice::{Choice, Drawn};
use columns::Columns;
use consumers::statistics::Statistics;
use plots::{Band, HeatMap, TableCurve, TableFigure, column_label, heat_map, table_curves};
use serde_json::json;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The table that is to be drawn, if it is one.
pub(super) fn table_of(args: &PlotArgs) -> Option<&Path> {
    let path = args.frames.source.file()?;
    ["csv", "parquet"].contains(&extension(path).as_str()).then_some(path)
}

pub(super) fn plot(args: &PlotArgs, path: &Path) -> Result<Done, Failure> {
    check_flags(args)?;
    let columns = Columns::read(path).bad_input()?;
    if columns.row_count() == 0 {
        return Err(bad_input!("{} has no rows", path.display()));
    }
    let choice = Choice::of(args, &columns)?;
    let out = args.out.clone().unwrap_or_else(|| default_out(path, &choice));
    check_figures(std::slice::from_ref(&out), args.look)?;
    check_places(&[&out], &args.frames)?;
    let figure = match &choice.drawn {
        Drawn::Heat { heat } => heat_map(&heat_of(args, path, &columns, &choice, heat)?)?,
        Drawn::Curves { by } => {
            let figure = curves_of(args, path, &columns, &choice, by.as_deref())?;
            table_curves(&figure)
        }
    };
    figure.write(&out, args.look.options(), args.frames.force)?;
    let outcome = json!({
        "table": path,
        "rows": columns.row_count(),
        "x": choice.x,
        "y": choice.y,
        "by": choice.by(),
        "heat": choice.heat(),
        "averaged_over": choice.averaged,
        "figures": [&out],
    });
    report(args.frames.json, &outcome, || {
        let mut rows = Rows::default();
        rows.add("rows", count(columns.row_count() as u64));
        let said = |name: &str, chosen: bool| {
            if chosen { format!("{name} (chosen: nothing was asked for)") } else { name.to_owned() }
        };
        rows.add("x", said(&choice.x, args.x.is_none()));
        rows.add("y", said(&choice.y.join(", "), args.y.is_empty()));
        if let Some(by) = choice.by() {
            rows.add("a curve for each", said(by, args.by.is_none()));
        }
        if let Some(heat) = choice.heat() {
            rows.add("colours", said(heat, args.heat.is_none()));
        }
        if !choice.averaged.is_empty() {
            rows.add("averaged over", choice.averaged.join(", "));
        }
        rows.add("figure", out.display());
        rows.under(format_args!("plot of {}", path.display()))
    })?;
    Ok(Done::Whole)
}

/// Refuses flags that only have a meaning for frames.
fn check_flags(args: &PlotArgs) -> Result<(), Failure> {
    let frames = &args.frames;
    let flags = [
        ("--what", args.what.is_some()),
        ("--at", args.at.is_some()),
        ("--frame", args.frame.is_some()),
        ("--beads", args.beads.is_some()),
        ("--range", args.range.is_some()),
        ("--latest", frames.latest),
        ("--from-start", frames.from_start),
        ("--fill-gaps", frames.fill_gaps),
        ("--every-step", frames.every_step),
        ("--from", frames.from != 0.0),
        ("--until", frames.until.is_some()),
        ("--jobs", frames.jobs.is_some()),
        ("--timeout", frames.timeout.is_some()),
    ];
    match flags.iter().find(|(_, is_given)| *is_given) {
        Some((flag, _)) => Err(bad_input!("{flag} is for runs and recordings; {} is a table", frames.source)),
        None => Ok(()),
    }
}

/// `results-total_j.png`, `results-total_j-heat.png`, in the current directory.
fn default_out(path: &Path, choice: &Choice) -> PathBuf {
    let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or("table");
    let (what, end) = match choice.heat() {
        Some(heat) => (heat, "-heat"),
        None => (choice.y.first().map_or("y", String::as_str), ""),
    };
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '_' { c } else { '-' };
    format!("{stem}-{}{end}.png", what.chars().map(plain).collect::<String>()).into()
}

fn log_of(args: &PlotArgs) -> [bool; 2] {
    [AxisArg::X, AxisArg::Y].map(|axis| args.log.contains(&axis))
}

fn caption(path: &Path, columns: &Columns, choice: &Choice, (curve, has_band): (&str, bool)) -> String {
    let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let rows = counted(columns.row_count() as u64, "row");
    let averaged = match choice.averaged.as_slice() {
        [] if columns.is_ensemble() || has_band => format!("; {curve}"),
        [] => String::new(),
        keys => format!("; {curve} over {}", keys.join(", ")),
    };
    format!("{name}, {rows}{averaged}")
}

fn heat_of(
    args: &PlotArgs,
    path: &Path,
    columns: &Columns,
    choice: &Choice,
    heat: &str,
) -> Result<HeatMap, Failure> {
    let y = choice.y.first().map_or("", String::as_str);
    let numbers = [columns.numbers(&choice.x)?, columns.numbers(y)?, columns.result(heat)?.means()];
    let rows = (0..columns.row_count()).filter_map(|row| {
        let [x, y, value] = [0, 1, 2].map(|i| numbers[i].get(row).copied().flatten());
        Some([x?, y?, value.unwrap_or(f64::NAN)])
    });
    Ok(HeatMap {
        columns: [choice.x.clone(), y.to_owned(), heat.to_owned()],
        log: log_of(args),
        log_colours: args.colours == Some(ColoursArg::Log),
        values: rows.collect(),
        caption: caption(path, columns, choice, ("mean", false)),
    })
}

fn curves_of(
    args: &PlotArgs,
    path: &Path,
    columns: &Columns,
    choice: &Choice,
    by: Option<&str>,
) -> Result<TableFigure, Failure> {
    let band = args.band.map(|band| match band {
        BandArg::StandardError => Band::StandardError,
        BandArg::Quantiles => Band::Quantiles,
    });
    let x = columns.numbers(&choice.x)?;
    let names = by.map(|by| columns.keys(by)).transpose()?;
    let mut panels = Vec::new();
    for y in &choice.y {
        let found = columns.result(y)?;
        // rows of one curve and one x, in the order of the table
        let mut groups: BTreeMap<(usize, Sortable), Vec<usize>> = BTreeMap::new();
        for (row, x) in x.iter().enumerate() {
            let curve = names.as_ref().map_or(0, |names| names.of[row]);
            let Some(x) = x.filter(|x| !log_of(args)[0] || *x > 0.0) else { continue };
            groups.entry((curve, Sortable(x))).or_default().push(row);
        }
        let labels: Vec<String> = match (by, &names) {
            (Some(by), Some(names)) => names.known.iter().map(|value| named(by, value)).collect(),
            _ => vec![String::new()],
        };
        let mut curves: Vec<TableCurve> =
            labels.into_iter().map(|label| TableCurve { label, points: Vec::new() }).collect();
        for ((curve, Sortable(x)), rows) in groups {
            let statistics: Option<Statistics> = found.statistics(&rows);
            curves[curve].points.extend(statistics.map(|statistics| (x, statistics)));
        }
        let has_band = |found: &Statistics| found.standard_error.is_some();
        let points = || curves.iter().flat_map(|curve| &curve.points);
        if band.is_some() && !points().any(|(_, found)| has_band(found)) {
            display::notice(format_args!(
                "no band for {y}: there is one row for each {}; bands are of rows that differ in something else, such as the seed",
                choice.x
            ));
        }
        if points().next().is_none() {
            return Err(bad_input!("{y} has no numbers over {}", choice.x));
        }
        curves.retain(|curve| !curve.points.is_empty());
        panels.push((y.clone(), curves));
    }
    let curve = match band {
        None => "mean",
        Some(Band::StandardError) => "mean ± standard error",
        Some(Band::Quantiles) => "median, 25 % to 75 % and 5 % to 95 %",
    };
    Ok(TableFigure {
        x: choice.x.clone(),
        panels,
        log: log_of(args),
        band,
        scattered: choice.scattered,
        caption: caption(path, columns, choice, (curve, band.is_some())),
    })
}

/// A number by its size.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sortable(f64);

impl Eq for Sortable {}

impl PartialOrd for Sortable {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Sortable {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

/// `α = 1.5`, `impurities[0] mass = 0.002 kg`.
fn named(column: &str, value: &str) -> String {
    let label = column_label(column);
    match label.strip_suffix(')').and_then(|label| label.rsplit_once(" (")) {
        Some((name, unit)) => format!("{name} = {value}\u{a0}{unit}"),
        None => format!("{label} = {value}"),
    }
}
