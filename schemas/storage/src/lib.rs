//! Bytes where they lie: files, and objects behind URLs.
//!
//! A URL (`s3://BUCKET/KEY`, `gs://BUCKET/KEY`, `az://CONTAINER/BLOB`, `http://…`, `https://…`) is a path like that of a
//! file: [`Reader::open`] opens either, [`list`] lists either. Credentials and endpoints come from the environment
//! variables `AWS_*`, `GOOGLE_*` and `AZURE_*`, as the crate `object_store` reads them.
//!
//! Architecture invariants: nothing else imports `object_store`. Memory is bounded by the parts of an object that are kept,
//! never by its size. Every answer is of the object that was opened, or an error. No message holds a secret.

mod error;
mod file;
mod list;
mod reader;
#[cfg(feature = "remote")]
mod remote;
#[cfg(not(feature = "remote"))]
#[path = "without.rs"]
mod remote;
mod secrets;
mod sender;
mod stop;

pub use error::StorageError;
pub use file::{open_file, read_file};
pub use list::{Listed, Listing, Skipped};
pub use reader::Reader;
pub use remote::{Upload, forget};
pub use secrets::masked;
pub use sender::{Begun, Errand, Outcome, SendError, SendOptions, Sender, Sent};
pub use stop::stop_when;

use std::io;
use std::path::Path;

/// Schemes of URLs.
const SCHEMES: [&str; 5] = ["s3", "gs", "az", "http", "https"];

/// True if `path` is a URL, and not the name of a file.
pub fn is_url(path: &Path) -> bool {
    let scheme = path.to_str().and_then(|text| text.split_once("://")).map(|(scheme, _)| scheme);
    scheme.is_some_and(|scheme| SCHEMES.contains(&scheme))
}

/// The files under the directory `root`, or the objects under the URL `root`, whose path is `wanted`. Symbolic links to directories
/// are not followed.
///
/// # Errors
/// When a directory cannot be read, when the store refuses, or lists more than can be held.
pub fn list(root: &Path, wanted: impl Fn(&Path) -> bool) -> io::Result<Listing> {
    let mut listing = Listing::default();
    if is_url(root) {
        remote::list(root, &wanted, &mut listing)?;
    } else {
        list::walk(root, &wanted, &mut listing)?;
    }
    listing.entries.sort_by(|one, other| one.path.cmp(&other.path));
    Ok(listing)
}
