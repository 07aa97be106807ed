//! Rows of any analysis, made again of their frames with the settings that the rows tell.
//!
//! A row may depend on the frames before. Then the analysis may have begun with the first state that there is or with its
//! first row. Another beginning, or frames that it missed, cannot be known: then a row that differs is not wrong.

use super::{Compared, is_same};
use consumers::analysis::{Analysis, Beginning, LastRow, Offer, Refusal, Remake, Settings};
use recording::RecordedRow;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use schemas::results::RowValues;

/// The rows of one topic.
pub(super) struct RemadeRows {
    offer: &'static Offer,
    /// Names of the columns of rows about things of their own, which have the numbers of these in front and are filled up with NaN.
    filled: Vec<&'static str>,
    begun: Option<Begun>,
    /// Number of the last row's frame.
    last: Option<u64>,
    /// False if the analysis may have begun, or gone on, with frames that are not known.
    is_sure: bool,
}

/// The analysis with some settings.
struct Begun {
    told: Told,
    /// Begun with the first frame and, where rows depend on those before, with the first row, too; without those that differed
    /// where another did not.
    analyses: Vec<Box<dyn Analysis>>,
    /// Names of its columns, where the file tells them, too.
    names: Option<String>,
}

/// Values of settings, as a row tells them.
type Told = Vec<(&'static str, Vec<String>)>;

impl RemadeRows {
    /// The rows of `topic`, if they can be made again.
    pub(super) fn of(topic: &str) -> Option<Self> {
        let name = topic.strip_prefix('/')?;
        let (name, is_added) = name.strip_prefix("own/").map_or((name, false), |name| (name, true));
        let offer = analyses::named(name).filter(|offer| analyses::is_added(offer) == is_added)?;
        let can_be = !matches!(offer.needs.remake, Remake::Not);
        let filled = offer.columns.iter().map(|column| column.name).collect();
        can_be.then_some(Self { offer, filled, begun: None, last: None, is_sure: true })
    }

    /// The settings that a row tells, of columns with these names.
    fn told(&self, names: &[&str], row: &RecordedRow) -> Told {
        match &self.offer.needs.remake {
            Remake::Not | Remake::OfFrame => Vec::new(),
            Remake::OfThings(setting) => vec![(setting, row.things.iter().map(u64::to_string).collect())],
            Remake::OfTolerance(setting) => {
                vec![(
                    setting,
                    row.tolerance_m.iter().map(|tolerance_m| format!("{tolerance_m:e}")).collect(),
                )]
            }
            Remake::OfFramesBefore(setting) => {
                vec![(setting, row.threshold.iter().map(|threshold| format!("{threshold:e}")).collect())]
            }
            Remake::OfNames { setting, also, value } => {
                let mut told = vec![(*setting, names.iter().copied().filter_map(value).collect())];
                told.extend(also.iter().map(|setting| (*setting, Vec::new())));
                told
            }
        }
    }

    fn begin(&self, manifest: &RunManifest, told: Told) -> Result<Begun, Refusal> {
        let mut settings = Settings::default();
        for (name, values) in &told {
            let known = self.offer.settings.iter().find(|setting| setting.name == *name);
            let set = known.map(|setting| settings.set(setting, values.clone()));
            set.transpose().map_err(|(found, why)| Refusal::of(name, found, why))?;
        }
        let analysis = (self.offer.begin)(&Beginning::whole(self.offer.name, manifest, &settings))?;
        // things and classes have the names of their message
        let are_told = matches!(self.offer.needs.remake, Remake::OfFrame | Remake::OfNames { .. });
        let columns = self.offer.published(&*analysis).filter(|_| are_told);
        Ok(Begun { told, analyses: vec![analysis], names: columns.map(|columns| columns.names) })
    }

    /// Looks at `frame`, and compares `row`, of columns with these names, if it is the one of this frame.
    pub(super) fn take(
        &mut self,
        manifest: &RunManifest,
        frame: &Frame<'_>,
        names: &[&str],
        row: &RecordedRow,
    ) -> Option<Compared> {
        let is_row = row.frame == frame.frame;
        let follows = matches!(self.offer.needs.remake, Remake::OfFramesBefore(_));
        if !is_row && !follows {
            return None;
        }
        let told = self.told(names, row);
        let begins_with_row = follows && is_row && self.last.is_none();
        if begins_with_row || self.begun.as_ref().is_none_or(|begun| begun.told != told) {
            let mut begun = match self.begin(manifest, told) {
                Ok(begun) => begun,
                Err(refusal) => return Some(Compared::Differs(refusal.to_string())),
            };
            let before = self.begun.take().filter(|before| before.told == begun.told);
            begun.analyses.extend(before.into_iter().flat_map(|before| before.analyses));
            self.begun = Some(begun);
            self.is_sure &= self.last.is_none();
        }
        if follows && is_row {
            let is_next = self.last.map_or(frame.step == 0, |last| last.checked_add(1) == Some(row.frame));
            self.is_sure &= is_next && row.threshold.is_some();
            self.last = Some(row.frame);
        }
        let Begun { analyses, names: own_names, .. } = self.begun.as_mut()?;
        if let Some(own) = own_names.as_ref().filter(|own| own.split(',').ne(names.iter().copied())) {
            let what = format!("its columns are {}, those of the analysis {own}", names.join(","));
            return Some(Compared::Differs(what));
        }
        let names = if follows { &self.filled } else { names };
        let mut differ = Vec::new();
        for analysis in &mut *analyses {
            let mut made = LastRow::read();
            analysis.observe(frame, &mut made);
            differ.extend(is_row.then(|| differs(&made, row, names, follows)));
        }
        if differ.iter().any(Option::is_none) {
            let mut each = differ.iter();
            analyses.retain(|_| each.next().is_some_and(Option::is_none));
            return Some(Compared::Same);
        }
        let what = differ.into_iter().flatten().next()?;
        Some(if follows && !self.is_sure { Compared::Unknown } else { Compared::Differs(what) })
    }
}

/// Difference between a row and the one made, which may be filled up with NaN.
fn differs(made: &LastRow, row: &RecordedRow, names: &[&str], is_filled: bool) -> Option<String> {
    match (made.values(), row.values.lend()) {
        (Some(RowValues::Numbers(made)), RowValues::Numbers(found)) if is_filled => {
            let filler = vec![f64::NAN; made.len().saturating_sub(found.len())];
            numbers_differ(made, &[found, &filler].concat(), names)
        }
        (Some(RowValues::Numbers(made)), RowValues::Numbers(found)) => numbers_differ(made, found, names),
        (Some(RowValues::Classes(made)), RowValues::Classes(found)) => classes_differ(made, found),
        _ => Some("its values are of another type".to_owned()),
    }
}

fn numbers_differ(made: &[f64], found: &[f64], names: &[&str]) -> Option<String> {
    if made.len() != found.len() {
        return Some(format!("it has {} values, the state gives {}", found.len(), made.len()));
    }
    let differs = (0..made.len()).find(|column| !is_same(made[*column], found[*column]))?;
    // things and arrays have fewer names than values, in turn
    let name = names.get(differs % names.len().max(1)).copied().unwrap_or_default();
    let (found, made) = (found[differs], made[differs]);
    Some(format!("{name} is {found:e}, the state gives {made:e}"))
}

fn classes_differ(made: &[u8], found: &[u8]) -> Option<String> {
    let contact = made.iter().zip(found).position(|(made, found)| made != found)?;
    let (found, made) = (found[contact], made[contact]);
    Some(format!("the class of contact {contact} is {found}, the state gives {made}"))
}
