//! Ctrl-C ends every command that takes long: soon, with exit code 3, and without a file that looks whole.

use crate::harness::{Place, Running, SILENCE, wait_until};
use crate::lying;
use recording::BeginRecord;
use schemas::frame::EndReason;
use std::fs;
use std::time::Instant;

/// Steps of a run that nobody waits for: recomputing them takes days.
const STEPS: u64 = 1_000_000_000_000;

/// What a command does when the signal comes.
#[derive(Clone, Copy, PartialEq)]
enum At {
    /// It computes, reads or writes, and has a handler.
    Work,
    /// It waits for others, and has a handler: it has said this.
    Wait(&'static str),
    /// It computes or reads, and nothing that it leaves needs an orderly end: the signal ends it.
    Bare,
}
use At::{Bare, Wait, Work};

/// Commands, when they are stopped, and the files that must not be there then. `long.mcap` has the first and the last of [`STEPS`]
/// steps, `loaded.mcap` a chain whose modes take long, `slow.toml` an orbit of many steps, `many` thousands of recordings; `paced` is a live run. Results of analyses up to
/// where they were stopped are kept, and said to end there.
const LONG: [(&str, At, &[&str]); 52] = [
    ("share long.mcap --pulses", Work, &["long.html"]),
    ("share long.mcap --every-steps 1000000 --force", Work, &["long.html"]),
    ("thin long.mcap --every-steps 1000000000000 --out thin.mcap", Work, &["thin.mcap"]),
    ("expand long.mcap --every-steps 1000000 --out expanded.mcap", Work, &["expanded.mcap"]),
    ("verify long.mcap", Work, &[]),
    ("verify long.mcap long.mcap", Work, &[]),
    ("recover long.mcap --out recovered.mcap", Work, &["recovered.mcap"]),
    ("export long.mcap --every-step --out states.csv", Work, &["states.csv"]),
    ("plot long.mcap --what velocity --fill-gaps --out map.png", Work, &[]),
    ("plot long.mcap --what velocity --at 1000 --out profile.png", Work, &["profile.png"]),
    ("plot long.mcap --what velocity --at 1000 --jobs 1 --out profile.png", Work, &["profile.png"]),
    ("film long.mcap --out film.gif", Work, &["film.gif"]),
    ("energies long.mcap --every-step", Work, &[]),
    ("energies long.mcap --every-step --jobs 1", Work, &[]),
    ("energies long.mcap --fill-gaps --from 1000", Work, &[]),
    ("energies live:nobody", Wait("waiting for the run"), &[]),
    ("energies live:paced --from-start --no-publish", Work, &[]),
    ("impurity long.mcap --every-step", Work, &[]),
    ("impurity live:paced", Work, &[]),
    ("contacts long.mcap --every-step", Work, &[]),
    ("contacts long.mcap --every-step --out map.mcap", Work, &[]),
    ("pulses long.mcap --every-step", Work, &[]),
    ("spreading long.mcap --every-step", Work, &[]),
    ("heat long.mcap --every-step", Work, &[]),
    ("correlations long.mcap --every-step", Work, &[]),
    ("modal loaded.mcap --every-step", Work, &[]),
    ("lyapunov long.mcap --exponents 4", Work, &[]),
    ("orbit slow.toml --out slow", Work, &["slow"]),
    ("deformation long.mcap --contact 3 --every-step", Work, &[]),
    ("forces long.mcap --at bead:3 --every-step", Work, &[]),
    ("spectrum long.mcap --at bead:3 --every-step", Work, &[]),
    ("spectrum long.mcap --map --every-step", Work, &[]),
    ("modes loaded.toml", Bare, &[]),
    ("modes loaded.mcap --out modes.csv", Work, &["modes.csv"]),
    ("modes loaded.mcap --energy --every-step", Work, &[]),
    (
        "run --preset striker-3g --duration 1e4 --record-every-steps 1000000000 --yes --out run.mcap",
        Work,
        &[],
    ),
    (
        "run --preset striker-3g --duration 1e4 --record-every-steps 1000000000 --yes --no-publish --out alone.mcap",
        Work,
        &[],
    ),
    ("run --preset striker-3g --duration 1e7 --yes --no-record", Work, &[]),
    ("run --preset striker-3g --no-record --wait-for 1", Wait("waiting for"), &[]),
    (
        "run --beads 2000000 --duration 1 --record-every-steps 1000000 --yes --no-publish --out large.mcap",
        Work,
        &[],
    ),
    (
        "run --beads 100000 --duration 1 --dt auto:1e-9 --yes --no-publish --out step.mcap",
        Bare,
        &["step.mcap"],
    ),
    ("record live:nobody --out recorded.mcap", Wait("waiting for the run"), &["recorded.mcap"]),
    ("record live:paced --out recorded.mcap", Work, &[]),
    ("replay long.mcap", Wait("waiting for"), &[]),
    ("replay long.mcap --wait-for 0 --name long", Work, &[]),
    ("sweep sweep.toml --out sweep --yes", Work, &["sweep/results.csv"]),
    ("sweep sweep.toml --plan", Work, &[]),
    ("sweep --status whole", Bare, &[]),
    ("check run.toml", Work, &[]),
    ("catalog many --out table.csv", Bare, &[]),
    ("reproduce --out paper", Work, &["paper/REPORT.md"]),
    ("demo --out demo", Work, &["demo/light-impurity.html"]),
];

/// Commands that take no time, or whose Ctrl-C is tested elsewhere.
const OTHERS: [&str; 13] = [
    "analyses",
    "presets",
    "schema",
    "preset",
    "completions",
    "man",
    // looks at heads of files, or at what is on the bus
    "info",
    "ls",
    // view::*, top::*: they end with 0
    "view",
    "top",
    // relay::*, uploads::*: in builds that have them
    "relay",
    "upload",
    "help",
];

/// Most time of processors that a command may take from the signal to its end (s), on a machine that does nothing else half of it.
const MOST_CPU_S: f64 = 1.0;

/// Waits until the process has a handler of SIGINT: before, the signal ends it like any program.
pub(crate) fn wait_for_handler(running: &Running) {
    let status = format!("/proc/{}/status", running.id());
    wait_until("the signal's handler", || {
        if state_of(running.id()).is_none_or(|(state, _)| state == 'Z') {
            return Some(());
        }
        let status = fs::read_to_string(&status).unwrap_or_default();
        let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:"))?.trim().to_owned();
        (u64::from_str_radix(&caught, 16).unwrap() & 2 != 0).then_some(())
    });
}

/// The state of a process, and how long it has computed (s).
pub(crate) fn state_of(process: u32) -> Option<(char, f64)> {
    let stat = fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    let fields: Vec<&str> = stat.rsplit(')').next()?.split_ascii_whitespace().collect();
    let ticks = |at: usize| fields[at].parse::<f64>().ok();
    Some((fields[0].chars().next()?, (ticks(11)? + ticks(12)?) / 100.0))
}

/// Waits until the process does what it is to do when it is stopped.
fn wait_for(at: At, running: &mut Running) {
    match at {
        Work => {
            wait_for_handler(running);
            let began = state_of(running.id()).map_or(0.0, |(_, cpu_s)| cpu_s);
            wait_until("work", || match state_of(running.id()) {
                // one that waits for others has said so, and does no more
                Some((state, cpu_s)) => (state == 'Z' || cpu_s >= began + 0.03).then_some(()),
                None => Some(()),
            });
        }
        Wait(said) => {
            wait_for_handler(running);
            running.wait_until_it_says(said);
        }
        Bare => wait_until("work", || match state_of(running.id()) {
            Some((state, cpu_s)) => (state == 'Z' || cpu_s >= 0.2).then_some(()),
            None => Some(()),
        }),
    }
}

/// Stops the command, and says what is wrong with how it ended.
fn stopped(place: &Place, words: &str, at: At, files: &[&str]) -> Result<String, String> {
    let mut running = place.start(words);
    wait_for(at, &mut running);
    let (start, before) = (Instant::now(), state_of(running.id()));
    let is_there = before.is_some_and(|(state, _)| state != 'Z');
    if is_there {
        running.signal("INT");
    }
    let after = wait_until(&format!("the end of {words}"), || match state_of(running.id()) {
        Some((state, cpu_s)) => (state == 'Z').then_some(cpu_s),
        None => Some(0.0),
    });
    let (wall_s, cpu_s) = (start.elapsed().as_secs_f64(), after - before.map_or(after, |(_, cpu_s)| cpu_s));
    let by_itself = if is_there { "" } else { " (ended by itself)" };
    let told = format!("{wall_s:.2} s, {cpu_s:.2} s of processors: {words}{by_itself}");
    let ended = running.wait();
    let left: Vec<_> = files.iter().filter(|file| place.path(file).exists()).collect();
    // one without a handler may have been done before
    let is_right = match (ended.code(), ended.killed_by()) {
        (Some(3), None) => true,
        (None, Some(2)) => at == Bare,
        (Some(0), None) => at == Bare && !is_there,
        _ => false,
    };
    let is_soon = cpu_s <= MOST_CPU_S && wall_s < SILENCE.as_secs_f64();
    if is_right && is_soon && left.is_empty() {
        Ok(told)
    } else {
        Err(format!("{told}: {:?}, {left:?}\n{}", ended.code(), ended.stderr()))
    }
}

/// What [`LONG`] needs.
fn prepare(place: &Place) {
    let (mut manifest, mut states) = lying::run(place);
    fs::remove_file(place.path("run.mcap")).unwrap();
    manifest.physics.step_count = STEPS;
    manifest.provenance.record_every_steps = STEPS;
    let (first, mut last) = (states.remove(0), states.remove(0));
    last.0 = STEPS;
    lying::write(place, "long.mcap", &manifest, &BeginRecord::default(), &[first, last], EndReason::Complete);
    let preset = place.run("preset striker-3g").exits(0).stdout();
    let longer =
        |line: &str| if line.starts_with("duration_s") { "duration_s = 1e7".into() } else { line.to_owned() };
    place.write("run.toml", &preset.lines().map(longer).collect::<Vec<_>>().join("\n"));
    let sweep = "[base]\npreset = \"striker-3g\"\ntime.duration_s = 1e7\n[grid]\nchain.alpha = [1.5, 2.0]\n";
    place.write("sweep.toml", sweep);
    let orbit = place.run("orbit --example").exits(0).stdout();
    let orbit = orbit.split("[continue]").next().unwrap().replace("[orbit]\n", "[orbit]\nsteps = 50000000\n");
    place.write("slow.toml", &orbit);
    place.write("small.toml", &sweep.replace("1e7", "1e-4"));
    place.run("sweep small.toml --out whole --yes").exits(0);
    let loaded = preset.lines().map(|line| if line.starts_with("beads") { "beads = 4000" } else { line });
    let loaded = loaded
        .collect::<Vec<_>>()
        .join("\n")
        .replace("[striker]", "[load]\nprecompression_n = 5.0\n\n[striker]");
    place.write("loaded.toml", &loaded);
    place.run("run loaded.toml --duration 1e-4 --out loaded.mcap --no-publish").exits(0);
    fs::create_dir(place.path("many")).unwrap();
    // some times as long as a look waits for
    for number in 0..12_000 {
        fs::hard_link(place.path("long.mcap"), place.path(format!("many/{number}.mcap"))).unwrap();
    }
}

#[test]
fn every_long_command_ends_at_ctrl_c_with_3() {
    let place = Place::new();
    prepare(&place);
    let paced =
        place.start("run --preset striker-3g --duration 1e4 --name paced --pace 1e-3 --no-record --yes");
    place.wait_for_run("paced", |run| run.step > 0);
    let mut failed = Vec::new();
    for (words, at, files) in LONG {
        match stopped(&place, words, at, files) {
            Ok(told) => println!("{told}"),
            Err(why) => failed.push(why),
        }
    }
    paced.signal("INT");
    paced.wait().exits(3);
    assert!(failed.is_empty(), "{}", failed.join("\n"));
    // nothing hidden is left, either, but what a run or a sweep goes on with
    let names =
        fs::read_dir(place.path(".")).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let hidden: Vec<_> = names.filter(|name| name.starts_with('.')).collect();
    assert!(hidden.is_empty(), "{hidden:?}");
}

/// A command that nobody has thought of here is one that may not end.
#[test]
fn no_command_is_left_out() {
    let help = Place::new().run("--help").exits(0).stdout();
    let commands = help.lines().filter_map(|line| line.strip_prefix("  ")?.split_once("  "));
    let names =
        commands.map(|(name, _)| name).filter(|name| name.bytes().all(|byte| byte.is_ascii_lowercase()));
    let names: Vec<&str> = names.filter(|name| !name.is_empty()).collect();
    assert!(names.len() > 30, "{names:?}");
    let is_known = |name: &&&str| {
        let is_of = |(words, ..): &(&str, At, &[&str])| words.split(' ').next() == Some(**name);
        OTHERS.contains(*name) || LONG.iter().any(is_of)
    };
    let unknown: Vec<_> = names.iter().filter(|name| !is_known(name)).collect();
    assert!(unknown.is_empty(), "add a row to LONG in tests/e2e/ctrl_c.rs for {unknown:?}");
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
