//! `beadline plot` of a table: what a sweep has found, over what was swept.

mod choice;
mod columns;
mod gaps;

use crate::args::{BandArg, ColoursArg, PlotArgs};
use crate::display::{self, count, counted};
use crate::failure::{BadInput, Done, Failure};
use crate::outputs::{check_figures, check_places, extension};
use crate::report::{Rows, report};
use crate::sweep;
use choice::Choice;
use columns::{Columns, NOT_SET, Values};
use gaps::Gaps;
use plots::{
    Band, HeatMap, TableCurve, TableFigure, TableFit, TablePanel, TablePoint, column_label, heat_map,
    table_curves,
};
use producer::sweep::Sweep;
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
    let mut fits = Vec::new();
    let (figure, gaps) = if let Some(heat) = &choice.heat {
        let (map, gaps) = heat_of(args, path, &columns, &choice, heat)?;
        (heat_map(&map)?, gaps)
    } else {
        let (figure, gaps) = curves_of(args, path, &columns, &choice)?;
        fits = fits_in(&figure);
        (table_curves(&figure), gaps)
    };
    figure.write(&out, args.look.options(), args.frames.force)?;
    let log = ["x", "y"].into_iter().zip(choice.log).filter(|(_, is_log)| *is_log).map(|(axis, _)| axis);
    let log: Vec<&str> = log.collect();
    let outcome = json!({
        "table": path.to_string_lossy(),
        "rows": columns.row_count(),
        "x": choice.x,
        "y": choice.y,
        "by": choice.by,
        "heat": choice.heat,
        "averaged_over": choice.averaged,
        "log": log,
        "fits": fits.iter().map(|(column, curve, fit)| json!({
            "column": column,
            "curve": curve,
            "exponent": fit.law.exponent,
            "error": fit.law.exponent_error,
            "prefactor": fit.law.prefactor,
            "from": fit.ends[0],
            "to": fit.ends[1],
        })).collect::<Vec<_>>(),
        "left_out": gaps,
        "figures": [out.to_string_lossy()],
    });
    report(args.frames.json, &outcome, || {
        let mut rows = Rows::default();
        rows.add("rows", count(columns.row_count() as u64));
        let said = |name: &str, chosen: bool| {
            if chosen { format!("{name} (chosen: nothing was asked for)") } else { name.to_owned() }
        };
        rows.add("x", said(&choice.x, args.x.is_none()));
        rows.add("y", said(&choice.y.join(", "), args.y.is_empty()));
        if let Some(by) = &choice.by {
            rows.add("a curve for each", said(by, args.by.is_none()));
        }
        if let Some(heat) = &choice.heat {
            rows.add("colours", said(heat, args.heat.is_none()));
        }
        if !choice.averaged.is_empty() {
            rows.add("averaged over", choice.averaged.join(", "));
        }
        if !log.is_empty() {
            rows.add("logarithmic", said(&log.join(", "), args.log.is_empty()));
        }
        let exponent = |(column, curve, fit): &Fitted| {
            let of = [column.as_str(), curve].into_iter().filter(|name| !name.is_empty());
            format!("{}: {}", of.collect::<Vec<_>>().join(", "), fit.words())
        };
        rows.each("exponent", fits.iter().map(exponent));
        if choice.x == "time_s" && !fits.is_empty() {
            rows.add(
                "",
                "its error takes the times of a run for independent, and is too small where they are not",
            );
        }
        let left_out = gaps.iter().filter_map(|gaps| Some(format!("{}: {}", gaps.column, gaps.words()?)));
        rows.each("left out", left_out);
        rows.add("figure", out.display());
        rows.under(format_args!("plot of {}", path.display()))
    })?;
    Ok(Done::Whole)
}

/// A power law that a figure has, the column and the name of its curve.
type Fitted = (String, String, TableFit);

/// The laws that a figure has.
fn fits_in(figure: &TableFigure) -> Vec<Fitted> {
    let curves = figure.panels.iter().flat_map(|panel| panel.curves.iter().map(move |curve| (panel, curve)));
    let found =
        curves.filter_map(|(panel, curve)| Some((panel.column.clone(), curve.label.clone(), curve.fit?)));
    found.collect()
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
    let (what, end) = match &choice.heat {
        Some(heat) => (heat.as_str(), "-heat"),
        None => (choice.y.first().map_or("y", String::as_str), ""),
    };
    let plain = |c: char| if c.is_ascii_alphanumeric() || c == '_' { c } else { '-' };
    format!("{stem}-{}{end}.png", what.chars().map(plain).collect::<String>()).into()
}

fn caption(path: &Path, columns: &Columns, choice: &Choice, curve: Option<&str>, gaps: &[Gaps]) -> String {
    let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let mut text = format!("{name}, {}", counted(columns.row_count() as u64, "row"));
    text.extend(curve.map(|curve| format!("; {curve}")));
    if let (Some(_), keys @ [_, ..]) = (curve, choice.averaged.as_slice()) {
        text.extend([" over ", &keys.join(", ")]);
    }
    text.extend(of_sweep(path).map(|common| format!("; {common}")));
    for gaps in gaps {
        text.extend(gaps.words().map(|words| format!("; {}: {words}", gaps.column)));
    }
    text
}

/// Most runs of a sweep that are compared for what they have in common.
const MOST_COMPARED: u64 = 2000;

/// The parameters that all runs of a sweep have in common, if the table lies in its directory and they are not too many.
fn of_sweep(path: &Path) -> Option<String> {
    let is_ours =
        path.file_stem().is_some_and(|stem| sweep::TABLES.iter().flatten().any(|name| stem == *name));
    let file = sweep::file_in(path.parent()?).filter(|_| is_ours)?;
    // what it names may lie elsewhere: the figure is the same without these words
    let sweep = Sweep::read(&file, experiments::HOOKS).ok()?;
    let count = sweep.point_count();
    let runs = (0..count.min(MOST_COMPARED + 1)).map_while(|index| Some(sweep.point(index).ok()?.physics));
    let runs: Vec<_> = runs.collect();
    (runs.len() as u64 == count).then(|| plots::common_caption(&runs))
}

/// Numbers of an axis; none that a logarithmic one cannot show.
fn places(columns: &Columns, name: &str, is_log: bool) -> Result<Vec<Option<f64>>, Failure> {
    let shown = |x: &f64| !is_log || *x > 0.0;
    Ok(columns.numbers(name)?.into_iter().map(|x| x.filter(shown)).collect())
}

fn heat_of(
    args: &PlotArgs,
    path: &Path,
    columns: &Columns,
    choice: &Choice,
    heat: &str,
) -> Result<(HeatMap, Vec<Gaps>), Failure> {
    let y = choice.y.first().map_or("", String::as_str);
    let axes = [places(columns, &choice.x, choice.log[0])?, places(columns, y, choice.log[1])?];
    let keys = [columns.keys(&choice.x)?, columns.keys(y)?];
    let cell = |row: usize| keys.each_ref().map(|keys| keys.of[row]);
    let found = columns.result(heat)?;
    let mut gaps = Gaps::new(heat, columns.row_count());
    let mut cells: BTreeMap<[usize; 2], Vec<usize>> = BTreeMap::new();
    for (row, at) in axes[0].iter().zip(&axes[1]).enumerate() {
        match at {
            (Some(_), Some(_)) => cells.entry(cell(row)).or_default().push(row),
            _ => gaps.off_axes(1),
        }
    }
    let values: Vec<Values> = cells.values().map(|rows| found.values(rows)).collect();
    gaps.of_fewer(&values);
    let means = found.means();
    gaps.without_value(cells.values().flatten().filter(|row| means[**row].is_none()).count());
    if cells.values().flatten().all(|row| means[*row].is_none()) {
        return Err(bad_input!("{heat} has no numbers over {} and {y}", choice.x));
    }
    let point = |row: &usize| Some([axes[0][*row]?, axes[1][*row]?, means[*row].unwrap_or(f64::NAN)]);
    let gaps = vec![gaps];
    let is_mean = columns.is_ensemble() || !choice.averaged.is_empty();
    let map = HeatMap {
        columns: [choice.x.clone(), y.to_owned(), heat.to_owned()],
        log: choice.log,
        log_colours: args.colours == Some(ColoursArg::Log),
        values: cells.values().flatten().filter_map(point).collect(),
        caption: caption(path, columns, choice, is_mean.then_some("mean"), &gaps),
    };
    Ok((map, gaps))
}

fn curves_of(
    args: &PlotArgs,
    path: &Path,
    columns: &Columns,
    choice: &Choice,
) -> Result<(TableFigure, Vec<Gaps>), Failure> {
    let band = args.band.map(|band| match band {
        BandArg::StandardError => Band::StandardError,
        BandArg::Quantiles => Band::Quantiles,
    });
    let (mut panels, mut gaps) = (Vec::new(), Vec::new());
    for y in &choice.y {
        let (mut panel, left_out) = panel_of(columns, choice, y, band)?;
        let of = |label: &str| if label.is_empty() { y.clone() } else { format!("{y}, {label}") };
        if let Some(stretch) = args.fit {
            panel.fit(stretch, band);
            if panel.curves.iter().all(|curve| curve.fit.is_none()) {
                let apart = match &choice.by {
                    Some(by) => format!("; there is a curve for each {by}, and with `--by none` one for all"),
                    None => String::new(),
                };
                return Err(bad_input!("--fit needs three points above 0 of a curve of {y}{apart}"));
            }
            for curve in panel.curves.iter().filter(|curve| curve.fit.is_none()) {
                notice!(
                    "{}: no power law, which needs three points, and all of them above 0",
                    of(&curve.label)
                );
            }
        }
        let is_above_0 = |point: &TablePoint| point.x > 0.0 && Band::middle(band, &point.found) > 0.0;
        let sloped = if args.slope.is_empty() { &[][..] } else { &panel.curves[..] };
        for curve in sloped.iter().filter(|curve| !curve.points.iter().any(is_above_0)) {
            notice!("{}: no slope, for no point is above 0", of(&curve.label));
        }
        panels.push(panel);
        gaps.push(left_out);
    }
    let points = panels.iter().flat_map(|panel| &panel.curves).flat_map(|curve| &curve.points);
    // where no rows fall on one point, they are drawn as they are
    let is_averaged = points.into_iter().any(|point| point.found.standard_error.is_some());
    let curve = is_averaged.then_some(match band {
        None => "mean",
        Some(Band::StandardError) => "mean ± standard error",
        Some(Band::Quantiles) => "median, 25 % to 75 % and 5 % to 95 %",
    });
    let figure = TableFigure {
        x: choice.x.clone(),
        panels,
        log: choice.log,
        slopes: args.slope.clone(),
        band,
        scattered: choice.scattered,
        caption: caption(path, columns, choice, curve, &gaps),
    };
    Ok((figure, gaps))
}

/// The curves of the column `y`, and what they leave out.
fn panel_of(
    columns: &Columns,
    choice: &Choice,
    y: &str,
    band: Option<Band>,
) -> Result<(TablePanel, Gaps), Failure> {
    let x = places(columns, &choice.x, choice.log[0])?;
    let keys = columns.keys(&choice.x)?;
    let names = choice.by.as_ref().map(|by| columns.keys(by)).transpose()?;
    let found = columns.result(y)?;
    let mut gaps = Gaps::new(y, columns.row_count());
    // rows of one curve and one x, in the order of the table
    let mut groups: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
    for (row, x) in x.iter().enumerate() {
        let curve = names.as_ref().map_or(0, |names| names.of[row]);
        match x {
            Some(_) => groups.entry((curve, keys.of[row])).or_default().push(row),
            None => gaps.off_axes(1),
        }
    }
    let labels: Vec<String> = match (&choice.by, &names) {
        (Some(by), Some(names)) => names.known.iter().map(|value| named(by, value)).collect(),
        _ => vec![String::new()],
    };
    let mut curves: Vec<TableCurve> =
        labels.into_iter().map(|label| TableCurve { label, points: Vec::new(), fit: None }).collect();
    let values: Vec<Values> = groups.values().map(|rows| found.values(rows)).collect();
    let of_fewer = gaps.of_fewer(&values);
    for (((curve, _), rows), (values, is_of_fewer)) in groups.iter().zip(values.iter().zip(of_fewer)) {
        let (Some(found), Some(x)) = (values.found, x[rows[0]]) else { continue };
        gaps.off_axes(usize::from(choice.log[1] && Band::middle(band, &found) <= 0.0));
        curves[*curve].points.push(TablePoint { x, found, is_of_fewer });
    }
    let means = found.means();
    gaps.without_value(groups.values().flatten().filter(|row| means[**row].is_none()).count());
    let points = || curves.iter().flat_map(|curve| &curve.points);
    if band.is_some() && !points().any(|point| point.found.standard_error.is_some()) {
        display::notice(format_args!(
            "no band for {y}: there is one row for each {}; bands are of rows that differ in something else, such as the seed",
            choice.x
        ));
    }
    if points().next().is_none() {
        return Err(bad_input!("{y} has no numbers over {}", choice.x));
    }
    curves.retain(|curve| !curve.points.is_empty());
    Ok((TablePanel { column: y.to_owned(), curves, note: gaps.note() }, gaps))
}

/// `α = 1.5`, `impurities[0] mass = 0.002 kg`.
fn named(column: &str, value: &str) -> String {
    let label = column_label(column);
    match label.strip_suffix(')').and_then(|label| label.rsplit_once(" (")) {
        Some((name, unit)) if value != NOT_SET => format!("{name} = {value}\u{a0}{unit}"),
        _ => format!("{label} = {value}"),
    }
}
