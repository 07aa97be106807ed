//! `beadline impurity`.

use crate::analysis::{AnalysisError, ROW_HEAD, Session, begin_row, check_bead, draw, finish, publish};
use crate::args::ImpurityArgs;
use crate::display::{self, counted};
use crate::failure::{Done, Failure};
use crate::outputs::check_tables;
use bus::ResultPublisher;
use consumers::energies::default_split_bead;
use consumers::follow::Analysis;
use consumers::impurity::{Event, EventKind, Followed, Motion};
use consumers::plots;
use consumers::series::Series;
use consumers::table::Table;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use schemas::results::{ResultColumns, Topic};
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
    table: Option<Table>,
    event_table: Option<Table>,
    publisher: Option<ResultPublisher<f64>>,
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
        if let Some(table) = &mut self.table {
            begin_row(table, frame);
            for value in &self.row {
                // the beads at the ends have one neighbour
                if value.is_nan() {
                    table.empty()
                } else {
                    table.double(*value)
                };
            }
            table.end_row()?;
        }
        publish(self.publisher.as_mut(), frame, &self.row)
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
    let names: Vec<_> = beads
        .iter()
        .flat_map(|bead| Motion::QUANTITIES.map(|(quantity, unit)| format!("{quantity}_{bead}_{unit}")))
        .collect();
    let columns: Vec<_> = ROW_HEAD.iter().map(|name| (*name).to_owned()).chain(names.clone()).collect();
    let event_columns = ["time_s", "bead", "event", "u_m"].map(str::to_owned);
    let create = |path, columns: &[String]| Table::create(path, columns, args.common.frames.force);
    let published = ResultColumns { width: names.len(), names: names.join(","), tolerance_m: None };
    let mut outputs = Outputs {
        followed: Followed::new(&manifest, &beads),
        curves: vec![Series::default(); if args.common.figure.is_empty() { 0 } else { beads.len() }],
        events: Vec::new(),
        event_count: 0,
        table: args.out.as_ref().map(|path| create(path, &columns)).transpose()?,
        event_table: args.events.as_ref().map(|path| create(path, &event_columns)).transpose()?,
        publisher: session.results(Topic::Impurity, &published)?,
        row: Vec::with_capacity(names.len()),
    };
    let tally = session.follow(&mut outputs)?;

    let Outputs { curves, events, event_count, table, event_table, publisher, .. } = outputs;
    finish(publisher)?;
    table.map(Table::finish).transpose()?;
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

fn rows(beads: &[u64], events: &[Event], event_count: u64) -> Vec<(&'static str, String)> {
    let listed: Vec<_> = beads.iter().map(u64::to_string).collect();
    let turns: Vec<_> = events.iter().filter(|event| event.kind == EventKind::Turns).collect();
    let shown: Vec<_> = turns
        .iter()
        .take(8)
        .map(|turn| {
            let (place, time) = (display::quantity(turn.u_m, "m"), display::quantity(turn.time_s, "s"));
            format!("bead {} at {place}, {time}", turn.bead)
        })
        .collect();
    let mut rows = vec![
        ("beads", listed.join(", ")),
        ("events", format!("{event_count}, {}", counted(turns.len() as u64, "turning point"))),
    ];
    rows.extend(shown.into_iter().map(|turn| ("turns", turn)));
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
