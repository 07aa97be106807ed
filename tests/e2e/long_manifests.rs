//! Manifests that are longer than the bus has room for in one piece: lists with a number for each bead.

use crate::harness::{Place, Running, wait_until};
use crate::recordings::in_a_namespace;
use std::fmt::Write as _;
use std::fs;

/// A chain of so many beads with a velocity for each: 20 bytes a bead.
fn chain_with_a_list(beads: u32) -> String {
    let mut text = format!(
        "[chain]\nbeads = {beads}\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n\
         [time]\ndt_s = 1e-6\nduration_s = 3e-6\n[initial]\nvelocities_m_s = ["
    );
    for bead in 0..beads {
        // no two are alike, and each has as many digits as a double has
        let _ = write!(text, "{:.17},", 0.1 + 1e-3 * f64::from(bead).sqrt().fract());
    }
    text + "]\n"
}

/// The end of everything that reads such a run, live and from its file.
#[test]
fn a_run_whose_manifest_has_a_number_for_each_bead_goes_all_the_way() {
    let place = Place::new();
    place.write("long.toml", &chain_with_a_list(4000));
    let run = place.start("run long.toml --wait-for 2 --json");
    let energies = place.start("energies live:long --out live.csv --json");
    let recorder = place.start("record live:long --out copy.mcap");
    assert_eq!(run.wait().exits(0).json()["frames_published"], 4);
    assert_eq!(energies.wait().exits(0).json()["frames_received"], 4);
    recorder.wait().exits(0);
    for file in ["long.mcap", "copy.mcap"] {
        place.run(&format!("verify {file}")).exits(0);
        place.run(&format!("energies {file} --out {file}.csv")).exits(0);
        assert_eq!(place.read(&format!("{file}.csv")), place.read("live.csv"));
    }
    let waiting = place.start("replay long.mcap --name again --json");
    place.wait_for_run("again", |run| run.step_count == Some(3));
    let impurity = place.start("impurity live:again --json");
    assert_eq!(impurity.wait().exits(0).json()["frames_received"], 4);
    waiting.wait().exits(0);
    let root = fs::read_dir(place.path("bus")).unwrap().map(|entry| entry.unwrap().file_name());
    let left: Vec<_> = root.filter(|name| name.to_string_lossy().ends_with(".manifest")).collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn the_file_of_a_long_manifest_goes_with_the_next_start_after_a_kill() {
    let place = Place::new();
    place.write("long.toml", &chain_with_a_list(4000));
    let is_there = || {
        let root = fs::read_dir(place.path("bus")).ok()?;
        let mut names = root.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        names.find(|name| name.ends_with(".manifest"))
    };
    let run = place.start("run long.toml --no-record --wait-for 1");
    wait_until("the file of the manifest", is_there);
    run.signal("KILL");
    run.wait();
    place.run("run --preset homogeneous --duration 1e-4 --no-record").exits(0);
    assert_eq!(is_there(), None);
}

/// A manifest of more than 5 MB.
#[test]
fn readers_of_recordings_take_a_manifest_of_megabytes() {
    let place = Place::new();
    place.write("large.toml", &chain_with_a_list(260_000));
    place.run("run large.toml --no-publish").exits(0);
    let info = place.run("info large.mcap --json").exits(0);
    assert!(info.stdout().len() < 100_000_000);
    place.run("verify large.mcap").exits(0);
    place.run("plot large.mcap --what velocity --at 2e-6 --out profile.svg").exits(0);
    let bytes = fs::read(place.path("large.mcap")).unwrap();
    fs::write(place.path("cut.mcap.partial"), &bytes[..bytes.len() * 4 / 5]).unwrap();
    let resumed = place.run("run --resume cut.mcap.partial --no-publish --json").exits(0).json();
    assert_eq!((&resumed["steps"], resumed["first_step"].as_u64() < Some(3)), (&3.into(), true), "{resumed}");
    place.run("verify cut.mcap").exits(0);
}

/// Neither the root nor anything in shared memory is touched.
#[test]
fn a_run_that_is_not_published_needs_no_bus() {
    let place = Place::new();
    let words = "run --preset homogeneous --duration 1e-4 --no-publish --out alone.mcap --json";
    let mut command = place.command(words.split(' '));
    command.env("BEADLINE_ROOT", "/proc/nowhere/bus");
    let ended = Running::start(words, command).wait().exits(0).json();
    assert_eq!((&ended["frames_published"], &ended["end"]), (&0.into(), &"complete".into()));
    place.run("verify alone.mcap").exits(0);
    place.run("run --no-publish --wait-for 1").exits(2).says(&["--no-publish"]);
    let program = env!("CARGO_BIN_EXE_beadline");
    let script = format!(
        "mount -t tmpfs -o size=4k tmpfs /dev/shm && head -c 4096 /dev/zero >/dev/shm/full || exit 100
         BEADLINE_ROOT=/proc/nowhere/bus {program} run --preset homogeneous --duration 1e-4 --no-publish --out full.mcap"
    );
    let Some(ended) = in_a_namespace(&place, &script) else { return };
    ended.exits(0);
    assert!(!place.path("bus").join("creating.lock").exists());
}
