//! Growth of the differences between a run and its twins.

use super::caption;
use consumers::determination::{Determination, Quantity, Sample};
use figure::{Axis, Curve, Figure, Panel};
use schemas::manifest::RunManifest;

/// The curves: the state, and the reported energies.
const SHOWN: [(Quantity, &str); 4] = [
    (Quantity::Displacement, "displacement (L)"),
    (Quantity::Velocity, "velocity (v_{0})"),
    (Quantity::LeftEnergy, "energy left of bead #"),
    (Quantity::TotalEnergy, "total energy"),
];

/// The range of errors: below it is rounding in a few operations, above it nothing is left of the run.
const RANGE: (f64, f64) = (1e-16, 10.0);

/// The errors of the step and of rounding over time, with the tolerance; and the contacts that are in another class,
/// where those are too many.
pub fn determination(manifest: &RunManifest, found: &Determination) -> Figure {
    let samples: Vec<_> = found.trail().samples().collect();
    let Some(outcome) = found.outcome() else { return Figure::new().caption(caption(manifest)) };
    let end_ms = outcome.compared_until.1 * 1e3;
    let lost_ms = outcome.first_lost().and_then(|lost| lost.until_s).map(|until_s| until_s * 1e3);
    let errors = |label: &'static str, of: fn(&Sample) -> &[f64; Quantity::COUNT]| {
        let named = |name: String| if label == STEP { name } else { String::new() };
        let y = Axis::new(label).log().limits(RANGE.0, RANGE.1);
        let panel =
            SHOWN.iter().fold(Panel::new().x_axis("time (ms)").y_axis(y), |panel, (quantity, name)| {
                let name = named(name.replace('#', &outcome.split_bead.to_string()));
                let errors = samples.iter().map(|at| (at.time_s * 1e3, of(at)[*quantity as usize]));
                panel.curve(Curve::line(name, errors).thin())
            });
        let panel = panel.horizontal(named("tolerance".to_owned()), outcome.tolerance);
        match lost_ms {
            Some(lost_ms) => panel.band_x(named("not determined".to_owned()), lost_ms, end_ms),
            None => panel,
        }
    };
    let step = errors(STEP, |sample| &sample.step);
    let rounding = errors("error of rounding", |sample| &sample.rounding);
    let figure = Figure::new().shared_x().caption(caption(manifest)).panel(step).panel(rounding);
    if outcome.of(Quantity::Contacts).is_none_or(|contacts| contacts.until_s.is_none()) {
        return figure;
    }
    let count = |of: fn(&Sample) -> &[f64; Quantity::COUNT]| {
        samples.iter().map(move |at| (at.time_s * 1e3, of(at)[Quantity::Contacts as usize]))
    };
    figure.panel(
        Panel::new()
            .x_axis("time (ms)")
            .y_axis("contacts")
            .curve(Curve::line("differ by the step", count(|sample| &sample.step)).thin())
            .curve(Curve::line("by rounding", count(|sample| &sample.rounding)).thin())
            .height(0.6),
    )
}

const STEP: &str = "error of the step";
