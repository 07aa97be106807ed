//! Rows and figures of orbits.

use crate::Orbit;
use crate::branch::Change;
use crate::multipliers::Multipliers;
use consumers::table::{Cell, Column, Kind};
use figure::{Axis, Curve, Figure, Mark, Panel, Stroke};
use std::f64::consts::TAU;
use waves::dispersion::UnitCell;
use waves::linear::LinearChain;

/// Columns of a branch, after that of the parameter.
const COLUMNS: [&str; 6] =
    ["period_s", "energy_j", "amplitude_m", "largest_multiplier", "unstable", "returns"];
/// Places of these among the columns of a branch.
const ENERGY: usize = 2;
const AMPLITUDE: usize = 3;
const LARGEST: usize = 4;
const UNSTABLE: usize = 5;

/// Columns of a branch along `key`: its value, period (s), energy (J), amplitude (m), size of the largest multiplier, number of multipliers outside
/// of the unit circle, distance from the state a period later, over its size.
pub fn columns(key: &str) -> Vec<Column> {
    let kind = |name: &str| if name == "unstable" { Kind::Integer } else { Kind::Double };
    std::iter::once(key).chain(COLUMNS).map(|name| Column::new(name, kind(name))).collect()
}

/// The row of an orbit in these.
pub fn row(orbit: &Orbit) -> Vec<Cell> {
    let largest = orbit.multipliers.largest().map_or(Cell::Empty, |one| Cell::Double(one.size()));
    vec![
        Cell::Double(orbit.unknown.parameter),
        Cell::Double(orbit.period_s()),
        Cell::Double(orbit.energy_j),
        Cell::Double(orbit.amplitude_m()),
        largest,
        Cell::Integer(orbit.multipliers.unstable().count() as u64),
        Cell::Double(orbit.returns),
    ]
}

fn double(cell: &Cell) -> f64 {
    match cell {
        Cell::Double(value) => *value,
        _ => f64::NAN,
    }
}

/// The multipliers of an orbit on the complex plane, with the unit circle.
pub fn multipliers(caption: impl Into<String>, found: &Multipliers) -> Figure {
    let circle = (0..=360).map(|degree| {
        let angle = TAU * f64::from(degree) / 360.0;
        (angle.cos(), angle.sin())
    });
    let place = |one: crate::multipliers::Multiplier| (one.re, one.im);
    let unstable: Vec<_> = found.unstable().collect();
    let is_stable = |one: &crate::multipliers::Multiplier| !unstable.contains(one);
    let mut panel = Panel::new()
        .curve(Curve::line("", circle).thin())
        .points("on or in the unit circle", found.telling().filter(is_stable).map(place))
        .height(1.5);
    let mut kinds: Vec<_> = unstable.iter().map(|one| found.kind(*one)).collect();
    kinds.dedup();
    for kind in kinds {
        let of_kind = unstable.iter().filter(|one| found.kind(**one) == kind).map(|one| place(*one));
        panel = panel.curve(Curve::points(kind.as_str(), of_kind).mark(Mark::Square));
    }
    let farthest = found.telling().map(|one| one.re.abs().max(one.im.abs())).fold(1.0, f64::max) * 1.1;
    let axis = |label: &str| Axis::new(label).limits(-farthest, farthest);
    let panel = panel.x_axis(axis("Re μ")).y_axis(axis("Im μ"));
    Figure::new().caption(caption).panel(panel)
}

/// A branch, from its rows: amplitude, energy and the largest multiplier along `key`; unstable parts are dashed.
pub fn branch(
    caption: impl Into<String>,
    key: &str,
    rows: &[Vec<Cell>],
    changes: &[(String, f64, f64, f64)],
) -> Figure {
    let is_unstable = |row: &Vec<Cell>| matches!(row[UNSTABLE], Cell::Integer(count) if count > 0);
    let mut figure = Figure::new().caption(caption).shared_x();
    let panels = [(AMPLITUDE, "largest displacement (m)"), (ENERGY, "energy (J)"), (LARGEST, "largest |μ|")];
    let mut names: Vec<&str> = changes.iter().map(|(name, ..)| name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    for (column, label) in panels {
        // one legend serves all panels
        let named = |name: &str| if column == AMPLITUDE { name.to_owned() } else { String::new() };
        let mut panel = Panel::new().y_axis(Axis::new(label));
        // a step belongs to the part that it leads to
        let points = |wanted: bool| {
            let place = |place: usize| {
                let row = &rows[place];
                let is_shown = [place, place + 1]
                    .iter()
                    .any(|at| rows.get(*at).is_some_and(|row| is_unstable(row) == wanted));
                (double(&row[0]), if is_shown { double(&row[column]) } else { f64::NAN })
            };
            (0..rows.len()).map(place).collect::<Vec<_>>()
        };
        panel = panel.curve(Curve::line(named("stable"), points(false)));
        panel = panel.curve(Curve::line(named("unstable"), points(true)).stroke(Stroke::Dashed));
        if column == LARGEST {
            panel = panel.horizontal("", 1.0);
        }
        for name in &names {
            let of_name = changes.iter().filter(|(other, ..)| other == name);
            let places = of_name.map(|(_, parameter, amplitude_m, energy_j)| match column {
                AMPLITUDE => (*parameter, *amplitude_m),
                ENERGY => (*parameter, *energy_j),
                _ => (*parameter, 1.0),
            });
            panel = panel.points(named(name), places.collect::<Vec<_>>());
        }
        figure = figure.panel(panel.x_axis(Axis::new(key)));
    }
    figure
}

/// The place of the frequency of an orbit among those of linear waves; none if there are no such waves, or the chain repeats no unit.
pub fn place(orbit: &Orbit) -> Option<&'static str> {
    let linear = LinearChain::of(&orbit.physics.chain()).ok()?;
    let bands = UnitCell::of(&linear)?.bands_hz();
    let frequency_hz = 1.0 / orbit.period_s();
    let highest_hz = bands.iter().map(|band| band[1]).fold(0.0, f64::max);
    Some(match UnitCell::carries(&bands, frequency_hz) {
        true => "in a band of linear waves",
        false if frequency_hz > highest_hz => "above the bands of linear waves",
        false => "in a gap between the bands of linear waves",
    })
}

/// A change of stability in words: `Neimark–Sacker at 0.389617`.
pub fn words(change: &Change) -> String {
    let way = if change.begins { "begins" } else { "ends" };
    let angle = change.multiplier.angle_rad().to_degrees().abs();
    format!("{} {way}, multiplier {:.6} at {angle:.3}°", change.name, change.multiplier.size())
}
