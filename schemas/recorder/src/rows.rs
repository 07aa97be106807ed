//! The results that analyses publish, each kind in a thread of its own.

use super::{Recorder, RowFate};
use bus::{
    Bus, Delivery, OwnTopicsWatch, ResultElement, ResultReceived, ResultSubscriber, ResultWatch,
    ResultsError, Row, StreamId,
};
use recording::{ResultKind, ResultRow, RowValues};
use schemas::frame::EndReason;
use schemas::results::{ResultColumns, Topic};
use schemas::run_name::RunName;
use std::collections::VecDeque;
use std::convert::Infallible;
use std::io;
use std::sync::mpsc::{Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

/// Rows kept while the run is being joined. It publishes at most 64 frames before it waits for us.
const MOST_EARLY_ROWS: usize = 128;

/// How long to wait for a publisher before looking for one.
const LOOK_PERIOD: Duration = Duration::from_millis(100);

/// How long to trust that publishers of topics that are not ours announce themselves: a look takes milliseconds.
const OWN_LOOK_PERIOD: Duration = Duration::from_secs(1);

/// How long after the last frame a first row may come.
const LAST_LOOK: Duration = Duration::from_millis(300);

/// What came of one kind of results.
#[derive(Debug, Clone, PartialEq)]
pub struct RowTally {
    /// Of which results.
    pub topic: Topic,
    /// Rows recorded.
    pub count: u64,
    /// Frame of the first one.
    pub first_frame: Option<u64>,
    /// Frame of the last one.
    pub last_frame: Option<u64>,
    /// Missed rows: frames from and up to.
    pub missed: Vec<(u64, u64)>,
    /// Why recording rows stopped, if before their end.
    pub trouble: Option<String>,
}

impl RowTally {
    fn new(topic: Topic) -> Self {
        Self { topic, count: 0, first_frame: None, last_frame: None, missed: Vec::new(), trouble: None }
    }

    /// Whether it has every row from its first to its last one, as far as is known.
    pub fn is_whole(&self) -> bool {
        self.missed.is_empty() && self.trouble.is_none()
    }

    /// Whether anything of this kind was published.
    pub fn is_worth_telling(&self) -> bool {
        self.count > 0 || !self.is_whole()
    }

    /// Rows missed.
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
    threads: Vec<JoinHandle<RowTally>>,
    /// Looks out for topics that are not ours, and returns a thread for each.
    lookout: Option<JoinHandle<OwnThreads>>,
    failure: Option<ResultsError>,
}

impl RowThreads {
    /// Starts recording the results of `run`, once: before the run is joined, so that no row is missed. On return those
    /// who publish already have us as a subscriber, and those who come wait for us.
    pub fn start(&self, bus: &Bus, run: &RunName, recorder: &Arc<Recorder>) {
        let mut started = self.started.lock().unwrap_or_else(PoisonError::into_inner);
        if started.run.as_ref() == Some(run) {
            return;
        }
        started.run = Some(run.clone());
        let (looking, looked) = channel();
        for topic in [Topic::Energies, Topic::Impurity, Topic::Contacts, Topic::Pulses] {
            match ResultWatch::create(bus, run, topic) {
                Ok(watch) => match spawn(watch, recorder, looking.clone()) {
                    Ok(thread) => started.threads.push(thread),
                    Err(error) => started.failure = Some(error),
                },
                Err(error) => started.failure = Some(error),
            }
        }
        match OwnTopicsWatch::create(bus, run) {
            Ok(watch) => {
                let mut own = OwnThreads::new(bus, run, recorder);
                own.look(&watch, Some(&looking));
                match thread::Builder::new().spawn(move || own.look_out(&watch)) {
                    Ok(thread) => started.lookout = Some(thread),
                    Err(error) => started.failure = Some(no_thread(Topic::Energies, &error)),
                }
            }
            Err(error) => started.failure = Some(error),
        }
        drop(looking);
        // nothing is sent; each thread gives its end up when it has looked for a publisher
        let _ = looked.recv();
    }

    /// Waits for the threads, which end after the frames have: what each has recorded, and why results could not be
    /// recorded at all.
    pub fn finish(&self) -> (Vec<RowTally>, Option<ResultsError>) {
        let started = std::mem::take(&mut *self.started.lock().unwrap_or_else(PoisonError::into_inner));
        let mut tallies: Vec<_> = started.threads.into_iter().map(join).collect();
        let own = started.lookout.map(join);
        let mut failure = started.failure;
        if let Some(own) = own {
            tallies.extend(own.threads.into_iter().map(|(_, thread)| join(thread)));
            failure = failure.or(own.failure);
        }
        (tallies, failure)
    }
}

/// A thread that records the rows for which `watch` waits; see [`Rows::record`].
fn spawn(
    watch: ResultWatch,
    recorder: &Arc<Recorder>,
    looking: Sender<Infallible>,
) -> Result<JoinHandle<RowTally>, ResultsError> {
    let (recorder, topic) = (Arc::clone(recorder), watch.topic());
    let work = move || match watch.topic() {
        Topic::Contacts => {
            Rows::new(&recorder, &watch, |classes| RowValues::Classes(classes)).record(looking)
        }
        _ => Rows::new(&recorder, &watch, |numbers| RowValues::Numbers(numbers)).record(looking),
    };
    thread::Builder::new().spawn(work).map_err(|error| no_thread(topic, &error))
}

/// The system grants no thread for results.
fn no_thread(topic: Topic, error: &io::Error) -> ResultsError {
    let cause = format!("no thread can be started ({error}); allow more processes (`ulimit -u`)");
    ResultsError::Port { topic, cause }
}

fn join<T>(thread: JoinHandle<T>) -> T {
    // a thread that panicked has said why; the panic goes on here
    thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
}

/// The threads that record results whose topics are not ours.
struct OwnThreads {
    bus: Bus,
    run: RunName,
    recorder: Arc<Recorder>,
    threads: Vec<(Topic, JoinHandle<RowTally>)>,
    failure: Option<ResultsError>,
}

impl OwnThreads {
    fn new(bus: &Bus, run: &RunName, recorder: &Arc<Recorder>) -> Self {
        let (bus, run, recorder) = (bus.clone(), run.clone(), Arc::clone(recorder));
        Self { bus, run, recorder, threads: Vec::new(), failure: None }
    }

    /// Looks for new topics until the frames are over.
    fn look_out(mut self, watch: &OwnTopicsWatch) -> Self {
        let mut looked_at = Instant::now();
        while self.failure.is_none() && self.recorder.state().end.is_none() {
            if watch.wait(LOOK_PERIOD) || looked_at.elapsed() >= OWN_LOOK_PERIOD {
                looked_at = Instant::now();
                self.look(watch, None);
            }
        }
        self
    }

    /// Starts a thread for each topic that has none.
    fn look(&mut self, watch: &OwnTopicsWatch, looking: Option<&Sender<Infallible>>) {
        let looked = watch.topics().and_then(|topics| {
            for topic in topics {
                if self.threads.iter().any(|(known, _)| *known == topic) {
                    continue;
                }
                let watch = ResultWatch::create(&self.bus, &self.run, topic)?;
                let looking = looking.cloned().unwrap_or_else(|| channel().0);
                self.threads.push((topic, spawn(watch, &self.recorder, looking)?));
            }
            Ok(())
        });
        self.failure = self.failure.take().or(looked.err());
    }
}

/// A row that came before the run was joined.
struct EarlyRow<T> {
    stream: StreamId,
    frame: u64,
    step: u64,
    time_s: f64,
    follows: bool,
    values: Vec<T>,
}

/// One kind of results.
struct Rows<'a, T: ResultElement> {
    recorder: &'a Recorder,
    watch: &'a ResultWatch,
    values: fn(&[T]) -> RowValues<'_>,
    early: VecDeque<EarlyRow<T>>,
    columns: ResultColumns,
    /// What the columns are, once there is a row.
    kind: Option<ResultKind>,
    /// The last published row, which has not arrived.
    owed: Option<u64>,
    heard_at: Instant,
    tally: RowTally,
}

impl<'a, T: ResultElement> Rows<'a, T> {
    fn new(recorder: &'a Recorder, watch: &'a ResultWatch, values: fn(&[T]) -> RowValues<'_>) -> Self {
        Self {
            recorder,
            watch,
            values,
            early: VecDeque::new(),
            columns: ResultColumns::default(),
            kind: None,
            owed: None,
            heard_at: Instant::now(),
            tally: RowTally::new(watch.topic()),
        }
    }

    /// Records rows until the frames are over and no more rows come. Gives `looking` up once it has subscribed to a
    /// publisher that was there before.
    fn record(mut self, looking: Sender<Infallible>) -> RowTally {
        let followed = self.follow(looking);
        self.tally.trouble = followed.err();
        if let Some((last, owed)) = self.tally.last_frame.zip(self.owed).filter(|(last, owed)| owed > last) {
            self.tally.missed.push((last + 1, owed));
        }
        self.tally
    }

    fn follow(&mut self, looking: Sender<Infallible>) -> Result<(), String> {
        let say = |error: ResultsError| error.to_string();
        let mut looking = Some(looking);
        let mut subscriber: Option<ResultSubscriber<T>> = None;
        while !self.is_over(subscriber.is_some())? {
            let Some(rows) = &mut subscriber else {
                subscriber = self.watch.attach(Delivery::Lossless, Arc::default()).map_err(say)?;
                drop(looking.take());
                match &subscriber {
                    Some(rows) => (self.columns, self.kind) = (rows.columns().clone(), None),
                    None => self.watch.wait(LOOK_PERIOD),
                }
                continue;
            };
            match rows.receive_soon().map_err(say)? {
                Some(ResultReceived::Row(row)) => self.take(&row)?,
                Some(ResultReceived::Missed { to, .. }) => self.owed = Some(to),
                Some(ResultReceived::End(reason)) => {
                    subscriber = None;
                    if reason == EndReason::ProducerLost && self.tally.count > 0 {
                        return Err("the process that published them is gone without a word".to_owned());
                    }
                }
                None => {}
            }
        }
        Ok(())
    }

    /// Whether no more rows are wanted, or are to be expected.
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
        Err(format!("no row came for {} s", end.patience.as_secs()))
    }

    fn take(&mut self, row: &Row<'_, T>) -> Result<(), String> {
        self.heard_at = Instant::now();
        self.record_early()?;
        if let RowFate::TooEarly = self.write(row)? {
            if self.early.len() == MOST_EARLY_ROWS {
                self.early.pop_front();
            }
            let Row { stream, frame, step, time_s, follows, values } = *row;
            self.early.push_back(EarlyRow { stream, frame, step, time_s, follows, values: values.to_vec() });
        }
        Ok(())
    }

    /// Records what came too early, if it is not any more.
    fn record_early(&mut self) -> Result<(), String> {
        while let Some(early) = self.early.pop_front() {
            let EarlyRow { stream, frame, step, time_s, follows, ref values } = early;
            if let RowFate::TooEarly = self.write(&Row { stream, frame, step, time_s, follows, values })? {
                self.early.push_front(early);
                break;
            }
        }
        Ok(())
    }

    fn write(&mut self, row: &Row<'_, T>) -> Result<RowFate, String> {
        let Row { stream, frame, step, time_s, follows, values } = *row;
        if self.tally.last_frame.is_some_and(|last| last >= frame) {
            // another publisher begins again
            return Ok(RowFate::NotOurs);
        }
        let row = ResultRow { frame, step, time_s, values: (self.values)(values) };
        let (topic, columns) = (self.tally.topic, &self.columns);
        let known = self.kind.take();
        let kind = |run: &_| known.map_or_else(|| ResultKind::new(topic, columns, run), Ok);
        let (fate, kind) = self.recorder.write_row(stream, &row, kind)?;
        self.kind = kind;
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
