//! Tables as they were written, read back whole.

use super::Cell;
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

/// Largest file that is read: all of it is in memory.
const MAX_BYTES: u64 = 1 << 30;

/// A column with the values of all rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Values {
    /// Its name.
    pub name: String,
    /// A value for each row.
    pub cells: Vec<Cell>,
}

/// Reason why a table cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum ReadTableError {
    /// The file cannot be read.
    #[error("{} cannot be read", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// More than is read into memory.
    #[error("{} has {found} bytes; at most {MAX_BYTES} are read", path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size.
        found: u64,
    },
    /// It is named as Parquet, but is none.
    #[error("{} is no Parquet file that can be read", path.display())]
    Parquet {
        /// The file.
        path: PathBuf,
        /// Error of the Parquet reader.
        source: ParquetError,
    },
    /// It is no CSV with a header.
    #[error("{}:{line}: {what}", path.display())]
    Csv {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// The error.
        what: String,
    },
}

/// Reads the table `path`: Parquet if it is named `.parquet`, CSV otherwise.
///
/// # Errors
/// When it cannot be read, is no table, or is larger than 1 GiB.
pub fn read(path: &Path) -> Result<Vec<Values>, ReadTableError> {
    let unreadable = |source| ReadTableError::Unreadable { path: path.to_owned(), source };
    let found = fs::metadata(path).map_err(unreadable)?.len();
    if found > MAX_BYTES {
        return Err(ReadTableError::TooLarge { path: path.to_owned(), found });
    }
    if path.extension().is_some_and(|end| end.eq_ignore_ascii_case("parquet")) {
        let file = File::open(path).map_err(unreadable)?;
        return parquet(file).map_err(|source| ReadTableError::Parquet { path: path.to_owned(), source });
    }
    let text = fs::read_to_string(path).map_err(unreadable)?;
    csv(&text).map_err(|(line, what)| ReadTableError::Csv { path: path.to_owned(), line, what })
}

fn parquet(file: File) -> Result<Vec<Values>, ParquetError> {
    let reader = SerializedFileReader::new(file)?;
    let schema = reader.metadata().file_metadata().schema();
    let column = |name: &str| Values { name: name.to_owned(), cells: Vec::new() };
    let mut columns: Vec<Values> = schema.get_fields().iter().map(|field| column(field.name())).collect();
    for row in reader.get_row_iter(None)? {
        for (values, (_, field)) in columns.iter_mut().zip(row?.get_column_iter()) {
            values.cells.push(match field {
                Field::Null => Cell::Empty,
                Field::Double(value) => Cell::Double(*value),
                Field::ULong(value) => Cell::Integer(*value),
                Field::Str(word) => Cell::Word(word.clone()),
                // no table of ours has them
                other => cell(&other.to_string()),
            });
        }
    }
    Ok(columns)
}

/// Value of a field without quotes.
fn cell(field: &str) -> Cell {
    if field.is_empty() {
        return Cell::Empty;
    }
    let whole = field.parse().map(Cell::Integer);
    whole.or_else(|_| field.parse().map(Cell::Double)).unwrap_or_else(|_| Cell::Word(field.to_owned()))
}

/// Reads fields as RFC 4180 has them; what is wrong comes with its line.
fn csv(text: &str) -> Result<Vec<Values>, (usize, String)> {
    let (mut columns, mut rest, mut line): (Vec<Values>, _, _) = (Vec::new(), text, 1);
    while !rest.is_empty() {
        let (fields, lines) =
            record(&mut rest).ok_or_else(|| (line, "a quoted field has no end".to_owned()))?;
        if line == 1 {
            let column = |(name, _)| Values { name, cells: Vec::new() };
            columns = fields.into_iter().map(column).collect();
        } else if fields.len() == columns.len() {
            for (column, (field, quoted)) in columns.iter_mut().zip(fields) {
                column.cells.push(if quoted { Cell::Word(field) } else { cell(&field) });
            }
        } else {
            let what = format!("found {} fields; expected {}, as in the header", fields.len(), columns.len());
            return Err((line, what));
        }
        line += lines;
    }
    if columns.is_empty() {
        Err((1, "expected a header with the names of the columns".to_owned()))
    } else {
        Ok(columns)
    }
}

/// Takes a record off `rest`: its fields, each with whether it was quoted, and how many lines it had. None if it has no end.
fn record(rest: &mut &str) -> Option<(Vec<(String, bool)>, usize)> {
    let (mut fields, mut lines) = (Vec::new(), 1);
    loop {
        let is_quoted = rest.starts_with('"');
        let mut field = String::new();
        if is_quoted {
            loop {
                let inner = rest.get(1..)?;
                let end = inner.find('"')?;
                field.push_str(&inner[..end]);
                *rest = &inner[end + 1..];
                if !rest.starts_with('"') {
                    break;
                }
                field.push('"');
            }
            lines += field.matches('\n').count();
        }
        let end = rest.find([',', '\n']).unwrap_or(rest.len());
        field.push_str(rest[..end].trim_end_matches('\r'));
        let goes_on = rest[end..].starts_with(',');
        *rest = rest.get(end + 1..).unwrap_or_default();
        fields.push((field, is_quoted));
        if !goes_on {
            return Some((fields, lines));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Column, Kind, Table};
    use super::*;

    #[test]
    fn what_was_written_is_read_back() {
        let dir = tempfile::tempdir().expect("tempdir");
        let columns =
            [Kind::Integer, Kind::Double, Kind::Word].map(|kind| Column::new(format!("{kind:?}, x"), kind));
        let words = ["plain", "[{ a = 1, b = \"c\" }]", "two\nlines"];
        let tables = ["a.csv", "a.parquet"].map(|name| {
            let path = dir.path().join(name);
            let mut table = Table::create(&path, &columns, false).expect("new file");
            for (i, word) in (0_u32..).zip(words) {
                table
                    .integer(i.into())
                    .double(0.1 * f64::from(i))
                    .cell(Cell::Word(word.to_owned()))
                    .end_row()
                    .expect("disk");
            }
            table.empty().empty().empty().end_row().expect("disk");
            read(&table.finish().expect("disk")).expect("a table")
        });
        assert_eq!(tables[0], tables[1]);
        assert_eq!(tables[0][2].name, "Word, x");
        assert_eq!(tables[0][2].cells[1], Cell::Word(words[1].to_owned()));
        assert_eq!(tables[0][1].cells[2], Cell::Double(0.2));
        assert_eq!(tables[0][0].cells[3], Cell::Empty);
    }

    #[test]
    fn mistakes_have_their_line() {
        let error = |text: &str| csv(text).expect_err(text);
        assert_eq!(error("").0, 1);
        assert_eq!(error("a,b\n1,2\n3\n"), (3, "found 1 fields; expected 2, as in the header".to_owned()));
        assert_eq!(error("a,b\n\"x\ny\",1\n\"open,2\n").0, 4);
        assert_eq!(csv("a\r\n1\r\n").expect("lines of Windows")[0].cells, [Cell::Integer(1)]);
    }
}
