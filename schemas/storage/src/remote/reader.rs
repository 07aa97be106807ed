//! Reads an object from place to place, with few requests. Announced ranges come in large parts, the next one on its
//! way while one is used. Else parts are small at first, and grow as reading goes on.

use super::object::{Object, Part};
use std::io::{self, BufRead, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

/// Bytes of the first request without an announcement: the beginning of most recordings.
const LITTLE_BYTES: u64 = 64 << 10;

/// Factor by which requests grow as reading goes on.
const GROWTH: u64 = 8;

/// The most that one request brings.
const MOST_BYTES: u64 = 8 << 20;

/// A reader of an object.
#[derive(Debug)]
pub(crate) struct ObjectReader {
    object: Arc<Object>,
    position: u64,
    /// Range of the bytes at hand.
    here: Range<u64>,
    bytes: Arc<Vec<u8>>,
    /// On its way.
    next: Option<Arc<Part>>,
    expected: Range<u64>,
    /// Reading may go on after the announced range.
    and_more: bool,
    /// Bytes of the next request without an announcement.
    amount: u64,
}

impl ObjectReader {
    pub(crate) fn open(url: &Path) -> io::Result<Self> {
        let object = Object::open(url)?;
        Ok(Self {
            object,
            position: 0,
            here: 0..0,
            bytes: Arc::default(),
            next: None,
            expected: 0..0,
            and_more: false,
            amount: 0,
        })
    }

    pub(crate) fn size(&self) -> u64 {
        self.object.size()
    }

    pub(crate) fn expect(&mut self, range: Range<u64>, and_more: bool) {
        (self.expected, self.and_more) = (range, and_more);
    }

    pub(crate) fn expects(&self, offset: u64) -> bool {
        self.expected.contains(&offset) || self.here.contains(&offset)
    }

    /// End of a part that starts at `offset`.
    fn end_of(&self, offset: u64) -> u64 {
        let most = if self.expected.contains(&offset) { self.expected.end - offset } else { self.amount };
        // a server may claim any size
        offset.saturating_add(most.min(MOST_BYTES)).min(self.size()) // integers
    }

    /// Brings the bytes at the position.
    fn load(&mut self) -> io::Result<()> {
        let goes_on = !self.here.is_empty() && self.position == self.here.end;
        let is_expected = self.expected.contains(&self.position);
        self.amount = match (is_expected, goes_on) {
            (true, _) if self.and_more => MOST_BYTES,
            (true, _) => LITTLE_BYTES / GROWTH,
            (false, true) => (self.amount * GROWTH).min(MOST_BYTES), // integers
            (false, false) => LITTLE_BYTES,
        };
        let part = self.object.part(self.position, self.end_of(self.position))?;
        let end = part.range.end;
        let is_stream =
            self.expected.contains(&end) || (!is_expected && goes_on && self.amount == MOST_BYTES);
        self.next =
            (is_stream && end < self.size()).then(|| self.object.part(end, self.end_of(end))).transpose()?;
        self.bytes = part.wait()?;
        self.here = part.range.clone();
        Ok(())
    }
}

impl BufRead for ObjectReader {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.position < self.size() && !self.here.contains(&self.position) {
            self.load()?;
        }
        let at = usize::try_from(self.position.saturating_sub(self.here.start)).unwrap_or(usize::MAX);
        Ok(self.bytes.get(at..).unwrap_or_default())
    }

    fn consume(&mut self, amount: usize) {
        self.position = self.position.saturating_add(amount as u64);
    }
}

impl Read for ObjectReader {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.fill_buf()?.read(buffer)?;
        self.consume(count);
        Ok(count)
    }
}

impl Seek for ObjectReader {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let (base, offset) = match to {
            SeekFrom::Start(offset) => (offset, 0),
            SeekFrom::End(offset) => (self.size(), offset),
            SeekFrom::Current(offset) => (self.position, offset),
        };
        self.position = base.checked_add_signed(offset).ok_or(io::ErrorKind::InvalidInput)?;
        Ok(self.position)
    }
}
