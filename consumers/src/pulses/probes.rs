//! Pulses that pass a bead: when, how fast the bead then moves, and how fast the pulse travels.

use super::surroundings::Surroundings;
use super::track::{Point, REACH};
use super::{Happening, Pulses};
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use std::sync::Arc;

/// A pulse that has passed a probe bead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Passage {
    /// The probe bead.
    pub bead: u64,
    /// Time (s) at which the bead moves fastest, interpolated.
    pub time_s: f64,
    /// The velocity of the bead then (m/s), interpolated; its sign is the pulse's direction.
    pub v_peak_m_s: f64,
    /// Speed of the pulse (beads/s) over the [`Passage::BASELINE`] beads around the probe.
    pub speed_beads_per_s: f64,
}

impl Passage {
    /// The speed is measured between the beads this far before and behind the probe.
    pub const BASELINE: u64 = Pulses::REACH;
}

/// Watches pulses pass some probe beads of one run: those that [`Pulses`] finds among the beads around each.
#[derive(Debug, Clone)]
pub struct Probes {
    probes: Vec<Probe>,
    passages: Vec<Passage>,
}

#[derive(Debug, Clone)]
struct Probe {
    bead: u64,
    pulses: Pulses,
}

/// Beads on either side of a probe: a pulse is one, and has a speed, when it comes to the probe and when it has left.
const AROUND: usize = 2 * REACH;

impl Probes {
    /// Probes at `beads` of `manifest`'s run, each at least [`Passage::BASELINE`] beads from the ends. Pulses count
    /// whose peaks are above a thousandth of the striker's speed.
    pub fn new(manifest: &RunManifest, beads: &[u64]) -> Self {
        let threshold_m_s = Pulses::DEFAULT_THRESHOLD * Pulses::velocity_scale_m_s(manifest);
        let around = Arc::new(Surroundings::of(manifest));
        let count = around.chain.bead_count();
        let probe = |bead: &u64| {
            let at = usize::try_from(*bead).unwrap_or(usize::MAX).min(count - 1);
            let beads = at.saturating_sub(AROUND)..(at + AROUND + 1).min(count);
            Probe { bead: *bead, pulses: Pulses::among(Arc::clone(&around), threshold_m_s, beads) }
        };
        Self { probes: beads.iter().map(probe).collect(), passages: Vec::new() }
    }

    /// Looks at the next frame.
    pub fn observe(&mut self, frame: &Frame<'_>) {
        for Probe { bead, pulses } in &mut self.probes {
            self.passages.extend(passed(pulses.observe(frame), *bead));
        }
    }

    /// Forgets the frames before: no peak is interpolated across a gap.
    pub fn gap(&mut self) {
        self.probes.iter_mut().for_each(|probe| probe.pulses.gap());
    }

    /// The pulses that have passed each probe, in the order of arrival. The speed of one that has not come
    /// [`Passage::BASELINE`] beads farther is measured over as many as it has, or a bead before.
    pub fn passages(&self) -> Vec<Passage> {
        let mut passages = self.passages.clone();
        for Probe { bead, pulses } in &self.probes {
            let mut under_way = pulses.clone();
            passages.extend(passed(under_way.finish(), *bead));
        }
        passages.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        passages
    }
}

/// The pulses that pass `bead` among the `happenings`.
fn passed(happenings: &[Happening], bead: u64) -> Vec<Passage> {
    let mut passages = Vec::new();
    let mut before: Option<&Point> = None;
    for happening in happenings {
        let Happening::Passed(point) = happening else { continue };
        let of_before = before.filter(|before| before.pulse == point.pulse);
        let speed = point.speed_beads_per_s.or_else(|| of_before?.speed_beads_per_s);
        if let Some(speed_beads_per_s) = speed.filter(|_| point.bead == bead) {
            let Point { time_s, v_peak_m_s, .. } = *point;
            passages.push(Passage { bead, time_s, v_peak_m_s, speed_beads_per_s });
        }
        before = Some(point);
    }
    passages
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::manifest::Origin;
    use schemas::presets::PRESETS;

    /// A bump of fixed shape that moves at 4000 beads/s to the left passes bead 50.
    #[test]
    fn a_moving_bump_is_measured() {
        let mut config = PRESETS[2].config();
        config.chain.beads = 100;
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let m = RunManifest::new(&config, "run", origin).expect("valid");
        let mut probes = Probes::new(&m, &[50]);
        for step in 0..1000_u32 {
            let time_s = f64::from(step) * 2.5e-5;
            let v_m_s: Vec<f64> = (0..100_u32)
                .map(|bead| {
                    let x = (f64::from(bead) - (90.0 - 4000.0 * time_s)) / 5.0;
                    -2.0 * (-x * x).exp()
                })
                .collect();
            let u_m: Vec<f64> = (0..100_u32).map(|bead| -1e-6 * f64::from(bead)).collect();
            let step = u64::from(step);
            probes.observe(&Frame {
                frame: step,
                step,
                time_s,
                u_m: &u_m,
                v_m_s: &v_m_s,
                extra: &[],
                active: None,
            });
        }
        let passages = probes.passages();
        let [passage] = passages[..] else { panic!("{passages:?}") };
        // steps of a 50th of the width: the quartic is off by far less than 1e-6
        assert!((passage.v_peak_m_s + 2.0).abs() < 1e-6 && (passage.time_s - 0.01).abs() < 1e-8);
        assert!((passage.speed_beads_per_s - 4000.0).abs() < 1e-3);
    }
}
