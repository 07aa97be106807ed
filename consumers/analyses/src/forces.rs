//! Forces as sensors at beads, contacts and walls read them, with their peaks.

use crate::places::{ALLOWED, TAKES_PLACE, places};
use consumers::analysis::{
    Allowed, Analysis, Beginning, Meaning, Needs, Number, Offer, Outlet, Refusal, Remake, Report, Setting,
    TableFlag, Takes, Whereabouts, Words,
};
use consumers::series::Series;
use consumers::table::{Cell, Column};
use figure::{Figure, FigureError};
use plots::SensedForces;
use schemas::amounts::{count, counted, quantity};
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use schemas::results::ResultColumns;
use serde_json::{Value, json};
use waves::peaks::{Peak, Peaks};
use waves::place::{Place, Sensors};
use waves::sampling::Sampling;

/// The analysis, before it looks at a run.
pub static OFFER: Offer = Offer {
    name: "forces",
    about: "Forces as sensors at beads, contacts and walls read them, with their peaks",
    help: "Examples:\n  \
        beadline forces run.mcap --at wall:right --at bead:20 --figure forces.png\n  \
        beadline forces --at contact:7 --out forces.csv --peaks peaks.csv    attach to the only live run\n\n\
        A contact or a wall has its force, with what damping adds. A bead has the mean of the forces on its two sides, as \
        a sensor embedded in a bead reads it; a free side has none. Peaks are above the force at rest; two maxima are two \
        peaks if the force falls below half of the first one and doubles again. Where the frames begin in a falling force, or \
        end in a rising one, there is none. width is the full width at half of the height, where that is above the \
        threshold; above is the time above the threshold.",
    settings: &[
        Setting::new("at", TAKES_PLACE, "A place, repeatable: bead:20, contact:7, wall:left, wall:right")
            .repeatable()
            .required(),
        Setting::new(
            "threshold",
            Takes::number("n", Allowed::AboveZero),
            "Least height of a peak (N) above the force at rest [default: 1e-2 of the run's force scale m·L/T²]",
        ),
    ],
    tables: &[
        TableFlag { name: "out", help: "Table of the overlaps and forces in each frame" },
        TableFlag { name: "peaks", help: "Table of the peaks" },
    ],
    columns: &[
        Meaning::number("overlap_PLACE_m", "overlap of a contact or with a wall"),
        Meaning::number("force_PLACE_n", "force there"),
    ],
    summary: &[
        Meaning::count("peak_count", "peaks of the force"),
        Meaning::number("peak_n", "the highest, above the force at rest"),
        Meaning::number("peak_time_s", "its time"),
        Meaning::number("peak_width_s", "its full width at half of its height"),
        Meaning::number("peak_above_s", "the time above the threshold around it"),
        Meaning::number("rest_force_n", "force at rest"),
    ],
    place: Whereabouts::Of { setting: "at", also: &[], allowed: ALLOWED },
    needs: Needs {
        remake: Remake::OfNames {
            setting: "at",
            also: &[],
            // force_contact_7_n
            value: |name| Some(name.strip_prefix("force_")?.strip_suffix("_n")?.replace('_', ":")),
        },
        ..Needs::FRAMES
    },
    begin: |beginning| Ok(Box::new(ForceAnalysis::begin(beginning)?)),
};

/// Index of the table of peaks.
const PEAKS: usize = 1;

/// Peaks that are shown for each place; the table has all of them.
const SHOWN: usize = 4;

/// One place, as it is watched.
struct Sensor {
    place: Place,
    rest_n: f64,
    peaks: Peaks,
    /// Force (N) and overlap (m), kept for a figure alone.
    curve: Option<Series<2>>,
}

/// One place, as it was found.
struct Sensed {
    place: Place,
    rest_n: f64,
    peaks: Vec<Peak>,
    peak_count: u64,
    curve: Series<2>,
}

struct ForceAnalysis {
    manifest: RunManifest,
    threshold_n: f64,
    sensors: Sensors,
    places: Vec<Sensor>,
    /// The row of the last frame.
    row: Vec<f64>,
    sampling: Sampling,
    found: Vec<Sensed>,
}

impl ForceAnalysis {
    fn begin(beginning: &Beginning<'_>) -> Result<Self, Refusal> {
        let manifest = beginning.manifest.clone();
        let chain = manifest.physics.chain();
        let places = places(beginning, "at", &chain)?;
        let given = beginning.settings.one("threshold");
        let threshold_n =
            given.or_else(|| Peaks::default_threshold_n(&manifest.physics)).ok_or_else(|| {
                "the run has no force scale, since nothing strikes and nothing is loaded; say --threshold N"
                    .to_owned()
            })?;
        let sensors = Sensors::new(chain);
        let sensor = |place: &Place| Sensor {
            place: *place,
            rest_n: sensors.rest_force_n(*place),
            peaks: Peaks::new(threshold_n),
            curve: beginning.is_drawn.then(Series::default),
        };
        let places = places.iter().map(sensor).collect();
        let (row, sampling, found) = (Vec::new(), Sampling::default(), Vec::new());
        Ok(Self { manifest, threshold_n, sensors, places, row, sampling, found })
    }
}

impl Analysis for ForceAnalysis {
    fn columns(&self, table: usize) -> Vec<Column> {
        if table == PEAKS {
            let names = ["place", "time_s", "force_n", "width_s", "above_s"];
            return names.map(|name| name.to_owned().into()).into();
        }
        Vec::new()
    }

    fn published(&self) -> Option<ResultColumns> {
        let names = names(&self.places);
        Some(ResultColumns::named(&names.iter().map(String::as_str).collect::<Vec<_>>()))
    }

    fn observe(&mut self, frame: &Frame<'_>, out: &mut dyn Outlet) {
        self.sampling.take(frame.step);
        self.row.clear();
        for Sensor { place, rest_n, peaks, curve } in &mut self.places {
            let force_n = self.sensors.force_n(frame, *place);
            let overlap_m = self.sensors.overlap_m(frame, *place);
            peaks.push(frame.time_s, force_n - *rest_n);
            if let Some(curve) = curve {
                curve.push(frame.time_s, [force_n, overlap_m.unwrap_or(f64::NAN)]);
            }
            self.row.extend(overlap_m);
            self.row.push(force_n);
        }
        out.row(frame, &self.row);
    }

    fn gap(&mut self) {
        self.places.iter_mut().for_each(|sensor| sensor.peaks.gap());
    }

    fn finish(&mut self, out: &mut dyn Outlet) -> Result<(), Refusal> {
        for Sensor { place, rest_n, peaks, curve } in std::mem::take(&mut self.places) {
            let (peaks, peak_count) = peaks.finish();
            for peak in peaks.iter().filter(|_| out.wants(PEAKS)).collect::<Vec<_>>() {
                let optional = |value: Option<f64>| value.map_or(Cell::Empty, Cell::Double);
                let (time, force) = (Cell::Double(peak.time_s), Cell::Double(peak.force_n));
                let word = Cell::Word(place.to_string());
                out.line(PEAKS, &[word, time, force, optional(peak.width_s), optional(peak.above_s)]);
            }
            self.found.push(Sensed { place, rest_n, peaks, peak_count, curve: curve.unwrap_or_default() });
        }
        Ok(())
    }

    fn report(&mut self) -> Option<Report> {
        let interval_s =
            self.sampling.interval_steps().map(|steps| steps as f64 * self.manifest.physics.dt_s);
        let notices = coarse_frames(&self.found, interval_s).into_iter().collect();
        let (words, results) = (words(&self.found, self.threshold_n), json(&self.found, self.threshold_n));
        Some(Report { title: "forces", words, results, notices, is_lossy: false })
    }

    fn figure(&mut self) -> Result<Option<Figure>, FigureError> {
        let drawn = self.found.iter().map(|found| SensedForces {
            place: found.place,
            curve: &found.curve,
            rest_n: found.rest_n,
            peaks: &found.peaks,
        });
        Ok(Some(plots::forces(&self.manifest, &drawn.collect::<Vec<_>>())))
    }

    fn value(&self, name: &str, _: Option<&str>) -> Option<Number> {
        let found = self.found.first()?;
        match name {
            "peak_count" => return Some(Number::Count(found.peak_count)),
            "rest_force_n" => return Some(Number::Double(found.rest_n)),
            _ => {}
        }
        // the highest of those that are kept may not be the highest of all
        let is_whole = found.peak_count <= Peaks::MOST as u64;
        let highest = found.peaks.iter().max_by(|a, b| a.force_n.total_cmp(&b.force_n));
        let peak = highest.filter(|_| is_whole)?;
        Some(Number::Double(match name {
            "peak_n" => peak.force_n,
            "peak_time_s" => peak.time_s,
            "peak_width_s" => peak.width_s?,
            "peak_above_s" => peak.above_s?,
            _ => return None,
        }))
    }
}

fn names(places: &[Sensor]) -> Vec<String> {
    let of_place = places.iter().flat_map(|Sensor { place, .. }| {
        let name = place.column();
        let overlap = (!matches!(place, Place::Bead(_))).then(|| format!("overlap_{name}_m"));
        overlap.into_iter().chain([format!("force_{name}_n")])
    });
    of_place.collect()
}

/// A warning where a peak is narrower than its samples can tell.
fn coarse_frames(found: &[Sensed], interval_s: Option<f64>) -> Option<String> {
    const LEAST_SAMPLES: f64 = 8.0;
    let interval_s = interval_s?;
    let (place, time_s) = found.iter().find_map(|found| {
        let is_narrow =
            |peak: &&Peak| peak.width_s.is_some_and(|width_s| width_s < LEAST_SAMPLES * interval_s);
        found.peaks.iter().find(is_narrow).map(|peak| (found.place, peak.time_s))
    })?;
    Some(format!(
        "{place}: fewer than {LEAST_SAMPLES} frames show the upper half of the peak at {}, too few for its height \
         and width; record more often, or use --every-step",
        quantity(time_s, "s")
    ))
}

fn words(found: &[Sensed], threshold_n: f64) -> Words {
    let mut words = Words::default();
    words.add("threshold", quantity(threshold_n, "N"));
    for Sensed { place, rest_n, peaks, peak_count, .. } in found {
        let at_rest =
            if *rest_n == 0.0 { String::new() } else { format!(" above {} at rest", quantity(*rest_n, "N")) };
        words.add(place.to_string(), format_args!("{}{at_rest}", counted(*peak_count, "peak")));
        words.each("", peaks.iter().take(SHOWN).map(peak_text));
        if peaks.len() > SHOWN {
            words.add("", format_args!("… {} more; --peaks has them", count((peaks.len() - SHOWN) as u64)));
        }
    }
    words
}

fn peak_text(peak: &Peak) -> String {
    let (height, time) = (quantity(peak.force_n, "N"), quantity(peak.time_s, "s"));
    let known = |name: &str, value: Option<f64>| {
        value.map_or_else(String::new, |value| format!(", {name} {}", quantity(value, "s")))
    };
    format!("{height} at {time}{}{}", known("width", peak.width_s), known("above threshold", peak.above_s))
}

fn json(found: &[Sensed], threshold_n: f64) -> Value {
    let peak = |peak: &Peak| {
        json!({
            "time_s": peak.time_s,
            "force_n": peak.force_n,
            "width_s": peak.width_s,
            "above_s": peak.above_s,
        })
    };
    let place = |found: &Sensed| {
        json!({
            "place": found.place.to_string(),
            "rest_force_n": found.rest_n,
            "peak_count": found.peak_count,
            "peaks": found.peaks.iter().map(peak).collect::<Vec<_>>(),
        })
    };
    json!({ "threshold_n": threshold_n, "places": found.iter().map(place).collect::<Vec<_>>() })
}
