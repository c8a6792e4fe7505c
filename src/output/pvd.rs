//! ParaView collection (`.pvd`): which files show which plant time; particles and moved parts side by side.
//!
//! The collection is written anew after every frame (staging name, then rename), so it is complete at any moment.

use super::vtp::escape;
use crate::storage::StorageError;
use crate::storage::staging::write_whole;
use regex::Regex;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

/// One file of the collection.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Plant time [s].
    pub time: f64,
    /// Index within its time: 0 for the particles, then the parts; selects the block in ParaView.
    pub part: u32,
    /// What it shows: `particles`, `contacts`, or the part's name.
    pub name: String,
    /// The file, relative to the collection, with `/` between folders.
    pub file: String,
}

/// The collection of one run.
#[derive(Debug)]
pub struct Collection {
    path: PathBuf,
    entries: Vec<Entry>,
}

impl Collection {
    /// An empty collection; written at once.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn create(path: &Path) -> Result<Self, StorageError> {
        let collection = Self { path: path.to_path_buf(), entries: Vec::new() };
        collection.write()?;
        Ok(collection)
    }

    /// The collection of an earlier run, without what is later than the plant time `time` [s] it resumes from.
    ///
    /// # Errors
    /// When the file cannot be read, or was not written by this program.
    pub fn resume(path: &Path, time: f64) -> Result<Self, StorageError> {
        let text = fs::read_to_string(path).map_err(|source| StorageError::system("read", path, source))?;
        let mut entries = parse(&text).map_err(|reason| StorageError::unusable(path, reason))?;
        entries.retain(|entry| entry.time <= time);
        let collection = Self { path: path.to_path_buf(), entries };
        collection.write()?;
        Ok(collection)
    }

    /// Adds the files of one frame. What the collection had for the same time and part is replaced, so that a frame
    /// written once more after a resume is not shown twice.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn add_frame(&mut self, frame: Vec<Entry>) -> Result<(), StorageError> {
        self.entries.retain(|old| !frame.iter().any(|new| new.time == old.time && new.part == old.part));
        self.entries.extend(frame);
        self.write()
    }

    /// All files, in the order in which they came.
    #[must_use]
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    fn write(&self) -> Result<(), StorageError> {
        let mut text = String::from(OPENING);
        for Entry { time, part, name, file } in &self.entries {
            let (name, file) = (escape(name), escape(file));
            let _ = writeln!(
                text,
                "<DataSet timestep=\"{time:?}\" group=\"\" part=\"{part}\" name=\"{name}\" file=\"{file}\"/>"
            );
        }
        text.push_str(CLOSING);
        write_whole(&self.path, text.as_bytes())
    }
}

const OPENING: &str = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\" byte_order=\"LittleEndian\" \
                       header_type=\"UInt64\">\n<Collection>\n";
const CLOSING: &str = "</Collection>\n</VTKFile>\n";

fn parse(text: &str) -> Result<Vec<Entry>, String> {
    let foreign = || "it is not a collection of this program; move it away to start a new one".to_owned();
    let body = text.strip_prefix(OPENING).and_then(|rest| rest.strip_suffix(CLOSING)).ok_or_else(foreign)?;
    let line = r#"^<DataSet timestep="([^"]*)" group="" part="([0-9]+)" name="([^"]*)" file="([^"]*)"/>$"#;
    let pattern = Regex::new(line).map_err(|error| error.to_string())?;
    body.lines()
        .enumerate()
        .map(|(number, line)| {
            let wrong = || format!("line {} is not an entry of a collection: {line}", number + 4);
            let fields = pattern.captures(line).ok_or_else(wrong)?;
            Ok(Entry {
                time: fields[1].parse().map_err(|_| wrong())?,
                part: fields[2].parse().map_err(|_| wrong())?,
                name: unescape(&fields[3]),
                file: unescape(&fields[4]),
            })
        })
        .collect()
}

fn unescape(text: &str) -> String {
    text.replace("&quot;", "\"").replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&")
}

/// Name of a frame's file: `particles_000012.vtp`; characters that a file system or a URL may refuse become `_`.
/// Names that differ only in such characters need the part's index in `name`.
#[must_use]
pub fn frame_file(name: &str, frame: u64) -> String {
    let plain = |character: char| character.is_ascii_alphanumeric() || matches!(character, '-' | '_');
    let name: String = name.chars().map(|character| if plain(character) { character } else { '_' }).collect();
    format!("{name}_{frame:06}.vtp")
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn entry(time: f64, part: u32, name: &str, file: &str) -> Entry {
        Entry { time, part, name: name.to_owned(), file: file.to_owned() }
    }

    #[test]
    fn a_resumed_collection_forgets_what_is_later_and_keeps_the_rest() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames.pvd");
        let mut collection = Collection::create(&path).unwrap();
        for frame in 0..4_u64 {
            let time = 0.1 * frame as f64;
            let particles = entry(time, 0, "particles", &format!("frames/{}", frame_file("particles", frame)));
            let part = entry(time, 1, "drum <\"&>", "frames/drum.vtp");
            collection.add_frame(vec![particles, part]).unwrap();
        }
        let all = collection.entries().to_vec();
        let mut resumed = Collection::resume(&path, 0.1 * 2.0).unwrap();
        assert_eq!(resumed.entries(), &all[..6]);
        resumed.add_frame(vec![entry(0.1 * 2.0, 1, "drum", "again.vtp")]).unwrap();
        assert_eq!(resumed.entries().len(), 6);
        assert_eq!(Collection::resume(&path, f64::INFINITY).unwrap().entries(), resumed.entries());
    }

    #[test]
    fn a_foreign_or_edited_collection_is_refused_by_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames.pvd");
        fs::write(&path, "<VTKFile/>").unwrap();
        let error = Collection::resume(&path, 0.0).unwrap_err();
        assert!(error.to_string().contains("not a collection of this program"), "{error}");
        fs::write(&path, format!("{OPENING}<DataSet/>\n{CLOSING}")).unwrap();
        let error = Collection::resume(&path, 0.0).unwrap_err();
        assert!(error.to_string().contains("line 4"), "{error}");
    }

    #[test]
    fn names_of_files_are_plain() {
        assert_eq!(frame_file("02 drum/größe", 12), "02_drum_gr__e_000012.vtp");
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in ".*") {
            let _ = parse(&text);
            let _ = parse(&format!("{OPENING}{text}{CLOSING}"));
        }

        #[test]
        fn what_is_written_is_read(time: f64, part: u32, name in "[^\n\r]*", file in "[^\n\r]*") {
            prop_assume!(time.is_finite());
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("frames.pvd");
            let mut collection = Collection::create(&path).unwrap();
            collection.add_frame(vec![entry(time, part, &name, &file)]).unwrap();
            let read = Collection::resume(&path, time).unwrap();
            prop_assert_eq!(read.entries(), collection.entries());
        }
    }
}
