//! Orbits of long chains, which are found by products of the derivative with vectors: against those found by matrices, of chains short enough for both.

#![expect(clippy::panic, reason = "a test may panic")]

mod common;

use common::{list, tried_by, with_born_by};
use orbits::Orbit;
use orbits::multipliers::{Multiplier, ON_CIRCLE};
use producer::integrator::Integrator;
use schemas::philox::uniform;

const FIXED: &str = "ends = { left = 'fixed', right = 'fixed' }\n";
const RING: &str = "ends = { left = 'periodic', right = 'periodic' }\n";
const LOAD: &str = "load = { precompression_n = 1.0 }\n";
const SPHERES: &str = "alpha = 1.5, stiffness = 1.0";
const BONDS: &str = "bonds = { linear = 1.0, cubic = 1.0 }";

/// A chain of random masses around a light bead that swings, from the highest mode on.
fn light_bead(beads: u32, seed: u32, [law, rest, orbit]: [&str; 3]) -> String {
    let random = |bead| 0.8 + 0.4 * uniform(7, seed, u64::from(bead));
    let masses = (0..beads).map(|bead| if bead == beads / 2 { 0.2 } else { random(bead) });
    format!(
        "chain = {{ beads = {beads}, bead_mass_kg = 1.0, {law}, masses = {{ list_kg = {} }} }}\n{rest}\n\
         orbit = {{ steps = 160, mode = {{ number = {beads}, displacement_m = 0.1 }}, {orbit} }}",
        list(masses)
    )
}

/// The orbit of a file at another time, as the seed of one that moves at its beginning.
fn moving(toml: &str) -> String {
    let orbit = tried_by(toml, None).unwrap_or_else(|error| panic!("{error}\n{toml}"));
    let (mut state, mut integrator) = (orbit.state.clone(), Integrator::new(&orbit.physics));
    while state.step < 23 {
        integrator.advance(&mut state, 23);
    }
    let (chain, _) = toml.split_once("orbit = ").expect("a table");
    let [u_m, v_m_s] = [&state.u_m, &state.v_m_s].map(|numbers| list(numbers.iter().copied()));
    format!(
        "{chain}initial = {{ displacements_m = {u_m}, velocities_m_s = {v_m_s} }}\n\
         orbit = {{ energy_j = 0.101, steps = 160, period_s = {} }}",
        orbit.period_s()
    )
}

/// Chains that conserve energy: each with its name.
fn conservative(beads: u32, seed: u32) -> Vec<(String, String)> {
    let mut all = Vec::new();
    let pressed = format!("{FIXED}{LOAD}");
    let resonators = format!("{pressed}resonators = {{ mass_kg = 0.3, stiffness_n_per_m = 0.4 }}");
    for asked in ["energy_j = 0.1", "amplitude_m = 0.2", "segments = 4, amplitude_m = 0.2"] {
        all.push((format!("pressed, {asked}"), light_bead(beads, seed, [SPHERES, &pressed, asked])));
    }
    let asked = "amplitude_m = 0.2";
    all.push(("resonators".to_owned(), light_bead(beads, seed, [SPHERES, &resonators, asked])));
    // the amplitude of a chain that nothing holds is any
    for (name, ends) in [("fixed", FIXED), ("free", ""), ("ring", RING)] {
        let toml = light_bead(beads, seed, [BONDS, ends, "energy_j = 0.1"]);
        // of some the orbit is not unique: a mode at the bead is one with others in the chain
        if tried_by(&toml, None).is_ok() {
            all.push((format!("{name}, moving"), moving(&toml)));
            all.push((name.to_owned(), toml));
        }
    }
    all.into_iter().map(|(name, toml)| (format!("{name}, {beads} beads, {seed}"), toml)).collect()
}

/// Chains that are shaken and lose energy.
fn shaken(beads: u32, frequency_hz: f64) -> Vec<(String, String)> {
    let mut all = Vec::new();
    let sine = format!("{{ sine = {{ amplitude = 0.1, frequency_hz = {frequency_hz} }} }}");
    let pressed = format!("{FIXED}{LOAD}");
    // as long as those of a run may be
    let steps = if frequency_hz < 0.1 { 300 } else { 100 };
    for (name, law, rest, drive) in [
        ("a wall", SPHERES, &*pressed, "wall = 'left', displacement_m"),
        ("a bead that is moved", SPHERES, &pressed, "bead = 3, displacement_m"),
        ("a bead that is pushed, free", BONDS, "", "bead = 3, force_n"),
        ("a bead that is pushed, in a ring", BONDS, RING, "bead = 3, force_n"),
    ] {
        for loss in ["on_site = { drag_n_s_per_m = 0.1 }", "damping.viscous_n_s_per_m = 0.3"] {
            let toml = format!(
                "chain = {{ beads = {beads}, bead_mass_kg = 1.0, {law} }}\n{rest}\n{loss}\n\
                 drive = [{{ {drive} = {sine} }}]\norbit = {{ steps = {steps} }}"
            );
            all.push((format!("{name}, {loss}, {beads} beads"), toml));
        }
    }
    all
}

/// A wave, which is displaced by a bead in a period.
fn wave(beads: u32, ends: &str) -> (String, String) {
    let toml = format!(
        "chain = {{ beads = {beads}, bead_mass_kg = 1.0, {SPHERES} }}\n{ends}\
         initial = {{ solitary = {{ bead = {}, velocity_m_s = 1.0 }} }}\n\
         orbit = {{ period_s = {}, shift_beads = 1, steps = 200 }}",
        beads / 2,
        1.0 / 0.907_470_078_412_186_5
    );
    (format!("a wave among {beads} beads"), toml)
}

/// Distance from the nearest of `all`, less where multipliers come in pairs that rounding parts.
fn distance(one: Multiplier, all: &[Multiplier]) -> f64 {
    let from = |other: &Multiplier| (one.re - other.re).hypot(one.im - other.im);
    let is_pair = one.im.abs() < 1e-4 && (one.re.abs() - 1.0).abs() < 1e-4;
    all.iter().map(from).fold(f64::INFINITY, f64::min) * if is_pair { 1e-2 } else { 1.0 }
}

#[test]
fn orbits_found_by_products_are_those_found_by_matrices() {
    let mut all = Vec::new();
    for (beads, seeds) in [(13, 3), (70, 1)] {
        (0..seeds).for_each(|seed| all.extend(conservative(beads, seed)));
        all.extend(shaken(beads, 0.3));
    }
    // in a period sound passes all of the beads: no few diagonals hold the derivative
    all.extend(shaken(70, 0.02));
    all.extend([(19, ""), (79, ""), (24, RING), (80, RING)].map(|(beads, ends)| wave(beads, ends)));
    let (mut largest, mut farthest) = (0.0, 0.0);
    for (name, toml) in &all {
        let [dense, found] = [None, Some(0)]
            .map(|most| tried_by(toml, most).unwrap_or_else(|error| panic!("{name}: {error}\n{toml}")));
        let relative = |of: fn(&Orbit) -> f64| (of(&found) / of(&dense) - 1.0).abs();
        let apart = relative(Orbit::period_s).max(relative(|orbit| orbit.energy_j));
        // the waves of a ring grow, and with them roundings
        assert!(apart < if name.contains("wave") { 1e-9 } else { 1e-10 }, "{name}: {apart:e}");
        largest = f64::max(largest, apart);
        // others may have another place or phase
        if name.starts_with("pressed") || name.starts_with("a wall") {
            let apart = dense.state.u_m.iter().zip(&*found.state.u_m).map(|(a, b)| (a - b).abs());
            let apart = apart.fold(0.0, f64::max) / dense.amplitude_m();
            assert!(apart < 1e-10, "{name}: {apart:e}");
        }
        let limit = found.multipliers.limit().expect("a limit");
        assert!(limit.residual < 1e-8, "{name}: {limit:?}");
        // small ones of a chain from which waves run out are good to nothing
        let least = if name.contains("wave") { 0.9 } else { 0.5 };
        let above = limit.above.min(1.0 + ON_CIRCLE).max(least);
        for one in found.multipliers.telling().filter(|one| one.size() > above) {
            let apart = distance(one, dense.multipliers.found());
            let most = if name.contains("wave") { 1e-6 } else { 1e-8 };
            assert!(apart < most, "{name}: {one:?}, {apart:e}");
            if most < 1e-7 {
                farthest = f64::max(farthest, apart);
            }
        }
        for one in dense.multipliers.telling().filter(|one| one.size() > limit.above.max(least)) {
            let apart = distance(one, found.multipliers.found());
            assert!(apart < 1e-6, "{name}: {one:?} is not found: {limit:?}");
        }
        assert!(
            found.multipliers.is_stable().is_none_or(|it| Some(it) == dense.multipliers.is_stable()),
            "{name}"
        );
    }
    println!("{} orbits: off by {largest:e} at most, multipliers by {farthest:e}", all.len());
}

#[test]
fn a_branch_by_products_changes_where_that_by_matrices_does_and_bears_none() {
    let file = "chain = { beads = 2, bead_mass_kg = 1.0, alpha = 1.5, stiffness = 1.0 }\n\
         ends = { left = 'fixed', right = 'fixed' }\nload = { precompression_n = 1.0 }\n\
         on_site = { drag_n_s_per_m = 0.05 }\norbit = { steps = 100 }\n\
         drive = [{ wall = 'left', displacement_m = { sine = { amplitude = 0.155, frequency_hz = 0.385 } } }]\n\
         continue = { key = 'drive[0].displacement_m.sine.amplitude', from = 0.155, to = 0.175, branches = true }";
    let [dense, found] = [None, Some(0)].map(|most| with_born_by(file, most));
    let place = |branch: &common::Branch| (branch.changes[0].name, branch.changes[0].orbit.unknown.parameter);
    let ((name, at), (other_name, other)) = (place(&dense.0), place(&found.0));
    assert!(name == other_name && (at / other - 1.0).abs() < 1e-9, "{name} at {at}, {other_name} at {other}");
    let why = found.1.expect_err("branches need all multipliers").to_string();
    assert!(why.contains("up to 1000 beads"), "{why}");
}

/// A breather of heavy and light beads on springs, at a light bead near the middle: no bead far from it moves.
fn breather(beads: u32) -> String {
    let period_s = std::f64::consts::TAU / 3.15;
    let middle = beads / 4 * 2;
    let place = |bead: u32| {
        let from = (f64::from(bead) - f64::from(middle)).abs();
        if bead.is_multiple_of(2) {
            0.9 / (0.25 * from).cosh() * if (from / 2.0) % 2.0 == 0.0 { 1.0 } else { -1.0 }
        } else {
            0.0
        }
    };
    format!(
        "chain = {{ beads = {beads}, bead_mass_kg = 1.0, {SPHERES}, masses = {{ pattern_kg = [0.3, 1.0] }} }}\n{FIXED}{LOAD}\
         on_site = {{ linear_n_per_m = 0.3 }}\ninitial = {{ displacements_m = {} }}\n\
         orbit = {{ period_s = {period_s}, steps = 160 }}",
        list((0..beads).map(place))
    )
}

#[test]
fn a_breather_is_the_same_in_a_chain_fifteen_times_as_long() {
    let [short, long] = [200, 3000].map(|beads| tried_by(&breather(beads), None).expect("a breather"));
    assert!((long.energy_j / short.energy_j - 1.0).abs() < 1e-9, "{} for {}", long.energy_j, short.energy_j);
    let limit = long.multipliers.limit().expect("a limit");
    let large =
        |orbit: &Orbit| orbit.multipliers.telling().take_while(|one| one.size() > limit.above).count();
    assert!(large(&short) == 2 && large(&long) == 2, "{:?}", long.multipliers);
    for (one, other) in short.multipliers.telling().zip(long.multipliers.telling()).take(2) {
        assert!(distance(one, &[other]) < 1e-9, "{one:?}, {other:?}");
    }
    println!("residuals {:?}, {limit:?}", long.residuals);
}

#[test]
fn a_long_chain_that_is_shaken_is_stable() {
    let (_, toml) = &shaken(2000, 0.3)[0];
    // springs hold long waves, which drag alone lets fade ever more slowly
    let toml = toml.replace("on_site = { ", "on_site = { linear_n_per_m = 0.3, ");
    let found = tried_by(&toml, None).expect("an orbit");
    assert!(found.returns < 1e-12 && found.multipliers.is_stable() == Some(true), "{:?}", found.multipliers);
}
