//! Bounds of the messages from the other side: everything is counted before it is used.

use super::{MessageError, garbage};
use schemas::manifest::RunManifest;

/// Longest row of results (bytes): a class for each contact of the longest chain, of 20,000,000 beads.
pub const MOST_ROW_BYTES: usize = 24 << 20;
/// Most topics of results of a run: more than run beside each other. Each is a service in shared memory.
pub const MOST_TOPICS: usize = 32;
/// Publishers of results that may begin in a second, after one of each kind: each costs the far side a tenth of a second, and
/// analyses that are started again are fewer.
pub const BEGINNINGS_PER_S: u64 = 1;
/// Most bytes of messages before the first state: the near side keeps no more.
pub const MOST_BYTES_BEFORE: usize = 64 << 20;
/// Longest part of a message beside its longest frame or row (bytes): the batch of a near side, and the heads.
const MOST_BATCH_BYTES: usize = (1 << 20) + (8 << 10);

/// Longest message about a run (bytes).
pub fn most_message_bytes(manifest: &RunManifest) -> usize {
    let frame_bytes = manifest.frame_doubles().saturating_mul(8);
    MOST_ROW_BYTES.max(frame_bytes).saturating_add(MOST_BATCH_BYTES) // integers
}

/// Longest message about a run whose frames are no longer than the longest row (bytes).
pub const MOST_USUAL_BYTES: usize = MOST_ROW_BYTES + MOST_BATCH_BYTES;

pub(super) fn check_length(bytes: &[u8], manifest: &RunManifest) -> Result<(), MessageError> {
    let most = most_message_bytes(manifest);
    if bytes.len() > most {
        return Err(garbage(format_args!(
            "a message of {} bytes, expected at most {most} about this run",
            bytes.len()
        )));
    }
    Ok(())
}

/// Checks rows of `each` bytes, the number of its frame first.
pub(super) fn check_rows(rows: &[u8], each: usize, manifest: &RunManifest) -> Result<(), MessageError> {
    if each > MOST_ROW_BYTES {
        return Err(garbage(format_args!("rows of {each} bytes, expected at most {MOST_ROW_BYTES}")));
    }
    if !rows.len().is_multiple_of(each) {
        return Err(garbage(format_args!("{} bytes of rows of {each} each", rows.len())));
    }
    let frames = rows.chunks_exact(each).filter_map(|row| row.first_chunk().copied().map(u64::from_le_bytes));
    match frames.max() {
        Some(frame) if frame >= manifest.frame_count() => Err(garbage(format_args!(
            "a row of frame {frame}, the run has {} frames",
            manifest.frame_count()
        ))),
        _ => Ok(()),
    }
}
