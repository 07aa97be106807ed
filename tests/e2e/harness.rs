//! Directories, buses and processes for tests.

use bus::{Bus, RunInfo, list_runs};
use serde_json::Value;
use std::ffi::OsStr;
use std::fs;
use std::io::{Read, Write};
use std::os::unix::process::ExitStatusExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Output, Stdio};
use std::time::{Duration, Instant};

/// Nothing here takes this long unless it hangs.
const WATCHDOG: Duration = Duration::from_mins(2);

/// Nothing that is asked to answer or to end takes this long, even on a busy machine, unless it waits for somebody who is silent:
/// such waits are of 10 s and more.
pub(crate) const SILENCE: Duration = Duration::from_secs(8);

/// A directory for files and a bus that no other test sees.
pub(crate) struct Place {
    dir: tempfile::TempDir,
    root: PathBuf,
}

impl Place {
    pub(crate) fn new() -> Self {
        let dir = tempfile::Builder::new().prefix("bl").tempdir_in("/tmp").unwrap();
        let root = dir.path().join("bus");
        Self { dir, root }
    }

    /// A file in the directory.
    pub(crate) fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.dir.path().join(name)
    }

    pub(crate) fn read(&self, name: &str) -> String {
        fs::read_to_string(self.path(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
    }

    pub(crate) fn write(&self, name: &str, text: &str) -> PathBuf {
        fs::write(self.path(name), text).unwrap();
        self.path(name)
    }

    pub(crate) fn bus(&self) -> Bus {
        Bus::at(&self.root).unwrap()
    }

    /// `beadline ARGUMENTS` in this directory and on this bus.
    pub(crate) fn command<S: AsRef<OsStr>>(&self, arguments: impl IntoIterator<Item = S>) -> Command {
        self.foreign(env!("CARGO_BIN_EXE_beadline"), arguments)
    }

    /// Another program in this directory and on this bus.
    pub(crate) fn foreign<S: AsRef<OsStr>>(
        &self,
        program: impl AsRef<OsStr>,
        arguments: impl IntoIterator<Item = S>,
    ) -> Command {
        let mut command = Command::new(program);
        command.args(arguments).current_dir(self.dir.path()).env("BEADLINE_ROOT", &self.root);
        command
    }

    /// Runs `beadline` with these words to its end.
    pub(crate) fn run(&self, words: &str) -> Ended {
        self.start(words).wait()
    }

    /// Starts `beadline` with these words.
    pub(crate) fn start(&self, words: &str) -> Running {
        Running::start(words, self.command(words.split_whitespace()))
    }

    /// Waits until a run of that name shows `condition`.
    pub(crate) fn wait_for_run(&self, name: &str, mut condition: impl FnMut(&RunInfo) -> bool) -> RunInfo {
        let bus = self.bus();
        wait_until(&format!("run {name}"), || {
            let runs = list_runs(&bus).unwrap();
            runs.into_iter().find(|run| run.name.as_str() == name && condition(run))
        })
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        // what iceoryx2 keeps for a root outlives it otherwise
        let Ok(bus) = Bus::at(&self.root) else { return };
        for entry in fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().starts_with(bus.prefix()) {
                let _ = fs::remove_file(entry.path());
            }
        }
    }
}

/// Polls `look` until it gives something.
pub(crate) fn wait_until<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(start.elapsed() < WATCHDOG, "{what}: waited in vain");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// A `beadline` process; killed when dropped.
pub(crate) struct Running {
    words: String,
    child: Option<Child>,
}

impl Running {
    pub(crate) fn start(words: &str, command: Command) -> Self {
        Self::start_with(words, command, Stdio::null())
    }

    /// Starts a command with something on its stdin.
    pub(crate) fn start_with(words: &str, mut command: Command, stdin: Stdio) -> Self {
        command.stdin(stdin).stdout(Stdio::piped()).stderr(Stdio::piped());
        let child = command.spawn().unwrap_or_else(|error| panic!("{words}: {error}"));
        Self { words: words.to_owned(), child: Some(child) }
    }

    /// A process that somebody else has started.
    pub(crate) fn of(words: &str, child: Child) -> Self {
        Self { words: words.to_owned(), child: Some(child) }
    }

    /// Its number.
    pub(crate) fn id(&self) -> u32 {
        self.child.as_ref().unwrap().id()
    }

    /// Sends a signal, named as `kill` names it.
    pub(crate) fn signal(&self, signal: &str) {
        let pid = self.id().to_string();
        assert!(Command::new("kill").args([format!("-{signal}"), pid]).status().unwrap().success());
    }

    /// Its stdin, if that is a pipe that nobody has taken.
    pub(crate) fn stdin(&mut self) -> ChildStdin {
        self.child.as_mut().unwrap().stdin.take().unwrap()
    }

    /// The next line on its stdout.
    pub(crate) fn line(&mut self) -> String {
        let stdout = self.child.as_mut().unwrap().stdout.as_mut().unwrap();
        let (mut line, mut byte) = (Vec::new(), [0]);
        while stdout.read(&mut byte).unwrap() == 1 && byte != *b"\n" {
            line.push(byte[0]);
        }
        String::from_utf8(line).unwrap()
    }

    /// Waits until it has said this on stderr, of which the rest of the line is lost.
    pub(crate) fn wait_until_it_says(&mut self, words: &str) {
        let stderr = self.child.as_mut().unwrap().stderr.as_mut().unwrap();
        let (mut said, mut byte) = (Vec::new(), [0]);
        while !said.ends_with(words.as_bytes()) && stderr.read(&mut byte).unwrap() == 1 {
            said.push(byte[0]);
        }
    }

    /// Whether it still runs.
    pub(crate) fn is_running(&mut self) -> bool {
        self.child.as_mut().unwrap().try_wait().unwrap().is_none()
    }

    /// Waits for its end, and tells the most memory (kB) that it had.
    pub(crate) fn wait_for_peak(mut self) -> (Ended, u64) {
        let status = format!("/proc/{}/status", self.id());
        let mut peak = None;
        while self.is_running() {
            let text = fs::read_to_string(&status).unwrap_or_default();
            let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
            let found = line.and_then(|line| line.trim().trim_end_matches(" kB").parse().ok());
            // a later mark is never lower; the first may be of this process, whose memory a child has until it is
            // its own program
            peak = found.or(peak);
            std::thread::sleep(Duration::from_millis(2));
        }
        (self.wait(), peak.unwrap())
    }

    pub(crate) fn wait(mut self) -> Ended {
        let output = self.child.take().unwrap().wait_with_output().unwrap();
        Ended { words: std::mem::take(&mut self.words), output }
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if let Some(child) = &mut self.child {
            let _ = child.kill();
            let _ = child.wait();
        }
    }
}

/// What a process left.
pub(crate) struct Ended {
    words: String,
    output: Output,
}

impl Ended {
    pub(crate) fn stdout(&self) -> String {
        String::from_utf8_lossy(&self.output.stdout).into_owned()
    }

    pub(crate) fn stderr(&self) -> String {
        String::from_utf8_lossy(&self.output.stderr).into_owned()
    }

    /// The exit code; none if a signal ended it.
    pub(crate) fn code(&self) -> Option<i32> {
        self.output.status.code()
    }

    /// The signal that ended it, if one did.
    pub(crate) fn killed_by(&self) -> Option<i32> {
        self.output.status.signal()
    }

    /// Asserts the exit code.
    #[track_caller]
    pub(crate) fn exits(self, code: i32) -> Self {
        let found = self.output.status;
        assert_eq!(found.code(), Some(code), "{}\n{found}\n{}{}", self.words, self.stdout(), self.stderr());
        self
    }

    /// Asserts that each of `words` stands in what was said on stderr.
    #[track_caller]
    pub(crate) fn says(self, words: &[&str]) -> Self {
        let stderr = self.stderr();
        for word in words {
            assert!(stderr.contains(word), "{}: `{word}` is not in:\n{stderr}", self.words);
        }
        self
    }

    /// The JSON on stdout.
    #[track_caller]
    pub(crate) fn json(&self) -> Value {
        let stdout = self.stdout();
        serde_json::from_str(&stdout)
            .unwrap_or_else(|error| panic!("{}: {error}\n{stdout}{}", self.words, self.stderr()))
    }
}

/// Says that a test did nothing, in the form that CI looks for.
pub(crate) fn skip(why: &str) {
    // not `eprintln!`, which the test harness hides unless the test fails
    let said = std::io::stderr().write_all(format!("\nSKIPPED: {why}\n").as_bytes());
    said.unwrap();
}

/// The Python of `tests/setup`, or none.
pub(crate) fn python() -> Option<PathBuf> {
    let found = std::env::var_os("BEADLINE_CHECK_PYTHON")
        .map(PathBuf::from)
        .and_then(|path| path.canonicalize().ok());
    if found.is_none() {
        skip(
            "set BEADLINE_CHECK_PYTHON to the Python that `tests/setup` makes to check with Python's readers",
        );
    }
    // the link itself names the environment, its target does not
    found.and(
        std::env::var_os("BEADLINE_CHECK_PYTHON")
            .map(|path| std::path::absolute(PathBuf::from(path)).unwrap()),
    )
}

/// The Python of `tests/setup` that has the package `beadline`, or none.
pub(crate) fn package_python() -> Option<PathBuf> {
    let package = python()?.parent()?.parent()?.join("package/bin/python");
    if !package.exists() {
        skip(
            "the package `beadline` is not installed beside BEADLINE_CHECK_PYTHON, as `tests/setup` does it",
        );
        return None;
    }
    Some(package)
}

/// The directory of the ffmpeg of `tests/setup`, or none.
pub(crate) fn ffmpeg_directory() -> Option<PathBuf> {
    let directory = python()?.parent()?.to_owned();
    if !directory.join("ffmpeg").exists() {
        skip("there is no ffmpeg beside BEADLINE_CHECK_PYTHON, as `tests/setup` puts it there");
        return None;
    }
    Some(directory)
}

/// The Node.js of `tests/setup`, or none.
pub(crate) fn node() -> Option<PathBuf> {
    python().map(|python| python.with_file_name("node"))
}
