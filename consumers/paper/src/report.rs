//! Report of all judgements, as one value, and as JSON.

use crate::{Claim, Judgement, Number, Study, Verdict};
use schemas::manifest::RunManifest;
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// The paper by figures, with our results.
pub struct Report<'a> {
    /// In the order of the paper.
    pub studies: Vec<Studied>,
    /// The runs behind it, in the order of their names.
    pub runs: Vec<RunManifest>,
    /// Times until which some of them are determined, by their names.
    pub determined: &'a BTreeMap<String, String>,
    /// The program and its version.
    pub program: String,
}

/// One study with its verdicts.
pub struct Studied {
    /// The figure.
    pub study: &'static Study,
    /// The claims of the paper, with our judgements.
    pub claims: Vec<(&'static Claim, Judgement)>,
}

impl Report<'_> {
    /// Number of claims with `verdict`.
    pub fn count(&self, verdict: Verdict) -> usize {
        self.claims().filter(|(_, judgement)| judgement.verdict == verdict).count()
    }

    /// The numbers that contradict their references, with their claims.
    pub fn contradictions(&self) -> Vec<(&'static Claim, &Number)> {
        let numbers = self
            .claims()
            .flat_map(|(claim, judgement)| judgement.numbers.iter().map(move |number| (*claim, number)));
        numbers.filter(|(_, number)| number.contradicts_reference()).collect()
    }

    /// Number of numbers with a reference.
    pub fn reference_count(&self) -> usize {
        let numbers = self.claims().flat_map(|(_, judgement)| &judgement.numbers);
        numbers.filter(|number| number.reference.is_some()).count()
    }

    fn claims(&self) -> impl Iterator<Item = &(&'static Claim, Judgement)> {
        self.studies.iter().flat_map(|studied| &studied.claims)
    }

    /// All of it for programs.
    pub fn json(&self) -> Value {
        let runs = self.runs.iter().map(|manifest| {
            let name = &manifest.provenance.name;
            json!({ "name": name, "determined": self.determined.get(name.as_str()), "physics": manifest.physics })
        });
        json!({
            "program": self.program,
            "paper": PAPER,
            "summary": self.summary(),
            "figures": self.studies.iter().map(Studied::json).collect::<Vec<_>>(),
            "runs": runs.collect::<Vec<_>>(),
        })
    }

    /// Numbers of claims with each verdict.
    pub fn summary(&self) -> Value {
        json!({
            "figures": self.studies.len(),
            "claims": self.claims().count(),
            "reproduced": self.count(Verdict::Reproduced),
            "reproduced_with_a_correction": self.count(Verdict::Corrected),
            "not_so": self.count(Verdict::NotSo),
            "numbers_with_a_reference": self.reference_count(),
            "numbers_that_contradict_it": self.contradictions().len(),
        })
    }
}

/// The paper.
pub const PAPER: &str = "E. Hascoët and H. J. Herrmann, Shocks in non-loaded bead chains with impurities";

/// Path of the figure of a study, below the directory of the report.
pub fn figure_path(study: &Study, extension: &str) -> String {
    format!("img/paper/{}.{extension}", study.slug)
}

impl Studied {
    fn json(&self) -> Value {
        let claims = self.claims.iter().map(|(Claim { id, place, quote, .. }, judgement)| {
            let Judgement { verdict, why, numbers } = judgement;
            let (verdict, numbers) = (verdict.as_str(), numbers.iter().map(number_json).collect::<Vec<_>>());
            json!({ "id": id, "place": place, "quote": quote, "verdict": verdict, "why": why, "numbers": numbers })
        });
        let claims: Vec<Value> = claims.collect();
        let Study { slug, title, place, .. } = self.study;
        let files = ["svg", "png"].map(|extension| figure_path(self.study, extension));
        json!({ "figure": slug, "title": title, "place": place, "files": files, "claims": claims })
    }
}

fn number_json(number: &Number) -> Value {
    let mut json = json!(number);
    if number.reference.is_some() {
        json["reference"]["contradicted"] = number.contradicts_reference().into();
    }
    json
}
