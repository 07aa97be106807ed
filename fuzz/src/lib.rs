//! What the fuzz targets share.

mod place;

pub use place::Place;

use hostile::mutation::{self, Checksums};
use hostile::random::Random;
use hostile::{checksums, records::Parts};

/// A custom mutator for recordings: by records with their lengths, offsets and checksums, or by libFuzzer itself, which
/// knows what was compared with what. Returns the new size.
pub fn mutate_recording(bytes: &mut [u8], size: usize, most: usize, seed: u32) -> usize {
    let mut random = Random::new(u64::from(seed));
    let checksums = if random.one_in(8) { Checksums::Stale } else { Checksums::Right };
    let mut changed = match random.below(4) {
        0 => {
            let size = libfuzzer_sys::fuzzer_mutate(bytes, size, most);
            bytes[..size].to_vec()
        }
        1 => mutate_one_record(&bytes[..size], most, &mut random),
        _ => mutation::mutate(&bytes[..size], &mut random, Checksums::Stale),
    };
    if checksums == Checksums::Right {
        checksums::correct(&mut changed);
    }
    let size = changed.len().min(most);
    bytes[..size].copy_from_slice(&changed[..size]);
    size
}

/// Has libFuzzer change the contents of one record.
fn mutate_one_record(bytes: &[u8], most: usize, random: &mut Random) -> Vec<u8> {
    let mut parts = Parts::of_file(bytes);
    let at = random.below(parts.records.len());
    if let Some(record) = parts.records.get_mut(at) {
        let size = record.body.len();
        let room = (2 * size + 16).min(most);
        record.body.resize(room.max(size), 0);
        let size = libfuzzer_sys::fuzzer_mutate(&mut record.body, size, room);
        record.body.truncate(size);
    }
    parts.put_together()
}
