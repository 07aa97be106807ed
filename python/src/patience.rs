//! Work without the interpreter, which looks at signals meanwhile.

use crate::errors::{Why, of_panic};
use experiments::pool::{Told, share_batches};
use producer::integrator::Lanes;
use pyo3::prelude::*;
use std::num::NonZero;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, Thread};
use std::time::{Duration, Instant};

/// Interval at which signals are looked at.
pub(crate) const LOOK: Duration = Duration::from_millis(50);

/// Wakes the thread that waits when it is dropped: at the end of work, also of work that panics.
struct Bell {
    is_done: Arc<AtomicBool>,
    waiting: Thread,
}

impl Bell {
    /// For this thread, and what says that the work is done. That a thread has ended is seen only after it has woken us.
    fn new() -> (Self, Arc<AtomicBool>) {
        let is_done = Arc::<AtomicBool>::default();
        (Self { is_done: Arc::clone(&is_done), waiting: thread::current() }, is_done)
    }
}

impl Drop for Bell {
    fn drop(&mut self) {
        self.is_done.store(true, Ordering::Release);
        self.waiting.unpark();
    }
}

/// Does `work` in a thread of its own, and looks at signals meanwhile; one that raises sets the flag, waits for the end of
/// the work, and is raised.
pub(crate) fn interruptible<T: Send>(
    py: Python<'_>,
    work: impl FnOnce(&AtomicBool) -> Result<T, Why> + Send,
) -> PyResult<T> {
    let stop = AtomicBool::new(false);
    stoppable(py, &stop, || work(&stop))
}

/// The same for work that others can stop, too.
pub(crate) fn stoppable<T: Send>(
    py: Python<'_>,
    stop: &AtomicBool,
    work: impl FnOnce() -> Result<T, Why> + Send,
) -> PyResult<T> {
    thread::scope(|scope| {
        let (bell, is_done) = Bell::new();
        let worker = scope.spawn(move || {
            let _bell = bell;
            work()
        });
        let mut raised = Ok(());
        while !is_done.load(Ordering::Acquire) {
            py.detach(|| thread::park_timeout(if raised.is_ok() { LOOK } else { LOOK / 10 }));
            if let (Ok(()), Err(error)) = (&raised, py.check_signals()) {
                stop.store(true, Ordering::Relaxed);
                raised = Err(error);
            }
        }
        let done = py.detach(|| worker.join());
        raised?;
        match done {
            Ok(done) => done.map_err(PyErr::from),
            Err(panic) => Err(of_panic(&*panic)),
        }
    })
}

/// Looks for signals during work in the thread that Python called. The work asks it now and then whether to go on.
pub(crate) struct Looks {
    last: Instant,
    calls: u32,
    /// Exception that a signal or a callback has raised.
    raised: Option<PyErr>,
}

impl Looks {
    /// Calls between two looks at the clock.
    const CALLS: u32 = 16;

    pub(crate) fn new() -> Self {
        Self { last: Instant::now(), calls: 0, raised: None }
    }

    /// True if the work may go on. Every 50 ms it looks at signals and calls `tell`.
    pub(crate) fn go_on(&mut self, tell: impl FnOnce(Python<'_>) -> PyResult<()>) -> bool {
        self.calls += 1;
        if self.raised.is_none() && self.calls >= Self::CALLS {
            self.calls = 0;
            if self.last.elapsed() >= LOOK {
                self.last = Instant::now();
                self.call(|py| py.check_signals().and_then(|()| tell(py)));
            }
        }
        self.raised.is_none()
    }

    /// Calls something of Python's at once.
    pub(crate) fn call(&mut self, call: impl FnOnce(Python<'_>) -> PyResult<()>) {
        self.raised = Python::attach(call).err();
    }

    /// True if something was raised.
    pub(crate) fn has_raised(&self) -> bool {
        self.raised.is_some()
    }

    /// Gives the exception that was raised, if any, as an error.
    pub(crate) fn end(self) -> PyResult<()> {
        self.raised.map_or(Ok(()), Err)
    }
}

/// Does `work` in a thread of its own that nothing stops: a signal is raised at once, and leaves it to itself.
pub(crate) fn abandonable<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> Result<T, Why> + Send + 'static,
) -> PyResult<T> {
    let (bell, is_done) = Bell::new();
    let told = move || {
        let _bell = bell;
        work()
    };
    let worker = thread::Builder::new().spawn(told)?;
    while !is_done.load(Ordering::Acquire) {
        py.detach(|| thread::park_timeout(LOOK));
        py.check_signals()?;
    }
    match worker.join() {
        Ok(done) => done.map_err(PyErr::from),
        Err(panic) => Err(of_panic(&*panic)),
    }
}

/// Does `work` in the calling thread, without the interpreter.
pub(crate) fn detached<T: Send>(py: Python<'_>, work: impl FnOnce() -> Result<T, Why> + Send) -> PyResult<T> {
    match py.detach(|| catch_unwind(AssertUnwindSafe(work))) {
        Ok(done) => done.map_err(PyErr::from),
        Err(panic) => Err(of_panic(&*panic)),
    }
}

/// Does `count` jobs in threads, by `work` that gets some at a time: as many as chains lie beside each other. Gives their results in order,
/// none of one in which the program went wrong; `tell` is called with how many are done. Whatever raises meanwhile gives all of them up.
pub(crate) fn shared<T: Send>(
    py: Python<'_>,
    count: usize,
    threads: Option<NonZero<usize>>,
    tell: Option<&Py<PyAny>>,
    work: impl Fn(&Arc<AtomicBool>, &[usize], &mut Vec<(usize, T)>) -> Result<(), Why> + Send + Sync,
) -> PyResult<Vec<Option<T>>> {
    let threads = threads.or_else(|| thread::available_parallelism().ok()).map_or(1, NonZero::get);
    let threads = threads.min(count).max(1);
    let most = Lanes::most().min(count.div_ceil(threads)).max(1);
    let mut results: Vec<Option<T>> = (0..count).map(|_| None).collect();
    detached(py, || {
        let stop = &Arc::<AtomicBool>::default();
        let (mut done, mut looked, mut raised) = (0_usize, Instant::now(), None);
        let work = |_, batch: &[usize], results: &mut Vec<_>| work(stop, batch, results);
        // what is heard is heard in the thread that Python called, at least every 100 ms
        let shared = share_batches(0..count, (threads, most), stop, work, |told| {
            match told {
                Told::Done(job, result) => (results[job], done) = (Some(result), done + 1),
                Told::Broken(_) => done += 1,
                Told::Fewer(..) | Told::Nothing => {}
            }
            if raised.is_none() && looked.elapsed() >= LOOK {
                looked = Instant::now();
                raised = Python::attach(|py| {
                    py.check_signals()?;
                    tell.map_or(Ok(()), |tell| tell.call1(py, (done,)).map(drop))
                })
                .err();
                stop.fetch_or(raised.is_some(), Ordering::Relaxed);
            }
        });
        raised.map_or(shared, |error| Err(error.into()))
    })?;
    Ok(results)
}
