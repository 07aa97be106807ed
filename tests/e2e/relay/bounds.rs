//! Whatever the other side can count is counted before it is believed.

use super::strangers::{near_that, request, send, stranger};
use super::{Hosts, LONG};
use crate::harness::{Ended, Running, wait_until};
use ::relay::message::{
    EndMessage, FramesMessage, Have, Offer, RowsHead, RowsMessage, Versions, Welcome, to_json,
};
use ::relay::wire::zenoh::bytes::ZBytes;
use ::relay::wire::zenoh::{Session, Wait as _};
use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::manifest::RunManifest;
use schemas::presets::PRESETS;
use schemas::results::{ENERGIES, ResultColumns};
use std::net::TcpStream;

/// A run of some thousand frames, and its states.
pub(super) struct Run {
    pub(super) manifest: RunManifest,
    state: ChainState,
    integrator: Integrator,
}

impl Run {
    pub(super) fn new() -> Self {
        let mut config = PRESETS[0].config();
        (config.chain.beads, config.time.duration_s) = (100, 1e-3);
        config.chain.impurities.clear();
        config.name = Some("shock".to_owned());
        let manifest = RunManifest::new(&config, "shock", beadline::origin()).unwrap();
        let (state, integrator) =
            (ChainState::initial(&manifest.physics), Integrator::new(&manifest.physics));
        Self { manifest, state, integrator }
    }

    /// The state of a frame that is not before the last one asked for.
    pub(super) fn state(&mut self, frame: u64) -> Vec<u8> {
        while self.state.step < self.manifest.step_of_frame(frame) {
            self.integrator.step(&mut self.state);
        }
        let mut message = FramesMessage::default();
        message.push(&self.state.as_frame(&self.manifest, frame));
        message.finish()
    }
}

pub(super) fn end(reason: &str, last_frame: Option<u64>) -> Vec<u8> {
    EndMessage { reason: reason.to_owned(), last_frame }.encode()
}

/// One near side of `run` with these messages, all of them sent at once where somebody has none.
fn near_with(port: u16, run: &Run, messages: Vec<Vec<u8>>) -> Session {
    near_that(port, Versions::OURS, &run.manifest, move |query, _, have| {
        for (seq, message) in (1..).zip(&messages).skip(usize::try_from(have.seq).unwrap()) {
            send(query, seq, 0, message.clone());
        }
    })
}

#[test]
fn an_end_that_contradicts_the_manifest_or_what_arrived_is_a_failure() {
    let mut run = Run::new();
    let (first, later) = (run.state(0), run.state(300));
    let all = run.manifest.frame_count();
    assert!(all > 301);
    let but = format!("after 301 frames, but its manifest has {all}");
    for (end, said) in [
        (end("complete", Some(300)), but.as_str()),
        (end("complete", None), "after 0 frames"),
        (end("interrupted", Some(100)), "after 101 frames, but 301 arrived"),
    ] {
        let hosts = Hosts::on_loopback();
        let session = near_with(hosts.port, &run, vec![first.clone(), later.clone(), end]);
        let far = hosts.relay_to("--wait-for 1");
        let there = hosts.far("energies live:shock --out there.csv --json");
        far.wait().exits(1).says(&[said, "taken as failed"]);
        assert_eq!(there.wait().json()["end"], "failed", "{said}");
        session.close().wait().unwrap();
    }
    // one that was interrupted is said to be
    let hosts = Hosts::on_loopback();
    let session = near_with(hosts.port, &run, vec![first.clone(), later, end("interrupted", Some(300))]);
    let far = hosts.relay_to("").wait().exits(0).json();
    assert_eq!((&far["end"], far["frames"].as_u64()), (&"interrupted".into(), Some(301)), "{far}");
    session.close().wait().unwrap();
    // so is one that ended before there was a frame
    let hosts = Hosts::on_loopback();
    let session = near_with(hosts.port, &run, vec![end("interrupted", None)]);
    let far = hosts.relay_to("").wait().exits(0).says(&["there is no frame"]).json();
    assert_eq!(far["end"], "interrupted", "{far}");
    session.close().wait().unwrap();
}

/// A near side that welcomes whoever asks with these answers.
fn welcoming(port: u16, answers: Vec<String>) -> Session {
    let session = stranger("listen/endpoints", port);
    let answers: Vec<_> = answers.into_iter().map(ZBytes::from).collect();
    let answer = move |query: ::relay::wire::zenoh::query::Query| {
        for answer in &answers {
            query.reply("beadline/relay/any", answer.clone()).wait().unwrap();
        }
    };
    session.declare_queryable("beadline/relay/any").callback(answer).background().wait().unwrap();
    session
}

fn refused(answers: Vec<String>) -> Ended {
    let hosts = Hosts::on_loopback();
    let session = welcoming(hosts.port, answers);
    let far = hosts.relay_to("");
    let ended = bounded(far).exits(1);
    session.close().wait().unwrap();
    ended
}

/// Waits for the end of a side, and asserts that it never had much memory.
#[track_caller]
fn bounded(side: Running) -> Ended {
    let (ended, most_kb) = side.wait_for_peak();
    assert!(most_kb < 200_000, "{most_kb} kB\n{}", ended.stderr());
    ended
}

#[test]
fn a_welcome_is_one_and_short_and_of_a_run_that_can_be() {
    let run = Run::new();
    let welcome = |manifest: String| {
        let run = Some(Offer { manifest, have: Have { stream: 1, seq: 0 }, frames: false });
        to_json(&Welcome { versions: Versions::OURS, run })
    };
    let json = run.manifest.to_json();
    refused(vec![welcome(json.clone()); 2]).says(&["expected one run, found more than one"]);
    let many = to_json(&Welcome { versions: Versions::OURS, run: None });
    let many = many + &" ".repeat(250_000);
    refused(vec![many; 6000]).says(&["expected"]);
    let long = welcome(json.clone()) + &" ".repeat(17 << 20);
    refused(vec![long]).says(&["at most 16777216 are expected"]);
    let beads = format!("\"beads\":{}", run.manifest.physics.beads);
    assert!(json.contains(&beads), "{json}");
    for wrong in ["\"beads\":0", "\"beads\":18446744073709551615"] {
        refused(vec![welcome(json.replace(&beads, wrong))]).says(&["offers a run that cannot be", "beads"]);
    }
}

/// Rows of one kind of results, each of zeros.
fn rows(topic: &str, width: usize, frames: &[u64], written: bool) -> Vec<u8> {
    let columns = ResultColumns { width, names: ENERGIES[0].to_owned(), tolerance_m: None };
    let head =
        RowsHead { topic: topic.to_owned(), width, names: columns.names, tolerance_m: None, ended: None };
    let mut message = RowsMessage::default();
    for frame in frames {
        message.push(*frame, std::iter::repeat_n(0, if written { 8 * width } else { 0 }));
    }
    message.finish(&head)
}

#[test]
fn what_a_near_side_counts_is_bounded() {
    let mut run = Run::new();
    let first = run.state(0);
    let frames = run.manifest.frame_count();
    let topics: Vec<_> = (0..3000).map(|n| rows(&format!("own/t{n}"), 1, &[0], true)).collect();
    let restarted = |n: usize| rows("own/again", 1 + n % 2, &[], true);
    for (messages, said) in [
        (topics, "after 32 kinds"),
        ((0..150).map(restarted).collect(), "1 kinds, which began"),
        (vec![rows("own/wide", 1 << 40, &[], true)], "expected at most 25165824"),
        (vec![rows("own/late", 1, &[0, frames], true)], "a row of frame"),
        (vec![vec![2; 30 << 20]], "silent for 1 s"),
    ] {
        let hosts = Hosts::on_loopback();
        let all: Vec<_> = [first.clone()].into_iter().chain(messages).collect();
        // a few at a time, as ours does
        let session = near_that(hosts.port, Versions::OURS, &run.manifest, move |query, _, have| {
            for (seq, message) in (1..).zip(&all).skip(usize::try_from(have.seq).unwrap()).take(16) {
                send(query, seq, 0, message.clone());
            }
        });
        let far = hosts.relay_to("--wait-for 1 --silence 1");
        let there = hosts.far("energies live:shock --out there.csv --json");
        // what is too long for any run does not even arrive
        far.wait().exits(if said.contains("silent") { 3 } else { 1 }).says(&[said]);
        assert_eq!(there.wait().json()["end"], "failed", "{said}");
        session.close().wait().unwrap();
    }
}

#[test]
fn a_near_side_that_sends_more_than_may_be_under_way_is_refused() {
    let mut run = Run::new();
    let state = run.state(0);
    let large = rows("own/large", 1 << 17, &[0], true);
    for (count, message) in [(1000, state.clone()), (50, large)] {
        let hosts = Hosts::on_loopback();
        let messages = std::iter::once(state.clone()).chain(std::iter::repeat_n(message, count)).collect();
        let session = near_with(hosts.port, &run, messages);
        bounded(hosts.relay_to("")).exits(1).says(&["more than 32 messages or 8388608 bytes at once"]);
        session.close().wait().unwrap();
    }
}

/// Connections that say nothing, and more requests that wait than there is room for.
#[test]
fn those_who_say_nothing_keep_nobody_out() {
    let hosts = Hosts::on_loopback();
    let near = hosts.relay_from("--silence 2");
    let connect = || TcpStream::connect(("127.0.0.1", hosts.port)).ok();
    wait_until("the near side to listen", connect);
    let silent: Vec<_> = (0..500).filter_map(|_| connect()).collect();
    assert_eq!(silent.len(), 500);
    let sessions: Vec<_> = (0..20).map(|_| stranger("connect/endpoints", hosts.port)).collect();
    let session = &sessions[0];
    let ask = |_| session.get("beadline/relay/*").payload(request(Versions::OURS)).wait().unwrap();
    let idle: Vec<_> = (0..3000).map(ask).collect();
    let far = hosts.relay_to("");
    let running = hosts.near(&format!("run --no-record --name shock {LONG}"));
    hosts.far.wait_for_run("shock", |run| run.step > 100);
    running.signal("INT");
    running.wait().exits(3);
    assert_eq!(far.wait().exits(0).json()["end"], "interrupted");
    assert_eq!(near.wait().json()["end"], "interrupted");
    drop((silent, idle, sessions));
}
