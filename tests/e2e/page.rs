//! The page in a browser.

use crate::harness::{Place, Running, node, skip};
use crate::lying;
use recording::BeginRecord;
use schemas::frame::EndReason;
use schemas::manifest::Physics;
use schemas::presets::PRESETS;
use std::ffi::{OsStr, OsString};
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// A sparse recording of 100 beads, and what stands in front of its duration.
const RUN: &str = "run --beads 100 --impurity 50=0.6e-3 --record-every-steps 100 --out run.mcap";

/// Node.js, if there is also a browser for it to drive: the program that a variable names, or else at its usual place.
fn with_browser(variable: &str, usual: &str) -> Option<PathBuf> {
    let browser = std::env::var_os(variable).unwrap_or_else(|| usual.into());
    if !Path::new(&browser).exists() {
        skip(&format!("no {usual}: `tests/setup` installs it, or set {variable} to another one"));
        return None;
    }
    node()
}

/// Runs a scenario of `tests/node/check_page.mjs`, which has to find everything as it should be, and prints what
/// it measured.
#[track_caller]
fn check<A: AsRef<OsStr>>(place: &Place, scenario: &str, arguments: impl IntoIterator<Item = A>) {
    check_by("check_page.mjs", place, scenario, arguments);
}

/// The same by another script beside it.
#[track_caller]
pub(crate) fn check_by<A: AsRef<OsStr>>(
    script: &str,
    place: &Place,
    scenario: &str,
    arguments: impl IntoIterator<Item = A>,
) {
    let browser = match scenario {
        "firefox" => with_browser("BEADLINE_CHECK_FIREFOX", "/usr/bin/firefox-esr"),
        _ => with_browser("BEADLINE_CHECK_BROWSER", "/usr/bin/chromium"),
    };
    let Some(node) = browser else { return };
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/node").join(script);
    let mut words: Vec<OsString> =
        vec![script.into(), env!("CARGO_BIN_EXE_beadline").into(), scenario.to_owned().into()];
    words.extend(arguments.into_iter().map(|word| word.as_ref().to_owned()));
    let ended = Running::start(&format!("page {scenario}"), place.foreign(node, words)).wait().exits(0);
    // not `print!`, which the test harness hides unless the test fails
    std::io::stderr().write_all(ended.stdout().as_bytes()).unwrap();
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
    place.run(&format!("{RUN} --duration 0.01")).exits(0);
    let two = place.run("share run.mcap --out two.html --every-steps 1000000 --json").exits(0).json();
    let every_steps = two["steps"].as_u64().unwrap() - 1;
    assert_eq!((&two["states"], &two["every_steps"]), (&2.into(), &every_steps.into()));
    place.run("share run.mcap --out run.html").exits(0);
    place.run("expand run.mcap --out whole.mcap").exits(0);
    check(&place, "shared", ["run.html", "whole.mcap"]);
    check(&place, "firefox", ["run.html", "whole.mcap"]);
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

/// The page and `verify` say the same of what is missing and what is not whole.
#[test]
fn what_a_proof_lacks_is_said_as_verify_says_it() {
    let place = Place::new();
    let (manifest, mut states) = lying::run(&place);
    let begin = BeginRecord::default();
    lying::write(&place, "failed.mcap", &manifest, &begin, &states, EndReason::Failed);
    states.remove(20);
    lying::write(&place, "missing.mcap", &manifest, &begin, &states, EndReason::Complete);
    for (name, verdict) in [("failed", "NOT WHOLE"), ("missing", "NOT PROVEN")] {
        let told = place.run(&format!("verify {name}.mcap")).exits(3).stdout();
        assert!(told.contains(verdict), "{told}");
    }
    check(&place, "proofs", ["run.mcap", "missing.mcap", "failed.mcap"]);
}

#[test]
fn a_long_text_is_shown_cut_in_the_page() {
    let place = Place::new();
    let (mut manifest, states) = lying::run(&place);
    manifest.provenance.program = "p".repeat(5_000_000);
    lying::write(&place, "long.mcap", &manifest, &BeginRecord::default(), &states, EndReason::Complete);
    check(&place, "long", ["long.mcap"]);
}

#[test]
fn a_folder_of_many_files_has_as_many_rows_as_a_tab_bears() {
    let place = Place::new();
    place.run(&format!("{RUN} --duration 0.001")).exits(0);
    fs::create_dir(place.path("many")).unwrap();
    for i in 0..1200 {
        fs::hard_link(place.path("run.mcap"), place.path(format!("many/run-{i:04}.mcap"))).unwrap();
    }
    check(&place, "crowded", ["many"]);
}

#[test]
fn damage_is_said_before_anybody_looks_there() {
    let place = Place::new();
    let (manifest, states) = lying::run(&place);
    lying::write(&place, "whole.mcap", &manifest, &BeginRecord::default(), &states, EndReason::Complete);
    let mut bytes = fs::read(place.path("whole.mcap")).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(place.path("damaged.mcap"), bytes).unwrap();
    check(&place, "damaged", ["damaged.mcap"]);
}

#[test]
fn what_the_pointer_reads_out_is_what_is_exported() {
    let place = Place::new();
    place
        .run("run --beads 40 --impurity 20=0.6e-3 --duration 0.004 --record-every-steps 100 --out run.mcap")
        .exits(0);
    place.run("export run.mcap --every-step --out run.csv").exits(0);
    check(&place, "readout", ["run.mcap", "run.csv"]);
}

#[test]
fn wheel_and_drag_lead_to_single_steps_and_a_reload_keeps_the_view() {
    let place = Place::new();
    place.run(&format!("{RUN} --duration 0.002")).exits(0);
    check(&place, "gestures", ["run.mcap"]);
}

#[test]
fn everything_can_be_done_by_keys_and_has_a_name() {
    let place = Place::new();
    place.run(&format!("{RUN} --duration 0.002")).exits(0);
    check(&place, "keyboard", ["run.mcap"]);
}

#[test]
fn a_live_run_can_be_paused_in_the_page_and_scrolled_back_to_its_beginning() {
    check(&Place::new(), "live", [""; 0]);
}

/// How fast it is beside the page is printed; that it never waits for the page holds on any machine.
#[test]
fn a_page_never_holds_a_run_back() {
    check(&Place::new(), "rate", [""; 0]);
}

#[test]
fn a_recording_that_is_dropped_is_shown_whatever_its_kernel() {
    let place = Place::new();
    place.run(&format!("{RUN} --duration 0.002")).exits(0);
    place.run("expand run.mcap --out whole.mcap").exits(0);
    place.run("share --out empty.html").exits(0);
    let older = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/1.0-kernel-1/full.mcap");
    let names = ["empty.html", "run.mcap", "whole.mcap"].map(|name| place.path(name));
    check(&place, "dropped", names.iter().chain([&older]));
}

#[test]
fn a_hostile_file_is_a_sentence_and_a_hostile_name_is_text() {
    let place = Place::new();
    let (mut manifest, states) = lying::run(&place);
    manifest.provenance.program = "<script>alert(1)</script><img src=x onerror=alert(2)>".to_owned();
    manifest.provenance.host = "</script></title><script>alert(3)</script><!--".to_owned();
    fs::create_dir(place.path("files")).unwrap();
    let named = "files/<img src=x onerror=alert(4)>.mcap";
    lying::write(&place, named, &manifest, &BeginRecord::default(), &states, EndReason::Complete);
    let bytes = fs::read(place.path(named)).unwrap();
    place.foreign(env!("CARGO_BIN_EXE_beadline"), ["share", named, "--out", "named.html"]).status().unwrap();
    let changed = |at: usize, with: &[u8]| {
        let mut changed = bytes.clone();
        changed[at..at + with.len()].copy_from_slice(with);
        changed
    };
    let middle = bytes.len() / 2;
    for (name, bytes) in [
        ("bad-page", b"<!doctype html><script>alert(5)</script>".to_vec()),
        ("bad-nothing", Vec::new()),
        ("bad-beginning", bytes[..100].to_vec()),
        // of the first record, and of one whose sum with its place has more than 64 bits
        ("bad-length", changed(9, &(1u64 << 62).to_le_bytes())),
        ("bad-longest", changed(9, &u64::MAX.to_le_bytes())),
        ("cut", bytes[..middle].to_vec()),
        ("flipped", changed(middle, &[bytes[middle] ^ 1])),
    ] {
        fs::write(place.path(format!("files/{name}.mcap")), bytes).unwrap();
    }
    place.run("share --out empty.html").exits(0);
    check(&place, "hostile", ["empty.html", "named.html", "files"]);
}

#[test]
fn a_folder_or_a_sweep_is_a_table_from_which_runs_are_opened() {
    let place = Place::new();
    let sweep = "\
[base]
preset = \"light-impurity\"
chain.beads = 60
chain.impurities = [{ bead = 30, mass_kg = 1e-3 }]
time.duration_s = 2e-3
[grid]
chain.alpha = [1.5, 2.0]
\"chain.impurities[0].mass_kg\" = [0.6e-3, 5e-3]
";
    place.write("computed.toml", sweep);
    place.write("recorded.toml", &format!("record = true\n{sweep}"));
    place.run("sweep computed.toml --out computed").exits(0);
    place.run("sweep recorded.toml --out recorded").exits(0);
    check(&place, "folder", ["recorded/recordings", "recorded", "computed"]);
}

#[test]
fn a_changed_chain_is_what_its_configuration_gives() {
    let place = Place::new();
    place.run(&format!("{RUN} --duration 0.004")).exits(0);
    check(
        &place,
        "change",
        ["run.mcap", "mass of bead 50=0.0008", "exponent α=1.8", "speed of the striker=7"],
    );
}

/// Chains beyond one power law: what is changed leaves what it does not concern as it was resolved.
#[test]
fn bonds_drives_and_spheres_are_changed_as_their_configurations_give_it() {
    let place = Place::new();
    let bonds = "\
chain = { beads = 30, bead_mass_kg = 1e-3, bonds = { linear = 1e5, quadratic = 1e8, cubic = 1e13 } }
ends = { left = \"fixed\", right = \"fixed\" }
striker = { bead = 3, velocity_m_s = 0.5 }
drive = [{ bead = 10, force_n = { sine = { amplitude = 2.0, frequency_hz = 1000.0 } } }]
time = { duration_s = 0.003 }
";
    let spheres = "\
seed = 7
chain = { beads = 30, spheres = { material = \"steel\", radius_m = 9.5e-3 } }
disorder = [{ of = \"radii\", uniform = 0.1 }]
ends = { left = \"fixed\", right = \"fixed\" }
load = { precompression_n = 10.0 }
drive = [{ wall = \"left\", displacement_m = { sine = { amplitude = 3e-7, frequency_hz = 6.3e3, ramp_s = 1e-4 } } }]
time = { duration_s = 0.003 }
";
    let baths = "\
seed = 5
chain = { beads = 16, bead_mass_kg = 1.0, bonds = { linear = 1.0, cubic = 1.0 } }
ends = { left = \"fixed\", right = \"fixed\" }
striker = { bead = 8, velocity_m_s = 1.0 }
bath = [
    { beads = \"..4\", temperature_j = { ramp = { amplitude = 1.5, to_s = 20.0 } }, friction_per_s = 0.5 },
    { beads = \"-4..\", temperature_j = 0.5, friction_per_s = 0.5, pairs = true, seed = 9 },
]
time = { duration_s = 30.0 }
";
    for (name, text) in [("bonds", bonds), ("spheres", spheres), ("baths", baths)] {
        place.write(&format!("{name}.toml"), text);
        place.run(&format!("run {name}.toml --out {name}.mcap")).exits(0);
    }
    let drive = "amplitude of the drive of bead 10=3.5";
    check(
        &place,
        "change",
        ["bonds.mcap", drive, "linear stiffness of bonds=137000", "mass of bead 3=0.002"],
    );
    let wall = "frequency of the drive of left wall=8000";
    check(&place, "change", ["spheres.mcap", "speed of the striker=0.2", wall]);
    check(&place, "change", ["baths.mcap", "speed of the striker=1.5"]);
}

#[test]
fn what_is_exported_from_the_page_is_what_it_shows() {
    let place = Place::new();
    place.run(&format!("{RUN} --duration 0.004")).exits(0);
    check(&place, "exports", ["run.mcap"]);
}

/// At a reduced size; `node tests/node/check_page.mjs BEADLINE speed` measures in full.
#[test]
fn speeds_are_measured() {
    let place = Place::new();
    place.run("run --beads 1000 --impurity 500=0.6e-3 --duration 0.003 --out run.mcap").exits(0);
    place.run("share run.mcap --out run.html").exits(0);
    check(&place, "speed", ["run.mcap", "run.html"]);
}
