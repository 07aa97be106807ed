//! The speed of the pulse against eq. (vf).

use super::deform::{ALPHAS, against_reference};
use super::judgement::{Judgement, Number, StudyError, Verdict};
use super::observe::{Observations, Observed};
use super::passing::{Passed, both_steps, pulses_of_table};
use super::reference::{LIGHT_PULSES, SOLITARY_WAVE};
use super::runs::{Run, homogeneous, light};
use super::study::{Claim, Study};
use consumers::power_law::PowerLaw;
use consumers::pulses::Passage;
use consumers::theory::{Coefficients, ContinuumWave, SolitaryWave, WaveError};
use figure::{Axis, Colour, Curve, Figure, Mark, Panel, Stroke};

/// Exponents of the deformation curves with a pulse that is stationary at contact 100.
fn stationary() -> impl Iterator<Item = f64> {
    ALPHAS.into_iter().filter(|alpha| *alpha > 1.1)
}

pub(super) const SPEED: Study = Study {
    slug: "speed",
    title: "Speed of the pulse against the theories",
    place: "eq. (vf)",
    runs,
    sweep: false,
    draw,
    claims: &[
        Claim {
            id: "speed-eq-vf",
            place: "section 2, eq. (vf)",
            quote: "From the expression above we easily extract the wave speed V = (2c_α²/(α+1))^(1/(α+1))·v_max^((α−1)/(α+1)), v_max \
                    being the maximum of the velocity pulse.",
            judge: judge_speed,
        },
        Claim {
            id: "speed-grows-with-amplitude",
            place: "section 1",
            quote: "… the speed of our solitary waves increases with the amplitude.",
            judge: judge_amplitude,
        },
    ],
};

fn runs() -> Vec<Run> {
    stationary().map(homogeneous).chain([light()]).flat_map(both_steps).collect()
}

/// `C_V` as measured: `V/((k/m)^(1/(α+1))·v_max^((α−1)/(α+1)))`.
fn measured(seen: &Observed) -> Result<f64, StudyError> {
    let physics = &seen.manifest.physics;
    let speed = seen.deformations.first().and_then(|found| found.speed_beads_per_s);
    let speed = speed.ok_or_else(|| seen.absent("speed"))?;
    let v_peak_m_s = seen.first_pulse_past(100)?.v_peak_m_s;
    let power = 1.0 / (physics.alpha + 1.0);
    let unit = (physics.stiffness / physics.bead_mass_kg).powf(power)
        * v_peak_m_s.powf((physics.alpha - 1.0) * power);
    Ok(speed / unit)
}

fn judge_speed(seen: &Observations) -> Result<Judgement, StudyError> {
    let mut numbers = Vec::new();
    let mut worst = 0.0_f64;
    for alpha in stationary() {
        let run = homogeneous(alpha);
        let exact = SOLITARY_WAVE.at(alpha)?[0];
        let coefficient = seen.stepped(&run, format!("C_V, α = {alpha}"), "", measured)?;
        let continuum = ContinuumWave::new(alpha)?.coefficients().speed;
        let what = format!("speed over that of eq. (vf), α = {alpha}");
        let ratio = seen.stepped(&run, what, "", |seen| Ok(measured(seen)? / continuum))?;
        worst = worst.max((ratio.value - 1.0).abs());
        numbers.extend([coefficient.against(exact, 1e-6), ratio]);
        let speeds = against_reference(seen, alpha)?;
        numbers.extend(speeds.into_iter().filter(|number| number.what.starts_with("speed")));
    }
    Ok(Judgement {
        verdict: Verdict::graded(worst < 0.1, worst < 1e-3),
        why: format!(
            "The powers of k/m and v_max are exact, but the coefficient (2/(α+1))^(1/(α+1)) is that of the continuum, up to {:.1} % too large; \
             that of the lattice is the one measured.",
            100.0 * worst
        ),
        numbers,
    })
}

fn judge_amplitude(seen: &Observations) -> Result<Judgement, StudyError> {
    let pulses = pulses_of_table(seen, &light(), LIGHT_PULSES, true)?;
    let law = |of: fn(&Passed) -> Passage| {
        let points: Vec<(f64, f64)> =
            pulses.iter().rev().map(|pulse| (of(pulse).v_peak_m_s, of(pulse).speed_beads_per_s)).collect();
        PowerLaw::fit(&points).ok_or_else(|| StudyError::absent(light().name(), "law"))
    };
    let (fine, coarse) = (law(|pulse| pulse.fine)?, law(|pulse| pulse.coarse)?);
    let rises = fine.local.0 > 0.0;
    Ok(Judgement {
        verdict: Verdict::of(rises && (fine.exponent - 0.2).abs() < 1e-3),
        why: format!(
            "The {} forward pulses of the light impurity, whose amplitudes span a factor of {:.0}, have V ∝ v_max^{:.4}; eq. (vf) has 1/5.",
            pulses.len(),
            pulses[0].fine.v_peak_m_s / pulses[pulses.len() - 1].fine.v_peak_m_s,
            fine.exponent
        ),
        numbers: vec![
            Number::stepped(
                "exponent of v_max in V, α = 1.5",
                (fine.exponent, coarse.exponent),
                "",
                pulses[0].drift,
            ),
            Number::new(
                "standard error of the exponent, from the scatter of the points",
                fine.exponent_error,
                "",
            ),
        ],
    })
}

fn draw(seen: &Observations) -> Result<Figure, StudyError> {
    let points = stationary().map(|alpha| Ok((alpha, measured(seen.of(&homogeneous(alpha))?)?)));
    let points = points.collect::<Result<Vec<_>, StudyError>>()?;
    let alphas = || (1..=120).map(|i| 1.01 + (10.5_f64 - 1.01) * (f64::from(i) / 120.0).powi(2));
    let along = |wave: fn(f64) -> Result<Coefficients, WaveError>| {
        alphas().map(|alpha| Ok((alpha, wave(alpha)?.speed))).collect::<Result<Vec<_>, WaveError>>()
    };
    let exact = along(|alpha| Ok(SolitaryWave::new(alpha)?.coefficients()))?;
    let continuum = along(|alpha| Ok(ContinuumWave::new(alpha)?.coefficients()))?;
    let panel = Panel::new()
        .x_axis(Axis::new("exponent α").log())
        .y_axis("C_{V} = V (m/k)^{1/(α+1)} v_{max}^{−(α−1)/(α+1)}")
        .curve(Curve::line("exact wave of the lattice", exact).colour(Colour::Black))
        .curve(Curve::line("continuum, eq. (vf)", continuum).colour(Colour::Blue).stroke(Stroke::Dashed))
        .curve(Curve::points("simulation", points).colour(Colour::Vermillion).mark(Mark::Circle));
    Ok(Figure::new()
        .caption("Speed over contacts 95 to 105 of 200 equal beads, largest velocity at bead 100.")
        .panel(panel))
}
