//! A sweep as a job array of Slurm.

use super::values::{parse_directive, parse_jobs, parse_positive};
use clap::Args;
use std::num::NonZero;

/// A time as Slurm reads it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct TimeLimit {
    /// As it was written.
    pub(crate) text: String,
    /// None for no limit.
    pub(crate) seconds: Option<u64>,
}

/// `90`, `90:00`, `1:30:00`, `2-12`, `2-12:30`, `2-12:30:00`, `UNLIMITED`: the times that sbatch takes for --time.
fn parse_time_limit(text: &str) -> Result<TimeLimit, String> {
    let text = parse_directive(text)?;
    if ["infinite", "unlimited"].contains(&text.to_lowercase().as_str()) {
        return Ok(TimeLimit { text, seconds: None });
    }
    let (days, rest) = match text.split_once('-') {
        Some((days, rest)) => (Some(days), rest),
        None => (None, text.as_str()),
    };
    // Slurm counts minutes in 32 bits
    let part = |part: &str| {
        let is_number = !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
        part.parse::<u64>().ok().filter(|number| is_number && *number < 1 << 31)
    };
    let parts: Option<Vec<u64>> = rest.split(':').map(part).collect();
    let seconds = days.map_or(Some(0), part).zip(parts).and_then(|(whole_days, parts)| {
        // without days one number or two are minutes and seconds
        let units = match (days, parts.len()) {
            (None, 1 | 2) => &[60, 1][..],
            (_, 1..=3) => &[3600, 60, 1],
            _ => return None,
        };
        Some(whole_days * 86_400 + parts.iter().zip(units).map(|(part, unit)| part * unit).sum::<u64>())
    });
    match seconds.filter(|seconds| *seconds < 60 << 31) {
        // of 0 Slurm makes no limit
        Some(0) => Ok(TimeLimit { text, seconds: None }),
        Some(seconds) => Ok(TimeLimit { seconds: Some(seconds), text }),
        None => Err(format!(
            "expected a time that Slurm takes: MINUTES, MM:SS, HH:MM:SS, D-HH, D-HH:MM or D-HH:MM:SS{}",
            meant(&text)
        )),
    }
}

/// The time that `25h` and others are in Slurm's words.
fn meant(text: &str) -> String {
    let units: [(&[&str], f64); 4] = [
        (&["d", "day", "days"], 86_400.0),
        (&["h", "hour", "hours"], 3600.0),
        (&["m", "min", "minutes"], 60.0),
        (&["s", "sec", "seconds"], 1.0),
    ];
    let unit_at = text.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(text.len());
    let (number, unit) = text.split_at(unit_at);
    let one = units.iter().find(|(names, _)| names.contains(&unit.trim())).map(|(_, one)| one);
    let Some((number, one)) = number.trim().parse::<f64>().ok().zip(one) else { return String::new() };
    let total = number * one;
    if !(1.0..1e9).contains(&total) {
        return String::new();
    }
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the range")]
    let total = total.ceil() as u64;
    let (days, hours, rest) = (total / 86_400, total / 3600 % 24, total % 3600);
    format!("; {text} is {days}-{hours:02}:{:02}:{:02}", rest / 60, rest % 60)
}

/// Options in the script of a job array. Values go to Slurm unchecked: Slurm knows what its site allows.
#[derive(Debug, Args)]
#[command(next_help_heading = "As a job array of Slurm")]
pub(crate) struct SlurmArgs {
    /// Compute nothing; write the script of a job array, DIR/slurm/array.sh
    #[arg(long)]
    pub(crate) slurm: bool,
    /// Submit it with sbatch
    #[arg(long, requires = "slurm")]
    pub(crate) submit: bool,
    /// Tasks of the array, a shard of the points for each [default: 1000, if there are as many points]
    #[arg(long, value_name = "N", requires = "slurm", value_parser = parse_positive)]
    pub(crate) array_size: Option<NonZero<u64>>,
    /// Cores of a task
    #[arg(long, value_name = "N", requires = "slurm", default_value = "1", value_parser = parse_jobs)]
    pub(crate) cpus: NonZero<usize>,
    /// Time limit of a task, also as MINUTES, HH:MM:SS or D-HH; a task that needs more goes on in another turn
    #[arg(long, value_name = "D-HH:MM:SS", requires = "slurm", value_parser = parse_time_limit)]
    pub(crate) time: Option<TimeLimit>,
    /// Memory of a task, such as 500M
    #[arg(long, value_name = "SIZE", requires = "slurm", value_parser = parse_directive)]
    pub(crate) mem: Option<String>,
    /// Partition
    #[arg(long, value_name = "NAME", requires = "slurm", value_parser = parse_directive)]
    pub(crate) partition: Option<String>,
    /// Account
    #[arg(long, value_name = "NAME", requires = "slurm", value_parser = parse_directive)]
    pub(crate) account: Option<String>,
    /// Another option of sbatch, repeatable: --sbatch=--qos=low
    #[arg(
        long,
        value_name = "OPTION",
        requires = "slurm",
        allow_hyphen_values = true,
        value_parser = parse_directive
    )]
    pub(crate) sbatch: Vec<String>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_those_that_slurm_takes() {
        let seconds = |text: &str| parse_time_limit(text).map(|limit| limit.seconds);
        for (text, expected) in [
            ("90", 5400),
            ("90:30", 5430),
            ("4:00:00", 14_400),
            ("30:00:00", 108_000),
            ("1-01", 90_000),
            ("1-00:30", 88_200),
            ("0-0:00:61", 61),
        ] {
            assert_eq!(seconds(text), Ok(Some(expected)), "{text}");
        }
        for text in ["0", "UNLIMITED", "infinite"] {
            assert_eq!(seconds(text), Ok(None), "{text}");
        }
        for (text, says) in [
            ("25h", "D-HH:MM:SS; 25h is 1-01:00:00"),
            ("90min", "; 90min is 0-01:30:00"),
            ("1.5 d", "; 1.5 d is 1-12:00:00"),
            ("2 weeks", "or D-HH:MM:SS"),
            ("1:2:3:4", "or D-HH:MM:SS"),
            ("1-", "or D-HH:MM:SS"),
            ("-1", "or D-HH:MM:SS"),
            ("+5", "or D-HH:MM:SS"),
            ("", "one line"),
            ("99999999999", "or D-HH:MM:SS"),
        ] {
            let said = seconds(text).expect_err(text);
            assert!(said.contains(says), "{text}: {said}");
        }
    }
}
