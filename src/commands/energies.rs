//! `beadline energies`.

use crate::analysis::{
    AnalysisError, ROW_HEAD, Session, begin_row, check_bead, check_tables, draw, finish, publish,
};
use crate::args::EnergiesArgs;
use crate::failure::{Done, Failure};
use consumers::energies::{Energies, EnergyOutcome, EnergyRow, default_split_bead};
use consumers::follow::Analysis;
use consumers::plots;
use consumers::series::Series;
use consumers::table::Table;
use schemas::bus::{ResultColumns, ResultPublisher, Topic};
use schemas::frame::Frame;
use serde_json::{Value, json};

/// The analysis with everything that its results go to.
struct Outputs {
    energies: Energies,
    /// Kept only for a figure.
    curves: Option<Series<{ EnergyRow::COLUMNS.len() }>>,
    table: Option<Table>,
    publisher: Option<ResultPublisher<f64>>,
}

impl Analysis for Outputs {
    type Error = AnalysisError;

    fn observe(&mut self, frame: &Frame<'_>) -> Result<(), AnalysisError> {
        let values = self.energies.observe(frame).values();
        if let Some(curves) = &mut self.curves {
            curves.push(frame.time_s, values);
        }
        if let Some(table) = &mut self.table {
            begin_row(table, frame);
            for value in values {
                table.double(value);
            }
            table.end_row()?;
        }
        publish(self.publisher.as_mut(), frame, &values)
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
    let names = EnergyRow::COLUMNS;
    let columns: Vec<_> = ROW_HEAD.iter().chain(&names).map(|name| (*name).to_owned()).collect();
    let published = ResultColumns { width: names.len(), names: names.join(",") };
    let mut outputs = Outputs {
        energies: Energies::new(&manifest, split_bead),
        curves: (!args.common.figure.is_empty()).then(Series::default),
        table: args.out.as_ref().map(|path| Table::create(path, &columns, args.common.force)).transpose()?,
        publisher: session.results(Topic::Energies, &published)?,
    };
    let tally = session.follow(&mut outputs)?;

    let Outputs { energies, curves, table, publisher } = outputs;
    finish(publisher)?;
    table.map(Table::finish).transpose()?;
    if let Some(curves) = curves {
        draw(&args.common, || Ok(plots::energies(&manifest, split_bead, &curves)))?;
    }
    let outcome = energies.outcome();
    session.report(&tally, "energies", rows(outcome.as_ref()), json(outcome.as_ref()))
}

fn rows(outcome: Option<&EnergyOutcome>) -> Vec<(&'static str, String)> {
    let Some(outcome) = outcome else { return Vec::new() };
    let last = &outcome.last;
    vec![
        ("split at bead", outcome.split_bead.to_string()),
        (
            "total",
            format!(
                "{:.6e} J (kinetic {:.6e}, potential {:.6e})",
                last.total_j, last.kinetic_j, last.potential_j
            ),
        ),
        ("left", format!("{:.6e} J", last.left_j)),
        ("split bead", format!("{:.6e} J", last.split_j)),
        ("right", format!("{:.6e} J", last.right_j)),
        ("reflected/total", format!("{:.6}", outcome.reflected_over_total)),
        ("reflected/transmitted", format!("{:.6}", outcome.reflected_over_transmitted)),
        ("largest |ΔE/E|", format!("{:.2e}", outcome.max_abs_drift)),
    ]
}

fn json(outcome: Option<&EnergyOutcome>) -> Value {
    let Some(outcome) = outcome else { return Value::Null };
    let last: serde_json::Map<_, _> = EnergyRow::COLUMNS
        .iter()
        .zip(outcome.last.values())
        .map(|(name, value)| ((*name).to_owned(), json!(value)))
        .collect();
    json!({
        "split_bead": outcome.split_bead,
        "last": last,
        "reflected_over_total": outcome.reflected_over_total,
        "reflected_over_transmitted": outcome.reflected_over_transmitted,
        "max_abs_relative_drift": outcome.max_abs_drift,
    })
}
