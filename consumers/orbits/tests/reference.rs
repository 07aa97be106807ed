//! Orbits and multipliers of another program: `tests/reference/orbits.csv`.

#![expect(clippy::panic, reason = "a test may panic")]

mod common;

use common::{Branch, find, follow, list};
use orbits::Orbit;
use std::collections::BTreeMap;

/// Rows of the reference: case, quantity, value, tolerance.
fn rows() -> impl Iterator<Item = (&'static str, &'static str, f64, f64)> {
    include_str!("../../../tests/reference/orbits.csv").lines().skip(1).map(|line| {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |place: usize| fields[place].parse().expect("a number");
        (fields[0], fields[1], number(2), number(3))
    })
}

/// A quantity of an orbit, by its name in the reference.
fn quantity(orbit: &Orbit, name: &str) -> f64 {
    let words: Vec<&str> = name.split(' ').collect();
    let index = || -> usize { words[1].parse().expect("a number") };
    match words[0] {
        "period" => orbit.period_s(),
        "energy" => orbit.energy_j,
        "multiplier" => orbit.multipliers.found()[index() - 1].size(),
        "bead" if words[2] == "velocity" => orbit.state.v_m_s[index()],
        "bead" => orbit.state.u_m[index()],
        other => panic!("no quantity {other}"),
    }
}

/// A ring in its highest mode.
fn highest_mode(beads: u32, law: &str, amplitude: f64, asked: &str) -> String {
    let places = (0..beads).map(|i| if i % 2 == 0 { amplitude } else { -amplitude });
    format!(
        "chain = {{ beads = {beads}, bead_mass_kg = 1.0, {law} }}\n\
         ends = {{ left = 'periodic', right = 'periodic' }}\ninitial = {{ displacements_m = {} }}\n{asked}",
        list(places)
    )
}

const FPUT: &str = "bonds = { linear = 1.0, cubic = 1.0 }";

/// A breather in the gap of a pressed diatomic chain, heavy or light at its centre, from the edge of the gap to `omega`.
fn breather(is_heavy: bool, omega: f64) -> String {
    let is_heavy_at = |i: u32| i.is_multiple_of(2) == is_heavy;
    let (amplitude, width) = if is_heavy { (0.8, 0.2) } else { (0.9, 0.25) };
    // where contacts open errors fall slowly
    let steps = if omega < 3.0 { 3200 } else { 400 };
    let place = |i: u32| {
        let from = f64::from(i) - 20.0;
        let turns = if is_heavy { (from.abs() - 1.0) / 2.0 } else { from.abs() / 2.0 };
        let sign = if is_heavy { from.signum() } else { 1.0 } * if turns % 2.0 == 0.0 { 1.0 } else { -1.0 };
        if is_heavy_at(i) { 0.0 } else { sign * amplitude / (width * from.abs()).cosh() }
    };
    let tau = std::f64::consts::TAU;
    format!(
        "chain = {{ beads = 41, bead_mass_kg = 1.0, alpha = 1.5, stiffness = 1.0, masses = {{ list_kg = {} }} }}\n\
         ends = {{ left = 'fixed', right = 'fixed' }}\nload = {{ precompression_n = 1.0 }}\n\
         initial = {{ displacements_m = {} }}\norbit = {{ period_s = {}, steps = {steps} }}\n\
         continue = {{ key = 'orbit.period_s', from = {}, to = {} }}",
        list((0..41).map(|i| if is_heavy_at(i) { 1.0 } else { 0.3 })),
        list((0..41).map(place)),
        tau / 3.1,
        tau / 3.1,
        tau / omega
    )
}

/// A pressed, damped chain whose left wall is shaken.
fn shaken(beads: u32, masses: &str, drag: f64, frequency_hz: f64, amplitude: f64, rest: &str) -> String {
    format!(
        "chain = {{ beads = {beads}, bead_mass_kg = 1.0, alpha = 1.5, stiffness = 1.0{masses} }}\n\
         ends = {{ left = 'fixed', right = 'fixed' }}\nload = {{ precompression_n = 1.0 }}\n\
         on_site = {{ drag_n_s_per_m = {drag} }}\n\
         drive = [{{ wall = 'left', displacement_m = {{ sine = {{ amplitude = {amplitude}, frequency_hz = {frequency_hz} }} }} }}]\n\
         orbit = {{ steps = 400 }}\n{rest}"
    )
}

fn wave(alpha: f64, speed: f64) -> String {
    format!(
        "chain = {{ beads = 19, bead_mass_kg = 1.0, alpha = {alpha:?}, stiffness = 1.0 }}\n\
         initial = {{ solitary = {{ bead = 9, velocity_m_s = 1.0 }} }}\n\
         orbit = {{ period_s = {}, shift_beads = 1, steps = 400 }}",
        1.0 / speed
    )
}

/// The orbit file of a case; the branch to its instability if `changes`.
fn file(case: &str, changes: bool) -> String {
    let along = |from: f64, to: f64| {
        let key = "drive[0].displacement_m.sine.amplitude";
        if changes {
            format!("continue = {{ key = '{key}', from = {from}, to = {to} }}")
        } else {
            String::new()
        }
    };
    let energy =
        |energy_j: f64| format!("orbit = {{ energy_j = {energy_j}, period_s = 3.0, steps = 400 }}\n");
    let threshold = |beads: u32, from: f64, to: f64| {
        let along =
            format!("{}continue = {{ key = 'orbit.energy_j', from = {from}, to = {to} }}", energy(from));
        highest_mode(beads, FPUT, (0.5 * from / f64::from(beads)).sqrt(), &along)
    };
    let dimer = ", masses = { pattern_kg = [1.0, 0.5] }";
    match case {
        "B1-mult-32" => highest_mode(32, FPUT, 0.2, &energy(3.2)),
        "B1-mult-16" => highest_mode(16, FPUT, 0.15, &energy(0.8)),
        "B1-threshold-16" => threshold(16, 0.16, 0.3),
        "B1-threshold-32" => threshold(32, 0.08, 0.13),
        "B2-ring16-0.3" => highest_mode(
            16,
            "alpha = 1.5, stiffness = 1.0",
            0.3,
            "load = { precompression_n = 1.0 }\norbit = { amplitude_m = 0.3, period_s = 2.57, steps = 400 }",
        ),
        "B3-heavy-3.12" => breather(true, 3.12),
        "B3-heavy-2.9" => breather(true, 2.9),
        "B3-light-3.12" => breather(false, 3.12),
        "B3-light-2.9" => breather(false, 2.9),
        "B4-N10-f0.3" => shaken(10, "", 0.05, 0.3, 0.3, &along(0.05, 0.4)),
        "B4-N5-f0.3" => shaken(5, "", 0.05, 0.3, 0.2, &along(0.05, 0.32)),
        "B4-N10-dimer-f0.25" => shaken(10, dimer, 0.03, 0.25, 0.2, &along(0.05, 0.26)),
        "B5-wave-1.5" => wave(1.5, 0.907_470_078_412_186_5),
        "B5-wave-2.0" => wave(2.0, 0.855_251_931_863_514_2),
        other => panic!("no case {other}"),
    }
}

#[test]
fn orbits_are_those_of_another_program() {
    let mut found: BTreeMap<(&str, bool), Branch> = BTreeMap::new();
    let mut wrong = Vec::new();
    for (case, name, expected, tolerance) in rows() {
        let change = name.strip_prefix("change ");
        let branch = found.entry((case, change.is_some())).or_insert_with(|| {
            let file = file(case, change.is_some());
            if file.contains("continue = ") {
                follow(&file)
            } else {
                Branch { last: find(&file), changes: Vec::new() }
            }
        });
        let value = match change {
            None => quantity(&branch.last, name),
            Some("energy") => branch.changes[0].orbit.energy_j,
            Some(kind) => {
                assert_eq!(branch.changes[0].name, kind, "{case}");
                branch.changes[0].orbit.unknown.parameter
            }
        };
        let error = value - expected;
        println!("{case} {name}: {value} for {expected}, off by {error:e} of {tolerance:e}");
        if error.abs() > tolerance {
            wrong.push(format!("{case} {name}: {value} for {expected}, off by {error:e} of {tolerance:e}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
