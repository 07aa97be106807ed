//! The presets of the field: what is known of each without us.

use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::config::RunConfig;
use schemas::drive::Waveform;
use schemas::manifest::Physics;
use schemas::presets::Preset;
use std::f64::consts::{PI, TAU};

fn preset(name: &str) -> RunConfig {
    Preset::find(name).unwrap().config()
}

/// Calls `each` with the state after every `every` steps.
fn run(physics: &Physics, every: u64, mut each: impl FnMut(&ChainState)) -> ChainState {
    let mut state = ChainState::initial(physics);
    let mut integrator = Integrator::new(physics);
    while state.step < physics.step_count {
        let last = physics.step_count.min(state.step.saturating_add(every));
        integrator.advance(&mut state, last);
        each(&state);
    }
    state
}

/// (kinetic + potential + dissipated − driven − what there was at first) over the largest of them.
fn imbalance(physics: &Physics, state: &ChainState) -> f64 {
    let chain = physics.chain();
    let energy = chain.energy(&state.u_m, &state.v_m_s, &state.extra, &mut vec![0.0; chain.contact_count()]);
    let driven: f64 = physics.rows().drives_of(&state.extra).iter().step_by(2).sum();
    let dissipated = physics.dissipated_j(&state.extra);
    let first = physics.initial_energy().total_j();
    let largest = driven.abs().max(dissipated).max(first);
    (energy.total_j() + dissipated - driven - first) / largest
}

/// The preset with its left wall shaken at that frequency; the largest velocity of bead 35 after the start, over that of the wall.
fn transmitted(name: &str, at_hz: f64) -> f64 {
    let mut config = preset(name);
    let Waveform::Sine(sine) = &mut config.drive[0].waveform else { unreachable!("a sine") };
    sine.frequency_hz = at_hz;
    let speed = TAU * at_hz * sine.amplitude;
    config.time.duration_s = 0.03;
    let physics = Physics::resolve(&config).unwrap();
    let mut largest: f64 = 0.0;
    run(&physics, 20, |state| {
        if physics.time_s(state.step) > 0.02 {
            largest = largest.max(state.v_m_s[35].abs());
        }
    });
    largest / speed
}

/// K = 1.5e5 N/m under 10 N: a gap from √(2K/M) to √(2K/m), 1949.2 to 2756.6 Hz, and nothing above √(2K·(1/M + 1/m)), 3376.2 Hz.
/// What is shaken within the gap falls from pair to pair of beads; what is left at bead 35 is of the beginning, which has frequencies of
/// the bands.
#[test]
fn a_dimer_chain_is_silent_within_its_gap() {
    let edges = [(2.0 * 1.5e5 / 2e-3_f64).sqrt() / TAU, (2.0 * 1.5e5 / 1e-3_f64).sqrt() / TAU];
    for (at, passes) in [(0.5, true), (0.95, true), (1.1, false), (1.2, false), (1.3, false), (1.5, true)] {
        let found = transmitted("band-gap", at * edges[0]);
        assert!(if passes { found > 0.2 } else { found < 0.05 }, "{at}: {found:e}");
    }
    assert!((edges[1] / edges[0] - 2.0_f64.sqrt()).abs() < 1e-15);
}

/// Masses on springs inside the beads take up what is between the lower band and `ω0·√(1 + m_r/m)`, `ω0 = √(k_r/m_r) = 1e4/s`.
#[test]
fn a_chain_of_resonators_is_silent_within_its_gap() {
    let (m, m_r, k, omega2) = (1e-3_f64, 0.5e-3_f64, 1.5e5_f64, 1e8_f64);
    // the upper edge of the lower band: (m + m_r·ω0²/(ω0² − ω²))·ω² = 4K
    let (b, c) = (m * omega2 + m_r * omega2 + 4.0 * k, 4.0 * k * omega2);
    let lower = ((b - (b * b - 4.0 * m * c).sqrt()) / (2.0 * m)).sqrt() / TAU;
    let upper = (omega2 * (1.0 + m_r / m)).sqrt() / TAU;
    for (at_hz, passes) in
        [(0.9 * lower, true), (1.08 * lower, false), (0.93 * upper, false), (1.1 * upper, true)]
    {
        let found = transmitted("resonators", at_hz);
        assert!(if passes { found > 0.2 } else { found < 0.05 }, "{at_hz} Hz: {found:e}");
    }
}

/// The energy of a mode of the linear part.
fn mode_j(mode: f64, state: &ChainState) -> f64 {
    let n = state.u_m.len() as f64 + 1.0;
    let project = |values: &[f64]| {
        let shape = (1_u32..).map(|i| (PI * mode * f64::from(i) / n).sin());
        (2.0 / n).sqrt() * values.iter().zip(shape).map(|(x, shape)| x * shape).sum::<f64>()
    };
    let omega = 2.0 * (0.5 * PI * mode / n).sin();
    let (q, p) = (project(&state.u_m), project(&state.v_m_s));
    0.5 * (p * p + omega * omega * q * q)
}

/// E. Fermi, J. Pasta, S. Ulam and M. Tsingou, Los Alamos LA-1940 (1955), figure 1: the first mode gives nearly all of its energy to the
/// next four, the second has the most of it in between, and in the end all but 2 to 3 % is back.
#[test]
fn the_first_mode_gets_its_energy_back() {
    let physics = Physics::resolve(&preset("fput-alpha")).unwrap();
    let first_j = mode_j(1.0, &ChainState::initial(&physics));
    let exact = 0.5 * 16.0 * (2.0 * (PI / 64.0).sin()).powi(2);
    assert!((first_j / exact - 1.0).abs() < 1e-12);
    let (mut least, mut second, mut back) = (f64::MAX, 0.0_f64, (0.0, 0.0));
    let last = run(&physics, 100, |state| {
        let (t, part) = (physics.time_s(state.step), mode_j(1.0, state) / first_j);
        least = least.min(part);
        second = second.max(mode_j(2.0, state) / first_j);
        if t > 5000.0 && part > back.1 {
            back = (t, part);
        }
    });
    println!("least {least}, second {second}, back {back:?}");
    assert!(least < 0.1 && second > 0.8, "{least}, {second}");
    assert!(back.1 > 0.97 && back.1 < 0.99 && (back.0 - 9370.0).abs() < 50.0, "{back:?}");
    assert!(imbalance(&physics, &last).abs() < 1e-9);
}

/// Two equal waves that meet: mirror images to the bit. Each leaves a small one behind, a larger one where they meet at a contact than
/// where they meet at a bead: F. Santibanez, R. Munoz, A. Caussarieu, S. Job and F. Melo, Phys. Rev. E 84 (2011), arXiv:1102.3364.
#[test]
fn waves_that_meet_leave_small_ones_behind() {
    let behind = |beads: usize| {
        let mut config = preset("collision");
        config.chain.beads = beads as u64;
        config.striker.more[0].bead = beads as u64 - 1;
        let physics = Physics::resolve(&config).unwrap();
        let state = run(&physics, 1000, |state| {
            for i in 0..beads / 2 {
                let j = beads - 1 - i;
                assert_eq!(state.u_m[i].to_bits(), (0.0 - state.u_m[j]).to_bits());
                assert_eq!(state.v_m_s[i].to_bits(), (0.0 - state.v_m_s[j]).to_bits());
            }
        });
        let chain = physics.chain();
        let mut contacts_j = vec![0.0; beads - 1];
        chain.contact_energies_j(&state.u_m, &mut contacts_j);
        // the waves are at beads 15 and 185 by now, the weak ones between 40 and 160
        let behind_j = chain.kinetic_j(&state.v_m_s, 40..160) + contacts_j[40..159].iter().sum::<f64>();
        behind_j / physics.initial_energy().total_j()
    };
    let (even, odd) = (behind(200), behind(199));
    println!("left behind {even:e}, {odd:e}");
    assert!(even > 1e-5 && even < 5e-3, "{even:e}");
    assert!(odd > 1e-7 && odd < even, "{odd:e}, {even:e}");
}

/// What a shaken wall and a piston do, and what dashpots and drag take up, is the energy that there is.
#[test]
fn driven_energy_is_dissipated_or_there() {
    for (name, allowed) in
        [("driven-damped", 1e-6), ("absorbing", 1e-6), ("piston", 1e-6), ("band-gap", 1e-6)]
    {
        let physics = Physics::resolve(&preset(name)).unwrap();
        let state = run(&physics, u64::MAX / 2, |_| {});
        let found = imbalance(&physics, &state);
        println!("{name} {found:e}");
        assert!(found.abs() < allowed, "{name}: {found:e}");
    }
}

/// M. Toda, J. Phys. Soc. Jpn. 22 (1967) 431, doi:10.1143/JPSJ.22.431: `δ = ln(1 + sinh²κ/cosh²(κ·i − t·sinh κ))`, here κ = 1.
#[test]
fn todas_soliton_stays_as_it_is() {
    let physics = Physics::resolve(&preset("toda")).unwrap();
    let state = run(&physics, u64::MAX / 2, |_| {});
    let t = physics.time_s(physics.step_count);
    let mut worst: f64 = 0.0;
    for i in 0..199_u32 {
        let x = f64::from(i) - 50.0 - t * 1.0_f64.sinh();
        let expected = (1.0 + (1.0_f64.sinh() / x.cosh()).powi(2)).ln();
        let found = state.u_m[i as usize] - state.u_m[i as usize + 1];
        worst = worst.max((found - expected).abs());
    }
    println!("toda {worst:e}");
    assert!(worst < 1e-6, "{worst:e}");
}

/// A struck bead of an endless chain of equal masses and linear springs: `v = J_2n(2ct)`, and the second moment of the energy is (ct)²/2.
/// Masses at random keep energy near the struck one: S. Lepri, R. Schilling and S. Aubry, Phys. Rev. E 82 (2010) 056602,
/// doi:10.1103/PhysRevE.82.056602.
#[test]
fn disorder_holds_energy_back() {
    let moment = |seed: Option<u64>| {
        let mut config = preset("disordered");
        match seed {
            Some(seed) => config.seed = seed,
            None => config.disorder.clear(),
        }
        let physics = Physics::resolve(&config).unwrap();
        let state = run(&physics, u64::MAX / 2, |_| {});
        let chain = physics.chain();
        let mut contacts_j = vec![0.0; chain.contact_count()];
        chain.contact_energies_j(&state.u_m, &mut contacts_j);
        let mut sums = [0.0; 3];
        for i in 0..400 {
            let left = if i > 0 { contacts_j[i - 1] } else { 0.0 };
            let right = contacts_j.get(i).copied().unwrap_or(0.0);
            let energy = chain.kinetic_j(&state.v_m_s, i..i + 1) + 0.5 * (left + right);
            let place = f64::from(u32::try_from(i).unwrap());
            sums = [sums[0] + energy, sums[1] + place * energy, sums[2] + place * place * energy];
        }
        sums[2] / sums[0] - (sums[1] / sums[0]).powi(2)
    };
    let sound = 1e4 * 0.018;
    let ordered = moment(None) / (0.5 * sound * sound);
    println!("ordered {ordered}");
    assert!((ordered - 1.0).abs() < 1e-4, "{ordered}");
    let mean = (1..=10).map(|seed| moment(Some(seed))).sum::<f64>() / 10.0 / (0.5 * sound * sound);
    println!("disordered {mean}");
    assert!(mean < 0.6, "{mean}");
}

/// The speed of the wave over the force that it has at its crest, against the long-wave theory of V. F. Nesterenko as C. Daraio,
/// V. F. Nesterenko, E. B. Herbold and S. Jin, Phys. Rev. E 73 (2006) 026610, write it, which is of the same spheres without our
/// stiffness: `0.6802·(2E/(a·ρ^(3/2)·(1 − ν²)))^(1/3)·F^(1/6)`, a the diameter.
#[test]
fn spheres_carry_the_wave_of_their_material() {
    let physics = Physics::resolve(&preset("steel-spheres")).unwrap();
    let chain = physics.chain();
    let (mut force_n, mut peak_m_s) = (0.0_f64, 0.0_f64);
    let mut passed = [(0.0, 0.0); 2];
    run(&physics, 1, |state| {
        force_n = force_n.max(chain.contact_force_n(&state.u_m, 25));
        peak_m_s = peak_m_s.max(state.v_m_s[25]);
        for (contact, (most, time_s)) in [15, 35].into_iter().zip(&mut passed) {
            let found_n = chain.contact_force_n(&state.u_m, contact);
            if found_n > *most {
                (*most, *time_s) = (found_n, physics.time_s(state.step));
            }
        }
    });
    let speed = 20.0 / (passed[1].1 - passed[0].1);
    let (k, m) = (physics.stiffness, physics.bead_mass_kg);
    let exact = 0.907_470_1 * (k / m).powf(0.4) * peak_m_s.powf(0.2);
    let long =
        0.6802 * (2.0 * 203e9 / (8e-3 * 7780_f64.powf(1.5) * (1.0 - 0.09))).cbrt() * force_n.powf(1.0 / 6.0);
    println!("{force_n} N, {peak_m_s} m/s, {} m/s, exact {}, long waves {long}", speed * 8e-3, exact * 8e-3);
    assert!((speed / exact - 1.0).abs() < 2e-3, "{speed}, {exact}");
    assert!((speed * 8e-3 / long - 1.0).abs() < 0.02, "{speed}, {long}");
}

/// Less than 1e-4 of the solitary wave of a striker of 5 m/s comes back from an absorbing end as it is without further words.
#[test]
fn the_solitary_wave_does_not_come_back() {
    let mut config = preset("absorbing");
    config.time.duration_s = 0.05;
    let physics = Physics::resolve(&config).unwrap();
    let state = run(&physics, u64::MAX / 2, |_| {});
    let chain = physics.chain();
    let mut contacts_j = vec![0.0; chain.contact_count()];
    chain.contact_energies_j(&state.u_m, &mut contacts_j);
    // the wave was at bead 290 after 25 ms; what the striker left behind has 0.6 % of its energy, and is before bead 40
    let back = chain.kinetic_j(&state.v_m_s, 40..240) + contacts_j[40..239].iter().sum::<f64>();
    let part = back / physics.initial_energy().total_j();
    println!("reflected {part:e}");
    assert!(part < 1e-4, "{part:e}");
}
