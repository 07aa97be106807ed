//! Results as CSV: a header with units, then rows of numbers that read back to their bits.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// A CSV file that is being written. It appears under its name only when it is finished; until
/// then, and if it is never finished, it is `<name>.partial`.
#[derive(Debug)]
pub struct Table {
    path: PathBuf,
    partial: PathBuf,
    replace: bool,
    out: BufWriter<File>,
    line: Vec<u8>,
    in_row: bool,
}

/// Why a table could not be written.
#[derive(Debug, thiserror::Error)]
pub enum TableError {
    /// A file of that name exists.
    #[error("{path} exists already; choose another name or pass --force", path = path.display())]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// The file system refused.
    #[error("{path} cannot be written: {source}", path = path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

impl Table {
    /// Creates the table `path` with `columns`, such as `time_s`. An existing file is replaced only
    /// with `replace`.
    ///
    /// # Errors
    /// When the file exists or cannot be created.
    pub fn create(path: &Path, columns: &[String], replace: bool) -> Result<Self, TableError> {
        if path.exists() && !replace {
            return Err(TableError::Exists { path: path.to_owned() });
        }
        let mut partial = path.as_os_str().to_owned();
        partial.push(".partial");
        let partial = PathBuf::from(partial);
        let file = OpenOptions::new().write(true).create(true).truncate(true).open(&partial);
        let file = file.map_err(|source| TableError::Io { path: partial.clone(), source })?;
        let out = BufWriter::with_capacity(1 << 16, file);
        let path = path.to_owned();
        let mut table = Self { path, partial, replace, out, line: Vec::new(), in_row: false };
        table.line.extend(columns.join(",").bytes());
        table.end_row()?;
        Ok(table)
    }

    /// Adds a whole number to the current row.
    pub fn integer(&mut self, value: u64) -> &mut Self {
        self.field(format_args!("{value}"))
    }

    /// Adds a double in the shortest form that reads back to its bits.
    pub fn double(&mut self, value: f64) -> &mut Self {
        self.field(format_args!("{value:e}"))
    }

    /// Adds a word, which must contain neither commas nor quotes nor line ends.
    pub fn word(&mut self, word: &str) -> &mut Self {
        self.field(format_args!("{word}"))
    }

    /// Adds an empty field: a value that does not exist.
    pub fn empty(&mut self) -> &mut Self {
        self.field(format_args!(""))
    }

    fn field(&mut self, value: std::fmt::Arguments<'_>) -> &mut Self {
        if self.in_row {
            self.line.push(b',');
        }
        self.in_row = true;
        // writing to a Vec cannot fail
        let _ = self.line.write_fmt(value);
        self
    }

    /// Ends the current row.
    ///
    /// # Errors
    /// When the disk does not take it.
    pub fn end_row(&mut self) -> Result<(), TableError> {
        self.line.push(b'\n');
        let written = self.out.write_all(&self.line);
        self.line.clear();
        self.in_row = false;
        written.map_err(|source| TableError::Io { path: self.partial.clone(), source })
    }

    /// Completes the file and gives it its name.
    ///
    /// # Errors
    /// When the disk does not take it, or a file of that name has appeared meanwhile.
    pub fn finish(mut self) -> Result<PathBuf, TableError> {
        let error = |source| TableError::Io { path: self.path.clone(), source };
        self.out.flush().map_err(error)?;
        if self.replace {
            fs::rename(&self.partial, &self.path).map_err(error)?;
        } else {
            // a hard link, unlike a rename, never replaces a file that appeared meanwhile
            fs::hard_link(&self.partial, &self.path).map_err(error)?;
            fs::remove_file(&self.partial).map_err(error)?;
        }
        Ok(self.path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn columns() -> Vec<String> {
        vec!["step".into(), "time_s".into()]
    }

    #[test]
    fn doubles_read_back_to_their_bits() {
        let dir = tempfile::tempdir().expect("tempdir");
        let path = dir.path().join("a.csv");
        let values = [0.1, -0.0, 5e-324, 1.797e308, 3.0, std::f64::consts::PI];
        let mut table = Table::create(&path, &columns(), false).expect("new file");
        for value in values {
            table.integer(7).double(value).end_row().expect("disk");
        }
        assert!(!path.exists());
        table.finish().expect("disk");
        let text = fs::read_to_string(&path).expect("written");
        assert!(text.starts_with("step,time_s\n7,1e-1\n7,-0e0\n"), "{text}");
        let read = text.lines().skip(1).map(|line| line[2..].parse::<f64>().expect("number").to_bits());
        assert!(read.eq(values.map(f64::to_bits)));
    }

    #[test]
    fn an_existing_file_is_kept_unless_told_otherwise() {
        let dir = tempfile::tempdir().expect("tempdir");
        let path = dir.path().join("a.csv");
        fs::write(&path, "mine").expect("disk");
        assert!(matches!(Table::create(&path, &columns(), false), Err(TableError::Exists { .. })));
        assert_eq!(fs::read_to_string(&path).expect("kept"), "mine");
        Table::create(&path, &columns(), true).expect("told").finish().expect("disk");
        assert_eq!(fs::read_to_string(&path).expect("replaced"), "step,time_s\n");
    }

    #[test]
    fn a_file_that_appears_meanwhile_is_not_replaced() {
        let dir = tempfile::tempdir().expect("tempdir");
        let path = dir.path().join("a.csv");
        let table = Table::create(&path, &columns(), false).expect("new file");
        fs::write(&path, "mine").expect("disk");
        assert!(table.finish().is_err());
        assert_eq!(fs::read_to_string(&path).expect("kept"), "mine");
    }
}
