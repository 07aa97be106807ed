//! Everything that reads recordings, over whole files.

#![no_main]

use beadline_fuzz::{Place, mutate_recording};
use libfuzzer_sys::{fuzz_mutator, fuzz_target};
use schemas::frame::{EndReason, FrameSource, Received};
use recording::{
    Audit, Audited, ContactsReader, ReadError, RecordingInfo, RecordingSource, state_hash,
};
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
    let (states, end) = read_states(&mut RecordingSource::open(&path));
    let (all, _) = read_states(&mut RecordingSource::open_all(&path));
    let (audited, is_sound) = audit(&path);
    assert!(
        !is_sound || audited.iter().take(all.len()).eq(all.iter().map(|(step, _)| step)),
        "an audit gives less: {} of {} states",
        audited.len(),
        all.len()
    );
    if end == Some(EndReason::Complete) {
        let info = info.expect("a file that can be read");
        assert!(info.finished && info.damage.is_none(), "{info:?}");
        // an index that leads elsewhere is for `verify` to find
        if is_sound {
            for wanted in &states {
                seek(&path, wanted);
            }
        }
    }
    read_contacts(&path);
});

/// Step and hash of a state.
type State = (u64, String);

/// States come in order and with the lengths that the manifest says; then comes the end, or an error.
fn read_states(source: &mut Result<RecordingSource, ReadError>) -> (Vec<State>, Option<EndReason>) {
    let mut states: Vec<State> = Vec::new();
    let Ok(source) = source else { return (states, None) };
    let (beads, doubles) = (source.manifest().physics.beads, source.manifest().frame_doubles());
    let mut accounted = 0;
    loop {
        match source.receive() {
            Ok(Received::Frame(frame)) => {
                assert_eq!((frame.u_m.len() as u64, frame.v_m_s.len() as u64), (beads, beads));
                assert_eq!(frame.u_m.len() + frame.v_m_s.len() + frame.extra.len(), doubles);
                assert!(states.last().is_none_or(|before| before.0 < frame.step));
                assert!(frame.frame >= accounted);
                accounted = frame.frame;
                let doubles = [frame.u_m, frame.v_m_s, frame.extra].concat();
                states.push((frame.step, state_hash(frame.step, &doubles)));
            }
            Ok(Received::Missed { from, to }) => {
                assert!(accounted <= from && from <= to, "{from} to {to} after {accounted}");
                accounted = to;
            }
            Ok(Received::End(reason)) => return (states, Some(reason)),
            Err(_) => {
                // nothing further is believed
                assert!(!matches!(source.receive(), Ok(Received::Frame(_))));
                return (states, None);
            }
        }
    }
}

/// The steps of the states that can be read, whatever is damaged, and whether everything in the file agrees with
/// everything else in it.
fn audit(path: &Path) -> (Vec<u64>, bool) {
    let mut steps = Vec::new();
    let Ok(mut audit) = Audit::open(path) else { return (steps, false) };
    loop {
        match audit.read_next() {
            Ok(Audited::State(state)) => steps.push(state.step),
            Ok(Audited::End) => return (steps, audit.damage_count() == 0),
            Ok(_) => {}
            Err(_) => return (steps, false),
        }
    }
}

/// Going to a step gives the state that reading from the beginning gives.
fn seek(path: &Path, wanted: &State) {
    let mut source = RecordingSource::open(path).expect("read before");
    if source.seek_to_step(wanted.0).is_err() {
        return;
    }
    if let Ok(Received::Frame(frame)) = source.receive() {
        let doubles = [frame.u_m, frame.v_m_s, frame.extra].concat();
        assert_eq!(&(frame.step, state_hash(frame.step, &doubles)), wanted);
    }
}

fn read_contacts(path: &Path) {
    let Ok(mut reader) = ContactsReader::open(path) else { return };
    let contacts = reader.manifest().contact_count()..=reader.manifest().all_contact_count();
    while let Ok(Some(row)) = reader.next_row() {
        assert!(contacts.contains(&row.classes.len()));
        assert!(row.classes.iter().all(|class| *class <= 2));
    }
}
