//! A recording proves itself.

use crate::harness::Place;
use recording::{RecordingSource, RecordingWriter, WriteOptions};
use schemas::frame::{EndReason, Frame, FrameSink, FrameSource, Received};

const SMALL: &str = "run --beads 120 --impurity 60=0.6e-3 --duration 0.012 --name small";

/// Copies the recording `from` to `to`, each state as `change` leaves it, with checksums that are right.
fn copy(place: &Place, from: &str, to: &str, mut change: impl FnMut(u64, &mut Vec<f64>) -> bool) {
    let mut source = RecordingSource::open(&place.path(from)).unwrap();
    let manifest = source.manifest().clone();
    let mut copy = RecordingWriter::create(&place.path(to), &manifest, "", &WriteOptions::default()).unwrap();
    while let Received::Frame(frame) = source.receive().unwrap() {
        let mut v_m_s = frame.v_m_s.to_vec();
        if change(frame.step, &mut v_m_s) {
            copy.accept(&Frame { v_m_s: &v_m_s, ..frame }).unwrap();
        }
    }
    copy.finish(EndReason::Complete).unwrap();
}

#[test]
fn a_recording_is_proven_however_sparse_it_is() {
    let place = Place::new();
    for (flags, states) in [("", None), ("--record-every-steps 100", Some(84)), ("--method gear5", None)] {
        let run = place.run(&format!("{SMALL} {flags} --out run.mcap --force --json")).exits(0).json();
        for jobs in ["", "--jobs 1", "--jobs 3"] {
            let found = place.run(&format!("verify run.mcap {jobs} --json")).exits(0).json();
            assert_eq!(
                (found["proven"].as_bool(), found["difference_count"].as_u64()),
                (Some(true), Some(0))
            );
            assert_eq!(found["states"], run["frames_recorded"]);
            assert_eq!(found["steps_recomputed"], found["last_step"]);
            assert!(states.is_none_or(|states| found["states"] == states));
        }
    }
    assert!(place.run("verify run.mcap").exits(0).stdout().contains("small: proven"));
}

#[test]
fn a_changed_double_under_valid_checksums_is_found() {
    let place = Place::new();
    place.run(&format!("{SMALL} --record-every-steps 50 --out run.mcap")).exits(0);
    copy(&place, "run.mcap", "same.mcap", |_, _| true);
    place.run("verify same.mcap").exits(0);
    copy(&place, "run.mcap", "changed.mcap", |step, v_m_s| {
        if step == 1000 {
            // one bit, of a bead that still rests
            v_m_s[77] = f64::from_bits(v_m_s[77].to_bits() ^ 1);
        }
        true
    });
    place.run("info changed.mcap").exits(0);
    let found = place.run("verify changed.mcap --json").exits(3).json();
    // the state that was changed, and the next one, which does not follow from it
    assert_eq!(found["difference_count"], 2);
    let first = &found["differences"][0];
    assert_eq!((first["step"].as_u64(), first["frame"].as_u64()), (Some(1000), Some(1000)));
    assert_eq!((first["bead"].as_u64(), first["quantity"].as_str()), (Some(77), Some("velocity")));
    let stdout = place.run("verify changed.mcap").exits(3).stdout();
    assert!(stdout.contains("velocity of bead 77 at step 1000 (frame 1000)"), "{stdout}");
}

#[test]
fn another_initial_condition_and_missing_states_are_found() {
    let place = Place::new();
    place.run(&format!("{SMALL} --record-every-steps 50 --out run.mcap")).exits(0);
    copy(&place, "run.mcap", "faster.mcap", |step, v_m_s| {
        if step == 0 {
            v_m_s[0] = 5.000_000_1;
        }
        true
    });
    let stdout = place.run("verify faster.mcap").exits(3).stdout();
    assert!(stdout.contains("initial condition") && stdout.contains("NOT PROVEN"), "{stdout}");
    copy(&place, "run.mcap", "torn.mcap", |step, _| step != 1000);
    let found = place.run("verify torn.mcap --json").exits(3).json();
    assert_eq!(
        (found["missing_frames"][0][0].as_u64(), found["difference_count"].as_u64()),
        (Some(1000), Some(0))
    );
}

#[test]
fn a_recording_that_was_cut_off_is_not_whole() {
    let place = Place::new();
    place.run(&format!("{SMALL} --out run.mcap")).exits(0);
    let bytes = std::fs::read(place.path("run.mcap")).unwrap();
    std::fs::write(place.path("cut.mcap"), &bytes[..bytes.len() / 2]).unwrap();
    let found = place.run("verify cut.mcap --json").exits(3).json();
    assert_eq!((found["proven"].as_bool(), found["end"].as_str()), (Some(false), Some("unfinished")));
    assert!(place.run("verify cut.mcap").exits(3).stdout().contains("proven as far as it goes"));
}

#[test]
fn what_is_no_recording_cannot_be_verified() {
    let place = Place::new();
    place.write("table.mcap", "time,energy\n");
    place.run("verify table.mcap").exits(2).says(&["not an MCAP file"]);
    place.run("verify nowhere.mcap").exits(2).says(&["nowhere.mcap"]);
}
