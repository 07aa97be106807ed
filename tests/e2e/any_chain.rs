//! Chains beyond one struck bead and one power law, each through everything that can be done with a run.

use crate::harness::Place;
use crate::kernel::Program;
use recording::RecordingSource;
use schemas::config::RunConfig;
use schemas::frame::{FrameSource, Received};
use serde_json::Value;
use std::thread;

/// The chains that are held against an independent integrator, and chains with baths.
const CASES: [&str; 2] =
    [include_str!("../reference/driven-state-cases.json"), include_str!("../reference/bath-cases.json")];

/// Name and configuration of each.
fn cases() -> Vec<(String, String)> {
    let cases = CASES.map(|text| serde_json::from_str::<Vec<Value>>(text).unwrap());
    let text = |case: &Value, key: &str| case[key].as_str().unwrap().to_owned();
    cases.iter().flatten().map(|case| (text(case, "name"), text(case, "toml"))).collect()
}

/// Each of them written to a file.
fn written() -> (Place, Vec<String>) {
    let place = Place::new();
    let write = |(name, toml): (String, String)| {
        place.write(&format!("{name}.toml"), &toml);
        name
    };
    let names = cases().into_iter().map(write).collect();
    (place, names)
}

/// Frame, step and bits of each state, all rows of it.
fn states(place: &Place, file: &str) -> Vec<(u64, u64, Vec<u64>)> {
    let mut source = RecordingSource::open(&place.path(file)).unwrap();
    let mut states = Vec::new();
    while let Received::Frame(frame) = source.receive().unwrap() {
        let values = [&[frame.time_s], frame.u_m, frame.v_m_s, frame.extra].concat();
        states.push((frame.frame, frame.step, values.iter().map(|value| value.to_bits()).collect()));
    }
    states
}

/// Does this with each name, several at a time.
fn each(names: &[String], work: impl Fn(&str) + Sync) {
    let work = &work;
    thread::scope(|scope| {
        for part in names.chunks(names.len().div_ceil(4)) {
            scope.spawn(move || part.iter().for_each(|name| work(name)));
        }
    });
}

#[test]
fn every_chain_is_proven_and_comes_back_from_every_fiftieth_state() {
    let (place, names) = written();
    each(&names, |name| {
        place.run(&format!("run {name}.toml")).exits(0);
        let proof = place.run(&format!("verify {name}.mcap")).exits(0).stdout();
        assert!(proof.contains("proven"), "{name}: {proof}");
        place.run(&format!("thin {name}.mcap --every-steps 50 --out {name}-thin.mcap")).exits(0);
        place.run(&format!("verify {name}-thin.mcap")).exits(0);
        place.run(&format!("expand {name}-thin.mcap --out {name}-whole.mcap")).exits(0);
        let [full, thin, whole] =
            ["", "-thin", "-whole"].map(|end| states(&place, &format!("{name}{end}.mcap")));
        assert!(full == whole, "{name}");
        assert!(thin.len() < full.len() / 40, "{name}: {} of {}", thin.len(), full.len());
    });
}

#[test]
fn every_interrupted_chain_is_gone_on_with() {
    let (place, names) = written();
    each(&names, |name| {
        // off the bus, where it would leave a run of the same name for a moment
        place
            .run(&format!("run {name}.toml --record-every-steps 20 --no-publish --out {name}-whole.mcap"))
            .exits(0);
        let duration_s = RunConfig::from_toml(&place.read(&format!("{name}.toml"))).unwrap().time.duration_s;
        let pace = duration_s / 8.0;
        let run = place.start(&format!("run {name}.toml --record-every-steps 20 --pace {pace:e}"));
        place.wait_for_run(name, |run| run.step >= 50);
        run.signal("INT");
        run.wait().exits(3);
        place.run(&format!("run --resume {name}.mcap")).exits(0).says(&["goes on after step"]);
        let whole = states(&place, &format!("{name}-whole.mcap"));
        assert!(states(&place, &format!("{name}.mcap")) == whole, "{name}");
    });
}

/// What was computed while a run went on is what its recording says afterwards.
#[test]
fn live_is_the_same_as_a_file() {
    let (place, _) = written();
    for name in ["sine-wall", "mass-in-mass", "damped-resonance", "bath-and-drive"] {
        let run = place.start(&format!("run {name}.toml --wait-for 1"));
        place.wait_for_run(name, |_| true);
        place.run(&format!("energies live:{name} --out {name}-live.csv")).exits(0);
        run.wait().exits(0);
        place.run(&format!("energies {name}.mcap --out {name}.csv")).exits(0);
        assert_eq!(place.read(&format!("{name}-live.csv")), place.read(&format!("{name}.csv")), "{name}");
    }
}

/// By programs that were written from `docs/KERNEL.md`, of the first fifth of each run.
#[test]
fn every_chain_is_recomputed_by_others() {
    for program in Program::all() {
        let (place, names) = written();
        each(&names, |name| {
            let config = RunConfig::from_toml(&place.read(&format!("{name}.toml"))).unwrap();
            let duration_s = config.time.duration_s / 5.0;
            let flags = format!("--duration {duration_s:e} --record-every-steps 50");
            place.run(&format!("run {name}.toml {flags}")).exits(0);
        });
        program.run(&place, names.iter().map(|name| place.path(format!("{name}.mcap"))), 0, "equal");
    }
}

#[test]
fn what_is_particular_is_shown_before_and_after_a_run() {
    let (place, names) = written();
    let particulars = [
        ("sine-wall", "left wall"),
        ("piston", "left wall"),
        ("two-powers", "a second power"),
        ("alpha-by-contact", "α of 1.5"),
        ("fput-alpha-ring", "a ring, bonds: linear 1, quadratic (FPUT-α) 0.25"),
        ("fput-beta", "cubic (FPUT-β)"),
        ("toda-ring", "bonds: Toda"),
        ("on-site-cubic", "on-site springs"),
        ("mass-in-mass", "resonators"),
        ("kuwabara-kono", "viscoelastic spheres, A = 5e-6 s"),
        ("power-damping", "damping 5·δ^0.25·dδ/dt"),
        ("drag", "drag"),
        ("absorbing", "absorbing on the right"),
        ("gaps", "gaps"),
        ("chirped-bead", "bead 0"),
        ("burst", "bead 5"),
        ("table-wall", "right wall"),
        ("damped-resonance", "bead 3"),
        ("velocity-ramp", "bead 6"),
    ];
    each(&names, |name| {
        let dry = place.run(&format!("run {name}.toml --dry-run")).exits(0).stdout();
        place.run(&format!("run {name}.toml")).exits(0);
        let info = place.run(&format!("info {name}.mcap")).exits(0).stdout();
        for (_, words) in particulars.iter().filter(|(of, _)| *of == name) {
            assert!(dry.contains(words), "{name}: {words} is not in\n{dry}");
            assert!(info.contains(words), "{name}: {words} is not in\n{info}");
        }
    });
}

/// A chain of quadratic bonds that has too much energy for them, and for a shorter step.
#[test]
fn a_bond_over_the_edge_of_its_potential_is_not_called_a_long_step() {
    let place = Place::new();
    let chain = |bonds: &str, dt: &str| {
        format!(
            "[chain]\nbeads = 8\nbead_mass_kg = 1.0\nbonds = {{ linear = 1.0, {bonds} }}\n[striker]\nbead = 0\nvelocity_m_s = 9.0\n\
             [ends]\nleft = \"fixed\"\nright = \"fixed\"\n[time]\nduration_s = 60.0\n{dt}"
        )
    };
    for (name, bonds, dt) in [
        ("over", "quadratic = 0.5", ""),
        ("slowly", "quadratic = 0.5", "dt_s = 0.01\n"),
        ("one", "quadratic = { pattern = [0.5, 0.0] }, cubic = { pattern = [0.0, 1.0] }", ""),
    ] {
        place.write(&format!("{name}.toml"), &chain(bonds, dt));
        let words = ["over the edge of its potential", "`cubic`"];
        place.run(&format!("run {name}.toml --no-record")).exits(1).says(&words);
    }
    place.run("check over.toml").exits(1).says(&["over the edge of its potential"]);
    place.write("held.toml", &chain("quadratic = 0.5, cubic = 0.1", ""));
    place.run("run held.toml --no-record").exits(0);
}

/// 60 beads whose contacts have the exponent 2, `chain` says how.
fn squares(chain: &str) -> String {
    format!(
        "[chain]\nbeads = 60\nbead_mass_kg = 1e-3\nstiffness = 1e7\nimpurities = [{{ bead = 30, mass_kg = 4e-3 }}]\n{chain}\n\
         [striker]\nbead = 0\nvelocity_m_s = 1.0\n[time]\nduration_s = 0.02\ndt_s = 2e-6\n"
    )
}

#[test]
fn an_exponent_of_each_contact_has_the_answers_of_one_for_all() {
    let place = Place::new();
    for (name, chain) in [
        ("one", "alpha = 2.0".to_owned()),
        ("each", format!("alpha = 1.5\nalphas = {{ list = {:?} }}", [2.0; 59])),
    ] {
        place.write(&format!("{name}.toml"), &squares(&chain));
        place.run(&format!("run {name}.toml --no-publish")).exits(0);
        place.run(&format!("export {name}.mcap --out {name}.csv --every-steps 10000")).exits(0);
    }
    let impulse = |name: &str| {
        let found = place.run(&format!("deformation {name}.mcap --contact 20 --json")).exits(0).json();
        found["results"]["contacts"][0]["first_pulse"]["impulse_n_s"].as_f64().unwrap()
    };
    assert!((impulse("one") / 1.05221e-3 - 1.0).abs() < 1e-5, "{}", impulse("one"));
    assert_eq!(impulse("one"), impulse("each"));
    assert_eq!(place.read("one.chain.csv"), place.read("each.chain.csv"));
}

#[test]
fn a_pulse_of_two_powers_is_compared_with_the_wave_of_none() {
    let place = Place::new();
    place.write(
        "two.toml",
        &squares("alpha = 1.5\nsecond = { alpha = 3.0, stiffness = 1e13 }")
            .replace("impurities", "# impurities"),
    );
    place.run("run two.toml --no-publish").exits(0);
    let found = place.run("deformation two.mcap --contact 30").exits(0);
    assert!(found.stdout().contains("do not follow `chain.alpha` alone"), "{}", found.stdout());
    place.run("pulses two.mcap --out two.csv").exits(0);
    let table = place.read("two.csv");
    let mut lines = table.lines();
    let column = lines.next().unwrap().split(',').position(|name| name == "speed_over_solitary").unwrap();
    assert!(lines.clone().count() > 0);
    assert!(lines.all(|line| line.split(',').nth(column).unwrap().is_empty()), "{table}");
}

/// Changes that begin in a part of a chain stay there where the rest does not feel them: of all exponents the first is still the largest.
#[test]
fn the_first_of_all_exponents_is_the_largest() {
    let place = Place::new();
    place.write(
        "split.toml",
        "seed = 3\n[chain]\nbeads = 7\nbead_mass_kg = 1.0\nbonds = { linear = 1.0, cubic = { list = [0.0, 0.0, 0.0, 5.0, 5.0, 5.0] } }\n\
         [ends]\nleft = 'fixed'\nright = 'fixed'\n[[drive]]\nbead = 3\ndisplacement_m = { sine = { amplitude = 0.5, frequency_hz = 0.05 } }\n\
         [initial]\nthermal = { energy_j = 1.0 }\n[time]\nduration_s = 1000.0\n",
    );
    place.run("run split.toml --no-publish --record-every-steps 1000").exits(0);
    let exponents = |asked: &str| {
        let found = place.run(&format!("lyapunov split.mcap --exponents {asked} --json")).exits(0).json();
        let all = found["results"]["exponents_per_s"].as_array().unwrap().clone();
        all.iter().map(|one| one.as_f64().unwrap()).collect::<Vec<_>>()
    };
    let (all, two) = (exponents("all"), exponents("2"));
    assert_eq!(all.len(), 12);
    // in a finite time neighbours may still change places
    assert!(all.windows(2).all(|pair| pair[0] > pair[1] - 0.005), "{all:?}");
    assert!((all[0] - two[0]).abs() < 0.01 && all[0] > 0.03, "{all:?} {two:?}");
    // they pair as those of any such chain
    assert!((0..6).all(|i| (all[i] + all[11 - i]).abs() < 1e-9), "{all:?}");
}

#[test]
fn what_no_answer_can_be_given_to_is_refused() {
    let place = Place::new();
    let chain = "[chain]\nbeads = 6\nbead_mass_kg = 1.0\nbonds = { linear = 1.0 }\n[ends]\nleft = 'fixed'\nright = 'fixed'\n[time]\nduration_s = 100.0\n";
    place.write(
        "twice.toml",
        &format!("{chain}[initial]\nmodes = {{ energies_j = [[1, 5, 1e-3], [3, 1e-3]] }}\n"),
    );
    place.run("run twice.toml --no-record").exits(2).says(&["mode 3 twice", "each mode once"]);
    let held = "[[drive]]\nbead = 1\ndisplacement_m = { sine = { amplitude = 0.1, frequency_hz = 0.1 } }\n";
    place.write("held.toml", &format!("{chain}{held}"));
    place.run("modes held.toml").exits(2).says(&["bead 1 is moved by a drive"]);
    place.write("moded.toml", &format!("{chain}{held}[initial]\nmodes = {{ energies_j = [[1, 1e-3]] }}\n"));
    place.run("run moded.toml --no-record").exits(2).says(&["initial.modes", "bead 1 is moved by a drive"]);
    place.write("warm.toml", &format!("{chain}[initial]\nthermal = {{ energy_j = 0.1 }}\n"));
    place.run("run warm.toml --no-publish").exits(0);
    place.run("heat warm.mcap --lag 300 --green-kubo kappa.csv").exits(2).says(&[
        "lag",
        "300",
        "time that is looked at",
    ]);
    let large = format!("run warm.toml --no-record --seed {}", 1_u64 << 63);
    place.run(&large).exits(2).says(&["--seed", "2^63 − 1"]);
    place.write(
        "bath.toml",
        &format!("{chain}[[bath]]\nbeads = 0\ntemperature_j = 0.1\nfriction_per_s = 0.1\n"),
    );
    place.write("s.toml", "check = true\n[base]\nfile = 'bath.toml'\n[grid]\nseed = [1, 2]\n");
    place.run("sweep s.toml --out s").exits(3);
    assert_eq!(place.read("s/results.csv").matches("other noise").count(), 2);
}

/// A bond of `F = δ − δ²` has no slope where it is pressed by 0.5 m, and twice the slope of rest where it is pulled as far.
#[test]
fn a_bond_that_begins_soft_has_the_step_of_a_hard_one() {
    let dt_s = |bonds: &str, begun: f64| {
        let toml = format!(
            "chain = {{ beads = 2, bead_mass_kg = 1.0, bonds = {{ {bonds} }} }}\ninitial = {{ displacements_m = [{begun:?}, 0.0] }}\n\
             time = {{ duration_s = 10.0 }}\n"
        );
        schemas::manifest::Physics::resolve(&RunConfig::from_toml(&toml).unwrap()).unwrap().dt_s
    };
    for bonds in ["linear = 1.0, quadratic = -1.0", "linear = 1.0, quadratic = -3.0, cubic = 3.0"] {
        let at_rest = dt_s(bonds, 1e-3);
        for begun in [-0.95, -0.4, 0.4, 0.5, 0.95] {
            assert!(dt_s(bonds, begun) <= at_rest * 1.001, "{bonds}: {begun}");
        }
    }
    assert!(dt_s("cubic = 1.0", 1.0) < 0.1);
}

/// The contact that closes a ring is on the left of the first bead and on the right of the last.
#[test]
fn beads_beside_the_seam_of_a_ring_have_its_overlap() {
    let place = Place::new();
    place.write(
        "ring.toml",
        "[chain]\nbeads = 9\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n[ends]\nleft = 'periodic'\nright = 'periodic'\n\
         [load]\nprecompression_n = 1.0\n[striker]\nbead = 0\nvelocity_m_s = 0.1\n[time]\nduration_s = 1e-3\n",
    );
    place.run("run ring.toml --no-publish").exits(0);
    place.run("impurity ring.mcap --bead 0 --bead 8 --out ring.csv").exits(0);
    let table = place.read("ring.csv");
    let mut lines = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let names = lines.next().unwrap();
    let place_of =
        |name: &str| names.iter().position(|one| *one == name).unwrap_or_else(|| panic!("{names:?}"));
    let [left, right] = ["overlap_left_0_m", "overlap_right_8_m"].map(place_of);
    let both: Vec<_> = lines.map(|line| [line[left].to_owned(), line[right].to_owned()]).collect();
    assert!(both.len() > 10 && both.iter().all(|[left, right]| left == right && !left.is_empty()), "{table}");
}

/// A ring that is turned by a bead has the same answers a bead further: bead 8, and the contact behind it, become the first.
#[test]
fn a_ring_has_no_first_bead() {
    let place = Place::new();
    let tables = |name: &str, struck: u32, place_of: u32| {
        place.write(
            &format!("{name}.toml"),
            &format!(
                "[chain]\nbeads = 9\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n[ends]\nleft = 'periodic'\nright = 'periodic'\n\
                 [striker]\nbead = {struck}\nvelocity_m_s = 0.1\n[time]\nduration_s = 3e-4\ndt_s = 1e-6\n"
            ),
        );
        place.run(&format!("run {name}.toml --no-publish")).exits(0);
        place.run(&format!("contacts {name}.mcap --out {name}-c.csv --out {name}-c.mcap")).exits(0);
        place.run(&format!("spreading {name}.mcap --out {name}-s.csv")).exits(0);
        place
            .run(&format!(
                "forces {name}.mcap --at bead:{place_of} --at contact:{place_of} --out {name}-f.csv"
            ))
            .exits(0);
        let numbers = |part: &str| -> Vec<Vec<f64>> {
            let table = place.read(&format!("{name}-{part}.csv"));
            let line = |line: &str| line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
            table.lines().skip(1).map(line).collect()
        };
        let counts: Vec<_> = numbers("c").iter().map(|row| row[3..6].to_vec()).collect();
        assert!(counts.iter().all(|row| row.iter().sum::<f64>() == 9.0), "{counts:?}");
        assert_eq!(
            place.run(&format!("contacts {name}-c.mcap --json")).exits(0).json()["rows"],
            counts.len()
        );
        (counts, numbers("f"), numbers("s").iter().map(|row| row[5]).collect::<Vec<_>>())
    };
    let (one, turned) = (tables("one", 7, 8), tables("turned", 8, 0));
    assert!(one.0 == turned.0 && one.0.iter().any(|row| row[0] > 0.0));
    let is_near = |a: f64, b: f64| (a - b).abs() <= 1e-9 * a.abs().max(1e-9) || a.is_nan() && b.is_nan();
    assert!(one.1.concat().iter().zip(turned.1.concat()).all(|(a, b)| is_near(*a, b)), "{:?}", turned.1);
    assert!(one.1.iter().any(|row| row[3] > 0.0 && row[3] != row[4]), "{:?}", one.1);
    assert!(one.2.len() > 100 && one.2.iter().zip(&turned.2).all(|(a, b)| is_near(*a, *b)), "{:?}", one.2);
}

/// A wall that moves: its contact gets the bead's momentum, and grows at the rate at which both approach each other.
#[test]
fn walls_that_move_press_with_their_velocity() {
    let place = Place::new();
    for (name, damping, wave) in [
        ("steady", "[damping]\nrestitution = 0.5", "velocity_m_s = 1.0"),
        (
            "sine",
            "[damping]\nviscous_n_s_per_m = 0.5",
            "velocity_m_s = { sine = { amplitude = 1e-2, frequency_hz = 6.3e3, ramp_s = 5e-4 } }",
        ),
        (
            "moved",
            "[damping]\nviscous_n_s_per_m = 0.5",
            "displacement_m = { sine = { amplitude = 3e-7, frequency_hz = 6.3e3, ramp_s = 5e-4 } }",
        ),
    ] {
        let load = if name == "steady" { "" } else { "[load]\nprecompression_n = 20.0" };
        place.write(
            &format!("{name}.toml"),
            &format!(
                "[chain]\nbeads = 10\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n{damping}\n[ends]\nleft = 'fixed'\nright = 'free'\n\
                 {load}\n[[drive]]\nwall = 'left'\n{wave}\n[time]\nduration_s = 4e-3\n"
            ),
        );
        let steady = "--from 0.001 --segment 2048";
        place.run(&format!("run {name}.toml --no-publish")).exits(0);
        place.run(&format!("forces {name}.mcap --at wall:left --out {name}-f.csv")).exits(0);
        place
            .run(&format!(
                "spectrum {name}.mcap --at wall:left --of displacement {steady} --out {name}-d.csv"
            ))
            .exits(0);
        place.run(&format!("spectrum {name}.mcap --at wall:left {steady} --out {name}-v.csv")).exits(0);
        let rows = |part: &str| -> Vec<Vec<f64>> {
            let table = place.read(&format!("{name}-{part}.csv"));
            table
                .lines()
                .skip(1)
                .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
                .collect()
        };
        let mut source = RecordingSource::open(&place.path(format!("{name}.mcap"))).unwrap();
        let mut momentum = 0.0;
        while let Received::Frame(frame) = source.receive().unwrap() {
            momentum = 1e-3 * frame.v_m_s.iter().sum::<f64>();
        }
        // the load at the free end pushes back
        let force = rows("f");
        let rest_n = if load.is_empty() { 0.0 } else { 20.0 };
        let impulse: f64 = force
            .windows(2)
            .map(|pair| 0.5 * (pair[0][4] + pair[1][4] - 2.0 * rest_n) * (pair[1][2] - pair[0][2]))
            .sum();
        assert!((impulse - momentum).abs() < 1e-3 * momentum.abs(), "{name}: {impulse} {momentum}");
        // a rate has (2πf)² the density of what grows
        if name != "steady" {
            let (grown, rate) = (rows("d"), rows("v"));
            let far = |row: &[f64]| (row[0] - 6.3e3).abs();
            let line = (1..20).min_by(|a, b| far(&rate[*a]).total_cmp(&far(&rate[*b]))).unwrap();
            let turns = std::f64::consts::TAU * 6.3e3;
            let ratio = rate[line][1] / (grown[line][1] * turns * turns);
            assert!((ratio - 1.0).abs() < 0.01, "{name}: {ratio}");
        }
    }
}

/// The current of `heat` is that of the whole force: what passes a contact changes the energy behind it, or is lost there.
#[test]
fn a_damped_chain_conducts_what_it_loses() {
    let place = Place::new();
    place.write(
        "h.toml",
        "[chain]\nbeads = 20\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n[damping]\nviscous_n_s_per_m = 10.0\n\
         [ends]\nleft = 'fixed'\nright = 'free'\n[load]\nprecompression_n = 20.0\n\
         [[drive]]\nbead = 0\nvelocity_m_s = { sine = { amplitude = 1e-2, frequency_hz = 6e3, ramp_s = 1e-3 } }\n[time]\nduration_s = 0.01\n",
    );
    place.run("run h.toml --no-publish").exits(0);
    place.run("heat h.mcap --from 0.005 --profile p.csv").exits(0);
    let mut source = RecordingSource::open(&place.path("h.mcap")).unwrap();
    let chain = source.manifest().physics.chain();
    // the energy right of bead 0 and half of the first contact, with what was lost there
    let (mut behind_j, mut times_s) = (Vec::new(), Vec::new());
    while let Received::Frame(frame) = source.receive().unwrap() {
        if frame.time_s >= 0.005 {
            let mut contacts_j = vec![0.0; chain.contact_count()];
            chain.contact_energies_j(frame.u_m, &mut contacts_j);
            let kinetic_j: f64 = frame.v_m_s[1..].iter().map(|v| 0.5e-3 * v * v).sum();
            let lost_j = chain.rows.work_of(frame.extra);
            let potential_j = contacts_j[1..].iter().sum::<f64>() + 0.5 * contacts_j[0];
            // the last number is that of the walls
            let contacts_j = &lost_j[1..chain.contact_count()];
            behind_j.push(kinetic_j + potential_j + contacts_j.iter().sum::<f64>() + 0.5 * lost_j[0]);
            times_s.push(frame.time_s);
        }
    }
    let last = behind_j.len() - 1;
    let power_w = (behind_j[last] - behind_j[0]) / (times_s[last] - times_s[0]);
    let profile = place.read("p.csv");
    let current_w: f64 = profile.lines().nth(1).unwrap().split(',').nth(3).unwrap().parse().unwrap();
    assert!((current_w / power_w - 1.0).abs() < 0.01, "{current_w} {power_w}");
}

#[test]
fn what_has_no_effect_in_a_chain_is_refused() {
    let place = Place::new();
    let rest = "[striker]\nbead = 0\nvelocity_m_s = 1.0\n[time]\nduration_s = 1e-3\ndt_s = 1e-6\n";
    let bonded = "[chain]\nbeads = 5\nbead_mass_kg = 1e-3\nbonds = { linear = 1.0 }\n";
    let spheres = "[chain]\nbeads = 5\nspheres = { material = 'steel', radius_m = 9.5e-3 }\n";
    for (chain, key) in [
        (
            format!("{bonded}[[disorder]]\nof = 'stiffnesses'\nuniform = 0.5\n"),
            "disorder[0].of: found stiffnesses",
        ),
        (
            format!("{bonded}[ends]\nright = 'fixed'\nright_stiffness = 5.0\n"),
            "ends.right_stiffness: found 5",
        ),
        (format!("{bonded}stiffness = 50.0\n"), "chain.stiffness: found 50"),
        (format!("{bonded}alpha = 3.0\n"), "chain.alpha: found 3"),
        (format!("{spheres}alphas = {{ pattern = [1.5, 2.0] }}\n"), "chain.alphas: found"),
        (format!("{spheres}[ends]\nright_material = 'brass'\n"), "ends.right_material: found"),
        (
            format!("{spheres}[ends]\nleft = 'fixed'\nleft_material = 'brass'\nleft_stiffness = 1e6\n"),
            "ends.left_material: found",
        ),
    ] {
        place.write("no.toml", &format!("{chain}{rest}"));
        let told = place.run("run no.toml --no-publish").exits(2).stderr();
        assert!(told.contains(key), "{key}: {told}");
    }
    place
        .run("run --preset fput-alpha --duration 50 --stiffness 50 --no-publish")
        .exits(2)
        .says(&["--stiffness", "nothing beside chain.bonds"]);
    // frames that are published are recorded, unless a file says otherwise
    place.write("some.toml", &format!("{bonded}{rest}[stream]\npublish_every_steps = 7\n"));
    let told = place.run("run some.toml --no-publish").exits(0);
    // a damped chain of springs is not chaotic
    place.write(
        "damped.toml",
        &format!(
            "{bonded}[damping]\nviscous_n_s_per_m = 0.5\n{}",
            rest.replace("1e-3\ndt", "1.0\ndt").replace("1e-6", "1e-4")
        ),
    );
    let told =
        told.stderr() + &place.run("run damped.toml --no-publish --record-every-steps 100").exits(0).stderr();
    assert!(!told.contains("chaotic"), "{told}");
}

/// 1e-5 s are ten steps of 1e-6 s, whose double is a little less.
#[test]
fn times_that_people_write_are_those_of_steps() {
    let place = Place::new();
    for (dt, unit) in [("1e-6", 1e-6), ("0.1", 0.1)] {
        place.write(
            "t.toml",
            &format!(
                "[chain]\nbeads = 5\nbead_mass_kg = 1.0\nbonds = {{ linear = 1.0 }}\n[striker]\nbead = 0\nvelocity_m_s = 1.0\n\
                 [time]\nduration_s = {}\ndt_s = {dt}\n",
                30.0 * unit
            ),
        );
        place.run("run t.toml --no-publish --force").exits(0);
        for (from, until) in [(3, 6), (7, 12), (10, 10), (11, 29), (10, 20)] {
            // as people write them
            let time = |step: u32| {
                if dt == "0.1" { format!("{}.{}", step / 10, step % 10) } else { format!("{step}e-6") }
            };
            let window = format!("--from {} --until {}", time(from), time(until));
            place.run(&format!("energies t.mcap {window} --out e.csv --force")).exits(0);
            let table = place.read("e.csv");
            let steps: Vec<u32> =
                table.lines().skip(1).map(|line| line.split(',').nth(1).unwrap().parse().unwrap()).collect();
            assert_eq!(steps, (from..=until).collect::<Vec<_>>(), "{window}");
            place.run(&format!("export t.mcap {window} --out x.csv --force")).exits(0);
            assert_eq!(place.read("x.csv").lines().count(), steps.len() + 1, "{window}");
        }
    }
}
