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
    let words = "run homogeneous.toml --method rk5 --beads 40 --duration 2e-3 --dt auto:1e-6 --json";
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

/// A chain of `chain` and what else, over `duration_s`.
fn chain(rest: &str, duration_s: &str) -> String {
    format!(
        "[chain]\nbeads = 8\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n{rest}\n[time]\nduration_s = {duration_s}\n"
    )
}

const SHAKEN: &str = "[ends]\nleft = \"fixed\"\n[[drive]]\nwall = \"left\"\n\
    displacement_m = { sine = { amplitude = 1e-5, frequency_hz = 1000.0, ramp_s = 0.001 } }";

/// Nothing strikes, nothing presses: the overlap that decides how fast such a damping acts is that of the drive.
#[test]
fn dampings_of_a_driven_unloaded_chain_have_a_step() {
    let place = Place::new();
    for damping in ["kuwabara_kono_s = 1e-6", "power = { coefficient = 1e3, exponent = 0.5 }"] {
        let toml = chain(&format!("{SHAKEN}\n[damping]\n{damping}\n[integrator]\nmethod = \"rk5\""), "2e-3");
        place.write("hang.toml", &toml);
        let run = place.run("run hang.toml --no-record --json").exits(0).json();
        assert!(run["relative_drift"].as_f64().unwrap().abs() < 1e-4, "{damping}: {run}");
    }
}

/// Such runs never began: their step was a power of 0.
#[test]
fn a_chain_that_nothing_moves_is_refused() {
    let place = Place::new();
    let zeros = [
        "[initial]\ngaussian = { bead = 5, width_beads = 2, displacement_m = 0.0 }",
        "[[drive]]\nbead = 3\nforce_n = { sine = { amplitude = 0.0, frequency_hz = 1000.0 } }",
        "[[striker]]\nbead = 0\nvelocity_m_s = 0.0\n[[striker]]\nbead = 1\nvelocity_m_s = 0.0",
    ];
    for zero in zeros {
        place.write("zero.toml", &chain(zero, "1e-3"));
        for words in ["run zero.toml --dry-run", "check zero.toml", "run zero.toml --dt 1e-6"] {
            place.run(words).exits(2).says(&["nothing sets this chain in motion"]);
        }
    }
    let wrong = [
        (
            "[initial]\ngaussian = { bead = nan, width_beads = 2, displacement_m = 1e-6 }",
            "initial.gaussian.bead",
        ),
        ("[initial]\nplane_wave = { cycles = inf, velocity_m_s = 1.0 }", "initial.plane_wave.cycles"),
        (
            "[initial]\nplane_wave = { cycles = 1, velocity_m_s = 1.0, phase_rad = nan }",
            "initial.plane_wave.phase_rad",
        ),
        ("[initial]\nvelocities_m_s = [1e-250, 0, 0, 0, 0, 0, 0, 0]", "L = "),
        ("[[drive]]\nbead = 3\nforce_n = { sine = { amplitude = nan, frequency_hz = 1000.0 } }", "amplitude"),
    ];
    for (wrong, says) in wrong {
        place.write("wrong.toml", &chain(wrong, "1e-3"));
        place.run("run wrong.toml --dry-run").exits(2).says(&[says]);
    }
}

/// A sweep with a point whose drive has the amplitude 0 is refused before any is computed.
#[test]
fn a_sweep_says_at_which_point_nothing_moves() {
    let place = Place::new();
    let sweep = "[base]\nchain.beads = 8\nchain.bead_mass_kg = 1e-3\nchain.alpha = 1.5\nchain.stiffness = 1e7\n\
        time.duration_s = 1e-4\n\
        drive = [{ bead = 3, force_n = { sine = { amplitude = 0.1, frequency_hz = 1000.0, ramp_s = 1e-4 } } }]\n\
        [grid]\n\"drive[0].force_n.sine.amplitude\" = [0.0, 0.1]\n";
    place.write("amp.toml", sweep);
    place.run("sweep amp.toml --out amp").exits(2).says(&["nothing sets this chain in motion", "(point 0)"]);
}

/// Masses of 1 kg on springs whose force grows as exp(50 δ): the energy of the striker bounds how far they are pressed.
#[test]
fn a_hard_toda_chain_has_a_step_that_its_energy_allows() {
    let place = Place::new();
    let toda = "[chain]\nbeads = 8\nbead_mass_kg = 1.0\n\
        bonds = { toda = { stiffness = 1.0, steepness_per_m = 50.0 } }\n\
        [striker]\nbead = 0\nvelocity_m_s = 1.5\n[time]\nduration_s = 4.0\n";
    place.write("toda.toml", toda);
    let would = place.run("run toda.toml --dry-run --json").exits(0).json();
    let steps = would["manifest"]["physics"]["step_count"].as_u64().unwrap();
    assert!((1_000..100_000).contains(&steps), "{steps} steps");
    assert!(would["step"].as_str().unwrap().contains("by the contact of beads 0 and 1"), "{would}");
    let run = place.run("run toda.toml --no-record --json --dt 5e-4").exits(0).json();
    assert!(run["relative_drift"].as_f64().unwrap().abs() < 1e-5, "{run}");
}

/// α = 3 and α = 1.3 in turn, of nearly the same slopes under their load: each contact has the step of its own law.
#[test]
fn exponents_far_apart_have_the_steps_of_their_own_laws() {
    let place = Place::new();
    let toml = "[chain]\nbeads = 8\nbead_mass_kg = 1e-3\nalpha = 1.3\nstiffness = 1.59e6\n\
        alphas = { pattern = [3.0, 1.3] }\nstiffnesses = { pattern = [1e13, 1.59e6] }\n\
        [load]\nprecompression_n = 1.346\n[striker]\nbead = 0\nvelocity_m_s = 1.365\n[time]\nduration_s = 0.00146\n";
    place.write("alphas.toml", toml);
    let run = place.run("run alphas.toml --no-record --json").exits(0).json();
    assert!(run["steps"].as_u64().unwrap() < 50_000, "{run}");
    assert!(run["relative_drift"].as_f64().unwrap().abs() < 1e-7, "{run}");
}

#[test]
fn what_decides_the_step_is_said() {
    let place = Place::new();
    let said = |words: &str, expected: &str| {
        let text = place.run(&format!("run {words} --dry-run")).exits(0).stdout();
        assert!(text.contains(expected), "{words}: {text}");
    };
    said("--preset homogeneous", "as it is by default, by the collision time T");
    said("--preset homogeneous --dt 1e-6", "as asked; 1.45 µs would be the default, by the collision time T");
    said("--preset light-impurity --impurity 500=0.1e-3", "by bead 500, the lightest");
    said("--preset band-gap", "by the contact of beads 0 and 1");
    place.write("stiff.toml", &chain("[damping]\nviscous_n_s_per_m = 500.0\n[integrator]\nmethod = \"rk5\"\n[striker]\nbead = 0\nvelocity_m_s = 5.0", "1e-5"));
    said("stiff.toml", "by the damping");
    place.run("run stiff.toml --no-record").exits(0).says(&["(by the damping)"]);
    // dashpots of bonds settle as those of contacts do
    let bonds = "[chain]\nbeads = 9\nbead_mass_kg = 1e-3\nbonds = { linear = 1.0 }\n[damping]\nviscous_n_s_per_m = 3.0\n\
        [striker]\nbead = 4\nvelocity_m_s = 0.4\n[time]\nduration_s = 0.1\n";
    place.write("bonds.toml", bonds);
    said("bonds.toml", "by the damping");
    let run = place.run("run bonds.toml --no-record --json").exits(0).json();
    let drift = run["relative_drift"].as_f64().unwrap_or(f64::NAN);
    assert!(drift.abs() < 1e-3, "{drift:e}");
    place.run("run bonds.toml --no-record --dt 1e-3").exits(2).says(&["time.dt_s", "allowed"]);
}

/// A longer step than the default does where four digits are enough, and `check` says how long: then it is true.
#[test]
fn check_says_which_longer_step_would_do() {
    let place = Place::new();
    let dimer = "check --preset dimer --beads 40 --duration 3e-3";
    let check = place.run(&format!("{dimer} --json")).exits(0).json();
    let longer_s = check["longer_dt_s"].as_f64().unwrap();
    assert!(longer_s > 1.5 * check["dt_s"].as_f64().unwrap(), "{longer_s:e}");
    place.run(&format!("{dimer} --dt {longer_s:e}")).exits(0);
    assert!(place.run(dimer).exits(0).stdout().contains("times as long would do, --dt"));
    // contacts that stay closed have the whole order of the method
    let walls = "[ends]\nleft = \"fixed\"\nright = \"fixed\"\n[load]\nprecompression_n = 20.0\n[striker]\nbead = 0\nvelocity_m_s = 0.1";
    for method in ["rkn4", "rk5", "gear5"] {
        let pressed = chain(&format!("[integrator]\nmethod = \"{method}\"\n{walls}"), "0.05");
        place.write("p.toml", &pressed);
        let check = place.run("check p.toml --json").exits(0).json();
        let longer_s = check["longer_dt_s"].as_f64();
        assert!(longer_s.is_some() || method != "rkn4");
        let Some(longer_s) = longer_s else { continue };
        place.run(&format!("check p.toml --dt {longer_s:e}")).exits(0);
    }
}
