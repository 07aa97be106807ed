//! Small orbits against the linear modes, which another crate computes: of every kind of chain that is pressed together or bonded.

mod common;

use common::{find, follow, read, tried};
use orbits::NoOrbit;
use schemas::manifest::Physics;
use waves::linear::LinearChain;
use waves::modes::Modes;

/// Kinds of chains, but for their number of beads and their method.
const KINDS: [(&str, &str); 12] = [
    ("a pressed chain", "alpha = 1.5, stiffness = 1e7 | load.precompression_n = 20.0"),
    ("another power", "alpha = 2.2, stiffness = 1e9 | load.precompression_n = 20.0"),
    (
        "several powers",
        "alphas = { pattern = [1.5, 1.3] }, alpha = 1.5, stiffness = 1e7 | load.precompression_n = 20.0",
    ),
    (
        "a second power",
        "second = { alpha = 3.0, stiffness = 1e12 }, alpha = 1.5, stiffness = 1e7 | load.precompression_n = 20.0",
    ),
    (
        "two masses",
        "masses = { pattern_kg = [1e-3, 3e-3] }, alpha = 1.5, stiffness = 1e7 | load.precompression_n = 20.0",
    ),
    (
        "an impurity",
        "impurities = [{ bead = 1, mass_kg = 4e-4 }], alpha = 1.5, stiffness = 1e7 | load.precompression_n = 20.0",
    ),
    (
        "springs",
        "alpha = 1.5, stiffness = 1e7 | load.precompression_n = 20.0 | on_site = { linear_n_per_m = 1e5, cubic_n_per_m3 = 1e13 }",
    ),
    (
        "resonators",
        "alpha = 1.5, stiffness = 1e7 | load.precompression_n = 20.0 | resonators = { mass_kg = 4e-4, stiffness_n_per_m = 3e5 }",
    ),
    ("weight", "alpha = 1.5, stiffness = 1e7 | load.gravity_m_s2 = 2e4 | load.precompression_n = 5.0"),
    ("FPUT bonds", "bonds = { linear = 1e6, quadratic = 1e9, cubic = 1e13 }"),
    ("Toda bonds", "bonds = { toda = { stiffness = 30.0, steepness_per_m = 3e4 } }"),
    ("bonds and springs", "bonds = { linear = 1e6, cubic = 1e13 } | on_site.linear_n_per_m = 2e5"),
];

fn file(beads: usize, kind: &str, ends: &str, method: &str, orbit: &str) -> String {
    let mut parts = kind.split(" | ");
    let chain = parts.next().expect("a chain");
    let others: Vec<&str> = parts.collect();
    format!(
        "chain = {{ beads = {beads}, bead_mass_kg = 1e-3, {chain} }}\nends = {{ left = '{ends}', right = '{ends}' }}\n\
         integrator = {{ method = '{method}' }}\n{}\n{orbit}",
        others.join("\n")
    )
}

/// Frequencies (rad/s) of the modes of a chain.
fn modes(toml: &str) -> Option<Modes> {
    let problem = read(toml).problem(0.0).expect("a chain");
    let physics: &Physics = &problem.physics;
    LinearChain::of(&physics.chain()).ok().and_then(|linear| Modes::of(&linear).ok())
}

#[test]
fn small_orbits_of_every_kind_turn_as_the_linear_modes() {
    let (mut tried_count, mut largest) = (0, 0.0);
    for (name, kind) in KINDS {
        for beads in [2, 3, 8, 13] {
            for ends in ["fixed", "periodic"] {
                for method in ["rkn4", "velocity-verlet"] {
                    let number = beads; // the highest mode of the beads
                    let orbit = format!(
                        "orbit = {{ amplitude_m = 1e-9, steps = 600, mode = {{ number = {number}, displacement_m = 1e-9 }} }}"
                    );
                    if kind.contains("alphas") && beads == 2 {
                        continue;
                    }
                    if ends == "periodic"
                        && (name == "weight"
                            || name == "springs"
                            || beads == 2
                            || beads % 2 == 1 && kind.contains("pattern"))
                    {
                        continue;
                    }
                    let toml = file(beads, kind, ends, method, &orbit);
                    let what = format!("{name}, {beads} beads, {ends}, {method}");
                    let modes = modes(&toml).unwrap_or_else(|| panic!("{what}: no modes"));
                    let orbit = match tried(&toml) {
                        Ok(orbit) => orbit,
                        // modes of one frequency: each of their sums is an orbit, to this amplitude
                        Err(NoOrbit::NotUnique { .. } | NoOrbit::Stuck { .. }) if ends == "periodic" => {
                            continue;
                        }
                        Err(error) => panic!("{what}: {error}"),
                    };
                    // of two modes of one frequency the other one is as large as it came out: not small
                    let largest_m = orbit.state.u_m.iter().fold(0.0, |most: f64, u| most.max(u.abs()));
                    if ends == "periodic" && largest_m > 3e-9 {
                        continue;
                    }
                    let omega = modes.omega_rad_s()[number - 1];
                    let period_s = std::f64::consts::TAU / omega;
                    // errors of the method, of second or fourth order in the step
                    let tolerance = if method == "rkn4" { 1e-6 } else { 1e-3 };
                    let error = orbit.period_s() / period_s - 1.0;
                    assert!(error.abs() < tolerance, "{what}: period {} for {period_s}", orbit.period_s());
                    // of a ring two modes have nearly one frequency
                    let most = if ends == "periodic" { 1e-6 } else { 1e-10 };
                    assert!(orbit.returns < most, "{what}: {:?}", orbit.returns);
                    let mut expected: Vec<f64> =
                        modes.omega_rad_s().iter().flat_map(|omega| [(omega * period_s).cos(); 2]).collect();
                    let mut found: Vec<f64> = orbit.multipliers.found().iter().map(|one| one.re).collect();
                    expected.sort_by(f64::total_cmp);
                    found.sort_by(f64::total_cmp);
                    assert_eq!(found.len(), expected.len(), "{what}");
                    for (found, expected) in found.iter().zip(&expected) {
                        // a defective pair at 1 or −1 is good to the root of an error
                        let is_defective = expected.abs() > 1.0 - 1e-3;
                        let tolerance = match (method, is_defective) {
                            ("rkn4", false) => 1e-8,
                            ("rkn4", true) => 1e-3,
                            _ => 2e-2,
                        };
                        if method == "rkn4" && !is_defective {
                            largest = f64::max(largest, (found - expected).abs());
                        }
                        assert!((found - expected).abs() < tolerance, "{what}: {found} for {expected}");
                    }
                    tried_count += 1;
                }
            }
        }
    }
    println!("{tried_count} orbits, multipliers off by {largest:e} at most, where not defective");
    assert!(tried_count > 90, "{tried_count}");
}

/// However a period is divided, the orbit and its multipliers are the same.
#[test]
fn parts_of_a_period_change_no_multiplier() {
    let mut largest = 0.0;
    for (name, kind) in KINDS {
        let found = [1, 4].map(|segments| {
            let orbit = format!(
                "orbit = {{ amplitude_m = 2e-6, steps = 400, segments = {segments}, mode = {{ number = 5, displacement_m = 2e-6 }} }}"
            );
            let orbit = find(&file(5, kind, "fixed", "rkn4", &orbit));
            let mut sizes: Vec<_> = orbit.multipliers.found().iter().map(|one| (one.size(), one.re)).collect();
            sizes.sort_by(|a, b| a.1.total_cmp(&b.1));
            (orbit.period_s(), sizes)
        });
        let [(period, one), (other_period, other)] = found;
        assert!((period / other_period - 1.0).abs() < 1e-12, "{name}: {period} and {other_period}");
        for (one, other) in one.iter().zip(&other) {
            if (one.1 - 1.0).abs() > 1e-5 {
                largest = [largest, (one.0 - other.0).abs(), (one.1 - other.1).abs()]
                    .into_iter()
                    .fold(0.0, f64::max);
            }
            // the defective pair at 1 is good to the root of rounding
            let tolerance = if (one.1 - 1.0).abs() < 1e-5 { 1e-5 } else { 1e-8 };
            assert!(
                (one.0 - other.0).abs() < tolerance && (one.1 - other.1).abs() < tolerance,
                "{name}: {one:?} and {other:?}"
            );
        }
    }
    println!("one and four parts: multipliers differ by {largest:e} at most");
}

/// The period (s) with this amplitude (m) asked of the seed's mode, which displaces all beads by as much.
fn period_with(beads: u32, bonds: &str, ends: &str, amplitude: f64) -> f64 {
    let toml = format!(
        "chain = {{ beads = {beads}, bead_mass_kg = 1.0, bonds = {{ {bonds} }} }}\nends = {{ left = '{ends}', right = '{ends}' }}\n\
         [orbit]\namplitude_m = {amplitude:?}\nmode = {{ number = {beads}, displacement_m = 0.4 }}\n"
    );
    find(&toml).period_s()
}

/// A seed that is far larger than the orbit would need shorter steps: those of the orbit count.
#[test]
fn steps_are_those_that_the_orbit_may_have() {
    let of = |displacement_m: f64, steps: u64| {
        format!(
            "chain = {{ beads = 3, bead_mass_kg = 1.0, bonds = {{ linear = 1.0, cubic = 10.0 }} }}\nends = {{ left = 'fixed', right = 'fixed' }}\n\
             orbit = {{ energy_j = 1e-4, steps = {steps}, mode = {{ number = 1, displacement_m = {displacement_m} }} }}"
        )
    };
    let toml = of(0.4, 40);
    assert!(read(&toml).problem(0.0).expect("a chain").physics.longest_dt_s() < 0.19);
    assert!((find(&toml).period_s() / find(&of(0.02, 40)).period_s() - 1.0).abs() < 1e-9);
    let refused = tried(&of(0.02, 20)).expect_err("long steps").to_string();
    assert!(refused.contains("orbit.steps: found 20, of "), "{refused}");
}

/// Among beads that the seed displaces equally, some the other way, the amplitude is that of one on its side. With the other sign Newton's method
/// came to orbits of no time, or of several periods.
#[test]
fn an_amplitude_of_either_sign_has_the_same_orbit() {
    let toda = "toda = { stiffness = 1.0, steepness_per_m = 1.5 }";
    let fput = "linear = 1.0, cubic = 1.0";
    for (beads, bonds, ends) in
        [(2, toda, "free"), (2, fput, "free"), (2, fput, "fixed"), (3, fput, "periodic"), (6, fput, "fixed")]
    {
        for amplitude in [0.3, 0.4, 0.5] {
            let [up, down] =
                [amplitude, -amplitude].map(|amplitude| period_with(beads, bonds, ends, amplitude));
            // the two modes of a ring mix, the other way with the other sign
            let allowed = if ends == "periodic" { 1e-3 } else { 1e-9 };
            assert!(
                (up / down - 1.0).abs() < allowed && up > 2.0,
                "{beads} {bonds} {ends} {amplitude}: {up}, {down}"
            );
        }
    }
    assert!((period_with(2, toda, "free", 0.4) - 4.86447).abs() < 1e-5);
}

/// The bead that is displaced most may have the sign that was not asked for: a seed of one such bead.
#[test]
fn an_amplitude_of_the_other_sign_than_the_seed_is_refused() {
    let toml = "chain = { beads = 2, bead_mass_kg = 1.0, bonds = { linear = 1.0 } }\nends = { left = 'fixed', right = 'fixed' }\n\
                initial = { displacements_m = [-0.4, -0.4] }\n[orbit]\nperiod_s = 6.0\namplitude_m = 0.4\n";
    let refused = tried(toml).unwrap_err().to_string();
    assert!(refused.contains("orbit.amplitude_m") && refused.contains("bead 0"), "{refused}");
}

/// Matrices whose steps went round in a circle, and one that was singular to the last place.
#[test]
fn no_energy_is_refused_by_chance() {
    for (beads, energy) in [(8, 0.1), (6, 0.23), (4, 0.13)] {
        let ring = |energy: f64| {
            format!(
                "chain = {{ beads = {beads}, bead_mass_kg = 1.0, bonds = {{ linear = 1.0, cubic = 1.0 }} }}\n\
                 ends = {{ left = 'periodic', right = 'periodic' }}\n\
                 [orbit]\nenergy_j = {energy:?}\nmode = {{ number = {beads}, displacement_m = 0.1 }}\n"
            )
        };
        let [here, beside] = [energy, energy * (1.0 + 1e-9)].map(|energy| find(&ring(energy)));
        assert!((here.period_s() / beside.period_s() - 1.0).abs() < 1e-8, "{beads} {energy}");
        assert_eq!(here.multipliers.is_stable(), beside.multipliers.is_stable(), "{beads} {energy}");
    }
}

/// Exponents are at least 1, drags at least 0: a branch begins and ends there, and comes near from far away.
#[test]
fn a_branch_goes_up_to_the_end_of_a_parameter() {
    let pressed = "chain = { beads = 2, bead_mass_kg = 1.0, alpha = 1.5, stiffness = 1.0 }\nends = { left = 'fixed', right = 'fixed' }\n\
                   load = { precompression_n = 1.0 }\n[orbit]\namplitude_m = 0.3\nmode = { number = 2, displacement_m = 0.1 }\n";
    let shaken = "chain = { beads = 3, bead_mass_kg = 1.0, bonds = { linear = 1.0, cubic = 1.0 } }\nends = { left = 'fixed', right = 'fixed' }\n\
                  on_site = { drag_n_s_per_m = 0.1 }\ndrive = [{ wall = 'left', displacement_m = { sine = { amplitude = 0.1, frequency_hz = 0.2 } } }]\n\
                  [orbit]\n";
    for (chain, key, from, to) in [
        (pressed, "chain.alpha", 2.0, 1.1),
        (pressed, "chain.alpha", 1.1, 1.0),
        (pressed, "chain.alpha", 1.0, 1.1),
        (shaken, "on_site.drag_n_s_per_m", 0.1, 0.01),
    ] {
        let branch = follow(&format!("{chain}[continue]\nkey = '{key}'\nfrom = {from:?}\nto = {to:?}\n"));
        assert_eq!(branch.last.unknown.parameter, to, "{key} from {from}");
    }
}

/// A state that is itself one bead further on says nothing of the next period where the chain is another there.
#[test]
fn a_wave_needs_a_chain_that_repeats() {
    let ring = |masses: &str| {
        format!(
            "chain = {{ beads = 4, bead_mass_kg = 1.0, bonds = {{ linear = 1.0, cubic = 1.0 }}{masses} }}\n\
             ends = {{ left = 'periodic', right = 'periodic' }}\n\
             [orbit]\nperiod_s = 1.0\nshift_beads = 1\nmode = {{ number = 2, displacement_m = 0.1 }}\n"
        )
    };
    let refused = |toml: &str| tried(toml).is_err_and(|why| why.to_string().contains("orbit.shift_beads"));
    assert!(!refused(&ring("")));
    assert!(refused(&ring(", masses = { pattern_kg = [1.0, 2.0] }")));
    let drive = "[[drive]]\nbead = 0\nforce_n = { sine = { amplitude = 0.1, frequency_hz = 0.1 } }\n";
    assert!(refused(&(ring("").replace("period_s = 1.0\n", "") + drive)));
}
