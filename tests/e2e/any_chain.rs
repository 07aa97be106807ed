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
        ("fput-alpha-ring", "a ring, bonds: linear, quadratic (FPUT-α)"),
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
