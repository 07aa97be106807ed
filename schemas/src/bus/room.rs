//! How much shared memory a run may touch, and whether there is that much.

use super::services::{BORROWED, Limits, MAX_SUBSCRIBERS};
use std::path::PathBuf;

/// Most frames that wait for one consumer. More does not help: the ring should stay in the cache.
pub(super) const MAX_BUFFER: usize = 64;
/// Memory that all queues of a run may use together, if there is that much.
const BUDGET_BYTES: u64 = 1 << 30;
/// What a sample needs besides its payload: headers, reference counts, alignment.
const OVERHEAD_BYTES: u64 = 512;
/// What the small services of a run need: blackboard, queues, tags.
const FIXED_BYTES: u64 = 2 << 20;

/// What a process needs that registers itself, and attaches to a run as it is.
const LEAST_BYTES: u64 = 1 << 20;

/// Why a run does not fit into shared memory.
#[derive(Debug, thiserror::Error)]
pub enum RoomError {
    /// Too little is free.
    #[error(
        "publishing this run may need {needed_bytes} bytes of shared memory, {free_bytes} are free in {path}; \
         free some, enlarge it (docker: --shm-size), or publish fewer beads"
    )]
    Full {
        /// Where.
        path: PathBuf,
        /// What may be touched at worst.
        needed_bytes: u64,
        /// What is there.
        free_bytes: u64,
    },
    /// Next to nothing is free.
    #[error(
        "using the bus needs {LEAST_BYTES} bytes of shared memory, {free_bytes} are free in {path}; \
         free some, or enlarge it (docker: --shm-size)"
    )]
    Least {
        /// Where.
        path: PathBuf,
        /// What is there.
        free_bytes: u64,
    },
    /// The file system could not be asked.
    #[error("cannot find out how much shared memory is free in {path}")]
    Io {
        /// Where.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
}

/// Bytes free in shared memory.
pub(super) fn free_bytes() -> Result<u64, RoomError> {
    let path = PathBuf::from("/dev/shm");
    match rustix::fs::statvfs(&path) {
        Ok(fs) => Ok(fs.f_bavail.saturating_mul(fs.f_frsize)),
        Err(e) => Err(RoomError::Io { path, source: e.into() }),
    }
}

/// What queues of `limits` for slots of `slot_bytes` may touch when every consumer is behind.
fn needed_bytes(slot_bytes: u64, limits: Limits) -> u64 {
    let slots = limits.subscribers * (limits.buffer + BORROWED) + BORROWED;
    (slots as u64).saturating_mul(slot_bytes.saturating_add(OVERHEAD_BYTES))
}

/// Queues for slots of `slot_bytes`: as long as is useful, as short as the memory demands.
pub(super) fn plan(slot_bytes: u64, free_bytes: u64) -> Limits {
    let budget = BUDGET_BYTES.min(free_bytes / 2);
    let fits = |limits: &Limits| needed_bytes(slot_bytes, *limits) <= budget;
    let choices = [MAX_SUBSCRIBERS, MAX_SUBSCRIBERS / 2, MAX_SUBSCRIBERS / 4]
        .into_iter()
        .flat_map(|subscribers| [MAX_BUFFER, 32, 16, 8, 4, 2].map(|buffer| Limits { subscribers, buffer }));
    choices.clone().find(fits).unwrap_or(Limits { subscribers: MAX_SUBSCRIBERS / 4, buffer: 2 })
}

/// Refuses what may not fit: writing to shared memory that is full kills the process.
pub(super) fn check(slot_bytes: u64, limits: Limits, free_bytes: u64) -> Result<(), RoomError> {
    // the chain is as big as a frame, and is kept for consumers that come later
    let needed = needed_bytes(slot_bytes, limits).saturating_add(2 * slot_bytes).saturating_add(FIXED_BYTES);
    if needed <= free_bytes {
        return Ok(());
    }
    Err(RoomError::Full { path: PathBuf::from("/dev/shm"), needed_bytes: needed, free_bytes })
}

/// Refuses to touch shared memory when it is full: that kills the process.
pub(super) fn check_least(free_bytes: u64) -> Result<(), RoomError> {
    if free_bytes >= LEAST_BYTES {
        return Ok(());
    }
    Err(RoomError::Least { path: PathBuf::from("/dev/shm"), free_bytes })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_memory_is_refused_before_it_is_touched() {
        assert!(check_least(1 << 20).is_ok());
        let error = check_least((1 << 20) - 1).expect_err("full");
        assert!(error.to_string().contains("1048575 are free in /dev/shm"), "{error}");
    }

    #[test]
    fn queues_shrink_with_the_frame_and_with_the_memory() {
        let frame = |beads: u64| 16 * beads;
        let much = 16 << 30;
        assert_eq!(plan(frame(1000), much), Limits { subscribers: 16, buffer: 64 });
        assert_eq!(plan(frame(1_000_000), much), Limits { subscribers: 16, buffer: 2 });
        let docker = 64 << 20;
        assert_eq!(plan(frame(1000), docker), Limits { subscribers: 16, buffer: 64 });
        assert!(check(frame(1000), plan(frame(1000), docker), docker).is_ok());
        assert!(check(frame(100_000), plan(frame(100_000), docker), docker).is_ok());
        let error = check(frame(1_000_000), plan(frame(1_000_000), docker), docker).expect_err("too big");
        assert!(error.to_string().contains("67108864 are free in /dev/shm"), "{error}");
    }
}
