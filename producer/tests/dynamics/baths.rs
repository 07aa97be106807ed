//! Heat baths: harmonic chains between two of them against exact covariances, pressed Hertz chains against the averages of their
//! equilibrium, and the balance of energies of chains of every kind.

use crate::random_chains::{Kind, Random, chain};
use crate::stationary::{between, harmonic, physics, stationary};
use crate::table::Table;
use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::bath::Bath;
use schemas::beads::Beads;
use schemas::drive::Waveform;
use schemas::manifest::Physics;
use schemas::method::Method;
use schemas::summary::Drift;

/// A value of `tests/reference/thermal.csv`.
fn exact(case: &str, quantity: &str, i: usize, j: usize) -> f64 {
    let table = Table::read("thermal");
    let is = |row: &crate::table::Row<'_>| {
        row.text("case") == case
            && row.text("quantity") == quantity
            && [row.count("i"), row.count("j")] == [i as u64, j as u64]
    };
    table.rows().find(is).unwrap().number("value")
}

/// The errors of covariances of displacements, of temperatures and of the heat current fall with the square of the step, and those of
/// `rkn4` are smaller than those of velocity Verlet.
#[test]
fn averages_between_two_baths_are_of_second_order() {
    for (case, friction) in [("C1-rll8", 0.5), ("C1-rll8-g2", 2.0)] {
        let error = |method: &str, dt_s: f64| {
            let found = stationary(method, dt_s, friction, [1.5, 0.5]);
            let at = |i: usize, j: usize| (found.0[i][j] - exact(case, "displacements", i, j)).abs();
            let displacements = (0..8).flat_map(|i| (i..8).map(move |j| (i, j))).map(|(i, j)| at(i, j));
            let temperatures =
                (0..8).map(|i| (found.0[8 + i][8 + i] - exact(case, "temperature", i, i)).abs());
            displacements.chain(temperatures).fold(0.0, f64::max)
        };
        let errors = |method: &str| [0.2, 0.1, 0.05].map(|dt_s| error(method, dt_s));
        let (verlet, rkn4) = (errors("velocity-verlet"), errors("rkn4"));
        println!("{case}: velocity-verlet {verlet:?}, rkn4 {rkn4:?}");
        for [coarse, half, quarter] in [verlet, rkn4] {
            assert!((3.7..4.4).contains(&(coarse / half)) && (3.9..4.1).contains(&(half / quarter)));
        }
        assert!(rkn4[1] < verlet[1] && verlet[1] < 0.02, "{case}");
    }
}

/// In an equilibrium they have the order of the method or a higher one: 2 and 4. Displacements have the covariances T·K^{-1}, velocities T.
#[test]
fn averages_of_an_equilibrium_have_the_order_of_the_method() {
    let error = |method: &str, dt_s: f64| {
        let found = stationary(method, dt_s, 0.5, [1.0; 2]);
        let exact = |i: usize, j: usize| match (i.min(j), i.max(j)) {
            (low, high) if high < 8 => ((low + 1) * (8 - high)) as f64 / 9.0,
            (low, high) => f64::from(u8::from(low == high)),
        };
        let off = (0..256).map(|at| (at / 16, at % 16)).map(|(i, j)| (found.0[i][j] - exact(i, j)).abs());
        off.fold(0.0, f64::max)
    };
    for (method, order) in [("velocity-verlet", 2), ("rkn4", 4)] {
        let [coarse, half] = [0.24, 0.12].map(|dt_s| error(method, dt_s));
        println!("{method}: {coarse:e}, {half:e}");
        // the errors of rkn4 are near those of the sums
        assert!(coarse / half > 0.9 * 2.0_f64.powi(order) && coarse < 0.02, "{method}: {coarse:e}, {half:e}");
        assert!(order == 2 || coarse < 1e-7, "{method}: {coarse:e}");
    }
}

/// Mean and standard error of values that do not depend on each other.
fn mean_and_error(values: &[f64]) -> (f64, f64) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let squares: f64 = values.iter().map(|x| (x - mean) * (x - mean)).sum();
    (mean, (squares / (n * (n - 1.0))).sqrt())
}

/// Current and temperatures of 100 seeds lie within 4 standard errors of the exact ones, and of the standard errors that single runs find from
/// twenty blocks each, 58 to 78 of 100 hold the exact current, as 68 % should.
#[test]
fn sampled_chains_have_the_current_of_rieder_lebowitz_and_lieb() {
    let (exact_w, blocks) = (exact("C1-rll8", "heat_current", 0, 0), 20);
    let (mut currents, mut temperatures) = (Vec::new(), vec![Vec::new(); 8]);
    let mut held = 0;
    for seed in 0..100 {
        let physics = harmonic("rkn4", 0.1, seed, &between(0.5));
        let (mut state, mut integrator) = (ChainState::initial(&physics), Integrator::new(&physics));
        let heat_j = |state: &ChainState| state.extra[0];
        let mut of_blocks = Vec::new();
        let mut squares = [0.0; 8];
        // 2000 s until the chain has forgotten its beginning, at 0.0094 1/s
        while state.step < 20_000 {
            integrator.step(&mut state);
        }
        for _ in 0..blocks {
            let (begun, from) = (heat_j(&state), state.step);
            while state.step < from + 4_000 {
                integrator.step(&mut state);
                if state.step.is_multiple_of(20) {
                    squares
                        .iter_mut()
                        .zip(state.v_m_s.iter())
                        .for_each(|(sum, v)| *sum += v * v / (200.0 * 20.0));
                }
            }
            of_blocks.push((heat_j(&state) - begun) / 400.0);
        }
        let (current, error) = mean_and_error(&of_blocks);
        held += usize::from((current - exact_w).abs() < error);
        currents.push(current);
        temperatures.iter_mut().zip(squares).for_each(|(all, square)| all.push(square));
    }
    let (current, error) = mean_and_error(&currents);
    println!("current {current:.6} ± {error:.6}, exact {exact_w:.6}; {held} of 100 within one error");
    assert!((current - exact_w).abs() < 4.0 * error && error < 0.003);
    assert!((58..=78).contains(&held), "{held}");
    for (i, all) in temperatures.iter().enumerate() {
        let (found, error) = mean_and_error(all);
        let expected = exact("C1-rll8", "temperature", i, i);
        assert!((found - expected).abs() < 4.0 * error, "bead {i}: {found} ± {error}, exact {expected}");
    }
}

/// Equipartition, the virial and the averages over contacts of Hertz chains under a constant force, by a bath of beads, of pairs, and of the last
/// beads alone, by both methods; within 4 standard errors.
#[test]
fn a_pressed_hertz_chain_comes_to_its_equilibrium() {
    for (case, temperature_j, method, bath) in [
        ("C2-gibbs-0.1", 0.1, "velocity-verlet", "friction_per_s = 0.5"),
        ("C2-gibbs-0.5", 0.5, "rkn4", "friction_per_s = 0.5"),
        ("C2-gibbs-0.1", 0.1, "rkn4", "friction_per_s = 2.0\npairs = true"),
        ("C2-gibbs-0.5", 0.5, "velocity-verlet", "friction_per_s = 1.0\nbeads = \"-4..\""),
    ] {
        let physics = physics(&format!(
            "seed = 1\n[chain]\nbeads = 16\nbead_mass_kg = 1.0\nalpha = 1.5\nstiffness = 1.0\n[ends]\nleft = \"fixed\"\n\
             [load]\nprecompression_n = 1.0\n[integrator]\nmethod = \"{method}\"\n[[bath]]\ntemperature_j = {temperature_j}\n{bath}\n\
             [time]\nduration_s = 50000\ndt_s = 0.05\n"
        ));
        let (mut state, mut integrator) = (ChainState::initial(&physics), Integrator::new(&physics));
        let names =
            ["mean_overlap", "mean_force", "mean_square_force", "mean_contact_energy", "virial", "kinetic"];
        let mut of_blocks = vec![Vec::new(); names.len()];
        while state.step < 40_000 {
            integrator.step(&mut state);
        }
        for _ in 0..30 {
            let (mut sums, mut count) = ([0.0; 6], 0.0);
            for _ in 0..1_600 {
                (0..20).for_each(|_| integrator.step(&mut state));
                let mut left_m = 0.0;
                for (u, v) in state.u_m.iter().zip(state.v_m_s.iter()) {
                    let overlap_m = left_m - u + 1.0;
                    let force_n = if overlap_m > 0.0 { overlap_m.powf(1.5) } else { 0.0 };
                    let energy_j = 0.4 * force_n * overlap_m;
                    let all =
                        [overlap_m, force_n, force_n * force_n, energy_j, overlap_m * (force_n - 1.0), v * v];
                    sums.iter_mut().zip(all).for_each(|(sum, value)| *sum += value);
                    (left_m, count) = (*u, count + 1.0);
                }
            }
            of_blocks.iter_mut().zip(sums).for_each(|(all, sum)| all.push(sum / count));
        }
        for (name, values) in names.iter().zip(&of_blocks) {
            let (found, error) = mean_and_error(values);
            let expected = if *name == "kinetic" { temperature_j } else { exact(case, name, 0, 0) };
            println!("{case} {method} {bath:?}: {name} {found:.5} ± {error:.5}, exact {expected:.5}");
            assert!(
                (found - expected).abs() < 4.0 * error + 1e-3 * expected,
                "{case} {method} {bath}: {name}"
            );
        }
    }
}

/// The largest ΔE/E of the first 2000 steps.
fn off_balance(physics: &Physics) -> f64 {
    let chain = physics.chain();
    let drift = Drift::new(physics, &chain);
    let (mut state, mut integrator) = (ChainState::initial(physics), Integrator::new(physics));
    let mut contacts = vec![0.0; chain.contact_count()];
    let mut worst = 0.0_f64;
    for _ in 0..physics.step_count.min(2_000) {
        integrator.step(&mut state);
        let energy_j = chain.energy(&state.u_m, &state.v_m_s, &state.extra, &mut contacts).total_j();
        worst = worst.max(drift.of(energy_j, physics.driven_j(&state.extra), &state.v_m_s).abs());
    }
    worst
}

/// Chains of every kind have the energy that they had at first, and what drives and baths have given.
#[test]
fn energies_balance_in_chains_of_every_kind() {
    let mut random = Random(34);
    let mut tried = [0; 2];
    for kind in Kind::every() {
        for turn in 0..12 {
            let method = if turn % 2 == 0 { Method::VelocityVerlet } else { Method::Rkn4 };
            let mut config = chain(&mut random, kind, method);
            config.integrator.method = method;
            let beads = config.chain.beads;
            let Ok(plain) = Physics::resolve(&config) else { continue };
            let energy_j = plain.initial_energy().total_j() + 1e-12;
            let from = random.below(beads - 1).cast_signed();
            let bath = Bath {
                beads: Beads { from, to: (turn % 3 > 0).then(|| from + 2) },
                temperature_j: Some(Waveform::Constant(random.ratio(1e-3, 1.0) * energy_j)),
                temperature_k: None,
                friction_per_s: random.ratio(1e-2, 1.0) / (50.0 * plain.dt_s),
                seed: Some(turn),
                pairs: turn % 4 > 1,
            };
            config.bath = vec![bath];
            // as short as the chain alone has them
            config.time.dt_s = Some(plain.dt_s);
            let Ok(physics) = Physics::resolve(&config) else { continue };
            tried[usize::from(turn % 4 > 1)] += 1;
            let (found, alone) = (off_balance(&physics), off_balance(&plain));
            let most = if method == Method::Rkn4 { 1e-6 } else { 3e-4 };
            // some drives have a larger error alone
            assert!(
                found < most || found < 3.0 * alone,
                "{kind:?} {method}, turn {turn}: {found:e}\n{}",
                config.to_toml()
            );
        }
    }
    println!("{tried:?} baths of beads and of pairs");
    assert!(tried.iter().all(|count| *count > 60), "{tried:?}");
}

/// Momentum of a ring in a bath of pairs, and of a free chain, stays what it was to rounding.
#[test]
fn a_bath_of_pairs_conserves_momentum() {
    for ends in ["[ends]\nleft = \"periodic\"\nright = \"periodic\"\n", ""] {
        let physics = physics(&format!(
            "[chain]\nbeads = 12\nbead_mass_kg = 1.0\nmasses = {{ pattern_kg = [1.0, 3.0] }}\nbonds = {{ linear = 1.0, cubic = 1.0 }}\n{ends}\
             [[bath]]\ntemperature_j = 1.0\nfriction_per_s = 1.0\npairs = true\n[time]\nduration_s = 1000\ndt_s = 0.02\n"
        ));
        let (mut state, mut integrator) = (ChainState::initial(&physics), Integrator::new(&physics));
        let (masses, mut kinetic) = (physics.chain().mass_kg, 0.0);
        for _ in 0..physics.step_count {
            integrator.step(&mut state);
            let of = |term: &dyn Fn(f64, f64) -> f64| {
                masses.iter().zip(state.v_m_s.iter()).map(|(m, v)| term(*m, *v)).sum::<f64>()
            };
            assert!(of(&|m, v| m * v).abs() < 1e-12);
            kinetic += of(&|m, v| 0.5 * m * v * v) / physics.step_count as f64;
        }
        // one momentum of twelve is not there
        assert!((kinetic / 5.5 - 1.0).abs() < 0.05, "{kinetic}");
    }
}
