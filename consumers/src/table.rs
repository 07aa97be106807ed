//! Results as CSV: a header with units, then rows of numbers that read back to their bits.

use schemas::whole_file::WholeFile;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub use schemas::whole_file::WholeFileError as TableError;

/// A CSV file that is being written. It appears under its name only when it is finished; until then it
/// is `<name>.partial`. If it is never finished that is what it stays, unless it has no rows: then it is
/// removed.
#[derive(Debug)]
pub struct Table {
    // before the file: what is buffered is written first
    out: BufWriter<Arc<File>>,
    file: WholeFile,
    line: Vec<u8>,
    in_row: bool,
}

impl Table {
    /// Creates the table `path` with `columns`, such as `time_s`. Existing files, also what another table
    /// left unfinished, are replaced only with `replace`; what a living process writes never is.
    ///
    /// # Errors
    /// When something is in the way, or the file cannot be created.
    pub fn create(path: &Path, columns: &[String], replace: bool) -> Result<Self, TableError> {
        let file = WholeFile::create(path, replace)?;
        let out = BufWriter::with_capacity(1 << 16, Arc::clone(file.file()));
        let mut table = Self { out, file, line: Vec::new(), in_row: false };
        table.line.extend(columns.join(",").bytes());
        table.write_line()?;
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
        self.write_line()?;
        self.file.keep();
        Ok(())
    }

    fn write_line(&mut self) -> Result<(), TableError> {
        self.line.push(b'\n');
        let written = self.out.write_all(&self.line);
        self.line.clear();
        self.in_row = false;
        written.map_err(TableError::io(self.file.partial()))
    }

    /// Completes the file and gives it its name, both on the disk.
    ///
    /// # Errors
    /// When the disk does not take it, or a file of that name has appeared meanwhile.
    pub fn finish(self) -> Result<PathBuf, TableError> {
        let Self { mut out, file, .. } = self;
        out.flush().map_err(TableError::io(file.partial()))?;
        file.publish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

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
        assert!(matches!(table.finish(), Err(TableError::Appeared { .. })));
        assert_eq!(fs::read_to_string(&path).expect("kept"), "mine");
    }

    #[test]
    fn two_tables_of_one_name_do_not_lose_each_other() {
        let dir = tempfile::tempdir().expect("tempdir");
        let path = dir.path().join("a.csv");
        let mut first = Table::create(&path, &columns(), false).expect("new file");
        for replace in [false, true] {
            let second = Table::create(&path, &columns(), replace);
            assert!(matches!(second, Err(TableError::Busy { .. })), "{second:?}");
        }
        first.integer(1).double(1.0).end_row().expect("disk");
        first.finish().expect("disk");
        assert_eq!(fs::read_to_string(&path).expect("whole"), "step,time_s\n1,1e0\n");
    }

    #[test]
    fn rows_are_kept_when_a_table_is_given_up() {
        let dir = tempfile::tempdir().expect("tempdir");
        let path = dir.path().join("a.csv");
        drop(Table::create(&path, &columns(), false).expect("new file"));
        assert_eq!(fs::read_dir(dir.path()).expect("listed").count(), 0, "nothing but a head");
        let mut table = Table::create(&path, &columns(), false).expect("nothing is in the way");
        table.integer(1).double(1.0).end_row().expect("disk");
        drop(table);
        let partial = path.with_extension("csv.partial");
        assert_eq!(fs::read_to_string(&partial).expect("kept"), "step,time_s\n1,1e0\n");
        let next = Table::create(&path, &columns(), false);
        assert!(matches!(next, Err(TableError::PartialExists { .. })), "{next:?}");
    }

    #[test]
    fn a_directory_is_refused_before_any_row_is_computed() {
        let dir = tempfile::tempdir().expect("tempdir");
        for replace in [false, true] {
            let refused = Table::create(dir.path(), &columns(), replace);
            assert!(matches!(refused, Err(TableError::NotAFile { .. })), "{refused:?}");
        }
    }
}
