//! The figures of the paper, and which claims go with each.

use super::study::Study;
use super::{deform, energies, heavy, light, maps, others, rattle, scaling, speed, strikers, transient};

/// Every study, in the order of the paper.
pub const STUDIES: &[Study] = &[
    transient::SELF_SIMILAR,
    deform::AT_1_2,
    deform::AT_1_5,
    deform::AT_1_7,
    deform::AT_10,
    deform::AT_1_01,
    deform::AT_1_01_LONG,
    speed::SPEED,
    transient::TRANSIENT,
    transient::GAUSSIAN_LIMIT,
    scaling::WIDTH,
    scaling::VMAX,
    light::VELOCITY,
    light::DISPLACEMENT,
    maps::LIGHT,
    rattle::IMPURITY,
    heavy::VELOCITY,
    maps::HEAVY,
    heavy::SECOND_HIT,
    others::OTHERS,
    strikers::THREE_GRAMS,
    strikers::TEN_GRAMS,
    energies::TOTAL,
    energies::TRANSMITTED,
    energies::CORRECTED,
    energies::PULSE,
];

impl Study {
    /// The study of that name.
    pub fn find(slug: &str) -> Option<&'static Self> {
        STUDIES.iter().find(|study| study.slug == slug)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Observations, Run, StudyError};
    use schemas::manifest::{Origin, RunManifest};
    use std::collections::{BTreeMap, BTreeSet};

    #[test]
    fn every_claim_has_a_name_of_its_own_a_place_and_a_quotation() {
        let mut ids = BTreeSet::new();
        let mut slugs = BTreeSet::new();
        for study in STUDIES {
            assert!(slugs.insert(study.slug), "{}", study.slug);
            assert!(!study.title.is_empty() && !study.place.is_empty(), "{}", study.slug);
            assert!(!study.claims.is_empty(), "{} draws, but judges nothing", study.slug);
            for claim in study.claims {
                assert!(ids.insert(claim.id), "{} stands twice", claim.id);
                assert!(claim.place.len() > 4 && claim.quote.len() > 20, "{}", claim.id);
                assert!(claim.id.chars().all(|c| c.is_ascii_alphanumeric() || "-.".contains(c)));
            }
        }
    }

    #[test]
    fn runs_of_one_name_are_one_run_and_valid() {
        let origin = || Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        let mut runs: BTreeMap<String, Run> = BTreeMap::new();
        for run in STUDIES.iter().flat_map(|study| (study.runs)()) {
            let manifest = RunManifest::new(&run.config, "run", origin());
            assert!(manifest.is_ok(), "{}: {manifest:?}", run.name());
            if let Some(other) = runs.insert(run.name().to_owned(), run.clone()) {
                assert_eq!(other, run);
            }
        }
    }

    #[test]
    fn a_claim_says_which_run_it_lacks() {
        for claim in STUDIES.iter().flat_map(|study| study.claims) {
            if let Err(error) = (claim.judge)(&Observations::default()) {
                assert!(matches!(error, StudyError::NotObserved { .. }), "{}: {error}", claim.id);
            }
        }
    }
}
