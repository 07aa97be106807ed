//! Files of ours in every reader of MCAP that others wrote: Python's, those for Node.js, Rerun's.

use crate::harness::{Place, Running, python, skip, wait_until};
use recording::RecordingInfo;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const CHAIN: &str = "run --preset homogeneous --duration 4e-3 --impurity 20=0.6e-3";

/// The readers that `tests/setup` installs.
struct Readers<'a> {
    place: &'a Place,
    programs: PathBuf,
}

impl<'a> Readers<'a> {
    /// Those of the environment of `BEADLINE_CHECK_PYTHON`, or none.
    fn of(place: &'a Place) -> Option<Self> {
        let programs = python()?.parent()?.to_owned();
        let readers = Self { place, programs };
        let needed = [readers.programs.join("rerun"), readers.programs.join("node"), readers.modules()];
        if let Some(missing) = needed.iter().find(|path| !path.exists()) {
            skip(&format!("there is no {}: run `tests/setup` again", missing.display()));
            return None;
        }
        // as its own documentation asks for; it is said in the home that `program` gives it
        Self::run(readers.program("rerun", &["analytics", "disable"]));
        Some(readers)
    }

    /// Where the packages for Node.js are.
    fn modules(&self) -> PathBuf {
        self.programs.with_file_name("node").join("node_modules")
    }

    fn program(&self, name: &str, words: &[&str]) -> Command {
        let mut command = self.place.foreign(self.programs.join(name), words);
        command.env("NODE_PATH", self.modules()).env("HOME", self.place.path("home"));
        command.env_remove("XDG_CONFIG_HOME");
        command
    }

    fn run(command: Command) -> String {
        Running::start(&format!("{command:?}"), command).wait().exits(0).stdout()
    }

    fn python(&self, script: &str, words: &[&str]) {
        let script = format!("{}/tests/python/{script}", env!("CARGO_MANIFEST_DIR"));
        Self::run(self.program("python", &[&[script.as_str()], words].concat()));
    }

    fn node(&self, words: &[&str]) {
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/node/check_recording.cjs");
        Self::run(self.program("node", &[&[script], words].concat()));
    }

    /// Rerun finds nothing wrong with the `.mcap` file, and makes `rrd` of it.
    fn rerun(&self, flags: &[&str], file: &str, rrd: &str) {
        let checked = Self::run(self.program("rerun", &[&["mcap", "check", "--full", file], flags].concat()));
        let statuses = checked.lines().skip_while(|line| !line.starts_with("Status")).skip(2);
        let statuses: Vec<_> = statuses.filter(|line| !line.trim().is_empty()).collect();
        assert!(!statuses.is_empty(), "{checked}");
        assert!(statuses.iter().all(|line| line.starts_with("ok ")), "{checked}");
        Self::run(self.program("rerun", &[&["mcap", "convert", file, "--output", rrd], flags].concat()));
    }

    /// Every reader gets the doubles of our tables from a recording; `code` is that of our analyses of it.
    fn read_recording(&self, file: &str, code: i32) {
        let is_closed = !file.ends_with(".partial");
        self.place.run(&format!("impurity {file} --bead 0 --bead 20 --out motion.csv --force")).exits(code);
        self.place.run(&format!("energies {file} --out energies.csv --force")).exits(code);
        let tables = ["motion.csv", "energies.csv"];
        let unfinished: &[&str] = if is_closed { &[] } else { &["--unfinished"] };
        self.python("check_recording.py", &[unfinished, &[file, tables[0]]].concat());
        self.node(&[unfinished, &[file], &tables].concat());
        // Rerun goes by the extension
        fs::copy(self.place.path(file), self.place.path("copy.mcap")).unwrap();
        self.rerun(if is_closed { &[] } else { &["--recover"] }, "copy.mcap", "copy.rrd");
        self.python("check_with_rerun.py", &[&["copy.rrd"], &tables[..]].concat());
    }
}

/// A recording, what a kill leaves of one, and what is recovered from that: the doubles of our tables in every reader.
#[test]
fn every_reader_reads_recordings_killed_and_recovered_ones() {
    let place = Place::new();
    let Some(readers) = Readers::of(&place) else { return };
    place.run(&format!("{CHAIN} --name run")).exits(0);
    readers.read_recording("run.mcap", 0);

    let killed = place.start(&format!("{CHAIN} --name killed --pace 0.012 --flush-period 0.01"));
    let partial = place.path("killed.mcap.partial");
    wait_until("300 recorded frames", || has_frames(&partial, 300).then_some(()));
    drop(killed);
    readers.read_recording("killed.mcap.partial", 3);

    place.run("recover killed.mcap.partial --out recovered.mcap").exits(0);
    readers.read_recording("recovered.mcap", 0);
}

fn has_frames(path: &Path, count: u64) -> bool {
    RecordingInfo::read(path).is_ok_and(|info| info.frames() >= count)
}

/// What is exported for Foxglove is the recording's, reduced without losing what is fastest, and Rerun shows it: of a whole
/// run, of a part of it, and of a sparse recording with fewer states than rows of the map and clouds.
#[test]
fn viewers_show_what_is_exported_for_foxglove() {
    let place = Place::new();
    let Some(readers) = Readers::of(&place) else { return };
    place.run(&format!("{CHAIN} --name run")).exits(0);
    place.run("thin run.mcap --every-steps 100 --out sparse.mcap").exits(0);
    for (i, (recording, part, beads, clouds)) in [
        ("run.mcap", "", "", "300"),
        ("run.mcap", "--from 1e-3 --until 3e-3", "--beads 10..60", "300"),
        ("sparse.mcap", "", "", "29"),
    ]
    .into_iter()
    .enumerate()
    {
        let [shown, rrd] = ["mcap", "rrd"].map(|end| format!("shown-{i}.{end}"));
        place.run(&format!("export {recording} --to foxglove --out {shown} {part} {beads}")).exits(0);
        place.run(&format!("impurity {recording} --events events.csv --force {part}")).exits(0);
        let flags = part.split_whitespace().chain(beads.split_whitespace());
        let words: Vec<_> = [recording, &shown, "events.csv", clouds].into_iter().chain(flags).collect();
        readers.python("check_foxglove.py", &words);
        readers.node(&[&shown]);
        readers.rerun(&[], &shown, &rrd);
        readers.python("check_shown_in_rerun.py", &[&shown, &rrd]);
    }
    place.run("export run.mcap --out few.mcap").exits(2).says(&["--to", "foxglove"]);
    place.run("export run.mcap --to foxglove --out shown-0.mcap").exits(2).says(&["--force"]);
    place.run("export run.mcap --to foxglove --out few.mcap --clouds 5").exits(0);
    place.run("impurity run.mcap --events events.csv --force").exits(0);
    readers.python("check_foxglove.py", &["run.mcap", "few.mcap", "events.csv", "5"]);
}
