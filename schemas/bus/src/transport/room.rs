//! Limits the shared memory that a run may touch, and checks that so much is free.

use super::leftovers::SEGMENTS;
use super::services::{Limits, MAX_SUBSCRIBERS};
use crate::errors::LEAST_BYTES;
use crate::{BORROWED, RoomError};
use rustix::fs::FallocateFlags;
use rustix::io::Errno;
use std::path::{Path, PathBuf};

/// Most frames that wait for one consumer. More does not help: the ring should stay in the cache.
pub const MAX_BUFFER: usize = 64;
/// Fewest frames that wait for one consumer, so that it can hold one and have the next.
const LEAST_BUFFER: usize = 2;
/// Most memory that all queues of a run use together, if that much is free. All of it is taken at once.
const BUDGET_BYTES: u64 = 1 << 30;
/// Most memory that all queues of a run use together, if they are longer than they have to be.
const COMFORT_BYTES: u64 = 256 << 20;
/// Bytes of a sample besides its payload: headers, reference counts, alignment.
const OVERHEAD_BYTES: u64 = 512;
/// Bytes of the small services of a run: blackboard, queues, tags.
const FIXED_BYTES: u64 = 2 << 20;

/// Bytes free in shared memory.
pub(super) fn free_bytes() -> Result<u64, RoomError> {
    let path = PathBuf::from(SEGMENTS);
    match rustix::fs::statvfs(&path) {
        Ok(fs) => Ok(fs.f_bavail.saturating_mul(fs.f_frsize)),
        Err(e) => Err(RoomError::Io { path, source: e.into() }),
    }
}

/// Bytes that queues of `limits` for slots of `slot_bytes` touch when every consumer is behind.
fn needed_bytes(slot_bytes: u64, limits: Limits) -> u64 {
    let slots = limits.subscribers * (limits.buffer + BORROWED) + BORROWED;
    (slots as u64).saturating_mul(slot_bytes.saturating_add(OVERHEAD_BYTES))
}

/// Plans queues for slots of `slot_bytes`: as long as is useful, as short as the free memory demands.
pub(super) fn plan(slot_bytes: u64, free_bytes: u64) -> Limits {
    let most = BUDGET_BYTES.min(free_bytes / 2);
    let fits = |limits: &Limits| {
        let budget = if limits.buffer > LEAST_BUFFER { most.min(COMFORT_BYTES) } else { most };
        needed_bytes(slot_bytes, *limits) <= budget
    };
    let mut choices =
        [MAX_SUBSCRIBERS, MAX_SUBSCRIBERS / 2, MAX_SUBSCRIBERS / 4].into_iter().flat_map(|subscribers| {
            [MAX_BUFFER, 32, 16, 8, 4, LEAST_BUFFER].map(|buffer| Limits { subscribers, buffer })
        });
    choices.find(fits).unwrap_or(Limits { subscribers: MAX_SUBSCRIBERS / 4, buffer: LEAST_BUFFER })
}

/// Takes all the memory of the port's samples at once, so that writing them later cannot fail: a write to full shared
/// memory kills the process.
pub(super) fn reserve(prefix: &str, port_id: u128) -> Result<(), RoomError> {
    let directory = Path::new(SEGMENTS);
    let io = |source| RoomError::Io { path: directory.to_owned(), source };
    let end = format!("_{port_id}.data");
    for entry in std::fs::read_dir(directory).map_err(io)? {
        let path = entry.map_err(io)?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if !name.starts_with(prefix) || !name.ends_with(&end) {
            continue;
        }
        let file = std::fs::File::options().write(true).open(&path).map_err(io)?;
        let needed_bytes = file.metadata().map_err(io)?.len();
        loop {
            match rustix::fs::fallocate(&file, FallocateFlags::empty(), 0, needed_bytes) {
                // a kernel that cannot do it: the check of the free space must do
                Ok(()) | Err(Errno::OPNOTSUPP | Errno::NOSYS) => break,
                Err(Errno::INTR) => {}
                Err(Errno::NOSPC) => {
                    let (path, free_bytes) = (directory.to_owned(), free_bytes()?);
                    return Err(RoomError::Full { path, needed_bytes, free_bytes });
                }
                Err(e) => return Err(RoomError::Reserve { path, needed_bytes, source: e.into() }),
            }
        }
    }
    Ok(())
}

/// Refuses a run that does not fit, before any of it is made. Call it with the lock held, so that nobody else takes the
/// free memory.
pub(super) fn check(slot_bytes: u64, limits: Limits, free_bytes: u64) -> Result<(), RoomError> {
    // the chain is kept for consumers that come later; it has at most five numbers where a frame has two
    let needed = needed_bytes(slot_bytes, limits).saturating_add(3 * slot_bytes).saturating_add(FIXED_BYTES);
    if needed <= free_bytes {
        return Ok(());
    }
    Err(RoomError::Full { path: PathBuf::from(SEGMENTS), needed_bytes: needed, free_bytes })
}

/// Refuses to touch shared memory when it is full: touching it would kill the process.
pub(super) fn check_least(free_bytes: u64) -> Result<(), RoomError> {
    if free_bytes >= LEAST_BYTES {
        return Ok(());
    }
    Err(RoomError::Least { path: PathBuf::from(SEGMENTS), free_bytes })
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
        assert_eq!(plan(frame(100_000), much), Limits { subscribers: 16, buffer: 8 });
        assert_eq!(plan(frame(1_000_000), much), Limits { subscribers: 16, buffer: 2 });
        let docker = 64 << 20;
        assert_eq!(plan(frame(1000), docker), Limits { subscribers: 16, buffer: 64 });
        assert!(check(frame(1000), plan(frame(1000), docker), docker).is_ok());
        assert!(check(frame(100_000), plan(frame(100_000), docker), docker).is_ok());
        let error = check(frame(1_000_000), plan(frame(1_000_000), docker), docker).expect_err("too big");
        assert!(error.to_string().contains("67108864 are free in /dev/shm"), "{error}");
    }
}
