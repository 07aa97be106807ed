//! `beadline spreading`.

use crate::analysis::{AnalysisError, Session, begin_row, draw, table};
use crate::args::SpreadingArgs;
use crate::display;
use crate::failure::{Done, Failure};
use crate::outputs::check_tables;
use crate::report::Rows;
use consumers::follow::Analysis;
use consumers::series::Series;
use consumers::spreading::{Spreading, SpreadingRow};
use consumers::table::Table;
use schemas::frame::Frame;

/// The analysis and its outputs.
struct Outputs {
    spreading: Spreading,
    /// Kept only for a figure.
    curves: Option<Series<{ SpreadingRow::COLUMNS.len() }>>,
    table: Option<Table>,
}

impl Analysis for Outputs {
    type Error = AnalysisError;

    fn observe(&mut self, frame: &Frame<'_>) -> Result<(), AnalysisError> {
        let values = self.spreading.observe(frame).values();
        if let Some(curves) = &mut self.curves {
            curves.push(frame.time_s, values);
        }
        if let Some(table) = &mut self.table {
            begin_row(table, frame);
            for value in values {
                table.optional(Some(value).filter(|value| !value.is_nan()));
            }
            table.end_row()?;
        }
        Ok(())
    }
}

pub(crate) fn spreading(args: &SpreadingArgs) -> Result<Done, Failure> {
    let tables: Vec<_> = args.out.iter().collect();
    check_tables(&tables)?;
    let mut session = Session::open(&args.common, "spreading", &tables)?;
    let manifest = session.manifest().clone();
    let columns: Vec<_> = crate::analysis::ROW_HEAD.into_iter().chain(SpreadingRow::COLUMNS).collect();
    let mut outputs = Outputs {
        spreading: Spreading::new(&manifest),
        curves: (!args.common.figure.is_empty()).then(Series::default),
        table: table(args.out.as_ref(), &columns, args.common.frames.force)?,
    };
    let tally = session.follow(&mut outputs)?;
    let Outputs { spreading, curves, table } = outputs;
    table.map(Table::finish).transpose()?;
    if let Some(curves) = curves {
        draw(&args.common, || Ok(plots::spreading(&manifest, &curves)))?;
    }
    let last = spreading.last();
    session.report(&tally, "spreading", rows(last.as_ref()), last)
}

fn rows(last: Option<&SpreadingRow>) -> Rows {
    let mut rows = Rows::default();
    let Some(row) = last else { return rows };
    if row.participation_beads.is_nan() {
        rows.add("energy", "none: nothing can spread");
        return rows;
    }
    let number = display::number;
    rows.add("energy", display::quantity(row.energy_j, "J"));
    rows.add("centre", format_args!("bead {}", number(row.centre_beads)));
    let width = row.second_moment_beads2.sqrt();
    let moment = number(row.second_moment_beads2);
    rows.add("second moment", format_args!("{moment} beads² (width {} beads)", number(width)));
    rows.add("participation", format_args!("{} beads", number(row.participation_beads)));
    rows
}
