//! Stand-ins for objects behind URLs in a build without them.

use crate::{Listing, StorageError};
use std::convert::Infallible;
use std::io::{self, BufRead, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

/// Makes methods that nobody can call: their type has no value.
macro_rules! unreached {
    ($($visible:vis fn $name:ident($($parameter:tt)*) -> $result:ty = $never:expr;)*) => { $(
        $visible fn $name($($parameter)*) -> $result {
            match $never {}
        }
    )* };
}

/// None can be opened.
#[derive(Debug)]
pub(crate) struct ObjectReader(Infallible);

impl ObjectReader {
    pub(crate) fn open(_: &Path) -> io::Result<Self> {
        Err(StorageError::NotBuilt.into())
    }

    unreached! {
        pub(crate) fn size(&self) -> u64 = self.0;
        pub(crate) fn expect(&mut self, _: Range<u64>, _: bool) -> () = self.0;
        pub(crate) fn expects(&self, _: u64) -> bool = self.0;
    }
}

impl Read for ObjectReader {
    unreached! { fn read(&mut self, _: &mut [u8]) -> io::Result<usize> = self.0; }
}

impl BufRead for ObjectReader {
    unreached! {
        fn fill_buf(&mut self) -> io::Result<&[u8]> = self.0;
        fn consume(&mut self, _: usize) -> () = self.0;
    }
}

impl Seek for ObjectReader {
    unreached! { fn seek(&mut self, _: SeekFrom) -> io::Result<u64> = self.0; }
}

pub(crate) fn list(_: &Path, _: &dyn Fn(&Path) -> bool, _: &mut Listing) -> Result<(), StorageError> {
    Err(StorageError::NotBuilt)
}

/// Forgets the object behind the URL `path`: the next reader opens it anew.
pub fn forget(_: &Path) {}

/// None can be written.
#[derive(Debug)]
pub struct Upload(Infallible);

#[expect(missing_docs, clippy::missing_errors_doc, reason = "as in a build with them")]
impl Upload {
    pub fn begin(_: &Path, _: &str, _: u64, _: bool) -> Result<Self, StorageError> {
        Err(StorageError::NotBuilt)
    }

    pub fn resume(_: &Path, _: &str, _: &str, _: u64, _: bool) -> Result<Option<Self>, StorageError> {
        Err(StorageError::NotBuilt)
    }

    pub fn give_up(_: &Path, _: &str) -> Result<(), StorageError> {
        Err(StorageError::NotBuilt)
    }

    unreached! {
        pub fn can_be_resumed(&self) -> bool = self.0;
        pub fn part_bytes(&self) -> u64 = self.0;
        pub fn id(&self) -> &str = self.0;
        pub fn bytes(&self) -> u64 = self.0;
        pub fn parts(&self) -> usize = self.0;
        pub fn send(&mut self, _: Vec<u8>) -> Result<bool, StorageError> = self.0;
        pub fn complete(&mut self) -> Result<(), StorageError> = self.0;
    }
}
