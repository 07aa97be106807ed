//! A recording that is published again is the run, as far as consumers can tell.

use crate::harness::{Place, Running, wait_until};
use crate::lying;
use bus::{AttachOptions, Delivery, LiveSource};
use recording::{BeginRecord, RecordingSource, RecordingWriter, WriteOptions};
use schemas::chain::Chain;
use schemas::frame::{EndReason, FrameSink, FrameSource, Received};
use schemas::manifest::RunManifest;
use std::fs;
use std::time::{Duration, Instant};

/// A chain small enough to be quick, with everything that the light-impurity run has.
const SMALL: &str = "run --beads 120 --impurity 60=0.6e-3 --duration 0.012 --name small";

/// Its beginning, where that is enough.
const SHORT: &str = "run --beads 120 --impurity 60=0.6e-3 --duration 2e-3 --name small";

/// Tables that `analyse` leaves, each for every frame or for what happened between frames.
const TABLES: [&str; 6] = ["energies", "impurity", "events", "contacts", "pulses", "tracks"];

/// Starts all analyses of `source`, with tables that end in `-tag.csv`.
fn analyse(place: &Place, source: &str, tag: &str) -> [Running; 4] {
    [
        place.start(&format!("energies {source} --out energies-{tag}.csv")),
        place.start(&format!("impurity {source} --out impurity-{tag}.csv --events events-{tag}.csv")),
        place.start(&format!("contacts {source} --out contacts-{tag}.csv")),
        place.start(&format!("pulses {source} --out pulses-{tag}.csv --positions tracks-{tag}.csv")),
    ]
}

fn all_exit_0(started: impl IntoIterator<Item = Running>) {
    for running in started {
        running.wait().exits(0);
    }
}

/// The central promise, as result files: live from the start, live by a consumer that came late, a replay of
/// the recording, of a thinned one, also to one that came late, and the file itself.
#[test]
fn live_replay_and_file_give_the_same_results() {
    for every in [1, 7] {
        let place = Place::new();
        let run = place.start(&format!(
            "{SMALL} --publish-every-steps {every} --out full.mcap --wait-for 4 --pace 0.005"
        ));
        let early = analyse(&place, "live", "live");
        place.wait_for_run("small", |run| run.step > 100);
        let late = place.start("energies --from-start --no-publish --out energies-late.csv");
        run.wait().exits(0);
        all_exit_0(early.into_iter().chain([late]));

        let whole = place.start("replay full.mcap --wait-for 4");
        all_exit_0(analyse(&place, "live:small", "replay").into_iter().chain([whole]));

        place.run("thin full.mcap --every-steps 70 --out sparse.mcap").exits(0);
        let sparse = place.start("replay sparse.mcap --wait-for 4 --rate 0.005");
        let early = analyse(&place, "live", "sparse");
        place.wait_for_run("small", |run| run.step > 100);
        let late = place.start("energies --from-start --no-publish --out energies-late-replay.csv");
        all_exit_0(early.into_iter().chain([late, sparse]));

        all_exit_0(analyse(&place, "full.mcap", "file"));
        let mut tags = vec!["replay", "sparse", "file"];
        if every == 1 {
            all_exit_0(analyse(&place, "sparse.mcap --every-step", "sparse-file"));
            tags.push("sparse-file");
        }
        for table in TABLES {
            let live = place.read(&format!("{table}-live.csv"));
            assert!(live.lines().count() > 3, "{table}: nothing to compare");
            for tag in &tags {
                assert!(
                    place.read(&format!("{table}-{tag}.csv")) == live,
                    "{table}: {tag} differs from live"
                );
            }
        }
        for tag in ["late", "late-replay"] {
            let same = place.read(&format!("energies-{tag}.csv")) == place.read("energies-live.csv");
            assert!(same, "energies of the one that came {tag} differ");
        }
    }
}

/// All that a consumer is told.
#[derive(PartialEq)]
struct Told {
    manifest: RunManifest,
    chain: Chain,
    /// Frame, step, and the bits of time, displacements, velocities and extra values.
    frames: Vec<(u64, u64, Vec<u64>)>,
    first_frame: u64,
    end: EndReason,
}

/// Attaches to the run `name`, and reads it to its end.
fn listen(place: &Place, name: &str) -> (Told, u64) {
    let name = name.parse().unwrap();
    let mut live =
        LiveSource::attach(&place.bus(), Some(&name), Delivery::Lossless, &AttachOptions::default()).unwrap();
    let mut frames = Vec::new();
    let end = loop {
        match live.receive().unwrap() {
            Received::Frame(frame) => {
                let values = [&[frame.time_s], frame.u_m, frame.v_m_s, frame.extra].concat();
                frames.push((frame.frame, frame.step, values.iter().map(|value| value.to_bits()).collect()));
            }
            Received::Missed { from, to } => panic!("the frames {from} to {to} did not come"),
            Received::End(reason) => break reason,
        }
    };
    let stream = live.stream();
    assert_eq!(stream.run_id, live.manifest().provenance.run_id);
    let told = Told {
        manifest: live.manifest().clone(),
        chain: live.chain().clone(),
        frames,
        first_frame: live.first_frame(),
        end,
    };
    (told, stream.stream_id)
}

/// The method with values beside displacement and velocity, and frames that are not steps.
#[test]
fn a_consumer_is_told_what_the_run_told_it_but_for_the_stream() {
    let place = Place::new();
    let run = place.start(&format!("{SMALL} --method gear5 --publish-every-steps 5 --wait-for 1"));
    let (original, stream) = listen(&place, "small");
    run.wait().exits(0);
    assert_eq!((original.end, original.first_frame), (EndReason::Complete, 0));

    let replay = place.start("replay small.mcap");
    let (again, other_stream) = listen(&place, "small");
    replay.wait().exits(0).says(&["waiting for 1 lossless consumer", "--wait-for 0"]);
    assert!(again == original, "the replay is not the run");
    assert_ne!(other_stream, stream);

    place.run("thin small.mcap --every-steps 100 --out sparse.mcap").exits(0);
    let replay = place.start("replay sparse.mcap --name other --wait-for 1");
    let (mut sparse, _) = listen(&place, "other");
    replay.wait().exits(0);
    // a thinned recording says of itself that it is one
    assert_eq!(sparse.manifest.provenance.record_every_steps, 100);
    sparse.manifest.provenance.record_every_steps = original.manifest.provenance.record_every_steps;
    sparse.manifest.provenance.name = original.manifest.provenance.name.clone();
    assert!(sparse == original, "the replay of the thinned recording is not the run");
}

#[test]
fn every_step_can_be_a_frame() {
    let place = Place::new();
    place.run(&format!("{SMALL} --publish-every-steps 7 --record-every-steps 70 --out sparse.mcap")).exits(0);
    place.run(&format!("{SMALL} --out full.mcap")).exits(0);
    let replay = place.start("replay sparse.mcap --every-step --json");
    place.run("energies live --out steps.csv").exits(0);
    let replay = replay.wait().exits(0).json();
    place.run("energies full.mcap --out full.csv").exits(0);
    assert!(place.read("steps.csv") == place.read("full.csv"));
    assert_eq!(replay["frames_published"], place.read("full.csv").lines().count() - 1);
}

#[test]
fn each_loop_is_a_whole_stream_of_its_own() {
    let place = Place::new();
    place.run(SHORT).exits(0);
    let replay = place.start("replay small.mcap --loop --json");
    let loops: Vec<_> = (0..3).map(|_| listen(&place, "small")).collect();
    place.wait_for_run("small", |run| run.state.as_str() == "waiting");
    replay.signal("INT");
    assert_eq!(replay.wait().exits(0).json()["loops"], 3);
    for (told, stream) in &loops {
        assert!(*told == loops[0].0 && told.end == EndReason::Complete);
        assert_eq!(loops.iter().filter(|(_, other)| other == stream).count(), 1, "a stream id comes twice");
    }
}

#[test]
fn a_part_has_exactly_its_frames() {
    let place = Place::new();
    place.run(&format!("{SMALL} --publish-every-steps 2 --out full.mcap")).exits(0);
    place.run("thin full.mcap --every-steps 500 --out sparse.mcap").exits(0);
    place.run("energies full.mcap --out e.csv").exits(0);
    let table = place.read("e.csv");
    let time = |frame: usize| table.lines().nth(frame + 1).unwrap().split(',').nth(2).unwrap().to_owned();
    let mut parts = Vec::new();
    for file in ["full.mcap", "sparse.mcap"] {
        let replay = place.start(&format!("replay {file} --from {} --until {}", time(1001), time(1300)));
        let (part, _) = listen(&place, "small");
        let said = replay.wait().exits(0).stdout();
        let until_s: f64 = time(1300).parse().unwrap();
        assert!(said.contains(&format!("until {until_s} s, as asked")), "{said}");
        assert_eq!((part.first_frame, part.end), (1001, EndReason::Interrupted));
        assert!(part.frames.iter().map(|(frame, ..)| *frame).eq(1001..=1300));
        parts.push(part.frames);
    }
    assert!(parts[0] == parts[1], "the part of the thinned recording differs");
    // to the end of the run, it is complete
    let replay = place.start(&format!("replay sparse.mcap --from {}", time(4000)));
    assert_eq!(listen(&place, "small").0.end, EndReason::Complete);
    replay.wait().exits(0);
    place.run("replay full.mcap --from 0.002 --until 0.001").exits(2).says(&["--from 0.002 is after"]);
    place.run("replay full.mcap --from 3").exits(2).says(&["no frame from 3 s", "recorded is 0 s to"]);
    place.run("replay full.mcap --until -1").exits(2).says(&["0 or more"]);
}

/// Simulated time is never ahead of where the rate allows it to be.
#[test]
fn the_rate_is_kept() {
    let place = Place::new();
    place.run(&format!("{SMALL} --publish-every-steps 50")).exits(0);
    let replay = place.start("replay small.mcap --rate 0.02 --from 0.002 --wait-for 1 --json");
    let name = "small".parse().unwrap();
    let start = Instant::now();
    let options = AttachOptions::default();
    let mut live = LiveSource::attach(&place.bus(), Some(&name), Delivery::Lossless, &options).unwrap();
    let (mut first_s, mut last_s) = (None, 0.0);
    while let Received::Frame(frame) = live.receive().unwrap() {
        let since_s = frame.time_s - *first_s.get_or_insert(frame.time_s);
        assert!(since_s / 0.02 <= start.elapsed().as_secs_f64(), "frame {} came too early", frame.frame);
        last_s = since_s;
    }
    assert!(last_s > 0.009);
    assert!(replay.wait().exits(0).json()["wall_s"].as_f64().unwrap() >= last_s / 0.02);
}

/// What was not closed, or is damaged, is published up to there; consumers hear what they would find in the file.
#[test]
fn a_recording_that_is_not_whole_ends_as_a_failed_run() {
    let place = Place::new();
    place.run(&format!("{SMALL} --out whole.mcap")).exits(0);
    let bytes = fs::read(place.path("whole.mcap")).unwrap();
    let two_thirds = bytes.len() / 3 * 2;
    fs::write(place.path("torn.mcap"), &bytes[..two_thirds]).unwrap();
    let mut damaged = bytes.clone();
    damaged[two_thirds] ^= 1;
    fs::write(place.path("damaged.mcap"), &damaged).unwrap();
    for (file, why) in [("torn.mcap", "was not closed"), ("damaged.mcap", "damaged")] {
        let replay = place.start(&format!("replay {file} --json"));
        let consumer = place.start("energies live --out live.csv --force --json");
        let replay = replay.wait().exits(3).says(&[why, "the run failed"]).json();
        let consumer = consumer.wait().exits(3).says(&["the run failed"]).json();
        assert_eq!(consumer["end"], "failed");
        assert_eq!(consumer["frames_received"], replay["frames_published"]);
        place.run(&format!("energies {file} --out file.csv --force")).exits(3);
        assert!(place.read("live.csv") == place.read("file.csv"), "{file}: not the frames of the file");
        assert!(place.read("file.csv").lines().count() > 1000);
    }
    // an interrupted run was ended in order
    let run = place.start(&format!("{SMALL} --out part.mcap --pace 0.002"));
    place.wait_for_run("small", |run| run.step > 100);
    run.signal("INT");
    run.wait().exits(3);
    let replay = place.start("replay part.mcap");
    assert_eq!(listen(&place, "small").0.end, EndReason::Interrupted);
    replay.wait().exits(0);
    // so was a part of a recording, whose run went on
    let (manifest, states) = lying::run(&place);
    for end in [EndReason::Continued, EndReason::Detached] {
        lying::write(&place, "first.mcap", &manifest, &BeginRecord::default(), &states[..3], end);
        let replay = place.start("replay first.mcap");
        assert_eq!(listen(&place, manifest.provenance.name.as_str()).0.end, EndReason::Interrupted);
        replay.wait().exits(0);
    }
    place.write("text.mcap", "something else");
    place.run("replay text.mcap").exits(2);
}

#[test]
fn a_name_that_is_taken_is_an_error() {
    let place = Place::new();
    place.run(SHORT).exits(0);
    let run = place.start(&format!("{SMALL} --no-record --pace 1e-4"));
    place.wait_for_run("small", |run| run.step > 0);
    place.run("replay small.mcap").exits(1).says(&["small is being published already"]);
    place.run("replay small.mcap --name other --wait-for 0").exits(0);
    run.signal("INT");
    run.wait().exits(3);
}

#[test]
fn a_signal_ends_a_replay_in_order() {
    for signal in ["INT", "TERM"] {
        let place = Place::new();
        place.run(SHORT).exits(0);
        let replay = place.start("replay small.mcap --rate 1e-4 --json");
        let consumer = place.start("energies --json");
        place.wait_for_run("small", |run| run.step > 10 && run.lossless == 1);
        replay.signal(signal);
        let replay = replay.wait().exits(3).json();
        let consumer = consumer.wait().exits(0).json();
        assert_eq!((&replay["end"], &consumer["end"]), (&"interrupted".into(), &"interrupted".into()));
        assert_eq!(consumer["last_frame"], replay["last_step"]);
        let waiting = place.start("replay small.mcap --wait-for 2");
        place.wait_for_run("small", |run| run.state.as_str() == "waiting");
        waiting.signal(signal);
        waiting.wait().exits(3).says(&["before the replay began"]);
    }
}

/// Another dynamics cannot be recomputed here, but what it recorded can be published.
#[test]
fn a_recording_of_another_kernel_is_replayed_as_it_is() {
    let place = Place::new();
    place.run(&format!("{SMALL} --publish-every-steps 7")).exits(0);
    let mut source = RecordingSource::open(&place.path("small.mcap")).unwrap();
    let mut manifest = source.manifest().clone();
    manifest.physics.kernel_version = schemas::manifest::KERNEL_VERSION + 1;
    let options = WriteOptions::default();
    let mut writer = RecordingWriter::create(&place.path("other.mcap"), &manifest, "", &options).unwrap();
    while let Received::Frame(frame) = source.receive().unwrap() {
        writer.accept(&frame).unwrap();
    }
    writer.finish(EndReason::Complete).unwrap();
    let replay = place.start("replay other.mcap");
    let (told, _) = listen(&place, "small");
    replay.wait().exits(0);
    assert_eq!((told.end, told.manifest), (EndReason::Complete, manifest));
    place
        .run("replay other.mcap --every-step")
        .exits(3)
        .says(&["kernel version", "does not hold every frame"]);
}

/// The most memory (kB) that a replay of `file` needs, read to its end at least once.
fn peak_memory_kb(place: &Place, file: &str) -> u64 {
    let replay = place.start(&format!("replay {file} --loop --wait-for 0 --rate 0.01"));
    let run = place.wait_for_run("small", |_| true);
    // until the second loop begins
    let step = |run: &bus::RunInfo| run.step;
    let mut furthest = 0;
    wait_until("the second loop", || {
        let now = bus::list_runs(&place.bus()).unwrap().iter().map(step).next()?;
        let again = now < furthest;
        furthest = furthest.max(now);
        again.then_some(())
    });
    let status = fs::read_to_string(format!("/proc/{}/status", run.pid)).unwrap();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    replay.signal("INT");
    replay.wait().exits(0);
    peak.trim().strip_suffix(" kB").unwrap().parse().unwrap()
}

#[test]
fn memory_does_not_grow_with_the_recording() {
    let place = Place::new();
    let run = "run --preset homogeneous --beads 600 --name small --dt 1e-6";
    place.run(&format!("{run} --duration 1e-3 --out small.mcap")).exits(0);
    place.run(&format!("{run} --duration 10e-3 --out large.mcap")).exits(0);
    let large = place.run("info large.mcap --json").exits(0).json();
    assert!(large["uncompressed_bytes"].as_u64().unwrap() > 90_000_000, "{large}");
    let [small_kb, large_kb] = ["small.mcap", "large.mcap"].map(|file| peak_memory_kb(&place, file));
    assert!(
        large_kb < small_kb + 8192,
        "{large_kb} kB for the large recording, {small_kb} kB for the small one"
    );
}

/// Without a terminal there are no keys, and nothing is asked of it.
#[test]
fn a_replay_without_a_terminal_needs_none() {
    let place = Place::new();
    place.run(SHORT).exits(0);
    let start = Instant::now();
    place.run("replay small.mcap --wait-for 0 --rate 0.01").exits(0);
    assert!(start.elapsed() >= Duration::from_millis(99));
}
