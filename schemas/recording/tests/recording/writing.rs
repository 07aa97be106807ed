//! What a recording can hold beside the frames of a run from its start to its end.

use crate::run::{RUN_TOML, doubles, for_each_frame, manifest, options, read_all, temp_dir};
use recording::{
    BeginRecord, ContactsReader, RecordedRows, RecordingInfo, RecordingSource, RecordingWriter, RowMessages,
    WriteError, WriteOptions,
};
use schemas::frame::{EndReason, Frame, FrameSink};
use schemas::results::{KeptValues, ResultColumns, ResultRow, RowValues, Topic};

/// States between frames have no frame number: whoever reads frames passes over them.
#[test]
fn states_between_frames_are_recorded_without_a_frame_number() {
    let (_directory, path) = temp_dir();
    let manifest = manifest(7, 3, 3);
    let mut writer = RecordingWriter::create(&path, &manifest, RUN_TOML, &options()).unwrap();
    let mut accept = |frame, step| {
        let (u_m, v_m_s) = (doubles(step, 0), doubles(step, 1));
        let time_s = manifest.physics.time_s(step);
        writer.accept(&Frame { frame, step, time_s, u_m: &u_m, v_m_s: &v_m_s, extra: &[], active: None })
    };
    for (frame, step) in [(0, 0), (0, 1), (0, 2), (1, 3), (1, 4), (1, 5), (2, 6)] {
        accept(frame, step).unwrap();
    }
    for (frame, step) in [(2, 7), (3, 8)] {
        assert!(
            matches!(accept(frame, step), Err(WriteError::Frame { .. })),
            "{step} is not of frame {frame}"
        );
    }
    accept(3, 7).unwrap();
    writer.finish(EndReason::Complete).unwrap();
    assert_eq!(RecordingInfo::read(&path).unwrap().frames(), 8);
    let (steps, missed, end) = read_all(&mut RecordingSource::open(&path).unwrap());
    assert_eq!((steps, missed, end.unwrap()), (vec![0, 3, 6, 7], vec![], EndReason::Complete));
}

/// A recording that begins in the middle of a run misses nothing: what was before is not its own.
#[test]
fn a_recording_that_begins_later_says_so_and_misses_nothing() {
    let (_directory, path) = temp_dir();
    let manifest = manifest(50, 1, 10);
    for (lost, expected) in [(0, vec![]), (30, vec![(17, 30)])] {
        let begin = BeginRecord { first_step: 17, part: 3, previous_state_hash: Some("ab".into()) };
        let options = WriteOptions { force: true, ..options() };
        let mut writer = RecordingWriter::create_from(&path, &manifest, None, &begin, &options).unwrap();
        for_each_frame(&manifest, |frame| {
            if frame.step > lost
                && (frame.step == 17 || (frame.step > 17 && manifest.is_recorded(frame.step)))
            {
                writer.accept(frame).unwrap();
            } else if frame.step < 17 {
                assert!(writer.accept(frame).is_err());
            }
        });
        writer.finish(EndReason::Complete).unwrap();
        let (_, missed, end) = read_all(&mut RecordingSource::open(&path).unwrap());
        assert_eq!((missed, end.unwrap()), (expected, EndReason::Complete));
        let info = RecordingInfo::read(&path).unwrap();
        assert_eq!((&info.begin, info.run_toml.as_ref()), (&begin, None));
        let end = info.end.unwrap();
        assert_eq!((end.part, end.previous_state_hash.as_deref()), (3, Some("ab")));
    }
}

/// Results are messages beside the states, in the order of frames within each channel.
#[test]
fn rows_of_results_have_channels_of_their_own() {
    let (_directory, path) = temp_dir();
    let manifest = manifest(9, 1, 1);
    let mut writer = RecordingWriter::create(&path, &manifest, RUN_TOML, &options()).unwrap();
    let rows =
        |name, columns: &_| RowMessages::new(Topic::results(name).unwrap(), columns, &manifest).unwrap();
    let contacts = rows("contacts", &ResultColumns::contacts(39, 1e-12));
    // of an analysis that nothing here has heard of
    let new = rows("new", &ResultColumns::named(&["a_m", "b_m"]));
    for_each_frame(&manifest, |frame| {
        writer.accept(frame).unwrap();
        if frame.step >= 4 {
            let (frame, step, time_s) = (frame.frame, frame.step, frame.time_s);
            let classes = [1; 39];
            let values = RowValues::Classes(&classes);
            let row = ResultRow { frame, step, time_s, values };
            writer.write_row(&contacts, &row).unwrap();
            assert!(matches!(writer.write_row(&contacts, &row), Err(WriteError::Frame { .. })), "twice");
            let values = RowValues::Numbers(&[0.5, -0.5]);
            writer.write_row(&new, &ResultRow { values, ..row }).unwrap();
        }
    });
    writer.finish(EndReason::Complete).unwrap();
    let info = RecordingInfo::read(&path).unwrap();
    let counts = ["/state", "/contacts", "/new", "/pulses"].map(|topic| info.messages(topic));
    assert_eq!(counts, [10, 6, 6, 0]);
    let mut rows = RecordedRows::open(&path, "/new").unwrap();
    let row = rows.next_row().unwrap().unwrap();
    assert_eq!((row.frame, row.values), (4, KeptValues::Numbers(vec![0.5, -0.5])));
    assert_eq!(rows.names(), ["a_m", "b_m"]);
    let mut map = ContactsReader::open(&path).unwrap();
    let row = map.next_row().unwrap().unwrap();
    assert_eq!((row.frame, row.tolerance_m, row.classes), (4, 1e-12, &[1; 39][..]));
}

/// A channel has one list of names. A second publisher of a topic may name other beads, or count other pulses.
#[test]
fn rows_of_other_columns_than_those_before_are_refused() {
    let (_directory, path) = temp_dir();
    let manifest = manifest(9, 1, 1);
    let mut writer = RecordingWriter::create(&path, &manifest, RUN_TOML, &options()).unwrap();
    let mut write = |frame, topic, columns: &ResultColumns| {
        let rows = RowMessages::new(Topic::results(topic).unwrap(), columns, &manifest).unwrap();
        let values = RowValues::Numbers(&[2.0, 0.0, 0.0, 0.0, 0.0][..columns.width]);
        let row = ResultRow { frame, step: frame, time_s: manifest.physics.time_s(frame), values };
        writer.write_row(&rows, &row).map_err(|error| error.to_string())
    };
    let force = |bead| ResultColumns::named(&[&*format!("force_bead_{bead}_n")]);
    let pulses = |threshold| ResultColumns::pulses(1, threshold);
    for (topic, columns, other, said) in [
        ("forces", force(3), force(9), "rows of `force_bead_9_n` after rows of `force_bead_3_n`"),
        ("pulses", pulses(0.1), pulses(1e-3), "threshold 1e-3` after"),
    ] {
        write(0, topic, &columns).unwrap();
        let refused = write(1, topic, &other).unwrap_err();
        assert!(refused.contains(said), "{refused}");
        write(2, topic, &columns).unwrap();
    }
}
