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

mod reader;
mod writer;

pub use reader::{ColumnReader, read_all};
pub use writer::ColumnWriter;

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

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

#[cfg(test)]
mod tests {
    use super::super::{Column, StorageError};
    use super::*;
    use crate::exit_code;
    use crate::math::{Vec3, vec3};
    use proptest::prelude::*;
    use std::fs;
    use std::io;
    use std::path::Path;

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

    fn load(bytes: &[u8]) -> Result<BTreeMap<String, Column<'static>>, StorageError> {
        let source = io::Cursor::new(bytes.to_vec());
        read_all(&ColumnReader::from_source(Path::new("a"), Box::new(source), bytes.len() as u64, "checkpoint")?)
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
        let mut bytes = sample_bytes();
        for bit in 0..8 * bytes.len() {
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert!(load(&bytes).is_err(), "bit {bit} of {}", 8 * bytes.len());
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        assert!(load(&bytes).is_ok());
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
