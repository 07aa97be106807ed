//! The built command, run on a file that may be anything.

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::process::{Pid, PidfdFlags, pidfd_open};
use std::fs::{self, File};
use std::io;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// Address space that a process may have. Its memory is far smaller; threads reserve what they do not use.
const MEMORY_BYTES: u64 = 1 << 30;

/// Processor time that a process may take.
const PROCESSOR_S: u64 = 10;

/// Time after which a process hangs, whatever it does.
const HANGS_AFTER_S: i64 = 120;

/// The command, and a place for what it says and writes.
#[derive(Debug)]
pub struct Trial {
    program: PathBuf,
    directory: PathBuf,
}

/// How a process ended that did what it may: its exit code, 0 to 3.
pub type Exit = usize;

impl Trial {
    /// Runs `program` in `directory`, which nothing else uses.
    pub fn new(program: &Path, directory: &Path) -> Self {
        Self { program: program.to_owned(), directory: directory.to_owned() }
    }

    /// Runs `beadline COMMAND FILE`; further words of `command` come after the file, and what they name is in the
    /// trial's directory.
    ///
    /// # Errors
    /// When it panicked, was ended by a signal (a crash, too much memory, a hang), or has an exit code that is none
    /// of ours; with what it said.
    pub fn run(&self, command: &str, file: &Path) -> Result<Exit, String> {
        self.try_run(command, file).unwrap_or_else(|error| Err(format!("cannot be run: {error}")))
    }

    fn try_run(&self, command: &str, file: &Path) -> io::Result<Result<Exit, String>> {
        let said = self.directory.join("stderr");
        let limits = format!("ulimit -c 0; ulimit -v {}; ulimit -t {PROCESSOR_S}", MEMORY_BYTES >> 10);
        let mut process = Command::new("sh");
        process.args(["-c", &format!("{limits}; exec \"$@\""), "sh"]);
        let mut words = command.split_whitespace();
        process.arg(&self.program).args(words.next()).arg(file).args(words);
        process.current_dir(&self.directory).env("BEADLINE_ROOT", self.directory.join("bus"));
        process.stdin(Stdio::null()).stdout(Stdio::null()).stderr(File::create(&said)?);
        let mut child = process.spawn()?;
        let in_time = wait(&child)?;
        if !in_time {
            child.kill()?;
        }
        let status = child.wait()?;
        let text = String::from_utf8_lossy(&fs::read(&said)?).into_owned();
        let code = status.code().and_then(|code| usize::try_from(code).ok()).filter(|code| *code <= 3);
        Ok(match code {
            _ if !in_time => Err(format!("hung for {HANGS_AFTER_S} s\n{text}")),
            Some(code) if !text.contains("panicked") => Ok(code),
            _ => {
                let signal = status.signal().map_or(String::new(), |signal| format!(", signal {signal}"));
                Err(format!("{status}{signal}\n{text}"))
            }
        })
    }
}

/// Whether the process ends in time.
fn wait(child: &Child) -> io::Result<bool> {
    let process = pidfd_open(Pid::from_child(child), PidfdFlags::empty())?;
    let timeout = Timespec { tv_sec: HANGS_AFTER_S, tv_nsec: 0 };
    loop {
        match poll(&mut [PollFd::new(&process, PollFlags::IN)], Some(&timeout)) {
            Ok(ready) => return Ok(ready > 0),
            Err(rustix::io::Errno::INTR) => {}
            Err(error) => return Err(error.into()),
        }
    }
}
