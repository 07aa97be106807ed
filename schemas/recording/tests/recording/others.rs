//! What a recording holds beside its frames stays whole when it is written again.

use crate::run::{RUN_TOML, for_each_frame, manifest, options, temp_dir, write_recording};
use mcap::MessageStream;
use mcap::records::{MessageHeader, Metadata, Record};
use recording::{Audit, Audited, CopyError, OtherChannels, RecordingWriter};
use schemas::frame::{EndReason, FrameSink};
use std::collections::BTreeMap;
use std::fs;
use std::io::Cursor;
use std::path::Path;

/// A message with all that belongs to it, but the numbers that a file gives its channels.
#[derive(Debug, Clone, PartialEq)]
struct Whole {
    topic: String,
    encoding: String,
    metadata: BTreeMap<String, String>,
    schema: Option<(String, String, Vec<u8>)>,
    sequence: u32,
    times_ns: (u64, u64),
    contents: Vec<u8>,
}

fn messages(path: &Path) -> Vec<Whole> {
    let bytes = fs::read(path).unwrap();
    let whole = |message: mcap::Message<'_>| {
        let schema = message.channel.schema.as_ref();
        Whole {
            topic: message.channel.topic.clone(),
            encoding: message.channel.message_encoding.clone(),
            metadata: message.channel.metadata.clone(),
            schema: schema.map(|s| (s.name.clone(), s.encoding.clone(), s.data.to_vec())),
            sequence: message.sequence,
            times_ns: (message.log_time, message.publish_time),
            contents: message.data.into_owned(),
        }
    };
    MessageStream::new(&bytes).unwrap().map(|message| whole(message.unwrap())).collect()
}

fn run_metadata(path: &Path) -> Metadata {
    let bytes = fs::read(path).unwrap();
    let records = mcap::read::LinearReader::new(&bytes).unwrap();
    let found = records.filter_map(Result::ok).find_map(|record| match record {
        Record::Metadata(metadata) if metadata.name == "beadline.run" => Some(metadata),
        _ => None,
    });
    found.unwrap()
}

/// The recording `ours` again, with two foreign channels: notes in JSON, with a schema, between frames and after the
/// last, and readings without a schema at the times of frames.
fn with_foreign_channels(ours: &Path, path: &Path) {
    let mut writer = mcap::WriteOptions::new().profile("beadline").create(Cursor::new(Vec::new())).unwrap();
    writer.write_metadata(&run_metadata(ours)).unwrap();
    let note = writer.add_schema("Note", "jsonschema", br#"{"type":"object"}"#).unwrap();
    let about = BTreeMap::from([("by".to_owned(), "somebody else".to_owned())]);
    let notes = writer.add_channel(note, "/notes", "json", &about).unwrap();
    let readings = writer.add_channel(0, "/readings", "x-raw", &BTreeMap::new()).unwrap();
    let mut put = |channel_id, sequence, log_time, publish_time, message: &[u8]| {
        let header = MessageHeader { channel_id, sequence, log_time, publish_time };
        writer.write_to_known_channel(&header, message).unwrap();
    };
    for message in messages(ours).iter().filter(|message| message.topic == "/state") {
        let time_ns = message.times_ns.0;
        put(readings, 7, time_ns, time_ns + 1, &[message.sequence as u8; 3]);
        if message.sequence % 3 == 1 {
            put(notes, message.sequence, time_ns + 10, time_ns + 12, b"{}");
        }
    }
    put(notes, 99, 1 << 40, 0, b"{\"after\":\"all\"}");
    writer.finish().unwrap();
    fs::write(path, writer.into_inner().into_inner()).unwrap();
}

#[test]
fn foreign_channels_are_copied_whole_after_the_frames_they_belong_to() {
    let (directory, ours) = temp_dir();
    let manifest = manifest(10, 1, 1);
    write_recording(&ours, &manifest, &options());
    let (foreign, copy) = (directory.path().join("foreign.mcap"), directory.path().join("copy.mcap"));
    with_foreign_channels(&ours, &foreign);

    let mut others = OtherChannels::open(&foreign).unwrap();
    let mut writer = RecordingWriter::create(&copy, &manifest, RUN_TOML, &options()).unwrap();
    for_each_frame(&manifest, |frame| {
        others.copy_before(frame.time_s, &mut writer).unwrap();
        writer.accept(frame).unwrap();
    });
    others.copy_rest(&mut writer).unwrap();
    writer.finish(EndReason::Complete).unwrap();

    let (of_frames, copied): (Vec<_>, Vec<_>) =
        messages(&copy).into_iter().partition(|message| message.schema.as_ref().is_some_and(is_ours));
    assert_eq!(of_frames, messages(&ours));
    assert_eq!(copied, messages(&foreign));
    assert_eq!(others.copied_count(), copied.len() as u64);
    let times: Vec<_> = messages(&copy).iter().map(|message| message.times_ns.0).collect();
    assert!(times.is_sorted(), "{times:?}");
}

fn is_ours((name, ..): &(String, String, Vec<u8>)) -> bool {
    name.starts_with("beadline.v1.")
}

#[test]
fn a_recording_of_ours_has_no_other_channels() {
    let (directory, ours) = temp_dir();
    let manifest = manifest(5, 1, 1);
    write_recording(&ours, &manifest, &options());
    let copy = directory.path().join("copy.mcap");
    let mut writer = RecordingWriter::create(&copy, &manifest, RUN_TOML, &options()).unwrap();
    let mut others = OtherChannels::open(&ours).unwrap();
    others.copy_rest(&mut writer).unwrap();
    assert_eq!(others.copied_count(), 0);
    writer.discard();
}

#[test]
fn records_of_others_are_copied_among_the_states_and_what_cannot_be_is_an_error() {
    let (directory, ours) = temp_dir();
    let manifest = manifest(5, 1, 1);
    write_recording(&ours, &manifest, &options());
    let with = |name: &str, about: &[(&str, &str)]| {
        let path = directory.path().join(name);
        let file = Cursor::new(Vec::new());
        let mut writer = mcap::WriteOptions::new().profile("beadline").create(file).unwrap();
        writer.write_metadata(&run_metadata(&ours)).unwrap();
        writer.write_metadata(&Metadata { name: "mine".to_owned(), metadata: BTreeMap::new() }).unwrap();
        let beside_the_summary = std::iter::empty::<mcap::write::PrivateRecordOptions>().collect();
        writer.write_private_record(0x90, b"private", beside_the_summary).unwrap();
        let about = about.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        let channel_id = writer.add_channel(0, "/state", "protobuf", &about).unwrap();
        let header = MessageHeader { channel_id, sequence: 0, log_time: 0, publish_time: 0 };
        writer.write_to_known_channel(&header, b"").unwrap();
        writer.finish().unwrap();
        fs::write(&path, writer.into_inner().into_inner()).unwrap();
        OtherChannels::open(&path).unwrap()
    };
    let copy = directory.path().join("copy.mcap");
    let mut writer = RecordingWriter::create(&copy, &manifest, RUN_TOML, &options()).unwrap();
    for_each_frame(&manifest, |frame| {
        writer.accept(frame).unwrap();
        if frame.step == 2 {
            with("whole.mcap", &[]).copy_rest(&mut writer).unwrap();
        }
    });
    let lost = with("lost.mcap", &[("unit", "furlong")]).copy_rest(&mut writer).unwrap_err();
    assert!(
        matches!(&lost, CopyError::Lost { what, .. } if what.ends_with("metadata of the channel `/state`"))
    );
    writer.finish(EndReason::Complete).unwrap();

    let bytes = fs::read(&copy).unwrap();
    let records: Vec<_> =
        mcap::read::LinearReader::new(&bytes).unwrap().collect::<Result<_, _>>().expect("records");
    let is_private = |record: &&Record<'_>| matches!(record, Record::Unknown { opcode: 0x90, .. });
    let is_mine = |record: &&Record<'_>| matches!(record, Record::Metadata(found) if found.name == "mine");
    assert_eq!((records.iter().filter(is_private).count(), records.iter().filter(is_mine).count()), (1, 1));
    let mut audit = Audit::open(&copy).unwrap();
    while !matches!(audit.read_next().unwrap(), Audited::End) {}
    assert!(audit.damages().is_empty() && audit.has_summary_section(), "{:?}", audit.damages());
}
