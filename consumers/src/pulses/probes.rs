//! Pulses that pass a bead: when, how fast the bead then moves, and how fast the pulse travels.

use schemas::frame::Frame;
use schemas::manifest::RunManifest;

/// A pulse that has passed a probe bead.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Passage {
    /// The probe bead.
    pub bead: u64,
    /// When the bead moves fastest (s), interpolated.
    pub time_s: f64,
    /// The velocity of the bead then (m/s), interpolated; its sign is the pulse's direction.
    pub v_peak_m_s: f64,
    /// Speed of the pulse (beads/s) over the [`Passage::BASELINE`] beads around the probe.
    pub speed_beads_per_s: f64,
}

impl Passage {
    /// The speed is measured between the beads this far before and behind the probe.
    pub const BASELINE: u64 = 5;
}

/// Watches pulses pass some probe beads of one run.
#[derive(Debug, Clone)]
pub struct Probes {
    probes: Vec<Probe>,
}

#[derive(Debug, Clone)]
struct Probe {
    bead: u64,
    /// The probe and the beads [`Passage::BASELINE`] before and behind it.
    gauges: [Gauge; 3],
}

/// Peaks of |v| at one bead.
#[derive(Debug, Clone)]
struct Gauge {
    bead: usize,
    threshold_m_s: f64,
    /// The two frames before: time (s) and velocity (m/s).
    before: [Option<(f64, f64)>; 2],
    /// Peaks: time (s) and velocity (m/s).
    peaks: Vec<(f64, f64)>,
}

impl Probes {
    /// Probes at `beads` of `manifest`'s run, each at least [`Passage::BASELINE`] beads from the ends. A
    /// maximum of |v| counts as a pulse if it is above a thousandth of the striker's speed.
    pub fn new(manifest: &RunManifest, beads: &[u64]) -> Self {
        let threshold_m_s = 1e-3 * manifest.physics.striker.velocity_m_s.abs();
        let last = manifest.physics.beads - 1;
        let gauge = |bead: u64| Gauge {
            bead: usize::try_from(bead.min(last)).unwrap_or(usize::MAX),
            threshold_m_s,
            before: [None; 2],
            peaks: Vec::new(),
        };
        let probe = |bead: &u64| Probe {
            bead: *bead,
            gauges: [
                gauge(bead.saturating_sub(Passage::BASELINE)),
                gauge(*bead),
                gauge(bead + Passage::BASELINE),
            ],
        };
        Self { probes: beads.iter().map(probe).collect() }
    }

    /// Looks at the next frame.
    pub fn observe(&mut self, frame: &Frame<'_>) {
        let gauges = self.probes.iter_mut().flat_map(|probe| &mut probe.gauges);
        gauges.for_each(|gauge| gauge.push(frame.time_s, frame.v_m_s[gauge.bead]));
    }

    /// Forgets the frames before: no peak is interpolated across a gap.
    pub fn gap(&mut self) {
        let gauges = self.probes.iter_mut().flat_map(|probe| &mut probe.gauges);
        gauges.for_each(|gauge| gauge.before = [None; 2]);
    }

    /// The pulses that have passed all three gauges of each probe, in the order of arrival.
    pub fn passages(&self) -> Vec<Passage> {
        let mut passages: Vec<_> = self.probes.iter().flat_map(Probe::passages).collect();
        passages.sort_by(|a, b| a.time_s.total_cmp(&b.time_s));
        passages
    }
}

impl Probe {
    fn passages(&self) -> Vec<Passage> {
        let [before, at, behind] = &self.gauges;
        let mut passages = Vec::new();
        for forward in [true, false] {
            let of = |gauge: &Gauge| -> Vec<(f64, f64)> {
                gauge.peaks.iter().copied().filter(|(_, v)| (*v > 0.0) == forward).collect()
            };
            // the n-th pulse of a direction at one gauge is the n-th at the others, because pulses
            // of one direction never overtake within a few beads
            let (before, at, behind) = (of(before), of(at), of(behind));
            for ((start, peak), end) in before.iter().zip(&at).zip(&behind) {
                let beads = (self.gauges[2].bead - self.gauges[0].bead) as f64;
                passages.push(Passage {
                    bead: self.bead,
                    time_s: peak.0,
                    v_peak_m_s: peak.1,
                    speed_beads_per_s: beads / (end.0 - start.0).abs(),
                });
            }
        }
        passages
    }
}

impl Gauge {
    fn push(&mut self, time_s: f64, v_m_s: f64) {
        if let [Some(first), Some(middle)] = self.before {
            let rises = middle.1.abs() > first.1.abs() && middle.1.abs() >= v_m_s.abs();
            if rises && middle.1.abs() > self.threshold_m_s {
                self.peaks.push(peak(first, middle, (time_s, v_m_s)));
            }
        }
        self.before = [self.before[1], Some((time_s, v_m_s))];
    }
}

/// The extremum of the parabola through three points `(t, v)`.
fn peak(first: (f64, f64), middle: (f64, f64), last: (f64, f64)) -> (f64, f64) {
    let (left, right) = (middle.0 - first.0, last.0 - middle.0);
    let rise = (middle.1 - first.1) / left;
    let fall = (last.1 - middle.1) / right;
    let curvature = (fall - rise) / (left + right);
    if curvature == 0.0 {
        return middle;
    }
    // v(t) = v_m + slope·(t − t_m) + curvature·(t − t_m)²
    let slope = rise + curvature * left;
    let shift = -slope / (2.0 * curvature);
    (middle.0 + shift, middle.1 + 0.5 * slope * shift)
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::manifest::Origin;
    use schemas::presets::PRESETS;

    #[test]
    fn a_parabola_is_found_exactly() {
        let v = |t: f64| 3.0 - 2.0 * (t - 0.7) * (t - 0.7);
        let (t, v_peak) = peak((0.0, v(0.0)), (0.5, v(0.5)), (1.25, v(1.25)));
        assert!((t - 0.7).abs() < 1e-15 && (v_peak - 3.0).abs() < 1e-15);
    }

    /// A bump of fixed shape that moves at 1000 beads/s to the left passes bead 50.
    #[test]
    fn a_moving_bump_is_measured() {
        let mut config = PRESETS[2].config();
        config.chain.beads = 100;
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let m = RunManifest::new(&config, "run", origin).expect("valid");
        let mut probes = Probes::new(&m, &[50]);
        for step in 0..1000_u32 {
            let time_s = f64::from(step) * 1e-4;
            let v_m_s: Vec<f64> = (0..100_u32)
                .map(|bead| {
                    let x = (f64::from(bead) - (90.0 - 1000.0 * time_s)) / 5.0;
                    -2.0 * (-x * x).exp()
                })
                .collect();
            let u_m = vec![0.0; 100];
            let step = u64::from(step);
            probes.observe(&Frame { frame: step, step, time_s, u_m: &u_m, v_m_s: &v_m_s, extra: &[] });
        }
        let passages = probes.passages();
        let [passage] = passages[..] else { panic!("{passages:?}") };
        // steps of a 50th of the width: the parabola is off by (1/50)⁴/…, far below 1e-6
        assert!((passage.v_peak_m_s + 2.0).abs() < 1e-6 && (passage.time_s - 0.04).abs() < 1e-8);
        assert!((passage.speed_beads_per_s - 1000.0).abs() < 1e-3);
    }
}
