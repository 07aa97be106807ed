//! Other processes of the bench: each does one thing, and says on stdout what came of it.

use crate::bare_bus::{BareListener, BareSubscriber};
use crate::report::print;
use anyhow::{Error, anyhow};
use bus::{AttachOptions, Bus, Delivery, LiveSource};
use rustix::time::{ClockId, clock_gettime};
use schemas::frame::{FrameSource as _, Received};
use schemas::run_name::RunName;
use std::fmt::Write as _;
use std::io;
use std::time::Duration;

/// Silence after which a listener takes the bench for ended.
const SILENCE: Duration = Duration::from_secs(2);

/// Word of both sides when a process can be measured.
pub(super) const ATTACHED: &str = "attached";
pub(super) const READY: &str = "ready";

/// Does the part that these words name.
pub(crate) fn run(words: &[&str]) -> Result<(), Error> {
    match *words {
        ["sum", name, count] => sum_slices(name, count.parse()?),
        ["listen", name] => listen(name),
        ["receive", name] => receive(&name.parse().map_err(|error: String| anyhow!(error))?),
        _ => Err(anyhow!("the bench has no part `{}`", words.join(" "))),
    }
}

fn say(line: &str) -> Result<(), Error> {
    print(format_args!("{line}\n"))
}

/// Nanoseconds of a clock that all processes share.
pub(super) fn now_ns() -> Result<u64, Error> {
    let now = Duration::try_from(clock_gettime(ClockId::Monotonic))?;
    Ok(u64::try_from(now.as_nanos())?)
}

/// Prints the sum of `count` slices from a bare publisher.
fn sum_slices(name: &str, count: u64) -> Result<(), Error> {
    let bus = Bus::from_env()?;
    let subscriber = BareSubscriber::create(&bus, name)?;
    say(ATTACHED)?;
    io::stdin().read_line(&mut String::new())?;
    if subscriber.receive(|_| {})? {
        return Err(anyhow!("a slice came before its time"));
    }
    say(READY)?;
    let mut total = 0.0;
    for _ in 0..count {
        subscriber.await_next(|doubles| total += sum(doubles))?;
    }
    say(&total.to_string())
}

/// Sums in eight parts: each addition to a single sum would wait for the one before.
fn sum(doubles: &[f64]) -> f64 {
    let (chunks, rest) = doubles.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for chunk in chunks {
        sums.iter_mut().zip(chunk).for_each(|(sum, x)| *sum += x);
    }
    sums.iter().chain(rest).sum()
}

/// Prints the time of each wake-up.
fn listen(name: &str) -> Result<(), Error> {
    let bus = Bus::from_env()?;
    let listener = BareListener::create(&bus, name)?;
    say(READY)?;
    let mut times = String::new();
    while listener.wait(SILENCE)? {
        writeln!(times, "{}", now_ns()?)?;
    }
    say(times.trim_end())
}

/// Prints the time at which each frame of a run came.
fn receive(name: &RunName) -> Result<(), Error> {
    let bus = Bus::from_env()?;
    let mut source = LiveSource::attach(&bus, Some(name), Delivery::Lossless, &AttachOptions::default())?;
    let mut times = String::new();
    loop {
        match source.receive()? {
            Received::Frame(_) => writeln!(times, "{}", now_ns()?)?,
            Received::Missed { .. } => return Err(anyhow!("the bench lost frames")),
            Received::End(_) => return say(times.trim_end()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sums_are_of_all_doubles() {
        let doubles: Vec<_> = (1..=19).map(f64::from).collect();
        assert_eq!(sum(&doubles), 190.0);
    }
}
