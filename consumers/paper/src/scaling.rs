//! Amplitude and width of the stationary pulse against α − 1.

use super::front::Front;
use super::judgement::{Judgement, Number, StudyError, Verdict};
use super::observe::{Observations, Observed};
use super::runs::long;
use super::study::{Claim, Study};
use consumers::power_law::PowerLaw;
use consumers::theory::{GaussianLimit, SolitaryWave};
use consumers::uncertain::Uncertain;
use figure::{Axis, Colour, Curve, Figure, Mark, Panel, Stroke};

const SECTION: &str = "section 2";
/// Exponents of the figures.
pub(super) const ALPHAS: [f64; 7] = [1.004, 1.01, 1.014, 1.02, 1.03, 1.05, 1.1];
/// Power laws are fitted for α − 1 from 0.01 to 0.05, as in the reference.
const FITTED: std::ops::RangeInclusive<f64> = 0.0099..=0.0501;
/// Error of the reference of `v_max/v0`: it has six digits.
const GOOD_TO: f64 = 1e-6;
/// Stationary `v_max/v0` of the project's reference, computed independently.
const REFERENCE: [(f64, f64); 5] =
    [(1.004, 0.204_950), (1.01, 0.257_856), (1.02, 0.306_854), (1.05, 0.386_324), (1.1, 0.459_784)];
pub(super) const FROM_PATH: &str = "the change over the last fifth of the path, the drift of the energy, and the interpolation between beads";
const FROM_FIT: &str =
    "the scatter of the points about the line and the range of exponents between neighbouring points";

pub(super) const VMAX: Study = Study {
    slug: "vmax",
    title: "Final amplitude of the velocity pulse against α − 1",
    place: "figure vmax",
    runs: || ALPHAS.map(long).to_vec(),
    sweep: false,
    draw: draw_vmax,
    claims: &[
        Claim {
            id: "vmax-quarter",
            place: SECTION,
            quote: "It follows that the product v_max²·w remains constant. Hence, v_max ∝ (α−1)^(1/4).",
            judge: judge_quarter,
        },
        Claim {
            id: "vmax-exponent",
            place: "figure vmax",
            quote: "The dashed line displays the corresponding power law: v_max ∝ (α−1)^0.243.",
            judge: judge_vmax,
        },
        Claim {
            id: "vmax-negligible-tail",
            place: SECTION,
            quote: "A second scaling relation can be obtained by using the conservation of the kinetic energy in the wave since \
                    the beads following the wave have negligible velocities.",
            judge: judge_energy,
        },
        Claim {
            id: "vmax-continuous",
            place: SECTION,
            quote: "These two scaling laws show that the transition between the self-similar regime α=1 to the solitonic regime \
                    α>1 is actually continuous, the value α=1 being not singular.",
            judge: judge_continuous,
        },
    ],
};

pub(super) const WIDTH: Study = Study {
    slug: "width",
    title: "Width of the pulse against α − 1",
    place: "figure width",
    runs: || ALPHAS.map(long).to_vec(),
    sweep: false,
    draw: draw_width,
    claims: &[
        Claim {
            id: "width-half",
            place: SECTION,
            quote: "According to the properties of Gaussian distributions the width w of the solitary wave follows the scaling \
                    law w ∝ (α−1)^(−1/2). … We checked numerically the accuracy of this scaling relation and found a good \
                    agreement.",
            judge: judge_half,
        },
        Claim {
            id: "width-exponent",
            place: "figure width",
            quote: "The dashed line displays the corresponding power law: w ∝ (α−1)^(−0.492).",
            judge: judge_width,
        },
    ],
};

/// A pulse that has become stationary.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stationary {
    pub(super) alpha: f64,
    /// `v_max/v0` and the full width at half maximum (beads).
    pub(super) amplitude: Uncertain,
    pub(super) fwhm_beads: Uncertain,
}

/// The end of the path of a pulse.
pub(super) fn stationary(seen: &Observations, alpha: f64) -> Result<Stationary, StudyError> {
    let run = long(alpha);
    let seen = seen.of(&run)?;
    let v0 = seen.manifest.physics.striker.velocity_m_s;
    let (early, late) = (window(seen, 0.72, 0.8)?, window(seen, 0.92, 0.995)?);
    let mean =
        |fronts: &[Front], of: fn(&Front) -> f64| fronts.iter().map(of).sum::<f64>() / fronts.len() as f64;
    let spread = |fronts: &[Front], of: fn(&Front) -> f64| {
        let values = || fronts.iter().map(of);
        0.5 * (values().fold(f64::NEG_INFINITY, f64::max) - values().fold(f64::INFINITY, f64::min))
    };
    let measure = |of: fn(&Front) -> f64| {
        let (value, before) = (mean(&late, of), mean(&early, of));
        Uncertain::new(value, (value - before).abs() + spread(&late, of) + value * seen.max_abs_drift)
    };
    let (v_max, fwhm_beads) = (measure(|front| front.v_max_m_s), measure(|front| front.fwhm_beads));
    Ok(Stationary { alpha, amplitude: v_max / v0, fwhm_beads })
}

/// The leading pulse while it was in this part of the chain.
fn window(seen: &Observed, from: f64, to: f64) -> Result<Vec<Front>, StudyError> {
    let beads = seen.manifest.physics.beads as f64;
    let inside = |front: &&Front| (from * beads..to * beads).contains(&front.bead);
    let fronts: Vec<Front> = seen.fronts.iter().filter(inside).copied().collect();
    if fronts.is_empty() {
        return Err(seen.absent(format!("pulse between {from} and {to} of the chain")));
    }
    Ok(fronts)
}

fn all(seen: &Observations) -> Result<Vec<Stationary>, StudyError> {
    ALPHAS.into_iter().map(|alpha| stationary(seen, alpha)).collect()
}

/// The law through the fitted range of a quantity.
fn law(pulses: &[Stationary], of: fn(&Stationary) -> f64) -> Result<PowerLaw, StudyError> {
    let fitted = pulses.iter().filter(|pulse| FITTED.contains(&(pulse.alpha - 1.0)));
    let points: Vec<(f64, f64)> = fitted.map(|pulse| (pulse.alpha - 1.0, of(pulse))).collect();
    PowerLaw::fit(&points).ok_or_else(|| StudyError::absent("front-alpha-…", "three stationary pulses"))
}

fn amplitude_law(pulses: &[Stationary]) -> Result<PowerLaw, StudyError> {
    law(pulses, |pulse| pulse.amplitude.value)
}

fn width_law(pulses: &[Stationary]) -> Result<PowerLaw, StudyError> {
    law(pulses, |pulse| pulse.fwhm_beads.value)
}

/// Error of an exponent between two neighbours in the fitted range.
fn neighbour_error(pulses: &[Stationary], of: fn(&Stationary) -> Uncertain) -> f64 {
    let fitted: Vec<_> = pulses.iter().filter(|pulse| FITTED.contains(&(pulse.alpha - 1.0))).collect();
    let pairs = fitted.windows(2).map(|pair| {
        let relative = of(pair[0]).relative() + of(pair[1]).relative();
        relative / ((pair[1].alpha - 1.0) / (pair[0].alpha - 1.0)).ln()
    });
    pairs.fold(0.0, f64::max)
}

/// The exponent with its uncertainty.
fn exponent(what: &str, law: &PowerLaw) -> Number {
    let range = 0.5 * (law.local.1 - law.local.0);
    Number::new(format!("exponent of {what} for α − 1 from 0.01 to 0.05"), law.exponent, "")
        .give_or_take(law.exponent_error.hypot(range), FROM_FIT)
}

/// The range of the exponents between neighbours, each of which may be `off` by so much.
fn local_exponents(law: &PowerLaw, off: f64) -> [Number; 2] {
    [("least", law.local.0), ("largest", law.local.1)].map(|(which, exponent)| {
        let what = format!("{which} exponent between two neighbours");
        Number::new(what, exponent, "").give_or_take(off, FROM_PATH)
    })
}

fn amplitude_numbers(pulses: &[Stationary]) -> Vec<Number> {
    let number = |pulse: &Stationary| {
        let what = format!("stationary v_max/v0 at α = {}", pulse.alpha);
        let number = Number::known(what, pulse.amplitude, "", FROM_PATH);
        match REFERENCE.iter().find(|(alpha, _)| *alpha == pulse.alpha) {
            Some((_, value)) => number.against_within(*value, GOOD_TO),
            None => number,
        }
    };
    pulses.iter().map(number).collect()
}

fn judge_quarter(seen: &Observations) -> Result<Judgement, StudyError> {
    let pulses = all(seen)?;
    let law = amplitude_law(&pulses)?;
    let product = |pulse: &Stationary| pulse.amplitude.value.powi(2) * pulse.fwhm_beads.value;
    let products: Vec<f64> = pulses.iter().map(product).collect();
    let largest = products.iter().copied().fold(0.0, f64::max);
    let least = products.iter().copied().fold(f64::INFINITY, f64::min);
    let spread = largest / least - 1.0;
    let mut numbers = vec![exponent("v_max", &law)];
    numbers.extend(pulses.iter().zip(&products).map(|(pulse, product)| {
        let relative = 2.0 * pulse.amplitude.relative() + pulse.fwhm_beads.relative();
        Number::new(format!("(v_max/v0)²·w at α = {}", pulse.alpha), *product, "beads")
            .give_or_take(relative * product, FROM_PATH)
    }));
    Ok(Judgement {
        verdict: Verdict::of((law.exponent - 0.25).abs() < 0.005 && spread < 0.1),
        why: format!(
            "The fitted exponent is {:.4}, and v_max²·w changes by {:.1} % from α = 1.004 to 1.1.",
            law.exponent,
            100.0 * spread
        ),
        numbers,
    })
}

fn judge_vmax(seen: &Observations) -> Result<Judgement, StudyError> {
    /// The exponent in the paper, and half of its last digit.
    const PAPER: (f64, f64) = (0.243, 0.0005);
    let pulses = all(seen)?;
    let law = amplitude_law(&pulses)?;
    let early = early_exponent(seen, 500.0)?;
    let off = neighbour_error(&pulses, |pulse| pulse.amplitude);
    // the reference has it between 0.2508 and 0.2513
    let mut numbers = vec![exponent("v_max", &law).against_within(0.251_05, 0.000_25)];
    numbers.extend(local_exponents(&law, off));
    numbers.push(Number::new("exponent if v_max is read at bead 500 already", early, ""));
    numbers.extend(amplitude_numbers(&pulses));
    let same = (law.exponent - PAPER.0).abs() <= PAPER.1 + law.exponent_error;
    Ok(Judgement {
        verdict: Verdict::graded((law.exponent - PAPER.0).abs() < 0.02, same),
        why: format!(
            "The exponent of the stationary amplitude is {:.4}, nearer to 1/4 than the paper's; read at bead 500, before the pulse is \
             stationary, it would be {early:.3}.",
            law.exponent
        ),
        numbers,
    })
}

/// The exponent that a reading at `bead` would give.
fn early_exponent(seen: &Observations, bead: f64) -> Result<f64, StudyError> {
    let mut points = Vec::new();
    for alpha in ALPHAS.into_iter().filter(|alpha| FITTED.contains(&(alpha - 1.0))) {
        points.push((alpha - 1.0, seen.of(&long(alpha))?.front_at(bead)?.v_max_m_s));
    }
    let law = PowerLaw::fit(&points);
    law.map(|law| law.exponent).ok_or_else(|| StudyError::absent("front-alpha-…", "three pulses"))
}

fn judge_energy(seen: &Observations) -> Result<Judgement, StudyError> {
    let mut numbers = Vec::new();
    let (mut least, mut most) = (1.0_f64, 0.0_f64);
    for alpha in ALPHAS {
        let pulse = stationary(seen, alpha)?;
        // energies over m·v0²/2, that of the struck bead
        let energy = 2.0 * SolitaryWave::new(alpha)?.coefficients().energy;
        let part = energy * pulse.amplitude.value.powi(2);
        (least, most) = (least.min(part), most.max(part));
        numbers.push(
            Number::new(format!("part of the energy in the pulse at α = {alpha}"), part, "")
                .give_or_take(2.0 * part * pulse.amplitude.plus_minus / pulse.amplitude.value, FROM_PATH),
        );
    }
    Ok(Judgement {
        verdict: Verdict::graded(least > 0.9, least > 0.99),
        why: format!(
            "The stationary pulse holds {:.1} to {:.1} % of the energy of the struck bead; what stays behind is little, and hardly depends on α.",
            100.0 * least,
            100.0 * most
        ),
        numbers,
    })
}

fn judge_continuous(seen: &Observations) -> Result<Judgement, StudyError> {
    let pulses = all(seen)?;
    let (amplitude, width) = (amplitude_law(&pulses)?, width_law(&pulses)?);
    // the laws hold outside of the range in which they were fitted, towards α = 1
    let nearest = pulses[0];
    let off = |law: &PowerLaw, found: f64| (found / law.at(nearest.alpha - 1.0) - 1.0).abs();
    let (amplitude_off, width_off) =
        (off(&amplitude, nearest.amplitude.value), off(&width, nearest.fwhm_beads.value));
    Ok(Judgement {
        verdict: Verdict::of(amplitude_off < 0.01 && width_off < 0.01),
        why: format!(
            "At α = {} the laws fitted above 1.01 still hold to {:.2} and {:.2} %; towards α = 1 they go to zero amplitude and infinite \
             width, as there.",
            nearest.alpha,
            100.0 * amplitude_off,
            100.0 * width_off
        ),
        numbers: vec![
            Number::new("v_max at α = 1.004 over the law", nearest.amplitude.value / amplitude.at(0.004), "")
                .give_or_take(nearest.amplitude.relative(), FROM_PATH),
            Number::new("width at α = 1.004 over the law", nearest.fwhm_beads.value / width.at(0.004), "")
                .give_or_take(nearest.fwhm_beads.relative(), FROM_PATH),
        ],
    })
}

fn judge_half(seen: &Observations) -> Result<Judgement, StudyError> {
    let pulses = all(seen)?;
    let law = width_law(&pulses)?;
    let mut numbers = vec![exponent("the width", &law)];
    for pulse in &pulses {
        let what = format!("width over that of the Gaussian at α = {}", pulse.alpha);
        let ratio = pulse.fwhm_beads / GaussianLimit::new(pulse.alpha)?.fwhm_beads();
        numbers.push(Number::known(what, ratio, "", FROM_PATH));
    }
    Ok(Judgement {
        verdict: Verdict::of((law.exponent + 0.5).abs() < 0.01),
        why: format!(
            "The fitted exponent is {:.4}; what it lacks to −1/2 is the difference between the pulse and a Gaussian.",
            law.exponent
        ),
        numbers,
    })
}

fn judge_width(seen: &Observations) -> Result<Judgement, StudyError> {
    /// The exponent in the paper, and half of its last digit.
    const PAPER: (f64, f64) = (-0.492, 0.0005);
    let pulses = all(seen)?;
    let law = width_law(&pulses)?;
    let off = neighbour_error(&pulses, |pulse| pulse.fwhm_beads);
    let mut numbers = vec![exponent("the width", &law).against_within(-0.4918, 0.000_05)];
    numbers.extend(local_exponents(&law, off));
    for pulse in &pulses {
        let what = format!("full width at half maximum at α = {}", pulse.alpha);
        let exact = SolitaryWave::new(pulse.alpha)?.coefficients().velocity_fwhm_beads;
        // the fixed point of the wave equation is no simulation, and good to more digits than this
        numbers.push(Number::known(what, pulse.fwhm_beads, "beads", FROM_PATH).against(exact, 1e-9));
    }
    Ok(Judgement {
        verdict: Verdict::of((law.exponent - PAPER.0).abs() <= PAPER.1 + law.exponent_error),
        why: format!("The fitted exponent is {:.4} (paper: {}).", law.exponent, PAPER.0),
        numbers,
    })
}

fn draw_vmax(seen: &Observations) -> Result<Figure, StudyError> {
    let pulses = all(seen)?;
    let law = amplitude_law(&pulses)?;
    let points: Vec<_> = pulses.iter().map(|pulse| (pulse.alpha - 1.0, pulse.amplitude.value)).collect();
    let paper = through(&law, 0.243);
    let reference = REFERENCE.map(|(alpha, value)| (alpha - 1.0, value));
    let label = format!("fit, exponent {:.4}", law.exponent);
    let panel = laws("v_{max}/v_{0}", &points, &reference, (&label, &law))
        .curve(line("exponent 0.243 of the paper", &paper).colour(Colour::Vermillion).stroke(Stroke::Dashed));
    let residuals = deviations(&points, &reference, &law)
        .curve(deviation_curve(&paper, &law).colour(Colour::Vermillion).stroke(Stroke::Dashed));
    Ok(Figure::new().shared_x().caption(CAPTION).panel(panel).panel(residuals))
}

fn draw_width(seen: &Observations) -> Result<Figure, StudyError> {
    let pulses = all(seen)?;
    let law = width_law(&pulses)?;
    let points: Vec<_> = pulses.iter().map(|pulse| (pulse.alpha - 1.0, pulse.fwhm_beads.value)).collect();
    let gaussian = ALPHAS.into_iter().map(|alpha| Ok((alpha - 1.0, GaussianLimit::new(alpha)?.fwhm_beads())));
    let gaussian = gaussian.collect::<Result<Vec<_>, StudyError>>()?;
    let label = format!("fit, exponent {:.4}", law.exponent).replace('-', "−");
    let limit = |points: Vec<(f64, f64)>, label: &str| {
        Curve::line(label, points).colour(Colour::Vermillion).stroke(Stroke::Dashed)
    };
    let residuals = gaussian.iter().copied().map(deviation(&law)).collect();
    Ok(Figure::new()
        .shared_x()
        .caption(CAPTION)
        .panel(
            laws("full width at half maximum (beads)", &points, &[], (&label, &law))
                .curve(limit(gaussian, "Gaussian limit")),
        )
        .panel(deviations(&points, &[], &law).curve(limit(residuals, ""))))
}

/// Points, over those of a reference, with the law through them, on logarithmic axes.
fn laws(
    label: &str,
    points: &[(f64, f64)],
    reference: &[(f64, f64)],
    (fit, law): (&str, &PowerLaw),
) -> Panel {
    Panel::new()
        .x_axis(Axis::new("α − 1").log())
        .y_axis(Axis::new(label).log())
        .curve(line(fit, law).colour(Colour::Black))
        .curve(crosses(if reference.is_empty() { "" } else { "independent reference" }, reference))
        .curve(Curve::points("simulation", points.to_vec()).colour(Colour::Blue))
        .height(1.4)
}

fn crosses(label: &str, points: &[(f64, f64)]) -> Curve {
    Curve::points(label, points.to_vec()).mark(Mark::Cross).colour(Colour::Orange)
}

/// Deviations of points, and of the points of a reference, from the law.
fn deviations(points: &[(f64, f64)], reference: &[(f64, f64)], law: &PowerLaw) -> Panel {
    let off = |points: &[(f64, f64)]| -> Vec<_> { points.iter().copied().map(deviation(law)).collect() };
    Panel::new()
        .x_axis(Axis::new("α − 1").log())
        .y_axis("off the fit (%)")
        .horizontal("", 0.0)
        .curve(crosses("", &off(reference)))
        .curve(Curve::points("", off(points)).colour(Colour::Blue))
        .height(0.8)
}

/// A point's distance from the law, in percent.
fn deviation(law: &PowerLaw) -> impl Fn((f64, f64)) -> (f64, f64) {
    |(x, y)| (x, 100.0 * (y / law.at(x) - 1.0))
}

/// Another law's distance from this one.
fn deviation_curve(other: &PowerLaw, law: &PowerLaw) -> Curve {
    let ends = [ALPHAS[0] - 1.0, ALPHAS[ALPHAS.len() - 1] - 1.0];
    let part = |i: u32| ends[0] * (ends[1] / ends[0]).powf(f64::from(i) / 50.0);
    Curve::line("", (0..=50).map(part).map(|x| deviation(law)((x, other.at(x)))).collect::<Vec<_>>())
}

const CAPTION: &str = "Stationary pulses in chains of equal beads: m = 1 g, k = 10^{7} N m^{−α}, v_{0} = 5 m/s; the line is fitted for \
                       α − 1 from 0.01 to 0.05.";

/// The law over the range of the figure.
fn line(label: impl Into<String>, law: &PowerLaw) -> Curve {
    let ends = [ALPHAS[0] - 1.0, ALPHAS[ALPHAS.len() - 1] - 1.0];
    Curve::line(label, ends.map(|x| (x, law.at(x))))
}

/// A law of another exponent through the middle of the range of this one.
fn through(law: &PowerLaw, exponent: f64) -> PowerLaw {
    let middle = (0.01_f64 * 0.05).sqrt();
    PowerLaw { exponent, prefactor: law.at(middle) / middle.powf(exponent), ..*law }
}
