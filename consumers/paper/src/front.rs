//! The leading pulse: its crest and its width.
//!
//! [`consumers::pulses`] looks at each bead over time, and needs frames as dense as the pulse is short. Over the 15000
//! beads that a pulse takes to become stationary near α = 1 that would be gigabytes; but there the pulse is
//! many beads long, and one frame shows its shape in space.

use consumers::pulses::Happening;
use schemas::frame::Frame;

/// The leading pulse in one frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Front {
    /// Time (s).
    pub time_s: f64,
    /// Position of its crest (beads), between two beads.
    pub bead: f64,
    /// The velocity there (m/s).
    pub v_max_m_s: f64,
    /// Full width (beads) at half of that.
    pub fwhm_beads: f64,
    /// `(a − b)/(a + b)` of the distances from the crest to half of it, a behind and b before: 0 for a symmetric pulse.
    pub asymmetry: f64,
}

/// Beads from which one place is interpolated. The error at the crest of a pulse of the standard deviation σ (beads)
/// falls as σ^(−9): it is 4e-6 of the height at most for σ = 2.95, the pulse of α = 1.02.
const NODES: usize = 9;

impl Front {
    /// The pulse of the largest velocity in `frame`; none if it has not left the struck end, or is as wide as the
    /// chain.
    pub(super) fn in_space(frame: &Frame<'_>) -> Option<Self> {
        let v = frame.v_m_s;
        let top = (0..v.len()).max_by(|a, b| v[*a].total_cmp(&v[*b]))?;
        if top < 2 * NODES || v[top] <= 0.0 {
            return None;
        }
        let (bead, v_max_m_s) = crest(v, top)?;
        let half = 0.5 * v_max_m_s;
        let behind = (0..top).rev().find(|bead| v[*bead] < half)?;
        let before = (top..v.len()).find(|bead| v[*bead] < half)?;
        let from = crossing(v, behind, half)?;
        let to = crossing(v, before - 1, half)?;
        let fwhm_beads = to - from;
        let asymmetry = ((bead - from) - (to - bead)) / fwhm_beads;
        Some(Self { time_s: frame.time_s, bead, v_max_m_s, fwhm_beads, asymmetry })
    }

    /// The first pulse of a run as it passes a bead, if it does.
    pub(super) fn in_time(happening: &Happening) -> Option<Self> {
        let Happening::Passed(point) = happening else { return None };
        let shape = point.shape.filter(|_| point.pulse == 1)?;
        Some(Self {
            time_s: point.time_s,
            bead: point.bead as f64,
            v_max_m_s: point.v_peak_m_s,
            fwhm_beads: shape.fwhm_beads,
            asymmetry: shape.asymmetry,
        })
    }
}

/// Place and height of the maximum within a bead of `top`, by golden sections.
fn crest(v: &[f64], top: usize) -> Option<(f64, f64)> {
    let window = window(v, top)?;
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = (top as f64 - 1.0, top as f64 + 1.0);
    // 2·0.618^40 beads: 1e-8, whose square is the error of the height
    for _ in 0..40 {
        let (a, b) = (high - golden * (high - low), low + golden * (high - low));
        if window.at(a) > window.at(b) { high = b } else { low = a }
    }
    let place = 0.5 * (low + high);
    Some((place, window.at(place)))
}

/// Position between `bead` and the next at which the velocity passes `level`, by bisection.
fn crossing(v: &[f64], bead: usize, level: f64) -> Option<f64> {
    let window = window(v, bead)?;
    let (mut low, mut high) = (bead as f64, bead as f64 + 1.0);
    let below = window.at(low) < level;
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if (window.at(middle) < level) == below { low = middle } else { high = middle }
    }
    Some(0.5 * (low + high))
}

/// The polynomial through the beads around a place.
struct Window<'a> {
    first: usize,
    v: &'a [f64],
}

/// The window around `bead`, if the chain goes that far.
fn window(v: &[f64], bead: usize) -> Option<Window<'_>> {
    let first = bead.checked_sub(NODES / 2)?;
    Some(Window { first, v: v.get(first..first + NODES)? })
}

impl Window<'_> {
    /// Barycentric interpolation at equidistant nodes, with the binomial coefficients as weights.
    fn at(&self, place: f64) -> f64 {
        const WEIGHTS: [f64; NODES] = [1.0, -8.0, 28.0, -56.0, 70.0, -56.0, 28.0, -8.0, 1.0];
        let (mut above, mut below) = (0.0, 0.0);
        for (node, (weight, v)) in WEIGHTS.iter().zip(self.v).enumerate() {
            let distance = place - (self.first + node) as f64;
            if distance == 0.0 {
                return *v;
            }
            above += weight / distance * v;
            below += weight / distance;
        }
        above / below
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pulse of that shape, a function of the distance (beads) ahead of its crest, with its crest at `centre`.
    fn measured(centre: f64, shape: impl Fn(f64) -> f64) -> Front {
        let v_m_s: Vec<f64> = (0..100).map(|bead| 1.7 * shape(f64::from(bead) - centre)).collect();
        let u_m = vec![0.0; 100];
        let frame =
            Frame { frame: 0, step: 0, time_s: 0.5, u_m: &u_m, v_m_s: &v_m_s, extra: &[], active: None };
        Front::in_space(&frame).unwrap()
    }

    /// A Gaussian as wide as the pulse of α = 1.02, wherever it lies between the beads.
    #[test]
    fn a_gaussian_is_measured_between_the_beads() {
        let sigma = 2.95_f64;
        let fwhm = 2.0 * (2.0 * std::f64::consts::LN_2).sqrt() * sigma;
        for tenth in 0..10 {
            let centre = 60.0 + 0.1 * f64::from(tenth);
            let found = measured(centre, |x| (-0.5 * (x / sigma).powi(2)).exp());
            // what `NODES` promises of the height; the error of the slope, as large, puts the crest off by that
            // over the curvature 1/σ²
            assert!((found.v_max_m_s / 1.7 - 1.0).abs() < 4e-6, "{found:?}");
            let off = (found.bead - centre, found.fwhm_beads / fwhm - 1.0, found.asymmetry);
            assert!(off.0.abs() < 3e-5 && off.1.abs() < 1e-5 && off.2.abs() < 1e-5, "{off:?}");
        }
    }

    /// `exp(1 − z − e^(−z))` is half its height at z = −0.98520 and 1.46119: with z growing behind the crest, that is
    /// an asymmetry of 0.19457.
    #[test]
    fn a_long_tail_is_asymmetric() {
        let found = measured(60.3, |x| {
            let z = -x / 4.0;
            (1.0 - z - (-z).exp()).exp()
        });
        assert!((found.asymmetry - 0.19457).abs() < 1e-4, "{found:?}");
    }

    #[test]
    fn a_pulse_at_the_struck_end_is_none_yet() {
        let frame = Frame {
            frame: 0,
            step: 0,
            time_s: 0.0,
            u_m: &[0.0; 50],
            v_m_s: &[5.0; 50],
            extra: &[],
            active: None,
        };
        assert_eq!(Front::in_space(&frame), None);
    }
}
