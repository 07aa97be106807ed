//! The motion of a light impurity between its neighbours.

use super::judgement::{Counted, FROM_STEP, Judgement, Number, StudyError, Verdict};
use super::observe::{Observations, Observed};
use super::passing::{BACKWARD_BEAD, FORWARD_BEAD, count_past, counted, falls, with_partners};
use super::reference::LIGHT_TURNS;
use super::runs::light;
use super::study::{Claim, Study};
use consumers::impurity::{Event, EventKind};
use figure::{Axis, Colour, Curve, Figure, Mark, Panel};

const SECTION: &str = "section 3";

pub(super) const IMPURITY: Study = Study {
    slug: "impurity-light",
    title: "Displacement of the light impurity",
    place: "figure uimp",
    runs: || with_partners(light()),
    sweep: false,
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
        Claim {
            id: "impurity-pulse-each-cycle",
            place: "section 1",
            quote: "These oscillations are damped since the impurity collides its nearest neighbors producing a \
                    backward and a forward moving pulse in each cycle.",
            judge: judge_cycles,
        },
    ],
};

/// The turning points of the impurity, as many as the reference has, in both runs.
fn turns(seen: &Observations) -> Result<Vec<(Event, Event)>, StudyError> {
    let count = LIGHT_TURNS.rows().count();
    let pairs: Vec<_> = seen.events(&light(), EventKind::Turns)?.into_iter().take(count).collect();
    if pairs.len() < count {
        return Err(seen.of(&light())?.absent(format!("turning point {}", pairs.len() + 1)));
    }
    Ok(pairs)
}

fn judge_oscillation(seen: &Observations) -> Result<Judgement, StudyError> {
    let turns = turns(seen)?;
    let worst = |of: fn(&Event) -> f64| {
        turns.iter().map(|(fine, coarse)| (of(fine) - of(coarse)).abs()).fold(0.0, f64::max)
    };
    let (worst_s, worst_m) = (worst(|turn| turn.time_s), worst(|turn| turn.u_m));
    let drift = seen.of(&light())?.max_abs_drift;
    let mut numbers = Vec::new();
    for (index, ((fine, _), reference)) in turns.iter().zip(LIGHT_TURNS.numbers()?).enumerate() {
        let order = index + 1;
        numbers.push(
            Number::new(format!("turning point {order}: time"), fine.time_s * 1e3, "ms")
                .give_or_take(worst_s.hypot(drift * fine.time_s) * 1e3, FROM_STEP)
                .against_within(reference[0], 1e-4),
        );
        numbers.push(
            Number::new(format!("turning point {order}: displacement"), fine.u_m * 1e3, "mm")
                .give_or_take(worst_m.hypot(drift * fine.u_m) * 1e3, FROM_STEP)
                .against_within(reference[1], 1e-5),
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
pub(super) fn flights(seen: &Observed) -> Vec<Flight> {
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
            let v_m_s = (event.u_m - from.u_m) / (event.time_s - from.time_s);
            flights.push(Flight { times_s: (from.time_s, event.time_s), v_m_s });
        }
    }
    flights
}

/// A flight of the impurity between its neighbours.
#[derive(Debug, Clone, Copy)]
pub(super) struct Flight {
    /// Times (s) at which it begins and ends.
    pub(super) times_s: (f64, f64),
    /// The velocity (m/s), constant.
    pub(super) v_m_s: f64,
}

/// The flights that end before the tables of the reference do.
fn first_flights(seen: &Observations) -> Result<Vec<(Flight, Flight)>, StudyError> {
    let (fine, coarse) = seen.both(&light(), |seen| Ok(flights(seen)))?;
    let pairs: Vec<_> = fine.into_iter().zip(coarse).take(8).collect();
    if pairs.len() < 4 {
        return Err(seen.of(&light())?.absent("flight between the neighbours"));
    }
    Ok(pairs)
}

fn judge_free_flight(seen: &Observations) -> Result<Judgement, StudyError> {
    let pairs = first_flights(seen)?;
    let share = |flights: &[Flight]| {
        let (first_s, last_s) = (flights[0].times_s.0, flights[flights.len() - 1].times_s.1);
        flights.iter().map(|flight| flight.times_s.1 - flight.times_s.0).sum::<f64>() / (last_s - first_s)
    };
    let (fine, coarse): (Vec<Flight>, Vec<Flight>) = pairs.into_iter().unzip();
    let drift = seen.of(&light())?.max_abs_drift;
    let part = Number::stepped("part of the time in free flight", (share(&fine), share(&coarse)), "", drift);
    Ok(Judgement {
        // without a contact there is no force: a flight is straight to the last bit, so what counts is
        // whether flights make up the motion
        verdict: Verdict::of(part.value > 0.5),
        why: format!(
            "Between the first and the last of {} flights it touches neither neighbour for {:.0} % of the time, and without a contact \
             its velocity is constant.",
            fine.len(),
            100.0 * part.value
        ),
        numbers: vec![part],
    })
}

fn judge_slowing(seen: &Observations) -> Result<Judgement, StudyError> {
    let flights = first_flights(seen)?;
    let speeds: Vec<f64> = flights.iter().map(|(flight, _)| flight.v_m_s).collect();
    let worst = flights.iter().map(|(fine, coarse)| (fine.v_m_s - coarse.v_m_s).abs()).fold(0.0, f64::max);
    let numbers = flights.iter().enumerate().map(|(index, (fine, _))| {
        Number::new(format!("flight {}: velocity", index + 1), fine.v_m_s, "m/s")
            .give_or_take(worst, FROM_STEP)
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

fn judge_cycles(seen: &Observations) -> Result<Judgement, StudyError> {
    // how often the impurity has hit a neighbour when the last pulse left that passes the probe
    let hits = |seen: &Observed, kind: EventKind, forward: bool| {
        let pulses = seen.pulses_past(if forward { FORWARD_BEAD } else { BACKWARD_BEAD }, forward);
        // the time that the weakest pulse takes over the 200 beads from the impurity
        let left_s = pulses.last().map_or(0.0, |pulse| pulse.time_s - 200.0 / pulse.speed_beads_per_s);
        let events = seen.events.iter();
        events.filter(|event| event.kind == kind && event.time_s < left_s + 1e-4).count()
    };
    let forward = count_past(seen, light(), FORWARD_BEAD, true)?;
    let backward = count_past(seen, light(), BACKWARD_BEAD, false)?;
    let right = counted(seen, light(), |seen| Ok(hits(seen, EventKind::RightCloses, true)))?;
    // the shock itself comes through the left contact, and is the first of the forward pulses
    let left = counted(seen, light(), |seen| Ok(hits(seen, EventKind::LeftCloses, false).saturating_sub(1)))?;
    let apart = |pulses: &Counted, hits: &Counted| pulses.count.abs_diff(hits.count);
    Ok(Judgement {
        verdict: Verdict::graded(
            forward.least > 1 && backward.least > 1,
            apart(&forward, &right) + apart(&backward, &left) <= 2,
        ),
        why: format!(
            "By then it has hit its right neighbour {right} times for {forward} forward pulses, and its left one {left} times for \
             {backward} backward pulses."
        ),
        numbers: vec![
            Number::count("forward pulses past bead 700", &forward),
            Number::count("closures of the right contact that can have made them", &right),
            Number::count("backward pulses past bead 300", &backward),
            Number::count("closures of the left contact that can have made them", &left),
        ],
    })
}

fn draw_impurity(seen: &Observations) -> Result<Figure, StudyError> {
    let seen = seen.of(&light())?;
    let path = seen.motion.curve(0).map(|(t, u)| (t * 1e3, u * 1e3));
    let marks = LIGHT_TURNS.numbers()?.into_iter().map(|row| (row[0], row[1]));
    let panel = Panel::new()
        .x_axis(Axis::new("time (ms)").limits(42.5, 80.0))
        .y_axis("displacement (mm)")
        .curve(Curve::line("impurity", path).colour(Colour::Blue))
        .curve(Curve::points("independent reference", marks).mark(Mark::Cross).colour(Colour::Vermillion));
    Ok(Figure::new().caption(plots::caption(&seen.manifest)).panel(panel))
}
