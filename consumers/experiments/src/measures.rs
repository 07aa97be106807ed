//! Numbers of any analysis, by name: those of its summary, `measure` of a sweep file, and those of its rows, `measure` of `[series]`.
//!
//! `ANALYSIS.COLUMN`, or `ANALYSIS.COLUMN@PLACE` where an analysis looks at one place. Numbers are those of the command of that
//! name with its defaults, or with others: `ANALYSIS(OPTION=VALUE;…).COLUMN`.

use analyses::{all, named};
use consumers::analysis::{
    Analysis, Beginning, LastRow, Meaning, Number, Offer, Refusal, Setting, Settings, Takes, Whereabouts,
};
use consumers::table::{Cell, Column};
use producer::sweep::MeasureOf;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use schemas::spelling::did_you_mean;

/// The ends of names that are units, which may be left out.
const UNITS: [&str; 13] =
    ["j", "n", "m", "s", "w", "hz", "beads", "beads2", "m_s", "n_s", "kg_m_s", "per_s", "beads_per_s"];

/// The place of `key` among `known`, and true if it is new there.
pub(crate) fn place_among<T: PartialEq>(known: &mut Vec<T>, key: T) -> (usize, bool) {
    let at = known.iter().position(|known| *known == key).unwrap_or(known.len());
    let is_new = at == known.len();
    known.extend(is_new.then_some(key));
    (at, is_new)
}

/// The numbers of an analysis that have a name whatever the settings.
fn numbers_of(kind: MeasureOf, offer: &'static Offer) -> impl Iterator<Item = &'static Meaning> {
    let numbers = if kind == MeasureOf::Rows { offer.columns } else { offer.numbers() };
    numbers.iter().filter(|number| number.has_own_name())
}

/// The number of this name, or the only one that it is without its unit.
fn number_of(kind: MeasureOf, offer: &'static Offer, asked: &str) -> Result<&'static Meaning, String> {
    if let Some(found) = numbers_of(kind, offer).find(|number| number.name == asked) {
        return Ok(found);
    }
    let unit = |name: &'static str| name.strip_prefix(asked)?.strip_prefix('_');
    let fits = |number: &&Meaning| unit(number.name).is_some_and(|unit| UNITS.contains(&unit));
    let mut fitting = numbers_of(kind, offer).filter(fits);
    if let (Some(found), None) = (fitting.next(), fitting.next()) {
        return Ok(found);
    }
    let known: Vec<&str> = numbers_of(kind, offer).map(|number| number.name).collect();
    if known.is_empty() {
        return Err(format!(
            "found `{asked}`; allowed: another analysis, {} has no rows of numbers with names",
            offer.name
        ));
    }
    let hint = did_you_mean(asked, known.iter().copied());
    let allowed = known.join(", ");
    Err(format!("found the unknown column `{asked}` of {}; allowed: {allowed}{hint}", offer.name))
}

/// The way to a number of each frame.
#[derive(Debug, Clone, Copy)]
pub(crate) enum InRow {
    /// A place in its row.
    Place(usize),
    /// A number of the summary, which is of the last frame.
    Number(&'static str),
}

/// A number that a sweep asks for.
pub(crate) struct Measure<'a> {
    pub(crate) offer: &'static Offer,
    pub(crate) number: &'static Meaning,
    place: Option<&'a str>,
    /// Its options as they are written, between `;`.
    options: &'a str,
}

impl<'a> Measure<'a> {
    pub(crate) fn parse(kind: MeasureOf, text: &'a str) -> Result<Self, String> {
        let (name, place) = match text.split_once('@') {
            Some((name, place)) => (name, Some(place)),
            None => (text, None),
        };
        let every = || all().map(|offer| offer.name).collect::<Vec<_>>().join(", ");
        let parts = match name.split_once('(') {
            Some((analysis, rest)) => {
                rest.split_once(").").map(|(options, column)| (analysis, options, column))
            }
            None => name.split_once('.').map(|(analysis, column)| (analysis, "", column)),
        };
        let Some((analysis, options, column)) = parts else {
            return Err(format!(
                "found `{text}`; allowed: the column of an analysis, such as `energies.driven_j` or `forces.peak_n@right`, of {}",
                every()
            ));
        };
        let Some(offer) = named(analysis) else {
            let hint = did_you_mean(analysis, all().map(|offer| offer.name));
            return Err(format!("found the unknown analysis `{analysis}`; allowed: {}{hint}", every()));
        };
        let number = number_of(kind, offer, column)?;
        let measure = Self { offer, number, place, options };
        measure.settings()?;
        let name = format!("{analysis}.{}", number.name);
        match (&offer.place, place) {
            (Whereabouts::Chain, Some(place)) => {
                Err(format!("found @{place}; allowed: `{name}` alone, which is of the whole chain"))
            }
            (Whereabouts::Of { allowed, .. }, None) => {
                Err(format!("found no place; allowed: `{name}@…`, {allowed}"))
            }
            (Whereabouts::Words(words), Some(place)) if !words.contains(&place) => {
                let words: Vec<String> = words.iter().map(|word| format!("@{word}")).collect();
                Err(format!("found @{place}; allowed: {}, or none of them", words.join(", ")))
            }
            _ => Ok(measure),
        }
    }

    /// The name of its column, with the unit.
    fn name(&self) -> String {
        let place = self.place.map_or_else(String::new, |place| format!("@{place}"));
        let options = if self.options.is_empty() { String::new() } else { format!("({})", self.options) };
        format!("{}{options}.{}{place}", self.offer.name, self.number.name)
    }

    /// The options and the place, if that is one: numbers that have both in common are of one analysis.
    pub(crate) fn key(&self) -> (&'static str, &'a str, Option<&'a str>) {
        let place = self.place.filter(|_| matches!(self.offer.place, Whereabouts::Of { .. }));
        (self.offer.name, self.options, place)
    }

    /// The way to the column's number in each frame that `analysis` looks at.
    pub(crate) fn in_rows_of(&self, analysis: &dyn Analysis) -> Result<InRow, String> {
        let name = self.number.name;
        if self.offer.needs.last_frame_only {
            return Ok(InRow::Number(name));
        }
        let published = self.offer.published(analysis).unwrap_or_default();
        let names: Vec<&str> = published.names.split(',').collect();
        if names.len() != published.width {
            let of = self.offer.name;
            return Err(format!(
                "found `{of}.{name}`, of which a frame has several; allowed: other analyses"
            ));
        }
        names.iter().position(|known| *known == name).map(InRow::Place).ok_or_else(|| {
            let (of, names) = (self.offer.name, &published.names);
            format!("found `{name}`, which is not in each row of {of}; allowed: {names}")
        })
    }

    /// The options that are written.
    fn settings(&self) -> Result<Settings, String> {
        let mut settings = Settings::default();
        for option in self.options.split(';').filter(|option| !option.is_empty()) {
            let (name, values) = match option.split_once('=') {
                Some((name, value)) => (name, vec![value.to_owned()]),
                None => (option, Vec::new()),
            };
            let known = self.offer.settings;
            let takes = |setting: &&Setting| matches!(setting.takes, Takes::Nothing) == values.is_empty();
            let Some(setting) = known.iter().filter(takes).find(|setting| setting.name == name) else {
                let write = |setting: &Setting| match setting.takes {
                    Takes::Nothing => setting.name.to_owned(),
                    _ => format!("{}=…", setting.name),
                };
                let allowed: Vec<String> = known.iter().map(write).collect();
                let allowed = if allowed.is_empty() { "none".to_owned() } else { allowed.join(", ") };
                return Err(format!(
                    "found the option `{option}` of {}; allowed: {allowed}",
                    self.offer.name
                ));
            };
            if settings.is_set(setting.name) {
                return Err(format!(
                    "found the option `{option}` after another `{name}`; allowed: each once"
                ));
            }
            if let Whereabouts::Of { setting: place, also, allowed } = &self.offer.place
                && (setting.name == *place || also.contains(&setting.name))
            {
                return Err(format!(
                    "found the option `{option}`, which the place behind @ sets; allowed: {allowed}"
                ));
            }
            settings.set(setting, values).map_err(|(found, why)| format!("found {name}={found}: {why}"))?;
        }
        Ok(settings)
    }

    pub(crate) fn has_no_options(&self) -> bool {
        self.options.is_empty()
    }

    /// Begins to look at a run.
    pub(crate) fn begin(&self, manifest: &RunManifest, is_trial: bool) -> Result<Box<dyn Analysis>, String> {
        self.begin_with(&self.settings()?, manifest, is_trial)
    }

    /// The same with these settings, and the place.
    pub(crate) fn begin_with(
        &self,
        settings: &Settings,
        manifest: &RunManifest,
        is_trial: bool,
    ) -> Result<Box<dyn Analysis>, String> {
        let mut settings = settings.clone();
        if let (Whereabouts::Of { setting, also, allowed }, Some(place)) = (&self.offer.place, self.place) {
            for known in self.offer.settings {
                let set = if known.name == *setting {
                    settings.set(known, vec![place.to_owned()])
                } else if also.contains(&known.name) {
                    settings.set(known, Vec::new())
                } else {
                    continue;
                };
                set.map_err(|(found, _)| format!("found @{found}; allowed: {allowed}"))?;
            }
        }
        let beginning = Beginning { is_trial, ..Beginning::whole(self.offer.name, manifest, &settings) };
        let begun = (self.offer.begin)(&beginning).map_err(|Refusal { setting, why }| match setting {
            Some((_, found)) => format!("found @{found}; {why}"),
            None => why,
        })?;
        match begun.too_coarse(manifest.provenance.publish_every_steps) {
            Some(why) => Err(format!("{why}; set stream.publish_every_steps to less")),
            None => Ok(begun),
        }
    }
}

/// The whole name of the column `text`, with its unit.
///
/// # Errors
/// When it is no number of an analysis, or none of the run of `manifest`: what was found, and what is allowed.
pub(crate) fn check(kind: MeasureOf, text: &str, manifest: Option<&RunManifest>) -> Result<String, String> {
    let measure = Measure::parse(kind, text)?;
    if let Some(manifest) = manifest {
        let analysis = measure.begin(manifest, true)?;
        if kind == MeasureOf::Rows {
            measure.in_rows_of(&*analysis)?;
        }
    }
    Ok(measure.name())
}

/// The columns of the numbers that are asked for, which were checked.
pub(crate) fn columns(asked: &[String]) -> impl Iterator<Item = Column> {
    let measures = asked.iter().filter_map(|text| Measure::parse(MeasureOf::Summary, text).ok());
    measures.map(|measure| Column::new(measure.name(), measure.number.kind))
}

/// An analysis that looks at the frames of a run.
enum Looking {
    /// One of those that every sweep has.
    Standard(&'static str),
    /// One that is asked for beside, with the last row that it gave.
    Beside { offer: &'static Offer, analysis: Box<dyn Analysis>, last: LastRow },
}

/// The analyses that look at the frames of a run for the numbers that are asked for.
#[derive(Default)]
pub(crate) struct Measures {
    /// Each analysis and place once.
    looking: Vec<Looking>,
    /// For each number which of these, its name there, and the word behind `@`.
    numbers: Vec<(usize, &'static str, Option<String>)>,
    has_seen: bool,
}

impl Measures {
    /// Begins to look at the run of `manifest`; somebody else looks at it for the analyses that are `standard`.
    ///
    /// # Errors
    /// The place in the list and what is wrong with it.
    pub(crate) fn new(
        asked: &[String],
        standard: &[&str],
        manifest: &RunManifest,
    ) -> Result<Self, (usize, String)> {
        let mut found = Vec::new();
        let mut measures = Self::default();
        for (i, text) in asked.iter().enumerate() {
            let wrong = |why| (i, why);
            let measure = Measure::parse(MeasureOf::Summary, text).map_err(wrong)?;
            let (at, is_new) = place_among(&mut found, measure.key());
            if is_new {
                measures.looking.push(
                    if standard.contains(&measure.offer.name) && measure.options.is_empty() {
                        Looking::Standard(measure.offer.name)
                    } else {
                        let analysis = measure.begin(manifest, false).map_err(wrong)?;
                        Looking::Beside { offer: measure.offer, analysis, last: LastRow::default() }
                    },
                );
            }
            measures.numbers.push((at, measure.number.name, measure.place.map(str::to_owned)));
        }
        Ok(measures)
    }

    pub(crate) fn observe(&mut self, frame: &Frame<'_>) {
        self.has_seen = true;
        for looking in &mut self.looking {
            if let Looking::Beside { offer, analysis, last } = looking
                && !offer.needs.last_frame_only
            {
                analysis.observe(frame, last);
            }
        }
    }

    /// Ends after the frame `last`: a value for each number. One that is not finite does not exist, nor does any without a frame. `standard`
    /// gives those of standard analyses, by the analysis, the number and the word behind `@`.
    pub(crate) fn finish(
        mut self,
        last: &Frame<'_>,
        standard: impl Fn(&str, &str, Option<&str>) -> Option<Number>,
    ) -> Vec<Cell> {
        for looking in &mut self.looking {
            let Looking::Beside { offer, analysis, last: row } = looking else { continue };
            if offer.needs.last_frame_only {
                analysis.observe(last, row);
            }
            // too few frames: its numbers do not exist
            let _ = analysis.finish(row);
        }
        let value = |(at, name, word): &(usize, &str, Option<String>)| -> Option<Number> {
            match &self.looking[*at] {
                Looking::Standard(analysis) => standard(analysis, name, word.as_deref()),
                Looking::Beside { .. } if !self.has_seen => None,
                Looking::Beside { offer, analysis, last } => {
                    last.value(offer, &**analysis, name, word.as_deref())
                }
            }
        };
        self.numbers.iter().map(|number| value(number).map_or(Cell::Empty, Cell::from)).collect()
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
            ("heat.current", "heat.current_w"),
            ("lyapunov.exponent", "lyapunov.exponent_per_s"),
            ("pulses.momentum", "pulses.momentum_kg_m_s"),
            ("modal(threshold=0.1).equipartition", "modal(threshold=0.1).equipartition_s"),
        ] {
            let parsed = Measure::parse(MeasureOf::Summary, text);
            assert_eq!(parsed.map(|measure| measure.name()), Ok(name.to_owned()));
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
            (
                "modal(treshold=1).equipartition_s",
                "found the option `treshold=1` of modal; allowed: threshold=…",
            ),
            (
                "modal(threshold).equipartition_s",
                "found the option `threshold` of modal; allowed: threshold=…",
            ),
            ("modal(threshold=-1).equipartition_s", "found threshold=-1: "),
            ("contacts(a=1).open_count", "found the option `a=1` of contacts; allowed: "),
            (
                "modal(threshold=1;threshold=2).equipartition_s",
                "after another `threshold`; allowed: each once",
            ),
            ("forces(at=bead:3).peak_n@6", "found the option `at=bead:3`, which the place behind @ sets"),
            ("modal(threshold=1.equipartition_s", "allowed: the column of an analysis"),
            ("pulses.bead@up", "found @up; allowed: @forward, @backward"),
        ] {
            let said = check(MeasureOf::Summary, text, None).expect_err(text);
            assert!(said.contains(says), "{text}: {said}");
        }
    }

    #[test]
    fn kinds_are_those_of_values() {
        assert!(
            all()
                .flat_map(consumers::analysis::Offer::numbers)
                .all(|number| number.kind != consumers::table::Kind::Word)
        );
    }
}
