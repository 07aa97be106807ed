//! Reads a file or an object.

use crate::remote::ObjectReader;
use crate::{is_url, open_file};
use std::fs::File;
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;

/// Bytes of a file that are read together.
const FILE_BUFFER_BYTES: usize = 1 << 16;

/// A file or an object, read from any place on.
#[derive(Debug)]
pub struct Reader(Inner);

#[derive(Debug)]
enum Inner {
    File(BufReader<File>, u64),
    Object(ObjectReader),
}

impl Reader {
    /// Opens the file or the URL `path`. An object costs one request, which brings its end, too.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn open(path: &Path) -> io::Result<Self> {
        Self::with_buffer(path, FILE_BUFFER_BYTES)
    }

    /// The same; of a file, `bytes` bytes are read together.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn with_buffer(path: &Path, bytes: usize) -> io::Result<Self> {
        if is_url(path) {
            return Ok(Self(Inner::Object(ObjectReader::open(path)?)));
        }
        let file = open_file(path)?;
        let size = file.metadata()?.len();
        Ok(Self(Inner::File(BufReader::with_capacity(bytes, file), size)))
    }

    /// In bytes, when it was opened.
    pub fn size(&self) -> u64 {
        match &self.0 {
            Inner::File(_, size) => *size,
            Inner::Object(object) => object.size(),
        }
    }

    /// True if each stretch of it costs a request.
    pub fn is_remote(&self) -> bool {
        matches!(self.0, Inner::Object(_))
    }

    /// Announces that all of `range` will be read: an object is then asked for no other bytes. `and_more` means that
    /// reading may well go on after it.
    pub fn expect(&mut self, range: Range<u64>, and_more: bool) {
        if let Inner::Object(object) = &mut self.0 {
            object.expect(range, and_more);
        }
    }

    /// True if reading at `offset` was expected, or costs nothing.
    pub fn expects(&self, offset: u64) -> bool {
        match &self.0 {
            Inner::File(..) => true,
            Inner::Object(object) => object.expects(offset),
        }
    }

    /// Appends the next `bytes` bytes to `buffer`, or as many as there are, and returns their number.
    ///
    /// # Errors
    /// When they cannot be read.
    pub fn read_to(&mut self, bytes: u64, buffer: &mut Vec<u8>) -> io::Result<usize> {
        match &mut self.0 {
            Inner::File(file, _) => file.take(bytes).read_to_end(buffer),
            Inner::Object(object) => object.take(bytes).read_to_end(buffer),
        }
    }
}

impl Read for Reader {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match &mut self.0 {
            Inner::File(file, _) => file.read(buffer),
            Inner::Object(object) => object.read(buffer),
        }
    }
}

impl BufRead for Reader {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        match &mut self.0 {
            Inner::File(file, _) => file.fill_buf(),
            Inner::Object(object) => object.fill_buf(),
        }
    }

    fn consume(&mut self, amount: usize) {
        match &mut self.0 {
            Inner::File(file, _) => file.consume(amount),
            Inner::Object(object) => object.consume(amount),
        }
    }
}

impl Seek for Reader {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match &mut self.0 {
            Inner::File(file, _) => file.seek(to),
            Inner::Object(object) => object.seek(to),
        }
    }

    fn seek_relative(&mut self, offset: i64) -> io::Result<()> {
        match &mut self.0 {
            Inner::File(file, _) => file.seek_relative(offset),
            Inner::Object(object) => object.seek(SeekFrom::Current(offset)).map(drop),
        }
    }
}
