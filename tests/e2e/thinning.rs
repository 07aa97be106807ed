//! A sparse recording and a full one are the same run.

use crate::harness::{Place, wait_until};
use mcap::records::{MessageHeader, Metadata, Record};
use mcap::{Attachment, MessageStream, read::LinearReader};
use recording::{BeginRecord, RecordingInfo, RecordingSource, RecordingWriter, WriteOptions};
use schemas::frame::{EndReason, Frame, FrameSink, FrameSource, Received};
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::BufWriter;

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

/// Topic, log time and contents of every message, as another program reads them.
fn messages(place: &Place, file: &str) -> Vec<(String, u64, Vec<u8>)> {
    let bytes = fs::read(place.path(file)).unwrap();
    let message = |message: mcap::Message<'_>| {
        (message.channel.topic.clone(), message.log_time, message.data.into_owned())
    };
    MessageStream::new(&bytes).unwrap().map(|found| message(found.unwrap())).collect()
}

/// Attachments and metadata of others, as another program reads them.
fn records(place: &Place, file: &str) -> Vec<String> {
    let bytes = fs::read(place.path(file)).unwrap();
    let found = LinearReader::new(&bytes).unwrap().filter_map(|record| match record.unwrap() {
        Record::Metadata(metadata) if metadata.name == "mine" => Some(format!("{metadata:?}")),
        Record::Attachment { header, data, .. } if header.name != "run.toml" => {
            Some(format!("{header:?} {data:?}"))
        }
        _ => None,
    });
    found.collect()
}

/// The recording `from` again, as another program may write it that adds a channel: a note about every tenth state.
fn add_notes(place: &Place, from: &str, to: &str) {
    let bytes = fs::read(place.path(from)).unwrap();
    let metadata: Vec<_> = LinearReader::new(&bytes)
        .unwrap()
        .filter_map(|record| match record.unwrap() {
            Record::Metadata(metadata) => Some(metadata),
            _ => None,
        })
        .collect();
    let file = BufWriter::new(File::create(place.path(to)).unwrap());
    let mut writer = mcap::WriteOptions::new().profile("beadline").create(file).unwrap();
    writer.write_metadata(&metadata[0]).unwrap();
    let operator = BTreeMap::from([("operator".to_owned(), "me".to_owned())]);
    writer.write_metadata(&Metadata { name: "mine".to_owned(), metadata: operator }).unwrap();
    let (name, media_type) = ("../notes.txt".to_owned(), "text/plain".to_owned());
    let attachment =
        Attachment { log_time: 1, create_time: 2, name, media_type, data: b"dark".as_slice().into() };
    writer.attach(&attachment).unwrap();
    let schema = writer.add_schema("Note", "jsonschema", b"{}").unwrap();
    let notes = writer.add_channel(schema, "/notes", "json", &BTreeMap::new()).unwrap();
    let mut states = 0_u32;
    let mut ours = BTreeMap::new();
    for message in MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let channel_id = *ours.entry(message.channel.id).or_insert_with(|| {
            let schema = message.channel.schema.as_ref().unwrap();
            let schema = writer.add_schema(&schema.name, &schema.encoding, &schema.data).unwrap();
            writer.add_channel(schema, &message.channel.topic, "protobuf", &BTreeMap::new()).unwrap()
        });
        let (log_time, publish_time) = (message.log_time, message.publish_time);
        let header = MessageHeader { channel_id, sequence: message.sequence, log_time, publish_time };
        writer.write_to_known_channel(&header, &message.data).unwrap();
        states += u32::from(message.channel.topic == "/summary");
        if message.channel.topic == "/summary" && states.is_multiple_of(10) {
            let (log_time, sequence) = (message.log_time, states);
            let header = MessageHeader { channel_id: notes, sequence, log_time, publish_time: log_time + 5 };
            writer.write_to_known_channel(&header, format!("{{\"states\":{states}}}").as_bytes()).unwrap();
        }
    }
    writer.write_metadata(metadata.last().unwrap()).unwrap();
    writer.finish().unwrap();
}

/// Byte for byte, with what else is in the file.
#[test]
fn thinned_and_expanded_messages_are_the_same_and_other_channels_stay_whole() {
    let place = Place::new();
    place.run(&format!("{SMALL} --out ours.mcap")).exits(0);
    add_notes(&place, "ours.mcap", "full.mcap");
    let full = messages(&place, "full.mcap");
    let notes = |messages: &[(String, u64, Vec<u8>)]| -> Vec<_> {
        messages.iter().filter(|message| message.0 == "/notes").cloned().collect()
    };
    assert!(notes(&full).len() > 100);
    for jobs in [1, 3] {
        let (sparse, back) = (format!("sparse{jobs}.mcap"), format!("back{jobs}.mcap"));
        place.run(&format!("thin full.mcap --every-steps 100 --jobs {jobs} --out {sparse}")).exits(0);
        let thinned = messages(&place, &sparse);
        assert!(notes(&thinned) == notes(&full) && thinned.len() < full.len() / 10);
        place.run(&format!("expand {sparse} --jobs {jobs} --out {back}")).exits(0);
        assert!(messages(&place, &back) == full, "the messages, or their order, differ");
        assert_eq!(records(&place, &back), records(&place, "full.mcap"));
    }
    assert_eq!(records(&place, "full.mcap").len(), 2);
    let named = ["metadata `mine`", "attachment `../notes.txt`"];
    for command in ["recover back1.mcap --out whole.mcap", "verify whole.mcap"] {
        let told = place.run(command).exits(0).stdout();
        assert!(named.iter().all(|name| told.contains(name)), "{told}");
    }
    assert_eq!(records(&place, "whole.mcap"), records(&place, "full.mcap"));
}

/// States between frames have no frame number; they are proven, lent to who asks for every step, and gone again when
/// the frames are asked for.
#[test]
fn steps_between_frames_can_be_recorded_too() {
    let place = Place::new();
    place.run(&format!("{SMALL} --publish-every-steps 7 --record-every-steps 70 --out sparse.mcap")).exits(0);
    place.run("expand sparse.mcap --out frames.mcap").exits(0);
    let all = place.run("expand sparse.mcap --every-steps 1 --out all.mcap --json").exits(0).json();
    let last_step = RecordingInfo::read(&place.path("all.mcap")).unwrap().last_step.unwrap();
    assert_eq!(all["states"].as_u64(), Some(last_step + 1));
    // who reads frames does not see them
    assert!(states(&place, "all.mcap") == states(&place, "frames.mcap"));
    let verified = place.run("verify all.mcap --json").exits(0).json();
    assert_eq!(verified["states"].as_u64(), Some(last_step + 1));
    place.run("energies all.mcap --every-step --out all.csv").exits(0);
    place.run("energies sparse.mcap --every-step --out sparse.csv").exits(0);
    assert!(place.read("all.csv") == place.read("sparse.csv"));
    place.run("thin all.mcap --every-steps 7 --out thinned.mcap").exits(0);
    assert!(messages(&place, "thinned.mcap") == messages(&place, "frames.mcap"));
}

/// A part that begins in mid-run, where no state is due, and says what it follows.
/// States between frames stand before the frame that a time asks for: readers of frames pass over them.
#[test]
fn frames_are_found_among_states_between_them() {
    let place = Place::new();
    let config = "[chain]\nbeads = 5\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n[striker]\nbead = 0\nvelocity_m_s = 1.0\n\
        [time]\nduration_s = 1e-3\n[stream]\npublish_every_steps = 7\nrecord_every_steps = 21\n";
    place.write("sp.toml", config);
    place.run("run sp.toml").exits(0);
    place.run("expand sp.mcap --every-steps 1 --out all.mcap").exits(0);
    for from in ["1e-4", "2.01e-4", "9e-4"] {
        place.run(&format!("energies sp.mcap --fill-gaps --from {from} --out sp.csv --force")).exits(0);
        place.run(&format!("energies all.mcap --from {from} --out all.csv --force")).exits(0);
        assert_eq!(place.read("all.csv"), place.read("sp.csv"));
        place.run(&format!("plot all.mcap --what velocity --at {from} --out all.svg --force")).exits(0);
    }
}

#[test]
fn a_part_stays_a_part() {
    let place = Place::new();
    place.run(&format!("{SMALL} --out run.mcap")).exits(0);
    let mut source = RecordingSource::open(&place.path("run.mcap")).unwrap();
    let manifest = source.manifest().clone();
    let begin = BeginRecord { first_step: 333, part: 2, previous_state_hash: Some("ab".repeat(32)) };
    let (path, options) = (place.path("part.mcap"), WriteOptions::default());
    let mut part = RecordingWriter::create_from(&path, &manifest, None, &begin, &options).unwrap();
    source.seek_to_step(333).unwrap();
    while let Received::Frame(frame @ Frame { step: ..=2345, .. }) = source.receive().unwrap() {
        part.accept(&frame).unwrap();
    }
    part.finish(EndReason::Continued).unwrap();

    place.run("thin part.mcap --every-steps 100 --out sparse.mcap").exits(0);
    place.run("expand sparse.mcap --out back.mcap").exits(0);
    assert!(messages(&place, "back.mcap") == messages(&place, "part.mcap"));
    let ends = ["part.mcap", "sparse.mcap", "back.mcap"].map(|file| {
        let info = RecordingInfo::read(&place.path(file)).unwrap();
        assert_eq!((&info.begin, info.first_step, info.last_step), (&begin, Some(333), Some(2345)), "{file}");
        info.end.unwrap()
    });
    assert!(ends[0] == ends[1] && ends[0] == ends[2]);
    assert_eq!(ends[0].previous_state_hash, begin.previous_state_hash);
}

/// It begins and ends between frames, as one may that was recovered.
#[test]
fn the_first_and_the_last_state_are_kept_wherever_they_are() {
    let place = Place::new();
    place.run(&format!("{SMALL} --publish-every-steps 7 --out run.mcap")).exits(0);
    place.run("expand run.mcap --every-steps 1 --out all.mcap").exits(0);
    let fewer = place.run("expand all.mcap --out frames.mcap").exits(2);
    fewer.says(&["states of the recording", "beadline thin"]);
    let mut source = RecordingSource::open_all(&place.path("all.mcap")).unwrap();
    let (manifest, options) = (source.manifest().clone(), WriteOptions::default());
    let begin = BeginRecord { first_step: 333, ..BeginRecord::default() };
    let path = place.path("cut.mcap");
    let mut cut = RecordingWriter::create_from(&path, &manifest, None, &begin, &options).unwrap();
    source.seek_to_step(333).unwrap();
    while let Received::Frame(frame @ Frame { step: ..=2341, .. }) = source.receive().unwrap() {
        cut.accept(&frame).unwrap();
    }
    cut.finish(EndReason::Interrupted).unwrap();
    place.run("thin cut.mcap --every-steps 70 --out sparse.mcap").exits(0);
    let info = RecordingInfo::read(&place.path("sparse.mcap")).unwrap();
    assert_eq!((info.first_step, info.last_step), (Some(333), Some(2341)));
    // 350 to 2310, and these two
    assert_eq!(info.frames(), 31);
}

#[test]
fn what_was_not_closed_is_to_be_recovered_first() {
    let place = Place::new();
    place.run(&format!("{SMALL} --out run.mcap")).exits(0);
    let bytes = fs::read(place.path("run.mcap")).unwrap();
    fs::write(place.path("cut.mcap"), &bytes[..bytes.len() / 2]).unwrap();
    for command in ["thin cut.mcap --every-steps 100 --out a.mcap", "expand cut.mcap --out a.mcap"] {
        place.run(command).exits(2).says(&["not closed", "beadline recover cut.mcap"]);
    }
    assert!(!place.path("a.mcap").exists() && !place.path("a.mcap.partial").exists());
}

/// A signal ends it at once, also in the middle of the one interval that there is, and leaves nothing behind.
#[test]
fn who_is_stopped_leaves_nothing_behind() {
    let place = Place::new();
    place.run("run --preset homogeneous --name long --record-every-steps 1000000 --out long.mcap").exits(0);
    let thinning = place.start("thin long.mcap --every-steps 1000000 --out a.mcap");
    wait_until("the new file", || place.path("a.mcap.partial").exists().then_some(()));
    thinning.signal("INT");
    thinning.wait().exits(3).says(&["stopped: nothing was written"]);
    assert!(!place.path("a.mcap").exists() && !place.path("a.mcap.partial").exists());
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
    run.wait().exits(3);
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
    place.run("thin run.mcap --every-steps 40 --out a.mcap").exits(2).says(&["exists", "--force"]);
    assert_eq!(place.read("a.mcap"), "something else");
    place.run("thin run.mcap --every-steps 40 --out sparse.mcap").exits(0);
    // it would drop the states of steps 40 and 80, and have more than there were
    let fewer = place.run("expand sparse.mcap --every-steps 12 --out b.mcap").exits(2);
    fewer.says(&["divisor of 40", "beadline thin"]);
}

/// Going on would leave out the states between frames that were there, so it is refused and nothing is touched.
#[test]
fn a_recording_with_states_between_frames_is_not_gone_on_with() {
    let place = Place::new();
    place.run(&format!("{SMALL} --publish-every-steps 7 --out run.mcap")).exits(0);
    place.run("expand run.mcap --every-steps 1 --out all.mcap").exits(0);
    let bytes = fs::read(place.path("all.mcap")).unwrap();
    fs::write(place.path("cut.mcap.partial"), &bytes[..bytes.len() / 2]).unwrap();
    place.run("run --resume cut.mcap.partial").exits(2).says(&["states between frames", "beadline thin"]);
    assert_eq!(fs::read(place.path("cut.mcap.partial")).unwrap().len(), bytes.len() / 2);
    assert!(!place.path("cut.mcap").exists());
    place.run("expand run.mcap --every-steps 70 --out fewer.mcap").exits(2).says(&["beadline thin"]);
}
