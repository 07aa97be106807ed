//! Both sides leave soon: when a run is over, and at Ctrl-C.

use super::bounds::{Run, end};
use super::strangers::{near_that, request, send, stranger};
use super::{Hosts, LONG, SMALL, is_relayed};
use crate::ctrl_c::wait_for_handler;
use crate::harness::{Ended, Running, SILENCE, wait_until};
use ::relay::message::{FramesMessage, RowsHead, RowsMessage, Versions, Welcome, to_json};
use ::relay::wire::zenoh::query::Query;
use ::relay::wire::zenoh::{Session, Wait as _};
use producer::state::ChainState;
use schemas::manifest::RunManifest;
use schemas::presets::PRESETS;
use std::net::TcpListener;
use std::sync::mpsc::{Receiver, channel};
use std::time::Instant;

/// Asserts that Ctrl-C ends a side soon, before it is done.
#[track_caller]
fn ends_at_ctrl_c(phase: &str, side: Running) {
    assert_eq!(ended_at_ctrl_c(phase, side).code(), Some(3), "{phase}");
}

/// Asserts that Ctrl-C ends a side soon.
#[track_caller]
fn ended_at_ctrl_c(phase: &str, side: Running) -> Ended {
    wait_for_handler(&side);
    side.signal("INT");
    let start = Instant::now();
    let ended = side.wait();
    let took = start.elapsed();
    assert!(took < SILENCE, "{phase}: {took:?}\n{}", ended.stderr());
    ended
}

#[test]
fn a_far_side_ends_with_its_run() {
    let hosts = Hosts::new();
    let [running, near, far] = hosts.relay(SMALL, "", "--wait-for 1");
    let words = "energies live:shock --out t.csv";
    let (there, here) = (hosts.far(words), hosts.near(words));
    for process in [here, running, there] {
        process.wait().exits(0);
    }
    let start = Instant::now();
    far.wait().exits(0);
    near.wait().exits(0);
    let took = start.elapsed();
    assert!(took < SILENCE, "{took:?}");
}

/// A near side that answers by `answer`, and tells of each question.
fn near_side(
    port: u16,
    answer: impl Fn(Query) -> Option<Query> + Send + Sync + 'static,
) -> (Session, Receiver<()>) {
    let session = stranger("listen/endpoints", port);
    let (asked, asking) = channel();
    let kept = std::sync::Mutex::new(Vec::new());
    let answer = move |query: Query| {
        kept.lock().unwrap().extend(answer(query));
        let _ = asked.send(());
    };
    session.declare_queryable("beadline/relay/any").callback(answer).background().wait().unwrap();
    (session, asking)
}

#[test]
fn ctrl_c_ends_a_far_side_that_connects_or_waits() {
    let hosts = Hosts::on_loopback();
    ends_at_ctrl_c("nobody listens", hosts.relay_to(""));

    let listener = TcpListener::bind(("127.0.0.1", hosts.port)).unwrap();
    let far = hosts.relay_to("");
    // the first one only looks whether anybody listens
    let silent = [listener.accept().unwrap(), listener.accept().unwrap()];
    ends_at_ctrl_c("what listens says nothing", far);
    drop((listener, silent));

    let hosts = Hosts::on_loopback();
    let (session, asking) = near_side(hosts.port, Some);
    let far = hosts.relay_to("");
    asking.recv().unwrap();
    ends_at_ctrl_c("nobody answers", far);
    session.close().wait().unwrap();

    let hosts = Hosts::on_loopback();
    let none = to_json(&Welcome { versions: Versions::OURS, run: None });
    let (session, asking) = near_side(hosts.port, move |query| {
        query.reply("beadline/relay/any", none.clone()).wait().unwrap();
        None
    });
    let far = hosts.relay_to("");
    asking.recv().unwrap();
    ends_at_ctrl_c("there is no run", far);
    session.close().wait().unwrap();
}

/// A far side of a near side that sends these messages again and again with new numbers, once it has asked for them.
fn far_of(hosts: &Hosts, manifest: &RunManifest, messages: Vec<Vec<u8>>, flags: &str) -> (Session, Running) {
    let (asked, asking) = channel();
    let session = near_that(hosts.port, Versions::OURS, manifest, move |query, _, have| {
        let message = messages.get(usize::try_from(have.seq).unwrap()).or(messages.last());
        if let Some(message) = message {
            send(query, have.seq + 1, 0, message.clone());
        }
        let _ = asked.send(());
    });
    let far = hosts.relay_to(flags);
    asking.recv().unwrap();
    (session, far)
}

#[test]
fn ctrl_c_ends_a_far_side_that_was_welcomed() {
    let mut run = Run::new();
    let first = run.state(0);
    let head = RowsHead {
        topic: "own/mine".to_owned(),
        width: 1,
        names: "a_m".to_owned(),
        tolerance_m: None,
        ended: None,
    };
    let rows = RowsMessage::default().finish(&head);
    for (phase, messages) in [
        ("nothing comes", vec![]),
        ("rows come, and no state", vec![rows.clone()]),
        ("a state, and rows", vec![first.clone(), rows]),
    ] {
        let hosts = Hosts::on_loopback();
        let (session, far) = far_of(&hosts, &run.manifest, messages, "");
        ends_at_ctrl_c(phase, far);
        session.close().wait().unwrap();
    }
    let hosts = Hosts::on_loopback();
    let (session, far) = far_of(&hosts, &run.manifest, vec![first.clone()], "--wait-for 1");
    hosts.far.wait_for_run("shock", |_| true);
    ends_at_ctrl_c("it waits for a consumer", far);
    session.close().wait().unwrap();

    // the near side never says that it knows of the end
    let hosts = Hosts::on_loopback();
    let messages = vec![first.clone(), end("interrupted", Some(0))];
    let (session, far) = far_of(&hosts, &run.manifest, messages, "--wait-for 1");
    hosts.far("energies live:shock --out there.csv").wait();
    ended_at_ctrl_c("it leaves", far).exits(0);
    session.close().wait().unwrap();

    // frames that are years apart
    let mut config = PRESETS[0].config();
    (config.chain.beads, config.time.duration_s) = (100, 1e6);
    config.chain.impurities.clear();
    config.name = Some("shock".to_owned());
    config.time.dt_s = Some(1e-6);
    (config.stream.publish_every_steps, config.stream.record_every_steps) = (1 << 38, 1 << 38);
    let far_apart = RunManifest::new(&config, "shock", beadline::origin()).unwrap();
    let state = |frame| {
        let mut message = FramesMessage::default();
        message.push(&ChainState::initial(&far_apart.physics).as_frame(&far_apart, frame));
        message.finish()
    };
    let hosts = Hosts::on_loopback();
    let (session, far) = far_of(&hosts, &far_apart, vec![state(0), state(1)], "");
    hosts.far.wait_for_run("shock", |_| true);
    ends_at_ctrl_c("it computes", far);
    session.close().wait().unwrap();
    let hosts = Hosts::on_loopback();
    let messages = vec![state(0), end("interrupted", Some(1))];
    let (session, far) = far_of(&hosts, &far_apart, messages, "");
    hosts.far.wait_for_run("shock", |_| true);
    ends_at_ctrl_c("it computes what nothing proves", far);
    session.close().wait().unwrap();
}

#[test]
fn ctrl_c_ends_both_sides_of_a_consumer_that_is_stuck() {
    for side in 0..2 {
        let hosts = Hosts::new();
        let [running, near, far] = hosts.relay("--beads 120 --impurity 60=0.6e-3 --duration 1", "--hold", "");
        let here = hosts.near("energies live:shock --out here.csv");
        hosts.far.wait_for_run("shock", |_| true);
        let there = hosts.far("energies live:shock --out there.csv");
        hosts.far.wait_for_run("shock", |run| run.lossless > 0);
        there.signal("STOP");
        let (mut last, mut still) = (0, 0);
        hosts.near.wait_for_run("shock", |run| {
            still = if std::mem::replace(&mut last, run.step) == run.step { still + 1 } else { 0 };
            still > 100
        });
        let (phase, ending) = [("a consumer holds it back", far), ("a far side holds it back", near)]
            .into_iter()
            .nth(side)
            .unwrap();
        ends_at_ctrl_c(phase, ending);
        there.signal("CONT");
        running.signal("INT");
        running.wait();
        here.wait();
    }
}

#[test]
fn ctrl_c_ends_a_near_side_that_waits_or_sends() {
    let hosts = Hosts::on_loopback();
    ends_at_ctrl_c("nobody asks", hosts.relay_from(""));

    let near = hosts.relay_from("");
    let session = wait_until("the near side", || {
        std::net::TcpStream::connect(("127.0.0.1", hosts.port)).ok()?;
        Some(stranger("connect/endpoints", hosts.port))
    });
    let replies = session.get("beadline/relay/*").payload(request(Versions::OURS)).wait().unwrap();
    assert!(replies.recv().is_ok());
    ends_at_ctrl_c("there is no run", near);
    session.close().wait().unwrap();

    let hosts = Hosts::on_loopback();
    let [running, near, _far] = hosts.relay(LONG, "", "");
    let here = hosts.near("energies live:shock --out here.csv");
    hosts.far.wait_for_run("shock", |run| run.step > 100);
    ends_at_ctrl_c("it sends", near);
    running.signal("INT");
    running.wait();
    here.wait();

    // a far side that never says that it has anything
    let hosts = Hosts::on_loopback();
    let running = hosts.near(&format!("run --no-record --name shock --wait-for 1 {SMALL}"));
    let near = hosts.relay_from("");
    let session = wait_until("the near side", || {
        std::net::TcpStream::connect(("127.0.0.1", hosts.port)).ok()?;
        Some(stranger("connect/endpoints", hosts.port))
    });
    let welcomed = || {
        let replies = session.get("beadline/relay/*").payload(request(Versions::OURS)).wait().unwrap();
        let reply = replies.recv().ok()?;
        let said = reply.result().ok()?.payload().try_to_string().unwrap().into_owned();
        said.contains("manifest").then_some(())
    };
    wait_until("a welcome", welcomed);
    hosts.near.wait_for_run("shock", is_relayed);
    hosts.near("energies live:shock --out here.csv").wait().exits(0);
    running.wait().exits(0);
    ends_at_ctrl_c("it waits for a far side", near);
    session.close().wait().unwrap();
}
