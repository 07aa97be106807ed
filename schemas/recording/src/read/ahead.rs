//! The next chunk, decompressed on another thread while the current one is read.
//!
//! The result is a hint: the reader takes it only for a chunk that it has read itself and found to be the same.
//! Problems are not reported here, because the reader meets them, too.

use crate::read::chunk_head::{ChunkHead, decompress};
use crate::read::records::{RECORD_HEAD_BYTES, RawRecord, RecordReader};
use mcap::records::op;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;

/// Smallest chunk for the thread: handing over a smaller one takes longer than decompressing it.
const SMALLEST_CHUNK_BYTES: u64 = 1 << 16;

/// Largest chunk for the thread. The reader decompresses larger ones itself, so that memory holds only one.
const LARGEST_CHUNK_BYTES: u64 = 64 << 20;

/// Most records between two chunks that are skipped: the first chunk's index for each channel. If there are more, the
/// reader decompresses the chunk itself.
const MOST_BETWEEN: usize = 256;

/// A thread that decompresses the next chunk. The second chunk read in sequence starts it; dropping this ends it.
#[derive(Default)]
pub(crate) struct Ahead {
    thread: Thread,
    /// Chunks read since the last jump.
    in_sequence: usize,
    is_asked: bool,
    /// Size of the largest chunk for the thread; the reader decompresses larger ones.
    most_bytes: u64,
    /// Buffer that the thread gets with the next request.
    spare: Vec<u8>,
    /// Chunks that came from the thread.
    #[cfg(test)]
    pub(crate) taken_count: u64,
}

#[derive(Default)]
enum Thread {
    #[default]
    NotStarted,
    Runs {
        requests: Sender<Request>,
        answers: Receiver<Option<Ready>>,
    },
    /// There is no second core, or the thread could not be started, or it panicked.
    None,
}

struct Request {
    /// Offset of the record after a chunk.
    from: u64,
    buffer: Vec<u8>,
}

/// A chunk as it was found in the file.
struct Ready {
    /// Offset of the chunk record.
    offset: u64,
    head: ChunkHead,
    /// CRC of the bytes after the header in the file.
    crc_of_contents: u32,
    crc_of_records: u32,
    /// The records.
    buffer: Vec<u8>,
}

impl Ahead {
    /// Makes one that decompresses chunks of up to `most_bytes`.
    pub(crate) fn within(most_bytes: u64) -> Self {
        Self { most_bytes: most_bytes.min(LARGEST_CHUNK_BYTES), ..Self::default() } // integers
    }

    /// Makes one that never starts a thread.
    #[cfg(test)]
    pub(crate) fn off() -> Self {
        Self { thread: Thread::None, ..Self::default() }
    }

    /// Tells that reading jumps: the next chunk does not follow the last one.
    pub(crate) fn jump(&mut self) {
        self.in_sequence = 0;
    }

    /// Puts the records of the chunk at `offset`, which `records` has just read and whose header is `head`, into
    /// `buffer` and returns their CRC, if the thread has them.
    pub(crate) fn take(
        &mut self,
        offset: u64,
        head: &ChunkHead,
        records: &RecordReader,
        buffer: &mut Vec<u8>,
    ) -> Option<u32> {
        let Thread::Runs { answers, .. } = &self.thread else { return None };
        if !std::mem::take(&mut self.is_asked) {
            return None;
        }
        let Ok(answer) = answers.recv() else {
            self.thread = Thread::None;
            return None;
        };
        let mut ready = answer?;
        let is_same =
            (ready.offset, ready.head, ready.crc_of_contents) == (offset, *head, records.chunk_crc());
        if is_same {
            #[cfg(test)]
            {
                self.taken_count += 1;
            }
            std::mem::swap(&mut ready.buffer, buffer);
        }
        self.spare = ready.buffer;
        is_same.then_some(ready.crc_of_records)
    }

    /// Has the thread decompress the chunk after the one of `chunk_bytes` that `records` has just read at `offset`.
    pub(crate) fn request_next(&mut self, offset: u64, chunk_bytes: u64, records: &RecordReader) {
        self.in_sequence += 1;
        let from = offset + RECORD_HEAD_BYTES + records.body().len() as u64;
        let is_worth_it = self.in_sequence > 1 && chunk_bytes >= SMALLEST_CHUNK_BYTES;
        if !is_worth_it || self.is_asked || !records.expects(from) {
            return;
        }
        if let Thread::NotStarted = self.thread {
            self.thread = start(records, self.most_bytes).unwrap_or(Thread::None);
        }
        if let Thread::Runs { requests, .. } = &self.thread {
            self.is_asked = requests.send(Request { from, buffer: std::mem::take(&mut self.spare) }).is_ok();
        }
    }
}

fn start(records: &RecordReader, most_bytes: u64) -> Option<Thread> {
    thread::available_parallelism().ok().filter(|cores| cores.get() > 1)?;
    let mut worker = Worker {
        records: RecordReader::open(records.path()).ok()?,
        most_bytes,
        zstd: zstd::bulk::Decompressor::new().ok()?,
    };
    let (requests, asked) = channel::<Request>();
    let (answer, answers) = channel();
    let work = move || {
        for Request { from, buffer } in asked {
            if answer.send(worker.next_chunk(from, buffer)).is_err() {
                return;
            }
        }
    };
    thread::Builder::new().name("beadline-read".into()).spawn(work).ok()?;
    Some(Thread::Runs { requests, answers })
}

struct Worker {
    /// A reader with a position of its own.
    records: RecordReader,
    most_bytes: u64,
    zstd: zstd::bulk::Decompressor<'static>,
}

impl Worker {
    /// The first chunk at `from` or after message indexes there; none if anything is wrong.
    fn next_chunk(&mut self, from: u64, mut buffer: Vec<u8>) -> Option<Ready> {
        let offset = self.find_chunk(from)?;
        let body = self.records.body();
        let head = ChunkHead::parse(body).filter(|head| head.is_compressed)?;
        let data = body.get(head.bytes..)?.get(..usize::try_from(head.compressed_bytes).ok()?)?;
        decompress(&mut self.zstd, data, head.uncompressed_bytes, self.most_bytes, &mut buffer).ok()?;
        let (crc_of_contents, crc_of_records) = (self.records.chunk_crc(), crc32fast::hash(&buffer));
        Some(Ready { offset, head, crc_of_contents, crc_of_records, buffer })
    }

    /// Reads on up to the chunk record, and returns where it is.
    fn find_chunk(&mut self, from: u64) -> Option<u64> {
        self.records.seek(from).ok()?;
        for _ in 0..MOST_BETWEEN {
            match self.records.next().ok()?? {
                RawRecord { opcode: op::CHUNK, offset, .. } => return Some(offset),
                RawRecord { opcode: op::MESSAGE_INDEX, .. } => {}
                _ => return None,
            }
        }
        None
    }
}
