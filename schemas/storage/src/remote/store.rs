//! The store of a URL, and the meaning of its refusals.

use super::client::{Connector, Skips};
use crate::StorageError;
use object_store::aws::AmazonS3Builder;
use object_store::azure::MicrosoftAzureBuilder;
use object_store::gcp::GoogleCloudStorageBuilder;
use object_store::http::HttpBuilder;
use object_store::list::PaginatedListStore;
use object_store::path::Path as ObjectPath;
use object_store::{BackoffConfig, ClientConfigKey, Error, ObjectStore, RetryConfig};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

/// Number of retries of a request, and their longest time.
const RETRIES: usize = 6;
const RETRY_FOR: Duration = Duration::from_mins(1);

/// Keeps connections from object to object.
static STORES: Mutex<BTreeMap<String, Arc<dyn ObjectStore>>> = Mutex::new(BTreeMap::new());

/// The store of the URL `url`, and the object's name there.
pub(crate) fn of_object(url: &Path) -> Result<(Arc<dyn ObjectStore>, ObjectPath), StorageError> {
    let (base, path) = place_of_object(url)?;
    Ok((of_base(base)?, path))
}

/// `s3://BUCKET` of the URL `url`, and the object's name there.
pub(super) fn place_of_object(url: &Path) -> Result<(&str, ObjectPath), StorageError> {
    let (base, key) = split(url)?;
    if key.is_empty() || key.ends_with('/') {
        return Err(StorageError::Url("no object is named".into()));
    }
    Ok((base, object_path(base, key)?))
}

/// A place with objects.
pub(crate) struct Directory {
    pub(super) store: Store,
    /// Prefix of their names.
    pub(crate) prefix: Option<ObjectPath>,
    /// Base of their URLs.
    pub(crate) base: String,
    /// Objects that were left out of the last page.
    pub(super) skipped: Arc<Mutex<Skips>>,
}

/// A store of any kind.
pub(super) struct Store {
    pub(super) objects: Arc<dyn ObjectStore>,
    /// Lists some objects at a time; absent if all are listed in one answer.
    pub(super) pages: Option<Arc<dyn PaginatedListStore>>,
}

impl Store {
    fn with_pages<S: ObjectStore + PaginatedListStore>(store: S) -> Self {
        let store = Arc::new(store);
        Self { objects: Arc::clone(&store) as _, pages: Some(store) }
    }
}

/// The store of the URL `url`, and which of its objects are below that.
pub(crate) fn of_directory(url: &Path) -> Result<Directory, StorageError> {
    let (base, key) = split(url)?;
    let key = key.trim_end_matches('/');
    let prefix = if key.is_empty() { None } else { Some(object_path(base, key)?) };
    super::handle()?; // which chooses the cryptography
    let connector = Connector::default();
    let skipped = Arc::clone(&connector.skipped);
    let store = build(base, connector).map_err(unusable)?;
    Ok(Directory { store, prefix, base: base.to_owned(), skipped })
}

/// `s3://BUCKET` and `KEY`.
fn split(url: &Path) -> Result<(&str, &str), StorageError> {
    let text = url.to_str().ok_or_else(|| StorageError::Url("it is not UTF-8".into()))?;
    let host = text.find("://").map_or(0, |at| at + 3);
    let end = text[host..].find('/').map_or(text.len(), |at| host + at);
    let (base, key) = (&text[..end], text[end..].trim_start_matches('/'));
    if base.len() == host {
        return Err(StorageError::Url("it names no bucket, container or host".into()));
    }
    if base.starts_with("http") && (base.contains('@') || key.contains(['?', '#'])) {
        return Err(StorageError::Url("names, passwords and queries in URLs are not read".into()));
    }
    Ok((base, key))
}

fn object_path(base: &str, key: &str) -> Result<ObjectPath, StorageError> {
    // keys of buckets are written as they are, as other tools do
    let parsed =
        if base.starts_with("http") { ObjectPath::from_url_path(key) } else { ObjectPath::parse(key) };
    parsed.map_err(|error| StorageError::Url(error.to_string()))
}

fn of_base(base: &str) -> Result<Arc<dyn ObjectStore>, StorageError> {
    let mut stores = STORES.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(store) = stores.get(base) {
        return Ok(Arc::clone(store));
    }
    super::handle()?; // which chooses the cryptography
    let store = build(base, Connector::default()).map_err(unusable)?.objects;
    stores.insert(base.to_owned(), Arc::clone(&store));
    Ok(store)
}

/// The error of a store that the environment or the URL makes impossible.
#[expect(clippy::needless_pass_by_value, reason = "for `map_err`")]
pub(super) fn unusable(error: Error) -> StorageError {
    StorageError::Url(error.to_string()).masked()
}

/// Rules for the retries of requests.
pub(super) fn retries() -> RetryConfig {
    RetryConfig {
        max_retries: RETRIES,
        retry_timeout: RETRY_FOR,
        backoff: BackoffConfig { max_backoff: Duration::from_secs(5), ..BackoffConfig::default() },
    }
}

fn build(base: &str, connector: Connector) -> object_store::Result<Store> {
    let retry = retries();
    Ok(match base.split("://").next() {
        Some("s3") => {
            let s3 = AmazonS3Builder::from_env().with_url(base).with_http_connector(connector);
            Store::with_pages(s3.with_retry(retry).build()?)
        }
        Some("gs") => {
            let gs = GoogleCloudStorageBuilder::from_env().with_url(base).with_http_connector(connector);
            Store::with_pages(gs.with_retry(retry).build()?)
        }
        Some("az") => {
            let az = MicrosoftAzureBuilder::from_env().with_url(base).with_http_connector(connector);
            Store::with_pages(az.with_retry(retry).build()?)
        }
        _ => {
            let http = HttpBuilder::new().with_url(base).with_config(ClientConfigKey::AllowHttp, "true");
            let http = http.with_http_connector(Connector { is_public: true, ..connector });
            Store { objects: Arc::new(http.with_retry(retry).build()?), pages: None }
        }
    })
}

/// Meaning of a store's error.
#[expect(clippy::needless_pass_by_value, reason = "for `map_err`")]
pub(crate) fn refused(error: Error) -> StorageError {
    if causes(&error).any(|cause| matches!(cause.downcast_ref(), Some(Error::Precondition { .. }))) {
        return StorageError::Changed;
    }
    let text = error.to_string();
    match error {
        Error::NotFound { .. } if text.contains("NoSuchBucket") => {
            StorageError::NotFound("there is no such bucket".into())
        }
        Error::NotFound { .. } => StorageError::NotFound("there is no such object".into()),
        Error::PermissionDenied { .. } | Error::Unauthenticated { .. } => {
            StorageError::Denied(reason(&text).unwrap_or("the store does not say why").to_owned())
        }
        _ if text.contains("non-partial response") => StorageError::NoRanges,
        _ => StorageError::Failed(text),
    }
}

/// `AccessDenied: …`, as the client tells it of the body, behind the status.
fn reason(text: &str) -> Option<&str> {
    let (_, told) = text.rsplit_once("status code: ")?.1.split_once(": ")?;
    Some(told).filter(|told| !told.is_empty())
}

fn causes<'a>(error: &'a Error) -> impl Iterator<Item = &'a (dyn std::error::Error + 'static)> {
    let first: &(dyn std::error::Error + 'static) = error;
    std::iter::successors(Some(first), |cause| (*cause).source())
}
