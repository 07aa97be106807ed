//! Sends files to objects while they are written, in a thread of its own.
//!
//! The writer of a file only appends to it, so bytes are sent as soon as they make a part. The writer never waits.

use crate::{StorageError, Upload, open_file, stop};
use std::fmt::{self, Display};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read as _, Seek as _, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;
use system::{is_at, without_waiting};

/// Smallest part that stores take, but for the last.
const LEAST_PART_BYTES: u64 = 5 << 20;

/// Most parts of an object.
const MOST_PARTS: u64 = 10_000;

/// Most bytes of the parts of an upload that is gone on with: a part is in memory.
const MOST_PART_BYTES: u64 = 512 << 20;

/// Most bytes of a note beside a file: a URL, an id and a run.
const MOST_NOTE_BYTES: u64 = 64 << 10;

/// Between two looks at a file that grows.
const LOOK: Duration = Duration::from_millis(200);

/// Pause before refused bytes are sent again, while the file grows.
const PAUSE: Duration = Duration::from_secs(10);

/// A file on its way to an object.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Errand {
    /// Name of the file once it is whole.
    pub file: PathBuf,
    /// Name of the file while it grows.
    pub growing: PathBuf,
    /// Its destination.
    pub url: PathBuf,
}

/// Options of sending.
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
    /// Its URL.
    pub url: PathBuf,
    /// Its size.
    pub bytes: u64,
    /// In how many parts it was sent.
    pub parts: usize,
    /// Bytes that the store had from an earlier attempt, and that were not sent again.
    pub kept_bytes: u64,
}

/// Why a file was not sent; it stays.
#[derive(Debug, thiserror::Error)]
pub enum SendError {
    /// The store refuses, or cannot be reached.
    #[error("{} was not written", url.display())]
    Store {
        /// Destination of the file.
        url: PathBuf,
        /// Why.
        source: StorageError,
    },
    /// The file cannot be read.
    #[error("{} cannot be read", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// The operating system's error.
        source: io::Error,
    },
    /// There is no note of the upload.
    #[error("{}, the note of the upload, cannot be written; choose another --spool, or upload a copy in another directory", note.display())]
    Note {
        /// The note.
        note: PathBuf,
        /// The operating system's error.
        source: io::Error,
    },
    /// Another process sends the file.
    #[error("{} is being sent by another process; wait for its end", file.display())]
    Busy {
        /// The file.
        file: PathBuf,
    },
    /// It was asked to stop.
    #[error("stopped before everything was sent")]
    Stopped,
    /// It was never finished.
    #[error("{} was not finished, so that nothing is left of it behind the URL", file.display())]
    Unfinished {
        /// Its name.
        file: PathBuf,
    },
}

/// Result of sending.
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
    /// Number of files, once it is known.
    files: Option<u64>,
    sent_bytes: u64,
    sent: Vec<Sent>,
}

/// An upload that has begun, of the first file.
pub struct Begun {
    options: SendOptions,
    errand: Errand,
    upload: Upload,
    lock: File,
}

impl Begun {
    /// Begins to send `errand`, even before its file exists, so that a store can refuse before anything is written. It
    /// goes on with the parts of an earlier attempt if that is possible, and else removes them.
    ///
    /// # Errors
    /// When there is such an object and it is not to be replaced, when the store refuses, or when another process sends the file.
    pub fn new(errand: Errand, options: SendOptions) -> Result<Self, SendError> {
        let (upload, lock) = begin(&errand, &options)?;
        Ok(Self { options, errand, upload, lock })
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
        let (errand, upload) = (self.errand, (self.upload, self.lock));
        let work = move || {
            // a run that is asked to stop is sent all the same; who waits for us may leave
            stop::be_patient();
            work.all(errand, upload, next)
        };
        let thread = thread::Builder::new().name("beadline-send".into()).spawn(work)?;
        Ok(Sender { shared, thread })
    }
}

impl Sender {
    /// Announces that `files` files are finished, and that there will be no more.
    pub fn end(&self, files: u64) {
        self.shared.lock().files = Some(files);
        self.shared.changed.notify_all();
    }

    /// Bytes sent so far.
    pub fn sent_bytes(&self) -> u64 {
        self.shared.lock().sent_bytes
    }

    /// True if everything is sent, or given up.
    pub fn is_done(&self) -> bool {
        self.thread.is_finished()
    }

    /// Does not wait for the end. Sent parts stay in the store until the file is sent again.
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

    /// Number of files, if it is known by now.
    fn files(&self) -> Option<u64> {
        self.lock().files
    }

    /// Waits until there is news from the writer, or for `time`.
    fn wait(&self, time: Duration) {
        let state = self.lock();
        if state.files.is_none() {
            drop(self.changed.wait_timeout(state, time));
        }
    }
}

/// The work of the thread.
struct Work {
    shared: Arc<Shared>,
    options: SendOptions,
    notice: Box<dyn Fn(&SendError) + Send>,
}

impl Work {
    fn all(
        self,
        first: Errand,
        upload: (Upload, File),
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
    fn one(
        &self,
        number: u64,
        errand: &Errand,
        upload: Option<(Upload, File)>,
    ) -> Result<Option<Sent>, SendError> {
        let Some(file) = self.open(number, errand)? else {
            if let Some((upload, _lock)) = upload {
                give_up(errand, &upload);
                return Err(SendError::Unfinished { file: errand.file.clone() });
            }
            return Ok(None);
        };
        let (mut upload, _lock) = match upload {
            Some(upload) => upload,
            None => self.patiently(|| begin(errand, &self.options))?,
        };
        let mut kept_bytes = 0;
        if let Err(error) = self.follow(&file, errand, &mut upload, &mut kept_bytes) {
            // what another attempt goes on with stays in the store
            if !(error.leaves_parts() && upload.can_be_resumed()) {
                give_up(errand, &upload);
            }
            return Err(error);
        }
        if !self.options.keep {
            // what cannot be removed is sent all the same
            let _ = fs::remove_file(&errand.file);
        }
        let (bytes, parts) = (upload.bytes(), upload.parts());
        Ok(Some(Sent { url: errand.url.clone(), bytes, parts, kept_bytes }))
    }

    /// The file, once it is there; none if it will never be.
    fn open(&self, number: u64, errand: &Errand) -> Result<Option<File>, SendError> {
        loop {
            let files = self.shared.files();
            // in this order: it may be given its name in between
            for path in [&errand.growing, &errand.file] {
                match open_file(path) {
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

    /// Sends the file until it is whole, and completes the object.
    fn follow(
        &self,
        file: &File,
        errand: &Errand,
        upload: &mut Upload,
        kept_bytes: &mut u64,
    ) -> Result<(), SendError> {
        loop {
            let files = self.shared.files();
            let is_whole = is_at(file, &errand.file);
            let length = file.metadata().map_err(unreadable(&errand.file))?.len();
            while upload.bytes() < length {
                let (parts, sent) = (upload.parts() as u64, upload.bytes());
                let part = part_bytes(upload.part_bytes(), parts, sent);
                let part = if is_whole { part.min(length - upload.bytes()) } else { part }; // integers
                if length - upload.bytes() < part {
                    break;
                }
                if !self.send(file, part, errand, upload)? {
                    *kept_bytes += part;
                }
            }
            if is_whole {
                self.patiently(|| upload.complete().map_err(refused(errand)))?;
                forget(errand);
                return Ok(());
            }
            // of files that are finished, it has lost its name
            if files.is_some() {
                return Err(SendError::Unfinished { file: errand.file.clone() });
            }
            self.shared.wait(LOOK);
        }
    }

    /// Sends the next part, unless the store has it: whether it was sent.
    fn send(&self, file: &File, bytes: u64, errand: &Errand, upload: &mut Upload) -> Result<bool, SendError> {
        let offset = upload.bytes();
        let was_sent = self.patiently(|| {
            let mut part = vec![0; usize::try_from(bytes).unwrap_or(usize::MAX)];
            system::read_exact_at(file, &mut part, offset).map_err(unreadable(&errand.file))?;
            upload.send(part).map_err(refused(errand))
        })?;
        self.shared.lock().sent_bytes += bytes;
        Ok(was_sent)
    }

    /// Repeats work that may fail for a while, as long as files are written, and once after that.
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
    /// True if it may go better later.
    fn may_pass(&self) -> bool {
        matches!(self, Self::Store { source: StorageError::Failed(_), .. })
    }

    /// True if another attempt may go on with the sent parts.
    fn leaves_parts(&self) -> bool {
        let Self::Store { source, .. } = self else { return false };
        matches!(source, StorageError::Failed(_) | StorageError::Denied(_) | StorageError::Stopped)
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
fn part_bytes(usual: u64, parts: u64, sent_bytes: u64) -> u64 {
    if parts < MOST_PARTS / 2 { usual } else { usual.max(sent_bytes / (MOST_PARTS / 10)) }
}

fn usual_part_bytes(expected_bytes: u64) -> u64 {
    (expected_bytes / (MOST_PARTS / 2)).max(LEAST_PART_BYTES) // integers
}

/// Begins an upload, or goes on with the one that an earlier attempt left, and keeps its id beside the file until it is over.
/// The lock of that note keeps other processes away as long as it lives.
fn begin(errand: &Errand, options: &SendOptions) -> Result<(Upload, File), SendError> {
    let SendOptions { run, expected_bytes, replace, .. } = options;
    let path = note_of(errand);
    let mut lock = lock(errand, &path)?;
    if let Some(note) = Note::read(&lock) {
        if let Some(part_bytes) = note.part_bytes_for(errand, options)
            && let Some(upload) =
                Upload::resume(&errand.url, &note.id, run, part_bytes, *replace).map_err(refused(errand))?
        {
            return Ok((upload, lock));
        }
        Upload::give_up(&note.url, &note.id).map_err(refused(errand))?;
    }
    let part_bytes = usual_part_bytes(*expected_bytes);
    let upload = Upload::begin(&errand.url, run, part_bytes, *replace);
    let upload = upload.inspect_err(|_| forget(errand)).map_err(refused(errand))?;
    let note = Note { url: errand.url.clone(), id: upload.id().to_owned(), run: run.clone(), part_bytes };
    let written = lock.set_len(0).and_then(|()| lock.rewind()).and_then(|()| write!(lock, "{note}"));
    let written = written.inspect_err(|_| give_up(errand, &upload));
    written.map_err(|source| SendError::Note { note: path, source })?;
    Ok((upload, lock))
}

/// Locks the note at `path`, which it makes if there is none.
fn lock(errand: &Errand, path: &Path) -> Result<File, SendError> {
    let mut options = OpenOptions::new();
    let options = without_waiting(options.read(true).write(true).create(true).truncate(false), false);
    let note = options.open(path).map_err(|source| SendError::Note { note: path.to_owned(), source })?;
    // whoever held the lock before may have removed the note
    if matches!(note.try_lock(), Err(TryLockError::WouldBlock)) || !is_at(&note, path) {
        return Err(SendError::Busy { file: errand.file.clone() });
    }
    Ok(note)
}

/// The note beside a file of which an upload is not over.
#[derive(Debug, PartialEq)]
struct Note {
    url: PathBuf,
    id: String,
    run: String,
    part_bytes: u64,
}

impl Note {
    fn read(file: &File) -> Option<Self> {
        let mut text = String::new();
        file.take(MOST_NOTE_BYTES).read_to_string(&mut text).ok()?;
        Self::parse(&text)
    }

    fn parse(text: &str) -> Option<Self> {
        let mut lines = text.lines();
        let (url, id) = lines.next()?.rsplit_once(' ')?;
        let (run, part_bytes) = lines.next().and_then(|line| line.rsplit_once(' ')).unwrap_or_default();
        // one that cannot be gone on with can still be given up
        let part_bytes = part_bytes.parse().unwrap_or(0);
        Some(Self { url: url.into(), id: id.to_owned(), run: run.to_owned(), part_bytes })
    }

    /// The size of its parts, if `errand` can go on with it.
    fn part_bytes_for(&self, errand: &Errand, options: &SendOptions) -> Option<u64> {
        let is_same = self.url == errand.url && self.run == options.run;
        let fits = (LEAST_PART_BYTES..=MOST_PART_BYTES).contains(&self.part_bytes)
            && options.expected_bytes / self.part_bytes < MOST_PARTS;
        (is_same && fits).then_some(self.part_bytes)
    }
}

impl Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { url, id, run, part_bytes } = self;
        writeln!(f, "{} {id}\n{run} {part_bytes}", url.display())
    }
}

/// Removes the sent parts. If that fails, the next attempt does it.
fn give_up(errand: &Errand, upload: &Upload) {
    if Upload::give_up(&errand.url, upload.id()).is_ok() {
        forget(errand);
    }
}

fn forget(errand: &Errand) {
    // an upload that is over may be given up again
    let _ = fs::remove_file(note_of(errand));
}

/// Path of the note with the id of an upload that is not over.
fn note_of(errand: &Errand) -> PathBuf {
    let mut name = errand.file.clone().into_os_string();
    name.push(".upload");
    name.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_far_larger_than_expected_has_room_in_its_parts() {
        for expected_bytes in [0, 1 << 30, 25 << 30] {
            let (mut sent, mut part) = (0, 0);
            for parts in 0..MOST_PARTS {
                part = part_bytes(usual_part_bytes(expected_bytes), parts, sent);
                sent += part;
            }
            // no store takes parts of more than 5 GiB
            assert!(sent > 3 << 40 && part < 5 << 30, "{expected_bytes}: {sent} in parts up to {part}");
        }
    }

    #[test]
    fn a_file_is_sent_by_one_at_a_time() {
        let place = tempfile::tempdir().expect("temporary directory");
        let file = place.path().join("run.mcap");
        let errand = Errand { growing: file.clone(), file, url: "s3://bucket/run.mcap".into() };
        let path = note_of(&errand);
        let first = lock(&errand, &path).expect("free");
        assert!(matches!(lock(&errand, &path), Err(SendError::Busy { .. })));
        forget(&errand);
        drop(first);
        lock(&errand, &path).expect("free again");
    }

    #[test]
    fn only_the_upload_of_the_same_run_to_the_same_place_is_gone_on_with() {
        let (url, run) = (PathBuf::from("s3://bucket/a b.mcap"), "0123".to_owned());
        let note = Note { url: url.clone(), id: "the-id".into(), run: run.clone(), part_bytes: 6 << 20 };
        assert_eq!(Note::parse(&note.to_string()), Some(note));
        let errand = Errand { file: "f".into(), growing: "f".into(), url };
        let options = SendOptions { run, expected_bytes: 1 << 30, replace: false, keep: true };
        let fits = |text: &str| Note::parse(text).and_then(|note| note.part_bytes_for(&errand, &options));
        assert_eq!(fits("s3://bucket/a b.mcap the-id\n0123 6291456\n"), Some(6 << 20));
        for other in [
            "s3://bucket/other.mcap the-id\n0123 6291456\n",
            "s3://bucket/a b.mcap the-id\n4567 6291456\n",
            "s3://bucket/a b.mcap the-id\n0123 1\n",
            "s3://bucket/a b.mcap the-id\n0123 18446744073709551615\n",
            "s3://bucket/a b.mcap the-id\n",
            "",
        ] {
            assert_eq!(fits(other), None, "{other}");
        }
    }
}
