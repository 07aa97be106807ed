//! What the equations of motion leave unchanged, the dynamics leaves unchanged.

use crate::chains::{final_state, impurity, physics};
use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::config::{RunConfig, StrikerConfig};
use schemas::manifest::Physics;
use schemas::method::Method;

const ALPHAS: [f64; 7] = [1.0, 1.3, 1.5, 2.0, 3.0, 5.0, 10.0];

/// 24 beads with a heavy and a light impurity, over 40 T: the wave has left the chain at its far end.
fn chain_of_24(alpha: f64, method: Method) -> Physics {
    physics(24, alpha, 0.02, 2000, |config| {
        config.chain.impurities = vec![impurity(7, 3.0), impurity(15, 0.4)];
        config.integrator.method = method;
    })
}

/// The largest difference of two lists of values, the second multiplied by `factor`, in units of `scale`.
fn difference<'a>(a: &[f64], b: impl IntoIterator<Item = &'a f64>, factor: f64, scale: f64) -> f64 {
    a.iter().zip(b).fold(0.0, |largest, (a, b)| largest.max((a - factor * b).abs() / scale))
}

/// The same chain with 4 times the mass, 2 times the velocity and `4^(1−α)` times the stiffness has 4 times
/// L and 2 times T.
#[test]
fn states_scale_with_the_length_and_the_velocity() {
    for method in Method::ALL {
        for alpha in ALPHAS {
            let physics = chain_of_24(alpha, method);
            let mut scaled = physics.clone();
            scaled.bead_mass_kg *= 4.0;
            scaled.impurities.iter_mut().for_each(|impurity| impurity.mass_kg *= 4.0);
            scaled.striker.velocity_m_s *= 2.0;
            scaled.stiffness *= 4.0_f64.powf(1.0 - alpha);
            scaled.dt_s *= 2.0;
            let scales = (physics.scales(), scaled.scales());
            assert!((scales.1.length_m / scales.0.length_m / 4.0 - 1.0).abs() < 1e-15);
            assert!((scales.1.time_s / scales.0.time_s / 2.0 - 1.0).abs() < 1e-15);

            let (state, scaled) = (final_state(&physics), final_state(&scaled));
            let u_error = difference(&scaled.u_m, state.u_m.iter(), 4.0, scales.1.length_m);
            let v_error = difference(&scaled.v_m_s, state.v_m_s.iter(), 2.0, 10.0);
            let extra_error = difference(&scaled.extra, state.extra.iter(), 4.0, scales.1.length_m);
            // bit for bit where 4^α is a power of two and δ^α is computed without the logarithm; else one
            // rounding of k and one of each δ^α, which 40 T amplify some hundred times
            let exact = [1.0, 1.5, 2.0, 3.0, 5.0].contains(&alpha);
            let allowed = if exact { 0.0 } else { 1e-12 };
            let errors = u_error.max(v_error).max(extra_error);
            assert!(errors <= allowed, "{method}, α = {alpha}: off by {errors:e}");
        }
    }
}

#[test]
fn a_chain_struck_from_the_right_is_the_mirror_image_bit_for_bit() {
    for method in Method::ALL {
        for alpha in ALPHAS {
            let physics = chain_of_24(alpha, method);
            let mut mirrored = physics.clone();
            mirrored.impurities.iter_mut().for_each(|impurity| impurity.bead = 23 - impurity.bead);
            mirrored.impurities.reverse();
            mirrored.striker = StrikerConfig { bead: 23, velocity_m_s: -physics.striker.velocity_m_s };
            let (state, mirrored) = (final_state(&physics), final_state(&mirrored));
            assert_eq!(difference(&state.u_m, mirrored.u_m.iter().rev(), -1.0, 1.0), 0.0);
            assert_eq!(difference(&state.v_m_s, mirrored.v_m_s.iter().rev(), -1.0, 1.0), 0.0);
            for (term, mirrored) in state.extra.chunks(24).zip(mirrored.extra.chunks(24)) {
                assert_eq!(difference(term, mirrored.iter().rev(), -1.0, 1.0), 0.0);
            }
        }
    }
}

/// With all velocities reversed the beads run back to where they started. The symplectic methods are
/// palindromes of kicks and drifts, so this holds to rounding at any time step, also where a contact opens.
/// `gear5` is not reversible: its polynomials look back.
#[test]
fn reversed_velocities_lead_back_to_the_start() {
    for method in [Method::VelocityVerlet, Method::Rkn4] {
        for alpha in ALPHAS {
            let physics = chain_of_24(alpha, method);
            let start = ChainState::initial(&physics);
            let mut state = final_state(&physics);
            state.v_m_s.iter_mut().for_each(|v| *v = -*v);
            let mut integrator = Integrator::new(&physics);
            for _ in 0..physics.step_count {
                integrator.step(&mut state);
            }
            let u_error = difference(&state.u_m, start.u_m.iter(), 1.0, physics.scales().length_m);
            let v_error = difference(&state.v_m_s, start.v_m_s.iter(), -1.0, physics.striker.velocity_m_s);
            // displacements of up to 30 L round by 3e-15 L; these add up to 2e-13 L at most as measured
            assert!(u_error.max(v_error) < 2e-12, "{method}, α = {alpha}: off by {u_error:e}, {v_error:e}");
        }
    }
}

/// Without walls nothing depends on the place, however large the forces would be of contacts with what is not there.
#[test]
fn a_chain_that_touches_no_wall_may_be_anywhere() {
    let ends = ["left = \"free\"\nright = \"free\"", "left = \"periodic\"\nright = \"periodic\""];
    let chains = [
        "bonds = { toda = { stiffness = 1.0, steepness_per_m = 1.0 } }",
        "bonds = { linear = 1.0, cubic = 0.1 }",
        "alpha = 300.0\nstiffness = 1.0",
    ];
    for (chain, ends) in chains.iter().flat_map(|chain| ends.map(|ends| (chain, ends))) {
        for beads in [3, 7, 16, 31, 40, 100] {
            let config = RunConfig::from_toml(&format!(
                "[chain]\nbeads = {beads}\nbead_mass_kg = 1.0\n{chain}\n[ends]\n{ends}\n[striker]\nbead = 0\n\
                 velocity_m_s = 1.0\n[time]\nduration_s = 2.0\ndt_s = 0.004\n[integrator]\nmethod = \"velocity-verlet\"\n"
            ));
            let physics = Physics::resolve(&config.unwrap()).unwrap();
            let end_of = |place_m: f64| {
                let (u_m, v_m_s) = physics.initial_state();
                let moved: Vec<f64> = u_m.iter().map(|u| u + place_m).collect();
                let mut state = ChainState::starting_at(&physics, &moved, &v_m_s);
                let mut integrator = Integrator::new(&physics);
                while state.step < physics.step_count {
                    integrator.advance(&mut state, physics.step_count);
                }
                state.u_m.iter().map(|u| u - place_m).collect::<Vec<_>>()
            };
            let here = end_of(0.0);
            for there in [-1000.0, 1000.0].map(end_of) {
                let is_close = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-9;
                assert!(
                    here.iter().zip(&there).all(is_close),
                    "{beads} beads, {chain}, {ends}: {here:?} {there:?}"
                );
            }
        }
    }
}
