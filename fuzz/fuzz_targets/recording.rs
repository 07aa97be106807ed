//! Everything that reads recordings, over whole files.

#![no_main]

use beadline_fuzz::{Place, mutate_recording};
use libfuzzer_sys::{fuzz_mutator, fuzz_target};
use schemas::frame::{EndReason, FrameSource, Received};
use schemas::recording::{ContactsReader, RecordingInfo, RecordingSource};
use std::cell::LazyCell;
use std::path::Path;

thread_local! {
    static PLACE: LazyCell<Place> = LazyCell::new(Place::new);
}

fuzz_mutator!(|bytes: &mut [u8], size: usize, most: usize, seed: u32| {
    mutate_recording(bytes, size, most, seed)
});

fuzz_target!(|bytes: &[u8]| {
    let path = PLACE.with(|place| place.put("fuzzed.mcap", bytes));
    let info = RecordingInfo::read(&path);
    let read = read_states(&path);
    if let (Ok(info), Ok(EndReason::Complete)) = (&info, &read) {
        assert!(info.finished && info.damage.is_none(), "{info:?}");
    }
    read_contacts(&path);
});

/// States come in order and with the lengths that the manifest says; the end comes.
fn read_states(path: &Path) -> Result<EndReason, String> {
    let mut source = RecordingSource::open(path).map_err(|error| error.to_string())?;
    let (beads, doubles) = (source.manifest().physics.beads, source.manifest().frame_doubles());
    let (mut before, mut accounted) = (None, 0);
    loop {
        match source.receive().map_err(|error| error.to_string())? {
            Received::Frame(frame) => {
                assert_eq!((frame.u_m.len() as u64, frame.v_m_s.len() as u64), (beads, beads));
                assert_eq!(frame.u_m.len() + frame.v_m_s.len() + frame.extra.len(), doubles);
                assert!(before.is_none_or(|before| before < frame.step));
                assert!(frame.frame >= accounted);
                (before, accounted) = (Some(frame.step), frame.frame);
            }
            Received::Missed { from, to } => {
                assert!(accounted <= from && from <= to, "{from} to {to} after {accounted}");
                accounted = to;
            }
            Received::End(reason) => return Ok(reason),
        }
    }
}

fn read_contacts(path: &Path) {
    let Ok(mut reader) = ContactsReader::open(path) else { return };
    let contacts = reader.manifest().contact_count();
    while let Ok(Some(row)) = reader.next_row() {
        assert_eq!(row.classes.len(), contacts);
        assert!(row.classes.iter().all(|class| *class <= 2));
    }
}
