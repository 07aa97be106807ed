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
    begun: Option<Begun>,
}

/// The analysis with some settings.
struct Begun {
    told: Told,
    analysis: Box<dyn Analysis>,
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
        (!matches!(offer.needs.remake, Remake::Not)).then_some(Self { offer, begun: None })
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
        Ok(Begun { told, analysis, names: columns.map(|columns| columns.names) })
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
        if self.begun.as_ref().is_none_or(|begun| begun.told != told) {
            match self.begin(manifest, told) {
                Ok(begun) => self.begun = Some(begun),
                Err(refusal) => return Some(refusal.to_string()),
            }
        }
        let Begun { analysis, names: own_names, .. } = self.begun.as_mut()?;
        if let Some(own) = own_names.as_ref().filter(|own| own.split(',').ne(names.iter().copied())) {
            return Some(format!("its columns are {}, those of the analysis {own}", names.join(",")));
        }
        let mut made = LastRow::default();
        analysis.observe(frame, &mut made);
        match (made.values(), row.values.lend()) {
            (Some(RowValues::Numbers(made)), RowValues::Numbers(found)) => numbers_differ(made, found, names),
            (Some(RowValues::Classes(made)), RowValues::Classes(found)) => classes_differ(made, found),
            _ => Some("its values are of another type".to_owned()),
        }
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
