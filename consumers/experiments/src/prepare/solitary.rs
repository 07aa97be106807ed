//! Exact solitary waves as displacements and velocities at step 0.

use super::states::{State, physics_of};
use super::{add, refused};
use consumers::deformation::Plain;
use consumers::theory::{SolitaryWave, Strength, WaveScale};
use schemas::chain::Chain;
use schemas::config::{ConfigError, RunConfig, Solitary};
use std::fmt;

/// The part of its height that a wave may have where it meets another one: what two waves then differ from two exact ones by.
const MEETING: f64 = 1e-9;

/// The part of its height that a wave may have where the chain ends or is of another kind.
const CUT: f64 = 1e-6;

/// No exact wave is as wide as this (beads).
const MOST_APART: i32 = 10_000;

/// The lists of `config` with the exact waves that it asks for.
///
/// # Errors
/// When there is no such wave in this chain, or when two of them overlap.
pub(super) fn with_waves(config: &RunConfig) -> Result<State, ConfigError> {
    let asked = &config.initial.solitary;
    let (mut u_m, mut v_m_s) =
        (config.initial.displacements_m.clone(), config.initial.velocities_m_s.clone());
    let key = |i: usize| match asked.len() {
        1 => "initial.solitary".to_owned(),
        _ => format!("initial.solitary[{i}]"),
    };
    if asked.is_empty() {
        return Ok((u_m, v_m_s));
    }
    let physics = physics_of(config)?;
    let (plain, chain) = (Plain::of(&physics, true), physics.chain());
    let exact = SolitaryWave::new(physics.alpha).map_err(|error| refused(&key(0), error.to_string()))?;
    // the places of waves so far, in their order: a wave meets its neighbours first
    let mut places: Vec<f64> = Vec::new();
    for (i, wave) in asked.iter().enumerate() {
        check_place((&plain, &chain), &exact, wave, &key(i))?;
        let meets = |other: &&f64| exact.overlap(0.5 * (wave.bead - **other)) > MEETING;
        let next = places.partition_point(|place| *place < wave.bead);
        if let Some(other) = places[next.saturating_sub(1)..].iter().take(2).find(meets) {
            let apart = (1..MOST_APART)
                .find(|beads| exact.overlap(0.5 * f64::from(*beads)) <= MEETING)
                .unwrap_or(MOST_APART);
            let message = format!(
                "found {}, and a wave at bead {other}, with which it overlaps; allowed: {apart} beads apart, where the sum of two \
                 exact waves is exact",
                wave.bead
            );
            return Err(refused(&format!("{}.bead", key(i)), message));
        }
        places.insert(next, wave.bead);
    }
    for (i, wave) in asked.iter().enumerate() {
        let (more_m, more_m_s) = state(&chain, &exact, *wave, &key(i))?;
        add(&mut u_m, more_m);
        add(&mut v_m_s, more_m_s);
    }
    Ok((u_m, v_m_s))
}

/// Refuses a wave that an end would cut, or that meets at its place what no exact wave has.
fn check_place(
    (plain, chain): (&Plain, &Chain),
    exact: &SolitaryWave,
    wave: &Solitary,
    key: &str,
) -> Result<(), ConfigError> {
    let last = chain.bead_count() as f64 - 1.0;
    let refuse = |why: String| Err(refused(&format!("{key}.bead"), format!("found {}{why}", wave.bead)));
    if !(0.0..=last).contains(&wave.bead) {
        return refuse(format!("; allowed: 0 to {last}"));
    }
    let cuts = |at: f64| exact.overlap(at - wave.bead) > CUT;
    let away = (1..MOST_APART).find(|beads| exact.overlap(f64::from(*beads)) <= CUT).unwrap_or(MOST_APART);
    if let Some(at) = [-0.5, last + 0.5].into_iter().find(|at| cuts(*at)) {
        return refuse(format!(
            ", {} beads from the end of the chain; allowed: {away} beads or more, beyond which the wave is 1e-6 of its height",
            (at - wave.bead).abs()
        ));
    }
    let is_near = |at: f64| (at - wave.bead).abs() < f64::from(away);
    let (crest, most) = (crest_bead(wave), away.unsigned_abs() as usize);
    let near = |count: usize| crest.saturating_sub(most)..count.min(crest + most + 1);
    let beads = near(chain.bead_count()).filter(|bead| is_near(*bead as f64));
    let contacts = near(chain.contact_count()).filter(|contact| is_near(*contact as f64 + 0.5));
    let found = if chain.is_pressed() {
        Err("the chain is pressed together")
    } else {
        plain.check(chain, &beads, &contacts)
    };
    found.or_else(|what| {
        refuse(format!(
            " where {what}; allowed: a place where the exact wave is a motion of the chain: within {away} beads equal beads, one power of \
             the overlap, and no load, gaps, resonators, losses, drives or baths"
        ))
    })
}

/// The bead at the crest, or the one before it.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "checked: it is a place in the chain"
)]
fn crest_bead(wave: &Solitary) -> usize {
    wave.bead as usize
}

/// The wave in the units of the chain, and whether it travels to higher bead numbers.
fn scaled(
    chain: &Chain,
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
    let refuse = |why: &dyn fmt::Display| refused(&format!("{key}.{name}"), format!("found {value}; {why}"));
    // beads and contacts are alike near the crest
    let crest = crest_bead(&wave);
    let scale = exact.coefficients().scaled(chain.mass_kg[crest], chain.stiffness[crest], strength);
    Ok((scale.map_err(|error| refuse(&error))?, value > 0.0))
}

fn state(chain: &Chain, exact: &SolitaryWave, wave: Solitary, key: &str) -> Result<State, ConfigError> {
    let (scale, is_forward) = scaled(chain, exact, wave, key)?;
    let beads = chain.bead_count();
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

#[cfg(test)]
mod tests {
    use super::*;

    fn prepared(chain: &str, tables: &str) -> Result<RunConfig, String> {
        let text = format!(
            "[chain]\n{chain}\n[initial]\nsolitary = {{ bead = 20, velocity_m_s = 0.1 }}\n[time]\nduration_s = 1e-3\n{tables}"
        );
        super::super::prepared(RunConfig::from_toml(&text).unwrap(), None).map_err(|error| error.to_string())
    }

    const HERTZ: &str = "beads = 60\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7";

    #[test]
    fn a_place_that_has_no_exact_wave_is_refused_with_what_is_there() {
        let [steel, nylon] = ["steel", "nylon"].map(|of| format!("material = \"{of}\", radius_m = 5e-3 }}"));
        let spheres = [
            format!("beads = 60\nspheres = [{{ {steel}, {{ {nylon}]"),
            format!("beads = 60\nspheres = {{ {steel}\nodd_spheres = [{{ bead = 21, {nylon}]"),
        ];
        let gaps = format!("{HERTZ}\ngaps_m = 1e-6");
        let bead = "[[drive]]\nbead = 21\ndisplacement_m = 0.0\n";
        for (chain, tables, says) in [
            (spheres[0].as_str(), "", "beads or contacts differ"),
            (&spheres[1], "", "beads or contacts differ"),
            (&gaps, "", "contacts have gaps"),
            (HERTZ, "[load]\nprecompression_n = 1.0\n", "the chain is pressed together"),
            (HERTZ, "[damping]\nrestitution = 0.5\n", "contacts dissipate"),
            (HERTZ, "[on_site]\nlinear_n_per_m = 1.0\n", "springs hold the beads"),
            (HERTZ, "[resonators]\nmass_kg = 1e-3\nstiffness_n_per_m = 1e5\n", "beads have resonators"),
            (HERTZ, "[ends]\nright = \"absorbing\"\nabsorbing_beads = 50\n", "drag acts on beads"),
            (HERTZ, bead, "a drive acts on beads"),
            (HERTZ, "[[bath]]\ntemperature_j = 1e-9\nfriction_per_s = 10.0\n", "a bath acts on beads"),
        ] {
            let refused = prepared(chain, tables).expect_err(says);
            let is_there = refused.starts_with("initial.solitary.bead: found 20 where ");
            assert!(is_there && refused.contains(says), "{refused}");
        }
        let many = HERTZ.replace("60", "4611686018427387904");
        assert!(prepared(&many, "").is_err_and(|refused| refused.starts_with("chain.beads: found 46")));
    }

    #[test]
    fn waves_overlap_in_whatever_order_they_are_given() {
        let prepared = |beads: [f64; 4]| {
            let waves = beads.map(|bead| format!("{{ bead = {bead}, velocity_m_s = 0.1 }}")).join(", ");
            let chain = HERTZ.replace("60", "200");
            let text =
                format!("[chain]\n{chain}\n[initial]\nsolitary = [{waves}]\n[time]\nduration_s = 1e-3\n");
            super::super::prepared(RunConfig::from_toml(&text).unwrap(), None)
                .map_err(|error| error.to_string())
        };
        assert!(prepared([150.0, 20.0, 120.0, 60.0]).is_ok());
        for (beads, found) in
            [([150.0, 20.0, 60.0, 63.0], [3, 63, 60]), ([150.0, 60.0, 57.0, 20.0], [2, 57, 60])]
        {
            let refused = prepared(beads).expect_err("two are too near");
            let [i, wave, other] = found;
            let says =
                format!("initial.solitary[{i}].bead: found {wave}, and a wave at bead {other}, with which");
            assert!(refused.starts_with(&says), "{refused}");
        }
    }

    /// The wave has the masses that the beads have, whatever else `bead_mass_kg` says; what acts elsewhere leaves it as it is.
    #[test]
    fn a_wave_is_that_of_the_beads_at_its_place() {
        let peak = |chain: &str, tables: &str| {
            let config = prepared(chain, tables).unwrap();
            (config.initial.velocities_m_s[20], config.initial.displacements_m[0])
        };
        let masses = format!("{HERTZ}\nmasses = {{ pattern_kg = [2e-3] }}");
        let heavy = HERTZ.replace("1e-3", "2e-3");
        let far = "[[drive]]\nbead = 0\ndisplacement_m = 0.0\n[ends]\nright = \"absorbing\"\n";
        assert_eq!(peak(&masses, ""), peak(&heavy, ""));
        assert_eq!(peak(HERTZ, far), peak(HERTZ, ""));
        assert!((peak(HERTZ, "").0 / 0.1 - 1.0).abs() < 1e-9);
    }
}
