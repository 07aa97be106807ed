//! Other masses and other exponents than those of the paper's figures.

use super::judgement::{Counted, Judgement, Number, StudyError, Verdict};
use super::observe::Observations;
use super::passing::{count_past, counted, falls, with_partners};
use super::rattle::flights;
use super::runs::{Run, short};
use super::study::{Claim, Study};
use figure::{Axis, Figure, Panel};

const SECTION: &str = "section 3";
/// Masses (g) and exponents of light and of heavy impurities.
const LIGHT: [(f64, f64); 5] = [(0.3, 1.5), (0.6, 1.2), (0.6, 1.5), (0.6, 3.0), (0.8, 1.5)];
const HEAVY: [(f64, f64); 5] = [(3.0, 1.5), (5.0, 1.5), (10.0, 1.2), (10.0, 1.5), (10.0, 3.0)];

pub(super) const OTHERS: Study = Study {
    slug: "other-parameters",
    title: "Impurities of other masses, and other exponents",
    place: "text of section 3",
    runs,
    sweep: false,
    draw,
    claims: &[
        Claim {
            id: "light-same-behaviour",
            place: SECTION,
            quote: "Although we chose special values for the impurity mass and the interaction law exponent the same behavior is observed \
                    if we maintain the impurity mass lower than the chain masses and the interaction exponent greater than one.",
            judge: judge_light,
        },
        Claim {
            id: "heavy-same-pattern",
            place: SECTION,
            quote: "As in the previous case, although we took 10g for the impurity mass and 1.5 for the interaction exponent the obtained \
                    pattern remains unchanged as these two parameters are tuned.",
            judge: judge_heavy,
        },
        Claim {
            id: "heavy-number-grows",
            place: SECTION,
            quote: "The number of fragmented pulses actually increases with the mass of the impurity.",
            judge: judge_number,
        },
    ],
};

/// Bead at which transmitted pulses are counted.
const BEAD: u64 = 225;

fn runs() -> Vec<Run> {
    LIGHT.iter().chain(&HEAVY).flat_map(|(mass_g, alpha)| with_partners(short(*mass_g, *alpha))).collect()
}

fn judge_light(seen: &Observations) -> Result<Judgement, StudyError> {
    let mut numbers = Vec::new();
    let (mut damped, mut steadily) = (0, 0);
    for (mass_g, alpha) in LIGHT {
        let run = short(mass_g, alpha);
        let found = flights(seen.of(&run)?);
        let speeds: Vec<f64> = found.iter().map(|flight| flight.v_m_s).collect();
        let (Some(first), Some(last)) = (speeds.first(), speeds.last()) else { continue };
        let to_and_fro = speeds.len() > 2 && speeds.windows(2).all(|pair| pair[0] * pair[1] < 0.0);
        damped += usize::from(to_and_fro && last.abs() < 0.5 * first.abs());
        steadily += usize::from(to_and_fro && falls(&speeds));
        let what = |quantity: &str| format!("{quantity}, {mass_g} g, α = {alpha}");
        let count = counted(seen, run.clone(), |seen| Ok(flights(seen).len()))?;
        numbers.push(Number::count(what("flights to and fro by the end of the run"), &count));
        let what = what("speed in the last over that in the first");
        numbers.push(seen.stepped(&run, what, "", |seen| {
            let found = flights(seen);
            let ends = found.last().zip(found.first());
            Ok(ends.map_or(f64::NAN, |(last, first)| (last.v_m_s / first.v_m_s).abs()))
        })?);
    }
    let all = LIGHT.len();
    Ok(Judgement {
        verdict: Verdict::graded(damped == all, steadily == all),
        why: format!(
            "From 0.3 to 0.8 g and α from 1.2 to 3 it flies to and fro and loses more than half of its speed in {damped} of {all} cases; that \
             every flight is slower than the one before is so in {steadily}."
        ),
        numbers,
    })
}

fn judge_heavy(seen: &Observations) -> Result<Judgement, StudyError> {
    let mut numbers = Vec::new();
    let mut same = 0;
    for (mass_g, alpha) in HEAVY {
        let train = seen.of(&short(mass_g, alpha))?.pulses_past(BEAD, true);
        let train: Vec<f64> = train.iter().map(|pulse| pulse.v_peak_m_s).collect();
        let count = count_past(seen, short(mass_g, alpha), BEAD, true)?;
        let reflected = count_past(seen, short(mass_g, alpha), 75, false)?;
        same += u32::from(count.least > 1 && falls(&train) && reflected.least > 0);
        numbers
            .push(Number::count(format!("forward pulses past bead {BEAD}, {mass_g} g, α = {alpha}"), &count));
    }
    let all = HEAVY.len();
    Ok(Judgement {
        verdict: Verdict::graded(same > 1, same as usize == all),
        why: format!(
            "A train of falling amplitudes goes on and a pulse comes back in {same} of {all} cases from 3 to 10 g and α from 1.2 to 3."
        ),
        numbers,
    })
}

fn judge_number(seen: &Observations) -> Result<Judgement, StudyError> {
    let mut counts = Vec::new();
    let mut numbers = Vec::new();
    for mass_g in [3.0, 5.0, 10.0] {
        let count = count_past(seen, short(mass_g, 1.5), BEAD, true)?;
        numbers.push(Number::count(format!("forward pulses past bead {BEAD}, {mass_g} g, α = 1.5"), &count));
        counts.push(count);
    }
    let (grow, grow_in_all) = Counted::grow(&counts);
    Ok(Judgement {
        verdict: Verdict::graded(grow, grow_in_all),
        why: format!(
            "By the same time {} pulses above 5 mm/s have passed bead {BEAD} behind impurities of 3, 5 and 10 g.",
            counts.iter().map(Counted::to_string).collect::<Vec<_>>().join(", ")
        ),
        numbers,
    })
}

fn draw(seen: &Observations) -> Result<Figure, StudyError> {
    let panel = |cases: &[(f64, f64)], column: usize, label: &str| -> Result<Panel, StudyError> {
        let mut panel = Panel::new().x_axis(Axis::new("t/T").limits(150.0, 400.0)).y_axis(label);
        for (mass_g, alpha) in cases {
            let run = seen.of(&short(*mass_g, *alpha))?;
            let scales = run.manifest.physics.scales();
            let unit = if column == 0 { scales.length_m } else { run.manifest.physics.striker.velocity_m_s };
            let points = run.motion.curve(column).map(|(t, value)| (t / scales.time_s, value / unit));
            panel = panel.line(format!("{mass_g} g, α = {alpha}"), points);
        }
        Ok(panel)
    };
    let caption =
        "An impurity at bead 150 of 300 beads of 1 g; L and T are the scales of a collision of two of them.";
    Ok(Figure::new().caption(caption).panel(panel(&LIGHT, 0, "displacement/L")?).panel(panel(
        &HEAVY,
        1,
        "velocity/v_{0}",
    )?))
}
