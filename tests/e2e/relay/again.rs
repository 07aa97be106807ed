//! A near side that is killed, or lost, and begun again: the far side goes on, and consumers hear nothing but a delay.

use super::bounds::{Run, end};
use super::strangers::{send, stranger};
use super::{Hosts, SLOW};
use crate::harness::wait_until;
use ::relay::message::{self, GONE, Have, Offer, Request, Versions, Welcome, to_json};
use ::relay::wire::zenoh::query::Query;
use ::relay::wire::zenoh::{Session, Wait as _};
use schemas::manifest::{RunId, RunManifest};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// One near side with these messages, which knows nobody who was at another one.
fn near_of(
    port: u16,
    manifest: &RunManifest,
    stream: u64,
    messages: Vec<Vec<u8>>,
) -> (Session, Arc<AtomicU64>) {
    let session = wait_until("the port", || stranger_at(port));
    let (manifest, done) = (manifest.to_json(), Arc::new(AtomicU64::new(0)));
    let told = Arc::clone(&done);
    let answer = move |query: Query| {
        let request: Request = message::request(&query.payload().unwrap().to_bytes()).unwrap();
        match request.have {
            None => {
                let have = Have { stream, seq: 0 };
                let run = Some(Offer { manifest: manifest.clone(), have, frames: false });
                let welcome = to_json(&Welcome { versions: Versions::OURS, run });
                query.reply("beadline/relay/any", welcome).wait().unwrap();
            }
            Some(have) if have.stream != stream => query.reply_err(GONE).wait().unwrap(),
            Some(have) => {
                told.fetch_max(request.done, Ordering::Relaxed);
                for (seq, message) in (1..).zip(&messages).skip(usize::try_from(have.seq).unwrap()) {
                    send(&query, seq, 0, message.clone());
                }
            }
        }
    };
    session.declare_queryable("beadline/relay/any").callback(answer).background().wait().unwrap();
    (session, done)
}

fn stranger_at(port: u16) -> Option<Session> {
    std::net::TcpListener::bind(("127.0.0.1", port)).ok().map(drop)?;
    Some(stranger("listen/endpoints", port))
}

#[test]
fn a_near_side_that_is_killed_and_begun_again_costs_a_delay() {
    for flags in ["", "--frames"] {
        let hosts = Hosts::new();
        let [running, near, far] = hosts.relay(SLOW, flags, "--wait-for 1");
        let words = "energies live:shock --out table.csv";
        let (there, here) = (hosts.far(words), hosts.near(words));
        hosts.far.wait_for_run("shock", |run| run.step > 200);
        near.signal("KILL");
        assert_eq!(near.wait().killed_by(), Some(9));
        let near = hosts.relay_from(flags);
        for process in [here, running, there] {
            process.wait().exits(0);
        }
        near.wait().exits(0);
        let table = hosts.near.read("table.csv");
        assert!(table == hosts.far.read("table.csv"), "{flags}");
        let ended = far.wait().says(&["another near side has the run"]);
        let far = ended.json();
        assert_eq!((&far["end"], &far["first_frame"]), (&"complete".into(), &0.into()), "{far}");
        assert_eq!(far["frames"].as_u64(), Some(table.lines().count() as u64 - 1), "{far}");
        // rows of `here` that went meanwhile are counted, unless `there` was the first to publish such rows
        assert_eq!(ended.code(), Some(if far["rows_lost"] == 0 { 0 } else { 3 }), "{far}");
    }
}

#[test]
fn a_far_side_goes_on_with_the_recording_of_its_run() {
    let hosts = Hosts::new();
    let running = hosts.near(&format!("run --out shock.mcap --name shock --wait-for 1 {SLOW}"));
    let near = hosts.relay_from("--hold");
    let far = hosts.relay_to("--wait-for 1");
    let there = hosts.far("energies live:shock --out there.csv --json");
    hosts.far.wait_for_run("shock", |run| run.step > 200);
    near.signal("KILL");
    near.wait();
    running.signal("INT");
    running.wait().exits(3);
    // from its first frame, which is long published there
    let near = hosts.relay_from("--hold");
    hosts.near("replay shock.mcap --rate max --wait-for 1").wait();
    assert_eq!(near.wait().exits(0).json()["end"], "interrupted");
    let far = far.wait().exits(0).json();
    assert_eq!((&far["end"], &far["first_frame"]), (&"interrupted".into(), &0.into()), "{far}");
    assert_eq!(there.wait().json()["end"], "interrupted");
    hosts.near("energies shock.mcap --out here.csv").wait();
    let table = hosts.near.read("here.csv");
    assert_eq!(far["frames"].as_u64(), Some(table.lines().count() as u64 - 1));
    assert!(table == hosts.far.read("there.csv"));
}

#[test]
fn what_another_near_side_sends_must_follow_from_what_was_published() {
    let mut run = Run::new();
    let (first, later, last) = (run.state(0), run.state(100), run.state(200));
    let mut wrong = last.clone();
    // the sign of a velocity
    let at = 16 + 8 * (100 + 3) + 7;
    wrong[at] ^= 0x80;
    let mut other = run.manifest.clone();
    other.provenance.run_id = RunId::random();
    let mut changed = run.manifest.clone();
    changed.provenance.host = "elsewhere".to_owned();
    let interrupted = end("interrupted", Some(200));
    for (manifest, messages, said) in [
        (&run.manifest, vec![last.clone(), interrupted.clone()], None),
        (&run.manifest, vec![later.clone(), last.clone(), interrupted.clone()], None),
        (&run.manifest, vec![wrong, interrupted.clone()], Some("velocity of bead 3 at step 200")),
        (&other, vec![last.clone(), interrupted.clone()], Some("came back with another run")),
        (&changed, vec![last, interrupted], Some("with another manifest")),
    ] {
        let hosts = Hosts::on_loopback();
        let messages_before = vec![first.clone(), later.clone()];
        let (session, done) = near_of(hosts.port, &run.manifest, 1, messages_before);
        let far = hosts.relay_to("--wait-for 1");
        let there = hosts.far("energies live:shock --out there.csv --json");
        wait_until("both states to be done with", || (done.load(Ordering::Relaxed) == 2).then_some(()));
        session.close().wait().unwrap();
        let (session, _) = near_of(hosts.port, manifest, 2, messages);
        let (far, there) = (far.wait(), there.wait().json());
        match said {
            None => {
                let far = far.exits(0).json();
                assert_eq!((&far["frames"], &far["end"]), (&201.into(), &"interrupted".into()), "{far}");
                assert_eq!(there["end"], "interrupted", "{there}");
                assert_eq!(hosts.far.read("there.csv").lines().count(), 1 + 201);
            }
            Some(said) => {
                far.exits(1).says(&[said]);
                assert_eq!(there["end"], "failed", "{said}");
            }
        }
        session.close().wait().unwrap();
    }
}
