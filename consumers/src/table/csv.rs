//! CSV: a header with units, then rows.

use super::{Cell, Column, TableError};
use schemas::whole_file::WholeFile;
use std::borrow::Cow;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::PathBuf;
use std::sync::Arc;

#[derive(Debug)]
pub(super) struct Csv {
    // before the file: buffered rows are written first
    out: BufWriter<Arc<File>>,
    file: WholeFile,
    line: Vec<u8>,
}

impl Csv {
    pub(super) fn new(file: WholeFile, columns: &[Column]) -> Result<Self, TableError> {
        let out = BufWriter::with_capacity(1 << 16, Arc::clone(file.file()));
        let mut csv = Self { out, file, line: Vec::new() };
        let names: Vec<_> = columns.iter().map(|column| quoted(&column.name)).collect();
        csv.line.extend(names.join(",").bytes());
        csv.write_line()?;
        Ok(csv)
    }

    pub(super) fn write(&mut self, row: &[Cell]) -> Result<(), TableError> {
        for (i, cell) in row.iter().enumerate() {
            if i > 0 {
                self.line.push(b',');
            }
            // writing to a Vec cannot fail
            let _ = match cell {
                Cell::Integer(value) => write!(self.line, "{value}"),
                Cell::Double(value) => write!(self.line, "{value:e}"),
                Cell::Word(word) => write!(self.line, "{}", quoted(word)),
                Cell::Empty => Ok(()),
            };
        }
        self.write_line()?;
        self.file.keep();
        Ok(())
    }

    fn write_line(&mut self) -> Result<(), TableError> {
        self.line.push(b'\n');
        let written = self.out.write_all(&self.line);
        self.line.clear();
        written.map_err(|error| self.file.refused(error))
    }

    pub(super) fn discard(self) {
        let Self { out, file, .. } = self;
        // buffered rows need not be written any more
        let _ = out.into_parts();
        file.discard();
    }

    pub(super) fn finish(self) -> Result<PathBuf, TableError> {
        let Self { mut out, mut file, .. } = self;
        // some disks only say then that they are full
        let synced = out.flush().and_then(|()| file.file().sync_all());
        if let Err(error) = synced {
            return Err(file.refused(error));
        }
        file.publish()
    }
}

/// A field as RFC 4180 has it: in quotes where it must be.
fn quoted(field: &str) -> Cow<'_, str> {
    if field.contains([',', '"', '\n', '\r']) {
        Cow::Owned(format!("\"{}\"", field.replace('"', "\"\"")))
    } else {
        Cow::Borrowed(field)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_quoted_where_they_must_be() {
        assert_eq!(quoted("left-opens"), "left-opens");
        assert_eq!(quoted("[{ bead = 5, name = \"a\" }]"), "\"[{ bead = 5, name = \"\"a\"\" }]\"");
        assert_eq!(quoted("a\nb"), "\"a\nb\"");
    }
}
