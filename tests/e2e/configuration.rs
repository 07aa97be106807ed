//! Bad configurations are refused with the key, the value, what is allowed, and the line.

use crate::harness::Place;
use std::process::Stdio;

const TOML: &str = "name = \"mine\"\n\
    [chain]\n\
    beads = 50\n\
    bead_mass_kg = 1e-3\n\
    alpha = 1.5\n\
    stiffness = 1e7\n\
    impurities = [{ bead = 20, mass_kg = 2e-3 }]\n\
    [striker]\n\
    bead = 0\n\
    velocity_m_s = 5.0\n\
    [time]\n\
    duration_s = 1e-4\n";

#[track_caller]
fn refuses(from: &str, to: &str, says: &[&str]) {
    let place = Place::new();
    assert!(TOML.contains(from));
    place.write("mine.toml", &TOML.replace(from, to));
    place.run("run mine.toml").exits(2).says(says);
    assert!(!place.path("mine.mcap").exists() && !place.path("mine.mcap.partial").exists());
}

#[test]
fn a_configuration_file_is_run() {
    let place = Place::new();
    place.write("mine.toml", TOML);
    place.run("run mine.toml").exits(0);
    let info = place.run("info mine.mcap --json").exits(0).json();
    assert_eq!(info["run_toml"], TOML);
    assert_eq!(info["manifest"]["physics"]["impurities"][0]["bead"], 20);
    assert_eq!(info["complete"], true);
}

/// With `--force`, too, no recording replaces what its run was read from.
#[test]
fn no_run_replaces_its_inputs() {
    let place = Place::new();
    place.run("run --preset homogeneous --beads 20 --duration 1e-4 --out from.mcap").exits(0);
    place.write("push.mcap", "time_s,value\n0.0,0.0\n5e-4,3.0\n");
    let chain =
        "chain = { beads = 20, bead_mass_kg = 1e-3, alpha = 1.5, stiffness = 1e7 }\ntime.duration_s = 1e-4\n";
    let names = "initial.from = { recording = \"from.mcap\", step = 1 }\n\
                 [[drive]]\nbead = 0\nforce_n = { csv = \"push.mcap\" }\n";
    place.write("config.mcap", &format!("{chain}{names}"));
    for name in ["config.mcap", "from.mcap", "push.mcap"] {
        place.run(&format!("run config.mcap --out {name} --force")).exits(2).says(&[name, "source itself"]);
    }
    place.run("run config.mcap --out run.mcap").exits(0);
}

/// No source of their numbers was found; the message names the numbers that take their place.
#[test]
fn materials_without_a_source_have_no_name() {
    let contact = "bead_mass_kg = 1e-3\n    alpha = 1.5\n    stiffness = 1e7\n    impurities = [{ bead = 20, mass_kg = 2e-3 }]\n".replace("    ", "");
    for name in ["ptfe", "tungsten-carbide"] {
        let spheres = format!("spheres = {{ material = \"{name}\", radius_m = 5e-3 }}\n");
        refuses(&contact, &spheres, &[name, "chrome-steel", "density_kg_m3, young_pa and poisson"]);
    }
}

#[test]
fn unknown_keys() {
    refuses("stiffness", "stifness", &["mine.toml:6", "stifness", "stiffness"]);
}

#[test]
fn impossible_values() {
    refuses("alpha = 1.5", "alpha = 0.5", &["mine.toml:5", "chain.alpha", "0.5", "allowed"]);
    refuses("mass_kg = 2e-3", "mass_kg = -2e-3", &["mine.toml:7", "impurities[0].mass_kg", "-0.002"]);
    refuses("bead = 20", "bead = 50", &["mine.toml:7", "impurities[0].bead", "50", "0 to 49"]);
    refuses("velocity_m_s = 5.0", "velocity_m_s = 0.0", &["mine.toml:10", "striker.velocity_m_s"]);
    refuses(
        "duration_s = 1e-4",
        "duration_s = 1e-4\ndt_s = 1.0",
        &["mine.toml:13", "time.dt_s", "collision time"],
    );
    refuses("\"mine\"", "\"My Run\"", &["mine.toml:1", "name", "a-z"]);
}

#[test]
fn things_that_are_not_toml() {
    refuses("[chain]", "[chain", &["mine.toml:2"]);
    refuses("beads = 50", "beads = \"many\"", &["mine.toml:3", "many"]);
}

#[test]
fn bad_flags() {
    let place = Place::new();
    place.run("run --alpha 0.5").exits(2).says(&["chain.alpha", "0.5", "allowed"]);
    place.run("run --impurity 500").exits(2).says(&["BEAD=VALUE"]);
    place.run("run --preset nothing").exits(2).says(&["nothing", "light-impurity"]);
    place.run("run --method euler").exits(2).says(&["euler", "rkn4"]);
    place.run("run --preset dimer --bead-mass 2e-3").exits(2).says(&["--bead-mass", "chain.masses"]);
    place.run("run /dev/zero").exits(2).says(&["/dev/zero", "256 MiB"]);
    place.run("run missing.toml").exits(2).says(&["missing.toml"]);
    place.run("energies live:Not_A_Name").exits(2).says(&["Not_A_Name", "a-z"]);
    place.run("run --preset homogeneous --duration 1e-4").exits(0);
    place.run("energies homogeneous.mcap --split 200").exits(2).says(&["--split 200", "0 to 199"]);
    place.run("impurity homogeneous.mcap --bead 999").exits(2).says(&["--bead 999", "0 to 199"]);
    place.run("contacts homogeneous.mcap --out map.txt").exits(2).says(&["map.txt", ".mcap"]);
    place.run("energies homogeneous.mcap --figure e.gif").exits(2).says(&["e.gif", ".svg"]);
}

/// A mistake in the file is shown where it stands, also when flags replace other values of it.
#[test]
fn mistakes_are_located_unless_a_flag_made_them() {
    let place = Place::new();
    place.write("bad.toml", &TOML.replace("alpha = 1.5", "alpha = 0.5"));
    place.run("run bad.toml --name x --duration 2e-4").exits(2).says(&["bad.toml:5", "chain.alpha"]);
    place.write("good.toml", TOML);
    let flag = place.run("run good.toml --alpha 0.7").exits(2).says(&["chain.alpha", "0.7"]);
    assert!(!flag.stderr().contains("good.toml"), "{}", flag.stderr());
}

/// A program that nobody listens to does its work all the same.
#[test]
fn a_closed_stderr_is_no_failure() {
    let place = Place::new();
    let mut command = place.command(["run", "--preset", "homogeneous", "--duration", "1e-4"]);
    let mut run = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    drop(run.stderr.take());
    assert_eq!(run.wait().unwrap().code(), Some(0));
    place.run("info homogeneous.mcap").exits(0);
}

/// Flags replace what the file says, and the recording keeps the effective configuration.
#[test]
fn flags_replace_values_of_the_file() {
    let place = Place::new();
    place.write("mine.toml", TOML);
    place.run("run mine.toml --alpha 2 --impurity none --striker 49=-3 --name other").exits(0);
    let info = place.run("info other.mcap --json").exits(0).json();
    let physics = &info["manifest"]["physics"];
    assert_eq!(physics["alpha"], 2.0);
    assert_eq!(physics["impurities"].as_array().unwrap().len(), 0);
    assert_eq!(
        (physics["striker"]["bead"].as_u64(), physics["striker"]["velocity_m_s"].as_f64()),
        (Some(49), Some(-3.0))
    );
    let toml = info["run_toml"].as_str().unwrap();
    assert!(toml.starts_with("# mine.toml") && toml.contains("alpha = 2.0"), "{toml}");
}
