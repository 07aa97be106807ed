//! `beadline forces`.

use crate::analysis::{AnalysisError, ROW_HEAD, Session, begin_row, draw, table};
use crate::args::ForcesArgs;
use crate::display::{self, count};
use crate::failure::{BadInput, Done, Failure};
use crate::outputs::check_tables;
use crate::report::Rows;
use consumers::follow::Analysis;
use consumers::series::Series;
use consumers::table::Table;
use plots::SensedForces;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use serde_json::{Value, json};
use waves::peaks::{Peak, Peaks};
use waves::place::{Place, Sensors};
use waves::sampling::Sampling;

/// Peaks that are shown for each place; the table has all of them.
const SHOWN: usize = 4;

/// One place and what was seen there.
struct Sensor {
    place: Place,
    rest_n: f64,
    peaks: Peaks,
    /// Force (N) and overlap (m), kept only for a figure.
    curve: Option<Series<2>>,
}

struct Look {
    sensors: Sensors,
    places: Vec<Sensor>,
    table: Option<Table>,
    sampling: Sampling,
}

impl Analysis for Look {
    type Error = AnalysisError;

    fn observe(&mut self, frame: &Frame<'_>) -> Result<(), AnalysisError> {
        self.sampling.take(frame.step);
        if let Some(table) = &mut self.table {
            begin_row(table, frame);
        }
        for Sensor { place, rest_n, peaks, curve } in &mut self.places {
            let force_n = self.sensors.force_n(frame, *place);
            let overlap_m = self.sensors.overlap_m(frame, *place);
            peaks.push(frame.time_s, force_n - *rest_n);
            if let Some(curve) = curve {
                curve.push(frame.time_s, [force_n, overlap_m.unwrap_or(f64::NAN)]);
            }
            if let Some(table) = &mut self.table {
                if let Some(overlap_m) = overlap_m {
                    table.double(overlap_m);
                }
                table.double(force_n);
            }
        }
        if let Some(table) = &mut self.table {
            table.end_row()?;
        }
        Ok(())
    }

    fn gap(&mut self) {
        self.places.iter_mut().for_each(|sensor| sensor.peaks.gap());
    }
}

pub(crate) fn forces(args: &ForcesArgs) -> Result<Done, Failure> {
    let tables: Vec<_> = args.out.iter().chain(&args.peaks).collect();
    check_tables(&tables)?;
    let mut session = Session::open(&args.common, "forces", &tables)?;
    let manifest = session.manifest().clone();
    let chain = manifest.physics.chain();
    for place in &args.at {
        place.check(&chain).bad_input()?;
    }
    let threshold_n = threshold_n(args, &manifest)?;
    let sensors = Sensors::new(chain);
    let force = args.common.frames.force;
    let columns = columns(&args.at);
    let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
    let sensor = |place: &Place| Sensor {
        place: *place,
        rest_n: sensors.rest_force_n(*place),
        peaks: Peaks::new(threshold_n),
        curve: (!args.common.figure.is_empty()).then(Series::default),
    };
    let mut look = Look {
        places: args.at.iter().map(sensor).collect(),
        table: table(args.out.as_ref(), &columns, force)?,
        sensors,
        sampling: Sampling::default(),
    };
    let peak_columns = ["place", "time_s", "force_n", "width_s", "above_s"];
    let peak_table = table(args.peaks.as_ref(), &peak_columns, force)?;
    let tally = session.follow(&mut look)?;

    let interval_s = look.sampling.interval_steps().map(|steps| steps as f64 * manifest.physics.dt_s);
    look.table.map(Table::finish).transpose()?;
    let mut found = Vec::new();
    for Sensor { place, rest_n, peaks, curve } in look.places {
        let (peaks, peak_count) = peaks.finish();
        found.push(Found { place, rest_n, peaks, peak_count, curve: curve.unwrap_or_default() });
    }
    if let Some(mut table) = peak_table {
        for Found { place, peaks, .. } in &found {
            for peak in peaks {
                table.word(&place.to_string()).double(peak.time_s).double(peak.force_n);
                table.optional(peak.width_s).optional(peak.above_s);
                table.end_row()?;
            }
        }
        table.finish()?;
    }
    warn_of_coarse_frames(&found, interval_s);
    draw(&args.common, || {
        let drawn = found.iter().map(|found| SensedForces {
            place: found.place,
            curve: &found.curve,
            rest_n: found.rest_n,
            peaks: &found.peaks,
        });
        Ok(plots::forces(&manifest, &drawn.collect::<Vec<_>>()))
    })?;
    session.report(&tally, "forces", rows(&found, threshold_n), json(&found, threshold_n))
}

struct Found {
    place: Place,
    rest_n: f64,
    peaks: Vec<Peak>,
    peak_count: u64,
    curve: Series<2>,
}

/// The least height of a peak.
fn threshold_n(args: &ForcesArgs, manifest: &RunManifest) -> Result<f64, Failure> {
    if let Some(threshold_n) = args.threshold {
        return Ok(threshold_n);
    }
    Peaks::default_threshold_n(&manifest.physics).ok_or_else(|| {
        bad_input!(
            "the run has no force scale, since nothing strikes and nothing is loaded; say --threshold N"
        )
    })
}

fn columns(places: &[Place]) -> Vec<String> {
    let of_place = places.iter().flat_map(|place| {
        let name = place.column();
        let overlap = (!matches!(place, Place::Bead(_))).then(|| format!("overlap_{name}_m"));
        overlap.into_iter().chain([format!("force_{name}_n")])
    });
    ROW_HEAD.into_iter().map(str::to_owned).chain(of_place).collect()
}

/// Says so if a peak is narrower than its samples can tell.
fn warn_of_coarse_frames(found: &[Found], interval_s: Option<f64>) {
    const LEAST_SAMPLES: f64 = 8.0;
    let Some(interval_s) = interval_s else { return };
    let narrow = found.iter().find_map(|found| {
        let is_narrow =
            |peak: &&Peak| peak.width_s.is_some_and(|width_s| width_s < LEAST_SAMPLES * interval_s);
        found.peaks.iter().find(is_narrow).map(|peak| (found.place, peak.time_s))
    });
    if let Some((place, time_s)) = narrow {
        notice!(
            "{place}: fewer than {LEAST_SAMPLES} frames show the upper half of the peak at {}, too few for its height \
             and width; record more often, or use --every-step",
            display::quantity(time_s, "s")
        );
    }
}

fn rows(found: &[Found], threshold_n: f64) -> Rows {
    let mut rows = Rows::default();
    rows.add("threshold", display::quantity(threshold_n, "N"));
    for Found { place, rest_n, peaks, peak_count, .. } in found {
        let at_rest = if *rest_n == 0.0 {
            String::new()
        } else {
            format!(" above {} at rest", display::quantity(*rest_n, "N"))
        };
        rows.add(place.to_string(), format_args!("{}{at_rest}", display::counted(*peak_count, "peak")));
        rows.each("", peaks.iter().take(SHOWN).map(peak_text));
        if peaks.len() > SHOWN {
            rows.add("", format_args!("… {} more; --peaks has them", count((peaks.len() - SHOWN) as u64)));
        }
    }
    rows
}

fn peak_text(peak: &Peak) -> String {
    let (height, time) = (display::quantity(peak.force_n, "N"), display::quantity(peak.time_s, "s"));
    let known = |name: &str, value: Option<f64>| {
        value.map_or_else(String::new, |value| format!(", {name} {}", display::quantity(value, "s")))
    };
    format!("{height} at {time}{}{}", known("width", peak.width_s), known("above threshold", peak.above_s))
}

fn json(found: &[Found], threshold_n: f64) -> Value {
    let peak = |peak: &Peak| {
        json!({
            "time_s": peak.time_s,
            "force_n": peak.force_n,
            "width_s": peak.width_s,
            "above_s": peak.above_s,
        })
    };
    let place = |found: &Found| {
        json!({
            "place": found.place.to_string(),
            "rest_force_n": found.rest_n,
            "peak_count": found.peak_count,
            "peaks": found.peaks.iter().map(peak).collect::<Vec<_>>(),
        })
    };
    json!({ "threshold_n": threshold_n, "places": found.iter().map(place).collect::<Vec<_>>() })
}
