//! Tangents are the derivatives of the steps.

use super::*;

/// Gives a chain the drives, resonators, springs at each place and ends of `toml`.
fn with(config: &mut RunConfig, toml: &str) {
    let chain = "[chain]\nbeads = 2\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n";
    let time = "[striker]\nbead = 0\nvelocity_m_s = 1.0\n[time]\nduration_s = 1e-3\n";
    let read = RunConfig::from_toml(&format!("{chain}{toml}{time}")).expect("valid");
    (config.drive, config.resonators) = (read.drive, read.resonators);
    (config.on_site, config.ends) = (read.on_site, read.ends);
}

/// Chains with drives and resonators, as a configuration has them beside its chain.
pub(super) fn driven() -> Vec<Variant> {
    vec![
        ("a bead that is pushed", |c| {
            with(c, "[[drive]]\nbead = 1\nforce_n = { sine = { amplitude = 3.0, frequency_hz = 1e4 } }\n");
        }),
        ("a bead that is moved", |c| {
            let toml =
                "[[drive]]\nbead = 1\ndisplacement_m = { sine = { amplitude = 1e-6, frequency_hz = 1e4 } }\n";
            with(c, toml);
        }),
        ("a bead whose velocity is told", |c| {
            with(
                c,
                "[[drive]]\nbead = 0\nvelocity_m_s = { sine = { amplitude = 0.1, frequency_hz = 1e4 } }\n",
            );
        }),
        ("a wall that is moved", |c| {
            let toml = "[[drive]]\nwall = \"left\"\ndisplacement_m = { sine = { amplitude = 1e-6, frequency_hz = 1e4 } }\n";
            with(c, &format!("[ends]\nleft = \"fixed\"\n{toml}"));
        }),
        ("resonators, springs and a bead that is moved", |c| {
            let sites =
                "[resonators]\nmass_kg = 5e-4\nstiffness_n_per_m = 1e6\n[on_site]\nlinear_n_per_m = 1e5\n";
            let drive =
                "[[drive]]\nbead = 1\ndisplacement_m = { sine = { amplitude = 1e-6, frequency_hz = 1e4 } }\n";
            with(c, &format!("{sites}{drive}"));
        }),
    ]
}

/// Steps of a run.
const STEPS: u64 = 20;

/// A number of no pattern, from −1 to 1.
fn some(index: u64) -> f64 {
    ((index * index * 7 + index * 3 + 1) % 101) as f64 / 50.0 - 1.0
}

/// The state `start`, changed by `factor` times `tangent`.
fn changed(start: &ChainState, tangent: &[f64], factor: f64) -> ChainState {
    let (mut state, beads) = (start.clone(), start.u_m.len());
    for i in 0..beads {
        state.u_m[i] += factor * tangent[i];
        state.v_m_s[i] += factor * tangent[beads + i];
    }
    state.extra.iter_mut().zip(&tangent[2 * beads..]).for_each(|(x, change)| *x += factor * change);
    state
}

/// The state after some steps as the numbers of a tangent.
fn end(physics: &Physics, mut state: ChainState, dimension: usize) -> Vec<f64> {
    let mut integrator = Integrator::new(physics);
    while state.step < STEPS {
        integrator.advance(&mut state, STEPS);
    }
    let numbers = state.u_m.iter().chain(state.v_m_s.iter()).chain(state.extra.iter());
    numbers.copied().take(dimension).collect()
}

/// Drag and dampings of contacts, for methods that take them.
fn dampings() -> Vec<Variant> {
    vec![
        ("drag", |c| c.on_site.drag_n_s_per_m = Some(Profile::Same(2.0))),
        ("dashpots", |c| c.damping = Some(DampingConfig::ViscousNSPerM(1.0))),
        ("restitution", |c| c.damping = Some(DampingConfig::Restitution(0.8))),
        ("viscoelastic spheres", |c| c.damping = Some(DampingConfig::KuwabaraKonoS(1e-6))),
        ("damping of a power, and drag", |c| {
            let damping = PowerDamping { coefficient: 1e4, exponent: 0.7 };
            c.damping = Some(DampingConfig::Power(damping));
            c.on_site.drag_n_s_per_m = Some(Profile::Same(2.0));
        }),
    ]
}

/// Every kind of chain, with drives and dampings of every kind, at lengths where a register ends and in between.
#[test]
fn tangents_are_differences_of_neighbouring_runs_on_every_kind_of_chain() {
    let archs = archs();
    let (mut tried, mut with_drives, mut with_resonators, mut damped) = (0, 0, 0, 0);
    for beads in [2, 3, 8, 17, 32, 33] {
        for method in [Method::VelocityVerlet, Method::Rkn4, Method::Rk5] {
            for alpha in [1.0, 1.5, 1.3, 3.0] {
                for (kind_name, kind) in kinds().into_iter().chain(driven()) {
                    let none: Variant = ("no damping", |_| {});
                    for (name, damp) in [none].into_iter().chain(dampings()) {
                        let mut config = config_of(beads, method, alpha, kind);
                        damp(&mut config);
                        let is_damped = name != none.0;
                        // the lengths tell registers apart, which dampings do not
                        let is_left_out = is_damped && ![3, 17].contains(&beads);
                        let Ok(physics) = Physics::resolve(&config) else { continue };
                        let what = format!("{beads} beads, {method}, α = {alpha}, {kind_name}, {name}");
                        if is_left_out || !has_derivatives(&physics, &archs, &what) {
                            continue;
                        }
                        tried += 1;
                        damped += usize::from(is_damped);
                        with_drives += usize::from(!physics.drives.is_empty());
                        with_resonators += usize::from(physics.resonators.is_some());
                    }
                }
            }
        }
    }
    let counts = [tried, with_drives, with_resonators, damped];
    assert!(tried > 1400 && with_drives > 400 && with_resonators > 90 && damped > 400, "{counts:?}");
}

/// Compares tangents of a run with neighbouring runs. False where a dashpot has closed: its force jumps.
fn has_derivatives(physics: &Physics, archs: &[Arch], what: &str) -> bool {
    let (u_m, v_m_s): (Vec<_>, Vec<_>) =
        (0..physics.beads).map(|i| (4.1e-6 * some(i), 0.1 * ((i * 5) % 7) as f64 - 0.3)).unzip();
    let start = ChainState::starting_at(physics, &u_m, &v_m_s);
    let mut integrator = Integrator::with_tangents(physics, 11).expect("a method that has tangents");
    let carried = integrator.tangents().expect("carried");
    let (dimension, free) = (carried.dimension(), carried.free());
    // a metre of displacement counts as much as a metre a collision time of velocity
    let units: Vec<f64> = (0..dimension)
        .map(|i| if i / u_m.len() % 2 == 0 { 1.0 } else { 1.0 / physics.scales().time_s })
        .collect();
    let begin = |number: usize| -> Vec<f64> {
        let of = |i| if free[i] { some((i + number * dimension) as u64) * units[i] } else { 0.0 };
        (0..dimension).map(of).collect()
    };
    (0..11).for_each(|number| carried.set(number, &begin(number)));
    let mut state = start.clone();
    while state.step < STEPS {
        integrator.advance(&mut state, STEPS);
    }
    assert_eq!(bits(&state), bits(&run_alone(physics, &start)), "{what}: the states");
    let carried = integrator.tangents().expect("carried");
    for arch in archs {
        let mut one = Integrator::carrying(physics, 1, *arch).expect("such a method");
        one.tangents().expect("carried").set(0, &begin(10));
        let mut state = start.clone();
        while state.step < STEPS {
            one.step(&mut state);
        }
        let one = one.tangents().expect("carried").tangent(0);
        assert_eq!(one, carried.tangent(10), "{what}, {arch:?}, alone");
    }
    if carried.has_jumped() {
        let exponent = physics.damping.map_or(1.0, |damping| damping.exponent(physics.alpha));
        assert!(exponent < 1.0, "{what}");
        if exponent == 0.0 {
            return false;
        }
    }
    for number in [0, 10] {
        // so near that `δ^p` of a damped contact that has just closed, which bends as δ^(p−2), is straight between them
        let (found, factor) = (carried.tangent(number), 1e-9 * physics.scales().length_m);
        let [up, down] =
            [factor, -factor].map(|factor| end(physics, changed(&start, &begin(number), factor), dimension));
        let largest = found.iter().zip(&units).fold(0.0, |most: f64, (x, unit)| most.max((x / unit).abs()));
        for i in 0..dimension {
            let expected = (up[i] - down[i]) / (2.0 * factor);
            let error = ((found[i] - expected) / units[i]).abs() / largest;
            // in a contact that opens a slope has no slope of its own: √ε of it, in ε of the time
            assert!(error < 2e-5, "{what}, {i}: {} for {expected}: {error:e}", found[i]);
        }
    }
    true
}

fn run_alone(physics: &Physics, start: &ChainState) -> ChainState {
    let (mut state, mut integrator) = (start.clone(), Integrator::new(physics));
    while state.step < STEPS {
        integrator.advance(&mut state, STEPS);
    }
    state
}

/// Many steps at once carry tangents as single steps do where most beads rest, in chains longer than a tile, too, and from a state that the
/// integrator has not come to.
#[test]
fn tangents_of_a_front_do_not_depend_on_where_anyone_looks() {
    let pushes = "[[drive]]\nbead = 40\nforce_n = { sine = { amplitude = 3.0, frequency_hz = 1e4 } }\n";
    let moves = "[ends]\nleft = \"fixed\"\n[[drive]]\nwall = \"left\"\ndisplacement_m = { sine = { amplitude = 1e-6, frequency_hz = 1e4 } }\n";
    // pressed contacts have a slope where the beads rest, too
    for (beads, method, toml, precompression_n) in [
        (300, Method::VelocityVerlet, "", 0.0),
        (300, Method::VelocityVerlet, "", 20.0),
        (300, Method::Rkn4, pushes, 20.0),
        (60, Method::VelocityVerlet, moves, 0.0),
        (2500, Method::Rkn4, "", 20.0),
        (2500, Method::VelocityVerlet, pushes, 0.0),
    ] {
        let physics = physics(|c| {
            with(c, toml);
            (c.chain.beads, c.integrator.method, c.striker.bead) = (beads, method, 40);
            c.load.precompression_n = precompression_n;
        });
        let mut together = Integrator::with_tangents(&physics, 3).expect("a method that has tangents");
        let mut one_by_one = together.clone();
        for steps in [70, 90, 50] {
            let mut states = [ChainState::initial(&physics), ChainState::initial(&physics)];
            for integrator in [&mut together, &mut one_by_one] {
                let tangents = integrator.tangents().expect("carried");
                tangents.spread(&tangents.weights(physics.scales().time_s));
            }
            while states[0].step < steps {
                together.advance(&mut states[0], steps);
            }
            while states[1].step < steps {
                one_by_one.step(&mut states[1]);
            }
            assert_eq!(bits(&states[0]), bits(&states[1]));
            for number in 0..3 {
                let [many, single] = [&mut together, &mut one_by_one]
                    .map(|integrator| integrator.tangents().expect("carried").tangent(number));
                assert_eq!(many, single, "{beads} beads, {method}, {toml}, {steps} steps");
            }
        }
    }
}

/// A chain of six beads pressed between walls.
fn pressed(method: Method, change: impl FnOnce(&mut RunConfig)) -> Physics {
    physics(|c| {
        (c.chain.beads, c.integrator.method) = (6, method);
        c.chain.masses = MassRule::PatternKg(vec![1e-3, 3e-3]);
        c.chain.impurities.clear();
        (c.load.precompression_n, c.striker.velocity_m_s) = (20.0, 0.01);
        change(c);
        (c.ends.left, c.ends.right) = (End::Fixed, End::Fixed);
    })
}

/// The map of many steps keeps the area of every pair of tangents: `Mᵀ·J·M = J`, with momenta in place of velocities.
#[test]
fn the_map_of_ten_thousand_steps_is_symplectic() {
    for method in [Method::VelocityVerlet, Method::Rkn4] {
        let physics = pressed(method, |_| {});
        let (mass, time_s) = (physics.chain().mass_kg, physics.scales().time_s);
        let mut integrator = Integrator::with_tangents(&physics, 12).expect("symplectic");
        for i in 0..12 {
            let mut unit = vec![0.0; 12];
            unit[i] = if i < 6 { 1.0 } else { 1.0 / time_s };
            integrator.tangents().expect("carried").set(i, &unit);
        }
        let mut state = ChainState::initial(&physics);
        let area = |carried: &Tangents, a: usize, b: usize| -> f64 {
            let (a, b) = (carried.tangent(a), carried.tangent(b));
            (0..6).map(|i| mass[i] * (a[i] * b[6 + i] - a[6 + i] * b[i])).sum::<f64>() * time_s / mass[0]
        };
        let pairs = || (0..12).flat_map(|a| (0..12).map(move |b| (a, b)));
        let carried = integrator.tangents().expect("carried");
        let before: Vec<f64> = pairs().map(|(a, b)| area(carried, a, b)).collect();
        while state.step < 10_000 {
            integrator.advance(&mut state, 10_000);
        }
        let carried = integrator.tangents().expect("carried");
        let largest = (0..12)
            .flat_map(|a| carried.tangent(a)[..6].to_vec())
            .fold(0.0, |most: f64, x| most.max(x.abs()));
        for ((a, b), before) in pairs().zip(before) {
            let error = (area(carried, a, b) - before).abs();
            // roundings of 10^4 steps, of products of entries that have grown
            assert!(error < 1e-10 * largest.max(1.0), "{method}, {a}, {b}: {error:e}, largest {largest}");
        }
    }
}

/// The logarithm of the determinant of the map of the steps up to `time_s`, of the free numbers of a state.
fn logarithm_of_determinant(physics: &Physics, time_s: f64) -> f64 {
    let mut integrator = Integrator::with_tangents(physics, 0).expect("rk5");
    let carried = integrator.tangents().expect("carried");
    let weights = carried.weights(physics.scales().time_s);
    carried.resize(carried.free().iter().filter(|free| **free).count());
    carried.spread(&weights);
    let (mut state, mut sum) = (ChainState::initial(physics), 0.0);
    while (state.step as f64 + 0.5) * physics.dt_s < time_s {
        integrator.step(&mut state);
        let carried = integrator.tangents().expect("carried");
        sum += carried.orthonormalise(&weights).iter().map(|parts| parts[parts.len() - 1].ln()).sum::<f64>();
        assert!(!carried.has_jumped(), "nothing opens");
    }
    sum
}

/// With damping the map of many steps shrinks volumes: by the factor `exp(−t·Σ γ/m)` over the beads that move freely, where γ is that of
/// drag and of the dashpots on both sides. Errors fall by the order of the method.
#[test]
fn the_map_of_damped_steps_shrinks_volumes_as_the_motion_does() {
    let variants: [(Variant, f64); 3] = [
        (("drag", |c| c.on_site.drag_n_s_per_m = Some(Profile::Same(2.0))), 2.0),
        (("dashpots", |c| c.damping = Some(DampingConfig::ViscousNSPerM(3.0))), 6.0),
        (
            ("both, and a bead that is moved", |c| {
                let moves = "displacement_m = { sine = { amplitude = 1e-7, frequency_hz = 1e3 } }";
                with(c, &format!("[[drive]]\nbead = 2\n{moves}\n"));
                c.damping = Some(DampingConfig::ViscousNSPerM(3.0));
                c.on_site.drag_n_s_per_m = Some(Profile::Same(2.0));
            }),
            8.0,
        ),
    ];
    for ((name, change), gamma) in variants {
        let [coarse, fine] = [1.0, 2.0].map(|finer| {
            let physics = pressed(Method::Rk5, |c| {
                change(c);
                c.time.dt_s = Some(2e-6 / finer);
            });
            let carried = Tangents::of(&physics, &physics.chain(), 1, Arch::new());
            let (mass, free) = (physics.chain().mass_kg, carried.free());
            let rate: f64 = (0..6).filter(|i| free[*i]).map(|i| gamma / mass[i]).sum();
            logarithm_of_determinant(&physics, 2e-3) / (-2e-3 * rate) - 1.0
        });
        let falls_by = coarse / fine;
        assert!(
            fine.abs() < 1e-9 && falls_by > 24.0,
            "{name}: {fine:e}, {falls_by} times less than {coarse:e}"
        );
    }
}

/// Where a contact closes the force of a dashpot jumps, and that of restitution has a slope without bound.
#[test]
fn damping_without_a_derivative_is_told_where_a_contact_closes() {
    let power = PowerDamping { coefficient: 1.0, exponent: 1.0 };
    for (damping, is_told) in [
        (DampingConfig::ViscousNSPerM(1.0), true),
        (DampingConfig::Restitution(0.9), true),
        (DampingConfig::KuwabaraKonoS(1e-6), true),
        (DampingConfig::Power(power), false),
    ] {
        let physics = physics(|c| {
            c.integrator.method = Method::Rk5;
            c.damping = Some(damping);
        });
        let (mut state, mut integrator) =
            (ChainState::initial(&physics), Integrator::with_tangents(&physics, 1).expect("rk5"));
        assert!(!integrator.tangents().expect("carried").has_jumped());
        (0..10).for_each(|_| integrator.step(&mut state));
        assert_eq!(integrator.tangents().expect("carried").has_jumped(), is_told, "{damping:?}");
    }
}

/// The growths of `tests/reference/tangents.csv`, by methods of higher orders, in units of their own.
#[test]
fn growths_are_those_of_another_program() {
    let mut rows = 0;
    for line in include_str!("../../../../tests/reference/tangents.csv").lines().skip(1) {
        let fields: Vec<&str> = line.split(',').collect();
        let number = |place: usize| -> f64 { fields[place].parse().expect("a number") };
        let (case, until, expected, tolerance) = (fields[0], number(1), number(2), number(3));
        let (config, start, tangent) = reference(case);
        // where no contact opens errors fall by h⁴, at openings by h^1.5
        let opens = case.ends_with("open");
        let [coarse, fine] = if opens { [4.0, 8.0] } else { [1.0, 2.0] }.map(|finer| {
            let mut config = config.clone();
            let steps = until / 0.02 * finer;
            config.time.dt_s = Some(until / steps);
            config.time.duration_s = until;
            let physics = Physics::resolve(&config).expect("valid");
            let beads = usize::try_from(physics.beads).expect("few");
            let mut state = ChainState::starting_at(&physics, &vec![0.0; beads], &start);
            let mut integrator = Integrator::with_tangents(&physics, 1).expect("rkn4");
            integrator.tangents().expect("carried").set(0, &tangent);
            while (state.step as f64) < steps {
                integrator.step(&mut state);
            }
            let norm =
                integrator.tangents().expect("carried").tangent(0).iter().map(|x| x * x).sum::<f64>().sqrt();
            norm.ln() / until
        });
        let found = if opens { fine } else { fine + (fine - coarse) / 15.0 };
        assert!((found - expected).abs() < tolerance, "{line}: {found}, off by {:e}", found - expected);
        rows += 1;
    }
    assert!(rows >= 20, "{rows}");
}

/// The largest exponents of two rings over long times, within three times both errors: those of the other program, from 10⁴ s to 10⁵ s, are
/// means over three runs; over 10⁴ s these here scatter by 0.0012.
#[test]
fn exponents_of_long_runs_are_those_of_another_program() {
    for (case, expected, error) in
        [("A1-ring32-E1", 0.104_587, 0.000_3), ("A1-ring32-E0.1", 0.012_257, 0.000_45)]
    {
        let (mut config, start, tangent) = reference(case);
        config.integrator.method = Method::VelocityVerlet;
        (config.time.dt_s, config.time.duration_s) = (Some(0.02), 2.2e4);
        let physics = Physics::resolve(&config).expect("valid");
        let mut state = ChainState::starting_at(&physics, &[0.0; 32], &start);
        let mut integrator = Integrator::with_tangents(&physics, 1).expect("velocity-verlet");
        integrator.tangents().expect("carried").set(0, &tangent);
        let (from, until) = (500_000, 1_100_000);
        let mut grown = 0.0;
        while state.step < until {
            let next = state.step + 500;
            while state.step < next {
                integrator.advance(&mut state, next);
            }
            let carried = integrator.tangents().expect("carried");
            let w = carried.tangent(0);
            let norm = w.iter().map(|x| x * x).sum::<f64>().sqrt();
            carried.set(0, &w.iter().map(|x| x / norm).collect::<Vec<_>>());
            grown += if next > from { norm.ln() } else { 0.0 };
        }
        let found = grown / (0.02 * (until - from) as f64);
        let allowed = 3.0 * f64::hypot(error, 0.001_2);
        assert!((found - expected).abs() < allowed, "{case}: {found}, not {expected} ± {allowed}");
    }
}

/// A chain, its first velocities and tangent, of a case of the reference.
fn reference(case: &str) -> (RunConfig, Vec<f64>, Vec<f64>) {
    let beads = if case.starts_with("A1-ring") { 32 } else { 16 };
    let mut config = PRESETS[0].config();
    config.chain.impurities.clear();
    (config.chain.beads, config.chain.bead_mass_kg, config.chain.stiffness) = (beads, Some(1.0), Some(1.0));
    config.integrator.method = Method::Rkn4;
    config.striker.velocity_m_s = 1.0;
    let is_bonded = case.starts_with("A1");
    if is_bonded {
        let laws = [(TermLaw::Spring(Spring(1)), 1.0), (TermLaw::Spring(Spring(3)), 1.0)];
        config.chain.bonds = Some(schemas::config::Bonds::from_iter(laws));
    } else {
        config.load.precompression_n = 1.0;
    }
    let (count, pi) = (beads as f64, std::f64::consts::PI);
    let end = if beads == 32 { End::Periodic } else { End::Fixed };
    (config.ends.left, config.ends.right) = (end, end);
    let size = case.rsplit("-E").next().and_then(|size| size.parse::<f64>().ok());
    let velocity = |i: f64| match (size, case) {
        (Some(size), _) => {
            size.sqrt()
                * (1..5).map(|j| (2.0 * pi * f64::from(j) * i / 32.0 + f64::from(j * j)).cos()).sum::<f64>()
        }
        (None, "A1-fixed16") => 1.4 * (1.3 * i + 0.4).sin(),
        (None, "A2-loaded16") => 0.6 * (1.3 * i + 0.4).sin(),
        (None, _) => 1.6 * (1.3 * i + 0.4).sin(),
    };
    let shape = |i: f64| match size {
        Some(_) => (2.0 / count).sqrt() * (2.0 * pi * 5.0 * i / count).cos(),
        None => (2.0 / (count + 1.0)).sqrt() * (3.0 * pi * (i + 1.0) / (count + 1.0)).sin(),
    };
    let places = || (0..beads).map(|i| i as f64);
    let (zeros, shapes) =
        (vec![0.0; usize::try_from(beads).expect("few")], places().map(shape).collect::<Vec<_>>());
    let tangent = if size == Some(0.1) { [zeros, shapes].concat() } else { [shapes, zeros].concat() };
    (config, places().map(velocity).collect(), tangent)
}
