//! The one place that maps outcomes to exit codes.

use crate::display;
use crate::limits;
use anyhow::Error;
use bus::{AttachError, BusError, PublishError, ResultsError, RootError};
use exports::ExportError;
use producer::resimulation::OtherKernel;
use recording::WriteError;
use schemas::text::shown;
use schemas::whole_file::WholeFileError;
use serde_json::json;
use std::any::Any;
use std::ffi::OsString;
use storage::StorageError;

/// End of a command that did not fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Done {
    /// Everything is as asked for.
    Whole,
    /// It finished, but something was lost, or it was asked to stop before it was done.
    Lossy,
}

impl Done {
    /// [`Done::Whole`] or, if not, [`Done::Lossy`].
    pub(crate) fn whole_if(whole: bool) -> Self {
        if whole { Self::Whole } else { Self::Lossy }
    }
}

/// Reason why a command failed.
#[derive(Debug)]
pub(crate) enum Failure {
    /// The user's input cannot be used: a flag, a configuration, a file.
    BadInput(Error),
    /// It was asked to stop before it was done, and leaves nothing.
    Stopped(Error),
    /// Anything else.
    Failed(Error),
}

impl Failure {
    /// It was asked to stop, and has written nothing.
    pub(crate) fn stopped() -> Self {
        Self::Stopped(anyhow::anyhow!("stopped: nothing was written"))
    }
}

impl<E: Into<Error>> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::Failed(error.into())
    }
}

/// A [`Failure::BadInput`] with this message.
macro_rules! bad_input {
    ($($message:tt)*) => { $crate::failure::Failure::BadInput(anyhow::anyhow!($($message)*)) };
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

/// Form in which a failure is printed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Form {
    /// In words.
    Words,
    /// As one line of JSON, because `--json` is among the arguments.
    Json,
}

impl Form {
    /// The form that the command line asks for, even if it is otherwise wrong.
    pub(crate) fn asked_for(arguments: &[OsString]) -> Self {
        let mut arguments = arguments.iter().skip(1).take_while(|argument| *argument != "--");
        if arguments.any(|argument| argument == "--json") { Self::Json } else { Self::Words }
    }

    /// A failure (exit code 1) in one line.
    pub(crate) fn line(self, message: &str) -> String {
        match self {
            Self::Words => format!("beadline: {message}"),
            Self::Json => line(message, &[], 1),
        }
    }
}

/// Tells a failure and gives the exit code.
pub(crate) fn exit(result: Result<Done, Failure>, form: Form) -> u8 {
    let (error, code) = match result {
        Ok(Done::Whole) => return 0,
        Ok(Done::Lossy) => return 3,
        Err(Failure::Failed(error)) if is_broken_pipe(&error) => return 0,
        Err(Failure::Failed(error) | Failure::BadInput(error)) if is_of_another_kernel(&error) => (error, 3),
        Err(Failure::Failed(error)) if is_in_the_way(&error) => (error, 2),
        Err(Failure::BadInput(error) | Failure::Failed(error)) if is_stop(&error) => (error, 3),
        Err(Failure::Failed(error)) => (limits::explain(error), 1),
        Err(Failure::Stopped(error)) => (error, 3),
        Err(Failure::BadInput(error)) => (error, 2),
    };
    let causes: Vec<String> = error.chain().skip(1).map(ToString::to_string).collect();
    match form {
        Form::Words => notice!("{error:#}"),
        Form::Json => display::tell_json(&line(&error.to_string(), &causes, code)),
    }
    code
}

/// Reports a wrong command line and ends, or prints the help that was asked for.
pub(crate) fn exit_of_usage(error: &clap::Error, form: Form) -> ! {
    if form == Form::Words || !error.use_stderr() {
        if let Err(why) = error.print()
            && !error.use_stderr()
        {
            let why = Error::new(why).context("the help cannot be printed on stdout");
            std::process::exit(exit(Err(Failure::Failed(why)), form).into());
        }
        std::process::exit(error.exit_code());
    }
    let text = error.render().to_string();
    // the first paragraph says what is wrong, the others how to write it
    let paragraphs: Vec<String> = text.split("\n\n").map(one_line).filter(|text| !text.is_empty()).collect();
    let message = paragraphs.first().map_or("", |text| text.strip_prefix("error: ").unwrap_or(text));
    display::tell_json(&line(message, paragraphs.get(1..).unwrap_or_default(), 2));
    std::process::exit(2);
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A failure in one line, for programs.
pub(crate) fn line(message: &str, causes: &[String], code: u8) -> String {
    let causes: Vec<_> = causes.iter().map(|cause| shown(cause)).collect();
    json!({ "error": { "message": shown(message), "causes": causes, "exit_code": code } }).to_string()
}

/// The words of a panic.
pub(crate) fn words_of(panic: &(dyn Any + Send)) -> String {
    let said = panic.downcast_ref::<String>().map(String::as_str);
    one_line(said.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no reason was given"))
}

/// A bug of ours or of a library, reported like any failure.
pub(crate) fn of_panic(panic: &(dyn Any + Send)) -> Failure {
    let said = words_of(panic);
    let bug = anyhow::anyhow!(
        "this program went wrong ({said}): that is a bug, please report it with the command and the lines above; files \
         that are not finished stay as .partial, and `beadline recover` or `beadline run --resume` go on with those of \
         runs"
    );
    Failure::Failed(bug)
}

/// True if this program cannot recompute something because another kernel made it, though nothing is wrong with it.
fn is_of_another_kernel(error: &Error) -> bool {
    error.chain().any(|cause| cause.downcast_ref::<OtherKernel>().is_some())
}

/// True if an output needs another name, whichever command found that, and however late; or if this build cannot do it.
fn is_in_the_way(error: &Error) -> bool {
    error.chain().any(|cause| {
        cause.downcast_ref().is_some_and(WriteError::is_in_the_way)
            || cause.downcast_ref().is_some_and(WholeFileError::is_in_the_way)
            || cause.downcast_ref().is_some_and(ExportError::is_in_the_way)
            || cause.downcast_ref().is_some_and(StorageError::is_of_usage)
            || matches!(cause.downcast_ref(), Some(RootError::Absent))
    })
}

/// It was asked to stop, wherever it was then.
fn is_stop(error: &Error) -> bool {
    use BusError::Stopped;
    error.chain().any(|cause| {
        matches!(cause.downcast_ref(), Some(AttachError::Stopped | AttachError::Bus(Stopped)))
            || matches!(cause.downcast_ref(), Some(PublishError::Stopped { .. } | PublishError::Bus(Stopped)))
            || matches!(cause.downcast_ref(), Some(ResultsError::Bus(Stopped)))
            || matches!(cause.downcast_ref(), Some(Stopped))
            || is_stop_of_store(cause)
    })
}

/// The same while a store was waited for, also where that is the cause of an error of reading.
fn is_stop_of_store(cause: &(dyn std::error::Error + 'static)) -> bool {
    let inner = cause.downcast_ref::<std::io::Error>().and_then(std::io::Error::get_ref);
    let inner = inner.and_then(|inner| inner.downcast_ref::<StorageError>());
    matches!(inner.or_else(|| cause.downcast_ref()), Some(StorageError::Stopped))
}

/// A reader that leaves early, as in `beadline presets | head -1`, is not a failure.
fn is_broken_pipe(error: &Error) -> bool {
    let io = error.chain().find_map(|cause| cause.downcast_ref::<std::io::Error>());
    io.is_some_and(|error| error.kind() == std::io::ErrorKind::BrokenPipe)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::panic::catch_unwind;

    #[test]
    fn a_panic_of_a_library_says_what_to_do() {
        for panic in
            [catch_unwind(|| panic!("segment {} is\n gone", 7)), catch_unwind(|| panic!("segment 7 is gone"))]
        {
            let Failure::Failed(error) = of_panic(&*panic.unwrap_err()) else { panic!("no failure") };
            let said = error.to_string();
            assert!(said.contains("(segment 7 is gone)") && said.contains("report it"), "{said}");
        }
    }
}
