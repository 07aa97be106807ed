//! Changes of the presets beyond one struck bead: drives, laws, initial states, disorder, ends.

use super::Preset;
use crate::bath::Bath;
use crate::beads::Beads;
use crate::config::{
    DampingConfig, Disorder, Disordered, End, MassRule, ModeShape, Profile, Resonators, RunConfig, Sphere,
    Spheres, StrikerConfig, Thermal,
};
use crate::drive::{Drive, Place, Quantity, Side, Sine, Waveform};
use crate::functions::{exp, ln};
use crate::material::Material;
use crate::term::{Spring, TermLaw, Toda};

/// Removes the striker and shakes the left wall by a sine of that amplitude (m) and frequency (Hz), which grows over ten periods.
fn shaken(config: &mut RunConfig, amplitude: f64, frequency_hz: f64) {
    still(config);
    config.load.precompression_n = 10.0;
    config.ends.left = End::Fixed;
    let sine = Sine {
        amplitude,
        frequency_hz,
        phase_rad: 0.0,
        ramp_s: 10.0 / frequency_hz,
        until_s: None,
        ramp_down_s: 0.0,
    };
    config.drive = vec![Drive {
        at: Place::Wall(Side::Left),
        prescribes: Quantity::Displacement,
        waveform: Waveform::Sine(sine),
    }];
}

/// Removes the striker.
fn still(config: &mut RunConfig) {
    config.striker = StrikerConfig { bead: 0, velocity_m_s: 0.0 }.into();
}

/// Publishes and records a state every `steps` steps.
fn sparse(config: &mut RunConfig, steps: u64) {
    config.stream.publish_every_steps = steps;
    config.stream.record_every_steps = steps;
}

/// Makes beads of 1 kg on bonds of these laws, with 1 N/m as the stiffness of the scales: the units of theory.
fn bonded(config: &mut RunConfig, laws: &[(TermLaw, f64)]) {
    still(config);
    config.chain.bonds = Some(laws.iter().cloned().collect());
    (config.chain.bead_mass_kg, config.chain.alpha, config.chain.stiffness) = (Some(1.0), None, None);
}

pub(super) fn band_gap(config: &mut RunConfig) {
    shaken(config, 1e-8, 2300.0);
    config.chain.masses = MassRule::PatternKg(vec![2e-3, 1e-3]);
    config.ends.right = End::Absorbing;
    config.ends.absorbing_beads = Some(60);
    sparse(config, 10);
}

pub(super) fn steel_spheres(config: &mut RunConfig) {
    let steel = Material { density_kg_m3: 7780.0, young_pa: 203e9, poisson: 0.3 };
    let sphere = Sphere { radius_m: 4e-3, material: steel };
    (config.chain.bead_mass_kg, config.chain.alpha, config.chain.stiffness) = (None, None, None);
    config.chain.spheres = Some(Spheres(vec![sphere]));
    config.striker.velocity_m_s = 1.0;
}

pub(super) fn fput_alpha(config: &mut RunConfig) {
    bonded(config, &[(TermLaw::Spring(Spring(1)), 1.0), (TermLaw::Spring(Spring(2)), 0.25)]);
    (config.ends.left, config.ends.right) = (End::Fixed, End::Fixed);
    config.initial.mode = Some(ModeShape { number: 1, displacement_m: 1.0, velocity_m_s: 0.0 });
    config.time.dt_s = Some(0.1);
    sparse(config, 100);
}

pub(super) fn collision(config: &mut RunConfig) {
    config.striker.more = vec![StrikerConfig { bead: 199, velocity_m_s: -5.0 }];
}

pub(super) fn disordered(config: &mut RunConfig) {
    config.seed = 1;
    config.disorder = vec![Disorder {
        of: Disordered::Masses,
        uniform: Some(0.5),
        normal: None,
        log_normal: None,
        two_valued: None,
        permuted: false,
    }];
    config.chain.bonds = Some([(TermLaw::Spring(Spring(1)), 1e5)].into_iter().collect());
    (config.chain.alpha, config.chain.stiffness) = (None, None);
    config.striker = StrikerConfig { bead: 200, velocity_m_s: 1.0 }.into();
    sparse(config, 10);
}

pub(super) fn driven_damped(config: &mut RunConfig) {
    shaken(config, 4.0, 1000.0);
    config.ends.left = End::Free;
    (config.drive[0].at, config.drive[0].prescribes) = (Place::Bead(0), Quantity::Force);
    config.damping = Some(DampingConfig::ViscousNSPerM(0.5));
    sparse(config, 5);
}

pub(super) fn absorbing(config: &mut RunConfig) {
    config.ends.right = End::Absorbing;
    sparse(config, 10);
}

pub(super) fn resonators(config: &mut RunConfig) {
    shaken(config, 1e-8, 1750.0);
    // 1/245 of the period of the highest mode, 4085 Hz: enough for a method of order 5
    config.time.dt_s = Some(1e-6);
    config.resonators =
        Some(Resonators { mass_kg: Profile::Same(0.5e-3), stiffness_n_per_m: Profile::Same(5e4) });
    config.ends.right = End::Absorbing;
    config.ends.absorbing_beads = Some(60);
    sparse(config, 10);
}

pub(super) const SOLITON: Preset = Preset {
    name: "toda",
    about: "200 masses on the springs of Toda, a soliton of his in their middle: it stays as it is",
    beads: 200,
    duration_s: 60.0,
    change: soliton,
};

/// `u = ln(cosh(x − κ)/cosh x) + κ` and `v = sinh κ·(tanh x − tanh(x − κ))` with `x = κ·(i − 50)` and κ = 1.
fn soliton(config: &mut RunConfig) {
    bonded(config, &[(TermLaw::Toda(Toda(1.0)), 1.0)]);
    let x = |bead: u32| f64::from(bead) - 50.0;
    // ln cosh x without overflow
    let ln_cosh = |x: f64| x.abs() + ln(0.5 * (1.0 + exp(-2.0 * x.abs())));
    let tanh = |x: f64| 1.0 - 2.0 / (exp(2.0 * x) + 1.0);
    let sinh = 0.5 * (exp(1.0) - exp(-1.0));
    config.initial.displacements_m = (0..200).map(|i| ln_cosh(x(i) - 1.0) - ln_cosh(x(i)) + 1.0).collect();
    config.initial.velocities_m_s = (0..200).map(|i| sinh * (tanh(x(i)) - tanh(x(i) - 1.0))).collect();
}

pub(super) fn piston(config: &mut RunConfig) {
    still(config);
    config.ends.left = End::Fixed;
    config.drive = vec![Drive {
        at: Place::Wall(Side::Left),
        prescribes: Quantity::Velocity,
        waveform: Waveform::Constant(1.0),
    }];
}

/// Two masses at either end are in baths of 0.15 J and 0.05 J.
pub(super) fn hot_and_cold(config: &mut RunConfig) {
    bonded(config, &[(TermLaw::Spring(Spring(1)), 1.0), (TermLaw::Spring(Spring(3)), 1.0)]);
    (config.seed, config.ends.left, config.ends.right) = (1, End::Fixed, End::Fixed);
    let bath = |from: i64, to: Option<i64>, temperature_j: f64| Bath {
        beads: Beads { from, to },
        temperature_j: Some(Waveform::Constant(temperature_j)),
        temperature_k: None,
        friction_per_s: 1.0,
        seed: None,
        pairs: false,
    };
    // what becomes 0.1 J of temperature
    config.initial.thermal = Some(Thermal { temperature_k: None, energy_j: Some(0.1) });
    config.bath = vec![bath(0, Some(2), 0.15), bath(-2, None, 0.05)];
    config.time.dt_s = Some(0.05);
    sparse(config, 20);
}

pub(super) fn thermal(config: &mut RunConfig) {
    bonded(config, &[(TermLaw::Spring(Spring(1)), 1.0), (TermLaw::Spring(Spring(3)), 0.1)]);
    config.seed = 1;
    (config.ends.left, config.ends.right) = (End::Periodic, End::Periodic);
    config.initial.thermal = Some(Thermal { temperature_k: None, energy_j: Some(0.1) });
}
