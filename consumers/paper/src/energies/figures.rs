//! The energy figures, drawn.

use super::super::judgement::StudyError;
use super::super::observe::Observations;
use super::super::reference::REFLECTED;
use super::super::reflection::{ALPHAS, BEAD_G, Reflected, is_shown};
use super::{amplitudes, curve, hard_limit};
use figure::{Axis, Colour, Curve, Figure, Mark, Panel, Stroke};

const CAPTION: &str =
    "1000 beads of 1 g, impurity at bead 500, k = 10^{7} N m^{−α}, v_{0} = 5 m/s on bead 0.";

/// Seven colours from the first exponent to the last.
const COLOURS: [Colour; 7] = [
    Colour::Purple,
    Colour::Blue,
    Colour::Sky,
    Colour::Green,
    Colour::Orange,
    Colour::Vermillion,
    Colour::Black,
];

/// The curves of all exponents, the largest first in the legend, as they lie at the right.
fn panel(seen: &Observations, label: &str, of: fn(&Reflected) -> f64) -> Result<Panel, StudyError> {
    let mut panel = Panel::new().x_axis(mass_axis()).y_axis(label).vertical("", BEAD_G);
    for (alpha, colour) in ALPHAS.iter().zip(COLOURS).rev() {
        panel = panel.curve(Curve::line(format!("α = {alpha}"), curve(seen, *alpha, of)?).colour(colour));
    }
    Ok(panel)
}

/// The same where they cross.
fn enlarged(seen: &Observations, label: &str, of: fn(&Reflected) -> f64) -> Result<Panel, StudyError> {
    let mut panel = Panel::new()
        .x_axis(Axis::new("mass of the impurity (g)").limits(0.55, 2.05))
        .y_axis(Axis::new(label).limits(-0.003, 0.08));
    for (alpha, colour) in ALPHAS.iter().zip(COLOURS).rev() {
        let points = curve(seen, *alpha, of)?;
        // masses that were added lie too close for circles
        let shown = points.iter().copied().filter(|(mass_g, _)| is_shown(*mass_g)).collect::<Vec<_>>();
        panel = panel.curve(Curve::line("", points).colour(colour));
        panel = panel.curve(Curve::points("", shown).colour(colour).mark(Mark::Circle));
    }
    Ok(panel)
}

fn mass_axis() -> Axis {
    Axis::new("mass of the impurity (g)").limits(0.4, 5.2)
}

pub(super) fn draw_total(seen: &Observations) -> Result<Figure, StudyError> {
    against_reference(seen, "reflected/total energy", |point| point.over_total.value, 2)
}

pub(super) fn draw_transmitted(seen: &Observations) -> Result<Figure, StudyError> {
    against_reference(seen, "reflected/transmitted energy", |point| point.over_transmitted.value, 3)
}

/// A quantity with the points that the reference has of it, in this column.
fn against_reference(
    seen: &Observations,
    label: &str,
    of: fn(&Reflected) -> f64,
    column: usize,
) -> Result<Figure, StudyError> {
    let points = REFLECTED.numbers()?.into_iter().map(|row| (row[1], row[column]));
    let reference = Curve::points("reference", points).mark(Mark::Cross).colour(Colour::Grey);
    let whole = panel(seen, label, of)?.curve(reference).height(1.5);
    Ok(Figure::new().caption(CAPTION).panel(whole).panel(enlarged(seen, label, of)?.height(1.2)))
}

pub(super) fn draw_corrected(seen: &Observations) -> Result<Figure, StudyError> {
    let label = "reflected/incident energy";
    let limit = (0..=100).map(|i| 1.0 + 0.04 * f64::from(i)).map(|mass_g| (mass_g, hard_limit(mass_g)));
    let limit = || Curve::line("", limit.clone()).colour(Colour::Grey).stroke(Stroke::Dashed);
    let whole = panel(seen, label, |point| point.corrected.value)?
        .curve(Curve::line("limit α → ∞", []).colour(Colour::Grey).stroke(Stroke::Dashed))
        .curve(limit())
        .height(1.5);
    let enlarged = enlarged(seen, label, |point| point.corrected.value)?.curve(limit()).height(1.2);
    let caption =
        format!("{CAPTION} Without the energy that stays at the struck end before the shock arrives.");
    Ok(Figure::new().caption(caption).panel(whole).panel(enlarged))
}

pub(super) fn draw_pulse(seen: &Observations) -> Result<Figure, StudyError> {
    let x = || mass_axis();
    let amplitude =
        amplitudes(seen, |point| point.backward_m_s)?.into_iter().map(|(mass_g, v)| (mass_g, v.abs()));
    let speed = amplitudes(seen, |point| point.backward_beads_per_s)?;
    // without an impurity there is no such pulse: the line is broken there
    let marked = |mut points: Vec<(f64, f64)>| {
        let heavy = points.partition_point(|(mass_g, _)| *mass_g < BEAD_G);
        points.insert(heavy, (BEAD_G, f64::NAN));
        Curve::line("", points).colour(Colour::Blue).mark(Mark::Circle)
    };
    Ok(Figure::new()
        .shared_x()
        .caption(format!("{CAPTION} α = 1.5; the strongest pulse that leaves the impurity backwards."))
        .panel(
            Panel::new()
                .x_axis(x())
                .y_axis("amplitude (m/s)")
                .curve(marked(amplitude.collect()))
                .vertical("mass of the other beads", BEAD_G),
        )
        .panel(Panel::new().x_axis(x()).y_axis("speed (beads/s)").curve(marked(speed)).vertical("", BEAD_G)))
}
