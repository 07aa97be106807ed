//! The threads that compress and write.

use super::WriteOptions;
use super::block::Block;
use super::chunks::Due;
use super::output::{Encoded, Encoder, Output};
use super::queue::{Queue, Refused};
use crate::write::sync::BackgroundSync;
use std::io;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
#[cfg(feature = "faults")]
use std::time::Duration;

/// Threads that compress: one keeps up with a disk, two with a run that computes on a third core.
const MOST_COMPRESSORS: usize = 2;

/// A sync is asked for after this many bytes: syncing everything at the end would hold the end up.
const SYNC_BYTES: u64 = 16 << 20;

/// Threads at work on a queue. When this is dropped they first write everything accepted.
#[derive(Debug)]
pub(super) struct Threads {
    shared: Arc<Shared>,
    handles: Vec<JoinHandle<()>>,
}

#[derive(Debug)]
struct Shared {
    queue: Queue,
    writing: Mutex<Writing>,
    /// Signals that another chunk was written, or that writing failed.
    turn: Condvar,
    #[cfg(feature = "faults")]
    slow_disk: Duration,
}

/// The file, to which chunks go in their order.
#[derive(Debug)]
struct Writing {
    output: Output,
    sync: BackgroundSync,
    /// Bytes in the file when a sync was last asked for because of their number.
    synced_bytes: u64,
    /// Chunks written.
    written: u64,
    failed: bool,
}

impl Writing {
    fn sync_if_much(&mut self) -> io::Result<()> {
        if self.output.bytes() - self.synced_bytes < SYNC_BYTES {
            return Ok(());
        }
        self.synced_bytes = self.output.bytes();
        self.request_sync()
    }

    fn request_sync(&mut self) -> io::Result<()> {
        self.sync.request(self.output.file())
    }
}

impl Threads {
    pub(super) fn start(queue: Queue, output: Output, options: &WriteOptions) -> io::Result<Self> {
        let writing =
            Writing { output, sync: BackgroundSync::default(), synced_bytes: 0, written: 0, failed: false };
        let shared = Arc::new(Shared {
            queue,
            writing: Mutex::new(writing),
            turn: Condvar::new(),
            #[cfg(feature = "faults")]
            slow_disk: options.slow_disk,
        });
        let mut this = Self { shared, handles: Vec::new() };
        let cores = thread::available_parallelism().map_or(1, usize::from);
        for _ in 0..cores.clamp(1, MOST_COMPRESSORS) {
            let shared = Arc::clone(&this.shared);
            let encoder = Encoder::new(options.compression)?;
            let work = move || shared.work(encoder);
            match thread::Builder::new().name("beadline-write".into()).spawn(work) {
                Ok(handle) => this.handles.push(handle),
                Err(error) if this.handles.is_empty() => {
                    let why = format!(
                        "no thread can be started that writes ({error}); allow more processes (`ulimit -u`)"
                    );
                    return Err(io::Error::new(error.kind(), why));
                }
                // those that there are do the work
                Err(_) => break,
            }
        }
        Ok(this)
    }

    pub(super) fn queue(&self) -> &Queue {
        &self.shared.queue
    }

    /// Appends a record of another file to what was written so far.
    pub(super) fn copy(&self, opcode: u8, body: &[u8]) -> io::Result<()> {
        self.shared.lock().output.copy(opcode, body)
    }

    /// Waits until the contents of the file are on the disk.
    pub(super) fn sync(&self) -> io::Result<()> {
        let writing = &mut *self.shared.lock();
        writing.sync.sync(writing.output.file())
    }

    /// Writes everything, waits for the threads to end, and gives the file back.
    pub(super) fn end(mut self) -> Result<(Output, BackgroundSync), Refused> {
        self.shared.queue.end();
        self.join();
        self.shared.queue.check()?;
        let shared = Arc::clone(&self.shared);
        drop(self);
        // the threads have ended and let go of it
        let writing = Arc::into_inner(shared).ok_or(Refused::GivenUp)?.writing;
        let writing = writing.into_inner().unwrap_or_else(PoisonError::into_inner);
        Ok((writing.output, writing.sync))
    }

    fn join(&mut self) {
        for handle in self.handles.drain(..) {
            // one that panicked has said why, and marked the queue as failed
            let _ = handle.join();
        }
    }
}

impl Drop for Threads {
    fn drop(&mut self) {
        self.shared.queue.end();
        self.join();
    }
}

impl Shared {
    fn work(&self, mut encoder: Encoder) {
        let _alarm = Alarm(self);
        let mut encoded = Encoded::default();
        while let Some(next) = self.queue.next() {
            let done = match next {
                Due::Write(number, block) => {
                    encoder.encode(&block, &mut encoded).and_then(|()| self.write(number, block, &encoded))
                }
                Due::Sync => self.lock().request_sync(),
                Due::Nothing(_) => Ok(()),
            };
            if let Err(error) = done {
                self.fail(error);
            }
        }
    }

    fn lock(&self) -> MutexGuard<'_, Writing> {
        // a thread that panicked has failed, and the flag says so
        self.writing.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes a chunk when it is its turn.
    fn write(&self, number: u64, block: Block, encoded: &Encoded) -> io::Result<()> {
        let mut writing = self.lock();
        while writing.written != number && !writing.failed {
            writing = self.turn.wait(writing).unwrap_or_else(PoisonError::into_inner);
        }
        if writing.failed {
            return Ok(());
        }
        #[cfg(feature = "faults")]
        thread::sleep(self.slow_disk);
        writing.output.chunk(&block, encoded)?;
        writing.written += 1;
        writing.sync_if_much()?;
        // before anybody can report an error, which counts the frames not written
        self.queue.written(block);
        drop(writing);
        self.turn.notify_all();
        Ok(())
    }

    fn fail(&self, error: io::Error) {
        self.lock().failed = true;
        self.turn.notify_all();
        self.queue.fail(error);
    }
}

/// Ends the waiting of the others if a thread panics.
struct Alarm<'a>(&'a Shared);

impl Drop for Alarm<'_> {
    fn drop(&mut self) {
        if thread::panicking() {
            self.0.fail(io::Error::other("the thread that writes panicked"));
        }
    }
}
