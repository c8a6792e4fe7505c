//! Reads dumps row by row in bounded memory: our own and those of LAMMPS and LIGGGHTS.

use super::FrameHeader;
use crate::math::{Bounds, Vec3};
use crate::particle::{Body, ParticleId, ParticleState};
use crate::storage::StorageError;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

/// Longest line that is taken for one [bytes]; keeps memory bounded in a file without line ends.
const LONGEST_LINE: u64 = 1 << 16;

/// Particles set aside at once at most before they have been seen; a dump's count is a claim, not a fact.
const TRUSTED_COUNT: u64 = 1 << 16;

/// A dump being read, one row at a time.
#[derive(Debug)]
pub struct DumpReader<R> {
    path: PathBuf,
    source: R,
    /// Bytes read so far.
    offset: u64,
    /// Where the last frame that was read to its end stops.
    whole_frames_end: u64,
    line: Vec<u8>,
    /// Where the fields of the line start and stop; used again for every row.
    fields: Vec<(usize, usize)>,
    columns: Vec<String>,
    claimed: u64,
    rows_read: u64,
}

impl DumpReader<BufReader<File>> {
    /// Opens a dump.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub fn open(path: &Path) -> Result<Self, StorageError> {
        let file = File::open(path).map_err(|source| StorageError::system("open", path, source))?;
        Ok(Self::new(BufReader::with_capacity(1 << 18, file), path))
    }
}

impl<R: BufRead> DumpReader<R> {
    /// Reads from `source`; `path` names it in errors.
    pub fn new(source: R, path: impl AsRef<Path>) -> Self {
        Self {
            path: path.as_ref().to_path_buf(),
            source,
            offset: 0,
            whole_frames_end: 0,
            line: Vec::new(),
            fields: Vec::new(),
            columns: Vec::new(),
            claimed: 0,
            rows_read: 0,
        }
    }

    /// Goes to the next frame (rows not read yet are passed over); `None` at the end of the dump.
    ///
    /// # Errors
    /// When the dump is damaged or half written; the error names the byte.
    pub fn next_frame(&mut self) -> Result<Option<FrameHeader>, StorageError> {
        self.skip_rows()?;
        if !self.read_line()? {
            return Ok(None);
        }
        let mut step = None;
        let mut time = None;
        let mut count = None;
        let mut domain = None;
        loop {
            let start = self.line_start();
            let item = self.line_text()?.trim_end().to_owned();
            match item.as_str() {
                "ITEM: TIMESTEP" => step = Some(self.value::<u64>("the time step")?),
                "ITEM: TIME" => time = Some(self.value::<f64>("the time")?),
                "ITEM: UNITS" => drop(self.value::<String>("the units")?),
                "ITEM: NUMBER OF ATOMS" => count = Some(self.value::<u64>("the number of particles")?),
                _ => {
                    if let Some(borders) = item.strip_prefix("ITEM: BOX BOUNDS") {
                        domain = Some((self.bounds()?, periodic(borders)));
                    } else if let Some(columns) = item.strip_prefix("ITEM: ATOMS") {
                        self.columns = columns.split_ascii_whitespace().map(str::to_owned).collect();
                        break;
                    } else {
                        return Err(self.damaged(start, "expected a line that starts with \"ITEM: \""));
                    }
                }
            }
            self.expect_line("the frame's header")?;
        }
        let (Some(step), Some(count), Some((bounds, periodic))) = (step, count, domain) else {
            let start = self.line_start();
            return Err(self.damaged(start, "the frame has no time step, number of particles or box above its rows"));
        };
        self.claimed = count;
        self.rows_read = 0;
        self.note_whole_frame();
        Ok(Some(FrameHeader { step, time, bounds, periodic }))
    }

    /// The current frame's columns.
    #[must_use]
    pub fn columns(&self) -> &[String] {
        &self.columns
    }

    /// Place of the column `name` in the current frame.
    ///
    /// # Errors
    /// When the frame has no such column; the error lists those it has.
    pub fn column(&self, name: &str) -> Result<usize, StorageError> {
        self.find(name).ok_or_else(|| {
            let reason = format!("it has no column {name:?} (it has: {})", self.columns.join(" "));
            StorageError::unusable(&self.path, reason)
        })
    }

    fn find(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column == name)
    }

    /// Number of rows the current frame claims to have.
    #[must_use]
    pub const fn claimed_rows(&self) -> u64 {
        self.claimed
    }

    /// The next row of the current frame; `None` after its last.
    ///
    /// # Errors
    /// When the dump ends within the frame or the row has not as many fields as there are columns.
    pub fn next_row(&mut self) -> Result<Option<Row<'_>>, StorageError> {
        if self.rows_read == self.claimed {
            return Ok(None);
        }
        if !self.read_line()? {
            let (read, claimed, offset) = (self.rows_read, self.claimed, self.offset);
            return Err(self.damaged(offset, &format!("the file ends after {read} of {claimed} rows of a frame")));
        }
        let start = self.line_start();
        let mut found = std::mem::take(&mut self.fields);
        found.clear();
        let text = self.line_text()?;
        found.extend(text.split_ascii_whitespace().map(|field| {
            let first = field.as_ptr().addr() - text.as_ptr().addr();
            (first, first + field.len())
        }));
        self.fields = found;
        let (fields, expected) = (self.fields.len(), self.columns.len());
        if fields != expected {
            return Err(self.damaged(start, &format!("a row of {fields} fields under {expected} columns")));
        }
        self.rows_read += 1;
        self.note_whole_frame();
        Ok(Some(Row { path: &self.path, offset: start, text: self.line_text()?, fields: &self.fields }))
    }

    /// Passes over the rest of the current frame.
    ///
    /// # Errors
    /// As [`DumpReader::next_row`].
    pub fn skip_rows(&mut self) -> Result<(), StorageError> {
        while self.next_row()?.is_some() {}
        Ok(())
    }

    /// The rest of the current frame as particles. Needs `id x y z vx vy vz radius` and `density` or `mass`; a missing
    /// `type` is 1, a missing spin is zero.
    ///
    /// # Errors
    /// When a column is missing, or the frame is damaged or half written.
    pub fn particles(&mut self, body: &Body) -> Result<Vec<ParticleState>, StorageError> {
        let id = self.column("id")?;
        let radius = self.column("radius")?;
        let position = self.vector(["x", "y", "z"])?;
        let velocity = self.vector(["vx", "vy", "vz"])?;
        let spin = self.vector(["omegax", "omegay", "omegaz"]).ok();
        let kind = self.find("type");
        let density = self.find("density");
        let mass = if density.is_none() { self.column("mass")? } else { 0 };
        let mut particles = Vec::with_capacity(self.claimed.min(TRUSTED_COUNT) as usize);
        while let Some(row) = self.next_row()? {
            let radius = row.f64(radius)?;
            particles.push(ParticleState {
                id: ParticleId(row.u64(id)?),
                material: kind.map_or(Ok(0), |kind| row.material(kind))?,
                radius,
                density: match density {
                    Some(density) => row.f64(density)?,
                    None => row.f64(mass)? / body.mass(radius, 1.0),
                },
                position: row.vec3(position)?,
                velocity: row.vec3(velocity)?,
                spin: spin.map_or(Ok(Vec3::zeros()), |spin| row.vec3(spin))?,
            });
        }
        Ok(particles)
    }

    fn vector(&self, names: [&str; 3]) -> Result<[usize; 3], StorageError> {
        Ok([self.column(names[0])?, self.column(names[1])?, self.column(names[2])?])
    }

    /// Bytes read so far.
    #[must_use]
    pub const fn offset(&self) -> u64 {
        self.offset
    }

    /// Where the last frame that was read to its end stops [bytes]: a dump cut there is whole.
    #[must_use]
    pub const fn whole_frames_end(&self) -> u64 {
        self.whole_frames_end
    }

    fn note_whole_frame(&mut self) {
        if self.rows_read == self.claimed {
            self.whole_frames_end = self.offset;
        }
    }

    /// Reads one line; false at the end. A line without its end was being written when the file was left.
    fn read_line(&mut self) -> Result<bool, StorageError> {
        self.line.clear();
        let mut limited = (&mut self.source).take(LONGEST_LINE);
        let read = limited.read_until(b'\n', &mut self.line);
        let read = read.map_err(|source| StorageError::system("read", &self.path, source))?;
        self.offset += read as u64;
        if read == 0 {
            return Ok(false);
        }
        if self.line.last() != Some(&b'\n') {
            let start = self.line_start();
            let what = if read as u64 == LONGEST_LINE { "a line without an end" } else { "a half-written line" };
            return Err(self.damaged(start, what));
        }
        Ok(true)
    }

    fn expect_line(&mut self, what: &str) -> Result<(), StorageError> {
        if self.read_line()? {
            return Ok(());
        }
        let offset = self.offset;
        Err(self.damaged(offset, &format!("the file ends before {what}")))
    }

    const fn line_start(&self) -> u64 {
        self.offset - self.line.len() as u64
    }

    fn line_text(&self) -> Result<&str, StorageError> {
        std::str::from_utf8(&self.line).map_err(|_| self.damaged(self.line_start(), "a line that is not text"))
    }

    fn value<T: std::str::FromStr>(&mut self, what: &str) -> Result<T, StorageError> {
        self.expect_line(what)?;
        let text = self.line_text()?.trim();
        text.parse().map_err(|_| self.damaged(self.line_start(), &format!("{text:?} is not {what}")))
    }

    fn bounds(&mut self) -> Result<Bounds, StorageError> {
        let mut bounds = Bounds { minimum: [0.0; 3], maximum: [0.0; 3] };
        for axis in 0..3 {
            self.expect_line("the bounds of the box")?;
            let mut ends = self.line_text()?.split_ascii_whitespace().map(str::parse::<f64>);
            let (Some(Ok(low)), Some(Ok(high)), None) = (ends.next(), ends.next(), ends.next()) else {
                return Err(self.damaged(self.line_start(), "expected two bounds of a box whose axes are x, y, z"));
            };
            (bounds.minimum[axis], bounds.maximum[axis]) = (low, high);
        }
        Ok(bounds)
    }

    fn damaged(&self, offset: u64, reason: &str) -> StorageError {
        let good = self.whole_frames_end;
        let reason = format!("damaged at byte {offset}: {reason} (whole frames end at byte {good})");
        StorageError::unusable(&self.path, reason)
    }
}

fn periodic(borders: &str) -> [bool; 3] {
    let mut periodic = [false; 3];
    for (axis, border) in borders.split_ascii_whitespace().take(3).enumerate() {
        periodic[axis] = border == "pp";
    }
    periodic
}

/// One row of a frame; fields are read by the column's place.
#[derive(Debug, Clone, Copy)]
pub struct Row<'a> {
    path: &'a Path,
    offset: u64,
    text: &'a str,
    fields: &'a [(usize, usize)],
}

impl Row<'_> {
    /// The field as a real number.
    ///
    /// # Errors
    /// When it is none.
    pub fn f64(&self, column: usize) -> Result<f64, StorageError> {
        self.field(column, "a number")
    }

    /// The field as a whole number.
    ///
    /// # Errors
    /// When it is none.
    pub fn u64(&self, column: usize) -> Result<u64, StorageError> {
        self.field(column, "a whole number")
    }

    fn vec3(&self, columns: [usize; 3]) -> Result<Vec3, StorageError> {
        Ok(Vec3::new(self.f64(columns[0])?, self.f64(columns[1])?, self.f64(columns[2])?))
    }

    /// Types count from 1, materials from 0.
    fn material(&self, column: usize) -> Result<u16, StorageError> {
        let kind = self.u64(column)?;
        kind.checked_sub(1).and_then(|material| u16::try_from(material).ok()).ok_or_else(|| {
            let reason = format!("damaged at byte {}: type {kind} is not between 1 and 65536", self.offset);
            StorageError::unusable(self.path, reason)
        })
    }

    fn field<T: std::str::FromStr>(&self, column: usize, what: &str) -> Result<T, StorageError> {
        let text = self.fields.get(column).map_or("", |&(first, end)| &self.text[first..end]);
        text.parse().map_err(|_| {
            let reason = format!("damaged at byte {}: {text:?} is not {what}", self.offset);
            StorageError::unusable(self.path, reason)
        })
    }
}
