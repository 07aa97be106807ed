//! The motion of single beads: impurities, or any other.

use crate::contacts::default_tolerance_m;
use schemas::chain::{Chain, Wall, Walls};
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use schemas::results::MOTION;

/// Motion of one bead in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Displacement (m).
    pub u_m: f64,
    /// Velocity (m/s).
    pub v_m_s: f64,
    /// Overlap with the left neighbour (m); NaN for the first bead.
    pub overlap_left_m: f64,
    /// Overlap with the right neighbour (m); NaN for the last bead.
    pub overlap_right_m: f64,
}

impl Motion {
    /// Names of the quantities with their units, in the order of [`Motion::values`].
    pub const QUANTITIES: [(&'static str, &'static str); 4] = MOTION;

    /// The values in the order of [`Motion::QUANTITIES`].
    pub fn values(&self) -> [f64; 4] {
        [self.u_m, self.v_m_s, self.overlap_left_m, self.overlap_right_m]
    }
}

/// Kind of an event of a bead.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EventKind {
    /// The contact with the left neighbour closes.
    LeftCloses,
    /// The contact with the left neighbour opens.
    LeftOpens,
    /// The contact with the right neighbour closes.
    RightCloses,
    /// The contact with the right neighbour opens.
    RightOpens,
    /// The bead turns round: its velocity changes sign.
    Turns,
}

impl EventKind {
    /// The word used in tables.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::LeftCloses => "left-closes",
            Self::LeftOpens => "left-opens",
            Self::RightCloses => "right-closes",
            Self::RightOpens => "right-opens",
            Self::Turns => "turns",
        }
    }
}

/// Something that happened to a bead between two frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Event {
    /// The bead.
    pub bead: u64,
    /// The kind of event.
    pub kind: EventKind,
    /// Time (s), interpolated.
    pub time_s: f64,
    /// Displacement of the bead then (m), interpolated.
    pub u_m: f64,
}

/// Follows some beads of one run.
#[derive(Debug, Clone)]
pub struct Followed {
    chain: Chain,
    beads: Vec<usize>,
    tolerance_m: f64,
    rest_m_s: f64,
    /// One sample a bead; empty before the first frame and after a gap.
    before: Vec<Sample>,
    now: Vec<Sample>,
    motions: Vec<Motion>,
    events: Vec<Event>,
}

/// Values of a bead at one frame, for interpolation.
#[derive(Debug, Clone, Copy)]
struct Sample {
    time_s: f64,
    u_m: f64,
    v_m_s: f64,
    /// Overlap (m) and its rate (m/s), left and right; none beyond a free end.
    contacts: [Option<(f64, f64)>; 2],
    /// True if the bead has moved faster than `rest_m_s` since it last turned.
    has_moved: bool,
    /// True if it last moved to the right; absent if it never moved.
    heads_right: Option<bool>,
}

impl Followed {
    /// Follows `beads` of `manifest`'s run. A contact counts as closed while its overlap is above the
    /// default tolerance of [`crate::contacts`]. A change of sign of the velocity counts as a turn if the
    /// bead moved faster than 1e-6 of the striker's speed ([`schemas::scales::Scales::speed_m_s`]) since the last.
    pub fn new(manifest: &RunManifest, beads: &[u64]) -> Self {
        let chain = manifest.physics.chain();
        let index = |bead: &u64| usize::try_from(*bead).unwrap_or(usize::MAX).min(chain.bead_count() - 1);
        Self {
            beads: beads.iter().map(index).collect(),
            tolerance_m: default_tolerance_m(manifest),
            rest_m_s: 1e-6 * manifest.physics.scales().speed_m_s(),
            before: Vec::with_capacity(beads.len()),
            now: Vec::with_capacity(beads.len()),
            motions: Vec::with_capacity(beads.len()),
            events: Vec::new(),
            chain,
        }
    }

    /// The motions of the beads in `frame`, in the order in which they were asked for, and the events since the frame
    /// before.
    pub fn observe(&mut self, frame: &Frame<'_>) -> (&[Motion], &[Event]) {
        self.motions.clear();
        self.events.clear();
        self.now.clear();
        for (i, bead) in self.beads.iter().enumerate() {
            let mut sample = self.sample(frame, *bead);
            self.motions.push(motion(&sample));
            if let Some(old) = self.before.get(i).copied() {
                sample.has_moved |= old.has_moved;
                sample.heads_right = sample.heads_right.or(old.heads_right);
                let step = Step { bead: *bead as u64, from: old, to: sample };
                step.contact_events(self.tolerance_m, &mut self.events);
                if let Some(turn) = step.turn() {
                    self.events.push(turn);
                    sample.has_moved = sample.v_m_s.abs() > self.rest_m_s;
                }
            }
            self.now.push(sample);
        }
        std::mem::swap(&mut self.before, &mut self.now);
        self.events.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        (&self.motions, &self.events)
    }

    /// Forgets the frame before: nothing is interpolated across a gap.
    pub fn gap(&mut self) {
        self.before.clear();
    }

    fn sample(&self, frame: &Frame<'_>, bead: usize) -> Sample {
        let contact = |c: usize| (self.chain.overlap_m(frame.u_m, c), frame.v_m_s[c] - frame.v_m_s[c + 1]);
        let [left_m, right_m] = self.chain.wall_approaches_m(frame.u_m, frame.extra);
        let [left_m_s, right_m_s] = self.chain.wall_approach_rates_m_s(frame.v_m_s, frame.time_s);
        let v_m_s = frame.v_m_s[bead];
        let with_wall = |wall: &Wall, approach_m: f64, rate_m_s: f64| {
            wall.is_there.then(|| (wall.overlap_m(approach_m), rate_m_s))
        };
        let Walls { left, right } = &self.chain.walls;
        // in a ring the contact that closes it stands in the place of the left wall
        Sample {
            time_s: frame.time_s,
            u_m: frame.u_m[bead],
            v_m_s,
            contacts: [
                bead.checked_sub(1).map_or_else(|| with_wall(left, left_m, left_m_s), |c| Some(contact(c))),
                if bead < self.chain.contact_count() {
                    Some(contact(bead))
                } else if self.chain.is_ring {
                    with_wall(left, left_m, left_m_s)
                } else {
                    with_wall(right, right_m, right_m_s)
                },
            ],
            has_moved: v_m_s.abs() > self.rest_m_s,
            heads_right: (v_m_s != 0.0).then_some(v_m_s > 0.0),
        }
    }
}

fn motion(sample: &Sample) -> Motion {
    let overlap = |side: usize| sample.contacts[side].map_or(f64::NAN, |(overlap_m, _)| overlap_m);
    Motion { u_m: sample.u_m, v_m_s: sample.v_m_s, overlap_left_m: overlap(0), overlap_right_m: overlap(1) }
}

/// A bead between two frames.
struct Step {
    bead: u64,
    from: Sample,
    to: Sample,
}

impl Step {
    fn displacement(&self) -> Cubic {
        Cubic::new(&self.from, &self.to, (self.from.u_m, self.from.v_m_s), (self.to.u_m, self.to.v_m_s))
    }

    fn event(&self, kind: EventKind, fraction: f64) -> Event {
        let time_s = self.from.time_s + fraction * (self.to.time_s - self.from.time_s);
        Event { bead: self.bead, kind, time_s, u_m: self.displacement().value(fraction) }
    }

    fn contact_events(&self, tolerance_m: f64, events: &mut Vec<Event>) {
        let kinds =
            [(EventKind::LeftCloses, EventKind::LeftOpens), (EventKind::RightCloses, EventKind::RightOpens)];
        for (side, (closes, opens)) in kinds.into_iter().enumerate() {
            let (Some(from), Some(to)) = (self.from.contacts[side], self.to.contacts[side]) else { continue };
            let (was_closed, is_closed) = (from.0 > tolerance_m, to.0 > tolerance_m);
            if was_closed != is_closed {
                let overlap = Cubic::new(&self.from, &self.to, from, to);
                let fraction = crossing(|s| overlap.value(s) > tolerance_m);
                events.push(self.event(if is_closed { closes } else { opens }, fraction));
            }
        }
    }

    fn turn(&self) -> Option<Event> {
        let turned = self.from.heads_right.zip(self.to.heads_right).is_some_and(|(from, to)| from != to);
        if !turned || !self.to.has_moved {
            return None;
        }
        let displacement = self.displacement();
        // a bead that stood still in the frame before turned there
        let stood = self.from.v_m_s == 0.0;
        let fraction = if stood { 0.0 } else { crossing(|s| displacement.slope(s) > 0.0) };
        Some(self.event(EventKind::Turns, fraction))
    }
}

/// The cubic through two values with their rates of change (Hermite), over the fraction 0…1 of the
/// time between them; its error is of fourth order in that time.
struct Cubic {
    values: (f64, f64),
    /// Rates of change for the whole interval.
    slopes: (f64, f64),
}

impl Cubic {
    fn new(from: &Sample, to: &Sample, start: (f64, f64), end: (f64, f64)) -> Self {
        let interval_s = to.time_s - from.time_s;
        Self { values: (start.0, end.0), slopes: (start.1 * interval_s, end.1 * interval_s) }
    }

    fn value(&self, s: f64) -> f64 {
        let ((y0, y1), (m0, m1)) = (self.values, self.slopes);
        let r = 1.0 - s;
        y0 * (1.0 + 2.0 * s) * r * r + y1 * s * s * (3.0 - 2.0 * s) + s * r * (m0 * r - m1 * s)
    }

    fn slope(&self, s: f64) -> f64 {
        let ((y0, y1), (m0, m1)) = (self.values, self.slopes);
        let r = 1.0 - s;
        6.0 * s * r * (y1 - y0) + m0 * r * (1.0 - 3.0 * s) + m1 * s * (3.0 * s - 2.0)
    }
}

/// Place between 0 and 1 at which `side` changes, by bisection to the last bit that matters.
fn crossing(side: impl Fn(f64) -> bool) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    let at_start = side(low);
    for _ in 0..52 {
        let middle = 0.5 * (low + high);
        if side(middle) == at_start {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::manifest::Origin;
    use schemas::presets::PRESETS;

    fn frame<'a>(step: u64, time_s: f64, u_m: &'a [f64], v_m_s: &'a [f64]) -> Frame<'a> {
        Frame { frame: step, step, time_s, u_m, v_m_s, extra: &[], active: None }
    }

    fn followed(beads: &[u64]) -> Followed {
        let mut config = PRESETS[2].config();
        config.chain.beads = 3;
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        Followed::new(&RunManifest::new(&config, "run", origin).expect("valid"), beads)
    }

    /// Bead 1 moves freely at +2 m/s from a gap of 1 m to a wall-like bead 2 at rest: it closes after
    /// 0.5 s, however the frames fall.
    #[test]
    fn a_contact_closes_between_the_frames() {
        let mut followed = followed(&[1]);
        followed.observe(&frame(0, 0.0, &[0.0, -1.0, 0.0], &[0.0, 2.0, 0.0]));
        let (motions, events) = followed.observe(&frame(1, 0.8, &[0.0, 0.6, 0.0], &[0.0, 2.0, 0.0]));
        let [left_opens, right_closes] = events else { panic!("{events:?}") };
        assert_eq!((left_opens.kind, right_closes.kind), (EventKind::LeftOpens, EventKind::RightCloses));
        // the tolerance is 3.6e-10 m, which the bead crosses in 1.8e-10 s
        assert!((right_closes.time_s - 0.5).abs() < 1e-9 && right_closes.u_m.abs() < 1e-9);
        assert_eq!(motions[0].overlap_right_m, 0.6);
    }

    /// u = t − t² turns at t = 1/2, u = 1/4; a cubic holds it exactly.
    #[test]
    fn a_turning_point_is_where_the_velocity_vanishes() {
        let mut followed = followed(&[0, 1]);
        followed.observe(&frame(0, 0.3, &[0.0, 0.21, 0.0], &[0.0, 0.4, 0.0]));
        let (_, events) = followed.observe(&frame(1, 0.9, &[0.0, 0.09, 0.0], &[0.0, -0.8, 0.0]));
        let turns: Vec<_> = events.iter().filter(|event| event.kind == EventKind::Turns).collect();
        let [turn] = turns[..] else { panic!("{events:?}") };
        assert_eq!(turn.bead, 1);
        assert!((turn.time_s - 0.5).abs() < 1e-15 && (turn.u_m - 0.25).abs() < 1e-15);
    }

    #[test]
    fn a_bead_that_stands_still_in_a_frame_turns_there() {
        let mut followed = followed(&[1]);
        let frames = [(0.0, 0.0, 1.0), (1.0, 0.5, 0.0), (2.0, 0.0, -1.0)];
        let mut turns = Vec::new();
        for (step, (t, u, v)) in (0..).zip(frames) {
            let (u_m, v_m_s) = ([0.0, u, 0.0], [0.0, v, 0.0]);
            let (_, events) = followed.observe(&frame(step, t, &u_m, &v_m_s));
            turns.extend(events.iter().filter(|event| event.kind == EventKind::Turns).copied());
        }
        assert_eq!(turns, [Event { bead: 1, kind: EventKind::Turns, time_s: 1.0, u_m: 0.5 }]);
    }

    #[test]
    fn nothing_is_interpolated_across_a_gap() {
        let mut followed = followed(&[1]);
        followed.observe(&frame(0, 0.0, &[0.0, -1.0, 0.0], &[0.0, 2.0, 0.0]));
        followed.gap();
        let (_, events) = followed.observe(&frame(9, 0.8, &[0.0, 0.6, 0.0], &[0.0, -2.0, 0.0]));
        assert!(events.is_empty());
    }

    #[test]
    fn beads_at_the_ends_have_one_neighbour() {
        let mut followed = followed(&[0, 2]);
        let (motions, _) = followed.observe(&frame(0, 0.0, &[3.0, 2.0, 0.0], &[0.0; 3]));
        assert!(motions[0].overlap_left_m.is_nan() && motions[1].overlap_right_m.is_nan());
        assert_eq!((motions[0].overlap_right_m, motions[1].overlap_left_m), (1.0, 2.0));
    }

    #[test]
    fn a_wall_is_the_neighbour_of_an_end_bead() {
        let mut config = PRESETS[2].config();
        config.chain.beads = 3;
        config.ends.right = schemas::config::End::Fixed;
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let mut followed = Followed::new(&RunManifest::new(&config, "run", origin).expect("valid"), &[0, 2]);
        // bead 2 comes at 2 m/s from a gap of 1 m to the wall, which closes after 0.5 s
        followed.observe(&frame(0, 0.0, &[0.0, 0.0, -1.0], &[0.0, 0.0, 2.0]));
        let (motions, events) = followed.observe(&frame(1, 0.8, &[0.0, 0.0, 0.6], &[0.0, 0.0, 2.0]));
        assert!(motions[0].overlap_left_m.is_nan());
        assert_eq!(motions[1].overlap_right_m, 0.6);
        let closing: Vec<_> = events.iter().filter(|event| event.kind == EventKind::RightCloses).collect();
        assert!(matches!(closing[..], [event] if (event.time_s - 0.5).abs() < 1e-9), "{events:?}");
    }
}
