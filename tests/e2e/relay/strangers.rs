//! What comes from elsewhere is not believed: sides that others made, in the place of one of ours.

use super::{Hosts, LONG, SMALL, has_all};
use crate::harness::wait_until;
use ::relay::message::{self, EndMessage, FramesMessage, Have, Offer, Request, Versions, Welcome, to_json};
use ::relay::wire::zenoh::query::Query;
use ::relay::wire::zenoh::{self, Session, Wait as _};
use producer::integrator::Integrator;
use producer::state::ChainState;
use schemas::manifest::RunManifest;
use schemas::presets::PRESETS;
use std::sync::Mutex;
use std::thread;
use std::time::Duration;

/// A Zenoh of a stranger's, at the near side's place or connected to it.
pub(super) fn stranger(key: &str, port: u16) -> Session {
    let mut config = zenoh::Config::default();
    config.insert_json5("scouting/multicast/enabled", "false").unwrap();
    config.insert_json5("listen/endpoints", "[]").unwrap();
    config.insert_json5(key, &format!("[\"tcp/127.0.0.1:{port}\"]")).unwrap();
    zenoh::open(config).wait().unwrap()
}

/// What a near side answers to `request`, and whether that is a refusal.
fn asked(session: &Session, request: &str) -> (bool, String) {
    wait_until("an answer", || {
        let replies = session.get("beadline/relay/*").payload(request).wait().unwrap();
        let reply = replies.recv().ok()?;
        Some(match reply.result() {
            Ok(sample) => (false, sample.payload().try_to_string().unwrap().into_owned()),
            Err(refused) => (true, refused.payload().try_to_string().unwrap().into_owned()),
        })
    })
}

pub(super) fn request(versions: Versions) -> String {
    to_json(&Request { versions, receiver: 5, frames: false, have: None, done: 0 })
}

#[test]
fn garbage_ends_nothing_else() {
    let hosts = Hosts::on_loopback();
    let [running, near, far] = hosts.relay(SMALL, "", "--wait-for 1");
    let session = stranger("connect/endpoints", hosts.port);
    for garbage in ["", "{}", "GET / HTTP/1.1", &"[".repeat(100_000)] {
        let (refused, said) = asked(&session, garbage);
        assert!(refused && said.contains("what no `beadline relay`"), "{said}");
    }
    session.put("beadline/relay-done", "{").wait().unwrap();
    session.close().wait().unwrap();
    let (there, here) =
        (hosts.far("energies live:shock --out t.csv"), hosts.near("energies live:shock --out t.csv"));
    for process in [there, here, running] {
        process.wait().exits(0);
    }
    let near = near.wait().exits(0).says(&["turned somebody away"]);
    has_all(&near, &far.wait().exits(0), hosts.near.read("t.csv").lines().count() as u64 - 1);
}

#[test]
fn another_version_is_told_on_both_sides() {
    let hosts = Hosts::on_loopback();
    let [running, near, far] = hosts.relay(LONG, "", "");
    let session = stranger("connect/endpoints", hosts.port);
    let kernel = Versions { kernel: Versions::OURS.kernel + 1, ..Versions::OURS };
    let protocol = Versions { protocol: 9, ..Versions::OURS };
    for (versions, word) in
        [(kernel, "kernel: the other side has version 4, this one has 3"), (protocol, "version 9")]
    {
        let (refused, said) = asked(&session, &request(versions));
        assert!(refused && said.contains(word), "{said}");
    }
    session.close().wait().unwrap();
    running.signal("INT");
    running.wait().exits(3);
    far.wait();
    near.wait().says(&[
        "kernel: the other side has version 4",
        "`--frames`",
        "relay protocol: the other side has version 9",
    ]);
}

/// A near side of ours, which answers with `tell` whoever has something.
pub(super) fn near_that<F>(port: u16, versions: Versions, manifest: &RunManifest, tell: F) -> Session
where
    F: Fn(&Query, &Request, Have) + Send + Sync + 'static,
{
    let session = stranger("listen/endpoints", port);
    let manifest = manifest.to_json();
    let answer = move |query: Query| {
        let request: Request = message::request(&query.payload().unwrap().to_bytes()).unwrap();
        if let Some(have) = request.have {
            return tell(&query, &request, have);
        }
        let run = Some(Offer { manifest: manifest.clone(), have: Have { stream: 1, seq: 0 }, frames: false });
        query.reply("beadline/relay/any", to_json(&Welcome { versions, run })).wait().unwrap();
    };
    session.declare_queryable("beadline/relay/any").callback(answer).background().wait().unwrap();
    session
}

/// Sends the message `seq`, which has waited for so long (ms).
pub(super) fn send(query: &Query, seq: u64, age_ms: u64, message: Vec<u8>) {
    let place = message::Place { seq, after: seq - 1, rows_lost: 0, age_ms };
    query.reply("beadline/relay/any", message).attachment(place.encode()).wait().unwrap();
}

/// One that has these messages, whatever is asked.
fn lying_near(port: u16, versions: Versions, manifest: &RunManifest, messages: Vec<Vec<u8>>) -> Session {
    near_that(port, versions, manifest, move |query, _, have| {
        for (seq, message) in (1..).zip(&messages).skip(usize::try_from(have.seq).unwrap()) {
            send(query, seq, 0, message.clone());
        }
    })
}

/// States that have always waited for long, until it asks for frames; then the rest of them.
#[test]
fn a_far_side_that_is_too_slow_asks_for_frames() {
    let hosts = Hosts::on_loopback();
    let mut config = PRESETS.iter().find(|preset| preset.name == "homogeneous").unwrap().config();
    (config.chain.beads, config.time.duration_s) = (100, 6e-3);
    let manifest = RunManifest::new(&config, "shock", beadline::origin()).unwrap();
    let frames = manifest.frame_count();
    let run = manifest.clone();
    let chain = Mutex::new((ChainState::initial(&run.physics), Integrator::new(&run.physics)));
    let session = near_that(hosts.port, Versions::OURS, &manifest, move |query, request, have| {
        thread::sleep(Duration::from_millis(20));
        let (state, integrator) = &mut *chain.lock().unwrap();
        let steps = if request.frames { run.physics.step_count } else { 4 * have.seq };
        let mut message = FramesMessage::default();
        while state.step < steps {
            integrator.step(state);
            if request.frames {
                message.push(&state.as_frame(&run, state.step));
            }
        }
        if message.is_empty() && request.frames {
            let end = EndMessage { reason: "complete".to_owned(), last_frame: Some(state.step) };
            return send(query, have.seq + 1, 0, end.encode());
        }
        if message.is_empty() {
            message.push(&state.as_frame(&run, state.step));
        }
        send(query, have.seq + 1, 20_000, message.finish());
    });
    let far = hosts.relay_to("").wait().exits(0).says(&["too slow to recompute"]).json();
    let (proven, all) = (far["frames_proven"].as_u64().unwrap(), far["frames"].as_u64().unwrap());
    assert!(0 < proven && proven < frames && all == frames && far["end"] == "complete", "{far}");
    session.close().wait().unwrap();
}

#[test]
fn what_a_near_side_says_is_not_believed() {
    let mut config = PRESETS[0].config();
    config.time.duration_s = 1e-3;
    let manifest = RunManifest::new(&config, "shock", beadline::origin()).unwrap();
    let mut state = ChainState::initial(&manifest.physics);
    let message = |state: &ChainState| {
        let mut message = FramesMessage::default();
        message.push(&state.as_frame(&manifest, state.step));
        message.finish()
    };
    let first = message(&state);
    let mut integrator = Integrator::new(&manifest.physics);
    (0..100).for_each(|_| integrator.step(&mut state));
    state.v_m_s[3] = -state.v_m_s[3];
    let kernel = Versions { kernel: 7, ..Versions::OURS };
    for (versions, messages, said) in [
        (
            Versions::OURS,
            vec![first.clone(), message(&state)],
            vec!["velocity of bead 3 at step 100", "after step 0"],
        ),
        (Versions::OURS, vec![first.clone(), vec![7; 100]], vec!["what no `beadline relay`"]),
        (Versions::OURS, vec![first[..900].to_vec()], vec!["what no `beadline relay`"]),
        (kernel, vec![first], vec!["kernel: the other side has version 7, this one has 3", "--frames"]),
    ] {
        let hosts = Hosts::on_loopback();
        let session = lying_near(hosts.port, versions, &manifest, messages);
        hosts.relay_to("").wait().exits(1).says(&said);
        session.close().wait().unwrap();
    }
}
