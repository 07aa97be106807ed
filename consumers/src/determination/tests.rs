use super::*;
use schemas::manifest::Origin;
use schemas::presets::Preset;

/// A course over looks 1 s apart with these errors, within 1e-6.
fn course(errors: &[f64]) -> Course {
    let mut course = Course::default();
    for (second, error) in errors.iter().enumerate() {
        course.take(second as f64, *error, 1e-6);
    }
    course
}

/// An error that exceeds the tolerance at a time (s) of 100.
fn lost_at(second: usize) -> Course {
    let errors: Vec<f64> = (0..100).map(|at| if at >= second { 1e-3 } else { 1e-9 }).collect();
    course(&errors)
}

#[test]
fn a_quantity_is_determined_until_the_look_before_its_error_is_first_too_large() {
    let course = course(&[0.0, 1e-7, 1e-6, 2e-6, 5e-6, 1e-8]);
    assert_eq!(course.until_s, Some(2.0), "what comes close again later was lost before");
    assert_eq!((course.at_end, course.worst, course.worst_at_s), (1e-8, 5e-6, 4.0));
}

/// A step that does not count would win less than a quarter more time, or more.
#[test]
fn what_bounds_is_what_a_shorter_step_would_win() {
    let moved_by = f64::EPSILON;
    let found = |step: usize, rounding: usize| {
        let found =
            Determined::new(Quantity::Velocity, [step, rounding, step.min(rounding)].map(lost_at), moved_by);
        (found.until_s, found.bound)
    };
    assert_eq!(found(100, 100), (None, None));
    assert_eq!(found(40, 100), (Some(39.0), Some(Bound::Step)));
    assert_eq!(found(40, 60), (Some(39.0), Some(Bound::Step)));
    assert_eq!(found(40, 42), (Some(39.0), Some(Bound::Chaos)));
    assert_eq!(found(100, 60), (Some(59.0), Some(Bound::Chaos)));
    let weak = Determined::new(Quantity::Velocity, [1; 3].map(lost_at), 1e-4);
    assert_eq!(weak.bound, Some(Bound::Rounding), "it has not grown from 1e-4 to 1e-3: nothing is chaotic");
}

#[test]
fn digits_are_those_that_an_error_leaves() {
    let of = |error: f64| digits(error);
    assert_eq!(
        [of(0.0), of(1e-7), of(1.1e-7), of(9e-7), of(0.5), of(3.0), of(f64::NAN)],
        [15, 7, 6, 6, 0, 0, 0]
    );
}

fn sample(time_s: f64, difference: f64) -> Sample {
    let mut sample = Sample { time_s, step: [0.0; Quantity::COUNT], rounding: [0.0; Quantity::COUNT] };
    sample.rounding[1] = difference;
    sample
}

/// Memory is bounded, time goes on evenly, and no peak is lost.
#[test]
fn a_trail_keeps_the_largest_errors() {
    let mut trail = Trail::default();
    for look in 0..100_000 {
        trail.push(sample(f64::from(look), if look == 77_777 { 1.0 } else { 1e-9 }));
    }
    let samples: Vec<_> = trail.samples().collect();
    assert!(samples.len() <= Trail::CAPACITY && samples.len() > Trail::CAPACITY / 4);
    assert_eq!(samples[samples.len() - 1].time_s, 99_999.0);
    let peak = samples.iter().position(|sample| sample.rounding[1] == 1.0).expect("kept");
    assert!(samples[peak].time_s >= 77_777.0 && samples[peak - 1].time_s < 77_777.0);
}

/// exp(0.05 t) from 1e-16, which saturates at 0.3; and t², which is no exponential growth.
#[test]
fn only_what_grows_exponentially_has_a_rate() {
    let trail = |difference: fn(f64) -> f64| {
        let mut trail = Trail::default();
        for t in (1..1000).map(f64::from) {
            trail.push(sample(t, difference(t)));
        }
        trail.growth_per_s(1e-10)
    };
    let rate = trail(|t| (1e-16 * (0.05 * t).exp()).min(0.3)).expect("exponential");
    assert!((rate - 0.05).abs() < 1e-12, "{rate}");
    assert_eq!(trail(|t| 1e-14 * t * t), None);
    assert_eq!(trail(|_| 1e-13), None);
}

/// Errors are in units of L, v0 and ½·m·v0²; that of the step is twice the larger difference.
#[test]
fn differences_are_measured_in_the_scales_of_the_run() {
    let mut config = Preset::find("homogeneous").expect("preset").config();
    config.chain.beads = 6;
    let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
    let manifest = RunManifest::new(&config, "run", origin).expect("valid");
    let mut found = Determination::new(&manifest, 3, TOLERANCE, 4.0 * f64::EPSILON);
    assert_eq!(found.outcome(), None);
    let length_m = manifest.physics.scales().length_m;
    let states = [([0.0; 6], [5.0, 0.0, 0.0, 0.0, 0.0, 0.0]), {
        let (mut u, mut v) = ([0.0; 6], [5.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        (u[3], v[3]) = (0.25 * length_m, 0.5);
        (u, v)
    }];
    let frame = |(u_m, v_m_s): &'static ([f64; 6], [f64; 6])| Frame {
        frame: 0,
        step: 0,
        time_s: 0.0,
        u_m,
        v_m_s,
        extra: &[],
        active: None,
    };
    let [run, halved] = Box::leak(Box::new(states));
    found.look(&frame(run), [&frame(halved), &frame(run)], &frame(run), None);
    let counts =
        |found: &Determination| found.outcome().and_then(|it| it.of(Quantity::Front).map(|it| it.step.worst));
    assert_eq!(counts(&found), Some(0.0), "counts may differ in one look");
    found.look(&frame(run), [&frame(halved), &frame(run)], &frame(run), None);
    let outcome = found.outcome().expect("one look");
    let step = |quantity| outcome.of(quantity).map(|each| each.step.at_end);
    let close = |quantity, expected: f64| {
        let found = step(quantity).expect("told");
        assert!((found - expected).abs() < 1e-12, "{quantity:?}: {found}");
    };
    close(Quantity::Displacement, 0.5);
    close(Quantity::Position, 0.5); // no impurity: of the split bead
    close(Quantity::Velocity, 0.2);
    close(Quantity::Peak, 0.0);
    close(Quantity::Contacts, 2.0);
    close(Quantity::Front, 3.0);
    assert_eq!(step(Quantity::Reflected), None, "the pulse has not arrived");
    assert!(outcome.quantities.iter().all(|each| each.rounding.worst == 0.0));
    assert_eq!(outcome.first_lost().map(|lost| lost.until_s), Some(Some(0.0)));
    // for as long as the differences of some looks ago count, a quantity that has come close again is not right
    for look in 0..LOOKS {
        let estimated = found.outcome().and_then(|it| it.of(Quantity::Velocity).map(|it| it.step.at_end));
        assert!((estimated.expect("told") - 0.2).abs() < 1e-12, "{look}");
        found.look(&frame(run), [&frame(run), &frame(run)], &frame(run), None);
    }
    let outcome = found.outcome().expect("looks");
    assert_eq!(outcome.of(Quantity::Velocity).map(|it| it.step.at_end), Some(0.0));
}
