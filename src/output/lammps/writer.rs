//! Writes the dump.

use super::{COLUMNS, DumpReader, FrameHeader};
use crate::math::Vec3;
use crate::particle::{Body, ParticleState};
use crate::storage::StorageError;
use std::fs::{File, OpenOptions};
use std::io::{self, BufReader, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// A dump that grows frame by frame; whole frames reach the file at the end of each [`DumpWriter::add_frame`].
#[derive(Debug)]
pub struct DumpWriter {
    path: PathBuf,
    out: BufWriter<File>,
}

impl DumpWriter {
    /// Starts an empty dump.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn create(path: &Path) -> Result<Self, StorageError> {
        let file = File::create(path).map_err(|source| StorageError::system("create", path, source))?;
        Ok(Self { path: path.to_path_buf(), out: BufWriter::with_capacity(1 << 18, file) })
    }

    /// Continues a dump after its frame of time step `step`: later frames, and what a killed run left half written,
    /// are cut off.
    ///
    /// # Errors
    /// When the disk refuses, or the dump is damaged before its end.
    pub fn resume(path: &Path, step: u64) -> Result<Self, StorageError> {
        let failed = |source| StorageError::system("continue", path, source);
        let mut file = OpenOptions::new().read(true).write(true).open(path).map_err(failed)?;
        let size = file.metadata().map_err(failed)?.len();
        let end = end_of_frames(DumpReader::new(BufReader::new(&file), path), step, size)?;
        file.set_len(end).map_err(failed)?;
        file.seek(SeekFrom::Start(end)).map_err(failed)?;
        Ok(Self { path: path.to_path_buf(), out: BufWriter::with_capacity(1 << 18, file) })
    }

    /// Adds one frame. `forces` [N] acts on each particle in turn; zero where they are not known.
    ///
    /// # Errors
    /// When the disk refuses, or there are not as many forces as particles.
    pub fn add_frame(
        &mut self,
        header: &FrameHeader,
        particles: &[ParticleState],
        forces: Option<&[Vec3]>,
        body: &Body,
    ) -> Result<(), StorageError> {
        if let Some(forces) = forces.filter(|forces| forces.len() != particles.len()) {
            let reason = format!("{} forces for {} particles", forces.len(), particles.len());
            return Err(StorageError::mismatch(&self.path, reason));
        }
        let written = write_header(&mut self.out, header, particles.len())
            .and_then(|()| {
                particles.iter().enumerate().try_for_each(|(index, particle)| {
                    let force = forces.map_or_else(Vec3::zeros, |forces| forces[index]);
                    write_row(&mut self.out, particle, &force, body)
                })
            })
            .and_then(|()| self.out.flush());
        written.map_err(|source| StorageError::system("write", &self.path, source))
    }
}

/// Where the frames up to `step` end. A half-written last frame is what a killed run leaves; anything else is damage.
fn end_of_frames(mut reader: DumpReader<impl io::BufRead>, step: u64, size: u64) -> Result<u64, StorageError> {
    loop {
        let end = reader.whole_frames_end();
        match reader.next_frame() {
            Ok(Some(header)) if header.step > step => return Ok(end),
            Ok(Some(_)) => match reader.skip_rows() {
                Ok(()) => {}
                Err(_) if reader.offset() == size => return Ok(end),
                Err(error) => return Err(error),
            },
            Ok(None) => return Ok(end),
            Err(_) if reader.offset() == size => return Ok(end),
            Err(error) => return Err(error),
        }
    }
}

fn write_header(out: &mut impl Write, header: &FrameHeader, count: usize) -> io::Result<()> {
    if let Some(time) = header.time {
        writeln!(out, "ITEM: TIME\n{time:?}")?;
    }
    let [x, y, z] = header.periodic.map(|periodic| if periodic { "pp" } else { "ff" });
    writeln!(out, "ITEM: TIMESTEP\n{}", header.step)?;
    writeln!(out, "ITEM: NUMBER OF ATOMS\n{count}")?;
    writeln!(out, "ITEM: BOX BOUNDS {x} {y} {z}")?;
    for (low, high) in header.bounds.minimum.iter().zip(&header.bounds.maximum) {
        writeln!(out, "{low:?} {high:?}")?;
    }
    writeln!(out, "ITEM: ATOMS {}", COLUMNS.join(" "))
}

/// `{:?}` of an `f64` is its shortest form that reads back as the same number, with an exponent where that is shorter.
fn write_row(out: &mut impl Write, particle: &ParticleState, force: &Vec3, body: &Body) -> io::Result<()> {
    let ParticleState { id, material, radius, density, position, velocity, spin } = particle;
    write!(out, "{} {}", id.0, u32::from(*material) + 1)?;
    write_vector(out, position)?;
    // Images are not counted: periodic positions are wrapped into the domain.
    out.write_all(b" 0 0 0")?;
    write_vector(out, velocity)?;
    write_vector(out, force)?;
    write_vector(out, spin)?;
    writeln!(out, " {radius:?} {:?} {density:?}", body.mass(*radius, *density))
}

fn write_vector(out: &mut impl Write, vector: &Vec3) -> io::Result<()> {
    write!(out, " {:?} {:?} {:?}", vector.x, vector.y, vector.z)
}
