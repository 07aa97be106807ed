//! The analyses, each in one file, and the one list of them.
//!
//! Whoever offers analyses iterates over [`all`] and names none: the command line, sweeps, the bus, Python, the documentation. An
//! analysis of one's own is a file like these; [`add`] lists it.

pub mod contacts;
pub mod correlations;
pub mod deformation;
pub mod energies;
pub mod forces;
pub mod heat;
pub mod impurity;
pub mod lyapunov;
pub mod modal;
pub mod modes;
mod places;
pub mod pulses;
pub mod spectrum;
pub mod spreading;

use consumers::analysis::Offer;
use std::sync::{PoisonError, RwLock};

/// Ours, in the order of the documentation.
static OURS: [&Offer; 13] = [
    &energies::OFFER,
    &impurity::OFFER,
    &contacts::OFFER,
    &pulses::OFFER,
    &spreading::OFFER,
    &deformation::OFFER,
    &forces::OFFER,
    &spectrum::OFFER,
    &modes::OFFER,
    &modal::OFFER,
    &lyapunov::OFFER,
    &heat::OFFER,
    &correlations::OFFER,
];

static ADDED: RwLock<Vec<&'static Offer>> = RwLock::new(Vec::new());

/// Every analysis: ours, and those that were added.
pub fn all() -> impl Iterator<Item = &'static Offer> + Clone {
    let added = ADDED.read().unwrap_or_else(PoisonError::into_inner).clone();
    OURS.into_iter().chain(added)
}

/// The analysis of this name.
pub fn named(name: &str) -> Option<&'static Offer> {
    all().find(|offer| offer.name == name)
}

/// True for an analysis that was added, whose rows go to `own/NAME`.
pub fn is_added(offer: &Offer) -> bool {
    OURS.iter().all(|ours| ours.name != offer.name)
}

/// Adds an analysis of one's own, before anything looks at the list. In place of an added one of the same name, the new one
/// is listed.
///
/// # Errors
/// When its name is no name, or that of one of ours.
pub fn add(offer: &'static Offer) -> Result<(), String> {
    let (name, is_letter) =
        (offer.name, |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit() || byte == b'-');
    if !name.bytes().all(is_letter) || name.starts_with('-') || !(1..=32).contains(&name.len()) {
        return Err(format!(
            "`{name}` is no name of an analysis; allowed: 1 to 32 characters of a-z, 0-9 and -, the first of them no -"
        ));
    }
    if OURS.iter().any(|ours| ours.name == name) {
        return Err(format!("there is an analysis `{name}` already; choose another name"));
    }
    let mut added = ADDED.write().unwrap_or_else(PoisonError::into_inner);
    added.retain(|other| other.name != name);
    added.push(offer);
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use consumers::analysis::{Beginning, Meaning, Settings, Whereabouts};
    use schemas::manifest::{Origin, RunManifest};
    use schemas::presets::Preset;

    #[test]
    fn names_and_columns_are_there_once() {
        for offer in all() {
            assert_eq!(all().filter(|other| other.name == offer.name).count(), 1, "{}", offer.name);
            let names: Vec<&str> = offer.summary.iter().map(|column| column.name).collect();
            assert!((1..names.len()).all(|i| !names[..i].contains(&names[i])), "{}: {names:?}", offer.name);
            assert!(offer.help.starts_with("Examples:\n"), "{}", offer.name);
        }
    }

    #[test]
    fn settings_that_others_name_are_there() {
        for offer in all() {
            let known = |name: &str| offer.settings.iter().any(|setting| setting.name == name);
            for setting in offer.settings {
                assert!(
                    setting.excludes.iter().chain(&setting.belongs_to).all(|name| known(name)),
                    "{setting:?}"
                );
            }
        }
    }

    #[test]
    fn no_numbers_are_told_of_no_frames() {
        let config = Preset::find("precompressed").expect("a preset").config();
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let manifest = RunManifest::new(&config, "run", origin).expect("valid");
        for (name, flag) in [("contacts", ""), ("modal", ""), ("heat", ""), ("modes", "energy")] {
            let offer = all().find(|offer| offer.name == name).expect("an analysis");
            let mut settings = Settings::default();
            for setting in offer.settings.iter().filter(|setting| setting.name == flag) {
                settings.set(setting, Vec::new()).expect("a flag");
            }
            let mut analysis =
                (offer.begin)(&Beginning::whole(name, &manifest, &settings)).expect("an analysis");
            let words = analysis.report().map_or_else(String::new, |report| report.words.under(""));
            assert!(!words.contains("NaN") && !words.contains("last"), "{name}: {words}");
            for column in offer.columns.iter().filter(|_| name != "modes") {
                assert!(analysis.value(column.name, None).is_none(), "{name}: {}", column.name);
            }
        }
    }

    /// A row of the table in `docs/CONFIGURATION.md`.
    fn row(offer: &Offer) -> String {
        let place = match &offer.place {
            Whereabouts::Chain => String::new(),
            Whereabouts::Of { allowed, .. } => (*allowed).to_owned(),
            Whereabouts::Words(words) => format!("@{}, or none of them", words.join(", @")),
        };
        let number = |number: &Meaning| format!("`{}` ({})", number.name, number.meaning);
        let numbers: Vec<String> = offer.numbers().iter().map(number).collect();
        format!("| `{}` | {place} | {} |", offer.name, numbers.join(", "))
    }

    /// With `BEADLINE_RENEW_TABLES` set the table is made anew.
    #[test]
    fn the_documentation_has_the_table_of_the_list() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/CONFIGURATION.md");
        let page = std::fs::read_to_string(path).expect("a page");
        let head = "| analysis | place | numbers |\n|---|---|---|\n";
        let (before, after) = page.split_once(head).expect("a table");
        let found = after.split("\n\n").next().unwrap_or_default();
        let made: Vec<String> = all().map(row).collect();
        let made = made.join("\n");
        if std::env::var_os("BEADLINE_RENEW_TABLES").is_some() {
            let rest = &after[found.len()..];
            std::fs::write(path, format!("{before}{head}{made}{rest}")).expect("disk");
        } else {
            assert_eq!(found, made, "BEADLINE_RENEW_TABLES=1 cargo test -p beadline-analyses makes it anew");
        }
    }
}
