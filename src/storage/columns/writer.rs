//! Writes a file of columns.

use super::super::staging::StagedFile;
use super::super::{Column, StorageError};
use super::{CHUNK, ColumnEntry, FORMAT_MAJOR, FORMAT_MINOR, Header, MAGIC, NumberType};
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::Path;

/// Gathers columns and writes them as one file.
#[derive(Debug)]
pub struct ColumnWriter<'a> {
    kind: String,
    attributes: BTreeMap<String, serde_json::Value>,
    columns: Vec<(String, Column<'a>)>,
}

impl<'a> ColumnWriter<'a> {
    /// A file of this kind (`checkpoint`, ...), without columns yet.
    #[must_use]
    pub fn new(kind: &str) -> Self {
        Self { kind: kind.to_owned(), attributes: BTreeMap::new(), columns: Vec::new() }
    }

    /// Adds a small fact to the header: the time step's number, a key, a name. Replaces an older one.
    pub fn attribute(&mut self, name: &str, value: impl Into<serde_json::Value>) -> &mut Self {
        self.attributes.insert(name.to_owned(), value.into());
        self
    }

    /// Adds a column. Its name must be new to the file.
    pub fn column(&mut self, name: &str, column: impl Into<Column<'a>>) -> &mut Self {
        self.columns.push((name.to_owned(), column.into()));
        self
    }

    /// Writes the file: staging name, synchronised with the disk, renamed. An older file at `path` stays until then.
    ///
    /// # Errors
    /// When the disk refuses, or two columns have one name.
    pub fn write(&self, path: &Path) -> Result<(), StorageError> {
        self.write_described(path).map(drop)
    }

    /// As [`ColumnWriter::write`]; returns what the header says about each column.
    ///
    /// # Errors
    /// As [`ColumnWriter::write`].
    pub fn write_described(&self, path: &Path) -> Result<Vec<ColumnEntry>, StorageError> {
        let header = self.header(path)?;
        let text = serde_json::to_vec(&header).map_err(|error| StorageError::mismatch(path, error.to_string()))?;
        let mut file = StagedFile::create(path)?;
        let written = file
            .write_all(MAGIC)
            .and_then(|()| file.write_all(&(text.len() as u64).to_le_bytes()))
            .and_then(|()| file.write_all(blake3::hash(&text).as_bytes()))
            .and_then(|()| file.write_all(&text))
            .and_then(|()| self.columns.iter().try_for_each(|(_, column)| write_bytes(column, &mut file)));
        written.map_err(|source| file.failed(source))?;
        file.commit_durably()?;
        Ok(header.columns)
    }

    fn header(&self, path: &Path) -> Result<Header, StorageError> {
        let mut columns: Vec<ColumnEntry> = Vec::with_capacity(self.columns.len());
        let mut offset = 0;
        for (name, column) in &self.columns {
            if columns.iter().any(|earlier| &earlier.name == name) {
                return Err(StorageError::mismatch(path, format!("two columns are named {name:?}")));
            }
            let mut hasher = blake3::Hasher::new();
            write_bytes(column, &mut hasher).map_err(|source| StorageError::system("write", path, source))?;
            let entry = ColumnEntry {
                name: name.clone(),
                number: number_type(column),
                components: column.components() as u64,
                length: column.len() as u64,
                offset,
                blake3: hasher.finalize().to_hex().to_string(),
            };
            offset += hasher.count();
            columns.push(entry);
        }
        Ok(Header {
            format_major: FORMAT_MAJOR,
            format_minor: FORMAT_MINOR,
            kind: self.kind.clone(),
            tollgate_version: env!("CARGO_PKG_VERSION").to_owned(),
            attributes: self.attributes.clone(),
            columns,
        })
    }
}

const fn number_type(column: &Column) -> NumberType {
    match column {
        Column::F64(_) | Column::Vec3(_) => NumberType::F64,
        Column::U64(_) => NumberType::U64,
        Column::U32(_) => NumberType::U32,
        Column::U16(_) => NumberType::U16,
        Column::U8(_) => NumberType::U8,
    }
}

fn write_bytes(column: &Column, out: &mut impl Write) -> io::Result<()> {
    match column {
        Column::F64(values) => write_numbers(values, f64::to_le_bytes, out),
        Column::U64(values) => write_numbers(values, u64::to_le_bytes, out),
        Column::U32(values) => write_numbers(values, u32::to_le_bytes, out),
        Column::U16(values) => write_numbers(values, u16::to_le_bytes, out),
        Column::U8(values) => out.write_all(values),
        Column::Vec3(values) => values.chunks(CHUNK).try_for_each(|chunk| {
            let flat: Vec<[f64; 3]> = chunk.iter().map(|vector| vector.data.0[0]).collect();
            write_numbers(flat.as_flattened(), f64::to_le_bytes, out)
        }),
    }
}

fn write_numbers<T: Copy, const N: usize>(
    values: &[T],
    bytes: impl Fn(T) -> [u8; N],
    out: &mut impl Write,
) -> io::Result<()> {
    values.chunks(CHUNK).try_for_each(|chunk| {
        let block: Vec<[u8; N]> = chunk.iter().map(|&value| bytes(value)).collect();
        out.write_all(block.as_flattened())
    })
}
