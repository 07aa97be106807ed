//! Keys pressed on the terminal while a run or a replay goes on.
//!
//! The terminal hands out each key at once and shows none of them until the [`Keyboard`] is dropped. The terminal is
//! restored on every way out: a return, a panic, a signal that ends or suspends the process.

use crate::signals;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::{Errno, read};
use rustix::process::getpgrp;
use rustix::termios::{
    LocalModes, OptionalActions, SpecialCodeIndex, Termios, tcgetattr, tcgetpgrp, tcsetattr,
};
use signal_hook::consts::{SIGINT, SIGQUIT, SIGTERM, SIGTSTP};
use signal_hook::low_level::{emulate_default_handler, pipe};
use std::io::{self, IsTerminal as _, Read as _};
use std::os::unix::net::UnixStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// How often a process in the background looks whether the terminal is its own again.
const BACKGROUND_POLL: Timespec = Timespec { tv_sec: 0, tv_nsec: 200_000_000 };

/// What a person wants.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Key {
    /// Pause or go on.
    Pause,
    /// One more frame.
    Step,
    /// Twice the rate.
    Faster,
    /// Half the rate.
    Slower,
    /// To another place; means something where frames are there already.
    Seek(Seek),
    /// The end.
    Quit,
}

/// Where to go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Seek {
    /// The frame before the last one, and a pause there.
    FrameBack,
    /// A twentieth of the whole back.
    Back,
    /// A twentieth of the whole on.
    On,
    /// The first frame.
    Home,
}

/// The keys of a terminal, from a thread that waits for them.
pub(crate) struct Keyboard {
    keys: Receiver<Key>,
    terminal: Arc<Terminal>,
    /// Closed to end the thread.
    end: Option<UnixStream>,
    thread: Option<JoinHandle<()>>,
}

impl Keyboard {
    /// Takes the keys of the terminal on stdin, and the signals that would leave it unrestored. None
    /// if stdin or stderr is no terminal, or if it belongs to another process at the moment.
    ///
    /// `stop` is set by the first SIGINT or SIGTERM, by SIGHUP and by the key that ends; a second signal ends at once.
    pub(crate) fn open() -> io::Result<(Option<Self>, Arc<AtomicBool>)> {
        let terminal = if io::stdin().is_terminal() && io::stderr().is_terminal() && is_ours() {
            Terminal::of_stdin()
        } else {
            None
        };
        let Some(terminal) = terminal.map(Arc::new) else { return Ok((None, signals::stop_flag()?)) };
        let stop = signals::patient_stop_flag()?;
        let (sender, keys) = channel();
        let (end, ended) = UnixStream::pair()?;
        let watch = Listener {
            ended,
            stopping: Signals::of(&[SIGINT, SIGTERM])?,
            suspending: Signals::of(&[SIGTSTP])?,
            killing: [SIGQUIT]
                .map(|signal| Ok((signal, Signals::of(&[signal])?)))
                .into_iter()
                .collect::<io::Result<_>>()?,
            terminal: Arc::clone(&terminal),
            stop: Arc::clone(&stop),
            sender,
        };
        terminal.take();
        let thread = thread::Builder::new().name("keys".into()).spawn(move || watch.run())?;
        Ok((Some(Self { keys, terminal, end: Some(end), thread: Some(thread) }), stop))
    }

    /// The next key, waiting at most this long.
    pub(crate) fn wait(&self, at_most: Duration) -> Option<Key> {
        self.keys
            .recv_timeout(at_most)
            .inspect_err(|error| {
                // the thread has ended; wait all the same
                if *error == RecvTimeoutError::Disconnected {
                    thread::sleep(at_most);
                }
            })
            .ok()
    }

    /// The next key that was pressed already.
    pub(crate) fn try_next(&self) -> Option<Key> {
        self.keys.try_recv().ok()
    }
}

impl Drop for Keyboard {
    fn drop(&mut self) {
        self.end = None;
        if let Some(thread) = self.thread.take() {
            // it has no result, and the terminal is given back in any case
            let _ = thread.join();
        }
        self.terminal.give_back();
    }
}

/// Whether the terminal on stdin answers to us: another process in its foreground may not be disturbed.
fn is_ours() -> bool {
    // a terminal that does not control us needs no check
    tcgetpgrp(io::stdin()).map_or(true, |foreground| foreground == getpgrp())
}

/// The terminal on stdin, in one of two modes.
struct Terminal {
    found: Termios,
    keys: Termios,
    taken: AtomicBool,
}

impl Terminal {
    fn of_stdin() -> Option<Self> {
        let found = tcgetattr(io::stdin()).ok()?;
        let mut keys = found.clone();
        keys.local_modes -= LocalModes::ICANON | LocalModes::ECHO;
        keys.special_codes[SpecialCodeIndex::VMIN] = 1;
        keys.special_codes[SpecialCodeIndex::VTIME] = 0;
        Some(Self { found, keys, taken: AtomicBool::new(false) })
    }

    /// Makes it hand out each key at once, if it is ours.
    fn take(&self) -> bool {
        let taken = is_ours() && tcsetattr(io::stdin(), OptionalActions::Now, &self.keys).is_ok();
        self.taken.store(taken, Ordering::SeqCst);
        taken
    }

    /// Restores it. In the background the shell does that.
    fn give_back(&self) {
        if self.taken.swap(false, Ordering::SeqCst) && is_ours() {
            // keys that were pressed for us are not left to the shell
            let _ = tcsetattr(io::stdin(), OptionalActions::Flush, &self.found);
        }
    }
}

/// Signals that can be waited for together with keys: one byte for each.
struct Signals(UnixStream);

impl Signals {
    fn of(signals: &[i32]) -> io::Result<Self> {
        let (came, coming) = UnixStream::pair()?;
        came.set_nonblocking(true)?;
        for signal in signals {
            pipe::register(*signal, coming.try_clone()?)?;
        }
        Ok(Self(came))
    }

    /// How many came since the last call.
    fn take(&self) -> usize {
        (&self.0).read(&mut [0; 16]).unwrap_or(0)
    }
}

/// What the thread watches.
struct Listener {
    ended: UnixStream,
    stopping: Signals,
    suspending: Signals,
    killing: Vec<(i32, Signals)>,
    terminal: Arc<Terminal>,
    stop: Arc<AtomicBool>,
    sender: Sender<Key>,
}

impl Listener {
    fn run(self) {
        let (mut stops, mut listening) = (0, true);
        loop {
            let ours = self.terminal.taken.load(Ordering::SeqCst) || self.terminal.take();
            let stdin = io::stdin();
            let mut watched = vec![PollFd::new(&self.ended, PollFlags::IN)];
            let signals =
                [&self.stopping, &self.suspending].into_iter().chain(self.killing.iter().map(|(_, s)| s));
            watched.extend(signals.map(|signals| PollFd::new(&signals.0, PollFlags::IN)));
            if ours && listening {
                watched.push(PollFd::new(&stdin, PollFlags::IN));
            }
            let polled = poll(&mut watched, (!ours).then_some(&BACKGROUND_POLL));
            if polled.is_err_and(|error| error != Errno::INTR) || !watched[0].revents().is_empty() {
                return;
            }
            let pressed =
                ours && listening && watched.last().is_some_and(|stdin| !stdin.revents().is_empty());
            stops += self.stopping.take();
            if stops > 1 {
                self.terminal.give_back();
                signals::end_at_once();
            }
            self.obey_signals();
            if pressed {
                listening = self.read_keys();
            }
        }
    }

    fn obey_signals(&self) {
        for (signal, signals) in &self.killing {
            if signals.take() > 0 {
                self.terminal.give_back();
                let _ = emulate_default_handler(*signal);
            }
        }
        if self.suspending.take() > 0 {
            self.terminal.give_back();
            let _ = emulate_default_handler(SIGTSTP);
        }
    }

    /// Whether there may be more keys later.
    fn read_keys(&self) -> bool {
        if !is_ours() {
            // somebody else has the terminal now, and with it the keys
            self.terminal.taken.store(false, Ordering::SeqCst);
            return true;
        }
        let mut bytes = [0; 64];
        match read(io::stdin(), &mut bytes) {
            Ok(0) => false,
            Ok(count) => {
                for key in keys_in(&bytes[..count]) {
                    if key == Key::Quit {
                        self.stop.store(true, Ordering::Relaxed);
                    }
                    // whoever no longer listens is about to end
                    let _ = self.sender.send(key);
                }
                true
            }
            Err(Errno::INTR | Errno::AGAIN) => true,
            Err(_) => false,
        }
    }
}

/// The keys that these bytes of a terminal mean.
fn keys_in(mut bytes: &[u8]) -> Vec<Key> {
    let mut keys = Vec::new();
    while let [first, rest @ ..] = bytes {
        bytes = rest;
        let key = match first {
            b' ' => Some(Key::Pause),
            b'.' => Some(Key::Step),
            b'+' | b'=' => Some(Key::Faster),
            b'-' => Some(Key::Slower),
            b'[' => Some(Key::Seek(Seek::Back)),
            b']' => Some(Key::Seek(Seek::On)),
            b'q' | b'Q' => Some(Key::Quit),
            // what follows ESC [ or ESC O is a key by its numbers and its last byte
            0x1b => match bytes {
                [b'[' | b'O', rest @ ..] => {
                    let length = rest.iter().position(|byte| (0x40..=0x7e).contains(byte));
                    let length = length.unwrap_or(rest.len());
                    bytes = rest.get(length + 1..).unwrap_or_default();
                    rest.get(length).and_then(|last| special_key(&rest[..length], *last))
                }
                _ => None,
            },
            _ => None,
        };
        keys.extend(key);
    }
    keys
}

/// The key of a sequence with these numbers and this last byte; terminals have several for Home.
fn special_key(numbers: &[u8], last: u8) -> Option<Key> {
    match (numbers, last) {
        (_, b'C') => Some(Key::Step),
        (_, b'D') => Some(Key::Seek(Seek::FrameBack)),
        (_, b'H') | (b"1" | b"7", b'~') => Some(Key::Seek(Seek::Home)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_known_by_their_bytes() {
        use Key::{Faster, Pause, Quit, Slower, Step};
        assert_eq!(keys_in(b" .+=-q"), [Pause, Step, Faster, Faster, Slower, Quit]);
        assert_eq!(keys_in(b"\x1b[C\x1bOC\x1b[1;5C"), [Step, Step, Step], "arrows to the right");
        assert_eq!(keys_in(b"\x1b[A\x1b[3~x\x1b \x1b["), [Pause], "other keys mean nothing");
        let back = [Seek::FrameBack, Seek::Back, Seek::On, Seek::Home, Seek::Home, Seek::Home];
        assert_eq!(keys_in(b"\x1b[D[]\x1b[H\x1bOH\x1b[1~"), back.map(Key::Seek));
    }
}
