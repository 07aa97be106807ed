//! Syncing to the disk without keeping the run waiting.

use std::fs::File;
use std::io;
use std::sync::Arc;
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::thread::{self, JoinHandle};

/// Syncs a file in a thread of its own, because a sync after a few hundred MB takes tenths of a second. The thread
/// starts with the first request.
#[derive(Debug, Default)]
pub(crate) struct BackgroundSync {
    worker: Option<Worker>,
}

#[derive(Debug)]
struct Worker {
    requests: SyncSender<()>,
    thread: JoinHandle<io::Result<()>>,
}

impl BackgroundSync {
    /// Asks for a sync of the present contents of `file`. Fails if an earlier request failed.
    pub(crate) fn request(&mut self, file: &Arc<File>) -> io::Result<()> {
        let worker = match self.worker.take() {
            Some(worker) => worker,
            None => match Worker::start(Arc::clone(file)) {
                Ok(worker) => worker,
                // the system grants no thread, so that the run has to wait
                Err(_) => return file.sync_data(),
            },
        };
        match worker.requests.try_send(()) {
            Err(TrySendError::Disconnected(())) => worker.join(),
            // one that waits covers this one, too
            Ok(()) | Err(TrySendError::Full(())) => {
                self.worker = Some(worker);
                Ok(())
            }
        }
    }

    /// Syncs the present contents of `file`, and waits for it. The operating system reports an error of an earlier
    /// request only once, to the sync of that time. This call returns that error, too.
    pub(crate) fn sync(&mut self, file: &File) -> io::Result<()> {
        self.finish()?;
        file.sync_data()
    }

    /// Waits for the requested syncs.
    pub(crate) fn finish(&mut self) -> io::Result<()> {
        self.worker.take().map_or(Ok(()), Worker::join)
    }
}

impl Worker {
    fn start(file: Arc<File>) -> io::Result<Self> {
        let (requests, received) = sync_channel(1);
        let work = move || received.iter().try_for_each(|()| file.sync_data());
        let thread = thread::Builder::new().name("beadline-sync".into()).spawn(work)?;
        Ok(Self { requests, thread })
    }

    fn join(self) -> io::Result<()> {
        drop(self.requests);
        self.thread.join().unwrap_or_else(|_| Err(io::Error::other("syncing panicked")))
    }
}

impl Drop for BackgroundSync {
    fn drop(&mut self) {
        // whoever wants to know calls `finish`
        let _ = self.finish();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::fd::OwnedFd;

    #[test]
    fn what_went_wrong_in_the_background_is_told_by_the_next_sync() {
        let (reader, _writer) = io::pipe().expect("pipe");
        let cannot_be_synced = Arc::new(File::from(OwnedFd::from(reader)));
        let sound = tempfile::tempfile().expect("file");
        let mut sync = BackgroundSync::default();
        sync.request(&cannot_be_synced).expect("asked for");
        sync.sync(&sound).expect_err("the error of the request");
        sync.sync(&sound).expect("nothing else is wrong");
    }
}
