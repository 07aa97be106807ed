//! A sparse recording and a full one are the same run.

use crate::harness::Place;
use schemas::frame::{FrameSource, Received};
use schemas::recording::RecordingSource;

const SMALL: &str = "run --beads 120 --impurity 60=0.6e-3 --duration 0.012 --name small";

/// Every state of a recording: its frame, step, time and bits.
fn states(place: &Place, file: &str) -> Vec<(u64, u64, Vec<u64>)> {
    let mut source = RecordingSource::open(&place.path(file)).unwrap();
    let mut states = Vec::new();
    while let Received::Frame(frame) = source.receive().unwrap() {
        let values = [&[frame.time_s], frame.u_m, frame.v_m_s, frame.extra].concat();
        states.push((frame.frame, frame.step, values.iter().map(|value| value.to_bits()).collect()));
    }
    states
}

#[test]
fn what_is_thinned_and_expanded_is_what_it_was() {
    let place = Place::new();
    for (flags, back) in [("", ""), ("--method gear5 --publish-every-steps 5", "--every-steps 5")] {
        place.run(&format!("{SMALL} {flags} --out full.mcap --force")).exits(0);
        let thinned = "thin full.mcap --every-steps 100 --out sparse.mcap --force --json";
        let thinned = place.run(thinned).exits(0).json();
        assert_eq!(thinned["states_before"], states(&place, "full.mcap").len());
        let sparse = states(&place, "sparse.mcap");
        assert_eq!(thinned["states"], sparse.len());
        assert!(sparse.iter().rev().skip(1).all(|(_, step, _)| step % 100 == 0));
        assert!(thinned["bytes"].as_u64().unwrap() < thinned["bytes_before"].as_u64().unwrap() / 10);
        place.run("verify sparse.mcap").exits(0);
        place.run(&format!("expand sparse.mcap {back} --out back.mcap --force")).exits(0);
        assert!(states(&place, "back.mcap") == states(&place, "full.mcap"), "{flags}: the states differ");
    }
}

/// A run that was interrupted ends where it ended, also when that is no step to be kept.
#[test]
fn an_interrupted_run_keeps_its_last_state() {
    let place = Place::new();
    let run = place.start(&format!("{SMALL} --out part.mcap --pace 0.002"));
    place.wait_for_run("small", |run| run.step > 150);
    run.signal("INT");
    run.wait().exits(0);
    place.run("thin part.mcap --every-steps 100 --out sparse.mcap").exits(0);
    place.run("expand sparse.mcap --out back.mcap").exits(0);
    let (part, back) = (states(&place, "part.mcap"), states(&place, "back.mcap"));
    assert!(part == back && states(&place, "sparse.mcap").last() == part.last());
}

#[test]
fn what_cannot_be_thinned_is_left_alone() {
    let place = Place::new();
    place.run(&format!("{SMALL} --publish-every-steps 4 --out run.mcap")).exits(0);
    place.run("thin run.mcap --every-steps 10 --out a.mcap").exits(2).says(&["multiple of 4"]);
    place.run("thin run.mcap --every-steps 0 --out a.mcap").exits(2).says(&["multiple of 4"]);
    place.run("thin run.mcap --every-steps 40 --out run.mcap --force").exits(2).says(&["the source itself"]);
    place.write("a.mcap", "something else");
    place.run("thin run.mcap --every-steps 40 --out a.mcap").exits(1).says(&["exists", "--force"]);
    assert_eq!(place.read("a.mcap"), "something else");
}
