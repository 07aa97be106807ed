//! States for other people's tools, each format in a module of its own.
//!
//! An [`Export`] takes states one by one and keeps none of them in memory. Its file has its name only when
//! [`Export::finish`] has given it; if dropped before that, it leaves nothing.

mod csv;
mod foxglove;
mod npz;
mod parquet;
mod spool;

use consumers::table::{Column, Kind, Table};
use recording::WriteError;
use schemas::frame::{Frame, Window};
use schemas::manifest::RunManifest;
use schemas::whole_file::WholeFileError;
use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// The part of a run that is exported.
#[derive(Debug, Clone)]
pub struct Excerpt {
    /// The run.
    pub manifest: RunManifest,
    /// The beads, at least one, all of them in the chain.
    pub beads: Range<usize>,
    /// The simulated time that was asked for; the states need not fill it.
    pub window: Window,
    /// Point clouds spread over that time, in formats that have them.
    pub clouds: u64,
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

    /// The first and the last step that may be exported.
    fn steps(&self) -> (u64, u64) {
        let physics = &self.manifest.physics;
        (physics.step_at_or_after(self.window.from_s), physics.step_at_or_before(self.window.until_s))
    }

    /// The simulated time (s) of the first of these steps.
    fn begin_s(&self) -> f64 {
        self.manifest.physics.time_s(self.steps().0)
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

    /// States that were recorded are missing before the next one.
    fn gap(&mut self) {}

    /// Does a part of the long work after the last state, and returns the fraction done; none when all is done.
    /// [`finish`](Self::finish) does the rest.
    ///
    /// # Errors
    /// When the disk does not take it.
    fn assemble(&mut self) -> Result<Option<f64>, ExportError> {
        Ok(None)
    }

    /// Completes the export and gives each file of it its name, the one that was asked for first.
    ///
    /// # Errors
    /// When the disk does not take it, or a file of that name has appeared meanwhile.
    fn finish(self: Box<Self>) -> Result<Vec<PathBuf>, ExportError>;
}

/// Reason why something was not exported.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The file could not be written, or not be given its name.
    #[error(transparent)]
    File(#[from] WholeFileError),
    /// The same of an MCAP file.
    #[error(transparent)]
    Mcap(#[from] WriteError),
}

impl ExportError {
    /// True if an existing file is in the way.
    pub fn is_in_the_way(&self) -> bool {
        match self {
            Self::File(error) => error.is_in_the_way(),
            Self::Mcap(error) => error.is_in_the_way(),
        }
    }
}

/// A format to export to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Arrays of `NumPy` in a ZIP file.
    Npz,
    /// A table with a row for each state and columns for each bead.
    Csv,
    /// A table with a row for each state and lists of values for the beads.
    Parquet,
    /// An MCAP file with Foxglove's messages.
    Foxglove,
}

impl Format {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Npz, Self::Csv, Self::Parquet, Self::Foxglove];

    /// Its name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Npz => "npz",
            Self::Csv => "csv",
            Self::Parquet => "parquet",
            Self::Foxglove => "foxglove",
        }
    }

    /// Ends of the names of such files; none if names do not tell this format.
    pub fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::Npz => &["npz"],
            Self::Csv => &["csv"],
            Self::Parquet => &["parquet"],
            Self::Foxglove => &[],
        }
    }

    /// The files of an export to `path`, that one first.
    pub fn files(self, path: &Path) -> Vec<PathBuf> {
        let names: &[&str] = match self {
            Self::Csv => &csv::BESIDE,
            Self::Parquet => &[parquet::CHAIN],
            Self::Npz | Self::Foxglove => &[],
        };
        let beside = names.iter().map(|name| beside(path, self, name));
        std::iter::once(path.to_owned()).chain(beside).collect()
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
            Self::Csv => Box::new(csv::Csv::create(path, excerpt, replace)?),
            Self::Parquet => Box::new(parquet::Parquet::create(path, excerpt, replace)?),
            Self::Foxglove => Box::new(foxglove::Foxglove::create(path, excerpt, replace)?),
        })
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// The name of a file beside `path`: `run.csv` and `chain.csv` make `run.chain.csv`.
fn beside(path: &Path, format: Format, name: &str) -> PathBuf {
    let end = path.extension().and_then(|end| end.to_str()).unwrap_or_default().to_ascii_lowercase();
    let is_end = format.extensions().contains(&end.as_str());
    let mut stem = if is_end { path.with_extension("") } else { path.to_owned() }.into_os_string();
    stem.push(".");
    stem.push(name);
    PathBuf::from(stem)
}

/// A table of the beads and of the contact that each has with the next one.
fn chain_table(path: &Path, excerpt: &Excerpt, replace: bool) -> Result<Table, WholeFileError> {
    let columns = [
        Column::new("bead", Kind::Integer),
        Column::new("mass_kg", Kind::Double),
        Column::new("stiffness", Kind::Double),
        Column::new("rest_overlap_m", Kind::Double),
    ];
    let mut table = Table::create(path, &columns, replace)?;
    let chain = excerpt.manifest.physics.chain();
    for bead in excerpt.beads.clone() {
        table.integer(bead as u64).double(chain.mass_kg[bead]);
        if excerpt.contacts().contains(&bead) {
            table.double(chain.own_stiffness(bead)).double(chain.rest_overlap_m[bead]);
        } else {
            table.empty().empty();
        }
        table.end_row()?;
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_goes_with_a_file_is_named_after_it() {
        let named = |path: &str| beside(Path::new(path), Format::Csv, "chain.csv").display().to_string();
        assert_eq!(named("a/run.csv"), "a/run.chain.csv");
        assert_eq!(named("run.v2"), "run.v2.chain.csv");
    }
}
