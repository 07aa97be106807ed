//! Processes of this program beside this one.

use anyhow::{Context as _, Error, anyhow};
use serde_json::Value;
use std::ffi::OsString;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::OnceLock;

/// The words that start this program, where that is not the file that runs.
static PROGRAM: OnceLock<Vec<OsString>> = OnceLock::new();

/// Sets how this program is started, if not by the file that runs.
pub(crate) fn set_program(program: Option<Vec<OsString>>) {
    if let Some(program) = program {
        // a process is one program
        let _ = PROGRAM.set(program);
    }
}

/// The beginning of a command that starts this program.
pub(crate) fn this_program() -> Result<Command, Error> {
    let Some([program, words @ ..]) = PROGRAM.get().map(Vec::as_slice) else {
        return Ok(Command::new(std::env::current_exe().context("the program cannot find itself")?));
    };
    let mut command = Command::new(program);
    command.args(words);
    Ok(command)
}

/// A process of this program. Its output is read when it ends, so it must not say more than a pipe holds before that.
pub(crate) struct Process {
    name: String,
    child: Child,
}

impl Process {
    /// Starts this program with `words`; errors call it `name`.
    pub(crate) fn start(name: &str, words: &[OsString]) -> Result<Self, Error> {
        let mut command = this_program()?;
        command.args(words).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let child = command.spawn().with_context(|| format!("{name} cannot be started"))?;
        Ok(Self { name: name.to_owned(), child })
    }

    /// The status that it has ended with, if it has.
    pub(crate) fn ended(&mut self) -> Result<Option<ExitStatus>, Error> {
        Ok(self.child.try_wait()?)
    }

    /// Asks it to end, if it still runs.
    pub(crate) fn stop(&mut self) {
        if let Ok(None) = self.ended() {
            // it may have ended meanwhile
            let _ = system::end(&mut self.child);
        }
    }

    /// Waits for its end and reads its summary.
    pub(crate) fn finish_json(self) -> Result<Value, Error> {
        let Self { name, child } = self;
        let output = child.wait_with_output()?;
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr);
            return Err(anyhow!("{name} failed ({}): {}", output.status, said.trim()));
        }
        serde_json::from_slice(&output.stdout).with_context(|| format!("{name} gave no summary"))
    }
}
