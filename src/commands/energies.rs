//! `beadline energies`.

use crate::analysis::{AnalysisError, ResultRows, Session, check_bead, draw};
use crate::args::EnergiesArgs;
use crate::display::{self, count};
use crate::failure::{Done, Failure};
use crate::outputs::check_tables;
use crate::report::Rows;
use consumers::energies::{
    Energies, EnergyOutcome, EnergyRow, Moment, Reflected, Reflection, default_split_bead,
};
use consumers::follow::Analysis;
use consumers::series::Series;
use consumers::uncertain::Uncertain;
use schemas::frame::Frame;
use schemas::results::{ENERGIES, ResultColumns};
use serde_json::{Value, json};

/// The analysis and its outputs.
struct Outputs {
    energies: Energies,
    /// Kept only for a figure.
    curves: Option<Series<{ EnergyRow::COLUMNS.len() }>>,
    rows: ResultRows,
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
        rows: ResultRows::open(&session, "energies", &ResultColumns::named(&ENERGIES), args.out.as_ref())?,
    };
    let tally = session.follow(&mut outputs)?;

    let Outputs { energies, curves, rows: written } = outputs;
    written.finish()?;
    let outcome = energies.outcome();
    if let Some(curves) = curves {
        let reflection = outcome.and_then(|outcome| outcome.reflection.ok());
        draw(&args.common, || Ok(plots::energies(&manifest, split_bead, &curves, reflection.as_ref())))?;
    }
    session.report(&tally, "energies", rows(outcome.as_ref()), outcome.as_ref().map(json))
}

fn rows(outcome: Option<&EnergyOutcome>) -> Rows {
    let mut rows = Rows::default();
    let Some(outcome) = outcome else { return rows };
    let last = &outcome.last;
    // one unit for all, so that they can be compared
    let (unit, one_j) = display::unit(last.total_j, "J");
    let energy = |energy_j: f64| Uncertain::new(energy_j, outcome.step_error_j()) / one_j;
    let total = energy(last.total_j);
    let text = |energy_j: f64| energy(energy_j).value_text();
    let (kinetic, potential) = (text(last.kinetic_j), text(last.potential_j));
    rows.add("split at bead", outcome.split_bead);
    rows.add("total", format_args!("{total} {unit} (kinetic {kinetic}, potential {potential})"));
    rows.add("left", format_args!("{} {unit}", text(last.left_j)));
    rows.add("split bead", format_args!("{} {unit}", text(last.split_j)));
    rows.add("right", format_args!("{} {unit}", text(last.right_j)));
    if last.driven_j != 0.0 {
        rows.add("driven", format_args!("{} {unit}", text(last.driven_j)));
    }
    if last.dissipated_j != 0.0 {
        rows.add("dissipated", format_args!("{} {unit}", text(last.dissipated_j)));
    }
    if outcome.is_ring {
        rows.add("ring contact", "half of its energy counts left, half right: it joins both");
    }
    match &outcome.reflection {
        Ok(reflection) => add_reflection(&mut rows, reflection, outcome.split_bead),
        Err(undefined) => rows.add("reflected", undefined),
    }
    rows.add("largest |ΔE/E|", format_args!("{:.1e}", outcome.max_abs_drift));
    if outcome.is_driven || last.dissipated_j != 0.0 {
        rows.add(
            "±",
            "from the balance of energies alone; `beadline check` says what a shorter step changes",
        );
    }
    rows
}

fn add_reflection(rows: &mut Rows, reflection: &Reflection, split_bead: u64) {
    let Some(energies) = &reflection.energies else {
        let what = format_args!("nothing yet: the pulse has not arrived at bead {split_bead}");
        return rows.add("reflected", what);
    };
    rows.add("stationary", stationary(reflection, energies));
    rows.add("reflected/total", format_args!("{}, {}", energies.over_total(), at(energies.at)));
    rows.add("reflected/transmitted", energies.over_transmitted());
    let (Some(recoil), Some(corrected)) = (&reflection.recoil, reflection.corrected()) else {
        return rows.add("recoil", "unknown: no frame in the 10 T before the pulse arrived");
    };
    let recoil_at = at(recoil.at);
    let recoil = Uncertain::new(recoil.energy_j, recoil.uncertainty_j) / energies.total_j;
    rows.add("recoil/total", format_args!("{recoil}, before the pulse arrived, {recoil_at}"));
    rows.add(
        "without the recoil",
        format_args!(
            "reflected/total {}, reflected/transmitted {}, reflected/incident {}",
            corrected.over_total, corrected.over_transmitted, corrected.over_incident
        ),
    );
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
        "incident_side": reflection.incident.as_str(),
        "pulse_arrived": reflection.arrival,
        "stationary": reflection.stationary_since.is_some(),
        "stationary_since": reflection.stationary_since,
        "front_met_end": reflection.met_end.map(|(bead, at)| json!({ "bead": bead, "at": at })),
        "energies": reflection.energies.map(|energies| json!({
            "at": energies.at,
            "reflected_j": energies.reflected_j,
            "transmitted_j": energies.transmitted_j,
            "total_j": energies.total_j,
            "uncertainty_j": energies.uncertainty_j,
            "inbound_j": energies.inbound_j,
            "step_error_j": energies.step_error_j,
            "reflected_over_total_uncertainty": energies.over_total().plus_minus,
            "reflected_over_transmitted_uncertainty": energies.over_transmitted().plus_minus,
        })),
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
