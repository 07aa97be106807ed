//! The velocities of all beads in one frame, whole and enlarged.

use super::observe::KeptFrame;
use figure::{Axis, Colour, Curve, Figure, Panel};
use schemas::manifest::RunManifest;

/// Velocities of the 1000 beads with an impurity at bead 500; the second panel shows those within `enlarged_m_s`.
pub(super) fn velocity_figure(manifest: &RunManifest, kept: &KeptFrame, enlarged_m_s: [f64; 2]) -> Figure {
    let panel = |y: Axis, impurity: &str| {
        let points = kept.v_m_s.iter().enumerate().map(|(bead, v)| (bead as f64, *v));
        Panel::new()
            .x_axis(Axis::new("bead").limits(0.0, 1000.0))
            .y_axis(y)
            .curve(Curve::line("", points).colour(Colour::Blue))
            .vertical(impurity, 500.0)
    };
    let axis = || Axis::new("velocity (m/s)");
    let [low, high] = enlarged_m_s;
    let small = panel(axis().limits(low, high), "").note("the same, enlarged").height(0.8);
    let caption = format!("{}; t = {:.2} ms", plots::caption(manifest), kept.time_s * 1e3);
    Figure::new().shared_x().caption(caption).panel(panel(axis(), "impurity")).panel(small)
}
