//! Simulate, stream, record, analyse.

use crate::harness::{Place, wait_until};
use bus::{Delivery, ResultReceived, ResultSubscriber};
use schemas::results::Topic;
use std::fs;
use std::sync::Arc;

/// A chain small enough to be quick, with everything that the light-impurity run has.
const SMALL: &str = "run --beads 120 --impurity 60=0.6e-3 --duration 0.012 --name small";

/// The central promise: an analysis gives the same bytes whichever way the frames reach it.
#[test]
fn results_from_the_live_run_and_from_its_recording_are_the_same_bytes() {
    let place = Place::new();
    let run = place.start(&format!("{SMALL} --wait-for 4 --json"));
    let consumers = [
        place.start("energies live:small --out energies-live.csv --json"),
        place.start("impurity --out impurity-live.csv --events events-live.csv --json"),
        place.start("contacts --out contacts-live.csv --out map-live.mcap --json"),
        place.start("pulses --out pulses-live.csv --positions tracks-live.csv --json"),
    ];
    let run = run.wait().exits(0).json();
    let frames = run["frames_published"].as_u64().unwrap();
    assert_eq!(run["frames_recorded"], frames);
    assert_eq!(run["end"], "complete");
    for consumer in consumers {
        let summary = consumer.wait().exits(0).json();
        assert_eq!(summary["frames_received"], frames);
        assert_eq!((summary["frames_missed"].as_u64(), summary["first_frame"].as_u64()), (Some(0), Some(0)));
    }
    place.run("energies small.mcap --out energies-file.csv").exits(0);
    place.run("impurity small.mcap --out impurity-file.csv --events events-file.csv").exits(0);
    place.run("contacts small.mcap --out contacts-file.csv --out map-file.mcap").exits(0);
    place.run("pulses small.mcap --out pulses-file.csv --positions tracks-file.csv").exits(0);
    for table in ["energies", "impurity", "events", "contacts", "pulses", "tracks"] {
        let (live, file) =
            (place.read(&format!("{table}-live.csv")), place.read(&format!("{table}-file.csv")));
        assert!(live == file, "{table}: the two tables differ");
        assert!(live.lines().count() > 3, "{table}: nothing to compare");
        if ["energies", "impurity", "contacts"].contains(&table) {
            assert_eq!(live.lines().count() as u64, frames + 1, "{table}");
        }
    }
    place.run("contacts map-live.mcap --figure a.svg").exits(0);
    place.run("contacts map-file.mcap --figure b.svg").exits(0);
    place.run("contacts small.mcap --figure c.svg").exits(0);
    assert!(place.read("a.svg") == place.read("b.svg") && place.read("a.svg") == place.read("c.svg"));
}

#[test]
fn the_demo_leaves_a_recording_tables_and_figures() {
    let place = Place::new();
    let demo = place.run("demo --out shock").exits(0);
    let text = demo.stdout();
    assert_eq!(text.matches("55,190, 0 missed").count(), 3, "{text}");
    for file in [
        "light-impurity.mcap",
        "light-impurity-sparse.mcap",
        "light-impurity.html",
        "energies.csv",
        "impurity.csv",
        "impurity-events.csv",
        "contacts.csv",
        "contacts.mcap",
        "profiles.svg",
        "profiles.png",
        "energies.svg",
        "energies.png",
        "impurity.svg",
        "impurity.png",
        "contacts.svg",
        "contacts.png",
    ] {
        assert!(fs::metadata(place.path("shock").join(file)).unwrap().len() > 500, "{file}");
        assert!(text.contains(file), "{file} is not in the table");
    }
    place.run("demo --out shock").exits(2).says(&["exists", "--force"]);
}

/// A demo that is told to end takes its processes with it.
#[test]
fn a_stopped_demo_leaves_no_process_behind() {
    let place = Place::new();
    let demo = place.start("demo --out shock");
    place.wait_for_run("light-impurity", |run| run.step > 0);
    demo.signal("TERM");
    demo.wait().exits(3).says(&["stopped"]);
    let runs = bus::list_runs(&place.bus()).unwrap();
    assert!(runs.iter().all(|run| !run.is_live()), "{runs:?}");
}

/// A consumer in another process gets the energies of each frame, as they stand in the table.
#[test]
fn results_are_published_on_the_bus() {
    let place = Place::new();
    let run = place.start(&format!("{SMALL} --no-record --wait-for 2"));
    let energies = place.start("energies --out energies.csv");
    let (bus, name) = (place.bus(), "small".parse().unwrap());
    let attach = || {
        ResultSubscriber::attach(
            &bus,
            &name,
            Topic::results("energies").unwrap(),
            Delivery::Lossless,
            Arc::default(),
        )
    };
    let mut rows = wait_until("energies on the bus", || attach().unwrap());
    let names = "kinetic_j,potential_j,total_j,left_j,split_j,right_j,dissipated_j,relative_drift,inbound_j,corrected_j,driven_j";
    assert_eq!(rows.columns().names, names);
    // the second consumer that the run waits for: it starts when we listen to the results of the first
    let second = place.start("contacts --out contacts.csv");
    let mut published: Vec<(u64, Vec<u64>)> = Vec::new();
    loop {
        match rows.receive().unwrap() {
            ResultReceived::Row(row) => {
                published
                    .push((row.frame, row.values.numbers().iter().map(|value| value.to_bits()).collect()));
            }
            ResultReceived::End(_) => break,
            ResultReceived::Missed { from, to } => panic!("frames {from} to {to} are missing"),
        }
    }
    run.wait().exits(0);
    energies.wait().exits(0);
    second.wait().exits(0);
    let table = place.read("energies.csv");
    let written: Vec<(u64, Vec<u64>)> = table
        .lines()
        .skip(1)
        .map(|line| {
            let fields: Vec<&str> = line.split(',').collect();
            // an empty field is what is published as NaN; as bits, because a NaN equals nothing
            let bits =
                |field: &&str| if field.is_empty() { f64::NAN } else { field.parse().unwrap() }.to_bits();
            (fields[0].parse().unwrap(), fields[3..].iter().map(bits).collect())
        })
        .collect();
    assert!(written == published, "the rows published are not those written");
}

#[test]
fn ls_shows_a_run_while_it_goes() {
    let place = Place::new();
    place.run("ls").exits(0).says(&["no runs"]);
    let run = place.start("run --preset homogeneous --no-record --pace 1e-4");
    let consumer = place.start("energies --latest");
    place.wait_for_run("homogeneous", |run| run.latest == 1 && run.step > 10);
    let listed = place.run("ls --json").exits(0).json();
    assert_eq!(listed[0]["name"], "homogeneous");
    assert_eq!(listed[0]["state"], "running");
    assert_eq!(listed[0]["alive"], true);
    let text = place.run("ls").exits(0).stdout();
    assert!(text.starts_with("NAME") && text.contains("homogeneous") && text.contains("running"), "{text}");
    run.signal("TERM");
    run.wait().exits(3);
    consumer.wait();
}

/// Who listens, how far behind they are, how far the run is and when it ends. A consumer that stands still falls behind
/// until it holds the run back.
#[test]
fn ls_shows_who_listens_and_when_the_run_ends() {
    let place = Place::new();
    let run = place.start("run --preset homogeneous --no-record --pace 2e-4 --wait-for 2");
    let keeps_up = place.start("energies --latest");
    let others = [place.start("energies --no-publish"), place.start("contacts --no-publish")];
    place.wait_for_run("homogeneous", |run| run.step > 100 && run.consumers.len() == 3);
    others[1].signal("STOP");
    let listed = wait_until("the one that stands still holds the run back", || {
        let listed = place.run("ls --json").exits(0).json()[0].clone();
        let stuck = |consumer: &&serde_json::Value| consumer["label"] == "contacts";
        let lag = listed["consumers"].as_array().unwrap().iter().find(stuck)?["lag_frames"].as_u64()?;
        (lag >= 60).then_some(listed)
    });
    let consumers = listed["consumers"].as_array().unwrap();
    let who = |consumer: &serde_json::Value| {
        format!("{} {}", consumer["delivery"].as_str().unwrap(), consumer["label"].as_str().unwrap())
    };
    let found: Vec<String> = consumers.iter().map(who).collect();
    assert_eq!(found, ["latest energies", "lossless contacts", "lossless energies"]);
    assert_eq!(consumers[1]["pid"], others[1].id());
    // its queue, what it holds, and what it took after it had told its place: 14 frames in 0.1 s, if nothing delays it
    let lag = |consumer: usize| consumers[consumer]["lag_frames"].as_u64().unwrap();
    assert!(lag(1) < 100 && lag(2) < 60, "{consumers:?}");
    let (step, steps) = (listed["step"].as_f64().unwrap(), listed["step_count"].as_f64().unwrap());
    assert!(step < steps && listed["ends_in_s"].as_f64().unwrap() > 1.0, "{listed}");
    let text = place.run("ls").exits(0).stdout();
    for word in ["ENDS IN", " % ", " of ", "lossless  contacts", "latest    energies", "frames behind"] {
        assert!(text.contains(word), "`{word}` is not in\n{text}");
    }
    others[1].signal("CONT");
    run.signal("TERM");
    run.wait();
    drop((keeps_up, others));
}

#[test]
fn only_every_kth_step_is_published_or_recorded_and_always_the_last() {
    let place = Place::new();
    let run = place.run(
        "run --preset homogeneous --name sparse --publish-every-steps 10 --record-every-steps 100 --duration 1e-3 --json",
    );
    let run = run.exits(0).json();
    let steps = run["steps"].as_u64().unwrap();
    assert_ne!(steps % 100, 0, "the last step would be recorded anyway");
    assert_eq!(run["frames_published"], steps.div_ceil(10) + 1);
    assert_eq!(run["frames_recorded"], steps.div_ceil(100) + 1);
    place.run("energies sparse.mcap --out e.csv").exits(0);
    let recorded: Vec<u64> = place
        .read("e.csv")
        .lines()
        .skip(1)
        .map(|line| line.split(',').nth(1).unwrap().parse().unwrap())
        .collect();
    let expected: Vec<u64> = (0..steps).step_by(100).chain([steps]).collect();
    assert_eq!(recorded, expected);
}

/// SIGINT and SIGTERM end a run in order: the file is finished, and says that it was interrupted.
#[test]
fn an_interrupted_run_leaves_a_finished_recording() {
    for signal in ["INT", "TERM"] {
        let place = Place::new();
        let run = place.start("run --preset homogeneous --pace 1e-3 --json");
        let consumer = place.start("impurity --out motion.csv --json");
        place.wait_for_run("homogeneous", |run| run.step > 100 && run.lossless == 1);
        run.signal(signal);
        let run = run.wait().exits(3).json();
        assert_eq!(run["end"], "interrupted");
        let info = place.run("info homogeneous.mcap --json").exits(0).json();
        assert_eq!((info["finished"].as_bool(), info["complete"].as_bool()), (Some(true), Some(false)));
        assert_eq!(info["last_step"], run["steps"]);
        assert!(!place.path("homogeneous.mcap.partial").exists());
        let consumer = consumer.wait().exits(0).json();
        assert_eq!(consumer["end"], "interrupted");
        assert_eq!(consumer["last_frame"], run["steps"]);
    }
}

/// A signal to the consumer ends it in order, and the run goes on without it.
#[test]
fn an_interrupted_consumer_keeps_what_it_has() {
    let place = Place::new();
    let run = place.start("run --preset homogeneous --no-record --pace 1e-3");
    let consumer = place.start("energies --out e.csv --figure e.svg --json");
    place.wait_for_run("homogeneous", |run| run.step > 100 && run.lossless == 1);
    consumer.signal("INT");
    let summary = consumer.wait().exits(3).json();
    assert_eq!(summary["end"], "stopped");
    let rows = place.read("e.csv").lines().count() as u64;
    assert_eq!(rows, summary["frames_received"].as_u64().unwrap() + 1);
    assert!(place.path("e.svg").exists());
    place.wait_for_run("homogeneous", |run| run.lossless == 0);
    run.signal("INT");
    run.wait().exits(3);
}

/// `--wait-for` counts lossless consumers that are ready, and nothing is published before.
#[test]
fn a_run_waits_for_the_consumers_it_was_told_to_wait_for() {
    let place = Place::new();
    let mut run = place.start(&format!("{SMALL} --no-record --wait-for 2 --json"));
    let latest = place.start("contacts --latest --json");
    let first = place.start("energies --json");
    place.wait_for_run("small", |run| run.lossless == 1 && run.latest == 1);
    assert!(run.is_running());
    assert_eq!(place.wait_for_run("small", |_| true).state.as_str(), "waiting");
    let second = place.start("impurity --json");
    let frames = run.wait().exits(0).json()["frames_published"].clone();
    for consumer in [first, second] {
        assert_eq!(consumer.wait().exits(0).json()["frames_received"], frames);
    }
    let latest = latest.wait().json();
    let counted = latest["frames_received"].as_u64().unwrap() + latest["frames_missed"].as_u64().unwrap();
    assert_eq!(counted, frames.as_u64().unwrap());
}

/// Stopped while it waits, a run leaves nothing behind, and its consumers end in order.
#[test]
fn a_run_that_is_stopped_before_it_begins_leaves_nothing() {
    let place = Place::new();
    let run = place.start("run --preset homogeneous --wait-for 2");
    let consumer = place.start("energies --json");
    place.wait_for_run("homogeneous", |run| run.lossless == 1);
    run.signal("INT");
    run.wait().exits(3).says(&["before the run began"]);
    assert_eq!(consumer.wait().exits(0).json()["frames_received"], 0);
    assert!(!place.path("homogeneous.mcap").exists() && !place.path("homogeneous.mcap.partial").exists());
}

/// Sparse recordings of interrupted runs end with the last frame that anybody saw, too.
#[test]
fn an_interrupted_sparse_recording_ends_with_the_last_published_frame() {
    let place = Place::new();
    let run = place.start("run --preset homogeneous --record-every-steps 1000 --pace 1e-3 --json");
    place.wait_for_run("homogeneous", |run| run.step > 10);
    run.signal("INT");
    let run = run.wait().exits(3).json();
    let info = place.run("info homogeneous.mcap --json").exits(0).json();
    assert_eq!(info["last_step"], run["steps"]);
}

#[test]
fn every_preset_can_be_printed_edited_and_run() {
    let place = Place::new();
    for line in place.run("presets").exits(0).stdout().lines() {
        let name = line.split_whitespace().next().unwrap();
        let toml = place.run(&format!("preset {name}")).exits(0).stdout();
        let toml: String = toml
            .lines()
            .map(|line| {
                // shorter by two zeros; that of a waveform stands within braces
                match line.strip_prefix("duration_s = ") {
                    Some(duration_s) => {
                        format!("duration_s = {:e}\n", 0.01 * duration_s.parse::<f64>().unwrap())
                    }
                    None => format!("{line}\n"),
                }
            })
            .collect();
        place.write(&format!("{name}.toml"), &toml);
        let run = place.run(&format!("run {name}.toml --json")).exits(0).json();
        assert_eq!(run["run"], name);
        let info = place.run(&format!("info {name}.mcap --json")).exits(0).json();
        assert_eq!(info["run_toml"], toml.as_str());
    }
}

/// As in `beadline presets | head -1`.
#[test]
fn a_reader_that_goes_away_is_no_failure() {
    let place = Place::new();
    let mut presets = place.command(["presets"]).stdout(std::process::Stdio::piped()).spawn().unwrap();
    drop(presets.stdout.take());
    let status = wait_until("presets", || presets.try_wait().unwrap());
    assert_eq!(status.code(), Some(0));
}
