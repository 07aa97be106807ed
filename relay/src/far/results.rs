//! Results that come along are published when their frames have been.

use crate::message::{BEGINNINGS_PER_S, MOST_TOPICS, MessageError, RowsHead, garbage};
use bus::{Bus, ResultElement, ResultPublisher, ResultsError, StreamId};
use schemas::manifest::RunManifest;
use schemas::results::Topic;
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Most bytes of rows that wait for their frames.
const MOST_WAITING_BYTES: usize = 64 << 20;

/// All results of one run.
pub(super) struct Results {
    bus: Bus,
    manifest: RunManifest,
    stream: StreamId,
    first_frame: u64,
    stop: Arc<AtomicBool>,
    topics: Vec<(Topic, OfTopic)>,
    waiting_bytes: usize,
    /// Publishers that began since then.
    begun: u64,
    since: Instant,
    rows: u64,
    lost: u64,
    troubles: Vec<String>,
}

/// One kind of results.
struct OfTopic {
    head: RowsHead,
    publisher: Publisher,
    /// The frame and the values of each row.
    waiting: VecDeque<(u64, Vec<u8>)>,
    /// The next row is of this frame or a later one.
    next_frame: u64,
    /// There was a row of each frame so far; none before the first row.
    is_dense: Option<bool>,
    /// Rows may have gone while no near side was there.
    has_gap: bool,
}

enum Publisher {
    Numbers(ResultPublisher<f64>),
    Classes(ResultPublisher<u8>),
    /// Not until the next one begins.
    None,
}

impl Results {
    pub(super) fn new(
        bus: &Bus,
        manifest: &RunManifest,
        stream: StreamId,
        first_frame: u64,
        stop: Arc<AtomicBool>,
    ) -> Self {
        Self {
            bus: bus.clone(),
            manifest: manifest.clone(),
            stream,
            first_frame,
            stop,
            topics: Vec::new(),
            waiting_bytes: 0,
            begun: 0,
            since: Instant::now(),
            rows: 0,
            lost: 0,
            troubles: Vec::new(),
        }
    }

    /// Rows published, and rows lost here.
    pub(super) fn counts(&self) -> (u64, u64) {
        (self.rows, self.lost)
    }

    pub(super) fn take_troubles(&mut self) -> Vec<String> {
        std::mem::take(&mut self.troubles)
    }

    /// Takes rows that arrived.
    pub(super) fn take(&mut self, head: &RowsHead, rows: &[u8]) -> Result<(), MessageError> {
        let at = self.at(head.topic()?, head)?;
        let of_topic = &mut self.topics[at].1;
        for row in rows.chunks_exact(head.row_bytes()) {
            let Some((frame, values)) = row.split_first_chunk() else { continue };
            let frame = u64::from_le_bytes(*frame);
            if frame < of_topic.next_frame || matches!(of_topic.publisher, Publisher::None) {
                continue; // from before we joined, or published by somebody here
            }
            self.lost += of_topic.count(frame);
            if self.waiting_bytes + row.len() > MOST_WAITING_BYTES {
                self.lost += 1;
                continue;
            }
            self.waiting_bytes += row.len();
            of_topic.waiting.push_back((frame, values.to_vec()));
        }
        of_topic.head.ended = head.ended;
        Ok(())
    }

    /// Another near side goes on: rows that were published meanwhile do not come.
    pub(super) fn again(&mut self) {
        self.topics.iter_mut().for_each(|(_, of_topic)| of_topic.has_gap = true);
    }

    /// Index of the results of this topic, after giving them a publisher.
    fn at(&mut self, topic: Topic, head: &RowsHead) -> Result<usize, MessageError> {
        let found = self.topics.iter().position(|(known, _)| *known == topic);
        if let Some(at) = found
            && self.topics[at].1.head.columns() == head.columns()
            && self.topics[at].1.head.ended.is_none()
        {
            return Ok(at);
        }
        self.begun += 1;
        let most = MOST_TOPICS as u64 + BEGINNINGS_PER_S * self.since.elapsed().as_secs();
        if (found.is_none() && self.topics.len() >= MOST_TOPICS) || self.begun > most {
            let (kinds, begun) = (self.topics.len(), self.begun - 1);
            return Err(garbage(format_args!(
                "results of {topic} after {kinds} kinds, which began {begun} times; expected at most {MOST_TOPICS} kinds, and so \
                 many beginnings and {BEGINNINGS_PER_S} more a second"
            )));
        }
        let next_frame = found.map_or(self.first_frame, |at| self.topics.remove(at).1.next_frame);
        let publisher = self.publisher(topic, head).unwrap_or_else(|error| {
            self.troubles.push(error.to_string());
            Publisher::None
        });
        let of_topic = OfTopic {
            head: head.clone(),
            publisher,
            waiting: VecDeque::new(),
            next_frame,
            is_dense: None,
            has_gap: false,
        };
        self.topics.push((topic, of_topic));
        Ok(self.topics.len() - 1)
    }

    fn publisher(&self, topic: Topic, head: &RowsHead) -> Result<Publisher, ResultsError> {
        fn create<T: ResultElement>(
            it: &Results,
            topic: Topic,
            head: &RowsHead,
        ) -> Result<ResultPublisher<T>, ResultsError> {
            let name = &it.manifest.provenance.name;
            ResultPublisher::create(&it.bus, name, topic, it.stream, &head.columns(), Arc::clone(&it.stop))
        }
        Ok(if head.tolerance_m.is_some() {
            Publisher::Classes(create(self, topic, head)?)
        } else {
            Publisher::Numbers(create(self, topic, head)?)
        })
    }

    /// Publishes the rows of frames before `next_frame`.
    pub(super) fn publish_up_to(&mut self, next_frame: u64) {
        for (_, of_topic) in &mut self.topics {
            while let Some((frame, values)) = of_topic.waiting.pop_front_if(|(frame, _)| *frame < next_frame)
            {
                self.waiting_bytes -= 8 + values.len();
                let step = self.manifest.step_of_frame(frame);
                let time_s = self.manifest.physics.time_s(step);
                match of_topic.publisher.publish((frame, step, time_s), &values) {
                    Ok(()) => self.rows += 1,
                    Err(error) => {
                        self.lost += 1;
                        self.troubles.push(error.to_string());
                        of_topic.publisher = Publisher::None;
                    }
                }
            }
            if of_topic.waiting.is_empty() && of_topic.head.ended.is_some() {
                of_topic.end(&mut self.troubles);
            }
        }
    }

    /// The run is over.
    pub(super) fn finish(&mut self) {
        for (_, of_topic) in &mut self.topics {
            of_topic.head.ended.get_or_insert(false);
            of_topic.end(&mut self.troubles);
        }
    }
}

impl OfTopic {
    /// Counts the next row; gives how many before it went while no near side was there.
    fn count(&mut self, frame: u64) -> u64 {
        let passed = frame - self.next_frame;
        self.next_frame = frame + 1;
        match (std::mem::take(&mut self.has_gap), self.is_dense) {
            (true, Some(true)) => return passed,
            (true, Some(false)) => {}
            (_, None) => self.is_dense = Some(true),
            (false, Some(was)) => self.is_dense = Some(was && passed == 0),
        }
        0
    }

    /// Ends it as it ended on the other host: without a word if its publisher was killed.
    fn end(&mut self, troubles: &mut Vec<String>) {
        let publisher = std::mem::replace(&mut self.publisher, Publisher::None);
        let finished = match publisher {
            Publisher::Numbers(publisher) if self.head.ended == Some(true) => publisher.finish(),
            Publisher::Classes(publisher) if self.head.ended == Some(true) => publisher.finish(),
            _ => Ok(()),
        };
        troubles.extend(finished.err().map(|error| error.to_string()));
    }
}

impl Publisher {
    fn publish(&mut self, (frame, step, time_s): (u64, u64, f64), values: &[u8]) -> Result<(), ResultsError> {
        match self {
            Self::Numbers(publisher) => {
                let values: Vec<f64> = values
                    .chunks_exact(8)
                    .map(|x| f64::from_le_bytes(x.try_into().unwrap_or_default()))
                    .collect();
                publisher.publish(frame, step, time_s, &values)
            }
            Self::Classes(publisher) => publisher.publish(frame, step, time_s, values),
            Self::None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::results::ResultColumns;

    fn of_topic() -> OfTopic {
        let head = RowsHead::new(Topic::own("x").unwrap(), &ResultColumns::named(&["a_m"]));
        let (publisher, waiting) = (Publisher::None, VecDeque::new());
        OfTopic { head, publisher, waiting, next_frame: 3, is_dense: None, has_gap: false }
    }

    #[test]
    fn rows_that_went_while_no_near_side_was_there_are_counted() {
        let mut dense = of_topic();
        assert_eq!([5, 6, 7].map(|frame| dense.count(frame)), [0; 3], "it may begin later than the run");
        dense.has_gap = true;
        assert_eq!([12, 13].map(|frame| dense.count(frame)), [4, 0]);
        let mut sparse = of_topic();
        assert_eq!([5, 9].map(|frame| sparse.count(frame)), [0; 2]);
        sparse.has_gap = true;
        assert_eq!(sparse.count(20), 0, "nobody knows whether there were any");
    }
}
