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
use schemas::chain::Chain;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use schemas::results::ResultColumns;
use serde_json::{Value, json};
use waves::peaks::{Peak, Peaks};
use waves::place::Place;
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

/// Peaks that are shown for each place, and those that are kept for a figure and for JSON; the table has all of them.
const SHOWN: usize = 4;
const KEPT: usize = 10_000;

/// One place, as it is watched.
struct Sensor {
    place: Place,
    rest_n: f64,
    finder: Peaks,
    /// The first peaks, the number of all, and the highest of all.
    peaks: Vec<Peak>,
    peak_count: u64,
    highest: Option<Peak>,
    /// Force (N) and overlap (m), kept for a figure alone.
    curve: Option<Series<2>>,
}

impl Sensor {
    /// Takes the peaks that are known by now.
    fn take(&mut self, out: &mut dyn Outlet) {
        for peak in self.finder.take() {
            self.peak_count += 1;
            if self.highest.is_none_or(|highest| peak.force_n >= highest.force_n) {
                self.highest = Some(peak);
            }
            if self.peaks.len() < KEPT {
                self.peaks.push(peak);
            }
            if out.wants(PEAKS) {
                let (time, force) = (Cell::Double(peak.time_s), Cell::Double(peak.force_n));
                let word = Cell::Word(self.place.to_string());
                out.line(PEAKS, &[word, time, force, peak.width_s.into(), peak.above_s.into()]);
            }
        }
    }
}

struct ForceAnalysis {
    manifest: RunManifest,
    threshold_n: f64,
    chain: Chain,
    places: Vec<Sensor>,
    /// The row of the last frame.
    row: Vec<f64>,
    sampling: Sampling,
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
        let sensor = |place: &Place| Sensor {
            place: *place,
            rest_n: place.rest_force_n(&chain),
            finder: Peaks::new(threshold_n),
            peaks: Vec::new(),
            peak_count: 0,
            highest: None,
            curve: beginning.is_drawn.then(Series::default),
        };
        let places = places.iter().map(sensor).collect();
        let (row, sampling) = (Vec::new(), Sampling::default());
        Ok(Self { manifest, threshold_n, chain, places, row, sampling })
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
        for sensor in &mut self.places {
            let force_n = sensor.place.force_n(&self.chain, frame);
            let overlap_m = sensor.place.overlap_m(&self.chain, frame);
            sensor.finder.push(frame.time_s, force_n - sensor.rest_n);
            sensor.take(out);
            if let Some(curve) = &mut sensor.curve {
                curve.push(frame.time_s, [force_n, overlap_m.unwrap_or(f64::NAN)]);
            }
            self.row.extend(overlap_m);
            self.row.push(force_n);
        }
        out.row(frame, &self.row);
    }

    fn gap(&mut self) {
        self.places.iter_mut().for_each(|sensor| sensor.finder.gap());
    }

    fn finish(&mut self, out: &mut dyn Outlet) -> Result<(), Refusal> {
        for sensor in &mut self.places {
            sensor.finder.gap();
            sensor.take(out);
        }
        Ok(())
    }

    fn report(&mut self) -> Option<Report> {
        let interval_s =
            self.sampling.interval_steps().map(|steps| steps as f64 * self.manifest.physics.dt_s);
        let notices = coarse_frames(&self.places, interval_s).into_iter().collect();
        let (words, results) = (words(&self.places, self.threshold_n), json(&self.places, self.threshold_n));
        Some(Report { title: "forces", words, results, notices, is_lossy: false })
    }

    fn figure(&mut self) -> Result<Option<Figure>, FigureError> {
        let drawn = self.places.iter().filter_map(|sensor| {
            let Sensor { place, rest_n, peaks, peak_count, curve, .. } = sensor;
            let (rest_n, peak_count) = (*rest_n, *peak_count);
            Some(SensedForces { place: *place, curve: curve.as_ref()?, rest_n, peaks, peak_count })
        });
        Ok(Some(plots::forces(&self.manifest, &drawn.collect::<Vec<_>>())))
    }

    fn value(&self, name: &str, _: Option<&str>) -> Option<Number> {
        let found = self.places.first()?;
        match name {
            "peak_count" => return Some(Number::Count(found.peak_count)),
            "rest_force_n" => return Some(Number::Double(found.rest_n)),
            _ => {}
        }
        let peak = found.highest?;
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
fn coarse_frames(found: &[Sensor], interval_s: Option<f64>) -> Option<String> {
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

fn words(found: &[Sensor], threshold_n: f64) -> Words {
    let mut words = Words::default();
    words.add("threshold", quantity(threshold_n, "N"));
    for Sensor { place, rest_n, peaks, peak_count, .. } in found {
        let at_rest =
            if *rest_n == 0.0 { String::new() } else { format!(" above {} at rest", quantity(*rest_n, "N")) };
        words.add(place.to_string(), format_args!("{}{at_rest}", counted(*peak_count, "peak")));
        words.each("", peaks.iter().take(SHOWN).map(peak_text));
        let more = peak_count.saturating_sub(SHOWN as u64);
        if more > 0 {
            words.add("", format_args!("… {} more; --peaks has them", count(more)));
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

fn json(found: &[Sensor], threshold_n: f64) -> Value {
    let place = |found: &Sensor| {
        json!({
            "place": found.place.to_string(),
            "rest_force_n": found.rest_n,
            "peak_count": found.peak_count,
            "highest": found.highest,
            "peaks": found.peaks,
            "left_out_count": found.peak_count - found.peaks.len() as u64,
        })
    };
    json!({ "threshold_n": threshold_n, "places": found.iter().map(place).collect::<Vec<_>>() })
}
