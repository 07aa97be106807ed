//! An analysis that is not ours, `examples/own_analysis.rs`: everything that ours can, from one file.

use crate::harness::{Place, Running, skip};
use std::fs;
use std::path::{Path, PathBuf};

const RUN: &str = "run --preset homogeneous --beads 30 --duration 0.0002 --publish-every-steps 10";

/// The example, which `cargo test` builds unless it is told to build this test alone.
pub(crate) fn example() -> Option<PathBuf> {
    let built = Path::new(env!("CARGO_BIN_EXE_beadline")).with_file_name("examples").join("own_analysis");
    if !built.exists() {
        skip("`cargo build --example own_analysis` first");
    }
    Some(built).filter(|built| built.exists())
}

fn start(place: &Place, example: &Path, arguments: &str) -> Running {
    Running::start(arguments, place.foreign(example, arguments.split(' ')))
}

#[test]
fn it_is_listed_and_helped_like_ours() {
    let Some(example) = example() else { return };
    let place = Place::new();
    let help = start(&place, &example, "--help").wait().exits(0).stdout();
    assert!(help.contains("  momentum ") && help.contains("  energies "), "{help}");
    let listed = start(&place, &example, "analyses --json").wait().exits(0).json();
    let mine = listed.as_array().unwrap().iter().find(|one| one["name"] == "momentum").expect("listed");
    assert_eq!(
        (mine["is_ours"].as_bool(), mine["numbers"][1]["name"].as_str()),
        (Some(false), Some("fastest_m_s"))
    );
    let flags = start(&place, &example, "momentum --help").wait().exits(0).stdout();
    assert!(flags.contains("--no-publish") && flags.contains("--figure"), "{flags}");
}

/// Live, from the file and in a sweep the numbers are the same; its rows are recorded beside ours.
#[test]
fn it_runs_live_on_files_and_in_sweeps() {
    let Some(example) = example() else { return };
    let place = Place::new();
    let run = place.start(&format!("{RUN} --name mine --wait-for 2 --no-record"));
    let recorder = place.start("record live:mine --out r.mcap");
    let live = start(&place, &example, "momentum live:mine --out live.csv --figure live.svg --json");
    run.wait().exits(0);
    let live = live.wait().exits(0).json();
    recorder.wait().exits(0);
    let file = start(&place, &example, "momentum r.mcap --out file.csv --json").wait().exits(0).json();
    assert_eq!(live["results"], file["results"]);
    assert_eq!(fs::read(place.path("live.csv")).unwrap(), fs::read(place.path("file.csv")).unwrap());
    let info = place.run("info r.mcap --json").exits(0).json();
    assert!(info.to_string().contains("/own/momentum"), "{info}");
    assert!(fs::read_to_string(place.path("live.svg")).unwrap().contains("<svg"));

    let sweep = "measure = [\"momentum.momentum_n_s\"]\n[base]\npreset = \"homogeneous\"\nchain.beads = 30\n\
                 time.duration_s = 0.0002\nstream.publish_every_steps = 10\n[grid]\n\"chain.alpha\" = [1.5]\n";
    fs::write(place.path("s.toml"), sweep).unwrap();
    start(&place, &example, "sweep s.toml --out all --yes").wait().exits(0);
    let rows = fs::read_to_string(place.path("all/results.csv")).unwrap();
    let mut lines = rows.lines();
    let column = lines.next().unwrap().split(',').position(|name| name == "momentum.momentum_n_s").unwrap();
    let swept: f64 = lines.next().unwrap().split(',').nth(column).unwrap().parse().unwrap();
    assert_eq!(Some(swept), file["results"]["momentum_n_s"].as_f64());
}
