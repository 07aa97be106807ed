//! Sends files to objects while they are written, in a thread of its own.
//!
//! Whoever writes a file only ever appends to it, so what is there is sent as soon as it makes a part. The writer never waits.

use crate::{StorageError, Upload};
use std::fs::{self, File};
use std::io;
use std::os::unix::fs::{FileExt as _, MetadataExt as _};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// Smallest part that stores take, but for the last.
const LEAST_PART_BYTES: u64 = 5 << 20;

/// Most parts of an object.
const MOST_PARTS: u64 = 10_000;

/// Between two looks at a file that grows.
const LOOK: Duration = Duration::from_millis(200);

/// Before what a store did not take is sent again, while the file grows.
const PAUSE: Duration = Duration::from_secs(10);

/// A file on its way to an object.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Errand {
    /// What the file is called once it is whole.
    pub file: PathBuf,
    /// What it is called while it is written.
    pub growing: PathBuf,
    /// Where it goes.
    pub url: PathBuf,
}

/// How files are sent.
#[derive(Debug, Clone)]
pub struct SendOptions {
    /// The run that they are recordings of.
    pub run: String,
    /// Size that a file is expected to have at most; it may become larger.
    pub expected_bytes: u64,
    /// Replace objects that exist.
    pub replace: bool,
    /// Keep files that were sent.
    pub keep: bool,
}

/// An object that is there, whole.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sent {
    /// Where it is.
    pub url: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// In how many parts it was sent.
    pub parts: usize,
}

/// Why a file was not sent; it stays.
#[derive(Debug, thiserror::Error)]
pub enum SendError {
    /// The store refuses, or cannot be reached.
    #[error("{} was not written", url.display())]
    Store {
        /// Where the file was to go.
        url: PathBuf,
        /// Why.
        source: StorageError,
    },
    /// The file cannot be read.
    #[error("{} cannot be read", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// What the operating system says.
        source: io::Error,
    },
    /// It was asked to stop.
    #[error("stopped before everything was sent")]
    Stopped,
    /// It was never finished.
    #[error("{} was not finished, so that nothing is left of it behind the URL", file.display())]
    Unfinished {
        /// What it is called.
        file: PathBuf,
    },
}

/// What came of sending.
#[derive(Debug)]
pub struct Outcome {
    /// The objects, in the order of their files.
    pub sent: Vec<Sent>,
    /// Why the next file was not sent; none of the later ones was.
    pub error: Option<SendError>,
}

/// Sends one file after the other.
pub struct Sender {
    shared: Arc<Shared>,
    thread: JoinHandle<Result<(), SendError>>,
}

#[derive(Default)]
struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    /// How many files there are, once that is known.
    files: Option<u64>,
    sent_bytes: u64,
    sent: Vec<Sent>,
}

/// An upload that has begun, of the first file.
pub struct Begun {
    options: SendOptions,
    errand: Errand,
    upload: Upload,
}

impl Begun {
    /// Begins to send `errand`, of which nothing need be there yet, so that a store that refuses is known before anything is
    /// written. What an earlier attempt left in the store is removed.
    ///
    /// # Errors
    /// When there is such an object and it is not to be replaced, or when the store refuses.
    pub fn new(errand: Errand, options: SendOptions) -> Result<Self, SendError> {
        let upload = begin(&errand, &options)?;
        Ok(Self { options, errand, upload })
    }

    /// Gives it up, before anything was sent.
    pub fn give_up(self) {
        give_up(&self.errand, &self.upload);
    }

    /// Sends it, and then file after file. `next` gives the N-th, from 2 on, if there may be one; `notice` is told what goes wrong and is tried again.
    ///
    /// # Errors
    /// When there is no thread for it.
    pub fn send(
        self,
        next: impl Fn(u64) -> Option<Errand> + Send + 'static,
        notice: impl Fn(&SendError) + Send + 'static,
    ) -> io::Result<Sender> {
        let shared = Arc::<Shared>::default();
        let work = Work { shared: Arc::clone(&shared), options: self.options, notice: Box::new(notice) };
        let (errand, upload) = (self.errand, self.upload);
        let work = move || work.all(errand, upload, next);
        let thread = thread::Builder::new().name("beadline-send".into()).spawn(work)?;
        Ok(Sender { shared, thread })
    }
}

impl Sender {
    /// Says that `files` files are finished, and that there will be no more.
    pub fn end(&self, files: u64) {
        self.shared.lock().files = Some(files);
        self.shared.changed.notify_all();
    }

    /// Bytes sent so far.
    pub fn sent_bytes(&self) -> u64 {
        self.shared.lock().sent_bytes
    }

    /// Whether everything is sent, or given up.
    pub fn is_done(&self) -> bool {
        self.thread.is_finished()
    }

    /// Does not wait for the end. What was sent stays in the store until the file is sent again.
    pub fn leave(self) -> Outcome {
        Outcome { sent: self.shared.lock().sent.clone(), error: Some(SendError::Stopped) }
    }

    /// Waits for the end, after [`end`](Self::end).
    pub fn finish(self) -> Outcome {
        let ended = self.thread.join().unwrap_or(Err(SendError::Stopped));
        Outcome { sent: std::mem::take(&mut self.shared.lock().sent), error: ended.err() }
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// How many files there are, if that is known by now.
    fn files(&self) -> Option<u64> {
        self.lock().files
    }

    /// Waits until there is news from whoever writes, or for `time`.
    fn wait(&self, time: Duration) {
        let state = self.lock();
        if state.files.is_none() {
            drop(self.changed.wait_timeout(state, time));
        }
    }
}

/// What the thread does.
struct Work {
    shared: Arc<Shared>,
    options: SendOptions,
    notice: Box<dyn Fn(&SendError) + Send>,
}

impl Work {
    fn all(
        self,
        first: Errand,
        upload: Upload,
        next: impl Fn(u64) -> Option<Errand>,
    ) -> Result<(), SendError> {
        let (mut errand, mut upload) = (first, Some(upload));
        for number in 1.. {
            let Some(sent) = self.one(number, &errand, upload.take())? else { break };
            self.shared.lock().sent.push(sent);
            let Some(following) = next(number + 1) else { break };
            errand = following;
        }
        Ok(())
    }

    /// Sends one file; none if there is none of this number.
    fn one(&self, number: u64, errand: &Errand, upload: Option<Upload>) -> Result<Option<Sent>, SendError> {
        let Some(file) = self.open(number, errand)? else {
            if let Some(upload) = upload {
                give_up(errand, &upload);
                return Err(SendError::Unfinished { file: errand.file.clone() });
            }
            return Ok(None);
        };
        let mut upload = match upload {
            Some(upload) => upload,
            None => self.patiently(|| begin(errand, &self.options))?,
        };
        if let Err(error) = self.follow(number, &file, errand, &mut upload) {
            give_up(errand, &upload);
            return Err(error);
        }
        if !self.options.keep {
            // what cannot be removed is sent all the same
            let _ = fs::remove_file(&errand.file);
        }
        Ok(Some(Sent { url: errand.url.clone(), bytes: upload.bytes(), parts: upload.parts() }))
    }

    /// The file, once it is there; none if it will never be.
    fn open(&self, number: u64, errand: &Errand) -> Result<Option<File>, SendError> {
        loop {
            let files = self.shared.files();
            // in this order: it may be given its name in between
            for path in [&errand.growing, &errand.file] {
                match File::open(path) {
                    Ok(file) => return Ok(Some(file)),
                    Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                    Err(error) => return Err(unreadable(path)(error)),
                }
            }
            if files.is_some_and(|files| number > files) {
                return Ok(None);
            }
            self.shared.wait(LOOK);
        }
    }

    /// Sends what is in the file until it is whole, and completes the object.
    fn follow(
        &self,
        number: u64,
        file: &File,
        errand: &Errand,
        upload: &mut Upload,
    ) -> Result<(), SendError> {
        loop {
            let files = self.shared.files();
            let is_whole = is_at(file, &errand.file);
            let length = file.metadata().map_err(unreadable(&errand.file))?.len();
            while upload.bytes() < length {
                let (parts, sent) = (upload.parts() as u64, upload.bytes());
                let part = part_bytes(self.options.expected_bytes, parts, sent);
                let part = if is_whole { part.min(length - upload.bytes()) } else { part }; // integers
                if length - upload.bytes() < part {
                    break;
                }
                self.send(file, part, errand, upload)?;
            }
            if is_whole {
                self.patiently(|| upload.complete().map_err(refused(errand)))?;
                forget(errand);
                return Ok(());
            }
            if files.is_some_and(|files| number > files) {
                return Err(SendError::Unfinished { file: errand.file.clone() });
            }
            self.shared.wait(LOOK);
        }
    }

    fn send(&self, file: &File, bytes: u64, errand: &Errand, upload: &mut Upload) -> Result<(), SendError> {
        let offset = upload.bytes();
        self.patiently(|| {
            let mut part = vec![0; usize::try_from(bytes).unwrap_or(usize::MAX)];
            file.read_exact_at(&mut part, offset).map_err(unreadable(&errand.file))?;
            upload.send(part).map_err(refused(errand))
        })?;
        self.shared.lock().sent_bytes += bytes;
        Ok(())
    }

    /// Does what may go wrong for a while, again and again as long as files are written, and once after that.
    fn patiently<T>(&self, mut attempt: impl FnMut() -> Result<T, SendError>) -> Result<T, SendError> {
        let mut was_told = false;
        loop {
            let is_last = self.shared.files().is_some();
            match attempt() {
                Err(error) if error.may_pass() && !is_last => {
                    if !was_told {
                        (self.notice)(&error);
                        was_told = true;
                    }
                    self.shared.wait(PAUSE);
                }
                ended => return ended,
            }
        }
    }
}

impl SendError {
    /// Whether it may go better later.
    fn may_pass(&self) -> bool {
        matches!(self, Self::Store { source: StorageError::Failed(_), .. })
    }
}

fn refused(errand: &Errand) -> impl Fn(StorageError) -> SendError + '_ {
    |source| SendError::Store { url: errand.url.clone(), source }
}

fn unreadable(file: &Path) -> impl Fn(io::Error) -> SendError + '_ {
    |source| SendError::File { file: file.to_owned(), source }
}

/// The size of the part that follows `parts` parts of `sent_bytes`: all of one size, as some stores want it, unless there is
/// far more than was expected.
fn part_bytes(expected_bytes: u64, parts: u64, sent_bytes: u64) -> u64 {
    let usual = usual_part_bytes(expected_bytes);
    if parts < MOST_PARTS / 2 { usual } else { usual.max(sent_bytes / (MOST_PARTS / 10)) }
}

fn usual_part_bytes(expected_bytes: u64) -> u64 {
    (expected_bytes / (MOST_PARTS / 2)).max(LEAST_PART_BYTES) // integers
}

/// Begins an upload, and keeps its id beside the file until it is over.
fn begin(errand: &Errand, options: &SendOptions) -> Result<Upload, SendError> {
    let SendOptions { run, expected_bytes, replace, .. } = options;
    let path = note_of(errand);
    if let Ok(note) = fs::read_to_string(&path)
        && let Some((url, id)) = note.trim_end().rsplit_once(' ')
    {
        Upload::give_up(Path::new(url), id).map_err(refused(errand))?;
    }
    let part_bytes = usual_part_bytes(*expected_bytes);
    let upload = Upload::begin(&errand.url, run, part_bytes, *replace).map_err(refused(errand))?;
    let note = format!("{} {}\n", errand.url.display(), upload.id());
    fs::write(&path, note).map_err(unreadable(&path))?;
    Ok(upload)
}

/// Removes what was sent. If that fails, the next attempt does it.
fn give_up(errand: &Errand, upload: &Upload) {
    if Upload::give_up(&errand.url, upload.id()).is_ok() {
        forget(errand);
    }
}

fn forget(errand: &Errand) {
    // an upload that is over may be given up again
    let _ = fs::remove_file(note_of(errand));
}

/// Where the id of an upload is that is not over.
fn note_of(errand: &Errand) -> PathBuf {
    let mut name = errand.file.clone().into_os_string();
    name.push(".upload");
    name.into()
}

/// Whether `file` is what stands at `path`.
fn is_at(file: &File, path: &Path) -> bool {
    let ours = file.metadata().map(|found| (found.dev(), found.ino()));
    path.symlink_metadata().is_ok_and(|found| ours.is_ok_and(|ours| ours == (found.dev(), found.ino())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_far_larger_than_expected_has_room_in_its_parts() {
        for expected_bytes in [0, 1 << 30, 25 << 30] {
            let (mut sent, mut part) = (0, 0);
            for parts in 0..MOST_PARTS {
                part = part_bytes(expected_bytes, parts, sent);
                sent += part;
            }
            // no store takes parts of more than 5 GiB
            assert!(sent > 3 << 40 && part < 5 << 30, "{expected_bytes}: {sent} in parts up to {part}");
        }
    }
}
