//! The one place that maps outcomes to exit codes.

use crate::display;
use anyhow::Error;
use consumers::export::ExportError;
use schemas::recording::WriteError;
use schemas::whole_file::WholeFileError;
use std::process::ExitCode;

/// How a command ended that did not fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Done {
    /// Everything is as asked for.
    Whole,
    /// It finished, but something was lost.
    Lossy,
}

impl Done {
    /// [`Done::Whole`] or, if not, [`Done::Lossy`].
    pub(crate) fn whole_if(whole: bool) -> Self {
        if whole { Self::Whole } else { Self::Lossy }
    }
}

/// Why a command failed.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The user's input cannot be used: a flag, a configuration, a file.
    BadInput(Error),
    /// Anything else.
    Failed(Error),
}

impl<E: Into<Error>> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::Failed(error.into())
    }
}

/// Marks errors of the user's input.
pub(crate) trait BadInput<T> {
    /// An error becomes [`Failure::BadInput`].
    fn bad_input(self) -> Result<T, Failure>;
}

impl<T, E: Into<Error>> BadInput<T> for Result<T, E> {
    fn bad_input(self) -> Result<T, Failure> {
        self.map_err(|error| Failure::BadInput(error.into()))
    }
}

/// Prints a failure and gives the exit code.
pub(crate) fn exit(result: Result<Done, Failure>) -> ExitCode {
    match result {
        Ok(Done::Whole) => ExitCode::SUCCESS,
        Ok(Done::Lossy) => ExitCode::from(3),
        Err(Failure::Failed(error)) if is_broken_pipe(&error) => ExitCode::SUCCESS,
        Err(Failure::Failed(error)) => {
            display::notice(format_args!("{error:#}"));
            ExitCode::from(if is_in_the_way(&error) { 2 } else { 1 })
        }
        Err(Failure::BadInput(error)) => {
            display::notice(format_args!("{error:#}"));
            ExitCode::from(2)
        }
    }
}

/// Another name was to be chosen for an output, whichever command found that, and how late.
fn is_in_the_way(error: &Error) -> bool {
    error.chain().any(|cause| {
        cause.downcast_ref().is_some_and(WriteError::is_in_the_way)
            || cause.downcast_ref().is_some_and(WholeFileError::is_in_the_way)
            || cause.downcast_ref().is_some_and(ExportError::is_in_the_way)
    })
}

/// A reader that went away, as in `beadline presets | head -1`, is no failure.
fn is_broken_pipe(error: &Error) -> bool {
    let io = error.chain().find_map(|cause| cause.downcast_ref::<std::io::Error>());
    io.is_some_and(|error| error.kind() == std::io::ErrorKind::BrokenPipe)
}
