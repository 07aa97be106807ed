//! Objects behind URLs, by the crate `object_store`: one thread makes all requests, and callers wait for it.

mod object;
mod reader;
mod store;
mod upload;

pub use object::forget;
pub(crate) use reader::ObjectReader;
pub use upload::Upload;

use crate::{Entry, StorageError};
use futures_util::TryStreamExt as _;
use std::future::Future;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{OnceLock, mpsc};
use store::Directory;
use tokio::runtime::{Builder, Handle};

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

/// Runs `work` on the thread that makes requests, and waits for it.
pub(crate) fn wait<T: Send + 'static>(
    work: impl Future<Output = Result<T, StorageError>> + Send + 'static,
) -> Result<T, StorageError> {
    let (answer, answers) = mpsc::sync_channel(1);
    handle()?.spawn(async move { answer.send(work.await) });
    answers.recv().unwrap_or_else(|_| Err(StorageError::Failed("the request was given up".into())))
}

/// All objects under the URL `root`.
pub(crate) fn list(root: &Path) -> io::Result<Vec<Entry>> {
    let Directory { store, prefix, base } = store::of_directory(root)?;
    let entry = move |found: object_store::ObjectMeta| Entry {
        path: PathBuf::from(format!("{base}/{}", found.location)),
        bytes: found.size,
    };
    let found = wait(async move {
        let found: Vec<_> = store.list(prefix.as_ref()).try_collect().await.map_err(store::refused)?;
        Ok(found)
    })?;
    Ok(found.into_iter().map(entry).collect())
}
