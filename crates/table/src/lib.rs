//! Flat tables of named columns of doubles as Parquet files.
//!
//! A [`Table`] has columns of equal length and one text of metadata. [`Table::to_parquet`] and
//! [`Table::read`] keep every bit of every number. Any data-frame library reads the files.
//!
//! ```
//! use trocar_table::Table;
//!
//! let table = Table {
//!     metadata: "{\"unit\": \"mm\"}".to_owned(),
//!     columns: vec![("time_s".to_owned(), vec![0.0, 0.1]), ("lift_mm".to_owned(), vec![0.0, 1.5])],
//! };
//! let bytes = table.to_parquet("example", "1.0")?;
//! assert_eq!(&bytes[..4], b"PAR1");
//! # Ok::<(), trocar_table::Error>(())
//! ```

use parquet::basic::{Repetition, Type as Physical};
use parquet::column::reader::ColumnReader;
use parquet::data_type::DoubleType;
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;
use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

/// What is wrong with a table or its file. The caller knows the file's name.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum Error {
    /// The table cannot be written.
    #[error("cannot be written: {0}")]
    Unwritable(String),
    /// The file is not Parquet, or damaged.
    #[error("is not a readable Parquet file: {0}")]
    Unreadable(String),
    /// The file is Parquet, but another program's.
    #[error("has no '{0}' metadata")]
    NoMetadata(String),
    /// A column is not of doubles, or shorter than the table.
    #[error("its column '{0}' does not hold one double a row")]
    Column(String),
    /// The file has more rows than the caller reads.
    #[error("has {rows} rows; at most {limit} are read")]
    TooLong {
        /// Rows of the file.
        rows: usize,
        /// Rows that the caller allows.
        limit: usize,
    },
}

/// A table: columns by name, all of the same length, and a text of metadata.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// The metadata, stored under the program's name.
    pub metadata: String,
    /// Name and values of each column.
    pub columns: Vec<(String, Vec<f64>)>,
}

impl Table {
    /// Rows of the table.
    pub fn rows(&self) -> usize {
        self.columns.first().map_or(0, |(_, values)| values.len())
    }

    /// The column called `name`.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.iter().find(|(n, _)| n == name).map(|(_, values)| values.as_slice())
    }

    /// The Parquet file as bytes. `program` is the metadata's key; with `version` it names the
    /// creator.
    ///
    /// # Errors
    /// Columns of different lengths.
    pub fn to_parquet(&self, program: &str, version: &str) -> Result<Vec<u8>, Error> {
        if let Some((name, _)) = self.columns.iter().find(|(_, values)| values.len() != self.rows()) {
            return Err(Error::Column(name.clone()));
        }
        self.encode(program, version).map_err(|e| Error::Unwritable(e.to_string()))
    }

    fn encode(&self, program: &str, version: &str) -> Result<Vec<u8>, ParquetError> {
        let field = |(name, _): &(String, Vec<f64>)| {
            let required = Type::primitive_type_builder(name, Physical::DOUBLE).with_repetition(Repetition::REQUIRED);
            required.build().map(Arc::new)
        };
        let fields = self.columns.iter().map(field).collect::<Result<_, _>>()?;
        let schema = Type::group_type_builder("channels").with_fields(fields).build()?;
        let metadata = KeyValue::new(program.to_owned(), self.metadata.clone());
        let properties = WriterProperties::builder()
            .set_created_by(format!("{program} {version}"))
            .set_key_value_metadata(Some(vec![metadata]))
            .build();
        let mut writer = SerializedFileWriter::new(Vec::new(), Arc::new(schema), Arc::new(properties))?;
        let mut group = writer.next_row_group()?;
        for (_, values) in &self.columns {
            if let Some(mut column) = group.next_column()? {
                column.typed::<DoubleType>().write_batch(values, None, None)?;
                column.close()?;
            }
        }
        group.close()?;
        writer.into_inner()
    }

    /// Reads a table of at most `limit` rows that [`Table::to_parquet`] wrote for `program`.
    ///
    /// # Errors
    /// A file that is not Parquet, damaged, another program's, too long, or not all of doubles.
    pub fn read(file: File, program: &str, limit: usize) -> Result<Self, Error> {
        // The decoder may panic on damaged pages; the file is bad then, too.
        catch_unwind(AssertUnwindSafe(|| decode(file, program, limit)))
            .unwrap_or_else(|_| Err(Error::Unreadable("its pages are damaged".to_owned())))
    }
}

fn decode(file: File, program: &str, limit: usize) -> Result<Table, Error> {
    let failed = |e: ParquetError| Error::Unreadable(e.to_string());
    let reader = SerializedFileReader::new(file).map_err(failed)?;
    let metadata = reader.metadata().file_metadata();
    let values = metadata.key_value_metadata().and_then(|all| all.iter().find(|kv| kv.key == program));
    let text = values.and_then(|kv| kv.value.clone()).ok_or_else(|| Error::NoMetadata(program.to_owned()))?;
    let rows = usize::try_from(metadata.num_rows()).unwrap_or(usize::MAX);
    if rows > limit {
        return Err(Error::TooLong { rows, limit });
    }
    let mut table = Table { metadata: text, columns: Vec::new() };
    for (index, described) in metadata.schema_descr().columns().iter().enumerate() {
        let name = described.name().to_owned();
        let mut values = Vec::new();
        for g in 0..reader.num_row_groups() {
            let group = reader.get_row_group(g).map_err(failed)?;
            let ColumnReader::DoubleColumnReader(mut column) = group.get_column_reader(index).map_err(failed)? else {
                return Err(Error::Column(name));
            };
            while values.len() < rows {
                let (_, read, _) = column.read_records(rows - values.len(), None, None, &mut values).map_err(failed)?;
                if read == 0 {
                    break;
                }
            }
        }
        if values.len() != rows {
            return Err(Error::Column(name));
        }
        table.columns.push((name, values));
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Seek, Write};

    fn file(bytes: &[u8]) -> File {
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(bytes).unwrap();
        file.rewind().unwrap();
        file
    }

    fn table() -> Table {
        let column = |scale: f64| (0..1000).map(|k| scale * f64::from(k) / 3.0).collect();
        let columns = vec![("a".to_owned(), column(1.0)), ("b".to_owned(), column(-1e-300))];
        Table { metadata: "{}".to_owned(), columns }
    }

    #[test]
    fn every_bit_comes_back() {
        let mut table = table();
        table.columns[0].1[7] = f64::NAN;
        let bytes = table.to_parquet("test", "1").unwrap();
        let read = Table::read(file(&bytes), "test", 1000).unwrap();
        assert_eq!(read.metadata, "{}");
        assert_eq!(read.rows(), 1000);
        for ((name, values), (_, before)) in read.columns.iter().zip(&table.columns) {
            assert_eq!(read.column(name).unwrap().len(), 1000);
            assert!(values.iter().zip(before).all(|(a, b)| a.to_bits() == b.to_bits()));
        }
    }

    #[test]
    fn bad_tables_and_files_have_one_line() {
        let mut ragged = table();
        ragged.columns[1].1.pop();
        assert_eq!(ragged.to_parquet("test", "1").unwrap_err(), Error::Column("b".to_owned()));
        let bytes = table().to_parquet("test", "1").unwrap();
        let said = |bytes: &[u8], program: &str, limit: usize| {
            Table::read(file(bytes), program, limit).unwrap_err().to_string()
        };
        assert_eq!(said(&bytes, "other", 1000), "has no 'other' metadata");
        assert_eq!(said(&bytes, "test", 999), "has 1000 rows; at most 999 are read");
        assert!(said(&bytes[..bytes.len() / 2], "test", 1000).contains("is not a readable Parquet file"));
        assert!(said(b"PAR1", "test", 1000).contains("is not a readable Parquet file"));
    }
}
