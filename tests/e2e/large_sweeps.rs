//! Sweeps of many points: begun at once, in memory that has nothing to do with their number, to the same bytes.

use crate::harness::{Place, Running, wait_until};
use std::fs::{self, File};
use std::io::{BufRead, BufReader};

/// More points than were once in memory, each of a few steps.
const LARGE: &str = "\
[base]
preset = \"homogeneous\"
chain.beads = 4
time.duration_s = 3e-6
[grid]
\"striker.velocity_m_s\" = { from = 1.0, to = 2.0, count = 100001 }
";

/// Ten million points.
const LARGEST: &str = "\
seeds = { from = 0, count = 1000 }
[base]
preset = \"homogeneous\"
chain.beads = 4
disorder = [{ of = \"masses\", uniform = 0.1 }]
time.duration_s = 3e-6
[grid]
\"striker.velocity_m_s\" = { from = 1.0, to = 2.0, count = 10000 }
";

/// Memory (kB) that a process may write: a tenth of the rows of the large sweep do not fit beside a program.
const MEMORY_KB: u32 = 120_000;

fn place(sweep: &str) -> Place {
    let place = Place::new();
    place.write("s.toml", sweep);
    place
}

/// `beadline WORDS` with no more than [`MEMORY_KB`].
fn start(place: &Place, words: &str) -> Running {
    let limited = format!("ulimit -d {MEMORY_KB}; exec \"$0\" {words}");
    let command = place.foreign("sh", ["-c", &limited, env!("CARGO_BIN_EXE_beadline")]);
    Running::start(words, command)
}

fn wait_for_rows(place: &Place, journal: &str, count: usize) {
    let journal = place.path(journal);
    let lines = || Some(BufReader::new(File::open(&journal).ok()?).lines().count());
    wait_until("rows", || lines().filter(|lines| *lines > count));
}

#[test]
fn many_points_are_interrupted_resumed_and_shared_out_to_the_same_bytes() {
    let place = place(LARGE);
    let first = start(&place, "sweep s.toml --out one --jobs 2 --json");
    wait_for_rows(&place, "one/rows/0-of-1.rows", 10_000);
    first.signal("TERM");
    let kept = first.wait().exits(3).json()["rows"].as_u64().unwrap();
    assert!(kept >= 10_000, "{kept}");
    let rest = start(&place, "sweep s.toml --out one --jobs 2 --json").wait().exits(0).json();
    assert_eq!((rest["computed"].as_u64(), rest["rows"].as_u64()), (Some(100_001 - kept), Some(100_001)));
    for shard in [2, 0, 1] {
        start(&place, &format!("sweep s.toml --out three --shard {shard}/3 --jobs 2")).wait().exits(0);
    }
    for file in ["results.csv", "results.parquet"] {
        let [one, three] = ["one", "three"].map(|dir| fs::read(place.path(dir).join(file)).unwrap());
        assert!(one == three, "{file}");
    }
    assert_eq!(place.read("one/results.csv").lines().count(), 100_002);
    // a journal for each shard, and what is merged
    assert_eq!(fs::read_dir(place.path("three/rows")).unwrap().count(), 3);
    assert_eq!(fs::read_dir(place.path("three")).unwrap().count(), 6);
}

/// The first point of ten million is computed as soon as that of ten, and what is there can be merged meanwhile.
#[test]
fn ten_million_points_begin_at_once() {
    let place = place(LARGEST);
    let sweep = start(&place, "sweep s.toml --out dir --shard 7/1000 --jobs 1 --yes --json");
    wait_for_rows(&place, "dir/rows/7-of-1000.rows", 100);
    let merged = start(&place, "sweep s.toml --out dir --merge --json").wait().exits(3).json();
    sweep.signal("TERM");
    // the shard may have been faster
    let ended = sweep.wait();
    let rows = |json: &serde_json::Value| json["rows"].as_u64().unwrap();
    assert!((100..=rows(&ended.json())).contains(&rows(&merged)), "{merged}");
    let table = place.read("dir/results.csv");
    let mut indices =
        table.lines().skip(1).map(|line| line.split(',').next().unwrap().parse::<u64>().unwrap());
    assert!(indices.by_ref().take(100).eq((0..100).map(|i| 7 + 1000 * i)), "in order");
    place.write("s.toml", &LARGEST.replace("count = 10000", "count = 10001"));
    place.run("sweep s.toml --out dir").exits(2).says(&["10001000 points", "several sweeps"]);
}

#[test]
fn a_plan_says_what_a_sweep_will_take() {
    let place = place(LARGEST);
    let plan = start(&place, "sweep s.toml --plan --cores 1000 --json").wait().exits(0).json();
    assert_eq!(plan["points"], 10_000_000);
    let point = |place: usize| plan["point_s"][place].as_f64().unwrap();
    assert!(point(0) <= point(1) && point(1) <= point(2));
    let bytes = |kind: &str| plan["bytes"][kind].as_f64().unwrap();
    assert!(bytes("journal") > bytes("csv") && bytes("csv") > bytes("parquet"), "{plan}");
    let on = plan["on"].as_array().unwrap();
    assert!(on.iter().any(|on| on["cores"] == 1000 && on["shards"].as_u64() <= Some(1000)), "{plan}");
    assert!(!plan["limits"].as_array().unwrap().is_empty());
    let words = place.run("sweep s.toml --plan").exits(0).stdout();
    for part in ["points", "core-hours", "on 10,000 cores", "first limit", "several sweeps"] {
        assert!(words.contains(part), "`{part}` is not in {words}");
    }
    assert_eq!(fs::read_dir(place.path(".")).unwrap().count(), 1, "nothing is left");
    // what takes too long is given up
    place.write("s.toml", "[base]\npreset = \"homogeneous\"\ntime.duration_s = 1e6\n");
    let plan = place.run("sweep s.toml --plan --json").exits(0).json();
    assert!(plan["core_hours"].as_f64().unwrap() > 1.0, "{plan}");
}

#[test]
fn many_points_are_not_recorded() {
    let place = place(LARGE);
    let refused = ["a file for each of 100,001 points", "10,000"];
    place.run("sweep s.toml --out dir --record").exits(2).says(&refused);
    place.write("s.toml", &format!("record = true\n{LARGE}"));
    place.run("sweep s.toml --out dir").exits(2).says(&refused);
    assert!(!place.path("dir").exists());
}

/// Statistics over the first key of a grid need the rows in another order than that of the results.
#[test]
fn statistics_over_far_points_are_those_of_their_rows() {
    let text = LARGE.replace("count = 100001", "count = 1500");
    let text = text.replace(
        "[grid]\n",
        "disorder = [{ of = \"masses\", uniform = 0.1 }]\n[grid]\nseed = { from = 0, to = 69, count = 70 }\n",
    );
    let place = place(&text);
    place.run("sweep s.toml --out dir --jobs 2").exits(0);
    let found = place.read("dir/ensemble.csv");
    let lines: Vec<Vec<&str>> = found.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(lines.len(), 1501);
    let column = |name: &str| lines[0].iter().position(|column| *column == name).unwrap();
    let (velocity, count, mean) = (column("striker.velocity_m_s"), column("count"), column("mean_steps"));
    for (group, line) in lines[1..].iter().enumerate() {
        assert_eq!((line[0].parse(), line[count]), (Ok(group), "70"));
        assert!(line[mean].parse::<f64>().unwrap() >= 1.0);
    }
    assert!((lines[1][velocity], lines[1500][velocity]) == ("1e0", "2e0"));
}
