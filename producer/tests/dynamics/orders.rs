//! How fast the error falls with the time step, where the exact result can be worked out by hand.

use crate::chains::{final_state, impurity, physics, state_after};
use producer::state::ChainState;
use schemas::config::{DampingConfig, RunConfig};
use schemas::method::Method;

/// Order of `method` where the force is smooth.
pub(crate) fn order_of(method: Method) -> f64 {
    f64::from(method.order())
}

/// Two beads on a linear contact that stays closed: the overlap is `v0/ω·sin ωt` with `ω² = 2k/m`, followed from
/// `ωt = ½` for 1.5 T to `ωt = 2.62`, and the centre of mass moves at v0/2.
#[test]
fn methods_have_their_order_while_a_linear_contact_is_closed() {
    for method in Method::ALL {
        let error = |steps: u64| {
            let physics = physics(2, 1.0, 1.5 / steps as f64, steps, |c| c.integrator.method = method);
            let v0 = physics.striker.velocity_m_s;
            let omega = (2.0 * physics.stiffness / physics.bead_mass_kg).sqrt();
            let time_s = 1.5 * physics.scales().time_s;
            let overlap = 0.5 * v0 / omega * 0.5_f64.sin();
            let speed = 0.5 * v0 * 0.5_f64.cos();
            let start = ChainState::starting_at(
                &physics,
                &[overlap, -overlap],
                &[0.5 * v0 + speed, 0.5 * v0 - speed],
            );
            let state = state_after(&physics, start);
            let (u, v) = (state.u_m, state.v_m_s);
            // linear in the state, so exact up to a few hundred roundings
            assert!(((u[0] + u[1]) / (v0 * time_s) - 1.0).abs() < 1e-13);
            let phase = 0.5 + omega * time_s;
            let overlap_error = (u[0] - u[1]) * omega / v0 - phase.sin();
            let speed_error = (v[0] - v[1]) / v0 - phase.cos();
            overlap_error.hypot(speed_error)
        };
        // the next term of the error is (ωdt)² ≤ 0.02 of the leading one; that of gear5 is about 6·ωdt of it,
        // because its leading term is small where forces depend on displacements alone
        let (fewest, allowed) = if method == Method::Gear5 { (40, 0.4) } else { (20, 0.02) };
        for (steps, allowed) in [(fewest, allowed), (2 * fewest, 0.5 * allowed)] {
            let order = (error(steps) / error(2 * steps)).log2();
            assert!((order - order_of(method)).abs() < allowed, "{method}: order {order}, {steps} steps");
        }
    }
}

/// Beads of m and 3 m part at −v0/2 and +v0/2, whatever α is.
///
/// Where the contact is closed the methods have their own order, and a symplectic method conserves an energy
/// that is the true one before and after the collision. The error that is left comes from the two moments at
/// which δ^α begins and ends, where only α derivatives exist: for the relative velocity the step that
/// meets one makes an error of the order `dt^(α+1)`, with a factor that depends on where in the step it
/// falls. Hence α + 1 for velocity Verlet too, where that is more than its own order, and never more than
/// α + 1 for the others.
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

/// Twelve beads, pressed together so hard that the shock opens none of their contacts: the force is smooth, and the
/// methods have their order on a whole nonlinear chain, from the first step on.
#[test]
fn methods_have_their_order_on_a_precompressed_chain() {
    for method in Method::ALL {
        let state = |steps: u64| {
            let physics = physics(12, 1.5, 6.0 / steps as f64, steps, |config| {
                config.integrator.method = method;
                config.load.precompression_n = 1000.0;
            });
            let (state, chain) = (final_state(&physics), physics.chain());
            assert!((0..11).all(|contact| chain.overlap_m(&state.u_m, contact) > 0.0), "a contact is open");
            state.u_m
        };
        let change = |coarse: &[f64], fine: &[f64]| {
            coarse.iter().zip(fine).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
        };
        let fewest = if method == Method::Gear5 { 600 } else { 300 };
        let [coarse, middle, fine] = [1, 2, 4].map(|factor| state(factor * fewest));
        let order = (change(&coarse, &middle) / change(&middle, &fine)).log2();
        // with forces that depend on displacements alone, c_0 = 3/20 gives the displacements one order more
        let expected = if method == Method::Gear5 { 6.0 } else { order_of(method) };
        assert!((order - expected).abs() < 0.05, "{method}: order {order}");
    }
}

/// The linear contact with dashpots, ζ = 0.1: the overlap is `e^(−γt)·sin(ω't + φ)`, up to a factor, with
/// `γ = η/m` and `ω'² = 2k/m − γ²`. Forces depend on velocities, and rk5 keeps its order; the dissipated work makes
/// up for the energy to fourth order at least.
#[test]
fn rk5_has_its_order_with_damping() {
    let errors = |steps: u64| {
        let dashpot = |config: &mut RunConfig| {
            let omega = (2.0 * config.chain.stiffness.unwrap() / config.chain.bead_mass_kg.unwrap()).sqrt();
            config.integrator.method = Method::Rk5;
            config.damping =
                Some(DampingConfig::ViscousNSPerM(0.1 * omega * config.chain.bead_mass_kg.unwrap()));
        };
        let physics = physics(2, 1.0, 1.2 / steps as f64, steps, dashpot);
        let omega = (2.0 * physics.stiffness / physics.bead_mass_kg).sqrt();
        let (decay, frequency) = (0.1 * omega, omega * 0.99_f64.sqrt());
        let amplitude_m = 1e-4;
        let motion = |time_s: f64| {
            let (phase, size) = (0.5 + frequency * time_s, amplitude_m * (-decay * time_s).exp());
            (size * phase.sin(), size * (frequency * phase.cos() - decay * phase.sin()))
        };
        let (overlap, rate) = motion(0.0);
        let halves = |x: f64| vec![0.5 * x, -0.5 * x];
        let start = ChainState::starting_at(&physics, &halves(overlap), &halves(rate));
        let chain = physics.chain();
        let energy_j =
            |state: &ChainState| chain.energy(&state.u_m, &state.v_m_s, &state.extra, &mut [0.0]).total_j();
        let before_j = energy_j(&start);
        let state = state_after(&physics, start);
        let (overlap, rate) = motion(1.2 * physics.scales().time_s);
        let overlap_error = (state.u_m[0] - state.u_m[1] - overlap) / amplitude_m;
        let rate_error = (state.v_m_s[0] - state.v_m_s[1] - rate) / (amplitude_m * omega);
        let dissipated_j = physics.dissipated_j(&state.extra);
        assert!(dissipated_j > 0.1 * before_j, "much is dissipated");
        [overlap_error.hypot(rate_error), ((energy_j(&state) + dissipated_j) / before_j - 1.0).abs()]
    };
    let (coarse, fine) = (errors(40), errors(80));
    let orders = [0, 1].map(|i| (coarse[i] / fine[i]).log2());
    assert!((orders[0] - 5.0).abs() < 0.2 && orders[1] > 3.8, "orders {orders:?} of {coarse:?}");
}
