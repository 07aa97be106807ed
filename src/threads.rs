//! Threads for work that is done in parts: as many as asked for, as far as the system grants them.

use std::num::NonZero;
use std::sync::{Mutex, PoisonError};
use std::thread::{self, ScopedJoinHandle};

/// The number `asked` for, by default one for each core.
pub(crate) fn or_cores(asked: Option<NonZero<usize>>) -> NonZero<usize> {
    asked.unwrap_or_else(|| thread::available_parallelism().unwrap_or(NonZero::<usize>::MIN))
}

/// The results of `work` on each of `items`, in their order, `at_once` of them at a time.
pub(crate) fn each<T: Sync, R: Send>(items: &[T], at_once: usize, work: impl Fn(&T) -> R + Sync) -> Vec<R> {
    let next = Mutex::new(items.iter().enumerate());
    let take = || {
        let mut done = Vec::new();
        loop {
            let Some((place, item)) = next.lock().unwrap_or_else(PoisonError::into_inner).next() else {
                return done;
            };
            done.push((place, work(item)));
        }
    };
    let mut all: Vec<(usize, R)> = thread::scope(|scope| {
        // this thread works, too, and alone where the system grants no other
        let start = |_| thread::Builder::new().spawn_scoped(scope, take).ok();
        let workers: Vec<_> = (1..at_once.min(items.len())).map_while(start).collect();
        let mut all = take();
        let join = |worker: ScopedJoinHandle<'_, _>| {
            worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        all.extend(workers.into_iter().flat_map(join));
        all
    });
    all.sort_by_key(|(place, _)| *place);
    all.into_iter().map(|(_, result)| result).collect()
}
