//! Roundings that a check tells are as large as those of the run.

use super::*;
use crate::exact::Exact;
use consumers::determination::Quantity;
use schemas::method::Method;

/// Undamped chains of one power, against the same steps in pairs of doubles.
#[test]
fn roundings_are_as_large_as_a_check_says_to_a_factor() {
    let kinds = ["free", "wall", "walls", "loaded", "heavy"];
    let mut ratios: Vec<f64> = (0..30)
        .map(|number| {
            let kind = kinds[number % kinds.len()];
            let stream = 200 + u32::try_from(number).expect("few runs");
            let mut random = Random { seed: 1, stream, index: 0 };
            let mut config = drawn(kind, &mut random);
            config.chain.alpha = Some([1.5, 2.0, 3.0][number % 3]);
            config.integrator.method = [Method::Rkn4, Method::VelocityVerlet][number / kinds.len() % 2];
            let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
            let manifest = RunManifest::new(&config, "run", origin).expect("valid");
            let physics = &manifest.physics;
            let steps = physics.step_count;
            let checked = compare(&manifest, None, (steps, TOLERANCE), &AtomicBool::new(false), |_| {});
            let outcome = checked.expect("finite").determination.outcome().expect("looks");
            let told = outcome.of(Quantity::Displacement).expect("told").rounding.at_end;
            let (mut run, mut exact) = (Finer::new(physics, 1), Exact::new(physics));
            exact.advance_to(steps);
            let u_m = run.frame(physics, steps).u_m.iter().zip(&exact.u_m);
            let off_m = u_m.map(|(u, exact)| ((u - exact.0) - exact.1).abs()).fold(0.0, f64::max);
            let ratio = off_m / physics.scales().length_m / told;
            println!(
                "{kind}, {}, {} beads, α = {}: {ratio:.2e} × {told:.1e}",
                physics.method, physics.beads, physics.alpha
            );
            ratio
        })
        .collect();
    ratios.sort_by(f64::total_cmp);
    println!("roundings over what was told: {:.2} to {:.2}, median {:.2}", ratios[0], ratios[29], ratios[15]);
    assert!(ratios[29] < 10.0 && ratios[15] > 0.1, "{ratios:?}");
}
