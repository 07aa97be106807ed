mod derivatives;
mod naive;
mod tangents;

use super::*;
use schemas::config::{
    DampingConfig, End, MassRule, PowerDamping, Profile, RunConfig, SecondPower, StiffnessRule,
};
use schemas::presets::PRESETS;
use schemas::term::{Spring, TermLaw, Toda};

fn physics(change: impl FnOnce(&mut RunConfig)) -> Physics {
    let mut config = PRESETS[0].config();
    config.chain.beads = 60;
    config.chain.impurities[0].bead = 30;
    config.time.duration_s = 5e-3;
    change(&mut config);
    Physics::resolve(&config).expect("valid")
}

fn bits(state: &ChainState) -> Vec<u64> {
    state.u_m.iter().chain(state.v_m_s.iter()).chain(state.extra.iter()).map(|x| x.to_bits()).collect()
}

/// The instruction sets of this machine.
fn archs() -> Vec<Arch> {
    let mut archs = vec![Arch::Scalar, Arch::new()];
    #[cfg(target_arch = "x86_64")]
    archs.extend(pulp::x86::V3::try_new().map(Arch::V3));
    archs
}

/// A chain of a kind.
fn config_of(beads: u64, method: Method, alpha: f64, kind: fn(&mut RunConfig)) -> RunConfig {
    let mut config = PRESETS[0].config();
    (config.chain.beads, config.chain.alpha, config.integrator.method) = (beads, Some(alpha), method);
    config.chain.impurities.clear();
    kind(&mut config);
    config
}

/// What makes a chain, and how to configure it.
type Variant = (&'static str, fn(&mut RunConfig));

/// Chains with everything that a configuration can ask for, each tried with the methods that take it.
fn variants(method: Method) -> Vec<Variant> {
    let mut variants: Vec<Variant> = vec![
        ("an impurity", |_| {}),
        ("walls and a dimer chain", |c| {
            (c.ends.left, c.ends.right) = (End::Fixed, End::Fixed);
            c.chain.masses = MassRule::PatternKg(vec![1e-3, 3e-3]);
            c.chain.stiffnesses = StiffnessRule::Pattern(vec![1e7, 5e6, 2e7]);
        }),
        ("precompression", |c| c.load.precompression_n = 20.0),
        ("gravity", |c| {
            (c.ends.right, c.load.gravity_m_s2) = (End::Fixed, 9.81);
            c.striker.bead = 20;
        }),
    ];
    if method.takes(schemas::method::Feature::Damping) {
        variants.push(("dashpots", |c| {
            c.damping = Some(DampingConfig::ViscousNSPerM(1.0));
            c.ends.left = End::Fixed;
        }));
        variants.push(("restitution", |c| {
            c.damping = Some(DampingConfig::Restitution(0.8));
            (c.ends.right, c.load.precompression_n) = (End::Fixed, 5.0);
        }));
    }
    variants
}

#[test]
fn skipping_and_vectors_change_no_bit() {
    let archs = archs();
    for method in Method::ALL {
        for alpha in [1.0, 1.01, 1.3, 1.5, 2.0, 2.5, 3.0, 10.0] {
            for (name, variant) in variants(method) {
                let physics = physics(|c| {
                    c.chain.alpha = Some(alpha);
                    c.integrator.method = method;
                    c.time.duration_s = 1.0;
                    variant(c);
                });
                let start = ChainState::initial(&physics);
                let mut naive = start.clone();
                let mut ours: Vec<_> = archs
                    .iter()
                    .map(|arch| (Integrator::with_arch(&physics, *arch), start.clone()))
                    .collect();
                for _ in 0..400 {
                    naive::step(&physics, &mut naive);
                    for (integrator, state) in &mut ours {
                        integrator.step(state);
                        assert_rests_outside(integrator, state);
                        let step = naive.step;
                        assert_eq!(bits(state), bits(&naive), "{method}, α = {alpha}, {name}, step {step}");
                    }
                }
            }
        }
    }
}

/// Nothing but the beads that the integrator says may differ from rest.
fn assert_rests_outside(integrator: &Integrator, state: &ChainState) {
    let active = integrator.active(state).expect("just stepped to");
    for (i, (u, v)) in state.u_m.iter().zip(state.v_m_s.iter()).enumerate() {
        let rests = u.to_bits() == 0 && v.to_bits() == 0;
        assert!(rests || (active.first..active.end).contains(&i), "bead {i}: {u}, {v} outside of {active:?}");
    }
}

/// Chains of every kind that a configuration can ask for.
fn kinds() -> Vec<Variant> {
    fn bonds(c: &mut RunConfig, laws: &[(TermLaw, f64)]) {
        (c.chain.alpha, c.chain.bonds) = (Some(1.0), Some(laws.iter().cloned().collect()));
        (c.ends.left, c.ends.right) = (End::Periodic, End::Periodic);
    }
    vec![
        ("free ends", |_| {}),
        ("a ring of contacts", |c| (c.ends.left, c.ends.right) = (End::Periodic, End::Periodic)),
        ("one wall, gaps", |c| {
            (c.ends.left, c.chain.gaps_m) = (End::Fixed, Some(Profile::Same(1e-6)));
        }),
        ("pressed between walls", |c| {
            (c.ends.left, c.ends.right, c.load.precompression_n) = (End::Fixed, End::Fixed, 20.0);
        }),
        ("springs at each place", |c| {
            c.on_site.linear_n_per_m = Some(Profile::Same(1e5));
            c.on_site.cubic_n_per_m3 = Some(Profile::Same(1e9));
        }),
        ("a second power", |c| {
            c.chain.second = Some(SecondPower { alpha: 2.5, stiffness: Profile::Same(1e9) });
            c.ends.right = End::Fixed;
        }),
        ("linear bonds between walls", |c| {
            bonds(c, &[(TermLaw::Spring(Spring(1)), 1e5)]);
            (c.ends.left, c.ends.right) = (End::Fixed, End::Fixed);
        }),
        ("FPUT-α bonds", |c| {
            bonds(c, &[(TermLaw::Spring(Spring(1)), 1e5), (TermLaw::Spring(Spring(2)), -1e8)]);
        }),
        ("FPUT-β bonds", |c| {
            bonds(c, &[(TermLaw::Spring(Spring(1)), 1e5), (TermLaw::Spring(Spring(3)), 1e12)]);
        }),
        ("all three, with free ends", |c| {
            let springs = [(1, 1e5), (2, 1e7), (3, 1e12)].map(|(n, k)| (TermLaw::Spring(Spring(n)), k));
            bonds(c, &springs);
            (c.ends.left, c.ends.right) = (End::Free, End::Fixed);
        }),
        ("Toda's bonds", |c| bonds(c, &[(TermLaw::Toda(Toda(1e3)), 1e5)])),
        ("a bath at either end", |c| {
            let bath = |beads: &str, temperature_j| {
                let text =
                    format!("beads = {beads}\ntemperature_j = {temperature_j:e}\nfriction_per_s = 5e4\n");
                toml::from_str(&text).expect("a bath")
            };
            (c.bath, c.ends.left) = (vec![bath("0", 1e-3), bath("-1", 1e-5)], End::Fixed);
        }),
        ("a ring in a bath, and its last beads in a second one", |c| {
            bonds(c, &[(TermLaw::Spring(Spring(1)), 1e5), (TermLaw::Spring(Spring(2)), -1e8)]);
            let all = "temperature_j = { ramp = { amplitude = 1e-3, to_s = 1e-6 } }\nfriction_per_s = 5e4\n";
            let last = "beads = \"-2..\"\ntemperature_j = 1e-5\nfriction_per_s = 2e4\nseed = 3\n";
            c.bath = [all, last].map(|text| toml::from_str(text).expect("a bath")).into();
        }),
        ("pairs in a bath", |c| {
            bonds(c, &[(TermLaw::Spring(Spring(1)), 1e5), (TermLaw::Spring(Spring(3)), 1e12)]);
            let text = "temperature_j = { ramp = { amplitude = 1e-3, to_s = 1e-6 } }\nfriction_per_s = 5e4\npairs = true\n";
            c.bath = vec![toml::from_str(text).expect("a bath")];
        }),
    ]
}

/// At every length where a register, a group or a block ends, by every instruction set, step by step and together.
#[test]
fn every_kind_and_length_has_the_bits_of_the_definition() {
    let archs = archs();
    let (mut tried, mut in_lanes) = (0, 0);
    for beads in [2, 3, 7, 8, 9, 14, 15, 16, 17, 31, 32, 33, 47, 48, 63, 64, 65] {
        for method in Method::ALL {
            for alpha in [1.5, 1.3, 3.0] {
                for (name, kind) in kinds() {
                    let config = config_of(beads, method, alpha, kind);
                    // some methods and lengths do not take everything
                    let Ok(physics) = Physics::resolve(&config) else { continue };
                    tried += 1;
                    let (u_m, v_m_s): (Vec<_>, Vec<_>) = (0..beads)
                        .map(|i| (1e-6 * ((i * i * 7) % 11) as f64 - 4e-6, 0.1 * ((i * 5) % 7) as f64 - 0.3))
                        .unzip();
                    let start = ChainState::starting_at(&physics, &u_m, &v_m_s);
                    let mut naive = start.clone();
                    for _ in 0..20 {
                        naive::step(&physics, &mut naive);
                    }
                    for arch in &archs {
                        let mut integrator = Integrator::with_arch(&physics, *arch);
                        let (mut state, mut together) = (start.clone(), start.clone());
                        for _ in 0..20 {
                            integrator.step(&mut state);
                            assert_rests_outside(&integrator, &state);
                        }
                        let mut integrator = Integrator::with_arch(&physics, *arch);
                        while together.step < 20 {
                            integrator.advance(&mut together, 20);
                        }
                        let what = format!("{beads} beads, {method}, α = {alpha}, {name}, {arch:?}");
                        assert_eq!(bits(&state), bits(&naive), "{what}");
                        assert_eq!(bits(&together), bits(&naive), "{what}, together");
                        in_lanes += usize::from(lanes_have_the_bits_of(&config, &start, *arch, &what));
                    }
                }
            }
        }
    }
    assert!(tried > 1200 && in_lanes > 1500, "{tried} chains, {in_lanes} times beside others");
}

/// Forces on up to three beads, and walls that move, in every kind of chain: sweeps of several steps, by every instruction set, have the bits of
/// separate kicks and drifts, which a run makes that carries a tangent.
#[test]
fn drives_in_sweeps_change_no_bit() {
    const FORCES: [&str; 3] = [
        "sine = { amplitude = 3.0, frequency_hz = 1e4, until_s = 4.05e-6 }",
        "step = { amplitude = -2.0, at_s = 2e-6, rise_s = 2.1e-6 }",
        "gaussian = { amplitude = 5.0, at_s = 4e-6, width_s = 2.1e-6 }",
    ];
    const WALL: &str =
        "[[drive]]\nwall = \"left\"\nvelocity_m_s.sine = { amplitude = 0.1, frequency_hz = 1e5 }\n";
    let (mut tried, mut of_walls) = (0, 0);
    let lengths = [2, 3, 8, 17, 33, 70].into_iter().flat_map(|beads| (0..6_usize).map(move |of| (beads, of)));
    for (beads, number) in lengths {
        for (method, (name, kind)) in [Method::VelocityVerlet, Method::Rkn4]
            .into_iter()
            .flat_map(|m| kinds().into_iter().map(move |k| (m, k)))
        {
            let pushed = [0, 1, 17].map(|more| (number as u64 * 7 + more) % beads).into_iter().zip(FORCES);
            let drives: Vec<_> = pushed
                .take(number % 3 + 1)
                .map(|(bead, force)| format!("[[drive]]\nbead = {bead}\nforce_n.{force}\n"))
                .collect();
            let mut toml = drives.concat();
            if number > 3 {
                toml += WALL;
            }
            let mut config = config_of(beads, method, if number == 1 { 1.3 } else { 1.5 }, kind);
            let drive = toml::from_str::<toml::Table>(&toml).expect("drives").remove("drive");
            config.drive = drive.expect("some").try_into().expect("drives");
            config.time.dt_s = Some(2e-7);
            // a chain without a wall, or so short that two forces meet at a bead
            let Ok(physics) = Physics::resolve(&config) else { continue };
            (tried, of_walls) = (tried + 1, of_walls + usize::from(number > 3));
            let start = ChainState::initial(&physics);
            let mut expected = start.clone();
            let mut alone = Integrator::with_tangents(&physics, 1).expect("a method that has tangents");
            (0..40).for_each(|_| alone.step(&mut expected));
            for arch in archs() {
                let (mut integrator, mut state) = (Integrator::with_arch(&physics, arch), start.clone());
                for last in [1, 2, 5, 19, 20, 40] {
                    while state.step < last {
                        integrator.advance(&mut state, last);
                    }
                }
                let what = format!("{beads} beads, {method}, {name}, {number}, {arch:?}");
                assert_eq!(bits(&state), bits(&expected), "{what}");
            }
        }
    }
    assert!(tried > 450 && of_walls > 40, "{tried} chains, {of_walls} with walls that move");
}

/// Chains like that of `config`, each with its own masses, forces, step and motion, have the bits beside each other that each has alone.
/// False if such a chain is computed alone.
fn lanes_have_the_bits_of(config: &RunConfig, start: &ChainState, arch: Arch, what: &str) -> bool {
    let unlike = |lane: usize| {
        let (mut config, part) = (config.clone(), 1.0 + 0.1 * lane as f64);
        config.chain.masses = MassRule::PatternKg(vec![1e-3 * part, 1e-3]);
        config.time.dt_s = Some(1e-7 * part);
        config.load.precompression_n *= part;
        let physics = Physics::resolve(&config).expect("valid");
        let (mut state, steps) = (start.clone(), 20 - lane as u64);
        state.u_m.iter_mut().for_each(|u| *u *= part);
        state.v_m_s[lane % start.v_m_s.len()] = -0.0;
        (physics, state, steps)
    };
    // one lane is left empty
    let chains: Vec<_> = (0..crate::kernel::lanes(arch) - 1).map(unlike).collect();
    let shapes: Vec<_> = chains.iter().filter_map(|(physics, ..)| Shape::of(physics)).collect();
    if shapes.is_empty() {
        return false;
    }
    assert!(shapes.iter().all(|shape| shape.is_like(&shapes[0])), "{what}");
    let together =
        shapes.iter().zip(&chains).map(|(shape, (physics, state, _))| (shape, physics.dt_s, state));
    let mut lanes = Lanes::of(together, arch);
    let mut made = 0;
    for (lane, (physics, state, steps)) in chains.iter().enumerate().rev() {
        while made < *steps {
            made += lanes.advance(steps - made);
        }
        let (mut found, mut alone) = (state.clone(), state.clone());
        lanes.copy_to(lane, &mut found);
        let mut integrator = Integrator::with_arch(physics, arch);
        (0..*steps).for_each(|_| integrator.step(&mut alone));
        assert_eq!(bits(&found), bits(&alone), "{what}, lane {lane}");
    }
    true
}

/// In a chain of many tiles, shocks here and there, of which the first ones cross the borders of tiles, beads that move
/// apart, and beads at rest, some of which have the velocity `-0`. Step by step, and many steps in one sweep.
#[test]
fn tiles_and_steps_together_change_no_bit() {
    for method in [Method::VelocityVerlet, Method::Rkn4] {
        for (name, variant) in variants(method) {
            let physics = physics(|c| {
                c.chain.beads = 1500;
                c.integrator.method = method;
                variant(c);
            });
            let mut start = ChainState::initial(&physics);
            let speed_m_s = start.v_m_s.iter().fold(0.0, |most: f64, v| most.max(v.abs()));
            for (bead, part) in [(415, 1.0), (448, -1.0), (700, 1.0), (832, 0.3), (1023, 0.7), (1499, -0.5)] {
                start.v_m_s[bead] = part * speed_m_s;
            }
            for bead in 900..1100 {
                start.v_m_s[bead] += if bead % 3 == 0 { -0.0 } else { 1e-3 * (bead % 7) as f64 * speed_m_s };
            }
            start.v_m_s[1200] = -0.0;
            let mut naive = start.clone();
            let mut ours = [416, 448, TILE]
                .map(|tile| (Integrator::with_tiles(&physics, Arch::new(), tile), start.clone()));
            let mut together = ours.clone();
            for _ in 0..100 {
                naive::step(&physics, &mut naive);
                for (integrator, state) in &mut ours {
                    integrator.step(state);
                    assert_eq!(bits(state), bits(&naive), "{method}, {name}, step {}", naive.step);
                }
                if ![1, 3, 50, 100].contains(&naive.step) {
                    continue;
                }
                for (integrator, state) in &mut together {
                    while state.step < naive.step {
                        integrator.advance(state, naive.step);
                    }
                    assert_eq!(bits(state), bits(&naive), "{method}, {name}, together to {}", naive.step);
                }
            }
        }
    }
}

#[test]
fn a_fresh_integrator_at_every_step_gives_the_same_bits() {
    for method in Method::ALL {
        for (name, variant) in variants(method) {
            let physics = physics(|c| {
                c.integrator.method = method;
                variant(c);
            });
            let mut one = Integrator::new(&physics);
            let mut state = ChainState::initial(&physics);
            for _ in 0..300 {
                let mut again = state.clone();
                Integrator::new(&physics).step(&mut again);
                one.step(&mut state);
                assert_eq!(bits(&again), bits(&state), "{method}, {name}, step {}", state.step);
            }
        }
    }
}

/// Momentum is conserved to rounding: every force acts on two beads with opposite signs.
#[test]
fn momentum_is_conserved() {
    for method in Method::ALL {
        let physics = physics(|c| c.integrator.method = method);
        let chain = physics.chain();
        let momentum = |s: &ChainState| s.v_m_s.iter().zip(&chain.mass_kg).map(|(v, m)| v * m).sum::<f64>();
        let mut integrator = Integrator::new(&physics);
        let mut state = ChainState::initial(&physics);
        let before = momentum(&state);
        for _ in 0..physics.step_count {
            integrator.step(&mut state);
        }
        // one rounding of ε/2·v for each bead and kick, adding up like a random walk
        assert!((momentum(&state) / before - 1.0).abs() < 1e-12, "{method}");
    }
}

/// Energy against the initial one, with the coefficients that `shared/reference` gives for
/// velocity Verlet (0.12·(dt/T)², α = 1.5), and 1e-6 for rkn4 at its default step.
#[test]
fn energy_drift_is_what_the_reference_says() {
    for (method, bound) in [
        (Method::VelocityVerlet, 0.13 * 0.0025 * 0.0025),
        (Method::Rkn4, 1e-7),
        (Method::Gear5, 2e-7),
        (Method::Rk5, 1e-7),
    ] {
        let physics = physics(|c| {
            c.chain.impurities.clear();
            c.integrator.method = method;
        });
        let chain = physics.chain();
        let initial = physics.initial_energy().total_j();
        let mut scratch = vec![0.0; chain.contact_count()];
        let mut integrator = Integrator::new(&physics);
        let mut state = ChainState::initial(&physics);
        let mut worst: f64 = 0.0;
        for _ in 0..physics.step_count {
            integrator.step(&mut state);
            let energy = chain.energy(&state.u_m, &state.v_m_s, &state.extra, &mut scratch).total_j();
            worst = worst.max((energy / initial - 1.0).abs());
        }
        assert!(worst < bound, "{method}: |ΔE/E| = {worst:e}");
        assert!(worst > bound / 1e3, "{method}: |ΔE/E| = {worst:e} is too good to be true");
    }
}
