//! The terminal of a Unix system, its keys and the signals that would leave it unrestored.

use super::{Key, Meaning};
use crate::signals;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::{Errno, read};
use rustix::process::getpgrp;
use rustix::termios::{
    InputModes, LocalModes, OptionalActions, SpecialCodeIndex, Termios, tcgetattr, tcgetpgrp, tcsetattr,
};
use signal_hook::consts::{
    SIGABRT, SIGALRM, SIGINT, SIGIO, SIGPROF, SIGQUIT, SIGSYS, SIGTERM, SIGTRAP, SIGTSTP, SIGUSR1, SIGUSR2,
    SIGVTALRM, SIGXCPU, SIGXFSZ,
};
use signal_hook::low_level::{emulate_default_handler, pipe};
use std::io::{self, IsTerminal as _, Read as _, Write as _};
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// Interval at which a process in the background checks if the terminal is its own again.
const BACKGROUND_POLL: Timespec = Timespec { tv_sec: 0, tv_nsec: 200_000_000 };

/// Longest time for which the rest of a key may be under way.
const REST_OF_A_KEY: Timespec = Timespec { tv_sec: 0, tv_nsec: 50_000_000 };

/// Signals that end a process by default, and that nobody handles.
const KILLING: [i32; 12] = [
    SIGQUIT, SIGABRT, SIGALRM, SIGIO, SIGPROF, SIGSYS, SIGTRAP, SIGUSR1, SIGUSR2, SIGVTALRM, SIGXCPU, SIGXFSZ,
];

/// Bytes that begin a screen: the other screen of the terminal, no cursor, and a question for its background.
const BEGIN_SCREEN: &[u8] = b"\x1b[?1049h\x1b[?25l\x1b]11;?\x1b\\\x1b[2J";
/// Bytes that end a screen.
const END_SCREEN: &[u8] = b"\x1b[0m\x1b[?25h\x1b[?1049l";

/// The keys of a terminal, from a thread that waits for them.
pub(crate) struct Keyboard<K = Key> {
    keys: Receiver<K>,
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
        let is_terminal = io::stdin().is_terminal() && io::stderr().is_terminal() && is_ours();
        let terminal = if is_terminal { Terminal::of_stdin(false) } else { None };
        let Some(terminal) = terminal else { return Ok((None, signals::stop_flag()?)) };
        let (keyboard, stop) = Self::take(terminal)?;
        Ok((Some(keyboard), stop))
    }
}

impl<K: Meaning> Keyboard<K> {
    /// Takes the terminal on stdin and stdout for a screen; none if they are no terminal. While it belongs to another
    /// process, nothing is written on it.
    pub(crate) fn with_screen() -> io::Result<Option<(Self, Arc<AtomicBool>)>> {
        let is_terminal = io::stdin().is_terminal() && io::stdout().is_terminal();
        let terminal = if is_terminal { Terminal::of_stdin(true) } else { None };
        terminal.map(Self::take).transpose()
    }

    fn take(terminal: Terminal) -> io::Result<(Self, Arc<AtomicBool>)> {
        let terminal = Arc::new(terminal);
        let stop = signals::patient_stop_flag()?;
        let (sender, keys) = channel();
        let (end, ended) = UnixStream::pair()?;
        let killing = if terminal.has_screen { KILLING.as_slice() } else { &KILLING[..1] };
        let watch = Listener {
            ended,
            stopping: Signals::of(&[SIGINT, SIGTERM])?,
            suspending: Signals::of(&[SIGTSTP])?,
            killing: killing
                .iter()
                .map(|signal| Ok((*signal, Signals::of(&[*signal])?)))
                .collect::<io::Result<_>>()?,
            terminal: Arc::clone(&terminal),
            stop: Arc::clone(&stop),
            sender,
        };
        terminal.take();
        let thread = thread::Builder::new().name("keys".into()).spawn(move || watch.run())?;
        Ok((Self { keys, terminal, end: Some(end), thread: Some(thread) }, stop))
    }

    /// The terminal that the screen is written on.
    pub(crate) fn terminal(&self) -> Arc<Terminal> {
        Arc::clone(&self.terminal)
    }

    /// The next key, waiting at most this long.
    pub(crate) fn wait(&self, at_most: Duration) -> Option<K> {
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
    pub(crate) fn try_next(&self) -> Option<K> {
        self.keys.try_recv().ok()
    }
}

impl<K> Drop for Keyboard<K> {
    fn drop(&mut self) {
        self.end = None;
        if let Some(thread) = self.thread.take() {
            // it has no result, and the terminal is given back in any case
            let _ = thread.join();
        }
        self.terminal.give_back();
    }
}

/// True if the terminal on stdin answers to this process: it must not disturb another process in the foreground.
fn is_ours() -> bool {
    // a terminal that does not control us needs no check
    tcgetpgrp(io::stdin()).map_or(true, |foreground| foreground == getpgrp())
}

/// The terminal on stdin, in one of two modes.
pub(crate) struct Terminal {
    found: Termios,
    keys: Termios,
    has_screen: bool,
    /// Held while something is written on the screen.
    writing: Mutex<()>,
    taken: AtomicBool,
    times_taken: AtomicU32,
    closed: AtomicBool,
}

impl Terminal {
    fn of_stdin(has_screen: bool) -> Option<Self> {
        let found = tcgetattr(io::stdin()).ok()?;
        let mut keys = found.clone();
        keys.local_modes -= LocalModes::ICANON | LocalModes::ECHO;
        keys.special_codes[SpecialCodeIndex::VMIN] = 1;
        keys.special_codes[SpecialCodeIndex::VTIME] = 0;
        if has_screen {
            // Ctrl-S would hold up whoever writes, also what restores the terminal
            keys.input_modes -= InputModes::IXON;
        }
        Some(Self {
            found,
            keys,
            has_screen,
            writing: Mutex::default(),
            taken: AtomicBool::new(false),
            times_taken: AtomicU32::new(0),
            closed: AtomicBool::new(false),
        })
    }

    /// Makes it hand out each key at once, if it is ours.
    fn take(&self) -> bool {
        let _writing = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        let taken = !self.closed.load(Ordering::SeqCst)
            && is_ours()
            && tcsetattr(io::stdin(), OptionalActions::Now, &self.keys).is_ok();
        if taken && self.has_screen {
            put(BEGIN_SCREEN);
        }
        self.taken.store(taken, Ordering::SeqCst);
        self.times_taken.fetch_add(u32::from(taken), Ordering::SeqCst);
        taken
    }

    /// Number of times that this process took the terminal; the screen is empty after each.
    pub(crate) fn times_taken(&self) -> u32 {
        self.times_taken.load(Ordering::SeqCst)
    }

    /// Writes on the screen, if that is ours.
    pub(crate) fn write(&self, bytes: &[u8]) {
        let _writing = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        if self.taken.load(Ordering::SeqCst) {
            put(bytes);
        }
    }

    /// Restores it. In the background the shell does that.
    fn give_back(&self) {
        let writing = self.before_long();
        if self.taken.swap(false, Ordering::SeqCst) && is_ours() {
            if self.has_screen && writing.is_some() {
                put(END_SCREEN);
            }
            // keys that were pressed for us are not left to the shell; flushing waits for whoever reads the terminal
            let how = if writing.is_some() { OptionalActions::Flush } else { OptionalActions::Now };
            let _ = tcsetattr(io::stdin(), how, &self.found);
        }
    }

    /// The right to write; none where the writer is held up, because nobody reads the terminal.
    fn before_long(&self) -> Option<MutexGuard<'_, ()>> {
        for _ in 0..20 {
            match self.writing.try_lock() {
                Ok(writing) => return Some(writing),
                Err(TryLockError::Poisoned(writing)) => return Some(writing.into_inner()),
                Err(TryLockError::WouldBlock) => thread::sleep(Duration::from_millis(10)),
            }
        }
        None
    }

    /// True if the terminal was restored for good.
    pub(crate) fn is_closed(&self) -> bool {
        self.closed.load(Ordering::SeqCst)
    }

    /// Restores it for good.
    pub(crate) fn close(&self) {
        self.closed.store(true, Ordering::SeqCst);
        self.give_back();
    }
}

/// Writes on the terminal at once. One that is gone needs nothing.
fn put(bytes: &[u8]) {
    let mut out = io::stdout();
    let _ = out.write_all(bytes).and_then(|()| out.flush());
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

    /// Number of signals since the last call.
    fn take(&self) -> usize {
        (&self.0).read(&mut [0; 16]).unwrap_or(0)
    }
}

/// State of the thread that watches signals and keys.
struct Listener<K> {
    ended: UnixStream,
    stopping: Signals,
    suspending: Signals,
    killing: Vec<(i32, Signals)>,
    terminal: Arc<Terminal>,
    stop: Arc<AtomicBool>,
    sender: Sender<K>,
}

impl<K: Meaning> Listener<K> {
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
                if self.terminal.has_screen {
                    // nothing is left behind, and to say so might wait for whoever reads the terminal
                    signal_hook::low_level::exit(1);
                }
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

    /// Reads keys and sends them. True if there may be more keys later.
    fn read_keys(&self) -> bool {
        if !is_ours() {
            // somebody else has the terminal now, and with it the keys
            self.terminal.taken.store(false, Ordering::SeqCst);
            return true;
        }
        let mut bytes = [0; 64];
        match read(io::stdin(), &mut bytes) {
            Ok(0) => false,
            Ok(mut count) => {
                let stdin = io::stdin();
                let mut more = [PollFd::new(&stdin, PollFlags::IN)];
                // the first byte of a key is a key by itself, unless the others follow
                if bytes[count - 1] == 0x1b && poll(&mut more, Some(&REST_OF_A_KEY)) == Ok(1) {
                    count += read(&stdin, &mut bytes[count..]).unwrap_or(0);
                }
                for key in K::of(&bytes[..count]) {
                    if key.is_end() {
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
