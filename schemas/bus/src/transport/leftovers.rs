//! Finds the remains of killed processes by their names, and removes them.
//!
//! iceoryx2 cleans up after a process that had registered everything it made. It does not find things made before
//! that, and waits for ever for a segment of size 0 whose creator is dead, if it may open it (as root it may).

use super::creator::{Id, Processes};
use super::{Ipc, backpressure, position};
use iceoryx2::node::{Node, NodeState};
use iceoryx2::prelude::{CallbackProgression, Config, Service as _};
use std::collections::{HashMap, HashSet};
use std::fs::{self, DirEntry, Metadata};
use std::os::unix::fs::{DirEntryExt as _, MetadataExt};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

pub(super) const SEGMENTS: &str = "/dev/shm";
/// Longest time that a segment may be half-made while a possible creator lives; creating takes microseconds.
const PATIENCE: Duration = Duration::from_secs(5);
/// Longest such time once one of two possible creators is dead.
const PATIENCE_WITH_ONE: Duration = Duration::from_secs(1);
/// Most waits for another process that is cleaning up.
const CLEANERS: u32 = 5;
/// Length of one such wait.
const CLEANER_PAUSE: Duration = Duration::from_millis(20);
/// Longest time that a process that ends may take from one of its files to the next.
const LEAVING: Duration = Duration::from_millis(5);

/// Leftovers that were removed.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq)]
pub(super) struct Removed {
    /// Number of unfinished segments; every opener waited for them.
    pub(super) half_made: u64,
    /// Number of segments and files without an owner.
    pub(super) orphans: u64,
    /// Bytes that the orphans took.
    pub(super) bytes: u64,
}

impl Removed {
    pub(super) fn add(&mut self, other: Self) {
        self.half_made += other.half_made;
        self.orphans += other.orphans;
        self.bytes += other.bytes;
    }

    fn orphan(&mut self, path: &Path, found: Option<&Metadata>) {
        if fs::remove_file(path).is_ok() {
            self.orphans += 1;
            self.bytes += found.map_or(0, |found| found.blocks() * 512);
        }
    }
}

/// A file of this user whose name begins with the prefix.
struct BusFile {
    path: PathBuf,
    name: String,
    ids: Vec<Id>,
    metadata: Metadata,
}

impl BusFile {
    /// True if the file is not whole yet: iceoryx2 makes a file readable when it is whole.
    fn is_half_made(&self) -> bool {
        self.metadata.len() == 0 || self.metadata.mode() & 0o400 == 0
    }

    fn creators_alive(&self) -> usize {
        self.ids.iter().filter(|id| id.creator_lives()).count()
    }
}

fn files_in(directory: &Path, prefix: &str) -> Vec<BusFile> {
    files_among(directory, prefix, |_| true)
}

/// The files of this user that `wanted` chooses by their names.
fn files_among(directory: &Path, prefix: &str, mut wanted: impl FnMut(&DirEntry) -> bool) -> Vec<BusFile> {
    let user = rustix::process::getuid().as_raw();
    let entries = fs::read_dir(directory).into_iter().flatten().flatten();
    let found = entries.filter_map(|entry| {
        let name = entry.file_name().into_string().ok().filter(|name| name.starts_with(prefix))?;
        if !wanted(&entry) {
            return None;
        }
        let metadata = entry.metadata().ok()?;
        let ids = Id::all_in(&name);
        (metadata.uid() == user).then(|| BusFile { path: entry.path(), name, ids, metadata })
    });
    found.collect()
}

fn segments(prefix: &str) -> Vec<BusFile> {
    files_in(Path::new(SEGMENTS), prefix)
}

/// Remembers when each half-made segment was first seen, and which segments are whole.
#[derive(Default)]
pub(super) struct HalfMade {
    since: HashMap<(PathBuf, u64), Instant>,
    whole: HashSet<u64>,
}

impl HalfMade {
    /// Removes segments that nobody will finish: at once if all possible creators are dead.
    pub(super) fn remove(&mut self, prefix: &str) -> Removed {
        let (mut removed, mut seen, mut whole) = (Removed::default(), HashMap::new(), HashSet::new());
        let mut is_new = |entry: &DirEntry| !(self.whole.contains(&entry.ino()) && whole.insert(entry.ino()));
        let unknown = files_among(Path::new(SEGMENTS), prefix, &mut is_new);
        for segment in unknown {
            if !segment.is_half_made() {
                whole.insert(segment.metadata.ino());
                continue;
            }
            let key = (segment.path.clone(), segment.metadata.ino());
            let since = self.since.get(&key).copied().unwrap_or_else(Instant::now);
            let patience = match segment.creators_alive() {
                0 if !segment.ids.is_empty() => Duration::ZERO,
                1 if segment.ids.len() == 2 => PATIENCE_WITH_ONE,
                _ => PATIENCE,
            };
            if since.elapsed() < patience {
                seen.insert(key, since);
            } else if fs::remove_file(&segment.path).is_ok() {
                removed.half_made += 1;
            }
        }
        (self.since, self.whole) = (seen, whole);
        removed
    }
}

/// True if anything on the bus may be without an owner, judged by names alone: its creator is dead, or it is a service that no
/// node uses. Call it with the lock held.
pub(super) fn may_be_there(root: &Path, prefix: &str, family: &str, config: &Config) -> bool {
    let mut suspects = services_of_nobody(prefix, config);
    let mut processes = Processes::default();
    let nodes = PathBuf::from(config.global.node_dir().to_string());
    let places = [(Path::new(SEGMENTS), family), (root, prefix), (&nodes, "")];
    for (path, name) in places.into_iter().flat_map(|(directory, prefix)| names_in(directory, prefix)) {
        let ids = Id::all_in(&name);
        let is_dead = !ids.is_empty() && !ids.iter().any(|id| processes.has_creator_of(*id));
        let is_earlier = name.starts_with(family) && !name.starts_with(prefix);
        if is_dead || is_earlier || path.extension().is_some_and(|end| end == "new") {
            suspects.push(path);
        }
    }
    suspects.extend(position::of_the_dead(root));
    if suspects.is_empty() {
        return false;
    }
    // a process that was just ending has left in order by now
    std::thread::sleep(LEAVING);
    suspects.iter().any(|path| path.symlink_metadata().is_ok())
}

/// Descriptions of services that no node uses. A node registers its use of a service before it makes the service, and until it is
/// about to remove it.
fn services_of_nobody(prefix: &str, config: &Config) -> Vec<PathBuf> {
    let services = names_in(Path::new(&config.global.service_dir().to_string()), prefix);
    let nodes = names_in(Path::new(&config.global.node_dir().to_string()), "");
    let nodes = nodes.into_iter().filter(|(_, name)| !name.starts_with(prefix));
    let used: HashSet<String> =
        nodes.flat_map(|(path, _)| names_in(&path, prefix)).map(|(_, name)| stem(&name).to_owned()).collect();
    let unused = services.into_iter().filter(|(_, name)| !used.contains(stem(name)));
    unused.map(|(path, _)| path).collect()
}

/// Part of a name before the first `.`.
fn stem(name: &str) -> &str {
    name.split('.').next().unwrap_or_default()
}

fn names_in(directory: &Path, prefix: &str) -> Vec<(PathBuf, String)> {
    let entries = fs::read_dir(directory).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| Some((entry.path(), entry.file_name().into_string().ok()?)));
    names.filter(|(_, name)| name.starts_with(prefix)).collect()
}

/// Removes everything that belongs to no living node and to no service. Call it with the lock held, so that nobody is
/// in the middle of creating a service, and after making a node, which cleans up after the dead processes that it knows.
pub(super) fn remove_orphans(root: &Path, prefix: &str, config: &Config) -> Removed {
    let mut removed = Removed::default();
    let mut files = segments(prefix);
    files.extend(files_in(root, prefix));
    let nodes = PathBuf::from(config.global.node_dir().to_string());
    remove_dead_nodes(&nodes, config, &mut removed);
    let services = PathBuf::from(config.global.service_dir().to_string());
    let mut needed = port_ids(&nodes, prefix);
    needed.extend(remove_dead_services(&services, prefix, config, &mut removed));
    for file in files {
        let in_use = file.ids.iter().any(|id| needed.contains(id) || id.creator_lives());
        // a replacement file has no id: it is made with the lock held, and renamed at once
        let is_new = Path::new(&file.name).extension().is_some_and(|extension| extension == "new");
        if !in_use && (is_new || !file.ids.is_empty()) {
            removed.orphan(&file.path, Some(&file.metadata));
        }
    }
    removed
}

/// Nodes whose processes live, and the number of dead nodes; none if the nodes cannot be listed.
fn node_states(config: &Config) -> Option<(HashSet<Id>, u64)> {
    let (mut living, mut dead) = (HashSet::new(), 0);
    let listed = Node::<Ipc>::list(config, |node| {
        if matches!(node, NodeState::Dead(_)) {
            dead += 1;
        } else {
            living.insert(Id(node.node_id().value()));
        }
        CallbackProgression::Continue
    });
    listed.is_ok().then_some((living, dead))
}

/// Removes nodes that were killed while they registered, or whose cleaner was killed when it had all but finished.
fn remove_dead_nodes(nodes: &Path, config: &Config, removed: &mut Removed) {
    let mut states = node_states(config);
    for _ in 0..CLEANERS {
        if states.as_ref().is_none_or(|(_, dead)| *dead == 0) {
            break;
        }
        // another process may be at it
        std::thread::sleep(CLEANER_PAUSE);
        backpressure::clean_dead(config);
        states = node_states(config);
    }
    let Some((living, _)) = states else { return };
    let names = fs::read_dir(nodes).into_iter().flatten().flatten();
    for name in names.filter_map(|entry| entry.file_name().into_string().ok()) {
        let ids = Id::all_in(&name);
        if ids.is_empty() || ids.iter().any(|id| living.contains(id) || id.creator_lives()) {
            continue;
        }
        let path = nodes.join(name);
        for tag in fs::read_dir(&path).into_iter().flatten().flatten() {
            removed.orphan(&tag.path(), None);
        }
        if fs::remove_dir(&path).is_err() {
            removed.orphan(&path, None);
        }
    }
}

/// Ids of the ports of all nodes. A port has its tag before it has anything else.
fn port_ids(nodes: &Path, prefix: &str) -> HashSet<Id> {
    let directories = fs::read_dir(nodes).into_iter().flatten().flatten();
    let tags = directories.flat_map(|node| files_in(&node.path(), prefix));
    tags.filter(|tag| tag.name.ends_with(".port_tag")).flat_map(|tag| tag.ids).collect()
}

/// Removes descriptions of services that nobody can use any more: half-made ones, those without the service, and those
/// without a living node. Returns the ids of the other services. The caller holds the lock, and is making no service.
fn remove_dead_services(directory: &Path, prefix: &str, config: &Config, removed: &mut Removed) -> Vec<Id> {
    // a description can be written to until it is whole
    let half_made = |file: &BusFile| file.metadata.len() == 0 || file.metadata.mode() & 0o777 != 0o400;
    for description in files_in(directory, prefix).into_iter().filter(half_made) {
        removed.orphan(&description.path, None);
    }
    let (mut ids, mut dead) = (Vec::new(), Vec::new());
    // the creator of that service removes an unreadable description
    let _ = Ipc::list(config, |service| {
        let id = Id(service.static_details.unique_service_id().value());
        let lives = match service.dynamic_details {
            Some(details) => details.nodes.iter().any(|node| !matches!(node, NodeState::Dead(_))),
            // it comes after the description
            None => id.creator_lives(),
        };
        if lives {
            ids.push(id);
        } else {
            dead.push(service.static_details.service_hash().as_str().to_owned());
        }
        CallbackProgression::Continue
    });
    for hash in dead {
        let name = format!("{prefix}{hash}{}", config.global.service.static_config_storage_suffix);
        removed.orphan(&directory.join(name), None);
    }
    ids
}

/// Removes all segments of an earlier secret of the same root, once all their creators are dead. Such a secret was
/// lost when the root was cleaned away.
pub(super) fn remove_earlier(prefix: &str, family: &str) -> Removed {
    let mut removed = Removed::default();
    let earlier = || segments(family).into_iter().filter(|segment| !segment.name.starts_with(prefix));
    if earlier().all(|segment| segment.creators_alive() == 0) {
        for segment in earlier() {
            removed.orphan(&segment.path, Some(&segment.metadata));
        }
    }
    removed
}
