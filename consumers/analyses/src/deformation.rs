//! Deformation of contacts by the first pulse, beside theory.

use consumers::analysis::{
    Analysis, Beginning, Meaning, Number, Offer, Outlet, Refusal, Report, Setting, TableFlag, Takes,
    Whereabouts, Words,
};
use consumers::deformation::{Comparison, Deformation, Deformations, Shape};
use consumers::table::{Cell, Column};
use consumers::uncertain::Uncertain;
use figure::{Figure, FigureError};
use schemas::amounts::count;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use schemas::summary::Summarizer;
use serde_json::{Value, json};

/// The analysis, before it looks at a run.
pub static OFFER: Offer = Offer {
    name: "deformation",
    about: "Deformation of a contact by the first pulse, beside theory",
    help: "Examples:\n  \
        beadline deformation run.mcap --contact 100 --figure d.png\n  \
        beadline deformation run.mcap --contact 100 --contact 150 --out d.csv\n\n\
        Contact C joins beads C and C+1; the last one of a ring joins its last bead and bead 0. Theories are scaled to the largest overlap; their width, speed, \
        impulse and shape are predictions. A bond that is stretched before a pulse presses it has no first pulse.",
    settings: &[Setting::new("contact", Takes::Whole("C"), "A contact to follow, repeatable")
        .repeatable()
        .required()],
    tables: &[TableFlag {
        name: "out",
        help: "Table of the pulse: overlap, exact wave and continuum in each frame",
    }],
    summary: &[
        Meaning::count("later_pulse_count", "pulses after the first one"),
        Meaning::number("t_peak_s", "time of the largest overlap"),
        Meaning::number("overlap_peak_m", "largest overlap"),
        Meaning::number("overlap_fwhm_s", "full width of the overlap at half of that"),
        Meaning::number("asymmetry", "(rear − front)/(rear + front) of its half widths"),
        Meaning::number("impulse_n_s", "impulse of the contact's force"),
        Meaning::number("speed_beads_per_s", "speed of the pulse there"),
        Meaning::number("exact_overlap_fwhm_s", "width of the exact solitary wave"),
        Meaning::number("exact_l1", "distance from it, L1"),
        Meaning::number("exact_l2", "distance from it, L2"),
        Meaning::number("exact_l_infinity", "distance from it, L∞"),
        Meaning::number("continuum_overlap_fwhm_s", "width of the continuum's wave"),
        Meaning::number("continuum_l1", "distance from it, L1"),
        Meaning::number("continuum_l2", "distance from it, L2"),
        Meaning::number("continuum_l_infinity", "distance from it, L∞"),
    ],
    place: Whereabouts::Of { setting: "contact", also: &[], allowed: "a contact such as @12" },
    begin: |beginning| Ok(Box::new(DeformationAnalysis::begin(beginning)?)),
    ..Offer::PLAIN
};

/// Frames that the upper half of a pulse needs for its shape: 20 are off by 1e-4 of the peak, 10 by 1e-3.
const LEAST_SAMPLES: u64 = 16;

struct DeformationAnalysis {
    manifest: RunManifest,
    deformations: Deformations,
    summarizer: Summarizer,
    /// The largest relative error of the energy.
    max_abs_drift: f64,
    found: Vec<Deformation>,
}

impl DeformationAnalysis {
    fn begin(beginning: &Beginning<'_>) -> Result<Self, Refusal> {
        let manifest = beginning.manifest.clone();
        let last = manifest.all_contact_count() as u64 - 1;
        let contacts = beginning.numbers("contact", "contacts", 0..=last)?;
        Ok(Self {
            deformations: Deformations::new(&manifest, &contacts),
            summarizer: Summarizer::new(&manifest.physics),
            max_abs_drift: 0.0,
            found: Vec::new(),
            manifest,
        })
    }
}

impl Analysis for DeformationAnalysis {
    fn columns(&self, _: usize) -> Vec<Column> {
        let names = ["contact", "time_s", "overlap_m", "exact_m", "continuum_m"];
        names.map(|name| name.to_owned().into()).into()
    }

    fn observe(&mut self, frame: &Frame<'_>, _: &mut dyn Outlet) {
        self.deformations.observe(frame);
        let drift = self.summarizer.summarize(frame).relative_drift.abs();
        self.max_abs_drift = self.max_abs_drift.max(drift);
    }

    fn gap(&mut self) {
        self.deformations.gap();
    }

    fn finish(&mut self, out: &mut dyn Outlet) -> Result<(), Refusal> {
        self.found = self.deformations.results();
        for deformation in self.found.iter().filter(|_| out.wants(0)).collect::<Vec<_>>() {
            write(deformation, out);
        }
        Ok(())
    }

    fn report(&mut self) -> Option<Report> {
        let (mut words, mut contacts) = (Words::default(), Vec::new());
        for found in &self.found {
            let known = Known::new(found, &self.manifest, self.max_abs_drift);
            add_words(&mut words, found, known.as_ref());
            contacts.push(json(found, known.as_ref()));
        }
        let notices = self.found.iter().filter_map(coarse_frames).collect();
        let results = json!({ "contacts": contacts });
        Some(Report { title: "deformation", words, results, notices, is_lossy: false })
    }

    fn figure(&mut self) -> Result<Option<Figure>, FigureError> {
        Ok(Some(plots::deformations(&self.manifest, &self.found)))
    }

    fn value(&self, name: &str, _: Option<&str>) -> Option<Number> {
        let found = self.found.first()?;
        let theory = |found: &Result<Comparison, String>, name: &str| {
            let theory = found.as_ref().ok()?;
            Some(Number::Double(match name {
                "overlap_fwhm_s" => theory.width_s,
                "l1" => theory.l1,
                "l2" => theory.l2,
                "l_infinity" => theory.l_infinity,
                _ => return None,
            }))
        };
        for (prefix, of_theory) in [("exact_", &found.exact), ("continuum_", &found.continuum)] {
            if let Some(name) = name.strip_prefix(prefix) {
                return theory(of_theory, name);
            }
        }
        let shape = found.measured.as_ref().ok();
        Some(Number::Double(match name {
            "later_pulse_count" => return found.later_pulse_count.map(Number::Count),
            "t_peak_s" => shape?.peak_s,
            "overlap_peak_m" => shape?.overlap_m,
            "overlap_fwhm_s" => shape?.width_s,
            "asymmetry" => shape?.asymmetry,
            "impulse_n_s" => shape?.impulse_n_s,
            "speed_beads_per_s" => shape.and(found.speed_beads_per_s)?,
            _ => return None,
        }))
    }
}

/// A warning where so few frames hold the pulse that its shape is their interpolation.
fn coarse_frames(deformation: &Deformation) -> Option<String> {
    let samples = samples_in_width(deformation).filter(|samples| *samples < LEAST_SAMPLES)?;
    Some(format!(
        "contact {}: {} of the frames show the upper half of the pulse, too few for its shape; record more often, or \
         use --every-step",
        deformation.contact,
        count(samples)
    ))
}

/// Frames in which the overlap is at least half of its peak, if there was a pulse.
fn samples_in_width(deformation: &Deformation) -> Option<u64> {
    let half_m = deformation.measured.as_ref().ok()?.overlap_m / 2.0;
    Some(deformation.samples.iter().filter(|sample| sample.overlap_m >= half_m).count() as u64)
}

/// Adds a line for each sample of the pulse; the theories' fields are empty where there is none.
fn write(deformation: &Deformation, out: &mut dyn Outlet) {
    for sample in &deformation.samples {
        let theory = |theory: &Result<Comparison, String>| {
            theory.as_ref().map_or(Cell::Empty, |theory| Cell::Double(theory.overlap_m(sample.time_s)))
        };
        let (exact, continuum) = (theory(&deformation.exact), theory(&deformation.continuum));
        let (time, overlap) = (Cell::Double(sample.time_s), Cell::Double(sample.overlap_m));
        out.line(0, &[Cell::Integer(deformation.contact), time, overlap, exact, continuum]);
    }
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
    /// Makes one if the pulse could be measured.
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

fn add_words(words: &mut Words, deformation: &Deformation, known: Option<&Known>) {
    words.add("contact", deformation.contact);
    let Some(known) = known else { return words.each("first pulse", deformation.measured.as_ref().err()) };
    let later = match deformation.later_pulse_count {
        None | Some(0) => String::new(),
        Some(later) => format!("; {} more came later", count(later)),
    };
    let (overlap, peak) = (known.overlap_m / 1e-6, known.peak_s / 1e-3);
    words.add("first pulse", format_args!("{overlap} µm at {peak} ms{later}"));
    let speed = known.speed_beads_per_s.map_or_else(String::new, |speed| format!(", {speed} beads/s"));
    let Known { asymmetry, impulse_n_s, .. } = known;
    let width = known.width_s / 1e-6;
    words.add(
        "measured",
        format_args!("width {width} µs, asymmetry {asymmetry}, impulse {impulse_n_s} N s{speed}"),
    );
    for (name, theory) in [("exact wave", &deformation.exact), ("continuum", &deformation.continuum)] {
        words.add(name, theory.as_ref().map_or_else(Clone::clone, |theory| theory_text(theory, known)));
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
