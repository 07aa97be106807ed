//! What is measured of a deformation, in a run and in its partner with twice the step.

use super::super::claim::{Number, StudyError};
use super::super::observe::{Observations, Observed};
use super::super::reference::CONTACT_100;
use super::super::runs::{Run, homogeneous};
use consumers::deformation::{Comparison, Deformation, Sample, Shape, Untold};
use consumers::theory::ContinuumWave;
use std::f64::consts::FRAC_PI_2;

/// A tail is where the overlap is this part of the peak.
pub(super) const TAIL: f64 = 1e-3;

/// The deformation that a run was made for.
pub(super) fn deformation<'a>(seen: &'a Observations, run: &Run) -> Result<&'a Deformation, StudyError> {
    let seen = seen.of(run)?;
    seen.deformations.first().ok_or_else(|| seen.absent("deformation"))
}

pub(super) fn shape(seen: &Observations, run: &Run) -> Result<Shape, StudyError> {
    let untold = |why: Untold| StudyError::Absent { run: run.name().to_owned(), what: why.to_string() };
    deformation(seen, run)?.measured.map_err(untold)
}

pub(super) fn continuum<'a>(seen: &'a Observations, run: &Run) -> Result<&'a Comparison, StudyError> {
    let none = |why: &String| StudyError::Absent { run: run.name().to_owned(), what: why.clone() };
    deformation(seen, run)?.continuum.as_ref().map_err(none)
}

/// Time, height, width and speed of the pulse at contact 100, and the largest velocity of bead 100, against the
/// reference.
pub(in super::super) fn against_reference(
    seen: &Observations,
    alpha: f64,
) -> Result<Vec<Number>, StudyError> {
    let good_to = if alpha == 1.01 { 1e-5 } else { 1e-6 };
    let (run, partner) = (homogeneous(alpha), homogeneous(alpha).with_step_times(2));
    let values = |run: &Run| -> Result<[f64; 5], StudyError> {
        let (shape, found) = (shape(seen, run)?, seen.of(run)?);
        let speed = speed_of_reference(found)?;
        let passage = found
            .pulses_past(100, true)
            .into_iter()
            .next()
            .ok_or_else(|| found.absent("pulse at bead 100"))?;
        Ok([shape.peak_s * 1e3, shape.overlap_m * 1e6, shape.width_s * 1e6, speed, passage.v_peak_m_s])
    };
    let (fine, coarse, drift) = (values(&run)?, values(&partner)?, seen.of(&run)?.max_abs_drift);
    let reference = CONTACT_100.numbers(&[alpha])?;
    let units = [1e3, 1e6, 1e6, 1.0, 1.0];
    let names = [
        ("time of the peak", "ms"),
        ("largest overlap", "µm"),
        ("full width at half maximum", "µs"),
        ("speed over contacts 94 to 105", "beads/s"),
        ("largest velocity of bead 100", "m/s"),
    ];
    let numbers = names.into_iter().enumerate().map(|(i, (what, unit))| {
        Number::stepped(format!("{what}, α = {alpha}"), (fine[i], coarse[i]), unit, drift)
            .against(units[i] * reference[i], good_to)
    });
    Ok(numbers.collect())
}

/// The speed (beads/s) over contacts 94 to 105, as in the reference: near α = 1 the pulse is not stationary there, and
/// another baseline has another speed.
fn speed_of_reference(seen: &Observed) -> Result<f64, StudyError> {
    let peak_s = |contact: u64| {
        let found = seen.deformations.iter().find(|found| found.contact == contact);
        let shape = found.and_then(|found| found.measured.ok());
        shape.map(|shape| shape.peak_s).ok_or_else(|| seen.absent(format!("pulse at contact {contact}")))
    };
    Ok(11.0 / (peak_s(105)? - peak_s(94)?))
}

/// How far the theory is off, as shares of the peak.
pub(super) fn norms(seen: &Observations, alpha: f64) -> Result<Vec<Number>, StudyError> {
    let (run, partner) = (homogeneous(alpha), homogeneous(alpha).with_step_times(2));
    let (fine, coarse) = (continuum(seen, &run)?, continuum(seen, &partner)?);
    let drift = seen.of(&run)?.max_abs_drift;
    let number = |what: &str, of: fn(&Comparison) -> f64| {
        Number::stepped(format!("{what} of eq. (cos), α = {alpha}"), (of(fine), of(coarse)), "", drift)
    };
    Ok(vec![
        number("largest error", |theory| theory.l_infinity),
        number("root-mean-square error over the width", |theory| theory.l2),
    ])
}

/// Where, before and after the peak, the measured overlap and the theory's are [`TAIL`] of the peak: half the time between
/// (s) of each.
pub(super) fn tails(seen: &Observations, run: &Run) -> Result<(f64, f64), StudyError> {
    let (found, theory, shape) = (deformation(seen, run)?, continuum(seen, run)?, shape(seen, run)?);
    let alpha = run.config.chain.alpha;
    let level_m = TAIL * shape.overlap_m;
    let above: Vec<f64> = found
        .samples
        .iter()
        .filter(|sample| sample.overlap_m > level_m)
        .map(|sample| sample.time_s)
        .collect();
    let (Some(first), Some(last)) = (above.first(), above.last()) else {
        return Err(StudyError::Absent { run: run.name().to_owned(), what: "overlap".to_owned() });
    };
    // cos^(2/(α−1)) = TAIL
    let wave = ContinuumWave::new(alpha)?;
    let part = TAIL.powf(0.5 * (alpha - 1.0)).acos() / FRAC_PI_2;
    let half_s = part * wave.half_length_beads() / theory.scale.speed_beads_per_s;
    Ok((0.5 * (last - first), half_s))
}

/// A quantity of the run of an exponent, and of its partner.
pub(super) fn stepped(
    seen: &Observations,
    alpha: f64,
    what: impl Into<String>,
    unit: &'static str,
    of: impl Fn(&Run) -> Result<f64, StudyError>,
) -> Result<Number, StudyError> {
    let run = homogeneous(alpha);
    let drift = seen.of(&run)?.max_abs_drift;
    Ok(Number::stepped(what, (of(&run)?, of(&run.with_step_times(2))?), unit, drift))
}

/// The length of the pulse at [`TAIL`] of the peak over that of the theory.
pub(super) fn longer(seen: &Observations, alpha: f64) -> Result<Number, StudyError> {
    let what = format!("length at a thousandth of the peak over that of eq. (cos), α = {alpha}");
    stepped(seen, alpha, what, "", |run| tails(seen, run).map(|(ours, theirs)| ours / theirs))
}

/// `∫k·δ^α dt` and `∫k·δ dt` over the momentum (kg·m/s) that contact 100 has handed on: that of all beads behind it.
pub(super) fn handed_on(seen: &Observations, run: &Run) -> Result<(f64, f64), StudyError> {
    let (found, shape, observed) = (deformation(seen, run)?, shape(seen, run)?, seen.of(run)?);
    let physics = &observed.manifest.physics;
    let passed: f64 = observed.kept_frame(0)?.v_m_s[101..].iter().map(|v| v * physics.bead_mass_kg).sum();
    let area = |pair: &[Sample]| {
        0.5 * (pair[0].compression_m() + pair[1].compression_m()) * (pair[1].time_s - pair[0].time_s)
    };
    let linear: f64 = found.samples.windows(2).map(area).sum();
    Ok((shape.impulse_n_s / passed, physics.stiffness * linear / passed))
}

/// The largest distance of a pulse from a triangle of its height and width, over its height.
pub(super) fn from_triangle(seen: &Observations, run: &Run) -> Result<f64, StudyError> {
    let (found, shape) = (deformation(seen, run)?, shape(seen, run)?);
    // for α → ∞ one bead moves at a time: the overlap grows while it crosses, and falls while the next does
    let triangle = |time_s: f64| (1.0 - 0.5 * (time_s - shape.peak_s).abs() / (0.5 * shape.width_s)).max(0.0);
    let differences = found.samples.iter();
    let differences =
        differences.map(|sample| (sample.compression_m() / shape.overlap_m - triangle(sample.time_s)).abs());
    Ok(differences.fold(0.0, f64::max))
}
