//! Pulses found in made-up frames, whose answers are known.

use consumers::pulses::{Birth, Counts, Direction, Fate, Happening, Point, Pulse, Pulses, Unfollowed};
use schemas::frame::Frame;
use schemas::manifest::{Origin, RunManifest};
use schemas::presets::PRESETS;

const BEADS: u16 = 200;
const THRESHOLD_M_S: f64 = 5e-3;

fn manifest() -> RunManifest {
    let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
    RunManifest::new(&PRESETS[2].config(), "run", origin).expect("a preset is valid")
}

/// A bump of velocity that travels, `e^(−x²/2σ²)` with another σ ahead of its crest than behind.
#[derive(Clone, Copy)]
struct Bump {
    v_m_s: f64,
    start: f64,
    beads_per_s: f64,
    ahead_sigma: f64,
    behind_sigma: f64,
}

impl Bump {
    /// In the direction in which its beads move, as in a chain without load.
    fn new(v_m_s: f64, start: f64, beads_per_s: f64) -> Self {
        Self { v_m_s, start, beads_per_s, ahead_sigma: 1.5, behind_sigma: 1.5 }
    }

    fn at(&self, bead: f64, time_s: f64) -> f64 {
        let x = (bead - self.start - self.beads_per_s * time_s) * self.beads_per_s.signum();
        let sigma = if x > 0.0 { self.ahead_sigma } else { self.behind_sigma };
        self.v_m_s * (-0.5 * (x / sigma).powi(2)).exp()
    }
}

#[derive(Default)]
struct Seen {
    pulses: Vec<Pulse>,
    points: Vec<Point>,
    unfollowed: Vec<Unfollowed>,
    counts: Counts,
}

/// Shows the sum of `bumps` in the frames `steps`, each 10 µs apart; an empty step is a gap. The contacts are
/// pressed or, with `loose`, open.
fn look(bumps: &[Bump], steps: impl IntoIterator<Item = Option<u32>>, loose: bool) -> Seen {
    let mut analysis = Pulses::new(&manifest(), THRESHOLD_M_S);
    let slope_m = if loose { 1e-6 } else { -1e-6 };
    let u_m: Vec<f64> = (0..BEADS).map(|bead| slope_m * f64::from(bead)).collect();
    let mut found = Seen::default();
    let mut take = |happenings: &[Happening]| {
        for happening in happenings {
            match happening {
                Happening::Passed(point) => found.points.push(*point),
                Happening::Ended(pulse) => found.pulses.push(*pulse),
            }
        }
    };
    for step in steps {
        let Some(step) = step else {
            analysis.gap();
            continue;
        };
        let time_s = 1e-5 * f64::from(step);
        let v_at = |bead| bumps.iter().map(|bump| bump.at(f64::from(bead), time_s)).sum();
        let v_m_s: Vec<f64> = (0..BEADS).map(v_at).collect();
        let step = u64::from(step);
        take(analysis.observe(&Frame {
            frame: step,
            step,
            time_s,
            u_m: &u_m,
            v_m_s: &v_m_s,
            extra: &[],
            active: None,
        }));
    }
    take(analysis.finish());
    found.counts = analysis.counts();
    found.unfollowed = analysis.unfollowed().to_vec();
    found
}

fn steps(range: std::ops::Range<u32>) -> impl Iterator<Item = Option<u32>> {
    range.map(Some)
}

#[test]
fn a_bump_is_measured_at_every_bead() {
    for sign in [1.0, -1.0] {
        let start = if sign > 0.0 { 20.0 } else { 180.0 };
        let found = look(&[Bump::new(2.0 * sign, start, 4000.0 * sign)], steps(0..4000), false);
        let [pulse] = found.pulses[..] else { panic!("{:?}", found.pulses) };
        assert_eq!(pulse.direction, if sign > 0.0 { Direction::Forward } else { Direction::Backward });
        assert_eq!(pulse.fate, Fate::UnderWay);
        let point = pulse.measured.point;
        // the quartic through frames of 1/88 of the width is off by (1/37)⁶ of it at most
        assert!((point.v_peak_m_s - 2.0 * sign).abs() < 1e-9, "{point:?}");
        assert!((point.speed_beads_per_s.unwrap() - 4000.0).abs() < 1e-4, "{point:?}");
        let shape = point.shape.unwrap();
        // FWHM of a Gaussian: 2·√(2 ln 2)·σ
        assert!((shape.fwhm_beads - 2.354_820_045 * 1.5).abs() < 1e-5, "{shape:?}");
        assert!(shape.asymmetry.abs() < 1e-5, "{shape:?}");
        // a row for each bead, none twice
        let beads: Vec<u64> = found.points.iter().map(|point| point.bead).collect();
        assert!(
            beads.windows(2).all(|pair| pair[0].abs_diff(pair[1]) == 1) && beads.len() > 150,
            "{beads:?}"
        );
    }
}

#[test]
fn a_bump_that_trails_off_behind_has_a_positive_asymmetry() {
    let bump = Bump { ahead_sigma: 1.0, behind_sigma: 3.0, ..Bump::new(1.0, 20.0, 4000.0) };
    let found = look(&[bump], steps(0..3000), false);
    let shape = found.pulses[0].measured.point.shape.unwrap();
    // half widths in the ratio of the σ; the kink of the curvature at the crest shifts the interpolated peak by
    // at most a frame, 0.04 of 4.7 beads
    assert!((shape.asymmetry - 0.5).abs() < 0.01, "{shape:?}");
}

#[test]
fn pulses_that_meet_head_on_are_followed_through_each_other() {
    for other in [-2.0, -0.7] {
        let bumps = [Bump::new(2.0, 20.0, 4000.0), Bump::new(other, 180.0, -4000.0)];
        let found = look(&bumps, steps(0..3600), false);
        let [a, b] = found.pulses[..] else { panic!("{:?}", found.pulses) };
        assert_eq!((a.fate, b.fate), (Fate::UnderWay, Fate::UnderWay));
        // both from one side of the other's beginning to the other
        assert!(a.birth_bead.abs_diff(a.end_bead) > 130 && b.birth_bead.abs_diff(b.end_bead) > 130);
        assert!((b.measured.point.v_peak_m_s - other).abs() < 1e-6, "{b:?}");
    }
}

#[test]
fn a_train_that_comes_apart_has_as_many_pulses_as_crests() {
    // 4 beads apart at first: the valley between them is above half of the second peak
    let bumps = [Bump::new(2.0, 24.0, 4400.0), Bump::new(1.5, 20.0, 4200.0), Bump::new(1.0, 16.0, 4000.0)];
    let found = look(&bumps, steps(0..3500), false);
    assert_eq!(found.pulses.len(), 3, "{:?}", found.pulses);
    for (pulse, bump) in found.pulses.iter().zip(&bumps) {
        let point = pulse.measured.point;
        assert!((point.v_peak_m_s - bump.v_m_s).abs() < 1e-3, "{point:?}");
        assert!((point.shape.unwrap().fwhm_beads - 3.532).abs() < 0.02, "{point:?}");
    }
}

#[test]
fn loose_beads_are_no_pulses_however_they_move() {
    let found = look(&[Bump::new(2.0, 20.0, 4000.0)], steps(0..3000), true);
    assert!(found.points.is_empty() && found.pulses.is_empty());
}

#[test]
fn what_moves_against_its_beads_is_no_pulse_in_a_chain_without_load() {
    let found = look(&[Bump::new(-2.0, 20.0, 4000.0)], steps(0..3000), false);
    assert!(found.pulses.is_empty(), "{:?}", found.pulses);
}

#[test]
fn a_pulse_is_taken_up_after_a_short_gap_and_counted_anew_after_a_long_one() {
    let bump = Bump::new(2.0, 20.0, 4000.0);
    // 100 steps are 4 beads, 1500 are 60
    let short = look(&[bump], steps(0..1000).chain([None]).chain(steps(1100..3500)), false);
    assert_eq!(short.pulses.len(), 1, "{:?}", short.pulses);
    let skipped: Vec<_> = short.points.windows(2).filter(|pair| pair[1].bead > pair[0].bead + 1).collect();
    assert_eq!(skipped.len(), 1, "nothing is interpolated across the gap");
    let long = look(&[bump], steps(0..1000).chain([None]).chain(steps(2500..3500)), false);
    let [before, after] = long.pulses[..] else { panic!("{:?}", long.pulses) };
    assert_eq!((before.fate, after.birth), (Fate::Gap, Birth::UnderWay));
}

#[test]
fn frames_too_far_apart_give_no_invented_pulses() {
    // the bump passes within 88 steps
    let fine = look(&[Bump::new(2.0, 20.0, 4000.0)], (0..3500).step_by(10).map(Some), false);
    assert_eq!((fine.pulses.len(), fine.counts.coarse_crests), (1, 0));
    assert!((fine.pulses[0].measured.point.v_peak_m_s - 2.0).abs() < 2e-4);
    let coarse = look(&[Bump::new(2.0, 20.0, 4000.0)], (0..3500).step_by(100).map(Some), false);
    assert_eq!((coarse.pulses.len(), coarse.counts.longest_interval_steps), (0, 100));
}

/// Frames 44 steps apart show a bump that passes in 88 too coarsely for a crest; that something passed is seen.
#[test]
fn what_no_pulse_follows_is_told() {
    for sign in [1.0, -1.0] {
        let bump = Bump::new(2.0 * sign, 100.0 - 80.0 * sign, 4000.0 * sign);
        let found = look(&[bump], (0..3500).step_by(44).map(Some), false);
        assert!(found.pulses.is_empty() && found.counts.unresolved_crests > 0, "{:?}", found.counts);
        let [passed] = found.unfollowed[..] else { panic!("{:?}", found.unfollowed) };
        assert_eq!((found.counts.unfollowed, passed.leads), (1, true));
        let beads = passed.beads.map(|bead| bead as f64);
        assert!((beads[1] - beads[0]) * sign > 100.0, "{passed:?}");
        assert!((passed.v_peak_m_s * sign - 2.0).abs() < 0.1, "{passed:?}");
        // 4000 beads/s, by frames of two beads
        let speed = (beads[1] - beads[0]) / (passed.times_s[1] - passed.times_s[0]);
        assert!((speed / (4000.0 * sign) - 1.0).abs() < 0.02, "{passed:?}");
    }
}

#[test]
fn what_is_followed_or_loose_or_stays_is_not_told_of() {
    let pulse = Bump::new(2.0, 20.0, 4000.0);
    assert_eq!(look(&[pulse], steps(0..3500), false).unfollowed, []);
    assert_eq!(look(&[pulse], (0..3500).step_by(44).map(Some), true).unfollowed, []);
    assert_eq!(look(&[pulse, Bump::new(-0.7, 180.0, -4000.0)], steps(0..3600), false).unfollowed, []);
    // still on its way when the frames end
    assert_eq!(look(&[Bump { ahead_sigma: 30.0, ..pulse }], steps(0..1000), false).unfollowed, []);
}
