//! The default time step conserves energy whatever the chain is made of, also where its ends are reached.

use crate::chains::{config, final_state};
use crate::random_chains::promise;
use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::config::{End, Impurity, MassRule, OddContact, RunConfig};
use schemas::manifest::Physics;
use schemas::method::Method;
use schemas::summary::{Drift, relative_drift};

/// 30 beads over 60 T: the wave has come to the end, and the last beads have flown off.
const BEADS: u64 = 30;

fn impurity(config: &mut RunConfig, bead: u64, ratio: f64) {
    config.chain.impurities = vec![Impurity { bead, mass_kg: ratio * 1e-3 }];
}

/// A load (N) under which contacts overlap by `ratio` L.
fn load_n(config: &RunConfig, ratio: f64) -> f64 {
    let length_m = (1e-3 * 25.0 / 1e7_f64).powf(1.0 / (config.chain.alpha.unwrap() + 1.0));
    1e7 * (ratio * length_m).powf(config.chain.alpha.unwrap())
}

fn wall_both(config: &mut RunConfig) {
    (config.ends.left, config.ends.right) = (End::Fixed, End::Fixed);
}

type Change = fn(&mut RunConfig);

const CHAINS: [(&str, Change); 20] = [
    ("equal beads", |_| {}),
    ("light impurity", |c| impurity(c, 10, 0.1)),
    ("heavy impurity", |c| impurity(c, 10, 10.0)),
    ("light striker", |c| impurity(c, 0, 0.1)),
    ("heavy striker", |c| impurity(c, 0, 10.0)),
    ("dimer", |c| c.chain.masses = MassRule::PatternKg(vec![1e-3, 0.34e-3])),
    ("light dimer", |c| c.chain.masses = MassRule::PatternKg(vec![1e-3, 0.05e-3])),
    ("tapered", |c| c.chain.masses = MassRule::Taper(0.95)),
    ("odd contact", |c| c.chain.contacts = vec![OddContact { contact: 10, stiffness: 1e9 }]),
    ("few beads", |c| c.chain.beads = 6),
    ("between walls", |c| {
        wall_both(c);
        c.chain.beads = 6;
    }),
    ("lightly pressed", |c| c.load.precompression_n = load_n(c, 0.1)),
    ("pressed", |c| c.load.precompression_n = load_n(c, 1.0)),
    ("pressed by walls", |c| {
        wall_both(c);
        c.load.precompression_n = load_n(c, 0.5);
    }),
    ("strongly pressed", |c| c.load.precompression_n = load_n(c, 1000.0)),
    ("light gravity", |c| {
        c.ends.right = End::Fixed;
        c.load.gravity_m_s2 = load_n(c, 0.1) / 1e-3;
    }),
    ("gravity", |c| {
        c.ends.right = End::Fixed;
        c.load.gravity_m_s2 = load_n(c, 10.0) / 1e-3;
    }),
    ("slow on earth", |c| {
        c.ends.right = End::Fixed;
        (c.chain.beads, c.load.gravity_m_s2, c.striker.velocity_m_s) = (15, 9.81, 1.0);
    }),
    ("dimer on a wall", |c| {
        c.ends.right = End::Fixed;
        c.chain.masses = MassRule::PatternKg(vec![1e-3, 4.369e-3]);
    }),
    ("piston", |c| impurity(c, 0, 1e6)),
];

/// The largest `|ΔE/E|` of a run with `method`, and 20000 steps at most.
fn drift(config: &RunConfig) -> f64 {
    let physics = Physics::resolve(config).unwrap();
    let chain = physics.chain();
    let drift = Drift::new(&physics, &chain);
    let mut contact_j = vec![0.0; chain.contact_count()];
    let mut integrator = Integrator::new(&physics);
    let mut state = ChainState::initial(&physics);
    let mut worst: f64 = 0.0;
    while state.step < 20_000 && physics.time_s(state.step) < 60.0 * physics.scales().time_s {
        integrator.step(&mut state);
        let energy = chain.energy(&state.u_m, &state.v_m_s, &state.extra, &mut contact_j);
        worst = worst.max(drift.of(energy.total_j(), 0.0, &state.v_m_s).abs());
    }
    worst
}

#[test]
fn the_default_step_conserves_energy() {
    for method in Method::ALL {
        for alpha in [1.1, 1.2, 1.3, 1.5, 2.0, 3.0] {
            for (name, change) in CHAINS {
                let mut config = config(BEADS, alpha);
                config.integrator.method = method;
                change(&mut config);
                let drift = drift(&config);
                assert!(drift < promise(&config), "{name}, {method}, α = {alpha}: {drift:e}");
            }
        }
    }
}

/// A piston that goes on pushing has a million times the energy of its chain, beside which no error would show.
#[test]
fn a_piston_hides_no_error() {
    let mut config = config(BEADS, 1.5);
    impurity(&mut config, 0, 1e6);
    config.time.dt_s = Some(Physics::resolve(&config).unwrap().longest_dt_s());
    let physics = Physics::resolve(&config).unwrap();
    let chain = physics.chain();
    let state = final_state(&Physics { step_count: 400, ..physics.clone() });
    let energy_j =
        chain.energy(&state.u_m, &state.v_m_s, &state.extra, &mut vec![0.0; chain.contact_count()]).total_j();
    let to_all = relative_drift(energy_j, physics.initial_energy().total_j()).abs();
    let to_chain = Drift::new(&physics, &chain).of(energy_j, 0.0, &state.v_m_s).abs();
    assert!(to_chain > 1e3 * to_all, "{to_all:e} {to_chain:e}");
}
