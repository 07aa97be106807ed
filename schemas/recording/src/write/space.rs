//! Estimate of the disk space that a recording will take, and a check that there is enough.

use crate::error::WriteError;
use crate::write::channel_writer::Compression;
use crate::write::disk::room_for;
use crate::write::encode::STATE_HEAD_BYTES;
use schemas::manifest::RunManifest;
use schemas::whole_file::directory_of;
use std::path::Path;
use system::Room;

/// Bytes of a message beyond its contents: opcode and length, channel, sequence and two times.
const MESSAGE_RECORD_BYTES: u64 = 9 + 2 + 4 + 8 + 8;

/// Time and offset of a message in its chunk's index.
const INDEX_ENTRY_BYTES: u64 = 16;

/// Chunk header, index records of two channels and the chunk's entry in the summary, rounded up.
const CHUNK_BYTES: u64 = 512;

/// Head, schemas, metadata, attachment and footer, rounded up.
const FILE_BYTES: u64 = 32 << 10;

/// Fewest beads that a shock reaches in a time T: 0.76 (α = 3) to 1.03 (α = 1) in uniform chains.
const FRONT_BEADS_PER_T: f64 = 0.5;

/// Largest ratio at which zstd shrinks the moving part of a chain: about 4 while half of it moves, 3 when all does.
const BEST_RATIO: f64 = 8.0;

/// Space that the recording of a run takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SpaceNeeded {
    /// Upper bound: nothing can be compressed.
    pub at_most_bytes: u64,
    /// A careful lower bound. Uncompressed it is the upper bound without its reserves. Compressed, only the part of
    /// the chain that the shock has reached by then counts, at a speed below that of any shock in a uniform chain; the
    /// bound divides its size by 8, where 3 to 4 were measured.
    pub at_least_bytes: u64,
}

impl SpaceNeeded {
    /// Makes the estimate for the whole run `manifest`.
    pub fn new(manifest: &RunManifest, compression: Compression) -> Self {
        let physics = &manifest.physics;
        let frames = manifest.recorded_count();
        let doubles = 8 * manifest.frame_doubles() as u64;
        let summary = 64 + 30 * physics.impurities.len() as u64 + 20;
        let frame = doubles + STATE_HEAD_BYTES + summary + 2 * (MESSAGE_RECORD_BYTES + INDEX_ENTRY_BYTES);
        let chain = 3 * 8 * physics.beads;
        // a chunk holds at least one frame, usually a MiB
        let chunks = frames.min(frames.saturating_mul(frame) >> 20) + 1;
        let at_most_bytes = frames
            .saturating_mul(frame)
            .saturating_add(chunks.saturating_mul(CHUNK_BYTES))
            .saturating_add(chain + FILE_BYTES);
        let states = frames.saturating_mul(doubles);
        let at_least_bytes = match compression {
            Compression::None => states,
            Compression::Zstd { .. } => scale(states, moving_fraction(manifest) / BEST_RATIO),
        };
        Self { at_most_bytes, at_least_bytes }
    }

    /// Refuses a recording `path` that cannot fit on its disk, and returns the free space there (bytes).
    ///
    /// The rule: a recording is refused if even its lower bound does not fit. The caller may warn of one that might not fit.
    ///
    /// # Errors
    /// [`WriteError::NoSpace`], [`WriteError::NoDisk`], or when the directory cannot be looked at.
    pub fn check(&self, path: &Path) -> Result<u64, WriteError> {
        let directory = directory_of(path);
        let Room { free_bytes, total_bytes } = room_for(path)?;
        if total_bytes == 0 {
            return Err(WriteError::NoDisk { directory: directory.to_owned() });
        }
        (self.at_least_bytes <= free_bytes).then_some(free_bytes).ok_or_else(|| WriteError::NoSpace {
            directory: directory.to_owned(),
            needed_bytes: self.at_least_bytes,
            free_bytes,
        })
    }
}

/// Mean over the run of the fraction of the chain that the shock has reached.
fn moving_fraction(manifest: &RunManifest) -> f64 {
    let physics = &manifest.physics;
    let duration = physics.time_s(physics.step_count) / physics.scales().time_s;
    // the front goes through the chain in this many T
    let passage = physics.beads as f64 / FRONT_BEADS_PER_T;
    if duration < passage { duration / passage / 2.0 } else { 1.0 - passage / duration / 2.0 }
}

fn scale(bytes: u64, factor: f64) -> u64 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates, is an estimate")]
    let scaled = (bytes as f64 * factor) as u64;
    scaled
}
