//! A recording proves itself.

use crate::harness::Place;
use analyses::pulses::OFFER;
use consumers::analysis::{Beginning, LastRow, Settings};
use recording::{RecordingSource, RecordingWriter, RowMessages, WriteOptions};
use schemas::frame::{EndReason, Frame, FrameSink, FrameSource, Received};
use schemas::results::{ResultColumns, ResultRow, RowValues, Topic};

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

/// Copies `run.mcap` to `to`, with the rows of pulses above 0.01 from frame `first` on of an analysis that began `before` it, each as
/// `change` leaves it; their channel tells the threshold as `told` says.
fn with_pulses(
    place: &Place,
    (to, told): (&str, fn(&mut ResultColumns)),
    (first, before): (u64, u64),
    mut change: impl FnMut(u64, &mut Vec<f64>),
) {
    let mut source = RecordingSource::open(&place.path("run.mcap")).unwrap();
    let manifest = source.manifest().clone();
    let mut settings = Settings::default();
    settings.set(&OFFER.settings[0], vec!["0.01".to_owned()]).unwrap();
    let mut analysis = (OFFER.begin)(&Beginning::whole("pulses", &manifest, &settings)).unwrap();
    let mut columns = OFFER.published(&*analysis).unwrap();
    told(&mut columns);
    let messages = RowMessages::new(Topic::results("pulses").unwrap(), &columns, &manifest).unwrap();
    let options = WriteOptions { force: true, ..WriteOptions::default() };
    let mut copy = RecordingWriter::create(&place.path(to), &manifest, "", &options).unwrap();
    while let Received::Frame(frame) = source.receive().unwrap() {
        copy.accept(&frame).unwrap();
        if frame.frame + before < first {
            continue;
        }
        let mut row = LastRow::read();
        analysis.observe(&frame, &mut row);
        let mut values = row.values().unwrap().numbers().to_vec();
        change(frame.frame, &mut values);
        if frame.frame >= first {
            let Frame { frame, step, time_s, .. } = frame;
            let row = ResultRow { frame, step, time_s, values: RowValues::Numbers(&values) };
            copy.write_row(&messages, &row).unwrap();
        }
    }
    copy.finish(EndReason::Complete).unwrap();
}

/// Rows of pulses are those of the states, wherever the analysis began; a row that is not is named.
#[test]
fn rows_of_pulses_are_made_again() {
    type Change = fn(&mut ResultColumns);
    let place = Place::new();
    let (telling, silent): (Change, Change) =
        (|_| (), |columns| columns.names = columns.names.split(';').next().unwrap().to_owned());
    for chain in [
        "--preset light-impurity --beads 60 --impurity 30=0.6e-3 --duration 6e-3",
        "--preset precompressed --beads 60 --impurity 30=2e-3 --duration 2e-3",
        "--preset dimer --beads 60 --duration 2e-3",
        "--preset disordered --beads 210 --duration 4e-3",
        "--preset homogeneous --beads 2 --duration 1e-3",
    ] {
        place.run(&format!("run {chain} --out run.mcap --force")).exits(0);
        for (first, before) in [(0, 0), (150, 0), (150, 150)] {
            with_pulses(&place, ("rows.mcap", telling), (first, before), |_, _| ());
            let text = place.run("verify rows.mcap").exits(0).stdout();
            assert!(
                text.contains("of `/pulses`, by the states") && !text.contains("they depend on"),
                "{text}"
            );
        }
    }
    place.run("run --preset light-impurity --beads 60 --impurity 30=0.6e-3 --duration 6e-3 --out run.mcap --force").exits(0);
    let forge = |frame: u64, row: &mut Vec<f64>| {
        if frame == 400 {
            row[2] = f64::from_bits(row[2].to_bits() ^ 1);
        }
    };
    with_pulses(&place, ("forged.mcap", telling), (0, 0), forge);
    let text = place.run("verify forged.mcap").exits(3).stdout();
    assert!(text.contains("the row of frame 400 of /pulses: v_peak_m_s is"), "{text}");
    let another = |columns: &mut ResultColumns| columns.names = columns.names.replace("1e-2", "2e-1");
    with_pulses(&place, ("other.mcap", another), (0, 0), |_, _| ());
    let found = place.run("verify other.mcap --json").exits(3).json();
    assert!(found["rows"][0]["difference_count"].as_u64() > Some(0), "{found}");
    // not wrong, if the threshold or the frames before are not known
    for (told, first, before) in [(silent, 0, 0), (telling, 150, 100)] {
        with_pulses(&place, ("unknown.mcap", told), (first, before), forge);
        let text = place.run("verify unknown.mcap").exits(0).stdout();
        assert!(text.contains("of `/pulses`: they depend on frames before"), "{text}");
    }
}
