//! Each analysis as a sweep looks at it: one place, one value for each column.

use super::Value::{self, Count, Number};
use super::{Analyses, Look};
use consumers::contacts::{ContactCounts, Contacts, default_tolerance_m};
use consumers::deformation::{Comparison, Deformation, Deformations, Untold};
use consumers::energies::{EnergyOutcome, EnergyRow};
use consumers::impurity::{EventKind, Followed, Motion};
use consumers::pulses::{Direction, Pulse};
use consumers::spreading::{Spreading, SpreadingRow};
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use std::cell::RefCell;
use std::rc::Rc;
use waves::dispersion::UnitCell;
use waves::linear::LinearChain;
use waves::modes::{Modes, ModesError};
use waves::peaks::{Peak, Peaks};
use waves::place::{Place, Quantity, Sensors, Side};
use waves::sampling::{Sampling, Take};
use waves::segments::Window;
use waves::welch::{DensitySummary, Welch};

type Begun = Result<Box<dyn Look>, String>;

/// Columns of what is reflected, in its summary.
pub(super) const REFLECTED: [&str; 6] = [
    "max_abs_relative_drift",
    "reflected_over_total",
    "reflected_over_transmitted",
    "corrected_over_total",
    "corrected_over_transmitted",
    "corrected_over_incident",
];

/// Columns of the strongest pulse.
pub(super) const PULSE: [&str; 8] = [
    "v_peak_m_s",
    "speed_beads_per_s",
    "fwhm_beads",
    "asymmetry",
    "speed_over_solitary",
    "fwhm_over_solitary",
    "momentum_kg_m_s",
    "energy_j",
];

/// Columns of the first pulse at a contact.
pub(super) const DEFORMATION: [&str; 14] = [
    "t_peak_s",
    "overlap_peak_m",
    "overlap_fwhm_s",
    "asymmetry",
    "impulse_n_s",
    "speed_beads_per_s",
    "exact_overlap_fwhm_s",
    "exact_l1",
    "exact_l2",
    "exact_l_infinity",
    "continuum_overlap_fwhm_s",
    "continuum_l1",
    "continuum_l2",
    "continuum_l_infinity",
];

/// The number that `place` is, below `count`; `what` is the kind of place.
fn number(place: Option<&str>, what: &str, numbers: std::ops::Range<u64>) -> Result<u64, String> {
    let found = place.unwrap_or_default();
    let known = found.parse().ok().filter(|number| numbers.contains(number));
    known.ok_or_else(|| {
        format!("found @{found}; allowed: {what}s {} to {} of this chain", numbers.start, numbers.end - 1)
    })
}

#[derive(Default)]
struct Energies(Option<EnergyOutcome>);

#[allow(clippy::unnecessary_wraps, reason = "one of the functions of the table, others of which refuse")]
pub(super) fn energies(_: &RunManifest, _: Option<&str>) -> Begun {
    Ok(Box::new(Energies::default()))
}

impl Look for Energies {
    fn finish(&mut self, _: &Frame<'_>, analyses: &Analyses) {
        self.0 = analyses.energies.outcome();
    }

    fn value(&self, column: &str) -> Option<Value> {
        let outcome = self.0.as_ref()?;
        if let Some(place) = EnergyRow::COLUMNS.iter().position(|name| *name == column) {
            return Some(Number(outcome.last.values()[place]));
        }
        let reflection = || outcome.reflection.as_ref().ok();
        let energies = || reflection()?.energies;
        let corrected = || reflection()?.corrected();
        Some(match column {
            "split_bead" => Count(outcome.split_bead),
            "max_abs_relative_drift" => Number(outcome.max_abs_drift),
            "reflected_over_total" => Number(energies()?.over_total().value),
            "reflected_over_transmitted" => Number(energies()?.over_transmitted().value),
            "corrected_over_total" => Number(corrected()?.over_total.value),
            "corrected_over_transmitted" => Number(corrected()?.over_transmitted.value),
            "corrected_over_incident" => Number(corrected()?.over_incident.value),
            _ => return None,
        })
    }
}

struct Impurity {
    followed: Followed,
    last: Option<Motion>,
    events: u64,
    turns: u64,
}

pub(super) fn impurity(manifest: &RunManifest, place: Option<&str>) -> Begun {
    let bead = number(place, "bead", 0..manifest.physics.beads)?;
    let followed = Followed::new(manifest, &[bead]);
    Ok(Box::new(Impurity { followed, last: None, events: 0, turns: 0 }))
}

impl Look for Impurity {
    fn observe(&mut self, frame: &Frame<'_>) {
        let (motions, events) = self.followed.observe(frame);
        self.last = motions.first().copied();
        self.events += events.len() as u64;
        self.turns += events.iter().filter(|event| event.kind == EventKind::Turns).count() as u64;
    }

    fn value(&self, column: &str) -> Option<Value> {
        let last = self.last?;
        Some(match column {
            "event_count" => Count(self.events),
            "turn_count" => Count(self.turns),
            "u_m" => Number(last.u_m),
            "v_m_s" => Number(last.v_m_s),
            "overlap_left_m" => Number(last.overlap_left_m),
            "overlap_right_m" => Number(last.overlap_right_m),
            _ => return None,
        })
    }
}

struct LastContacts(Contacts);

#[allow(clippy::unnecessary_wraps, reason = "one of the functions of the table, others of which refuse")]
pub(super) fn contacts(manifest: &RunManifest, _: Option<&str>) -> Begun {
    Ok(Box::new(LastContacts(Contacts::new(manifest, default_tolerance_m(manifest)))))
}

impl Look for LastContacts {
    fn finish(&mut self, last: &Frame<'_>, _: &Analyses) {
        self.0.observe(last);
    }

    fn value(&self, column: &str) -> Option<Value> {
        let counts = ContactCounts::of(self.0.classes());
        let [compressed, touching, open, first, last] = ContactCounts::COLUMNS;
        Some(Count(match column {
            _ if column == compressed => counts.compressed,
            _ if column == touching => counts.touching,
            _ if column == open => counts.open,
            _ if column == first => counts.compressed_range?.0,
            _ if column == last => counts.compressed_range?.1,
            _ => return None,
        }))
    }
}

struct Pulses {
    direction: Option<Direction>,
    count: u64,
    strongest: Option<Pulse>,
}

pub(super) fn pulses(_: &RunManifest, place: Option<&str>) -> Begun {
    let direction = match place {
        None => None,
        Some("forward") => Some(Direction::Forward),
        Some("backward") => Some(Direction::Backward),
        Some(found) => return Err(format!("found @{found}; allowed: @forward, @backward, or neither")),
    };
    Ok(Box::new(Pulses { direction, count: 0, strongest: None }))
}

impl Look for Pulses {
    fn finish(&mut self, _: &Frame<'_>, analyses: &Analyses) {
        for way in &analyses.ways {
            if self.direction.is_none_or(|direction| direction == way.direction) {
                self.count += way.count;
                self.strongest = Pulse::stronger(self.strongest, way.strongest);
            }
        }
    }

    fn value(&self, column: &str) -> Option<Value> {
        if column == "pulse_count" {
            return Some(Count(self.count));
        }
        let pulse = self.strongest.as_ref()?;
        let point = &pulse.measured.point;
        Some(match column {
            "bead" => Count(point.bead),
            "v_peak_m_s" => Number(point.v_peak_m_s),
            "speed_beads_per_s" => Number(point.speed_beads_per_s?),
            "fwhm_beads" => Number(point.shape?.fwhm_beads),
            "asymmetry" => Number(point.shape?.asymmetry),
            "speed_over_solitary" => Number(pulse.speed_over_solitary?),
            "fwhm_over_solitary" => Number(pulse.fwhm_over_solitary?),
            "momentum_kg_m_s" => Number(pulse.measured.momentum_kg_m_s),
            "energy_j" => Number(pulse.measured.energy_j),
            _ => return None,
        })
    }
}

struct LastSpreading {
    spreading: Spreading,
    last: Option<SpreadingRow>,
}

#[allow(clippy::unnecessary_wraps, reason = "one of the functions of the table, others of which refuse")]
pub(super) fn spreading(manifest: &RunManifest, _: Option<&str>) -> Begun {
    Ok(Box::new(LastSpreading { spreading: Spreading::new(manifest), last: None }))
}

impl Look for LastSpreading {
    fn finish(&mut self, last: &Frame<'_>, _: &Analyses) {
        self.last = Some(self.spreading.observe(last));
    }

    fn value(&self, column: &str) -> Option<Value> {
        let place = SpreadingRow::COLUMNS.iter().position(|name| *name == column)?;
        Some(Number(self.last?.values()[place]))
    }
}

struct AtContact {
    deformations: Deformations,
    found: Option<Deformation>,
}

pub(super) fn deformation(manifest: &RunManifest, place: Option<&str>) -> Begun {
    let contact = number(place, "contact", 0..manifest.physics.beads - 1)?;
    if manifest.physics.chain().is_loaded() {
        return Err(Untold::Loaded.to_string());
    }
    let deformations = Deformations::new(manifest, &[contact]);
    Ok(Box::new(AtContact { deformations, found: None }))
}

impl Look for AtContact {
    fn observe(&mut self, frame: &Frame<'_>) {
        self.deformations.observe(frame);
    }

    fn finish(&mut self, _: &Frame<'_>, _: &Analyses) {
        self.found = self.deformations.results().pop();
    }

    fn value(&self, column: &str) -> Option<Value> {
        let found = self.found.as_ref()?;
        if column == "later_pulse_count" {
            return Some(Count(found.later_pulse_count));
        }
        let theory = |found: &Result<Comparison, String>, column: &str| {
            let theory = found.as_ref().ok()?;
            Some(match column {
                "overlap_fwhm_s" => theory.width_s,
                "l1" => theory.l1,
                "l2" => theory.l2,
                "l_infinity" => theory.l_infinity,
                _ => return None,
            })
        };
        if let Some(column) = column.strip_prefix("exact_") {
            return theory(&found.exact, column).map(Number);
        }
        if let Some(column) = column.strip_prefix("continuum_") {
            return theory(&found.continuum, column).map(Number);
        }
        let shape = found.measured.as_ref().ok()?;
        Some(Number(match column {
            "t_peak_s" => shape.peak_s,
            "overlap_peak_m" => shape.overlap_m,
            "overlap_fwhm_s" => shape.width_s,
            "asymmetry" => shape.asymmetry,
            "impulse_n_s" => shape.impulse_n_s,
            "speed_beads_per_s" => found.speed_beads_per_s?,
            _ => return None,
        }))
    }
}

/// A place where a sensor is: `12`, `left`, `right`, or as the commands have it.
fn place_of(manifest: &RunManifest, place: Option<&str>) -> Result<Place, String> {
    let text = place.unwrap_or_default();
    let found = match text {
        "left" => Ok(Place::Wall(Side::Left)),
        "right" => Ok(Place::Wall(Side::Right)),
        _ => text.parse().map(Place::Bead).or_else(|_| text.parse()),
    };
    let found: Place = found.map_err(|_: String| format!("found @{text}; allowed: {}", super::PLACES))?;
    found.check(&manifest.physics.chain()).map_err(|error| error.to_string())
}

struct Forces {
    sensors: Sensors,
    place: Place,
    rest_n: f64,
    peaks: Peaks,
    highest: Option<Peak>,
    count: u64,
}

pub(super) fn forces(manifest: &RunManifest, place: Option<&str>) -> Begun {
    let place = place_of(manifest, place)?;
    let threshold_n = Peaks::default_threshold_n(&manifest.physics)
        .ok_or("the run has no force scale, since nothing strikes and nothing is loaded, and so no peaks")?;
    let sensors = Sensors::new(manifest.physics.chain());
    let (rest_n, peaks) = (sensors.rest_force_n(place), Peaks::new(threshold_n));
    Ok(Box::new(Forces { sensors, place, rest_n, peaks, highest: None, count: 0 }))
}

impl Look for Forces {
    fn observe(&mut self, frame: &Frame<'_>) {
        self.peaks.push(frame.time_s, self.sensors.force_n(frame, self.place) - self.rest_n);
    }

    fn finish(&mut self, _: &Frame<'_>, _: &Analyses) {
        let (found, count) = self.peaks.clone().finish();
        self.count = count;
        // the highest of those that are kept may not be the highest of all
        let is_whole = count <= Peaks::MOST as u64;
        let highest = found.into_iter().max_by(|a, b| a.force_n.total_cmp(&b.force_n));
        self.highest = highest.filter(|_| is_whole);
    }

    fn value(&self, column: &str) -> Option<Value> {
        match column {
            "peak_count" => return Some(Count(self.count)),
            "rest_force_n" => return Some(Number(self.rest_n)),
            _ => {}
        }
        let peak = self.highest?;
        Some(Number(match column {
            "peak_n" => peak.force_n,
            "peak_time_s" => peak.time_s,
            "peak_width_s" => peak.width_s?,
            "peak_above_s" => peak.above_s?,
            _ => return None,
        }))
    }
}

/// The density of the velocity at a place.
struct Spectrum {
    sensors: Sensors,
    place: Place,
    dt_s: f64,
    last_step: u64,
    sampling: Sampling,
    /// The first sample, until there is a second one.
    first: f64,
    welch: Option<Welch>,
    found: Option<DensitySummary>,
}

pub(super) fn spectrum(manifest: &RunManifest, place: Option<&str>) -> Begun {
    let place = place_of(manifest, place)?;
    let physics = &manifest.physics;
    let every = manifest.provenance.publish_every_steps;
    let half_hz = 0.5 / (every as f64 * physics.dt_s);
    let bands_hz = LinearChain::of(&physics.chain()).ok().and_then(|chain| UnitCell::of(&chain));
    let bands_hz = bands_hz.map_or_else(Vec::new, |cell| cell.bands_hz());
    if let Some([_, top_hz]) = bands_hz.last().filter(|band| band[1] > half_hz) {
        return Err(format!(
            "the chain has waves up to {top_hz:.0} Hz, and frames every {every} steps tell frequencies up to {half_hz:.0} Hz; set \
             stream.publish_every_steps to less"
        ));
    }
    Ok(Box::new(Spectrum {
        sensors: Sensors::new(physics.chain()),
        place,
        dt_s: physics.dt_s,
        last_step: physics.step_count,
        sampling: Sampling::default(),
        first: 0.0,
        welch: None,
        found: None,
    }))
}

impl Look for Spectrum {
    fn observe(&mut self, frame: &Frame<'_>) {
        if self.sampling.take(frame.step) == Take::Skip {
            return;
        }
        let sample = self.sensors.value(frame, self.place, Quantity::Velocity);
        let Some(samples) = self.sampling.expected(self.last_step) else {
            self.first = sample;
            return;
        };
        let first = self.first;
        let welch = self.welch.get_or_insert_with(|| {
            let mut welch = Welch::for_samples(1, samples, &[], Window::Hann);
            welch.push([first]);
            welch
        });
        welch.push([sample]);
    }

    fn finish(&mut self, _: &Frame<'_>, _: &Analyses) {
        let welch = self.welch.as_ref().filter(|welch| welch.segment_count() > 0);
        self.found = welch.zip(self.sampling.interval_steps()).map(|(welch, interval)| {
            let rate_hz = 1.0 / (interval as f64 * self.dt_s);
            DensitySummary::of(&welch.frequencies_hz(rate_hz), &welch.density(0, rate_hz))
        });
    }

    fn value(&self, column: &str) -> Option<Value> {
        let found = self.found?;
        Some(Number(match column {
            "peak_hz" => found.peak_hz,
            "peak_density" => found.peak,
            "mean_square" => found.mean_square,
            _ => return None,
        }))
    }
}

thread_local! {
    /// The modes of one run are asked for at several places.
    static LAST_MODES: RefCell<Option<(LinearChain, Rc<Modes>)>> = const { RefCell::new(None) };
}

struct Mode {
    chain: LinearChain,
    /// Which one, counted from 0.
    index: usize,
    modes: Option<Rc<Modes>>,
    largest_j: f64,
    last_j: f64,
}

pub(super) fn modes(manifest: &RunManifest, place: Option<&str>) -> Begun {
    let chain = LinearChain::of(&manifest.physics.chain()).map_err(|error| error.to_string())?;
    let count = Modes::count_of(&chain).map_err(|error: ModesError| error.to_string())?;
    let end = count as u64 + 1;
    let index = usize::try_from(number(place, "mode", 1..end)? - 1).unwrap_or(0);
    Ok(Box::new(Mode { chain, index, modes: None, largest_j: 0.0, last_j: 0.0 }))
}

impl Look for Mode {
    fn prepare(&mut self) -> Result<(), String> {
        let modes = LAST_MODES.with_borrow_mut(|last| {
            if let Some((chain, modes)) = last
                && *chain == self.chain
            {
                return Ok(Rc::clone(modes));
            }
            let modes = Rc::new(Modes::of(&self.chain)?);
            *last = Some((self.chain.clone(), Rc::clone(&modes)));
            Ok(modes)
        });
        self.modes = Some(modes.map_err(|error: ModesError| error.to_string())?);
        Ok(())
    }

    fn observe(&mut self, frame: &Frame<'_>) {
        let Some(modes) = &self.modes else { return };
        self.last_j = modes.energy_j(self.index, frame.u_m, frame.v_m_s);
        self.largest_j = if self.last_j > self.largest_j { self.last_j } else { self.largest_j };
    }

    fn value(&self, column: &str) -> Option<Value> {
        let modes = self.modes.as_ref()?;
        Some(match column {
            "centre_bead" => Count(modes.centre_bead(self.index) as u64),
            "frequency_hz" => Number(modes.frequency_hz(self.index)),
            "participation_beads" => Number(modes.participation_beads(self.index)),
            "largest_j" => Number(self.largest_j),
            "last_j" => Number(self.last_j),
            _ => return None,
        })
    }
}
