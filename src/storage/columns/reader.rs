//! Reads a file of columns; trusts nothing it has not checked.

use super::super::{Column, StorageError};
use super::{CHUNK, ColumnEntry, FORMAT_MAJOR, Header, MAGIC, NumberType, PREAMBLE};
use crate::math::Vec3;
use serde::Deserialize;
use std::borrow::Cow;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// The part of the header that every version has.
#[derive(Deserialize)]
struct VersionOnly {
    format_major: u32,
    format_minor: u32,
    #[serde(default)]
    tollgate_version: String,
}

/// A file of columns, opened: its header has been checked, a column is checked when it is read.
pub struct ColumnReader {
    path: PathBuf,
    source: RefCell<Box<dyn Source>>,
    header: Header,
    /// Where the columns start [bytes].
    base: u64,
}

/// What columns are read from.
pub(super) trait Source: Read + Seek + Send {}
impl<S: Read + Seek + Send> Source for S {}

impl std::fmt::Debug for ColumnReader {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ColumnReader").field("path", &self.path).field("header", &self.header).finish_non_exhaustive()
    }
}

impl ColumnReader {
    /// Opens a file of the kind `kind` and checks its header and size.
    ///
    /// # Errors
    /// When the file cannot be read, is foreign, of another kind, truncated, edited, or of another format version.
    pub fn open(path: &Path, kind: &str) -> Result<Self, StorageError> {
        let file = File::open(path).map_err(|source| StorageError::system("open", path, source))?;
        let size = file.metadata().map_err(|source| StorageError::system("read", path, source))?.len();
        Self::from_source(path, Box::new(file), size, kind)
    }

    pub(super) fn from_source(
        path: &Path,
        mut source: Box<dyn Source>,
        size: u64,
        kind: &str,
    ) -> Result<Self, StorageError> {
        let failed = |source| StorageError::system("read", path, source);
        let refuse = |reason: String| StorageError::unusable(path, reason);
        let mut preamble = [0; PREAMBLE as usize];
        let read = read_up_to(&mut source, &mut preamble).map_err(failed)?;
        if read < MAGIC.len() || &preamble[..8] != MAGIC {
            return Err(refuse(format!("it is not a {kind} of tollgate")));
        }
        let [length, digest] = [&preamble[8..16], &preamble[16..48]];
        let length = u64::from_le_bytes(length.try_into().unwrap_or_default());
        // The header's length is a claim until the file has proved large enough for it.
        let base = PREAMBLE.checked_add(length).filter(|&base| base <= size && read == preamble.len());
        let Some(base) = base else {
            return Err(refuse(format!("it is truncated: {size} bytes, its header alone needs more; {NEXT}")));
        };
        let mut text = vec![0; length as usize];
        source.read_exact(&mut text).map_err(failed)?;
        if blake3::hash(&text).as_bytes()[..] != *digest {
            return Err(refuse(format!("its header was edited or damaged; {NEXT}")));
        }
        let header = parse_header(&text, kind).map_err(refuse)?;
        check_layout(&header.columns, size - base).map_err(refuse)?;
        Ok(Self { path: path.to_path_buf(), source: RefCell::new(source), header, base })
    }

    /// Version of the program that wrote the file.
    #[must_use]
    pub fn tollgate_version(&self) -> &str {
        &self.header.tollgate_version
    }

    /// What the header says about each column.
    #[must_use]
    pub fn columns(&self) -> &[ColumnEntry] {
        &self.header.columns
    }

    /// True where the file has a column of this name.
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.header.columns.iter().any(|entry| entry.name == name)
    }

    /// A fact of the header, where it has it.
    #[must_use]
    pub fn attribute(&self, name: &str) -> Option<&serde_json::Value> {
        self.header.attributes.get(name)
    }

    /// A fact of the header that must be a whole number.
    ///
    /// # Errors
    /// When it is missing or something else.
    pub fn attribute_u64(&self, name: &str) -> Result<u64, StorageError> {
        let value = self.attribute(name).and_then(serde_json::Value::as_u64);
        value.ok_or_else(|| self.refuse(format!("its header has no whole number {name:?}")))
    }

    /// A fact of the header that must be a real number.
    ///
    /// # Errors
    /// When it is missing or something else.
    pub fn attribute_f64(&self, name: &str) -> Result<f64, StorageError> {
        let value = self.attribute(name).and_then(serde_json::Value::as_f64);
        value.ok_or_else(|| self.refuse(format!("its header has no number {name:?}")))
    }

    /// A fact of the header that must be text.
    ///
    /// # Errors
    /// When it is missing or something else.
    pub fn attribute_text(&self, name: &str) -> Result<&str, StorageError> {
        let value = self.attribute(name).and_then(serde_json::Value::as_str);
        value.ok_or_else(|| self.refuse(format!("its header has no text {name:?}")))
    }

    /// Reads the column `name` of real numbers.
    ///
    /// # Errors
    /// When there is no such column of real numbers, or its bytes were edited or damaged.
    pub fn f64s(&self, name: &str) -> Result<Vec<f64>, StorageError> {
        self.numbers(name, NumberType::F64, 1, f64::from_le_bytes)
    }

    /// Reads the column `name` of vectors.
    ///
    /// # Errors
    /// As [`ColumnReader::f64s`].
    pub fn vec3s(&self, name: &str) -> Result<Vec<Vec3>, StorageError> {
        self.numbers(name, NumberType::F64, 3, |row: [u8; 24]| {
            let [x, y, z] = std::array::from_fn(|axis| std::array::from_fn(|byte| row[8 * axis + byte]));
            Vec3::new(f64::from_le_bytes(x), f64::from_le_bytes(y), f64::from_le_bytes(z))
        })
    }

    /// Reads the column `name` of u64.
    ///
    /// # Errors
    /// As [`ColumnReader::f64s`].
    pub fn u64s(&self, name: &str) -> Result<Vec<u64>, StorageError> {
        self.numbers(name, NumberType::U64, 1, u64::from_le_bytes)
    }

    /// Reads the column `name` of u32.
    ///
    /// # Errors
    /// As [`ColumnReader::f64s`].
    pub fn u32s(&self, name: &str) -> Result<Vec<u32>, StorageError> {
        self.numbers(name, NumberType::U32, 1, u32::from_le_bytes)
    }

    /// Reads the column `name` of u16.
    ///
    /// # Errors
    /// As [`ColumnReader::f64s`].
    pub fn u16s(&self, name: &str) -> Result<Vec<u16>, StorageError> {
        self.numbers(name, NumberType::U16, 1, u16::from_le_bytes)
    }

    /// Reads the column `name` of u8.
    ///
    /// # Errors
    /// As [`ColumnReader::f64s`].
    pub fn u8s(&self, name: &str) -> Result<Vec<u8>, StorageError> {
        self.numbers(name, NumberType::U8, 1, u8::from_le_bytes)
    }

    /// Checks the digests of all columns without keeping them.
    ///
    /// # Errors
    /// When one was edited or damaged; names the first.
    pub fn verify(&self) -> Result<(), StorageError> {
        self.header.columns.iter().try_for_each(|entry| self.read(entry, |_| {}))
    }

    fn numbers<T, const N: usize>(
        &self,
        name: &str,
        number: NumberType,
        components: u64,
        value: impl Fn([u8; N]) -> T,
    ) -> Result<Vec<T>, StorageError> {
        let found = self.header.columns.iter().find(|entry| entry.name == name);
        let entry = found.ok_or_else(|| self.refuse(format!("it has no column {name:?}; {NEXT}")))?;
        if entry.number != number || entry.components != components {
            let (stored, by) = (entry.number, entry.components);
            let reason = format!("column {name:?} holds {stored:?} x {by}, not {number:?} x {components}; {NEXT}");
            return Err(self.refuse(reason));
        }
        // The product was held against the file's size when the file was opened.
        let mut values = Vec::with_capacity(entry.bytes().unwrap_or_default() as usize / N);
        self.read(entry, |bytes| {
            values.extend(bytes.as_chunks::<N>().0.iter().map(|&number| value(number)));
        })?;
        Ok(values)
    }

    /// Hands the column's bytes over in blocks of whole numbers, then compares the digest.
    fn read(&self, entry: &ColumnEntry, mut block: impl FnMut(&[u8])) -> Result<(), StorageError> {
        let failed = |source: io::Error| match source.kind() {
            io::ErrorKind::UnexpectedEof => self.refuse(format!("it was cut while it was read; {NEXT}")),
            _ => StorageError::system("read", &self.path, source),
        };
        let mut source = self.source.borrow_mut();
        source.seek(SeekFrom::Start(self.base + entry.offset)).map_err(failed)?;
        let mut left = entry.bytes().unwrap_or_default();
        let mut buffer = vec![0; left.min(BLOCK) as usize];
        let mut hasher = blake3::Hasher::new();
        while left > 0 {
            let part = &mut buffer[..left.min(BLOCK) as usize];
            source.read_exact(part).map_err(failed)?;
            hasher.update(part);
            block(part);
            left -= part.len() as u64;
        }
        if hasher.finalize().to_hex().as_str() != entry.blake3 {
            return Err(self.refuse(format!("column {:?} was edited or damaged; {NEXT}", entry.name)));
        }
        Ok(())
    }

    fn refuse(&self, reason: String) -> StorageError {
        StorageError::unusable(&self.path, reason)
    }
}

/// What next, for a file that cannot be saved.
/// Bytes that are read at once: whole rows of every kind of column.
const BLOCK: u64 = (8 * CHUNK as u64).next_multiple_of(24);

const NEXT: &str = "use an older file, or run again from the start";

fn read_up_to(source: &mut dyn Read, buffer: &mut [u8]) -> io::Result<usize> {
    let mut read = 0;
    while read < buffer.len() {
        match source.read(&mut buffer[read..])? {
            0 => break,
            count => read += count,
        }
    }
    Ok(read)
}

fn parse_header(text: &[u8], kind: &str) -> Result<Header, String> {
    let unreadable = |error: serde_json::Error| format!("its header cannot be understood ({error}); {NEXT}");
    // The version first: a newer header may look different.
    let version: VersionOnly = serde_json::from_slice(text).map_err(unreadable)?;
    if version.format_major != FORMAT_MAJOR {
        let VersionOnly { format_major, format_minor, tollgate_version } = version;
        return Err(format!(
            "it has format {format_major}.{format_minor} of tollgate {tollgate_version}; this program reads format \
             {FORMAT_MAJOR}; use the version that wrote it"
        ));
    }
    let header: Header = serde_json::from_slice(text).map_err(unreadable)?;
    if header.kind != kind {
        return Err(format!("it is a {}, not a {kind}", header.kind));
    }
    Ok(header)
}

/// Columns lie one after the other and fill the file exactly.
fn check_layout(columns: &[ColumnEntry], space: u64) -> Result<(), String> {
    let mut end = 0_u64;
    for entry in columns {
        let next = entry.bytes().and_then(|bytes| end.checked_add(bytes));
        match next {
            Some(next) if entry.offset == end => end = next,
            _ => return Err(format!("the place of column {:?} is impossible; {NEXT}", entry.name)),
        }
    }
    match space.cmp(&end) {
        std::cmp::Ordering::Less => Err(format!("it is truncated: {} bytes are missing; {NEXT}", end - space)),
        std::cmp::Ordering::Greater => {
            Err(format!("{} bytes follow its last column that do not belong to it; {NEXT}", space - end))
        }
        std::cmp::Ordering::Equal => Ok(()),
    }
}

/// All columns of a file, owned; what a loader takes that does not care for the file.
///
/// # Errors
/// As [`ColumnReader::f64s`], for the first column that fails.
pub fn read_all(reader: &ColumnReader) -> Result<BTreeMap<String, Column<'static>>, StorageError> {
    let columns = reader.columns().iter().map(|entry| {
        let name = entry.name.as_str();
        let column = match (entry.number, entry.components) {
            (NumberType::F64, 3) => Column::Vec3(Cow::Owned(reader.vec3s(name)?)),
            (NumberType::F64, _) => Column::from(reader.f64s(name)?),
            (NumberType::U64, _) => Column::from(reader.u64s(name)?),
            (NumberType::U32, _) => Column::from(reader.u32s(name)?),
            (NumberType::U16, _) => Column::from(reader.u16s(name)?),
            (NumberType::U8, _) => Column::from(reader.u8s(name)?),
        };
        Ok((name.to_owned(), column))
    });
    columns.collect()
}
