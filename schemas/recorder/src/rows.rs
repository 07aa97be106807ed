//! Records the results that analyses publish, each topic in a thread of its own.

use super::{Recorder, RowFate};
use bus::{
    Bus, Delivery, Looking, ResultReceived, ResultSubscriber, ResultsError, ResultsWatch, Row, StreamId,
};
use recording::RowMessages;
use schemas::frame::EndReason;
use schemas::results::{KeptValues, ResultColumns, ResultRow, Topic};
use schemas::run_name::RunName;
use std::collections::VecDeque;
use std::io;
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// Most rows kept while the run is being joined. The run publishes at most 64 frames before it waits for us.
const MOST_EARLY_ROWS: usize = 128;

/// Longest wait for a publisher before the next look for one.
const LOOK_PERIOD: Duration = Duration::from_millis(100);

/// Longest time for which we trust that publishers announce themselves: a look takes milliseconds.
const TRUST_PERIOD: Duration = Duration::from_secs(1);

/// Time after the last frame within which a publisher may come.
const LAST_LOOK: Duration = Duration::from_millis(300);

/// Tally of one recorded topic of results.
#[derive(Debug, Clone, PartialEq)]
pub struct RowTally {
    /// Topic of the results.
    pub topic: Topic,
    /// Rows recorded.
    pub count: u64,
    /// Frame of the first recorded row.
    pub first_frame: Option<u64>,
    /// Frame of the last recorded row.
    pub last_frame: Option<u64>,
    /// Missed rows: first and last frame of each gap.
    pub missed: Vec<(u64, u64)>,
    /// Reason why the recording of rows stopped early, if it did.
    pub trouble: Option<String>,
}

impl RowTally {
    fn new(topic: Topic) -> Self {
        Self { topic, count: 0, first_frame: None, last_frame: None, missed: Vec::new(), trouble: None }
    }

    /// True if the recording has every row from its first to its last one, as far as is known.
    pub fn is_whole(&self) -> bool {
        self.missed.is_empty() && self.trouble.is_none()
    }

    /// True if anything of this kind was published.
    pub fn is_worth_telling(&self) -> bool {
        self.count > 0 || !self.is_whole()
    }

    /// Number of missed rows.
    pub fn missed_count(&self) -> u64 {
        self.missed.iter().map(|(from, to)| to - from + 1).sum()
    }
}

/// The threads that record rows.
#[derive(Default)]
pub struct RowThreads {
    started: Mutex<Started>,
}

#[derive(Default)]
struct Started {
    run: Option<RunName>,
    /// Thread that looks out for results, and returns a thread for each topic.
    lookout: Option<JoinHandle<Lookout>>,
    failure: Option<String>,
}

impl RowThreads {
    /// Starts recording the results of `run`, once. Call it before the run is joined, so that no row is missed. On return
    /// this process is a subscriber of all present publishers, and new publishers wait for it.
    pub fn start(&self, bus: &Bus, run: &RunName, recorder: &Arc<Recorder>) {
        let mut started = self.started.lock().unwrap_or_else(PoisonError::into_inner);
        if started.run.as_ref() == Some(run) {
            return;
        }
        started.run = Some(run.clone());
        let begun = ResultsWatch::create(bus, run).map_err(|error| error.to_string()).and_then(|watch| {
            let mut lookout = Lookout::new(watch, recorder);
            Looking::awaited(|looking| lookout.look(Some(looking)));
            thread::Builder::new().spawn(move || lookout.look_out()).map_err(|error| no_thread(&error))
        });
        match begun {
            Ok(lookout) => started.lookout = Some(lookout),
            Err(failure) => started.failure = Some(failure),
        }
    }

    /// Waits for the threads, which end after the frames have. Returns the tally of each thread, and the reason if results
    /// could not be recorded at all.
    pub fn finish(&self) -> (Vec<RowTally>, Option<String>) {
        let started = std::mem::take(&mut *self.started.lock().unwrap_or_else(PoisonError::into_inner));
        let Some(lookout) = started.lookout.map(join) else { return (Vec::new(), started.failure) };
        (lookout.threads.into_iter().map(|(_, thread)| join(thread)).collect(), lookout.failure)
    }
}

/// Message for a thread that the system does not grant.
fn no_thread(error: &io::Error) -> String {
    format!("no thread can be started ({error}); allow more processes (`ulimit -u`)")
}

fn join<T>(thread: JoinHandle<T>) -> T {
    // a thread that panicked has said why; the panic goes on here
    thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// Finds topics of results, and starts a thread for each.
struct Lookout {
    watch: Arc<ResultsWatch>,
    recorder: Arc<Recorder>,
    threads: Vec<(Topic, JoinHandle<RowTally>)>,
    failure: Option<String>,
}

impl Lookout {
    fn new(watch: ResultsWatch, recorder: &Arc<Recorder>) -> Self {
        let (watch, recorder) = (Arc::new(watch), Arc::clone(recorder));
        Self { watch, recorder, threads: Vec::new(), failure: None }
    }

    /// Looks for new topics until the frames are over and no more publishers come.
    fn look_out(mut self) -> Self {
        let mut looked_at = Instant::now();
        while self.failure.is_none() && !self.is_over() {
            if self.watch.wait(LOOK_PERIOD) || looked_at.elapsed() >= TRUST_PERIOD {
                looked_at = Instant::now();
                self.look(None);
            }
        }
        self
    }

    fn is_over(&self) -> bool {
        let end = self.recorder.state().end;
        end.is_some_and(|end| end.last_frame.is_none() || end.since.elapsed() >= end.patience.min(LAST_LOOK))
    }

    /// Starts a thread for each topic that has none.
    fn look(&mut self, looking: Option<&Looking>) {
        let topics = self.watch.topics().map_err(|error| error.to_string());
        let started = topics.and_then(|topics| {
            for topic in topics {
                if self.threads.iter().any(|(known, _)| *known == topic) {
                    continue;
                }
                let (watch, recorder) = (Arc::clone(&self.watch), Arc::clone(&self.recorder));
                let looking = looking.cloned();
                let work = move || TopicRows::new(&recorder, &watch, topic).record(looking);
                let thread = thread::Builder::new().spawn(work).map_err(|error| no_thread(&error))?;
                self.threads.push((topic, thread));
            }
            Ok(())
        });
        self.failure = self.failure.take().or(started.err());
    }
}

/// A row that came before the run was joined.
struct EarlyRow {
    stream: StreamId,
    frame: u64,
    step: u64,
    time_s: f64,
    follows: bool,
    values: KeptValues,
}

/// Recorder of the rows of one topic.
struct TopicRows<'a> {
    recorder: &'a Recorder,
    watch: &'a ResultsWatch,
    early: VecDeque<EarlyRow>,
    columns: ResultColumns,
    /// Messages of the rows in the recording, once there is one.
    messages: Option<RowMessages>,
    /// Frame of the last published row, if that row has not arrived.
    owed: Option<u64>,
    heard_at: Instant,
    tally: RowTally,
}

impl<'a> TopicRows<'a> {
    fn new(recorder: &'a Recorder, watch: &'a ResultsWatch, topic: Topic) -> Self {
        Self {
            recorder,
            watch,
            early: VecDeque::new(),
            columns: ResultColumns::default(),
            messages: None,
            owed: None,
            heard_at: Instant::now(),
            tally: RowTally::new(topic),
        }
    }

    /// Records rows until the frames are over and no more rows come. Gives `looking` up once it has subscribed to a
    /// publisher that was there before.
    fn record(mut self, looking: Option<Looking>) -> RowTally {
        self.tally.trouble = self.follow(looking).err();
        if self.tally.trouble.is_some() {
            self.stand_by();
        }
        // rows of later frames than ours are no loss
        let end = self.recorder.state().end.and_then(|end| end.last_frame);
        let owed = self.owed.min(end);
        if let Some((last, owed)) = self.tally.last_frame.zip(owed).filter(|(last, owed)| owed > last) {
            self.tally.missed.push((last + 1, owed));
        }
        self.tally
    }

    /// Records no more, but still subscribes, so that no new publisher waits for this process in vain.
    fn stand_by(&self) {
        let goes_on = || self.recorder.state().end.is_none();
        while goes_on() {
            match self.watch.attach(self.tally.topic, Delivery::Latest, Arc::default()) {
                Ok(Some(mut rows)) => {
                    let mut is_over =
                        || matches!(rows.receive_soon(), Err(_) | Ok(Some(ResultReceived::End(_))));
                    while goes_on() && !is_over() {}
                }
                _ => thread::sleep(LOOK_PERIOD),
            }
        }
    }

    fn follow(&mut self, mut looking: Option<Looking>) -> Result<(), String> {
        let say = |error: ResultsError| error.to_string();
        let mut subscriber: Option<ResultSubscriber> = None;
        while !self.is_over(subscriber.is_some())? {
            let Some(rows) = &mut subscriber else {
                let topic = self.tally.topic;
                subscriber = self.watch.attach(topic, Delivery::Lossless, Arc::default()).map_err(say)?;
                drop(looking.take());
                match &subscriber {
                    Some(rows) => (self.columns, self.messages) = (rows.columns().clone(), None),
                    None => thread::sleep(LOOK_PERIOD),
                }
                continue;
            };
            match rows.receive_soon().map_err(say)? {
                Some(ResultReceived::Row(row)) => self.take(&row)?,
                Some(ResultReceived::Missed { to, .. }) => self.owed = Some(to),
                Some(ResultReceived::End(reason)) => {
                    subscriber = None;
                    if reason == EndReason::ProducerLost && self.tally.count > 0 {
                        return Err("their publisher left without a word about their end".to_owned());
                    }
                }
                None => {}
            }
        }
        Ok(())
    }

    /// True if no more rows are wanted or expected.
    fn is_over(&mut self, attached: bool) -> Result<bool, String> {
        let end = self.recorder.state().end;
        let Some(end) = end else { return Ok(false) };
        self.record_early()?;
        if end.last_frame.is_none() || self.tally.last_frame >= end.last_frame {
            return Ok(true);
        }
        if !attached {
            // an analysis that joined late may be about to publish
            return Ok(self.tally.count > 0 || end.since.elapsed() >= end.patience.min(LAST_LOOK));
        }
        if self.heard_at.max(end.since).elapsed() < end.patience {
            return Ok(false);
        }
        if self.tally.count == 0 {
            return Ok(true);
        }
        Err(match end.patience.as_secs() {
            0 => "the recording ended before the rows of its last frames came".to_owned(),
            waited => format!("no row came for {waited} s"),
        })
    }

    fn take(&mut self, row: &Row<'_>) -> Result<(), String> {
        self.heard_at = Instant::now();
        self.record_early()?;
        if let RowFate::TooEarly = self.write(row)? {
            if self.early.len() == MOST_EARLY_ROWS {
                self.early.pop_front();
            }
            let Row { stream, frame, step, time_s, follows, values } = *row;
            self.early.push_back(EarlyRow { stream, frame, step, time_s, follows, values: values.into() });
        }
        Ok(())
    }

    /// Records the rows that came too early, if the recording has begun.
    fn record_early(&mut self) -> Result<(), String> {
        while let Some(early) = self.early.pop_front() {
            let EarlyRow { stream, frame, step, time_s, follows, ref values } = early;
            let row = Row { stream, frame, step, time_s, follows, values: values.lend() };
            if let RowFate::TooEarly = self.write(&row)? {
                self.early.push_front(early);
                break;
            }
        }
        Ok(())
    }

    fn write(&mut self, row: &Row<'_>) -> Result<RowFate, String> {
        let Row { stream, frame, step, time_s, follows, values } = *row;
        if self.tally.last_frame.is_some_and(|last| last >= frame) {
            // another publisher begins again
            return Ok(RowFate::NotOurs);
        }
        let row = ResultRow { frame, step, time_s, values };
        let (topic, columns) = (self.tally.topic, &self.columns);
        let make = |run: &_| RowMessages::new(topic, columns, run);
        let fate = self.recorder.write_row(stream, &row, &mut self.messages, make)?;
        if let RowFate::Recorded { joined_at } = fate {
            let tally = &mut self.tally;
            // before a publisher's own first row there are none to miss
            let due = tally.last_frame.map(|last| last + 1).or(follows.then_some(joined_at));
            tally.missed.extend(due.filter(|due| *due < frame).map(|due| (due, frame - 1)));
            tally.count += 1;
            tally.first_frame.get_or_insert(frame);
            tally.last_frame = Some(frame);
        }
        Ok(fate)
    }
}
