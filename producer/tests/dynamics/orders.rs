//! How fast the error falls with the time step, where the exact result can be worked out by hand.

use crate::chains::{final_state, impurity, physics};
use schemas::method::Method;

/// Order of `method` where the force is smooth.
pub(crate) fn order_of(method: Method) -> f64 {
    match method {
        Method::VelocityVerlet => 2.0,
        Method::Rkn4 => 4.0,
    }
}

/// Two beads on a linear contact: while it is closed, for π/√2·T = 2.22 T, the overlap is
/// `v0/ω·sin ωt` with `ω² = 2k/m`, and the centre of mass moves at v0/2.
#[test]
fn methods_have_their_order_while_a_linear_contact_is_closed() {
    for method in Method::ALL {
        let error = |steps: u64| {
            let physics = physics(2, 1.0, 2.0 / steps as f64, steps, |c| c.integrator.method = method);
            let state = final_state(&physics);
            let (u, v, v0) = (state.u_m, state.v_m_s, physics.striker.velocity_m_s);
            let (omega, time_s) =
                ((2.0 * physics.stiffness / physics.bead_mass_kg).sqrt(), 2.0 * physics.scales().time_s);
            // linear in the state, so exact up to a few hundred roundings
            assert!(((u[0] + u[1]) / (v0 * time_s) - 1.0).abs() < 1e-13);
            let overlap_error = (u[0] - u[1]) * omega / v0 - (omega * time_s).sin();
            let speed_error = (v[0] - v[1]) / v0 - (omega * time_s).cos();
            overlap_error.hypot(speed_error)
        };
        for steps in [20, 40] {
            let order = (error(steps) / error(2 * steps)).log2();
            // the next term of the error is (ωdt)² ≤ 0.02 of the leading one
            assert!((order - order_of(method)).abs() < 0.03, "{method}: order {order}, {steps} steps");
        }
    }
}

/// Beads of m and 3 m part at −v0/2 and +v0/2, whatever α is.
///
/// Before and after the collision the energy that a symplectic method conserves is the true one, so its
/// error is all due to the two moments at which δ^α begins and ends, where only α derivatives exist: for
/// the relative velocity the step that meets one makes an error of the order `dt^(α+1)`, with a factor
/// that depends on where in the step it falls. Hence α + 1 for every such method, also where that is more
/// than its own order.
#[test]
fn a_whole_collision_is_elastic_to_the_order_alpha_plus_one() {
    for method in Method::ALL {
        for alpha in [1.0, 1.3, 1.5, 2.0, 2.5] {
            // root mean square over steps from half of to the whole of 0.04 T/2^halvings
            let error = |halvings: u32| {
                let squares = (64..128_u64).map(|phase| {
                    let steps = (200 << halvings) * phase / 64;
                    let physics = physics(2, alpha, 8.0 / steps as f64, steps, |config| {
                        config.integrator.method = method;
                        config.chain.impurities = vec![impurity(1, 3.0)];
                    });
                    let (state, v0) = (final_state(&physics), physics.striker.velocity_m_s);
                    assert!(state.u_m[0] < state.u_m[1], "the beads have parted");
                    (state.v_m_s[0] / v0 + 0.5).powi(2) + (state.v_m_s[1] / v0 - 0.5).powi(2)
                });
                (squares.sum::<f64>() / 64.0).sqrt()
            };
            let order = (error(0) / error(3)).log2() / 3.0;
            // 64 phases leave the mean of a widely spread factor uncertain by about a fifth: log2(1.2)/3,
            // twice
            assert!((order - (alpha + 1.0)).abs() < 0.18, "{method}, α = {alpha}: order {order}");
        }
    }
}
