//! What each analysis shows, drawn with [`crate::figure`].

mod deformation;

pub use deformation::deformations;

use crate::contacts::{COMPRESSED, ContactRaster, OPEN, TOUCHING};
use crate::energies::{EnergyRow, Reflection, STATIONARY};
use crate::figure::{Axis, Colour, Curve, Figure, FigureError, Panel, Raster};
use crate::impurity::{Event, EventKind, Motion};
use crate::series::Series;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use std::fmt::Write;

/// Columns of an [`EnergyRow`] in a series of them.
const TOTAL: usize = 2;
const LEFT: usize = 3;
const SPLIT: usize = 4;
const RIGHT: usize = 5;
const DRIFT: usize = 7;
const INBOUND: usize = 8;
const CORRECTED: usize = 9;

/// The parameters of a run as one line of text.
pub fn caption(manifest: &RunManifest) -> String {
    let physics = &manifest.physics;
    let mut text = format!(
        "{}: N = {}, m = {} g, α = {}, k = {} N m^{{−α}}",
        manifest.provenance.name,
        physics.beads,
        short(physics.bead_mass_kg * 1e3),
        short(physics.alpha),
        scientific(physics.stiffness),
    );
    // writing to a String cannot fail
    for impurity in physics.impurities.iter().take(4) {
        let _ = write!(text, ", bead {}: {} g", impurity.bead, short(impurity.mass_kg * 1e3));
    }
    if physics.impurities.len() > 4 {
        let _ = write!(text, ", … ({} impurities)", physics.impurities.len());
    }
    for phrase in physics.particulars() {
        let _ = write!(text, ", {}", phrase.replace('-', "−"));
    }
    let striker = physics.striker;
    let dt = scientific(physics.dt_s);
    let _ = write!(
        text,
        ", v_{{0}} = {} m/s on bead {}; {}, dt = {dt} s",
        short(striker.velocity_m_s),
        striker.bead,
        physics.method
    );
    text
}

/// A number in at most six digits.
fn short(value: f64) -> String {
    let rounded = format!("{value:.5e}").parse::<f64>().unwrap_or(value);
    format!("{rounded}").replace('-', "−")
}

/// A number as `1.45×10^{−6}`.
fn scientific(value: f64) -> String {
    let text = format!("{value:.2e}");
    let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let digits =
        if digits.contains('.') { digits.trim_end_matches('0').trim_end_matches('.') } else { digits };
    let power = format!("10^{{{}}}", exponent.replace('-', "−"));
    if digits == "1" { power } else { format!("{digits}×{power}") }
}

/// Velocity and displacement of every bead in one frame.
pub fn profiles(manifest: &RunManifest, frame: &Frame<'_>) -> Figure {
    let points = |values: &[f64], factor: f64| -> Vec<(f64, f64)> {
        values.iter().enumerate().map(|(bead, value)| (bead as f64, value * factor)).collect()
    };
    let mut velocity = Panel::new().y_axis("velocity (m/s)").line("", points(frame.v_m_s, 1.0));
    let shown_mm = bulk_range(frame.u_m).map(|limit_m| limit_m * 1e3);
    let mut displacement = Panel::new()
        .y_axis(Axis::new("displacement (mm)").limits(shown_mm[0], shown_mm[1]))
        .line("", points(frame.u_m, 1e3))
        .note(beyond_note(frame.u_m, shown_mm));
    for impurity in manifest.physics.impurities.iter().take(4) {
        velocity = velocity.vertical("impurity", impurity.bead as f64);
        displacement = displacement.vertical("", impurity.bead as f64);
    }
    let x = || Axis::new("bead").limits(0.0, manifest.physics.beads as f64 - 1.0);
    let text = format!("{}; t = {} ms", caption(manifest), short(frame.time_s * 1e3));
    Figure::new().shared_x().caption(text).panel(velocity.x_axis(x())).panel(displacement.x_axis(x()))
}

/// The range of all but a fiftieth of the values at either end, with some room: the struck end of a
/// chain flies off, and the rest would be a flat line beside it.
fn bulk_range(values: &[f64]) -> [f64; 2] {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let few = sorted.len() / 50;
    let (low, high) = (sorted[few], sorted[sorted.len() - 1 - few]);
    let room = 0.15 * (high - low);
    [low - room, high + room]
}

/// Says what lies outside of the displacements shown (mm).
fn beyond_note(u_m: &[f64], shown_mm: [f64; 2]) -> String {
    let beyond: Vec<f64> =
        u_m.iter().map(|u| u * 1e3).filter(|u| *u < shown_mm[0] || *u > shown_mm[1]).collect();
    let Some(farthest) = beyond.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs())) else {
        return String::new();
    };
    format!(
        "{} beads beyond the frame, as far as {} mm",
        beyond.len(),
        short((farthest * 10.0).round() / 10.0)
    )
}

/// The energies left of, in and right of the split bead, what of them may still cross it, and the drift of
/// their sum. Where something is reflected, also when the pulse arrived and since when that is stationary.
pub fn energies(
    manifest: &RunManifest,
    split_bead: u64,
    rows: &Series<{ EnergyRow::COLUMNS.len() }>,
    reflection: Option<&Reflection>,
) -> Figure {
    let times_s = rows.times_s();
    let curve = |column: usize, factor: f64| -> Vec<(f64, f64)> {
        times_s.iter().zip(rows.column(column)).map(|(t, value)| (t * 1e3, value * factor)).collect()
    };
    let panel = || Panel::new().x_axis("time (ms)");
    let parts = panel()
        .y_axis("energy (mJ)")
        .line(format!("left of bead {split_bead}"), curve(LEFT, 1e3))
        .line(format!("bead {split_bead}"), curve(SPLIT, 1e3))
        .line(format!("right of bead {split_bead}"), curve(RIGHT, 1e3));
    let drift = panel()
        .y_axis("(E − E_{0})/E_{0}")
        .curve(Curve::line("", curve(DRIFT, 1.0)).colour(Colour::Black))
        .height(0.6);
    let figure = Figure::new().shared_x().caption(caption(manifest)).panel(parts);
    match reflection {
        Some(reflection) => figure.panel(scattering(panel(), &times_s, rows, reflection)).panel(drift),
        None => figure.panel(drift),
    }
}

/// What is left on the incident side without the recoil, and what may still cross, both as parts of the
/// total energy.
fn scattering(
    panel: Panel,
    times_s: &[f64],
    rows: &Series<{ EnergyRow::COLUMNS.len() }>,
    reflection: &Reflection,
) -> Panel {
    let part = |column: usize| -> Vec<(f64, f64)> {
        let parts = rows.column(column).into_iter().zip(rows.column(TOTAL));
        times_s.iter().zip(parts).map(|(t, (value, total))| (t * 1e3, value / total)).collect()
    };
    let mut panel = panel
        .y_axis(Axis::new("part of E").log().limits(1e-7, 2.0))
        .line("reflected, without recoil", part(CORRECTED))
        .line("may still cross", part(INBOUND))
        .horizontal("", STATIONARY);
    if let Some(since) = reflection.stationary_since {
        let last_s = times_s.last().copied().unwrap_or(since.time_s);
        let until_s = reflection.met_end.map_or(last_s, |(_, met)| met.time_s);
        panel = panel.band_x("stationary", since.time_s * 1e3, until_s * 1e3);
    }
    panel
}

/// Displacement and velocity of the beads that were followed; `motions` holds one series a bead.
pub fn trajectories(
    manifest: &RunManifest,
    beads: &[u64],
    motions: &[Series<{ Motion::QUANTITIES.len() }>],
    events: &[Event],
) -> Figure {
    let (from_ms, to_ms) = shown_ms(motions, events);
    let panel =
        |label: &str| Panel::new().x_axis(Axis::new("time (ms)").limits(from_ms, to_ms)).y_axis(label);
    let (mut displacement, mut velocity) = (panel("displacement (mm)"), panel("velocity (m/s)").height(0.7));
    for (bead, series) in beads.iter().zip(motions) {
        let times_s = series.times_s();
        let curve = |column: usize, factor: f64| -> Vec<(f64, f64)> {
            times_s.iter().zip(series.column(column)).map(|(t, value)| (t * 1e3, value * factor)).collect()
        };
        displacement = displacement.line(format!("bead {bead}"), curve(0, 1e3));
        velocity = velocity.line("", curve(1, 1.0));
    }
    let turns = events.iter().filter(|event| event.kind == EventKind::Turns);
    let turns: Vec<_> = turns.map(|event| (event.time_s * 1e3, event.u_m * 1e3)).collect();
    if !turns.is_empty() {
        displacement = displacement.curve(Curve::points("turning points", turns).colour(Colour::Black));
    }
    Figure::new().shared_x().caption(caption(manifest)).panel(displacement).panel(velocity)
}

/// The times (ms) from a little before the first event to the end, or all of them.
fn shown_ms(motions: &[Series<{ Motion::QUANTITIES.len() }>], events: &[Event]) -> (f64, f64) {
    let times_s = motions.first().map(Series::times_s).unwrap_or_default();
    let (Some(first), Some(last)) = (times_s.first(), times_s.last()) else { return (0.0, 1.0) };
    let begin = events.first().map_or(*first, |event| event.time_s - 0.04 * (last - event.time_s));
    (if begin > *first { begin } else { *first } * 1e3, last * 1e3)
}

/// The space-time map of the contacts, time running down as in the paper.
///
/// # Errors
/// When the cells hold something else than classes of contacts.
pub fn contact_map(
    manifest: &RunManifest,
    tolerance_m: f64,
    raster: &ContactRaster,
) -> Result<Figure, FigureError> {
    let mut classes = [("", Colour::White); 3];
    classes[usize::from(TOUCHING)] = ("touching", Colour::White);
    classes[usize::from(COMPRESSED)] = ("compressed", Colour::Black);
    classes[usize::from(OPEN)] = ("open", Colour::Orange);
    // both sides of a contact raster are at most 1000
    let side = |cells: usize| u32::try_from(cells).unwrap_or(u32::MAX);
    let contacts = manifest.physics.beads as f64 - 1.0;
    let end_ms = manifest.physics.time_s(manifest.physics.step_count) * 1e3;
    let map =
        Raster::classes(side(raster.columns()), side(raster.rows()), raster.cells().to_vec(), &classes)?
            .over((-0.5, contacts - 0.5), (0.0, end_ms));
    let panel =
        Panel::new().x_axis("contact").y_axis(Axis::new("time (ms)").reversed()).raster(map).height(1.6);
    let text = format!("{}; touching: |δ| ≤ {} m", caption(manifest), scientific(tolerance_m));
    Ok(Figure::new().caption(text).panel(panel))
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::manifest::Origin;
    use schemas::presets::PRESETS;

    #[test]
    fn a_caption_names_every_parameter() {
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let m = RunManifest::new(&PRESETS[0].config(), "run", origin).expect("valid");
        assert_eq!(
            caption(&m),
            "light-impurity: N = 1000, m = 1 g, α = 1.5, k = 10^{7} N m^{−α}, bead 500: 0.6 g, \
             v_{0} = 5 m/s on bead 0; rkn4, dt = 7.25×10^{−7} s"
        );
    }
}
