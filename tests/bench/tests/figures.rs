//! The bench measures what it says. Whether floors are kept is for a quiet machine to say.

use bus::Bus;
use serde_json::Value;
use std::fs;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::process::{Command, Output};
use tempfile::TempDir;

/// A bus that no other test sees.
struct Place(TempDir);

impl Place {
    fn new() -> Self {
        // sockets lie in it, whose paths must be short
        Self(tempfile::Builder::new().prefix("bl").tempdir_in("/tmp").expect("a directory"))
    }

    fn root(&self) -> PathBuf {
        self.0.path().join("bus")
    }

    fn bench(&self, words: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_beadline-bench"));
        command.args(words.split_whitespace()).env("BEADLINE_ROOT", self.root());
        command
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        // what iceoryx2 keeps for a root outlives it otherwise
        let Ok(bus) = Bus::at(&self.root()) else { return };
        for entry in fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().starts_with(bus.prefix()) {
                let _ = fs::remove_file(entry.path());
            }
        }
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Measures one group, which makes so many rows.
fn measure(group: &str, rounds: u64, count: RangeInclusive<usize>) {
    let place = Place::new();
    let words = format!("--rounds {rounds} --json --only {group}");
    let Output { status, stdout, stderr } = place.bench(&words).output().expect("the bench runs");
    assert!([Some(0), Some(3)].contains(&status.code()), "{}", text(&stderr));
    let table: Value = serde_json::from_slice(&stdout).expect("JSON");
    let rows = table["rows"].as_array().expect("rows");
    assert!(count.contains(&rows.len()), "{} rows", rows.len());
    for row in rows {
        assert_eq!(row["group"], group);
        let [least, median, most] =
            ["least", "median", "most"].map(|name| row["ratio"][name].as_f64().expect("a number"));
        assert!(0.0 < least && least <= median && median <= most && most.is_finite(), "{row}");
        // no two measurements take the same time to the nanosecond
        assert!(rounds == 1 || least < most, "{row}");
        let (at_least, at_most) = (row["floor"]["at_least"].as_f64(), row["floor"]["at_most"].as_f64());
        let is_met =
            at_least.is_none_or(|floor| median >= floor) && at_most.is_none_or(|floor| median <= floor);
        assert_eq!(row["met"], is_met, "{row}");
        assert!(row["figure"].as_str().is_some_and(|figure| figure.contains(char::is_numeric)), "{row}");
    }
    let all_met = rows.iter().all(|row| row["met"] == true);
    assert_eq!(status.code(), Some(if all_met { 0 } else { 3 }));
}

#[test]
fn dynamics_are_measured_and_judged() {
    // one for each instruction set that is there
    measure("dynamics", 1, 4..=6);
}

#[test]
fn recordings_are_measured_and_judged() {
    measure("recordings", 1, 7..=7);
}

#[test]
fn analyses_are_measured_and_judged() {
    measure("analyses", 3, 5..=5);
}

#[test]
fn streaming_is_measured_and_judged_and_loses_no_frame() {
    measure("streaming", 1, 11..=11);
}

#[test]
fn what_cannot_be_measured_is_refused_with_what_can_be() {
    let place = Place::new();
    for (words, says) in [("--only geology", "recordings"), ("--rounds 0", "1..=1000")] {
        let ended = place.bench(words).output().expect("the bench runs");
        assert_eq!(ended.status.code(), Some(2));
        assert!(text(&ended.stderr).contains(says), "{}", text(&ended.stderr));
    }
}

#[test]
fn programs_that_are_not_installed_are_no_failure() {
    let place = Place::new();
    let mut command = place.bench("--only peers --rounds 1");
    let ended = command.env("PATH", place.0.path()).output().expect("the bench runs");
    assert!(ended.status.success());
    for missing in [
        "not measured: `lmp` not found (Debian: apt install lammps",
        "not measured: numba: `python3` not found",
    ] {
        assert!(text(&ended.stderr).contains(missing), "{}", text(&ended.stderr));
    }
}
