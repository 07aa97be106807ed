//! Rows of any analysis, made again of their frames with the settings that the rows tell.

use super::is_same;
use consumers::analysis::{Analysis, Beginning, LastRow, Offer, Refusal, Remake, Settings};
use recording::RecordedRow;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use schemas::results::RowValues;

/// The rows of one topic.
pub(super) struct RemadeRows {
    offer: &'static Offer,
    /// The analysis, and the settings that it was begun with.
    analysis: Option<(Told, Box<dyn Analysis>)>,
}

/// Values of settings, as a row tells them.
type Told = Vec<(&'static str, Vec<String>)>;

impl RemadeRows {
    /// The rows of `topic`, if they can be made again.
    pub(super) fn of(topic: &str) -> Option<Self> {
        let name = topic.strip_prefix('/')?;
        let (name, is_added) = name.strip_prefix("own/").map_or((name, false), |name| (name, true));
        let offer = analyses::named(name).filter(|offer| analyses::is_added(offer) == is_added)?;
        (!matches!(offer.needs.remake, Remake::Not)).then_some(Self { offer, analysis: None })
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
            Remake::OfNames { setting, also, value } => {
                let mut told = vec![(*setting, names.iter().copied().filter_map(value).collect())];
                told.extend(also.iter().map(|setting| (*setting, Vec::new())));
                told
            }
        }
    }

    fn begin(&self, manifest: &RunManifest, told: &Told) -> Result<Box<dyn Analysis>, Refusal> {
        let mut settings = Settings::default();
        for (name, values) in told {
            let known = self.offer.settings.iter().find(|setting| setting.name == *name);
            let set = known.map(|setting| settings.set(setting, values.clone()));
            set.transpose().map_err(|(found, why)| Refusal::of(name, found, why))?;
        }
        (self.offer.begin)(&Beginning::whole(self.offer.name, manifest, &settings))
    }

    /// The difference between the row of `frame`, of columns with these names, and the one that the frame gives.
    pub(super) fn difference(
        &mut self,
        manifest: &RunManifest,
        frame: &Frame<'_>,
        names: &[&str],
        row: &RecordedRow,
    ) -> Option<String> {
        let told = self.told(names, row);
        if self.analysis.as_ref().is_none_or(|(known, _)| *known != told) {
            match self.begin(manifest, &told) {
                Ok(analysis) => self.analysis = Some((told, analysis)),
                Err(refusal) => return Some(refusal.to_string()),
            }
        }
        let (_, analysis) = self.analysis.as_mut()?;
        let mut made = LastRow::default();
        analysis.observe(frame, &mut made);
        let names = self.offer.published(&**analysis).map(|columns| columns.names).unwrap_or_default();
        match (made.values(), row.values.lend()) {
            (Some(RowValues::Numbers(made)), RowValues::Numbers(found)) => {
                numbers_differ(made, found, &names)
            }
            (Some(RowValues::Classes(made)), RowValues::Classes(found)) => classes_differ(made, found),
            _ => Some("its values are of another type".to_owned()),
        }
    }
}

fn numbers_differ(made: &[f64], found: &[f64], names: &str) -> Option<String> {
    if made.len() != found.len() {
        return Some(format!("it has {} values, the state gives {}", found.len(), made.len()));
    }
    let differs = (0..made.len()).find(|column| !is_same(made[*column], found[*column]))?;
    let (name, found, made) =
        (names.split(',').nth(differs).unwrap_or_default(), found[differs], made[differs]);
    Some(format!("{name} is {found:e}, the state gives {made:e}"))
}

fn classes_differ(made: &[u8], found: &[u8]) -> Option<String> {
    let contact = made.iter().zip(found).position(|(made, found)| made != found)?;
    let (found, made) = (found[contact], made[contact]);
    Some(format!("the class of contact {contact} is {found}, the state gives {made}"))
}
