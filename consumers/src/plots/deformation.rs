//! The deformation of contacts beside theory.

use super::{caption, short};
use crate::deformation::{Comparison, Deformation, Shape};
use crate::figure::{Axis, Colour, Curve, Figure, Mark, Panel, Stroke};
use schemas::manifest::RunManifest;

/// Half the time shown, in measured widths.
const SHOWN_WIDTHS: f64 = 1.6;

/// Points at which the continuum's wave is marked, and along the exact wave.
const MARKS: u32 = 33;
const STEPS: u32 = 400;

/// For each contact that a pulse has passed: its overlap with the exact wave and that of the continuum, and
/// below it how far they are off.
pub fn deformations(manifest: &RunManifest, found: &[Deformation]) -> Figure {
    let mut figure = Figure::new().caption(caption(manifest));
    let mut first = true;
    for deformation in found {
        let Ok(shape) = &deformation.measured else { continue };
        figure = figure.panel(overlaps(deformation, shape, first)).panel(errors(deformation, shape));
        first = false;
    }
    if first {
        figure = figure.panel(Panel::new().y_axis("overlap (µm)").note("no pulse has passed"));
    }
    figure
}

fn time_axis(shape: &Shape) -> Axis {
    let shown_us = SHOWN_WIDTHS * shape.width_s * 1e6;
    Axis::new("t − t_{peak} (µs)").limits(-shown_us, shown_us)
}

/// Times (s) from one end of the figure to the other.
fn times_s(shape: &Shape, count: u32) -> impl Iterator<Item = f64> {
    let (peak_s, shown_s) = (shape.peak_s, SHOWN_WIDTHS * shape.width_s);
    (0..count).map(move |i| peak_s + shown_s * (2.0 * f64::from(i) / f64::from(count - 1) - 1.0))
}

fn overlaps(deformation: &Deformation, shape: &Shape, labelled: bool) -> Panel {
    let label = |text: &'static str| if labelled { text } else { "" };
    let place = |time_s: f64, overlap_m: f64| ((time_s - shape.peak_s) * 1e6, overlap_m * 1e6);
    let measured = deformation.samples.iter().map(|sample| place(sample.time_s, sample.overlap_m));
    let along = |theory: &Comparison, count| -> Vec<(f64, f64)> {
        times_s(shape, count).map(|time_s| place(time_s, theory.overlap_m(time_s))).collect()
    };
    let mut panel = Panel::new()
        .x_axis(time_axis(shape))
        .y_axis(Axis::new("overlap (µm)").limits(-0.06 * shape.overlap_m * 1e6, 1.06 * shape.overlap_m * 1e6))
        .curve(Curve::line(label("simulated"), measured).colour(Colour::Black))
        .note(format!("contact {}\nt_{{peak}} = {} ms", deformation.contact, short(shape.peak_s * 1e3)));
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
    let off = |theory: &Comparison| -> Vec<(f64, f64)> {
        let part = |overlap_m: f64, time_s: f64| (overlap_m - theory.overlap_m(time_s)) / shape.overlap_m;
        let samples = deformation.samples.iter();
        samples
            .map(|sample| {
                let percent = 100.0 * part(sample.overlap_m.max(0.0), sample.time_s);
                ((sample.time_s - shape.peak_s) * 1e6, percent)
            })
            .collect()
    };
    let mut panel = Panel::new().x_axis(time_axis(shape)).y_axis("difference (% of peak)").height(0.6);
    if let Ok(exact) = &deformation.exact {
        panel = panel.curve(Curve::line("", off(exact)).colour(Colour::Orange).stroke(Stroke::Dashed));
    }
    if let Ok(continuum) = &deformation.continuum {
        panel = panel.curve(Curve::line("", off(continuum)).colour(Colour::Blue));
    }
    panel
}
