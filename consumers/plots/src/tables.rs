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
    /// The law through points with x in `stretch`; none through fewer than three. Points are weighted by their standard errors where all have one.
    pub fn of(points: &[TablePoint], stretch: (f64, f64)) -> Option<Self> {
        let used = points.iter().filter(|point| (stretch.0..=stretch.1).contains(&point.x));
        let used: Vec<_> =
            used.map(|point| (point.x, point.found.mean, point.found.standard_error)).collect();
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
    pub fn fit(&mut self, stretch: (f64, f64)) {
        self.curves.iter_mut().for_each(|curve| curve.fit = TableFit::of(&curve.points, stretch));
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
        for curve in curves {
            // of several panels the first names the curves
            let label = if place == 0 { curve.label.as_str() } else { "" };
            panel = panel.curve(drawn(label, curve, table));
        }
        for (curve, TableFit { law, ends }) in curves.iter().filter_map(|curve| Some((curve, curve.fit?))) {
            let name = format!("{} ~ x^{{{}}}", curve.label, TableFit { law, ends }.words());
            let line = ends.map(|x| (x, law.at(x)));
            panel = panel.curve(Curve::line(name.trim(), line).stroke(Stroke::Dashed).colour(Colour::Black));
        }
        // the last one stands beside all further curves
        let slopes = table.slopes.iter().chain(table.slopes.last().into_iter().cycle());
        for (curve, slope) in curves.iter().zip(slopes) {
            let name = format!("slope {slope}").replace('-', "−");
            let line = Curve::line(name, beside(*slope, curve));
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

/// The line of a power law of this exponent through the middle of the points of a curve, of those that have a fit if it has one.
fn beside(slope: f64, curve: &TableCurve) -> Vec<(f64, f64)> {
    let [from, to] = curve.fit.map_or([0.0, f64::INFINITY], |fit| fit.ends);
    let used = || curve.points.iter().filter(|point| (from..=to).contains(&point.x));
    let mean =
        |of: fn(&TablePoint) -> f64| used().map(|point| of(point).ln()).sum::<f64>() / used().count() as f64;
    let (x, y) = (mean(|point| point.x), mean(|point| point.found.mean));
    let at = |point: &TablePoint| (point.x, (y + slope * (point.x.ln() - x)).exp());
    used().next().into_iter().chain(used().next_back()).map(at).collect()
}

/// The middle of values that a curve goes through.
fn middle(table: &TableFigure, found: &Statistics) -> f64 {
    if table.band == Some(Band::Quantiles) { found.median } else { found.mean }
}

fn middle_name(table: &TableFigure) -> &'static str {
    if table.band == Some(Band::Quantiles) { "median" } else { "mean" }
}

/// Most points of a curve that are marked.
const MARKED: usize = 40;

fn drawn(label: &str, curve: &TableCurve, table: &TableFigure) -> Curve {
    let points = curve.points.iter().map(|point| (point.x, middle(table, &point.found)));
    let drawn = match (table.scattered, curve.points.len()) {
        (true, _) => Curve::points(label, points),
        (false, ..=MARKED) => Curve::line(label, points).mark(Mark::Circle),
        (false, _) => Curve::line(label, points),
    };
    let band = |low: &dyn Fn(&Statistics) -> f64, high: &dyn Fn(&Statistics) -> f64| -> Vec<_> {
        curve.points.iter().map(|TablePoint { x, found, .. }| (*x, low(found), high(found))).collect()
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
