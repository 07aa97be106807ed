//! Results about the frames of a live run.

use super::Frame;
use crate::errors::{Why, of_panic};
use bus::{ResultPublisher, ResultsError};
use pyo3::prelude::*;
use schemas::frame::Frame as StateFrame;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// Frame, step, time (s), values.
type Row = (u64, u64, f64, Vec<f64>);

/// Publishes rows in a thread of its own: subscribers may hold it back, and signals are to be seen meanwhile.
#[pyclass(frozen, module = "beadline._native")]
pub(super) struct Results {
    /// None is the end in order; without one, subscribers hear that rows are missing.
    rows: Mutex<Option<SyncSender<Option<Row>>>>,
    worker: Mutex<Option<JoinHandle<Result<(), ResultsError>>>>,
    stop: Arc<AtomicBool>,
}

impl Results {
    /// Rows that may wait to be published.
    const WAITING: usize = 64;
    /// Pause before the next look at a full queue.
    const PAUSE: Duration = Duration::from_millis(1);

    pub(super) fn new(mut publisher: ResultPublisher<f64>, stop: Arc<AtomicBool>) -> Self {
        let (rows, waiting) = sync_channel::<Option<Row>>(Self::WAITING);
        let worker = thread::spawn(move || {
            for row in waiting {
                let Some((frame, step, time_s, values)) = row else { return publisher.finish() };
                publisher.publish(frame, step, time_s, &values)?;
            }
            Ok(())
        });
        Self { rows: Mutex::new(Some(rows)), worker: Mutex::new(Some(worker)), stop }
    }

    fn send(&self, py: Python<'_>, mut row: Option<Row>) -> PyResult<()> {
        loop {
            // a look never waits, so that nobody holds the lock for long
            let rows = self.rows.lock().unwrap_or_else(PoisonError::into_inner);
            let sent = rows.as_ref().map(|rows| rows.try_send(row));
            drop(rows);
            match sent {
                None => return Err(Why::new("LiveError", "these results are finished").into()),
                Some(Ok(())) => return Ok(()),
                Some(Err(TrySendError::Full(back))) => row = back,
                Some(Err(TrySendError::Disconnected(_))) => return self.end(py),
            }
            py.detach(|| thread::sleep(Self::PAUSE));
            py.check_signals()?;
        }
    }

    /// Waits for the end of the thread, and says what went wrong there.
    fn end(&self, py: Python<'_>) -> PyResult<()> {
        drop(self.rows.lock().unwrap_or_else(PoisonError::into_inner).take());
        let worker = self.worker.lock().unwrap_or_else(PoisonError::into_inner).take();
        let Some(worker) = worker else { return Ok(()) };
        while !worker.is_finished() {
            py.detach(|| thread::sleep(Self::PAUSE));
            py.check_signals().inspect_err(|_| self.stop.store(true, Ordering::Relaxed))?;
        }
        match worker.join() {
            Ok(done) => Ok(done.map_err(Why::from)?),
            Err(panic) => Err(of_panic(&*panic)),
        }
    }
}

#[pymethods]
impl Results {
    /// Publishes the row of a frame.
    fn publish(&self, py: Python<'_>, frame: &Frame, row: Vec<f64>) -> PyResult<()> {
        let StateFrame { frame, step, time_s, .. } = frame.state();
        self.send(py, Some((frame, step, time_s, row)))
    }

    /// Tells subscribers that no more rows come.
    fn finish(&self, py: Python<'_>) -> PyResult<()> {
        self.send(py, None)?;
        self.end(py)
    }
}
