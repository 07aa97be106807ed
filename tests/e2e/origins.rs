//! Rings have no ends and walls are told from free ends: what `pulses`, `energies` and the Python check say of them; and how far the
//! energies of driven chains may be off.

use crate::harness::{Place, python};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

/// 1 g, 1e7 N·m^−3/2.
fn chain(place: &Place, name: &str, beads: u64, rest: &str) {
    let text = format!(
        "[chain]\nbeads = {beads}\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n{rest}\n[stream]\npublish_every_steps = 4\nrecord_every_steps = 4\n"
    );
    place.write(&format!("{name}.toml"), &text);
    place.run(&format!("run {name}.toml")).exits(0);
}

/// The words for what pulses come from, and for what becomes of them.
fn origins(place: &Place, name: &str) -> [BTreeSet<String>; 2] {
    let told = place.run(&format!("pulses {name}.mcap --json --every-step"));
    let pulses = told.json()["results"]["pulses"].as_array().unwrap().clone();
    let words = |of: &dyn Fn(&Value) -> Value| {
        pulses.iter().map(|pulse| of(pulse).as_str().unwrap().to_owned()).collect()
    };
    [words(&|pulse| pulse["birth"]["from"].clone()), words(&|pulse| pulse["end"]["by"].clone())]
}

fn has(words: &BTreeSet<String>, word: &str) -> bool {
    words.contains(word)
}

#[test]
fn a_ring_has_a_seam_and_no_ends() {
    let place = Place::new();
    let rest = "[ends]\nleft = \"periodic\"\nright = \"periodic\"\n[striker]\nbead = 40\nvelocity_m_s = 5\n[time]\nduration_s = 0.01";
    chain(&place, "ring", 80, rest);
    let [births, fates] = origins(&place, "ring");
    assert!(has(&births, "striker") && has(&births, "seam") && has(&fates, "seam"), "{births:?} {fates:?}");
    assert!(!has(&births, "end") && !has(&fates, "end"), "{births:?} {fates:?}");
}

#[test]
fn every_striker_every_wall_and_every_drive_is_an_origin() {
    let place = Place::new();
    let strikers = "[[striker]]\nbead = 0\nvelocity_m_s = 2\n[[striker]]\nbead = 60\nvelocity_m_s = 2\n";
    let walls = "[ends]\nleft = \"fixed\"\nright = \"fixed\"\n";
    chain(&place, "two", 120, &format!("{walls}{strikers}[time]\nduration_s = 0.012"));
    let [births, fates] = origins(&place, "two");
    assert!(has(&births, "striker") && has(&births, "wall") && has(&fates, "wall"), "{births:?} {fates:?}");
    assert!(!has(&births, "end") && !has(&fates, "end"), "{births:?} {fates:?}");

    let shaken = "[load]\nprecompression_n = 20\n[[drive]]\nwall = \"left\"\n\
        displacement_m = { half_sine = { amplitude = 2e-6, duration_s = 2e-4, at_s = 1e-4 } }\n";
    chain(&place, "shaken", 100, &format!("{walls}{shaken}[time]\nduration_s = 0.004"));
    let [births, _] = origins(&place, "shaken");
    assert!(has(&births, "drive") && !has(&births, "end"), "{births:?}");
}

/// A chain at rest that a wall begins to shake has no energy of its own: nothing of it is exact for that.
#[test]
fn energies_of_a_driven_chain_are_no_more_exact_than_their_balance() {
    let place = Place::new();
    let rest = "[ends]\nleft = \"fixed\"\n[load]\nprecompression_n = 20\n[[drive]]\nwall = \"left\"\n\
        displacement_m = { sine = { amplitude = 3e-7, frequency_hz = 2e3, ramp_s = 5e-4 } }\n[time]\nduration_s = 0.003";
    chain(&place, "driven", 30, rest);
    let found = place.run("energies driven.mcap --json --out e.csv").exits(0).json();
    let said = found["results"]["step_error_j"].as_f64().unwrap();
    let table = place.read("e.csv");
    let heads: Vec<&str> = table.lines().next().unwrap().split(',').collect();
    let column = |name: &str| heads.iter().position(|head| *head == name).unwrap();
    let [total, dissipated, driven] = ["total_j", "dissipated_j", "driven_j"].map(column);
    let balance = table.lines().skip(1).map(|line| {
        let number = |column: usize| line.split(',').nth(column).unwrap().parse::<f64>().unwrap();
        (number(total) + number(dissipated) - number(driven)).abs()
    });
    let off = balance.fold(0.0, f64::max);
    assert!(off > 0.0 && said >= off && said < 10.0 * off, "{said:e} {off:e}");
    let text = place.run("energies driven.mcap").exits(0).stdout();
    assert!(text.contains("from the balance of energies alone"), "{text}");
}

/// The two beads beside the seam press each other at first, and nothing else does: half of that is left of bead 5, half right of it.
#[test]
fn half_of_the_ring_contact_counts_on_each_side() {
    let place = Place::new();
    let u: Vec<&str> = (0..10).map(|bead| if bead == 0 { "-1e-5" } else { "0.0" }).collect();
    let rest = format!(
        "[ends]\nleft = \"periodic\"\nright = \"periodic\"\n[initial]\ndisplacements_m = [{}]\n[striker]\nbead = 0\nvelocity_m_s = 0\n\
         [time]\nduration_s = 1e-4",
        u.join(", ")
    );
    chain(&place, "seam", 10, &rest);
    let told = place.run("energies seam.mcap --split 5 --out e.csv").exits(0).stdout();
    assert!(told.contains("half of its energy counts left, half right"), "{told}");
    let table = place.read("e.csv");
    let mut lines = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let (heads, first) = (lines.next().unwrap(), lines.next().unwrap());
    let at = |name: &str| first[heads.iter().position(|head| *head == name).unwrap()].parse::<f64>().unwrap();
    assert!(
        at("left_j") > 0.0 && at("left_j") == at("right_j") && at("total_j") == at("left_j") + at("right_j")
    );
}

/// With resonators the modes of N beads are 2N, and none is shared by more than N beads.
#[test]
fn participation_counts_beads_and_not_what_is_in_them() {
    let place = Place::new();
    let rest = "[ends]\nleft = \"periodic\"\nright = \"periodic\"\n[load]\nprecompression_n = 20\n\
        [resonators]\nmass_kg = 0.5e-3\nstiffness_n_per_m = 1e5\n[striker]\nbead = 0\nvelocity_m_s = 0.01\n[time]\nduration_s = 1e-4";
    chain(&place, "inner", 12, rest);
    let found = place.run("modes inner.mcap --json").exits(0).json();
    let modes = found["results"]["modes"].as_array().unwrap();
    let shared: Vec<f64> = modes.iter().map(|mode| mode["participation_beads"].as_f64().unwrap()).collect();
    assert_eq!(shared.len(), 24);
    assert!(shared.iter().all(|beads| *beads < 12.0 + 1e-9), "{shared:?}");
    // together, and all beads against what is in them
    assert!(shared.iter().filter(|beads| **beads > 12.0 - 1e-9).count() >= 2, "{shared:?}");
}

/// The drag of an absorbing end is what the page says that it is by default.
#[test]
fn the_usual_drag_of_an_absorbing_end_is_that_of_the_page() {
    let place = Place::new();
    let striker = "[striker]\nbead = 0\nvelocity_m_s = 5\n[time]\nduration_s = 8e-3";
    let last = |name: &str, drag: &str| {
        chain(&place, name, 60, &format!("[ends]\nright = \"absorbing\"\n{drag}{striker}"));
        place.run(&format!("energies {name}.mcap --json")).exits(0).json()["results"]["last"].clone()
    };
    // T = (m/k)^(2/5)·v0^(−1/5) for α = 1.5, so m/T = 13.8 N·s/m
    let collision_s = (1e-3_f64 / 1e7).powf(0.4) * 5.0_f64.powf(-0.2);
    let written = format!("absorbing_drag_n_s_per_m = {:?}\n", 0.005 * (1e-3 / collision_s));
    let (usual, given) = (last("usual", ""), last("given", &written));
    let dissipated = |last: &Value| last["dissipated_j"].as_f64().unwrap();
    assert!(dissipated(&usual) > 0.0);
    assert!((dissipated(&usual) / dissipated(&given) - 1.0).abs() < 1e-9, "{usual} {given}");
    let page = include_str!("../../docs/CONFIGURATION.md");
    assert!(page.contains("1/200 of m/T where beads are loose"));
}

/// By a program that was written from the page, with the functions of `docs/KERNEL.md`.
#[test]
fn random_numbers_are_made_again_from_the_page() {
    let Some(python) = python() else { return };
    let project = Path::new(env!("CARGO_MANIFEST_DIR"));
    let made = Command::new(python)
        .arg(project.join("tests/python/random_chains.py"))
        .arg(project.join("docs/CONFIGURATION.md"))
        .output()
        .unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stdout));
}
