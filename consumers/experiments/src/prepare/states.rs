//! Initial states that follow from the chain: modes with given energies, and states of a given energy.

use super::refused;
use schemas::config::{
    ConfigError, End, Gaussian, Initial, ModeEnergies, Phase, RunConfig, Strikers, TimeConfig,
};
use schemas::drive::{Drive, Place, Quantity};
use schemas::functions::sine_cosine;
use schemas::manifest::Physics;
use schemas::philox::uniform;
use std::collections::BTreeSet;
use std::f64::consts::TAU;
use waves::linear::{LinearChain, check_beads_are_free};
use waves::modes::Modes;

/// The stream of random phases; those of disorder count from 0, that of thermal velocities is the last.
const PHASES: u32 = u32::MAX - 1;

/// Displacements (m) and velocities (m/s).
pub(super) type State = (Vec<f64>, Vec<f64>);

/// The run of `config`, whatever it begins with.
pub(super) fn physics_of(config: &RunConfig) -> Result<Physics, ConfigError> {
    let mut config = config.clone();
    // no striker, which a driven bead refuses
    let moved = Gaussian { bead: 0.0, width_beads: 1.0, displacement_m: 0.0, velocity_m_s: 1.0 };
    config.initial = Initial { gaussian: Some(moved), ..Initial::default() };
    (config.striker, config.time.dt_s) = (Strikers::default(), None);
    Physics::resolve(&config)
}

/// The sum of modes of `asked`: `√(2·E)/ω·cos φ` along the unit vector of each, and `−√(2·E)·sin φ` of the velocities.
pub(super) fn of_modes(config: &RunConfig, asked: &ModeEnergies) -> Result<State, ConfigError> {
    let key = "initial.modes.energies_j";
    let physics = physics_of(config)?;
    check_beads_are_free(&physics).map_err(|why| refused("initial.modes", why))?;
    let linear =
        LinearChain::of(&physics.chain()).map_err(|error| refused("initial.modes", error.to_string()))?;
    if !linear.resonators.is_empty() {
        let why =
            "found in a chain with resonators; allowed: chains without, whose state is that of the beads";
        return Err(refused("initial.modes", why.to_owned()));
    }
    let modes = Modes::of(&linear).map_err(|error| refused("initial.modes", error.to_string()))?;
    let count = modes.count();
    let (mut u_m, mut v_m_s) = (vec![0.0; count], vec![0.0; count]);
    let mut named = BTreeSet::new();
    for entry in &asked.energies_j {
        let (first, last, energy_j) = match entry[..] {
            [mode, energy_j] => (mode, mode, energy_j),
            [first, last, energy_j] => (first, last, energy_j),
            _ => {
                let why = format!(
                    "found {} numbers; allowed: [mode, energy] or [first, last, energy of each]",
                    entry.len()
                );
                return Err(refused(key, why));
            }
        };
        let is_mode = |mode: f64| mode.fract() == 0.0 && (1.0..=count as f64).contains(&mode);
        if !is_mode(first) || !is_mode(last) || first > last {
            let why = format!("found the modes {first} to {last}; allowed: 1 to {count}, in order");
            return Err(refused(key, why));
        }
        if !(0.0..=1e100).contains(&energy_j) {
            return Err(refused(key, format!("found an energy of {energy_j} J; allowed: 0 to 1e100 J")));
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 1 to 4096")]
        for mode in first as usize - 1..last as usize {
            if !named.insert(mode) {
                return Err(refused(key, format!("found mode {} twice; allowed: each mode once", mode + 1)));
            }
            let omega = modes.omega_rad_s()[mode];
            if omega == 0.0 {
                let why = format!(
                    "found mode {}, a free motion without a frequency; allowed: the others",
                    mode + 1
                );
                return Err(refused(key, why));
            }
            let turns = match asked.phase {
                Phase::Rad(phase) => phase / TAU,
                Phase::Random => uniform(config.seed, PHASES, mode as u64),
            };
            let ((sine, cosine), size) = (sine_cosine((turns, 0.0)), (2.0 * energy_j).sqrt());
            let unit = modes.unit_shape(mode);
            u_m.iter_mut().zip(&unit).for_each(|(u, part)| *u += size / omega * cosine * part);
            v_m_s.iter_mut().zip(&unit).for_each(|(v, part)| *v -= size * sine * part);
        }
    }
    Ok((u_m, v_m_s))
}

/// The initial state of `config`, strikers among it, scaled to `energy_j` for each bead; without momentum where nothing holds the chain.
pub(super) fn of_energy(config: &RunConfig, energy_per_bead_j: f64) -> Result<State, ConfigError> {
    let key = "initial.energy_per_bead_j";
    if !(energy_per_bead_j > 0.0 && energy_per_bead_j <= 1e100) {
        return Err(refused(key, format!("found {energy_per_bead_j}; allowed: more than 0, up to 1e100 J")));
    }
    let initial = &config.initial;
    if !initial.resonator_displacements_m.is_empty() || !initial.resonator_velocities_m_s.is_empty() {
        let why = "found beside a state of resonators; allowed: resonators that rest in their beads";
        return Err(refused(key, why.to_owned()));
    }
    let is_moved = |drive: &&Drive| matches!(drive.at, Place::Bead(_)) && drive.prescribes != Quantity::Force;
    if let Some(drive) = config.drive.iter().position(|drive| is_moved(&drive)) {
        let why =
            format!("found beside drive[{drive}], which moves a bead; allowed: forces, and walls that move");
        return Err(refused(key, why));
    }
    // the step is that of the scaled state
    let free = RunConfig { time: TimeConfig { dt_s: None, ..config.time }, ..config.clone() };
    let physics = Physics::resolve(&free)?;
    let chain = physics.chain();
    let (u_m, mut v_m_s) = physics.initial_state();
    let mut springs = chain.sites.linear_n_per_m.iter().chain(&chain.sites.cubic_n_per_m3);
    let is_held = [config.ends.left, config.ends.right].contains(&End::Fixed) || springs.any(|k| *k != 0.0);
    if !is_held {
        let sum = |of: &dyn Fn(f64, f64) -> f64| {
            chain.mass_kg.iter().zip(&v_m_s).map(|(m, v)| of(*m, *v)).sum::<f64>()
        };
        let drift_m_s = sum(&|m, v| m * v) / sum(&|m, _| m);
        for v in &mut v_m_s {
            *v -= drift_m_s;
        }
    }
    let scaled = |factor: f64| -> State {
        let of = |values: &[f64]| values.iter().map(|x| factor * x).collect();
        (of(&u_m), of(&v_m_s))
    };
    let wanted_j = energy_per_bead_j * chain.bead_count() as f64;
    let mut contacts_j = vec![0.0; chain.contact_count()];
    let mut energy_j = |factor: f64| {
        let (u_m, v_m_s) = scaled(factor);
        chain.energy(&u_m, &v_m_s, &physics.initial_extra(&u_m), &mut contacts_j).total_j()
    };
    let has_energy = energy_j(1.0) > 0.0;
    if !has_energy {
        let why = "found a state without energy; allowed: one to be scaled, such as `thermal`, `modes` or a striker";
        return Err(refused(key, why.to_owned()));
    }
    let (mut low, mut high) = (0.0, 1.0);
    while energy_j(high) >= wanted_j && high > 1e-150 {
        high *= 0.5;
    }
    // from far below in small steps: behind the edge of a potential a state has less energy again
    high /= 128.0;
    let (mut before, mut passed_j, mut here_j) = (0.0, [0.0; 2], energy_j(high));
    while here_j < wanted_j && high < 1e150 {
        if passed_j[1] > passed_j[0] && passed_j[1] > here_j {
            // a top lies between
            let (mut left, mut right) = (before, high);
            while right - left > 1e-9 * right {
                let third = (right - left) / 3.0;
                let rises = energy_j(left + third) < energy_j(right - third);
                (left, right) = if rises { (left + third, right) } else { (left, right - third) };
            }
            if energy_j(right) >= wanted_j {
                (low, high) = (before, right);
                break;
            }
        }
        (before, low, high) = (low, high, 1.05 * high);
        (passed_j, here_j) = ([passed_j[1], here_j], energy_j(high));
    }
    // down to neighbouring doubles
    loop {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        (low, high) = if energy_j(middle) < wanted_j { (middle, high) } else { (low, middle) };
    }
    let has_come = (energy_j(high) / wanted_j - 1.0).abs() < 1e-9;
    if !has_come {
        return Err(refused(
            key,
            format!("found {energy_per_bead_j}; allowed: an energy that this state comes to by growing"),
        ));
    }
    Ok(scaled(high))
}

#[cfg(test)]
mod tests {
    use super::*;
    use waves::modal::Modal;

    fn config(toml: &str) -> RunConfig {
        let text = format!(
            "seed = 4\n[chain]\nbeads = 12\nbead_mass_kg = 1.0\n{toml}\n[time]\nduration_s = 1.0\ndt_s = 0.01\n"
        );
        super::super::prepared(RunConfig::from_toml(&text).unwrap(), None).unwrap()
    }

    #[test]
    fn modes_have_the_energies_that_were_asked_for() {
        let walls = "[ends]\nleft = \"fixed\"\nright = \"fixed\"\n";
        for (chain, phase) in [
            (
                "masses = { pattern_kg = [1.0, 3.0] }\nalpha = 1.5\nstiffness = 1.0\n[load]\nprecompression_n = 1.0\n",
                "\"random\"",
            ),
            ("bonds = { linear = 1.0, cubic = 1.0 }\n", "0.3"),
        ] {
            let of = format!(
                "{chain}{walls}[initial]\nmodes = {{ energies_j = [[2, 1e-3], [5, 7, 2e-3]], phase = {phase} }}"
            );
            let config = config(&of);
            let physics = Physics::resolve(&config).unwrap();
            let mut modal = Modal::of(&LinearChain::of(&physics.chain()).unwrap()).unwrap();
            let ((u_m, v_m_s), mut found) = (physics.initial_state(), Vec::new());
            modal.energies_j(&u_m, &v_m_s, &mut found);
            for (mode, found) in (1..).zip(found) {
                let expected = match mode {
                    2 => 1e-3,
                    5..=7 => 2e-3,
                    _ => 0.0,
                };
                assert!((found - expected).abs() < 1e-14, "mode {mode}: {found}");
            }
        }
    }

    #[test]
    fn a_state_is_scaled_to_its_energy() {
        for (chain, initial) in [
            (
                "bonds = { linear = 1.0, quadratic = 0.3, cubic = 1.0 }\n[ends]\nleft = \"periodic\"\nright = \"periodic\"\n",
                "thermal = { energy_j = 0.1 }\nplane_wave = { cycles = 1, displacement_m = 0.1 }",
            ),
            ("alpha = 1.5\nstiffness = 1.0\n", "velocities_m_s = [1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, -0.5]"),
        ] {
            let physics =
                Physics::resolve(&config(&format!("{chain}[initial]\nenergy_per_bead_j = 0.25\n{initial}")))
                    .unwrap();
            let found = physics.initial_energy().total_j();
            assert!((found / 3.0 - 1.0).abs() < 4.0 * f64::EPSILON, "{found}");
            let (_, v_m_s) = physics.initial_state();
            assert!(v_m_s.iter().sum::<f64>().abs() < 1e-14);
        }
    }

    /// `V(x) = x²/2 − x³ + x⁴/2` of the first bond has an edge at x = 1/2 and a second well behind it; `x²/2 − x³/12` reaches 2.6 J before
    /// its edge at 4.
    #[test]
    fn a_state_grows_to_the_first_that_has_its_energy() {
        let first_m = |bonds: &str, begin_m: f64, energy_per_bead_j: f64| {
            let text = format!(
                "[chain]\nbeads = 2\nbead_mass_kg = 1.0\nbonds = {{ linear = 1.0, {bonds} }}\n[initial]\n\
                 displacements_m = [0.0, {begin_m}]\nenergy_per_bead_j = {energy_per_bead_j}\n[time]\nduration_s = 1.0\n"
            );
            let config = super::super::prepared(RunConfig::from_toml(&text).unwrap(), None).unwrap();
            config.initial.displacements_m[1]
        };
        for (bonds, energy_j, potential_j) in [
            (
                "quadratic = 3.0, cubic = 2.0",
                0.031_249_9,
                (|x| x * x / 2.0 - x * x * x + x * x * x * x / 2.0) as fn(f64) -> f64,
            ),
            ("quadratic = 0.25", 2.666_66, |x| x * x / 2.0 - x * x * x / 12.0),
        ] {
            let begins: &[f64] = if energy_j < 1.0 { &[0.01, 0.3, 0.9, 1.3] } else { &[0.1, 1.5, 3.9] };
            for begin_m in begins {
                let x_m = first_m(bonds, *begin_m, energy_j / 2.0);
                assert!((potential_j(x_m) / energy_j - 1.0).abs() < 1e-12, "{begin_m}: {x_m}");
                assert!(x_m < if energy_j < 1.0 { 0.5 } else { 4.0 }, "{begin_m}: {x_m}");
            }
        }
    }

    #[test]
    fn springs_without_stiffness_hold_no_chain() {
        let momentum = |spring: f64| {
            let of = format!(
                "bonds = {{ linear = 1.0 }}\n[on_site]\nlinear_n_per_m = {spring}\n[initial]\nenergy_per_bead_j = 0.1\n\
                 velocities_m_s = [1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]"
            );
            config(&of).initial.velocities_m_s.iter().sum::<f64>()
        };
        assert!(momentum(0.0).abs() < 1e-14 && momentum(0.1) > 1.0);
    }

    #[test]
    fn no_state_is_scaled_beside_a_bead_that_a_drive_moves() {
        let text = "[chain]\nbeads = 3\nbead_mass_kg = 1.0\nalpha = 1.5\nstiffness = 1.0\n[initial]\nenergy_per_bead_j = 0.01\n\
                    velocities_m_s = [1.0, 0.5, -0.7]\n[[drive]]\nbead = 1\nvelocity_m_s = 0.2\n[time]\nduration_s = 1.0\n";
        let refused =
            super::super::prepared(RunConfig::from_toml(text).unwrap(), None).unwrap_err().to_string();
        assert!(refused.contains("drive[0], which moves a bead; allowed: forces"), "{refused}");
    }
}
