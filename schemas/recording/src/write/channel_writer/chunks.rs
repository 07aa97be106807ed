//! The chunks on their way from the run to the disk: the next action, and its time.

use super::WriteOptions;
use super::block::Block;
use std::collections::VecDeque;
use std::time::Instant;

/// The chunks that are not on the disk yet. It has no clock: callers pass the time.
#[derive(Debug)]
pub(super) struct Chunks {
    options: WriteOptions,
    open: Block,
    closed: VecDeque<Block>,
    /// Chunks handed out but not written yet: their number, and their bytes.
    in_work: (usize, u64),
    /// Empty chunks, to be used again.
    spare: Vec<Block>,
    /// Number of the next chunk to be taken.
    next_number: u64,
    /// Time when the first bytes were recorded for which no sync was asked yet.
    unsynced: Option<Instant>,
    accepted_frames: u64,
    written_frames: u64,
}

/// The next action.
#[derive(Debug)]
pub(super) enum Due {
    /// Write this chunk, which has this number in the file.
    Write(u64, Block),
    /// Sync what was written.
    Sync,
    /// Do nothing before this time; without one, nothing until something is recorded.
    Nothing(Option<Instant>),
}

impl Chunks {
    pub(super) fn new(options: WriteOptions) -> Self {
        Self {
            options,
            open: Block::default(),
            closed: VecDeque::new(),
            in_work: (0, 0),
            spare: Vec::new(),
            next_number: 0,
            unsynced: None,
            accepted_frames: 0,
            written_frames: 0,
        }
    }

    pub(super) fn options(&self) -> &WriteOptions {
        &self.options
    }

    /// The chunk that records go to; a full one is closed before.
    pub(super) fn open(&mut self) -> &mut Block {
        if self.open.bytes() > self.options.chunk_bytes {
            self.close();
        }
        &mut self.open
    }

    /// Counts the messages since the last call as those of a frame.
    pub(super) fn end_frame(&mut self) {
        self.open.end_frame();
        self.accepted_frames += 1;
    }

    /// True if something is in the open chunk.
    pub(super) fn is_open(&self) -> bool {
        self.open.bytes() > 0
    }

    /// Closes the open chunk, unless it is empty.
    pub(super) fn close(&mut self) {
        if self.is_open() {
            let next = self.spare.pop().unwrap_or_default();
            self.closed.push_back(std::mem::replace(&mut self.open, next));
        }
    }

    /// Chunks that are closed, but not written.
    pub(super) fn waiting_count(&self) -> usize {
        self.closed.len() + self.in_work.0
    }

    /// Bytes of these chunks.
    fn waiting_bytes(&self) -> u64 {
        self.in_work.1 + self.closed.iter().map(Block::bytes).sum::<u64>()
    }

    /// True if more bytes wait than may wait.
    pub(super) fn is_full(&self) -> bool {
        self.waiting_count() > 1 && self.waiting_bytes() > self.options.queue_bytes
    }

    /// Bytes recorded and not yet in the file, before compression.
    pub(super) fn pending_bytes(&self) -> u64 {
        self.open.bytes() + self.waiting_bytes()
    }

    /// The action that is due at the time `now`. The receiver of a chunk calls [`written`](Self::written) later.
    pub(super) fn next(&mut self, now: Instant) -> Due {
        let WriteOptions { flush_period, sync_period, .. } = self.options;
        let flush_at =
            self.open.opened().and_then(|opened| opened.checked_add(flush_period.min(sync_period)));
        if flush_at.is_some_and(|at| at <= now) {
            self.close();
        }
        if let Some(block) = self.closed.pop_front() {
            self.in_work = (self.in_work.0 + 1, self.in_work.1 + block.bytes());
            self.next_number += 1;
            return Due::Write(self.next_number - 1, block);
        }
        let sync_at = self.unsynced.and_then(|since| since.checked_add(sync_period));
        if sync_at.is_some_and(|at| at <= now) {
            self.unsynced = None;
            return Due::Sync;
        }
        Due::Nothing([flush_at, sync_at].into_iter().flatten().min())
    }

    /// Takes `block` back, which is in the file.
    pub(super) fn written(&mut self, mut block: Block) {
        self.in_work = (self.in_work.0 - 1, self.in_work.1 - block.bytes());
        self.written_frames += block.frames();
        self.unsynced = match (self.unsynced, block.opened()) {
            (Some(since), Some(opened)) => Some(since.min(opened)),
            (since, opened) => since.or(opened),
        };
        block.clear();
        self.spare.push(block);
    }

    /// Drops the waiting chunks, which will never be written.
    pub(super) fn give_up(&mut self) {
        self.open.clear();
        self.closed.clear();
    }

    /// Frames that were accepted, but are not in the file.
    pub(super) fn unwritten_frames(&self) -> u64 {
        self.accepted_frames - self.written_frames
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mcap::records::MessageHeader;
    use std::time::Duration;

    const MS: Duration = Duration::from_millis(1);

    fn chunks() -> Chunks {
        Chunks::new(WriteOptions {
            chunk_bytes: 1000,
            queue_bytes: 3000,
            flush_period: 100 * MS,
            sync_period: 250 * MS,
            ..WriteOptions::default()
        })
    }

    fn frame(chunks: &mut Chunks, bytes: usize, now: Instant) {
        let head = MessageHeader { channel_id: 1, sequence: 0, log_time: 0, publish_time: 0 };
        chunks.open().message(&head, &vec![0; bytes], now);
        chunks.end_frame();
    }

    /// The next chunk, written at once: its number and its frames.
    fn write(chunks: &mut Chunks, now: Instant) -> Option<(u64, u64)> {
        let Due::Write(number, block) = chunks.next(now) else { return None };
        let frames = block.frames();
        chunks.written(block);
        Some((number, frames))
    }

    /// A frame is on its way to the disk when the flush period is over, whether or not another one comes.
    #[test]
    fn no_frame_waits_longer_than_the_flush_period() {
        let (mut chunks, start) = (chunks(), Instant::now());
        assert!(matches!(chunks.next(start), Due::Nothing(None)));
        frame(&mut chunks, 10, start);
        frame(&mut chunks, 10, start + 60 * MS);
        let Due::Nothing(Some(at)) = chunks.next(start + 99 * MS) else { panic!("too early") };
        assert_eq!(at, start + 100 * MS);
        assert_eq!(chunks.unwritten_frames(), 2);
        assert_eq!(write(&mut chunks, start + 100 * MS), Some((0, 2)));
        assert_eq!(chunks.unwritten_frames(), 0);
        // the period begins with the first frame of a chunk
        frame(&mut chunks, 10, start + 150 * MS);
        assert_eq!(write(&mut chunks, start + 249 * MS), None);
        assert_eq!(write(&mut chunks, start + 250 * MS), Some((1, 1)));
    }

    #[test]
    fn no_frame_stays_unsynced_longer_than_the_sync_period() {
        let (mut chunks, start) = (chunks(), Instant::now());
        frame(&mut chunks, 10, start);
        assert!(write(&mut chunks, start + 100 * MS).is_some());
        let Due::Nothing(Some(at)) = chunks.next(start + 249 * MS) else { panic!("too early") };
        assert_eq!(at, start + 250 * MS);
        assert!(matches!(chunks.next(start + 250 * MS), Due::Sync));
        assert!(matches!(chunks.next(start + 250 * MS), Due::Nothing(None)));
        // one that is shorter than the flush period closes chunks, too
        chunks.options.sync_period = 10 * MS;
        frame(&mut chunks, 10, start + 300 * MS);
        assert!(write(&mut chunks, start + 310 * MS).is_some());
        assert!(matches!(chunks.next(start + 310 * MS), Due::Sync));
    }

    #[test]
    fn a_full_chunk_is_closed_and_a_full_queue_says_so() {
        let (mut chunks, start) = (chunks(), Instant::now());
        for _ in 0..7 {
            frame(&mut chunks, 1000, start);
        }
        assert_eq!(chunks.waiting_count(), 6);
        assert!(chunks.is_full());
        for number in 0..4 {
            assert_eq!(write(&mut chunks, start), Some((number, 1)));
        }
        assert!(!chunks.is_full(), "two of 1 kB");
        // a frame larger than the queue may wait, a second one may not
        frame(&mut chunks, 5000, start);
        chunks.close();
        while chunks.waiting_count() > 1 {
            assert!(write(&mut chunks, start).is_some());
        }
        assert!(!chunks.is_full());
        frame(&mut chunks, 5000, start);
        chunks.close();
        assert!(chunks.is_full());
    }

    /// A chunk that is handed out counts until it is written.
    #[test]
    fn chunks_in_work_take_room() {
        let (mut chunks, start) = (chunks(), Instant::now());
        frame(&mut chunks, 5000, start);
        frame(&mut chunks, 5000, start);
        chunks.close();
        let Due::Write(_, block) = chunks.next(start) else { panic!("nothing to write") };
        assert!(chunks.is_full());
        assert_eq!(chunks.unwritten_frames(), 2);
        chunks.written(block);
        assert!(!chunks.is_full());
    }
}
