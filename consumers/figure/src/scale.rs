//! The range of an axis, and where values lie on it.

use super::axis::Axis;
use super::prefixes::takes_prefix;

/// Values beyond this do not count for a range, nor those below its inverse on a logarithmic axis: what
/// is computed from them would overflow.
const LARGEST: f64 = 1e290;

/// Free space of an axis beyond the values on it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Margin {
    /// Nothing.
    Nothing,
    /// Nothing, but an end just short of a round number goes on to it.
    ToRound,
    /// This part of the length, on both sides.
    Part(f64),
}

/// The range of an axis, and how values lie in it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scale {
    pub(super) from: f64,
    pub(super) to: f64,
    pub(super) log: bool,
    reversed: bool,
    /// True if the unit on the axis can have a prefix, which makes numbers short.
    pub(super) takes_prefix: bool,
    /// The least distance of ticks: 1 on an axis of beads or contacts, between which there is nothing.
    pub(super) least_step: f64,
}

impl Scale {
    /// The axis' own limits, or the extent of `values` with some room.
    pub(super) fn new(axis: &Axis, values: impl Iterator<Item = f64>, room: Margin) -> Self {
        let takes_prefix = takes_prefix(&axis.label);
        let least_step = if matches!(axis.label.as_str(), "bead" | "contact") { 1.0 } else { 0.0 };
        let scale =
            |from, to| Self { from, to, log: axis.log, reversed: axis.reversed, takes_prefix, least_step };
        if let Some((a, b)) = axis.limits {
            let usable = scale(a, b);
            if a != b && usable.holds(a) && usable.holds(b) {
                let (low, high) = widen(a.min(b), a.max(b), 0.0);
                return scale(low, high);
            }
        }
        let probe = scale(1.0, 10.0);
        let held = values.filter(|value| probe.holds(*value));
        let extent = held.fold(None, |extent: Option<(f64, f64)>, value| {
            let (low, high) = extent.unwrap_or((value, value));
            Some((low.min(value), high.max(value)))
        });
        let margin = if let Margin::Part(part) = room { part } else { 0.0 };
        let (from, to) = match (extent, axis.log) {
            (None, false) => (0.0, 1.0),
            (None, true) => (1.0, 10.0),
            (Some((low, high)), false) if room == Margin::ToRound => {
                let (low, high) = widen(low, high, 0.0);
                to_round(low, high)
            }
            (Some((low, high)), false) => widen(low, high, margin),
            (Some((low, high)), true) => {
                let (low, high) = if high / low > 1.0 + 1e-9 {
                    (low.log10(), high.log10())
                } else {
                    (low.log10() - 0.5, low.log10() + 0.5)
                };
                let (low, high) = (low - margin * (high - low), high + margin * (high - low));
                (10_f64.powf(low), 10_f64.powf(high))
            }
        };
        scale(from, to)
    }

    /// True if an axis of this kind can begin or end at a value.
    fn holds(&self, value: f64) -> bool {
        value.abs() <= LARGEST && (!self.log || value >= 1.0 / LARGEST)
    }

    /// The place of a value as a fraction of the axis' length; `None` where it has none.
    pub(super) fn place(&self, value: f64) -> Option<f64> {
        if !value.is_finite() || (self.log && value <= 0.0) {
            return None;
        }
        let fraction = if self.log && (self.to / self.from).log10() < 300.0 {
            (value / self.from).log10() / (self.to / self.from).log10()
        } else if self.log {
            // ratios may leave the range of doubles
            (value.log10() - self.from.log10()) / (self.to.log10() - self.from.log10())
        } else {
            (value - self.from) / (self.to - self.from)
        };
        Some(if self.reversed { 1.0 - fraction } else { fraction })
    }
}

/// A range with a margin on both sides, and some length where there was none.
fn widen(low: f64, high: f64, margin: f64) -> (f64, f64) {
    let length = high - low;
    let size = low.abs().max(high.abs());
    if length > 1e-12 * size {
        return (low - margin * length, high + margin * length);
    }
    if size < 1e-290 {
        return (-1.0, 1.0);
    }
    (low - 0.1 * size, high + 0.1 * size)
}

/// A range whose ends go on to a round number where one is near.
fn to_round(low: f64, high: f64) -> (f64, f64) {
    const NEAR: f64 = 0.015;
    let step = RoundStep::near((high - low) / 8.0).size();
    let (below, above) = ((low / step).floor() * step, (high / step).ceil() * step);
    let near = NEAR * (high - low);
    (if low - below < near { below } else { low }, if above - high < near { above } else { high })
}

/// 1, 2 or 5 times a power of ten.
#[derive(Debug, Clone, Copy)]
pub(super) struct RoundStep {
    mantissa: f64,
    power: i32,
}

impl RoundStep {
    /// The nearest such number, by ratio.
    pub(super) fn near(size: f64) -> Self {
        // At most ±308.
        #[allow(clippy::cast_possible_truncation)]
        let power = size.log10().floor() as i32;
        let excess = size / power_of_ten(power);
        let (mantissa, power) = match excess {
            x if x < 2_f64.sqrt() => (1.0, power),
            x if x < 10_f64.sqrt() => (2.0, power),
            x if x < 50_f64.sqrt() => (5.0, power),
            _ => (1.0, power + 1),
        };
        Self { mantissa, power }
    }

    pub(super) fn size(self) -> f64 {
        self.mantissa * power_of_ten(self.power)
    }

    /// Decimals that a multiple needs when written in units of 10^exponent.
    pub(super) fn decimals(self, exponent: i32) -> usize {
        usize::try_from(exponent - self.power).unwrap_or(0).min(15)
    }

    /// Parts into which minor ticks divide the step.
    pub(super) fn minor_count(self) -> f64 {
        if self.mantissa == 2.0 { 4.0 } else { 5.0 }
    }
}

pub(super) fn power_of_ten(power: i32) -> f64 {
    10_f64.powi(power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_just_short_of_a_round_number_reaches_it() {
        let range = |to| Scale::new(&Axis::new(""), [0.0, to].into_iter(), Margin::ToRound).to;
        assert_eq!(range(999.0), 1000.0);
        assert_eq!(range(79.998), 80.0);
        assert_eq!(range(87.0), 87.0);
    }

    #[test]
    fn a_reversed_axis_starts_at_its_end() {
        let axis = Axis::new("t").limits(0.0, 8.0).reversed();
        let scale = Scale::new(&axis, std::iter::empty(), Margin::Nothing);
        assert_eq!(scale.place(2.0), Some(0.75));
        assert_eq!(scale.place(f64::NAN), None);
    }
}
