//! Parquet: typed columns, written a group of rows at a time.

use super::{Cell, Column, Kind, TableError};
use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical, ZstdLevel};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::Type;
use schemas::whole_file::WholeFile;
use std::fs::File;
use std::io;
use std::path::PathBuf;
use std::sync::Arc;

/// Values of one group of rows, about 8 MB in memory.
const GROUP_CELLS: usize = 1 << 18;

pub(super) struct Parquet {
    writer: Option<SerializedFileWriter<Arc<File>>>,
    file: WholeFile,
    columns: Vec<Column>,
    /// Whole rows that are not written yet.
    group: Vec<Cell>,
}

impl std::fmt::Debug for Parquet {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Parquet")
            .field("file", &self.file)
            .field("columns", &self.columns)
            .finish_non_exhaustive()
    }
}

impl Parquet {
    pub(super) fn new(file: WholeFile, columns: Vec<Column>) -> Self {
        Self { writer: None, file, columns, group: Vec::new() }
    }

    pub(super) fn write(&mut self, row: &mut Vec<Cell>) -> Result<(), TableError> {
        assert_eq!(row.len(), self.columns.len(), "a row has a value for each column");
        self.group.append(row);
        if self.group.len() >= GROUP_CELLS { self.write_group() } else { Ok(()) }
    }

    fn write_group(&mut self) -> Result<(), TableError> {
        let written = self.try_write_group();
        self.group.clear();
        written.map_err(|error| self.error(error))
    }

    fn try_write_group(&mut self) -> Result<(), ParquetError> {
        let Self { writer, file, columns, group } = self;
        let writer = match writer {
            Some(writer) => writer,
            None => writer.insert(begin(file, columns, group)?),
        };
        if group.is_empty() {
            return Ok(());
        }
        let mut rows = writer.next_row_group()?;
        let mut number = 0;
        while let Some(mut column) = rows.next_column()? {
            let cells = group.iter().skip(number).step_by(columns.len());
            write_column(&mut column, cells, &columns[number].name)?;
            column.close()?;
            number += 1;
        }
        rows.close()?;
        Ok(())
    }

    pub(super) fn finish(mut self) -> Result<PathBuf, TableError> {
        self.write_group()?;
        let closed = self.writer.take().map(SerializedFileWriter::close).transpose();
        closed.map_err(|error| self.error(error))?;
        self.file.publish()
    }

    fn error(&self, error: ParquetError) -> TableError {
        let error = match error {
            ParquetError::External(cause) => {
                cause.downcast::<io::Error>().map_or_else(io::Error::other, |error| *error)
            }
            other => io::Error::other(other),
        };
        TableError::removed(self.file.path())(error)
    }
}

/// Settles the types of the columns, and writes the head of the file.
fn begin(
    file: &WholeFile,
    columns: &mut [Column],
    group: &[Cell],
) -> Result<SerializedFileWriter<Arc<File>>, ParquetError> {
    let count = columns.len();
    let mut fields = Vec::with_capacity(count);
    for (number, column) in columns.iter_mut().enumerate() {
        let mut cells = group.iter().skip(number).step_by(count);
        // what never has a value could be anything
        let kind = column.kind.or_else(|| cells.find_map(kind_of)).unwrap_or(Kind::Double);
        column.kind = Some(kind);
        fields.push(Arc::new(field(&column.name, kind)?));
    }
    let schema = Arc::new(Type::group_type_builder("schema").with_fields(fields).build()?);
    let properties = WriterProperties::builder()
        .set_created_by(concat!("beadline ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .build();
    SerializedFileWriter::new(Arc::clone(file.file()), schema, Arc::new(properties))
}

fn kind_of(cell: &Cell) -> Option<Kind> {
    match cell {
        Cell::Integer(_) => Some(Kind::Integer),
        Cell::Double(_) => Some(Kind::Double),
        Cell::Word(_) => Some(Kind::Word),
        Cell::Empty => None,
    }
}

fn field(name: &str, kind: Kind) -> Result<Type, ParquetError> {
    let (physical, logical) = match kind {
        Kind::Integer => (Physical::INT64, Some(LogicalType::integer(64, false))),
        Kind::Double => (Physical::DOUBLE, None),
        Kind::Word => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
    };
    Type::primitive_type_builder(name, physical)
        .with_repetition(Repetition::OPTIONAL)
        .with_logical_type(logical)
        .build()
}

/// Writes `cells`, all of the kind of `column`.
fn write_column<'a>(
    column: &mut SerializedColumnWriter<'_>,
    cells: impl Iterator<Item = &'a Cell> + Clone,
    name: &str,
) -> Result<(), ParquetError> {
    let present: Vec<i16> = cells.clone().map(|cell| i16::from(*cell != Cell::Empty)).collect();
    let present_count = present.iter().filter(|present| **present == 1).count();
    let all = |taken: usize| assert_eq!(taken, present_count, "`{name}` has values of one kind");
    match column.untyped() {
        ColumnWriter::Int64ColumnWriter(writer) => {
            let values: Vec<i64> = cells.filter_map(integer).collect();
            all(values.len());
            writer.write_batch(&values, Some(&present), None)?;
        }
        ColumnWriter::DoubleColumnWriter(writer) => {
            let values: Vec<f64> = cells.filter_map(double).collect();
            all(values.len());
            writer.write_batch(&values, Some(&present), None)?;
        }
        ColumnWriter::ByteArrayColumnWriter(writer) => {
            let values: Vec<ByteArray> = cells.filter_map(word).collect();
            all(values.len());
            writer.write_batch(&values, Some(&present), None)?;
        }
        _ => return Err(ParquetError::General(format!("`{name}` is of no type that tables have"))),
    }
    Ok(())
}

fn integer(cell: &Cell) -> Option<i64> {
    match cell {
        // the schema says that the bits are those of an unsigned number
        Cell::Integer(value) => Some(value.cast_signed()),
        _ => None,
    }
}

fn double(cell: &Cell) -> Option<f64> {
    match cell {
        Cell::Double(value) => Some(*value),
        _ => None,
    }
}

fn word(cell: &Cell) -> Option<ByteArray> {
    match cell {
        Cell::Word(word) => Some(ByteArray::from(word.as_str())),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::super::Table;
    use super::*;
    use parquet::file::reader::{FileReader, SerializedFileReader};
    use parquet::record::Field;

    /// Every row of a Parquet file, with doubles as their bits.
    fn read(path: &std::path::Path) -> Vec<Vec<Cell>> {
        let reader = SerializedFileReader::new(File::open(path).expect("written")).expect("Parquet");
        let rows = reader.get_row_iter(None).expect("rows");
        rows.map(|row| row.expect("row").get_column_iter().map(|(_, field)| cell(field)).collect()).collect()
    }

    fn cell(field: &Field) -> Cell {
        match field {
            Field::ULong(value) => Cell::Integer(*value),
            Field::Double(value) => Cell::Integer(value.to_bits()),
            Field::Str(word) => Cell::Word(word.clone()),
            Field::Null => Cell::Empty,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn values_read_back_to_their_bits() {
        let dir = tempfile::tempdir().expect("tempdir");
        let path = dir.path().join("a.parquet");
        let columns = [
            Column::from("step".to_owned()),
            Column::from("u_m".to_owned()),
            Column::from("never".to_owned()),
            Column::new("error", Kind::Word),
        ];
        let values = [0.1, -0.0, 5e-324, f64::INFINITY, f64::NAN];
        let mut table = Table::create(&path, &columns, false).expect("new file");
        table.integer(0).empty().empty().empty().end_row().expect("memory");
        for value in values {
            table
                .integer(u64::MAX)
                .double(value)
                .empty()
                .cell(Cell::Word("a, \"b\"".to_owned()))
                .end_row()
                .expect("memory");
        }
        assert!(!path.exists());
        table.finish().expect("disk");
        let rows = read(&path);
        assert_eq!(rows[0], [Cell::Integer(0), Cell::Empty, Cell::Empty, Cell::Empty]);
        for (row, value) in rows[1..].iter().zip(values) {
            let word = Cell::Word("a, \"b\"".to_owned());
            assert_eq!(*row, [Cell::Integer(u64::MAX), Cell::Integer(value.to_bits()), Cell::Empty, word]);
        }
        assert_eq!(rows.len(), 6);
    }

    #[test]
    fn many_rows_take_several_groups() {
        let dir = tempfile::tempdir().expect("tempdir");
        let path = dir.path().join("a.parquet");
        let columns = ["step".to_owned(), "time_s".to_owned()];
        let mut table = Table::create(&path, &columns, false).expect("new file");
        let rows = GROUP_CELLS as u64; // two cells each: two groups
        for step in 0..rows {
            table.integer(step).double(step as f64 * 1e-6).end_row().expect("disk");
        }
        table.finish().expect("disk");
        let reader = SerializedFileReader::new(File::open(&path).expect("written")).expect("Parquet");
        assert_eq!(reader.num_row_groups(), 2);
        let read = read(&path);
        assert_eq!(read.len() as u64, rows);
        let last = rows - 1;
        assert_eq!(read[read.len() - 1], [last, (last as f64 * 1e-6).to_bits()].map(Cell::Integer));
    }

    #[test]
    fn a_table_without_rows_has_its_columns() {
        let dir = tempfile::tempdir().expect("tempdir");
        let path = dir.path().join("a.parquet");
        Table::create(&path, &["step".to_owned()], false).expect("new file").finish().expect("disk");
        assert_eq!(read(&path).len(), 0);
    }

    #[test]
    fn what_nobody_could_read_does_not_stay() {
        let dir = tempfile::tempdir().expect("tempdir");
        let path = dir.path().join("a.parquet");
        let mut table = Table::create(&path, &["step".to_owned()], false).expect("new file");
        table.integer(1).end_row().expect("memory");
        drop(table);
        assert_eq!(std::fs::read_dir(dir.path()).expect("listed").count(), 0);
    }
}
