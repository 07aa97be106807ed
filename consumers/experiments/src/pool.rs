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
pub fn share<J: Copy + PartialEq + Send, T: Send, E: From<NoThread> + Send>(
    jobs: impl Iterator<Item = J> + Send,
    threads: usize,
    stop: &AtomicBool,
    work: impl Fn(usize, J) -> Result<Option<T>, E> + Sync,
    hear: impl FnMut(Told<J, T>),
) -> Result<(), E> {
    let work = |worker: usize, jobs: &[J], done: &mut Vec<(J, T)>| {
        done.extend(work(worker, jobs[0])?.map(|result| (jobs[0], result)));
        Ok(())
    };
    share_batches(jobs, (threads, 1), stop, work, hear)
}

/// Like [`share`], with up to `most` jobs at a time for each of the `threads`: `work` adds those that are done to a list. After a panic those
/// that were done stay so, and the others are tried one by one.
///
/// # Errors
/// As [`share`].
pub fn share_batches<J: Copy + PartialEq + Send, T: Send, E: From<NoThread> + Send>(
    jobs: impl Iterator<Item = J> + Send,
    (threads, most): (usize, usize),
    stop: &AtomicBool,
    work: impl Fn(usize, &[J], &mut Vec<(J, T)>) -> Result<(), E> + Sync,
    mut hear: impl FnMut(Told<J, T>),
) -> Result<(), E> {
    let jobs = Mutex::new(jobs);
    let take = |worker: usize, tell: &Sender<Result<Told<J, T>, E>>| {
        // a bug in one job is no reason to lose the others
        let attempt = |batch: &[J]| {
            let mut done = Vec::new();
            let ended = catch_unwind(AssertUnwindSafe(|| work(worker, batch, &mut done)));
            let is_broken = ended.is_err();
            let mut news: Vec<_> =
                done.into_iter().map(|(job, result)| Ok(Told::Done(job, result))).collect();
            news.extend(ended.ok().and_then(Result::err).map(Err));
            (news, is_broken)
        };
        while !stop.load(Ordering::Relaxed) {
            let mut jobs = jobs.lock().unwrap_or_else(PoisonError::into_inner);
            let batch: Vec<J> = jobs.by_ref().take(most).collect();
            drop(jobs);
            if batch.is_empty() {
                return;
            }
            let (mut news, is_broken) = attempt(&batch);
            if is_broken && batch.len() > 1 {
                let is_done =
                    |job: &J| news.iter().any(|told| matches!(told, Ok(Told::Done(done, _)) if done == job));
                let left: Vec<J> = batch.into_iter().filter(|job| !is_done(job)).collect();
                for job in left {
                    let (told, is_broken) = attempt(&[job]);
                    news.extend(told);
                    news.extend(is_broken.then_some(Ok(Told::Broken(job))));
                }
            } else if is_broken {
                news.push(Ok(Told::Broken(batch[0])));
            }
            if news.into_iter().any(|news| tell.send(news).is_err()) {
                return;
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
    fn jobs_done_before_a_panic_among_them_are_not_done_again() {
        let (mut heard, begun) = (Vec::new(), Mutex::new(Vec::new()));
        let work = |_: usize, jobs: &[usize], done: &mut Vec<(usize, usize)>| {
            for job in jobs {
                begun.lock().expect("no panic while it is held").push(*job);
                assert!(*job != 2, "a bug");
                done.push((*job, job * job));
            }
            Ok::<_, NoThread>(())
        };
        let told = |told: Told<usize, usize>| match told {
            Told::Done(job, _) => heard.push((job, true)),
            Told::Broken(job) => heard.push((job, false)),
            Told::Fewer(..) | Told::Nothing => {}
        };
        assert!(share_batches(0..6, (1, 4), &AtomicBool::new(false), work, told).is_ok());
        assert_eq!(heard, [(0, true), (1, true), (2, false), (3, true), (4, true), (5, true)]);
        assert_eq!(begun.into_inner().expect("no panic while it is held"), [0, 1, 2, 2, 3, 4, 5]);
    }

    #[test]
    fn after_a_failure_no_job_is_begun() {
        let fails = |job| if job < 2 { Err(NoThread(io::Error::other("full"))) } else { Ok(Some(job)) };
        let (heard, whole) = outcomes(fails);
        assert!(!whole && heard.len() < 9, "{heard:?}");
    }
}
