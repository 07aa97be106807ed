//! Waveforms that no run can have.

use super::{Table, Waveform};
use crate::config_error::ConfigError;

/// Largest number in a waveform: leaves room for squares and products.
const LARGEST: f64 = 1e100;

/// Numbers of one waveform, each with its key.
struct Numbers<'a>(&'a str);

impl Numbers<'_> {
    fn refuse(&self, name: &str, found: f64, allowed: &str) -> Result<(), ConfigError> {
        let key = if name.is_empty() { self.0.to_owned() } else { format!("{}.{name}", self.0) };
        Err(ConfigError::number(&key, found, allowed))
    }

    fn finite(&self, name: &str, found: f64) -> Result<(), ConfigError> {
        if found.abs() <= LARGEST {
            return Ok(());
        }
        self.refuse(name, found, "a number of at most 1e100 in size")
    }

    fn positive(&self, name: &str, found: f64) -> Result<(), ConfigError> {
        if (1e-100..=LARGEST).contains(&found) {
            return Ok(());
        }
        self.refuse(name, found, "a positive number, 1e-100 to 1e100")
    }

    fn positive_or_zero(&self, name: &str, found: f64) -> Result<(), ConfigError> {
        if found == 0.0 { Ok(()) } else { self.positive(name, found) }
    }

    /// Checks the ramps (s) of an oscillation and the time `end` (s) at which it ends, if it does.
    fn ramps(&self, up_s: f64, down_s: f64, end: Option<f64>) -> Result<(), ConfigError> {
        self.positive_or_zero("ramp_s", up_s)?;
        self.positive_or_zero("ramp_down_s", down_s)?;
        match end {
            None if down_s > 0.0 => self.refuse(
                "ramp_down_s",
                down_s,
                "0 where there is no `until_s`: give the time at which it ends",
            ),
            Some(end_s) if up_s + down_s > end_s => {
                let allowed = format!("ramps that leave room for each other before the end at {end_s} s");
                self.refuse("ramp_s", up_s, &allowed)
            }
            _ => Ok(()),
        }
    }
}

impl Waveform {
    /// Refuses a waveform that no run of `duration_s` can have; `key` is its place in the configuration.
    ///
    /// # Errors
    /// When a number is not finite or out of range, or a table is out of order or ends before the run.
    pub fn check(&self, key: &str, duration_s: f64) -> Result<(), ConfigError> {
        let key = match self {
            Self::Constant(_) | Self::Csv { .. } => key.to_owned(),
            _ => format!("{key}.{}", self.kind()),
        };
        let numbers = Numbers(&key);
        match self {
            Self::Constant(value) => numbers.finite("", *value),
            Self::Sine(sine) => {
                numbers.finite("amplitude", sine.amplitude)?;
                numbers.positive("frequency_hz", sine.frequency_hz)?;
                numbers.finite("phase_rad", sine.phase_rad)?;
                if let Some(until_s) = sine.until_s {
                    numbers.positive("until_s", until_s)?;
                }
                numbers.ramps(sine.ramp_s, sine.ramp_down_s, sine.until_s)
            }
            Self::Chirp(chirp) => {
                numbers.finite("amplitude", chirp.amplitude)?;
                numbers.positive_or_zero("from_hz", chirp.from_hz)?;
                numbers.positive_or_zero("to_hz", chirp.to_hz)?;
                numbers.positive("duration_s", chirp.duration_s)?;
                numbers.ramps(chirp.ramp_s, chirp.ramp_down_s, Some(chirp.duration_s))
            }
            Self::Step(step) => {
                numbers.finite("amplitude", step.amplitude)?;
                numbers.finite("at_s", step.at_s)?;
                numbers.positive_or_zero("rise_s", step.rise_s)
            }
            Self::Ramp(ramp) => {
                numbers.finite("amplitude", ramp.amplitude)?;
                numbers.finite("from_s", ramp.from_s)?;
                numbers.finite("to_s", ramp.to_s)?;
                if ramp.to_s > ramp.from_s {
                    return Ok(());
                }
                let allowed = format!("a time after `from_s`, {} s", ramp.from_s);
                numbers.refuse("to_s", ramp.to_s, &allowed)
            }
            Self::HalfSine(half) => {
                numbers.finite("amplitude", half.amplitude)?;
                numbers.finite("at_s", half.at_s)?;
                numbers.positive("duration_s", half.duration_s)
            }
            Self::Gaussian(gaussian) => {
                numbers.finite("amplitude", gaussian.amplitude)?;
                numbers.finite("at_s", gaussian.at_s)?;
                numbers.positive("width_s", gaussian.width_s)?;
                numbers.positive_or_zero("frequency_hz", gaussian.frequency_hz)
            }
            Self::Table(table) => table.check(&numbers, duration_s),
            Self::Csv { csv, .. } => {
                Err(ConfigError::value(&key, csv.display(), "a table: the file has not been read"))
            }
        }
    }
}

impl Table {
    fn check(&self, numbers: &Numbers, duration_s: f64) -> Result<(), ConfigError> {
        let key = |name: &str| format!("{}.{name}", numbers.0);
        let (times, values) = (&self.times_s, &self.values);
        if times.len() < 2 {
            return Err(ConfigError::value(
                &key("times_s"),
                format_args!("{} times", times.len()),
                "2 or more",
            ));
        }
        if values.len() != times.len() {
            let allowed = format!("one for each of the {} times", times.len());
            return Err(ConfigError::value(
                &key("values"),
                format_args!("{} values", values.len()),
                &allowed,
            ));
        }
        for (name, list) in [("times_s", times), ("values", values)] {
            if let Some(i) = list.iter().position(|number| number.is_nan() || number.abs() > LARGEST) {
                numbers.finite(&format!("{name}[{i}]"), list[i])?;
            }
        }
        for (i, pair) in times.windows(2).enumerate() {
            if pair[1] - pair[0] < 1e-100 {
                let allowed = format!("times that increase: after {} s", pair[0]);
                return numbers.refuse(&format!("times_s[{}]", i + 1), pair[1], &allowed);
            }
        }
        let last = times[times.len() - 1];
        // the last step may end a rounding after the duration
        if last < duration_s * (1.0 - 1e-9) {
            let allowed =
                format!("times up to the end of the run at {duration_s} s: extend the table, or end the run");
            return numbers.refuse(&format!("times_s[{}]", times.len() - 1), last, &allowed);
        }
        Ok(())
    }
}
