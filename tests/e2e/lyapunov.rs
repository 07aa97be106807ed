//! Exponents are those of the run, wherever its frames come from.

use crate::harness::Place;

/// A ring of FPUT-β bonds, one unit of energy a bead, with steps of 0.02 s.
const RING: &str = "\
[chain]\nbeads = 32\nbead_mass_kg = 1.0\n
[chain.bonds]\nlinear = 1.0\ncubic = 1.0\n
[ends]\nleft = \"periodic\"\nright = \"periodic\"\n
[initial]\nvelocities_m_s = \"v\"\n
[integrator]\nmethod = \"velocity-verlet\"\n
[time]\ndt_s = 0.02\nduration_s = 200.0\n";

fn ring() -> String {
    let velocity = |i: u32| -> f64 {
        let i = f64::from(i);
        (1..5).map(|j| (std::f64::consts::TAU * f64::from(j) * i / 32.0 + f64::from(j * j)).cos()).sum()
    };
    let velocities: Vec<String> = (0..32).map(|i| format!("{:?}", velocity(i))).collect();
    RING.replace("\"v\"", &format!("[{}]", velocities.join(", ")))
}

#[test]
fn live_file_and_recomputed_frames_give_the_same_exponents() {
    let place = Place::new();
    place.write("ring.toml", &ring());
    let run = place
        .start("run ring.toml --name ring --publish-every-steps 10 --record-every-steps 10 --wait-for 1");
    let live = place.start("lyapunov live:ring --exponents 3 --out live.csv --figure live.svg");
    run.wait().exits(0);
    live.wait().exits(0);
    place.run("lyapunov ring.mcap --exponents 3 --out file.csv --figure file.svg").exits(0);
    assert!(
        place.read("file.csv") == place.read("live.csv") && place.read("file.svg") == place.read("live.svg")
    );
    // of a thinned recording the frames that it has, with the same numbers
    place.run("thin ring.mcap --every-steps 1000 --out sparse.mcap").exits(0);
    place.run("lyapunov sparse.mcap --exponents 3 --out sparse.csv").exits(0);
    let (all, sparse) = (place.read("file.csv"), place.read("sparse.csv"));
    let numbers = |line: &str| line.split_once(',').map(|(_, rest)| rest.to_owned());
    let all: Vec<_> = all.lines().map(numbers).collect();
    assert_eq!(sparse.lines().count(), 12);
    assert!(sparse.lines().all(|line| all.contains(&numbers(line))), "{sparse}");
}

/// The spectrum pairs, and adds up to nothing; of a chaotic ring the largest exponent is some 0.1 1/s.
#[test]
fn a_spectrum_comes_in_pairs() {
    let place = Place::new();
    place.write("ring.toml", &ring());
    place.run("run ring.toml --name ring --publish-every-steps 100 --record-every-steps 1000").exits(0);
    let found = place.run("lyapunov ring.mcap --exponents all --json").exits(0).json()["results"].clone();
    let exponents: Vec<f64> =
        found["exponents_per_s"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect();
    assert_eq!(exponents.len(), 64);
    assert!(found["pairing_per_s"].as_f64().unwrap() < 1e-9, "{found}");
    assert!(exponents[0] > 0.05 && exponents[0] < 0.2, "{}", exponents[0]);
    assert!(found["errors_per_s"][0].as_f64().unwrap() > 0.0);
}

/// Volumes shrink at the friction of a bath, whatever the chain is; changes that fell below rounding beside others have no number.
#[test]
fn exponents_that_rounding_takes_are_left_out() {
    let place = Place::new();
    place.write(
        "bath.toml",
        "[chain]\nbeads = 4\nbead_mass_kg = 1.0\nbonds = { linear = 1.0 }\n[ends]\nleft = \"fixed\"\nright = \"fixed\"\n\
         [[bath]]\nbeads = \"..2\"\ntemperature_j = 0.1\nfriction_per_s = 5.0\n[time]\nduration_s = 150\ndt_s = 0.0999\n",
    );
    place.run("run bath.toml --name bath").exits(0);
    let lost = place.run("lyapunov bath.mcap --exponents all --json").exits(0);
    assert!(lost.stderr().contains("on are lost in rounding"), "{}", lost.stderr());
    let lost = lost.json()["results"].clone();
    assert!(lost["exponents_per_s"][0].is_f64() && lost["exponents_per_s"][7].is_null(), "{lost}");
    assert!(lost["entropy_per_s"].is_null() && lost["pairing_per_s"].is_null(), "{lost}");
    let found = place.run("lyapunov bath.mcap --exponents all --interval-steps 10 --json").exits(0);
    let found = found.json()["results"].clone();
    let sum: f64 = found["exponents_per_s"].as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).sum();
    assert!((sum + 10.0).abs() < 1e-6 && found["pairing_per_s"].is_null(), "{found}");
}

#[test]
fn what_has_no_exponents_is_refused_with_the_reason() {
    let place = Place::new();
    place.run("run --preset homogeneous --beads 20 --duration 0.001 --name short").exits(0);
    let refused = place.run("lyapunov short.mcap --exponents 41").exits(2);
    assert!(refused.stderr().contains("the chain has 40 exponents"), "{}", refused.stderr());
    place.run("lyapunov short.mcap --exponents none").exits(2);
    let none = place.run("lyapunov short.mcap --interval-steps 1000000").exits(0);
    assert!(none.stderr().contains("shorter --interval-steps"), "{}", none.stderr());
    place.run("run --preset homogeneous --beads 20 --duration 0.001 --method gear5 --name gear").exits(0);
    let refused = place.run("lyapunov gear.mcap").exits(2);
    assert!(refused.stderr().contains("choose another method"), "{}", refused.stderr());
}
