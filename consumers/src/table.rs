//! Results as tables: CSV or Parquet, of numbers that read back to their bits.

mod csv;
mod parquet;
pub mod read;

use csv::Csv;
use parquet::Parquet;
use schemas::whole_file::WholeFile;
use std::path::{Path, PathBuf};

pub use schemas::whole_file::WholeFileError as TableError;

/// A value in a table.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// A whole number.
    Integer(u64),
    /// A double.
    Double(f64),
    /// A word.
    Word(String),
    /// A value that does not exist.
    Empty,
}

impl Cell {
    /// The number in it, if it holds one.
    pub fn number(&self) -> Option<f64> {
        match self {
            Self::Integer(value) => Some(*value as f64),
            Self::Double(value) => Some(*value),
            Self::Word(_) | Self::Empty => None,
        }
    }
}

/// A double, or nothing.
impl From<Option<f64>> for Cell {
    fn from(value: Option<f64>) -> Self {
        value.map_or(Self::Empty, Self::Double)
    }
}

/// Kind of the values of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Whole numbers.
    Integer,
    /// Doubles.
    Double,
    /// Words.
    Word,
}

/// A column: its name, with the unit, such as `time_s`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Column {
    /// The name.
    pub name: String,
    /// The type of its values; if not given, that of the first of them.
    pub kind: Option<Kind>,
}

impl Column {
    /// A column of that kind.
    pub fn new(name: impl Into<String>, kind: Kind) -> Self {
        Self { name: name.into(), kind: Some(kind) }
    }
}

impl From<String> for Column {
    fn from(name: String) -> Self {
        Self { name, kind: None }
    }
}

/// A file that is being written: Parquet if it is named `.parquet`, CSV otherwise. It appears under its name
/// only when it is finished; until then it is `<name>.partial`. If it is never finished a CSV with rows stays
/// that; anything else, which nobody could read, is removed.
#[derive(Debug)]
pub struct Table {
    form: Form,
    row: Vec<Cell>,
}

#[derive(Debug)]
enum Form {
    Csv(Csv),
    Parquet(Box<Parquet>),
}

impl Table {
    /// Creates the table `path` with `columns`. Existing files, also what another table left unfinished, are
    /// replaced only with `replace`; a file that a living process writes is never replaced.
    ///
    /// # Errors
    /// When something is in the way, or the file cannot be created.
    pub fn create<C: Clone + Into<Column>>(
        path: &Path,
        columns: &[C],
        replace: bool,
    ) -> Result<Self, TableError> {
        let columns: Vec<Column> = columns.iter().cloned().map(Into::into).collect();
        let file = WholeFile::create(path, replace)?;
        let is_parquet = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("parquet"));
        let form = if is_parquet {
            Form::Parquet(Box::new(Parquet::new(file, columns)))
        } else {
            Form::Csv(Csv::new(file, &columns)?)
        };
        Ok(Self { form, row: Vec::new() })
    }

    /// Adds a whole number to the current row.
    pub fn integer(&mut self, value: u64) -> &mut Self {
        self.cell(Cell::Integer(value))
    }

    /// Adds a double to the current row, in CSV in the shortest form that reads back to its bits.
    pub fn double(&mut self, value: f64) -> &mut Self {
        self.cell(Cell::Double(value))
    }

    /// Adds an empty field: a value that does not exist.
    pub fn empty(&mut self) -> &mut Self {
        self.cell(Cell::Empty)
    }

    /// Adds a value to the current row.
    pub fn cell(&mut self, cell: Cell) -> &mut Self {
        self.row.push(cell);
        self
    }

    /// Adds a row of these values, behind those that the current row has already.
    ///
    /// # Errors
    /// As [`end_row`](Self::end_row).
    pub fn add_row(&mut self, cells: &[Cell]) -> Result<(), TableError> {
        self.row.extend_from_slice(cells);
        self.end_row()
    }

    /// Ends the current row.
    ///
    /// # Errors
    /// When the disk does not take it.
    ///
    /// # Panics
    /// When the row has not a value of its kind for each column: a bug of the caller.
    pub fn end_row(&mut self) -> Result<(), TableError> {
        let written = match &mut self.form {
            Form::Csv(csv) => csv.write(&self.row),
            Form::Parquet(parquet) => parquet.write(&mut self.row),
        };
        self.row.clear();
        written
    }

    /// Removes the file.
    pub fn discard(self) {
        match self.form {
            Form::Csv(csv) => csv.discard(),
            Form::Parquet(parquet) => drop(parquet),
        }
    }

    /// Completes the file and gives it its name, both on the disk.
    ///
    /// # Errors
    /// When the disk does not take it, or a file of that name has appeared meanwhile.
    pub fn finish(self) -> Result<PathBuf, TableError> {
        match self.form {
            Form::Csv(csv) => csv.finish(),
            Form::Parquet(parquet) => parquet.finish(),
        }
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
