//! Colours for signed numbers, and the bar beside a raster that explains them.

use super::axis::Axis;
use super::scale::{Margin, Scale};
use super::style::Colour;
use super::ticks::{is_plain, power_label, signed};

/// Colours of numbers: white for 0, blues below, reds above, both as dark as they are far from 0. A raster that has
/// such a scale is drawn with a bar beside it.
#[derive(Debug, Clone, PartialEq)]
#[must_use]
pub struct ColourScale {
    pub(super) label: String,
    from: f64,
    to: f64,
    log_beyond: Option<f64>,
    /// The number that is white.
    white: f64,
}

/// Numbers along the bar; places are fractions of its length, from the bottom.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct BarTicks {
    pub(super) numbers: Vec<(f64, String)>,
    /// The numbers are to be multiplied by 10 to this power.
    pub(super) exponent: i32,
}

impl ColourScale {
    /// A linear scale for numbers between `from` and `to`, and 0. The label has the unit at its end, as that of
    /// an [`Axis`].
    pub fn new(label: impl Into<String>, from: f64, to: f64) -> Self {
        let usable = |value: f64| if value.is_finite() { value } else { 0.0 };
        let (from, to) = (usable(from).min(0.0), usable(to).max(0.0));
        let to = if from == to { 1.0 } else { to };
        Self { label: label.into(), from, to, log_beyond: None, white: 0.0 }
    }

    /// A linear scale for numbers from `from`, which is white, to `to`, which is as dark as a colour gets: for numbers that are
    /// far from 0 and differ little. Where they do not differ, white is 0.
    pub fn between(label: impl Into<String>, from: f64, to: f64) -> Self {
        let scale = Self::new(label, from, to);
        let is_usable = from.is_finite() && to.is_finite() && from < to;
        if is_usable { Self { from, to, white: from, ..scale } } else { scale }
    }

    /// Makes the scale logarithmic for numbers farther from 0 than `linear`, so that what is weak is seen beside
    /// what is strong.
    pub fn log_beyond(mut self, linear: f64) -> Self {
        self.log_beyond = (linear > 0.0 && linear < self.limit()).then_some(linear);
        self
    }

    fn limit(&self) -> f64 {
        (self.to - self.white).max(self.white - self.from)
    }

    /// Place of a number between white (0) and the two darkest colours (−1 and 1).
    pub fn shade(&self, value: f64) -> f64 {
        let value = value - self.white;
        let part = match self.log_beyond {
            None => value.abs() / self.limit(),
            Some(linear) => (value.abs() / linear).ln_1p() / (self.limit() / linear).ln_1p(),
        };
        part.min(1.0).copysign(value)
    }

    /// The shades at the lower and at the upper end of the bar.
    pub(super) fn shades(&self) -> (f64, f64) {
        (self.shade(self.from), self.shade(self.to))
    }

    /// The place of a number on the bar.
    fn place(&self, value: f64) -> f64 {
        let (low, high) = self.shades();
        (self.shade(value) - low) / (high - low)
    }

    /// Round numbers, at most `most` of them if they were evenly spread.
    pub(super) fn ticks(&self, most: usize) -> BarTicks {
        let decades = self.log_beyond.map_or_else(Vec::new, |linear| self.decades(linear, most));
        if decades.len() > 1 {
            return BarTicks { numbers: decades, exponent: 0 };
        }
        let axis = Axis::new("").limits(self.from, self.to);
        let ticks = Scale::new(&axis, std::iter::empty(), Margin::Nothing).ticks(most.div_ceil(2) + 1);
        let numbers = match self.log_beyond {
            None => ticks.major,
            Some(_) => self.with_room(ticks.major, most),
        };
        BarTicks { numbers, exponent: ticks.exponent }
    }

    /// Numbers at places on a linear bar, where they lie on a logarithmic one that has less than a decade: as many as have room.
    fn with_room(&self, linear: Vec<(f64, String)>, most: usize) -> Vec<(f64, String)> {
        let least_apart = 1.0 / most.max(1) as f64;
        let mut numbers: Vec<(f64, String)> = Vec::new();
        for (part, label) in linear {
            let place = self.place(self.from + part * (self.to - self.from));
            if numbers.last().is_none_or(|(last, _)| place - last >= least_apart) {
                numbers.push((place, label));
            }
        }
        numbers
    }

    /// 0 and powers of ten of both signs, as many as have room.
    fn decades(&self, linear: f64, most: usize) -> Vec<(f64, String)> {
        let least_apart = 1.0 / most.max(1) as f64;
        let zero = self.place(0.0);
        // at most ±308
        #[expect(clippy::cast_possible_truncation, reason = "a power of ten")]
        let (first, last) = (linear.log10().ceil() as i32, (self.limit().log10() + 1e-9).floor() as i32);
        let both = |power: i32| [-1.0, 1.0].map(|sign| sign * 10_f64.powi(power));
        let shown = |value: &f64| (self.from..=self.to).contains(value);
        let fits = |value: &f64| shown(value) && (self.place(*value) - zero).abs() >= least_apart;
        let powers: Vec<i32> = (first..=last).filter(|power| both(*power).iter().any(fits)).collect();
        let apart = |stride: usize| {
            let value = |power: i32| both(power).into_iter().find(shown).unwrap_or(0.0);
            let places: Vec<f64> =
                powers.iter().rev().step_by(stride).map(|power| self.place(value(*power))).collect();
            places.windows(2).all(|pair| (pair[0] - pair[1]).abs() >= least_apart)
        };
        let stride = (1..=powers.len()).find(|stride| apart(*stride)).unwrap_or(1);
        let plain = powers.iter().all(|power| is_plain(*power));
        let label = |value: f64, power: i32| {
            let decimals = usize::try_from(-power).unwrap_or(0);
            if plain { signed(value, decimals) } else { power_label(value < 0.0, power) }
        };
        let chosen = powers.iter().rev().step_by(stride);
        let mut numbers: Vec<(f64, String)> = chosen
            .flat_map(|power| both(*power).map(|value| (value, *power)))
            .filter(|(value, _)| fits(value))
            .map(|(value, power)| (self.place(value), label(value, power)))
            .collect();
        numbers.push((zero, "0".to_owned()));
        numbers.sort_by(|a, b| a.0.total_cmp(&b.0));
        numbers
    }
}

/// The colour of a shade from −1 to 1: lightness falls evenly from white on both sides, and differs by
/// so much that the map is read without any colour vision but for the sign.
///
/// # Source
/// B. Ottosson, *A perceptual color space for image processing* (2020): the space `OKLab`, in which it is even.
pub fn diverging(shade: f64) -> Colour {
    const DARKEST: f64 = 0.4;
    let part = shade.abs().min(1.0);
    hued(shade, 1.0 - (1.0 - DARKEST) * part, part * (2.0 - part))
}

/// The same for a dark background: nearly black for 0, and lighter the farther from it.
pub fn diverging_on_dark(shade: f64) -> Colour {
    const DARKEST: f64 = 0.17;
    const LIGHTEST: f64 = 0.85;
    let part = shade.abs().min(1.0);
    hued(shade, DARKEST + (LIGHTEST - DARKEST) * part, part * (2.0 - part))
}

/// Blue below 0 and red above, of this lightness and part of the full chroma.
fn hued(shade: f64, lightness: f64, part: f64) -> Colour {
    const CHROMA: f64 = 0.13;
    const BLUE: f64 = 255.0;
    const RED: f64 = 38.0;
    let chroma = CHROMA * part;
    let hue = if shade < 0.0 { BLUE } else { RED }.to_radians();
    oklab(lightness, chroma * hue.cos(), chroma * hue.sin())
}

/// A colour by its coordinates in `OKLab`.
fn oklab(lightness: f64, a: f64, b: f64) -> Colour {
    let cubed = |from_a: f64, from_b: f64| (lightness + from_a * a + from_b * b).powi(3);
    let l = cubed(0.396_337_777_4, 0.215_803_757_3);
    let m = cubed(-0.105_561_345_8, -0.063_854_172_8);
    let s = cubed(-0.089_484_177_5, -1.291_485_548);
    let red = 4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s;
    let green = -1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s;
    let blue = -0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701 * s;
    Colour::Rgb(byte(red), byte(green), byte(blue))
}

/// A linear part of the light of the screen as sRGB writes it.
fn byte(linear: f64) -> u8 {
    let linear = linear.clamp(0.0, 1.0);
    let encoded = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
    let byte = (255.0 * encoded).round() as u8;
    byte
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(scale: &ColourScale, most: usize) -> Vec<String> {
        scale.ticks(most).numbers.into_iter().map(|(_, label)| label).collect()
    }

    #[test]
    fn colours_darken_evenly_either_way_and_never_repeat() {
        assert_eq!(diverging(0.0), Colour::Rgb(255, 255, 255));
        // CIE 1976 lightness, in percent
        let lightness = |shade: f64| {
            let linear = diverging(shade).rgb().map(|byte| {
                let part = f64::from(byte) / 255.0;
                if part <= 0.040_45 { part / 12.92 } else { ((part + 0.055) / 1.055).powf(2.4) }
            });
            let luminance = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
            116.0 * luminance.cbrt() - 16.0
        };
        for sign in [-1.0, 1.0] {
            let steps: Vec<f64> = (0..=10).map(|part| lightness(sign * f64::from(part) / 10.0)).collect();
            for pair in steps.windows(2) {
                assert!((5.0..9.0).contains(&(pair[0] - pair[1])), "{steps:?}");
            }
        }
    }

    #[test]
    fn a_linear_scale_has_its_zero_where_the_colours_meet() {
        let scale = ColourScale::new("v (m/s)", -1.0, 3.0);
        assert_eq!(scale.shades(), (-1.0 / 3.0, 1.0));
        assert_eq!(labels(&scale, 6), ["−1", "0", "1", "2", "3"]);
        assert_eq!(scale.place(0.0), 0.25);
    }

    #[test]
    fn a_scale_between_two_numbers_has_all_colours_for_them() {
        let scale = ColourScale::between("x", 0.9, 1.0);
        assert_eq!((scale.shade(0.9), scale.shade(1.0)), (0.0, 1.0));
        assert_eq!(scale.shades(), (0.0, 1.0));
        assert_eq!(labels(&scale, 9), ["0.90", "0.92", "0.94", "0.96", "0.98", "1.00"]);
        assert_eq!(ColourScale::between("x", 2.0, f64::NAN).shades(), (0.0, 1.0));
        assert_eq!(ColourScale::between("x", -2.0, -2.0), ColourScale::new("x", -2.0, 0.0));
    }

    #[test]
    fn a_logarithmic_scale_shows_powers_of_ten_that_have_room() {
        let scale = ColourScale::new("v (m/s)", -5.0, 5.0).log_beyond(5e-3);
        assert_eq!(labels(&scale, 15), ["−1", "−0.1", "−0.01", "0", "0.01", "0.1", "1"]);
        assert_eq!(labels(&scale, 7), ["−1", "−0.1", "0", "0.1", "1"]);
        let one_sided = ColourScale::new("u (m)", 0.0, 2e-5).log_beyond(1e-8);
        assert_eq!(labels(&one_sided, 9), ["0", "10⁻⁷", "10⁻⁶", "10⁻⁵"]);
        assert_eq!(scale.shade(f64::INFINITY), 1.0);
    }

    #[test]
    fn a_logarithmic_scale_without_a_power_of_ten_has_round_numbers() {
        let scale = ColourScale::new("v (m/s)", -0.9, 0.9).log_beyond(0.2);
        assert_eq!(labels(&scale, 9), ["−0.8", "−0.4", "−0.2", "0.0", "0.2", "0.4", "0.8"]);
        let places: Vec<f64> = scale.ticks(9).numbers.into_iter().map(|(place, _)| place).collect();
        assert!((places[6] - 0.5 - 0.5 * 4.0_f64.ln_1p() / 4.5_f64.ln_1p()).abs() < 1e-12, "{places:?}");
    }

    #[test]
    fn any_range_makes_a_scale() {
        for (from, to) in [(0.0, 0.0), (f64::NAN, f64::INFINITY), (5.0, 7.0), (-1e-300, 0.0)] {
            for log_beyond in [0.0, 1e-3, f64::NAN, 1e9] {
                let scale = ColourScale::new("", from, to).log_beyond(log_beyond);
                let places: Vec<f64> = scale.ticks(6).numbers.iter().map(|tick| tick.0).collect();
                assert!(places.iter().all(|place| (-0.01..=1.01).contains(place)), "{scale:?} {places:?}");
            }
        }
    }
}
