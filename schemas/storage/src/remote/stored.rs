//! Parts of an upload that the store has, as S3 lists them, compared with those of a file.

use super::client::Connector;
use super::{store, wait, xml};
use crate::StorageError;
use md5::Md5;
use object_store::aws::{AmazonS3, AwsAuthorizer};
use object_store::client::{HttpClient, HttpConnector as _, HttpRequest, HttpRequestBody};
use object_store::multipart::PartId;
use object_store::path::Path as ObjectPath;
use object_store::signer::Signer as _;
use object_store::{ClientOptions, Error};
use reqwest::{Method, StatusCode};
use sha2::{Digest as _, Sha256};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

/// Most parts of an upload, and of an answer.
const MOST_PARTS: usize = 10_000;

/// Attempts to get a list, and the pause after the first one.
const ATTEMPTS: u32 = 4;
const PAUSE: Duration = Duration::from_millis(250);

/// A part as the store describes it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Stored {
    bytes: u64,
    /// The MD5 of its bytes, unless the store encrypts them with keys of its own.
    tag: String,
    sha256: Option<String>,
}

/// Asks S3 for the parts of an upload, for which `object_store` has no request.
#[derive(Debug, Clone)]
pub(super) struct Lister {
    store: Arc<AmazonS3>,
    client: HttpClient,
    region: String,
}

impl Lister {
    pub(super) fn new(
        store: Arc<AmazonS3>,
        options: &ClientOptions,
        region: String,
    ) -> object_store::Result<Self> {
        Ok(Self { store, client: Connector::default().connect(options)?, region })
    }

    /// The parts of the upload `id` of the object `path`, by their numbers from 0 on.
    pub(super) fn parts(&self, path: &ObjectPath, id: &str) -> Result<BTreeMap<usize, Stored>, StorageError> {
        let mut parts = BTreeMap::new();
        let mut after = 0;
        loop {
            let text = self.page(path, id, after)?;
            let before = parts.len();
            for found in xml::elements(&text, "Part") {
                let (number, part) = stored(&text[found.content]).ok_or_else(unreadable)?;
                parts.insert(number, part);
            }
            let is_more = xml::text_of(&text, "IsTruncated").is_some_and(|said| said == "true");
            if !is_more {
                return Ok(parts);
            }
            if parts.len() == before || parts.len() > MOST_PARTS {
                return Err(unreadable());
            }
            after = parts.last_key_value().map_or(0, |(index, _)| index + 1);
        }
    }

    /// The answer that lists parts after the one of number `after`.
    fn page(&self, path: &ObjectPath, id: &str, after: usize) -> Result<String, StorageError> {
        let (lister, path, id) = (self.clone(), path.clone(), id.to_owned());
        wait(async move {
            for attempt in 1.. {
                let request = lister.request(&path, &id, after).await.map_err(store::refused)?;
                let (status, text) = match lister.client.execute(request).await {
                    Ok(answer) => {
                        let status = answer.status();
                        let bytes = answer.into_body().bytes().await;
                        let bytes = bytes.map_err(|error| StorageError::Failed(error.to_string()))?;
                        (status, String::from_utf8_lossy(&bytes).into_owned())
                    }
                    Err(error) if attempt < ATTEMPTS => (StatusCode::SERVICE_UNAVAILABLE, error.to_string()),
                    Err(error) => return Err(StorageError::Failed(error.to_string())),
                };
                match status {
                    status if status.is_success() => return Ok(text),
                    StatusCode::NOT_FOUND => return Err(StorageError::NotFound(text)),
                    StatusCode::FORBIDDEN | StatusCode::UNAUTHORIZED => {
                        return Err(StorageError::Denied(text));
                    }
                    status if attempt >= ATTEMPTS || !status.is_server_error() => {
                        let why = format!("the parts that were sent are not listed: {status}: {text}");
                        return Err(StorageError::Failed(why));
                    }
                    _ => tokio::time::sleep(PAUSE * attempt).await,
                }
            }
            Err(unreadable())
        })
    }

    /// The signed request of a page. The keys go into headers, as those of all requests.
    async fn request(&self, path: &ObjectPath, id: &str, after: usize) -> object_store::Result<HttpRequest> {
        let generic =
            |error: Box<dyn std::error::Error + Send + Sync>| Error::Generic { store: "S3", source: error };
        // of the signed address only the place is used
        let mut url = self.store.signed_url(Method::GET, path, Duration::from_mins(1)).await?;
        url.query_pairs_mut()
            .clear()
            .append_pair("part-number-marker", &after.to_string())
            .append_pair("uploadId", id);
        let mut request = HttpRequest::new(HttpRequestBody::empty());
        *request.uri_mut() = url.as_str().parse().map_err(|error| generic(Box::new(error)))?;
        let credential = self.store.credentials().get_credential().await?;
        AwsAuthorizer::new(&credential, "s3", &self.region).try_authorize(&mut request, None)?;
        Ok(request)
    }
}

fn unreadable() -> StorageError {
    StorageError::Failed("the store's list of the parts that were sent cannot be read".into())
}

/// A part as it is listed, and its number from 0 on.
fn stored(text: &str) -> Option<(usize, Stored)> {
    let number: usize = xml::text_of(text, "PartNumber")?.parse().ok()?;
    let index = number.checked_sub(1).filter(|index| *index < MOST_PARTS)?;
    let bytes = xml::text_of(text, "Size")?.parse().ok()?;
    let (tag, sha256) = (xml::text_of(text, "ETag")?, xml::text_of(text, "ChecksumSHA256"));
    Some((index, Stored { bytes, tag, sha256 }))
}

impl Stored {
    /// True if its bytes are `bytes`, by size and hash.
    pub(super) fn is_of(&self, bytes: &[u8]) -> bool {
        if self.bytes != bytes.len() as u64 {
            return false;
        }
        let Some(sha256) = &self.sha256 else {
            let md5 = u128::from_be_bytes(Md5::digest(bytes).into());
            return self.tag.trim_matches('"').eq_ignore_ascii_case(&format!("{md5:032x}"));
        };
        *sha256 == base64(&Sha256::digest(bytes))
    }

    /// The part as `object_store` names it when an upload is completed.
    pub(super) fn id(&self) -> PartId {
        let element = |name: &str, text: &str| format!("<{name}>{}</{name}>", xml::escaped(text));
        let sha256 = self.sha256.as_deref().map_or_else(String::new, |sum| element("checksum_sha256", sum));
        let tag = element("e_tag", &self.tag);
        PartId { content_id: format!("<PartMetadata>{tag}{sha256}</PartMetadata>") }
    }
}

fn base64(bytes: &[u8]) -> String {
    let mut padded = bytes.to_vec();
    padded.resize(bytes.len().next_multiple_of(3), 0);
    let mut text = crate::secrets::base64(&padded, 0);
    let missing = padded.len() - bytes.len();
    text.truncate(text.len() - missing);
    text + &"=".repeat(missing)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_what_its_hashes_say() {
        let text = |sha256: &str| {
            format!(
                "<PartNumber>3</PartNumber><ETag>&quot;5d41402abc4b2a76b9719d911017c592&quot;</ETag>{sha256}<Size>5</Size>"
            )
        };
        let (index, part) = stored(&text("")).expect("a part");
        assert_eq!(index, 2);
        assert!(part.is_of(b"hello") && !part.is_of(b"hellp") && !part.is_of(b"hello "));
        // what the store says of SHA-256 counts, because a tag may be of encrypted bytes
        let sum = "LPJNul+wow4m6DsqxbninhsWHlwfp0JecwQzYpOLmCQ=";
        let (_, part) = stored(&text(&format!("<ChecksumSHA256>{sum}</ChecksumSHA256>"))).expect("a part");
        assert!(part.is_of(b"hello") && !part.is_of(b"hellp"));
        assert_eq!(
            part.id().content_id,
            format!(
                "<PartMetadata><e_tag>\"5d41402abc4b2a76b9719d911017c592\"</e_tag>\
                 <checksum_sha256>{sum}</checksum_sha256></PartMetadata>"
            )
        );
        for torn in ["", "<PartNumber>0</PartNumber>", "<PartNumber>99999999</PartNumber>"] {
            assert!(stored(&text("").replace("<PartNumber>3</PartNumber>", torn)).is_none());
        }
    }
}
