//! The time until which a check says that all beads are where they are computed to be is never too long, and seldom much too short.

use super::*;
use consumers::determination::Quantity;
use schemas::method::Method;

/// The run of a kind: of 2 beads or more, with a step and a method that are drawn, too.
fn drawn_run(kind: &str, random: &mut Random) -> (RunManifest, f64) {
    let mut config = drawn(kind, random);
    if config.chain.impurities.is_empty()
        && matches!(kind, "free" | "wall" | "walls" | "loaded" | "drag" | "resonators")
    {
        config.chain.beads = 2 + random.below(9);
        config.striker.bead = 0;
    }
    let origin = || Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
    let usual = config.integrator.method;
    let methods = [Method::Rkn4, Method::VelocityVerlet, Method::Rk5, Method::Gear5];
    config.integrator.method = methods[usize::try_from(random.below(4)).unwrap()];
    let mut manifest = RunManifest::new(&config, "run", origin()).unwrap_or_else(|_| {
        // dampings, drives and resonators do not take every method
        config.integrator.method = usual;
        RunManifest::new(&config, "run", origin())
            .unwrap_or_else(|error| panic!("{error}\n{}", config.to_toml()))
    });
    let physics = &mut manifest.physics;
    let longer = random.ratio(1.0, 0.8 * physics.longest_dt_s() / physics.dt_s);
    physics.dt_s *= longer;
    physics.step_count = random_steps(physics.step_count, longer);
    (manifest, random.ratio(1e-9, 1e-3))
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a positive number")]
fn random_steps(count: u64, longer: f64) -> u64 {
    (count as f64 / longer) as u64 + 1
}

/// The time (s) of the last look before some bead is farther than `tolerance` from its place with a 16th of the step; none if none ever is.
fn true_until_s(manifest: &RunManifest, tolerance: f64) -> Option<f64> {
    let physics = &manifest.physics;
    let [mut run, mut finer] = [1, 16].map(|parts| Finer::new(physics, parts));
    let (every, largest_m) =
        (Determination::look_every_steps(physics), tolerance * physics.scales().length_m);
    let (mut step, mut until_s) = (0, 0.0);
    while step < physics.step_count {
        step = physics.step_count.min(step + every);
        let [run, finer] = [&mut run, &mut finer].map(|each| each.frame(physics, step));
        if run.u_m.iter().zip(finer.u_m).any(|(a, b)| (a - b).abs() > largest_m) {
            return Some(until_s);
        }
        until_s = run.time_s;
    }
    None
}

/// Tries 200 runs; more of them: `BEADLINE_RUNS=1000 cargo test -p beadline-experiments --test random_runs prediction -- --nocapture`.
#[test]
fn the_end_of_what_is_determined_is_never_told_too_late_and_seldom_much_too_early() {
    let asked = std::env::var("BEADLINE_RUNS").ok().and_then(|count| count.parse().ok());
    let count: usize = asked.unwrap_or(200);
    let (mut lost, mut late, mut early) = (0, 0, 0);
    for number in 0..count {
        let kind = number % KINDS.len();
        let stream = 100 + u32::try_from(kind).expect("few kinds");
        let mut random = Random { seed: 1, stream, index: ((number / KINDS.len()) as u64) << 32 };
        let (manifest, tolerance) = drawn_run(KINDS[kind], &mut random);
        let physics = &manifest.physics;
        let checked =
            compare(&manifest, None, (physics.step_count, tolerance), &AtomicBool::new(false), |_| {});
        let outcome = checked.expect("finite").determination.outcome().expect("looks");
        let told_s = outcome.of(Quantity::Displacement).expect("told").until_s;
        let true_s = true_until_s(&manifest, tolerance);
        if told_s.is_none() && true_s.is_none() {
            continue;
        }
        lost += 1;
        let [end_s, look_s] =
            [physics.step_count, Determination::look_every_steps(physics)].map(|steps| physics.time_s(steps));
        let [told_s, true_s] = [told_s, true_s].map(|until_s| until_s.unwrap_or(end_s));
        let is_late = told_s > true_s;
        let is_early = true_s + look_s >= 2.0 * (told_s + look_s);
        if is_late || is_early {
            println!(
                "{}, run {number}, {}, {} beads, within {tolerance:.1e}: told {told_s:e} s, truly {true_s:e} s of {end_s:e} s",
                KINDS[kind], physics.method, physics.beads
            );
        }
        late += usize::from(is_late);
        early += usize::from(is_early);
    }
    println!(
        "{count} runs, {lost} not determined to the end: told too late in {late}, too early by a factor of 2 in {early}"
    );
    assert!(
        late == 0 && 20 * early <= lost && 2 * lost >= count,
        "{late} late, {early} early, {lost} of {count}"
    );
}
