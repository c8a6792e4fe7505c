//! A single file of named columns: the container of checkpoints.
//!
//! Layout, little-endian throughout:
//! ```text
//! bytes 0..8     "TOLLGATE"
//! bytes 8..16    length of the header [bytes], u64
//! bytes 16..48   blake3 digest of the header
//! header         JSON: format version, kind, program version, attributes, columns
//!                (name, type, components, length, offset from the header's end, blake3 digest)
//! columns        one after the other without gaps, to the end of the file
//! ```
//! Every byte is covered by a digest or checked by value, so no flipped bit goes unnoticed. The container knows
//! nothing about what it holds: whoever has state offers named columns and asks for them again.

use super::staging::StagedFile;
use super::{Column, OutputError};
use crate::math::Vec3;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Version of the container: a reader refuses another major; a larger minor only adds.
pub const FORMAT_MAJOR: u32 = 1;
/// See [`FORMAT_MAJOR`].
pub const FORMAT_MINOR: u32 = 0;

const MAGIC: &[u8; 8] = b"TOLLGATE";
const PREAMBLE: u64 = 48;
/// Numbers converted to bytes at once.
const CHUNK: usize = 1 << 13;

/// Type of the numbers of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum NumberType {
    /// IEEE 754 double.
    F64,
    /// Unsigned, 64 bits.
    U64,
    /// Unsigned, 32 bits.
    U32,
    /// Unsigned, 16 bits.
    U16,
    /// Unsigned, 8 bits.
    U8,
}

impl NumberType {
    /// Size of one number [bytes].
    #[must_use]
    pub const fn size(self) -> u64 {
        match self {
            Self::F64 | Self::U64 => 8,
            Self::U32 => 4,
            Self::U16 => 2,
            Self::U8 => 1,
        }
    }
}

/// What the header says about one column.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ColumnEntry {
    /// Its name.
    pub name: String,
    /// Type of its numbers.
    #[serde(rename = "type")]
    pub number: NumberType,
    /// Numbers per value: 3 for vectors, else 1.
    pub components: u64,
    /// Number of values.
    pub length: u64,
    /// First byte, counted from the end of the header.
    pub offset: u64,
    /// blake3 digest of its bytes, hexadecimal.
    pub blake3: String,
}

impl ColumnEntry {
    /// Size [bytes], unless the header's numbers are beyond all measure.
    fn bytes(&self) -> Option<u64> {
        self.length.checked_mul(self.components)?.checked_mul(self.number.size())
    }
}

#[derive(Debug, Serialize, Deserialize)]
struct Header {
    format_major: u32,
    format_minor: u32,
    kind: String,
    tollgate_version: String,
    attributes: BTreeMap<String, serde_json::Value>,
    columns: Vec<ColumnEntry>,
}

/// The part of the header that every version has.
#[derive(Deserialize)]
struct VersionOnly {
    format_major: u32,
    format_minor: u32,
    #[serde(default)]
    tollgate_version: String,
}

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
    pub fn write(&self, path: &Path) -> Result<(), OutputError> {
        let header = self.header(path)?;
        let text = serde_json::to_vec(&header).map_err(|error| OutputError::mismatch(path, error.to_string()))?;
        let mut file = StagedFile::create(path)?;
        let written = file
            .write_all(MAGIC)
            .and_then(|()| file.write_all(&(text.len() as u64).to_le_bytes()))
            .and_then(|()| file.write_all(blake3::hash(&text).as_bytes()))
            .and_then(|()| file.write_all(&text))
            .and_then(|()| self.columns.iter().try_for_each(|(_, column)| write_bytes(column, &mut file)));
        written.map_err(|source| file.failed(source))?;
        file.commit_durably()
    }

    fn header(&self, path: &Path) -> Result<Header, OutputError> {
        let mut columns: Vec<ColumnEntry> = Vec::with_capacity(self.columns.len());
        let mut offset = 0;
        for (name, column) in &self.columns {
            if columns.iter().any(|earlier| &earlier.name == name) {
                return Err(OutputError::mismatch(path, format!("two columns are named {name:?}")));
            }
            let mut hasher = blake3::Hasher::new();
            write_bytes(column, &mut hasher).map_err(|source| OutputError::system("write", path, source))?;
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
            let flat: Vec<f64> = chunk.iter().flatten().copied().collect();
            write_numbers(&flat, f64::to_le_bytes, out)
        }),
    }
}

fn write_numbers<T: Copy, const N: usize>(
    values: &[T],
    bytes: impl Fn(T) -> [u8; N],
    out: &mut impl Write,
) -> io::Result<()> {
    values.chunks(CHUNK).try_for_each(|chunk| {
        let block: Vec<u8> = chunk.iter().flat_map(|&value| bytes(value)).collect();
        out.write_all(&block)
    })
}

/// A file of columns, opened: its header has been checked, a column is checked when it is read.
#[derive(Debug)]
pub struct ColumnReader {
    path: PathBuf,
    file: RefCell<File>,
    header: Header,
    /// Where the columns start [bytes].
    base: u64,
}

impl ColumnReader {
    /// Opens a file of the kind `kind` and checks its header and size.
    ///
    /// # Errors
    /// When the file cannot be read, is foreign, of another kind, truncated, edited, or of another format version.
    pub fn open(path: &Path, kind: &str) -> Result<Self, OutputError> {
        let failed = |source| OutputError::system("read", path, source);
        let refuse = |reason: String| OutputError::unusable(path, reason);
        let mut file = File::open(path).map_err(|source| OutputError::system("open", path, source))?;
        let size = file.metadata().map_err(failed)?.len();
        let mut preamble = [0; PREAMBLE as usize];
        let read = read_up_to(&mut file, &mut preamble).map_err(failed)?;
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
        file.read_exact(&mut text).map_err(failed)?;
        if blake3::hash(&text).as_bytes()[..] != *digest {
            return Err(refuse(format!("its header was edited or damaged; {NEXT}")));
        }
        let header = parse_header(&text, kind).map_err(refuse)?;
        check_layout(&header.columns, size - base).map_err(refuse)?;
        Ok(Self { path: path.to_path_buf(), file: RefCell::new(file), header, base })
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
    pub fn attribute_u64(&self, name: &str) -> Result<u64, OutputError> {
        let value = self.attribute(name).and_then(serde_json::Value::as_u64);
        value.ok_or_else(|| self.refuse(format!("its header has no whole number {name:?}")))
    }

    /// A fact of the header that must be a real number.
    ///
    /// # Errors
    /// When it is missing or something else.
    pub fn attribute_f64(&self, name: &str) -> Result<f64, OutputError> {
        let value = self.attribute(name).and_then(serde_json::Value::as_f64);
        value.ok_or_else(|| self.refuse(format!("its header has no number {name:?}")))
    }

    /// A fact of the header that must be text.
    ///
    /// # Errors
    /// When it is missing or something else.
    pub fn attribute_text(&self, name: &str) -> Result<&str, OutputError> {
        let value = self.attribute(name).and_then(serde_json::Value::as_str);
        value.ok_or_else(|| self.refuse(format!("its header has no text {name:?}")))
    }

    /// Reads the column `name` of real numbers.
    ///
    /// # Errors
    /// When there is no such column of real numbers, or its bytes were edited or damaged.
    pub fn f64s(&self, name: &str) -> Result<Vec<f64>, OutputError> {
        self.numbers(name, NumberType::F64, 1, f64::from_le_bytes)
    }

    /// Reads the column `name` of vectors.
    ///
    /// # Errors
    /// As [`ColumnReader::f64s`].
    pub fn vec3s(&self, name: &str) -> Result<Vec<Vec3>, OutputError> {
        let flat = self.numbers(name, NumberType::F64, 3, f64::from_le_bytes)?;
        Ok(flat.chunks_exact(3).map(|xyz| Vec3::new(xyz[0], xyz[1], xyz[2])).collect())
    }

    /// Reads the column `name` of u64.
    ///
    /// # Errors
    /// As [`ColumnReader::f64s`].
    pub fn u64s(&self, name: &str) -> Result<Vec<u64>, OutputError> {
        self.numbers(name, NumberType::U64, 1, u64::from_le_bytes)
    }

    /// Reads the column `name` of u32.
    ///
    /// # Errors
    /// As [`ColumnReader::f64s`].
    pub fn u32s(&self, name: &str) -> Result<Vec<u32>, OutputError> {
        self.numbers(name, NumberType::U32, 1, u32::from_le_bytes)
    }

    /// Reads the column `name` of u16.
    ///
    /// # Errors
    /// As [`ColumnReader::f64s`].
    pub fn u16s(&self, name: &str) -> Result<Vec<u16>, OutputError> {
        self.numbers(name, NumberType::U16, 1, u16::from_le_bytes)
    }

    /// Reads the column `name` of u8.
    ///
    /// # Errors
    /// As [`ColumnReader::f64s`].
    pub fn u8s(&self, name: &str) -> Result<Vec<u8>, OutputError> {
        self.numbers(name, NumberType::U8, 1, u8::from_le_bytes)
    }

    /// Checks the digests of all columns without keeping them.
    ///
    /// # Errors
    /// When one was edited or damaged; names the first.
    pub fn verify(&self) -> Result<(), OutputError> {
        self.header.columns.iter().try_for_each(|entry| self.read(entry, |_| {}))
    }

    fn numbers<T, const N: usize>(
        &self,
        name: &str,
        number: NumberType,
        components: u64,
        value: impl Fn([u8; N]) -> T,
    ) -> Result<Vec<T>, OutputError> {
        let found = self.header.columns.iter().find(|entry| entry.name == name);
        let entry = found.ok_or_else(|| self.refuse(format!("it has no column {name:?}; {NEXT}")))?;
        if entry.number != number || entry.components != components {
            let (stored, by) = (entry.number, entry.components);
            let reason = format!("column {name:?} holds {stored:?} x {by}, not {number:?} x {components}; {NEXT}");
            return Err(self.refuse(reason));
        }
        // The product was held against the file's size when the file was opened.
        let mut values = Vec::with_capacity((entry.length * entry.components) as usize);
        self.read(entry, |bytes| {
            values.extend(bytes.as_chunks::<N>().0.iter().map(|&number| value(number)));
        })?;
        Ok(values)
    }

    /// Hands the column's bytes over in blocks of whole numbers, then compares the digest.
    fn read(&self, entry: &ColumnEntry, mut block: impl FnMut(&[u8])) -> Result<(), OutputError> {
        let failed = |source: io::Error| match source.kind() {
            io::ErrorKind::UnexpectedEof => self.refuse(format!("it was cut while it was read; {NEXT}")),
            _ => OutputError::system("read", &self.path, source),
        };
        let mut file = self.file.borrow_mut();
        file.seek(SeekFrom::Start(self.base + entry.offset)).map_err(failed)?;
        let mut left = entry.bytes().unwrap_or_default();
        let mut buffer = vec![0; left.min(8 * CHUNK as u64) as usize];
        let mut hasher = blake3::Hasher::new();
        while left > 0 {
            let part = &mut buffer[..left.min(8 * CHUNK as u64) as usize];
            file.read_exact(part).map_err(failed)?;
            hasher.update(part);
            block(part);
            left -= part.len() as u64;
        }
        if hasher.finalize().to_hex().as_str() != entry.blake3 {
            return Err(self.refuse(format!("column {:?} was edited or damaged; {NEXT}", entry.name)));
        }
        Ok(())
    }

    fn refuse(&self, reason: String) -> OutputError {
        OutputError::unusable(&self.path, reason)
    }
}

/// What next, for a file that cannot be saved.
const NEXT: &str = "use an older file, or run again from the start";

fn read_up_to(file: &mut File, buffer: &mut [u8]) -> io::Result<usize> {
    let mut read = 0;
    while read < buffer.len() {
        match file.read(&mut buffer[read..])? {
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
pub fn read_all(reader: &ColumnReader) -> Result<BTreeMap<String, Column<'static>>, OutputError> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::exit_code;
    use crate::math::vec3;
    use proptest::prelude::*;
    use std::fs;

    const NUMBERS: [f64; 5] = [1.0 / 3.0, -0.0, f64::NAN, f64::INFINITY, 5e-324];

    fn sample(path: &Path) {
        let mut writer = ColumnWriter::new("checkpoint");
        writer.attribute("step", 12_u64).attribute("time_s", 0.1).attribute("key", "abc");
        writer.column("spring", NUMBERS.to_vec());
        writer.column("position", vec![vec3(1.0, 2.0, 3.0), vec3(-4.0, 5e-7, 6.0)]);
        writer.column("id", vec![u64::MAX, 1]);
        writer.column("neighbour", vec![7_u32; 3]);
        writer.column("material", vec![1_u16, 65_535]);
        writer.column("active", vec![1_u8, 0, 1]);
        writer.column("empty", Vec::<f64>::new());
        writer.write(path).unwrap();
    }

    fn sample_bytes() -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.checkpoint");
        sample(&path);
        fs::read(&path).unwrap()
    }

    fn load(bytes: &[u8]) -> Result<BTreeMap<String, Column<'static>>, OutputError> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.checkpoint");
        fs::write(&path, bytes).unwrap();
        read_all(&ColumnReader::open(&path, "checkpoint")?)
    }

    fn reason(bytes: &[u8]) -> String {
        let error = load(bytes).unwrap_err();
        assert_eq!(error.exit_code(), exit_code::STREAM_UNUSABLE, "{error}");
        error.to_string()
    }

    /// The file with its header's text changed and the digest made to fit, as another program could write it.
    fn with_header(bytes: &[u8], change: impl Fn(String) -> String) -> Vec<u8> {
        let length = u64::from_le_bytes(bytes[8..16].try_into().unwrap()) as usize;
        let text = change(String::from_utf8(bytes[48..48 + length].to_vec()).unwrap());
        let mut changed = MAGIC.to_vec();
        changed.extend((text.len() as u64).to_le_bytes());
        changed.extend(blake3::hash(text.as_bytes()).as_bytes());
        changed.extend(text.as_bytes());
        changed.extend(&bytes[48 + length..]);
        changed
    }

    #[test]
    fn every_bit_of_every_type_comes_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.checkpoint");
        sample(&path);
        let reader = ColumnReader::open(&path, "checkpoint").unwrap();
        let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&reader.f64s("spring").unwrap()), bits(&NUMBERS));
        assert_eq!(reader.vec3s("position").unwrap()[1], vec3(-4.0, 5e-7, 6.0));
        assert_eq!(reader.u64s("id").unwrap(), [u64::MAX, 1]);
        assert_eq!(reader.u32s("neighbour").unwrap(), [7; 3]);
        assert_eq!(reader.u16s("material").unwrap(), [1, 65_535]);
        assert_eq!(reader.u8s("active").unwrap(), [1, 0, 1]);
        assert!(reader.f64s("empty").unwrap().is_empty());
        assert_eq!(reader.attribute_u64("step").unwrap(), 12);
        assert_eq!(reader.attribute_f64("time_s").unwrap(), 0.1);
        assert_eq!(reader.attribute_text("key").unwrap(), "abc");
        assert_eq!(reader.tollgate_version(), env!("CARGO_PKG_VERSION"));
        reader.verify().unwrap();
    }

    #[test]
    fn long_columns_cross_block_borders_unharmed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.checkpoint");
        let count = 3 * CHUNK + 1;
        let vectors: Vec<Vec3> = (0..count).map(|i| vec3(i as f64, 0.5, -(i as f64))).collect();
        let bytes: Vec<u8> = (0..9 * CHUNK).map(|i| (i % 251) as u8).collect();
        let mut writer = ColumnWriter::new("checkpoint");
        writer.column("vectors", &vectors).column("bytes", &bytes).write(&path).unwrap();
        let reader = ColumnReader::open(&path, "checkpoint").unwrap();
        assert_eq!(reader.vec3s("vectors").unwrap(), vectors);
        assert_eq!(reader.u8s("bytes").unwrap(), bytes);
    }

    #[test]
    fn each_bad_file_gets_its_reason() {
        let bytes = sample_bytes();
        assert!(reason(b"").contains("not a checkpoint of tollgate"));
        assert!(reason(b"solid ascii stl, surely longer than a preamble of 48 bytes").contains("not a checkpoint"));
        assert!(reason(&bytes[..20]).contains("truncated"));
        assert!(reason(&bytes[..60]).contains("truncated"));
        assert!(reason(&bytes[..bytes.len() - 1]).contains("truncated: 1 bytes are missing"));
        assert!(reason(&[&bytes[..], b"x"].concat()).contains("1 bytes follow"));
        let newer = with_header(&bytes, |text| text.replace("\"format_major\":1", "\"format_major\":2"));
        assert!(reason(&newer).contains("it has format 2.0") && reason(&newer).contains("reads format 1"));
        let other = with_header(&bytes, |text| text.replace("\"kind\":\"checkpoint\"", "\"kind\":\"stream\""));
        assert!(reason(&other).contains("it is a stream, not a checkpoint"));
        let mut edited = bytes.clone();
        *edited.last_mut().unwrap() ^= 1;
        assert!(reason(&edited).contains("column \"active\" was edited or damaged"));
        edited = bytes;
        edited[60] ^= 1;
        assert!(reason(&edited).contains("header was edited or damaged"));
    }

    #[test]
    fn a_newer_minor_version_is_read() {
        let newer =
            with_header(&sample_bytes(), |text| text.replace("\"format_minor\":0", "\"format_minor\":7,\"x\":1"));
        assert_eq!(load(&newer).unwrap().len(), 7);
    }

    #[test]
    fn impossible_lengths_are_refused_before_memory_is_asked_for() {
        let bytes = sample_bytes();
        for length in ["4611686018427387904", "18446744073709551615", "1000000000000"] {
            let length = format!("\"length\":{length}");
            let bad = with_header(&bytes, |text| text.replacen("\"length\":5", &length, 1));
            let reason = reason(&bad);
            assert!(reason.contains("impossible") || reason.contains("truncated"), "{reason}");
        }
        let mut bad = bytes;
        bad[8..16].copy_from_slice(&u64::MAX.to_le_bytes());
        assert!(reason(&bad).contains("truncated"));
    }

    #[test]
    fn asking_for_the_wrong_column_is_an_answerable_mistake() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.checkpoint");
        sample(&path);
        let reader = ColumnReader::open(&path, "checkpoint").unwrap();
        assert!(reader.f64s("nothing").unwrap_err().to_string().contains("no column \"nothing\""));
        assert!(reader.f64s("id").unwrap_err().to_string().contains("holds U64 x 1, not F64 x 1"));
        assert!(reader.attribute_u64("key").unwrap_err().to_string().contains("no whole number \"key\""));
        let mut twice = ColumnWriter::new("checkpoint");
        twice.column("a", vec![1.0]).column("a", vec![2.0]);
        assert!(twice.write(&path).unwrap_err().to_string().contains("two columns are named"));
    }

    /// Exhaustive rather than drawn: each of the file's bits in turn.
    #[test]
    fn no_flipped_bit_goes_unnoticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.checkpoint");
        let mut bytes = sample_bytes();
        for bit in 0..8 * bytes.len() {
            bytes[bit / 8] ^= 1 << (bit % 8);
            fs::write(&path, &bytes).unwrap();
            let read = ColumnReader::open(&path, "checkpoint").and_then(|reader| read_all(&reader));
            assert!(read.is_err(), "bit {bit} of {}", 8 * bytes.len());
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
    }

    proptest! {
        #[test]
        fn any_bytes_are_refused_without_panic(tail in prop::collection::vec(any::<u8>(), 0..400), length: u64) {
            prop_assert!(load(&tail).is_err());
            let mut bytes = MAGIC.to_vec();
            bytes.extend(length.to_le_bytes());
            bytes.extend(tail);
            prop_assert!(load(&bytes).is_err());
        }

        #[test]
        fn any_header_is_read_or_refused(at in 0_usize..2000, to in "[0-9\"{},:a-z-]{0,24}") {
            let changed = with_header(&sample_bytes(), |mut text| {
                let at = at % text.len();
                text.replace_range(at..(at + to.len()).min(text.len()), &to);
                text
            });
            let _ = load(&changed);
        }

        #[test]
        fn a_cut_file_is_refused(cut in 0_usize..4000) {
            let bytes = sample_bytes();
            prop_assert!(load(&bytes[..cut % bytes.len()]).is_err());
        }
    }
}
