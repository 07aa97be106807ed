//! What a run says of its time step, its end and how long it will take.

use crate::harness::Place;

const CHAIN: &str = "run --preset homogeneous --beads 40 --no-record";

#[test]
fn a_default_run_ends_when_it_was_asked_to() {
    let place = Place::new();
    let run = place.run("run --preset homogeneous --beads 40 --duration 1.2345e-3").exits(0);
    assert!(!run.stderr().contains("ends at"), "{}", run.stderr());
    let info = place.run("info homogeneous.mcap --json").exits(0).json();
    let physics = &info["manifest"]["physics"];
    let end_s = physics["dt_s"].as_f64().unwrap() * physics["step_count"].as_f64().unwrap();
    assert!((end_s / 1.2345e-3 - 1.0).abs() <= f64::EPSILON, "{end_s:e}");
}

#[test]
fn a_step_that_does_not_divide_the_duration_is_kept_and_told() {
    let place = Place::new();
    let words = format!("{CHAIN} --duration 1e-3 --dt 3e-6");
    place.run(&words).exits(0).says(&["333 steps of 3.00 µs", "ends at 9.99e-4 s, not at 1e-3 s"]);
    let exact = place.run(&format!("{CHAIN} --duration 1e-3 --dt 1e-6")).exits(0);
    assert!(!exact.stderr().contains("ends at"), "{}", exact.stderr());
    let found = place.run(&format!("{CHAIN} --duration 1e-3 --dt auto:1e-7")).exits(0);
    assert!(!found.stderr().contains("ends at"), "{}", found.stderr());
}

/// Overlaps of 46 µm of which the wave changes 3e-19 m.
#[test]
fn a_weak_kick_under_load_is_told_that_rounding_is_the_cause() {
    let place = Place::new();
    let chain = |velocity: &str| {
        format!(
            "[chain]\nbeads = 40\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n[load]\nprecompression_n = 100\n\
             [striker]\nbead = 0\nvelocity_m_s = {velocity}\n[time]\nduration_s = 1e-3\n"
        )
    };
    place.write("weak.toml", &chain("1e-13"));
    let weak = place
        .run("run weak.toml --no-record")
        .exits(0)
        .says(&["from rounding", "a shorter --dt does not help"]);
    assert!(!weak.stderr().contains("too long"), "{}", weak.stderr());
    // the step is at fault where it is
    place.write("coarse.toml", &chain("5.0"));
    let coarse = place.run("run coarse.toml --no-record --dt 4.2e-6").exits(0);
    let told = coarse.stderr();
    assert!(!told.contains("from rounding"), "{told}");
}

#[test]
fn a_long_run_says_how_long_and_an_absurd_one_does_not_begin() {
    let place = Place::new();
    let absurd = "run --preset homogeneous --no-record --duration 1e9";
    place.run(absurd).exits(2).says(&["at least", "years", "looks like a mistake", "--yes"]);
    // without a terminal nobody is asked: it goes on
    let long = "run --preset homogeneous --no-record --publish-every-steps 100000 --duration 1e4";
    for words in [long.to_owned(), format!("{absurd} --publish-every-steps 100000 --yes")] {
        let run = place.start(&words);
        place.wait_for_run("homogeneous", |_| true);
        run.signal("INT");
        run.wait().says(&["this takes at least"]);
    }
}

#[test]
fn a_long_sweep_says_how_long() {
    let place = Place::new();
    let text =
        "[base]\npreset = \"homogeneous\"\ntime.duration_s = 1e9\n[grid]\n\"chain.alpha\" = [1.5, 2.0]\n";
    place.write("sweep.toml", text);
    place.run("sweep sweep.toml --out out").exits(2).says(&["years", "--yes"]);
}
