//! What describes a recording, made again from its messages: for files whose lie is elsewhere.

use crate::checksums;
use crate::metadata::put_string;
use crate::records::{Chunk, MAGIC, Parts, Record, op, take_string};
use std::collections::BTreeMap;

/// The recording `bytes` with the message indexes, the times of chunks and the summary section that its messages have,
/// as our writer would write them, and with right checksums.
pub fn rebuilt(bytes: &[u8]) -> Vec<u8> {
    let mut file = Described { bytes: MAGIC.to_vec(), ..Described::default() };
    for record in Parts::of_file(bytes).records {
        match record.opcode {
            op::MESSAGE_INDEX => {}
            op::DATA_END => break,
            op::CHUNK => file.chunk(&record),
            _ => file.record(&record),
        }
    }
    file.close();
    checksums::correct(&mut file.bytes);
    file.bytes
}

#[derive(Default)]
struct Described {
    bytes: Vec<u8>,
    schemas: BTreeMap<u16, Vec<u8>>,
    channels: BTreeMap<u16, Vec<u8>>,
    chunks: Vec<Vec<u8>>,
    attachments: Vec<Vec<u8>>,
    metadata: Vec<Vec<u8>>,
    counts: BTreeMap<u16, u64>,
    times: Option<(u64, u64)>,
}

fn put_record(bytes: &mut Vec<u8>, opcode: u8, body: &[u8]) {
    bytes.push(opcode);
    bytes.extend((body.len() as u64).to_le_bytes());
    bytes.extend(body);
}

fn numbers(numbers: &[u64]) -> Vec<u8> {
    numbers.iter().flat_map(|number| number.to_le_bytes()).collect()
}

/// Numbers by channel, with their length before them.
fn by_channel(map: &BTreeMap<u16, u64>) -> Vec<u8> {
    let entries: Vec<u8> =
        map.iter().flat_map(|(id, value)| [&id.to_le_bytes()[..], &value.to_le_bytes()].concat()).collect();
    let mut bytes = Vec::new();
    put_string(&entries, &mut bytes);
    bytes
}

fn number(bytes: &[u8], at: usize) -> u64 {
    bytes.get(at..).and_then(|rest| rest.first_chunk()).map_or(0, |number| u64::from_le_bytes(*number))
}

impl Described {
    fn record(&mut self, Record { opcode, body, .. }: &Record) {
        let (offset, length) = (self.bytes.len() as u64, 9 + body.len() as u64);
        put_record(&mut self.bytes, *opcode, body);
        let mut index = numbers(&[offset, length]);
        match *opcode {
            op::METADATA => {
                put_string(take_string(body).map_or(&[][..], |(name, _)| name), &mut index);
                self.metadata.push(index);
            }
            op::ATTACHMENT => {
                let (name, rest) = take_string(&body[16..]).unwrap_or_default();
                let (media_type, rest) = take_string(rest).unwrap_or_default();
                index.extend(numbers(&[number(body, 0), number(body, 8), number(rest, 0)]));
                put_string(name, &mut index);
                put_string(media_type, &mut index);
                self.attachments.push(index);
            }
            _ => {}
        }
    }

    fn chunk(&mut self, record: &Record) {
        let Some(chunk) = Chunk::unpack(&record.body) else { return self.record(record) };
        let mut entries: BTreeMap<u16, Vec<u8>> = BTreeMap::new();
        let mut times: Option<(u64, u64)> = None;
        for inner in Parts::of_chunk(&chunk.contents).records {
            let id =
                |at: usize| inner.body.get(at..at + 2).map_or(0, |id| u16::from_le_bytes([id[0], id[1]]));
            match inner.opcode {
                op::SCHEMA => drop(self.schemas.insert(id(0), inner.body)),
                op::CHANNEL => drop(self.channels.insert(id(0), inner.body)),
                op::MESSAGE => {
                    let time = number(&inner.body, 6);
                    entries.entry(id(0)).or_default().extend(numbers(&[time, inner.offset as u64]));
                    *self.counts.entry(id(0)).or_default() += 1;
                    for times in [&mut times, &mut self.times] {
                        let (first, last) = times.unwrap_or((time, time));
                        *times = Some((first.min(time), last.max(time)));
                    }
                }
                _ => {}
            }
        }
        let (first, last) = times.unwrap_or_default();
        let mut body = record.body.clone();
        body[..16].copy_from_slice(&numbers(&[first, last]));
        let (offset, length) = (self.bytes.len() as u64, 9 + body.len() as u64);
        put_record(&mut self.bytes, op::CHUNK, &body);
        let (indexes, mut places) = (self.bytes.len() as u64, BTreeMap::new());
        for (id, entries) in entries {
            places.insert(id, self.bytes.len() as u64);
            let mut index = id.to_le_bytes().to_vec();
            put_string(&entries, &mut index);
            put_record(&mut self.bytes, op::MESSAGE_INDEX, &index);
        }
        let mut index = numbers(&[first, last, offset, length]);
        index.extend(by_channel(&places));
        index.extend(numbers(&[self.bytes.len() as u64 - indexes]));
        put_string(if chunk.is_compressed() { b"zstd" } else { b"" }, &mut index);
        let after_name = 28 + 4 + if chunk.is_compressed() { 4 } else { 0 };
        index.extend(numbers(&[number(&body, after_name), number(&body, 16)]));
        self.chunks.push(index);
    }

    fn statistics(&self) -> Vec<u8> {
        let count = |list: usize| u32::try_from(list).unwrap_or(u32::MAX).to_le_bytes();
        let mut body = numbers(&[self.counts.values().sum()]);
        body.extend(u16::try_from(self.schemas.len()).unwrap_or(u16::MAX).to_le_bytes());
        for list in [self.channels.len(), self.attachments.len(), self.metadata.len(), self.chunks.len()] {
            body.extend(count(list));
        }
        let (first, last) = self.times.unwrap_or_default();
        body.extend(numbers(&[first, last]));
        body.extend(by_channel(&self.counts));
        body
    }

    fn close(&mut self) {
        put_record(&mut self.bytes, op::DATA_END, &[0; 4]);
        let summary = self.bytes.len() as u64;
        let groups = [
            (op::SCHEMA, self.schemas.values().cloned().collect()),
            (op::CHANNEL, self.channels.values().cloned().collect()),
            (op::STATISTICS, vec![self.statistics()]),
            (op::CHUNK_INDEX, std::mem::take(&mut self.chunks)),
            (op::ATTACHMENT_INDEX, std::mem::take(&mut self.attachments)),
            (op::METADATA_INDEX, std::mem::take(&mut self.metadata)),
        ];
        let mut offsets = Vec::new();
        for (opcode, records) in groups {
            let start = self.bytes.len() as u64;
            for body in &records {
                put_record(&mut self.bytes, opcode, body);
            }
            let length = self.bytes.len() as u64 - start;
            if length > 0 {
                offsets.push([&[opcode][..], &numbers(&[start, length])].concat());
            }
        }
        let first_offset = self.bytes.len() as u64;
        for body in &offsets {
            put_record(&mut self.bytes, op::SUMMARY_OFFSET, body);
        }
        put_record(&mut self.bytes, op::FOOTER, &[numbers(&[summary, first_offset]), vec![0; 4]].concat());
        self.bytes.extend(MAGIC);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    /// What our writer wrote is what is made again.
    #[test]
    fn a_recording_of_ours_is_not_changed() {
        let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("../golden/1.0-kernel-1");
        for name in ["sparse.mcap", "contacts.mcap", "results-part-0001.mcap"] {
            let bytes = std::fs::read(golden.join(name)).expect("a golden recording");
            assert!(rebuilt(&bytes) == bytes, "{name}");
        }
    }
}
