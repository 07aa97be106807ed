//! A disk, and what a power failure may leave on it.
//!
//! A file has what was written before a sync of it that has ended; a name is there, or gone, for certain after a sync of its
//! directory. Of all else anything may have come to the disk, in any order and torn, as POSIX has it: no file system
//! is that bad, but each is in some part.

use super::trace::Operation;
use hostile::random::Random;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What a disk writes in one piece.
const SECTOR: usize = 512;

/// Files with their contents, and directories.
pub(super) type Image = BTreeMap<PathBuf, Option<Vec<u8>>>;

/// What comes to the disk of what was not synced.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Luck {
    Nothing,
    Everything,
    /// Names and lengths; zeros instead of what was written.
    Zeros,
    /// Everything up to a write, of which a part.
    Torn,
    /// Each name and each sector or not.
    Any,
}

#[derive(Debug, Clone, Default)]
pub(super) struct Disk {
    names: BTreeMap<PathBuf, usize>,
    /// None for a directory.
    nodes: Vec<Option<Vec<u8>>>,
    /// Not synced, with the number of the operation.
    pending: Vec<(usize, Change)>,
    /// The names as programs see them.
    seen: BTreeMap<PathBuf, usize>,
    made: usize,
}

#[derive(Debug, Clone)]
enum Change {
    Name { path: PathBuf, node: usize },
    Rename { from: PathBuf, to: PathBuf, node: usize },
    Remove { path: PathBuf },
    Write { node: usize, at: usize, bytes: Vec<u8> },
    Resize { node: usize, length: usize },
}

impl Disk {
    /// A disk on which everything is synced.
    pub(super) fn of(image: Image) -> Self {
        let mut disk = Self::default();
        for (path, content) in image {
            disk.names.insert(path, disk.nodes.len());
            disk.nodes.push(content);
        }
        disk.seen.clone_from(&disk.names);
        disk
    }

    pub(super) fn apply(&mut self, operation: &Operation) {
        let made = self.made;
        self.made += 1;
        let change = match operation {
            Operation::Create(path) if self.seen.contains_key(path) => return,
            Operation::Create(path) => self.make(path, Some(Vec::new())),
            Operation::MakeDirectory(path) => self.make(path, None),
            Operation::Write { path, at, bytes } => {
                Change::Write { node: self.seen[path], at: *at, bytes: bytes.clone() }
            }
            Operation::Resize { path, length } => Change::Resize { node: self.seen[path], length: *length },
            Operation::Rename { from, to } => {
                assert_eq!(from.parent(), to.parent(), "a rename between directories");
                let node = self.seen.remove(from).unwrap();
                self.seen.insert(to.clone(), node);
                Change::Rename { from: from.clone(), to: to.clone(), node }
            }
            Operation::Remove(path) => {
                self.seen.remove(path);
                Change::Remove { path: path.clone() }
            }
            Operation::Sync { path, begun } => return self.sync(path, *begun),
        };
        self.pending.push((made, change));
    }

    fn make(&mut self, path: &Path, content: Option<Vec<u8>>) -> Change {
        let node = self.nodes.len();
        self.nodes.push(content);
        self.seen.insert(path.to_owned(), node);
        Change::Name { path: path.to_owned(), node }
    }

    fn sync(&mut self, path: &Path, begun: usize) {
        let synced = self.seen.get(path).copied();
        for (made, change) in std::mem::take(&mut self.pending) {
            let is_synced = match &change {
                Change::Write { node, .. } | Change::Resize { node, .. } => Some(*node) == synced,
                Change::Name { path: of, .. }
                | Change::Rename { to: of, .. }
                | Change::Remove { path: of } => of.parent() == Some(path),
            };
            if is_synced && made < begun {
                change.keep(&mut self.names, &mut self.nodes);
            } else {
                self.pending.push((made, change));
            }
        }
    }

    /// What may be there after a power failure now.
    pub(super) fn after_failure(&self, luck: Luck, random: &mut Random) -> Image {
        let (mut names, mut nodes) = (self.names.clone(), self.nodes.clone());
        let torn = random.below(self.pending.len());
        let (rare, junk) = (random.one_of([2, 2, 8, 64]), random.one_in(4));
        for (number, (_, change)) in self.pending.iter().enumerate() {
            let kept = match (luck, change) {
                (Luck::Nothing, _) => None,
                (Luck::Everything, _) => Some(change.clone()),
                (Luck::Zeros, _) => Some(change.zeros()),
                (Luck::Torn, _) if number < torn => Some(change.clone()),
                (Luck::Torn, _) if number > torn => None,
                (Luck::Torn, _) => Some(change.cut(random)),
                (Luck::Any, Change::Write { node, .. }) => {
                    let old = nodes[*node].clone().unwrap_or_default();
                    Some(change.sectors(&old, rare, junk, random))
                }
                (Luck::Any, _) => (!random.one_in(rare)).then(|| change.clone()),
            };
            if let Some(change) = kept {
                change.keep(&mut names, &mut nodes);
            }
        }
        let reachable = |path: &Path| {
            path.ancestors().skip(1).all(|above| above.as_os_str().is_empty() || names.contains_key(above))
        };
        names
            .iter()
            .filter(|(path, _)| reachable(path))
            .map(|(path, node)| (path.clone(), nodes[*node].clone()))
            .collect()
    }
}

impl Change {
    fn keep(self, names: &mut BTreeMap<PathBuf, usize>, nodes: &mut [Option<Vec<u8>>]) {
        match self {
            Self::Name { path, node } => drop(names.insert(path, node)),
            Self::Rename { from, to, node } => {
                names.retain(|path, found| *path != from || *found != node);
                names.insert(to, node);
            }
            Self::Remove { path } => drop(names.remove(&path)),
            Self::Write { node, at, bytes } => {
                if let Some(content) = &mut nodes[node] {
                    let end = at + bytes.len();
                    content.resize(content.len().max(end), 0);
                    content[at..end].copy_from_slice(&bytes);
                }
            }
            Self::Resize { node, length } => {
                nodes[node].iter_mut().for_each(|content| content.resize(length, 0));
            }
        }
    }

    /// The same with zeros in place of what it writes.
    fn zeros(&self) -> Self {
        let mut change = self.clone();
        if let Self::Write { bytes, .. } = &mut change {
            bytes.fill(0);
        }
        change
    }

    /// The first part of it.
    fn cut(&self, random: &mut Random) -> Self {
        let mut change = self.clone();
        if let Self::Write { bytes, .. } = &mut change {
            bytes.truncate(random.below(bytes.len()));
        }
        change
    }

    /// Some sectors of it. In place of the others is what was there, or nothing, or anything.
    fn sectors(&self, old: &[u8], rare: usize, junk: bool, random: &mut Random) -> Self {
        let Self::Write { node, at, bytes } = self else { return self.clone() };
        let mut kept = bytes.clone();
        let mut end = 0;
        let mut start = 0;
        while start < bytes.len() {
            let next = (start + SECTOR - (at + start) % SECTOR).min(bytes.len());
            if random.one_in(rare) {
                for (byte, place) in kept[start..next].iter_mut().zip(at + start..) {
                    let junk = if junk { random.byte() } else { 0 };
                    *byte = old.get(place).copied().unwrap_or(junk);
                }
            } else {
                end = next;
            }
            start = next;
        }
        // the length may have come to the disk without them
        if random.one_in(2) {
            kept.truncate(end);
        }
        Self::Write { node: *node, at: *at, bytes: kept }
    }
}
