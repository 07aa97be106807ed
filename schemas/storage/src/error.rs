//! Errors of objects behind URLs.

use crate::secrets::masked;
use std::io;

/// Why an object cannot be read or written.
#[derive(Debug, Clone, thiserror::Error)]
pub enum StorageError {
    /// The feature `remote` is not there.
    #[error(
        "this command was built without `remote`, which reads and writes URLs: `cargo install --path . --features \
         remote` in its source builds one that has it"
    )]
    NotBuilt,
    /// Not a URL of an object.
    #[error(
        "{0}; a URL looks like s3://BUCKET/KEY, gs://BUCKET/KEY, az://CONTAINER/BLOB or https://HOST/PATH"
    )]
    Url(String),
    /// There is no such object, bucket or container.
    #[error("not found: {0}")]
    NotFound(String),
    /// There is an object of this name.
    #[error("it exists already; choose another name, or replace it with --force")]
    Exists,
    /// No credentials, wrong ones, or ones that may not.
    #[error(
        "access denied: {0}; credentials come from the environment (AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, \
         GOOGLE_APPLICATION_CREDENTIALS, AZURE_STORAGE_ACCOUNT_NAME and AZURE_STORAGE_ACCOUNT_KEY)"
    )]
    Denied(String),
    /// The object is another one than when it was opened.
    #[error("it was changed while it was read; read it again")]
    Changed,
    /// The server sends whole objects only.
    #[error(
        "the server does not send parts of objects (HTTP range requests), which reading needs; copy it to a file"
    )]
    NoRanges,
    /// The program was asked to stop.
    #[error("stopped before the store had answered")]
    Stopped,
    /// Anything else, after all retries.
    #[error("{0}")]
    Failed(String),
}

impl StorageError {
    /// True if another name, or another build of the command, is needed.
    pub fn is_of_usage(&self) -> bool {
        matches!(self, Self::NotBuilt | Self::Url(_) | Self::Exists)
    }

    /// The same without the secrets that a store or the environment may have put there.
    #[cfg_attr(not(feature = "remote"), expect(dead_code, reason = "nothing is asked of a store"))]
    pub(crate) fn masked(self) -> Self {
        match self {
            Self::Url(text) => Self::Url(masked(&text)),
            Self::NotFound(text) => Self::NotFound(masked(&text)),
            Self::Denied(text) => Self::Denied(masked(&text)),
            Self::Failed(text) => Self::Failed(masked(&text)),
            Self::NotBuilt | Self::Exists | Self::Changed | Self::NoRanges | Self::Stopped => self,
        }
    }
}

impl From<StorageError> for io::Error {
    fn from(error: StorageError) -> Self {
        let kind = match &error {
            StorageError::NotBuilt | StorageError::NoRanges => io::ErrorKind::Unsupported,
            StorageError::Url(_) => io::ErrorKind::InvalidInput,
            StorageError::NotFound(_) => io::ErrorKind::NotFound,
            StorageError::Exists => io::ErrorKind::AlreadyExists,
            StorageError::Denied(_) => io::ErrorKind::PermissionDenied,
            // not `Interrupted`, after which readers try again
            StorageError::Changed | StorageError::Stopped | StorageError::Failed(_) => io::ErrorKind::Other,
        };
        Self::new(kind, error)
    }
}
