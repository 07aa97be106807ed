//! What the fuzz targets begin with: our own files, whole and damaged in every kind of record.

use crate::checksums;
use crate::metadata::Metadata;
use crate::mutation::change_bytes;
use crate::random::Random;
use crate::records::{Chunk, Parts, Record, op};
use std::collections::BTreeSet;

/// The recording `bytes` with its chunks compressed or not.
pub fn repacked(bytes: &[u8], compressed: bool) -> Vec<u8> {
    let mut parts = Parts::of_file(bytes);
    for record in parts.records.iter_mut().filter(|record| record.opcode == op::CHUNK) {
        if let Some(chunk) = Chunk::unpack(&record.body) {
            record.body = chunk.pack(compressed);
        }
    }
    let mut bytes = parts.put_together();
    checksums::correct(&mut bytes);
    bytes
}

/// Copies of the recording `bytes`, each with one record damaged: of every opcode in the file and in its chunks, cut,
/// changed, doubled and taken away, with stale and with right checksums.
pub fn damaged(bytes: &[u8], seed: u64) -> Vec<Vec<u8>> {
    let mut random = Random::new(seed);
    let mut copies = Vec::new();
    for damage in [cut, change, double, remove] {
        let parts = Parts::of_file(bytes);
        for at in first_of_each_kind(&parts.records) {
            let mut parts = parts.clone();
            damage(&mut parts.records, at, &mut random);
            copies.push(parts.put_together());
        }
        let chunk = parts.records.iter().position(|record| record.opcode == op::CHUNK);
        let Some((place, chunk)) = chunk.and_then(|at| Some((at, Chunk::unpack(&parts.records[at].body)?)))
        else {
            continue;
        };
        let inner = Parts::of_chunk(&chunk.contents);
        for at in first_of_each_kind(&inner.records) {
            let (mut parts, mut inner, mut chunk) = (parts.clone(), inner.clone(), chunk.clone());
            damage(&mut inner.records, at, &mut random);
            chunk.contents = inner.put_together();
            parts.records[place].body = chunk.pack(chunk.is_compressed());
            copies.push(parts.put_together());
        }
    }
    let right = copies.clone().into_iter().map(|mut copy| {
        checksums::correct(&mut copy);
        copy
    });
    copies.extend(right.collect::<Vec<_>>());
    copies
}

fn first_of_each_kind(records: &[Record]) -> Vec<usize> {
    let mut seen = BTreeSet::new();
    (0..records.len()).filter(|at| seen.insert(records[*at].opcode)).collect()
}

#[expect(clippy::ptr_arg, reason = "one type for all kinds of damage")]
fn cut(records: &mut Vec<Record>, at: usize, random: &mut Random) {
    let length = random.below(records[at].body.len());
    records[at].body.truncate(length);
}

#[expect(clippy::ptr_arg, reason = "one type for all kinds of damage")]
fn change(records: &mut Vec<Record>, at: usize, random: &mut Random) {
    if !records[at].body.is_empty() {
        records[at].body = change_bytes(&records[at].body, random);
    }
}

fn double(records: &mut Vec<Record>, at: usize, _: &mut Random) {
    records.insert(at, records[at].clone());
}

fn remove(records: &mut Vec<Record>, at: usize, _: &mut Random) {
    records.remove(at);
}

/// The manifest of a recording, as the metadata record `beadline.run` has it and as JSON.
pub fn manifests(bytes: &[u8]) -> Vec<Vec<u8>> {
    let parts = Parts::of_file(bytes);
    let Some(record) = parts.records.iter().find(|record| record.opcode == op::METADATA) else {
        return Vec::new();
    };
    let Some(mut metadata) = Metadata::read(&record.body) else { return Vec::new() };
    let version = metadata.value("schema_version").cloned().unwrap_or_default();
    let minor = version.rsplit('.').next().unwrap_or_default();
    let mut json = format!("{{\"schema_version\":{{\"major\":1,\"minor\":{minor}}}").into_bytes();
    for key in ["physics", "provenance"] {
        let value = metadata.value(key).cloned().unwrap_or_default();
        json.extend(format!(",\"{key}\":{value}").bytes());
    }
    json.push(b'}');
    vec![record.body.clone(), json]
}

/// The messages of a recording that are as long as states, each after the byte that the target `state` expects.
pub fn states(bytes: &[u8], beads: usize) -> Vec<Vec<u8>> {
    let parts = Parts::of_file(bytes);
    let chunks = parts.records.iter().filter(|record| record.opcode == op::CHUNK);
    let inner = chunks.filter_map(|record| Some(Parts::of_chunk(&Chunk::unpack(&record.body)?.contents)));
    let messages = inner.flat_map(|parts| parts.records).filter(|record| record.opcode == op::MESSAGE);
    messages
        .filter_map(|record| {
            // channel, sequence, times
            let message = record.body.get(22..)?;
            let extra_per_bead = (message.len() / 8 / beads).checked_sub(2)?;
            let lengths = u8::try_from((beads - 1) | extra_per_bead << 5).ok()?;
            Some([&[lengths], message].concat())
        })
        .collect()
}
