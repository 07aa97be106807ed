//! Final states of damped chains, with the step that nobody chose, against those of an independent solver,
//! `tests/reference/damped_states.py`.

use crate::chains::{config, final_state};
use crate::table::{Row, Table};
use schemas::config::{DampingConfig, Impurity, RunConfig};
use schemas::manifest::Physics;
use schemas::method::Method;

fn configuration(row: Row<'_>) -> RunConfig {
    let mut config = config(row.count("beads"), row.number("alpha"));
    let written = row.text("impurities_kg").split_whitespace();
    config.chain.impurities = written
        .map(|impurity| impurity.split_once('=').unwrap())
        .map(|(bead, mass)| Impurity { bead: bead.parse().unwrap(), mass_kg: mass.parse().unwrap() })
        .collect();
    let value = row.number("value");
    config.damping = Some(match row.text("damping") {
        "viscous" => DampingConfig::ViscousNSPerM(value),
        _ => DampingConfig::Restitution(value),
    });
    config.integrator.method = Method::Rk5;
    let time_s = Physics::resolve(&config).unwrap().scales().time_s;
    config.time.duration_s = row.number("periods") * time_s;
    config
}

/// The largest difference, of displacements in L and of velocities in v0.
fn error(physics: &Physics, case: &str, states: &Table) -> f64 {
    let (state, scales) = (final_state(physics), physics.scales());
    let rows: Vec<_> = states.rows().filter(|row| row.text("case") == case).collect();
    assert_eq!(rows.len(), state.u_m.len());
    rows.iter().enumerate().fold(0.0, |largest: f64, (bead, row)| {
        let u_error = (state.u_m[bead] - row.number("u_m")).abs() / scales.length_m;
        let v_error = (state.v_m_s[bead] - row.number("v_m_s")).abs() / 5.0;
        largest.max(u_error).max(v_error)
    })
}

/// A dashpot's force jumps where its contact closes, which a step sees late by half of it: after 30 T that is
/// 1.6e-4 of L. A coefficient of restitution begins as δ^p.
#[test]
fn damped_chains_end_where_an_independent_solver_ends() {
    let (cases, states) = (Table::read("damped-state-cases"), Table::read("damped-states"));
    for row in cases.rows() {
        let (case, config) = (row.text("case"), configuration(row));
        let allowed = if row.text("damping") == "viscous" { 3e-4 } else { 1e-4 };
        let physics = Physics::resolve(&config).unwrap();
        let found = error(&physics, case, &states);
        println!("{case}: {found:.1e} with {:.2e} T", physics.dt_s / physics.scales().time_s);
        assert!(found < allowed, "{case}: {found:e}");
        let fine = Physics { dt_s: physics.dt_s / 4.0, step_count: 4 * physics.step_count, ..physics };
        let finer = error(&fine, case, &states);
        assert!(finer < found / 3.0, "{case}: {found:e}, then {finer:e}");
    }
}
