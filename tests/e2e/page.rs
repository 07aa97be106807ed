//! The page in a browser.

use crate::harness::{Place, Running, node, skip};
use crate::lying;
use recording::BeginRecord;
use schemas::frame::EndReason;
use schemas::manifest::Physics;
use schemas::presets::PRESETS;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

/// Node.js, if there is also a browser for it to drive.
fn with_browser() -> Option<PathBuf> {
    let browser = std::env::var_os("BEADLINE_CHECK_BROWSER").unwrap_or_else(|| "/usr/bin/chromium".into());
    if !Path::new(&browser).exists() {
        skip("no Chromium: `tests/setup` installs it, or set BEADLINE_CHECK_BROWSER");
        return None;
    }
    node()
}

/// Runs a scenario of `tests/node/check_page.mjs`, which has to find everything as it should be, and prints what
/// it measured.
#[track_caller]
fn check<A: AsRef<OsStr>>(place: &Place, scenario: &str, arguments: impl IntoIterator<Item = A>) {
    let Some(node) = with_browser() else { return };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/node/check_page.mjs");
    let mut words: Vec<OsString> =
        vec![script.into(), env!("CARGO_BIN_EXE_beadline").into(), scenario.to_owned().into()];
    words.extend(arguments.into_iter().map(|word| word.as_ref().to_owned()));
    let ended = Running::start(&format!("page {scenario}"), place.foreign(node, words)).wait().exits(0);
    print!("{}", ended.stdout());
}

/// Step by step, through chains of every kind that a preset has.
#[test]
fn every_step_of_every_preset_has_the_bits_of_the_kernel() {
    let place = Place::new();
    let mut files = Vec::new();
    for preset in PRESETS {
        let physics = Physics::resolve(&preset.config()).unwrap();
        let duration_s = physics.dt_s * 1500.0;
        let name = preset.name;
        place
            .run(&format!(
                "run --preset {name} --duration {duration_s:e} --dt {:e} --record-every-steps 100 --out {name}.mcap",
                physics.dt_s
            ))
            .exits(0);
        place.run(&format!("expand {name}.mcap --out {name}-whole.mcap")).exits(0);
        files.extend([format!("{name}.mcap"), format!("{name}-whole.mcap")]);
    }
    check(&place, "states", files);
}

#[test]
fn a_shared_file_holds_every_step_without_a_network() {
    let place = Place::new();
    place.run("run --beads 100 --impurity 50=0.6e-3 --duration 0.01 --record-every-steps 100 --out run.mcap").exits(0);
    place.run("share run.mcap --out run.html").exits(0);
    place.run("expand run.mcap --out whole.mcap").exits(0);
    check(&place, "shared", [place.path("run.html"), place.path("whole.mcap")]);
}

#[test]
fn a_changed_value_is_named_by_step_and_bead() {
    let place = Place::new();
    let (manifest, mut states) = lying::run(&place);
    let (step, doubles) = &mut states[20];
    // the last bit of the velocity of bead 3
    doubles[60 + 3] = f64::from_bits(doubles[60 + 3].to_bits() ^ 1);
    let step = *step;
    lying::write(&place, "changed.mcap", &manifest, &BeginRecord::default(), &states, EndReason::Complete);
    check(&place, "changed", ["changed.mcap".to_owned(), step.to_string(), "3".to_owned()]);
}
