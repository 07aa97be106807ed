//! How far the energy has spread, over time.

use super::caption;
use consumers::series::Series;
use consumers::spreading::SpreadingRow;
use figure::{Axis, Figure, Panel};
use schemas::manifest::RunManifest;

/// Columns of a [`SpreadingRow`] in a series of them.
const SECOND_MOMENT: usize = 2;
const PARTICIPATION: usize = 3;

/// The second moment of the energy and its participation number over time, both logarithmic: a power law is a straight line.
pub fn spreading(manifest: &RunManifest, rows: &Series<{ SpreadingRow::COLUMNS.len() }>) -> Figure {
    let panel = |label: &str, column: usize| {
        let curve = rows.curve(column).map(|(t, value)| (t * 1e3, value));
        // time 0 has no logarithm, nor has the moment of a single bead
        let curve: Vec<_> = curve.filter(|(t, value)| *t > 0.0 && *value > 0.0).collect();
        Panel::new().x_axis(Axis::new("time (ms)").log()).y_axis(Axis::new(label).log()).line("", curve)
    };
    Figure::new()
        .shared_x()
        .caption(caption(manifest))
        .panel(panel("second moment m_{2} (beads^{2})", SECOND_MOMENT))
        .panel(panel("participation number P (beads)", PARTICIPATION))
}
