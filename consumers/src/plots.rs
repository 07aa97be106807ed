//! What each analysis shows, drawn with [`crate::figure`].

mod deformation;

pub use deformation::deformations;

use crate::contacts::{COMPRESSED, ContactRaster, OPEN, TOUCHING};
use crate::energies::{EnergyRow, Reflection, STATIONARY};
use crate::figure::{Axis, Colour, Curve, Figure, FigureError, Panel, Raster};
use crate::impurity::{Event, EventKind, Motion};
use crate::pulses::{Strongest, VelocityMap};
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
        .y_axis(Axis::new("energy/total").log().limits(1e-7, 2.0))
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
    let end_s = manifest.physics.time_s(manifest.physics.step_count);
    contact_map_until(manifest, tolerance_m, raster, end_s)
}

/// The same for a raster that ends at `end_s` (s).
///
/// # Errors
/// When the cells hold something else than classes of contacts.
pub fn contact_map_until(
    manifest: &RunManifest,
    tolerance_m: f64,
    raster: &ContactRaster,
    end_s: f64,
) -> Result<Figure, FigureError> {
    let mut classes = [("", Colour::White); 3];
    classes[usize::from(TOUCHING)] = ("touching", Colour::White);
    classes[usize::from(COMPRESSED)] = ("compressed", Colour::Black);
    classes[usize::from(OPEN)] = ("open", Colour::Orange);
    // both sides of a contact raster are at most 1000
    let side = |cells: usize| u32::try_from(cells).unwrap_or(u32::MAX);
    let contacts = manifest.physics.beads as f64 - 1.0;
    let map =
        Raster::classes(side(raster.columns()), side(raster.rows()), raster.cells().to_vec(), &classes)?
            .over((-0.5, contacts - 0.5), (0.0, end_s * 1e3));
    let panel =
        Panel::new().x_axis("contact").y_axis(Axis::new("time (ms)").reversed()).raster(map).height(1.6);
    let text = format!("{}; touching: |δ| ≤ {} m", caption(manifest), scientific(tolerance_m));
    Ok(Figure::new().caption(text).panel(panel))
}

/// Pulses that have a colour and a name of their own in a figure.
const NAMED: usize = 5;

/// The tracks of the pulses over the space-time map of the velocities, time running down, and below it how
/// the peak of each changes from bead to bead. Velocities below `threshold_m_s` are white.
///
/// # Errors
/// When the map cannot be drawn, which is a mistake of ours.
pub fn pulses(
    manifest: &RunManifest,
    threshold_m_s: f64,
    map: &VelocityMap,
    strongest: &mut Strongest,
) -> Result<Figure, FigureError> {
    let last_bead = manifest.physics.beads as f64 - 1.0;
    let end_ms = manifest.physics.time_s(manifest.physics.step_count) * 1e3;
    let raster = velocity_raster(threshold_m_s, map)?.over((-0.5, last_bead + 0.5), (0.0, end_ms));
    let x = || Axis::new("bead").limits(-0.5, last_bead + 0.5);
    let mut tracks =
        Panel::new().x_axis(x()).y_axis(Axis::new("time (ms)").reversed()).raster(raster).height(1.6);
    let mut peaks = Panel::new().x_axis(x()).y_axis(Axis::new("peak |v| (m/s)").log()).height(0.7);
    // dark enough to be seen on the map, and none of its two colours
    let navy = Colour::Rgb(0x00, 0x2B, 0x80);
    let colours = [Colour::Black, Colour::Green, Colour::Purple, Colour::Sky, navy];
    let drawn = strongest.pulses().to_vec();
    let (named, others) = drawn.split_at(drawn.len().min(NAMED));
    let named = named.iter().zip(colours).map(|(pulse, colour)| {
        let v_m_s = short(rounded(pulse.measured.point.v_peak_m_s));
        (pulse, colour, format!("{}: {v_m_s} m/s", pulse.number))
    });
    let others = others.iter().map(|pulse| (pulse, Colour::Grey, String::new()));
    for (pulse, colour, label) in others.chain(named) {
        let Some(path) = strongest.path(pulse.number) else { continue };
        let track = path.points().map(|point| (point.bead as f64, point.time_s * 1e3));
        let peak = path.points().map(|point| (point.bead as f64, point.v_peak_m_s.abs()));
        tracks = tracks.curve(Curve::line(label, track).colour(colour).thin());
        peaks = peaks.curve(Curve::line("", peak).colour(colour).thin());
    }
    if drawn.len() > NAMED {
        let name = format!("{} others", drawn.len() - NAMED);
        tracks = tracks.curve(Curve::line(name, []).colour(Colour::Grey).thin());
    }
    let text = format!(
        "{}; lines: crests of pulses, by number and peak; colours: velocity, from {} m/s on",
        caption(manifest),
        scientific(threshold_m_s)
    );
    Ok(Figure::new().shared_x().caption(text).panel(tracks).panel(peaks))
}

/// Three digits.
fn rounded(value: f64) -> f64 {
    format!("{value:.2e}").parse().unwrap_or(value)
}

/// Velocities as classes: two for each factor of ten from `threshold_m_s` up, either way.
fn velocity_raster(threshold_m_s: f64, map: &VelocityMap) -> Result<Raster, FigureError> {
    let largest_m_s = map.cells().iter().fold(0.0_f64, |largest, v| {
        let v = f64::from(v.abs());
        if v > largest { v } else { largest }
    });
    // half decades; the outermost class has the largest velocity in it
    let level_of = |v_m_s: f64| (2.0 * v_m_s.log10()).floor();
    let lowest = level_of(threshold_m_s);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 40")]
    let steps = (level_of(largest_m_s) - lowest + 1.0).clamp(1.0, 40.0) as u8;
    let class = |v_m_s: &f32| {
        let v_m_s = f64::from(*v_m_s);
        if v_m_s.abs() < threshold_m_s {
            return steps;
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 40")]
        let level = (level_of(v_m_s.abs()) - lowest + 1.0).clamp(1.0, f64::from(steps)) as u8;
        if v_m_s > 0.0 { steps + level } else { steps - level }
    };
    let cells = map.cells().iter().map(class).collect();
    let mut classes: Vec<(String, Colour)> = (0..=2 * steps)
        .map(|class| {
            let level = i32::from(class) - i32::from(steps);
            let exponent = lowest + f64::from(level.abs()) - 1.0;
            let value_m_s = f64::from(level.signum()) * 10_f64.powf(0.5 * exponent);
            let decade = level != 0 && exponent.rem_euclid(2.0) == 0.0;
            let name = if decade { short(value_m_s) } else { String::new() };
            (name, diverging(f64::from(level) / f64::from(steps)))
        })
        .collect();
    // the unit once: there is one line for all of them
    if let Some((name, _)) = classes.iter_mut().rfind(|(name, _)| !name.is_empty()) {
        name.push_str(" m/s");
    }
    let classes: Vec<_> = classes.iter().map(|(name, colour)| (name.as_str(), *colour)).collect();
    // both sides of a velocity map are at most 1000
    let side = |cells: usize| u32::try_from(cells).unwrap_or(u32::MAX);
    Raster::classes(side(map.columns()), side(map.rows()), cells, &classes)
}

/// Blue for −1, white for 0, vermillion for 1: told apart by every kind of colour vision.
fn diverging(value: f64) -> Colour {
    let [red, green, blue] = if value < 0.0 { [0x00, 0x72, 0xB2] } else { [0xD5, 0x5E, 0x00] };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
    let mix = |full: u8| (255.0 + (f64::from(full) - 255.0) * value.abs()).round() as u8;
    Colour::Rgb(mix(red), mix(green), mix(blue))
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
             v_{0} = 5 m/s on bead 0; rkn4, dt = 1.45×10^{−6} s"
        );
    }
}
