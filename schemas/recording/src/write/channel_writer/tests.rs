use super::*;
use crate::proto;
use schemas::frame::FrameSource;
use schemas::manifest::Origin;
use schemas::presets::PRESETS;
use std::fs;

const HOUR: Duration = Duration::from_hours(1);

fn manifest() -> RunManifest {
    let origin = Origin { program: "test".into(), host: "here".into(), started_unix_ns: 5 };
    RunManifest::new(&PRESETS[0].config(), "test", origin).expect("preset")
}

fn options(compression: Compression) -> WriteOptions {
    WriteOptions {
        compression,
        chunk_bytes: 4000,
        flush_period: HOUR,
        sync_period: HOUR,
        ..WriteOptions::default()
    }
}

fn end() -> Metadata {
    let metadata = [("reason", "complete"), ("part", "1")].map(|(key, value)| (key.into(), value.into()));
    Metadata { name: "beadline.end".into(), metadata: metadata.into() }
}

/// Channel, frame, simulated time and contents of some messages; the last channel stays without one.
fn messages() -> impl Iterator<Item = (u16, u64, f64, Vec<u8>)> {
    (0..100_u16).map(|number| {
        let contents = (0..number * 7).map(|i| i.to_le_bytes()[0]).collect();
        (1 + number % 2, u64::from(number), f64::from(number / 3) * 1e-6, contents)
    })
}

fn write_ours(path: &Path, manifest: &RunManifest, compression: Compression) -> Finished {
    let mut writer =
        ChannelWriter::create(crate::PROFILE, path, manifest, None, Some("a = 1"), &options(compression))
            .expect("created");
    let ids =
        [proto::STATE, proto::SUMMARY, proto::CHAIN].map(|topic| writer.add_channel(topic).expect("new"));
    assert_eq!(writer.add_channel(proto::STATE).expect("known").0, ids[0].0);
    for (channel, frame, time_s, contents) in messages() {
        writer.write(ids[usize::from(channel - 1)], frame, time_s, &contents).expect("written");
    }
    writer.finish(&end(), 0).expect("finished")
}

/// The same by the writer of the crate `mcap`.
fn write_theirs(manifest: &RunManifest, compression: Option<mcap::Compression>) -> Vec<u8> {
    let mut bytes = io::Cursor::new(Vec::new());
    let options = mcap::WriteOptions::new()
        .profile(crate::PROFILE)
        .library(concat!("beadline ", env!("CARGO_PKG_VERSION")))
        .compression(compression)
        .chunk_size(Some(4000))
        .disable_seeking(true);
    let mut writer = options.create(&mut bytes).expect("created");
    writer.write_metadata(&head::run_metadata(manifest)).expect("written");
    let attachment = mcap::Attachment {
        log_time: 0,
        create_time: 5,
        name: "run.toml".into(),
        media_type: "application/toml".into(),
        data: b"a = 1".into(),
    };
    writer.attach(&attachment).expect("written");
    for topic in [proto::STATE, proto::SUMMARY, proto::CHAIN] {
        let schema = writer.add_schema(topic.message, "protobuf", topic.descriptor).expect("new");
        writer.add_channel(schema, topic.topic, "protobuf", &BTreeMap::new()).expect("new");
    }
    for (channel, frame, time_s, contents) in messages() {
        let header = message_head(ChannelId(channel), frame, time_s);
        writer.write_to_known_channel(&header, &contents).expect("written");
    }
    writer.write_metadata(&end()).expect("written");
    writer.finish().expect("finished");
    drop(writer);
    bytes.into_inner()
}

#[test]
fn a_file_is_what_mcaps_own_writer_makes_of_the_same_messages() {
    let directory = tempfile::tempdir().expect("directory");
    let path = directory.path().join("test.mcap");
    let manifest = manifest();
    let finished = write_ours(&path, &manifest, Compression::None);
    let ours = fs::read(&path).expect("read");
    assert_eq!(finished.bytes, ours.len() as u64);
    let theirs = write_theirs(&manifest, None);
    let first_difference = ours.iter().zip(&theirs).position(|(a, b)| a != b);
    assert_eq!((first_difference, ours.len()), (None, theirs.len()));
}

/// Whoever is stopped just then leaves a recording without states, with which a run begins anew.
#[test]
fn a_file_may_end_between_its_definitions() {
    let directory = tempfile::tempdir().expect("directory");
    let (path, cut) = ["test.mcap.partial", "cut.mcap"].map(|name| directory.path().join(name)).into();
    let options = options(Compression::None);
    let whole = path.with_extension("");
    let mut writer =
        ChannelWriter::create(crate::PROFILE, &whole, &manifest(), None, None, &options).expect("new");
    for topic in [proto::CHAIN, proto::STATE, proto::SUMMARY] {
        writer.add_channel(topic).expect("new");
        writer.flush().expect("flushed");
        fs::copy(&path, &cut).expect("copied");
        let mut source = crate::RecordingSource::open(&cut).expect("begun");
        let end = source.receive().expect("readable");
        assert!(matches!(end, schemas::frame::Received::End(schemas::frame::EndReason::Unfinished)));
        assert_eq!(crate::RecordingInfo::read(&cut).expect("begun").damage, None);
    }
}

/// Compressed, the bytes are zstd's choice; what is in them is not.
#[test]
fn mcaps_own_reader_finds_the_same_in_compressed_chunks() {
    let directory = tempfile::tempdir().expect("directory");
    let path = directory.path().join("test.mcap");
    let manifest = manifest();
    write_ours(&path, &manifest, Compression::Zstd { level: 1 });
    let theirs = write_theirs(&manifest, Some(mcap::Compression::Zstd));
    let ours = fs::read(&path).expect("read");
    let read = |bytes: &[u8]| {
        let messages = mcap::MessageStream::new(bytes).expect("ours");
        let parts = |message: mcap::Message<'_>| {
            (message.channel.topic.clone(), message.sequence, message.log_time, message.data.into_owned())
        };
        messages.map(|message| parts(message.expect("readable"))).collect::<Vec<_>>()
    };
    assert_eq!(read(&ours).len(), 100);
    assert!(read(&ours) == read(&theirs));
    let summary = |bytes: &[u8]| mcap::Summary::read(bytes).expect("readable").expect("there");
    let (ours, theirs) = (summary(&ours), summary(&theirs));
    assert_eq!(ours.stats, theirs.stats);
    let chunks = |summary: &mcap::Summary| {
        summary.chunk_indexes.iter().map(|index| index.uncompressed_size).collect::<Vec<_>>()
    };
    assert_eq!(chunks(&ours), chunks(&theirs));
}
