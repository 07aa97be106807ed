//! The records of an MCAP file in order, with their places.

use crate::error::ReadError;
use mcap::records::op;
use std::fs;
use std::io::{self, BufRead, Read, Seek, SeekFrom};
use std::ops::Range;
use std::path::{Path, PathBuf};
use storage::{Reader, is_url};

/// Largest record that is read.
pub const MAX_RECORD_BYTES: u64 = 1 << 30;

const MAGIC_BYTES: u64 = mcap::MAGIC.len() as u64;

/// Opcode and length of a record.
pub(crate) const RECORD_HEAD_BYTES: u64 = 9;

/// Reads records from a file, each into the same buffer. Checks the CRCs of the data section and of the
/// summary section.
#[derive(Debug)]
pub(crate) struct RecordReader {
    path: PathBuf,
    file: Reader,
    size: u64,
    /// Offset at which reading stops: the end of the file, or of its footer.
    end: u64,
    position: u64,
    /// True if the file ends as a closed MCAP file does.
    closed: bool,
    /// CRC of the section so far.
    crc: crc32fast::Hasher,
    section: Section,
    /// CRC of the bytes after the header of the chunk read last.
    chunk_crc: u32,
    body: Vec<u8>,
}

/// Section that a CRC covers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Section {
    Data,
    Summary,
    /// A section that is not read from its start, so that its CRC cannot be checked.
    Part,
}

/// A record.
#[derive(Debug, Clone, Copy)]
pub(crate) struct RawRecord<'a> {
    pub(crate) opcode: u8,
    /// Offset of its opcode in the file.
    pub(crate) offset: u64,
    pub(crate) body: &'a [u8],
}

impl RecordReader {
    /// Makes a reader at the first record of the file `path`.
    pub(crate) fn open(path: &Path) -> Result<Self, ReadError> {
        let mut records = Self::at_end(path)?;
        records.begin()?;
        Ok(records)
    }

    /// Makes a reader of the file `path` that has read only the end: an object behind a URL comes with its end.
    pub(crate) fn at_end(path: &Path) -> Result<Self, ReadError> {
        let io = ReadError::io(path);
        let not_mcap = || ReadError::NotMcap { path: path.to_owned() };
        // anything else that is no file is refused, and named, where it is opened
        if !is_url(path) && fs::metadata(path).map_err(&io)?.is_dir() {
            return Err(not_mcap());
        }
        let mut file = Reader::open(path).map_err(&io)?;
        let end = file.size();
        let last_magic = end.checked_sub(MAGIC_BYTES).ok_or_else(not_mcap)?;
        let last = read_magic(&mut file, last_magic).map_err(&io)?;
        Ok(Self {
            path: path.to_owned(),
            file,
            size: end,
            end,
            position: end,
            closed: last_magic > 0 && last == mcap::MAGIC,
            crc: crc32fast::Hasher::new(),
            section: Section::Part,
            chunk_crc: 0,
            body: Vec::new(),
        })
    }

    /// Goes to the first record.
    pub(crate) fn begin(&mut self) -> Result<(), ReadError> {
        let first = read_magic(&mut self.file, 0).map_err(ReadError::io(&self.path))?;
        if first != mcap::MAGIC {
            return Err(ReadError::NotMcap { path: self.path.clone() });
        }
        self.crc = crc32fast::Hasher::new();
        self.crc.update(&first);
        (self.position, self.end, self.section) = (MAGIC_BYTES, self.size, Section::Data);
        Ok(())
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The record read last.
    pub(crate) fn body(&self) -> &[u8] {
        &self.body
    }

    /// Exchanges the record read last for the buffer `other`.
    pub(crate) fn swap_body(&mut self, other: &mut Vec<u8>) {
        std::mem::swap(&mut self.body, other);
    }

    /// If the record read last is a chunk, the CRC of its contents as they are in the file.
    pub(crate) fn chunk_crc(&self) -> u32 {
        self.chunk_crc
    }

    /// True if the file ends as a closed MCAP file does.
    pub(crate) fn is_closed(&self) -> bool {
        self.closed
    }

    /// Size of the file in bytes.
    pub(crate) fn file_bytes(&self) -> u64 {
        self.size
    }

    /// True if each stretch of the file costs a request.
    pub(crate) fn is_remote(&self) -> bool {
        self.file.is_remote()
    }

    /// Announces the bytes that will be read, and whether more may follow after them.
    pub(crate) fn expect(&mut self, bytes: Range<u64>, and_more: bool) {
        self.file.expect(bytes, and_more);
    }

    /// True if reading at `offset` was expected.
    pub(crate) fn expects(&self, offset: u64) -> bool {
        self.file.expects(offset)
    }

    /// Opcode of the next record, if there is one.
    pub(crate) fn peek(&mut self) -> Option<u8> {
        self.file.fill_buf().ok()?.first().copied()
    }

    /// Offset of the next record.
    pub(crate) fn position(&self) -> u64 {
        self.position
    }

    /// Goes on reading at `offset`, somewhere within a section. The CRC of the rest of that section is not checked;
    /// those of each chunk and of the next section are.
    pub(crate) fn seek(&mut self, offset: u64) -> Result<(), ReadError> {
        self.section = Section::Part;
        self.position = offset;
        self.end = self.size;
        self.file.seek(SeekFrom::Start(offset)).map_err(ReadError::io(&self.path))?;
        Ok(())
    }

    /// Goes on reading at `offset`, where the summary section starts.
    pub(crate) fn seek_summary(&mut self, offset: u64) -> Result<(), ReadError> {
        self.seek(offset)?;
        self.section = Section::Summary;
        self.crc = crc32fast::Hasher::new();
        Ok(())
    }

    /// The next record; none after the footer, or where an unfinished file is torn.
    pub(crate) fn next(&mut self) -> Result<Option<RawRecord<'_>>, ReadError> {
        let offset = self.position;
        let left = self.end.saturating_sub(offset);
        if left < RECORD_HEAD_BYTES {
            return self.torn(offset, left);
        }
        let mut head = [0; 9];
        self.file.read_exact(&mut head).map_err(ReadError::io(&self.path))?;
        let [opcode, length @ ..] = head;
        let length = u64::from_le_bytes(length);
        if length > left - RECORD_HEAD_BYTES || (opcode == 0 && !self.closed) {
            return self.torn(offset, left);
        }
        self.read_body(offset, length)?;
        self.position = offset + RECORD_HEAD_BYTES + length;
        self.check_section(opcode, &head)?;
        if opcode == op::FOOTER {
            self.finish(offset)?;
        }
        Ok(Some(RawRecord { opcode, offset, body: &self.body }))
    }

    /// Reads `bytes` bytes from `offset` on in place of a record, or as many as there are. The caller then sets with
    /// [`seek`](Self::seek) where reading goes on.
    pub(crate) fn read_part(&mut self, offset: u64, bytes: u64) -> Result<&[u8], ReadError> {
        self.seek(offset)?;
        let room = bytes.min(self.size.saturating_sub(offset)).min(MAX_RECORD_BYTES);
        self.read_body(offset, room)?;
        Ok(&self.body)
    }

    /// Reads the `bytes` bytes from `offset` on as the contents of a chunk record.
    pub(crate) fn read_chunk(&mut self, offset: u64, bytes: u64) -> Result<(), ReadError> {
        self.read_part(offset, bytes)?;
        self.chunk_crc = crc_of_contents(&self.body);
        Ok(())
    }

    fn torn<T>(&self, offset: u64, left: u64) -> Result<Option<T>, ReadError> {
        if self.closed && left > 0 {
            let what = format!("a record beyond the end of the file, {left} bytes on");
            return Err(ReadError::damaged(&self.path, offset, what));
        }
        Ok(None)
    }

    fn read_body(&mut self, offset: u64, length: u64) -> Result<(), ReadError> {
        let too_long = || {
            let what = format!("a record of {length} bytes, more than {MAX_RECORD_BYTES}");
            ReadError::damaged(&self.path, offset, what)
        };
        let room =
            usize::try_from(length).ok().filter(|_| length <= MAX_RECORD_BYTES).ok_or_else(too_long)?;
        let io = ReadError::io(&self.path);
        self.body.clear();
        self.body.try_reserve(room).map_err(|error| io(error.into()))?;
        let read = self.file.read_to(length, &mut self.body).map_err(&io)?;
        if read < room { Err(io(io::ErrorKind::UnexpectedEof.into())) } else { Ok(()) }
    }

    /// Takes a record into the CRC of its section, or compares at the section's end.
    fn check_section(&mut self, opcode: u8, head: &[u8]) -> Result<(), ReadError> {
        match (opcode, self.section) {
            (op::CHUNK, Section::Part) => {
                self.chunk_crc = crc_of_contents(&self.body);
                Ok(())
            }
            (op::DATA_END, Section::Part) => {
                (self.section, self.crc) = (Section::Summary, crc32fast::Hasher::new());
                Ok(())
            }
            (_, Section::Part) => Ok(()),
            (op::DATA_END, Section::Data) => {
                let stored = self.body.first_chunk::<4>().map_or(0, |crc| u32::from_le_bytes(*crc));
                self.section = Section::Summary;
                let computed = std::mem::take(&mut self.crc).finalize();
                check_crc(&self.path, "the data section", stored, computed)
            }
            (op::FOOTER, Section::Summary) => {
                let Some((before, stored)) = self.body.split_last_chunk::<4>() else {
                    return Ok(());
                };
                self.crc.update(head);
                self.crc.update(before);
                let computed = std::mem::take(&mut self.crc).finalize();
                check_crc(&self.path, "the summary section", u32::from_le_bytes(*stored), computed)
            }
            (op::CHUNK, _) => {
                // in two parts: the second is the CRC of an uncompressed chunk, which costs no second pass
                let (header, contents) = self.body.split_at(chunk_header_bytes(&self.body));
                self.crc.update(head);
                self.crc.update(header);
                let mut chunk_crc = crc32fast::Hasher::new();
                chunk_crc.update(contents);
                self.crc.combine(&chunk_crc);
                self.chunk_crc = chunk_crc.finalize();
                Ok(())
            }
            _ => {
                self.crc.update(head);
                self.crc.update(&self.body);
                Ok(())
            }
        }
    }

    /// Checks that the footer at `offset` is the last record, and that only the magic follows.
    fn finish(&mut self, offset: u64) -> Result<(), ReadError> {
        self.end = self.position;
        let after = self.size - self.position;
        if self.closed && after != mcap::MAGIC.len() as u64 {
            let what = format!("a footer that {after} bytes follow");
            return Err(ReadError::damaged(&self.path, offset, what));
        }
        Ok(())
    }
}

/// Length of the header of the chunk record `body`: two times, size, CRC, compression, compressed size.
pub(crate) fn chunk_header_bytes(body: &[u8]) -> usize {
    const COMPRESSION: usize = 8 + 8 + 8 + 4;
    let name = body.get(COMPRESSION..).and_then(|rest| rest.first_chunk::<4>());
    let name_bytes = name.and_then(|length| usize::try_from(u32::from_le_bytes(*length)).ok());
    (COMPRESSION + 4 + 8).saturating_add(name_bytes.unwrap_or(0)).min(body.len())
}

/// CRC of the bytes after the header of the chunk record `body`.
fn crc_of_contents(body: &[u8]) -> u32 {
    crc32fast::hash(body.get(chunk_header_bytes(body)..).unwrap_or_default())
}

/// Compares a CRC with the one in the file, where 0 stands for none.
pub(crate) fn check_crc(path: &Path, part: &str, found: u32, computed: u32) -> Result<(), ReadError> {
    if found == 0 || found == computed {
        return Ok(());
    }
    Err(ReadError::Crc { path: path.to_owned(), part: part.to_owned(), found, computed })
}

fn read_magic(file: &mut Reader, offset: u64) -> io::Result<[u8; 8]> {
    let mut magic = [0; 8];
    file.seek(SeekFrom::Start(offset))?;
    file.read_exact(&mut magic)?;
    Ok(magic)
}
