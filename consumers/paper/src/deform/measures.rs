//! Measures of a deformation, in a run and in its partner with twice the step.

use super::super::judgement::{Number, StudyError};
use super::super::observe::{Observations, Observed};
use super::super::reference::CONTACT_100;
use super::super::runs::homogeneous;
use consumers::deformation::{Comparison, Deformation, Sample, Shape};
use consumers::theory::ContinuumWave;
use std::f64::consts::FRAC_PI_2;

/// A tail is where the overlap is this part of the peak.
pub(super) const TAIL: f64 = 1e-3;

/// The deformation that a run was made for.
pub(super) fn deformation(seen: &Observed) -> Result<&Deformation, StudyError> {
    seen.deformations.first().ok_or_else(|| seen.absent("deformation"))
}

pub(super) fn shape(seen: &Observed) -> Result<Shape, StudyError> {
    deformation(seen)?.measured.map_err(|why| seen.absent(why.to_string()))
}

pub(super) fn continuum(seen: &Observed) -> Result<&Comparison, StudyError> {
    deformation(seen)?.continuum.as_ref().map_err(|why| seen.absent(why))
}

/// Time, height, width and speed of the pulse at contact 100, and the largest velocity of bead 100, against the
/// reference.
pub(in super::super) fn against_reference(
    seen: &Observations,
    alpha: f64,
) -> Result<Vec<Number>, StudyError> {
    let good_to = if alpha == 1.01 { 1e-5 } else { 1e-6 };
    let run = homogeneous(alpha);
    let (fine, coarse) = seen.both(&run, |seen| {
        let (shape, speed) = (shape(seen)?, speed_of_reference(seen)?);
        let v_peak_m_s = seen.first_pulse_past(100)?.v_peak_m_s;
        Ok([shape.peak_s * 1e3, shape.overlap_m * 1e6, shape.width_s * 1e6, speed, v_peak_m_s])
    })?;
    let drift = seen.of(&run)?.max_abs_drift;
    let reference = CONTACT_100.at(alpha)?;
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

/// Errors of the theory, as shares of the peak.
pub(super) fn norms(seen: &Observations, alpha: f64) -> Result<Vec<Number>, StudyError> {
    let mean = format!("root-mean-square error over the width of eq. (cos), α = {alpha}");
    let mean = seen.stepped(&homogeneous(alpha), mean, "", |seen| Ok(continuum(seen)?.l2))?;
    Ok(vec![largest_error(seen, alpha)?, mean])
}

pub(super) fn largest_error(seen: &Observations, alpha: f64) -> Result<Number, StudyError> {
    let what = format!("largest error of eq. (cos), α = {alpha}");
    seen.stepped(&homogeneous(alpha), what, "", |seen| Ok(continuum(seen)?.l_infinity))
}

/// Half the times (s) between the points, before and after the peak, at which the measured overlap and the theory's
/// overlap are [`TAIL`] of the peak.
fn tails(seen: &Observed) -> Result<(f64, f64), StudyError> {
    let (found, theory, shape) = (deformation(seen)?, continuum(seen)?, shape(seen)?);
    let alpha = seen.manifest.physics.alpha;
    let above = |sample: &&Sample| sample.overlap_m > TAIL * shape.overlap_m;
    let ends = found.samples.iter().find(above).zip(found.samples.iter().rfind(above));
    let (first, last) = ends.ok_or_else(|| seen.absent("overlap"))?;
    // cos^(2/(α−1)) = TAIL
    let wave = ContinuumWave::new(alpha)?;
    let part = TAIL.powf(0.5 * (alpha - 1.0)).acos() / FRAC_PI_2;
    let half_s = part * wave.half_length_beads() / theory.scale.speed_beads_per_s;
    Ok((0.5 * (last.time_s - first.time_s), half_s))
}

/// The length of the pulse at [`TAIL`] of the peak over that of the theory.
pub(super) fn longer(seen: &Observations, alpha: f64) -> Result<Number, StudyError> {
    let what = format!("length at a thousandth of the peak over that of eq. (cos), α = {alpha}");
    seen.stepped(&homogeneous(alpha), what, "", |seen| tails(seen).map(|(ours, theirs)| ours / theirs))
}

/// `∫k·δ^α dt` and `∫k·δ dt` over the momentum (kg·m/s) that contact 100 has handed on: that of all beads behind it.
pub(super) fn handed_on(seen: &Observed) -> Result<(f64, f64), StudyError> {
    let (found, shape) = (deformation(seen)?, shape(seen)?);
    let physics = &seen.manifest.physics;
    let passed: f64 = seen.kept_frame(0)?.v_m_s[101..].iter().map(|v| v * physics.bead_mass_kg).sum();
    let area = |pair: &[Sample]| {
        0.5 * (pair[0].compression_m() + pair[1].compression_m()) * (pair[1].time_s - pair[0].time_s)
    };
    let linear: f64 = found.samples.windows(2).map(area).sum();
    Ok((shape.impulse_n_s / passed, physics.stiffness * linear / passed))
}

/// The largest distance of a pulse from a triangle of its height and width, over its height.
pub(super) fn from_triangle(seen: &Observed) -> Result<f64, StudyError> {
    let (found, shape) = (deformation(seen)?, shape(seen)?);
    // for α → ∞ one bead moves at a time: the overlap grows while it crosses, and falls while the next does
    let triangle = |time_s: f64| (1.0 - 0.5 * (time_s - shape.peak_s).abs() / (0.5 * shape.width_s)).max(0.0);
    let differences = found.samples.iter();
    let differences =
        differences.map(|sample| (sample.compression_m() / shape.overlap_m - triangle(sample.time_s)).abs());
    Ok(differences.fold(0.0, f64::max))
}
