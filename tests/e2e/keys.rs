//! Keys on a terminal, and what the terminal shows.

use crate::harness::{Place, Running, skip, wait_until};
use bus::{AttachOptions, Delivery, LiveSource};
use schemas::frame::{EndReason, FrameSource, Received};
use serde_json::Value;
use std::io::Write;
use std::process::{ChildStdin, Stdio};
use std::time::{Duration, Instant};

/// A short recording.
const SHORT: &str = "run --beads 120 --impurity 60=0.6e-3 --duration 2e-3 --name small";

/// A command on a terminal, with a hand on the keys.
struct Terminal {
    running: Running,
    keys: ChildStdin,
}

impl Terminal {
    fn start(place: &Place, words: &str) -> Self {
        Self::of_width(100, place, words)
    }

    fn of_width(columns: usize, place: &Place, words: &str) -> Self {
        let script = format!("{}/tests/python/on_a_terminal.py", env!("CARGO_MANIFEST_DIR"));
        let beadline = env!("CARGO_BIN_EXE_beadline");
        let arguments = [script.as_str(), beadline].into_iter().chain(words.split_whitespace());
        let mut command = place.foreign("python3", arguments);
        command.env("TERMINAL_COLUMNS", columns.to_string());
        let mut running = Running::start_with(words, command, Stdio::piped());
        let keys = running.stdin();
        Self { running, keys }
    }

    fn press(&mut self, keys: &str) {
        self.keys.write_all(keys.as_bytes()).unwrap();
    }

    /// Waits for the end, and asserts the exit code and that the terminal is as it was. The JSON on stdout, if there
    /// is any, is added to what is told.
    #[track_caller]
    fn ends(self, exit: i32) -> Value {
        let ended = self.running.wait().exits(0);
        let said = ended.stderr();
        let mut told: Value = serde_json::from_str(said.lines().last().unwrap()).unwrap();
        told["stdout"] = serde_json::from_str(&ended.stdout()).unwrap_or_default();
        assert_eq!((&told["exit"], &told["restored"]), (&exit.into(), &true.into()), "{told:#}");
        told
    }
}

/// Frames never come by themselves at this rate, so that all that come were asked for.
const BY_HAND: &str = "replay small.mcap --rate 1e-12 --wait-for 0 --json";

fn has_python() -> bool {
    let found = std::process::Command::new("python3").arg("--version").output().is_ok();
    if !found {
        skip("no python3 here, which gives a command a terminal: install it");
    }
    found
}

#[test]
fn keys_pause_step_and_change_the_rate() {
    if !has_python() {
        return;
    }
    let place = Place::new();
    place.run(SHORT).exits(0);
    let mut terminal = Terminal::start(&place, BY_HAND);
    for (key, frame) in [("", 0), (".", 1), ("\x1b[C", 2), (".", 3)] {
        terminal.press(key);
        place.wait_for_run("small", |run| run.frame == Some(frame));
    }
    // consumers can come while it is paused, and get what is next
    let consumer = place.start("energies --json");
    place.wait_for_run("small", |run| run.lossless == 1);
    terminal.press(" ");
    terminal.press(&"+".repeat(50));
    let told = terminal.ends(0);
    let consumer = consumer.wait().exits(0).json();
    assert_eq!((&consumer["first_frame"], &consumer["end"]), (&4.into(), &"complete".into()));
    let screen = told["screen"].as_str().unwrap();
    for word in ["small", "paused", "space pauses", "q quits", "t = "] {
        assert!(screen.contains(word), "`{word}` is not on the screen: {screen}");
    }
}

#[test]
fn the_terminal_is_given_back_on_every_way_out() {
    if !has_python() {
        return;
    }
    let place = Place::new();
    place.run(SHORT).exits(0);
    // q, and Ctrl-C and Ctrl-\ as the terminal turns them into signals
    for (keys, exit) in [("q", 3), (".q", 3), ("\x03", 3), ("\x1c", -3)] {
        let mut terminal = Terminal::start(&place, BY_HAND);
        place.wait_for_run("small", |run| run.is_live() && run.frame == Some(0));
        terminal.press(keys);
        let told = terminal.ends(exit);
        assert_eq!(told["suspended"], Value::Array(Vec::new()));
    }
    for (signal, exit) in [("TERM", 3), ("HUP", 3)] {
        let terminal = Terminal::start(&place, BY_HAND);
        let run = place.wait_for_run("small", |run| run.is_live() && run.frame == Some(0));
        let sent =
            std::process::Command::new("kill").args([format!("-{signal}"), run.pid.to_string()]).status();
        assert!(sent.unwrap().success());
        terminal.ends(exit);
    }
    // Ctrl-Z: the shell gets its terminal, and the replay gets it again
    let mut terminal = Terminal::start(&place, BY_HAND);
    place.wait_for_run("small", |run| run.is_live() && run.frame == Some(0));
    terminal.press("\x1a");
    place.wait_for_run("small", |run| {
        // keys that come while it is suspended are not for it
        terminal.press(".");
        run.frame > Some(2)
    });
    terminal.press("q");
    assert_eq!(terminal.ends(3)["suspended"], serde_json::json!([true]));
    // an error after the terminal was taken
    Terminal::start(&place, "replay small.mcap --from 1").ends(2);
}

/// A run has the keys of a replay. Consumers come while it is paused, and are served.
#[test]
fn a_run_is_paused_and_stepped_by_keys() {
    if !has_python() {
        return;
    }
    let place = Place::new();
    let mut terminal = Terminal::start(&place, &format!("{SHORT} --no-record --pace 1e-12 --yes --json"));
    // a run waits behind a frame: its second one comes at once
    for (key, frame) in [("", 1), (".", 2), ("\x1b[C", 3), (".", 4)] {
        terminal.press(key);
        place.wait_for_run("small", |run| run.frame == Some(frame));
    }
    let consumer = place.start("energies --json");
    place.wait_for_run("small", |run| run.lossless == 1);
    terminal.press(&format!(" {}", "+".repeat(50)));
    let told = terminal.ends(0);
    let consumer = consumer.wait().exits(0).json();
    assert_eq!((&consumer["first_frame"], &consumer["end"]), (&5.into(), &"complete".into()));
    assert!(told["stdout"]["paused_s"].as_f64().unwrap() > 0.0);
    let screen = told["screen"].as_str().unwrap();
    for word in ["small", "paused", "space pauses", "q quits", "step 4"] {
        assert!(screen.contains(word), "`{word}` is not on the screen: {screen}");
    }
    assert!(!screen.contains("jump"), "a run cannot go back");
}

/// What a lossless consumer gets until its stream ends: the stream, the first and the last frame, the end.
fn stream(place: &Place) -> (u64, u64, u64, EndReason) {
    let options = AttachOptions::default();
    let name = "small".parse().unwrap();
    let mut live = LiveSource::attach(&place.bus(), Some(&name), Delivery::Lossless, &options).unwrap();
    let (stream, first) = (live.stream().stream_id, live.first_frame());
    let mut next = first;
    loop {
        match live.receive().unwrap() {
            Received::Frame(frame) => {
                assert_eq!(frame.frame, next, "frames only ever go on in a stream");
                next += 1;
            }
            Received::Missed { from, to } => panic!("{from} to {to} are missed"),
            Received::End(end) => return (stream, first, next.saturating_sub(1), end),
        }
    }
}

/// Back and forth each begin a stream of their own: within one, frames only ever go on, and none is missed.
#[test]
fn a_replay_goes_back_and_forth_in_new_streams() {
    if !has_python() {
        return;
    }
    let place = Place::new();
    place.run(SHORT).exits(0);
    let frames = place.run("info small.mcap --json").exits(0).json()["last_step"].as_u64().unwrap();
    let jump = frames / 20;
    let mut terminal = Terminal::start(&place, BY_HAND);
    let at = |frame: u64| {
        place.wait_for_run("small", |run| run.is_live() && run.frame == Some(frame));
    };
    at(0);
    terminal.press("..");
    at(2);
    let mut streams = Vec::new();
    // on by two twentieths, back by one, one frame back, to the begin
    for (keys, frame) in
        [("]]", 2 + 2 * jump), ("[", 2 + jump), ("\x1b[D", 1 + jump), ("\x1b[H", 0), ("[", 0), ("]", jump)]
    {
        let listener = std::thread::scope(|scope| {
            let listener = scope.spawn(|| stream(&place));
            place.wait_for_run("small", |run| run.lossless == 1);
            terminal.press(keys);
            listener.join().unwrap()
        });
        assert_eq!(listener.3, EndReason::Interrupted, "{keys:?}");
        streams.push(listener.0);
        at(frame);
    }
    // frames are stepped through in the new stream
    terminal.press(".");
    at(jump + 1);
    let mut different = streams.clone();
    different.dedup();
    assert_eq!(different, streams, "a stream id comes twice");
    terminal.press("q");
    let told = terminal.ends(3);
    assert_eq!(told["stdout"]["jumps"], 6);
    assert_eq!(told["stdout"]["loops"], 1);
    let screen = told["screen"].as_str().unwrap();
    assert!(screen.contains("[ ] jump") && screen.contains("← back"), "{screen}");
}

/// Every status line is shown whole: parts that do not fit are left out, never cut.
#[test]
fn no_status_line_is_cut() {
    if !has_python() {
        return;
    }
    for columns in [60, 80, 120] {
        let place = Place::new();
        let name = "a-run-with-a-name-of-more-than-thirty-letters";
        let run = format!(
            "run --preset homogeneous --beads 120 --duration 2e-3 --name {name} --pace 0.004 --out r.mcap --json"
        );
        let terminal = Terminal::of_width(columns, &place, &run);
        let screen = terminal.ends(0)["screen"].as_str().unwrap().to_owned();
        let lines = rows(&screen, columns);
        assert!(lines.iter().any(|line| line.contains("t = ")), "{columns}: {screen}");
        assert!(lines.iter().any(|line| line.starts_with("a-run-")), "{columns}: {screen}");
        for line in lines {
            assert!(line.chars().count() < columns, "{columns} columns: {line:?}");
            let last = line.rsplit(['·', '%']).next().unwrap().trim();
            let is_step = last.starts_with("step ") || last.is_empty();
            let whole = [" s", "ns", "µs", "ms", "/s", "B", "paused", "→ one frame", "pace", "quits"];
            assert!(is_step || whole.iter().any(|end| last.ends_with(end)), "{columns}: {line:?}");
        }
    }
}

/// What stood in the rows of a terminal that are about progress, at any time; a row that is not the last is filled up
/// with spaces.
fn rows(screen: &str, columns: usize) -> Vec<String> {
    let pieces = screen.split(['\n', '\r', '\x1b']);
    let texts = pieces.map(|piece| {
        // what follows an escape is a letter with numbers before it
        let rest =
            piece.strip_prefix('[').map(|rest| rest.trim_start_matches(|c: char| !c.is_ascii_alphabetic()));
        rest.map_or(piece, |rest| rest.get(1..).unwrap_or_default()).chars().collect::<Vec<_>>()
    });
    let rows = texts.flat_map(|text| {
        text.chunks(columns)
            .map(|row| row.iter().collect::<String>().trim_end().to_owned())
            .collect::<Vec<_>>()
    });
    rows.filter(|row| row.contains(" %") || row.contains("space pauses")).collect()
}

/// A process that was suspended is late by seconds of simulated time, and does not race through them.
#[test]
fn a_paced_run_goes_on_at_its_pace_after_it_was_held_up() {
    let held = Duration::from_millis(1500);
    for words in [
        "run --preset homogeneous --beads 120 --duration 2e-3 --name small --no-record --pace 1e-3 --json",
        "replay small.mcap --rate 1e-3 --wait-for 0 --json",
    ] {
        let place = Place::new();
        place.run(SHORT).exits(0);
        let running = place.start(words);
        place.wait_for_run("small", |run| run.step > 10);
        running.signal("STOP");
        let start = Instant::now();
        wait_until("a while", || (start.elapsed() >= held).then_some(()));
        running.signal("CONT");
        let wall_s = running.wait().exits(0).json()["wall_s"].as_f64().unwrap();
        // 2 s at its pace, and 1.5 s in which it stood still, but for the slack of a tenth
        assert!(wall_s >= 3.35, "{words}: {wall_s} s; it caught up");
    }
}
