//! A thousand connections of each kind beside one user, who is answered at once.

use super::{SMALL, Server};
use crate::harness::{Place, Running, SILENCE, wait_until};
use crate::lying;
use recording::BeginRecord;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use schemas::frame::EndReason;
use std::collections::BTreeSet;
use std::fmt::Display;
use std::fs;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::process::Command;
use std::time::Instant;

const CROWD: usize = 1000;
/// Times that the user asks; a busy machine delays some.
const ROUNDS: usize = 5;

/// A recording of which two states are so far apart that the steps between take years to recompute.
fn write_far(place: &Place, name: &str) {
    let (mut manifest, mut states) = lying::run(place);
    manifest.physics.step_count = 1 << 40;
    manifest.provenance.record_every_steps = 1 << 40;
    states.truncate(2);
    states[1].0 = 1 << 40;
    lying::write(place, name, &manifest, &BeginRecord::default(), &states, EndReason::Complete);
    fs::remove_file(place.path("run.mcap")).unwrap();
}

/// This process may have that many connections, and those of other tests.
fn allow_files() {
    let files = getrlimit(Resource::Nofile);
    let current = files.maximum.map_or(1 << 16, |most| most.min(1 << 16));
    setrlimit(Resource::Nofile, Rlimit { current: Some(current), ..files }).unwrap();
}

/// The fastest answers to the user wait for nobody, one after the other; `between` what others do meanwhile.
#[track_caller]
fn is_at_once(server: &Server, who: &str, paths: &[&str], mut between: impl FnMut()) {
    for path in paths {
        let took = (0..ROUNDS).map(|_| {
            between();
            let began = Instant::now();
            assert_eq!(server.get(path, &[("Range", "bytes=0-1023")]).status / 100, 2, "{who}: {path}");
            began.elapsed()
        });
        let mut took: Vec<_> = took.collect();
        took.sort();
        let (fastest, slowest) = (took[0], took[ROUNDS - 1]);
        say(format_args!("{who}: {path:12} {fastest:?} to {slowest:?}"));
        assert!(fastest < SILENCE, "{who}: {path}: {took:?}");
    }
}

/// Not by `println!`, which the test harness hides unless the test fails.
fn say(words: impl Display) {
    std::io::stderr().write_all(format!("{words}\n").as_bytes()).unwrap();
}

/// Names of the server's threads that compute results.
fn computing(running: &Running) -> Vec<String> {
    let tasks = fs::read_dir(format!("/proc/{}/task", running.id())).unwrap().flatten();
    let names = tasks.filter_map(|task| fs::read_to_string(task.path().join("comm")).ok());
    // those that it starts have its name
    let names = names.map(|name| name.trim().to_owned()).filter(|name| name.starts_with("view results"));
    names.collect::<BTreeSet<_>>().into_iter().collect()
}

#[test]
fn a_crowd_keeps_nobody_from_the_page() {
    allow_files();
    let place = Place::new();
    write_far(&place, "far.mcap");
    place.run(&format!("{SMALL} --out small.mcap")).exits(0);
    let server = Server::start(&place, "view .");
    let paths = ["", "list", "recording/1", "results/1"];
    assert_eq!(server.json("list")["entries"][1]["name"], "small.mcap");
    assert_eq!(server.get("results/1", &[]).status, 200);

    let home = format!("/{}/", server.token);
    let host = ("Host", server.host.as_str());
    let connect = || TcpStream::connect(&server.host).unwrap();
    let asking = |path: &str| server.send("GET", path, &[host]);
    let crowd = |one: &dyn Fn() -> TcpStream| (0..CROWD).map(|_| one()).collect::<Vec<_>>();

    let idle = crowd(&connect);
    is_at_once(&server, "silent", &paths, || ());
    drop(idle);
    let mut slow = crowd(&connect);
    let head = format!("GET {home} HTTP/1.1\r\n");
    let mut sent = 0;
    is_at_once(&server, "slow heads", &paths, || {
        // those that were let go of hear of it
        slow.retain_mut(|slow| slow.write_all(&head.as_bytes()[sent..=sent]).is_ok());
        sent += 1;
    });
    drop(slow);
    let strangers = crowd(&|| asking("/"));
    is_at_once(&server, "strangers that read nothing", &paths, || ());
    drop(strangers);
    // more than a connection holds by itself
    let whole = format!("GET {home} HTTP/1.1\r\nHost: {}\r\n\r\n", server.host).repeat(40);
    let known = crowd(&|| {
        let mut stream = connect();
        // it may be let go of before it has asked for all
        let _ = stream.write_all(whole.as_bytes());
        stream
    });
    // what they asked for in one moment is what the machine has to do first
    assert_eq!(server.get("", &[]).status, 200);
    is_at_once(&server, "users that read nothing", &paths, || ());
    drop(known);
    let far = format!("{home}results/0");
    drop(crowd(&|| asking(&far)));
    is_at_once(&server, "long work that was left", &paths, || drop(asking(&far)));
    let waiting = crowd(&|| asking(&far));
    is_at_once(&server, "long work that is waited for", &paths, || ());
    // one for all of them
    wait_until("one computation", || (computing(&server.running) == ["view results/0"]).then_some(()));
    drop(waiting);
    let left = Instant::now();
    wait_until("the end of what nobody waits for", || computing(&server.running).is_empty().then_some(()));
    say(format_args!("left work ends in {:?}", left.elapsed()));
    server.end();
}

#[test]
fn what_one_file_takes_keeps_no_other_file_waiting() {
    let place = Place::new();
    write_far(&place, "a.mcap");
    for name in ["b", "c"] {
        fs::copy(place.path("a.mcap"), place.path(format!("{name}.mcap"))).unwrap();
    }
    place.run(&format!("{SMALL} --out small.mcap")).exits(0);
    let server = Server::start(&place, "view .");
    assert_eq!(server.json("list")["entries"][3]["name"], "small.mcap");
    let host = ("Host", server.host.as_str());
    let load = |file: usize| server.send("GET", &format!("/{}/results/{file}", server.token), &[host]);
    // of each file one computation, for all who ask
    let mut loads: Vec<_> = [0, 1, 2].into_iter().flat_map(|file| [load(file), load(file)]).collect();
    wait_until("all of them", || (computing(&server.running).len() == 3).then_some(()));
    assert!(!server.json("results/3")["pulses"].as_array().unwrap().is_empty());
    // one of two who wait leaves: the work goes on; the other leaves, too: it ends
    drop(loads.drain(..3));
    wait_until("the first one's end", || {
        (computing(&server.running) == ["view results/1", "view results/2"]).then_some(())
    });
    // also where one who has left had asked for more behind it
    let mut last = load(0);
    last.write_all(format!("GET /{}/list HTTP/1.1\r\n", server.token).as_bytes()).unwrap();
    wait_until("the first one again", || (computing(&server.running).len() == 3).then_some(()));
    drop(last);
    wait_until("its end", || (computing(&server.running).len() == 2).then_some(()));
    // who comes again is computed for again
    loads.push(load(0));
    wait_until("the first one again", || (computing(&server.running).len() == 3).then_some(()));
    // Ctrl-C ends all of it
    server.end();
}

#[test]
fn viewers_that_say_nothing_make_way_for_others() {
    allow_files();
    let place = Place::new();
    let run = place.start(&format!("{SMALL} --no-record --wait-for 1 --json"));
    place.wait_for_run("small", |_| true);
    let server = Server::start(&place, "view");
    let origin = format!("http://{}", server.host);
    let headers = [&[("Origin", origin.as_str())], &server.upgrade()[..]].concat();
    let path = format!("/{}/live/small", server.token);
    let silent: Vec<_> = (0..CROWD).map(|_| server.send("GET", &path, &headers)).collect();
    is_at_once(&server, "silent viewers", &["", "list"], || ());
    let mut viewer = server.viewer("small");
    viewer.receive();
    drop((silent, viewer));
    run.signal("INT");
    run.wait();
    server.end();
}

/// Where the system grants few files, connections of strangers go, and the user's come.
#[test]
fn too_few_files_are_no_end() {
    let place = Place::new();
    place.run(&format!("{SMALL} --out small.mcap")).exits(0);
    let mut command = Command::new("sh");
    let program = env!("CARGO_BIN_EXE_beadline");
    command.args(["-c", "ulimit -n 32 && exec \"$0\" view ."]).arg(program).current_dir(place.path("."));
    command.env("BEADLINE_ROOT", place.path("bus"));
    let server = Server::of(Running::start("view with few files", command), "view with few files");
    assert_eq!(server.json("list")["entries"][0]["name"], "small.mcap");
    let strangers: Vec<_> = (0..100).map(|_| TcpStream::connect(&server.host).unwrap()).collect();
    is_at_once(&server, "few files", &["", "list", "recording/0"], || ());
    drop(strangers);
    server.end();
}

/// One who never shows the token is answered once.
#[test]
fn a_stranger_is_let_go_of_after_an_answer() {
    let place = Place::new();
    fs::write(place.path("a.mcap"), "no").unwrap();
    let server = Server::start(&place, "view .");
    let mut stranger = server.send("GET", "/", &[("Host", &server.host)]);
    let mut answer = String::new();
    stranger.read_to_string(&mut answer).unwrap();
    assert!(answer.starts_with("HTTP/1.1 404") && answer.contains("connection: close"), "{answer}");
    server.end();
}
