//! What a recording can hold beside the frames of a run from its start to its end.

use crate::run::{RUN_TOML, doubles, manifest, options, read_all, temp_dir};
use schemas::frame::{EndReason, Frame, FrameSink};
use schemas::recording::{RecordingInfo, RecordingSource, RecordingWriter, WriteError};

/// States between frames have no frame number: whoever reads frames passes over them.
#[test]
fn states_between_frames_are_recorded_without_a_frame_number() {
    let (_directory, path) = temp_dir();
    let manifest = manifest(7, 3, 3);
    let mut writer = RecordingWriter::create(&path, &manifest, RUN_TOML, &options()).unwrap();
    let mut accept = |frame, step| {
        let (u_m, v_m_s) = (doubles(step, 0), doubles(step, 1));
        let time_s = manifest.physics.time_s(step);
        writer.accept(&Frame { frame, step, time_s, u_m: &u_m, v_m_s: &v_m_s, extra: &[] })
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
