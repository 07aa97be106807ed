//! Exact solitary waves as displacements and velocities at step 0.

use super::refused;
use consumers::theory::{SolitaryWave, Strength, WaveScale};
use schemas::config::{ConfigError, RunConfig, Solitary};
use std::fmt;

/// The part of its height that a wave may have where it meets another one: what two waves then differ from two exact ones by.
const MEETING: f64 = 1e-9;

/// The part of its height that a wave may have where the chain ends or is of another kind.
const CUT: f64 = 1e-6;

/// No exact wave is as wide as this (beads).
const MOST_APART: i32 = 10_000;

/// Displacements (m) and velocities (m/s) of a wave.
type State = (Vec<f64>, Vec<f64>);

/// The exact waves that `config` asks for.
///
/// # Errors
/// When there is no such wave in this chain, or when two of them overlap.
pub(super) fn waves(config: &RunConfig, beads: usize) -> Result<Vec<State>, ConfigError> {
    let asked = &config.initial.solitary;
    let key = |i: usize| match asked.len() {
        1 => "initial.solitary".to_owned(),
        _ => format!("initial.solitary[{i}]"),
    };
    if asked.is_empty() {
        return Ok(Vec::new());
    }
    check_chain(config, &key(0))?;
    let exact = SolitaryWave::new(config.chain.alpha).map_err(|error| refused(&key(0), error.to_string()))?;
    for (i, wave) in asked.iter().enumerate() {
        check_place(config, &exact, wave, &key(i))?;
        let meets = |other: &&Solitary| exact.overlap(0.5 * (wave.bead - other.bead)) > MEETING;
        if let Some(other) = asked[..i].iter().find(meets) {
            let apart = (1..MOST_APART)
                .find(|beads| exact.overlap(0.5 * f64::from(*beads)) <= MEETING)
                .unwrap_or(MOST_APART);
            let message = format!(
                "found {}, and a wave at bead {}, with which it overlaps; allowed: {apart} beads apart, where the sum of two \
                 exact waves is exact",
                wave.bead, other.bead
            );
            return Err(refused(&format!("{}.bead", key(i)), message));
        }
    }
    asked.iter().enumerate().map(|(i, wave)| state(config, &exact, *wave, (&key(i), beads))).collect()
}

fn check_chain(config: &RunConfig, key: &str) -> Result<(), ConfigError> {
    let chain = &config.chain;
    let is_even = chain.masses.is_uniform() && chain.stiffnesses.is_uniform() && config.load.is_none();
    let is_plain = chain.bonds.is_none() && chain.alphas.is_none() && chain.second.is_none();
    if is_even && is_plain && chain.gaps_m.is_none() && config.disorder.is_empty() {
        return Ok(());
    }
    let message = "found in a chain of another kind; allowed: equal beads, one power, no load, gaps and disorder, which have an exact wave";
    Err(refused(key, message.to_owned()))
}

/// Refuses a wave that an end, or a bead or a contact of another kind, would cut.
fn check_place(
    config: &RunConfig,
    exact: &SolitaryWave,
    wave: &Solitary,
    key: &str,
) -> Result<(), ConfigError> {
    let chain = &config.chain;
    let ends = [-0.5, chain.beads as f64 - 0.5].map(|at| ("the end of the chain".to_owned(), at));
    let beads =
        chain.impurities.iter().map(|odd| (format!("bead {} of another mass", odd.bead), odd.bead as f64));
    let contacts = chain
        .contacts
        .iter()
        .map(|odd| (format!("contact {} of another stiffness", odd.contact), odd.contact as f64 + 0.5));
    let last = chain.beads as f64 - 1.0;
    if !(0.0..=last).contains(&wave.bead) {
        return Err(refused(&format!("{key}.bead"), format!("found {}; allowed: 0 to {last}", wave.bead)));
    }
    let cuts = |at: f64| exact.overlap(at - wave.bead) > CUT;
    let Some((what, at)) = ends.into_iter().chain(beads).chain(contacts).find(|(_, at)| cuts(*at)) else {
        return Ok(());
    };
    let away = (1..MOST_APART).find(|beads| exact.overlap(f64::from(*beads)) <= CUT).unwrap_or(MOST_APART);
    let message = format!(
        "found {}, {} beads from {what}; allowed: {away} beads or more, beyond which the wave is 1e-6 of its height",
        wave.bead,
        (at - wave.bead).abs()
    );
    Err(refused(&format!("{key}.bead"), message))
}

/// The wave in the units of the chain, and whether it travels to higher bead numbers.
fn scaled(
    config: &RunConfig,
    exact: &SolitaryWave,
    wave: Solitary,
    key: &str,
) -> Result<(WaveScale, bool), ConfigError> {
    let (name, value, strength) = match (wave.speed_beads_s, wave.velocity_m_s) {
        (Some(speed), None) => ("speed_beads_s", speed, Strength::Speed { beads_per_s: speed.abs() }),
        (None, Some(peak)) => ("velocity_m_s", peak, Strength::PeakVelocity { m_s: peak.abs() }),
        (None, None) => {
            return Err(refused(
                key,
                "found no strength; allowed: one of speed_beads_s and velocity_m_s".to_owned(),
            ));
        }
        _ => {
            let found =
                "found speed_beads_s and velocity_m_s; allowed: one of them, as each follows from the other";
            return Err(refused(key, found.to_owned()));
        }
    };
    let chain = &config.chain;
    let refuse = |why: &dyn fmt::Display| refused(&format!("{key}.{name}"), format!("found {value}; {why}"));
    let scale = exact.coefficients().scaled(chain.bead_mass_kg, chain.stiffness, strength);
    Ok((scale.map_err(|error| refuse(&error))?, value > 0.0))
}

fn state(
    config: &RunConfig,
    exact: &SolitaryWave,
    wave: Solitary,
    (key, beads): (&str, usize),
) -> Result<State, ConfigError> {
    let (scale, is_forward) = scaled(config, exact, wave, key)?;
    let sign = if is_forward { 1.0 } else { -1.0 };
    let velocity = |i: usize| sign * scale.velocity_m_s * exact.velocity(i as f64 - wave.bead);
    // contact c, half a bead behind bead c + 1, is overlapped; displacements begin at the side to which the wave goes
    let overlap = |c: usize| scale.overlap_m * exact.overlap(c as f64 + 0.5 - wave.bead);
    let mut u_m = vec![0.0; beads];
    if is_forward {
        for i in (0..beads.saturating_sub(1)).rev() {
            u_m[i] = u_m[i + 1] + overlap(i);
        }
    } else {
        for i in 1..beads {
            u_m[i] = u_m[i - 1] - overlap(i - 1);
        }
    }
    Ok((u_m, (0..beads).map(velocity).collect()))
}
