//! Processes that die, names that are taken, memory that is full.

use crate::harness::Place;
use crate::recordings::in_a_namespace;

const PACED: &str = "run --preset homogeneous --name paced --pace 2e-3";

/// The run goes on without a lossless consumer that was killed, whether it was being waited for or not.
#[test]
fn a_killed_consumer_does_not_stop_the_run() {
    let place = Place::new();
    // as fast as it can, so that the producer soon waits for the one that is stopped
    let run =
        place.start("run --preset homogeneous --duration 0.1 --name run --no-record --wait-for 2 --json");
    let killed = place.start("energies");
    let other = place.start("contacts --json");
    place.wait_for_run("run", |run| run.step > 0);
    killed.signal("STOP");
    killed.signal("KILL");
    let run = run.wait().exits(0).json();
    assert_eq!(run["end"], "complete");
    let other = other.wait().exits(0).json();
    assert_eq!((&other["frames_received"], &other["frames_missed"]), (&run["frames_published"], &0.into()));
}

/// Consumers of a producer that was killed notice, keep what they have, and exit with 3; the next run
/// of that name starts as if nothing had been.
#[test]
fn a_killed_producer_is_noticed_and_succeeded() {
    let place = Place::new();
    let run = place.start(PACED);
    let energies = place.start("energies --out energies.csv --json");
    let latest = place.start("impurity --latest --json");
    place.wait_for_run("paced", |run| run.step > 200 && run.lossless == 1 && run.latest == 1);
    run.signal("KILL");
    let summary = energies.wait().exits(3).says(&["producer", "gone"]).json();
    assert_eq!(summary["end"], "producer lost");
    let rows = place.read("energies.csv").lines().count() as u64 - 1;
    assert_eq!(rows, summary["frames_received"].as_u64().unwrap());
    assert!(rows > 0);
    latest.wait().exits(3);
    run.wait();

    let next =
        place.start("run --preset homogeneous --name paced --duration 2e-3 --no-record --wait-for 1 --json");
    let consumer = place.start("energies live:paced --json");
    let frames = next.wait().exits(0).json()["frames_published"].clone();
    assert_eq!(consumer.wait().exits(0).json()["frames_received"], frames);
    assert!(place.path("paced.mcap.partial").exists(), "the killed run's recording is kept");
}

/// The next run of a name starts cleanly even while a consumer of the killed one is still attached.
#[test]
fn a_name_is_free_again_while_old_consumers_are_still_there() {
    let place = Place::new();
    let run = place.start(&format!("{PACED} --no-record"));
    let stopped = place.start("energies --json");
    place.wait_for_run("paced", |run| run.step > 10 && run.lossless == 1);
    stopped.signal("STOP");
    run.signal("KILL");
    run.wait();
    let next =
        place.start("run --preset homogeneous --name paced --duration 2e-3 --no-record --wait-for 1 --json");
    let consumer = place.start("contacts live:paced --json");
    let frames = next.wait().exits(0).json()["frames_published"].clone();
    let consumer = consumer.wait().exits(0).json();
    assert_eq!(consumer["frames_received"], frames);
    stopped.signal("CONT");
    let stopped = stopped.wait().exits(3).json();
    assert_ne!(stopped["run_id"], consumer["run_id"], "two runs were mixed");
}

#[test]
fn a_run_does_not_wait_for_more_consumers_than_can_attach() {
    let place = Place::new();
    place.run("run --wait-for 100").exits(2).says(&["--wait-for 100", "at most"]);
    assert!(!place.path("light-impurity.mcap.partial").exists());
}

#[test]
fn a_second_producer_of_the_same_name_is_refused() {
    let place = Place::new();
    let run = place.start(&format!("{PACED} --no-record"));
    let first = place.wait_for_run("paced", |run| run.step > 0);
    let id = first.run_id.to_string();
    place.run("run --preset homogeneous --name paced --out second.mcap").exits(1).says(&[
        "paced",
        &id,
        "another name",
    ]);
    assert!(!place.path("second.mcap").exists() && !place.path("second.mcap.partial").exists());
    run.signal("INT");
    run.wait().exits(3);
}

#[test]
fn a_consumer_with_nothing_to_attach_to_waits_with_a_notice_or_gives_up() {
    let place = Place::new();
    place.run("energies --timeout 0.2").exits(1).says(&["waiting for a run", "beadline run"]);
    place.run("energies live:later --timeout 0.2").exits(1).says(&["later"]);
    let consumer = place.start("energies live:later --json");
    let run = place.start("run --preset homogeneous --duration 1e-3 --no-record --name later --wait-for 1");
    run.wait().exits(0);
    assert_eq!(consumer.wait().exits(0).json()["frames_missed"], 0);
}

#[test]
fn with_several_runs_one_must_be_named() {
    let place = Place::new();
    let runs = ["one", "two"]
        .map(|name| place.start(&format!("run --preset homogeneous --no-record --pace 1e-4 --name {name}")));
    place.wait_for_run("one", |_| true);
    place.wait_for_run("two", |_| true);
    place.run("energies").exits(2).says(&["one", "two", "live:NAME"]);
    for run in runs {
        run.signal("INT");
        run.wait().exits(3);
    }
}

/// A stalled consumer that asked for the latest frames neither holds the run back nor disturbs one that
/// asked for all of them, and in the end says how many it missed.
#[test]
fn a_stalled_latest_consumer_harms_nobody() {
    let place = Place::new();
    let run =
        place.start("run --preset homogeneous --duration 0.05 --name run --no-record --wait-for 2 --json");
    let latest = place.start("energies --latest --json");
    place.wait_for_run("run", |run| run.latest == 1);
    let lossless = place.start("impurity --json");
    place.wait_for_run("run", |run| run.lossless == 1);
    latest.signal("STOP");
    // the second one that the run waits for: it starts with the latest one already stalled
    let second = place.start("contacts --json");
    let run = run.wait().exits(0).json();
    let frames = run["frames_published"].as_u64().unwrap();
    for consumer in [lossless, second] {
        let summary = consumer.wait().exits(0).json();
        assert_eq!(
            (summary["frames_received"].as_u64(), summary["frames_missed"].as_u64()),
            (Some(frames), Some(0))
        );
    }
    latest.signal("CONT");
    let summary = latest.wait().exits(3).says(&["did not arrive"]).json();
    let (received, missed) =
        (summary["frames_received"].as_u64().unwrap(), summary["frames_missed"].as_u64().unwrap());
    assert!(missed > frames / 2, "{summary}");
    assert_eq!(received + missed, frames);
}

/// A lossless consumer that lives but takes nothing is dropped after the stated time, loudly on both sides. A recorder
/// of its rows says which ones never came.
#[test]
fn a_stuck_lossless_consumer_is_dropped() {
    let place = Place::new();
    let words = "run --preset homogeneous --duration 0.1 --name run --no-record --wait-for 2 --stall-timeout 1 --json";
    let run = place.start(words);
    let stuck = place.start("energies --out e.csv --json");
    let recorder = place.start("record --out run.mcap --record-every-steps 1000 --json");
    // more frames than wait for a consumer, so that the first rows are out
    place.wait_for_run("run", |run| run.step > 200);
    stuck.signal("STOP");
    let run = run.wait().exits(3).says(&["energies", "dropped"]).json();
    assert_eq!(run["end"], "complete");
    assert!(run["consumers_dropped"][0].as_str().unwrap().contains("energies"), "{run}");
    stuck.signal("CONT");
    let summary = stuck.wait().exits(3).says(&["dropped"]).json();
    assert_eq!(summary["end"], "dropped");
    let recorded = recorder.wait().exits(3).says(&["energies: no rows of frames"]).json();
    let (rows, last) = (&recorded["results"]["energies"], recorded["last_frame"].as_u64().unwrap());
    assert_eq!(rows["missed"], serde_json::json!([[rows["rows"], last]]), "{rows}");
}

/// A stop while a consumer holds the run back: an orderly end, with everything that anybody got recorded.
#[test]
fn a_stop_while_a_consumer_holds_the_run_back_is_orderly() {
    let place = Place::new();
    let run = place.start(
        "run --preset homogeneous --duration 1 --name run --record-every-steps 1000000 --wait-for 1 --json",
    );
    let consumer = place.start("energies --json");
    place.wait_for_run("run", |run| run.step > 0);
    consumer.signal("STOP");
    // held back when the step no longer changes from one look to the next, some looks long
    let (mut last, mut same) = (0, 0);
    place.wait_for_run("run", |run| {
        same = if run.step == last { same + 1 } else { 0 };
        last = run.step;
        same > 100
    });
    run.signal("INT");
    let run = run.wait().exits(3).json();
    assert_eq!(run["end"], "interrupted");
    consumer.signal("CONT");
    let consumer = consumer.wait().exits(0).json();
    let info = place.run("info run.mcap --json").exits(0).json();
    assert!(info["last_step"].as_u64() >= consumer["last_frame"].as_u64(), "{info} {consumer}");
}

/// A frame may take long to compute: the run still ends when it is told to.
#[test]
fn a_stop_between_two_frames_is_obeyed() {
    let place = Place::new();
    let run = place.start(
        "run --preset homogeneous --duration 1e6 --name run --publish-every-steps 1000000000 --json --yes",
    );
    place.wait_for_run("run", |run| run.frame == Some(0));
    run.signal("INT");
    let run = run.wait().exits(3).json();
    assert_eq!((run["end"].as_str(), run["steps"].as_u64()), (Some("interrupted"), Some(0)));
    place.run("info run.mcap").exits(0);
}

/// A run that shared memory cannot hold is refused with what it needs, what there is, and what to do.
#[test]
fn a_full_dev_shm_is_a_clear_error() {
    let place = Place::new();
    let program = env!("CARGO_BIN_EXE_beadline");
    let script = format!("mount -t tmpfs -o size=1m tmpfs /dev/shm && exec {program} run --no-record");
    let Some(ended) = in_a_namespace(&place, &script) else { return };
    ended.exits(1).says(&["/dev/shm", "free", "fewer beads"]);
}
