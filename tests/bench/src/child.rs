//! Processes of this program beside this one.

use anyhow::{Context as _, Error, anyhow};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use std::ffi::OsStr;
use std::fs;
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::Duration;

/// A process of this program; killed when dropped. What it says is read when it is asked for, so it must not say more than
/// a pipe holds before that.
pub(crate) struct Process {
    name: String,
    child: Child,
    out: BufReader<ChildStdout>,
}

impl Process {
    /// Starts this program with these words: `beadline` and those of the command, or `part` and its own.
    pub(crate) fn start<S: AsRef<OsStr>>(words: impl IntoIterator<Item = S>) -> Result<Self, Error> {
        let words: Vec<_> = words.into_iter().map(|word| word.as_ref().to_owned()).collect();
        let name = format!("`{}`", words.join(OsStr::new(" ")).display());
        let mut command = Command::new(std::env::current_exe().context("the bench cannot find itself")?);
        command.args(words).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().with_context(|| format!("{name} cannot be started"))?;
        let out = child.stdout.take().ok_or_else(|| anyhow!("{name}: no stdout"))?;
        Ok(Self { name, child, out: BufReader::new(out) })
    }

    /// The next line that it says.
    pub(super) fn line(&mut self) -> Result<String, Error> {
        let mut line = String::new();
        if self.out.read_line(&mut line)? == 0 {
            return Err(self.failed());
        }
        Ok(line.trim_end().to_owned())
    }

    /// Waits until it says `word`.
    pub(super) fn expect(&mut self, word: &str) -> Result<(), Error> {
        let line = self.line()?;
        if line == word { Ok(()) } else { Err(anyhow!("{}: said {line}, not {word}", self.name)) }
    }

    /// Tells it to go on.
    pub(super) fn go_on(&mut self) -> Result<(), Error> {
        let stdin = self.child.stdin.as_mut().ok_or_else(|| anyhow!("{}: no stdin", self.name))?;
        Ok(stdin.write_all(b"\n")?)
    }

    /// Waits for its end, and gives the rest of its output.
    pub(super) fn finish(mut self) -> Result<String, Error> {
        let mut text = String::new();
        self.out.read_to_string(&mut text)?;
        if self.child.wait()?.success() { Ok(text) } else { Err(self.failed()) }
    }

    /// The same as JSON.
    pub(crate) fn finish_json(self) -> Result<Value, Error> {
        let unexpected = format!("{} gave no summary", self.name);
        serde_json::from_str(&self.finish()?).context(unexpected)
    }

    /// Stops it without its doing, and waits until it stands still.
    pub(super) fn stall(&self) -> Result<(), Error> {
        self.signal(Signal::STOP)?;
        while self.read("stat")?.rsplit(')').next().is_none_or(|rest| !rest.starts_with(" T")) {
            std::thread::sleep(Duration::from_millis(1));
        }
        Ok(())
    }

    /// Lets it run again.
    pub(super) fn resume(&self) -> Result<(), Error> {
        self.signal(Signal::CONT)
    }

    /// Time that its threads have spent on a core.
    pub(super) fn busy(&self) -> Result<Duration, Error> {
        let mut busy_ns = 0;
        for thread in fs::read_dir(self.proc("task"))? {
            let text = fs::read_to_string(thread?.path().join("schedstat"))?;
            let field = text.split_whitespace().next().and_then(|field| field.parse::<u64>().ok());
            busy_ns += field.ok_or_else(|| anyhow!("/proc does not tell how busy a thread was: {text}"))?;
        }
        Ok(Duration::from_nanos(busy_ns))
    }

    /// The most memory that it has had so far, what it shares included (bytes); none when it has ended.
    pub(super) fn peak_bytes(&self) -> Option<u64> {
        let status = self.read("status").ok()?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
        Some(1024 * line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok()?)
    }

    fn signal(&self, signal: Signal) -> Result<(), Error> {
        Ok(kill_process(Pid::from_child(&self.child), signal)?)
    }

    fn read(&self, what: &str) -> Result<String, Error> {
        Ok(fs::read_to_string(self.proc(what))?)
    }

    fn proc(&self, what: &str) -> String {
        format!("/proc/{}/{what}", self.child.id())
    }

    /// Reason why it did not do what it should, in its own words.
    fn failed(&mut self) -> Error {
        let mut said = String::new();
        if let Some(mut stderr) = self.child.stderr.take() {
            // what cannot be read is not told
            let _ = stderr.read_to_string(&mut said);
        }
        let status = self.child.wait().map_or_else(|error| error.to_string(), |status| status.to_string());
        anyhow!("{} failed ({status}): {}", self.name, said.trim())
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // it may have ended by itself
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
