//! The analyses, each in one file, and the one list of them.
//!
//! Whoever offers analyses iterates over [`all`] and names none: the command line, sweeps, the bus, Python, the documentation. An
//! analysis of one's own is a file like these; [`add`] lists it.

pub mod contacts;
pub mod deformation;
pub mod energies;
pub mod forces;
pub mod impurity;
pub mod modes;
mod places;
pub mod pulses;
pub mod spectrum;
pub mod spreading;

use consumers::analysis::Offer;
use std::sync::{PoisonError, RwLock};

/// Ours, in the order of the documentation.
static OURS: [&Offer; 9] = [
    &energies::OFFER,
    &impurity::OFFER,
    &contacts::OFFER,
    &pulses::OFFER,
    &spreading::OFFER,
    &deformation::OFFER,
    &forces::OFFER,
    &spectrum::OFFER,
    &modes::OFFER,
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
}
