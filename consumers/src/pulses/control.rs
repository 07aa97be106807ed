//! Control of the tracker: disturbances that passed along the chain and are in no track.
//!
//! The tracker can be wrong about a chain that nobody thought of. The control looks at each bead alone, and remembers
//! its largest rise of speed since a pulse passed it last. Beads in a row whose rises no pulse explains, one after the
//! other in time, are a disturbance that was not followed.

use super::crest::History;
use super::found::{MATTERS, SHORTEST, Unfollowed};
use super::front::Front;
use super::surroundings::Surroundings;
use super::track::{Point, Track};
use super::{Direction, signed};
use schemas::active::Active;
use schemas::frame::Frame;

/// Steps between the frames that are looked at: there are five or more while a pulse passes.
const EVERY_STEPS: u64 = 8;

/// A rise matters that is this part of the largest speed where beads are not alike: behind every pulse comes a train of waves that are none.
const MATTERS_UNEVEN: f64 = 0.5;

/// And this many times the threshold: weaker ones may fall below it on their way.
const ABOVE_THRESHOLD: f64 = 2.0;

/// Remembers the rises that no pulse explains.
#[derive(Debug, Clone)]
pub(super) struct Control {
    threshold_m_s: f64,
    due_step: u64,
    /// Time (s) of the frame that was looked at last.
    seen_s: f64,
    /// The longest time (s) between two frames that were looked at.
    apart_s: f64,
    beads: Vec<Bead>,
    /// Those that may have moved in the frame that was looked at last, or that began anew since: others are known to rest.
    seen: Active,
    front: Front,
}

#[derive(Debug, Clone, Copy)]
struct Bead {
    /// The smallest speed (m/s) since a pulse passed.
    low_m_s: f64,
    /// The largest of all.
    largest_m_s: f64,
    /// The largest rise since a pulse passed.
    rise: Rise,
    /// The largest rise that no pulse explains.
    unexplained: Rise,
}

/// A rise of the speed of a bead.
#[expect(clippy::struct_field_names, reason = "they end with units")]
#[derive(Debug, Clone, Copy, Default)]
struct Rise {
    /// The rise (m/s).
    by_m_s: f64,
    /// Its velocity then (m/s).
    v_m_s: f64,
    /// The time (s).
    time_s: f64,
}

impl Control {
    pub(super) fn new(bead_count: usize, threshold_m_s: f64) -> Self {
        let bead = Bead {
            low_m_s: f64::INFINITY,
            largest_m_s: 0.0,
            rise: Rise::default(),
            unexplained: Rise::default(),
        };
        Self {
            threshold_m_s,
            due_step: 0,
            seen_s: f64::NAN,
            apart_s: 0.0,
            beads: vec![bead; bead_count],
            seen: Active::all(bead_count),
            front: Front::new(bead_count, ABOVE_THRESHOLD * threshold_m_s),
        }
    }

    /// Looks at the newest velocities in `history` if the frame is due, while the pulses `tracks` are under way.
    pub(super) fn observe(
        &mut self,
        around: &Surroundings,
        frame: &Frame<'_>,
        history: &History,
        tracks: &[Track],
    ) {
        if frame.step < self.due_step {
            return;
        }
        self.due_step = frame.step + EVERY_STEPS;
        // NaN where there was none before
        self.apart_s = self.apart_s.max(frame.time_s - self.seen_s);
        self.seen_s = frame.time_s;
        self.front.observe(around, frame, history, tracks);
        let moving = history.moving();
        let Active { first, end } = self.seen.renew(Active { first: moving.start, end: moving.end });
        let speeds = self.beads[first..end].iter_mut().zip(&history.v_m_s(0)[first..end]);
        for (number, (bead, v)) in (first..).zip(speeds) {
            let speed = v.abs();
            bead.low_m_s = bead.low_m_s.min(speed);
            bead.largest_m_s = bead.largest_m_s.max(speed);
            let by_m_s = speed - bead.low_m_s;
            if by_m_s > bead.rise.by_m_s && by_m_s > self.threshold_m_s && around.is_pressed(frame, number) {
                bead.rise = Rise { by_m_s, v_m_s: *v, time_s: frame.time_s };
            }
        }
    }

    /// The largest speed (m/s) that `bead` has had in the frames that were looked at.
    pub(super) fn largest_m_s(&self, bead: i64) -> f64 {
        let bead = usize::try_from(bead).ok().and_then(|bead| self.beads.get(bead));
        bead.map_or(0.0, |bead| bead.largest_m_s)
    }

    /// A pulse has passed a bead: velocities that rose there within `around_s` of it are explained.
    pub(super) fn explain(&mut self, point: &Point, around_s: f64) {
        let Ok(number) = usize::try_from(point.bead) else { return };
        let Some(bead) = self.beads.get_mut(number) else { return };
        if bead.rise.time_s < point.time_s - around_s {
            bead.keep_unexplained();
        }
        if bead.rise.time_s <= point.time_s + around_s {
            bead.begin();
            self.seen = self.seen.with(Active { first: number, end: number + 1 });
        }
    }

    /// Frames are missing, or there are no more: a speed that still rises has not passed yet.
    pub(super) fn gap(&mut self) {
        self.front.gap();
        for bead in &mut self.beads {
            if bead.rise.time_s < self.seen_s {
                bead.keep_unexplained();
            }
            bead.begin();
        }
        self.seen = Active::all(self.beads.len());
        self.seen_s = f64::NAN;
    }

    /// The disturbances that no pulse follows, the leading and then the strongest first.
    pub(super) fn unfollowed(&mut self, around: &Surroundings) -> Vec<Unfollowed> {
        self.gap();
        let mut found = Vec::new();
        for direction in [Direction::Forward, Direction::Backward] {
            let mut first = 0;
            while first < self.beads.len() {
                let next = self.end_of_run(around, first, direction);
                if next - first >= SHORTEST {
                    found.push(self.run(first, next, direction));
                }
                first = next.max(first + 1);
            }
        }
        // a rise everywhere at the same time does not travel
        found.retain(|found: &Unfollowed| found.times_s[0] < found.times_s[1]);
        let mut leading = self.front.unfollowed().to_vec();
        leading.retain(|front| self.is_strong(front));
        found.retain(|found| !leading.iter().any(|front| front.is_part(found)));
        found.extend(leading);
        let rank = |found: &Unfollowed| (found.leads, found.v_peak_m_s.abs());
        found.sort_by(|a, b| {
            let ((leads, speed), (other_leads, other_speed)) = (rank(a), rank(b));
            other_leads.cmp(&leads).then(other_speed.total_cmp(&speed))
        });
        found
    }

    /// True if the front that was not followed is more than a forerunner of a stronger wave.
    fn is_strong(&self, front: &Unfollowed) -> bool {
        let [low, high] = front.sorted_beads();
        let number = |bead: u64| usize::try_from(bead).unwrap_or_default();
        let largest = self.beads[number(low)..=number(high)].iter().map(|bead| bead.largest_m_s);
        front.v_peak_m_s.abs() > MATTERS * largest.fold(0.0, f64::max)
    }

    /// The bead behind the last one of the run in `direction` that `first` is the lowest bead of.
    fn end_of_run(&self, around: &Surroundings, first: usize, direction: Direction) -> usize {
        let counts = |number: usize, bead: &Bead| {
            let rise = &bead.unexplained;
            let matters = if around.is_uneven(number) { MATTERS_UNEVEN } else { MATTERS };
            // where nothing pulls beads move where the pulse goes
            let along = around.pulls || rise.v_m_s * direction.sign() as f64 > 0.0;
            let least_m_s = (ABOVE_THRESHOLD * self.threshold_m_s).max(matters * bead.largest_m_s);
            along && rise.by_m_s > least_m_s
        };
        if !counts(first, &self.beads[first]) {
            return first;
        }
        let mut next = first + 1;
        while let Some(bead) = self.beads.get(next).filter(|bead| counts(next, bead)) {
            let before = &self.beads[next - 1].unexplained;
            let took_s = (bead.unexplained.time_s - before.time_s) * direction.sign() as f64;
            // a rise is seen in the first frame that has it
            let longest_s = around.longest_step_s(signed(next as u64), bead.unexplained.v_m_s) + self.apart_s;
            if took_s < 0.0 || took_s > longest_s {
                break;
            }
            next += 1;
        }
        next
    }

    fn run(&self, first: usize, next: usize, direction: Direction) -> Unfollowed {
        let rises = self.beads[first..next].iter().map(|bead| bead.unexplained);
        let strongest = rises.max_by(|a, b| a.v_m_s.abs().total_cmp(&b.v_m_s.abs())).unwrap_or_default();
        let [from, to] = match direction {
            Direction::Forward => [first, next - 1],
            Direction::Backward => [next - 1, first],
        };
        Unfollowed {
            beads: [from as u64, to as u64],
            times_s: [from, to].map(|bead| self.beads[bead].unexplained.time_s),
            v_peak_m_s: strongest.v_m_s,
            leads: false,
        }
    }
}

impl Unfollowed {
    fn sorted_beads(&self) -> [u64; 2] {
        let [from, to] = self.beads;
        if from < to { [from, to] } else { [to, from] }
    }

    /// True if `other` is about the same beads and times.
    fn is_part(&self, other: &Self) -> bool {
        let ([low, high], [from, to]) = (self.sorted_beads(), other.sorted_beads());
        low <= to
            && from <= high
            && self.times_s[0] <= other.times_s[1]
            && other.times_s[0] <= self.times_s[1]
    }
}

impl Bead {
    fn keep_unexplained(&mut self) {
        if self.rise.by_m_s > self.unexplained.by_m_s {
            self.unexplained = self.rise;
        }
    }

    /// Forgets the rise so far: the next one is counted from here.
    fn begin(&mut self) {
        (self.low_m_s, self.rise) = (f64::INFINITY, Rise::default());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::manifest::{Origin, RunManifest};
    use schemas::philox::uniform;
    use schemas::presets::PRESETS;

    /// Also where a pulse is said to have passed beads that rest again by then, and frames are missing.
    #[test]
    fn beads_at_rest_need_not_be_visited() {
        let mut config = PRESETS[2].config();
        config.chain.beads = 40;
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let around = Surroundings::of(&RunManifest::new(&config, "run", origin).expect("valid"));
        let u_m: Vec<f64> = (0..40_u8).map(|bead| -1e-6 * f64::from(bead)).collect();
        let whole = (Control::new(40, 0.1), History::new(0..40));
        let (mut whole, mut within) = (whole.clone(), whole);
        let mut index = 0;
        let mut below = |count: u8| {
            index += 1;
            (0..count).rfind(|i| f64::from(*i) <= f64::from(count) * uniform(1, 0, index)).unwrap_or(0)
        };
        for step in (0..16_000).step_by(8) {
            let first = below(40);
            let moving = usize::from(first)..usize::from(first + below(41 - first));
            let speeds: Vec<f64> = (0..40).map(|_| f64::from(below(9)) - 4.0).collect();
            let v_m_s: Vec<f64> =
                (0..40).map(|bead| if moving.contains(&bead) { speeds[bead] } else { 0.0 }).collect();
            let time_s = step as f64;
            let frame =
                Frame { frame: step, step, time_s, u_m: &u_m, v_m_s: &v_m_s, extra: &[], active: None };
            let bead = u64::from(below(40));
            let has = [below(3), below(50)];
            let actives = [Active::all(40), Active { first: moving.start, end: moving.end }];
            for ((control, history), active) in [&mut whole, &mut within].into_iter().zip(actives) {
                history.push(time_s, active, |beads, to| to.copy_from_slice(&v_m_s[beads]));
                control.observe(&around, &frame, history, &[]);
                if has[0] == 0 {
                    let (v_peak_m_s, speed_beads_per_s, shape) = (1.0, None, None);
                    let point = Point { pulse: 1, bead, time_s, v_peak_m_s, speed_beads_per_s, shape };
                    control.explain(&point, 20.0);
                }
                if has[1] == 0 {
                    control.gap();
                }
            }
            let rises = |control: &Control| {
                let beads = control.beads.iter();
                format!("{:?}", beads.map(|bead| (bead.rise, bead.unexplained)).collect::<Vec<_>>())
            };
            assert_eq!(rises(&whole.0), rises(&within.0), "step {step}");
        }
    }
}
