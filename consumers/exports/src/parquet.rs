//! Parquet: a row for each state, with lists of the values of its beads; the beads in a table beside it.

use super::{Excerpt, Export, ExportError, Format, beside, chain_table};
use consumers::table::Table;
use parquet::basic::{Compression, ConvertedType, LogicalType, Repetition, Type as Physical, ZstdLevel};
use parquet::column::writer::ColumnWriter;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{ColumnPath, Type};
use schemas::frame::Frame;
use schemas::whole_file::{WholeFile, WholeFileError};
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Displacements of one group of rows: with the velocities and their levels 24 MB in memory.
const GROUP_VALUES: usize = 1 << 20;

/// Rows of one group, if they are short.
const GROUP_ROWS: usize = 1 << 18;

/// Key of the manifest in the metadata of the file.
const MANIFEST_KEY: &str = "beadline.manifest";

/// Name of the file of the beads.
pub(super) const CHAIN: &str = "chain.parquet";

/// The columns of lists.
const LISTS: [&str; 2] = ["displacement_m", "velocity_m_s"];

/// The file, and the rows of the next group.
pub(super) struct Parquet {
    writer: SerializedFileWriter<Arc<File>>,
    file: WholeFile,
    chain: Table,
    excerpt: Excerpt,
    /// Numbers of the frames, of those rows that are frames.
    frames: Vec<i64>,
    /// 1 for each row that is a frame, 0 for the others.
    is_frame: Vec<i16>,
    steps: Vec<i64>,
    times_s: Vec<f64>,
    u_m: Vec<f64>,
    v_m_s: Vec<f64>,
    /// 0 for the first value of each list, 1 for the others.
    list_levels: Vec<i16>,
    /// 1 for each value: there are no lists without values.
    value_levels: Vec<i16>,
}

impl Parquet {
    pub(super) fn create(path: &Path, excerpt: &Excerpt, replace: bool) -> Result<Self, WholeFileError> {
        let file = WholeFile::create(path, replace)?;
        let chain = chain_table(&beside(path, Format::Parquet, CHAIN), excerpt, replace)?;
        let writer = begin(&file, excerpt).map_err(|error| error_of(&file, error))?;
        Ok(Self {
            writer,
            file,
            chain,
            excerpt: excerpt.clone(),
            frames: Vec::new(),
            is_frame: Vec::new(),
            steps: Vec::new(),
            times_s: Vec::new(),
            u_m: Vec::new(),
            v_m_s: Vec::new(),
            list_levels: Vec::new(),
            value_levels: Vec::new(),
        })
    }

    fn write_group(&mut self) -> Result<(), WholeFileError> {
        let written = self.try_write_group();
        written.map_err(|error| error_of(&self.file, error))?;
        for numbers in [&mut self.frames, &mut self.steps] {
            numbers.clear();
        }
        for levels in [&mut self.is_frame, &mut self.list_levels, &mut self.value_levels] {
            levels.clear();
        }
        for values in [&mut self.times_s, &mut self.u_m, &mut self.v_m_s] {
            values.clear();
        }
        Ok(())
    }

    fn try_write_group(&mut self) -> Result<(), ParquetError> {
        if self.steps.is_empty() {
            return Ok(());
        }
        let mut rows = self.writer.next_row_group()?;
        let mut number = 0;
        while let Some(mut column) = rows.next_column()? {
            let (values, lists) = (Some(self.value_levels.as_slice()), Some(self.list_levels.as_slice()));
            match (number, column.untyped()) {
                (0, ColumnWriter::Int64ColumnWriter(out)) => {
                    out.write_batch(&self.frames, Some(&self.is_frame), None)?
                }
                (1, ColumnWriter::Int64ColumnWriter(out)) => out.write_batch(&self.steps, None, None)?,
                (2, ColumnWriter::DoubleColumnWriter(out)) => out.write_batch(&self.times_s, None, None)?,
                (3, ColumnWriter::DoubleColumnWriter(out)) => out.write_batch(&self.u_m, values, lists)?,
                (_, ColumnWriter::DoubleColumnWriter(out)) => out.write_batch(&self.v_m_s, values, lists)?,
                _ => return Err(ParquetError::General(format!("column {number} is of another type"))),
            };
            column.close()?;
            number += 1;
        }
        rows.close()?;
        Ok(())
    }
}

impl Export for Parquet {
    fn frame(&mut self, frame: &Frame<'_>) -> Result<(), ExportError> {
        let (u_m, v_m_s) = self.excerpt.of(frame);
        if !self.steps.is_empty()
            && (self.u_m.len() + u_m.len() > GROUP_VALUES || self.steps.len() >= GROUP_ROWS)
        {
            self.write_group()?;
        }
        let number = self.excerpt.frame_at(frame.step);
        self.frames.extend(number.map(u64::cast_signed));
        self.is_frame.push(i16::from(number.is_some()));
        // the schema says that the bits are those of unsigned numbers
        self.steps.push(frame.step.cast_signed());
        self.times_s.push(frame.time_s);
        self.u_m.extend_from_slice(u_m);
        self.v_m_s.extend_from_slice(v_m_s);
        self.list_levels.push(0);
        self.list_levels.resize(self.u_m.len(), 1);
        self.value_levels.resize(self.u_m.len(), 1);
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<Vec<PathBuf>, ExportError> {
        self.write_group()?;
        let Self { writer, file, chain, .. } = *self;
        writer.close().map_err(|error| error_of(&file, error))?;
        // the states last: where they are the others are, too
        let chain = chain.finish()?;
        Ok(vec![file.publish()?, chain])
    }
}

fn error_of(file: &WholeFile, error: ParquetError) -> WholeFileError {
    WholeFileError::io(file.partial())(io::Error::other(error))
}

/// Writes the head of the file.
fn begin(file: &WholeFile, excerpt: &Excerpt) -> Result<SerializedFileWriter<Arc<File>>, ParquetError> {
    let number = |name, repetition| {
        Type::primitive_type_builder(name, Physical::INT64)
            .with_logical_type(Some(LogicalType::integer(64, false)))
            .with_repetition(repetition)
            .build()
    };
    let [u_m, v_m_s] = LISTS;
    let fields = vec![
        Arc::new(number("frame", Repetition::OPTIONAL)?),
        Arc::new(number("step", Repetition::REQUIRED)?),
        Arc::new(double("time_s")?),
        Arc::new(list(u_m)?),
        Arc::new(list(v_m_s)?),
    ];
    let schema = Arc::new(Type::group_type_builder("schema").with_fields(fields).build()?);
    let manifest = KeyValue::new(MANIFEST_KEY.to_owned(), excerpt.manifest.to_json());
    let mut properties = WriterProperties::builder()
        .set_created_by(concat!("beadline ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_key_value_metadata(Some(vec![manifest]));
    for name in LISTS {
        // doubles hardly repeat, and extremes of a list say little
        let values = ColumnPath::new([name, "list", "element"].map(str::to_owned).to_vec());
        properties = properties
            .set_column_dictionary_enabled(values.clone(), false)
            .set_column_statistics_enabled(values, EnabledStatistics::None);
    }
    SerializedFileWriter::new(Arc::clone(file.file()), schema, Arc::new(properties.build()))
}

fn double(name: &str) -> Result<Type, ParquetError> {
    Type::primitive_type_builder(name, Physical::DOUBLE).with_repetition(Repetition::REQUIRED).build()
}

/// A list of doubles, as the format wants lists to be nested.
fn list(name: &str) -> Result<Type, ParquetError> {
    let values = Type::group_type_builder("list")
        .with_repetition(Repetition::REPEATED)
        .with_fields(vec![Arc::new(double("element")?)])
        .build()?;
    Type::group_type_builder(name)
        .with_repetition(Repetition::REQUIRED)
        .with_logical_type(Some(LogicalType::List))
        .with_converted_type(ConvertedType::LIST)
        .with_fields(vec![Arc::new(values)])
        .build()
}
