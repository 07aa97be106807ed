//! `beadline deformation`.

use crate::analysis::{AnalysisError, Session, draw};
use crate::args::DeformationArgs;
use crate::display;
use crate::failure::{Done, Failure};
use crate::outputs::check_tables;
use anyhow::anyhow;
use consumers::deformation::{Comparison, Deformation, Deformations};
use consumers::follow::Analysis;
use consumers::plots;
use consumers::table::{Table, TableError};
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use serde_json::{Value, json};

/// Frames that the upper half of a pulse needs for its shape: 20 are off by 1e-4 of the peak, 10 by 1e-3.
const LEAST_SAMPLES: u64 = 16;

struct Look(Deformations);

impl Analysis for Look {
    type Error = AnalysisError;

    fn observe(&mut self, frame: &Frame<'_>) -> Result<(), AnalysisError> {
        self.0.observe(frame);
        Ok(())
    }

    fn gap(&mut self) {
        self.0.gap();
    }
}

pub(crate) fn deformation(args: &DeformationArgs) -> Result<Done, Failure> {
    let tables: Vec<_> = args.out.iter().collect();
    check_tables(&tables)?;
    let mut session = Session::open(&args.common, "deformation", &tables)?;
    let manifest = session.manifest().clone();
    check_contacts(&manifest, &args.contact)?;
    let columns = ["contact", "time_s", "overlap_m", "exact_m", "continuum_m"].map(str::to_owned);
    let table =
        args.out.as_ref().map(|path| Table::create(path, &columns, args.common.frames.force)).transpose()?;
    let mut look = Look(Deformations::new(&manifest, &args.contact));
    let tally = session.follow(&mut look)?;

    let found = look.0.results();
    warn_of_coarse_frames(&found);
    if let Some(mut table) = table {
        found.iter().try_for_each(|deformation| write(&mut table, deformation))?;
        table.finish()?;
    }
    draw(&args.common, || Ok(plots::deformations(&manifest, &found)))?;
    let rows = found.iter().flat_map(rows).collect();
    session.report(
        &tally,
        "deformation",
        rows,
        json!({ "contacts": found.iter().map(json).collect::<Vec<_>>() }),
    )
}

/// Says so where the pulse is told from so few frames that its shape is their interpolation.
fn warn_of_coarse_frames(found: &[Deformation]) {
    for deformation in found {
        if let Some(samples) = samples_in_width(deformation).filter(|samples| *samples < LEAST_SAMPLES) {
            display::notice(format_args!(
                "contact {}: {} of the frames show the upper half of the pulse, too few for its shape; record more often, or \
                 use --every-step",
                deformation.contact,
                display::count(samples)
            ));
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
        Some(contact) => {
            let message = format!("--contact {contact}: the chain has contacts 0 to {last}");
            Err(Failure::BadInput(anyhow!(message)))
        }
    }
}

/// A row for each sample of the pulse; the theories' fields are empty where there is none.
fn write(table: &mut Table, deformation: &Deformation) -> Result<(), TableError> {
    for sample in &deformation.samples {
        table.integer(deformation.contact).double(sample.time_s).double(sample.overlap_m);
        for theory in [&deformation.exact, &deformation.continuum] {
            match theory {
                Ok(theory) => table.double(theory.overlap_m(sample.time_s)),
                Err(_) => table.empty(),
            };
        }
        table.end_row()?;
    }
    Ok(())
}

fn rows(deformation: &Deformation) -> Vec<(&'static str, String)> {
    let mut rows = vec![("contact", deformation.contact.to_string())];
    let shape = match &deformation.measured {
        Ok(shape) => shape,
        Err(untold) => {
            rows.push(("first pulse", untold.to_string()));
            return rows;
        }
    };
    let later = match deformation.later_pulse_count {
        0 => String::new(),
        count => format!("; {} more came later", display::count(count)),
    };
    rows.push((
        "first pulse",
        format!(
            "{} at {}{later}",
            display::quantity(shape.overlap_m, "m"),
            display::quantity(shape.peak_s, "s")
        ),
    ));
    let speed =
        deformation.speed_beads_per_s.map_or_else(String::new, |speed| format!(", {speed:.2} beads/s"));
    rows.push((
        "measured",
        format!(
            "width {}, asymmetry {:.2e}, impulse {}{speed}",
            display::quantity(shape.width_s, "s"),
            shape.asymmetry,
            display::quantity(shape.impulse_n_s, "N s")
        ),
    ));
    for (name, theory) in [("exact wave", &deformation.exact), ("continuum", &deformation.continuum)] {
        rows.push((name, theory.as_ref().map_or_else(Clone::clone, theory_text)));
    }
    rows
}

fn theory_text(theory: &Comparison) -> String {
    format!(
        "width {}, impulse {}, {:.2} beads/s; off by L1 {:.1e}, L2 {:.1e}, L∞ {:.1e}",
        display::quantity(theory.width_s, "s"),
        display::quantity(theory.impulse_n_s, "N s"),
        theory.scale.speed_beads_per_s,
        theory.l1,
        theory.l2,
        theory.l_infinity
    )
}

fn json(deformation: &Deformation) -> Value {
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
