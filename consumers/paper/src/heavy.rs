//! A heavy impurity: it moves on, the transmitted wave breaks up, one pulse comes back.

use super::judgement::{Judgement, Number, StudyError, Verdict, pool_uncertainty};
use super::observe::Observations;
use super::passing::{
    BACKWARD_BEAD, FORWARD_BEAD, Passed, against_table, counted, falls, heights, pulses_of_table,
    with_partners,
};
use super::profile::velocity_figure;
use super::reference::HEAVY_PULSES;
use super::runs::heavy;
use super::study::{Claim, Study};
use consumers::impurity::{Event, EventKind};
use consumers::pulses::Passage;
use consumers::theory::{SolitaryWave, Strength};
use figure::{Axis, Colour, Curve, Figure, Panel};

const SECTION: &str = "section 3";
/// Error of the reference of the pulses.
const GOOD_TO: f64 = 1e-6;
/// Number of the kept frame in the figures.
const AT_80_MS: usize = 1;

pub(super) const VELOCITY: Study = Study {
    slug: "velocity-heavy",
    title: "Velocities after the collision with a heavy impurity",
    place: "figure vheavy",
    runs: || with_partners(heavy()),
    sweep: false,
    draw: |seen| velocity_figure(seen.of(&heavy())?, AT_80_MS, [-0.05, 0.15]),
    claims: &[
        Claim {
            id: "heavy-train",
            place: SECTION,
            quote: "The collision generates many pulses of decreasing amplitudes behind the impurity, these pulses \
                    being very close to each other.",
            judge: judge_train,
        },
        Claim {
            id: "heavy-one-reflected",
            place: SECTION,
            quote: "Moving in the opposite direction one can see one pulse of large amplitude.",
            judge: judge_reflected,
        },
        Claim {
            id: "heavy-not-symmetric",
            place: SECTION,
            quote: "This pattern is not symmetric as in the case of a light bead and a different physical process seems to be \
                    involved.",
            judge: judge_asymmetry,
        },
        Claim {
            id: "heavy-fragments",
            place: SECTION,
            quote: "This spatio-temporal pattern allows us to say that the collision of a shock wave with an heavy impurity make it \
                    fragment into solitary waves of decreasing amplitudes.",
            judge: judge_fragments,
        },
        Claim {
            id: "heavy-no-solitons",
            place: "section 4",
            quote: "The chain corresponding to the transmitted wave supports no more solitonic propagation …",
            judge: judge_solitons,
        },
        Claim {
            id: "heavy-low-pulses",
            place: SECTION,
            quote: "These new compression pulses are not visible on the velocity profile since their amplitude is too low.",
            judge: judge_low_pulses,
        },
    ],
};

pub(super) const SECOND_HIT: Study = Study {
    slug: "second-hit",
    title: "The heavy impurity and its left neighbour",
    place: "text of section 3, and what it leaves out",
    runs: || with_partners(heavy()),
    sweep: false,
    draw: draw_second_hit,
    claims: &[
        Claim {
            id: "heavy-shifted",
            place: SECTION,
            quote: "The impurity has actually been given a shift to the right when it collided with the shock wave.",
            judge: judge_shift,
        },
        Claim {
            id: "heavy-sticks",
            place: SECTION,
            quote: "Instead of bouncing back the impurity sticks and there is the formation of a compression chain.",
            judge: judge_sticking,
        },
    ],
};

fn forward(seen: &Observations) -> Result<Vec<Passed>, StudyError> {
    pulses_of_table(seen, &heavy(), HEAVY_PULSES, true)
}

fn backward(seen: &Observations) -> Result<Vec<Passed>, StudyError> {
    pulses_of_table(seen, &heavy(), HEAVY_PULSES, false)
}

fn judge_train(seen: &Observations) -> Result<Judgement, StudyError> {
    let pulses = forward(seen)?;
    let falls = falls(&heights(&pulses));
    let widest = |of: fn(&Passed) -> Passage| {
        let apart = |before: Passage, after: Passage| {
            (after.time_s - before.time_s) * 0.5 * (before.speed_beads_per_s + after.speed_beads_per_s)
        };
        pulses.windows(2).map(|pair| apart(of(&pair[0]), of(&pair[1]))).fold(0.0, f64::max)
    };
    let both = (widest(|pulse| pulse.fine), widest(|pulse| pulse.coarse));
    let widest = both.0;
    let mut numbers = against_table(&pulses, HEAVY_PULSES, true, GOOD_TO)?;
    let what = "largest distance between two of them, as they pass bead 700";
    numbers.push(Number::stepped(what, both, "beads", pulses[0].drift));
    Ok(Judgement {
        verdict: Verdict::of(falls && widest < 50.0),
        why: format!(
            "The first {} forward pulses pass bead 700, {} weaker than the one before, at most {widest:.0} beads apart.",
            pulses.len(),
            if falls { "each" } else { "not all" },
        ),
        numbers,
    })
}

fn judge_reflected(seen: &Observations) -> Result<Judgement, StudyError> {
    let pulses = backward(seen)?;
    let ratio = pulses[1].fine.v_peak_m_s / pulses[0].fine.v_peak_m_s;
    Ok(Judgement {
        verdict: Verdict::of(ratio < 0.1),
        why: format!(
            "The reflected pulse has {:.2} m/s; the next one back is {:.0} times weaker.",
            pulses[0].fine.v_peak_m_s,
            1.0 / ratio
        ),
        numbers: against_table(&pulses, HEAVY_PULSES, false, GOOD_TO)?,
    })
}

fn judge_asymmetry(seen: &Observations) -> Result<Judgement, StudyError> {
    /// Pulses above a fiftieth of the striker's speed are the pattern that a plot shows.
    const SHOWN_M_S: f64 = 0.1;
    let count = |bead, forward| {
        counted(seen, heavy(), |seen| {
            let pulses = seen.pulses_past(bead, forward);
            Ok(pulses.iter().filter(|pulse| pulse.v_peak_m_s.abs() > SHOWN_M_S).count())
        })
    };
    // the incident pulse passes bead 300 forwards, and is not counted
    let (forward, backward) = (count(FORWARD_BEAD, true)?, count(BACKWARD_BEAD, false)?);
    Ok(Judgement {
        verdict: Verdict::graded(forward.count > 3 * backward.count, forward.least > 3 * backward.most),
        why: format!("{forward} pulses above 0.1 m/s go forward, and {backward} back."),
        numbers: vec![
            Number::count("pulses above 0.1 m/s past bead 700", &forward),
            Number::count("pulses above 0.1 m/s past bead 300 on their way back", &backward),
        ],
    })
}

/// Speeds of the forward pulses over those of exact solitary waves of their amplitudes, and how far they may be from 1.
fn solitary(seen: &Observations) -> Result<(Vec<Number>, f64), StudyError> {
    let physics = &seen.of(&heavy())?.manifest.physics;
    let wave = SolitaryWave::new(physics.alpha)?.coefficients();
    let ratio = |passage: &Passage| -> Result<f64, StudyError> {
        let strength = Strength::PeakVelocity { m_s: passage.v_peak_m_s };
        let scale = wave.scaled(physics.bead_mass_kg, physics.stiffness, strength)?;
        Ok(passage.speed_beads_per_s / scale.speed_beads_per_s)
    };
    let mut numbers = Vec::new();
    for (index, pulse) in forward(seen)?.iter().enumerate() {
        let what =
            format!("forward pulse {}: speed over that of a solitary wave of its amplitude", index + 1);
        numbers.push(Number::stepped(what, (ratio(&pulse.fine)?, ratio(&pulse.coarse)?), "", pulse.drift));
    }
    pool_uncertainty(&mut numbers);
    let off = |number: &Number| (number.value - 1.0).abs() + number.relative_uncertainty() * number.value;
    let worst = numbers.iter().map(off).fold(0.0, f64::max);
    Ok((numbers, worst))
}

/// A pulse is a solitary wave if its speed is that of one, to this part.
const SOLITARY: f64 = 1e-3;

fn judge_fragments(seen: &Observations) -> Result<Judgement, StudyError> {
    let (numbers, worst) = solitary(seen)?;
    let falls = falls(&heights(&forward(seen)?));
    Ok(Judgement {
        verdict: Verdict::graded(falls, worst < SOLITARY),
        why: format!(
            "The amplitudes of the {} first fragments {}, and each has the speed of the exact solitary wave of its amplitude within {worst:.0e}.",
            numbers.len(),
            if falls { "fall" } else { "do not fall" },
        ),
        numbers,
    })
}

fn judge_solitons(seen: &Observations) -> Result<Judgement, StudyError> {
    let (numbers, worst) = solitary(seen)?;
    Ok(Judgement {
        // it is so if the fragments are no solitary waves
        verdict: Verdict::of(worst >= SOLITARY),
        why: if worst < SOLITARY {
            format!(
                "The wave breaks up, but what it breaks up into are solitary waves: their speeds are those of such waves within {worst:.0e}."
            )
        } else {
            format!("The fragments' speeds differ from those of solitary waves by up to {worst:.0e}.")
        },
        numbers,
    })
}

fn judge_low_pulses(seen: &Observations) -> Result<Judgement, StudyError> {
    /// Smallest part that is visible in a plot of the whole range.
    const VISIBLE: f64 = 0.01;
    let (ahead, behind) = (forward(seen)?, backward(seen)?);
    let part = |of: fn(&Passed) -> f64| of(&behind[1]).abs() / (of(&ahead[0]) - of(&behind[0]));
    let both = (part(|pulse| pulse.fine.v_peak_m_s), part(|pulse| pulse.coarse.v_peak_m_s));
    let part = both.0;
    Ok(Judgement {
        verdict: Verdict::graded(part < 0.05, part < VISIBLE),
        why: format!("The strongest of them takes {:.2} % of the height of the plot.", 100.0 * part),
        numbers: vec![
            behind[1].amplitude("strongest pulse of the second front: peak velocity"),
            Number::stepped("the same over the range of all velocities", both, "", behind[1].drift),
        ],
    })
}

/// Events in which the left neighbour hits the impurity, in both runs.
fn hits(seen: &Observations) -> Result<Vec<(Event, Event)>, StudyError> {
    seen.events(&heavy(), EventKind::LeftCloses)
}

fn judge_shift(seen: &Observations) -> Result<Judgement, StudyError> {
    let run = seen.of(&heavy())?;
    let (u, v) = (run.motion.column(0), run.motion.column(1));
    let backwards = v.iter().copied().fold(0.0, f64::min);
    let shift = seen.stepped(&heavy(), "displacement at 80 ms", "mm", |seen| {
        Ok(seen.kept_frame(AT_80_MS)?.u_m[500] * 1e3)
    })?;
    let monotonic = u.windows(2).all(|pair| pair[1] >= pair[0] - 1e-9);
    Ok(Judgement {
        verdict: Verdict::graded(shift.value > 0.0, monotonic),
        why: format!(
            "At 80 ms it is {:.2} mm to the right of where it was, and {}.",
            shift.value,
            if monotonic { "it never moves back" } else { "it moves back a little on the way" }
        ),
        numbers: vec![shift, Number::new("largest velocity backwards", backwards.abs(), "m/s")],
    })
}

fn judge_sticking(seen: &Observations) -> Result<Judgement, StudyError> {
    let hits = hits(seen)?;
    let heavy = seen.of(&heavy())?;
    let bounced = heavy.motion.column(1).iter().any(|v| *v < -1e-3);
    let mut numbers = Vec::new();
    for (index, (fine, coarse)) in hits.iter().enumerate() {
        let what = format!("hit {} of bead 499 on the impurity", index + 1);
        let times_ms = (fine.time_s * 1e3, coarse.time_s * 1e3);
        let number = Number::stepped(what, times_ms, "ms", heavy.max_abs_drift);
        // the reference gives the second in hundredths of a millisecond
        numbers.push(if index == 1 { number.against_within(60.94, 0.005) } else { number });
    }
    let again = hits.get(1).map(|(fine, _)| fine.time_s);
    Ok(Judgement {
        verdict: Verdict::graded(!bounced, again.is_none()),
        why: match again {
            Some(time_s) if !bounced => format!(
                "It does not bounce back, but more happens than the paper shows: at {:.2} ms bead 499 hits it again and \
                 starts a second train.",
                time_s * 1e3
            ),
            Some(_) => "It bounces back, and is hit again.".to_owned(),
            None => "It stays beside its right neighbour and is not hit again.".to_owned(),
        },
        numbers,
    })
}

fn draw_second_hit(seen: &Observations) -> Result<Figure, StudyError> {
    let hits = hits(seen)?;
    let seen = seen.of(&heavy())?;
    let curve = |column: usize, factor: f64| {
        seen.motion.curve(column).map(move |(t, value)| (t * 1e3, value * factor))
    };
    let x = || Axis::new("time (ms)").limits(42.0, 80.0);
    let mut velocity = Panel::new()
        .x_axis(x())
        .y_axis("velocity of the impurity (m/s)")
        .curve(Curve::line("", curve(1, 1.0)).colour(Colour::Blue));
    let mut gap = Panel::new()
        .x_axis(x())
        .y_axis(Axis::new("gap to bead 499 (mm)").limits(-0.15, 1.1))
        .curve(Curve::line("", curve(2, -1e3)).colour(Colour::Vermillion))
        .horizontal("", 0.0);
    for (index, (hit, _)) in hits.iter().enumerate() {
        velocity =
            velocity.vertical(if index == 0 { "bead 499 hits the impurity" } else { "" }, hit.time_s * 1e3);
        gap = gap.vertical("", hit.time_s * 1e3);
    }
    Ok(Figure::new().shared_x().caption(plots::caption(&seen.manifest)).panel(velocity).panel(gap))
}
