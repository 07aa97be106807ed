//! Jobs shared out among threads.

use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError, Sender};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

/// Interval at which the listener hears something, whatever the workers do.
const PERIOD: Duration = Duration::from_millis(100);

/// News for a listener.
#[derive(Debug)]
pub enum Told<J, T> {
    /// A job is done.
    Done(J, T),
    /// A job ended in a panic, which has said why; the others go on.
    Broken(J),
    /// The system granted this many threads only, and why; they do everything.
    Fewer(usize, io::Error),
    /// Nothing has happened for a while.
    Nothing,
}

/// The operating system grants no thread at all.
#[derive(Debug, thiserror::Error)]
#[error("no thread to compute in")]
pub struct NoThread(#[source] io::Error);

/// Has `work(worker, job)` done for each of `jobs`, in their order, by so many threads, and tells `hear`. A job that gives
/// nothing was stopped.
///
/// # Errors
/// When there is no thread, or when a job fails: then `stop` is set, and the first failure is returned.
pub fn share<J: Copy + Send, T: Send, E: From<NoThread> + Send>(
    jobs: impl Iterator<Item = J> + Send,
    threads: usize,
    stop: &AtomicBool,
    work: impl Fn(usize, J) -> Result<Option<T>, E> + Sync,
    hear: impl FnMut(Told<J, T>),
) -> Result<(), E> {
    let work = |worker: usize, jobs: &[J]| {
        work(worker, jobs[0]).map(|done| done.into_iter().map(|done| (jobs[0], done)).collect())
    };
    share_batches(jobs, (threads, 1), stop, work, hear)
}

/// Like [`share`], with up to `most` jobs at a time for each of the `threads`: `work` gives those that are done.
///
/// # Errors
/// As [`share`].
pub fn share_batches<J: Copy + Send, T: Send, E: From<NoThread> + Send>(
    jobs: impl Iterator<Item = J> + Send,
    (threads, most): (usize, usize),
    stop: &AtomicBool,
    work: impl Fn(usize, &[J]) -> Result<Vec<(J, T)>, E> + Sync,
    mut hear: impl FnMut(Told<J, T>),
) -> Result<(), E> {
    let jobs = Mutex::new(jobs);
    let take = |worker: usize, tell: &Sender<Result<Told<J, T>, E>>| {
        // a bug in one job is no reason to lose the others
        let attempt = |batch: &[J]| catch_unwind(AssertUnwindSafe(|| work(worker, batch)));
        while !stop.load(Ordering::Relaxed) {
            let mut jobs = jobs.lock().unwrap_or_else(PoisonError::into_inner);
            let batch: Vec<J> = jobs.by_ref().take(most).collect();
            drop(jobs);
            if batch.is_empty() {
                return;
            }
            let attempts = match attempt(&batch) {
                Err(_) if batch.len() > 1 => batch.chunks(1).map(|job| (job, attempt(job))).collect(),
                ended => vec![(&batch[..], ended)],
            };
            for (jobs, ended) in attempts {
                let news: Vec<_> = match ended {
                    Ok(Ok(all)) => all.into_iter().map(|(job, done)| Ok(Told::Done(job, done))).collect(),
                    Ok(Err(error)) => vec![Err(error)],
                    Err(_) => vec![Ok(Told::Broken(jobs[0]))],
                };
                if news.into_iter().any(|news| tell.send(news).is_err()) {
                    return;
                }
            }
        }
    };
    let (tell, told) = mpsc::channel();
    thread::scope(|scope| {
        for worker in 0..threads.max(1) {
            let (take, tell) = (&take, tell.clone());
            if let Err(error) = thread::Builder::new().spawn_scoped(scope, move || take(worker, &tell)) {
                if worker == 0 {
                    return Err(NoThread(error).into());
                }
                hear(Told::Fewer(worker, error));
                break;
            }
        }
        drop(tell);
        let mut failure = None;
        loop {
            match told.recv_timeout(PERIOD) {
                Ok(Ok(told)) => hear(told),
                Ok(Err(error)) => {
                    stop.store(true, Ordering::Relaxed);
                    failure.get_or_insert(error);
                }
                Err(RecvTimeoutError::Timeout) => hear(Told::Nothing),
                Err(RecvTimeoutError::Disconnected) => break,
            }
        }
        failure.map_or(Ok(()), Err)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Outcomes of ten jobs, with two workers.
    fn outcomes(work: impl Fn(usize) -> Result<Option<usize>, NoThread> + Sync) -> (Vec<String>, bool) {
        let (mut heard, stop) = (Vec::new(), AtomicBool::new(false));
        let ended = share(
            0..10,
            2,
            &stop,
            |_, job| work(job),
            |told| match told {
                Told::Done(job, square) => heard.push(format!("{job}: {square}")),
                Told::Broken(job) => heard.push(format!("{job}: broken")),
                Told::Fewer(..) | Told::Nothing => {}
            },
        );
        heard.sort();
        (heard, ended.is_ok())
    }

    #[test]
    fn each_job_is_done_once_and_a_broken_one_costs_no_other() {
        let (heard, whole) = outcomes(|job| {
            assert!(job != 3, "a bug");
            Ok(Some(job * job))
        });
        assert!(whole && heard.len() == 10);
        assert_eq!(heard[2..5], ["2: 4", "3: broken", "4: 16"]);
    }

    #[test]
    fn after_a_failure_no_job_is_begun() {
        let fails = |job| if job < 2 { Err(NoThread(io::Error::other("full"))) } else { Ok(Some(job)) };
        let (heard, whole) = outcomes(fails);
        assert!(!whole && heard.len() < 9, "{heard:?}");
    }
}
