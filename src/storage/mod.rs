//! Files that are whole or absent, and the container of named columns: what checkpoints and streams are made of.

pub mod columns;
pub mod staging;

use crate::exit_code;
use crate::math::Vec3;
use std::borrow::Cow;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// Why a file could not be written or read.
#[derive(Debug)]
pub enum StorageError {
    /// The disk or the system refused.
    System {
        /// What was being done, as in "cannot {doing} FILE".
        doing: &'static str,
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The file is there but cannot be used: damaged, half written, foreign, or of a newer format.
    Unusable {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, and what to do.
        reason: String,
    },
    /// Two things that were to be written together do not fit; a mistake of the caller.
    Mismatch {
        /// The file that was to be written.
        path: PathBuf,
        /// What does not fit what.
        reason: String,
    },
}

impl StorageError {
    pub(crate) fn system(doing: &'static str, path: &Path, source: io::Error) -> Self {
        Self::System { doing, path: path.to_path_buf(), source }
    }

    pub(crate) fn unusable(path: &Path, reason: impl Into<String>) -> Self {
        Self::Unusable { path: path.to_path_buf(), reason: reason.into() }
    }

    pub(crate) fn mismatch(path: &Path, reason: impl Into<String>) -> Self {
        Self::Mismatch { path: path.to_path_buf(), reason: reason.into() }
    }

    /// The exit status of a command that ends with this error.
    #[must_use]
    pub const fn exit_code(&self) -> u8 {
        match self {
            Self::System { .. } => exit_code::SYSTEM,
            Self::Unusable { .. } => exit_code::STREAM_UNUSABLE,
            Self::Mismatch { .. } => exit_code::BUG,
        }
    }
}

impl fmt::Display for StorageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::System { doing, path, source } => {
                let hint = match source.kind() {
                    io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => "; free some space, then use --resume",
                    io::ErrorKind::PermissionDenied => "; choose a folder you may write to with --out",
                    _ => "",
                };
                write!(f, "cannot {doing} {}: {source}{hint}", path.display())
            }
            Self::Unusable { path, reason } => write!(f, "cannot use {}: {reason}", path.display()),
            Self::Mismatch { path, reason } => write!(f, "cannot write {}: {reason}", path.display()),
        }
    }
}

impl std::error::Error for StorageError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::System { source, .. } => Some(source),
            Self::Unusable { .. } | Self::Mismatch { .. } => None,
        }
    }
}

/// One value per particle, contact, triangle, ...; borrowed or owned.
#[derive(Debug, Clone, PartialEq)]
pub enum Column<'a> {
    /// Real numbers.
    F64(Cow<'a, [f64]>),
    /// Vectors.
    Vec3(Cow<'a, [Vec3]>),
    /// Whole numbers up to 2^64 - 1.
    U64(Cow<'a, [u64]>),
    /// Whole numbers up to 2^32 - 1.
    U32(Cow<'a, [u32]>),
    /// Whole numbers up to 65 535.
    U16(Cow<'a, [u16]>),
    /// Whole numbers up to 255.
    U8(Cow<'a, [u8]>),
}

impl Column<'_> {
    /// Number of values (a vector is one value).
    #[must_use]
    pub fn len(&self) -> usize {
        match self {
            Self::F64(values) => values.len(),
            Self::Vec3(values) => values.len(),
            Self::U64(values) => values.len(),
            Self::U32(values) => values.len(),
            Self::U16(values) => values.len(),
            Self::U8(values) => values.len(),
        }
    }

    /// True where there is no value.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Numbers per value: 3 for vectors, else 1.
    #[must_use]
    pub const fn components(&self) -> usize {
        if matches!(self, Self::Vec3(_)) { 3 } else { 1 }
    }
}

macro_rules! column_from {
    ($($variant:ident($number:ty)),*) => {$(
        impl<'a> From<&'a [$number]> for Column<'a> {
            fn from(values: &'a [$number]) -> Self {
                Self::$variant(Cow::Borrowed(values))
            }
        }
        impl<'a> From<&'a Vec<$number>> for Column<'a> {
            fn from(values: &'a Vec<$number>) -> Self {
                Self::$variant(Cow::Borrowed(values))
            }
        }
        impl From<Vec<$number>> for Column<'_> {
            fn from(values: Vec<$number>) -> Self {
                Self::$variant(Cow::Owned(values))
            }
        }
    )*};
}

column_from!(F64(f64), Vec3(Vec3), U64(u64), U32(u32), U16(u16), U8(u8));

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_class_of_error_has_its_exit_code_and_says_what_next() {
        let full = StorageError::system("write", Path::new("a.vtp"), io::Error::from(io::ErrorKind::StorageFull));
        assert_eq!(full.exit_code(), exit_code::SYSTEM);
        assert!(full.to_string().starts_with("cannot write a.vtp: "), "{full}");
        assert!(full.to_string().contains("--resume"), "{full}");
        assert_eq!(StorageError::unusable(Path::new("a"), "x").exit_code(), exit_code::STREAM_UNUSABLE);
        assert_eq!(StorageError::mismatch(Path::new("a"), "x").exit_code(), exit_code::BUG);
    }

    #[test]
    fn a_vector_is_one_value_of_three_numbers() {
        let column = Column::from(vec![Vec3::zeros(), Vec3::zeros()]);
        assert_eq!((column.len(), column.components()), (2, 3));
    }
}
