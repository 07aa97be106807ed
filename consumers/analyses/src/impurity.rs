//! Motion of an impurity, or of any beads: trajectory, contacts, turning points.

use consumers::analysis::{
    Analysis, Beginning, Meaning, Needs, Number, Offer, Outlet, Refusal, Remake, Report, Setting, TableFlag,
    Takes, Whereabouts, Words,
};
use consumers::energies::default_split_bead;
use consumers::impurity::{Event, EventKind, Followed, Motion};
use consumers::series::Series;
use consumers::table::{Cell, Column};
use figure::{Figure, FigureError};
use schemas::amounts::{count, counted, quantity};
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use schemas::results::ResultColumns;
use serde_json::{Value, json};

/// The analysis, before it looks at a run.
pub static OFFER: Offer = Offer {
    name: "impurity",
    about: "Motion of the impurity, or of any beads: trajectory, contacts, turning points",
    help: "Examples:\n  \
        beadline impurity --figure trajectory.png            attach to the only live run\n  \
        beadline impurity run.mcap --out i.csv --events events.csv\n  \
        beadline impurity run.mcap --bead 499 --bead 501     other beads\n\n\
        A contact counts as closed while its overlap is above 1e-6 of the collision length L. Events are \
        interpolated between frames.",
    settings: &[Setting::new(
        "bead",
        Takes::Whole("BEAD"),
        "A bead to follow, repeatable [default: every impurity, or the middle bead]",
    )
    .repeatable()],
    tables: &[
        TableFlag { name: "out", help: "Table of the motion in each frame" },
        TableFlag { name: "events", help: "Table of events: contacts that close or open, turning points" },
    ],
    columns: &[
        Meaning::number("u_BEAD_m", "displacement"),
        Meaning::number("v_BEAD_m_s", "velocity"),
        Meaning::number("overlap_left_BEAD_m", "overlap of the contact on its left"),
        Meaning::number("overlap_right_BEAD_m", "overlap of the contact on its right"),
    ],
    summary: &[
        Meaning::count("event_count", "contacts that closed or opened, and turning points"),
        Meaning::count("turn_count", "turning points"),
        Meaning::number("u_m", "last displacement"),
        Meaning::number("v_m_s", "last velocity"),
        Meaning::number("overlap_left_m", "last overlap of the contact on its left"),
        Meaning::number("overlap_right_m", "last overlap of the contact on its right"),
    ],
    place: Whereabouts::Of { setting: "bead", also: &[], allowed: "a bead such as @12" },
    needs: Needs { remake: Remake::OfThings("bead"), ..Needs::FRAMES },
    begin: |beginning| Ok(Box::new(MotionAnalysis::begin(beginning)?)),
};

/// Index of the table of events.
const EVENTS: usize = 1;

/// Events that are kept for words, JSON and the figure; the table has all of them.
const MAX_EVENTS: usize = 10_000;

const WIDTH: usize = Motion::QUANTITIES.len();

struct MotionAnalysis {
    manifest: RunManifest,
    beads: Vec<u64>,
    followed: Followed,
    /// One a bead, kept for a figure alone.
    curves: Vec<Series<WIDTH>>,
    events: Vec<Event>,
    event_count: u64,
    turn_count: u64,
    /// The last row.
    row: Vec<f64>,
}

impl MotionAnalysis {
    fn begin(beginning: &Beginning<'_>) -> Result<Self, Refusal> {
        let manifest = beginning.manifest.clone();
        let mut beads = beginning.beads("bead")?;
        if beads.is_empty() {
            beads = manifest.physics.impurities.iter().map(|impurity| impurity.bead).collect();
        }
        if beads.is_empty() {
            beads.push(default_split_bead(&manifest));
        }
        Ok(Self {
            followed: Followed::new(&manifest, &beads),
            curves: vec![Series::default(); if beginning.is_drawn { beads.len() } else { 0 }],
            events: Vec::new(),
            event_count: 0,
            turn_count: 0,
            row: Vec::with_capacity(beads.len() * WIDTH),
            manifest,
            beads,
        })
    }
}

impl Analysis for MotionAnalysis {
    fn columns(&self, table: usize) -> Vec<Column> {
        if table == EVENTS {
            return ["time_s", "bead", "event", "u_m"].map(|name| name.to_owned().into()).into();
        }
        Vec::new()
    }

    fn published(&self) -> Option<ResultColumns> {
        Some(ResultColumns::motion(&self.beads))
    }

    fn observe(&mut self, frame: &Frame<'_>, out: &mut dyn Outlet) {
        let (motions, events) = self.followed.observe(frame);
        self.row.clear();
        for (motion, curve) in motions.iter().zip(&mut self.curves) {
            curve.push(frame.time_s, motion.values());
        }
        self.row.extend(motions.iter().flat_map(Motion::values));
        for event in events {
            self.event_count += 1;
            self.turn_count += u64::from(event.kind == EventKind::Turns);
            if self.events.len() < MAX_EVENTS {
                self.events.push(*event);
            }
            if out.wants(EVENTS) {
                let word = Cell::Word(event.kind.as_str().to_owned());
                let (time, bead) = (Cell::Double(event.time_s), Cell::Integer(event.bead));
                out.line(EVENTS, &[time, bead, word, Cell::Double(event.u_m)]);
            }
        }
        out.row(frame, &self.row);
    }

    fn gap(&mut self) {
        self.followed.gap();
    }

    fn report(&mut self) -> Option<Report> {
        Some(Report { title: "motion", words: self.words(), results: self.json(), ..Report::default() })
    }

    fn figure(&mut self) -> Result<Option<Figure>, FigureError> {
        Ok(Some(plots::trajectories(&self.manifest, &self.beads, &self.curves, &self.events)))
    }

    fn value(&self, name: &str, _: Option<&str>) -> Option<Number> {
        let last = |at: usize| self.row.get(at).copied().map(Number::Double);
        match name {
            "event_count" => Some(Number::Count(self.event_count)),
            "turn_count" => Some(Number::Count(self.turn_count)),
            "u_m" => last(0),
            "v_m_s" => last(1),
            "overlap_left_m" => last(2),
            "overlap_right_m" => last(3),
            _ => None,
        }
    }
}

impl MotionAnalysis {
    fn words(&self) -> Words {
        let listed: Vec<_> = self.beads.iter().map(u64::to_string).collect();
        let turns = self.events.iter().filter(|event| event.kind == EventKind::Turns);
        let shown = turns.take(8).map(|turn| {
            let (place, time) = (quantity(turn.u_m, "m"), quantity(turn.time_s, "s"));
            format!("bead {} at {place}, {time}", turn.bead)
        });
        let mut words = Words::default();
        words.add("beads", listed.join(", "));
        let turning_points = counted(self.turn_count, "turning point");
        words.add("events", format_args!("{}, {turning_points}", count(self.event_count)));
        words.each("turns", shown);
        words
    }

    fn json(&self) -> Value {
        let event = |event: &Event| json!({ "time_s": event.time_s, "bead": event.bead, "event": event.kind.as_str(), "u_m": event.u_m });
        json!({
            "beads": self.beads,
            "event_count": self.event_count,
            "turn_count": self.turn_count,
            "events": self.events.iter().map(event).collect::<Vec<_>>(),
            "left_out_count": self.event_count - self.events.len() as u64,
        })
    }
}
