//! The test vectors of `docs/KERNEL.md`.

use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::chain::Wall;
use schemas::config::{DampingConfig, End, MassRule, RunConfig};
use schemas::damping::Damping;
use schemas::manifest::Physics;
use schemas::method::Method;
use schemas::presets::Preset;
use std::fmt::Write as _;

/// A chain of five beads, changed by `change`, with steps of a fiftieth of T.
fn chain(change: impl FnOnce(&mut RunConfig)) -> Physics {
    let mut config = Preset::find("homogeneous").expect("a preset").config();
    config.chain.beads = 5;
    config.chain.masses = MassRule::ListKg(vec![1e-3, 2e-3, 6e-4, 1e-3, 3e-3]);
    config.time.duration_s = 1e-3;
    change(&mut config);
    let mut physics = Physics::resolve(&config).expect("valid");
    physics.dt_s = 0.02 * physics.scales().time_s;
    physics
}

fn chains() -> [Physics; 4] {
    [
        chain(|c| (c.chain.alpha, c.integrator.method) = (Some(1.3), Method::Rkn4)),
        chain(|c| {
            c.integrator.method = Method::VelocityVerlet;
            (c.ends.left, c.ends.right) = (End::Fixed, End::Fixed);
            (c.load.precompression_n, c.load.gravity_m_s2) = (20.0, 9.81);
        }),
        chain(|c| {
            (c.chain.alpha, c.integrator.method) = (Some(2.2), Method::Gear5);
            (c.ends.right, c.load.precompression_n) = (End::Fixed, 5.0);
        }),
        chain(|c| {
            (c.chain.alpha, c.integrator.method) = (Some(2.2), Method::Rk5);
            c.damping = Some(DampingConfig::Restitution(0.8));
            (c.ends.right, c.load.precompression_n) = (End::Fixed, 5.0);
        }),
    ]
}

fn hexadecimal(values: &[f64]) -> String {
    let digits: Vec<String> = values.iter().map(|x| format!("\"{:016x}\"", x.to_bits())).collect();
    format!("[{}]", digits.join(","))
}

/// One chain of the block: what `/chain` has of it, and three states.
fn vector(physics: &Physics) -> String {
    let chain = physics.chain();
    let damping = chain.damping.as_ref();
    let wall = |wall: &Wall, side: usize| {
        let coefficient = damping.map_or(0.0, |damping| damping.wall_coefficient[side]);
        let numbers = [wall.stiffness, wall.rest_overlap_m, wall.rest_force_n, coefficient];
        if wall.is_there { hexadecimal(&numbers) } else { "null".to_owned() }
    };
    let kind = match damping.map(|damping| damping.kind) {
        None => "null",
        Some(Damping::ViscousNSPerM(_)) => "\"dashpots\"",
        Some(Damping::Restitution(_)) => "\"restitution\"",
        Some(Damping::KuwabaraKonoS(_) | Damping::Power(_)) => unreachable!("no chain of the page has these"),
    };
    let striker = physics.striker;
    let mut text = format!(
        "{{\"method\":\"{}\",\"alpha\":{},\"dt_s\":{},\"striker\":{{\"bead\":{},\"velocity_m_s\":{}}},\"damping\":{kind},\n",
        physics.method, physics.alpha, physics.dt_s, striker.bead, striker.velocity_m_s
    );
    let none = Vec::new();
    for (name, values) in [
        ("m", &chain.mass_kg),
        ("k", &chain.stiffness),
        ("rho", &chain.rest_overlap_m),
        ("R", &chain.rest_force_n),
        ("eta", damping.map_or(&none, |damping| &damping.coefficient)),
    ] {
        writeln!(text, "\"{name}\":{},", hexadecimal(values)).expect("a text");
    }
    let (left, right) = (wall(&chain.walls.left, 0), wall(&chain.walls.right, 1));
    writeln!(text, "\"left_wall\":{left},\"right_wall\":{right},").expect("a text");
    let mut state = ChainState::initial(physics);
    let mut integrator = Integrator::new(physics);
    let mut states = Vec::new();
    for step in 0..3 {
        if step > 0 {
            integrator.step(&mut state);
        }
        let arrays: Vec<String> = [&state.u_m, &state.v_m_s, &state.extra]
            .iter()
            .flat_map(|x| x.chunks(5))
            .map(hexadecimal)
            .collect();
        states.push(format!("[{}]", arrays.join(",\n")));
    }
    text + &format!("\"states\":[{}]}}", states.join(",\n"))
}

#[test]
fn the_page_has_the_bits_of_four_chains() {
    let vectors: Vec<String> = chains().iter().map(vector).collect();
    // further chains follow them, which the programs of the page's readers check
    let block = format!("```json\n[{},\n{{", vectors.join(",\n"));
    let page = include_str!("../../../docs/KERNEL.md");
    assert!(page.contains(&block), "docs/KERNEL.md has other vectors than these:\n{block}");
}
