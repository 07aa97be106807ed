//! Work that takes long, in threads of its own: each thing is computed once, however many ask for it, and for as long as one does.

use super::Served;
use std::any::Any;
use std::collections::HashMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use tokio::sync::{Notify, watch};

/// Most threads: one for each connection that may wait, so that no file waits for another.
const MAX_THREADS: usize = 64;

/// Computations under way, by their names.
#[derive(Default)]
pub(super) struct Works {
    current: Mutex<HashMap<String, Work>>,
    /// Some work has ended.
    ended: Notify,
}

struct Work {
    /// Set when nobody waits any more.
    stop: Arc<AtomicBool>,
    waiting: usize,
    answer: watch::Receiver<Served>,
}

/// One who waits; the last one who leaves stops the work.
struct Waiter {
    works: Arc<Works>,
    name: String,
    answer: watch::Receiver<Served>,
}

impl Works {
    fn lock(&self) -> MutexGuard<'_, HashMap<String, Work>> {
        self.current.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Result of `work`, which learns by a flag that nobody waits for it any more. The name says what it computes.
    pub(super) async fn answer(
        self: &Arc<Self>,
        name: &str,
        work: impl FnOnce(&Arc<AtomicBool>) -> Served + Clone + Send + 'static,
    ) -> Served {
        loop {
            let ended = self.ended.notified();
            let Some(mut waiter) = self.join(name, &work) else {
                // a thread of that name, or one of too many, is about to end
                ended.await;
                continue;
            };
            // the sender is gone without an answer where there is nothing of that name
            return waiter.answer.wait_for(Option::is_some).await.ok().and_then(|served| served.clone());
        }
    }

    /// Waits with those who wait for the same, or begins; none where a thread has to end first.
    fn join(
        self: &Arc<Self>,
        name: &str,
        work: &(impl FnOnce(&Arc<AtomicBool>) -> Served + Clone + Send + 'static),
    ) -> Option<Waiter> {
        let mut current = self.lock();
        let waiter = |answer| Waiter { works: Arc::clone(self), name: name.to_owned(), answer };
        if let Some(work) = current.get_mut(name) {
            let goes_on = !work.stop.load(Ordering::Relaxed);
            work.waiting += usize::from(goes_on);
            return goes_on.then(|| waiter(work.answer.clone()));
        }
        if current.len() >= MAX_THREADS {
            return None;
        }
        let (sender, answer) = watch::channel(None);
        let stop = Arc::new(AtomicBool::new(false));
        let (works, work, own, flag) = (Arc::clone(self), work.clone(), name.to_owned(), Arc::clone(&stop));
        let run = move || {
            let made = catch_unwind(AssertUnwindSafe(|| work(&flag)))
                .unwrap_or_else(|panic| Some(Err(defect(&*panic))));
            works.lock().remove(&own);
            sender.send_replace(made);
            works.ended.notify_waiters();
        };
        let started = thread::Builder::new().name(format!("view {name}")).spawn(run);
        if let Err(error) = started {
            let told = format!("the system grants no thread for this ({error}): try again later");
            return Some(waiter(watch::channel(Some(Err(told))).1));
        }
        current.insert(name.to_owned(), Work { stop, waiting: 1, answer: answer.clone() });
        Some(waiter(answer))
    }
}

impl Drop for Waiter {
    fn drop(&mut self) {
        let mut current = self.works.lock();
        let work = current.get_mut(&self.name).filter(|work| work.answer.same_channel(&self.answer));
        if let Some(work) = work {
            work.waiting -= 1;
            if work.waiting == 0 {
                work.stop.store(true, Ordering::Relaxed);
            }
        }
    }
}

/// A panic, in a sentence for the user.
fn defect(panic: &(dyn Any + Send)) -> String {
    let said = panic.downcast_ref::<String>().map(String::as_str);
    let said = said.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no reason was given");
    format!("this program went wrong ({said}): that is a defect of Beadline, please report it")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicUsize;
    use std::sync::mpsc;
    use std::time::Duration;
    use tokio::runtime::{Builder, Runtime};
    use tokio::time::timeout;

    fn runtime() -> Runtime {
        Builder::new_current_thread().enable_time().build().expect("a runtime")
    }

    /// Longer than anything here takes, unless it hangs.
    const WATCHDOG: Duration = Duration::from_mins(1);

    #[test]
    fn all_who_ask_for_the_same_get_one_computation_and_others_do_not_wait_for_it() {
        let works = Arc::new(Works::default());
        let begun = Arc::new(AtomicUsize::new(0));
        let (go_on, waits) = mpsc::channel::<()>();
        let waits = Arc::new(Mutex::new(waits));
        let count = Arc::clone(&begun);
        let long = move |_: &Arc<AtomicBool>| {
            count.fetch_add(1, Ordering::Relaxed);
            let _ = waits.lock().expect("one thread").recv_timeout(WATCHDOG);
            Some(Ok("long".to_owned()))
        };
        runtime().block_on(async {
            let (one, other) = (works.answer("long", long.clone()), works.answer("long", long));
            let short = async {
                for _ in 0..3 {
                    assert_eq!(
                        works.answer("short", |_| Some(Ok("s".to_owned()))).await,
                        Some(Ok("s".to_owned()))
                    );
                }
                go_on.send(()).expect("it waits");
            };
            let (one, other, ()) = tokio::join!(one, other, short);
            assert_eq!((one, other), (Some(Ok("long".to_owned())), Some(Ok("long".to_owned()))));
            assert_eq!(works.answer("nothing", |_| None).await, None);
            let defect = works.answer("defect", |_| panic!("at 7")).await;
            assert!(defect.is_some_and(|told| {
                told.is_err_and(|told| told.contains("at 7") && told.contains("report"))
            }));
        });
        assert_eq!(begun.load(Ordering::Relaxed), 1);
    }

    #[test]
    fn work_that_all_have_left_is_stopped_and_begins_anew_for_the_next() {
        let works = Arc::new(Works::default());
        let (tell, told) = mpsc::channel();
        let long = move |stop: &Arc<AtomicBool>| {
            while !stop.load(Ordering::Relaxed) {
                thread::yield_now();
            }
            tell.send(()).expect("somebody listens");
            None
        };
        runtime().block_on(async {
            let soon = Duration::from_millis(1);
            let stays = works.answer("long", long.clone());
            let mut stays = Box::pin(stays);
            assert!(timeout(soon, &mut stays).await.is_err());
            assert!(timeout(soon, works.answer("long", long)).await.is_err());
            assert!(told.try_recv().is_err(), "one stays");
            drop(stays);
            told.recv_timeout(WATCHDOG).expect("stopped");
            assert_eq!(
                works.answer("long", |_| Some(Ok("anew".to_owned()))).await,
                Some(Ok("anew".to_owned()))
            );
        });
    }
}
