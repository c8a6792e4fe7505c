//! Samples: binary dumps of LIGGGHTS with the columns [`COLUMNS`].
//!
//! A file holds one snapshot, little endian: time step (int64), number of particles (int64), whether the box is triclinic (int32),
//! six kinds of border (int32), six bounds (float64), number of columns (int32), number of ranks (int32); then for every rank the
//! number of values (int32) and the values (float64), row by row. Everything is checked before anything is used, and memory is
//! taken only for what the file really holds.

use crate::backend::liggghts::COLUMNS;
use crate::math::{Vec3, vec3};
use crate::storage::StorageError;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Bytes before the first rank's values.
const HEADER: usize = 8 + 8 + 4 + 6 * 4 + 6 * 8 + 4 + 4;
/// Largest kind of border that LIGGGHTS knows: periodic, fixed, shrink-wrapped, shrink-wrapped with a minimum.
const BORDERS: i32 = 3;

/// A particle in a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row {
    /// LIGGGHTS' number, from 1.
    pub tag: u32,
    /// LIGGGHTS' type, from 1.
    pub kind: u16,
    /// Radius \[m\].
    pub radius: f64,
    /// Density \[kg/m3\].
    pub density: f64,
    /// Centre \[m\].
    pub position: Vec3,
    /// Velocity \[m/s\].
    pub velocity: Vec3,
    /// Own rotation \[rad/s\].
    pub spin: Vec3,
    /// Force with gravity \[N\].
    pub force: Vec3,
    /// Torque \[N m\].
    pub torque: Vec3,
}

/// One snapshot.
#[derive(Debug, Default)]
pub struct Sample {
    bytes: Vec<u8>,
    /// Start and number of rows of every rank's values.
    blocks: Vec<(usize, usize)>,
    step: u64,
}

impl Sample {
    /// Reads the whole file at `path`, the snapshot of time step `step`, in place of what this sample held.
    ///
    /// # Errors
    /// When it cannot be read, is not whole, or is not such a dump; the reason names the byte.
    pub fn read(&mut self, path: &Path, step: u64) -> Result<(), StorageError> {
        let failed = |source| StorageError::system("read the sample", path, source);
        let mut file = File::open(path).map_err(failed)?;
        let length = file.metadata().map_err(failed)?.len();
        self.bytes.clear();
        self.blocks.clear();
        file.by_ref().take(HEADER as u64).read_to_end(&mut self.bytes).map_err(failed)?;
        let refuse = |reason: String| StorageError::unusable(path, format!("{reason}; run the stage again"));
        let header = Header::parse(&self.bytes).map_err(refuse)?;
        header.fits(length, step).map_err(refuse)?;
        self.bytes.reserve(length as usize - self.bytes.len());
        file.read_to_end(&mut self.bytes).map_err(failed)?;
        self.step = step;
        self.index(&header).map_err(refuse)
    }

    /// Finds the ranks' blocks and checks every row.
    fn index(&mut self, header: &Header) -> Result<(), String> {
        let width = columns();
        let mut at = HEADER;
        let mut rows = 0;
        for rank in 0..header.ranks {
            let count = self.bytes.get(at..at + 4).ok_or_else(|| ends_early(self.bytes.len(), rank))?;
            let count = i32::from_le_bytes(count.try_into().expect("four bytes"));
            let values = usize::try_from(count).ok().filter(|values| values % width == 0);
            let values = values.ok_or_else(|| format!("rank {rank} claims {count} values at byte {at}"))?;
            at += 4;
            let end = at + 8 * values;
            if end > self.bytes.len() {
                return Err(ends_early(self.bytes.len(), rank));
            }
            self.blocks.push((at, values / width));
            rows += (values / width) as u64;
            at = end;
        }
        if rows != header.particles || at != self.bytes.len() {
            let (claimed, length) = (header.particles, self.bytes.len());
            return Err(format!("it claims {claimed} particles and holds {rows}, up to byte {at} of {length}"));
        }
        self.offsets().try_for_each(|offset| self.check_row(offset))
    }

    fn check_row(&self, offset: usize) -> Result<(), String> {
        let values = self.values(offset);
        if let Some(column) = values.iter().position(|value| !value.is_finite()) {
            let name = COLUMNS.split(' ').nth(column).unwrap_or_default();
            let (value, tag) = (values[column], values[0]);
            let at = offset + 8 * column;
            return Err(format!(
                "{name} of particle {tag} is {value} at byte {at}: the run has blown up, a smaller time step may help"
            ));
        }
        let whole = |value: f64, most: f64| value >= 1.0 && value <= most && value.fract() == 0.0;
        if !whole(values[0], f64::from(i32::MAX)) || !whole(values[1], f64::from(u16::MAX)) {
            return Err(format!("id {} and type {} at byte {offset} cannot be", values[0], values[1]));
        }
        if values[2] <= 0.0 || values[3] <= 0.0 {
            let (tag, radius, density) = (values[0], values[2], values[3]);
            return Err(format!(
                "particle {tag} at byte {offset} has a radius of {radius} m and a density of {density} kg/m3"
            ));
        }
        Ok(())
    }

    /// Time step.
    #[must_use]
    pub const fn step(&self) -> u64 {
        self.step
    }

    /// Bytes of the file.
    #[must_use]
    pub const fn bytes(&self) -> usize {
        self.bytes.len()
    }

    /// The particles, in the file's order.
    pub fn rows(&self) -> impl Iterator<Item = Row> {
        self.offsets().map(|offset| {
            let values = self.values(offset);
            let vector = |first: usize| vec3(values[first], values[first + 1], values[first + 2]);
            Row {
                tag: values[0] as u32,
                kind: values[1] as u16,
                radius: values[2],
                density: values[3],
                position: vector(4),
                velocity: vector(7),
                spin: vector(10),
                force: vector(13),
                torque: vector(16),
            }
        })
    }

    /// Where each row begins.
    fn offsets(&self) -> impl Iterator<Item = usize> {
        let width = 8 * columns();
        self.blocks.iter().flat_map(move |&(start, rows)| (0..rows).map(move |row| start + row * width))
    }

    fn values(&self, offset: usize) -> [f64; WIDTH] {
        let mut values = [0.0; WIDTH];
        for (value, bytes) in values.iter_mut().zip(self.bytes[offset..].chunks_exact(8)) {
            *value = f64::from_le_bytes(bytes.try_into().expect("eight bytes"));
        }
        values
    }
}

/// Number of [`COLUMNS`], as a test makes sure of.
const WIDTH: usize = 19;

const fn columns() -> usize {
    WIDTH
}

fn ends_early(length: usize, rank: u64) -> String {
    format!("it ends at byte {length}, within the values of rank {rank}: it is half written")
}

/// What stands before the values.
#[derive(Debug)]
struct Header {
    step: i64,
    particles: u64,
    ranks: u64,
}

impl Header {
    fn parse(bytes: &[u8]) -> Result<Self, String> {
        if bytes.len() < HEADER {
            return Err(format!(
                "it ends at byte {}, within its header of {HEADER} bytes: it is half written",
                bytes.len()
            ));
        }
        let long = |at: usize| i64::from_le_bytes(bytes[at..at + 8].try_into().expect("eight bytes"));
        let short = |at: usize| i32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes"));
        let foreign = |what: String, at: usize| {
            format!("{what} at byte {at} is not that of a sample: it is another kind of file")
        };
        let step = long(0);
        let particles =
            u64::try_from(long(8)).map_err(|_| foreign(format!("the number of particles {}", long(8)), 8))?;
        if short(16) != 0 {
            return Err(foreign(format!("the kind of box {}", short(16)), 16));
        }
        if let Some(at) = (0..6).map(|border| 20 + 4 * border).find(|&at| !(0..=BORDERS).contains(&short(at))) {
            return Err(foreign(format!("the kind of border {}", short(at)), at));
        }
        let (at, columns) = (HEADER - 8, short(HEADER - 8));
        if columns != WIDTH as i32 {
            return Err(foreign(format!("the number of columns {columns} instead of {WIDTH}"), at));
        }
        let ranks = u64::try_from(short(at + 4)).ok().filter(|ranks| *ranks > 0);
        let ranks = ranks.ok_or_else(|| foreign(format!("the number of ranks {}", short(at + 4)), at + 4))?;
        Ok(Self { step, particles, ranks })
    }

    /// Whether a file of `length` bytes can hold what is claimed, at the time step that it is asked for.
    fn fits(&self, length: u64, step: u64) -> Result<(), String> {
        if u64::try_from(self.step) != Ok(step) {
            return Err(format!("it is of time step {} at byte 0, not of {step}", self.step));
        }
        let values = self.particles.checked_mul(8 * WIDTH as u64);
        let whole = values.and_then(|values| values.checked_add(HEADER as u64 + 4 * self.ranks));
        match whole {
            Some(whole) if whole == length => Ok(()),
            _ => {
                let claimed = whole.map_or_else(|| "more than any file".to_owned(), |whole| whole.to_string());
                let particles = self.particles;
                Err(format!(
                    "it ends at byte {length}, {particles} particles need {claimed} bytes: it is half written or damaged"
                ))
            }
        }
    }
}

#[cfg(test)]
mod tests;
