//! What no chain can be is refused with its line, what was found and what is allowed.

use crate::harness::Place;

const CHAIN: &str = "[chain]\nbeads = 10\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n";
const SPHERES: &str = "[chain]\nbeads = 10\n";
const STRUCK: &str = "[striker]\nbead = 0\nvelocity_m_s = 5.0\n[time]\nduration_s = 1e-3\ndt_s = 1e-7\n";

/// Words of the parser that no message may have.
const LEAKS: [&str; 8] =
    ["did not match", "variant", "invalid type", "flatten", "f64", "struct", "expected", "map"];

/// Refuses each of the texts after `chain` where `marked` stands, and says why.
fn refuses(chain: &str, rows: &[(&str, &str, &[&str])]) {
    let place = Place::new();
    for (text, marked, says) in rows {
        let toml = format!("{chain}{text}\n{STRUCK}");
        let line = 1 + toml.lines().position(|line| line.starts_with(marked)).unwrap();
        place.write("mine.toml", &toml);
        let ended = place.run("run mine.toml").exits(2).says(says).says(&[&format!("mine.toml:{line}: ")]);
        let said = ended.stderr();
        assert!(said.contains("found ") || said.contains("missing"), "{text}: {said}");
        assert!(
            said.contains("allowed: ") || said.contains("missing") || said.contains(".csv"),
            "{text}: {said}"
        );
        assert!(!LEAKS.iter().any(|leak| said.contains(leak)), "{text}: {said}");
    }
}

#[test]
fn drives() {
    refuses(
        CHAIN,
        &[
            (
                "[[drive]]\nbead = 3\nforce_n = 1.0\n[[drive]] # again\nbead = 3\nforce_n = 2.0",
                "[[drive]] # again",
                &["drive[1]", "bead 3", "drive[0]"],
            ),
            (
                "[[drive]]\nbead = 3\nforce_n = { table = { times_s = [0.0, 5e-4], values = [0.0, 1.0] } }",
                "force_n",
                &["times_s[1]", "found 0.0005", "end of the run at 0.001 s"],
            ),
            (
                "[[drive]]\nbead = 3\nforce_n = { sine = { amplitude = 1.0, frequency_hz = 1e6 } }",
                "force_n",
                &["1000000 Hz", "at least 20 steps", "time.dt_s"],
            ),
            (
                "[[drive]]\nbead = 3\nforce_n = { square = { amplitude = 1.0 } }",
                "force_n",
                &["square", "sine, chirp"],
            ),
            ("[[drive]]\nbead = 3\nforce_n = { csv = \"no.csv\" }", "force_n", &["no.csv"]),
            ("[[drive]]\nwall = \"right\"\nvelocity_m_s = 2.0", "wall", &["right = \"fixed\" in [ends]"]),
            ("[[drive]]\nbead = 3", "[[drive]]", &["0 of `force_n`", "one for each [[drive]]"]),
            ("[drive]\nbead = 3\nforce_n = 1.0", "[drive]", &["tables under [[drive]]"]),
            ("[[drive]]\nbead = 0\nvelocity_m_s = 1.0", "bead = 0", &["not struck"]),
            (
                "[integrator]\nmethod = \"gear5\"\n[[drive]]\nbead = 3\nforce_n = 1.0",
                "method",
                &["found gear5", "rkn4"],
            ),
        ],
    );
}

#[test]
fn materials() {
    refuses(
        SPHERES,
        &[
            (
                "spheres = { density_kg_m3 = 7800.0, young_pa = 2e11, radius_m = 5e-3 }",
                "spheres",
                &["found no poisson", "`material`"],
            ),
            ("spheres = { material = \"steel\" }", "spheres", &["found no radius", "diameter_m"]),
            (
                "spheres = { material = \"unobtanium\", radius_m = 5e-3 }",
                "spheres",
                &["`unobtanium`", "steel", "brass"],
            ),
            (
                "spheres = { material = \"steel\", radius_m = 5e-3 }\n\
                 odd_spheres = [{ bead = 3, material = \"steel\", radius_m = \"big\" }]",
                "odd_spheres",
                &["odd_spheres[0].radius_m", "found \"big\"", "a number"],
            ),
            (
                "bead_mass_kg = 5.0\nspheres = { material = \"steel\", radius_m = 5e-3 }",
                "bead_mass_kg",
                &["chain.bead_mass_kg: found 5", "none beside `spheres`", "e-3 kg"],
            ),
            (
                "spheres = { material = \"steel\", radius_m = 5e-3 }\nstiffness = 1e7",
                "stiffness",
                &["chain.stiffness: found 1e7", "none beside `spheres`", "leave one of them out"],
            ),
            (
                "alpha = 1.5\nbead_mass_kg = 1e-3\nstiffness = nan",
                "stiffness",
                &["chain.stiffness: found nan", "a number"],
            ),
        ],
    );
}

#[test]
fn laws_ends_and_methods() {
    refuses(
        CHAIN,
        &[
            ("alphas = { list = [1.5, 2.0] }", "alphas", &["2 values", "9 values"]),
            (
                "alphas = { list = [1.5], pattern = [1.5] }",
                "alphas",
                &["`pattern` and `list`", "one of them"],
            ),
            (
                "gaps_m = 1e-6\n[load]\nprecompression_n = 1.0",
                "gaps_m",
                &["gaps with a load", "[load] presses together"],
            ),
            ("[ends]\nleft = \"periodic\"", "left", &["periodic at one end", "right = \"periodic\""]),
            (
                "[ends]\nleft = \"periodic\"\nright = \"periodic\"\n[load]\nprecompression_n = 1.0\n\
                 [on_site]\nlinear_n_per_m = 1.0",
                "[on_site]",
                &["springs in a loaded ring", "no load"],
            ),
            (
                "[integrator]\nmethod = \"rkn4\"\n[on_site]\ndrag_n_s_per_m = 1.0",
                "method",
                &["found rkn4", "rk5 with drag"],
            ),
            (
                "[[disorder]]\nof = \"masses\"\nuniform = 1.5",
                "[[disorder]]",
                &["seed 0", "bead 2", "kg", "above 0", "log_normal"],
            ),
        ],
    );
}

#[test]
fn several_strikers_and_a_seed_are_given_by_flags() {
    let place = Place::new();
    let run = "run --preset homogeneous --beads 20 --duration 1e-4";
    place.run(&format!("{run} --striker 0=5 --striker 19=-4")).exits(0);
    let info = place.run("info homogeneous.mcap").exits(0).stdout();
    assert!(info.contains("bead 0 at 5 m/s, bead 19 at -4 m/s"), "{info}");
    place
        .run(&format!("{run} --striker 0=5 --striker 0=4 --force"))
        .exits(2)
        .says(&["--striker", "each bead once"]);
    place
        .write("d.toml", &format!("seed = 1\n{CHAIN}{STRUCK}[[disorder]]\nof = \"masses\"\nuniform = 0.2\n"));
    place.run("run d.toml --seed 7").exits(0);
    assert_eq!(place.run("info d.mcap --json").exits(0).json()["physics"]["seed"], 7);
    place.run("run d.toml --seed -1 --force").exits(2).says(&["--seed"]);
    for (of, told) in [("masses", "kg before disorder"), ("stiffnesses", "bead 5 of 0.002 kg\n")] {
        let chain = CHAIN.replace("beads = 10", "beads = 10\nimpurities = [{ bead = 5, mass_kg = 2e-3 }]");
        place.write("i.toml", &format!("{chain}{STRUCK}[[disorder]]\nof = \"{of}\"\nuniform = 0.2\n"));
        let shown = place.run("run i.toml --dry-run").exits(0).stdout();
        assert!(shown.contains(told), "{shown}");
    }
}

/// Hertz's law by hand: 4/3 of E/(2(1 − ν²)) times the root of half the radius; the mass of a ball.
#[test]
fn materials_are_shown_as_masses_and_stiffnesses() {
    let place = Place::new();
    place.write(
        "s.toml",
        &format!(
            "{SPHERES}spheres = {{ density_kg_m3 = 8000.0, young_pa = 2e11, poisson = 0.3, radius_m = 5e-3 }}\n{STRUCK}"
        ),
    );
    let dry = place.run("run s.toml --dry-run").exits(0).stdout();
    assert!(!place.path("s.mcap").exists());
    place.run("run s.toml").exits(0);
    let info = place.run("info s.mcap").exits(0).stdout();
    let (radius_m, young_pa, poisson) = (5e-3_f64, 2e11, 0.3);
    let mass_kg = 8000.0 * 4.0 / 3.0 * std::f64::consts::PI * radius_m.powi(3);
    let stiffness = 2.0 / 3.0 * young_pa / (1.0 - poisson * poisson) * (radius_m / 2.0).sqrt();
    for shown in [dry, info] {
        let number = |name: &str| -> f64 {
            let row = shown.lines().find(|line| line.trim_start().starts_with(name)).unwrap();
            row.split_whitespace().nth(1).unwrap().parse().unwrap()
        };
        assert!((number("masses") / mass_kg - 1.0).abs() < 1e-12, "{shown}");
        assert!((number("stiffnesses") / stiffness - 1.0).abs() < 1e-12, "{shown}");
        assert!(shown.contains("(radius 5 mm)"), "{shown}");
    }
}

/// Two exact waves, one given by its speed and one by its peak velocity, travel as theory says and keep their shape.
#[test]
fn two_exact_solitary_waves_are_started_by_speed_or_amplitude() {
    let place = Place::new();
    let chain = CHAIN.replace("beads = 10", "beads = 200");
    let waves = |other: &str| {
        format!(
            "{chain}[[initial.solitary]]\nbead = 30.5\nspeed_beads_s = 9000.0\n[[initial.solitary]]\nbead = {other}\n\
             [time]\nduration_s = 5e-3\n"
        )
    };
    place.write("two.toml", &waves("170\nvelocity_m_s = -1.0"));
    place.run("run two.toml").exits(0);
    let found = place.run("pulses two.mcap --json").exits(0).json()["results"]["pulses"].clone();
    let found = found.as_array().unwrap();
    assert_eq!(found.len(), 2, "{found:?}");
    for (direction, key, expected) in
        [("forward", "speed_beads_per_s", 9000.0), ("backward", "v_peak_m_s", -1.0)]
    {
        let pulse = found.iter().find(|pulse| pulse["direction"] == direction).unwrap();
        let [value, speed, width] =
            [key, "speed_over_solitary", "fwhm_over_solitary"].map(|key| pulse[key].as_f64().unwrap());
        assert!((value / expected - 1.0).abs() < 1e-4, "{direction}: {value}");
        assert!((speed - 1.0).abs() < 1e-4 && (width - 1.0).abs() < 1e-3, "{direction}: {speed} {width}");
    }
    for (other, says) in [
        ("36\nvelocity_m_s = 1.0", "initial.solitary[1].bead: found 36, and a wave at bead 30.5"),
        ("36\nvelocity_m_s = 1.0", "beads apart, where the sum of two exact waves is exact"),
        ("170", "initial.solitary[1]: found no strength; allowed: one of speed_beads_s and velocity_m_s"),
        (
            "170\nvelocity_m_s = 1.0\nspeed_beads_s = 2.0",
            "initial.solitary[1]: found speed_beads_s and velocity_m_s",
        ),
        (
            "199\nvelocity_m_s = 1.0",
            "initial.solitary[1].bead: found 199, 0.5 beads from the end of the chain",
        ),
        ("300\nvelocity_m_s = 1.0", "initial.solitary[1].bead: found 300; allowed: 0 to 199"),
        ("170\nvelocity_m_s = 0.0", "initial.solitary[1].velocity_m_s: found 0; "),
        (
            "170\nvelocty_m_s = 1.0",
            "unknown key `velocty_m_s`; allowed: bead, speed_beads_s, velocity_m_s; did you mean",
        ),
    ] {
        place.write("bad.toml", &waves(other));
        place.run("run bad.toml").exits(2).says(&["bad.toml:", says]);
    }
}
