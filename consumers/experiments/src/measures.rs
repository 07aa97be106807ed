//! Columns of any analysis, by name: what `measure` of a sweep file may name.
//!
//! `ANALYSIS.COLUMN`, or `ANALYSIS.COLUMN@PLACE` where an analysis looks at one place. [`KNOWN`] has all of them. Numbers are
//! those of the command of that name with its defaults.

mod looks;

use crate::analyses::Analyses;
use consumers::contacts::ContactCounts;
use consumers::energies::EnergyRow;
use consumers::spreading::SpreadingRow;
use consumers::table::{Cell, Column, Kind};
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use schemas::spelling::did_you_mean;

/// An analysis, and what can be asked of it.
struct Known {
    name: &'static str,
    /// Whole numbers and other numbers of its summary.
    counts: &'static [&'static str],
    numbers: &'static [&'static [&'static str]],
    /// Places that it looks at; empty if it is of the whole chain.
    places: &'static str,
    /// Begins to look at a run, at that place.
    begin: Begin,
}

type Begin = fn(&RunManifest, Option<&str>) -> Result<Box<dyn Look>, String>;

/// Looks at the frames of a run for one analysis at one place.
trait Look {
    /// Does what takes long and is needed for a run alone, not to check that it can be looked at.
    fn prepare(&mut self) -> Result<(), String> {
        Ok(())
    }

    fn observe(&mut self, _: &Frame<'_>) {}

    /// There are no more frames after `last`.
    fn finish(&mut self, _last: &Frame<'_>, _: &Analyses) {}

    /// The value of a column at the end of the run, if there is one.
    fn value(&self, column: &str) -> Option<Value>;
}

/// The value of a column.
enum Value {
    Count(u64),
    Number(f64),
}

const BEADS: &str = "a bead such as @12";
const CONTACTS: &str = "a contact such as @12";
const PLACES: &str = "@12 for a bead, @contact:7, @left or @right for a wall";

/// Every analysis with a summary.
const KNOWN: [Known; 9] = [
    Known {
        name: "energies",
        counts: &["split_bead"],
        numbers: &[&EnergyRow::COLUMNS, &looks::REFLECTED],
        places: "",
        begin: looks::energies,
    },
    Known {
        name: "impurity",
        counts: &["event_count", "turn_count"],
        numbers: &[&["u_m", "v_m_s", "overlap_left_m", "overlap_right_m"]],
        places: BEADS,
        begin: looks::impurity,
    },
    Known {
        name: "contacts",
        counts: &ContactCounts::COLUMNS,
        numbers: &[],
        places: "",
        begin: looks::contacts,
    },
    Known {
        name: "pulses",
        counts: &["pulse_count", "bead"],
        numbers: &[&looks::PULSE],
        places: "@forward or @backward, or nothing for both directions",
        begin: looks::pulses,
    },
    Known {
        name: "spreading",
        counts: &[],
        numbers: &[&SpreadingRow::COLUMNS],
        places: "",
        begin: looks::spreading,
    },
    Known {
        name: "deformation",
        counts: &["later_pulse_count"],
        numbers: &[&looks::DEFORMATION],
        places: CONTACTS,
        begin: looks::deformation,
    },
    Known {
        name: "forces",
        counts: &["peak_count"],
        numbers: &[&["peak_n", "peak_time_s", "peak_width_s", "peak_above_s", "rest_force_n"]],
        places: PLACES,
        begin: looks::forces,
    },
    Known {
        name: "spectrum",
        counts: &[],
        numbers: &[&["peak_hz", "peak_density", "mean_square"]],
        places: PLACES,
        begin: looks::spectrum,
    },
    Known {
        name: "modes",
        counts: &["centre_bead"],
        numbers: &[&["frequency_hz", "participation_beads", "largest_j", "last_j"]],
        places: "a mode such as @1, the lowest",
        begin: looks::modes,
    },
];

/// The ends of names that are units, which may be left out.
const UNITS: [&str; 10] = ["j", "n", "m", "s", "hz", "beads", "beads2", "m_s", "n_s", "beads_per_s"];

impl Known {
    fn needs_place(&self) -> bool {
        !self.places.is_empty() && !self.places.contains("nothing")
    }

    fn columns(&self) -> impl Iterator<Item = (&'static str, Kind)> {
        let counts = self.counts.iter().map(|name| (*name, Kind::Integer));
        counts.chain(self.numbers.iter().flat_map(|names| names.iter()).map(|name| (*name, Kind::Double)))
    }

    /// The column of this name, or the only one that it is without its unit.
    fn column(&self, asked: &str) -> Result<(&'static str, Kind), String> {
        if let Some(found) = self.columns().find(|(name, _)| *name == asked) {
            return Ok(found);
        }
        let unit = |name: &'static str| name.strip_prefix(asked)?.strip_prefix('_');
        let mut fitting =
            self.columns().filter(|(name, _)| unit(name).is_some_and(|unit| UNITS.contains(&unit)));
        if let (Some(found), None) = (fitting.next(), fitting.next()) {
            return Ok(found);
        }
        let known: Vec<&str> = self.columns().map(|(name, _)| name).collect();
        let hint = did_you_mean(asked, known.iter().copied());
        Err(format!(
            "found the unknown column `{asked}` of {}; allowed: {}{hint}",
            self.name,
            known.join(", ")
        ))
    }
}

/// A column that a sweep asks for.
struct Measure<'a> {
    known: &'static Known,
    column: &'static str,
    kind: Kind,
    place: Option<&'a str>,
}

impl<'a> Measure<'a> {
    fn parse(text: &'a str) -> Result<Self, String> {
        let (name, place) = match text.split_once('@') {
            Some((name, place)) => (name, Some(place)),
            None => (text, None),
        };
        let analyses = || KNOWN.iter().map(|known| known.name);
        let all = || analyses().collect::<Vec<_>>().join(", ");
        let Some((analysis, column)) = name.split_once('.') else {
            return Err(format!(
                "found `{text}`; allowed: the column of an analysis, such as `energies.driven_j` or `forces.peak_n@right`, of {}",
                all()
            ));
        };
        let Some(known) = KNOWN.iter().find(|known| known.name == analysis) else {
            let hint = did_you_mean(analysis, analyses());
            return Err(format!("found the unknown analysis `{analysis}`; allowed: {}{hint}", all()));
        };
        let (column, kind) = known.column(column)?;
        match place {
            Some(place) if known.places.is_empty() => Err(format!(
                "found @{place}; allowed: `{analysis}.{column}` alone, which is of the whole chain"
            )),
            None if known.needs_place() => {
                Err(format!("found no place; allowed: `{analysis}.{column}@…`, {}", known.places))
            }
            _ => Ok(Self { known, column, kind, place }),
        }
    }

    /// The name of its column, with the unit.
    fn name(&self) -> String {
        let place = self.place.map_or_else(String::new, |place| format!("@{place}"));
        format!("{}.{}{place}", self.known.name, self.column)
    }
}

/// The whole name of the column `text`, with its unit.
///
/// # Errors
/// When it is no column of an analysis, or none of the run of `manifest`: what was found, and what is allowed.
pub(crate) fn check(text: &str, manifest: Option<&RunManifest>) -> Result<String, String> {
    let measure = Measure::parse(text)?;
    if let Some(manifest) = manifest {
        (measure.known.begin)(manifest, measure.place)?;
    }
    Ok(measure.name())
}

/// The columns of what is asked for, which was checked.
pub(crate) fn columns(asked: &[String]) -> impl Iterator<Item = Column> {
    let measures = asked.iter().filter_map(|text| Measure::parse(text).ok());
    measures.map(|measure| Column::new(measure.name(), measure.kind))
}

/// The looks at the frames of a run for the columns that are asked for.
#[derive(Default)]
pub(crate) struct Measures {
    /// Each analysis and place once.
    looks: Vec<Box<dyn Look>>,
    /// For each column which of these, and its name there.
    columns: Vec<(usize, &'static str)>,
}

impl Measures {
    /// Begins to look at the run of `manifest`.
    ///
    /// # Errors
    /// The place in the list and what is wrong with it.
    pub(crate) fn new(asked: &[String], manifest: &RunManifest) -> Result<Self, (usize, String)> {
        let mut found: Vec<(&str, Option<&str>)> = Vec::new();
        let mut measures = Self { looks: Vec::new(), columns: Vec::new() };
        for (i, text) in asked.iter().enumerate() {
            let wrong = |why| (i, why);
            let Measure { known, column, place, .. } = Measure::parse(text).map_err(wrong)?;
            let at = found.iter().position(|known_at| *known_at == (known.name, place));
            let at = if let Some(at) = at {
                at
            } else {
                let mut look = (known.begin)(manifest, place).map_err(wrong)?;
                look.prepare().map_err(wrong)?;
                measures.looks.push(look);
                found.push((known.name, place));
                found.len() - 1
            };
            measures.columns.push((at, column));
        }
        Ok(measures)
    }

    pub(crate) fn observe(&mut self, frame: &Frame<'_>) {
        self.looks.iter_mut().for_each(|look| look.observe(frame));
    }

    /// There are no more frames after `last`: a value for each column. A number that is not finite does not exist.
    pub(crate) fn finish(mut self, last: &Frame<'_>, analyses: &Analyses) -> Vec<Cell> {
        self.looks.iter_mut().for_each(|look| look.finish(last, analyses));
        let cell = |(at, column): &(usize, &str)| match self.looks[*at].value(column) {
            Some(Value::Count(count)) => Cell::Integer(count),
            Some(Value::Number(number)) if number.is_finite() => Cell::Double(number),
            _ => Cell::Empty,
        };
        self.columns.iter().map(cell).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_columns_with_or_without_their_units() {
        for (text, name) in [
            ("energies.driven_j", "energies.driven_j"),
            ("spreading.participation", "spreading.participation_beads"),
            ("forces.peak@right", "forces.peak_n@right"),
            ("pulses.v_peak@forward", "pulses.v_peak_m_s@forward"),
            ("spectrum.peak_hz@12", "spectrum.peak_hz@12"),
        ] {
            assert_eq!(Measure::parse(text).map(|measure| measure.name()), Ok(name.to_owned()));
        }
    }

    #[test]
    fn what_is_unknown_is_refused_with_what_is_allowed() {
        for (text, says) in [
            ("driven_j", "found `driven_j`; allowed: the column of an analysis"),
            ("enrgies.driven_j", "unknown analysis `enrgies`; allowed: energies, impurity"),
            ("enrgies.driven_j", "; did you mean `energies`?"),
            ("energies.drivn_j", "unknown column `drivn_j` of energies; allowed: split_bead, kinetic_j"),
            ("energies.drivn_j", "; did you mean `driven_j`?"),
            ("energies.driven_j@3", "found @3; allowed: `energies.driven_j` alone"),
            ("forces.peak_n", "found no place; allowed: `forces.peak_n@…`, @12 for a bead"),
        ] {
            let said = check(text, None).expect_err(text);
            assert!(said.contains(says), "{text}: {said}");
        }
    }

    /// CONFIGURATION names every column of every analysis; those of theories by the beginnings of their names.
    #[test]
    fn every_column_is_documented() {
        let page = include_str!("../../../docs/CONFIGURATION.md");
        for known in &KNOWN {
            let row = page.lines().find(|line| line.starts_with(&format!("| `{}` | ", known.name)));
            let row = row.unwrap_or_else(|| panic!("{} is not documented", known.name));
            for (column, _) in known.columns() {
                let column = column.strip_prefix("exact_").unwrap_or(column);
                let column = column.strip_prefix("continuum_").unwrap_or(column);
                assert!(row.contains(&format!("`{column}`")), "{column} of {} is not documented", known.name);
            }
        }
    }

    /// A name stands for one column.
    #[test]
    fn no_analysis_has_two_columns_of_one_name() {
        for known in &KNOWN {
            let names: Vec<&str> = known.columns().map(|(name, _)| name).collect();
            assert!((1..names.len()).all(|i| !names[..i].contains(&names[i])), "{}: {names:?}", known.name);
        }
    }
}
