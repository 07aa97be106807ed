//! The deformation of a contact while the pulse passes, beside the theory of the continuum.

mod measures;

use super::judgement::{Judgement, Number, StudyError, Verdict};
use super::observe::Observations;
use super::passing::both_steps;
use super::runs::{Run, homogeneous, homogeneous_long};
use super::study::{Claim, Study};
use consumers::deformation::{Comparison, Sample, Shape};
use consumers::theory::ContinuumWave;
use consumers::uncertain::Uncertain;
use figure::Figure;
pub(super) use measures::against_reference;
use measures::{TAIL, continuum, deformation, from_triangle, handed_on, largest_error, longer, norms, shape};
use std::f64::consts::FRAC_PI_2;

const SECTION: &str = "section 2";
const CONCLUSION: &str = "section 4";
/// Two curves superimpose if they differ by no more than this part of the peak.
const SUPERIMPOSE: f64 = 0.05;

/// A study of the deformation at one exponent.
macro_rules! study {
    ($name:ident, $alpha:literal, $slug:literal, $title:literal, $place:literal, $claims:expr) => {
        pub(super) const $name: Study = Study {
            slug: $slug,
            title: $title,
            place: $place,
            runs: || both($alpha),
            sweep: false,
            draw: |seen| draw(seen, &homogeneous($alpha)),
            claims: $claims,
        };
    };
}

study!(
    AT_1_2,
    1.2,
    "deformation-1.2",
    "Deformation of contact 100 of 200 beads, α = 1.2",
    "figure cos1.2",
    &[
        Claim {
            id: "deformation-1.2-superimposes",
            place: "figure cos1.2",
            quote: "There is very good agreement between numerical and theoretical results. The crossed curve from the analytical \
                    result eq. (cos) superimposes the plain line curve from the numerical simulation.",
            judge: judge_1_2,
        },
        Claim {
            id: "one-lobe",
            place: SECTION,
            quote: "This periodic wave solution is singular since it violates the condition −u_x>0 in eq. (cond). We actually get \
                    the shock wave solution by imposing the argument of the cosines to vary in the interval [−π/2(2k+1), \
                    π/2(2k+1)], k ∈ Z.",
            judge: judge_lobe,
        },
    ]
);

study!(
    AT_1_5,
    1.5,
    "deformation-1.5",
    "Deformation of contact 100 of 200 beads, α = 1.5",
    "figure cos1.5",
    &[
        Claim {
            id: "deformation-1.5-tails",
            place: "figure cos1.5",
            quote: "Discrepancies between numerical and theoretical results appear at the curves tails. The crossed tails of the \
                    analytical result remain below the real tails of the numerical simulation.",
            judge: judge_1_5,
        },
        Claim {
            id: "tails-much-longer",
            place: SECTION,
            quote: "Actually, the tails of the deformations curves are much longer than the ones given by equation (cos).",
            judge: judge_tails,
        },
        Claim {
            id: "stiffness-unit",
            place: SECTION,
            quote: "We choose beads of mass m=1g and stiffness k=10^7 N.m^−1.",
            judge: judge_unit,
        },
    ]
);

study!(
    AT_1_7,
    1.7,
    "deformation-1.7",
    "Deformation of contact 100 of 200 beads, α = 1.7",
    "figure cos1.7",
    &[
        Claim {
            id: "deformation-1.7-deviates-more",
            place: "figure cos1.7",
            quote: "The increase in α increases the deviation of the curves at the tails.",
            judge: judge_1_7,
        },
        Claim {
            id: "tails-separate",
            place: CONCLUSION,
            quote: "As α increases beyond 1.2 tails in the deformation curves separate.",
            judge: judge_1_7,
        },
        Claim {
            id: "good-for-low-alpha",
            place: SECTION,
            quote: "One easily sees on these curves that the analytical results are rather good for low values of α (α>1) showing \
                    discrepancies when α is increased.",
            judge: judge_low_alpha,
        },
        Claim {
            id: "unreliable-at-1.7",
            place: CONCLUSION,
            quote: "When α reaches the value of 1.7 the analytical result given for the deformation curve is already not reliable.",
            judge: judge_unreliable,
        },
    ]
);

study!(
    AT_10,
    10.0,
    "deformation-10",
    "Deformation of contact 100 of 200 beads, α = 10",
    "figure cos10",
    &[
        Claim {
            id: "deformation-10-triangle",
            place: "figure cos10",
            quote: "There is no agreement between analytical and numerical results. The true deformation has a triangular shape …",
            judge: judge_triangle,
        },
        Claim {
            id: "deformation-10-parabola",
            place: "figure cos10",
            quote: "… while the analytical curve display a periodic parabola shape.",
            judge: judge_parabola,
        },
    ]
);

study!(
    AT_1_01,
    1.01,
    "deformation-1.01",
    "Deformation of contact 100 of 200 beads, α = 1.01",
    "figure cos1.01",
    &[Claim {
        id: "deformation-1.01-asymmetric",
        place: "figure cos1.01",
        quote: "The pulse is not symmetric. We are in the non-linearity dominated regime.",
        judge: judge_asymmetric,
    }]
);

pub(super) const AT_1_01_LONG: Study = Study {
    slug: "deformation-1.01-2000",
    title: "Deformation of contact 2000 of 3000 beads, α = 1.01",
    place: "figure cos1.01.b",
    runs: || both_steps(homogeneous_long()),
    sweep: false,
    draw: |seen| draw(seen, &homogeneous_long()),
    claims: &[Claim {
        id: "deformation-1.01-stationary",
        place: "figure cos1.01.b",
        quote: "The pulse reached its stationary soliton shape given by eq. (cos) and the numerical and analytical curves superimpose.",
        judge: judge_stationary,
    }],
};

/// The exponents at contact 100 of the paper's figures, in their order.
pub(super) const ALPHAS: [f64; 5] = [1.2, 1.5, 1.7, 10.0, 1.01];

fn both(alpha: f64) -> Vec<Run> {
    let compared: &[f64] = if alpha == 1.7 { &[1.2, 1.5, 1.7] } else { &[alpha] };
    let runs = compared.iter().map(|alpha| homogeneous(*alpha));
    runs.flat_map(|run| [run.clone().with_step_times(2), run]).collect()
}

fn judge_1_2(seen: &Observations) -> Result<Judgement, StudyError> {
    let mut numbers = norms(seen, 1.2)?;
    let largest = numbers[0].value;
    numbers.extend(against_reference(seen, 1.2)?);
    Ok(Judgement {
        verdict: Verdict::of(largest < SUPERIMPOSE),
        why: format!("The curves differ by at most {:.1} % of the peak.", 100.0 * largest),
        numbers,
    })
}

fn judge_lobe(seen: &Observations) -> Result<Judgement, StudyError> {
    // eq. (cos) without its condition on the argument: each lobe has the same impulse
    let lobes = |k: f64| {
        let what = format!("impulse of eq. (cos) for k = {k} over the measured one");
        seen.stepped(&homogeneous(1.2), what, "", |seen| {
            Ok((2.0 * k + 1.0) * continuum(seen)?.impulse_n_s / shape(seen)?.impulse_n_s)
        })
    };
    let least = (0..=1000).map(|i| (FRAC_PI_2 * 0.006 * f64::from(i)).cos().abs().powf(2.0 / 0.2));
    let least = least.fold(f64::INFINITY, f64::min);
    let (one, three) = (lobes(0.0)?, lobes(1.0)?);
    let near = |ratio: &Number| (ratio.value - 1.0).abs() < SUPERIMPOSE;
    Ok(Judgement {
        verdict: Verdict::graded(near(&one), near(&three) && least < 0.0),
        why: format!(
            "The argument must stay within one lobe, k = 0: its impulse is {:.3} of the measured one, that of k = 1 {:.2}; and −u_x does not \
             change sign at the nodes, it touches 0.",
            one.value, three.value
        ),
        numbers: vec![one, three, Number::new("least value of the shape over three lobes", least, "")],
    })
}

fn judge_1_5(seen: &Observations) -> Result<Judgement, StudyError> {
    let run = seen.of(&homogeneous(1.5))?;
    let (found, theory, shape) = (deformation(run)?, continuum(run)?, shape(run)?);
    // a tail begins where the theory falls below the simulation for good
    let outside = |sample: &&Sample| theory.overlap_m(sample.time_s) < 0.02 * shape.overlap_m;
    let above = |sample: &&Sample| sample.overlap_m > TAIL * shape.overlap_m;
    let tail: Vec<_> = found.samples.iter().filter(outside).filter(above).collect();
    let below = tail.iter().all(|sample| theory.overlap_m(sample.time_s) < sample.overlap_m);
    let mut numbers = vec![longer(seen, 1.5)?];
    let by = 100.0 * (numbers[0].value - 1.0);
    numbers.extend(norms(seen, 1.5)?);
    numbers.extend(against_reference(seen, 1.5)?);
    Ok(Judgement {
        verdict: Verdict::of(below && !tail.is_empty()),
        why: format!(
            "In the tails, where eq. (cos) is below 2 % of the peak, it is {} the simulation; at a thousandth of the peak the pulse is {:.0} % \
             longer.",
            if below { "everywhere below" } else { "not everywhere below" },
            by
        ),
        numbers,
    })
}

fn judge_tails(seen: &Observations) -> Result<Judgement, StudyError> {
    /// "Much longer" is taken to be half as long again.
    const MUCH: f64 = 1.5;
    let longer = longer(seen, 1.5)?;
    let ratio = longer.value;
    Ok(Judgement {
        verdict: Verdict::graded(ratio > 1.0, ratio > MUCH),
        why: format!(
            "They are {}: at a thousandth of the peak, by {:.0} % at α = 1.5; the exact wave fades doubly exponentially.",
            match ratio {
                much if much > MUCH => "much longer",
                some if some > 1.0 => "longer, but not much",
                _ => "not longer",
            },
            100.0 * (ratio - 1.0)
        ),
        numbers: vec![longer],
    })
}

fn judge_unit(seen: &Observations) -> Result<Judgement, StudyError> {
    let run = homogeneous(1.5);
    let what = "∫k·δ^1.5 dt over the momentum behind contact 100";
    let power = seen.stepped(&run, what, "", |seen| Ok(handed_on(seen)?.0))?;
    // newtons, if k is what is written in the paper: a force proportional to the overlap
    let linear = seen.stepped(&run, "∫k·δ dt over the same", "", |seen| Ok(handed_on(seen)?.1))?;
    let near = |ratio: &Number| (ratio.value - 1.0).abs() < 1e-3;
    Ok(Judgement {
        verdict: Verdict::graded(near(&power), near(&linear)),
        why: format!(
            "k is in N·m^−α: ∫k·δ^α dt is {:.5} of the momentum handed on; a stiffness of 10^7 N·m^−1 would have handed on {:.0} times as \
             much.",
            power.value, linear.value
        ),
        numbers: vec![power, linear],
    })
}

fn judge_1_7(seen: &Observations) -> Result<Judgement, StudyError> {
    let mut numbers = vec![longer(seen, 1.2)?, longer(seen, 1.5)?, longer(seen, 1.7)?];
    let ratios: Vec<f64> = numbers.iter().map(|number| number.value).collect();
    numbers.extend(against_reference(seen, 1.7)?);
    Ok(Judgement {
        verdict: Verdict::of(ratios.windows(2).all(|pair| pair[0] < pair[1])),
        why: format!(
            "At a thousandth of the peak the pulse is {:.0}, {:.0} and {:.0} % longer than eq. (cos) for α = 1.2, 1.5 and 1.7.",
            100.0 * (ratios[0] - 1.0),
            100.0 * (ratios[1] - 1.0),
            100.0 * (ratios[2] - 1.0)
        ),
        numbers,
    })
}

fn judge_low_alpha(seen: &Observations) -> Result<Judgement, StudyError> {
    let mut numbers = Vec::new();
    let mut largest = Vec::new();
    for alpha in [1.2, 1.5, 1.7] {
        let norms = norms(seen, alpha)?;
        largest.push(norms[0].value);
        numbers.extend(norms);
    }
    let grows = largest.windows(2).all(|pair| pair[0] < pair[1]);
    Ok(Judgement {
        verdict: Verdict::graded(grows, largest[0] < SUPERIMPOSE),
        why: format!(
            "The largest error of eq. (cos) is {:.1}, {:.1} and {:.1} % of the peak for α = 1.2, 1.5 and 1.7.",
            100.0 * largest[0],
            100.0 * largest[1],
            100.0 * largest[2]
        ),
        numbers,
    })
}

fn judge_unreliable(seen: &Observations) -> Result<Judgement, StudyError> {
    let what = "width of eq. (cos) over the measured one, α = 1.7";
    let width = seen
        .stepped(&homogeneous(1.7), what, "", |seen| Ok(continuum(seen)?.width_s / shape(seen)?.width_s))?;
    let error = largest_error(seen, 1.7)?;
    Ok(Judgement {
        verdict: Verdict::graded(error.value > 0.02, error.value > SUPERIMPOSE),
        why: format!(
            "At α = 1.7 eq. (cos) is off by {:.1} % of the peak, and its width by {:.1} %.",
            100.0 * error.value,
            100.0 * (width.value - 1.0)
        ),
        numbers: vec![error, width],
    })
}

fn judge_triangle(seen: &Observations) -> Result<Judgement, StudyError> {
    let what = "largest distance from a triangle of the same height and width";
    let triangle = seen.stepped(&homogeneous(10.0), what, "", from_triangle)?;
    let error = largest_error(seen, 10.0)?;
    let (from_triangle, from_theory) = (triangle.value, error.value);
    let mut numbers = vec![triangle, error];
    numbers.extend(against_reference(seen, 10.0)?);
    Ok(Judgement {
        // at a finite exponent the corners are rounded
        verdict: Verdict::graded(from_triangle < 0.5 * from_theory, from_triangle < 0.1),
        why: format!(
            "The pulse differs from a triangle by at most {:.1} % of its peak, from eq. (cos) by {:.0} %.",
            100.0 * from_triangle,
            100.0 * from_theory
        ),
        numbers,
    })
}

fn judge_parabola(_: &Observations) -> Result<Judgement, StudyError> {
    let wave = ContinuumWave::new(10.0)?;
    let half = wave.half_length_beads();
    let distance = |i: u32| {
        let part = f64::from(i) / 1000.0;
        (wave.overlap(part * half) - (1.0 - part * part)).abs()
    };
    let largest = (0..=1000).map(distance).fold(0.0, f64::max);
    Ok(Judgement {
        verdict: Verdict::graded(wave.overlap(0.5 * half) > 0.75, largest < SUPERIMPOSE),
        why: format!(
            "|cos|^(2/9) has round arches, but blunter ones than parabolas: it differs from the parabola of the same height and base by up to \
             {:.0} % of the height.",
            100.0 * largest
        ),
        numbers: vec![Number::new("largest distance between |cos|^(2/9) and a parabola", largest, "")],
    })
}

fn judge_asymmetric(seen: &Observations) -> Result<Judgement, StudyError> {
    let what = "asymmetry of the half-widths, bead 100";
    let asymmetry = seen.stepped(&homogeneous(1.01), what, "", |seen| Ok(shape(seen)?.asymmetry))?;
    let part = asymmetry.value.abs();
    let mut numbers = vec![asymmetry];
    numbers.extend(norms(seen, 1.01)?);
    numbers.extend(against_reference(seen, 1.01)?);
    Ok(Judgement {
        verdict: Verdict::of(part > 0.02),
        why: format!(
            "The half-widths after and before the peak differ by {:.1} % of their sum.",
            100.0 * part
        ),
        numbers,
    })
}

fn judge_stationary(seen: &Observations) -> Result<Judgement, StudyError> {
    let number = |what: &str, of: fn(&Shape, &Comparison) -> f64| -> Result<Number, StudyError> {
        seen.stepped(&homogeneous_long(), what, "", |seen| Ok(of(&shape(seen)?, continuum(seen)?)))
    };
    let asymmetry = number("asymmetry of the half-widths, contact 2000", |shape, _| shape.asymmetry)?;
    let error = number("largest error of eq. (cos)", |_, theory| theory.l_infinity)?;
    let why = format!(
        "At contact 2000 the half-widths differ by {} % of their sum, and eq. (cos) is off by at most {} % of the peak.",
        Uncertain::new(asymmetry.value.abs(), asymmetry.relative_uncertainty() * asymmetry.value) / 0.01,
        Uncertain::new(error.value, error.relative_uncertainty() * error.value) / 0.01
    );
    Ok(Judgement {
        verdict: Verdict::of(asymmetry.value.abs() < 0.005 && error.value < SUPERIMPOSE),
        why,
        numbers: vec![
            asymmetry,
            error,
            number("root-mean-square error of eq. (cos) over the width", |_, theory| theory.l2)?,
            number("full width at half maximum over that of eq. (cos)", |shape, theory| {
                shape.width_s / theory.width_s
            })?,
        ],
    })
}

fn draw(seen: &Observations, run: &Run) -> Result<Figure, StudyError> {
    let seen = seen.of(run)?;
    Ok(plots::deformations(&seen.manifest, std::slice::from_ref(deformation(seen)?)))
}
