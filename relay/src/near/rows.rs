//! Results that analyses publish on the near bus, each topic in a thread of its own.

use crate::log::{Kind, SharedLog, lock};
use crate::message::{MOST_ROW_BYTES, MOST_TOPICS, RowsHead, RowsMessage};
use bus::{Bus, Delivery, Looking, ResultReceived, ResultSubscriber, ResultsError, ResultsWatch, StreamId};
use schemas::frame::EndReason;
use schemas::results::{RowValues, Topic};
use schemas::run_name::RunName;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, OnceLock};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// Bytes of a message of rows.
const BATCH_BYTES: usize = 64 << 10;
/// Longest wait for more of them.
const BATCH_PERIOD: Duration = Duration::from_millis(10);
/// Interval between two searches for a publisher.
const LOOK_PERIOD: Duration = Duration::from_millis(100);
/// Time for which the near side trusts that publishers announce themselves.
const TRUST_PERIOD: Duration = Duration::from_secs(1);
/// Longest silence of a living publisher after the end of the run.
const PATIENCE: Duration = Duration::from_secs(10);

/// The threads that send rows of results into a log.
pub struct RowSenders<P> {
    log: Arc<SharedLog<P>>,
    started: Mutex<Vec<JoinHandle<()>>>,
    /// The last frame that is sent, once that is known.
    last_frame: Arc<OnceLock<u64>>,
    /// Rows of other publishings are not ours.
    stream: Arc<Mutex<Option<StreamId>>>,
    failures: Arc<Mutex<Vec<String>>>,
    /// Nobody waits for the rest.
    stop: Arc<AtomicBool>,
}

impl<P: Clone + From<Vec<u8>> + Send + 'static> RowSenders<P> {
    /// None yet; at the end `stop` ends the wait for the last rows.
    pub fn new(log: Arc<SharedLog<P>>, stop: Arc<AtomicBool>) -> Self {
        Self {
            log,
            stop,
            started: Mutex::default(),
            last_frame: Arc::default(),
            stream: Arc::default(),
            failures: Arc::default(),
        }
    }

    /// Starts sending the results of `run`, once: before the run is joined, so that no row is missed. On return this process
    /// is a subscriber of all present publishers, and new publishers wait for it.
    ///
    /// # Errors
    /// When the bus cannot be used.
    pub fn start(&self, bus: &Bus, run: &RunName) -> Result<(), ResultsError> {
        let mut started = lock(&self.started);
        if !started.is_empty() {
            return Ok(());
        }
        let watch = Arc::new(ResultsWatch::create(bus, run)?);
        let (others, mut known) = (self.another(), Vec::new());
        Looking::awaited(|looking| others.look(&watch, &mut known, Some(looking)));
        started.push(thread::spawn(move || others.look_out(&watch, known)));
        Ok(())
    }

    fn another(&self) -> Self {
        Self {
            log: Arc::clone(&self.log),
            started: Mutex::default(),
            last_frame: Arc::clone(&self.last_frame),
            stream: Arc::clone(&self.stream),
            failures: Arc::clone(&self.failures),
            stop: Arc::clone(&self.stop),
        }
    }

    /// Sends rows of this publishing of the run alone.
    pub fn joined(&self, stream: StreamId) {
        *lock(&self.stream) = Some(stream);
    }

    /// Starts a thread for each topic that comes beside the `known` ones.
    fn look_out(&self, watch: &Arc<ResultsWatch>, mut known: Vec<Topic>) {
        let mut looked_at = Instant::now();
        loop {
            // who came with the last frame is seen, too
            let is_last = self.last_frame.get().is_some();
            if watch.wait(LOOK_PERIOD) || is_last || looked_at.elapsed() >= TRUST_PERIOD {
                looked_at = Instant::now();
                self.look(watch, &mut known, None);
            }
            if is_last || (self.last_frame.get().is_some() && self.is_stopped()) {
                break;
            }
        }
        for thread in std::mem::take(&mut *lock(&self.started)) {
            let _ = thread.join();
        }
    }

    fn look(&self, watch: &Arc<ResultsWatch>, known: &mut Vec<Topic>, looking: Option<&Looking>) {
        for topic in watch.topics().unwrap_or_default() {
            if known.contains(&topic) {
                continue;
            }
            if known.len() < MOST_TOPICS {
                lock(&self.started).push(self.spawn(watch, topic, looking.cloned()));
            } else {
                // a far side takes no more
                let too_many = format!("{topic}: expected at most {MOST_TOPICS} topics of results");
                lock(&self.failures).push(too_many);
            }
            known.push(topic);
        }
    }

    fn spawn(&self, watch: &Arc<ResultsWatch>, topic: Topic, looking: Option<Looking>) -> JoinHandle<()> {
        let (it, watch) = (self.another(), Arc::clone(watch));
        thread::spawn(move || {
            if let Err(error) = it.send(&watch, topic, looking) {
                lock(&it.failures).push(error.to_string());
            }
        })
    }

    /// Sends the rows of one publisher after the other. Gives `looking` up after the first look for one.
    fn send(
        &self,
        watch: &ResultsWatch,
        topic: Topic,
        mut looking: Option<Looking>,
    ) -> Result<(), ResultsError> {
        let mut over_since = None;
        loop {
            let over = self.last_frame.get().is_some();
            let found = watch.attach(topic, Delivery::Lossless, Arc::default())?;
            drop(looking.take());
            match found {
                Some(mut rows) => {
                    self.send_all(&mut rows, topic)?;
                    if self.last_frame.get().is_some() {
                        return Ok(());
                    }
                }
                None if over
                    && (over_since.get_or_insert_with(Instant::now).elapsed() >= LOOK_PERIOD
                        || self.is_stopped()) =>
                {
                    return Ok(());
                }
                None => thread::sleep(LOOK_PERIOD),
            }
        }
    }

    fn is_stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Sends the rows of one publisher.
    fn send_all(&self, rows: &mut ResultSubscriber, topic: Topic) -> Result<(), ResultsError> {
        let mut head = RowsHead::new(topic, rows.columns());
        let refused = |what| Err(ResultsError::Columns { topic, what });
        if head.row_bytes() > MOST_ROW_BYTES {
            return refused(format!("rows of {} bytes, expected at most {MOST_ROW_BYTES}", head.row_bytes()));
        }
        if head.tolerance_m.is_some_and(f64::is_nan) {
            return refused("classes without a tolerance; say what counts as touching".to_owned());
        }
        let (mut batch, mut count, mut since) = (RowsMessage::default(), 0, Instant::now());
        let (mut heard, mut due, mut lost) = (Instant::now(), DueRows::default(), 0);
        loop {
            let last = self.last_frame.get().copied();
            match rows.receive_soon()? {
                // the run goes on without us
                Some(ResultReceived::Row(row))
                    if last.is_some_and(|last| row.frame > last || self.is_stopped()) =>
                {
                    head.ended = Some(false);
                }
                Some(ResultReceived::Row(row)) => {
                    heard = Instant::now();
                    if lock(&self.stream).is_none_or(|stream| stream == row.stream) {
                        if batch.is_empty() {
                            since = heard;
                        }
                        match row.values {
                            RowValues::Numbers(numbers) => {
                                batch.push(row.frame, numbers.iter().flat_map(|number| number.to_le_bytes()));
                            }
                            RowValues::Classes(classes) => batch.push(row.frame, classes.iter().copied()),
                        }
                        due.came(row.frame);
                        count += 1;
                    }
                }
                Some(ResultReceived::End(reason)) => head.ended = Some(reason == EndReason::Complete),
                Some(ResultReceived::Missed { to, .. }) => lost = due.missed(last.unwrap_or(to).min(to)),
                None => match last {
                    None => heard = Instant::now(),
                    Some(last) if heard.elapsed() >= PATIENCE || self.is_stopped() => {
                        (lost, head.ended) = (due.missed(last), Some(false));
                    }
                    Some(_) => {}
                },
            }
            if lost > 0 {
                self.log.change(|log| log.lose_rows(std::mem::take(&mut lost)));
            }
            let is_due = batch.len() >= BATCH_BYTES || since.elapsed() >= BATCH_PERIOD;
            if head.ended.is_some() || (is_due && !batch.is_empty()) {
                let message = batch.finish(&head);
                let (bytes, count) = (message.len(), std::mem::take(&mut count));
                self.log.change(|log| log.push(Kind::Rows(count), message.into(), bytes, Instant::now()));
            }
            if head.ended.is_some() {
                return Ok(());
            }
        }
    }

    /// No frame is sent after `last_frame`: waits for the rest of the rows, and returns the troubles.
    pub fn finish(&self, last_frame: u64) -> Vec<String> {
        let _ = self.last_frame.set(last_frame);
        for thread in std::mem::take(&mut *lock(&self.started)) {
            let _ = thread.join();
        }
        std::mem::take(&mut *lock(&self.failures))
    }
}

/// The rows that are due from a publisher with one row for each frame.
#[derive(Default)]
struct DueRows {
    next_frame: Option<u64>,
    /// True if there was a row for each frame so far; none before the second row.
    is_dense: Option<bool>,
}

impl DueRows {
    fn came(&mut self, frame: u64) {
        if self.next_frame.replace(frame + 1) == Some(frame) {
            self.is_dense.get_or_insert(true);
        }
    }

    /// No row up to this frame comes any more; gives how many were due.
    fn missed(&mut self, to: u64) -> u64 {
        let Some(next) = self.next_frame.replace(to + 1) else { return 0 };
        if *self.is_dense.get_or_insert(false) { (to + 1).saturating_sub(next) } else { 0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_that_do_not_come_are_counted_where_each_frame_has_one() {
        let mut dense = DueRows::default();
        assert_eq!(dense.missed(3), 0, "it may begin later than the run");
        (5..7).for_each(|frame| dense.came(frame));
        assert_eq!(dense.missed(9), 3);
        dense.came(10);
        assert_eq!([12, 12].map(|last| dense.missed(last)), [2, 0]);
        let mut sparse = DueRows::default();
        sparse.came(5);
        assert_eq!(sparse.missed(9), 0, "nobody knows whether there were any");
        (10..12).for_each(|frame| sparse.came(frame));
        assert_eq!(sparse.missed(20), 0);
    }
}
