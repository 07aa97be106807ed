//! Pulses: when they pass, how strong, fast and wide they are, where they come from and go.

use consumers::analysis::{
    Allowed, Analysis, Beginning, Meaning, Needs, Number, Offer, Outlet, Refusal, Remake, Report, RowValues,
    Setting, TableFlag, Takes, Whereabouts, Words,
};
use consumers::pulses::{
    Birth, Counts, Direction, Fate, Happening, Obstacles, Point, Pulse, Pulses, Strongest, UnderWay,
    Unfollowed,
};
use consumers::space_time::{Extent, Picture, singles};
use consumers::table::{Cell, Column};
use figure::{Figure, FigureError};
use schemas::amounts::{self, count, counted, fixed, typed_quantity};
use schemas::frame::{Active, Frame};
use schemas::manifest::RunManifest;
use schemas::results::{PULSE, ResultColumns};
use serde_json::{Value, json};

/// The analysis, before it looks at a run.
pub static OFFER: Offer = Offer {
    name: "pulses",
    about: "Pulses: when they pass, how strong, fast and wide they are, where they come from and go",
    help: "Examples:\n  \
        beadline pulses --figure tracks.png                  attach to the only live run\n  \
        beadline pulses run.mcap --out pulses.csv --positions tracks.csv\n  \
        beadline pulses run.mcap --threshold 0.01            only those above a hundredth of v0\n\n\
        A pulse passes a bead when |v| of the bead has a maximum in time while both of its contacts are \
        pressed (bonds count as pressed, also where they pull); it counts once it has passed 5 beads, and ends where it meets an impurity or an end. Where \
        light and heavy beads alternate, the maximum is that of the mean velocity around. How many weak \
        pulses there are depends on the threshold: the count says how many would be found at twice of it. \
        Peaks are good to 1e-4 if 8 frames fall into the time that a pulse takes to pass; what a recording \
        with fewer lacks is recomputed, unless --as-recorded. What moved along the chain and is in no pulse, \
        above all a front that no pulse leads, is told, and the exit code is 3 then. V/V_sw is the speed over that of the exact solitary wave of the same \
        peak velocity: 1 for a pulse that no longer changes. Velocities, momenta and energies count from the velocity \
        that more than half of the beads begin with; if there is none, V/V_sw is empty. asymmetry = (rear − front)/(rear + front) of \
        the half widths. A bath's noise makes crests of its own: the more frames, the more pulses there are. `--json` and the tables have more: momentum, energy, width over that of the wave.",
    settings: &[Setting::new(
        "threshold",
        Takes::Number { unit: "", range: Allowed::AboveZero, default: Some("0.001") },
        "Smallest peak velocity of a pulse, relative to the run's velocity scale (v0)",
    )],
    tables: &[
        TableFlag {
            name: "out",
            help: "Table of the pulses, a row for each, in the order in which they end",
        },
        TableFlag {
            name: "positions",
            help: "Table of their tracks: a row for each bead that a pulse passes",
        },
    ],
    columns: &[
        Meaning::number("pulse", "its number; of at most 16 pulses under way"),
        Meaning::number("bead", "its crest"),
        Meaning::number("v_peak_m_s", "velocity of the crest's bead"),
        Meaning::number("velocity_beads_per_s", "its speed, with its direction"),
        Meaning::number("fwhm_beads", "its full width at half of its peak"),
    ],
    summary: &[
        Meaning::count("pulse_count", "pulses"),
        Meaning::count("bead", "the bead at which the strongest was measured"),
        Meaning::number("v_peak_m_s", "its peak velocity"),
        Meaning::number("speed_beads_per_s", "its speed"),
        Meaning::number("fwhm_beads", "its full width at half of its peak"),
        Meaning::number("asymmetry", "(rear − front)/(rear + front) of its half widths"),
        Meaning::number("speed_over_solitary", "its speed over that of the solitary wave"),
        Meaning::number("fwhm_over_solitary", "its width over that of the solitary wave"),
        Meaning::number("momentum_kg_m_s", "its momentum"),
        Meaning::number("energy_j", "its energy"),
    ],
    place: Whereabouts::Words(&["forward", "backward"]),
    needs: Needs {
        remake: Remake::OfFramesBefore("threshold"),
        longest_interval_steps: Some(Pulses::longest_fine_interval_steps),
        ..Needs::FRAMES
    },
    begin: |beginning| Ok(Box::new(PulseAnalysis::new(beginning))),
};

/// Indices of the tables.
const PULSES: usize = 0;
const POSITIONS: usize = 1;

/// Pulses in the summary.
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

/// Pulses of the frames of one run.
pub struct PulseAnalysis {
    manifest: RunManifest,
    /// Relative to the run's velocity scale.
    threshold: f64,
    threshold_m_s: f64,
    pulses: Pulses,
    strongest: Strongest,
    ways: [Way; 2],
    /// Happenings in the last frame, for those who look at single pulses.
    ended: Vec<Pulse>,
    /// Kept for a figure alone.
    map: Option<Picture<f32>>,
    row: Vec<f64>,
}

/// The pulses that travel in one direction.
#[derive(Debug, Clone, Copy)]
struct Way {
    direction: Direction,
    count: u64,
    /// The one of the largest peak velocity.
    strongest: Option<Pulse>,
}

impl PulseAnalysis {
    /// Begins to look at a run.
    pub fn new(beginning: &Beginning<'_>) -> Self {
        let manifest = beginning.manifest.clone();
        let threshold = beginning.settings.one("threshold").unwrap_or(Pulses::DEFAULT_THRESHOLD);
        let threshold_m_s = threshold * Pulses::velocity_scale_m_s(&manifest);
        let extent = Extent { places: 0..manifest.contact_count() + 1, steps: beginning.steps.clone() };
        let way = |direction| Way { direction, count: 0, strongest: None };
        Self {
            pulses: Pulses::new(&manifest, threshold_m_s),
            strongest: Strongest::new(beginning.is_drawn),
            ways: [Direction::Forward, Direction::Backward].map(way),
            ended: Vec::new(),
            map: beginning.is_drawn.then(|| Picture::new(extent)),
            row: Vec::new(),
            manifest,
            threshold,
            threshold_m_s,
        }
    }

    /// The pulses so far.
    pub fn pulses(&self) -> &Pulses {
        &self.pulses
    }

    /// The pulses that ended in the last frame, or at the end.
    pub fn ended(&self) -> &[Pulse] {
        &self.ended
    }

    fn take(&mut self, happening: &Happening, out: &mut dyn Outlet) {
        self.strongest.take(happening);
        match happening {
            Happening::Passed(point) if out.wants(POSITIONS) => {
                let line: Vec<Cell> =
                    [Cell::Integer(point.pulse)].into_iter().chain(point_cells(point)).collect();
                out.line(POSITIONS, &line);
            }
            Happening::Passed(_) => {}
            Happening::Ended(pulse) => {
                self.ended.push(*pulse);
                for way in self.ways.iter_mut().filter(|way| way.direction == pulse.direction) {
                    way.count += 1;
                    way.strongest = Pulse::stronger(way.strongest, Some(*pulse));
                }
                if out.wants(PULSES) {
                    out.line(PULSES, &pulse_line(pulse));
                }
            }
        }
    }
}

impl Analysis for PulseAnalysis {
    fn columns(&self, table: usize) -> Vec<Column> {
        let names = if table == POSITIONS { &POINT_COLUMNS[..] } else { &PULSE_COLUMNS };
        names.iter().map(|name| (*name).to_owned().into()).collect()
    }

    fn published(&self) -> Option<ResultColumns> {
        Some(ResultColumns::pulses(PUBLISHED, self.threshold))
    }

    fn observe(&mut self, frame: &Frame<'_>, out: &mut dyn Outlet) {
        if let Some(map) = &mut self.map {
            let Active { first, end } = frame.moving();
            map.push_from(first, frame.step, singles(frame.v_m_s[first..end].iter().copied()));
        }
        self.ended.clear();
        let happenings = self.pulses.observe(frame).to_vec();
        for happening in &happenings {
            self.take(happening, out);
        }
        if out.is_published() {
            published_row(&mut self.row, self.pulses.under_way(frame.time_s));
            out.publish(frame, RowValues::Numbers(&self.row));
        }
    }

    fn gap(&mut self) {
        self.pulses.gap();
        if let Some(map) = &mut self.map {
            map.gap();
        }
    }

    fn finish(&mut self, out: &mut dyn Outlet) -> Result<(), Refusal> {
        self.ended.clear();
        let happenings = self.pulses.finish().to_vec();
        for happening in &happenings {
            self.take(happening, out);
        }
        Ok(())
    }

    fn report(&mut self) -> Option<Report> {
        let (notices, is_lossy) = notices(&self.manifest, &self.pulses);
        let mut words = Words::default();
        words.add("pulses", counts_text(&self.pulses.counts(), self.threshold_m_s));
        if !self.pulses.unfollowed().is_empty() && !is_shaken(&self.manifest) {
            words.add("not followed", not_followed_text(&self.pulses));
        }
        let drift_m_s = self.pulses.drift_m_s();
        if drift_m_s != 0.0 {
            words.add(
                "velocities",
                format!("relative to {}, with which most beads begin", typed_quantity(drift_m_s, "m/s")),
            );
        }
        words.add("", HEADING);
        let obstacles = Obstacles::of(&self.manifest.physics.chain());
        add_lines(&mut words, &obstacles, self.strongest.pulses());
        let results = json(self.threshold_m_s, &self.pulses, self.strongest.pulses());
        Some(Report { title: "pulses", words, results, notices, is_lossy })
    }

    fn figure(&mut self) -> Result<Option<Figure>, FigureError> {
        let extent = Extent { places: 0..self.manifest.contact_count() + 1, steps: 0..=0 };
        let map = self.map.take().unwrap_or_else(|| Picture::new(extent));
        plots::pulses(&self.manifest, self.threshold_m_s, &map, &mut self.strongest).map(Some)
    }

    fn value(&self, name: &str, word: Option<&str>) -> Option<Number> {
        let ways = self.ways.iter().filter(|way| word.is_none_or(|word| word == way.direction.as_str()));
        if name == "pulse_count" {
            return Some(Number::Count(ways.map(|way| way.count).sum()));
        }
        let pulse = ways.fold(None, |strongest, way| Pulse::stronger(strongest, way.strongest))?;
        let point = &pulse.measured.point;
        Some(Number::Double(match name {
            "bead" => return Some(Number::Count(point.bead)),
            "v_peak_m_s" => point.v_peak_m_s,
            "speed_beads_per_s" => point.speed_beads_per_s?,
            "fwhm_beads" => point.shape?.fwhm_beads,
            "asymmetry" => point.shape?.asymmetry,
            "speed_over_solitary" => pulse.speed_over_solitary?,
            "fwhm_over_solitary" => pulse.fwhm_over_solitary?,
            "momentum_kg_m_s" => pulse.measured.momentum_kg_m_s,
            "energy_j" => pulse.measured.energy_j,
            _ => return None,
        }))
    }
}

/// Number of pulses, and of those that do not depend on the threshold.
fn counts_text(counts: &Counts, threshold_m_s: f64) -> String {
    let all = format!("{} with peaks above {threshold_m_s:.3e} m/s", count(counts.pulses));
    if counts.clear_pulses == counts.pulses {
        return all;
    }
    let (clear, beads) = (count(counts.clear_pulses), Pulses::CLEAR_TRACK);
    format!("{all}; {clear} above twice that over {beads} beads, the others depend on the threshold")
}

fn pulse_line(pulse: &Pulse) -> Vec<Cell> {
    let word = |word: &str| Cell::Word(word.to_owned());
    let mut line = vec![
        Cell::Integer(pulse.number),
        word(pulse.direction.as_str()),
        Cell::Double(pulse.birth_time_s),
        Cell::Integer(pulse.birth_bead),
        word(pulse.birth.as_str()),
        Cell::Double(pulse.end_time_s),
        Cell::Integer(pulse.end_bead),
        word(pulse.fate.as_str()),
        Cell::Integer(pulse.bead_count),
    ];
    line.extend(point_cells(&pulse.measured.point));
    line.extend([pulse.speed_over_solitary, pulse.fwhm_over_solitary].map(Cell::from));
    line.extend([pulse.measured.momentum_kg_m_s, pulse.measured.energy_j].map(Cell::Double));
    line
}

fn point_cells(point: &Point) -> [Cell; 6] {
    [
        Cell::Integer(point.bead),
        Cell::Double(point.time_s),
        Cell::Double(point.v_peak_m_s),
        point.speed_beads_per_s.into(),
        point.shape.map(|shape| shape.fwhm_beads).into(),
        point.shape.map(|shape| shape.asymmetry).into(),
    ]
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

/// Warnings about what could not be followed; true if something was lost.
fn notices(manifest: &RunManifest, pulses: &Pulses) -> (Vec<String>, bool) {
    if is_shaken(manifest) {
        let noise = "a bath shakes beads: the number of pulses depends on how many frames are looked at";
        return (vec![noise.to_owned()], false);
    }
    let (counts, mut notices) = (pulses.counts(), Vec::new());
    let seen = counts.longest_interval_steps;
    let longer = |longest: Option<u64>| longest.is_some_and(|longest| seen > longest);
    let fine = Pulses::longest_fine_interval_steps(manifest);
    if longer(fine) {
        notices.push(format!(
            "frames are {seen} steps apart: peaks of fast pulses are off by more than 1e-4, and pulses may be missed; \
             every {} steps are enough, and --every-step recomputes them",
            fine.unwrap_or(1),
        ));
    }
    if counts.unresolved_crests > 0 {
        let unresolved = counted(counts.unresolved_crests, "crest");
        notices.push(format!("left out {unresolved} that fell between frames"));
    }
    notices.extend(pulses.unfollowed().iter().take(TOLD).map(unfollowed_text));
    if let Some(more) = counts.unfollowed.checked_sub(TOLD as u64 + 1) {
        notices.push(format!("so did {} more", count(more + 1)));
    }
    let unresolved = longer(Pulses::longest_interval_steps(manifest));
    (notices, unresolved || counts.unresolved_crests > 0 || counts.unfollowed > 0)
}

/// True if a bath's noise moves beads: their velocities have a maximum every few steps, however short these are.
fn is_shaken(manifest: &RunManifest) -> bool {
    manifest.physics.baths.iter().any(|bath| bath.hottest_j() > 0.0)
}

/// Number of disturbances without a pulse. One that led a front is more than a wave among others.
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
    let (v_peak, since, until) = (peak(*v_peak_m_s), time(*since_s), time(*until_s));
    if *leads {
        return format!(
            "the leading pulse is missing: a front of {v_peak} m/s passed beads {from} to {to} from {since} to \
             {until}, and no pulse follows it"
        );
    }
    format!(
        "a disturbance of {v_peak} m/s passed beads {from} to {to} from {since} to {until}, and no \
         pulse follows it"
    )
}

const HEADING: &str =
    "      v_peak       speed    width   V/V_sw  asymm.  at bead  from                     to";

/// The summary of each pulse. A pulse from or to an impurity is first or last seen beside it; the impurity is named.
fn add_lines(words: &mut Words, obstacles: &Obstacles, pulses: &[Pulse]) {
    let number =
        |value: Option<f64>, decimals: usize| value.map_or("–".into(), |value| fixed(value, decimals));
    let line = |pulse: &Pulse| {
        let point = &pulse.measured.point;
        let named = |is_impurity, bead| if is_impurity { obstacles.nearest(bead) } else { bead };
        let from = named(pulse.birth == Birth::Impurity, pulse.birth_bead);
        let to = named(pulse.fate == Fate::Impurity, pulse.end_bead);
        format!(
            "{:>9} m/s {:>8}/s {:>7} {:>8} {:>7} {:>8}  {:<24} {}",
            peak(point.v_peak_m_s),
            point.speed_beads_per_s.map_or("–".into(), speed),
            number(point.shape.map(|shape| shape.fwhm_beads), 3),
            number(pulse.speed_over_solitary, 5),
            number(point.shape.map(|shape| shape.asymmetry), 3),
            point.bead,
            format!("{} {} at {}", pulse.birth.as_str(), from, time(pulse.birth_time_s)),
            format_args!("{} {} at {}", pulse.fate.as_str(), to, time(pulse.end_time_s)),
        )
    };
    for pulse in pulses.iter().take(SHOWN) {
        words.add(format!("pulse {}", pulse.number), line(pulse));
    }
}

/// A velocity (m/s) with its digits, however weak the pulse is.
fn peak(v_m_s: f64) -> String {
    if v_m_s.abs() < 1e-2 { format!("{v_m_s:.2e}") } else { format!("{v_m_s:.6}") }
}

/// A speed (beads/s), with six digits where one decimal is too few.
fn speed(beads_per_s: f64) -> String {
    if beads_per_s < 1e3 { amounts::number(beads_per_s) } else { fixed(beads_per_s, 1) }
}

/// A time in milliseconds, or in a unit that fits it where these are too coarse or too fine.
fn time(time_s: f64) -> String {
    if time_s == 0.0 || (1e-6..10.0).contains(&time_s) {
        return format!("{:.3} ms", time_s * 1e3);
    }
    typed_quantity(time_s, "s")
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

#[cfg(test)]
mod tests {
    use super::*;
    use consumers::analysis::{LastRow, Settings};
    use producer::integrator::Integrator;
    use producer::state::ChainState;
    use schemas::config::RunConfig;
    use schemas::manifest::Origin;

    /// The analysis of every step of a chain of equal spheres.
    fn observed(beads: u64, rest: &str) -> PulseAnalysis {
        let toml =
            format!("[chain]\nbeads = {beads}\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n{rest}");
        let origin = Origin { program: "test".into(), host: "here".into(), started_unix_ns: 1 };
        let manifest = RunManifest::new(&RunConfig::from_toml(&toml).unwrap(), "run", origin).unwrap();
        let settings = Settings::default();
        let mut analysis = PulseAnalysis::new(&Beginning::whole("pulses", &manifest, &settings));
        let (mut state, mut out) = (ChainState::initial(&manifest.physics), LastRow::default());
        let mut integrator = Integrator::new(&manifest.physics);
        while state.step < manifest.physics.step_count {
            analysis.observe(&state.as_frame(&manifest, state.step), &mut out);
            integrator.step(&mut state);
        }
        analysis.finish(&mut out).unwrap();
        analysis
    }

    /// Noise makes fronts that no pulse follows; the report says what the number of pulses is worth.
    #[test]
    fn a_bath_makes_pulses_of_noise() {
        let bath = "[[bath]]\nbeads = \"0..19\"\ntemperature_j = 1e-3\nfriction_per_s = 1e4\n";
        let report = observed(20, &format!("{bath}[time]\nduration_s = 1e-3\n")).report().unwrap();
        assert!(!report.is_lossy && report.notices.len() == 1, "{:?}", report.notices);
        assert!(report.notices[0].starts_with("a bath shakes beads"), "{:?}", report.notices);
    }

    /// Two drives make four fronts, and a front goes on beyond the seam of a ring; a striker beside that makes pulses in both
    /// directions.
    #[test]
    fn fronts_of_several_places_are_not_one() {
        let shape = "{ amplitude = 5.0, duration_s = 2e-4, at_s = 1e-4 }";
        let drive = |bead: u64| format!("[[drive]]\nbead = {bead}\nforce_n.half_sine = {shape}\n");
        let drives = [40, 120].map(drive).concat();
        let ends = "[ends]\nleft = \"periodic\"\nright = \"periodic\"\n";
        let ring = format!("{ends}[striker]\nbead = 82\nvelocity_m_s = 1.0\n");
        for (beads, rest, of_strikers) in [(200, drives, 0), (90, ring, 2)] {
            let mut analysis = observed(beads, &format!("{rest}[time]\nduration_s = 0.006\n"));
            assert_eq!(analysis.pulses.unfollowed(), []);
            let pulses = analysis.strongest.pulses();
            let found = pulses.iter().filter(|pulse| pulse.birth == Birth::Striker).count();
            assert_eq!(found, of_strikers, "{pulses:?}");
        }
    }

    #[test]
    fn slow_and_fast_units_keep_their_digits() {
        assert_eq!([4567.89, 1.449_634, 1.234_567e-7].map(speed), ["4567.9", "1.44963", "1.23457e-7"]);
        let told = [0.0, 1.234_567e-2, 226_870.421_774, 2.5e-9].map(time);
        assert_eq!(told, ["0.000 ms", "12.346 ms", "226870 s", "2.5 ns"]);
    }
}
