//! Neighbouring beads, as a person names them.

use std::ops::Range;
use std::str::FromStr;

/// A range of beads; an end that is not given is the chain's.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct BeadRange {
    /// The first bead.
    pub from: Option<u64>,
    /// The bead after the last one.
    pub to: Option<u64>,
}

impl BeadRange {
    /// The beads of a chain of `count`.
    ///
    /// # Errors
    /// The values found and the beads of the chain.
    pub fn of(self, count: u64) -> Result<Range<usize>, String> {
        let (from, to) = (self.from.unwrap_or(0), self.to.unwrap_or(count));
        let refuse =
            |what: &str| Err(format!("{from}..{to}: {what}; the chain has beads 0 to {}", count - 1));
        if from >= to {
            return refuse("expected at least one bead");
        }
        if to > count {
            return refuse("some of these do not exist");
        }
        let index = |bead: u64| usize::try_from(bead).map_err(|error| error.to_string());
        Ok(index(from)?..index(to)?)
    }
}

impl FromStr for BeadRange {
    type Err = String;

    /// `100..200`, `100..`, `..200` without the last bead, `100..=199` with it.
    fn from_str(text: &str) -> Result<Self, String> {
        let range = text.split_once("..").and_then(|(from, to)| {
            let (to, added) = to.strip_prefix('=').map_or((to, 0), |to| (to, 1));
            let number = |text: &str| if text.is_empty() { Some(None) } else { text.parse().ok().map(Some) };
            let (from, to): (Option<u64>, Option<u64>) = (number(from)?, number(to)?);
            let to = if added == 1 { Some(to?.checked_add(1)?) } else { to };
            Some(Self { from, to })
        });
        range.ok_or_else(|| {
            "expected beads as in 100..200 (without bead 200), 100..=199, 100.. or ..200".to_owned()
        })
    }
}
