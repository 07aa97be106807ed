//! Positions of consumers. Each consumer writes its own to a small file, as nobody else knows which frames it has taken from
//! its queue.

use super::board::unix_ns;
use super::creator::Id;
use std::fs::{self, File};
use std::os::unix::fs::FileExt as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};

/// Time between two writes of a consumer's position.
const TELL_PERIOD: Duration = Duration::from_millis(100);
/// Folder of the position files in the root.
const FOLDER: &str = "at";
/// Age from which a position is out of date: its consumer is busy with a frame.
const FRESH: Duration = Duration::from_millis(500);

/// Position of a consumer in the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Position {
    /// The first frame that the consumer does not have.
    pub(super) next_frame: u64,
    /// Published frames that the consumer did not have when it wrote.
    pub(super) behind: u64,
    /// Frames that the consumer has missed.
    pub(super) missed: u64,
}

impl Position {
    fn to_bytes(self) -> [u8; 32] {
        let mut bytes = [0; 32];
        let values = [self.next_frame, self.behind, self.missed, unix_ns()];
        for (place, value) in bytes.chunks_exact_mut(8).zip(values) {
            place.copy_from_slice(&value.to_le_bytes());
        }
        bytes
    }

    /// Reads the last position of the consumer with the subscriber `id`; none if the consumer tells nothing. If the
    /// position is out of date, `behind` counts the missing frames up to `last_frame`.
    pub(super) fn read(root: &Path, id: u128, last_frame: Option<u64>) -> Option<Self> {
        let bytes: [u8; 32] = fs::read(path(root, id)).ok()?.try_into().ok()?;
        let mut values = bytes
            .chunks_exact(8)
            .map(|value| value.iter().rev().fold(0, |n, byte| n << 8 | u64::from(*byte)));
        let (next_frame, behind, missed) = (values.next()?, values.next()?, values.next()?);
        let told = SystemTime::UNIX_EPOCH + Duration::from_nanos(values.next()?);
        let is_fresh = told.elapsed().is_ok_and(|age| age < FRESH);
        let now = last_frame.map_or(0, |last| (last + 1).saturating_sub(next_frame));
        Some(Self { next_frame, behind: if is_fresh { behind } else { now }, missed })
    }
}

fn path(root: &Path, id: u128) -> PathBuf {
    root.join(FOLDER).join(format!("{id:032x}"))
}

/// Writes the position of a consumer; removes it when dropped.
#[derive(Debug)]
pub(super) struct Teller {
    /// File and its path; none if the file could not be made: consumers work without it.
    file: Option<(File, PathBuf)>,
    told_at: Option<Instant>,
}

impl Teller {
    pub(super) fn new(root: &Path, id: u128) -> Self {
        let path = path(root, id);
        let file = path.parent().and_then(|folder| {
            fs::create_dir_all(folder).ok()?;
            remove_dead(root);
            File::create(&path).ok()
        });
        Self { file: file.map(|file| (file, path)), ..Self::none() }
    }

    /// Makes a teller that tells nothing.
    pub(super) fn none() -> Self {
        Self { file: None, told_at: None }
    }

    /// Writes `position`, if it is time to.
    pub(super) fn tell(&mut self, now: Instant, position: impl FnOnce() -> Position) {
        let Some((file, _)) = &self.file else { return };
        if self.told_at.is_none_or(|at| now.duration_since(at) >= TELL_PERIOD) {
            self.told_at = Some(now);
            // nobody depends on it
            let _ = file.write_all_at(&position().to_bytes(), 0);
        }
    }
}

impl Drop for Teller {
    fn drop(&mut self) {
        if let Some((_, path)) = &self.file {
            let _ = fs::remove_file(path);
        }
    }
}

/// Removes the positions that killed consumers have left.
pub(super) fn remove_dead(root: &Path) {
    for path in of_the_dead(root) {
        let _ = fs::remove_file(path);
    }
}

/// The positions that killed consumers have left.
pub(super) fn of_the_dead(root: &Path) -> impl Iterator<Item = PathBuf> {
    let entries = fs::read_dir(root.join(FOLDER)).into_iter().flatten().flatten();
    entries.filter_map(|entry| {
        let id = u128::from_str_radix(entry.file_name().to_str()?, 16).ok()?;
        (!Id(id).creator_lives()).then(|| entry.path())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_told_is_read_until_the_consumer_leaves() {
        let root = tempfile::tempdir().expect("a folder");
        let (id, now) = (7_u128 << 64, Instant::now());
        let position = Position { next_frame: 12, behind: 3, missed: 1 };
        let mut teller = Teller::new(root.path(), id);
        teller.tell(now, || position);
        teller.tell(now, || unreachable!("it has just told"));
        assert_eq!(Position::read(root.path(), id, None), Some(position));
        assert_eq!(Position::read(root.path(), 8, None), None);
        drop(teller);
        assert_eq!(Position::read(root.path(), id, None), None);
    }

    #[test]
    fn what_killed_consumers_left_is_removed() {
        let root = tempfile::tempdir().expect("a folder");
        // numbers of processes end before 2^22
        let id_of = |process: u32| u128::from(process) << 64 | u128::from(u32::MAX);
        let [living, killed] =
            [std::process::id(), 1 << 23].map(|process| Teller::new(root.path(), id_of(process)));
        remove_dead(root.path());
        let left = fs::read_dir(root.path().join(FOLDER)).expect("a folder").count();
        assert_eq!(left, 1);
        drop((living, killed));
    }

    #[test]
    fn who_tells_nothing_for_a_while_lacks_what_came_since() {
        let root = tempfile::tempdir().expect("a folder");
        let teller = Teller::new(root.path(), 1);
        let mut bytes = Position { next_frame: 12, behind: 3, missed: 0 }.to_bytes();
        bytes[24..].fill(0);
        fs::write(path(root.path(), 1), bytes).expect("writes");
        assert_eq!(Position::read(root.path(), 1, Some(111)).map(|told| told.behind), Some(100));
        drop(teller);
    }
}
