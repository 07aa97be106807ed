//! `--dt auto:TOL` finds a step that keeps the energy as well as asked.

use crate::harness::Place;

const CHAIN: &str = "run --preset homogeneous --beads 40 --duration 2e-3";

/// The step that `--dt auto:tolerance` gives a run with these flags, and the run's drift.
fn step_and_drift(place: &Place, flags: &str, tolerance: f64) -> (f64, f64) {
    let words = format!("{CHAIN} {flags} --dt auto:{tolerance:e} --json --force");
    let run = place.run(&words).exits(0).says(&["tried dt", "took dt", "max|ΔE/E|"]);
    let info = place.run("info homogeneous.mcap --json").exits(0).json();
    let dt_s = info["manifest"]["physics"]["dt_s"].as_f64().unwrap();
    // the recording says where its step comes from
    let toml = info["run_toml"].as_str().unwrap();
    assert!(toml.contains(&format!("# --dt auto:{tolerance:e} took dt = {dt_s:e} s")), "{toml}");
    assert!(toml.contains("dt_s = "), "{toml}");
    (dt_s, run.json()["relative_drift"].as_f64().unwrap().abs())
}

#[test]
fn the_energy_error_is_within_the_tolerance_for_every_method() {
    let place = Place::new();
    for method in ["velocity-verlet", "rkn4", "gear5"] {
        for (alpha, tolerance) in [(1.5, 1e-6), (3.0, 1e-9)] {
            let flags = format!("--method {method} --alpha {alpha}");
            let (dt_s, drift) = step_and_drift(&place, &flags, tolerance);
            assert!(drift <= tolerance, "{flags}: {drift:e} at dt = {dt_s:e} s");
        }
    }
}

#[test]
fn a_smaller_tolerance_takes_a_shorter_step_and_the_same_one_the_same() {
    let place = Place::new();
    let (first, _) = step_and_drift(&place, "", 1e-8);
    let (again, _) = step_and_drift(&place, "", 1e-8);
    let (finer, _) = step_and_drift(&place, "", 1e-11);
    assert_eq!(first, again);
    assert!(finer < 0.5 * first, "{first:e} {finer:e}");
}

/// Damped contacts dissipate energy, which is counted: what is left is the error of the method.
#[test]
fn dissipated_work_is_no_error() {
    let place = Place::new();
    let preset = place.run("preset homogeneous").exits(0).stdout();
    place.write("homogeneous.toml", &format!("{preset}\n[damping]\nrestitution = 0.8\n"));
    let words = "run homogeneous.toml --method gear5 --beads 40 --duration 2e-3 --dt auto:1e-6 --json";
    let run = place.run(words).exits(0);
    assert!(run.json()["relative_drift"].as_f64().unwrap().abs() <= 1e-6);
}

#[test]
fn what_rounding_does_not_allow_is_refused_with_what_is_possible() {
    let place = Place::new();
    let says = ["auto:1e-16 is out of reach", "rounding", "the best that was found", "ask for auto:"];
    place.run(&format!("{CHAIN} --dt auto:1e-16")).exits(2).says(&says);
    assert!(!place.path("homogeneous.mcap").exists() && !place.path("homogeneous.mcap.partial").exists());
    place.run(&format!("{CHAIN} --dt auto:often")).exits(2).says(&["auto:TOL"]);
}
