//! Answers to one question on their way from Zenoh's thread to ours: no more of them than a near side may send ahead.

use super::{ANSWER_PATIENCE, KEY, LOOK_PERIOD, WireError, zenoh_error};
use crate::log::{WINDOW_BYTES, WINDOW_MESSAGES};
use crate::message::{Request, garbage, to_json};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use zenoh::qos::CongestionControl;
use zenoh::query::{ConsolidationMode, QueryTarget, Reply};
use zenoh::{Session, Wait as _};

/// Answers that may wait: those with a message, the last one, and Zenoh's own word about the time.
const MOST_ANSWERS: usize = WINDOW_MESSAGES + 2;
/// Longest refusal (bytes): a sentence.
const MOST_REFUSAL_BYTES: usize = 4096;

/// Answers to one question.
pub(super) struct Answers {
    replies: Receiver<Reply>,
    room: Arc<Room>,
}

#[derive(Default)]
struct Room {
    /// Bytes that wait.
    bytes: AtomicUsize,
    /// More came than there is room for.
    is_full: AtomicBool,
}

impl Answers {
    /// Asks everybody who offers a run.
    pub(super) fn ask(session: &Session, request: &Request) -> Result<Self, WireError> {
        let (sender, replies) = sync_channel(MOST_ANSWERS);
        let room = Arc::new(Room::default());
        let its = Arc::clone(&room);
        let asked = session
            .get(format!("{KEY}/*"))
            .payload(to_json(request))
            .target(QueryTarget::All)
            .consolidation(ConsolidationMode::None)
            .congestion_control(CongestionControl::Block)
            .timeout(ANSWER_PATIENCE)
            .callback(move |reply| its.take(&sender, reply));
        asked.wait().map_err(zenoh_error)?;
        Ok(Self { replies, room })
    }

    /// The next answer; none after the last one, or when `stop` is set.
    pub(super) fn next(&self, stop: &AtomicBool) -> Result<Option<Reply>, WireError> {
        while !stop.load(Ordering::Relaxed) {
            let found = self.replies.recv_timeout(LOOK_PERIOD);
            if self.room.is_full.load(Ordering::Relaxed) {
                return Err(garbage(format_args!(
                    "more than {WINDOW_MESSAGES} messages or {WINDOW_BYTES} bytes at once, expected no more before those are done with"
                ))
                .into());
            }
            match found {
                Ok(reply) => {
                    self.room.bytes.fetch_sub(bytes_of(&reply), Ordering::Relaxed);
                    return Ok(Some(reply));
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Ok(None),
            }
        }
        Ok(None)
    }
}

impl Room {
    /// In Zenoh's thread, which must not wait.
    fn take(&self, sender: &SyncSender<Reply>, reply: Reply) {
        if self.is_full.load(Ordering::Relaxed) {
            return;
        }
        let bytes = bytes_of(&reply);
        let before = self.bytes.fetch_add(bytes, Ordering::Relaxed);
        // one that is longer than all that may be under way goes alone
        let is_too_much = match reply.result() {
            Ok(_) => bytes > 0 && before > 0 && before + bytes > WINDOW_BYTES,
            Err(_) => bytes > MOST_REFUSAL_BYTES,
        };
        if is_too_much || sender.try_send(reply).is_err() {
            // also where nobody listens any more
            self.is_full.store(true, Ordering::Relaxed);
        }
    }
}

fn bytes_of(reply: &Reply) -> usize {
    match reply.result() {
        Ok(sample) => sample.payload().len(),
        Err(refused) => refused.payload().len(),
    }
}
