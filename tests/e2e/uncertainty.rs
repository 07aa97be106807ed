//! What a run says its reflected energy may be off by, against the same run with a quarter of its step.

use crate::reference::rows;
use consumers::energies::{Energies, Reflection, default_split_bead};
use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::config::{Impurity, RunConfig};
use schemas::manifest::{Origin, RunManifest};
use schemas::method::Method;
use schemas::presets::Preset;

/// 120 beads with `mass_g` at bead 40, until the shock has come to the end: the errors of collisions are the same as in
/// longer chains.
fn config(alpha: f64, mass_g: f64, method: Method) -> RunConfig {
    let mut config = Preset::find("homogeneous").unwrap().config();
    config.chain.alpha = Some(alpha);
    config.chain.beads = 120;
    config.chain.impurities = vec![Impurity { bead: 40, mass_kg: mass_g * 1e-3 }];
    config.integrator.method = method;
    // no wave is slower than a bead in 2 T
    config.time.duration_s = 240.0 * (1e-3 * 25.0 / 1e7_f64).powf(1.0 / (alpha + 1.0)) / 5.0;
    config
}

/// The reflection with the default step over `divisor`, looked at every 0.2 T or so at the same times, and the largest
/// error of the energy.
fn reflection(config: &RunConfig, divisor: u64) -> (Reflection, f64) {
    let origin = || Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
    let default = RunManifest::new(config, "run", origin()).unwrap().physics;
    let mut config = config.clone();
    config.time.dt_s = Some(default.dt_s / divisor as f64);
    config.time.duration_s = default.dt_s * default.step_count as f64;
    let manifest = RunManifest::new(&config, "run", origin()).unwrap();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "10 to 80")]
    let every = divisor * (0.2 * default.scales().time_s / default.dt_s).round() as u64;
    let mut energies = Energies::new(&manifest, default_split_bead(&manifest));
    let mut integrator = Integrator::new(&manifest.physics);
    let mut state = ChainState::initial(&manifest.physics);
    for frame in 0.. {
        let look = (frame * every).min(manifest.physics.step_count);
        while state.step < look {
            integrator.advance(&mut state, look);
        }
        energies.observe(&state.as_frame(&manifest, frame));
        let outcome = energies.outcome().unwrap();
        let reflection = outcome.reflection.unwrap();
        if reflection.met_end.is_some() || state.step == manifest.physics.step_count {
            return (reflection, outcome.max_abs_drift);
        }
    }
    unreachable!("a run ends");
}

/// What one run says, and what is so.
struct Case {
    /// How far the reflected part of the energy is off, and how far that without the recoil.
    off: [f64; 2],
    /// What the step may make of either.
    step: [f64; 2],
    /// The whole uncertainty of either.
    plus_minus: [f64; 2],
    drift: f64,
}

#[expect(clippy::print_stdout, reason = "the table of docs/NUMERICS.md, with --nocapture")]
fn case(alpha: f64, mass_g: f64, method: Method) -> Case {
    let config = config(alpha, mass_g, method);
    let ((coarse, drift), (fine, _)) = (reflection(&config, 1), reflection(&config, 4));
    let of = |found: &Reflection| {
        let (energies, corrected) = (found.energies.unwrap(), found.corrected().unwrap());
        [energies.over_total(), corrected.over_total]
    };
    let (says, is) = (of(&coarse), of(&fine));
    let energies = coarse.energies.unwrap();
    let step = energies.step_error_j / energies.total_j;
    let case = Case {
        off: [0, 1].map(|i| (says[i].value - is[i].value).abs()),
        step: [step, 2.0 * step],
        plus_minus: says.map(|said| said.plus_minus),
        drift,
    };
    println!(
        "{method}, α = {alpha}, {mass_g} g: off by {:.1e}, {:.1e} without the recoil; the step makes {:.1e}, max|ΔE/E| {drift:.1e}",
        case.off[0], case.off[1], case.step[0]
    );
    case
}

/// Asserts that the step is covered, and not by far too much.
fn check(cases: &[Case]) {
    let mut too_large = Vec::new();
    for Case { off, step, plus_minus, drift } in cases {
        for i in [0, 1] {
            assert!(
                off[i] <= step[i] && step[i] <= plus_minus[i],
                "{:e} {:e} {:e}",
                off[i],
                step[i],
                plus_minus[i]
            );
            // with a factor of two and more to spare, as `docs/NUMERICS.md` says
            assert!(off[i] < 1.5 * drift + 1e-13, "{:e} {drift:e}", off[i]);
        }
        too_large.push(step[0] / off[0]);
    }
    too_large.sort_by(f64::total_cmp);
    let median = too_large[too_large.len() / 2];
    assert!(median < 100.0, "{median}");
}

#[test]
fn the_uncertainty_of_a_reflection_covers_the_step_in_the_cases_of_the_reference() {
    let cases = rows("reflected-energy.csv").into_iter().map(|row| {
        let [alpha, mass_g] = [0, 1].map(|column| row[column].parse().unwrap());
        case(alpha, mass_g, Method::Rkn4)
    });
    let cases: Vec<Case> = cases.collect();
    assert_eq!(cases.len(), 24);
    check(&cases);
}

#[test]
fn the_uncertainty_of_a_reflection_covers_the_step_of_every_method() {
    let mut cases = Vec::new();
    for method in Method::ALL {
        for alpha in [1.1, 1.5, 2.0, 5.0] {
            cases.extend([0.3, 0.95, 10.0].map(|mass_g| case(alpha, mass_g, method)));
        }
    }
    check(&cases);
}

/// Nothing is reflected by a bead like all others, and nothing changes any more: the recoil alone is left, and the step is
/// all that makes it uncertain.
#[test]
fn what_does_not_change_any_more_is_not_exact() {
    for alpha in [1.5, 3.0] {
        let Case { off, step, plus_minus, .. } = case(alpha, 1.0, Method::Rkn4);
        assert!(plus_minus[0] - step[0] < off[0] && off[0] < step[0], "{off:?} {step:?} {plus_minus:?}");
    }
}
