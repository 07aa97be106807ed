//! Changes that damage or malice would make.

use crate::checksums;
use crate::metadata::Metadata;
use crate::random::Random;
use crate::records::{Chunk, Parts, Record, op};

/// What a mutation may be told to do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Checksums {
    /// Left as they are, so that most changes are noticed by them.
    Stale,
    /// Made right again, so that the change itself must be noticed, or survived.
    Right,
}

/// Changes the file `bytes` in one to four places, as `random` has it.
pub fn mutate(bytes: &[u8], random: &mut Random, checksums: Checksums) -> Vec<u8> {
    let mut changed = bytes.to_vec();
    for _ in 0..=random.below(4) {
        changed = match random.below(8) {
            0 | 1 => change_bytes(&changed, random),
            2 => change_order(&changed, random),
            3 | 4 => change_record(&changed, random),
            5 => change_text(&changed, random),
            _ => change_within_chunk(&changed, random),
        };
    }
    if checksums == Checksums::Right {
        checksums::correct(&mut changed);
    }
    changed
}

/// Numbers that programs trip over.
fn odd_number(random: &mut Random) -> u64 {
    let near = random.one_of([0, 1, 7, 8, 127, 128, 255, 256, 65_535, 1 << 20, 1 << 30, 1 << 31, 1 << 52]);
    let far = random.one_of([1 << 62, i64::MAX.unsigned_abs(), u64::MAX, u64::MAX - 8, u64::from(u32::MAX)]);
    random.one_of([near, far, random.clone().number(), near.wrapping_sub(1), near + 1])
}

/// Changes some bytes wherever they are.
pub fn change_bytes(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut changed = bytes.to_vec();
    let at = random.below(bytes.len());
    let length = random.one_of([1, 2, 4, 8, 9, 64, 512]).min(bytes.len() - at);
    match random.below(9) {
        0 | 1 => {
            if let Some(byte) = changed.get_mut(at) {
                *byte ^= 1 << random.below(8);
            }
        }
        2 => {
            if let Some(byte) = changed.get_mut(at) {
                *byte = random.byte();
            }
        }
        3 => {
            let number = odd_number(random).to_le_bytes();
            let size = random.one_of([2, 4, 8]).min(length);
            changed[at..at + size].copy_from_slice(&number[..size]);
        }
        4 => changed.truncate(at),
        5 => drop(changed.drain(at..at + length)),
        6 => {
            let copy = bytes[at..at + length].to_vec();
            let to = random.below(bytes.len());
            changed.splice(to..to, copy);
        }
        7 => {
            let from = random.below(bytes.len() - length + 1);
            changed[at..at + length].copy_from_slice(&bytes[from..from + length]);
        }
        _ => changed[at..at + length].fill(random.one_of([0, 0xff, 0x20])),
    }
    changed
}

/// Takes records away, doubles them, exchanges them.
fn change_order(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut parts = Parts::of_file(bytes);
    shuffle(&mut parts.records, random);
    parts.put_together()
}

fn shuffle(records: &mut Vec<Record>, random: &mut Random) {
    if records.is_empty() {
        return;
    }
    let (at, other) = (random.below(records.len()), random.below(records.len()));
    match random.below(6) {
        0 => drop(records.remove(at)),
        1 => {
            let copy = records[at].clone();
            records.insert(other, copy);
        }
        2 => records.swap(at, other),
        3 => records[at].opcode = random.one_of([random.clone().byte(), random.clone().byte() & 0x0f]),
        4 => records[at].body = records[other].body.clone(),
        _ => records.truncate(at),
    }
}

/// Changes the contents of one record; its length stays right.
fn change_record(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut parts = Parts::of_file(bytes);
    let at = random.below(parts.records.len());
    if let Some(record) = parts.records.get_mut(at).filter(|record| !record.body.is_empty()) {
        record.body = change_bytes(&record.body, random);
    }
    parts.put_together()
}

/// Changes the records in a chunk, with the sizes and the CRC that they then have.
fn change_within_chunk(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut parts = Parts::of_file(bytes);
    let chunks: Vec<_> =
        (0..parts.records.len()).filter(|at| parts.records[*at].opcode == op::CHUNK).collect();
    let Some(at) = chunks.get(random.below(chunks.len())).copied() else { return parts.put_together() };
    let Some(mut chunk) = Chunk::unpack(&parts.records[at].body) else { return parts.put_together() };
    if random.one_in(4) && !chunk.contents.is_empty() {
        chunk.contents = change_bytes(&chunk.contents, random);
    } else {
        let mut inner = Parts::of_chunk(&chunk.contents);
        let which = random.below(inner.records.len());
        if random.one_in(3) {
            shuffle(&mut inner.records, random);
        } else if let Some(record) = inner.records.get_mut(which).filter(|record| !record.body.is_empty()) {
            record.body = change_bytes(&record.body, random);
        }
        chunk.contents = inner.put_together();
    }
    let compressed = if random.one_in(4) { !chunk.is_compressed() } else { chunk.is_compressed() };
    parts.records[at].body = chunk.pack(compressed);
    parts.put_together()
}

/// Exchanges a number in the manifest, or in another text, for an odd one.
fn change_text(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut parts = Parts::of_file(bytes);
    let texts: Vec<_> =
        (0..parts.records.len()).filter(|at| matches!(parts.records[*at].opcode, op::METADATA)).collect();
    let Some(at) = texts.get(random.below(texts.len())).copied() else { return parts.put_together() };
    change_number(&mut parts.records[at].body, random);
    parts.put_together()
}

/// Exchanges one decimal number in a metadata record for another.
fn change_number(body: &mut Vec<u8>, random: &mut Random) {
    let Some(mut metadata) = Metadata::read(body) else { return };
    let which = random.below(metadata.entries.len());
    let Some((_, text)) = metadata.entries.get_mut(which) else { return };
    let is_part = |byte: u8| byte.is_ascii_digit() || matches!(byte, b'.' | b'e' | b'-');
    let bytes = text.as_bytes();
    let begins = |at: usize| at == 0 || !is_part(bytes[at - 1]) && !bytes[at - 1].is_ascii_alphanumeric();
    let starts: Vec<_> = (0..bytes.len()).filter(|at| bytes[*at].is_ascii_digit() && begins(*at)).collect();
    let Some(start) = starts.get(random.below(starts.len())).copied() else { return };
    let end = (start..bytes.len()).find(|at| !is_part(bytes[*at])).unwrap_or(bytes.len());
    let number = match random.below(4) {
        0 => odd_number(random).to_string(),
        1 => f64::from_bits(random.number()).to_string(),
        2 => random.one_of(["0", "-1", "1e-300", "1e308", "1e400", "null", "[]", "1.0", "\"\""]).to_owned(),
        _ => random
            .one_of(["4503599627370496", "4503599627370497", "20000000", "20000001", "2", "1e-9"])
            .to_owned(),
    };
    text.replace_range(start..end, &number);
    *body = metadata.write();
}
