//! `beadline deformation`.

use crate::analysis::{AnalysisError, Session, draw, table};
use crate::args::DeformationArgs;
use crate::display;
use crate::failure::{Done, Failure};
use crate::outputs::check_tables;
use crate::report::Rows;
use consumers::deformation::{Comparison, Deformation, Deformations, Shape};
use consumers::follow::Analysis;
use consumers::table::{Table, TableError};
use consumers::uncertain::Uncertain;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use schemas::summary::Summarizer;
use serde_json::{Value, json};

/// Frames that the upper half of a pulse needs for its shape: 20 are off by 1e-4 of the peak, 10 by 1e-3.
const LEAST_SAMPLES: u64 = 16;

struct Look {
    deformations: Deformations,
    summarizer: Summarizer,
    /// The largest relative error of the energy.
    max_abs_drift: f64,
}

impl Analysis for Look {
    type Error = AnalysisError;

    fn observe(&mut self, frame: &Frame<'_>) -> Result<(), AnalysisError> {
        self.deformations.observe(frame);
        let drift = self.summarizer.summarize(frame).relative_drift.abs();
        self.max_abs_drift = self.max_abs_drift.max(drift);
        Ok(())
    }

    fn gap(&mut self) {
        self.deformations.gap();
    }
}

pub(crate) fn deformation(args: &DeformationArgs) -> Result<Done, Failure> {
    let tables: Vec<_> = args.out.iter().collect();
    check_tables(&tables)?;
    let mut session = Session::open(&args.common, "deformation", &tables)?;
    let manifest = session.manifest().clone();
    check_contacts(&manifest, &args.contact)?;
    let columns = ["contact", "time_s", "overlap_m", "exact_m", "continuum_m"];
    let table = table(args.out.as_ref(), &columns, args.common.frames.force)?;
    let mut look = Look {
        deformations: Deformations::new(&manifest, &args.contact),
        summarizer: Summarizer::new(&manifest.physics),
        max_abs_drift: 0.0,
    };
    let tally = session.follow(&mut look)?;

    let found = look.deformations.results();
    warn_of_coarse_frames(&found);
    if let Some(mut table) = table {
        found.iter().try_for_each(|deformation| write(&mut table, deformation))?;
        table.finish()?;
    }
    draw(&args.common, || Ok(plots::deformations(&manifest, &found)))?;
    let known = found.iter().map(|found| Known::new(found, &manifest, look.max_abs_drift));
    let known: Vec<Option<Known>> = known.collect();
    let (mut rows, mut contacts) = (Rows::default(), Vec::new());
    for (found, known) in found.iter().zip(&known) {
        add_rows(&mut rows, found, known.as_ref());
        contacts.push(json(found, known.as_ref()));
    }
    session.report(&tally, "deformation", rows, json!({ "contacts": contacts }))
}

/// Says so if so few frames hold the pulse that its shape is their interpolation.
fn warn_of_coarse_frames(found: &[Deformation]) {
    for deformation in found {
        if let Some(samples) = samples_in_width(deformation).filter(|samples| *samples < LEAST_SAMPLES) {
            notice!(
                "contact {}: {} of the frames show the upper half of the pulse, too few for its shape; record more often, or \
                 use --every-step",
                deformation.contact,
                display::count(samples)
            );
        }
    }
}

/// Frames in which the overlap is at least half of its peak, if there was a pulse.
fn samples_in_width(deformation: &Deformation) -> Option<u64> {
    let half_m = deformation.measured.as_ref().ok()?.overlap_m / 2.0;
    Some(deformation.samples.iter().filter(|sample| sample.overlap_m >= half_m).count() as u64)
}

fn check_contacts(manifest: &RunManifest, contacts: &[u64]) -> Result<(), Failure> {
    let last = manifest.physics.beads - 2;
    match contacts.iter().find(|contact| **contact > last) {
        None => Ok(()),
        Some(contact) => Err(bad_input!("--contact {contact}: the chain has contacts 0 to {last}")),
    }
}

/// A row for each sample of the pulse; the theories' fields are empty where there is none.
fn write(table: &mut Table, deformation: &Deformation) -> Result<(), TableError> {
    for sample in &deformation.samples {
        table.integer(deformation.contact).double(sample.time_s).double(sample.overlap_m);
        for theory in [&deformation.exact, &deformation.continuum] {
            table.optional(theory.as_ref().ok().map(|theory| theory.overlap_m(sample.time_s)));
        }
        table.end_row()?;
    }
    Ok(())
}

/// The measured pulse with its uncertainty: the difference to the result of every second frame alone, and the error
/// of the energy.
struct Known {
    peak_s: Uncertain,
    overlap_m: Uncertain,
    width_s: Uncertain,
    asymmetry: Uncertain,
    impulse_n_s: Uncertain,
    speed_beads_per_s: Option<Uncertain>,
    /// The relative uncertainty of velocities and momenta, derived from the overlap.
    scale: f64,
}

impl Known {
    /// Of a pulse that could be measured.
    fn new(deformation: &Deformation, manifest: &RunManifest, drift: f64) -> Option<Self> {
        let shape = deformation.measured.as_ref().ok()?;
        let (halved, halved_speed) = &deformation.halved;
        let known = |value: f64, halved: Option<f64>| {
            let frames = halved.map_or(f64::NAN, |halved| value - halved);
            Uncertain::new(value, frames.hypot(drift * value))
        };
        let of = |of: fn(&Shape) -> f64| known(of(shape), halved.as_ref().map(of));
        let overlap_m = of(|shape| shape.overlap_m);
        // v_max ∝ δ^((α+1)/2)
        let power = 0.5 * (manifest.physics.alpha + 1.0);
        Some(Self {
            peak_s: of(|shape| shape.peak_s),
            width_s: of(|shape| shape.width_s),
            asymmetry: of(|shape| shape.asymmetry),
            impulse_n_s: of(|shape| shape.impulse_n_s),
            speed_beads_per_s: deformation.speed_beads_per_s.map(|speed| known(speed, *halved_speed)),
            scale: power * overlap_m.plus_minus / overlap_m.value,
            overlap_m,
        })
    }
}

fn add_rows(rows: &mut Rows, deformation: &Deformation, known: Option<&Known>) {
    rows.add("contact", deformation.contact);
    let Some(known) = known else { return rows.each("first pulse", deformation.measured.as_ref().err()) };
    let later = match deformation.later_pulse_count {
        0 => String::new(),
        count => format!("; {} more came later", display::count(count)),
    };
    let (overlap, peak) = (known.overlap_m / 1e-6, known.peak_s / 1e-3);
    rows.add("first pulse", format_args!("{overlap} µm at {peak} ms{later}"));
    let speed = known.speed_beads_per_s.map_or_else(String::new, |speed| format!(", {speed} beads/s"));
    let Known { asymmetry, impulse_n_s, .. } = known;
    let width = known.width_s / 1e-6;
    rows.add(
        "measured",
        format_args!("width {width} µs, asymmetry {asymmetry}, impulse {impulse_n_s} N s{speed}"),
    );
    for (name, theory) in [("exact wave", &deformation.exact), ("continuum", &deformation.continuum)] {
        rows.add(name, theory.as_ref().map_or_else(Clone::clone, |theory| theory_text(theory, known)));
    }
}

fn theory_text(theory: &Comparison, known: &Known) -> String {
    let scaled = |value: f64| Uncertain::new(value, known.scale * value).value_text();
    format!(
        "width {} µs, impulse {} N s, {} beads/s; off by L1 {:.1e}, L2 {:.1e}, L∞ {:.1e}",
        scaled(theory.width_s * 1e6),
        scaled(theory.impulse_n_s),
        scaled(theory.scale.speed_beads_per_s),
        theory.l1,
        theory.l2,
        theory.l_infinity
    )
}

fn json(deformation: &Deformation, known: Option<&Known>) -> Value {
    json!({
        "contact": deformation.contact,
        "first_pulse": match &deformation.measured {
            Ok(shape) => json!({
                "samples_in_width": samples_in_width(deformation),
                "t_peak_s": shape.peak_s,
                "overlap_peak_m": shape.overlap_m,
                "overlap_fwhm_s": shape.width_s,
                "asymmetry": shape.asymmetry,
                "impulse_n_s": shape.impulse_n_s,
                "speed_beads_per_s": deformation.speed_beads_per_s,
            }),
            Err(untold) => json!({ "untold": untold.to_string() }),
        },
        "uncertainty": known.map(|known| json!({
            "t_peak_s": known.peak_s.plus_minus,
            "overlap_peak_m": known.overlap_m.plus_minus,
            "overlap_fwhm_s": known.width_s.plus_minus,
            "asymmetry": known.asymmetry.plus_minus,
            "impulse_n_s": known.impulse_n_s.plus_minus,
            "speed_beads_per_s": known.speed_beads_per_s.map(|speed| speed.plus_minus),
        })),
        "later_pulse_count": deformation.later_pulse_count,
        "exact": theory_json(&deformation.exact),
        "continuum": theory_json(&deformation.continuum),
    })
}

fn theory_json(theory: &Result<Comparison, String>) -> Value {
    match theory {
        Ok(theory) => json!({
            "v_max_m_s": theory.scale.velocity_m_s,
            "speed_beads_per_s": theory.scale.speed_beads_per_s,
            "overlap_fwhm_s": theory.width_s,
            "impulse_n_s": theory.impulse_n_s,
            "l1": theory.l1,
            "l2": theory.l2,
            "l_infinity": theory.l_infinity,
        }),
        Err(why) => json!({ "undefined": why }),
    }
}
