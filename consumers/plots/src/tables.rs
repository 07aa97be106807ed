//! Columns of any table over each other: curves, points, bands, heat maps.

mod heat;
mod labels;

pub use heat::{HeatMap, heat_map};
pub use labels::column_label;

use consumers::statistics::Statistics;
use figure::{Axis, Curve, Figure, Mark, Panel};

/// What a band around a curve shows, and which middle the curve then has.
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
    /// The values at each x, by rising x.
    pub points: Vec<(f64, Statistics)>,
}

/// What is drawn over one x axis.
#[derive(Debug, Clone, PartialEq)]
pub struct TableFigure {
    /// The column of the x axis.
    pub x: String,
    /// A panel for each column of results, with its curves.
    pub panels: Vec<(String, Vec<TableCurve>)>,
    /// Whether the axes are logarithmic.
    pub log: [bool; 2],
    /// What lies around the curves.
    pub band: Option<Band>,
    /// Rows next to each other differ in more than x: lines between them would mean nothing.
    pub scattered: bool,
    /// What is said under the panels.
    pub caption: String,
}

/// Draws the columns of a table over one of them.
pub fn table_curves(table: &TableFigure) -> Figure {
    let axis = |name: &str, log: bool| {
        let axis = Axis::new(column_label(name));
        if log { axis.log() } else { axis }
    };
    let mut figure = Figure::new().shared_x().caption(table.caption.clone());
    for (place, (name, curves)) in table.panels.iter().enumerate() {
        let mut panel = Panel::new().x_axis(axis(&table.x, table.log[0])).y_axis(axis(name, table.log[1]));
        for curve in curves {
            // of several panels the first names the curves
            let label = if place == 0 { curve.label.as_str() } else { "" };
            panel = panel.curve(drawn(label, curve, table));
        }
        figure = figure.panel(panel);
    }
    figure
}

/// Most points of a curve that are marked.
const MARKED: usize = 40;

fn drawn(label: &str, curve: &TableCurve, table: &TableFigure) -> Curve {
    let middle = |found: &Statistics| match table.band {
        Some(Band::Quantiles) => found.median,
        Some(Band::StandardError) | None => found.mean,
    };
    let points = curve.points.iter().map(|(x, found)| (*x, middle(found)));
    let drawn = match (table.scattered, curve.points.len()) {
        (true, _) => Curve::points(label, points),
        (false, ..=MARKED) => Curve::line(label, points).mark(Mark::Circle),
        (false, _) => Curve::line(label, points),
    };
    let band = |low: &dyn Fn(&Statistics) -> f64, high: &dyn Fn(&Statistics) -> f64| -> Vec<_> {
        curve.points.iter().map(|(x, found)| (*x, low(found), high(found))).collect()
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
