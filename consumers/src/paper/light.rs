//! A light impurity: it rattles between its neighbours and emits pulses both ways.

use super::claim::{Claim, Judgement, Number, StudyError, Verdict};
use super::observe::{Observations, Observed};
use super::reference::{LIGHT_PULSES, LIGHT_TURNS};
use super::runs::{Run, light};
use super::study::Study;
use crate::figure::{Axis, Colour, Curve, Figure, Panel};
use crate::impurity::{Event, EventKind};
use crate::plots;
use crate::pulses::Passage;

const SECTION: &str = "section 3";
/// Where the uncertainties of this module come from.
const FROM_STEP: &str = "a run with twice the step, recorded half as often";
/// Forward and backward pulses are measured at these beads, as in the reference.
const FORWARD_BEAD: u64 = 700;
const BACKWARD_BEAD: u64 = 300;

pub(super) const VELOCITY: Study = Study {
    slug: "velocity-light",
    title: "Velocities after the collision with a light impurity",
    place: "figure vlight",
    runs: both_steps,
    draw: draw_velocity,
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

pub(super) const IMPURITY: Study = Study {
    slug: "impurity-light",
    title: "Displacement of the light impurity",
    place: "figure uimp",
    runs: both_steps,
    draw: draw_impurity,
    claims: &[
        Claim {
            id: "impurity-oscillates",
            place: SECTION,
            quote: "Fig. (uimp) clearly shows that the impurity oscillates around an equilibrium position.",
            judge: judge_oscillation,
        },
        Claim {
            id: "impurity-zig-zag",
            place: SECTION,
            quote: "These oscillations are zig-zag shaped showing that the impurity moves with a constant velocity \
                    between two shocks with its left and right neighbors.",
            judge: judge_free_flight,
        },
        Claim {
            id: "impurity-slows",
            place: SECTION,
            quote: "This velocity decreases in time (lower slopes of the oscillations) since the impurity transfers \
                    energy to its neighbors at each shock creating new pulses.",
            judge: judge_slowing,
        },
    ],
};

/// The run, and the same with a longer step.
fn both_steps() -> Vec<Run> {
    vec![light(), coarse()]
}

fn coarse() -> Run {
    light().with_step_times(2)
}

/// The pulses that pass `bead` in one direction, as many as the reference has, in both runs.
fn pulses(seen: &Observations, forward: bool) -> Result<Vec<(Passage, Passage)>, StudyError> {
    let bead = if forward { FORWARD_BEAD } else { BACKWARD_BEAD };
    let (fine, coarse) = (seen.of(&light())?, seen.of(&coarse())?);
    let direction = direction(forward);
    let count = LIGHT_PULSES.rows().filter(|row| row[0] == direction).count();
    let pairs = fine.pulses_past(bead, forward).into_iter().zip(coarse.pulses_past(bead, forward));
    let pairs: Vec<_> = pairs.take(count).collect();
    if pairs.len() < count {
        return Err(fine.absent(format!("{direction} pulse {} at bead {bead}", pairs.len() + 1)));
    }
    Ok(pairs)
}

fn direction(forward: bool) -> &'static str {
    if forward { "forward" } else { "backward" }
}

/// Amplitude and speed of each pulse against the reference.
fn pulse_numbers(seen: &Observations, forward: bool) -> Result<Vec<Number>, StudyError> {
    let direction = direction(forward);
    let mut numbers = Vec::new();
    for (index, (fine, coarse)) in pulses(seen, forward)?.into_iter().enumerate() {
        let order = (index + 1).to_string();
        let reference = LIGHT_PULSES.values(&[direction, &order])?;
        let amplitude =
            Number::new(format!("{direction} pulse {order}: peak velocity"), fine.v_peak_m_s, "m/s")
                .give_or_take(fine.v_peak_m_s - coarse.v_peak_m_s, FROM_STEP)
                .against(reference[0], 1e-5);
        let (ours, theirs) = (fine.speed_beads_per_s, coarse.speed_beads_per_s);
        let speed = Number::new(format!("{direction} pulse {order}: speed"), ours, "beads/s")
            .give_or_take(ours - theirs, FROM_STEP)
            .against(reference[1], 1e-5);
        numbers.extend([amplitude, speed]);
    }
    Ok(numbers)
}

/// Whether the heights of the pulses fall from each to the next.
fn falls(heights: &[f64]) -> bool {
    heights.windows(2).all(|pair| pair[1].abs() < pair[0].abs())
}

fn heights(pulses: &[(Passage, Passage)]) -> Vec<f64> {
    pulses.iter().map(|(fine, _)| fine.v_peak_m_s).collect()
}

fn judge_secondary_waves(seen: &Observations) -> Result<Judgement, StudyError> {
    let forward = pulses(seen, true)?;
    let passed_by = |time_s: f64| forward.iter().filter(|(fine, _)| fine.time_s <= time_s).count();
    let counts = [0.07, 0.08, 0.1].map(passed_by);
    let grows = counts.windows(2).all(|pair| pair[0] < pair[1]);
    let mut numbers = pulse_numbers(seen, true)?;
    for (time_ms, count) in [70, 80, 100].into_iter().zip(counts) {
        let what = format!("pulses that have passed bead {FORWARD_BEAD} at {time_ms} ms");
        numbers.push(Number::new(what, count as f64, ""));
    }
    Ok(Judgement {
        verdict: Verdict::graded(grows, falls(&heights(&forward))),
        why: format!(
            "The shock and {} secondary pulses pass bead {FORWARD_BEAD}, each weaker than the one before, and their \
             number still grows.",
            forward.len() - 1
        ),
        numbers,
    })
}

fn judge_backward_waves(seen: &Observations) -> Result<Judgement, StudyError> {
    let backward = heights(&pulses(seen, false)?);
    let negative = backward.iter().all(|v| *v < 0.0);
    Ok(Judgement {
        verdict: Verdict::of(negative && falls(&backward)),
        why: format!(
            "{} pulses of negative velocity pass bead {BACKWARD_BEAD} on their way back, each weaker than the one \
             before.",
            backward.len()
        ),
        numbers: pulse_numbers(seen, false)?,
    })
}

fn judge_amplitudes(seen: &Observations) -> Result<Judgement, StudyError> {
    /// "Almost the same" is taken to be within a tenth.
    const ALMOST: f64 = 0.1;
    let (forward, backward) = (pulses(seen, true)?, pulses(seen, false)?);
    let mut numbers = Vec::new();
    let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
    for (order, (ahead, behind)) in forward.iter().skip(1).zip(&backward).enumerate() {
        let ratio = |ahead: Passage, behind: Passage| -behind.v_peak_m_s / ahead.v_peak_m_s;
        let (fine, coarse) = (ratio(ahead.0, behind.0), ratio(ahead.1, behind.1));
        let what = format!("secondary pulse {}: backward over forward amplitude", order + 1);
        numbers.push(Number::new(what, fine, "").give_or_take(fine - coarse, FROM_STEP));
        let off = (fine - 1.0).abs();
        (least, most) = (least.min(off), most.max(off));
    }
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
    let before = |seen: &Observed| {
        let passage = seen.pulses_past(BACKWARD_BEAD, true).into_iter().next();
        passage.ok_or_else(|| seen.absent("incident pulse"))
    };
    let (incident, coarse) = (before(seen.of(&light())?)?, before(seen.of(&coarse())?)?);
    let (transmitted, coarse_transmitted) = pulses(seen, true)?[0];
    let ratio = |of: fn(&Passage) -> f64| {
        let (fine, coarse) = (of(&transmitted) / of(&incident), of(&coarse_transmitted) / of(&coarse));
        (fine, fine - coarse)
    };
    let (weaker, weaker_error) = ratio(|pulse| pulse.v_peak_m_s);
    let (slower, slower_error) = ratio(|pulse| pulse.speed_beads_per_s);
    // eq. (vf): V ∝ v_max^((α−1)/(α+1)), 1/5 for Hertz contacts
    let expected = weaker.powf(0.2);
    Ok(Judgement {
        verdict: Verdict::of(weaker < 1.0 && slower < 1.0),
        why: format!(
            "Behind the impurity the shock has {:.2} % less amplitude and is {:.2} % slower, as V ∝ v_max^(1/5) demands.",
            100.0 * (1.0 - weaker),
            100.0 * (1.0 - slower)
        ),
        numbers: vec![
            Number::new("transmitted over incident amplitude", weaker, "")
                .give_or_take(weaker_error, FROM_STEP),
            Number::new("transmitted over incident speed", slower, "").give_or_take(slower_error, FROM_STEP),
            Number::new("the ratio of speeds that eq. (vf) expects", expected, "")
                .give_or_take(0.2 * expected * weaker_error / weaker, FROM_STEP),
        ],
    })
}

fn draw_velocity(seen: &Observations) -> Result<Figure, StudyError> {
    let seen = seen.of(&light())?;
    let snapshot = seen.snapshot(3)?;
    let points =
        |factor: f64| snapshot.v_m_s.iter().enumerate().map(move |(bead, v)| (bead as f64, v * factor));
    let x = || Axis::new("bead").limits(0.0, 999.0);
    let whole = Panel::new()
        .x_axis(x())
        .y_axis("velocity (m/s)")
        .curve(Curve::line("", points(1.0)).colour(Colour::Blue))
        .vertical("impurity", 500.0);
    let small = Panel::new()
        .x_axis(x())
        .y_axis(Axis::new("velocity (m/s)").limits(-0.2, 0.2))
        .curve(Curve::line("", points(1.0)).colour(Colour::Blue))
        .vertical("", 500.0)
        .note("the same, enlarged")
        .height(0.8);
    let caption = format!("{}; t = {:.2} ms", plots::caption(&seen.manifest), snapshot.time_s * 1e3);
    Ok(Figure::new().shared_x().caption(caption).panel(whole).panel(small))
}

/// The turning points of the impurity, as many as the reference has, in both runs.
fn turns(seen: &Observations) -> Result<Vec<(Event, Event)>, StudyError> {
    let of = |seen: &Observed| -> Vec<Event> {
        seen.events.iter().filter(|event| event.kind == EventKind::Turns).copied().collect()
    };
    let (fine, coarse) = (seen.of(&light())?, seen.of(&coarse())?);
    let count = LIGHT_TURNS.rows().count();
    let pairs: Vec<_> = of(fine).into_iter().zip(of(coarse)).take(count).collect();
    if pairs.len() < count {
        return Err(fine.absent(format!("turning point {}", pairs.len() + 1)));
    }
    Ok(pairs)
}

fn judge_oscillation(seen: &Observations) -> Result<Judgement, StudyError> {
    let turns = turns(seen)?;
    let mut numbers = Vec::new();
    for (index, ((fine, coarse), row)) in turns.iter().zip(LIGHT_TURNS.rows()).enumerate() {
        let reference = LIGHT_TURNS.values(&[row[0]])?;
        let missing =
            || StudyError::NoReference { file: "light-impurity-turning-points.csv", row: row[0].into() };
        let time_ms: f64 = row[0].parse().map_err(|_| missing())?;
        let order = index + 1;
        numbers.push(
            Number::new(format!("turning point {order}: time"), fine.time_s * 1e3, "ms")
                .give_or_take((fine.time_s - coarse.time_s) * 1e3, FROM_STEP)
                .against_within(time_ms, 1e-4),
        );
        numbers.push(
            Number::new(format!("turning point {order}: displacement"), fine.u_m * 1e3, "mm")
                .give_or_take((fine.u_m - coarse.u_m) * 1e3, FROM_STEP)
                .against_within(reference[0], 1e-5),
        );
    }
    let u: Vec<f64> = turns.iter().map(|(fine, _)| fine.u_m).collect();
    // turns to the right and to the left alternate about one place, ever closer to it
    let swings: Vec<f64> = u.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let alternates = swings.windows(2).all(|pair| pair[0] * pair[1] < 0.0);
    let settled = 0.5 * (u[u.len() - 1] + u[u.len() - 2]);
    let first = 0.5 * (u[0] + u[1]);
    Ok(Judgement {
        verdict: Verdict::of(alternates),
        why: format!(
            "It turns {} times by the end of the table; the middle of its swings moves only from {:.3} to {:.3} mm.",
            turns.len(),
            first * 1e3,
            settled * 1e3
        ),
        numbers,
    })
}

/// The flights of the impurity between its neighbours: from when one contact opens, the other being open,
/// until one closes; start, duration and mean velocity.
fn flights(seen: &Observed) -> Vec<Flight> {
    let (mut left_open, mut right_open) = (false, false);
    let mut start: Option<Event> = None;
    let mut flights = Vec::new();
    for event in &seen.events {
        match event.kind {
            EventKind::LeftOpens => left_open = true,
            EventKind::RightOpens => right_open = true,
            EventKind::LeftCloses => left_open = false,
            EventKind::RightCloses => right_open = false,
            EventKind::Turns => continue,
        }
        if left_open && right_open {
            start.get_or_insert(*event);
        } else if let Some(from) = start.take() {
            let duration_s = event.time_s - from.time_s;
            let v_m_s = (event.u_m - from.u_m) / duration_s;
            flights.push(Flight { start_s: from.time_s, duration_s, v_m_s });
        }
    }
    flights
}

#[derive(Debug, Clone, Copy)]
struct Flight {
    start_s: f64,
    duration_s: f64,
    v_m_s: f64,
}

/// The flights that end before the tables of the reference do.
fn first_flights(seen: &Observations) -> Result<Vec<(Flight, Flight)>, StudyError> {
    let (fine, coarse) = (seen.of(&light())?, seen.of(&coarse())?);
    let pairs: Vec<_> = flights(fine).into_iter().zip(flights(coarse)).take(8).collect();
    if pairs.len() < 4 {
        return Err(fine.absent("flight between the neighbours"));
    }
    Ok(pairs)
}

fn judge_free_flight(seen: &Observations) -> Result<Judgement, StudyError> {
    let flights = first_flights(seen)?;
    let (first, last) = (flights[0].0, flights[flights.len() - 1].0);
    let flying_s: f64 = flights.iter().map(|(flight, _)| flight.duration_s).sum();
    let share = flying_s / (last.start_s + last.duration_s - first.start_s);
    Ok(Judgement {
        // without a contact there is no force: a flight is straight to the last bit, so what counts is
        // whether flights make up the motion
        verdict: Verdict::of(share > 0.5),
        why: format!(
            "Between the first and the last of {} flights it touches neither neighbour for {:.0} % of the time, and \
             without a contact its velocity is constant.",
            flights.len(),
            100.0 * share
        ),
        numbers: vec![Number::new("part of the time in free flight", share, "")],
    })
}

fn judge_slowing(seen: &Observations) -> Result<Judgement, StudyError> {
    let flights = first_flights(seen)?;
    let speeds: Vec<f64> = flights.iter().map(|(flight, _)| flight.v_m_s).collect();
    let numbers = flights.iter().enumerate().map(|(index, (fine, coarse))| {
        Number::new(format!("flight {}: velocity", index + 1), fine.v_m_s, "m/s")
            .give_or_take(fine.v_m_s - coarse.v_m_s, FROM_STEP)
    });
    Ok(Judgement {
        verdict: Verdict::of(falls(&speeds)),
        why: format!(
            "From flight to flight it is slower: {:.3} m/s in the first, {:.3} m/s in number {}.",
            speeds[0].abs(),
            speeds[speeds.len() - 1].abs(),
            speeds.len()
        ),
        numbers: numbers.collect(),
    })
}

fn draw_impurity(seen: &Observations) -> Result<Figure, StudyError> {
    let pairs = turns(seen)?;
    let seen = seen.of(&light())?;
    let times_s = seen.motion.times_s();
    let path = times_s.into_iter().zip(seen.motion.column(0)).map(|(t, u)| (t * 1e3, u * 1e3));
    let marks = pairs.iter().map(|(fine, _)| (fine.time_s * 1e3, fine.u_m * 1e3));
    let panel = Panel::new()
        .x_axis(Axis::new("time (ms)").limits(42.5, 80.0))
        .y_axis("displacement (mm)")
        .curve(Curve::line("impurity", path).colour(Colour::Blue))
        .curve(Curve::points("turning points", marks).colour(Colour::Vermillion));
    Ok(Figure::new().caption(plots::caption(&seen.manifest)).panel(panel))
}
