//! Derivatives by numbers of the configuration are those of runs.

use super::*;
use crate::tangents::NoDerivative;
use schemas::config::{ConfigError, Impurity};

/// A number of a configuration, which is made larger by a factor.
type Number = (&'static str, fn(&mut RunConfig, f64));

fn numbers() -> Vec<Number> {
    vec![
        ("the first velocity", |c, factor| c.striker.velocity_m_s *= factor),
        ("the masses", |c, factor| c.chain.bead_mass_kg.iter_mut().for_each(|x| *x *= factor)),
        ("the mass of an impurity", |c, factor| {
            let bead = 1;
            let mass_kg = 2.0 * c.chain.bead_mass_kg.unwrap() * factor;
            c.chain.impurities = vec![Impurity { bead, mass_kg }];
        }),
        ("the stiffness", |c, factor| c.chain.stiffness.iter_mut().for_each(|x| *x *= factor)),
        ("the exponent", |c, factor| c.chain.alpha.iter_mut().for_each(|x| *x *= factor)),
        ("the load", |c, factor| c.load.precompression_n *= factor),
        ("the drag", |c, factor| {
            if let Some(Profile::Same(drag)) = &mut c.on_site.drag_n_s_per_m {
                *drag *= factor;
            }
        }),
    ]
}

/// Part by which numbers of neighbours differ from that of a run.
const PART: f64 = 1e-5;

/// The run of `config`, and those beside it of which `change` makes a number larger or smaller by a part.
fn three(config: &RunConfig, change: fn(&mut RunConfig, f64)) -> Result<[Physics; 3], ConfigError> {
    let of = |factor: f64, dt_s: Option<f64>| {
        let mut config = config.clone();
        change(&mut config, factor);
        config.time.dt_s = dt_s.or(config.time.dt_s);
        Physics::resolve(&config)
    };
    let physics = of(1.0, None)?;
    let dt_s = Some(physics.dt_s);
    Ok([of(1.0 - PART, dt_s)?, of(1.0, dt_s)?, of(1.0 + PART, dt_s)?])
}

/// The state of a run after some steps, and its derivative by the number in which `below` and `above`, so far apart, differ.
fn derivative([below, physics, above]: &[Physics; 3], apart: f64, steps: u64) -> (ChainState, Vec<f64>) {
    let neighbours = Neighbours { below, above, apart };
    let mut integrator = Integrator::with_derivatives(physics, &[neighbours]).expect("a derivative");
    let mut state = ChainState::initial(physics);
    while state.step < steps {
        integrator.advance(&mut state, steps);
    }
    (state, integrator.tangents().expect("carried").tangent(0))
}

#[test]
fn derivatives_are_differences_of_runs_on_every_kind_of_chain() {
    const STEPS: u64 = 150;
    let end = |physics: &Physics| {
        let (mut state, mut integrator) = (ChainState::initial(physics), Integrator::new(physics));
        while state.step < STEPS {
            integrator.advance(&mut state, STEPS);
        }
        state
    };
    let (mut tried, mut moving) = (0, [0; 7]);
    for method in [Method::VelocityVerlet, Method::Rkn4, Method::Rk5] {
        for (kind_name, kind) in kinds().into_iter().chain(super::tangents::driven()) {
            for is_dragged in [false, true] {
                for (place, (name, change)) in numbers().into_iter().enumerate() {
                    let mut config = config_of(9, method, 1.5, kind);
                    config.on_site.drag_n_s_per_m = is_dragged.then_some(Profile::Same(2.0));
                    let Ok(all) = three(&config, change) else { continue };
                    if !all[1].baths.is_empty() {
                        continue;
                    }
                    let what = format!("{method}, {kind_name}, {name}, drag: {is_dragged}");
                    let (state, found) = derivative(&all, 2.0 * PART, STEPS);
                    let [below, physics, above] = &all;
                    assert_eq!(bits(&state), bits(&end(physics)), "{what}: the states");
                    let (below, above) = (end(below), end(above));
                    let rows = physics.rows();
                    let numbers = |state: &ChainState| {
                        [&state.u_m[..], &state.v_m_s[..], &rows.resonators_of(&state.extra).concat()]
                            .concat()
                    };
                    let largest: [f64; 2] = [0, 1].map(|row| {
                        found[9 * row..9 * (row + 1)].iter().fold(0.0, |most: f64, x| most.max(x.abs()))
                    });
                    for (i, (below, above)) in numbers(&below).iter().zip(numbers(&above)).enumerate() {
                        let expected = (above - below) / (2.0 * PART);
                        let error = (found[i] - expected).abs();
                        // differences of neighbours know no more of contacts that open: see `tangents`
                        let allowed = 2e-5 * largest[i / 9 % 2] + 1e-16;
                        assert!(error <= allowed, "{what}, {i}: {} for {expected}: {error:e}", found[i]);
                    }
                    tried += 1;
                    moving[place] += usize::from(largest[1] > 0.0);
                }
            }
        }
    }
    assert!(tried > 250 && moving.iter().all(|count| *count > 2), "{tried}, {moving:?}");
}

/// The derivatives of `tests/reference/derivatives.csv`, in units of their own.
#[test]
fn derivatives_are_those_of_another_program() {
    let mut rows = 0;
    for (case, mass_kg, until) in [("A3-impurity-light", 0.3, 14), ("A3-impurity-heavy", 2.5, 18)] {
        let by: [Number; 3] = [
            ("v0", |c, factor| c.striker.velocity_m_s *= factor),
            ("m", |c, factor| c.chain.impurities[0].mass_kg *= factor),
            ("alpha", |c, factor| c.chain.alpha.iter_mut().for_each(|x| *x *= factor)),
        ];
        for ((name, change), value) in by.into_iter().zip([1.0, mass_kg, 1.5]) {
            let mut config = config_of(20, Method::Rkn4, 1.5, |_| {});
            (config.chain.bead_mass_kg, config.chain.stiffness) = (Some(1.0), Some(1.0));
            config.chain.impurities = vec![Impurity { bead: 10, mass_kg }];
            (config.striker.velocity_m_s, config.striker.bead) = (1.0, 0);
            config.time.duration_s = until as f64;
            config.time.dt_s = Some(1.0 / 2048.0);
            let all = three(&config, change).expect("valid");
            let (_, found) = derivative(&all, 2.0 * PART * value, until * 2048);
            for line in include_str!("../../../../tests/reference/derivatives.csv").lines().skip(1) {
                let fields: Vec<&str> = line.split(',').collect();
                if fields[..2] != [case, name] {
                    continue;
                }
                let bead: usize = fields[2].parse().expect("a bead");
                for (place, text) in [(bead, fields[3]), (20 + bead, fields[4])] {
                    let expected: f64 = text.parse().expect("a number");
                    let error = (found[place] - expected).abs();
                    // steps that ignore openings err by h^1.5 each
                    assert!(error < 2e-6, "{line}: {}, off by {error:e}", found[place]);
                }
                rows += 1;
            }
        }
    }
    assert_eq!(rows, 120);
}

#[test]
fn what_has_no_derivative_is_refused() {
    let physics = |change: fn(&mut RunConfig)| {
        let mut config = config_of(9, Method::Rkn4, 1.5, |_| {});
        config.time.dt_s = Some(1e-7);
        change(&mut config);
        Physics::resolve(&config).expect("valid")
    };
    let usual = physics(|_| {});
    for (what, changed) in [
        ("the time step", physics(|c| c.time.dt_s = Some(2e-7))),
        ("the method", physics(|c| c.integrator.method = Method::VelocityVerlet)),
        ("the number of beads", physics(|c| c.chain.beads = 10)),
    ] {
        let neighbours = Neighbours { below: &usual, above: &changed, apart: 1.0 };
        let found = Integrator::with_derivatives(&usual, &[neighbours]).expect_err(what);
        assert_eq!(found, NoDerivative::Changes(what));
    }
}
