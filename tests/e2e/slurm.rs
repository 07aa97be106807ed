//! Sweeps as job arrays, by a real Slurm of two nodes on this machine; and the same by other engines.

mod cluster;

use crate::harness::{Place, wait_until};
use cluster::Cluster;
use serde_json::Value;
use std::fs;

/// 10,000 points of about a millisecond.
const QUICK: &str = "\
[base]
preset = \"homogeneous\"
chain.beads = 10
time.duration_s = 5e-4
[grid]
chain.alpha = { from = 1.4, to = 2.0, count = 100 }
\"striker.velocity_m_s\" = { from = 1.0, to = 5.0, count = 100 }
";

/// Points of some hundredths of a second, more than a test waits for.
const LONG: &str = "\
[base]
preset = \"homogeneous\"
chain.beads = 40
time.duration_s = 0.05
[grid]
chain.alpha = { from = 1.4, to = 2.0, count = 20000 }
";

/// What a task has left of itself: lines of a time, a word and more.
fn trace(place: &Place, dir: &str, shard: &str) -> String {
    fs::read_to_string(place.path(dir).join("slurm").join(format!("{shard}.trace"))).unwrap_or_default()
}

/// Indices of the rows that a shard has in its journal, in their order.
fn rows(place: &Place, dir: &str, shard: &str) -> Vec<u64> {
    let journal = fs::read_to_string(place.path(dir).join("rows").join(format!("{shard}.rows")));
    let journal = journal.unwrap_or_default();
    let whole = journal.split_inclusive('\n').filter(|line| line.ends_with('\n')).skip(1);
    let row = |line: &str| serde_json::from_str::<Value>(&line[9..]).unwrap()["index"].as_u64().unwrap();
    whole.map(row).collect()
}

fn results(place: &Place, dir: &str) -> [Vec<u8>; 2] {
    ["results.csv", "results.parquet"].map(|name| fs::read(place.path(dir).join(name)).unwrap())
}

/// A node dies with all its processes while it computes, and comes back: its tasks begin again, and nobody can tell from the
/// results.
#[test]
fn a_node_that_dies_costs_nothing() {
    let place = Place::new();
    place.write("s.toml", QUICK);
    let Some(mut cluster) = Cluster::start(&place) else { return };
    let refused = cluster.beadline("sweep s.toml --out refused --slurm --submit --partition nowhere");
    refused.exits(1).says(&["sbatch refuses", "invalid partition", "--force"]);

    let words = "sweep s.toml --out all --slurm --array-size 8 --time 10 --mem 50M --submit --json";
    let sent = cluster.beadline(words).exits(0).json();
    assert_eq!((sent["array_size"].as_u64(), sent["job"].as_str()), (Some(8), Some("1")));
    // a task in the middle of its shard, on the node that is going to die
    wait_until("a task on the second node", || {
        (0..8).map(|shard| format!("{shard}-of-8")).find(|shard| {
            let trace = trace(&place, "all", shard);
            trace.ends_with(" two\n") && (20..600).contains(&rows(&place, "all", shard).len())
        })
    });
    cluster.kill_node("two");
    let status = || cluster.beadline("sweep --status all --json").exits(0).json();
    let some = status()["done"].as_u64().unwrap();
    assert!((20..10_000).contains(&some), "{some}");
    // the rows that are there can be merged at any time
    cluster.beadline("sweep --merge all").exits(3).says(&["missing in the results"]);
    wait_until("the dead node to be missed", || cluster.node_state("two").starts_with("down").then_some(()));
    cluster.start_node("two");

    let status = || cluster.beadline("sweep --status all --json").exits(0).json();
    let end = wait_until("all points", || Some(status()).filter(|status| status["done"] == 10_000));
    assert!(end["begun_again"].as_u64().unwrap() >= 1, "{end}");
    assert_eq!((&end["points"], &end["shards"]["done"]), (&10_000.into(), &8.into()));
    cluster.wait_for_empty_queue();
    let nodes: String = (0..8).map(|shard| trace(&place, "all", &format!("{shard}-of-8"))).collect();
    assert!(nodes.contains(" one\n") && nodes.contains(" two\n"), "{nodes}");
    place.run("sweep s.toml --out alone").exits(0);
    assert!(results(&place, "all") == results(&place, "alone"));
}

/// A task that others preempt, or that is out of time, ends in order with every row that it had, and goes on after them.
#[test]
fn a_task_that_is_stopped_goes_on_where_it_was() {
    let place = Place::new();
    place.write("s.toml", LONG);
    let Some(cluster) = Cluster::start(&place) else { return };
    // Slurm looks at limits every 30 s: in this minute it finds that 20 s are left after 10 s at the earliest
    let words = "sweep s.toml --out all --slurm --array-size 4 --time 1 --submit --sbatch=--signal=B:USR1@20";
    cluster.beadline(words).exits(0);
    let shards = ["0-of-4", "1-of-4", "2-of-4", "3-of-4"];
    let status = || cluster.beadline("sweep --status all --json").exits(0).json();
    wait_until("rows of all tasks", || {
        shards.iter().all(|shard| rows(&place, "all", shard).len() > 2).then_some(())
    });
    let running = status();
    assert!(running["rate"].as_f64().is_none_or(|rate| rate > 0.0), "{running}");
    assert_eq!(running["shards"]["running"], 4, "{running}");

    // a job that goes before others takes a node
    let preempted = wait_until("a preempted task", || {
        cluster.run_urgent_job();
        shards.iter().find(|shard| trace(&place, "all", shard).contains(" ended 3"))
    });
    assert!(!trace(&place, "all", preempted).contains("requeued"), "Slurm does that");
    let out_of_time = wait_until("a task that is out of time", || {
        shards.iter().find(|shard| trace(&place, "all", shard).contains(" requeued"))
    });
    for shard in [preempted, out_of_time] {
        let trace = wait_until("its second attempt", || {
            Some(trace(&place, "all", shard)).filter(|trace| trace.matches(" begun ").count() > 1)
        });
        assert!(trace.contains(" ended 3"), "{trace}");
        // what it said when it ended, and what there is of that: no row was lost, none computed twice
        let said = place.read(&format!("all/slurm/{shard}.out"));
        let computed = said.lines().find_map(|line| line.trim().strip_prefix("computed now")).unwrap();
        let computed: usize = computed.trim().replace(',', "").parse().unwrap();
        let second = trace.lines().filter(|line| line.contains(" begun ")).nth(1).unwrap();
        assert_eq!(
            second.split(' ').nth(2),
            Some(&*(computed + 1).to_string()),
            "with the first line, {said}"
        );
        let mut found = rows(&place, "all", shard);
        assert!(found.len() >= computed);
        found.sort_unstable();
        found.dedup();
        assert!(found.len() >= computed, "{shard}");
    }
    assert!(status()["begun_again"].as_u64().unwrap() >= 2);
    cluster.cancel_all();
    let stopped = status();
    // one that Slurm told of its time in this moment has heard two signals, and ended at once
    let ended = ["stopped", "failed"].map(|state| stopped["shards"][state].as_u64().unwrap_or(0));
    assert!(ended[0] >= 2 && ended[0] + ended[1] == 4, "{stopped}");
    assert_eq!(stopped["rate"], Value::Null);
}

#[test]
fn without_slurm_there_is_a_script_to_take_there() {
    let place = Place::new();
    place.write("s.toml", QUICK);
    let words = "sweep s.toml --out all --slurm --array-size 8 --time 2:00:00 --partition long --account me \
                 --cpus 4 --sbatch=--qos=low --sbatch=--exclude=n[1-3]";
    place.run(words).exits(0);
    let script = place.read("all/slurm/array.sh");
    for line in
        ["array=0-7", "time=2:00:00", "partition=long", "account=me", "cpus-per-task=4", "qos=low", "requeue"]
    {
        assert!(script.contains(&format!("#SBATCH --{line}\n")), "{line} is not in:\n{script}");
    }
    place.run(words).exits(0);
    place.run(&format!("{words} --mem 1G")).exits(2).says(&["other options", "--force"]);
    assert_eq!(place.read("all/slurm/array.sh"), script);
    place.run("sweep s.toml --out all --shard 0/800 --jobs 1").exits(0);
    place.run(&format!("{words} --mem 1G --force")).exits(0);
    assert!(place.path("all/rows/0-of-800.rows").exists(), "rows are kept");

    let mut send = place.command(words.split_whitespace().chain(["--mem", "1G", "--submit"]));
    send.env("PATH", "/nowhere");
    let ended = crate::harness::Running::start("--submit", send).wait().exits(1);
    ended.says(&["sbatch is not on this machine", "slurm/array.sh"]);
    place.run("sweep s.toml --out all --submit").exits(2).says(&["--slurm"]);
    place.run("sweep s.toml --out all --slurm --time 1\u{7}").exits(2).says(&["one line"]);
    place.run("sweep s.toml --out all --slurm --time 25h").exits(2).says(&["D-HH:MM:SS; 25h is 1-01:00:00"]);
}

/// Also where no engine leaves traces.
#[test]
fn the_status_tells_what_has_begun_and_what_stands_still() {
    let place = Place::new();
    place.write("s.toml", QUICK);
    place.run("sweep --status .").exits(2).says(&["holds no sweep"]);
    for shard in [2, 3] {
        place.run(&format!("sweep s.toml --out all --shard {shard}/100 --jobs 1")).exits(0);
    }
    let journal = place.path("all/rows/3-of-100.rows");
    let rows = fs::read_to_string(&journal).unwrap();
    let half: Vec<_> = rows.lines().take(51).collect();
    fs::write(&journal, format!("{}\nnot a row\n", half.join("\n"))).unwrap();
    let status = || place.run("sweep --status all --json").exits(0).json();
    let found = status();
    assert_eq!(
        (&found["points"], &found["done"], &found["damaged"]),
        (&10_000.into(), &150.into(), &1.into())
    );
    let shards = serde_json::json!({ "done": 1, "running": 1, "not_begun": 98 });
    assert_eq!((&found["shards"], &found["begun"][0]["shard"]), (&shards, &3.into()));

    let long_ago = std::time::SystemTime::now() - std::time::Duration::from_hours(3);
    let file = fs::File::options().write(true).open(&journal).unwrap();
    file.set_modified(long_ago).unwrap();
    fs::create_dir(place.path("all/slurm")).unwrap();
    let begun = long_ago.duration_since(std::time::UNIX_EPOCH).unwrap().as_secs();
    place.write("all/slurm/3-of-100.trace", &format!("{begun} begun 1 node7\n"));
    let words = place.run("sweep --status all").exits(0).stdout();
    place.run("sweep --merge all").exits(3).says(&["missing in the results: 9,850 points"]);
    assert_eq!(place.read("all/results.csv").lines().count(), 151);
    let still = "3/100: 50 of 100 points, on node7, no row for 3 h";
    assert!(words.contains("stand still") && words.contains(still), "{words}");
}
