//! Quantities of every bead or contact: at one time, and over space and time.

use super::{caption, map_panel, prefix, quantity, rounded, short, sides};
use consumers::fields::Field;
use consumers::space_time::Picture;
use figure::{Axis, Colour, ColourScale, Curve, Figure, FigureError, Mark, Panel, Raster, Stroke};
use schemas::amounts::counted;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use std::ops::Range;

/// Impurities that are marked in a profile.
const MARKED: usize = 8;

/// Scale of colours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ColourSteps {
    /// In proportion: what is strong is compared well, what is weak disappears.
    Linear,
    /// By the logarithm, from a size on that the numbers themselves suggest.
    Log,
    /// As it suits the quantity: displacements linear, the others by the logarithm.
    Fitting,
    /// By the logarithm, beyond this number.
    LogBeyond(f64),
}

/// Velocity and displacement of every bead in one frame.
pub fn profiles(manifest: &RunManifest, frame: &Frame<'_>) -> Figure {
    let beads = 0..manifest.contact_count() + 1;
    let of = |field| profile_panel(manifest, frame, field, &beads);
    let velocity = mark_impurities(of(Field::Velocity), manifest, Field::Velocity, &beads, true);
    let displacement = mark_impurities(of(Field::Displacement), manifest, Field::Displacement, &beads, false);
    at(manifest, frame).shared_x().panel(velocity).panel(displacement)
}

/// A quantity along the chain in one frame, for the beads or contacts `places`.
pub fn profile(manifest: &RunManifest, frame: &Frame<'_>, field: Field, places: &Range<usize>) -> Figure {
    let panel = mark_impurities(profile_panel(manifest, frame, field, places), manifest, field, places, true);
    let figure = at(manifest, frame).shared_x().panel(panel);
    if is_loaded(manifest, field) { figure.panel(beyond_rest(manifest, frame, places)) } else { figure }
}

/// True if the values at rest are not 0.
fn is_loaded(manifest: &RunManifest, field: Field) -> bool {
    field == Field::Overlap && manifest.physics.chain().is_loaded()
}

/// Panel of the differences between the overlaps of a loaded chain and those at rest. They are far less than the
/// overlaps at rest.
fn beyond_rest(manifest: &RunManifest, frame: &Frame<'_>, places: &Range<usize>) -> Panel {
    let chain = manifest.physics.chain();
    let values: Vec<f64> = Field::Overlap.deviations(&chain, frame).collect();
    let values = &values[places.clone()];
    let largest = values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
    let (prefix, factor) = prefix(largest);
    let curve = places.clone().zip(values).map(|(place, value)| (place as f64, value * factor));
    let x = profile_axis(Field::Overlap, places);
    let label = format!("overlap beyond rest ({prefix}m)");
    let panel = Panel::new().x_axis(x).y_axis(label).curve(marked(Curve::line("", curve), places));
    mark_impurities(panel, manifest, Field::Overlap, places, false)
}

/// True if each bead is marked, so that a person sees that the chain has few.
fn is_marked(places: &Range<usize>) -> bool {
    places.len() <= 60
}

pub(super) fn marked(curve: Curve, places: &Range<usize>) -> Curve {
    if is_marked(places) { curve.mark(Mark::Circle) } else { curve }
}

/// Axis from the first place to the last, with room for their marks.
pub(super) fn profile_axis(field: Field, places: &Range<usize>) -> Axis {
    let room = if is_marked(places) { 0.5 } else { 0.0 };
    Axis::new(field.place()).limits(places.start as f64 - room, places.end as f64 - 1.0 + room)
}

fn at(manifest: &RunManifest, frame: &Frame<'_>) -> Figure {
    let (time_ms, step) = (short(frame.time_s * 1e3), frame.step);
    Figure::new().caption(format!("{}; t = {time_ms}\u{a0}ms (step {step})", caption(manifest)))
}

fn profile_panel(manifest: &RunManifest, frame: &Frame<'_>, field: Field, places: &Range<usize>) -> Panel {
    let chain = manifest.physics.chain();
    let values: Vec<f64> = field.values(&chain, frame).collect();
    let values = &values[places.clone()];
    let shown = shown_range(manifest, field, false, values);
    let (label, factor) = label(field, shown[0].abs().max(shown[1].abs()));
    let points = |values: &[f64]| -> Vec<(f64, f64)> {
        places.clone().zip(values).map(|(place, value)| (place as f64, value * factor)).collect()
    };
    let mut y = Axis::new(label);
    if field != Field::Velocity {
        y = y.limits(shown[0] * factor, shown[1] * factor);
    }
    let x = profile_axis(field, places);
    let is_loaded = is_loaded(manifest, field);
    let name = if is_loaded { field_name(field) } else { "" };
    let curve = marked(Curve::line(name, points(values)), places);
    let mut panel = Panel::new().x_axis(x).y_axis(y).curve(curve).note(beyond_note(field, values, shown));
    if is_loaded {
        let rest: Vec<f64> = places.clone().map(|contact| chain.rest_m(contact)).collect();
        let rest = points(&rest);
        panel = panel.curve(Curve::line("at rest", rest).colour(Colour::Grey).stroke(Stroke::Dashed).thin());
    }
    panel
}

/// Vertical lines at the impurities; between the contacts of one. Of several panels the first names them.
pub(super) fn mark_impurities(
    panel: Panel,
    manifest: &RunManifest,
    field: Field,
    places: &Range<usize>,
    named: bool,
) -> Panel {
    let half = if field == Field::Overlap { 0.5 } else { 0.0 };
    let impurities = manifest.physics.impurities.iter().map(|impurity| impurity.bead as f64 - half);
    let shown = impurities.filter(|x| (places.start as f64..places.end as f64).contains(x));
    let shown: Vec<f64> = shown.collect();
    if shown.len() > MARKED {
        return panel;
    }
    let name = |index: usize| match (index, shown.len()) {
        _ if !named => "",
        (0, 1) => "impurity",
        (0, _) => "impurities",
        _ => "",
    };
    shown.iter().enumerate().fold(panel, |panel, (index, x)| panel.vertical(name(index), *x))
}

/// A quantity over space and time, as far as `picture` goes, time running down. Colours end at the limits `range`
/// (SI), which have 0 between them, or where the values suggest.
///
/// # Errors
/// When the map cannot be drawn, which is a mistake of ours.
pub fn space_time(
    manifest: &RunManifest,
    field: Field,
    picture: &Picture<f32>,
    steps: ColourSteps,
    range: Option<[f64; 2]>,
) -> Result<Figure, FigureError> {
    let ends = range.unwrap_or_else(|| coloured(manifest, field, picture, steps));
    let panel = map_within(manifest, field, picture, steps, ends)?.height(1.35);
    let [least, largest] = extremes(picture);
    let beyond = if least >= ends[0] && largest <= ends[1] {
        String::new()
    } else {
        let said = |value: f64| match field {
            Field::Velocity => format!("{}\u{a0}m/s", short(rounded(value))),
            _ => quantity(value, field.unit()),
        };
        let farthest = said(if largest > -least { largest } else { least });
        let symmetric = range.is_none_or(|[from, to]| from == -to);
        let ends = if symmetric {
            format!("beyond ±{}", said(ends[1].max(-ends[0])))
        } else {
            format!("outside of {} to {}", said(ends[0]), said(ends[1]))
        };
        format!("; values {ends}, as far as {farthest}, have the darkest colours")
    };
    Ok(Figure::new().caption(format!("{}{beyond}", caption(manifest))).panel(panel))
}

/// The least and the largest value, and 0.
fn extremes(picture: &Picture<f32>) -> [f64; 2] {
    let widened = |[low, high]: [f32; 2], value: f32| {
        [if value < low { value } else { low }, if value > high { value } else { high }]
    };
    picture.cells().flatten().fold([0.0; 2], widened).map(f64::from)
}

/// The values that have colours of their own: all of them if colours follow the logarithm.
fn coloured(manifest: &RunManifest, field: Field, picture: &Picture<f32>, steps: ColourSteps) -> [f64; 2] {
    let [least, largest] = extremes(picture);
    let linear =
        steps == ColourSteps::Linear || steps == ColourSteps::Fitting && field == Field::Displacement;
    if !linear {
        return [least, largest];
    }
    let values: Vec<f64> = picture.cells().flatten().map(f64::from).collect();
    let [low, high] = bulk(manifest, field, true, &values);
    let end = high.max(-low);
    // what is cut off by a little is not worth a word
    if -1.2 * end <= least && largest <= 1.2 * end {
        return [least, largest];
    }
    [if -end > least { -end } else { least }, if end < largest { end } else { largest }]
}

pub(super) fn map_of(
    manifest: &RunManifest,
    field: Field,
    picture: &Picture<f32>,
    steps: ColourSteps,
) -> Result<Panel, FigureError> {
    map_within(manifest, field, picture, steps, coloured(manifest, field, picture, steps))
}

fn map_within(
    manifest: &RunManifest,
    field: Field,
    picture: &Picture<f32>,
    steps: ColourSteps,
    [low, high]: [f64; 2],
) -> Result<Panel, FigureError> {
    let (label, factor) = label_beyond_rest(manifest, field, high.max(-low));
    #[expect(clippy::cast_possible_truncation, reason = "seven digits are enough for a colour")]
    let [single, low_shown, high_shown] = [factor, low * factor, high * factor].map(|value| value as f32);
    let shown = |value: f32| {
        let value = value * single;
        if value < low_shown {
            low_shown
        } else if value > high_shown {
            high_shown
        } else {
            value
        }
    };
    let cells: Vec<Option<f32>> = picture.cells().map(|cell| cell.map(shown)).collect();
    let mut scale = ColourScale::new(label, low * factor, high * factor);
    scale = match steps {
        ColourSteps::Linear => scale,
        ColourSteps::Fitting if field == Field::Displacement => scale,
        ColourSteps::Log | ColourSteps::Fitting => scale.log_beyond(linear_within(low, high) * factor),
        ColourSteps::LogBeyond(value) => scale.log_beyond(value * factor),
    };
    let (columns, rows) = sides(picture);
    let raster = Raster::values(columns, rows, &cells, scale)?;
    Ok(map_panel(manifest, field.place(), picture.extent(), raster))
}

/// Three decades below the sign that reaches less far, or four below the other if that is more.
fn linear_within(low: f64, high: f64) -> f64 {
    let (less, more) = if high < -low { (high, -low) } else { (-low, high) };
    (1e-3 * less).max(1e-4 * more)
}

fn field_name(field: Field) -> &'static str {
    if field == Field::Energy { "energy of a bead" } else { field.as_str() }
}

/// The label of an axis on which `largest` is shown as 1 to 1000, and the factor from SI units.
fn label(field: Field, largest: f64) -> (String, f64) {
    let (prefix, factor) = if field == Field::Velocity { ("", 1.0) } else { prefix(largest) };
    (format!("{} ({prefix}{})", field_name(field), field.unit()), factor)
}

/// The same for differences from the values at rest.
pub(super) fn label_beyond_rest(manifest: &RunManifest, field: Field, largest: f64) -> (String, f64) {
    let (label, factor) = label(field, largest);
    let label =
        if is_loaded(manifest, field) { label.replace("overlap", "overlap beyond rest") } else { label };
    (label, factor)
}

/// Range of the values that is shown. Displacements other than 0 lose a fiftieth at either end, since the struck end of a
/// chain flies off, and the rest would be a flat line beside it. No gap wider than the largest overlap is shown, if there is an
/// overlap; a bond has no gaps, nor need a loaded contact have one that is less pressed than at rest, from which values count if they are `from_rest`.
fn bulk(manifest: &RunManifest, field: Field, from_rest: bool, values: &[f64]) -> [f64; 2] {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let Some((mut low, mut high)) = sorted.first().copied().zip(sorted.last().copied()) else {
        return [0.0; 2];
    };
    if field == Field::Displacement && low < high {
        // beads that have not moved yet say nothing about how far the others have
        sorted.retain(|value| *value != 0.0);
        let few = sorted.len() / 50;
        let mut near = [sorted[few], sorted[sorted.len() - 1 - few]];
        if sorted.len() < values.len() {
            near = [near[0].min(0.0), near[1].max(0.0)];
        }
        // the tail of a front is next to nothing
        if near[1] - near[0] > 1e-9 * (high - low) {
            [low, high] = near;
        }
    }
    let can_be_gaps = manifest.physics.bonds.is_none() && !(from_rest && is_loaded(manifest, field));
    if field == Field::Overlap && can_be_gaps && high > 0.0 && low < -high {
        low = -high;
    }
    [low, high]
}

/// This range with some room on both sides, which equal values other than 0 have, too.
pub(super) fn shown_range(manifest: &RunManifest, field: Field, from_rest: bool, values: &[f64]) -> [f64; 2] {
    let [low, high] = bulk(manifest, field, from_rest, values);
    let room = 0.15 * if low < high { high - low } else { high.abs() };
    [low - room, high + room]
}

/// Text about values outside of the range shown.
fn beyond_note(field: Field, values: &[f64], shown: [f64; 2]) -> String {
    let outside = values.iter().copied().filter(|value| *value < shown[0] || *value > shown[1]);
    let outside: Vec<f64> = outside.collect();
    let farthest = outside.iter().copied().max_by(|a, b| a.abs().total_cmp(&b.abs()));
    let number_of = |one| counted(outside.len() as u64, one);
    match (farthest, field) {
        (None, _) | (_, Field::Velocity | Field::Energy) => String::new(),
        (Some(farthest), Field::Displacement) => {
            format!("{} beyond the frame, as far as {}", number_of("bead"), quantity(farthest, "m"))
        }
        (Some(farthest), Field::Overlap) => {
            format!("{}, up to {}", number_of("wider gap"), quantity(-farthest, "m"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::manifest::Origin;
    use schemas::presets::PRESETS;

    #[test]
    fn displacements_that_are_shown_are_those_of_beads_that_have_moved() {
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let run = RunManifest::new(&PRESETS[0].config(), "run", origin).expect("valid");
        let shown = |values: &[f64]| bulk(&run, Field::Displacement, false, values);
        let with_rest = |moved: &[f64]| shown(&[moved, &[0.0; 1000]].concat());
        assert_eq!(with_rest(&[5e-4, 4e-4, 1e-130]), [0.0, 5e-4]);
        // the struck bead has flown off
        let moved: Vec<f64> = (1..=100).map(f64::from).collect();
        assert_eq!(with_rest(&[&moved[..], &[-1e6]].concat()), [0.0, 98.0]);
        assert_eq!(shown(&moved), [3.0, 98.0]);
        // nearly all of what has moved is the tail of a front
        assert_eq!(with_rest(&[&[1e-3][..], &[1e-130; 200]].concat()), [0.0, 1e-3]);
        assert_eq!(shown(&[0.0; 9]), [0.0; 2]);
        let [low, high] = shown_range(&run, Field::Velocity, true, &[5.0; 6]);
        assert!(low < 5.0 && 5.0 < high, "{low} to {high}");
    }
}
