//! Neighbouring beads, as a person names them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::Range;
use std::str::FromStr;

/// Beads in a row: `100..200`, `100..`, `..200` without the last bead, `100..=199` with it, `-4..` for the last four. In a
/// configuration also a single one: `3`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "Written", into = "Written")]
pub struct Beads {
    /// The first bead; counted from behind the last one if it is negative.
    pub from: i64,
    /// The bead behind the last of them, counted in the same way; none for the end of the chain.
    pub to: Option<i64>,
}

#[derive(Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "a bead, or beads such as \"0..4\", \"..4\" or \"-4..\"")]
enum Written {
    One(i64),
    Row(#[schemars(regex(pattern = r"^([+-]?[0-9]+)?\.\.(=?[+-]?[0-9]+)?$"))] String),
}

impl Beads {
    /// `bead` alone, or the beads from `from` to `bead` where that is given.
    fn up_to(from: Option<i64>, bead: i64) -> Self {
        // behind the last bead is the end of the chain
        Self { from: from.unwrap_or(bead), to: (bead != -1).then(|| bead.saturating_add(1)) }
    }

    /// The same beads, counted from bead 0 of a chain of `count`.
    pub(crate) fn counted(self, count: u64) -> Self {
        let count = count.cast_signed();
        let from_0 = |place: i64| if place < 0 { place.saturating_add(count) } else { place };
        Self { from: from_0(self.from), to: Some(self.to.map_or(count, from_0)) }
    }

    /// These beads of a chain; none unless they are counted from bead 0, as those of a resolved run are.
    pub fn range(self) -> Range<usize> {
        let place = |place: i64| usize::try_from(place).unwrap_or(0);
        place(self.from)..place(self.to.unwrap_or(0))
    }

    /// The beads of a chain of `count`.
    ///
    /// # Errors
    /// The values found and the beads of the chain.
    pub fn of(self, count: u64) -> Result<Range<usize>, String> {
        let counted = self.counted(count);
        let to = counted.to.unwrap_or(0);
        let refuse = |what: &str| {
            Err(format!("{}..{to}: {what}; the chain has beads 0 to {}", counted.from, count - 1))
        };
        if counted.from >= to {
            return refuse("expected at least one bead");
        }
        if counted.from < 0 || to > count.cast_signed() {
            return refuse("some of these do not exist");
        }
        Ok(counted.range())
    }
}

impl FromStr for Beads {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let row = text.split_once("..").and_then(|(from, to)| {
            let number = |text: &str| if text.is_empty() { Some(None) } else { text.parse().ok().map(Some) };
            let from: Option<i64> = number(from)?;
            match to.strip_prefix('=') {
                Some(last) => Some(Self::up_to(from.or(Some(0)), number(last)??)),
                None => Some(Self { from: from.unwrap_or(0), to: number(to)? }),
            }
        });
        let allowed = "100..200 (without bead 200), 100..=199, 100.., ..200 or -4.. (the last four)";
        row.ok_or_else(|| format!("expected beads as in {allowed}"))
    }
}

impl TryFrom<Written> for Beads {
    type Error = String;

    fn try_from(written: Written) -> Result<Self, String> {
        match written {
            Written::One(bead) => Ok(Self::up_to(None, bead)),
            Written::Row(row) => row.parse().map_err(|why| format!("found \"{row}\"; {why}")),
        }
    }
}

impl From<Beads> for Written {
    fn from(beads: Beads) -> Self {
        Self::Row(beads.to_string())
    }
}

impl fmt::Display for Beads {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}..", self.from)?;
        self.to.map_or(Ok(()), |to| write!(f, "{to}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn beads_are_counted_from_either_end() {
        for (text, expected) in [
            ("0..4", 0..4),
            ("..4", 0..4),
            ("-4..", 6..10),
            ("-4..-1", 6..9),
            ("..", 0..10),
            ("2..=5", 2..6),
            ("..=-1", 0..10),
        ] {
            let beads: Beads = text.parse().expect(text);
            assert_eq!((beads.counted(10).range(), beads.of(10)), (expected.clone(), Ok(expected)), "{text}");
            assert_eq!(beads.to_string().parse(), Ok(beads));
        }
        for text in ["4", "a..4", "0..4..5", "1.5..", "2..="] {
            assert!(text.parse::<Beads>().expect_err(text).contains("-4.."), "{text}");
        }
        for text in ["5..5", "3..11", "-11..", "9..2"] {
            let why = text.parse::<Beads>().expect(text).of(10).expect_err(text);
            assert!(why.contains("the chain has beads 0 to 9"), "{text}: {why}");
        }
    }
}
