//! The directory of a sweep.
//!
//! - `sweep.toml` the sweep file as given, `sweep.json` its identity
//! - `rows/I-of-N.rows` the journal of each shard
//! - `results.csv`, `results.parquet` the merged rows; `timings.csv` how long each took
//! - `ensemble.csv`, `ensemble.parquet` their statistics over one key, where the sweep has one for that
//! - `series.csv`, `ensemble-series.csv` and `.parquet` the same over time, where the sweep asks for that
//! - `recordings/point-000123.mcap` where recordings are asked for

use crate::args::Shard;
use crate::failure::{BadInput, Failure};
use anyhow::{Context, anyhow};
use consumers::journal::{Journal, JournalError, JournalHead};
use experiments::columns;
use producer::sweep::Sweep;
use recording::hex;
use schemas::whole_file::{self, WholeFileError, create_directory};
use serde::{Deserialize, Serialize};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Most bytes of the description of a sweep: the names of its columns.
pub(super) const MOST_SIGN_BYTES: u64 = 16 << 20;

pub(super) const SWEEP_JSON: &str = "sweep.json";
const SWEEP_TOML: &str = "sweep.toml";
const ROWS: &str = "rows";
const RECORDINGS: &str = "recordings";
/// Names of the tables of rows, of their statistics, and of both over time; each is there as CSV and as Parquet.
pub(super) const RESULTS: [&str; 2] = ["results", "series"];
pub(super) const ENSEMBLES: [&str; 2] = ["ensemble", "ensemble-series"];
pub(super) const FORMATS: [&str; 2] = ["csv", "parquet"];

/// The directory of one sweep.
#[derive(Debug)]
pub(super) struct Directory {
    path: PathBuf,
    sign: Sign,
    head: JournalHead,
}

/// Contents of `sweep.json`.
#[derive(Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Sign {
    /// SHA-256 of the values that decide the rows.
    identity: String,
    program: String,
    pub(super) points: u64,
    pub(super) columns: Vec<String>,
}

impl Sign {
    /// Identity of the journals of the sweep.
    pub(super) fn identity(&self) -> String {
        format!("{} {}", self.identity, self.program)
    }
}

impl Directory {
    /// Makes `path` the directory of `sweep`, or finds that it is; files of another sweep are refused, or removed with
    /// `force`.
    pub(super) fn open(path: &Path, sweep: &Sweep, force: bool) -> Result<Self, Failure> {
        let directory = Self::of(path, sweep);
        let make = |path: &Path| {
            create_directory(path).with_context(|| format!("cannot make {}", path.display())).bad_input()
        };
        make(path)?;
        // where a sweep was removed, empty directories and what others put there stay
        if !force || !directory.clear()? {
            directory.check()?;
        }
        make(&directory.rows())?;
        // the sweep may be the same and be written otherwise
        directory.write(SWEEP_TOML, sweep.text().as_bytes())?;
        directory.write(SWEEP_JSON, &serde_json::to_vec_pretty(&directory.sign)?)?;
        Ok(directory)
    }

    /// The directory `path` in which `sweep` was computed.
    pub(super) fn existing(path: &Path, sweep: &Sweep) -> Result<Self, Failure> {
        let directory = Self::of(path, sweep);
        if !path.join(SWEEP_JSON).exists() {
            return Err(Failure::BadInput(anyhow!("{} holds no sweep", path.display())));
        }
        directory.check()?;
        Ok(directory)
    }

    fn of(path: &Path, sweep: &Sweep) -> Self {
        let columns = columns(sweep);
        let sign = Sign {
            identity: hex(&sweep.identity()),
            program: concat!("beadline ", env!("CARGO_PKG_VERSION")).to_owned(),
            points: sweep.point_count(),
            columns: columns.iter().map(|column| column.name.clone()).collect(),
        };
        let head = JournalHead { identity: sign.identity(), columns };
        Self { path: path.to_owned(), sign, head }
    }

    /// Refuses a directory of another sweep.
    fn check(&self) -> Result<(), Failure> {
        let path = self.path.join(SWEEP_JSON);
        let bytes = match storage::read_file(&path, MOST_SIGN_BYTES) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return self.check_empty(),
            read => read.with_context(|| path.display().to_string())?,
        };
        let found: Sign = serde_json::from_slice(&bytes)
            .with_context(|| format!("{} cannot be read", path.display()))
            .bad_input()?;
        if found == self.sign {
            return Ok(());
        }
        let why = if found.program == self.sign.program {
            format!("another sweep, of {} points", found.points)
        } else {
            format!("a sweep of {}, this is {}", found.program, self.sign.program)
        };
        Err(Failure::BadInput(anyhow!(
            "{} holds {why}; choose another directory, or remove its rows, results and recordings with --force",
            self.path.display()
        )))
    }

    /// Refuses a directory that is used for something else.
    fn check_empty(&self) -> Result<(), Failure> {
        for entry in fs::read_dir(&self.path)? {
            let name = entry?.file_name();
            if name != ROWS && name != SWEEP_TOML && !name.to_string_lossy().ends_with(".partial") {
                if self.path.join(SWEEP_JSON).exists() {
                    // another process has just begun
                    return self.check();
                }
                return Err(Failure::BadInput(anyhow!(
                    "{} holds no sweep, but has `{}` in it; choose another directory",
                    self.path.display(),
                    name.display()
                )));
            }
        }
        Ok(())
    }

    /// Removes the files of a sweep here, unless somebody computes it; true if there was one.
    fn clear(&self) -> Result<bool, Failure> {
        if !self.path.join(SWEEP_JSON).exists() {
            return Ok(false);
        }
        let journals = self.journals()?;
        for path in &journals {
            // anything else that is wrong with it is reported here
            if let Err(error @ JournalError::Busy { .. }) = Journal::open(path, &self.head, |_| ()) {
                return Err(Failure::Failed(error.into()));
            }
        }
        let recordings = files(&self.path.join(RECORDINGS), |name| name.starts_with("point-"))?;
        let others = ["timings.csv", SWEEP_TOML, SWEEP_JSON].map(|name| self.path.join(name));
        journals.into_iter().chain(recordings).chain(others).try_for_each(|path| remove(&path))?;
        RESULTS.iter().chain(&ENSEMBLES).try_for_each(|name| self.remove_table(name))?;
        Ok(true)
    }

    /// Removes a table in all formats, such as one that an earlier form of the sweep file asked for.
    pub(super) fn remove_table(&self, name: &str) -> Result<(), Failure> {
        FORMATS.iter().try_for_each(|format| remove(&self.path.join(format!("{name}.{format}"))))
    }

    /// Writes a small file that every process of the sweep would write the same.
    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), Failure> {
        let path = self.path.join(name);
        if fs::read(&path).is_ok_and(|found| found == bytes) {
            return Ok(());
        }
        match whole_file::write(&path, bytes, true) {
            // another process of the sweep is writing it
            Err(WholeFileError::Busy { .. }) => Ok(()),
            written => Ok(written?),
        }
    }

    /// A file of the sweep.
    pub(super) fn file(&self, name: &str) -> PathBuf {
        self.path.join(name)
    }

    /// The common head of all journals of the sweep.
    pub(super) fn head(&self) -> &JournalHead {
        &self.head
    }

    /// Opens the journal of `shard`, which one process at a time may do, and tells `each` the points that have a row there.
    pub(super) fn journal(&self, shard: Shard, each: impl FnMut(u64)) -> Result<Journal, Failure> {
        Journal::open(&self.journal_path(shard), &self.head, each).map_err(|error| match error {
            JournalError::Busy { .. } => Failure::Failed(anyhow!(
                "{} is being swept by another process; give each a part of it with --shard I/N",
                self.path.display()
            )),
            error => Failure::Failed(error.into()),
        })
    }

    /// Path of the journal of `shard`.
    pub(super) fn journal_path(&self, shard: Shard) -> PathBuf {
        self.rows().join(format!("{}-of-{}.rows", shard.number, shard.count))
    }

    /// Every journal there is, in the order of their names.
    pub(super) fn journals(&self) -> Result<Vec<PathBuf>, Failure> {
        journals_in(&self.path)
    }

    /// The journals that may have rows of points of `shard`, but for its own: those of other shards of as many have none.
    pub(super) fn journals_beside(&self, shard: Shard) -> Result<Vec<PathBuf>, Failure> {
        let of_as_many = format!("-of-{}.rows", shard.count);
        let others = self.journals()?.into_iter();
        Ok(others.filter(|path| !path.to_string_lossy().ends_with(&of_as_many)).collect())
    }

    /// Size of all journals together.
    pub(super) fn journal_bytes(&self) -> Result<u64, Failure> {
        let sizes = self.journals()?.into_iter().map(|path| Ok(fs::metadata(path)?.len()));
        sizes.sum()
    }

    /// Directory of the journals.
    pub(super) fn rows(&self) -> PathBuf {
        self.path.join(ROWS)
    }

    /// Path of the recording of a point.
    pub(super) fn recording(&self, index: u64) -> PathBuf {
        self.path.join(RECORDINGS).join(format!("point-{index:06}.mcap"))
    }

    /// Makes the directory of the recordings.
    pub(super) fn make_recordings(&self) -> Result<(), Failure> {
        Ok(create_directory(&self.path.join(RECORDINGS))?)
    }
}

/// Removes the file, if it is there.
fn remove(path: &Path) -> Result<(), Failure> {
    match fs::remove_file(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
        removed => Ok(removed.with_context(|| path.display().to_string())?),
    }
}

/// The sweep file in the directory of a sweep.
pub(super) fn sweep_file(path: &Path) -> Option<PathBuf> {
    path.join(SWEEP_JSON).is_file().then(|| path.join(SWEEP_TOML))
}

/// Every journal in the directory of a sweep, in the order of their names.
pub(super) fn journals_in(path: &Path) -> Result<Vec<PathBuf>, Failure> {
    files(&path.join(ROWS), |name| Path::new(name).extension().is_some_and(|end| end == "rows"))
}

/// The files in `directory` with names that `wanted` picks, in the order of their names.
fn files(directory: &Path, wanted: impl Fn(&str) -> bool) -> Result<Vec<PathBuf>, Failure> {
    let entries = match fs::read_dir(directory) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.with_context(|| directory.display().to_string())?,
    };
    let mut found = entries.map(|entry| Ok(entry?.path())).collect::<io::Result<Vec<_>>>()?;
    found.retain(|path| path.file_name().is_some_and(|name| wanted(&name.to_string_lossy())));
    found.sort();
    Ok(found)
}
