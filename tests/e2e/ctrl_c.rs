//! Ctrl-C ends every command that takes long: soon, with exit code 3, and without a file that looks whole.

use crate::harness::{Place, Running, wait_until};
use crate::lying;
use recording::BeginRecord;
use schemas::frame::EndReason;
use std::fs;

/// Steps of a run that nobody waits for: recomputing them takes days.
const STEPS: u64 = 1_000_000_000_000;

/// Commands, and the files that must not be there when they were stopped; `long.mcap` has the first and the last of [`STEPS`]
/// steps. Results of analyses up to where they were stopped are kept, and said to end there.
const LONG: [(&str, &[&str]); 18] = [
    ("share long.mcap --pulses", &["long.html"]),
    ("share long.mcap --every-steps 1000000", &["long.html"]),
    ("thin long.mcap --every-steps 1000000000000 --out thin.mcap", &["thin.mcap"]),
    ("expand long.mcap --every-steps 1000000 --out expanded.mcap", &["expanded.mcap"]),
    ("verify long.mcap", &[]),
    ("export long.mcap --every-step --out states.csv", &["states.csv"]),
    ("plot long.mcap --what velocity --fill-gaps --out map.png", &[]),
    ("energies long.mcap --every-step", &[]),
    ("impurity long.mcap --every-step", &[]),
    ("contacts long.mcap --every-step", &[]),
    ("pulses long.mcap --every-step", &[]),
    ("spreading long.mcap --every-step", &[]),
    ("forces long.mcap --at bead:3 --every-step", &[]),
    ("run --preset striker-3g --duration 1e4 --record-every-steps 1000000000 --yes --out run.mcap", &[]),
    ("run --preset striker-3g --duration 1e7 --yes --no-record", &[]),
    ("sweep sweep.toml --out sweep --yes", &["sweep/results.csv"]),
    ("check run.toml", &[]),
    ("reproduce --out paper", &["paper/REPORT.md"]),
];

/// Waits until the process has a handler of SIGINT: before, the signal ends it like any program.
pub(crate) fn wait_for_handler(running: &mut Running) {
    let status = format!("/proc/{}/status", running.id());
    wait_until("the signal's handler", || {
        if !running.is_running() {
            return Some(());
        }
        let status = fs::read_to_string(&status).unwrap_or_default();
        let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"))?.trim().to_owned();
        (u64::from_str_radix(&caught, 16).unwrap() & 2 != 0).then_some(())
    });
}

#[test]
fn every_long_command_ends_at_ctrl_c_with_3() {
    let place = Place::new();
    let (mut manifest, mut states) = lying::run(&place);
    fs::remove_file(place.path("run.mcap")).unwrap();
    manifest.physics.step_count = STEPS;
    manifest.provenance.record_every_steps = STEPS;
    let (first, mut last) = (states.remove(0), states.remove(0));
    last.0 = STEPS;
    lying::write(
        &place,
        "long.mcap",
        &manifest,
        &BeginRecord::default(),
        &[first, last],
        EndReason::Complete,
    );
    let preset = place.run("preset striker-3g").exits(0).stdout();
    let longer =
        |line: &str| if line.starts_with("duration_s") { "duration_s = 1e7".into() } else { line.to_owned() };
    place.write("run.toml", &preset.lines().map(longer).collect::<Vec<_>>().join("\n"));
    let sweep = "[base]\npreset = \"striker-3g\"\ntime.duration_s = 1e7\n[grid]\nchain.alpha = [1.5, 2.0]\n";
    place.write("sweep.toml", sweep);

    let mut failed = Vec::new();
    for (words, files) in LONG {
        let mut running = place.start(words);
        wait_for_handler(&mut running);
        running.signal("INT");
        let ended = running.wait();
        let left: Vec<_> = files.iter().filter(|file| place.path(file).exists()).collect();
        if ended.code() != Some(3) || !left.is_empty() {
            failed.push(format!("{words}: {:?}, {left:?}\n{}", ended.code(), ended.stderr()));
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
    // nothing hidden is left, either, but what a run or a sweep goes on with
    let names =
        fs::read_dir(place.path(".")).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let hidden: Vec<_> = names.filter(|name| name.starts_with('.')).collect();
    assert!(hidden.is_empty(), "{hidden:?}");
}

#[test]
fn a_recording_that_is_not_whole_is_said_to_be_before_it_is_shown() {
    let place = Place::new();
    place.run("run --preset striker-3g --duration 0.001 --out run.mcap").exits(0);
    let bytes = fs::read(place.path("run.mcap")).unwrap();
    fs::write(place.path("cut.mcap"), &bytes[..bytes.len() / 2]).unwrap();
    let mut running = place.start("view cut.mcap");
    let url = running.line();
    assert!(url.starts_with("http"), "{url}");
    running.signal("INT");
    running.wait().exits(0).says(&["cut.mcap", "what is whole in it is shown"]);
}

/// Ten thousand beads in steps that are many: a look at all of them takes minutes, and nobody asked for it.
#[test]
fn a_long_chain_is_shared_without_a_look_at_all_steps_and_says_so() {
    let place = Place::new();
    place.run("run --beads 100000 --duration 0.004 --record-every-steps 100 --out long.mcap").exits(0);
    let ended = place.run("share long.mcap --json").exits(0).says(&["pulses are not looked for", "--pulses"]);
    let made = ended.json();
    assert!(made["pulses"].is_null() && made["recomputes"] == true, "{made}");
    assert!(made["bytes"].as_u64().unwrap() <= 2_000_000);
    // 1.6 MB a state: what a browser unpacks, and what lay on the disk on the way
    assert!(made["states"].as_u64().unwrap() <= 64_000_000 / 1_600_000, "{made}");
    let found = place.run("share long.mcap --pulses --force --json").exits(0).json();
    assert!(found["pulses"].as_u64().unwrap() > 0, "{found}");
}
