//! `beadline impurity`.

use crate::analysis::{AnalysisError, ResultRows, Session, check_bead, draw, table};
use crate::args::ImpurityArgs;
use crate::display::{self, counted};
use crate::failure::{Done, Failure};
use crate::outputs::check_tables;
use crate::report::Rows;
use consumers::energies::default_split_bead;
use consumers::follow::Analysis;
use consumers::impurity::{Event, EventKind, Followed, Motion};
use consumers::series::Series;
use consumers::table::Table;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use schemas::results::ResultColumns;
use serde_json::{Value, json};

/// Events kept for the summary and the figure; the table has all of them.
const MAX_EVENTS: usize = 10_000;

const WIDTH: usize = Motion::QUANTITIES.len();

/// The analysis and its outputs.
struct Outputs {
    followed: Followed,
    /// One a bead, kept only for a figure.
    curves: Vec<Series<WIDTH>>,
    events: Vec<Event>,
    event_count: u64,
    event_table: Option<Table>,
    rows: ResultRows,
    row: Vec<f64>,
}

impl Analysis for Outputs {
    type Error = AnalysisError;

    fn observe(&mut self, frame: &Frame<'_>) -> Result<(), AnalysisError> {
        let (motions, events) = self.followed.observe(frame);
        self.row.clear();
        for (motion, curve) in motions.iter().zip(&mut self.curves) {
            curve.push(frame.time_s, motion.values());
        }
        self.row.extend(motions.iter().flat_map(Motion::values));
        for event in events {
            self.event_count += 1;
            if self.events.len() < MAX_EVENTS {
                self.events.push(*event);
            }
            if let Some(table) = &mut self.event_table {
                table.double(event.time_s).integer(event.bead).word(event.kind.as_str()).double(event.u_m);
                table.end_row()?;
            }
        }
        self.rows.write(frame, &self.row)
    }

    fn gap(&mut self) {
        self.followed.gap();
    }
}

pub(crate) fn impurity(args: &ImpurityArgs) -> Result<Done, Failure> {
    let tables: Vec<_> = args.out.iter().chain(&args.events).collect();
    check_tables(&tables)?;
    let mut session = Session::open(&args.common, "impurity", &tables)?;
    let manifest = session.manifest().clone();
    let beads = beads(args, &manifest)?;
    let published = ResultColumns::motion(&beads);
    let event_columns = ["time_s", "bead", "event", "u_m"];
    let mut outputs = Outputs {
        followed: Followed::new(&manifest, &beads),
        curves: vec![Series::default(); if args.common.figure.is_empty() { 0 } else { beads.len() }],
        events: Vec::new(),
        event_count: 0,
        event_table: table(args.events.as_ref(), &event_columns, args.common.frames.force)?,
        rows: ResultRows::open(&session, "impurity", &published, args.out.as_ref())?,
        row: Vec::with_capacity(published.width),
    };
    let tally = session.follow(&mut outputs)?;

    let Outputs { curves, events, event_count, event_table, rows: written, .. } = outputs;
    written.finish()?;
    event_table.map(Table::finish).transpose()?;
    draw(&args.common, || Ok(plots::trajectories(&manifest, &beads, &curves, &events)))?;
    session.report(&tally, "motion", rows(&beads, &events, event_count), json(&beads, &events, event_count))
}

/// The beads named, or every impurity, or the middle bead.
fn beads(args: &ImpurityArgs, manifest: &RunManifest) -> Result<Vec<u64>, Failure> {
    if !args.bead.is_empty() {
        return args.bead.iter().map(|bead| check_bead(manifest, "--bead", *bead)).collect();
    }
    let impurities: Vec<_> = manifest.physics.impurities.iter().map(|impurity| impurity.bead).collect();
    Ok(if impurities.is_empty() { vec![default_split_bead(manifest)] } else { impurities })
}

fn rows(beads: &[u64], events: &[Event], event_count: u64) -> Rows {
    let listed: Vec<_> = beads.iter().map(u64::to_string).collect();
    let turns: Vec<_> = events.iter().filter(|event| event.kind == EventKind::Turns).collect();
    let shown = turns.iter().take(8).map(|turn| {
        let (place, time) = (display::quantity(turn.u_m, "m"), display::quantity(turn.time_s, "s"));
        format!("bead {} at {place}, {time}", turn.bead)
    });
    let mut rows = Rows::default();
    rows.add("beads", listed.join(", "));
    rows.add("events", format_args!("{event_count}, {}", counted(turns.len() as u64, "turning point")));
    rows.each("turns", shown);
    rows
}

fn json(beads: &[u64], events: &[Event], event_count: u64) -> Value {
    let event = |event: &Event| json!({ "time_s": event.time_s, "bead": event.bead, "event": event.kind.as_str(), "u_m": event.u_m });
    json!({
        "beads": beads,
        "event_count": event_count,
        "events": events.iter().map(event).collect::<Vec<_>>(),
    })
}
