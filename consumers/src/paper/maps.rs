//! The contacts over space and time.

use super::claim::{Claim, Judgement, Number, StudyError, Verdict};
use super::observe::{KeptFrame, Observations, Observed};
use super::passing::{both_steps, falls, pulses};
use super::runs::{Run, heavy, light};
use super::study::Study;
use crate::figure::Figure;
use crate::plots;

const SECTION: &str = "section 3";
/// A gap as wide as this is one, as in the reference.
const GAP_M: f64 = 1e-9;
const IMPURITY: usize = 500;

pub(super) const LIGHT: Study = Study {
    slug: "contacts-light",
    title: "Contacts after the collision with a light impurity",
    place: "figure spatio1",
    runs: light_runs,
    sweep: false,
    draw: draw_light,
    claims: &[
        Claim {
            id: "light-black-lines",
            place: SECTION,
            quote: "The secondary pulses are created at the impurity position and after a transient displayed by thin curved \
                    black lines near the impurity location they propagate with a constant velocity reaching then a \
                    stationary regime.",
            judge: judge_constant_speed,
        },
        Claim {
            id: "light-slower-pulses",
            place: SECTION,
            quote: "The wave speed of these pulses are decreasing as new pulses are created as one can see by looking at the \
                    slopes of the black lines.",
            judge: judge_speeds,
        },
        Claim {
            id: "light-wave-source",
            place: SECTION,
            quote: "From these observations we can conclude that the light impurity acts as a wave source.",
            judge: judge_source,
        },
        Claim {
            id: "light-white-touching",
            place: "section 3 and figure spatio1",
            quote: "… one can see black straight lines defining compression waves whereas white zones mean beads are at \
                    touching.",
            judge: judge_light_gaps,
        },
    ],
};

pub(super) const HEAVY: Study = Study {
    slug: "contacts-heavy",
    title: "Contacts after the collision with a heavy impurity",
    place: "figure spatio2",
    runs: heavy_runs,
    sweep: false,
    draw: draw_heavy,
    claims: &[
        Claim {
            id: "heavy-halved",
            place: SECTION,
            quote: "After collision the bead chain is halved as it is shown by the white vertical line separating two black \
                    areas meaning compression between beads.",
            judge: judge_halved,
        },
        Claim {
            id: "heavy-rest-between-pulses",
            place: SECTION,
            quote: "Between these pulses the beads remain at rest just touching their nearest neighbor.",
            judge: judge_heavy_gaps,
        },
        Claim {
            id: "heavy-larger-slope",
            place: SECTION,
            quote: "Other compression areas appear on the left side. The straight line of larger slope is the main reflected wave.",
            judge: judge_slope,
        },
        Claim {
            id: "heavy-second-front",
            place: "section 3 and figure spatio2",
            quote: "A growing compression zone moving at constant velocity follows this pulse. After some times this area also \
                    begins to fragment into new pulses as one can see from the black straight lines appearing at the front.",
            judge: judge_second_front,
        },
    ],
};

fn light_runs() -> Vec<Run> {
    both_steps(light())
}

fn heavy_runs() -> Vec<Run> {
    both_steps(heavy())
}

fn judge_constant_speed(seen: &Observations) -> Result<Judgement, StudyError> {
    /// The first pulses that have come as far as bead 850 by the end of the run.
    const COUNT: usize = 3;
    let at = |bead: u64| pulses(seen, &light(), bead, true, COUNT);
    let places = [520, 600, 700, 850].map(|bead| (bead, at(bead)));
    let mut numbers = Vec::new();
    let mut latest_change = 0.0_f64;
    let mut early_change = 0.0_f64;
    for order in 1..COUNT {
        let mut speeds = Vec::new();
        for (bead, pulses) in &places {
            let pulse = pulses.clone()?[order];
            numbers.push(pulse.speed(format!("secondary pulse {order}: speed at bead {bead}")));
            speeds.push(pulse.fine.speed_beads_per_s);
        }
        early_change = early_change.max((speeds[0] / speeds[3] - 1.0).abs());
        latest_change = latest_change.max((speeds[2] / speeds[3] - 1.0).abs());
    }
    Ok(Judgement {
        verdict: Verdict::graded(latest_change < 1e-3, early_change > latest_change),
        why: format!(
            "From bead 700 to 850 the speeds change by {latest_change:.1e}; at bead 520 they are still {early_change:.1e} away from that."
        ),
        numbers,
    })
}

fn judge_speeds(seen: &Observations) -> Result<Judgement, StudyError> {
    let pulses = pulses(seen, &light(), 700, true, 5)?;
    let speeds: Vec<f64> = pulses.iter().map(|pulse| pulse.fine.speed_beads_per_s).collect();
    let numbers = pulses.iter().enumerate();
    let numbers = numbers.map(|(index, pulse)| pulse.speed(format!("forward pulse {}: speed", index + 1)));
    Ok(Judgement {
        verdict: Verdict::of(falls(&speeds)),
        why: format!(
            "From {:.0} beads/s of the shock down to {:.0} of the pulse that comes fifth.",
            speeds[0], speeds[4]
        ),
        numbers: numbers.collect(),
    })
}

/// Gaps left and right of the impurity.
fn gaps(seen: &Observed, kept: &KeptFrame) -> (usize, usize) {
    let chain = seen.manifest.physics.chain();
    let open = |contact: &usize| chain.overlap_m(&kept.u_m, *contact) < -GAP_M;
    ((0..IMPURITY).filter(open).count(), (IMPURITY..chain.contact_count()).filter(open).count())
}

fn gap_numbers((left, right): (usize, usize), expected_left: f64, expected_right: f64) -> Vec<Number> {
    // the reference's run ends up to a step later, in which a contact may open or close
    let number = |side: &str, found: usize, expected: f64| {
        let what = format!("gaps above 1 nm {side} of the impurity at 80 ms");
        Number::new(what, found as f64, "").against_within(expected, 1.0)
    };
    vec![number("left", left, expected_left), number("right", right, expected_right)]
}

fn judge_light_gaps(seen: &Observations) -> Result<Judgement, StudyError> {
    let light = seen.of(&light())?;
    let (left, right) = gaps(light, light.kept_frame(3)?);
    Ok(Judgement {
        verdict: Verdict::of(left + right == 0),
        why: format!(
            "{} of the contacts that are not compressed are open, with gaps above 1 nm: there are three classes of contacts, \
             not two.",
            left + right
        ),
        numbers: gap_numbers((left, right), 78.0, 48.0),
    })
}

fn judge_halved(seen: &Observations) -> Result<Judgement, StudyError> {
    let heavy = seen.of(&heavy())?;
    // overlap with the left neighbour, between the collision and the second hit
    let times = heavy.motion.times_s();
    let samples = times.iter().zip(heavy.motion.column(2)).filter(|(t, _)| (0.046..0.060).contains(*t));
    let (mut open, mut all) = (0_usize, 0_usize);
    for (_, overlap_m) in samples {
        all += 1;
        open += usize::from(overlap_m < -GAP_M);
    }
    let part = open as f64 / all.max(1) as f64;
    Ok(Judgement {
        verdict: Verdict::of(part > 0.99),
        why: format!(
            "From 46 to 60 ms the contact between bead 499 and the impurity is open in {:.0} % of the frames: the white line \
             is a gap.",
            100.0 * part
        ),
        numbers: vec![Number::new("part of the frames with a gap left of the impurity", part, "")],
    })
}

fn judge_heavy_gaps(seen: &Observations) -> Result<Judgement, StudyError> {
    let heavy = seen.of(&heavy())?;
    let kept = heavy.kept_frame(1)?;
    let (left, right) = gaps(heavy, kept);
    Ok(Judgement {
        verdict: Verdict::graded(right <= 1, left + right <= 1),
        why: format!(
            "Right of the impurity {right} contacts have a gap above 1 nm, so that they do touch there, but left of it \
             {left} have."
        ),
        numbers: gap_numbers((left, right), 31.0, 0.0),
    })
}

fn judge_slope(seen: &Observations) -> Result<Judgement, StudyError> {
    let back = pulses(seen, &heavy(), 300, false, 2)?;
    let ratio = back[0].fine.speed_beads_per_s / back[1].fine.speed_beads_per_s;
    Ok(Judgement {
        verdict: Verdict::of(ratio > 1.0),
        why: format!("The reflected pulse is {ratio:.2} times as fast as the first of the second front."),
        numbers: vec![
            back[0].speed("reflected pulse: speed"),
            back[1].speed("first pulse of the second front: speed"),
        ],
    })
}

fn judge_source(seen: &Observations) -> Result<Judgement, StudyError> {
    let run = seen.of(&light())?;
    let ahead = run.pulses_past(520, true);
    let behind = run.pulses_past(300, false);
    let (from_s, to_s) =
        (ahead.first().map_or(0.0, |pulse| pulse.time_s), ahead.last().map_or(0.0, |pulse| pulse.time_s));
    Ok(Judgement {
        verdict: Verdict::of(ahead.len() > 3 && behind.len() > 3),
        why: format!(
            "From {:.0} to {:.0} ms {} pulses above 5 mm/s pass bead 520; by the end of the run {} have passed bead 300 on their way back.",
            from_s * 1e3,
            to_s * 1e3,
            ahead.len(),
            behind.len()
        ),
        numbers: vec![
            Number::new("pulses past bead 520", ahead.len() as f64, ""),
            Number::new("pulses past bead 300 on their way back", behind.len() as f64, ""),
        ],
    })
}

fn judge_second_front(seen: &Observations) -> Result<Judgement, StudyError> {
    let back = pulses(seen, &heavy(), 300, false, 2)?;
    let heavy = seen.of(&heavy())?;
    // the compressed contacts of the zone, not those of the pulses that have left it
    let zone = |kept: &KeptFrame| {
        let compressed = |contact: &usize| kept.classes[*contact] == crate::contacts::COMPRESSED;
        let first_behind =
            (0..IMPURITY - 1).rev().take_while(|contact| compressed(contact) || *contact > IMPURITY - 8);
        first_behind.count()
    };
    let (early, late) = (zone(heavy.kept_frame(0)?), zone(heavy.kept_frame(1)?));
    let separate = back[1].fine.time_s > back[0].fine.time_s;
    Ok(Judgement {
        verdict: Verdict::graded(separate, late > early),
        why: format!(
            "A second pulse of {:.3} m/s passes bead 300 {:.0} ms after the reflected one; the zone next to the impurity is {} \
             contacts long at 60 ms and {} at 80 ms.",
            back[1].fine.v_peak_m_s,
            (back[1].fine.time_s - back[0].fine.time_s) * 1e3,
            early,
            late
        ),
        numbers: vec![
            back[0].speed("reflected pulse: speed"),
            back[1].speed("first pulse of the second front: speed"),
            back[1].amplitude("first pulse of the second front: peak velocity"),
        ],
    })
}

fn draw_light(seen: &Observations) -> Result<Figure, StudyError> {
    draw(seen, &light())
}

fn draw_heavy(seen: &Observations) -> Result<Figure, StudyError> {
    draw(seen, &heavy())
}

fn draw(seen: &Observations, run: &Run) -> Result<Figure, StudyError> {
    let seen = seen.of(run)?;
    let map = seen.map.as_ref().ok_or_else(|| seen.absent("map of the contacts"))?;
    Ok(plots::contact_map(&seen.manifest, seen.tolerance_m, map)?)
}
