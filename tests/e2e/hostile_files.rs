//! Files that somebody made to do harm, given to the built command.

use crate::harness::{Ended, Place, Running};
use hostile::campaign::Campaign;
use hostile::checksums;
use hostile::metadata::{Metadata, put_string};
use hostile::records::{Chunk, Parts, Record, op};
use std::fs;
use std::path::Path;

const COMMANDS: [&str; 5] = ["info", "verify", "energies", "contacts", "recover --out saved.mcap --force"];

fn golden(name: &str) -> Vec<u8> {
    fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/1.0-kernel-2").join(name)).unwrap()
}

/// A short version of what `beadline-hostile`'s program `mutate` does for longer:
///
///     cargo run --release -p beadline-hostile --bin mutate -- --count 100000 tests/golden/*/{sparse,partial}.mcap*
#[test]
fn random_changes_of_a_recording_are_survived() {
    let place = Place::new();
    let campaign = Campaign {
        program: Path::new(env!("CARGO_BIN_EXE_beadline")),
        commands: &["info", "verify", "recover --force --out recovered.mcap", "energies"].map(str::to_owned),
        recordings: &["sparse.mcap", "contacts.mcap", "partial.mcap.partial"].map(golden),
        seed: 1 << 40,
        // a thousand, each given to every command: more than 1 GiB, 10 s of a processor or two minutes is a failure
        count: 1000,
        jobs: 2,
        directory: &place.path("."),
    };
    let outcome = campaign.run(|_| ()).unwrap();
    assert!(outcome.failures.is_empty(), "{:#?}", outcome.failures);
    // it is worth nothing if all of them are refused for the same reason
    let kinds = outcome.exits[0];
    assert!(kinds[0] > 0 && kinds[2] > 0 && kinds[3] > 0, "{kinds:?}");
}

/// `sparse.mcap` as `change` leaves it, with right checksums, under `hostile.mcap`.
fn forge(place: &Place, change: impl FnOnce(&mut Parts)) {
    let mut parts = Parts::of_file(&golden("sparse.mcap"));
    change(&mut parts);
    let mut bytes = parts.put_together();
    checksums::correct(&mut bytes);
    fs::write(place.path("hostile.mcap"), bytes).unwrap();
}

/// Runs a command on `hostile.mcap` with at most `memory_mib` of address space.
fn run_within(place: &Place, memory_mib: u64, command: &str) -> Ended {
    let program = env!("CARGO_BIN_EXE_beadline");
    let script = format!("ulimit -v {}; exec {program} {command} hostile.mcap", memory_mib << 10);
    Running::start(command, place.foreign("sh", ["-c", script.as_str()])).wait()
}

/// Without the limits on what lengths claim, this takes 4 GiB.
#[test]
fn lengths_that_claim_gigabytes_reserve_nothing() {
    let place = Place::new();
    // the claim of a string, in each record that has one
    for (opcode, at) in [(0x01, 0), (op::METADATA, 0), (op::CHUNK, 28), (op::METADATA_INDEX, 16), (0x04, 4)] {
        forge(&place, |parts| {
            let records = parts.records.iter_mut().filter(|record| record.opcode == opcode);
            records
                .for_each(|record| record.body[at..at + 4].copy_from_slice(&0xfff0_0000_u32.to_le_bytes()));
        });
        for command in COMMANDS {
            let ended = run_within(&place, 512, command);
            assert!([0, 2, 3].contains(&ended.code().unwrap_or(-1)), "{command}: {}", ended.stderr());
        }
    }
    // 1 GiB in a chunk of some hundred bytes
    forge(&place, |parts| {
        let chunk = parts.records.iter_mut().find(|record| record.opcode == op::CHUNK).unwrap();
        chunk.body[16..24].copy_from_slice(&(1_u64 << 30).to_le_bytes());
    });
    for command in COMMANDS {
        let ended = run_within(&place, 512, command);
        assert!([0, 2, 3].contains(&ended.code().unwrap_or(-1)), "{command}: {}", ended.stderr());
    }
}

/// 256 MiB of zeros in a message of another channel, in 8 kB: memory is bounded by the chunk.
#[test]
fn a_chunk_that_unpacks_to_much_takes_no_more_than_that() {
    let place = Place::new();
    forge(&place, |parts| {
        let at = parts.records.iter().position(|record| record.opcode == op::CHUNK).unwrap();
        let mut chunk = Chunk::unpack(&parts.records[at].body).unwrap();
        chunk.contents = vec![0x8f];
        chunk.contents.extend((256_u64 << 20).to_le_bytes());
        chunk.contents.resize(9 + (256 << 20), 0);
        let body = chunk.pack(true);
        assert!(body.len() < 20_000);
        parts.records.insert(at + 1, Record { opcode: op::CHUNK, body, offset: usize::MAX });
    });
    for command in COMMANDS {
        let ended = run_within(&place, 768, command);
        assert!([0, 2, 3].contains(&ended.code().unwrap_or(-1)), "{command}: {}", ended.stderr());
    }
}

/// A chunk of `count` times `piece`, after the first one of `sparse.mcap`, in a file without an end.
fn with_chunks(place: &Place, contents: &[u8], count: usize) -> usize {
    let mut parts = Parts::of_file(&golden("sparse.mcap"));
    let at = parts.records.iter().position(|record| record.opcode == op::CHUNK).unwrap();
    let mut chunk = Chunk::unpack(&parts.records[at].body).unwrap();
    chunk.contents = contents.to_vec();
    let body = chunk.pack(true);
    parts.records.truncate(at + 1);
    parts.rest.clear();
    let record = Record { opcode: op::CHUNK, body, offset: usize::MAX };
    parts.records.extend(std::iter::repeat_n(record, count));
    let bytes = parts.put_together();
    fs::write(place.path("hostile.mcap"), &bytes).unwrap();
    bytes.len()
}

/// A record that nobody knows, of so many zeros.
fn zeros(length: usize) -> Vec<u8> {
    let mut contents = vec![0x8f];
    contents.extend((length as u64).to_le_bytes());
    contents.resize(9 + length, 0);
    contents
}

/// Nobody writes chunks of hundreds of megabytes: what one may expand to is bounded.
#[test]
fn a_chunk_that_expands_to_more_than_any_of_ours_is_damage() {
    let place = Place::new();
    with_chunks(&place, &zeros(65 << 20), 1);
    let found = place.run("verify hostile.mcap").exits(3).stdout();
    assert!(found.contains("more than 67108864"), "{found}");
    with_chunks(&place, &zeros(63 << 20), 1);
    let found = place.run("verify hostile.mcap").exits(3).stdout();
    assert!(!found.contains("67108864"), "{found}");
}

/// 6 GB of zeros in 200 kB.
#[test]
fn a_glance_at_a_file_reads_a_bounded_part_of_it() {
    let place = Place::new();
    assert!(with_chunks(&place, &zeros(60 << 20), 100) < 1 << 20);
    place.run("info hostile.mcap").exits(3);
    let found = place.run("info hostile.mcap").exits(3).stdout();
    assert!(found.contains("a chunk with which its chunks are more than"), "{found}");
}

/// Empty records, seven million of them in 7 kB: each takes time.
#[test]
fn a_file_of_many_records_is_read_no_longer_than_its_size_allows() {
    let place = Place::new();
    let mut contents = vec![0; 9 << 18];
    contents.iter_mut().step_by(9).for_each(|opcode| *opcode = 0x8f);
    with_chunks(&place, &contents, 50);
    let found = place.run("verify hostile.mcap").exits(3).stdout();
    assert!(found.contains("its chunks claim more records than a file of this size can hold"), "{found}");
}

/// A schema with a name of a megabyte, and as many channels of it as there can be.
#[test]
fn the_names_of_schemas_are_counted_with_each_channel() {
    let place = Place::new();
    let mut contents = vec![0x03];
    let mut schema = 900_u16.to_le_bytes().to_vec();
    put_string(&vec![b'a'; 1 << 20], &mut schema);
    put_string(b"", &mut schema);
    put_string(b"", &mut schema);
    contents.extend((schema.len() as u64).to_le_bytes());
    contents.extend(schema);
    for id in 1000..20_000_u16 {
        let mut channel = [id.to_le_bytes(), 900_u16.to_le_bytes()].concat();
        (0..3).for_each(|_| put_string(b"", &mut channel));
        contents.push(0x04);
        contents.extend((channel.len() as u64).to_le_bytes());
        contents.extend(channel);
    }
    with_chunks(&place, &contents, 1);
    for command in COMMANDS {
        let ended = run_within(&place, 768, command);
        assert!([0, 2, 3].contains(&ended.code().unwrap_or(-1)), "{command}: {}", ended.stderr());
    }
}

/// What is recovered verifies, or it is said why not.
#[test]
fn what_is_recovered_is_proven_or_it_says_why_not() {
    let place = Place::new();
    let recordings =
        ["sparse.mcap", "results-part-0001.mcap", "partial.mcap.partial", "loaded.mcap"].map(golden);
    let campaign = Campaign {
        program: Path::new(env!("CARGO_BIN_EXE_beadline")),
        commands: &[],
        recordings: &recordings,
        seed: 0,
        count: 0,
        jobs: 1,
        directory: &place.path("."),
    };
    let mut counts = [0; 2];
    for seed in (1 << 41)..(1 << 41) + 80 {
        fs::write(place.path("mutated.mcap"), campaign.mutation(seed)).unwrap();
        let recovered = place.run("recover mutated.mcap --out saved.mcap --force --json");
        let code = recovered.code().unwrap();
        if code == 1 || code == 2 {
            continue;
        }
        let verified = place.run("verify saved.mcap --json");
        let said = &recovered.json()["verified"];
        let is_proven = verified.code() == Some(0);
        assert_eq!(said["proven"], is_proven, "mutation {seed}: {said}, then {}", verified.stdout());
        assert_eq!(said["verdict"], verified.json()["verdict"], "mutation {seed}");
        assert!(is_proven || said["verdict"].as_str().is_some_and(|verdict| !verdict.is_empty()));
        counts[usize::from(is_proven)] += 1;
    }
    assert!(counts[1] > 10, "{counts:?}");
}

/// The numbers of a manifest at the ends of what is allowed: nothing overflows, nothing is reserved that the file
/// does not fill.
#[test]
fn a_manifest_of_the_largest_run_costs_nothing_by_itself() {
    let place = Place::new();
    for (key, values) in [
        ("step_count", ["4503599627370496", "18446744073709551615", "0"].as_slice()),
        ("dt_s", &["1e-300", "5e-324", "0", "1e308"]),
        ("beads", &["20000000", "18446744073709551615", "2", "0"]),
        ("publish_every_steps", &["4503599627370496", "18446744073709551615", "0"]),
        ("record_every_steps", &["4503599627370496", "18446744073709551615", "0"]),
    ] {
        for value in values {
            forge(&place, |parts| set_number(parts, key, value));
            for command in COMMANDS {
                let ended = run_within(&place, 512, command);
                let code = ended.code().unwrap_or(-1);
                assert!([0, 2, 3].contains(&code), "{key} = {value}: {command}: {}", ended.stderr());
            }
        }
    }
}

/// A terminal obeys escape sequences, wherever they come from.
#[test]
fn what_a_file_says_does_not_reach_the_terminal_as_a_command() {
    let place = Place::new();
    forge(&place, |parts| {
        for record in parts.records.iter_mut().filter(|record| record.opcode == op::METADATA) {
            let mut metadata = Metadata::read(&record.body).unwrap();
            if let Some(provenance) = metadata.value("provenance") {
                *provenance = provenance.replace("\"host\":\"golden\"", "\"host\":\"\\u001b[2J\"");
            }
            record.body = metadata.write();
        }
    });
    let info = place.run("info hostile.mcap").exits(0);
    assert!(
        info.stdout().contains("on \\u{1b}[2J") && !info.stdout().contains('\u{1b}'),
        "{}",
        info.stdout()
    );
    place.run("energies no\u{1b}[2J.mcap").exits(2).says(&["no\\u{1b}[2J.mcap"]);
}

/// Sets a number in the manifest's JSON.
fn set_number(parts: &mut Parts, key: &str, number: &str) {
    for record in parts.records.iter_mut().filter(|record| record.opcode == op::METADATA) {
        let mut metadata = Metadata::read(&record.body).unwrap();
        for (_, text) in &mut metadata.entries {
            let Some(at) = text.find(&format!("\"{key}\":")) else { continue };
            let start = at + key.len() + 3;
            let end = start + text[start..].find([',', '}']).unwrap();
            text.replace_range(start..end, number);
        }
        record.body = metadata.write();
    }
}
