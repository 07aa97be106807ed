//! States for other people's tools, each format in a module of its own.
//!
//! An [`Export`] takes states one by one and keeps none of them in memory. Its file has its name only when
//! [`Export::finish`] has given it; dropped before that, nothing of it is left.

mod npz;
mod spool;

use schemas::frame::{Frame, Window};
use schemas::manifest::RunManifest;
use schemas::whole_file::WholeFileError;
use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// What is exported of a run.
#[derive(Debug, Clone)]
pub struct Excerpt {
    /// The run.
    pub manifest: RunManifest,
    /// The beads, at least one, all of them in the chain.
    pub beads: Range<usize>,
    /// The simulated time that was asked for; the states need not fill it.
    pub window: Window,
}

impl Excerpt {
    /// The contacts between two of the beads.
    pub fn contacts(&self) -> Range<usize> {
        self.beads.start..self.beads.end - 1
    }

    /// Displacements (m) and velocities (m/s) of the beads in `frame`.
    pub fn of<'a>(&self, frame: &Frame<'a>) -> (&'a [f64], &'a [f64]) {
        (&frame.u_m[self.beads.clone()], &frame.v_m_s[self.beads.clone()])
    }

    /// The number of the frame at `step`, if there is one: steps between frames may be exported, too.
    pub fn frame_at(&self, step: u64) -> Option<u64> {
        self.manifest.is_frame(step).then(|| self.manifest.frame_at(step))
    }
}

/// A file in another format that is being written.
pub trait Export {
    /// Takes the next state.
    ///
    /// # Errors
    /// When the disk does not take it; the export is then of no use any more.
    fn frame(&mut self, frame: &Frame<'_>) -> Result<(), ExportError>;

    /// Completes the export and gives each file of it its name, the one that was asked for first.
    ///
    /// # Errors
    /// When the disk does not take it, or a file of that name has appeared meanwhile.
    fn finish(self: Box<Self>) -> Result<Vec<PathBuf>, ExportError>;
}

/// Why something was not exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The file could not be written, or not be given its name.
    #[error(transparent)]
    File(#[from] WholeFileError),
}

impl ExportError {
    /// Whether what was there before stands in the way.
    pub fn is_in_the_way(&self) -> bool {
        match self {
            Self::File(error) => error.is_in_the_way(),
        }
    }
}

/// A format to export to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Arrays of `NumPy` in a ZIP file.
    Npz,
}

impl Format {
    /// All of them.
    pub const ALL: [Self; 1] = [Self::Npz];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Npz => "npz",
        }
    }

    /// What names of such files end with, if that says which format it is.
    pub fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::Npz => &["npz"],
        }
    }

    /// Begins an export of `excerpt` to `path`. A file of that name, or what an export has left of one, is in the
    /// way unless `replace`.
    ///
    /// # Errors
    /// When something is in the way, or the file cannot be created.
    pub fn begin(
        self,
        path: &Path,
        excerpt: &Excerpt,
        replace: bool,
    ) -> Result<Box<dyn Export>, ExportError> {
        Ok(match self {
            Self::Npz => Box::new(npz::Npz::create(path, excerpt, replace)?),
        })
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
