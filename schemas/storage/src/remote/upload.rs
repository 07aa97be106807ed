//! Writes an object in parts. It is there when it is whole, and not before.

use super::client::Connector;
use super::store::{self, retries};
use super::stored::{Lister, Stored};
use super::wait;
use crate::StorageError;
use object_store::aws::{AmazonS3Builder, AmazonS3ConfigKey, Checksum};
use object_store::azure::{AzureConfigKey, MicrosoftAzureBuilder};
use object_store::gcp::{GoogleCloudStorageBuilder, GoogleConfigKey};
use object_store::multipart::{MultipartStore, PartId};
use object_store::path::Path as ObjectPath;
use object_store::{
    Attribute, Attributes, ClientConfigKey, ClientOptions, Error, GetOptions, HeaderMap, HeaderValue,
    ObjectMeta, ObjectStore, PutMultipartOptions,
};
use reqwest::header::IF_NONE_MATCH;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

/// Slowest connection over which a part arrives before its request is given up.
const LEAST_BYTES_PER_S: u64 = 100_000;

/// Name of the metadata of an object that name its run.
const RUN: &str = "beadline-run";

trait Store: ObjectStore + MultipartStore {}

impl<S: ObjectStore + MultipartStore> Store for S {}

/// The store that an object is written to.
#[derive(Debug, Clone)]
struct Target {
    store: Arc<dyn Store>,
    /// The same, which completes no object that is there already; none if the store cannot do that.
    new_only: Option<Arc<dyn Store>>,
    /// True if an object can say more about itself than its size.
    takes_attributes: bool,
    /// Lists parts that were sent; none if the store cannot be asked for them.
    lister: Option<Lister>,
    path: ObjectPath,
}

/// An object that is being written.
#[derive(Debug)]
pub struct Upload {
    target: Target,
    id: String,
    parts: Vec<PartId>,
    /// Parts that an earlier attempt has sent, by their numbers.
    stored: BTreeMap<usize, Stored>,
    part_bytes: u64,
    bytes: u64,
    run: String,
    replace: bool,
}

impl Upload {
    /// Begins the object behind `url`, a recording of the run `run`, in parts of about `part_bytes`. The store says here whether
    /// it takes them.
    ///
    /// # Errors
    /// When there is one and it is not to be replaced, or when the store refuses.
    pub fn begin(url: &Path, run: &str, part_bytes: u64, replace: bool) -> Result<Self, StorageError> {
        let target = Target::of(url, part_bytes)?;
        if !replace && target.look()?.is_some() {
            return Err(StorageError::Exists);
        }
        let (asked, name) = (target.clone(), (Attribute::Metadata(RUN.into()), run.to_owned()));
        let id = wait(async move {
            let begun = if asked.takes_attributes {
                let attributes = Attributes::from_iter([name]);
                let options = PutMultipartOptions { attributes, ..PutMultipartOptions::default() };
                asked.store.create_multipart_opts(&asked.path, options).await
            } else {
                asked.store.create_multipart(&asked.path).await
            };
            begun.map_err(store::refused)
        })?;
        let (parts, stored, run) = (Vec::new(), BTreeMap::new(), run.to_owned());
        Ok(Self { target, id, parts, stored, part_bytes, bytes: 0, run, replace })
    }

    /// Goes on with the upload `id`, which was begun in the same way: parts that the store has are not sent again. None
    /// if the store has no such upload any more, or does not list its parts.
    ///
    /// # Errors
    /// When there is an object and it is not to be replaced, or when the store refuses.
    pub fn resume(
        url: &Path,
        id: &str,
        run: &str,
        part_bytes: u64,
        replace: bool,
    ) -> Result<Option<Self>, StorageError> {
        let target = Target::of(url, part_bytes)?;
        let Some(lister) = &target.lister else { return Ok(None) };
        if !replace && target.look()?.is_some() {
            return Err(StorageError::Exists);
        }
        let stored = match lister.parts(&target.path, id) {
            Err(StorageError::NotFound(_)) => return Ok(None),
            stored => stored?,
        };
        let (id, run) = (id.to_owned(), run.to_owned());
        Ok(Some(Self { target, id, parts: Vec::new(), stored, part_bytes, bytes: 0, run, replace }))
    }

    /// True if another attempt can go on with the parts that were sent.
    pub fn can_be_resumed(&self) -> bool {
        self.target.lister.is_some()
    }

    /// Gives up the upload `id` of the object behind `url`, and has the store remove its parts.
    ///
    /// # Errors
    /// When the store refuses. An upload that is not there any more is given up.
    pub fn give_up(url: &Path, id: &str) -> Result<(), StorageError> {
        let (target, id) = (Target::of(url, 0)?, id.to_owned());
        match wait(
            async move { target.store.abort_multipart(&target.path, &id).await.map_err(store::refused) },
        ) {
            Err(StorageError::NotFound(_)) => Ok(()),
            ended => ended,
        }
    }

    /// The store's name of the upload.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// The size of its parts, but for the last, unless it becomes far larger than expected.
    pub fn part_bytes(&self) -> u64 {
        self.part_bytes
    }

    /// Bytes sent so far.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Parts sent so far.
    pub fn parts(&self) -> usize {
        self.parts.len()
    }

    /// Sends the next part, unless the store has it: whether it was sent. After an error it may be sent again.
    ///
    /// # Errors
    /// When the store refuses, after all retries.
    pub fn send(&mut self, part: Vec<u8>) -> Result<bool, StorageError> {
        let (index, bytes) = (self.parts.len(), part.len());
        let stored = self.stored.remove(&index).filter(|stored| stored.is_of(&part));
        let is_there = stored.is_some();
        let part = if let Some(stored) = stored {
            stored.id()
        } else {
            let (target, id) = (self.target.clone(), self.id.clone());
            wait(async move {
                target.store.put_part(&target.path, &id, index, part.into()).await.map_err(store::refused)
            })?
        };
        self.parts.push(part);
        self.bytes += bytes as u64;
        Ok(!is_there)
    }

    /// Completes the object, and looks whether it is there as it was sent. After an error it may be completed again.
    ///
    /// # Errors
    /// When the store refuses, when there is such an object by now, or when it is not as long as it must be.
    pub fn complete(&mut self) -> Result<(), StorageError> {
        if !self.replace && self.target.look()?.is_some_and(|found| !self.is_sent(&found)) {
            return Err(StorageError::Exists);
        }
        let (target, id, parts) = (self.target.clone(), self.id.clone(), self.parts.clone());
        let new_only = target.new_only.filter(|_| !self.replace);
        let completed = wait(async move {
            let store = new_only.unwrap_or(target.store);
            let ended = store.complete_multipart(&target.path, &id, parts).await;
            ended.map_err(|error| match error {
                Error::Precondition { .. } | Error::AlreadyExists { .. } => StorageError::Exists,
                error => store::refused(error),
            })
        });
        // an answer may be lost on its way, and what was asked for again is refused
        let found = self.target.look()?;
        match (completed, found) {
            (_, Some(found)) if self.is_sent(&found) => Ok(()),
            (Err(error), _) => Err(error),
            (Ok(result), Some((found, _))) if found.size == self.bytes && found.e_tag == result.e_tag => {
                Ok(())
            }
            (Ok(_), found) => {
                let there = found.map_or(0, |(found, _)| found.size);
                Err(StorageError::Failed(format!("the store has {there} bytes, {} were sent", self.bytes)))
            }
        }
    }

    /// True if an object is the sent one.
    fn is_sent(&self, (found, attributes): &(ObjectMeta, Attributes)) -> bool {
        let run = attributes.get(&Attribute::Metadata(RUN.into()));
        found.size == self.bytes && run.is_some_and(|run| **run == *self.run)
    }
}

impl Target {
    fn of(url: &Path, part_bytes: u64) -> Result<Self, StorageError> {
        let (base, path) = store::place_of_object(url)?;
        super::handle()?; // which chooses the cryptography
        let timeout = format!("{} seconds", 60 + part_bytes / LEAST_BYTES_PER_S); // integers
        let stores: object_store::Result<Stores> = match base.split("://").next() {
            Some("s3") => s3(base, &timeout),
            Some("gs") => {
                let gs = GoogleCloudStorageBuilder::from_env().with_url(base).with_retry(retries());
                let gs = gs.with_http_connector(Connector::default());
                let gs = gs.with_config(GoogleConfigKey::Client(ClientConfigKey::Timeout), timeout).build();
                gs.map(|gs| (Arc::new(gs) as _, None, None))
            }
            Some("az") => {
                let az = MicrosoftAzureBuilder::from_env().with_url(base).with_retry(retries());
                let az = az.with_http_connector(Connector::default());
                let az = az.with_config(AzureConfigKey::Client(ClientConfigKey::Timeout), timeout).build();
                az.map(|az| (Arc::new(az) as _, None, None))
            }
            _ => return Err(StorageError::Url("what is behind http:// and https:// is only read".into())),
        };
        let (store, new_only, lister) = stores.map_err(store::unusable)?;
        Ok(Self { store, new_only, takes_attributes: !base.starts_with("az"), lister, path })
    }

    /// The store's description of the object, if there is one.
    fn look(&self) -> Result<Option<(ObjectMeta, Attributes)>, StorageError> {
        let target = self.clone();
        let options = GetOptions { head: true, ..GetOptions::default() };
        let found = wait(async move {
            let found = target.store.get_opts(&target.path, options).await.map_err(store::refused)?;
            Ok((found.meta, found.attributes))
        });
        match found {
            Ok(found) => Ok(Some(found)),
            Err(StorageError::NotFound(_)) => Ok(None),
            Err(error) => Err(error),
        }
    }
}

type Stores = (Arc<dyn Store>, Option<Arc<dyn Store>>, Option<Lister>);

/// A bucket, the same under the condition that there is no such object, and who lists its parts.
fn s3(base: &str, timeout: &str) -> object_store::Result<Stores> {
    let builder = |options: ClientOptions| {
        let options = options.with_config(ClientConfigKey::Timeout, timeout);
        let builder = AmazonS3Builder::from_env().with_url(base).with_client_options(options);
        let builder = builder.with_http_connector(Connector::default()).with_retry(retries());
        builder.with_checksum_algorithm(Checksum::SHA256)
    };
    let condition = HeaderMap::from_iter([(IF_NONE_MATCH, HeaderValue::from_static("*"))]);
    let new_only = builder(client_options().with_default_headers(condition)).build()?;
    let any = builder(client_options());
    let region = any.get_config_value(&AmazonS3ConfigKey::Region).unwrap_or_else(|| "us-east-1".into());
    let any = Arc::new(any.build()?);
    let lister = Lister::new(Arc::clone(&any), &client_options(), region)?;
    Ok((any, Some(Arc::new(new_only)), Some(lister)))
}

/// Options of connections to S3 from the environment; options that are given replace them.
fn client_options() -> ClientOptions {
    let known = std::env::vars().filter_map(|(name, value)| {
        let key = name.strip_prefix("AWS_")?.to_ascii_lowercase().parse::<ClientConfigKey>().ok()?;
        Some((key, value))
    });
    known.fold(ClientOptions::new(), |options, (key, value)| options.with_config(key, value))
}
