//! Transient of a pulse near α = 1, and the stationary pulse.

use super::front::Front;
use super::judgement::{Judgement, Number, StudyError, Verdict};
use super::observe::{KeptFrame, Observations, Observed};
use super::runs::long;
use super::scaling::{FROM_PATH, stationary};
use super::study::{Claim, Study};
use consumers::power_law::PowerLaw;
use consumers::theory::GaussianLimit;
use consumers::uncertain::Uncertain;
use figure::{Axis, Colour, Curve, Figure, Panel, Stroke};
use schemas::frame::Frame;

const SECTION: &str = "section 2";
/// Exponents whose transients are shown.
const SHOWN: [f64; 4] = [1.004, 1.01, 1.02, 1.05];
/// Exponents whose shapes are compared with a Gaussian.
const GAUSSIAN: [f64; 3] = [1.004, 1.01, 1.1];

pub(super) const TRANSIENT: Study = Study {
    slug: "transient",
    title: "The leading pulse on its way to the stationary one",
    place: "text of section 2",
    runs: || SHOWN.map(long).to_vec(),
    sweep: false,
    draw: draw_transient,
    claims: &[
        Claim {
            id: "transient-amplitude-width",
            place: SECTION,
            quote: "The non-linearity dominated regime corresponds to a transient where the amplitude of the pulse decreases slowly \
                    in time before reaching a constant value, i.e, the solitonic regime. At the same time the width of the pulse \
                    increases also reaching a stationary value.",
            judge: judge_stationarity,
        },
        Claim {
            id: "transient-symmetry",
            place: SECTION,
            quote: "Moreover the shape of the pulse evolves continuously from a non-symmetric one to a symmetric one.",
            judge: judge_symmetry,
        },
        Claim {
            id: "transient-2000-beads",
            place: SECTION,
            quote: "The pulse has actually to propagate over 2000 beads before reaching its solitonic regime predicted by (cos).",
            judge: judge_2000,
        },
        Claim {
            id: "transient-longer",
            place: SECTION,
            quote: "The time of the transient obviously increases as we decrease α (if we take α=1.004 the pulse has to propagate \
                    over 15000 beads before reaching its stationary value).",
            judge: judge_15000,
        },
    ],
};

pub(super) const SELF_SIMILAR: Study = Study {
    slug: "self-similar",
    title: "The leading pulse for α = 1",
    place: "text of section 1",
    runs: || vec![long(1.0)],
    sweep: false,
    draw: draw_linear,
    claims: &[Claim {
        id: "linear-laws",
        place: "section 1, of earlier work",
        quote: "Instead of traveling as a soliton the pulse propagates increasing its width and decreasing its amplitude. It was \
                then showed that the amplitude decreases like t^(−0.17) and the width increases like t^(1/3).",
        judge: judge_linear,
    }],
};

pub(super) const GAUSSIAN_LIMIT: Study = Study {
    slug: "gaussian",
    title: "The stationary pulse and the Gaussian of the limit α → 1",
    place: "text of section 2",
    runs: || GAUSSIAN.map(long).to_vec(),
    sweep: false,
    draw: draw_gaussian,
    claims: &[Claim {
        id: "gaussian-limit",
        place: SECTION,
        quote: "The solution of eq. (eq) is then approximated by a Gaussian for α close to unity.",
        judge: judge_gaussian,
    }],
};

/// Position at which a quantity of the leading pulse comes, for good, within the part `within` of `goal`.
fn settles(fronts: &[Front], of: fn(&Front) -> f64, goal: f64, within: f64) -> Option<f64> {
    let outside = fronts.iter().rposition(|front| (of(front) / goal - 1.0).abs() > within);
    fronts.get(outside.map_or(0, |outside| outside + 1)).map(|front| front.bead)
}

/// A number over the stationary one, which is known with an uncertainty.
fn over_stationary(what: impl Into<String>, ratio: f64, stationary: Uncertain) -> Number {
    Number::new(what, ratio, "").give_or_take(stationary.relative(), FROM_PATH)
}

fn judge_stationarity(seen: &Observations) -> Result<Judgement, StudyError> {
    let mut numbers = Vec::new();
    let mut holds = true;
    for alpha in SHOWN {
        let run = seen.of(&long(alpha))?;
        let v0 = run.manifest.physics.striker.velocity_m_s;
        let (early, end) = (run.front_at(50.0)?, stationary(seen, alpha)?);
        let (amplitude, width) =
            (early.v_max_m_s / v0 / end.amplitude.value, early.fwhm_beads / end.fwhm_beads.value);
        let change = end.amplitude.relative().max(end.fwhm_beads.relative());
        // above 1.03 the pulse settles within a bead or two of the struck end, as near as the lattice lets it
        holds &= amplitude > 1.0 && width < 1.0 && change < 1e-3;
        let what = |quantity: &str| format!("{quantity} at bead 50 over the stationary one, α = {alpha}");
        numbers.push(over_stationary(what("amplitude"), amplitude, end.amplitude));
        numbers.push(over_stationary(what("width"), width, end.fwhm_beads));
        let what =
            format!("relative change of amplitude or width over the last fifth of the path, α = {alpha}");
        numbers.push(Number::new(what, change, ""));
    }
    Ok(Judgement {
        verdict: Verdict::of(holds),
        why: if holds {
            "For every exponent shown the amplitude falls and the width grows to values that no longer change.".to_owned()
        } else {
            "Not for every exponent shown do amplitude and width come to values that no longer change."
                .to_owned()
        },
        numbers,
    })
}

fn judge_symmetry(seen: &Observations) -> Result<Judgement, StudyError> {
    let mut numbers = Vec::new();
    let mut holds = true;
    for alpha in [1.004, 1.01, 1.02] {
        let run = seen.of(&long(alpha))?;
        let asymmetry: Vec<f64> = run.fronts.iter().map(|front| front.asymmetry.abs()).collect();
        let last = run.front_at(0.9 * run.manifest.physics.beads as f64)?;
        let first = run.front_at(100.0)?;
        // rising by no more than what the interpolation between beads is good to
        let monotonic = asymmetry.windows(2).skip(5).all(|pair| pair[1] < pair[0] + 1e-4);
        holds &= monotonic && last.asymmetry.abs() < 0.01 * first.asymmetry.abs();
        for (front, place) in [(first, "bead 100"), (last, "nine tenths of the chain")] {
            let what = format!("asymmetry at {place}, α = {alpha}");
            let number = Number::new(what, front.asymmetry, "");
            numbers.push(number.give_or_take(1e-4, "the interpolation between beads"));
        }
    }
    Ok(Judgement {
        verdict: Verdict::of(holds),
        why: format!(
            "The difference of the half-widths before and behind the crest {} as the pulse goes.",
            if holds {
                "falls steadily, to less than a hundredth of what it was at bead 100,"
            } else {
                "does not fall steadily"
            }
        ),
        numbers,
    })
}

fn judge_2000(seen: &Observations) -> Result<Judgement, StudyError> {
    let run = seen.of(&long(1.01))?;
    let (end, front) = (stationary(seen, 1.01)?, run.front_at(2000.0)?);
    let v0 = run.manifest.physics.striker.velocity_m_s;
    let amplitude = front.v_max_m_s / v0 / end.amplitude.value - 1.0;
    let width = front.fwhm_beads / end.fwhm_beads.value - 1.0;
    let goal = end.amplitude.value * v0;
    let place = |within| settles(&run.fronts, |front| front.v_max_m_s, goal, within).unwrap_or(f64::NAN);
    Ok(Judgement {
        verdict: Verdict::graded(amplitude.abs() < 0.01 && width.abs() < 0.01, amplitude.abs() < 2e-3),
        why: format!(
            "At bead 2000 the amplitude is {:.2} % above and the width {:.2} % below the stationary value; a thousandth is reached at bead \
             {:.0}.",
            100.0 * amplitude,
            -100.0 * width,
            place(1e-3)
        ),
        numbers: vec![
            over_stationary("amplitude at bead 2000 over the stationary one", amplitude + 1.0, end.amplitude),
            over_stationary("width at bead 2000 over the stationary one", width + 1.0, end.fwhm_beads),
            place_of(run, "bead from which the amplitude is within 1 %", place(1e-2)),
            place_of(run, "bead from which the amplitude is within 0.1 %", place(1e-3)),
        ],
    })
}

fn judge_15000(seen: &Observations) -> Result<Judgement, StudyError> {
    let mut numbers = Vec::new();
    let mut places = Vec::new();
    for alpha in SHOWN {
        let run = seen.of(&long(alpha))?;
        let goal = stationary(seen, alpha)?.amplitude.value * run.manifest.physics.striker.velocity_m_s;
        for within in [1e-2, 1e-3] {
            let place = settles(&run.fronts, |front| front.v_max_m_s, goal, within);
            let place =
                place.ok_or_else(|| run.absent(format!("pulse within {within} of its last amplitude")))?;
            let what = format!("bead from which the amplitude is within {} %, α = {alpha}", 100.0 * within);
            numbers.push(place_of(run, what, place));
            places.push(place);
        }
    }
    let thousandth: Vec<f64> = places.iter().skip(1).step_by(2).copied().collect();
    let run = seen.of(&long(SHOWN[0]))?;
    let last = stationary(seen, SHOWN[0])?.amplitude;
    let v0 = run.manifest.physics.striker.velocity_m_s;
    let above = run.front_at(15_000.0)?.v_max_m_s / v0 / last.value - 1.0;
    let what = "amplitude at bead 15000 over the stationary one, α = 1.004";
    numbers.push(over_stationary(what, above + 1.0, last));
    let longer = thousandth.windows(2).all(|pair| pair[0] > pair[1]);
    Ok(Judgement {
        verdict: Verdict::graded(longer, (0.5..=1.0).contains(&(thousandth[0] / 15_000.0))),
        why: format!(
            "A thousandth of the stationary amplitude is reached at beads {} for α = {}; at bead 15000 the amplitude of 1.004 is \
             the stationary one within {:.0e}.",
            thousandth.iter().map(|place| format!("{place:.0}")).collect::<Vec<_>>().join(", "),
            SHOWN.map(|alpha| alpha.to_string()).join(", "),
            above.abs() + last.relative(),
        ),
        numbers,
    })
}

/// A bead that the pulse reaches, as well as frames tell: how far it goes from one to the next.
fn place_of(seen: &Observed, what: impl Into<String>, bead: f64) -> Number {
    let between = seen.fronts.windows(2).map(|pair| pair[1].bead - pair[0].bead).fold(0.0, f64::max);
    Number::new(what, bead, "").give_or_take(between, "the distance between two frames")
}

/// Amplitude and width of the pulse of α = 1 against time, from bead 600 on.
fn linear_laws(seen: &Observations) -> Result<(PowerLaw, PowerLaw), StudyError> {
    let run = seen.of(&long(1.0))?;
    let law = |of: fn(&Front) -> f64| {
        let late = run.fronts.iter().filter(|front| front.bead > 600.0);
        let points: Vec<(f64, f64)> = late.map(|front| (front.time_s, of(front))).collect();
        PowerLaw::fit(&points).ok_or_else(|| run.absent("pulse beyond bead 600"))
    };
    Ok((law(|front| front.v_max_m_s)?, law(|front| front.fwhm_beads)?))
}

fn judge_linear(seen: &Observations) -> Result<Judgement, StudyError> {
    let (amplitude, width) = linear_laws(seen)?;
    let run = seen.of(&long(1.0))?;
    let (half, last) = (run.front_at(2900.0)?, run.front_at(5800.0)?);
    let near = |found: f64, said: f64| (found - said).abs() < 0.01;
    let number = |what: &str, law: &PowerLaw| {
        Number::new(format!("exponent of the {what} over time, from bead 600 to 5800"), law.exponent, "")
            .give_or_take(law.exponent_error, "the scatter of the points about the line")
    };
    Ok(Judgement {
        verdict: Verdict::of(near(amplitude.exponent, -0.17) && near(width.exponent, 1.0 / 3.0)),
        why: format!(
            "The fitted exponents are {:.3} and {:.3}; the half-widths still differ by {:.0} % of their sum at bead 5800.",
            amplitude.exponent,
            width.exponent,
            100.0 * last.asymmetry.abs()
        ),
        numbers: vec![
            number("amplitude", &amplitude),
            number("width", &width),
            Number::new("asymmetry of the half-widths at bead 5800", last.asymmetry, "")
                .give_or_take(last.asymmetry - half.asymmetry, "the change since half way"),
        ],
    })
}

/// The pulse in a kept frame, relative to its crest: (beads from it, `v/v_max`).
fn profile(seen: &Observed, kept: &KeptFrame) -> Result<Vec<(f64, f64)>, StudyError> {
    let frame = Frame {
        frame: 0,
        step: 0,
        time_s: kept.time_s,
        u_m: &kept.u_m,
        v_m_s: &kept.v_m_s,
        extra: &[],
        active: None,
    };
    let front = Front::in_space(&frame).ok_or_else(|| seen.absent("leading pulse"))?;
    let points = kept.v_m_s.iter().enumerate();
    let points = points.map(|(bead, v)| (bead as f64 - front.bead, v / front.v_max_m_s));
    Ok(points.filter(|(xi, _)| xi.abs() < 1.5 * front.fwhm_beads).collect())
}

fn judge_gaussian(seen: &Observations) -> Result<Judgement, StudyError> {
    let mut distances = Vec::new();
    for alpha in GAUSSIAN {
        let run = seen.of(&long(alpha))?;
        let gaussian = GaussianLimit::new(alpha)?;
        let profile = profile(run, run.kept_frame(0)?)?;
        let distance = profile.iter().map(|(xi, v)| (v - gaussian.overlap(*xi)).abs());
        distances.push(distance.fold(0.0, f64::max));
    }
    let numbers = GAUSSIAN.iter().zip(&distances).map(|(alpha, distance)| {
        Number::new(format!("largest distance between v/v_max and the Gaussian, α = {alpha}"), *distance, "")
            .give_or_take(1e-3 * distance, "the interpolation of the crest between beads")
    });
    let falls = distances.windows(2).all(|pair| pair[0] < pair[1]);
    Ok(Judgement {
        verdict: Verdict::of(falls && distances[1] < 0.02),
        why: format!(
            "The distance to the Gaussian is {:.2} % of v_max at α = 1.01 and {:.2} % at 1.004; at 1.1 it is {:.1} %.",
            100.0 * distances[1],
            100.0 * distances[0],
            100.0 * distances[2]
        ),
        numbers: numbers.collect(),
    })
}

fn draw_transient(seen: &Observations) -> Result<Figure, StudyError> {
    let x = || Axis::new("bead that the pulse has reached").log().limits(20.0, 16_000.0);
    let mut amplitude = Panel::new().x_axis(x()).y_axis(Axis::new("v_{max}/v_{0}").log().limits(0.19, 0.6));
    let mut width = Panel::new().x_axis(x()).y_axis(Axis::new("width (beads)").log().limits(2.5, 20.0));
    let mut asymmetry = Panel::new().x_axis(x()).y_axis("asymmetry");
    for alpha in SHOWN {
        let run = seen.of(&long(alpha))?;
        let v0 = run.manifest.physics.striker.velocity_m_s;
        let curve = |of: &dyn Fn(&Front) -> f64| -> Vec<(f64, f64)> {
            run.fronts.iter().map(|front| (front.bead, of(front))).collect()
        };
        amplitude = amplitude.line(format!("α = {alpha}"), curve(&|front| front.v_max_m_s / v0));
        width = width.line("", curve(&|front| front.fwhm_beads));
        asymmetry = asymmetry.line("", curve(&|front| front.asymmetry));
    }
    amplitude = amplitude.vertical("15000 beads", 15_000.0);
    let caption = "The leading pulse in chains of equal beads: m = 1 g, k = 10^{7} N m^{−α}, v_{0} = 5 m/s. Width: full, at half \
                   maximum. Asymmetry: (rear − front)/(rear + front) of the half-widths.";
    Ok(Figure::new()
        .shared_x()
        .caption(caption)
        .panel(amplitude)
        .panel(width.vertical("", 15_000.0))
        .panel(asymmetry.vertical("", 15_000.0).height(0.8)))
}

fn draw_linear(seen: &Observations) -> Result<Figure, StudyError> {
    let (amplitude, width) = linear_laws(seen)?;
    let run = seen.of(&long(1.0))?;
    let panel = |label: &str, of: fn(&Front) -> f64, law: &PowerLaw, power: &str| {
        let points = run.fronts.iter().map(|front| (front.time_s * 1e3, of(front)));
        let line = run.fronts.iter().map(|front| (front.time_s * 1e3, law.at(front.time_s)));
        Panel::new()
            .x_axis(Axis::new("time (ms)").log())
            .y_axis(Axis::new(label).log())
            .curve(Curve::line("α = 1", points).colour(Colour::Blue))
            .curve(
                Curve::line(format!("fit, exponent {power}"), line)
                    .colour(Colour::Black)
                    .stroke(Stroke::Dashed),
            )
    };
    let power = |law: &PowerLaw| format!("{:.3}", law.exponent).replace('-', "−");
    Ok(Figure::new()
        .shared_x()
        .caption(plots::caption(&run.manifest))
        .panel(panel("v_{max} (m/s)", |front| front.v_max_m_s, &amplitude, &power(&amplitude)))
        .panel(panel("width (beads)", |front| front.fwhm_beads, &width, &power(&width))))
}

fn draw_gaussian(seen: &Observations) -> Result<Figure, StudyError> {
    let x = Axis::new("distance from the crest (beads)").limits(-25.0, 25.0);
    let mut panel = Panel::new().x_axis(x).y_axis("v/v_{max}");
    for alpha in GAUSSIAN {
        let run = seen.of(&long(alpha))?;
        panel = panel.points(format!("α = {alpha}"), profile(run, run.kept_frame(0)?)?);
    }
    for (label, alpha) in ["Gaussian limit", "", ""].into_iter().zip(GAUSSIAN) {
        let gaussian = GaussianLimit::new(alpha)?;
        let places = (-300..=300).map(|tenth| 0.1 * f64::from(tenth));
        let limit = places.map(|xi| (xi, gaussian.overlap(xi)));
        panel = panel.curve(Curve::line(label, limit).colour(Colour::Black));
    }
    Ok(Figure::new().caption("Stationary velocity pulses in chains of equal beads.").panel(panel))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quantity_settles_where_it_stays() {
        let front = |bead: f64, v_max_m_s: f64| Front {
            time_s: 0.0,
            bead,
            v_max_m_s,
            fwhm_beads: 1.0,
            asymmetry: 0.0,
        };
        let fronts = [front(1.0, 1.001), front(2.0, 1.5), front(3.0, 1.05), front(4.0, 1.001)];
        let place = |within| settles(&fronts, |front| front.v_max_m_s, 1.0, within);
        assert_eq!((place(0.1), place(0.01), place(1.0)), (Some(3.0), Some(4.0), Some(1.0)));
        assert_eq!(place(1e-4), None);
    }
}
