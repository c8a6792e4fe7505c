//! Text dumps of LIGGGHTS' local computes, snapshot by snapshot, while they are still being written.

use crate::storage::StorageError;
use std::fs::File;
use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::path::{Path, PathBuf};

/// Longest line that is read \[bytes\]: a row of 30 numbers with all their digits has a tenth of it.
const LONGEST_LINE: u64 = 16_384;
/// Most numbers of a row that are read.
const MOST_COLUMNS: usize = 64;

/// A dump to which LIGGGHTS appends.
#[derive(Debug)]
pub struct LocalDump {
    path: PathBuf,
    file: Option<BufReader<File>>,
    /// Bytes read.
    offset: u64,
    line: Vec<u8>,
    /// Time step and number of rows of the snapshot whose header was read last and whose rows were not.
    ahead: Option<(u64, u64)>,
    /// Numbers of each row of that snapshot.
    columns: usize,
}

impl LocalDump {
    /// The dump at `path`, which need not be there yet.
    #[must_use]
    pub fn new(path: PathBuf) -> Self {
        Self { path, file: None, offset: 0, line: Vec::new(), ahead: None, columns: 0 }
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Bytes read so far.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        self.offset
    }

    /// Goes on to the snapshot of time step `step` and calls `row` for each of its rows, with its numbers; `false` where the dump
    /// has none of that time step.
    ///
    /// # Errors
    /// When the dump cannot be read, ends within a snapshot or is not such a dump, or `row` refuses.
    pub fn visit(
        &mut self,
        step: u64,
        mut row: impl FnMut(&[f64]) -> Result<(), String>,
    ) -> Result<bool, StorageError> {
        loop {
            if self.ahead.is_none() {
                self.ahead = self.header()?;
            }
            let Some((found, rows)) = self.ahead else { return Ok(false) };
            if found > step {
                return Ok(false);
            }
            self.ahead = None;
            let mut numbers = Vec::new();
            for _ in 0..rows {
                let start = self.offset;
                self.line("a row")?;
                if found == step {
                    let columns = self.columns;
                    parse(&self.line, columns, &mut numbers).map_err(|reason| self.refuse(start, &reason))?;
                    row(&numbers).map_err(|reason| self.refuse(start, &reason))?;
                }
            }
            if found == step {
                return Ok(true);
            }
        }
    }

    /// Reads the next snapshot's header; `None` at the end of the dump.
    fn header(&mut self) -> Result<Option<(u64, u64)>, StorageError> {
        if self.file.is_none() {
            match File::open(&self.path) {
                Ok(file) => self.file = Some(BufReader::with_capacity(1 << 16, file)),
                Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
                Err(source) => return Err(StorageError::system("read the contacts", &self.path, source)),
            }
        }
        if !self.next_line()? {
            return Ok(None);
        }
        self.expect("ITEM: TIMESTEP")?;
        let step = self.number("the time step")?;
        self.line("the number of rows")?;
        self.expect("ITEM: NUMBER OF ENTRIES")?;
        let rows = self.number("the number of rows")?;
        self.line("the bounds")?;
        self.expect("ITEM: BOX BOUNDS")?;
        for _ in 0..3 {
            self.line("the bounds")?;
        }
        self.line("the columns")?;
        self.expect("ITEM: ENTRIES")?;
        self.columns = self.line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).count() - 2;
        if self.columns > MOST_COLUMNS {
            return Err(self.refuse(self.offset, &format!("{} columns", self.columns)));
        }
        Ok(Some((step, rows)))
    }

    /// Numbers of each row of the snapshot that was visited last.
    #[must_use]
    pub const fn columns(&self) -> usize {
        self.columns
    }

    /// Reads the next line; false at the end of the dump.
    fn next_line(&mut self) -> Result<bool, StorageError> {
        self.line.clear();
        let Some(file) = &mut self.file else { return Ok(false) };
        let count = file.take(LONGEST_LINE).read_until(b'\n', &mut self.line);
        let count = count.map_err(|source| StorageError::system("read the contacts", &self.path, source))?;
        self.offset += count as u64;
        if count == 0 {
            return Ok(false);
        }
        if self.line.pop() != Some(b'\n') {
            let reason = if count as u64 == LONGEST_LINE {
                "a line is too long"
            } else {
                "it ends within a line: it is half written"
            };
            return Err(self.refuse(self.offset, reason));
        }
        Ok(true)
    }

    /// Reads a line that must be there.
    fn line(&mut self, what: &str) -> Result<(), StorageError> {
        if self.next_line()? {
            return Ok(());
        }
        Err(self.refuse(self.offset, &format!("it ends where {what} must stand: it is half written")))
    }

    fn expect(&self, start: &str) -> Result<(), StorageError> {
        if self.line.starts_with(start.as_bytes()) {
            return Ok(());
        }
        let at = self.offset - self.line.len() as u64 - 1;
        Err(self.refuse(at, &format!("{start:?} does not stand there: it is another kind of file")))
    }

    fn number(&mut self, what: &str) -> Result<u64, StorageError> {
        let at = self.offset;
        self.line(what)?;
        let number = std::str::from_utf8(&self.line).ok().and_then(|text| text.trim().parse().ok());
        number.ok_or_else(|| self.refuse(at, &format!("{what} is not a number")))
    }

    fn refuse(&self, at: u64, reason: &str) -> StorageError {
        StorageError::unusable(&self.path, format!("at byte {at}: {reason}; run the stage again"))
    }
}

fn parse(line: &[u8], columns: usize, numbers: &mut Vec<f64>) -> Result<(), String> {
    numbers.clear();
    let text = std::str::from_utf8(line).map_err(|_| "a row is not text".to_owned())?;
    for word in text.split_ascii_whitespace() {
        let number = word.parse::<f64>().ok().filter(|number| number.is_finite());
        numbers.push(number.ok_or_else(|| format!("{word:?} is not a finite number"))?);
    }
    if numbers.len() == columns {
        Ok(())
    } else {
        Err(format!("a row has {} numbers instead of {columns}", numbers.len()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::fs::{self, OpenOptions};
    use std::io::Write;

    fn snapshot(step: u64, rows: &[&str]) -> String {
        let head = format!("ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ENTRIES\n{}\n", rows.len());
        let bounds = "ITEM: BOX BOUNDS ff ff ff\n-0.1 0.1\n-0.1 0.1\n0 0.2\n";
        let rows: String = rows.iter().map(|row| format!("{row} \n")).collect();
        format!("{head}{bounds}ITEM: ENTRIES c_p[1] c_p[2] c_p[3] \n{rows}")
    }

    fn rows_of(dump: &mut LocalDump, step: u64) -> Result<Option<Vec<Vec<f64>>>, StorageError> {
        let mut rows = Vec::new();
        let found = dump.visit(step, |row| {
            rows.push(row.to_vec());
            Ok(())
        })?;
        Ok(found.then_some(rows))
    }

    #[test]
    fn snapshots_are_read_as_they_are_appended() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pairs");
        let mut dump = LocalDump::new(path.clone());
        assert_eq!(rows_of(&mut dump, 0).unwrap(), None, "it is not there yet");
        let append = |text: &str| {
            let mut file = OpenOptions::new().create(true).append(true).open(&path).unwrap();
            file.write_all(text.as_bytes()).unwrap();
        };
        append(&snapshot(0, &[]));
        append(&snapshot(20, &["1 -0 2.5e-05", "3 4 5"]));
        assert_eq!(rows_of(&mut dump, 0).unwrap(), Some(vec![]));
        assert_eq!(rows_of(&mut dump, 20).unwrap(), Some(vec![vec![1.0, -0.0, 2.5e-5], vec![3.0, 4.0, 5.0]]));
        assert_eq!(rows_of(&mut dump, 40).unwrap(), None);
        append(&snapshot(40, &["7 8 9"]));
        append(&snapshot(80, &["1 1 1"]));
        append(&snapshot(100, &["2 2 2"]));
        assert_eq!(rows_of(&mut dump, 60).unwrap(), None, "nothing was dumped there");
        assert_eq!(rows_of(&mut dump, 100).unwrap(), Some(vec![vec![2.0; 3]]), "one may be passed over");
        assert_eq!((dump.columns(), dump.bytes()), (3, fs::metadata(&path).unwrap().len()));
    }

    #[test]
    fn a_dump_cut_at_any_byte_of_a_snapshot_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pairs");
        let whole = snapshot(20, &["1 2 3", "4 5 6"]);
        for length in 1..whole.len() {
            fs::write(&path, &whole.as_bytes()[..length]).unwrap();
            let text = rows_of(&mut LocalDump::new(path.clone()), 20).unwrap_err().to_string();
            assert!(text.contains("half written") && text.contains(&format!("byte {length}")), "{length}: {text}");
        }
    }

    #[test]
    fn what_is_no_dump_is_refused_with_its_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("pairs");
        let refused = |text: &str| {
            fs::write(&path, text).unwrap();
            rows_of(&mut LocalDump::new(path.clone()), 20).unwrap_err().to_string()
        };
        let whole = snapshot(20, &["1 2 3"]);
        for (text, expected) in [
            ("solid x\n".to_owned(), "at byte 0: \"ITEM: TIMESTEP\" does not stand there"),
            (whole.replace("ENTRIES\n1", "ENTRIES\n99999999999999"), "it ends where a row must stand"),
            (whole.replace("ENTRIES\n1", "ENTRIES\n-1"), "the number of rows is not a number"),
            (whole.replace("1 2 3", "1 2 nan"), "\"nan\" is not a finite number"),
            (whole.replace("1 2 3", "1 2"), "2 numbers instead of 3"),
            (whole.replace("1 2 3", "1 2 3,5"), "\"3,5\" is not a finite number"),
            ("x".repeat(20_000), "a line is too long"),
        ] {
            let found = refused(&text);
            assert!(found.contains(expected), "{expected:?} is not in {found:?}");
        }
    }

    proptest! {
        #[test]
        fn no_text_makes_it_panic(at in 0_usize..400, to in any::<u8>()) {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("pairs");
            let mut bytes = snapshot(20, &["1 2 3", "4 5 6"]).into_bytes();
            let at = at % bytes.len();
            bytes[at] = to;
            fs::write(&path, &bytes).unwrap();
            let _ = rows_of(&mut LocalDump::new(path), 20);
        }
    }
}
