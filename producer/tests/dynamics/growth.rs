//! Roundings that grow until they count are seen beside a run.

use producer::growth::{Growth, Lost};
use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::config::{Impurity, RunConfig};
use schemas::manifest::Physics;
use schemas::presets::{PRESETS, Preset};

/// The loss of the run of a preset, changed by `change`.
fn lost(preset: &str, change: impl FnOnce(&mut RunConfig)) -> (Physics, Option<Lost>) {
    let mut config = Preset::find(preset).unwrap().config();
    change(&mut config);
    lost_of(&config)
}

fn lost_of(config: &RunConfig) -> (Physics, Option<Lost>) {
    let physics = Physics::resolve(config).unwrap();
    let mut integrator = Integrator::new(&physics);
    let mut state = ChainState::initial(&physics);
    let mut growth = Growth::of(&physics, &state);
    while state.step < physics.step_count {
        let next =
            growth.as_ref().map_or(physics.step_count, |growth| growth.next_before(physics.step_count));
        integrator.advance(&mut state, next);
        if let Some(growth) = &mut growth {
            growth.look(&state, None);
        }
    }
    let lost = growth.and_then(|growth| growth.lost());
    (physics, lost)
}

/// Presets are determined to their ends (`docs/NUMERICS.md`: roundings come to 1e-7 L at most in those of the paper).
#[test]
fn no_preset_of_the_paper_is_lost() {
    for preset in PRESETS.iter().take(10) {
        let (_, lost) = lost(preset.name, |_| {});
        assert_eq!(lost, None, "{}", preset.name);
    }
}

/// The tangent, `beadline check --beads 1200 --impurity 0=10e-3`: λ = 0.050/T, and displacements to 1e-4 L until 463 T.
#[test]
fn a_chaotic_train_is_lost_when_its_twin_is() {
    let (physics, lost) = lost("homogeneous", |config| {
        config.chain.beads = 1200;
        config.chain.impurities = vec![Impurity { bead: 0, mass_kg: 10e-3 }];
        config.time.duration_s = 0.05;
    });
    let (time_s, Lost { at_s, growth_per_s }) = (physics.scales().time_s, lost.expect("chaos"));
    println!("lost at {:.0} T, grows by {:.4} in each T", at_s / time_s, growth_per_s * time_s);
    assert!((400.0..650.0).contains(&(at_s / time_s)), "{} T", at_s / time_s);
    assert!((0.03..0.12).contains(&(growth_per_s * time_s)), "{} per T", growth_per_s * time_s);
}

/// Steps that are coarser than usual are looked at more often, up to four times of them.
#[test]
fn a_chaotic_train_of_coarse_steps_is_lost_as_well() {
    for times in [2.0, 4.0] {
        let (physics, lost) = lost("homogeneous", |config| {
            config.chain.beads = 1200;
            config.chain.impurities = vec![Impurity { bead: 0, mass_kg: 10e-3 }];
            config.time.duration_s = 0.05;
            config.time.dt_s = Some(times * Physics::resolve(config).unwrap().usual_step().0);
        });
        let (time_s, Lost { at_s, growth_per_s }) = (physics.scales().time_s, lost.expect("chaos"));
        println!("{times}: at {:.0} T, grows by {:.4} in each T", at_s / time_s, growth_per_s * time_s);
        assert!((400.0..650.0).contains(&(at_s / time_s)), "{times}: {} T", at_s / time_s);
    }
}

#[test]
fn beads_between_two_walls_are_lost_in_the_long_run() {
    let (physics, lost) = lost("walls", |config| config.time.duration_s = 0.08);
    let Lost { at_s, growth_per_s } = lost.expect("chaos");
    let time_s = physics.scales().time_s;
    println!("lost at {:.0} T, grows by {:.4} in each T", at_s / time_s, growth_per_s * time_s);
    assert!(at_s > 300.0 * time_s, "walls are determined to 276 T");
}

/// A slow piston presses beads until they are far stiffer than its speed tells; half of the step ends in the same eight digits.
#[test]
fn beads_that_a_piston_presses_are_not_lost() {
    let text = "[chain]\nbeads = 3\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n[ends]\nleft = \"fixed\"\nright = \"fixed\"\n\
                [[drive]]\nwall = \"left\"\nvelocity_m_s = 0.001\n[time]\nduration_s = 0.4\n";
    assert_eq!(lost_of(&RunConfig::from_toml(text).unwrap()).1, None);
}
