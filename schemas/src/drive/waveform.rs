//! Values that change with time, and their slopes: the same bits on every machine.

use super::{Interpolation, Table};
use crate::amounts;
use crate::functions::{Moment, TURN, angular, exp, larger, sine_cosine};
use crate::json_schema::{is_default, not_negative, positive};
use schemars::{JsonSchema, Schema};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use std::path::PathBuf;

/// A value at each time t from the beginning of the run, in the unit of what it prescribes.
///
/// Keys left out of a configuration are 0, and 0 means none: no phase, no ramp.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
#[schemars(deny_unknown_fields, transform = or_number)]
pub enum Waveform {
    /// The same at all times, as a plain number is.
    Constant(f64),
    /// A sine.
    Sine(Sine),
    /// A sine whose frequency changes.
    Chirp(Chirp),
    /// A step.
    Step(Step),
    /// A straight line from 0 to a value.
    Ramp(Ramp),
    /// Half a period of a sine.
    HalfSine(HalfSine),
    /// A Gaussian, or a burst of oscillations under one.
    Gaussian(Gaussian),
    /// Values at times.
    Table(Table),
    /// A file with a table, as a configuration names it; no run has one.
    #[serde(untagged)]
    Csv {
        /// The file: two columns, time (s) and value.
        csv: PathBuf,
        /// The interpolation between its rows.
        #[serde(default)]
        interpolation: Interpolation,
    },
}

/// Allows a plain number, too.
fn or_number(schema: &mut Schema) {
    if let Some(Value::Array(forms)) = schema.get_mut("anyOf") {
        forms.insert(0, json!({ "type": "number", "description": "The same at all times." }));
    }
}

/// `A·sin(2π·f·t + φ)` times an envelope: sin²(π·t/(2·ramp)) while t is below the ramp, the same mirrored before the end, 0 after it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sine {
    /// The amplitude A, in the unit of the quantity.
    pub amplitude: f64,
    /// The frequency f (Hz).
    #[schemars(transform = positive)]
    pub frequency_hz: f64,
    /// The phase φ (rad).
    #[serde(default, skip_serializing_if = "is_default")]
    pub phase_rad: f64,
    /// Duration of its growth (s).
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(transform = not_negative)]
    pub ramp_s: f64,
    /// Its end (s).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(transform = positive)]
    pub until_s: Option<f64>,
    /// Duration of its fall before the end (s).
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(transform = not_negative)]
    pub ramp_down_s: f64,
}

/// `A·sin(2π·(f0·t + c·t²))`, `c = (f1 − f0)/2/duration`, with the envelope of [`Sine`], until `duration_s`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Chirp {
    /// The amplitude A, in the unit of the quantity.
    pub amplitude: f64,
    /// Frequency at time 0, f0 (Hz).
    #[schemars(transform = not_negative)]
    pub from_hz: f64,
    /// Frequency at the end, f1 (Hz).
    #[schemars(transform = not_negative)]
    pub to_hz: f64,
    /// The end (s).
    #[schemars(transform = positive)]
    pub duration_s: f64,
    /// Duration of its growth (s).
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(transform = not_negative)]
    pub ramp_s: f64,
    /// Duration of its fall before the end (s).
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(transform = not_negative)]
    pub ramp_down_s: f64,
}

/// 0, then A; in between it grows as sin²(π·t/(2·rise)).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Step {
    /// The amplitude A, in the unit of the quantity.
    pub amplitude: f64,
    /// Its beginning (s).
    #[serde(default, skip_serializing_if = "is_default")]
    pub at_s: f64,
    /// Duration of its growth (s).
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(transform = not_negative)]
    pub rise_s: f64,
}

/// 0, then a straight line to A, then A.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ramp {
    /// The amplitude A, in the unit of the quantity.
    pub amplitude: f64,
    /// Beginning of the line (s).
    #[serde(default, skip_serializing_if = "is_default")]
    pub from_s: f64,
    /// End of the line (s).
    pub to_s: f64,
}

/// `A·sin(π·(t − at)/duration)`, and 0 before and after it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HalfSine {
    /// The amplitude A, in the unit of the quantity.
    pub amplitude: f64,
    /// Its duration (s).
    #[schemars(transform = positive)]
    pub duration_s: f64,
    /// Its beginning (s).
    #[serde(default, skip_serializing_if = "is_default")]
    pub at_s: f64,
}

/// `A·exp(−z²/2)·cos(2π·f·(t − at))` with `z = (t − at)/width`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gaussian {
    /// The amplitude A, in the unit of the quantity.
    pub amplitude: f64,
    /// Its middle (s).
    pub at_s: f64,
    /// Its standard deviation (s).
    #[schemars(transform = positive)]
    pub width_s: f64,
    /// The frequency f (Hz) of the burst, 0 for a plain Gaussian.
    #[serde(default, skip_serializing_if = "is_default")]
    #[schemars(transform = not_negative)]
    pub frequency_hz: f64,
}

impl Waveform {
    /// The value at a time.
    #[inline]
    pub fn value(&self, at: Moment) -> f64 {
        self.value_and_slope(at).0
    }

    /// The derivative of the value by time (1/s).
    #[inline]
    pub fn slope(&self, at: Moment) -> f64 {
        self.value_and_slope(at).1
    }

    /// Both; a slope is that of the piece of the waveform in which the time lies.
    #[inline]
    pub fn value_and_slope(&self, at: Moment) -> (f64, f64) {
        match self {
            Self::Constant(value) => (*value, 0.0),
            Self::Sine(sine) => sine.value_and_slope(at),
            Self::Chirp(chirp) => chirp.value_and_slope(at),
            Self::Step(step) => step.value_and_slope(at),
            Self::Ramp(ramp) => ramp.value_and_slope(at),
            Self::HalfSine(half) => half.value_and_slope(at),
            Self::Gaussian(gaussian) => gaussian.value_and_slope(at),
            Self::Table(table) => table.value_and_slope(at.seconds()),
            Self::Csv { .. } => (f64::NAN, f64::NAN),
        }
    }

    /// The highest frequency that it prescribes (Hz), if it has one: that of its oscillation, or of the oscillation of which a ramp or
    /// a half-sine is a part.
    pub fn highest_hz(&self) -> Option<f64> {
        let of_ramp = |ramp_s: f64| if ramp_s > 0.0 { 0.5 / ramp_s } else { 0.0 };
        let hz = match self {
            Self::Constant(_) | Self::Ramp(_) | Self::Table(_) | Self::Csv { .. } => 0.0,
            Self::Sine(sine) => {
                larger(sine.frequency_hz, larger(of_ramp(sine.ramp_s), of_ramp(sine.ramp_down_s)))
            }
            Self::Chirp(chirp) => larger(
                larger(chirp.from_hz, chirp.to_hz),
                larger(of_ramp(chirp.ramp_s), of_ramp(chirp.ramp_down_s)),
            ),
            Self::Step(step) => of_ramp(step.rise_s),
            Self::HalfSine(half) => of_ramp(half.duration_s),
            // the spectrum has fallen to 1 % three deviations, 3/(2π·width), away from its middle
            Self::Gaussian(gaussian) => gaussian.frequency_hz + 0.5 / gaussian.width_s,
        };
        (hz > 0.0).then_some(hz)
    }

    /// A number that no value exceeds in size, for scales.
    pub fn largest(&self) -> f64 {
        match self {
            Self::Constant(value) => value.abs(),
            Self::Sine(Sine { amplitude, .. })
            | Self::Chirp(Chirp { amplitude, .. })
            | Self::Step(Step { amplitude, .. })
            | Self::Ramp(Ramp { amplitude, .. })
            | Self::HalfSine(HalfSine { amplitude, .. })
            | Self::Gaussian(Gaussian { amplitude, .. }) => amplitude.abs(),
            Self::Table(table) => table.largest(),
            Self::Csv { .. } => 0.0,
        }
    }

    /// True if a value may be below 0; for values that may not.
    pub(crate) fn can_be_negative(&self) -> bool {
        match self {
            Self::Constant(value) => *value < 0.0,
            Self::Sine(_) | Self::Chirp(_) => true,
            Self::Gaussian(Gaussian { amplitude, frequency_hz, .. }) => {
                *amplitude < 0.0 || *frequency_hz != 0.0
            }
            Self::Step(Step { amplitude, .. })
            | Self::Ramp(Ramp { amplitude, .. })
            | Self::HalfSine(HalfSine { amplitude, .. }) => *amplitude < 0.0,
            Self::Table(table) => table.values.iter().any(|value| *value < 0.0),
            Self::Csv { .. } => false,
        }
    }

    /// The key of a configuration: `sine`.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Constant(_) => "constant",
            Self::Sine(_) => "sine",
            Self::Chirp(_) => "chirp",
            Self::Step(_) => "step",
            Self::Ramp(_) => "ramp",
            Self::HalfSine(_) => "half_sine",
            Self::Gaussian(_) => "gaussian",
            Self::Table(_) => "table",
            Self::Csv { .. } => "csv",
        }
    }

    /// A phrase for captions: `sine of 10 nm at 6300 Hz`; `unit` is that of the values.
    pub fn words(&self, unit: &str) -> String {
        let (number, seconds) = (amounts::typed, amounts::seconds);
        let of = |amplitude: f64| amounts::typed_quantity(amplitude, unit);
        match self {
            Self::Constant(value) => format!("constant {}", of(*value)),
            Self::Sine(sine) => format!("sine of {} at {} Hz", of(sine.amplitude), number(sine.frequency_hz)),
            Self::Chirp(chirp) => {
                let [from, to] = [chirp.from_hz, chirp.to_hz].map(number);
                let duration = seconds(chirp.duration_s);
                format!("chirp of {} from {from} to {to} Hz in {duration}", of(chirp.amplitude))
            }
            Self::Step(step) => format!("step of {} at {}", of(step.amplitude), seconds(step.at_s)),
            Self::Ramp(ramp) => {
                let [from, to] = [ramp.from_s, ramp.to_s].map(seconds);
                format!("ramp to {} from {from} to {to}", of(ramp.amplitude))
            }
            Self::HalfSine(half) => {
                format!("half-sine of {}, {} long", of(half.amplitude), seconds(half.duration_s))
            }
            Self::Gaussian(gaussian) => {
                let (height, [width, at]) =
                    (of(gaussian.amplitude), [gaussian.width_s, gaussian.at_s].map(seconds));
                match gaussian.frequency_hz {
                    0.0 => format!("Gaussian of {height}, width {width}, at {at}"),
                    hertz => format!("burst of {height} at {} Hz, width {width}, at {at}", number(hertz)),
                }
            }
            Self::Table(table) => format!("table of {} values", table.values.len()),
            Self::Csv { csv, .. } => format!("table in {}", csv.display()),
        }
    }

    /// The jump of the value, in words, if it has one.
    pub(super) fn jump(&self) -> Option<String> {
        match self {
            Self::Step(step) if step.rise_s == 0.0 => Some("a step with no `rise_s`".to_owned()),
            Self::Sine(Sine { until_s: Some(end_s), ramp_down_s: 0.0, amplitude, .. })
            | Self::Chirp(Chirp { duration_s: end_s, ramp_down_s: 0.0, amplitude, .. }) => {
                let left = self.value(Moment::new(0, 0.0, end_s.next_down())).abs();
                let ends = || format!("a {} that ends at {}", self.kind(), amounts::typed(left));
                (left > 1e-9 * amplitude.abs()).then(ends)
            }
            _ => None,
        }
    }
}

impl Sine {
    #[inline]
    fn value_and_slope(&self, at: Moment) -> (f64, f64) {
        let envelope = envelope(at, self.ramp_s, self.until_s, self.ramp_down_s);
        let turns = at.turns(self.frequency_hz, self.phase_rad);
        oscillation(self.amplitude, envelope, turns, self.frequency_hz)
    }
}

impl Chirp {
    #[inline]
    fn value_and_slope(&self, at: Moment) -> (f64, f64) {
        let envelope = envelope(at, self.ramp_s, Some(self.duration_s), self.ramp_down_s);
        let half_rate = 0.5 * (self.to_hz - self.from_hz) / self.duration_s;
        let turns = at.chirped_turns(self.from_hz, half_rate);
        oscillation(self.amplitude, envelope, turns, self.from_hz + 2.0 * half_rate * at.seconds())
    }
}

/// `A·envelope·sin` and its slope at an angle (turns) that grows with `hz`.
#[inline]
fn oscillation(amplitude: f64, (envelope, steepness): (f64, f64), turns: (f64, f64), hz: f64) -> (f64, f64) {
    let (sine, cosine) = sine_cosine(turns);
    let slope = envelope * (angular(hz) * cosine) + steepness * sine;
    (amplitude * (envelope * sine), amplitude * slope)
}

/// The envelope of an oscillation and its slope.
#[inline]
fn envelope(at: Moment, ramp_s: f64, until_s: Option<f64>, ramp_down_s: f64) -> (f64, f64) {
    if let Some(until_s) = until_s {
        let left = at.until(until_s).seconds();
        if left <= 0.0 {
            return (0.0, 0.0);
        }
        if left < ramp_down_s {
            let (value, slope) = rise(left, ramp_down_s);
            return (value, -slope);
        }
    }
    if at.seconds() < ramp_s { rise(at.seconds(), ramp_s) } else { (1.0, 0.0) }
}

/// `sin²` of a quarter turn that takes `rise_s` (s), and its slope, at the time `since` (s) after its beginning.
#[inline]
fn rise(since: f64, rise_s: f64) -> (f64, f64) {
    let (sine, cosine) = sine_cosine((since / (4.0 * rise_s), 0.0));
    (sine * sine, sine * cosine * (0.5 * TURN[0] / rise_s))
}

impl Step {
    #[inline]
    fn value_and_slope(&self, at: Moment) -> (f64, f64) {
        let since = at.since(self.at_s).seconds();
        let (value, slope) = if since < 0.0 {
            (0.0, 0.0)
        } else if since < self.rise_s {
            rise(since, self.rise_s)
        } else {
            (1.0, 0.0)
        };
        (self.amplitude * value, self.amplitude * slope)
    }
}

impl Ramp {
    #[inline]
    fn value_and_slope(&self, at: Moment) -> (f64, f64) {
        let (since, length) = (at.since(self.from_s).seconds(), self.to_s - self.from_s);
        if since < 0.0 {
            (0.0, 0.0)
        } else if since < length {
            (self.amplitude * (since / length), self.amplitude / length)
        } else {
            (self.amplitude, 0.0)
        }
    }
}

impl HalfSine {
    #[inline]
    fn value_and_slope(&self, at: Moment) -> (f64, f64) {
        let since = at.since(self.at_s).seconds();
        if since < 0.0 || since >= self.duration_s {
            return (0.0, 0.0);
        }
        let (sine, cosine) = sine_cosine((since / (2.0 * self.duration_s), 0.0));
        (self.amplitude * sine, self.amplitude * (0.5 * TURN[0] / self.duration_s * cosine))
    }
}

impl Gaussian {
    #[inline]
    fn value_and_slope(&self, at: Moment) -> (f64, f64) {
        let since = at.since(self.at_s);
        let z = since.seconds() / self.width_s;
        let bell = self.amplitude * exp(-0.5 * (z * z));
        let (sine, cosine) = sine_cosine(since.turns(self.frequency_hz, 0.0));
        let slope = -(z / self.width_s * cosine + angular(self.frequency_hz) * sine);
        (bell * cosine, bell * slope)
    }
}
