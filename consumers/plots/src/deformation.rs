//! The deformation of contacts beside theory.

use super::{caption, prefix};
use consumers::deformation::{Comparison, Deformation, Sample, Shape};
use figure::{Axis, Colour, Curve, Figure, Mark, Panel, Stroke};
use schemas::manifest::RunManifest;

/// Half the time shown, in measured widths.
const SHOWN_WIDTHS: f64 = 1.6;

/// Points at which the continuum's wave is marked, and along the exact wave.
const MARKS: u32 = 33;
const STEPS: u32 = 400;

/// Panels for each contact that a pulse has passed: its overlap with the exact wave and that of the continuum, and
/// below it their deviations.
pub fn deformations(manifest: &RunManifest, found: &[Deformation]) -> Figure {
    let mut figure = Figure::new().caption(caption(manifest));
    let mut first = true;
    for deformation in found {
        let Ok(shape) = &deformation.measured else { continue };
        figure = figure.panel(overlaps(deformation, shape, first)).panel(errors(deformation, shape));
        first = false;
    }
    if found.len() == 1 {
        figure = figure.shared_x();
    }
    if first {
        let why = found.iter().find_map(|deformation| deformation.measured.as_ref().err());
        let why = why.map_or_else(String::new, ToString::to_string);
        figure = figure.panel(Panel::new().y_axis("overlap (m)").note(why));
    }
    figure
}

/// The axis of the time from the peak, and the factor from seconds to its unit.
fn time_axis(shape: &Shape) -> (Axis, f64) {
    let shown_s = SHOWN_WIDTHS * shape.width_s;
    let (prefix, factor) = prefix(shown_s);
    let axis = Axis::new(format!("t − t_{{peak}} ({prefix}s)"));
    (axis.limits(-shown_s * factor, shown_s * factor), factor)
}

/// Times (s) from one end of the figure to the other.
fn times_s(shape: &Shape, count: u32) -> impl Iterator<Item = f64> {
    let (peak_s, shown_s) = (shape.peak_s, SHOWN_WIDTHS * shape.width_s);
    (0..count).map(move |i| peak_s + shown_s * (2.0 * f64::from(i) / f64::from(count - 1) - 1.0))
}

/// The samples of a pulse, and nothing in the times before and after it.
fn samples(deformation: &Deformation, shape: &Shape) -> impl Iterator<Item = Sample> {
    let (first_s, last_s) = match &deformation.samples[..] {
        [first, .., last] => (first.time_s, last.time_s),
        _ => (shape.peak_s, shape.peak_s),
    };
    let nothing = |time_s: f64| Sample { time_s, overlap_m: 0.0, rate_m_s: 0.0 };
    let early = times_s(shape, STEPS).filter(move |time_s| *time_s < first_s).map(nothing);
    let late = times_s(shape, STEPS).filter(move |time_s| *time_s > last_s).map(nothing);
    early.chain(deformation.samples.iter().copied()).chain(late)
}

fn overlaps(deformation: &Deformation, shape: &Shape, labelled: bool) -> Panel {
    let label = |text: &'static str| if labelled { text } else { "" };
    let (prefix, factor) = prefix(shape.overlap_m);
    let (time_axis, time_factor) = time_axis(shape);
    let place = |time_s: f64, overlap_m: f64| ((time_s - shape.peak_s) * time_factor, overlap_m * factor);
    let largest = shape.overlap_m * factor;
    let measured = samples(deformation, shape).map(|sample| place(sample.time_s, sample.compression_m()));
    let along = |theory: &Comparison, count| -> Vec<(f64, f64)> {
        times_s(shape, count).map(|time_s| place(time_s, theory.overlap_m(time_s))).collect()
    };
    let mut panel = Panel::new()
        .x_axis(time_axis)
        .y_axis(Axis::new(format!("overlap ({prefix}m)")).limits(-0.06 * largest, 1.06 * largest))
        .curve(Curve::line(label("simulated"), measured).colour(Colour::Black))
        .note(format!("contact {}", deformation.contact));
    if let Ok(exact) = &deformation.exact {
        let curve = Curve::line(label("exact wave"), along(exact, STEPS));
        panel = panel.curve(curve.colour(Colour::Orange).stroke(Stroke::Dashed));
    }
    if let Ok(continuum) = &deformation.continuum {
        let curve = Curve::points(label("continuum"), along(continuum, MARKS));
        panel = panel.curve(curve.colour(Colour::Blue).mark(Mark::Diamond));
    }
    panel
}

fn errors(deformation: &Deformation, shape: &Shape) -> Panel {
    let (time_axis, time_factor) = time_axis(shape);
    let off = |theory: &Comparison| -> Vec<(f64, f64)> {
        let part = |overlap_m: f64, time_s: f64| (overlap_m - theory.overlap_m(time_s)) / shape.overlap_m;
        samples(deformation, shape)
            .map(|sample| {
                let percent = 100.0 * part(sample.compression_m(), sample.time_s);
                ((sample.time_s - shape.peak_s) * time_factor, percent)
            })
            .collect()
    };
    let mut panel = Panel::new().x_axis(time_axis).y_axis("off (% of peak)").height(0.6);
    if let Ok(continuum) = &deformation.continuum {
        panel = panel.curve(Curve::line("", off(continuum)).colour(Colour::Blue));
    }
    if let Ok(exact) = &deformation.exact {
        panel = panel.curve(Curve::line("", off(exact)).colour(Colour::Orange).stroke(Stroke::Dashed));
    }
    panel
}
