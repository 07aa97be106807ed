//! A heavy first bead: one shock becomes a train.

use super::judgement::{Counted, Judgement, Number, StudyError, Verdict, pool_uncertainty};
use super::observe::Observations;
use super::passing::{count_past, falls, heights, pulses, with_partners};
use super::profile::{caption, chain_panel};
use super::runs::{striker, striker_long};
use super::study::{Claim, Study};
use figure::Figure;

const SECTION: &str = "section 3";
/// The masses (g) of the first bead over which pulses are counted.
const MASSES_G: [f64; 5] = [1.0, 2.0, 3.0, 5.0, 10.0];
/// Bead at which they are counted.
const BEAD: u64 = 450;

pub(super) const THREE_GRAMS: Study = Study {
    slug: "striker-3g",
    title: "Velocities behind a first bead of 3 g",
    place: "figure exp1",
    runs: || {
        [vec![striker(3.0)], with_partners(striker_long(1.0)), with_partners(striker_long(3.0))].concat()
    },
    sweep: false,
    draw: |seen| draw(seen, 3.0),
    claims: &[
        Claim {
            id: "striker-3g-train",
            place: "figure exp1",
            quote: "Instead of having a single soliton as it is the case for a homogeneous chain many pulses of decreasing \
                    amplitudes are propagating.",
            judge: judge_train,
        },
        Claim {
            id: "striker-1g-single",
            place: SECTION,
            quote: "In the case of a bead having the same mass we know that the perturbation of the first bead by giving it a \
                    finite velocity at zero time will produce a single pulse.",
            judge: judge_single,
        },
    ],
};

pub(super) const TEN_GRAMS: Study = Study {
    slug: "striker-10g",
    title: "Velocities behind a first bead of 10 g",
    place: "figure exp2",
    runs: || {
        let long = MASSES_G.into_iter().flat_map(|mass_g| with_partners(striker_long(mass_g)));
        std::iter::once(striker(10.0)).chain(long).collect()
    },
    sweep: false,
    draw: |seen| draw(seen, 10.0),
    claims: &[Claim {
        id: "striker-number-grows",
        place: "section 3 and figure exp2",
        quote: "As the mass of the first bead is increased the number of emitted pulses grows.",
        judge: judge_numbers,
    }],
};

/// Number of pulses that pass bead 450 behind a first bead of `mass_g`.
fn emitted(seen: &Observations, mass_g: f64) -> Result<Counted, StudyError> {
    count_past(seen, striker_long(mass_g), BEAD, true)
}

fn judge_train(seen: &Observations) -> Result<Judgement, StudyError> {
    /// Pulses whose amplitudes are told.
    const TOLD: usize = 6;
    let count = emitted(seen, 3.0)?;
    let all = pulses(seen, &striker_long(3.0), BEAD, true, count.least)?;
    let falls = falls(&heights(&all));
    let told = all.iter().take(TOLD).enumerate();
    let told = told.map(|(index, pulse)| pulse.amplitude(format!("pulse {}: peak velocity", index + 1)));
    let mut numbers: Vec<Number> = told.collect();
    pool_uncertainty(&mut numbers);
    numbers.push(Number::count(format!("pulses above 5 mm/s past bead {BEAD}"), &count));
    Ok(Judgement {
        verdict: Verdict::of(count.least > 1 && falls),
        why: format!(
            "{count} pulses pass bead {BEAD} of a longer chain within 120 ms, {} weaker than the one before.",
            if falls { "each" } else { "not all" }
        ),
        numbers,
    })
}

fn judge_single(seen: &Observations) -> Result<Judgement, StudyError> {
    let count = emitted(seen, 1.0)?;
    Ok(Judgement {
        verdict: Verdict::of(count.least == 1 && count.most == 1),
        why: format!("{count} pulse above 5 mm/s passes bead {BEAD} within 120 ms."),
        numbers: vec![Number::count("pulses", &count)],
    })
}

fn judge_numbers(seen: &Observations) -> Result<Judgement, StudyError> {
    let counts = MASSES_G.into_iter().map(|mass_g| emitted(seen, mass_g));
    let counts = counts.collect::<Result<Vec<_>, _>>()?;
    let numbers = counts.iter().zip(MASSES_G).map(|(count, mass_g)| {
        let what = format!("pulses above 5 mm/s past bead {BEAD}, first bead of {mass_g} g");
        Number::count(what, count)
    });
    let numbers = numbers.collect();
    let (grow, grow_in_all) = Counted::grow(&counts);
    Ok(Judgement {
        verdict: Verdict::graded(grow, grow_in_all),
        why: format!(
            "Within 120 ms {} pulses pass bead {BEAD} for first beads of {} g{}.",
            counts.iter().map(Counted::to_string).collect::<Vec<_>>().join(", "),
            MASSES_G.map(|mass_g| mass_g.to_string()).join(", "),
            if grow_in_all { "" } else { "; counts whose ranges overlap are not told apart" }
        ),
        numbers,
    })
}

fn draw(seen: &Observations, mass_g: f64) -> Result<Figure, StudyError> {
    let seen = seen.of(&striker(mass_g))?;
    let kept = seen.kept_frame(0)?;
    let panel = chain_panel(seen, kept.v_m_s.iter().copied()).y_axis("velocity (m/s)");
    Ok(Figure::new().caption(caption(seen, kept)).panel(panel))
}
