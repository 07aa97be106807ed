//! Pulses over the space-time map of the velocities.

use super::fields::{ColourSteps, map_of};
use super::{caption, scientific, three};
use consumers::fields::Field;
use consumers::pulses::Strongest;
use consumers::space_time::Picture;
use figure::{Axis, Colour, Curve, Figure, FigureError, Panel};
use schemas::manifest::RunManifest;

/// Pulses that have a colour and a name of their own in a figure.
const NAMED: usize = 5;
/// Other pulses that are drawn: more would hide the map.
const OTHERS: usize = 25;

/// The tracks of the pulses over the space-time map of the velocities, time running down, and below it how
/// the peak of each changes from bead to bead. Colours are linear up to `threshold_m_s`.
///
/// # Errors
/// When the map cannot be drawn, which is a mistake of ours.
pub fn pulses(
    manifest: &RunManifest,
    threshold_m_s: f64,
    map: &Picture<f32>,
    strongest: &mut Strongest,
) -> Result<Figure, FigureError> {
    let steps = ColourSteps::LogBeyond(threshold_m_s);
    let mut tracks = map_of(manifest, Field::Velocity, map, steps)?;
    let places = &map.extent().places;
    let x = Axis::new("bead").limits(places.start as f64 - 0.5, places.end as f64 - 0.5);
    let mut peaks = Panel::new().x_axis(x).y_axis(Axis::new("peak |v| (m/s)").log()).height(0.7);
    // dark enough to be seen on the map, and none of its two colours
    let violet = Colour::Rgb(0x6A, 0x1B, 0x9A);
    let colours = [Colour::Black, Colour::Green, Colour::Purple, Colour::Orange, violet];
    let found = strongest.pulses().to_vec();
    let (named, others) = found.split_at(found.len().min(NAMED));
    let drawn = &others[..others.len().min(OTHERS)];
    let named = named.iter().zip(colours).map(|(pulse, colour)| {
        let v_m_s = three(pulse.measured.point.v_peak_m_s);
        (pulse, colour, format!("{}: {v_m_s} m/s", pulse.number))
    });
    let unnamed = drawn.iter().map(|pulse| (pulse, Colour::Grey, String::new()));
    for (pulse, colour, label) in unnamed.chain(named) {
        let Some(path) = strongest.path(pulse.number) else { continue };
        let track = path.points().map(|point| (point.bead as f64, point.time_s * 1e3));
        let peak = path.points().map(|point| (point.bead as f64, point.v_peak_m_s.abs()));
        tracks = tracks.curve(Curve::line(label, track).colour(colour).thin());
        peaks = peaks.curve(Curve::line("", peak).colour(colour).thin());
    }
    if !others.is_empty() {
        let part = if drawn.len() < others.len() { format!("{} of ", drawn.len()) } else { String::new() };
        let name = format!("{part}{} others", others.len());
        tracks = tracks.curve(Curve::line(name, []).colour(Colour::Grey).thin());
    }
    let text = format!(
        "{}; lines: crests of pulses above {} m/s, by number and peak",
        caption(manifest),
        scientific(threshold_m_s)
    );
    Ok(Figure::new().shared_x().caption(text).panel(tracks).panel(peaks))
}
