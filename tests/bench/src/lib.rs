//! Measuring this machine: each figure beside its limit, alternately in one run, as ratios.
//!
//! The other sides are here, too: `baseline`, the loop that everybody writes first; `bare_bus` and `bare_mcap`, the
//! same bytes through nothing but iceoryx2 and mcap; `peers`, other people's programs. Whoever runs a [`Bench`] is a program
//! that has the commands of `beadline`: it is started again for what needs processes of their own ([`mod@part`]).

mod analyses;
mod bare_bus;
mod bare_mcap;
mod baseline;
pub mod child;
mod dynamics;
mod memory;
pub mod part;
mod peers;
mod recordings;
mod streaming;
mod sweep;

use anyhow::Error;
use recordings::Frames;
use serde::Serialize;
use std::cell::OnceCell;
use std::fmt::Write as _;
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Rows that belong together.
pub struct Group {
    /// One word.
    pub name: &'static str,
    /// What it measures, for the help.
    about: &'static str,
    measure: fn(&Bench, &mut dyn Audience) -> Result<(), Error>,
}

/// Every group, in the order of the table.
pub const GROUPS: [Group; 7] = [
    Group {
        name: "dynamics",
        about: "steps of the chain against a plain loop, and along its length",
        measure: dynamics::rows,
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
        name: "peers",
        about: "the same physics by LAMMPS, NumPy and Numba, as far as they are installed",
        measure: peers::rows,
    },
];

/// The groups as the help lists them.
pub fn list_of_groups() -> String {
    let mut text = String::from("Groups:\n");
    for group in &GROUPS {
        // writing to a String cannot fail
        let _ = writeln!(text, "  {:<12}{}", group.name, group.about);
    }
    text
}

/// Who hears of what is measured, as soon as it is.
pub trait Audience: Send {
    /// What comes now belongs to `group`.
    ///
    /// # Errors
    /// When nobody listens any more.
    fn begin(&mut self, group: &Group) -> Result<(), Error>;

    /// A row is finished.
    ///
    /// # Errors
    /// When nobody listens any more.
    fn row(&mut self, row: Row) -> Result<(), Error>;

    /// Something to know beside the rows.
    fn notice(&mut self, text: &str);
}

/// What the groups share.
pub struct Bench {
    rounds: u32,
    directory: TempDir,
    frames: OnceCell<Frames>,
}

impl Bench {
    /// A bench that measures each pair in so many rounds.
    ///
    /// # Errors
    /// When there is no room for its files.
    pub fn new(rounds: u32) -> Result<Self, Error> {
        Ok(Self { rounds, directory: tempfile::tempdir()?, frames: OnceCell::new() })
    }

    /// Measures the rows of `group`.
    ///
    /// # Errors
    /// When something cannot be measured, or nobody listens.
    pub fn measure(&self, group: &Group, report: &mut dyn Audience) -> Result<(), Error> {
        report.begin(group)?;
        (group.measure)(self, report)
    }

    /// The light-impurity run, recorded when a group first asks for it.
    fn frames(&self, report: &mut dyn Audience) -> Result<&Frames, Error> {
        if let Some(frames) = self.frames.get() {
            return Ok(frames);
        }
        report.notice("recording the light-impurity run");
        let frames = Frames::record_in(self.directory.path())?;
        Ok(self.frames.get_or_init(|| frames))
    }
}

/// A ratio measured in several rounds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Ratio {
    /// Of the rounds.
    pub median: f64,
    /// The least of them.
    pub least: f64,
    /// The most of them.
    pub most: f64,
}

/// What a ratio has to be.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Floor {
    /// A speed in that of the other.
    AtLeast(f64),
    /// A time in that of the other.
    AtMost(f64),
    /// A speed in that of the other, of which nothing is asked.
    Any,
}

/// One figure beside its limit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// What is measured.
    pub what: &'static str,
    /// What it is measured against.
    pub against: &'static str,
    /// What the ratio has to be.
    pub floor: Floor,
    /// What it is.
    pub ratio: Ratio,
    /// Our figure in a unit of its own, of the median round: of this machine today.
    pub figure: String,
}

/// Times of the two sides of a row, one for each round.
#[derive(Debug, Clone, Default)]
pub(crate) struct Rounds {
    pub(crate) ours_s: Vec<f64>,
    pub(crate) theirs_s: Vec<f64>,
}

impl Row {
    /// Whether the median keeps to the floor.
    pub fn is_met(&self) -> bool {
        match self.floor {
            Floor::AtLeast(floor) => self.ratio.median >= floor,
            Floor::AtMost(floor) => self.ratio.median <= floor,
            Floor::Any => true,
        }
    }
}

impl Rounds {
    /// Measures both sides `count` times, in turns, after one turn that only warms up.
    pub(crate) fn alternate(
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
    pub(crate) fn row(&self, what: &'static str, against: &'static str, floor: Floor, figure: String) -> Row {
        let ratio = if let Floor::AtMost(_) = floor { self.time() } else { self.speed() };
        Row { what, against, floor, ratio, figure }
    }

    /// Our speed in theirs.
    fn speed(&self) -> Ratio {
        Ratio::of(self.theirs_s.iter().zip(&self.ours_s).map(|(theirs, ours)| theirs / ours))
    }

    /// Our time in theirs.
    pub(crate) fn time(&self) -> Ratio {
        Ratio::of(self.ours_s.iter().zip(&self.theirs_s).map(|(ours, theirs)| ours / theirs))
    }

    /// The median of our times (s).
    pub(crate) fn ours_s(&self) -> f64 {
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

/// How long `work` takes.
pub(crate) fn timed<T>(work: impl FnOnce() -> Result<T, Error>) -> Result<Duration, Error> {
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
