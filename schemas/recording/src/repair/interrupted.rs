//! The recording of an interrupted run, which is to be resumed.

use crate::error::{ReadError, WriteError};
use crate::proto;
use crate::read::info::RecordingInfo;
use crate::read::salvage::{Damage, DamageKind};
use crate::repair::audit::{Audit, Audited};
use crate::write::channel_writer::WriteOptions;
use crate::write::writer::RecordingWriter;
use schemas::whole_file::{LockedFile, Names, WholeFileError, directory_of};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

/// A file of this size or more is never taken for one that was only begun: the head of a recording, which is on the
/// disk before anything follows, is shorter.
const MOST_BEGUN: u64 = 1 << 20;

/// A recording that is written again from its beginning, so that its run can go on: in its place, or in another one.
///
/// When it is written in its place, it is renamed to `<name>.mcap.interrupted` until the new `<name>.mcap.partial` has
/// everything that it has. After a kill in between, the next attempt finds it there.
#[derive(Debug)]
pub struct InterruptedRecording {
    file: LockedFile,
    /// A file of a former attempt at the same run, without anything that this recording lacks.
    leftover: Option<LockedFile>,
    names: Names,
    target: PathBuf,
    info: RecordingInfo,
    /// True if a finished file of its name may be replaced.
    replace: bool,
}

/// Why a run cannot be resumed from a recording.
#[derive(Debug, thiserror::Error)]
pub enum ResumeError {
    /// It cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// A file cannot be locked, renamed or removed.
    #[error(transparent)]
    File(#[from] WholeFileError),
    /// Another file is in the recording's way.
    #[error(
        "{} cannot be resumed while {} exists: move one of them away, or write to another place with --out",
        path.display(), other.display()
    )]
    InTheWay {
        /// The recording.
        path: PathBuf,
        /// The other one.
        other: PathBuf,
    },
}

impl InterruptedRecording {
    /// Finds the recording that `path` is about, which may be called `.mcap`, `.mcap.partial` or `.mcap.interrupted`,
    /// and reads all of it. It will be written again as `out`, or in its place; with `replace` a finished file may be
    /// replaced.
    ///
    /// A former attempt may have left another recording in its place. The one that has everything is taken.
    ///
    /// # Errors
    /// When it cannot be read or is being written, or when a file is in the way.
    pub fn find(path: &Path, out: Option<&Path>, replace: bool) -> Result<Self, ResumeError> {
        let names = Names::of(path);
        let out = out.filter(|out| !is_same_place(out, &names.whole));
        let target = out.map_or_else(|| names.whole.clone(), Path::to_owned);
        let there = |name: &PathBuf| name.symlink_metadata().is_ok();
        let (file, info, leftover) = match out {
            Some(_) => read_locked(path).map(|(file, info)| (file, info, None))?,
            None if there(&names.aside) => best_of(&names, path == names.whole, replace)?,
            None => {
                let other = if path == names.whole { &names.partial } else { &names.whole };
                if there(other) && !(replace && other == &names.whole) {
                    return Err(in_the_way(path, other));
                }
                read_locked(path).map(|(file, info)| (file, info, None))?
            }
        };
        Ok(Self { file, leftover, names, target, info, replace })
    }

    /// Contents of the recording.
    pub fn info(&self) -> &RecordingInfo {
        &self.info
    }

    /// Present path of the recording.
    pub fn path(&self) -> &Path {
        self.file.path()
    }

    /// Path of the recording when it is finished.
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// True if the recording will be written again in its place.
    pub fn is_in_place(&self) -> bool {
        self.target == self.names.whole
    }

    /// Makes room for the new recording.
    ///
    /// # Errors
    /// When the operating system refuses.
    pub fn set_aside(&mut self) -> Result<(), WholeFileError> {
        if !self.is_in_place() {
            return Ok(());
        }
        if let Some(leftover) = self.leftover.take() {
            self.file.sync()?;
            leftover.remove()?;
        }
        if self.file.path() == self.names.aside {
            return Ok(());
        }
        self.file.rename(&self.names.aside, false)
    }

    /// Starts the recording that will take over everything from this one.
    ///
    /// # Errors
    /// As for [`RecordingWriter::create_from`].
    pub fn write_again(&self, options: &WriteOptions) -> Result<RecordingWriter, WriteError> {
        let RecordingInfo { manifest, run_toml, begin, .. } = &self.info;
        let create = if self.is_in_place() {
            RecordingWriter::create_beside_old
        } else {
            RecordingWriter::create_from
        };
        create(&self.target, manifest, run_toml.as_deref(), begin, options)
    }

    /// Gives a complete recording its name, if a kill came before that, and returns its path.
    ///
    /// # Errors
    /// When the operating system refuses, or when a file has that name.
    pub fn give_name(mut self) -> Result<PathBuf, WholeFileError> {
        self.file.sync()?;
        if self.file.path() != self.names.whole {
            self.file.rename(&self.names.whole, self.replace)?;
        }
        if let Some(leftover) = self.leftover {
            leftover.remove()?;
        }
        Ok(self.names.whole)
    }

    /// Gives the recording back a name under which it is found, after the new one failed.
    ///
    /// # Errors
    /// When the operating system refuses, or when a file has that name; it then stays where it is.
    pub fn put_back(mut self) -> Result<(), WholeFileError> {
        if self.file.path() != self.names.aside {
            return Ok(());
        }
        let name = if self.info.finished { &self.names.whole } else { &self.names.partial };
        self.file.rename(&name.clone(), false)
    }

    /// Removes the recording, because the new one has all of its contents. It stays if the new one is in another
    /// place.
    ///
    /// # Errors
    /// When the operating system refuses.
    pub fn remove(self) -> Result<(), WholeFileError> {
        if self.is_in_place() { self.file.remove() } else { Ok(()) }
    }
}

/// True if both are the same name in the same directory.
fn is_same_place(one: &Path, other: &Path) -> bool {
    let directory = |path| directory_of(path).canonicalize().ok();
    one == other || (one.file_name() == other.file_name() && directory(one) == directory(other))
}

/// The recording to go on with after an attempt that was killed: the one that was set aside or, if that has come
/// further, the new one, with or without its final name. The other one is removed later, so it must have nothing of
/// its own.
fn best_of(
    names: &Names,
    is_whole: bool,
    replace: bool,
) -> Result<(LockedFile, RecordingInfo, Option<LockedFile>), ResumeError> {
    let there = |name: &PathBuf| name.symlink_metadata().is_ok();
    let (old, info) = read_locked(&names.aside)?;
    let may_replace = replace && !is_whole;
    match (there(&names.whole), there(&names.partial)) {
        (true, true) if !may_replace => Err(in_the_way(&names.partial, &names.whole)),
        (true, false) => match read_locked(&names.whole) {
            // killed before the old one was removed
            Ok((new, found)) if found.finished && has_all_of(&found, &info) => Ok((new, found, Some(old))),
            Ok(_) | Err(ResumeError::Read(_)) if may_replace => Ok((old, info, None)),
            Ok(_) | Err(ResumeError::Read(_)) => Err(in_the_way(&names.aside, &names.whole)),
            Err(error) => Err(error),
        },
        (_, true) if is_begun(names) => Ok((old, info, Some(LockedFile::open(&names.partial)?))),
        (_, true) => match read_locked(&names.partial) {
            Ok((new, found)) if has_all_of(&info, &found) => Ok((old, info, Some(new))),
            Ok((new, found)) if has_all_of(&found, &info) => Ok((new, found, Some(old))),
            Ok(_) | Err(ResumeError::Read(_)) => Err(in_the_way(&names.aside, &names.partial)),
            Err(error) => Err(error),
        },
        (false, false) => Ok((old, info, None)),
    }
}

/// True if `one` has everything that `other` has: both are of the same run and undamaged, it has come as far, and it
/// has as many messages of each channel that does not belong to the states.
///
/// `other` may be damaged, as an unsynced file is after a power failure, unless the run may have gone on in it. The
/// two files then exist side by side only until both have the last state, which is due.
fn has_all_of(one: &RecordingInfo, other: &RecordingInfo) -> bool {
    let same = one.manifest.provenance.run_id == other.manifest.provenance.run_id;
    let is_due = one.last_step.is_none_or(|step| one.manifest.is_recorded(step));
    let is_sound = one.damage.is_none() && (other.damage.is_none() || is_due);
    let is_of_states = |topic: &str| [proto::STATE.topic, proto::SUMMARY.topic].contains(&topic);
    let has_others = other
        .channels
        .iter()
        .filter(|channel| !is_of_states(&channel.topic))
        .all(|channel| one.messages(&channel.topic) >= other.messages(&channel.topic));
    same && is_sound && has_others && one.last_step >= other.last_step
}

fn in_the_way(path: &Path, other: &Path) -> ResumeError {
    ResumeError::InTheWay { path: path.to_owned(), other: other.to_owned() }
}

/// True if the new recording holds nothing but the first bytes of the old one, or zeros where a power failure kept
/// them from the disk.
fn is_begun(names: &Names) -> bool {
    let read = |path: &Path| -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        storage::open_file(path)?.take(MOST_BEGUN).read_to_end(&mut bytes).map(|_| bytes)
    };
    let is_file =
        names.partial.symlink_metadata().is_ok_and(|found| found.is_file() && found.len() < MOST_BEGUN);
    let (Ok(new), Ok(old), true) = (read(&names.partial), read(&names.aside), is_file) else { return false };
    new.len() <= old.len() && new.iter().zip(&old).all(|(new, old)| new == old || *new == 0)
}

/// Locks the recording `path` and reads all of it.
fn read_locked(path: &Path) -> Result<(LockedFile, RecordingInfo), ResumeError> {
    // a file that is not there cannot be read, rather than written
    path.metadata().map_err(ReadError::io(path))?;
    let file = LockedFile::open(path)?;
    let mut info = RecordingInfo::read(path)?;
    let is_damaged = info.damage.is_some();
    let (damage, last_step) = damage_within(path, info.frames() > 0)?;
    info.damage = info.damage.or(damage);
    if is_damaged {
        info.last_step = last_step;
    }
    Ok((file, info))
}

/// The damage in the recording `path`, or missing frames if it has states, other than an early end, or contents that
/// cannot be copied; and the last step in it, also after damage.
fn damage_within(path: &Path, has_states: bool) -> Result<(Option<String>, Option<u64>), ReadError> {
    let mut audit = Audit::open(path)?;
    let mut last_step = None;
    loop {
        match audit.read_next()? {
            Audited::State(state) => last_step = last_step.max(Some(state.step)),
            Audited::End => break,
            Audited::Summary(_) | Audited::Other(_) => {}
        }
    }
    let (has_end, file_bytes) = (audit.end().is_some(), audit.file_bytes());
    let is_torn_end = |damage: &Damage| match damage.kind {
        DamageKind::Torn => true,
        // after the end of the recording: what is repeated there
        DamageKind::Unreadable => has_end && damage.offset_bytes + damage.length_bytes == file_bytes,
        _ => false,
    };
    let within = audit.damages().iter().find(|damage| !is_torn_end(damage));
    let damaged = within.map(|damage| format!("{} is damaged: {damage}", path.display()));
    let missing = audit.missing().first().filter(|_| has_states);
    let incomplete = missing.map(|(from, to)| format!("its frames {from} to {to} are missing"));
    let others = || audit.other_records().missing().map(|what| format!("it has {what}"));
    Ok((damaged.or(incomplete).or_else(others), last_step))
}
