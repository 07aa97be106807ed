//! The bench measures what it says. Whether floors are kept is for a quiet machine to say.

use crate::harness::{Place, Running};
use std::ops::RangeInclusive;

/// Measures one group once, which makes so many rows.
fn measure(group: &str, count: RangeInclusive<usize>) {
    let place = Place::new();
    let ended = place.run(&format!("bench --rounds 1 --json --only {group}"));
    assert!([0, 3].contains(&ended.code().unwrap_or(-1)), "{}", ended.stderr());
    let table = ended.json();
    let rows = table["rows"].as_array().expect("rows");
    assert!(count.contains(&rows.len()), "{} rows", rows.len());
    for row in rows {
        let ratio = row["ratio"]["median"].as_f64().expect("a number");
        assert!(ratio > 0.0 && ratio.is_finite(), "{row}");
        assert_eq!(row["ratio"]["least"], row["ratio"]["most"], "of one round");
        assert_eq!(row["group"], group);
    }
}

#[test]
fn dynamics_are_measured_and_judged() {
    // one for each instruction set that is there
    measure("dynamics", 4..=6);
}

#[test]
fn recordings_are_measured_and_judged() {
    measure("recordings", 7..=7);
}

#[test]
fn analyses_are_measured_and_judged() {
    measure("analyses", 3..=3);
}

#[test]
fn streaming_is_measured_and_judged_and_loses_no_frame() {
    measure("streaming", 7..=7);
}

#[test]
fn groups_are_chosen_by_name() {
    let place = Place::new();
    let none = place.run("bench --only geology");
    assert_eq!(none.code(), Some(2));
    assert!(none.stderr().contains("recordings"), "{}", none.stderr());
    let help = place.run("bench --help");
    assert!(help.stdout().contains("  analyses "), "{}", help.stdout());
}

#[test]
fn programs_that_are_not_installed_are_no_failure() {
    let place = Place::new();
    let mut command = place.command(["bench", "--only", "peers", "--rounds", "1"]);
    command.env("PATH", place.path("nothing"));
    let ended = Running::start("bench without anybody to measure against", command).wait().exits(0);
    ended.says(&[
        "not measured: `lmp` not found (Debian: apt install lammps",
        "not measured: numba: `python3` not found",
    ]);
}
