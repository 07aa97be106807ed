//! Rows and figures of orbits.

use crate::branch::Change;
use crate::map::STEPS;
use crate::multipliers::{Multiplier, Multipliers};
use crate::spectra::Spectrum;
use crate::{NoOrbit, Orbit};
use consumers::table::{Cell, Column, Kind};
use figure::{Axis, Colour, ColourScale, Curve, Figure, FigureError, Panel, Stroke};
use plots::{HeatMap, column_label};
use schemas::amounts::quantity;
use std::collections::BTreeSet;
use std::f64::consts::TAU;
use waves::dispersion::UnitCell;
use waves::linear::LinearChain;

/// Columns of a branch, after that of the parameter.
const COLUMNS: [&str; 6] =
    ["period_s", "energy_j", "amplitude_m", "largest_multiplier", "unstable", "returns"];
/// Names of points on a map that have no name of an instability.
pub const STABLE: &str = "stable";
/// The same where not all multipliers are found.
const NONE_FOUND: &str = "stable as far as known";
/// The beginning of the same without an orbit.
pub const NOT_FOUND: &str = "no orbit found";
/// Places of these among the columns of a branch.
const ENERGY: usize = 2;
const AMPLITUDE: usize = 3;
const LARGEST: usize = 4;
const UNSTABLE: usize = 5;

/// Colours of branches that are born on the first one, in turn.
const BORN: [Colour; 5] = [Colour::Green, Colour::Purple, Colour::Orange, Colour::Sky, Colour::Grey];
/// Marks of changes of stability beside these.
const SHAPES: [figure::Mark; 4] =
    [figure::Mark::Circle, figure::Mark::Square, figure::Mark::Triangle, figure::Mark::Diamond];

/// Columns of a branch along `key`: its value, period (s), energy (J), amplitude (m), size of the largest multiplier, number of multipliers outside
/// of the unit circle, distance from the state a period later, over its size.
pub fn columns(key: &str) -> Vec<Column> {
    let kind = |name: &str| if name == "unstable" { Kind::Integer } else { Kind::Double };
    std::iter::once(key).chain(COLUMNS).map(|name| Column::new(name, kind(name))).collect()
}

/// The same of a branch and those that are born on it, with the number of the branch.
pub fn branch_columns(key: &str) -> Vec<Column> {
    columns(key).into_iter().chain([Column::new("branch", Kind::Integer)]).collect()
}

/// The number of the branch in a row of these.
pub fn branch_of(row: &[Cell]) -> usize {
    if let Some(Cell::Integer(branch)) = row.last() { usize::try_from(*branch).unwrap_or(0) } else { 0 }
}

/// The row of an orbit in the columns of one branch.
pub fn row(orbit: &Orbit) -> Vec<Cell> {
    let largest = orbit.multipliers.largest().map(Multiplier::size);
    vec![
        Cell::Double(orbit.unknown.parameter),
        Cell::Double(orbit.period_s()),
        Cell::Double(orbit.energy_j),
        Cell::Double(orbit.amplitude_m()),
        largest.into(),
        Cell::Integer(orbit.multipliers.unstable().count() as u64),
        Cell::Double(orbit.returns),
    ]
}

/// Columns of a map over two keys: their values, those of a branch, angle (rad) of the largest multiplier where one is outside of the
/// unit circle, name of the way in which the orbit is unstable.
pub fn map_columns([across, along]: &[String; 2]) -> Vec<Column> {
    let further = [Column::new("largest_angle_rad", Kind::Double), Column::new("stability", Kind::Word)];
    [Column::new(across, Kind::Double)].into_iter().chain(columns(along)).chain(further).collect()
}

/// The row of a point in these; almost empty where no orbit was found, for this reason.
pub fn map_row([across, along]: [f64; 2], found: Result<&Orbit, &NoOrbit>) -> Vec<Cell> {
    let orbit = match found {
        Ok(orbit) => orbit,
        Err(why) => {
            let are_long = matches!(why, NoOrbit::Config(error) if error.key == STEPS);
            let why = if are_long { ": steps too long (orbit.steps)" } else { "" };
            let empty = std::iter::repeat_n(Cell::Empty, COLUMNS.len() + 1);
            let start = [Cell::Double(across), Cell::Double(along)].into_iter();
            return start.chain(empty).chain([Cell::Word(format!("{NOT_FOUND}{why}"))]).collect();
        }
    };
    // the sizes of those on the circle differ by rounding
    let largest = orbit.multipliers.unstable().next();
    let angle = Cell::from(largest.map(Multiplier::angle_rad));
    let way = Cell::Word(way(&orbit.multipliers).to_owned());
    [Cell::Double(across)].into_iter().chain(row(orbit)).chain([angle, way]).collect()
}

/// The name of the way in which an orbit with these is unstable, or that it is stable.
pub fn way(found: &Multipliers) -> &'static str {
    let is_stable = if found.is_stable().is_some() { STABLE } else { NONE_FOUND };
    found.unstable().next().map_or(is_stable, |one| found.kind(one).as_str())
}

/// The name in a row of such a map.
pub fn stability(row: &[Cell]) -> &str {
    if let Some(Cell::Word(word)) = row.last() { word } else { NOT_FOUND }
}

/// The map over two keys with the values `values`, from its rows in the order of these: the largest multiplier in colours, and the limit of the
/// stable region.
///
/// # Errors
/// When it cannot be drawn, which is a mistake of ours.
pub fn map(
    caption: impl Into<String>,
    keys: &[String; 2],
    values: &[Vec<f64>; 2],
    rows: &[Vec<Cell>],
) -> Result<Figure, FigureError> {
    let is_log = |values: &[f64]| match values {
        [first, second, .., before, last] if *first > 0.0 && *last > 0.0 => {
            (second / first - last / before).abs() < 1e-6 * (second / first)
        }
        _ => false,
    };
    let point = |row: &Vec<Cell>| [double(&row[0]), double(&row[1]), double(&row[1 + LARGEST]).log10()];
    let map = HeatMap {
        columns: [keys[0].clone(), keys[1].clone(), "log₁₀ of the largest |μ|".to_owned()],
        log: [is_log(&values[0]), is_log(&values[1])],
        log_colours: false,
        values: rows.iter().map(point).collect(),
        caption: String::new(),
    };
    let sizes = || map.values.iter().map(|point| point[2]).filter(|size| size.is_finite());
    let scale = ColourScale::new(&map.columns[2], sizes().fold(0.0, f64::min), sizes().fold(0.0, f64::max));
    let is_stable: Vec<bool> = rows.iter().map(|row| stability(row).starts_with(STABLE)).collect();
    let limit = Curve::line("limit of stability", map.border(&is_stable)).colour(Colour::Black);
    let missed = rows.iter().filter(|row| stability(row).starts_with(NOT_FOUND)).count();
    let panel = map.panel(scale, &format!("no orbit found ({missed})"))?;
    Ok(Figure::new().caption(caption).panel(panel.curve(limit)))
}

/// The same as numbers.
pub fn values(orbit: &Orbit) -> Vec<f64> {
    row(orbit).iter().map(double).collect()
}

fn double(cell: &Cell) -> f64 {
    cell.number().unwrap_or(f64::NAN)
}

/// The multipliers of an orbit on the complex plane, with the unit circle.
pub fn multipliers(caption: impl Into<String>, found: &Multipliers) -> Figure {
    let circle = (0..=360).map(|degree| {
        let angle = TAU * f64::from(degree) / 360.0;
        (angle.cos(), angle.sin())
    });
    let place = |one: Multiplier| (one.re, one.im);
    let unstable: Vec<_> = found.unstable().collect();
    let stable: Vec<_> = found.telling().filter(|one| !unstable.contains(one)).map(place).collect();
    let mut panel = Panel::new().curve(Curve::line("", circle).thin()).height(1.5);
    if !stable.is_empty() {
        panel = panel.points("on or in the unit circle", stable);
    }
    let names: BTreeSet<&str> = unstable.iter().map(|one| found.kind(*one).as_str()).collect();
    for name in names {
        let of_name = unstable.iter().filter(|one| found.kind(**one).as_str() == name).map(|one| place(*one));
        panel = panel.curve(Curve::points(name, of_name).mark(figure::Mark::Square));
    }
    let farthest = found.telling().map(|one| one.re.abs().max(one.im.abs())).fold(1.0, f64::max) * 1.1;
    let axis = |label: &str| Axis::new(label).limits(-farthest, farthest);
    let panel = panel.x_axis(axis("Re μ")).y_axis(axis("Im μ"));
    Figure::new().caption(caption).panel(panel)
}

/// A change of stability, as a figure shows it.
#[derive(Debug, Clone, PartialEq)]
pub struct Mark {
    /// Its name.
    pub name: String,
    /// The number of the row before which it lies.
    pub before: usize,
    /// Its row.
    pub row: Vec<f64>,
}

/// A branch, from its rows: amplitude, energy and the largest multiplier along `key`; unstable parts are dashed.
pub fn branch(caption: impl Into<String>, key: &str, rows: &[Vec<Cell>], marks: &[Mark]) -> Figure {
    let mut figure = Figure::new().caption(caption).shared_x();
    let panels = [(AMPLITUDE, "largest displacement (m)"), (ENERGY, "energy (J)"), (LARGEST, "largest |μ|")];
    for (column, label) in panels {
        // one legend serves all panels
        figure = figure.panel(panel(key, (column, label), column == AMPLITUDE, rows, marks));
    }
    figure
}

/// A branch above spectra of runs at some of its values.
pub fn beside_spectra(
    caption: impl Into<String>,
    key: &str,
    rows: &[Vec<Cell>],
    marks: &[Mark],
    spectra: &[Spectrum],
) -> Figure {
    let x = column_label(key);
    let unit = x.rsplit_once('(').map_or("", |(_, unit)| unit.trim_end_matches(')'));
    let mut branch = panel(&x, (AMPLITUDE, "largest displacement (m)"), true, rows, marks);
    let largest = spectra.iter().flat_map(|one| &one.density).fold(0.0_f64, |most, value| most.max(*value));
    let mut panel = Panel::new()
        .x_axis(Axis::new("frequency over that of the orbits").limits(0.0, 1.15))
        .y_axis(Axis::new("velocity PSD (m^{2} s^{−2} Hz^{−1})").log().limits(1e-16 * largest, 3.0 * largest))
        .vertical("", 1.0)
        .height(1.1);
    for one in spectra {
        branch = branch.vertical("", one.parameter);
        let points = one.frequencies_hz.iter().zip(&one.density).skip(1);
        let points = points.map(|(frequency_hz, value)| (frequency_hz / one.orbit_hz, *value));
        panel = panel.line(format!("bead {} at {}", one.bead, quantity(one.parameter, unit)), points);
    }
    Figure::new().caption(caption).panel(branch).panel(panel)
}

/// A column of a branch along `key`, with the marks; curves have names if `is_named`.
fn panel(
    key: &str,
    (column, label): (usize, &str),
    is_named: bool,
    rows: &[Vec<Cell>],
    marks: &[Mark],
) -> Panel {
    let named = |name: &str| if is_named { name.to_owned() } else { String::new() };
    let mut panel = Panel::new().x_axis(Axis::new(key)).y_axis(Axis::new(label));
    let point = |values: &[f64]| (values[0], values[column]);
    let branches: BTreeSet<usize> = rows.iter().map(|row| branch_of(row)).collect();
    let has_born = branches.len() > 1;
    for branch in branches {
        // the values of each place, and true if the part that leads to it is unstable
        let mut places: Vec<(Vec<f64>, bool)> = Vec::new();
        for (number, row) in rows.iter().enumerate().filter(|(_, row)| branch_of(row) == branch) {
            let was_unstable = places.last().is_some_and(|(_, is_unstable)| *is_unstable);
            let between = marks.iter().filter(|mark| mark.before == number);
            places.extend(between.map(|mark| (mark.row.clone(), was_unstable)));
            let is_unstable = matches!(row[UNSTABLE], Cell::Integer(count) if count > 0);
            places.push((row.iter().map(double).collect(), is_unstable));
        }
        let parts = |wanted: bool| {
            let part = |pair: &[(Vec<f64>, bool)]| {
                let (from, to) = (point(&pair[0].0), point(&pair[1].0));
                if pair[1].1 == wanted { [from, to] } else { [(to.0, f64::NAN); 2] }
            };
            places.windows(2).flat_map(part).collect::<Vec<_>>()
        };
        let curve = |name: &str, is_unstable: bool| Curve::line(named(name), parts(is_unstable));
        let curves = if let Some(born) = branch.checked_sub(1) {
            // one colour, with the strokes of the first branch
            let colour = BORN[born % BORN.len()];
            [(format!("branch {branch}"), false), (String::new(), true)]
                .map(|(name, is_unstable)| curve(&name, is_unstable).colour(colour))
        } else {
            [curve("stable", false), curve("unstable", true)]
        };
        let [stable, unstable] = curves;
        panel = panel.curve(stable.stroke(Stroke::Solid)).curve(unstable.stroke(Stroke::Dashed));
    }
    let names: BTreeSet<&str> = marks.iter().map(|mark| mark.name.as_str()).collect();
    if column == LARGEST {
        panel = panel.horizontal("", 1.0);
    }
    for (name, shape) in names.iter().zip(SHAPES.into_iter().cycle()) {
        let of_name = marks.iter().filter(|mark| mark.name == *name).map(|mark| point(&mark.row));
        let points = Curve::points(named(name), of_name.collect::<Vec<_>>());
        // black beside the colours of many branches
        panel = panel.curve(if has_born { points.colour(Colour::Black).mark(shape) } else { points });
    }
    panel
}

/// The place of the frequency of an orbit among those of linear waves; none if there are no such waves, the chain repeats no unit, or the orbit is a
/// wave, whose period is that from bead to bead.
pub fn place(orbit: &Orbit) -> Option<&'static str> {
    if orbit.shift_beads > 0 {
        return None;
    }
    let linear = LinearChain::of(&orbit.physics.chain()).ok()?;
    let bands = UnitCell::of(&linear)?.bands_hz();
    let frequency_hz = 1.0 / orbit.period_s();
    let highest_hz = bands.iter().map(|band| band[1]).fold(0.0, f64::max);
    if highest_hz == 0.0 {
        return None;
    }
    let lowest_hz = bands.iter().map(|band| band[0]).fold(f64::INFINITY, f64::min);
    Some(match UnitCell::carries(&bands, frequency_hz) {
        true => "in a band of linear waves",
        false if frequency_hz > highest_hz => "above the bands of linear waves",
        false if frequency_hz < lowest_hz => "below the bands of linear waves",
        false => "in a gap between the bands of linear waves",
    })
}

/// A change of stability in words: `Neimark–Sacker at 0.389617`.
pub fn words(change: &Change) -> String {
    let way = if change.begins { "begins" } else { "ends" };
    let angle = change.multiplier.angle_rad().to_degrees().abs();
    let place = if change.is_located { "" } else { " somewhere in the step before" };
    format!("{} {way}{place}, multiplier {:.6} at {angle:.3}°", change.name, change.multiplier.size())
}
