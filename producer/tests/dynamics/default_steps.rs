//! The default steps keep what `Method::default_step_fraction` promises.

use producer::energy_error::energy_error;
use schemas::manifest::Physics;
use schemas::method::Method;
use schemas::presets::{PRESETS, Preset};

/// max|ΔE/E| of a preset with another α, over as many collision times as it has, but at most 220, with at most
/// 100 beads before the impurity and 100 after it. Most of the error is made by the first collisions.
fn error(preset: &Preset, method: Method, alpha: f64) -> f64 {
    let mut config = preset.config();
    let hertz = Physics::resolve(&config).unwrap();
    let collision_times = (config.time.duration_s / hertz.scales().time_s).min(220.0);
    config.chain.alpha = Some(alpha);
    config.chain.beads = config.chain.beads.min(200);
    for impurity in &mut config.chain.impurities {
        impurity.bead = impurity.bead.min(100);
    }
    config.integrator.method = method;
    config.time.duration_s = collision_times * Physics::resolve(&config).unwrap().scales().time_s;
    let physics = Physics::resolve(&config).unwrap();
    // about fifty looks in a collision time
    let look_every = (method.default_step_fraction(1.5) / method.default_step_fraction(alpha)).round();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "1 to 8")]
    energy_error(&physics, u64::MAX, look_every as u64, |_| {}).largest
}

#[test]
fn default_steps_keep_the_energy() {
    for (method, promise, alphas) in [
        (Method::Rkn4, 1e-7, [1.1, 1.3, 1.5, 2.0, 3.0].as_slice()),
        (Method::Gear5, 1e-7, [1.1, 1.5, 2.0, 3.0].as_slice()),
        (Method::VelocityVerlet, 3e-6, [1.1, 1.5, 2.0, 3.0].as_slice()),
    ] {
        for alpha in alphas {
            for preset in ["light-impurity", "homogeneous", "striker-3g", "striker-10g"] {
                let found = error(&Preset::find(preset).unwrap(), method, *alpha);
                assert!(found < promise, "{preset}, {method}, α = {alpha}: {found:e}");
            }
        }
    }
}

/// The paper's runs as they are, with the method and the step that nobody has to choose.
#[test]
fn the_runs_of_the_paper_keep_their_energy() {
    for preset in &PRESETS[..5] {
        let physics = Physics::resolve(&preset.config()).unwrap();
        let found = energy_error(&physics, u64::MAX, 1, |_| {}).largest;
        assert!(found < 1e-7, "{}: {found:e}", preset.name);
    }
}
