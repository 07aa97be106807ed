//! Rows in the order of their numbers, however many there are: sorted in parts that fit into memory, which lie in a temporary
//! file until they are merged.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::fs::File;
use std::io::{self, BufReader, BufWriter, Read, Seek as _, Write};
use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;
use std::vec;

/// Bytes of rows that are sorted in memory.
const PART_BYTES: usize = 1 << 25;

/// Bytes of each part that are read ahead.
const READ_BYTES: usize = 1 << 15;

/// A row by its number.
pub(super) type Row = (u64, Box<[u8]>);

/// Takes rows in any order.
pub(super) struct Sorter {
    /// Directory with room for all rows.
    directory: PathBuf,
    rows: Vec<Row>,
    bytes: usize,
    /// Sorted parts, and where each lies in the file.
    file: Option<File>,
    parts: Vec<Range<u64>>,
}

impl Sorter {
    pub(super) fn new(directory: PathBuf) -> Self {
        Self { directory, rows: Vec::new(), bytes: 0, file: None, parts: Vec::new() }
    }

    pub(super) fn push(&mut self, number: u64, row: &[u8]) -> io::Result<()> {
        self.bytes += size_of::<Row>() + row.len();
        self.rows.push((number, row.into()));
        if self.bytes > PART_BYTES { self.put_away() } else { Ok(()) }
    }

    /// Writes the rows in memory to the file.
    fn put_away(&mut self) -> io::Result<()> {
        // no other process sees it, and none finds it after a kill
        let file = match &mut self.file {
            Some(file) => file,
            file => file.insert(tempfile::tempfile_in(&self.directory)?),
        };
        self.rows.sort_by_key(|(number, _)| *number);
        let begin = file.stream_position()?;
        let mut out = BufWriter::new(&*file);
        for (number, row) in self.rows.drain(..) {
            out.write_all(&number.to_le_bytes())?;
            out.write_all(&(row.len() as u64).to_le_bytes())?;
            out.write_all(&row)?;
        }
        out.flush()?;
        drop(out);
        self.parts.push(begin..file.stream_position()?);
        self.bytes = 0;
        Ok(())
    }

    /// All rows; those of one number in the order in which they came.
    pub(super) fn finish(mut self) -> io::Result<Sorted> {
        self.rows.sort_by_key(|(number, _)| *number);
        let mut sources = Vec::with_capacity(self.parts.len() + 1);
        if let Some(file) = self.file.map(Arc::new) {
            let part = |Range { start, end }| Part { file: Arc::clone(&file), position: start, end };
            let parts = self.parts.into_iter().map(part);
            sources.extend(parts.map(|part| Source::File(BufReader::with_capacity(READ_BYTES, part))));
        }
        sources.push(Source::Memory(self.rows.into_iter()));
        let mut sorted = Sorted { sources, heads: BinaryHeap::new() };
        (0..sorted.sources.len()).try_for_each(|source| sorted.fetch(source))?;
        Ok(sorted)
    }
}

/// The number of a row, its source, the row.
type Head = (u64, usize, Box<[u8]>);

/// Rows in ascending order.
pub(super) struct Sorted {
    sources: Vec<Source>,
    /// The next row of each source, the least number first, and of equal ones that of the first source.
    heads: BinaryHeap<Reverse<Head>>,
}

enum Source {
    File(BufReader<Part>),
    Memory(vec::IntoIter<Row>),
}

impl Sorted {
    pub(super) fn next(&mut self) -> io::Result<Option<Row>> {
        let Some(Reverse((number, source, row))) = self.heads.pop() else { return Ok(None) };
        self.fetch(source)?;
        Ok(Some((number, row)))
    }

    fn fetch(&mut self, source: usize) -> io::Result<()> {
        let row = match &mut self.sources[source] {
            Source::Memory(rows) => rows.next(),
            Source::File(part) => read_row(part)?,
        };
        self.heads.extend(row.map(|(number, row)| Reverse((number, source, row))));
        Ok(())
    }
}

fn read_row(part: &mut BufReader<Part>) -> io::Result<Option<Row>> {
    if part.get_ref().position == part.get_ref().end && part.buffer().is_empty() {
        return Ok(None);
    }
    let mut head = [[0; 8]; 2];
    part.read_exact(head.as_flattened_mut())?;
    let [number, length] = head.map(u64::from_le_bytes);
    let mut row = vec![0; usize::try_from(length).map_err(io::Error::other)?];
    part.read_exact(&mut row)?;
    Ok(Some((number, row.into())))
}

/// A part of a file that others read, too.
struct Part {
    file: Arc<File>,
    position: u64,
    end: u64,
}

impl Read for Part {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let left = usize::try_from(self.end - self.position).unwrap_or(usize::MAX).min(buffer.len());
        let read = system::read_at(&self.file, &mut buffer[..left], self.position)?;
        self.position += read as u64;
        Ok(read)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two parts in the file and one in memory, in an order that has nothing to do with the numbers, and each number twice.
    #[test]
    fn rows_come_in_the_order_of_their_numbers() {
        let place = tempfile::tempdir().expect("tempdir");
        let mut sorter = Sorter::new(place.path().to_owned());
        let count = 70_000;
        for (i, copy) in [1, 2].into_iter().flat_map(|copy| (0..count / 2).map(move |i| (i, copy))) {
            let number = i * 7919 % (count / 2);
            sorter
                .push(number, &[vec![copy], vec![0; 1047], number.to_le_bytes().to_vec()].concat())
                .expect("disk");
        }
        assert_eq!(sorter.parts.len(), 2, "{} bytes are left", sorter.bytes);
        assert_eq!(std::fs::read_dir(place.path()).expect("listed").count(), 0, "a file without a name");
        let mut sorted = sorter.finish().expect("disk");
        for expected in 0..count {
            let (number, row) = sorted.next().expect("disk").expect("a row");
            assert_eq!((number, u64::from(row[0])), (expected / 2, 1 + expected % 2));
            assert_eq!(row[1048..], number.to_le_bytes());
        }
        assert!(sorted.next().expect("disk").is_none());
    }
}
