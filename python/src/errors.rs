//! Errors as Python sees them: the exceptions of `beadline.errors`.

use bus::{AttachError, BusError, LiveError, PublishError, ResultsError, RootError};
use producer::resimulation::{Difference, OtherKernel, ResimulationError};
use pyo3::exceptions::{PyFileExistsError, PyFileNotFoundError, PyOSError, PyRuntimeError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use recording::{ReadError, WriteError};
use schemas::config::ConfigError;
use schemas::manifest::ManifestError;
use std::error::Error;
use std::io;
use std::path::Path;

/// Reason why something did not work; becomes an exception where the interpreter is held.
#[derive(Debug, Default)]
pub(crate) struct Why {
    class: &'static str,
    message: String,
    path: Option<String>,
    byte: Option<u64>,
    step: Option<u64>,
    frame: Option<u64>,
    bead: Option<usize>,
    key: Option<String>,
    line: Option<usize>,
    remedy: Option<&'static str>,
    /// An exception that was raised meanwhile: a signal, a callback.
    raised: Option<PyErr>,
}

impl Why {
    /// An exception of class `class` of `beadline.errors`.
    pub(crate) fn new(class: &'static str, message: impl Into<String>) -> Self {
        Self { class, message: message.into(), ..Self::default() }
    }

    /// An error, with its causes, as an exception of class `class`.
    pub(crate) fn of(class: &'static str, error: &dyn Error) -> Self {
        let mut message = error.to_string();
        let mut cause = error.source();
        while let Some(error) = cause {
            message = format!("{message}: {error}");
            cause = error.source();
        }
        Self::new(class, message)
    }

    /// The same, and which frame is meant.
    pub(crate) fn at_frame(self, frame: u64) -> Self {
        Self { frame: Some(frame), ..self }
    }

    /// The same, and the step and the bead.
    pub(crate) fn at_bead(self, step: u64, bead: usize) -> Self {
        Self { step: Some(step), bead: Some(bead), ..self }
    }

    /// The same, and which of several runs is meant.
    pub(crate) fn of_run(self, number: usize) -> Self {
        Self { message: format!("runs[{number}]: {}", self.message), ..self }
    }

    pub(crate) fn of_io(error: &io::Error, path: &Path) -> Self {
        let code = error.raw_os_error();
        // Python says the number itself, and the path as open() does
        let said = error.to_string().split(" (os error ").next().unwrap_or_default().to_owned();
        let raised = PyOSError::new_err((code, said, path.as_os_str().to_owned()));
        Self { raised: code.is_some().then_some(raised), ..Self::of("BeadlineError", error) }
    }
}

impl From<PyErr> for Why {
    fn from(raised: PyErr) -> Self {
        Self { raised: Some(raised), ..Self::default() }
    }
}

impl From<Why> for PyErr {
    fn from(why: Why) -> Self {
        if let Some(raised) = why.raised {
            return raised;
        }
        Python::attach(|py| {
            let make = || {
                let about = PyDict::new(py);
                about.set_item("path", &why.path)?;
                about.set_item("byte", why.byte)?;
                about.set_item("step", why.step)?;
                about.set_item("frame", why.frame)?;
                about.set_item("bead", why.bead)?;
                about.set_item("key", &why.key)?;
                about.set_item("line", why.line)?;
                about.set_item("remedy", why.remedy)?;
                let class = py.import("beadline.errors")?.getattr(why.class)?;
                class.call((&why.message,), Some(&about))
            };
            make().map_or_else(|error| error, Self::from_value)
        })
    }
}

impl From<ConfigError> for Why {
    fn from(error: ConfigError) -> Self {
        let path = error.path.as_ref().map(|path| path.display().to_string());
        Self { path, key: Some(error.key.clone()), line: error.line, ..Self::of("ConfigError", &error) }
    }
}

impl From<ManifestError> for Why {
    fn from(error: ManifestError) -> Self {
        Self::of("RecordingError", &error)
    }
}

impl From<ReadError> for Why {
    fn from(error: ReadError) -> Self {
        // without a number it is no error of the system: the file became shorter, or a store refused
        if let ReadError::Io { path, source } = &error {
            if source.raw_os_error().is_some() {
                return Self::of_io(source, path);
            }
            if source.kind() == io::ErrorKind::NotFound {
                let said = format!("{}: {source}", path.display());
                return PyFileNotFoundError::new_err(said).into();
            }
        }
        let is_damaged = matches!(
            error,
            ReadError::Damaged { .. } | ReadError::Crc { .. } | ReadError::ManifestChecksum { .. }
        );
        let remedy = "copy the file again from its source, or save what is left with `beadline recover`";
        Self {
            path: Some(error.path().display().to_string()),
            byte: error.byte(),
            remedy: is_damaged.then_some(remedy),
            ..Self::of("RecordingError", &error)
        }
    }
}

impl From<WriteError> for Why {
    fn from(error: WriteError) -> Self {
        let why = Self::of("BeadlineError", &error);
        let mut causes = std::iter::successors(Some(&error as &dyn Error), |error| (*error).source());
        let code = causes.find_map(|cause| cause.downcast_ref::<io::Error>()?.raw_os_error());
        let raised = match code {
            // which the command calls so
            _ if error.is_in_the_way() => {
                Some(PyFileExistsError::new_err(why.message.replace("--force", "force=True")))
            }
            code => code.map(|code| PyOSError::new_err((code, why.message.clone()))),
        };
        Self { raised, ..why }
    }
}

impl From<Difference> for Why {
    fn from(found: Difference) -> Self {
        Self {
            step: Some(found.step),
            frame: Some(found.frame),
            bead: Some(found.bead),
            remedy: Some("ask for the file again; `beadline verify` names every state that differs"),
            ..Self::of("RecordingError", &found)
        }
    }
}

impl From<OtherKernel> for Why {
    fn from(error: OtherKernel) -> Self {
        let remedy = Some("read the recorded states (`recorded_steps`), or use a Beadline of that version");
        Self { remedy, ..Self::of("RecordingError", &error) }
    }
}

impl From<ResimulationError<ReadError>> for Why {
    fn from(error: ResimulationError<ReadError>) -> Self {
        match error {
            ResimulationError::Source(error) => error.into(),
            ResimulationError::Differs(found) => found.into(),
        }
    }
}

macro_rules! of_class {
    ($($error:ty => $class:literal;)*) => { $(
        impl From<$error> for Why {
            fn from(error: $error) -> Self {
                Self::of($class, &error)
            }
        }
    )* };
}

of_class! {
    AttachError => "LiveError";
    BusError => "LiveError";
    LiveError => "LiveError";
    PublishError => "LiveError";
    ResultsError => "LiveError";
    RootError => "LiveError";
}

/// A thread that panicked: a bug of ours, which must not take the interpreter with it.
pub(crate) fn of_panic(panic: &(dyn std::any::Any + Send)) -> PyErr {
    let said = panic.downcast_ref::<String>().map(String::as_str);
    let said = said.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no reason was given");
    PyRuntimeError::new_err(format!("Beadline went wrong ({said}): that is a bug, please report it"))
}
