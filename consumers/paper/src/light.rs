//! A light impurity emits pulses both ways: velocities and displacements.

use super::judgement::{Counted, Judgement, Number, StudyError, Verdict, pool_uncertainty};
use super::observe::Observations;
use super::passing::{
    BACKWARD_BEAD, FORWARD_BEAD, Passed, against_table, counted, falls, heights, pulses, pulses_of_table,
    with_partners,
};
use super::profile::{caption, chain_panel, velocity_figure};
use super::reference::LIGHT_PULSES;
use super::runs::light;
use super::study::{Claim, Study};
use consumers::pulses::Passage;
use figure::{Axis, Figure};
use std::ops::Range;

const SECTION: &str = "section 3";
/// Error of the reference of the pulses.
const GOOD_TO: f64 = 1e-5;
/// Number of the kept frame in the figures.
const AT_80_MS: usize = 3;

pub(super) const VELOCITY: Study = Study {
    slug: "velocity-light",
    title: "Velocities after the collision with a light impurity",
    place: "figure vlight",
    runs: || with_partners(light()),
    sweep: false,
    draw: |seen| velocity_figure(seen.of(&light())?, AT_80_MS, [-0.2, 0.2]),
    claims: &[
        Claim {
            id: "light-secondary-waves",
            place: SECTION,
            quote: "The leading wave corresponds to the shock wave which is followed by an increasing number of \
                    secondary solitary waves with decreasing amplitudes generated at the impurity position.",
            judge: judge_secondary_waves,
        },
        Claim {
            id: "light-negative-velocities",
            place: SECTION,
            quote: "A symmetric pattern arises in the opposite direction since solitary waves with negative \
                    velocities … propagate.",
            judge: judge_backward_waves,
        },
        Claim {
            id: "light-almost-same-amplitudes",
            place: SECTION,
            quote: "… and almost same amplitudes as the previous ones …",
            judge: judge_amplitudes,
        },
        Claim {
            id: "light-incident-slows",
            place: SECTION,
            quote: "The wave speed of the incident shock is modified after the collision since its amplitude \
                    decreases providing with energy the impurity which can then generate new waves.",
            judge: judge_incident,
        },
    ],
};

pub(super) const DISPLACEMENT: Study = Study {
    slug: "displacement-light",
    title: "Displacements after the collision with a light impurity",
    place: "figure ulight",
    runs: || with_partners(light()),
    sweep: false,
    draw: draw_displacement,
    claims: &[Claim {
        id: "light-square-fronts",
        place: SECTION,
        quote: "The corresponding displacement profile is displayed on Fig. (ulight) where the pulses are now replaced \
                by the squared front waves characteristics of shock waves.",
        judge: judge_steps,
    }],
};

fn forward(seen: &Observations) -> Result<Vec<Passed>, StudyError> {
    pulses_of_table(seen, &light(), LIGHT_PULSES, true)
}

fn backward(seen: &Observations) -> Result<Vec<Passed>, StudyError> {
    pulses_of_table(seen, &light(), LIGHT_PULSES, false)
}

fn judge_secondary_waves(seen: &Observations) -> Result<Judgement, StudyError> {
    let pulses = forward(seen)?;
    let passed_by = |time_s: f64| {
        counted(seen, light(), |seen| {
            let pulses = seen.pulses_past(FORWARD_BEAD, true);
            Ok(pulses.iter().filter(|pulse| pulse.time_s <= time_s).count())
        })
    };
    let counts = [passed_by(0.07)?, passed_by(0.08)?, passed_by(0.1)?];
    let (grows, grows_in_all) = Counted::grow(&counts);
    let mut numbers = against_table(&pulses, LIGHT_PULSES, true, GOOD_TO)?;
    for (time_ms, count) in [70, 80, 100].into_iter().zip(counts) {
        let what = format!("pulses that have passed bead {FORWARD_BEAD} at {time_ms} ms");
        numbers.push(Number::count(what, &count));
    }
    let falls = falls(&heights(&pulses));
    Ok(Judgement {
        verdict: Verdict::graded(grows, grows_in_all && falls),
        why: format!(
            "The shock and {} secondary pulses pass bead {FORWARD_BEAD}, {}, and their number {}.",
            pulses.len() - 1,
            if falls { "each weaker than the one before" } else { "not always weaker than the one before" },
            if grows { "grows with time" } else { "does not grow with time" },
        ),
        numbers,
    })
}

fn judge_backward_waves(seen: &Observations) -> Result<Judgement, StudyError> {
    let pulses = backward(seen)?;
    let amplitudes = heights(&pulses);
    let (negative, falls) = (amplitudes.iter().all(|v| *v < 0.0), falls(&amplitudes));
    Ok(Judgement {
        verdict: Verdict::of(negative && falls),
        why: format!(
            "{} pulses of {} velocity pass bead {BACKWARD_BEAD} on their way back, {} weaker than the one before.",
            pulses.len(),
            if negative { "negative" } else { "either" },
            if falls { "each" } else { "not all" },
        ),
        numbers: against_table(&pulses, LIGHT_PULSES, false, GOOD_TO)?,
    })
}

fn judge_amplitudes(seen: &Observations) -> Result<Judgement, StudyError> {
    /// "Almost the same" is taken to be within a tenth.
    const ALMOST: f64 = 0.1;
    let (ahead, behind) = (forward(seen)?, backward(seen)?);
    let mut numbers = Vec::new();
    let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
    for (order, (ahead, behind)) in ahead.iter().skip(1).zip(&behind).enumerate() {
        let fine = -behind.fine.v_peak_m_s / ahead.fine.v_peak_m_s;
        let coarse = -behind.coarse.v_peak_m_s / ahead.coarse.v_peak_m_s;
        let what = format!("secondary pulse {}: backward over forward amplitude", order + 1);
        numbers.push(Number::stepped(what, (fine, coarse), "", ahead.drift));
        let off = (fine - 1.0).abs();
        (least, most) = (least.min(off), most.max(off));
    }
    pool_uncertainty(&mut numbers);
    Ok(Judgement {
        verdict: Verdict::of(most <= ALMOST),
        why: format!(
            "The amplitudes of the two directions differ by {:.0} to {:.0} %.",
            100.0 * least,
            100.0 * most
        ),
        numbers,
    })
}

fn judge_incident(seen: &Observations) -> Result<Judgement, StudyError> {
    let incident = pulses(seen, &light(), BACKWARD_BEAD, true, 1)?[0];
    let transmitted = forward(seen)?[0];
    let ratio = |of: fn(&Passage) -> f64| {
        (of(&transmitted.fine) / of(&incident.fine), of(&transmitted.coarse) / of(&incident.coarse))
    };
    let weaker = ratio(|pulse| pulse.v_peak_m_s);
    let slower = ratio(|pulse| pulse.speed_beads_per_s);
    // eq. (vf): V ∝ v_max^((α−1)/(α+1)), 1/5 for Hertz contacts
    let expected = (weaker.0.powf(0.2), weaker.1.powf(0.2));
    Ok(Judgement {
        verdict: Verdict::of(weaker.0 < 1.0 && slower.0 < 1.0),
        why: format!(
            "Behind the impurity the amplitude is {:.2} % of what it was and the speed {:.2} %; eq. (vf) expects {:.2} %.",
            100.0 * weaker.0,
            100.0 * slower.0,
            100.0 * expected.0
        ),
        numbers: vec![
            incident.amplitude("incident pulse at bead 300: peak velocity"),
            incident.speed("incident pulse at bead 300: speed"),
            Number::stepped("transmitted over incident amplitude", weaker, "", incident.drift),
            Number::stepped("transmitted over incident speed", slower, "", incident.drift),
            Number::stepped("the ratio of speeds that eq. (vf) expects", expected, "", incident.drift),
        ],
    })
}

fn judge_steps(seen: &Observations) -> Result<Judgement, StudyError> {
    /// A front is square if it is this much narrower than the distance to the next.
    const SQUARE: f64 = 0.1;
    let coarse = seen.of(&light().with_step_times(2))?.kept_frame(AT_80_MS)?;
    let seen = seen.of(&light())?;
    let kept = seen.kept_frame(AT_80_MS)?;
    let front = crest(&kept.v_m_s, 501..1000).ok_or_else(|| seen.absent("leading pulse"))?;
    let next = crest(&kept.v_m_s, 501..front - 20).ok_or_else(|| seen.absent("second pulse"))?;
    let between = usize::midpoint(front, next);
    let plateau_m = kept.u_m[between];
    let reach = |part: f64| falls_below(&kept.u_m, between, part * plateau_m);
    let rise_beads = reach(0.1) - reach(0.9);
    let apart_beads = (front - next) as f64;
    Ok(Judgement {
        verdict: Verdict::of(rise_beads < SQUARE * apart_beads),
        why: format!(
            "The displacement rises from 10 to 90 % of {:.3} mm within {rise_beads:.1} beads, and stays there for the \
             {apart_beads:.0} beads to the next pulse.",
            plateau_m * 1e3
        ),
        numbers: vec![
            Number::stepped(
                "leading step: height",
                (plateau_m * 1e3, coarse.u_m[between] * 1e3),
                "mm",
                seen.max_abs_drift,
            ),
            Number::new("leading step: from 10 to 90 %", rise_beads, "beads")
                .give_or_take(0.1, "the place of the pulse between two beads"),
        ],
    })
}

/// The bead of the largest |v| among `beads`.
fn crest(v_m_s: &[f64], beads: Range<usize>) -> Option<usize> {
    beads.max_by(|a, b| v_m_s[*a].abs().total_cmp(&v_m_s[*b].abs()))
}

/// First position to the right of the bead `from` at which the displacement falls below `level_m`; in beads,
/// interpolated.
fn falls_below(u_m: &[f64], from: usize, level_m: f64) -> f64 {
    let below = (from..u_m.len()).find(|bead| u_m[*bead] < level_m).unwrap_or(u_m.len() - 1);
    let (inside, outside) = (u_m[below - 1], u_m[below]);
    below as f64 - (level_m - outside) / (inside - outside)
}

fn draw_displacement(seen: &Observations) -> Result<Figure, StudyError> {
    let seen = seen.of(&light())?;
    let kept = seen.kept_frame(AT_80_MS)?;
    // the first beads fly off backwards, as far as −28 mm: the rest would be a flat line beside them
    let panel = chain_panel(seen, kept.u_m.iter().map(|u| u * 1e3))
        .y_axis(Axis::new("displacement (mm)").limits(-0.1, 0.75))
        .vertical("impurity", 500.0);
    let farthest = -kept.u_m[0] * 1e3;
    let caption = caption(seen, kept)
        + &format!("; the first beads have flown off to the left, bead 0 by {farthest:.1} mm");
    Ok(Figure::new().caption(caption).panel(panel))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_is_measured_between_beads() {
        let u_m = [1.0, 1.0, 1.0, 0.8, 0.2, 0.0, 0.0];
        assert!((falls_below(&u_m, 1, 0.9) - 2.5).abs() < 1e-12);
        assert!((falls_below(&u_m, 1, 0.1) - 4.5).abs() < 1e-12);
        assert_eq!(crest(&[0.0, 1.0, -3.0, 2.0], 0..4), Some(2));
    }
}
