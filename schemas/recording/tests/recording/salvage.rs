//! Reading on after damage: what comes before and after it is what it was, and nothing else is believed.

use crate::hostile::records;
use crate::run::{manifest, options, put, temp_dir, write_recording};
use mcap::records::op;
use recording::{Audit, Audited, Compression, DamageKind, WriteOptions};
use std::fs;
use std::path::Path;

const BOTH: [Compression; 2] = [Compression::None, Compression::Zstd { level: 1 }];

/// Steps of the states under checksums that hold, and the damages by kind and chunk.
fn salvaged(path: &Path) -> (Vec<u64>, Vec<(DamageKind, Option<u64>)>) {
    let mut audit = Audit::open(path).unwrap();
    let mut steps = Vec::new();
    loop {
        match audit.read_next().unwrap() {
            Audited::State(state) if state.is_checked => steps.push(state.step),
            Audited::End => break,
            _ => {}
        }
    }
    (steps, audit.damages().iter().map(|damage| (damage.kind, damage.chunk)).collect())
}

#[test]
fn a_damaged_chunk_costs_what_is_in_it_and_no_more() {
    for compression in BOTH {
        let (_directory, path) = temp_dir();
        write_recording(&path, &manifest(57, 1, 1), &WriteOptions { compression, ..options() });
        let bytes = fs::read(&path).unwrap();
        assert_eq!(salvaged(&path), ((0..=57).collect(), vec![]));
        let chunks: Vec<_> = records(&bytes).into_iter().filter(|record| record.0 == op::CHUNK).collect();
        for (number, (_, at, length)) in chunks.iter().enumerate() {
            let mut changed = bytes.clone();
            changed[at + 9 + length / 2] ^= 4;
            put(&path, &changed);
            let (steps, damages) = salvaged(&path);
            assert_eq!(damages, [(DamageKind::Chunk, Some(number as u64))]);
            assert!((40..58).contains(&steps.len()), "{compression:?}, chunk {number}: {steps:?}");
        }
    }
}

/// Lengths that lie lead nowhere, and the next chunk is found all the same.
#[test]
fn a_wrong_length_costs_one_chunk_at_the_most() {
    for compression in BOTH {
        let (_directory, path) = temp_dir();
        write_recording(&path, &manifest(57, 1, 1), &WriteOptions { compression, ..options() });
        let bytes = fs::read(&path).unwrap();
        for (opcode, at, _) in records(&bytes) {
            if ![op::CHUNK, op::MESSAGE_INDEX].contains(&opcode) {
                continue;
            }
            for bit in [0, 3, 8, 14, 40, 63] {
                let mut changed = bytes.clone();
                changed[at + 1 + bit / 8] ^= 1 << (bit % 8);
                put(&path, &changed);
                let (steps, damages) = salvaged(&path);
                assert!(
                    !damages.is_empty() && steps.len() >= 40,
                    "bit {bit} of the record at {at}: {steps:?}"
                );
            }
        }
    }
}

#[test]
fn a_file_that_was_cut_anywhere_gives_its_whole_chunks() {
    for compression in BOTH {
        let (_directory, path) = temp_dir();
        write_recording(&path, &manifest(57, 1, 1), &WriteOptions { compression, ..options() });
        let bytes = fs::read(&path).unwrap();
        let chunks: Vec<_> = records(&bytes).into_iter().filter(|record| record.0 == op::CHUNK).collect();
        let first = chunks[0].1;
        let mut last = 0;
        for cut in (first..bytes.len()).step_by(bytes.len() / 97) {
            for zeros in [0, 5000] {
                let mut part = bytes[..cut].to_vec();
                part.resize(cut + zeros, 0);
                put(&path, &part);
                let (steps, _) = salvaged(&path);
                assert!(steps.len() >= last && steps.len() as u64 == steps.last().map_or(0, |step| step + 1));
                last = steps.len();
            }
        }
        assert_eq!(last, 58);
    }
}

/// A file full of what looks like chunks costs no more than a few times its size.
#[test]
fn what_only_looks_like_chunks_is_not_looked_at_for_ever() {
    let (_directory, path) = temp_dir();
    write_recording(&path, &manifest(9, 1, 1), &options());
    let mut bytes = fs::read(&path).unwrap();
    let chunk = records(&bytes).into_iter().find(|record| record.0 == op::CHUNK).unwrap();
    bytes.truncate(chunk.1);
    let claimed = 1_u64 << 20;
    let mut fake = vec![op::CHUNK];
    fake.extend((claimed + 40).to_le_bytes());
    fake.extend([0; 16]);
    fake.extend(claimed.to_le_bytes());
    fake.extend([1, 1, 1, 1, 0, 0, 0, 0]);
    fake.extend(claimed.to_le_bytes());
    bytes.push(0);
    bytes.extend(fake.repeat(100_000));
    put(&path, &bytes);
    let (steps, damages) = salvaged(&path);
    assert!(steps.is_empty());
    assert_eq!(damages.len(), 1);
}
