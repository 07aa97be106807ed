//! Objects behind URLs, by the crate `object_store`: one thread makes all requests, and callers wait for it.

mod client;
mod listing;
mod object;
mod options;
mod reader;
mod store;
mod stored;
mod upload;
mod xml;

pub(crate) use listing::list;

pub use object::forget;
pub(crate) use reader::ObjectReader;
pub use upload::Upload;

use crate::{StorageError, stop};
use std::future::Future;
use std::io;
use std::sync::OnceLock;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;
use tokio::runtime::{Builder, Handle};

/// Between two looks at whether the program is asked to stop.
pub(crate) const LOOK: Duration = Duration::from_millis(50);

/// The thread that makes requests, started by the first one.
pub(crate) fn handle() -> Result<&'static Handle, StorageError> {
    static HANDLE: OnceLock<Result<Handle, StorageError>> = OnceLock::new();
    HANDLE.get_or_init(start).as_ref().map_err(Clone::clone)
}

fn start() -> Result<Handle, StorageError> {
    let failed = |error: io::Error| StorageError::Failed(format!("no thread for requests: {error}"));
    // whoever came first has chosen for the whole process
    let _ = rustls::crypto::ring::default_provider().install_default();
    let runtime = Builder::new_current_thread().enable_all().build().map_err(failed)?;
    let handle = runtime.handle().clone();
    let work = move || runtime.block_on(std::future::pending::<()>());
    std::thread::Builder::new().name("beadline-remote".into()).spawn(work).map_err(failed)?;
    Ok(handle)
}

/// Runs `work` on the thread that makes requests, and waits for it, unless the program is asked to stop meanwhile. No
/// error message holds a secret.
pub(crate) fn wait<T: Send + 'static>(
    work: impl Future<Output = Result<T, StorageError>> + Send + 'static,
) -> Result<T, StorageError> {
    let (answer, answers) = mpsc::sync_channel(1);
    let task = handle()?.spawn(async move {
        // nobody may wait any more
        let _ = answer.send(work.await);
    });
    loop {
        match answers.recv_timeout(LOOK) {
            Ok(answer) => return answer.map_err(StorageError::masked),
            Err(RecvTimeoutError::Timeout) if stop::is_asked() => {
                task.abort();
                return Err(StorageError::Stopped);
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => {
                return Err(StorageError::Failed("the request was given up".into()));
            }
        }
    }
}
