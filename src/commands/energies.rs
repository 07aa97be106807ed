//! `beadline energies`.

use crate::analysis::{AnalysisError, Rows, Session, check_bead, draw};
use crate::args::EnergiesArgs;
use crate::display::{self, count};
use crate::failure::{Done, Failure};
use crate::outputs::check_tables;
use consumers::energies::{
    Energies, EnergyOutcome, EnergyRow, Moment, Reflected, Reflection, default_split_bead,
};
use consumers::follow::Analysis;
use consumers::series::Series;
use consumers::uncertain::Uncertain;
use schemas::frame::Frame;
use schemas::results::{ENERGIES, ResultColumns, Topic};
use serde_json::{Value, json};

/// The analysis and its outputs.
struct Outputs {
    energies: Energies,
    /// Kept only for a figure.
    curves: Option<Series<{ EnergyRow::COLUMNS.len() }>>,
    rows: Rows,
}

impl Analysis for Outputs {
    type Error = AnalysisError;

    fn observe(&mut self, frame: &Frame<'_>) -> Result<(), AnalysisError> {
        let values = self.energies.observe(frame).values();
        if let Some(curves) = &mut self.curves {
            curves.push(frame.time_s, values);
        }
        self.rows.write(frame, &values)
    }
}

pub(crate) fn energies(args: &EnergiesArgs) -> Result<Done, Failure> {
    let tables: Vec<_> = args.out.iter().collect();
    check_tables(&tables)?;
    let mut session = Session::open(&args.common, "energies", &tables)?;
    let manifest = session.manifest().clone();
    let split_bead = match args.split {
        Some(bead) => check_bead(&manifest, "--split", bead)?,
        None => default_split_bead(&manifest),
    };
    let mut outputs = Outputs {
        energies: Energies::new(&manifest, split_bead),
        curves: (!args.common.figure.is_empty()).then(Series::default),
        rows: Rows::open(&session, Topic::Energies, &ResultColumns::named(&ENERGIES), args.out.as_ref())?,
    };
    let tally = session.follow(&mut outputs)?;

    let Outputs { energies, curves, rows: written } = outputs;
    written.finish()?;
    let outcome = energies.outcome();
    if let Some(curves) = curves {
        let reflection = outcome.and_then(|outcome| outcome.reflection.ok());
        draw(&args.common, || Ok(plots::energies(&manifest, split_bead, &curves, reflection.as_ref())))?;
    }
    session.report(&tally, "energies", rows(outcome.as_ref()), json(outcome.as_ref()))
}

fn rows(outcome: Option<&EnergyOutcome>) -> Vec<(&'static str, String)> {
    let Some(outcome) = outcome else { return Vec::new() };
    let last = &outcome.last;
    // one unit for all, so that they can be compared
    let (unit, one_j) = display::unit(last.total_j, "J");
    let energy = |energy_j: f64| Uncertain::new(energy_j, outcome.step_error_j()) / one_j;
    let total = energy(last.total_j);
    let parts = [last.kinetic_j, last.potential_j].map(|energy_j| energy(energy_j).value_text());
    let mut rows = vec![
        ("split at bead", outcome.split_bead.to_string()),
        ("total", format!("{total} {unit} (kinetic {}, potential {})", parts[0], parts[1])),
        ("left", format!("{} {unit}", energy(last.left_j).value_text())),
        ("split bead", format!("{} {unit}", energy(last.split_j).value_text())),
        ("right", format!("{} {unit}", energy(last.right_j).value_text())),
    ];
    if last.dissipated_j != 0.0 {
        rows.push(("dissipated", format!("{} {unit}", energy(last.dissipated_j).value_text())));
    }
    match &outcome.reflection {
        Ok(reflection) => rows.extend(reflection_rows(reflection, outcome.split_bead)),
        Err(undefined) => rows.push(("reflected", undefined.to_string())),
    }
    rows.push(("largest |ΔE/E|", format!("{:.1e}", outcome.max_abs_drift)));
    rows
}

fn reflection_rows(reflection: &Reflection, split_bead: u64) -> Vec<(&'static str, String)> {
    let Some(energies) = &reflection.energies else {
        return vec![("reflected", format!("nothing yet: the pulse has not arrived at bead {split_bead}"))];
    };
    let mut rows = vec![
        ("stationary", stationary(reflection, energies)),
        ("reflected/total", format!("{}, {}", energies.over_total(), at(energies.at))),
        ("reflected/transmitted", energies.over_transmitted().to_string()),
    ];
    match (&reflection.recoil, reflection.corrected()) {
        (Some(recoil), Some(corrected)) => {
            let recoil_at = at(recoil.at);
            let recoil = Uncertain::new(recoil.energy_j, recoil.uncertainty_j) / energies.total_j;
            rows.extend([
                ("recoil/total", format!("{recoil}, before the pulse arrived, {recoil_at}")),
                (
                    "without the recoil",
                    format!(
                        "reflected/total {}, reflected/transmitted {}, reflected/incident {}",
                        corrected.over_total, corrected.over_transmitted, corrected.over_incident
                    ),
                ),
            ]);
        }
        _ => rows.push(("recoil", "unknown: no frame in the 10 T before the pulse arrived".to_owned())),
    }
    rows
}

/// Whether and since when the reflected energy is stationary.
fn stationary(reflection: &Reflection, energies: &Reflected) -> String {
    let met = reflection.met_end.map(|(bead, moment)| format!("a front met bead {bead}, {}", at(moment)));
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
    format!("frame {} ({})", count(moment.frame), display::quantity(moment.time_s, "s"))
}

fn json(outcome: Option<&EnergyOutcome>) -> Value {
    let Some(outcome) = outcome else { return Value::Null };
    let last: serde_json::Map<_, _> = EnergyRow::COLUMNS
        .iter()
        .zip(outcome.last.values())
        .map(|(name, value)| ((*name).to_owned(), json!(value)))
        .collect();
    let energies = outcome.reflection.as_ref().ok().and_then(|reflection| reflection.energies);
    json!({
        "split_bead": outcome.split_bead,
        "last": last,
        "reflected_over_total": energies.map(|energies| energies.over_total().value),
        "reflected_over_transmitted": energies.map(|energies| energies.over_transmitted().value),
        "reflection": match &outcome.reflection {
            Ok(reflection) => reflection_json(reflection),
            Err(undefined) => json!({ "undefined": undefined.to_string() }),
        },
        "max_abs_relative_drift": outcome.max_abs_drift,
    })
}

fn reflection_json(reflection: &Reflection) -> Value {
    let moment = |moment: Moment| json!({ "frame": moment.frame, "time_s": moment.time_s });
    json!({
        "incident_side": reflection.incident.as_str(),
        "pulse_arrived": reflection.arrival.map(moment),
        "stationary": reflection.stationary_since.is_some(),
        "stationary_since": reflection.stationary_since.map(moment),
        "front_met_end": reflection.met_end.map(|(bead, at)| json!({ "bead": bead, "at": moment(at) })),
        "energies": reflection.energies.map(|energies| json!({
            "at": moment(energies.at),
            "reflected_j": energies.reflected_j,
            "transmitted_j": energies.transmitted_j,
            "total_j": energies.total_j,
            "uncertainty_j": energies.uncertainty_j,
            "inbound_j": energies.inbound_j,
            "step_error_j": energies.step_error_j,
            "reflected_over_total_uncertainty": energies.over_total().plus_minus,
            "reflected_over_transmitted_uncertainty": energies.over_transmitted().plus_minus,
        })),
        "recoil": reflection.recoil.map(|recoil| json!({
            "energy_j": recoil.energy_j,
            "uncertainty_j": recoil.uncertainty_j,
            "at": moment(recoil.at),
        })),
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
