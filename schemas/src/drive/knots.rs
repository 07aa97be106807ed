//! Knots: the times at which a waveform jumps, has a kink, or goes over into another formula.

use super::{Drive, Waveform};
use crate::functions::two_product;

impl Waveform {
    /// Knots (s) of the waveform, in no order.
    ///
    /// ```
    /// use schemas::drive::{Sine, Waveform};
    /// let sine = Sine { amplitude: 1.0, frequency_hz: 50.0, phase_rad: 0.0, ramp_s: 0.1, until_s: Some(0.5), ramp_down_s: 0.25 };
    /// assert_eq!(Waveform::Sine(sine).knots_s(), [0.1, 0.25, 0.5]);
    /// ```
    pub fn knots_s(&self) -> Vec<f64> {
        let ramps = |ramp_s: f64, until_s: Option<f64>, ramp_down_s: f64| {
            let down = until_s.filter(|_| ramp_down_s > 0.0).map(|until_s| until_s - ramp_down_s);
            Some(ramp_s).filter(|ramp_s| *ramp_s > 0.0).into_iter().chain(down).chain(until_s).collect()
        };
        match self {
            Self::Constant(_) | Self::Gaussian(_) | Self::Csv { .. } => Vec::new(),
            Self::Sine(sine) => ramps(sine.ramp_s, sine.until_s, sine.ramp_down_s),
            Self::Chirp(chirp) => ramps(chirp.ramp_s, Some(chirp.duration_s), chirp.ramp_down_s),
            Self::Step(step) => vec![step.at_s, step.at_s + step.rise_s],
            Self::Ramp(ramp) => vec![ramp.from_s, ramp.to_s],
            Self::HalfSine(half) => vec![half.at_s, half.at_s + half.duration_s],
            Self::Table(table) => table.times_s.clone(),
        }
    }
}

/// Knots of all `drives` after the beginning of the run, by the step of `dt_s` in which each lies: the number of the step and the
/// time (s) after its beginning, in order.
///
/// A knot within [`APART`] steps of the beginning of a step lies there, and a knot as near after another one counts as that one.
pub fn knots_of(drives: &[Drive], dt_s: f64) -> Vec<(u64, f64)> {
    let near_s = APART * dt_s;
    let mut knots_s: Vec<f64> = drives.iter().flat_map(|drive| drive.waveform.knots_s()).collect();
    knots_s.retain(|knot_s| *knot_s > near_s);
    knots_s.sort_by(f64::total_cmp);
    let mut last_s = 0.0;
    knots_s.retain(|knot_s| {
        let is_apart = *knot_s - last_s > near_s;
        last_s = if is_apart { *knot_s } else { last_s };
        is_apart
    });
    knots_s.into_iter().map(|knot_s| place(knot_s, dt_s)).collect()
}

/// The step of `dt_s` in which the time `knot_s` lies, and the time (s) from its beginning to the knot.
fn place(knot_s: f64, dt_s: f64) -> (u64, f64) {
    let near_s = APART * dt_s;
    let step = (knot_s / dt_s).floor();
    let (start_s, rest_s) = two_product(step, dt_s);
    let after_s = (knot_s - start_s) - rest_s;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "not negative; saturates")]
    let step = step as u64;
    if after_s <= near_s {
        (step, 0.0)
    } else if dt_s - after_s <= near_s {
        (step.saturating_add(1), 0.0)
    } else {
        (step, after_s)
    }
}

/// Two knots nearer to each other than this part of a step are one.
pub const APART: f64 = 1.0 / 1_048_576.0;
