//! Columns of any table over each other: curves, points, bands, heat maps.

mod heat;
mod labels;

pub use heat::{HeatMap, heat_map};
pub use labels::column_label;

use consumers::power_law::PowerLaw;
use consumers::statistics::Statistics;
use consumers::uncertain::Uncertain;
use figure::{Axis, Colour, Curve, Figure, Mark, Panel, Stroke};

/// Contents of a band around a curve, which also decide the curve's middle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Band {
    /// The mean and its standard error.
    StandardError,
    /// The median, half of the values and nine tenths of them.
    Quantiles,
}

impl Band {
    /// The middle of values that a curve with this band, or without one, goes through.
    pub fn middle(band: Option<Self>, found: &Statistics) -> f64 {
        if band == Some(Self::Quantiles) { found.median } else { found.mean }
    }
}

/// A curve of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct TableCurve {
    /// Its name in the legend.
    pub label: String,
    /// Its points, by rising x.
    pub points: Vec<TablePoint>,
    /// The power law through some of them.
    pub fit: Option<TableFit>,
}

/// A power law through points from one x to another.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TableFit {
    /// The law.
    pub law: PowerLaw,
    /// The first and the last x.
    pub ends: [f64; 2],
}

impl TableFit {
    /// The law through the middles of points with x in `stretch`; none through fewer than three. Means are weighted by their standard errors
    /// where all have one.
    pub fn of(points: &[TablePoint], stretch: (f64, f64), band: Option<Band>) -> Option<Self> {
        let error = |found: &Statistics| found.standard_error.filter(|_| band != Some(Band::Quantiles));
        let used = points.iter().filter(|point| (stretch.0..=stretch.1).contains(&point.x));
        let used: Vec<_> =
            used.map(|TablePoint { x, found, .. }| (*x, Band::middle(band, found), error(found))).collect();
        let ends = [used.first()?.0, used.last()?.0];
        PowerLaw::through(&used).map(|law| Self { law, ends })
    }

    /// The exponent with its error: `−2.01 ± 0.05`.
    pub fn words(&self) -> String {
        Uncertain::new(self.law.exponent, self.law.exponent_error).to_string().replace('-', "−")
    }
}

/// The values at one x.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TablePoint {
    /// The x.
    pub x: f64,
    /// Their common parameters.
    pub found: Statistics,
    /// True if they are fewer than those of other points, or than there should be.
    pub is_of_fewer: bool,
}

/// A column of results over x.
#[derive(Debug, Clone, PartialEq)]
pub struct TablePanel {
    /// The column.
    pub column: String,
    /// Its curves.
    pub curves: Vec<TableCurve>,
    /// A short text inside the panel: how many rows have no value.
    pub note: String,
}

impl TablePanel {
    /// Finds the law of each curve, as [`TableFit::of`].
    pub fn fit(&mut self, stretch: (f64, f64), band: Option<Band>) {
        self.curves.iter_mut().for_each(|curve| curve.fit = TableFit::of(&curve.points, stretch, band));
    }
}

/// Panels over one x axis.
#[derive(Debug, Clone, PartialEq)]
pub struct TableFigure {
    /// The column of the x axis.
    pub x: String,
    /// A panel for each column of results.
    pub panels: Vec<TablePanel>,
    /// True if the axes, x and y, are logarithmic.
    pub log: [bool; 2],
    /// Exponents of power laws that are drawn beside the curves.
    pub slopes: Vec<f64>,
    /// Band around the curves.
    pub band: Option<Band>,
    /// True if rows next to each other differ in more than x: lines between them would mean nothing.
    pub scattered: bool,
    /// Text under the panels.
    pub caption: String,
}

/// Draws the columns of a table over one of them.
pub fn table_curves(table: &TableFigure) -> Figure {
    let axis = |name: &str, log: bool| {
        let axis = Axis::new(column_label(name));
        if log { axis.log() } else { axis }
    };
    let mut figure = Figure::new().shared_x().caption(table.caption.clone());
    for (place, TablePanel { column, curves, note }) in table.panels.iter().enumerate() {
        let mut panel = Panel::new().x_axis(axis(&table.x, table.log[0])).y_axis(axis(column, table.log[1]));
        let floor = floor_of(curves, table);
        for curve in curves {
            // of several panels the first names the curves
            let label = if place == 0 { curve.label.as_str() } else { "" };
            panel = panel.curve(drawn(label, curve, table, floor));
        }
        for (curve, TableFit { law, ends }) in curves.iter().filter_map(|curve| Some((curve, curve.fit?))) {
            let name = format!("{} ~ x^{{{}}}", curve.label, TableFit { law, ends }.words());
            let line = between(ends, table.log).map(|x| (x, law.at(x)));
            panel = panel.curve(Curve::line(name.trim(), line).stroke(Stroke::Dashed).colour(Colour::Black));
        }
        // the last one stands beside all further curves
        let slopes = table.slopes.iter().chain(table.slopes.last().into_iter().cycle());
        for (curve, slope) in curves.iter().zip(slopes) {
            let name = format!("slope {slope}").replace('-', "−");
            let line = Curve::line(name, beside(*slope, curve, table));
            panel = panel.curve(line.stroke(Stroke::Dotted).colour(Colour::Black));
        }
        let points = curves.iter().flat_map(|curve| &curve.points);
        let of_fewer = points.filter(|point| point.is_of_fewer);
        let of_fewer: Vec<_> = of_fewer.map(|point| (point.x, middle(table, &point.found))).collect();
        if !of_fewer.is_empty() {
            let name = format!("{} of fewer rows", middle_name(table));
            panel = panel.curve(Curve::points(name, of_fewer).mark(Mark::Cross).colour(Colour::Black));
        }
        figure = figure.panel(panel.note(note.clone()));
    }
    figure
}

/// Places from one x above 0 to another at which a power law is drawn: both ends where it is a straight line.
fn between([from, to]: [f64; 2], log: [bool; 2]) -> impl Iterator<Item = f64> {
    let pieces = if log == [true; 2] { 1 } else { 100 };
    (0..=pieces).map(move |i| match f64::from(i) / f64::from(pieces) {
        1.0 => to,
        part if log[0] => from * (to / from).powf(part),
        part => from + part * (to - from),
    })
}

/// The line of a power law of this exponent through the middle of the points above 0 of a curve, of those that have a fit if it has one.
fn beside(slope: f64, curve: &TableCurve, table: &TableFigure) -> Vec<(f64, f64)> {
    let [from, to] = curve.fit.map_or([0.0, f64::INFINITY], |fit| fit.ends);
    let used = curve.points.iter().map(|point| (point.x, middle(table, &point.found)));
    let used: Vec<_> = used.filter(|(x, y)| (from..=to).contains(x) && *x > 0.0 && *y > 0.0).collect();
    let (Some((first, _)), Some((last, _))) = (used.first(), used.last()) else { return Vec::new() };
    let mean =
        |of: fn(&(f64, f64)) -> f64| used.iter().map(|at| of(at).ln()).sum::<f64>() / used.len() as f64;
    let (x, y) = (mean(|(x, _)| *x), mean(|(_, y)| *y));
    between([*first, *last], table.log).map(|at| (at, (y + slope * (at.ln() - x)).exp())).collect()
}

/// The middle of values that a curve goes through.
fn middle(table: &TableFigure, found: &Statistics) -> f64 {
    Band::middle(table.band, found)
}

fn middle_name(table: &TableFigure) -> &'static str {
    if table.band == Some(Band::Quantiles) { "median" } else { "mean" }
}

/// Most points of a curve that are marked.
const MARKED: usize = 40;

/// The least number that bands may go down to: on a logarithmic axis one below all that is drawn there, so that what has no lower end leaves
/// the others behind.
fn floor_of(curves: &[TableCurve], table: &TableFigure) -> f64 {
    if !table.log[1] {
        return f64::NEG_INFINITY;
    }
    let drawn = curves.iter().flat_map(|curve| &curve.points).flat_map(|TablePoint { found, .. }| {
        let error = found.standard_error.unwrap_or(0.0);
        let [low, quarter, rest, high] = found.quantiles;
        [found.mean, found.mean - error, found.mean + error, found.median, low, quarter, rest, high]
    });
    0.5 * drawn.filter(|value| *value > 0.0).fold(f64::INFINITY, f64::min)
}

fn drawn(label: &str, curve: &TableCurve, table: &TableFigure, floor: f64) -> Curve {
    let points = curve.points.iter().map(|point| (point.x, middle(table, &point.found)));
    let drawn = match (table.scattered, curve.points.len()) {
        (true, _) => Curve::points(label, points),
        (false, ..=MARKED) => Curve::line(label, points).mark(Mark::Circle),
        (false, _) => Curve::line(label, points),
    };
    let band = |low: &dyn Fn(&Statistics) -> f64, high: &dyn Fn(&Statistics) -> f64| -> Vec<_> {
        let reaching = |low: f64| if low < floor { floor } else { low };
        curve
            .points
            .iter()
            .map(|TablePoint { x, found, .. }| (*x, reaching(low(found)), high(found)))
            .collect()
    };
    match table.band {
        None => drawn,
        Some(Band::StandardError) => {
            let error = |found: &Statistics| found.standard_error.unwrap_or(f64::NAN);
            drawn.band(band(&|found| found.mean - error(found), &|found| found.mean + error(found)))
        }
        Some(Band::Quantiles) => drawn
            .band(band(&|found| found.quantiles[0], &|found| found.quantiles[3]))
            .band(band(&|found| found.quantiles[1], &|found| found.quantiles[2])),
    }
}
