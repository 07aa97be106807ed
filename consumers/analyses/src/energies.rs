//! Energies of the chain: left of a bead, in it, right of it; and the part that the bead reflects.

use consumers::analysis::{
    Analysis, Beginning, Meaning, Number, Offer, Outlet, Refusal, Report, Setting, TableFlag, Takes, Words,
};
use consumers::energies::{
    Energies, EnergyOutcome, EnergyRow, Moment, Reflected, Reflection, default_split_bead,
};
use consumers::series::Series;
use consumers::uncertain::Uncertain;
use figure::{Figure, FigureError};
use schemas::amounts::{count, quantity, unit};
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use schemas::results::ENERGIES;
use serde_json::{Value, json};

/// The analysis, before it looks at a run.
pub static OFFER: Offer = Offer {
    name: "energies",
    about: "Energy left of the impurity, in it, and right of it; the part that is reflected",
    help: "Examples:\n  \
        beadline energies                                    attach to the only live run\n  \
        beadline energies run.mcap --out e.csv --figure e.svg\n  \
        beadline energies run.mcap --split 300               left and right of bead 300\n  \
        beadline energies sparse.mcap --every-step --from 0.04 --until 0.041 --out e.csv\n\n\
        The last one has every step of a part, although the recording is sparse.",
    settings: &[Setting::new(
        "split",
        Takes::Whole("BEAD"),
        "The bead that divides left from right [default: the first impurity that is not the striker, else the middle bead]",
    )],
    tables: &[TableFlag { name: "out", help: "Table of the energies of each frame" }],
    columns: &COLUMNS,
    summary: &SUMMARY,
    begin: |beginning| Ok(Box::new(EnergyAnalysis::begin(beginning)?)),
    ..Offer::PLAIN
};

const COLUMNS: [Meaning; ENERGIES.len()] = [
    Meaning::number("kinetic_j", "kinetic energy of all beads and resonators"),
    Meaning::number("potential_j", "potential energy of contacts, walls, springs of beads and resonators"),
    Meaning::number("total_j", "both"),
    Meaning::number("left_j", "energy left of the split bead"),
    Meaning::number("split_j", "energy of the split bead, with half of its contacts"),
    Meaning::number("right_j", "energy right of it"),
    Meaning::number("dissipated_j", "work that damping has taken"),
    Meaning::number("relative_drift", "error of the balance of energies, over the initial energy"),
    Meaning::number("inbound_j", "energy that may still cross the split bead"),
    Meaning::number("corrected_j", "reflected energy without the recoil"),
    Meaning::number("driven_j", "energy that drives and baths have given"),
];

const SUMMARY: [Meaning; 18] = {
    let [kinetic, potential, total, left, split, right, dissipated, drift, inbound, corrected, driven] =
        COLUMNS;
    [
        Meaning::count("split_bead", "the bead that divides left from right"),
        kinetic,
        potential,
        total,
        left,
        split,
        right,
        dissipated,
        drift,
        inbound,
        corrected,
        driven,
        Meaning::number("max_abs_relative_drift", "largest |relative_drift| of a frame"),
        Meaning::number("reflected_over_total", "reflected energy over the total"),
        Meaning::number("reflected_over_transmitted", "the same over the transmitted energy"),
        Meaning::number("corrected_over_total", "reflected energy without the recoil, over the total"),
        Meaning::number("corrected_over_transmitted", "the same over the transmitted energy"),
        Meaning::number("corrected_over_incident", "the same over the incident energy"),
    ]
};

/// Energies of the frames of one run.
pub struct EnergyAnalysis {
    manifest: RunManifest,
    energies: Energies,
    /// Kept for a figure alone.
    curves: Option<Series<{ ENERGIES.len() }>>,
}

impl EnergyAnalysis {
    /// Begins to look at a run.
    ///
    /// # Errors
    /// When the chain has no such split bead.
    pub fn begin(beginning: &Beginning<'_>) -> Result<Self, Refusal> {
        let manifest = beginning.manifest.clone();
        let split_bead = beginning.bead("split")?.unwrap_or_else(|| default_split_bead(&manifest));
        let curves = beginning.is_drawn.then(Series::default);
        Ok(Self { energies: Energies::new(&manifest, split_bead), manifest, curves })
    }

    /// The energies so far.
    pub fn energies(&self) -> &Energies {
        &self.energies
    }
}

impl Analysis for EnergyAnalysis {
    fn observe(&mut self, frame: &Frame<'_>, out: &mut dyn Outlet) {
        let values = self.energies.observe(frame).values();
        if let Some(curves) = &mut self.curves {
            curves.push(frame.time_s, values);
        }
        out.row(frame, &values);
    }

    fn report(&mut self) -> Option<Report> {
        let outcome = self.energies.outcome();
        let words = outcome.as_ref().map(words).unwrap_or_default();
        let results = outcome.as_ref().map_or(Value::Null, json);
        Some(Report { title: "energies", words, results, ..Report::default() })
    }

    fn figure(&mut self) -> Result<Option<Figure>, FigureError> {
        let curves = self.curves.take().unwrap_or_default();
        let reflection = self.energies.outcome().and_then(|outcome| outcome.reflection.ok());
        let split_bead = self.energies.split_bead();
        Ok(Some(plots::energies(&self.manifest, split_bead, &curves, reflection.as_ref())))
    }

    fn value(&self, name: &str, _: Option<&str>) -> Option<Number> {
        let outcome = self.energies.outcome()?;
        if let Some(place) = EnergyRow::COLUMNS.iter().position(|column| *column == name) {
            return Some(Number::Double(outcome.last.values()[place]));
        }
        let reflection = || outcome.reflection.as_ref().ok();
        let energies = || reflection()?.energies;
        let corrected = || reflection()?.corrected();
        Some(Number::Double(match name {
            "split_bead" => return Some(Number::Count(outcome.split_bead)),
            "max_abs_relative_drift" => outcome.max_abs_drift,
            "reflected_over_total" => energies()?.over_total().value,
            "reflected_over_transmitted" => energies()?.over_transmitted().value,
            "corrected_over_total" => corrected()?.over_total.value,
            "corrected_over_transmitted" => corrected()?.over_transmitted.value,
            "corrected_over_incident" => corrected()?.over_incident.value,
            _ => return None,
        }))
    }
}

fn words(outcome: &EnergyOutcome) -> Words {
    let mut words = Words::default();
    let last = &outcome.last;
    // one unit for all, so that they can be compared
    let (unit, one_j) = unit(last.total_j, "J");
    let energy = |energy_j: f64| Uncertain::new(energy_j, outcome.step_error_j()) / one_j;
    let total = energy(last.total_j);
    let text = |energy_j: f64| energy(energy_j).value_text();
    let (kinetic, potential) = (text(last.kinetic_j), text(last.potential_j));
    words.add("split at bead", outcome.split_bead);
    words.add("total", format_args!("{total} {unit} (kinetic {kinetic}, potential {potential})"));
    words.add("left", format_args!("{} {unit}", text(last.left_j)));
    words.add("split bead", format_args!("{} {unit}", text(last.split_j)));
    words.add("right", format_args!("{} {unit}", text(last.right_j)));
    for (name, energy_j) in [("driven", last.driven_j), ("dissipated", last.dissipated_j)] {
        if energy_j != 0.0 {
            words.add(name, format_args!("{} {unit}", text(energy_j)));
        }
    }
    if outcome.is_ring {
        words.add("ring contact", "half of its energy counts left, half right: it joins both");
    }
    match &outcome.reflection {
        Ok(reflection) => add_reflection(&mut words, reflection, outcome.split_bead),
        Err(undefined) => words.add("reflected", undefined),
    }
    words.add("largest |ΔE/E|", format_args!("{:.1e}", outcome.max_abs_drift));
    if outcome.is_driven || last.dissipated_j != 0.0 {
        words.add(
            "±",
            "from the balance of energies alone; `beadline check` says what a shorter step changes",
        );
    }
    words
}

fn add_reflection(words: &mut Words, reflection: &Reflection, split_bead: u64) {
    let Some(energies) = &reflection.energies else {
        let what = format_args!("nothing yet: the pulse has not arrived at bead {split_bead}");
        return words.add("reflected", what);
    };
    words.add("stationary", stationary(reflection, energies));
    words.add("reflected/total", format_args!("{}, {}", energies.over_total(), at(energies.at)));
    words.add("reflected/transmitted", energies.over_transmitted());
    let (Some(recoil), Some(corrected)) = (&reflection.recoil, reflection.corrected()) else {
        return words.add("recoil", "unknown: no frame in the 10 T before the pulse arrived");
    };
    let recoil_at = at(recoil.at);
    let recoil = Uncertain::new(recoil.energy_j, recoil.uncertainty_j) / energies.total_j;
    words.add("recoil/total", format_args!("{recoil}, before the pulse arrived, {recoil_at}"));
    words.add(
        "without the recoil",
        format_args!(
            "reflected/total {}, reflected/transmitted {}, reflected/incident {}",
            corrected.over_total, corrected.over_transmitted, corrected.over_incident
        ),
    );
}

/// Tells whether and since when the reflected energy is stationary.
fn stationary(reflection: &Reflection, energies: &Reflected) -> String {
    let exchanged = |moment| format!("energy was exchanged with the outside, {}", at(moment));
    let met = reflection.met_end.map(|(bead, moment)| format!("a front met bead {bead}, {}", at(moment)));
    let met = met.or_else(|| reflection.exchanged.map(exchanged));
    match (reflection.stationary_since, met) {
        (Some(since), None) => format!("since {}", at(since)),
        (Some(since), Some(met)) => format!("since {}, until {met}", at(since)),
        (None, met) => {
            let open = energies.inbound_j / energies.total_j;
            let when = met.unwrap_or_else(|| "the frames ended".to_owned());
            format!("no: {open:.1e} of the energy might still have crossed the split bead when {when}")
        }
    }
}

fn at(moment: Moment) -> String {
    format!("frame {} ({})", count(moment.frame), quantity(moment.time_s, "s"))
}

fn json(outcome: &EnergyOutcome) -> Value {
    let energies = outcome.reflection.as_ref().ok().and_then(|reflection| reflection.energies);
    json!({
        "split_bead": outcome.split_bead,
        "last": outcome.last,
        "reflected_over_total": energies.map(|energies| energies.over_total().value),
        "reflected_over_transmitted": energies.map(|energies| energies.over_transmitted().value),
        "reflection": match &outcome.reflection {
            Ok(reflection) => reflection_json(reflection),
            Err(undefined) => json!({ "undefined": undefined.to_string() }),
        },
        "max_abs_relative_drift": outcome.max_abs_drift,
        "step_error_j": outcome.step_error_j(),
    })
}

fn reflection_json(reflection: &Reflection) -> Value {
    json!({
        "incident_side": reflection.incident,
        "pulse_arrived": reflection.arrival,
        "stationary": reflection.stationary_since.is_some(),
        "stationary_since": reflection.stationary_since,
        "front_met_end": reflection.met_end.map(|(bead, at)| json!({ "bead": bead, "at": at })),
        "energy_exchanged": reflection.exchanged,
        "energies": reflection.energies.map(|energies| {
            let mut all = json!(energies);
            all["reflected_over_total_uncertainty"] = json!(energies.over_total().plus_minus);
            all["reflected_over_transmitted_uncertainty"] = json!(energies.over_transmitted().plus_minus);
            all
        }),
        "recoil": reflection.recoil,
        "corrected": reflection.corrected().map(|corrected| json!({
            "reflected_j": corrected.reflected_j,
            "uncertainty_j": corrected.uncertainty_j,
            "incident_j": corrected.incident_j,
            "reflected_over_total": corrected.over_total.value,
            "reflected_over_incident": corrected.over_incident.value,
            "reflected_over_transmitted": corrected.over_transmitted.value,
            "reflected_over_total_uncertainty": corrected.over_total.plus_minus,
            "reflected_over_incident_uncertainty": corrected.over_incident.plus_minus,
            "reflected_over_transmitted_uncertainty": corrected.over_transmitted.plus_minus,
        })),
    })
}
