//! An object as it was when it was opened, and the parts of it that are at hand.

use super::{LOOK, handle, store, wait};
use crate::{StorageError, stop};
use futures_util::TryStreamExt as _;
use object_store::path::Path as ObjectPath;
use object_store::{Error, GetOptions, GetRange, GetResult, ObjectMeta, ObjectStore};
use std::collections::VecDeque;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Condvar, Mutex, PoisonError, Weak};

/// Bytes of its end that the request brings that opens an object: footer and summary of most recordings.
const TAIL_BYTES: u64 = 256 << 10;

/// Parts that an object keeps; each is at most as long as a reader asks for.
const MOST_PARTS: usize = 4;

/// Objects that stay open when nobody reads them, for those who open one several times.
const MOST_IDLE: usize = 2;

/// An object.
#[derive(Debug)]
pub(crate) struct Object {
    url: PathBuf,
    store: Arc<dyn ObjectStore>,
    path: ObjectPath,
    found: ObjectMeta,
    tail: Arc<Part>,
    /// The last one was used last.
    parts: Mutex<VecDeque<Arc<Part>>>,
}

/// Bytes that were asked for.
#[derive(Debug)]
pub(crate) struct Part {
    pub(crate) range: Range<u64>,
    bytes: Mutex<Option<Result<Arc<Vec<u8>>, StorageError>>>,
    arrived: Condvar,
}

#[derive(Default)]
struct Known {
    all: Vec<Weak<Object>>,
    /// The last one was opened last.
    idle: VecDeque<Arc<Object>>,
}

static KNOWN: Mutex<Known> = Mutex::new(Known { all: Vec::new(), idle: VecDeque::new() });

/// Forgets the object behind the URL `path`: the next reader opens it anew.
pub fn forget(path: &Path) {
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    known.idle.retain(|object| object.url != path);
    known.all.retain(|object| object.upgrade().is_some_and(|object| object.url != path));
}

impl Object {
    /// The object behind `url`: the same one as long as anybody reads it, and a while longer.
    pub(crate) fn open(url: &Path) -> Result<Arc<Self>, StorageError> {
        let known = || KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        let found = known().all.iter().filter_map(Weak::upgrade).find(|object| object.url == url);
        let object = match found {
            Some(object) => object,
            None => Arc::new(Self::request(url)?),
        };
        let mut known = known();
        known.all.retain(|other| other.upgrade().is_some_and(|other| other.url != url));
        known.all.push(Arc::downgrade(&object));
        known.idle.retain(|other| other.url != url);
        known.idle.push_back(Arc::clone(&object));
        if known.idle.len() > MOST_IDLE {
            known.idle.pop_front();
        }
        Ok(object)
    }

    fn request(url: &Path) -> Result<Self, StorageError> {
        let (store, path) = store::of_object(url)?;
        let asked = (Arc::clone(&store), path.clone());
        let (found, start, bytes) = wait(async move { tail(&*asked.0, &asked.1).await })?;
        let tail = Part::asked(start..found.size);
        tail.arrive(Ok(bytes));
        let parts = Mutex::default();
        Ok(Self { url: url.to_owned(), store, path, found, tail: Arc::new(tail), parts })
    }

    pub(crate) fn size(&self) -> u64 {
        self.found.size
    }

    /// The part with the byte at `offset`: one that is there, or else one that is asked for now and goes on to `end` or
    /// to where the next one begins.
    pub(crate) fn part(self: &Arc<Self>, offset: u64, end: u64) -> Result<Arc<Part>, StorageError> {
        if offset >= self.tail.range.start {
            return Ok(Arc::clone(&self.tail));
        }
        let mut parts = self.parts.lock().unwrap_or_else(PoisonError::into_inner);
        let known = parts.iter().position(|part| part.range.contains(&offset) && !part.has_failed());
        let part = if let Some(part) = known.and_then(|known| parts.remove(known)) {
            part
        } else {
            let starts = parts.iter().chain([&self.tail]).map(|part| part.range.start);
            let next = starts.filter(|start| *start > offset).min();
            let range = offset..next.map_or(end, |next| end.min(next)); // integers
            let part = Arc::new(Part::asked(range));
            self.ask(&part)?;
            part
        };
        parts.push_back(Arc::clone(&part));
        if parts.len() > MOST_PARTS {
            parts.pop_front();
        }
        Ok(part)
    }

    /// Has the bytes of `part` brought.
    fn ask(self: &Arc<Self>, part: &Arc<Part>) -> Result<(), StorageError> {
        let (object, part) = (Arc::clone(self), Arc::clone(part));
        let range = part.range.clone();
        let request = handle()?.spawn(async move { object.get(range).await });
        handle()?.spawn(async move {
            let gone = |_| Err(StorageError::Failed("the request was given up".into()));
            part.arrive(request.await.unwrap_or_else(gone).map_err(StorageError::masked));
        });
        Ok(())
    }

    async fn get(&self, range: Range<u64>) -> Result<Vec<u8>, StorageError> {
        let found = &self.found;
        // a weak tag never matches
        let tag = found.e_tag.clone().filter(|tag| !tag.starts_with("W/"));
        let since = (found.last_modified.timestamp() > 0).then_some(found.last_modified);
        let options = GetOptions {
            range: Some(GetRange::Bounded(range.clone())),
            if_unmodified_since: since.filter(|_| tag.is_none()),
            if_match: tag,
            ..GetOptions::default()
        };
        let answer = match self.store.get_opts(&self.path, options).await {
            Ok(answer) if same(&answer.meta, found) => body(answer, range.end - range.start).await,
            Ok(_) => Err(StorageError::Changed),
            Err(error) => Err(store::refused(error)),
        };
        if matches!(answer, Err(StorageError::Changed)) {
            forget(&self.url);
        }
        answer
    }
}

/// True if both are of the same object, as far as the store tells.
fn same(one: &ObjectMeta, other: &ObjectMeta) -> bool {
    (&one.e_tag, one.size, one.last_modified) == (&other.e_tag, other.size, other.last_modified)
}

/// The store's description of an object, and the end of the object: its offset, and its bytes.
async fn tail(
    store: &dyn ObjectStore,
    path: &ObjectPath,
) -> Result<(ObjectMeta, u64, Vec<u8>), StorageError> {
    let with = |range| GetOptions { range: Some(range), ..GetOptions::default() };
    let answer = match store.get_opts(path, with(GetRange::Suffix(TAIL_BYTES))).await {
        Ok(answer) => answer,
        // Azure has no suffixes, and an empty object has none anywhere
        Err(error) if matches!(error, Error::NotSupported { .. }) || error.to_string().contains("416") => {
            let head = GetOptions { head: true, ..GetOptions::default() };
            let found = store.get_opts(path, head).await.map_err(|_| store::refused(error))?.meta;
            if found.size == 0 {
                return Ok((found, 0, Vec::new()));
            }
            let range = GetRange::Bounded(found.size.saturating_sub(TAIL_BYTES)..found.size);
            let options = GetOptions { if_match: found.e_tag, ..with(range) };
            store.get_opts(path, options).await.map_err(store::refused)?
        }
        Err(error) => return Err(store::refused(error)),
    };
    let (found, start) = (answer.meta.clone(), answer.range.start);
    let bytes = body(answer, (found.size - start).min(TAIL_BYTES)).await?; // integers
    Ok((found, start, bytes))
}

/// The `count` bytes that were asked for, and no more, whatever the server sends.
async fn body(answer: GetResult, count: u64) -> Result<Vec<u8>, StorageError> {
    let mut pieces = answer.into_stream();
    let mut bytes = Vec::new();
    while let Some(piece) = pieces.try_next().await.map_err(store::refused)? {
        bytes.extend_from_slice(&piece);
        if bytes.len() as u64 > count {
            break;
        }
    }
    let found = bytes.len();
    let what = || StorageError::Failed(format!("the answer has {found} bytes instead of {count}"));
    if found as u64 == count { Ok(bytes) } else { Err(what()) }
}

impl Part {
    fn asked(range: Range<u64>) -> Self {
        Self { range, bytes: Mutex::default(), arrived: Condvar::new() }
    }

    fn arrive(&self, bytes: Result<Vec<u8>, StorageError>) {
        *self.bytes.lock().unwrap_or_else(PoisonError::into_inner) = Some(bytes.map(Arc::new));
        self.arrived.notify_all();
    }

    fn has_failed(&self) -> bool {
        matches!(*self.bytes.lock().unwrap_or_else(PoisonError::into_inner), Some(Err(_)))
    }

    /// Its bytes, when they are there, unless the program is asked to stop meanwhile.
    pub(crate) fn wait(&self) -> Result<Arc<Vec<u8>>, StorageError> {
        let mut bytes = self.bytes.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            if let Some(bytes) = &*bytes {
                return bytes.clone();
            }
            if stop::is_asked() {
                return Err(StorageError::Stopped);
            }
            bytes = self.arrived.wait_timeout(bytes, LOOK).unwrap_or_else(PoisonError::into_inner).0;
        }
    }
}
