//! What the page reads from recordings: by its own modules, against readers that others wrote.

use crate::harness::{Place, Running, node};
use schemas::manifest::Physics;
use schemas::presets::PRESETS;
use std::ffi::{OsStr, OsString};
use std::fs;
use std::path::{Path, PathBuf};

fn in_project(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// Runs a script of Node.js that has to end well and to print `says`; nothing where there is no Node.js.
#[track_caller]
fn run<A: AsRef<OsStr>>(place: &Place, script: &Path, arguments: impl IntoIterator<Item = A>, says: &str) {
    let Some(node) = node() else { return };
    let mut words = vec![script.as_os_str().to_owned()];
    words.extend(arguments.into_iter().map(|word| word.as_ref().to_owned()));
    let ended = Running::start(&script.display().to_string(), place.foreign(node, words)).wait();
    let (stdout, ended) = (ended.stdout(), ended.exits(0));
    assert!(stdout.contains(says), "{}: {stdout}{}", script.display(), ended.stderr());
}

#[track_caller]
pub(crate) fn check<A: AsRef<OsStr>>(place: &Place, arguments: impl IntoIterator<Item = A>, says: &str) {
    run(place, &in_project("tests/node/check_page_data.mjs"), arguments, says);
}

/// Golden recordings of both kernels, finished or not, and contacts maps, of which the page says that it has no states to show.
fn golden() -> Vec<PathBuf> {
    let directories = ["tests/golden/1.0-kernel-1", "tests/golden/1.0-kernel-2"];
    let entries = directories.iter().flat_map(|directory| fs::read_dir(in_project(directory)).unwrap());
    let mut files: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    files.retain(|path| path.extension().is_some_and(|end| end == "mcap" || end == "partial"));
    files.sort();
    files
}

#[test]
fn every_preset_and_golden_recording_has_the_same_states_in_the_page() {
    let place = Place::new();
    let mut files = golden();
    for preset in PRESETS {
        let physics = Physics::resolve(&preset.config()).unwrap();
        let duration_s = physics.dt_s * (physics.step_count / 50) as f64;
        let out = format!("{}.mcap", preset.name);
        let flags = format!("--duration {duration_s:e} --publish-every-steps 1 --record-every-steps 10");
        place.run(&format!("run --preset {} {flags} --out {out}", preset.name)).exits(0);
        files.push(place.path(&out));
    }
    check(&place, &files, "equal");
}

#[test]
fn the_page_decompresses_as_zstd_does() {
    check(&Place::new(), ["--zstd"], "equal");
}

#[test]
fn any_encoding_is_read_and_what_is_impossible_is_refused_in_the_page() {
    check(&Place::new(), ["--made"], "as it should be");
}

#[test]
fn a_damaged_recording_is_an_error_or_a_note_in_the_page() {
    let files = ["full.mcap", "results-part-0003.mcap", "partial.mcap.partial"]
        .map(|name| in_project("tests/golden/1.0-kernel-2").join(name).into_os_string());
    let arguments = [OsString::from("--damage")].into_iter().chain(files);
    check(&Place::new(), arguments, "errors");
}

#[test]
fn what_the_page_draws_is_right_where_it_is_numbers_and_text() {
    let script = in_project("tests/node/check_page_drawing.mjs");
    run(&Place::new(), &script, [""; 0], "are right");
}

#[test]
fn the_modules_of_the_page_have_types() {
    let tsc = in_project("target/check/node/node_modules/typescript/bin/tsc");
    let project = in_project("page/tsconfig.json").into_os_string();
    run(&Place::new(), &tsc, [OsString::from("-p"), project], "");
}
