//! The energy figures: how much comes back, how much goes on.

mod figures;

use super::crossing::crossings;
use super::judgement::{Judgement, Number, StudyError, Verdict};
use super::observe::Observations;
use super::passing::both_steps;
use super::reference::REFLECTED;
use super::reflection::{
    ALPHAS, BEAD_G, MASSES_G, Reflected, corrected_over_total, differences, is_shown, over_total, points_of,
};
use super::runs::light;
use super::study::{Claim, Study};
use consumers::impurity::EventKind;
use consumers::uncertain::Uncertain;
use figures::{draw_corrected, draw_pulse, draw_total, draw_transmitted};
use std::collections::BTreeSet;

const SECTION: &str = "section 3";
/// Error of the reference.
const GOOD_TO: f64 = 3e-5;
const FROM_WINDOW: &str =
    "what may still cross the impurity, the change over the last 50 to 100 T, and the error of the step";
const FROM_GRID: &str = "half the distance between the masses where the order is certain";

pub(super) const TOTAL: Study = Study {
    slug: "reflected-total",
    title: "Reflected over total energy",
    place: "figure er.e",
    runs: || both_steps(light()),
    draw: draw_total,
    claims: &[
        Claim {
            id: "reflected-mass-difference",
            place: SECTION,
            quote: "One easily sees that the amount of reflected energy increases as the mass difference increases.",
            judge: judge_mass,
        },
        Claim {
            id: "reflected-grows-with-alpha",
            place: SECTION,
            quote: "This amount also increases with α if the the impurity mass is greater than a value located between 1.5g and 2g.",
            judge: judge_alpha,
        },
        Claim {
            id: "reflected-crossings",
            place: SECTION,
            quote: "Below this value the curves cross each others at different values of the impurity mass.",
            judge: judge_crossings,
        },
        Claim {
            id: "reflected-below-crossing",
            place: SECTION,
            quote: "Below the crossing it is the lowest value of the two exponents which gives the greater amount of reflected energy.",
            judge: judge_below,
        },
        Claim {
            id: "reflected-wait",
            place: SECTION,
            quote: "This energy is not stationary immediately after wave reflection and we have to wait the time for it to reach a \
                    stationary value.",
            judge: judge_wait,
        },
    ],
    ..ENERGY
};

pub(super) const TRANSMITTED: Study = Study {
    slug: "reflected-transmitted",
    title: "Reflected over transmitted energy",
    place: "figure er.et",
    draw: draw_transmitted,
    claims: &[
        Claim {
            id: "reflected-below-transmitted",
            place: "section 3 and figure er.et",
            quote: "Moreover the ratios remain lower than unity meaning that the amount of reflected energy is always lower than the \
                    amount of transmitted energy in the impurity mass interval considered.",
            judge: judge_unity,
        },
        Claim {
            id: "transmitted-similar",
            place: SECTION,
            quote: "If we now consider the ratio of reflected energy over transmitted energy in Fig. (er.et) we observe similar \
                    variations as previously.",
            judge: judge_similar,
        },
    ],
    ..ENERGY
};

pub(super) const CORRECTED: Study = Study {
    slug: "reflected-corrected",
    title: "Reflected energy without the recoil of the struck end",
    place: "figure er.e, corrected",
    draw: draw_corrected,
    claims: &[Claim {
        id: "reflected-recoil",
        place: "figure er.e",
        quote: "The reflected energy is defined as the energy contained in the first half of the bead chain after scattering. … Below \
                this threshold we have a more complicated pattern in which curves cross each others at different locations.",
        judge: judge_recoil,
    }],
    ..ENERGY
};

pub(super) const PULSE: Study = Study {
    slug: "reflected-pulse",
    title: "The reflected pulse over the mass of the impurity",
    place: "text of section 1",
    draw: draw_pulse,
    claims: &[
        Claim {
            id: "reflected-amplitude-grows",
            place: "section 1",
            quote: "In each case the amplitude of the reflected pulse grows with the absolute value of the difference between the mass of \
                    the impurity and the normal mass.",
            judge: judge_amplitude,
        },
        Claim {
            id: "reflected-speed-grows",
            place: "section 1",
            quote: "Hence the speed of the reflected pulse grows with this mass difference since the speed of our solitary waves increases \
                    with the amplitude.",
            judge: judge_speed,
        },
    ],
    ..ENERGY
};

/// The common part of the studies of this module.
const ENERGY: Study =
    Study { slug: "", title: "", place: "", runs: Vec::new, sweep: true, draw: draw_total, claims: &[] };

/// The point of an exponent and a mass (g).
fn point(seen: &Observations, alpha: f64, mass_g: f64) -> Result<&Reflected, StudyError> {
    let same = |point: &&Reflected| point.alpha == alpha && (point.mass_g - mass_g).abs() < 1e-9;
    let missing = || StudyError::NotObserved { run: format!("α = {alpha}, impurity of {mass_g} g") };
    seen.reflected().iter().find(same).ok_or_else(missing)
}

/// A quantity over all masses (g) for one exponent.
fn curve(
    seen: &Observations,
    alpha: f64,
    of: impl Fn(&Reflected) -> f64,
) -> Result<Vec<(f64, f64)>, StudyError> {
    // those of the figures must be there, others may
    for mass_g in MASSES_G {
        point(seen, alpha, mass_g)?;
    }
    Ok(points_of(seen.reflected(), alpha).into_iter().map(|point| (point.mass_g, of(point))).collect())
}

/// The points that the reference has, of one of its two quantities.
fn against_reference(seen: &Observations, transmitted: bool) -> Result<Vec<Number>, StudyError> {
    let mut numbers = Vec::new();
    for row in REFLECTED.numbers()? {
        let (alpha, mass_g) = (row[0], row[1]);
        let found = point(seen, alpha, mass_g)?;
        let (what, ours, expected) = if transmitted {
            ("reflected over transmitted", found.over_transmitted, row[3])
        } else {
            ("reflected over total", found.over_total, row[2])
        };
        let number = told(format!("{what}, α = {alpha}, {mass_g} g"), ours);
        numbers.push(number.against_within(expected, GOOD_TO));
    }
    Ok(numbers)
}

/// A number of a run that knows how far it may be off.
fn told(what: impl Into<String>, found: Uncertain) -> Number {
    Number::known(what, found, "", FROM_WINDOW)
}

fn all(seen: &Observations, of: fn(&Reflected) -> f64) -> Result<Vec<Vec<(f64, f64)>>, StudyError> {
    ALPHAS.into_iter().map(|alpha| curve(seen, alpha, of)).collect()
}

/// True if the magnitudes of a curve over the masses fall to the bead's mass and rise from it.
fn grows_with_difference(curve: &[(f64, f64)]) -> bool {
    let falls =
        curve.windows(2).filter(|pair| pair[1].0 <= BEAD_G).all(|pair| pair[1].1.abs() < pair[0].1.abs());
    let rises =
        curve.windows(2).filter(|pair| pair[0].0 >= BEAD_G).all(|pair| pair[1].1.abs() > pair[0].1.abs());
    falls && rises
}

fn judge_mass(seen: &Observations) -> Result<Judgement, StudyError> {
    let curves = all(seen, |point| point.over_total.value)?;
    let growing: Vec<bool> = curves.iter().map(|curve| grows_with_difference(curve)).collect();
    let count = growing.iter().filter(|grows| **grows).count();
    let mut numbers = against_reference(seen, false)?;
    let drift = seen.reflected().iter().map(|point| point.drift).fold(0.0, f64::max);
    numbers.push(Number::new("largest relative error of the energy in any of these runs", drift, ""));
    Ok(Judgement {
        verdict: Verdict::graded(count * 2 > curves.len(), count == curves.len()),
        why: format!(
            "On either side of the bead's mass the ratio grows with the difference, for {count} of {} exponents over {} masses.",
            curves.len(),
            curves[0].len()
        ),
        numbers,
    })
}

/// A crossing of the curves of two neighbouring exponents.
struct Meeting {
    alphas: [f64; 2],
    /// The mass (g).
    at: Uncertain,
}

/// Crossings of neighbouring curves.
fn meetings(seen: &Observations, of: fn(&Reflected) -> Uncertain) -> Vec<Meeting> {
    let pairs = ALPHAS.windows(2);
    let of_pair = |pair: &[f64]| {
        let alphas = [pair[0], pair[1]];
        let found = crossings(&differences(seen.reflected(), pair, of));
        found.into_iter().map(move |at| Meeting { alphas, at })
    };
    pairs.flat_map(of_pair).collect()
}

/// The crossings as numbers; `how` says of which quantity, if that is not plain.
fn crossing_numbers(meetings: &[Meeting], how: &str) -> Vec<Number> {
    let number = |meeting: &Meeting| {
        let [low, high] = meeting.alphas;
        let what = format!("crossing of the curves of α = {low} and {high}{how}");
        Number::known(what, meeting.at, "g", FROM_GRID)
    };
    meetings.iter().map(number).collect()
}

fn judge_alpha(seen: &Observations) -> Result<Judgement, StudyError> {
    let curves = all(seen, |point| point.over_total.value)?;
    let masses_g: Vec<f64> = curves[0].iter().map(|(mass_g, _)| *mass_g).collect();
    let ordered = |index: &usize| curves.windows(2).all(|pair| pair[0][*index].1 < pair[1][*index].1);
    // the masses from which on the ratio grows with the exponent, and the last at which it does not
    let first = (0..masses_g.len()).rev().take_while(ordered).last().unwrap_or(masses_g.len());
    let (to, from) =
        (masses_g.get(first).copied().unwrap_or(f64::INFINITY), masses_g[first.saturating_sub(1)]);
    let meetings = meetings(seen, over_total);
    let last = meetings.iter().map(|meeting| meeting.at).max_by(|a, b| a.value.total_cmp(&b.value));
    let absent = || StudyError::absent("the sweep over the masses", "crossing of two curves");
    let last = last.ok_or_else(absent)?;
    Ok(Judgement {
        verdict: Verdict::graded(to <= 2.0, (1.5..=2.0).contains(&last.value)),
        why: format!(
            "From {to} g on the ratio grows with every step in α, at {from} g not yet; the last two neighbouring curves cross at {:.2} g.",
            last.value
        ),
        numbers: vec![Number::known(
            "mass of the last crossing of two neighbouring curves",
            last,
            "g",
            FROM_GRID,
        )],
    })
}

fn judge_crossings(seen: &Observations) -> Result<Judgement, StudyError> {
    all(seen, |point| point.over_total.value)?;
    let numbers = crossing_numbers(&meetings(seen, over_total), "");
    let different: BTreeSet<u64> = numbers.iter().map(|number| number.value.to_bits()).collect();
    Ok(Judgement {
        verdict: Verdict::of(different.len() > 1),
        why: format!(
            "Neighbouring curves cross at {} places, from {:.2} to {:.2} g.",
            numbers.len(),
            numbers.iter().map(|number| number.value).fold(f64::INFINITY, f64::min),
            numbers.iter().map(|number| number.value).fold(0.0, f64::max)
        ),
        numbers,
    })
}

fn judge_below(seen: &Observations) -> Result<Judgement, StudyError> {
    all(seen, |point| point.over_total.value)?;
    let (mut holds, mut pairs) = (0, 0);
    let mut exceptions = Vec::new();
    let meetings = meetings(seen, over_total);
    for alphas in ALPHAS.windows(2) {
        let of_pair =
            || meetings.iter().filter(|meeting| meeting.alphas == alphas).map(|meeting| meeting.at.value);
        if of_pair().all(|mass_g| mass_g <= BEAD_G) {
            continue;
        }
        pairs += 1;
        // below the last crossing the lower exponent reflects more, unless there is another
        let others: Vec<String> = of_pair().rev().skip(1).map(|mass_g| format!("{mass_g:.2}")).collect();
        if others.is_empty() {
            holds += 1;
        } else {
            exceptions.push(format!("{} and {} at {} g", alphas[0], alphas[1], others.join(" and ")));
        }
    }
    Ok(Judgement {
        verdict: Verdict::graded(holds > 0, holds == pairs),
        why: if exceptions.is_empty() {
            format!(
                "Below their crossing above 1 g the lower exponent reflects more, for all {pairs} neighbouring pairs."
            )
        } else {
            format!(
                "It is so for {holds} of {pairs} neighbouring pairs that cross above 1 g; the others cross again below it: {}.",
                exceptions.join(", ")
            )
        },
        numbers: vec![Number::new("pairs for which it is so", f64::from(holds), "")],
    })
}

fn judge_wait(seen: &Observations) -> Result<Judgement, StudyError> {
    let run = seen.of(&light())?;
    let collisions = seen.events(&light(), EventKind::LeftCloses)?;
    let (fine, coarse) = collisions.first().ok_or_else(|| run.absent("collision"))?;
    let (arrival_s, coarse_s) = (fine.time_s, coarse.time_s);
    let since_s = point(seen, 1.5, 0.6)?.stationary_since_s;
    let wait_t = (since_s - arrival_s) / run.manifest.physics.scales().time_s;
    Ok(Judgement {
        verdict: Verdict::of(wait_t > 10.0),
        why: format!(
            "Behind 0.6 g at α = 1.5 the energy is stationary {wait_t:.0} collision times after the shock arrives, while the shock itself \
             passes a bead in about two."
        ),
        numbers: vec![
            Number::stepped(
                "arrival of the shock",
                (arrival_s * 1e3, coarse_s * 1e3),
                "ms",
                run.max_abs_drift,
            ),
            Number::new("energy stationary from", since_s * 1e3, "ms")
                .give_or_take(run.manifest.physics.dt_s * 1e3, "the distance between two frames"),
        ],
    })
}

fn judge_unity(seen: &Observations) -> Result<Judgement, StudyError> {
    all(seen, |point| point.over_transmitted.value)?;
    let ratios = || seen.reflected().iter().map(|point| point.over_transmitted);
    let largest = ratios().max_by(|a, b| a.value.total_cmp(&b.value));
    let largest = largest.unwrap_or(Uncertain::unknown(f64::NAN));
    let mut numbers = vec![told("largest ratio of all", largest)];
    numbers.extend(against_reference(seen, true)?);
    Ok(Judgement {
        verdict: Verdict::of(largest.value + largest.plus_minus < 1.0),
        why: format!("The largest of all {} ratios is {:.3}.", ratios().count(), largest.value),
        numbers,
    })
}

fn judge_similar(seen: &Observations) -> Result<Judgement, StudyError> {
    let curves = all(seen, |point| point.over_transmitted.value)?;
    let total = meetings(seen, over_total);
    let transmitted = meetings(seen, |point| point.over_transmitted);
    let apart = total.iter().zip(&transmitted).map(|(a, b)| (a.at.value - b.at.value).abs());
    let apart = apart.fold(0.0, f64::max);
    let grows = curves.iter().filter(|curve| grows_with_difference(curve)).count();
    Ok(Judgement {
        verdict: Verdict::of(total.len() == transmitted.len() && grows == curves.len()),
        why: format!(
            "{grows} of {} curves grow with the mass difference, and they cross at {} places, within {:.0e} g of those of the other figure.",
            curves.len(),
            transmitted.len(),
            apart
        ),
        numbers: vec![Number::new("largest distance between crossings of the two figures", apart, "g")],
    })
}

fn judge_recoil(seen: &Observations) -> Result<Judgement, StudyError> {
    let mut numbers = Vec::new();
    for alpha in ALPHAS {
        let equal = point(seen, alpha, BEAD_G)?;
        numbers.push(told(format!("ratio with no impurity at all (1 g), α = {alpha}"), equal.over_total));
        numbers.push(told(format!("the same without the recoil, α = {alpha}"), equal.corrected_over_total));
    }
    for alpha in [3.0, 5.0] {
        let heavy = point(seen, alpha, 5.0)?;
        let limit = hard_limit(5.0);
        let what = format!(
            "of the incident energy, without recoil, 5 g, α = {alpha}; ((m_i − m)/(m_i + m))² is {limit:.4}"
        );
        numbers.push(told(what, heavy.corrected));
    }
    let as_defined = meetings(seen, over_total);
    let corrected = meetings(seen, corrected_over_total);
    numbers.extend(crossing_numbers(&corrected, ", of the total energy without the recoil"));
    let incident = meetings(seen, |point| point.corrected);
    numbers.extend(crossing_numbers(&incident, ", of the incident energy"));
    Ok(Judgement {
        verdict: Verdict::graded(!as_defined.is_empty(), corrected.len() == as_defined.len()),
        why: format!(
            "As defined, the energy contains the recoil of the first kick: without any impurity the ratio is {:.6} at α = 1.5, not 0. Without \
             the recoil all curves touch zero at 1 g, and {}.",
            point(seen, 1.5, BEAD_G)?.over_total.value,
            left_of(as_defined.len(), &corrected)
        ),
        numbers,
    })
}

/// The number of crossings that are left, and their masses, in words.
fn left_of(all: usize, left: &[Meeting]) -> String {
    if left.is_empty() {
        return format!("none of the {all} crossings are left, as far as masses 0.0125 g apart show");
    }
    let each = left.iter().map(|Meeting { alphas: [low, high], at }| format!("{low} and {high} at {at}"));
    let each = each.collect::<Vec<_>>().join(" g, ");
    format!("{} crossings are left in place of {all}: {each} g", left.len())
}

/// Reflected share of the energy of two hard spheres: `((m_i − m)/(m_i + m))²`, for `m_i ≥ m` the limit α → ∞.
fn hard_limit(mass_g: f64) -> f64 {
    ((mass_g - BEAD_G) / (mass_g + BEAD_G)).powi(2)
}

/// The amplitude (m/s) of the reflected pulse at α = 1.5, for masses other than the bead's.
fn amplitudes(seen: &Observations, of: fn(&Reflected) -> f64) -> Result<Vec<(f64, f64)>, StudyError> {
    let points = curve(seen, 1.5, of)?;
    // nearer to the bead's mass there is hardly a pulse to be found
    Ok(points
        .into_iter()
        .filter(|(mass_g, value)| *mass_g != BEAD_G && is_shown(*mass_g) && value.is_finite())
        .collect())
}

/// A quantity of the reflected pulses for each mass, as numbers.
fn pulse_numbers(what: &str, points: &[(f64, f64)], unit: &'static str) -> Vec<Number> {
    let number = |(mass_g, value): &(f64, f64)| {
        Number::new(format!("{what} of the reflected pulse, {mass_g} g"), *value, unit)
            .give_or_take(1e-4 * value, "the interpolation between frames")
    };
    points.iter().map(number).collect()
}

/// Growth away from the bead's mass, in words.
fn growth(points: &[(f64, f64)]) -> &'static str {
    if grows_with_difference(points) { "grows" } else { "does not always grow" }
}

fn judge_amplitude(seen: &Observations) -> Result<Judgement, StudyError> {
    let points = amplitudes(seen, |point| point.backward_m_s)?;
    let light = points.first().map_or(0.0, |point| point.1.abs());
    let heavy =
        points.iter().find(|(mass_g, _)| (mass_g - 1.5).abs() < 1e-9).map_or(0.0, |point| point.1.abs());
    Ok(Judgement {
        verdict: Verdict::of(grows_with_difference(&points)),
        why: format!(
            "At α = 1.5 it {} with the difference on either side of 1 g, and not alike on both: {light:.2} m/s for 0.6 g, {heavy:.2} m/s for 1.5 g.",
            growth(&points)
        ),
        numbers: pulse_numbers("amplitude", &points, "m/s"),
    })
}

fn judge_speed(seen: &Observations) -> Result<Judgement, StudyError> {
    let points = amplitudes(seen, |point| point.backward_beads_per_s)?;
    let speeds = || points.iter().map(|(_, speed)| *speed);
    let (least, most) = (speeds().fold(f64::INFINITY, f64::min), speeds().fold(0.0, f64::max));
    Ok(Judgement {
        verdict: Verdict::of(grows_with_difference(&points)),
        why: format!(
            "At α = 1.5 the speed {} with the difference on either side of 1 g, from {least:.0} to {most:.0} beads/s.",
            growth(&points)
        ),
        numbers: pulse_numbers("speed", &points, "beads/s"),
    })
}
