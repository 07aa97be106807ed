//! The energy figures: how much comes back, how much goes on.

mod figures;

use super::claim::{Claim, Judgement, Number, StudyError, Verdict};
use super::observe::Observations;
use super::reference::REFLECTED;
use super::reflection::{ALPHAS, BEAD_G, MASSES_G, Reflected, crossings, curve, point};
use super::runs::light;
use super::study::Study;
use crate::impurity::EventKind;
use figures::{draw_corrected, draw_pulse, draw_total, draw_transmitted};
use std::collections::BTreeSet;

const SECTION: &str = "section 3";
/// What the reference is good to.
const GOOD_TO: f64 = 3e-5;
const FROM_WINDOW: &str = "what may still cross the impurity, and the change over the last 50 to 100 T";
const FROM_GRID: &str = "half the distance between the masses computed";

pub(super) const TOTAL: Study = Study {
    slug: "reflected-total",
    title: "Reflected over total energy",
    place: "figure er.e",
    runs: || vec![light()],
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

/// What the studies of this module have in common.
const ENERGY: Study =
    Study { slug: "", title: "", place: "", runs: Vec::new, sweep: true, draw: draw_total, claims: &[] };

/// The points that the reference has, of one of its two quantities.
fn against_reference(seen: &Observations, transmitted: bool) -> Result<Vec<Number>, StudyError> {
    let mut numbers = Vec::new();
    for row in REFLECTED.rows() {
        let missing = || StudyError::NoReference { file: "reflected-energy.csv", row: row.join(",") };
        let value = |word: &str| word.parse::<f64>().map_err(|_| missing());
        let (alpha, mass_g) = (value(row[0])?, value(row[1])?);
        let found = point(seen, alpha, mass_g)?;
        let (what, ours, expected) = if transmitted {
            ("reflected over transmitted", found.over_transmitted, value(row[3])?)
        } else {
            ("reflected over total", found.over_total, value(row[2])?)
        };
        // d(r/t) = (r/t)·(dr/r + dr/t)
        let slope = ours / found.over_total;
        let uncertainty =
            if transmitted { found.uncertainty * slope * (1.0 + ours) } else { found.uncertainty };
        numbers.push(
            Number::new(format!("{what}, α = {alpha}, {mass_g} g"), ours, "")
                .give_or_take(uncertainty, FROM_WINDOW)
                .against_within(expected, GOOD_TO),
        );
    }
    Ok(numbers)
}

fn all(seen: &Observations, of: fn(&Reflected) -> f64) -> Result<Vec<Vec<(f64, f64)>>, StudyError> {
    ALPHAS.into_iter().map(|alpha| curve(seen, alpha, of)).collect()
}

/// Whether a curve over the masses falls to the bead's mass and rises from it.
fn grows_with_difference(curve: &[(f64, f64)]) -> bool {
    let falls = curve.windows(2).filter(|pair| pair[1].0 <= BEAD_G).all(|pair| pair[1].1 < pair[0].1);
    let rises = curve.windows(2).filter(|pair| pair[0].0 >= BEAD_G).all(|pair| pair[1].1 > pair[0].1);
    falls && rises
}

fn judge_mass(seen: &Observations) -> Result<Judgement, StudyError> {
    let curves = all(seen, |point| point.over_total)?;
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
            MASSES_G.len()
        ),
        numbers,
    })
}

/// The masses (g) computed, with whether the ratio grows with the exponent there, over all exponents.
fn ordered(seen: &Observations, of: fn(&Reflected) -> f64) -> Result<Vec<(f64, bool)>, StudyError> {
    let curves = all(seen, of)?;
    let at = |index: usize| curves.windows(2).all(|pair| pair[0][index].1 < pair[1][index].1);
    Ok(MASSES_G.iter().enumerate().map(|(index, mass_g)| (*mass_g, at(index))).collect())
}

fn judge_alpha(seen: &Observations) -> Result<Judgement, StudyError> {
    let ordered = ordered(seen, |point| point.over_total)?;
    let last_disorder = ordered.iter().rposition(|(_, is)| !is);
    let (from, to) = match last_disorder {
        Some(index) if index + 1 < ordered.len() => (ordered[index].0, ordered[index + 1].0),
        Some(index) => (ordered[index].0, f64::INFINITY),
        None => (0.0, ordered[0].0),
    };
    // exact to the masses computed: the last crossing of two neighbouring curves
    let last = crossing_masses(seen, |point| point.over_total)?.into_iter().fold(0.0, f64::max);
    Ok(Judgement {
        verdict: Verdict::graded(to <= 2.0, (1.5..=2.0).contains(&last)),
        why: format!(
            "From {to} g on the ratio grows with every step in α, at {from} g not yet; the last two neighbouring curves cross at {last:.2} g."
        ),
        numbers: vec![
            Number::new("mass of the last crossing of two neighbouring curves", last, "g")
                .give_or_take(0.5 * (to - from).min(1.0), FROM_GRID),
        ],
    })
}

/// Where neighbouring curves cross (g).
fn crossing_masses(seen: &Observations, of: fn(&Reflected) -> f64) -> Result<Vec<f64>, StudyError> {
    let curves = all(seen, of)?;
    Ok(curves.windows(2).flat_map(|pair| crossings(&pair[0], &pair[1])).collect())
}

/// The spacing (g) of the masses around one.
fn spacing_g(mass_g: f64) -> f64 {
    let pair = MASSES_G.windows(2).find(|pair| (pair[0]..=pair[1]).contains(&mass_g));
    pair.map_or(0.0, |pair| pair[1] - pair[0])
}

fn judge_crossings(seen: &Observations) -> Result<Judgement, StudyError> {
    let curves = all(seen, |point| point.over_total)?;
    let mut numbers = Vec::new();
    for (pair, alphas) in curves.windows(2).zip(ALPHAS.windows(2)) {
        for mass_g in crossings(&pair[0], &pair[1]) {
            let what = format!("crossing of the curves of α = {} and {}", alphas[0], alphas[1]);
            numbers.push(Number::new(what, mass_g, "g").give_or_take(0.5 * spacing_g(mass_g), FROM_GRID));
        }
    }
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
    let curves = all(seen, |point| point.over_total)?;
    let (mut holds, mut pairs) = (0, 0);
    let mut exceptions = Vec::new();
    for (pair, alphas) in curves.windows(2).zip(ALPHAS.windows(2)) {
        let Some(first) = crossings(&pair[0], &pair[1]).into_iter().rfind(|mass_g| *mass_g > BEAD_G) else {
            continue;
        };
        pairs += 1;
        let below = pair[0].iter().zip(&pair[1]).filter(|(low, _)| low.0 < first);
        if below.clone().all(|(low, high)| low.1 > high.1) {
            holds += 1;
        } else {
            let least = below
                .filter(|(low, high)| low.1 <= high.1)
                .map(|(low, _)| low.0)
                .fold(f64::INFINITY, f64::min);
            exceptions.push(format!("{} and {} at {least} g", alphas[0], alphas[1]));
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
                "It is so for {holds} of {pairs} neighbouring pairs that cross above 1 g; others cross again among the light impurities: {}.",
                exceptions.join(", ")
            )
        },
        numbers: vec![Number::new("pairs for which it is so", f64::from(holds), "")],
    })
}

fn judge_wait(seen: &Observations) -> Result<Judgement, StudyError> {
    let run = seen.of(&light())?;
    let arrival = run.events.iter().find(|event| event.kind == EventKind::LeftCloses);
    let arrival_s = arrival.ok_or_else(|| run.absent("collision"))?.time_s;
    let since_s = point(seen, 1.5, 0.6)?.stationary_since_s;
    let wait_t = (since_s - arrival_s) / run.manifest.physics.scales().time_s;
    Ok(Judgement {
        verdict: Verdict::of(wait_t > 10.0),
        why: format!(
            "Behind 0.6 g at α = 1.5 the energy is stationary {wait_t:.0} collision times after the shock arrives, while the shock itself \
             passes a bead in about two."
        ),
        numbers: vec![
            Number::new("arrival of the shock", arrival_s * 1e3, "ms"),
            Number::new("energy stationary from", since_s * 1e3, "ms"),
        ],
    })
}

fn judge_unity(seen: &Observations) -> Result<Judgement, StudyError> {
    let points = all(seen, |point| point.over_transmitted)?;
    let largest = points.iter().flatten().map(|(_, ratio)| *ratio).fold(0.0, f64::max);
    let hardest = point(seen, 5.0, 5.0)?;
    let uncertainty = hardest.uncertainty * largest / hardest.over_total * (1.0 + largest);
    let mut numbers =
        vec![Number::new("largest ratio of all", largest, "").give_or_take(uncertainty, FROM_WINDOW)];
    numbers.extend(against_reference(seen, true)?);
    Ok(Judgement {
        verdict: Verdict::of(largest < 1.0),
        why: format!("The largest of all {} ratios is {largest:.3}.", points.iter().flatten().count()),
        numbers,
    })
}

fn judge_similar(seen: &Observations) -> Result<Judgement, StudyError> {
    let total = crossing_masses(seen, |point| point.over_total)?;
    let transmitted = crossing_masses(seen, |point| point.over_transmitted)?;
    let apart = total.iter().zip(&transmitted).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let curves = all(seen, |point| point.over_transmitted)?;
    let grows = curves.iter().filter(|curve| grows_with_difference(curve)).count();
    Ok(Judgement {
        verdict: Verdict::of(total.len() == transmitted.len() && grows == curves.len()),
        why: format!(
            "{grows} of {} curves grow with the mass difference, and they cross at {} places, within {apart:.3} g of those of the other figure.",
            curves.len(),
            transmitted.len()
        ),
        numbers: vec![Number::new("largest distance between crossings of the two figures", apart, "g")],
    })
}

fn judge_recoil(seen: &Observations) -> Result<Judgement, StudyError> {
    let mut numbers = Vec::new();
    for alpha in ALPHAS {
        let equal = point(seen, alpha, BEAD_G)?;
        numbers.push(
            Number::new(format!("ratio with no impurity at all (1 g), α = {alpha}"), equal.over_total, "")
                .give_or_take(equal.uncertainty, FROM_WINDOW),
        );
        numbers.push(
            Number::new(format!("the same without the recoil, α = {alpha}"), equal.corrected, "")
                .give_or_take(equal.uncertainty + equal.recoil_uncertainty, FROM_WINDOW),
        );
    }
    for alpha in [3.0, 5.0] {
        let heavy = point(seen, alpha, 5.0)?;
        numbers.push(
            Number::new(
                format!("without recoil, 5 g, α = {alpha}; ((m_i − m)/(m_i + m))² is {:.4}", hard_limit(5.0)),
                heavy.corrected,
                "",
            )
            .give_or_take(heavy.uncertainty + heavy.recoil_uncertainty, FROM_WINDOW),
        );
    }
    let as_defined = crossing_masses(seen, |point| point.over_total)?;
    let corrected = real_crossings(seen)?;
    Ok(Judgement {
        verdict: Verdict::graded(!as_defined.is_empty(), corrected > 0),
        why: format!(
            "As defined, the energy contains the recoil of the first kick: without any impurity the ratio is {:.6} at α = 1.5, not 0. Without \
             the recoil {} of the {} crossings {} left.",
            point(seen, 1.5, BEAD_G)?.over_total,
            if corrected == 0 { "none".to_owned() } else { corrected.to_string() },
            as_defined.len(),
            if corrected == 1 { "is" } else { "are" },
        ),
        numbers,
    })
}

/// Pairs of neighbouring corrected curves and masses at which the order is the other way round by more than both are
/// uncertain.
fn real_crossings(seen: &Observations) -> Result<usize, StudyError> {
    let mut count = 0;
    for pair in ALPHAS.windows(2) {
        let mut wrong = false;
        for mass_g in MASSES_G {
            let (low, high) = (point(seen, pair[0], mass_g)?, point(seen, pair[1], mass_g)?);
            let off = |point: &Reflected| point.uncertainty + point.recoil_uncertainty;
            wrong |= (mass_g - BEAD_G).abs() > 1e-9 && low.corrected - high.corrected > off(low) + off(high);
        }
        count += usize::from(wrong);
    }
    Ok(count)
}

/// What two hard spheres reflect: `((m_i − m)/(m_i + m))²`, for `m_i ≥ m` the limit α → ∞.
fn hard_limit(mass_g: f64) -> f64 {
    ((mass_g - BEAD_G) / (mass_g + BEAD_G)).powi(2)
}

/// The amplitude (m/s) of the reflected pulse at α = 1.5, for masses other than the bead's.
fn amplitudes(seen: &Observations, of: fn(&Reflected) -> f64) -> Result<Vec<(f64, f64)>, StudyError> {
    let points = curve(seen, 1.5, of)?;
    Ok(points
        .into_iter()
        .filter(|(mass_g, value)| (mass_g - BEAD_G).abs() > 1e-9 && value.is_finite())
        .collect())
}

/// Whether values grow away from the bead's mass, on either side.
fn grows(points: &[(f64, f64)]) -> bool {
    let light =
        points.windows(2).filter(|pair| pair[1].0 < BEAD_G).all(|pair| pair[1].1.abs() < pair[0].1.abs());
    let heavy =
        points.windows(2).filter(|pair| pair[0].0 > BEAD_G).all(|pair| pair[1].1.abs() > pair[0].1.abs());
    light && heavy
}

fn judge_amplitude(seen: &Observations) -> Result<Judgement, StudyError> {
    let points = amplitudes(seen, |point| point.backward_m_s)?;
    let numbers = points.iter().map(|(mass_g, v)| {
        Number::new(format!("amplitude of the reflected pulse, {mass_g} g"), *v, "m/s")
            .give_or_take(1e-4 * v, "the interpolation between frames")
    });
    let light = points.first().map_or(0.0, |point| point.1.abs());
    let heavy =
        points.iter().find(|(mass_g, _)| (mass_g - 1.5).abs() < 1e-9).map_or(0.0, |point| point.1.abs());
    Ok(Judgement {
        verdict: Verdict::of(grows(&points)),
        why: format!(
            "At α = 1.5 it {} with the difference on either side of 1 g, and not alike on both: {light:.2} m/s for 0.6 g, {heavy:.2} m/s for 1.5 g.",
            if grows(&points) { "grows" } else { "does not always grow" }
        ),
        numbers: numbers.collect(),
    })
}

fn judge_speed(seen: &Observations) -> Result<Judgement, StudyError> {
    let points = amplitudes(seen, |point| point.backward_beads_per_s)?;
    let speeds = || points.iter().map(|(_, speed)| *speed);
    let (least, most) = (speeds().fold(f64::INFINITY, f64::min), speeds().fold(0.0, f64::max));
    let numbers = points.iter().map(|(mass_g, speed)| {
        Number::new(format!("speed of the reflected pulse, {mass_g} g"), *speed, "beads/s")
            .give_or_take(1e-4 * speed, "the interpolation between frames")
    });
    Ok(Judgement {
        verdict: Verdict::of(grows(&points)),
        why: format!(
            "At α = 1.5 the speed {} with the difference on either side of 1 g, from {least:.0} to {most:.0} beads/s.",
            if grows(&points) { "grows" } else { "does not always grow" }
        ),
        numbers: numbers.collect(),
    })
}
