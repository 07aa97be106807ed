//! `beadline pulses`.

use crate::analysis::{AnalysisError, Session, draw, finish, publish, table};
use crate::args::{AnalysisArgs, PulsesArgs};
use crate::display::{self, count, counted};
use crate::failure::{BadInput, Done, Failure};
use crate::outputs::check_tables;
use crate::report::Rows;
use bus::ResultPublisher;
use consumers::follow::Analysis;
use consumers::pulses::{
    Birth, Counts, Fate, Happening, Obstacles, Point, Pulse, Pulses, Strongest, UnderWay, Unfollowed,
};
use consumers::space_time::{Extent, Picture, singles};
use consumers::table::Table;
use producer::resimulation::check_kernel;
use recording::RecordingSource;
use schemas::frame::{Frame, FrameSource};
use schemas::manifest::RunManifest;
use schemas::results::{PULSE, ResultColumns};
use serde_json::{Value, json};
use source::Named;

/// Pulses shown in the summary.
const SHOWN: usize = 12;

/// Most disturbances without a pulse that are listed, on the screen and in JSON.
const TOLD: usize = 3;
const MOST_IN_JSON: usize = 100;

/// Pulses in a published row.
const PUBLISHED: usize = 16;

const PULSE_COLUMNS: [&str; 19] = [
    "pulse",
    "direction",
    "birth_time_s",
    "birth_bead",
    "birth",
    "end_time_s",
    "end_bead",
    "end",
    "bead_count",
    "bead",
    "time_s",
    "v_peak_m_s",
    "speed_beads_per_s",
    "fwhm_beads",
    "asymmetry",
    "speed_over_solitary",
    "fwhm_over_solitary",
    "momentum_kg_m_s",
    "energy_j",
];

const POINT_COLUMNS: [&str; 7] =
    ["pulse", "bead", "time_s", "v_peak_m_s", "speed_beads_per_s", "fwhm_beads", "asymmetry"];

/// The analysis and its outputs.
struct Outputs {
    pulses: Pulses,
    strongest: Strongest,
    /// Kept only for a figure.
    map: Option<Picture<f32>>,
    tables: Tables,
    publisher: Option<ResultPublisher<f64>>,
    row: Vec<f64>,
}

struct Tables {
    pulses: Option<Table>,
    points: Option<Table>,
}

impl Analysis for Outputs {
    type Error = AnalysisError;

    fn observe(&mut self, frame: &Frame<'_>) -> Result<(), AnalysisError> {
        if let Some(map) = &mut self.map {
            map.push(frame.step, singles(frame.v_m_s.iter().copied()));
        }
        for happening in self.pulses.observe(frame) {
            self.strongest.take(happening);
            self.tables.write(happening)?;
        }
        if self.publisher.is_some() {
            published_row(&mut self.row, self.pulses.under_way(frame.time_s));
        }
        publish(self.publisher.as_mut(), frame, &self.row)
    }

    fn gap(&mut self) {
        self.pulses.gap();
        if let Some(map) = &mut self.map {
            map.gap();
        }
    }
}

pub(crate) fn pulses(args: &PulsesArgs) -> Result<Done, Failure> {
    let tables: Vec<_> = args.out.iter().chain(&args.positions).collect();
    check_tables(&tables)?;
    if !(args.threshold > 0.0 && args.threshold.is_finite()) {
        return Err(bad_input!("--threshold {}: expected a number above 0", args.threshold));
    }
    let common = with_enough_steps(args)?;
    let mut session = Session::open(&common, "pulses", &tables)?;
    let manifest = session.manifest().clone();
    let threshold_m_s = args.threshold * Pulses::velocity_scale_m_s(&manifest);
    let drawn = !args.common.figure.is_empty();
    let published = ResultColumns::pulses(PUBLISHED);
    let bead_count = manifest.contact_count() + 1;
    let mut outputs = Outputs {
        pulses: Pulses::new(&manifest, threshold_m_s),
        strongest: Strongest::new(drawn),
        map: drawn.then(|| Picture::new(Extent { places: 0..bead_count, steps: session.steps() })),
        tables: Tables::create(args)?,
        publisher: session.results("pulses", &published)?,
        row: Vec::with_capacity(published.width),
    };
    let tally = session.follow(&mut outputs)?;

    let Outputs { mut pulses, mut strongest, map, mut tables, publisher, .. } = outputs;
    for happening in pulses.finish() {
        strongest.take(happening);
        tables.write(happening)?;
    }
    finish(publisher)?;
    tables.finish()?;
    if let Some(map) = map {
        draw(&args.common, || Ok(plots::pulses(&manifest, threshold_m_s, &map, &mut strongest)?))?;
    }
    let obstacles = Obstacles::of(&manifest.physics.chain());
    let is_whole = warn(&manifest, &pulses);
    let results = json(threshold_m_s, &pulses, strongest.pulses());
    let mut rows = Rows::default();
    rows.add("pulses", counts_text(&pulses.counts(), threshold_m_s));
    if !pulses.unfollowed().is_empty() {
        rows.add("not followed", not_followed_text(&pulses));
    }
    rows.add("", HEADING);
    add_lines(&mut rows, &obstacles, strongest.pulses());
    let done = session.report(&tally, "pulses", rows, results)?;
    Ok(if is_whole { done } else { Done::Lossy })
}

/// The arguments, with what a recording lacks where it has too little for the fastest pulses: its frames if they are
/// enough, else every step.
fn with_enough_steps(args: &PulsesArgs) -> Result<AnalysisArgs, Failure> {
    let mut common = args.common.clone();
    let frames = &mut common.frames;
    let Named::File(path) = &frames.source else { return Ok(common) };
    if frames.every_step || frames.fill_gaps {
        return Ok(common);
    }
    let source = RecordingSource::open(path).bad_input()?;
    let manifest = source.manifest();
    let interval = manifest.provenance.record_every_steps;
    if !is_coarse(manifest, interval) {
        return Ok(common);
    }
    let few = format!("the recording has every {interval}th step, too few to follow pulses");
    if args.as_recorded {
        notice!("{few}; nothing is recomputed, as asked by --as-recorded");
    } else if let Err(error) = check_kernel(manifest) {
        notice!("{few}; the steps between are not recomputed: {error}");
    } else if is_coarse(manifest, manifest.provenance.publish_every_steps) {
        notice!("{few}; the steps between are recomputed");
        frames.every_step = true;
    } else {
        notice!("{few}; the frames between are recomputed");
        frames.fill_gaps = true;
    }
    Ok(common)
}

/// Whether frames this many steps apart show the fastest pulses too coarsely.
pub(crate) fn is_coarse(manifest: &RunManifest, interval_steps: u64) -> bool {
    Pulses::longest_fine_interval_steps(manifest).is_some_and(|needed| interval_steps > needed)
}

/// How many pulses there are, and how many of them at any threshold.
fn counts_text(counts: &Counts, threshold_m_s: f64) -> String {
    let all = format!("{} with peaks above {threshold_m_s:.3e} m/s", count(counts.pulses));
    if counts.clear_pulses == counts.pulses {
        return all;
    }
    let (clear, beads) = (count(counts.clear_pulses), Pulses::CLEAR_TRACK);
    format!("{all}; {clear} above twice that over {beads} beads, the others depend on the threshold")
}

impl Tables {
    fn create(args: &PulsesArgs) -> Result<Self, Failure> {
        let force = args.common.frames.force;
        let pulses = table(args.out.as_ref(), &PULSE_COLUMNS, force)?;
        Ok(Self { pulses, points: table(args.positions.as_ref(), &POINT_COLUMNS, force)? })
    }

    fn write(&mut self, happening: &Happening) -> Result<(), AnalysisError> {
        match (happening, &mut self.pulses, &mut self.points) {
            (Happening::Passed(point), _, Some(table)) => {
                table.integer(point.pulse);
                write_point(table, point);
                Ok(table.end_row()?)
            }
            (Happening::Ended(pulse), Some(table), _) => write_pulse(table, pulse),
            _ => Ok(()),
        }
    }

    fn finish(self) -> Result<(), Failure> {
        self.pulses.map(Table::finish).transpose()?;
        self.points.map(Table::finish).transpose()?;
        Ok(())
    }
}

fn write_pulse(table: &mut Table, pulse: &Pulse) -> Result<(), AnalysisError> {
    table.integer(pulse.number).word(pulse.direction.as_str());
    table.double(pulse.birth_time_s).integer(pulse.birth_bead).word(pulse.birth.as_str());
    table.double(pulse.end_time_s).integer(pulse.end_bead).word(pulse.fate.as_str());
    table.integer(pulse.bead_count);
    write_point(table, &pulse.measured.point);
    table.optional(pulse.speed_over_solitary).optional(pulse.fwhm_over_solitary);
    table.double(pulse.measured.momentum_kg_m_s).double(pulse.measured.energy_j);
    Ok(table.end_row()?)
}

fn write_point(table: &mut Table, point: &Point) {
    table.integer(point.bead).double(point.time_s).double(point.v_peak_m_s).optional(point.speed_beads_per_s);
    table.optional(point.shape.map(|shape| shape.fwhm_beads));
    table.optional(point.shape.map(|shape| shape.asymmetry));
}

/// The strongest pulses under way, in the order of their numbers.
fn published_row(row: &mut Vec<f64>, under_way: impl Iterator<Item = UnderWay>) {
    let mut pulses: Vec<_> = under_way.collect();
    if pulses.len() > PUBLISHED {
        pulses.sort_by(|a, b| b.v_peak_m_s.abs().total_cmp(&a.v_peak_m_s.abs()));
        pulses.truncate(PUBLISHED);
    }
    pulses.sort_by_key(|pulse| pulse.number);
    row.clear();
    for pulse in &pulses {
        let fwhm_beads = pulse.fwhm_beads.unwrap_or(f64::NAN);
        let (position, velocity) = (pulse.position_beads, pulse.velocity_beads_per_s);
        row.extend([pulse.number as f64, position, pulse.v_peak_m_s, velocity, fwhm_beads]);
    }
    row.resize(PUBLISHED * PULSE.len(), f64::NAN);
}

/// Says what could not be followed. True if everything was.
fn warn(manifest: &RunManifest, pulses: &Pulses) -> bool {
    let counts = pulses.counts();
    let coarse = is_coarse(manifest, counts.longest_interval_steps);
    let unresolved = Pulses::longest_interval_steps(manifest)
        .is_some_and(|longest| counts.longest_interval_steps > longest);
    if coarse {
        notice!(
            "frames are {} steps apart: peaks of fast pulses are off by more than 1e-4, and pulses may be missed; \
             every {} steps are enough, and --every-step recomputes them",
            counts.longest_interval_steps,
            Pulses::longest_fine_interval_steps(manifest).unwrap_or(1),
        );
    }
    if counts.unresolved_crests > 0 {
        let unresolved = counted(counts.unresolved_crests, "crest");
        notice!("left out {unresolved} that fell between frames");
    }
    for disturbance in pulses.unfollowed().iter().take(TOLD) {
        display::notice(unfollowed_text(disturbance));
    }
    if let Some(more) = counts.unfollowed.checked_sub(TOLD as u64 + 1) {
        notice!("so did {} more", count(more + 1));
    }
    !unresolved && counts.unresolved_crests == 0 && counts.unfollowed == 0
}

/// What led a front is more than a wave among others.
fn not_followed_text(pulses: &Pulses) -> String {
    let all = counted(pulses.counts().unfollowed, "disturbance");
    let leading = if leading_is_followed(pulses) { "" } else { "; the leading pulse is missing" };
    format!("{all}{leading}")
}

fn leading_is_followed(pulses: &Pulses) -> bool {
    !pulses.unfollowed().iter().any(|disturbance| disturbance.leads)
}

fn unfollowed_text(disturbance: &Unfollowed) -> String {
    let Unfollowed { beads: [from, to], times_s: [since_s, until_s], v_peak_m_s, leads } = disturbance;
    let (v_peak, since_ms, until_ms) = (peak(*v_peak_m_s), since_s * 1e3, until_s * 1e3);
    if *leads {
        return format!(
            "the leading pulse is missing: a front of {v_peak} m/s passed beads {from} to {to} from {since_ms:.3} to \
             {until_ms:.3} ms, and no pulse follows it"
        );
    }
    format!(
        "a disturbance of {v_peak} m/s passed beads {from} to {to} from {since_ms:.3} to {until_ms:.3} ms, and no \
         pulse follows it"
    )
}

const HEADING: &str =
    "      v_peak       speed    width   V/V_sw  asymm.  at bead  from                     to";

/// The summary of each pulse. A pulse from or to an impurity is first or last seen beside it; the impurity is named.
fn add_lines(rows: &mut Rows, obstacles: &Obstacles, pulses: &[Pulse]) {
    let number = |value: Option<f64>, decimals: usize| {
        value.map_or("–".into(), |value| display::fixed(value, decimals))
    };
    let line = |pulse: &Pulse| {
        let point = &pulse.measured.point;
        let named = |is_impurity, bead| if is_impurity { obstacles.nearest(bead) } else { bead };
        let from = named(pulse.birth == Birth::Impurity, pulse.birth_bead);
        let to = named(pulse.fate == Fate::Impurity, pulse.end_bead);
        format!(
            "{:>9} m/s {:>8}/s {:>7} {:>8} {:>7} {:>8}  {:<24} {}",
            peak(point.v_peak_m_s),
            number(point.speed_beads_per_s, 1),
            number(point.shape.map(|shape| shape.fwhm_beads), 3),
            number(pulse.speed_over_solitary, 5),
            number(point.shape.map(|shape| shape.asymmetry), 3),
            point.bead,
            format!("{} {} at {:.3} ms", pulse.birth.as_str(), from, pulse.birth_time_s * 1e3),
            format_args!("{} {} at {:.3} ms", pulse.fate.as_str(), to, pulse.end_time_s * 1e3),
        )
    };
    for pulse in pulses.iter().take(SHOWN) {
        rows.add(format!("pulse {}", pulse.number), line(pulse));
    }
}

/// A velocity (m/s) with its digits, however weak the pulse is.
fn peak(v_m_s: f64) -> String {
    if v_m_s.abs() < 1e-2 { format!("{v_m_s:.2e}") } else { format!("{v_m_s:.6}") }
}

fn json(threshold_m_s: f64, found: &Pulses, pulses: &[Pulse]) -> Value {
    let counts = found.counts();
    let pulse = |pulse: &Pulse| {
        let (measured, point) = (&pulse.measured, &pulse.measured.point);
        json!({
            "pulse": pulse.number,
            "direction": pulse.direction.as_str(),
            "birth": { "time_s": pulse.birth_time_s, "bead": pulse.birth_bead, "from": pulse.birth.as_str() },
            "end": { "time_s": pulse.end_time_s, "bead": pulse.end_bead, "by": pulse.fate.as_str() },
            "bead_count": pulse.bead_count,
            "bead": point.bead,
            "time_s": point.time_s,
            "undisturbed": measured.undisturbed,
            "v_peak_m_s": point.v_peak_m_s,
            "speed_beads_per_s": point.speed_beads_per_s,
            "fwhm_beads": point.shape.map(|shape| shape.fwhm_beads),
            "asymmetry": point.shape.map(|shape| shape.asymmetry),
            "speed_over_solitary": pulse.speed_over_solitary,
            "fwhm_over_solitary": pulse.fwhm_over_solitary,
            "momentum_kg_m_s": measured.momentum_kg_m_s,
            "energy_j": measured.energy_j,
        })
    };
    json!({
        "threshold_m_s": threshold_m_s,
        "pulse_count": counts.pulses,
        "clear_pulse_count": counts.clear_pulses,
        "coarse_crest_count": counts.coarse_crests,
        "unresolved_crest_count": counts.unresolved_crests,
        "unfollowed_count": counts.unfollowed,
        "leading_pulse_followed": leading_is_followed(found),
        "unfollowed": found.unfollowed().iter().take(MOST_IN_JSON).collect::<Vec<_>>(),
        "pulses": pulses.iter().map(pulse).collect::<Vec<_>>(),
    })
}
