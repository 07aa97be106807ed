//! All beads in one frame; their velocities, whole and enlarged.

use super::judgement::StudyError;
use super::observe::{KeptFrame, Observed};
use figure::{Axis, Colour, Curve, Figure, Panel};

/// An axis of all beads of a run, with a quantity of each.
pub(super) fn chain_panel(seen: &Observed, of_beads: impl Iterator<Item = f64>) -> Panel {
    let points = of_beads.enumerate().map(|(bead, value)| (bead as f64, value));
    Panel::new()
        .x_axis(Axis::new("bead").limits(0.0, seen.manifest.physics.beads as f64))
        .curve(Curve::line("", points).colour(Colour::Blue))
}

/// The parameters of a run, and the time of a frame.
pub(super) fn caption(seen: &Observed, kept: &KeptFrame) -> String {
    format!("{}; t = {:.2} ms", plots::caption(&seen.manifest), kept.time_s * 1e3)
}

/// Velocities of the 1000 beads with an impurity at bead 500; the second panel shows those within `enlarged_m_s`.
pub(super) fn velocity_figure(
    seen: &Observed,
    frame: usize,
    enlarged_m_s: [f64; 2],
) -> Result<Figure, StudyError> {
    let kept = seen.kept_frame(frame)?;
    let panel = |y: Axis, impurity: &str| {
        chain_panel(seen, kept.v_m_s.iter().copied()).y_axis(y).vertical(impurity, 500.0)
    };
    let axis = || Axis::new("velocity (m/s)");
    let [low, high] = enlarged_m_s;
    let small = panel(axis().limits(low, high), "").note("the same, enlarged").height(0.8);
    let whole = panel(axis(), "impurity");
    Ok(Figure::new().shared_x().caption(caption(seen, kept)).panel(whole).panel(small))
}
