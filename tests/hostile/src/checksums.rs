//! Checksums made right again, so that what they protect is looked at.

use crate::records::{Chunk, Parts, Record, op, take_string};
use sha2::{Digest, Sha256};

/// Where the CRC stands in a chunk record.
const CHUNK_CRC: usize = 8 + 8 + 8;

/// Gives a file the checksums that its bytes have: of the manifest, the chunks, the attachments, the data section
/// and the summary section. What cannot be taken apart is left as it is, and a chunk that cannot be unpacked gets the
/// CRC 0, which means that there is none.
pub fn correct(bytes: &mut Vec<u8>) {
    let mut parts = Parts::of_file(bytes);
    for record in &mut parts.records {
        match record.opcode {
            op::METADATA => correct_manifest(&mut record.body),
            op::CHUNK => correct_chunk(&mut record.body),
            op::ATTACHMENT => correct_attachment(&mut record.body),
            _ => {}
        }
    }
    let mut corrected = parts.put_together();
    correct_sections(&mut corrected);
    *bytes = corrected;
}

fn correct_chunk(body: &mut [u8]) {
    let crc = Chunk::unpack(body).map_or(0, |chunk| crc32fast::hash(&chunk.contents));
    if let Some(place) = body.get_mut(CHUNK_CRC..CHUNK_CRC + 4) {
        place.copy_from_slice(&crc.to_le_bytes());
    }
}

fn correct_attachment(body: &mut [u8]) {
    if let Some((content, place)) = body.split_last_chunk_mut::<4>() {
        *place = crc32fast::hash(content).to_le_bytes();
    }
}

/// Gives the contents of a metadata record `beadline.run` the checksum that they have.
pub fn correct_manifest(body: &mut [u8]) {
    let Some((b"beadline.run", entries)) = take_string(body) else { return };
    let begin = body.len() - entries.len() + 4;
    let mut found = [(); 4].map(|()| 0..0);
    let mut at = begin;
    while let Some((key, rest)) = body.get(at..).and_then(take_string) {
        let Some((value, rest)) = take_string(rest) else { break };
        let end = body.len() - rest.len();
        let names: [&[u8]; 4] = [b"schema_version", b"physics", b"provenance", b"checksum"];
        if let Some(which) = names.iter().position(|name| *name == key) {
            found[which] = end - value.len()..end;
        }
        at = end;
    }
    let mut hash = Sha256::new_with_prefix(b"beadline.run\n");
    for part in &found[..3] {
        hash.update(&body[part.clone()]);
        hash.update(b"\n");
    }
    let digest = hash.finalize();
    let Some(place) = body.get_mut(found[3].clone()).filter(|place| place.len() == 2 * digest.len()) else {
        return;
    };
    for (digits, byte) in place.chunks_exact_mut(2).zip(digest) {
        let digit = |value: u8| b"0123456789abcdef"[usize::from(value)];
        digits.copy_from_slice(&[digit(byte >> 4), digit(byte & 0xf)]);
    }
}

fn correct_sections(bytes: &mut [u8]) {
    let records = Parts::of_file(bytes).records;
    let Some(data_end) = records.iter().position(|record| record.opcode == op::DATA_END) else { return };
    let Record { offset, .. } = records[data_end];
    let crc = crc32fast::hash(&bytes[..offset]);
    put(bytes, &records[data_end], 0, crc);
    let (Some(first), Some(footer)) = (records.get(data_end + 1), records.last()) else { return };
    // start of the summary, start of the summary offsets, CRC
    if footer.opcode == op::FOOTER && footer.body.len() >= 20 {
        let crc = crc32fast::hash(&bytes[first.offset..footer.offset + 9 + 16]);
        put(bytes, footer, 16, crc);
    }
}

fn put(bytes: &mut [u8], record: &Record, at: usize, crc: u32) {
    let place = record.offset + 9 + at;
    if record.body.len() >= at + 4 {
        bytes[place..place + 4].copy_from_slice(&crc.to_le_bytes());
    }
}
