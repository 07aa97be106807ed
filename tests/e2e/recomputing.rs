//! What a source does not hold is recomputed, with the same bits.

use crate::harness::{Place, wait_until};

/// A chain small enough to be quick, with everything that the light-impurity run has.
const SMALL: &str = "run --beads 120 --impurity 60=0.6e-3 --duration 0.012 --name small";

/// Asserts that two tables hold the same bytes.
#[track_caller]
fn assert_equal(place: &Place, one: &str, other: &str) {
    assert!(place.read(one) == place.read(other), "{one} and {other} differ");
}

#[test]
fn a_sparse_recording_holds_every_step() {
    let place = Place::new();
    for method in ["rkn4", "gear5"] {
        place.run(&format!("{SMALL} --method {method} --out full.mcap --force")).exits(0);
        let sparse = format!("{SMALL} --method {method} --record-every-steps 100 --out sparse.mcap --force");
        place.run(&sparse).exits(0);
        for (file, flags) in [("full", ""), ("sparse", "--every-step")] {
            let common = format!("{file}.mcap {flags} --force");
            place.run(&format!("energies {common} --out energies-{file}.csv")).exits(0);
            place.run(&format!("impurity {common} --out i-{file}.csv --events events-{file}.csv")).exits(0);
            place.run(&format!("contacts {common} --out contacts-{file}.csv")).exits(0);
        }
        for table in ["energies", "i", "events", "contacts"] {
            assert_equal(&place, &format!("{table}-full.csv"), &format!("{table}-sparse.csv"));
        }
    }
}

#[test]
fn steps_between_frames_can_be_had_too() {
    let place = Place::new();
    place.run(&format!("{SMALL} --publish-every-steps 7 --out sevenths.mcap")).exits(0);
    let result = place.run("energies sevenths.mcap --every-step --out energies.csv --json").exits(0).json();
    let table = place.read("energies.csv");
    let steps: Vec<u64> =
        table.lines().skip(1).map(|row| row.split(',').nth(1).unwrap().parse().unwrap()).collect();
    assert!(steps.iter().enumerate().all(|(i, step)| i as u64 == *step), "each step once");
    assert_eq!(result["frames_received"], steps.len() as u64);
}

/// A consumer that comes late, and one that is stopped on the way and loses frames, end up with the table
/// of the one that was there from the start.
#[test]
fn nothing_is_missed_by_coming_late_or_by_losing_frames() {
    let place = Place::new();
    // about six seconds, so that others can attach on the way
    let run = place.start(&format!("{SMALL} --wait-for 1 --no-record --pace 0.002"));
    let early = place.start("energies --out early.csv --no-publish");
    place.wait_for_run("small", |run| run.step > 200);
    let late = place.start("energies --out late.csv --no-publish --from-start --json");
    let losing =
        place.start("energies --out losing.csv --no-publish --latest --from-start --fill-gaps --json");
    place.wait_for_run("small", |run| run.latest > 0 && run.lossless > 1);
    losing.signal("STOP");
    wait_until("the run's end", || {
        let runs = schemas::bus::list_runs(&place.bus()).unwrap();
        runs.iter().all(|run| !run.is_live()).then_some(())
    });
    losing.signal("CONT");
    run.wait().exits(0);
    early.wait().exits(0);
    for consumer in [late, losing] {
        let summary = consumer.wait().exits(0).json();
        assert_eq!((summary["first_frame"].as_u64(), summary["frames_missed"].as_u64()), (Some(0), Some(0)));
    }
    assert_equal(&place, "early.csv", "late.csv");
    assert_equal(&place, "early.csv", "losing.csv");
}
