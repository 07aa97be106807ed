//! Recordings of versions that do not exist yet.

use crate::harness::Place;
use hostile::metadata::{Metadata, put_string};
use hostile::records::{Chunk, Parts, Record, op};
use hostile::summary::rebuilt;
use std::fs;
use std::path::Path;

const GOLDEN: &str = "tests/golden/1.0-kernel-2";

/// The commands that read a recording. What they write has a name of its own.
const COMMANDS: [&str; 11] = [
    "info later.mcap",
    "verify later.mcap",
    "energies later.mcap",
    "energies later.mcap --every-step",
    "impurity later.mcap",
    "contacts later.mcap --out contacts.mcap",
    "pulses later.mcap",
    "replay later.mcap --wait-for 0",
    "thin later.mcap --every-steps 3 --out thin.mcap",
    "expand later.mcap --out expanded.mcap",
    "recover later.mcap --out recovered.mcap",
];

/// The recording `full.mcap` of 1.0, its metadata as `change` leaves it, under `later.mcap`, with right checksums and indexes.
fn later(place: &Place, change: impl Fn(&mut Metadata), add: impl FnOnce(&mut Parts)) {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join(GOLDEN).join("full.mcap");
    let mut parts = Parts::of_file(&fs::read(golden).unwrap());
    for record in parts.records.iter_mut().filter(|record| record.opcode == op::METADATA) {
        let mut metadata = Metadata::read(&record.body).unwrap();
        change(&mut metadata);
        record.body = metadata.write();
    }
    add(&mut parts);
    fs::write(place.path("later.mcap"), rebuilt(&parts.put_together())).unwrap();
}

fn set(metadata: &mut Metadata, key: &str, change: impl FnOnce(&str) -> String) {
    if let Some(value) = metadata.value(key) {
        *value = change(value);
    }
}

/// Another minor version, and whatever it may add: keys of the provenance and of both metadata records, a record
/// and metadata of new kinds, a channel.
#[test]
fn a_later_minor_version_is_read_with_a_notice() {
    let place = Place::new();
    let change = |metadata: &mut Metadata| {
        set(metadata, "schema_version", |_| "1.7".to_owned());
        set(metadata, "provenance", |json| json.replacen('{', "{\"colour\":\"red\",", 1));
        metadata.entries.push(("mood".to_owned(), "good".to_owned()));
    };
    later(&place, change, |parts| {
        let weather =
            Metadata { name: "beadline.weather".into(), entries: vec![("sky".into(), "blue".into())] };
        parts.records.insert(2, Record { opcode: op::METADATA, body: weather.write(), offset: usize::MAX });
        parts.records.insert(3, Record { opcode: 0x8f, body: b"later".to_vec(), offset: usize::MAX });
        add_channel(parts);
    });
    for command in COMMANDS {
        place.run(command).exits(0).says(&["1.7", "1.1"]);
    }
}

/// Puts a channel of our encoding but of an unknown schema into the first chunk, with a message.
fn add_channel(parts: &mut Parts) {
    let chunk = parts.records.iter_mut().find(|record| record.opcode == op::CHUNK).unwrap();
    let mut contents = Chunk::unpack(&chunk.body).unwrap();
    let mut channel = [77, 0, 0, 0].to_vec();
    for text in ["/weather", "json", ""] {
        put_string(text.as_bytes(), &mut channel);
    }
    let message = [&[77, 0][..], &[0; 20], b"{\"sky\":\"blue\"}"].concat();
    for (opcode, body) in [(0x04, &channel), (op::MESSAGE, &message)] {
        contents.contents.push(opcode);
        contents.contents.extend((body.len() as u64).to_le_bytes());
        contents.contents.extend(body);
    }
    chunk.body = contents.pack(true);
}

#[test]
fn a_later_major_version_is_refused_with_what_to_do() {
    let place = Place::new();
    later(&place, |metadata| set(metadata, "schema_version", |_| "2.0".to_owned()), |_| ());
    for command in COMMANDS {
        place.run(command).exits(2).says(&["2.0", "1.1", "use a Beadline that reads 2.0"]);
    }
}

/// What decides bits may not be passed over.
#[test]
fn a_later_minor_version_with_more_physics_is_refused() {
    let place = Place::new();
    let change = |metadata: &mut Metadata| {
        set(metadata, "schema_version", |_| "1.7".to_owned());
        set(metadata, "physics", |json| json.replacen('{', "{\"friction\":0.1,", 1));
    };
    later(&place, change, |_| ());
    for command in COMMANDS {
        place.run(command).exits(2).says(&["1.7", "1.1", "friction", "use a Beadline that reads 1.7"]);
    }
}

/// Another dynamics is no damage: what is recorded can be read, what is not recorded cannot be recomputed.
#[test]
fn another_kernel_version_is_said_plainly() {
    let place = Place::new();
    let other = |json: &str| json.replace("\"kernel_version\":2", "\"kernel_version\":4");
    later(&place, |metadata| set(metadata, "physics", other), |_| ());
    for command in ["info later.mcap", "energies later.mcap"] {
        place.run(command).exits(0);
    }
    let words = ["kernel version 4", "nothing is wrong with it"];
    place.run("energies later.mcap --every-step").exits(3).says(&words);
    // what can be checked is checked, and nothing is proven
    let text = place.run("verify later.mcap").exits(3).stdout();
    assert!(words.iter().all(|word| text.contains(word)), "{text}");
}
