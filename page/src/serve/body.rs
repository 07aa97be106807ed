//! Contents of an answer.

use super::blocking;
use hyper::body::{Body as HttpBody, Bytes, Frame, SizeHint};
use std::future::Future;
use std::io::{self, Read as _, Seek as _, SeekFrom};
use std::ops::Range;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};
use std::task::{Context, Poll};
use storage::Reader;

/// Size of a piece (bytes): all of a file that is in memory.
const PIECE_BYTES: u64 = 1 << 18;

/// Bytes that are there, or pieces of a file that are read as the client takes them.
pub(super) enum Body {
    Whole(Bytes),
    Pieces(Pieces),
}

impl Body {
    pub(super) fn empty() -> Self {
        Self::Whole(Bytes::new())
    }
}

impl HttpBody for Body {
    type Data = Bytes;
    type Error = io::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, io::Error>>> {
        match &mut *self {
            Self::Whole(bytes) if bytes.is_empty() => Poll::Ready(None),
            Self::Whole(bytes) => Poll::Ready(Some(Ok(Frame::data(std::mem::take(bytes))))),
            Self::Pieces(pieces) => pieces.poll_next(context),
        }
    }

    fn is_end_stream(&self) -> bool {
        self.size_hint().exact() == Some(0)
    }

    fn size_hint(&self) -> SizeHint {
        SizeHint::with_exact(match self {
            Self::Whole(bytes) => bytes.len() as u64,
            Self::Pieces(pieces) => pieces.left(),
        })
    }
}

type Reading = Pin<Box<dyn Future<Output = Option<io::Result<Bytes>>> + Send>>;

/// The rest of a range, read piece by piece as the client takes it.
pub(super) struct Pieces {
    file: Arc<Mutex<Reader>>,
    left: Range<u64>,
    reading: Option<Reading>,
}

impl Pieces {
    /// The bytes `range` of a file.
    pub(super) fn new(file: Reader, range: Range<u64>) -> Self {
        Self { file: Arc::new(Mutex::new(file)), left: range, reading: None }
    }

    /// Bytes that are still to come.
    fn left(&self) -> u64 {
        self.left.end - self.left.start
    }

    /// The next piece.
    fn poll_next(&mut self, context: &mut Context<'_>) -> Poll<Option<Result<Frame<Bytes>, io::Error>>> {
        if self.left.is_empty() {
            return Poll::Ready(None);
        }
        let (file, from) = (Arc::clone(&self.file), self.left.start);
        let count = PIECE_BYTES.min(self.left.end - from);
        let reading =
            self.reading.get_or_insert_with(|| Box::pin(blocking(move || read(&file, from, count))));
        match reading.as_mut().poll(context) {
            Poll::Pending => Poll::Pending,
            Poll::Ready(read) => {
                self.reading = None;
                self.left.start += count;
                // none: the runtime ends
                Poll::Ready(read.map(|read| read.map(Frame::data)))
            }
        }
    }
}

fn read(file: &Mutex<Reader>, from: u64, count: u64) -> io::Result<Bytes> {
    let mut bytes = vec![0; usize::try_from(count).map_err(io::Error::other)?];
    let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
    file.seek(SeekFrom::Start(from))?;
    file.read_exact(&mut bytes)?;
    Ok(bytes.into())
}
