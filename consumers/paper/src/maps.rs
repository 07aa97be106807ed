//! The contacts over space and time.

use super::judgement::{Counted, Judgement, Number, StudyError, Verdict, pool_uncertainty};
use super::observe::Observations;
use super::passing::{Passed, count_past, counted, falls, pulses, with_partners};
use super::runs::{Run, heavy, light};
use super::study::{Claim, Study};
use consumers::pulses::Passage;
use figure::Figure;
use std::ops::Range;

const SECTION: &str = "section 3";
/// A gap as wide as this is one, as in the reference.
const GAP_M: f64 = 1e-9;
const IMPURITY: usize = 500;

pub(super) const LIGHT: Study = Study {
    slug: "contacts-light",
    title: "Contacts after the collision with a light impurity",
    place: "figure spatio1",
    runs: || with_partners(light()),
    sweep: false,
    draw: |seen| draw(seen, &light()),
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
    runs: || with_partners(heavy()),
    sweep: false,
    draw: |seen| draw(seen, &heavy()),
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
    pool_uncertainty(&mut numbers);
    // of the difference of two speeds
    let known = 2.0 * numbers[0].relative_uncertainty();
    Ok(Judgement {
        verdict: Verdict::graded(latest_change < 1e-3, early_change > latest_change),
        why: format!(
            "From bead 700 to 850 the speeds change by {}; at bead 520 they are still {early_change:.1e} away from that.",
            if latest_change < known {
                format!("less than {known:.0e}")
            } else {
                format!("{latest_change:.1e}")
            }
        ),
        numbers,
    })
}

fn judge_speeds(seen: &Observations) -> Result<Judgement, StudyError> {
    let pulses = pulses(seen, &light(), 700, true, 5)?;
    let speeds: Vec<f64> = pulses.iter().map(|pulse| pulse.fine.speed_beads_per_s).collect();
    let number =
        |(index, pulse): (usize, &Passed)| pulse.speed(format!("forward pulse {}: speed", index + 1));
    let mut numbers: Vec<Number> = pulses.iter().enumerate().map(number).collect();
    pool_uncertainty(&mut numbers);
    Ok(Judgement {
        verdict: Verdict::of(falls(&speeds)),
        why: format!(
            "From {:.0} beads/s of the shock down to {:.0} of the pulse that comes fifth.",
            speeds[0], speeds[4]
        ),
        numbers,
    })
}

/// Gaps on one side of the impurity in the kept frame number `frame`.
fn gaps(seen: &Observations, run: Run, frame: usize, side: Range<usize>) -> Result<Counted, StudyError> {
    counted(seen, run, |seen| {
        let (chain, kept) = (seen.manifest.physics.chain(), seen.kept_frame(frame)?);
        Ok(side.clone().filter(|contact| chain.overlap_m(&kept.u_m, *contact) < -GAP_M).count())
    })
}

/// The gaps left and right of the impurity, and these as numbers beside those of the reference.
fn gaps_against(
    seen: &Observations,
    run: &Run,
    frame: usize,
    expected: [f64; 2],
) -> Result<([Counted; 2], Vec<Number>), StudyError> {
    let contacts = seen.of(run)?.manifest.physics.chain().contact_count();
    let found =
        [gaps(seen, run.clone(), frame, 0..IMPURITY)?, gaps(seen, run.clone(), frame, IMPURITY..contacts)?];
    let sides = ["left", "right"].into_iter().zip(&found).zip(expected);
    let numbers = sides.map(|((side, found), expected)| {
        let what = format!("gaps above 1 nm {side} of the impurity at 80 ms");
        // the reference's run ends up to a step later, in which a contact may open or close
        Number::count(what, found).against_within(expected, 1.0)
    });
    Ok((found, numbers.collect()))
}

fn judge_light_gaps(seen: &Observations) -> Result<Judgement, StudyError> {
    let ([left, right], numbers) = gaps_against(seen, &light(), 3, [78.0, 48.0])?;
    Ok(Judgement {
        verdict: Verdict::of(left.count + right.count == 0),
        why: format!(
            "Of the contacts that are not compressed {left} left of the impurity and {right} right of it are open, with gaps \
             above 1 nm: there are three classes of contacts, not two."
        ),
        numbers,
    })
}

fn judge_halved(seen: &Observations) -> Result<Judgement, StudyError> {
    let heavy = seen.of(&heavy())?;
    // overlap with the left neighbour, between the collision and the second hit
    let samples = heavy.motion.curve(2).filter(|(t, _)| (0.046..0.060).contains(t));
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
    let ([left, right], numbers) = gaps_against(seen, &heavy(), 1, [31.0, 0.0])?;
    Ok(Judgement {
        verdict: Verdict::graded(right.count <= 1, left.count + right.count <= 1),
        why: format!(
            "Right of the impurity {right} contacts have a gap above 1 nm, so that they do touch there, but left of it \
             {left} have."
        ),
        numbers,
    })
}

fn speeds_back(back: &[Passed]) -> Vec<Number> {
    let names = ["reflected pulse: speed", "first pulse of the second front: speed"];
    back.iter().zip(names).map(|(pulse, name)| pulse.speed(name)).collect()
}

fn judge_slope(seen: &Observations) -> Result<Judgement, StudyError> {
    let back = pulses(seen, &heavy(), 300, false, 2)?;
    let ratio = back[0].fine.speed_beads_per_s / back[1].fine.speed_beads_per_s;
    let mut numbers = speeds_back(&back);
    pool_uncertainty(&mut numbers);
    Ok(Judgement {
        verdict: Verdict::of(ratio > 1.0),
        why: format!("The reflected pulse is {ratio:.2} times as fast as the first of the second front."),
        numbers,
    })
}

fn judge_source(seen: &Observations) -> Result<Judgement, StudyError> {
    let first_and_last = seen.of(&light())?.pulses_past(520, true);
    let time_ms = |pulse: Option<&Passage>| pulse.map_or(0.0, |pulse| pulse.time_s * 1e3);
    let (ahead, behind) = (count_past(seen, light(), 520, true)?, count_past(seen, light(), 300, false)?);
    Ok(Judgement {
        verdict: Verdict::of(ahead.least > 3 && behind.least > 3),
        why: format!(
            "From {:.0} to {:.0} ms {ahead} pulses above 5 mm/s pass bead 520; by the end of the run {behind} have passed bead 300 on \
             their way back.",
            time_ms(first_and_last.first()),
            time_ms(first_and_last.last()),
        ),
        numbers: vec![
            Number::count("pulses past bead 520", &ahead),
            Number::count("pulses past bead 300 on their way back", &behind),
        ],
    })
}

fn judge_second_front(seen: &Observations) -> Result<Judgement, StudyError> {
    let back = pulses(seen, &heavy(), 300, false, 2)?;
    // the compressed contacts of the zone, not those of the pulses that have left it
    let zone = |frame: usize| {
        counted(seen, heavy(), |seen| {
            let kept = seen.kept_frame(frame)?;
            let compressed = |contact: &usize| kept.classes[*contact] == consumers::contacts::COMPRESSED;
            let first_behind =
                (0..IMPURITY - 1).rev().take_while(|contact| compressed(contact) || *contact > IMPURITY - 8);
            Ok(first_behind.count())
        })
    };
    let (early, late) = (zone(0)?, zone(1)?);
    let mut numbers = speeds_back(&back);
    numbers.push(back[1].amplitude("first pulse of the second front: peak velocity"));
    pool_uncertainty(&mut numbers);
    numbers.extend([
        Number::count("contacts in the zone at 60 ms", &early),
        Number::count("contacts in the zone at 80 ms", &late),
    ]);
    let separate = back[1].fine.time_s > back[0].fine.time_s;
    Ok(Judgement {
        verdict: Verdict::graded(separate, late.least > early.most),
        why: format!(
            "A second pulse of {:.3} m/s passes bead 300 {:.0} ms after the reflected one; the zone next to the impurity is {} \
             contacts long at 60 ms and {} at 80 ms.",
            back[1].fine.v_peak_m_s,
            (back[1].fine.time_s - back[0].fine.time_s) * 1e3,
            early,
            late,
        ),
        numbers,
    })
}

fn draw(seen: &Observations, run: &Run) -> Result<Figure, StudyError> {
    let seen = seen.of(run)?;
    let map = seen.map.as_ref().ok_or_else(|| seen.absent("map of the contacts"))?;
    Ok(plots::contact_map(&seen.manifest, seen.tolerance_m, map)?)
}
