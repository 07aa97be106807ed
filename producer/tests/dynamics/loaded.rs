//! Loaded and walled chains, exact where arithmetic is: rest, windows, mirror images, powers of two, momentum.

use crate::chains::{final_state, physics};
use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::chain::Chain;
use schemas::config::{End, MassRule, OddContact, RunConfig, StrikerConfig};
use schemas::manifest::Physics;
use schemas::method::Method;

const ALPHAS: [f64; 7] = [1.0, 1.3, 1.5, 2.0, 3.0, 5.0, 10.0];
const BEADS: u64 = 24;

/// The kicks and drifts of the splitting methods as published, in fractions of the step: kick, drift, kick, …, kick.
/// What belongs to the last of each is what is missing to one step.
fn splitting(method: Method) -> Option<Vec<f64>> {
    match method {
        Method::VelocityVerlet => Some(vec![0.5, 1.0, 0.5]),
        Method::Rkn4 => {
            let (b1, b2, b3) = (0.082_984_406_417_405_2, 0.396_309_801_498_368, -0.039_056_304_922_348_6);
            let (a1, a2) = (0.245_298_957_184_271, 0.604_872_665_711_080);
            let (a3, b4) = (0.5 - (a1 + a2), 1.0 - 2.0 * (b1 + b2 + b3));
            Some(vec![b1, a1, b2, a2, b3, a3, b4, a3, b3, a2, b2, a1, b1])
        }
        Method::Gear5 | Method::Rk5 => None,
    }
}

/// Force (N) beyond that at rest of the contact on the left of bead `bead`, which may be that with a wall.
fn left_force(chain: &Chain, u_m: &[f64], bead: usize) -> f64 {
    let (law, walls) = (&chain.law, chain.walls);
    if bead == 0 {
        law.force(walls.left.stiffness, -u_m[0] + walls.left.rest_overlap_m) - walls.left.rest_force_n
    } else if bead == u_m.len() {
        let approach_m = u_m[bead - 1];
        law.force(walls.right.stiffness, approach_m + walls.right.rest_overlap_m) - walls.right.rest_force_n
    } else {
        law.force(chain.stiffness[bead - 1], chain.overlap_m(u_m, bead - 1)) - chain.rest_force_n[bead - 1]
    }
}

/// A step without windows, vectors or shared forces: its definition.
fn naive_step(physics: &Physics, chain: &Chain, stages: &[f64], state: &mut ChainState) {
    for (stage, fraction) in stages.iter().enumerate() {
        let duration_s = fraction * physics.dt_s;
        for bead in 0..state.u_m.len() {
            if stage % 2 == 0 {
                let force = left_force(chain, &state.u_m, bead) - left_force(chain, &state.u_m, bead + 1);
                let velocity = &mut state.v_m_s[bead];
                *velocity += duration_s * (1.0 / chain.mass_kg[bead]) * force;
            } else {
                state.u_m[bead] += duration_s * state.v_m_s[bead];
            }
        }
    }
    state.step += 1;
}

/// A load (N) under which contacts overlap by `ratio` L.
fn load_of(config: &RunConfig, ratio: f64) -> f64 {
    let [mass_kg, alpha, stiffness] = config.chain.scales().expect("scales");
    let speed = config.striker.velocity_m_s.abs();
    let ratio_m = (mass_kg * speed * speed / stiffness).powf(1.0 / (alpha + 1.0)) * ratio;
    stiffness * ratio_m.powf(alpha)
}

type Change = fn(&mut RunConfig);

/// Chains that the shock opens at some contacts and leaves closed at others.
const LOADS: [(&str, Change); 6] = [
    ("walls", |c| (c.ends.left, c.ends.right) = (End::Fixed, End::Fixed)),
    ("pressed by walls", |c| {
        (c.ends.left, c.ends.right) = (End::Fixed, End::Fixed);
        c.load.precompression_n = load_of(c, 0.2);
    }),
    ("pressed at free ends", |c| c.load.precompression_n = load_of(c, 0.2)),
    ("hanging from the left", |c| {
        c.ends.left = End::Fixed;
        c.load.gravity_m_s2 = load_of(c, 0.05) / -c.chain.bead_mass_kg.unwrap();
    }),
    ("standing on the right", |c| {
        (c.ends.right, c.ends.right_stiffness) = (End::Fixed, Some(3.0 * c.chain.stiffness.unwrap()));
        c.load.gravity_m_s2 = load_of(c, 0.05) / c.chain.bead_mass_kg.unwrap();
        c.load.precompression_n = load_of(c, 0.01);
    }),
    ("uneven", |c| {
        (c.ends.left, c.ends.right) = (End::Fixed, End::Fixed);
        c.load.gravity_m_s2 = load_of(c, 0.05) / c.chain.bead_mass_kg.unwrap();
        let mass_kg = c.chain.bead_mass_kg.unwrap();
        c.chain.masses = MassRule::PatternKg(vec![mass_kg, 0.4 * mass_kg, 2.0 * mass_kg]);
        c.chain.contacts = vec![OddContact { contact: 5, stiffness: 0.1 * c.chain.stiffness.unwrap() }];
    }),
];

/// A run of `steps` steps of one of [`LOADS`], struck at `bead` with `velocity_m_s`.
fn loaded(change: Change, method: Method, alpha: f64, striker: StrikerConfig, steps: u64) -> Physics {
    physics(BEADS, alpha, 0.02, steps, |config| {
        change(config);
        (config.striker, config.integrator.method) = (striker.into(), method);
    })
}

fn bits(state: &ChainState) -> Vec<u64> {
    state.u_m.iter().chain(state.v_m_s.iter()).map(|x| x.to_bits()).collect()
}

fn for_each_loaded(check: impl Fn(&str, Change, Method, f64)) {
    for (name, change) in LOADS {
        for method in Method::ALL {
            for alpha in ALPHAS {
                check(&format!("{name}, {method}, α = {alpha}"), change, method, alpha);
            }
        }
    }
}

/// With and without a window over the beads that move.
#[test]
fn a_loaded_chain_at_rest_stays_there_bit_for_bit() {
    for_each_loaded(|name, change, method, alpha| {
        let still = StrikerConfig { bead: 0, velocity_m_s: 0.0 };
        let mut physics = loaded(change, method, alpha, StrikerConfig { bead: 0, velocity_m_s: 5.0 }, 2000);
        physics.striker = still;
        let chain = physics.chain();
        let mut naive = ChainState::initial(&physics);
        let zeros = vec![0; 2 * naive.u_m.len()];
        assert_eq!(bits(&final_state(&physics)), zeros, "{name}");
        let Some(stages) = splitting(method) else { return };
        for _ in 0..20 {
            naive_step(&physics, &chain, &stages, &mut naive);
        }
        assert_eq!(bits(&naive), zeros, "{name}");
    });
}

/// Struck in the middle, until the waves have been reflected at both ends.
#[test]
fn windows_change_no_bit_of_loaded_chains() {
    for_each_loaded(|name, change, method, alpha| {
        let Some(stages) = splitting(method) else { return };
        let striker = StrikerConfig { bead: BEADS / 2, velocity_m_s: -5.0 };
        let physics = loaded(change, method, alpha, striker, 900);
        let chain = physics.chain();
        let mut integrator = Integrator::new(&physics);
        let (mut state, mut naive) = (ChainState::initial(&physics), ChainState::initial(&physics));
        let mut untouched = 0;
        for _ in 0..physics.step_count {
            naive_step(&physics, &chain, &stages, &mut naive);
            integrator.step(&mut state);
            assert_eq!(bits(&state), bits(&naive), "{name}, step {}", state.step);
            untouched += u64::from(state.u_m[0].to_bits() == 0);
        }
        assert!((2..900).contains(&untouched), "{name}: bead 0 rested for {untouched} steps");
    });
}

#[test]
fn a_fresh_integrator_at_every_step_of_a_loaded_chain_gives_the_same_bits() {
    for_each_loaded(|name, change, method, alpha| {
        let physics = loaded(change, method, alpha, StrikerConfig { bead: 3, velocity_m_s: 5.0 }, 150);
        let mut integrator = Integrator::new(&physics);
        let mut state = ChainState::initial(&physics);
        for _ in 0..physics.step_count {
            let mut again = state.clone();
            Integrator::new(&physics).step(&mut again);
            integrator.step(&mut state);
            assert_eq!(again, state, "{name}, step {}", state.step);
        }
    });
}

#[test]
fn mirrored_loads_give_mirrored_bits() {
    for_each_loaded(|name, change, method, alpha| {
        let physics = loaded(change, method, alpha, StrikerConfig { bead: 3, velocity_m_s: 5.0 }, 900);
        let mut mirrored = physics.clone();
        mirrored.striker = StrikerConfig { bead: BEADS - 4, velocity_m_s: -5.0 };
        let ends = &mut mirrored.ends;
        std::mem::swap(&mut ends.left, &mut ends.right);
        std::mem::swap(&mut ends.left_stiffness, &mut ends.right_stiffness);
        mirrored.load.gravity_m_s2 *= -1.0;
        let mut mass_kg = physics.chain().mass_kg;
        mass_kg.reverse();
        mirrored.masses = MassRule::ListKg(mass_kg);
        mirrored.contacts.iter_mut().for_each(|odd| odd.contact = BEADS - 2 - odd.contact);
        let (state, mirrored) = (final_state(&physics), final_state(&mirrored));
        for bead in 0..state.u_m.len() {
            let other = state.u_m.len() - 1 - bead;
            assert_eq!(state.u_m[bead], -mirrored.u_m[other], "{name}, bead {bead}");
            assert_eq!(state.v_m_s[bead], -mirrored.v_m_s[other], "{name}, bead {bead}");
        }
    });
}

/// 4 times the masses under the same loads, or 4 times the stiffnesses under 4 times the loads, at the speed that
/// leaves L as it is: all lengths keep their bits, whatever α is, and times and velocities change by a factor of 2.
#[test]
fn powers_of_two_scale_loaded_chains_exactly() {
    for_each_loaded(|name, change, method, alpha| {
        let physics = loaded(change, method, alpha, StrikerConfig { bead: 0, velocity_m_s: 5.0 }, 900);
        let state = final_state(&physics);
        for heavier in [true, false] {
            let mut scaled = physics.clone();
            // of time
            let factor = if heavier { 2.0 } else { 0.5 };
            let masses = if heavier { 4.0 } else { 1.0 };
            let forces = if heavier { 1.0 } else { 4.0 };
            scaled.bead_mass_kg *= masses;
            if let MassRule::PatternKg(pattern) = &mut scaled.masses {
                for mass_kg in pattern {
                    *mass_kg *= masses;
                }
            }
            scaled.stiffness *= forces;
            scaled.contacts.iter_mut().for_each(|odd| odd.stiffness *= forces);
            scaled.ends.right_stiffness = scaled.ends.right_stiffness.map(|stiffness| stiffness * forces);
            scaled.load.precompression_n *= forces;
            scaled.load.gravity_m_s2 *= forces / masses;
            scaled.striker.velocity_m_s /= factor;
            scaled.dt_s *= factor;
            let scaled = final_state(&scaled);
            assert_eq!(scaled.u_m, state.u_m, "{name}");
            let v_m_s: Vec<_> = scaled.v_m_s.iter().map(|v| v * factor).collect();
            assert_eq!(v_m_s, state.v_m_s[..], "{name}");
        }
    });
}

/// Free ends conserve momentum, also where constant forces press them together; walls change it by their impulse,
/// which velocity Verlet gives as the trapezoidal sum of their forces.
#[test]
fn momentum_changes_by_the_impulse_of_the_walls() {
    let mut pushed = 0;
    for (name, change) in LOADS {
        for alpha in ALPHAS {
            let striker = StrikerConfig { bead: 3, velocity_m_s: 5.0 };
            let physics = loaded(change, Method::VelocityVerlet, alpha, striker, 2000);
            let chain = physics.chain();
            let momentum =
                |state: &ChainState| state.v_m_s.iter().zip(&chain.mass_kg).map(|(v, m)| v * m).sum::<f64>();
            let push = |state: &ChainState| {
                left_force(&chain, &state.u_m, 0) - left_force(&chain, &state.u_m, state.u_m.len())
            };
            let mut integrator = Integrator::new(&physics);
            let mut state = ChainState::initial(&physics);
            let before = momentum(&state);
            let (mut expected, mut largest) = (before, before.abs());
            for _ in 0..physics.step_count {
                let begin = push(&state);
                integrator.step(&mut state);
                expected += 0.5 * physics.dt_s * (begin + push(&state));
                largest = largest.max(expected.abs());
            }
            // one rounding of ε/2·v for each bead and kick, adding up like a random walk
            let error = (momentum(&state) - expected).abs() / largest;
            assert!(error < 1e-12, "{name}, α = {alpha}: {error:e}");
            assert!(expected == before || name != "pressed at free ends");
            pushed += usize::from(expected != before);
        }
    }
    // a steep contact law may hold the wave back from the only wall
    assert!(pushed >= 4 * ALPHAS.len(), "walls pushed in {pushed} runs");
}

/// The splitting methods are palindromes: with all velocities reversed the beads run back to rest.
#[test]
fn reversed_velocities_lead_a_loaded_chain_back_to_rest() {
    for_each_loaded(|name, change, method, alpha| {
        if splitting(method).is_none() {
            return;
        }
        let physics = loaded(change, method, alpha, StrikerConfig { bead: 0, velocity_m_s: 5.0 }, 900);
        let mut state = final_state(&physics);
        state.v_m_s.iter_mut().for_each(|v| *v = -*v);
        let mut integrator = Integrator::new(&physics);
        for _ in 0..physics.step_count {
            integrator.step(&mut state);
        }
        let v_error =
            state.v_m_s[1..].iter().fold((state.v_m_s[0] + 5.0).abs(), |worst, v| worst.max(v.abs()));
        let u_error = state.u_m.iter().fold(0.0, |worst: f64, u| worst.max(u.abs()));
        let error = (u_error / physics.scales().length_m).max(v_error / 5.0);
        // roundings of 1e-16 L, which the collisions of 18 T and back multiply
        assert!(error < 1e-11, "{name}: {error:e}");
    });
}

/// A chain that nothing strikes has its time step from its load.
#[test]
fn a_loaded_chain_at_rest_has_a_default_time_step() {
    for alpha in ALPHAS {
        let mut config = crate::chains::config(BEADS, alpha);
        config.load.precompression_n = 2.0;
        config.striker.velocity_m_s = 0.0;
        let physics = Physics::resolve(&config).unwrap();
        let overlap_m = (2.0 / config.chain.stiffness.unwrap()).powf(1.0 / alpha);
        let time_s = (1e-3 / (config.chain.stiffness.unwrap() * overlap_m.powf(alpha - 1.0))).sqrt();
        let expected = Method::Rkn4.default_step_fraction(alpha) * time_s * (5.0 / alpha).min(1.0);
        // as nearly as divides the duration
        let nearly = 0.5 / physics.step_count as f64 + 1e-12;
        assert!((physics.dt_s / expected - 1.0).abs() < nearly, "α = {alpha}: {}", physics.dt_s);
        // 20 times the load: contacts are stiffer, and the step is shorter
        config.load.precompression_n = 40.0;
        assert!(Physics::resolve(&config).unwrap().dt_s <= physics.dt_s);
    }
}
