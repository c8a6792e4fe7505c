//! LAMMPS text dump (`dump.*.lammpstrj`): the format that OVITO and most other tools read.
//!
//! Reader and writer are bit-exact against each other: numbers are printed in the shortest form that reads back as the
//! same `f64`. The first eighteen columns and their order are those third-party readers of LIGGGHTS dumps expect.

mod reader;
mod writer;

pub use reader::{DumpReader, Row};
pub use writer::DumpWriter;

use crate::math::Bounds;

/// Columns of a dump written here, in order. Types count from 1 (material number + 1); `ix iy iz` are periodic images.
pub const COLUMNS: [&str; 20] = [
    "id", "type", "x", "y", "z", "ix", "iy", "iz", "vx", "vy", "vz", "fx", "fy", "fz", "omegax", "omegay", "omegaz",
    "radius", "mass", "density",
];

/// What stands above the rows of a frame.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameHeader {
    /// Number of the time step.
    pub step: u64,
    /// Plant time [s], where the dump says so. Left out by default: some readers expect exactly nine header lines.
    pub time: Option<f64>,
    /// The domain [m].
    pub bounds: Bounds,
    /// Whether x, y, z are periodic.
    pub periodic: [bool; 3],
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec3;
    use crate::particle::{Body, ParticleId, ParticleState};
    use proptest::prelude::*;
    use std::fs;

    fn header(step: u64) -> FrameHeader {
        let bounds = Bounds { minimum: [-0.1, 0.0, 1e-9], maximum: [0.3, 1.0 / 3.0, 2.0] };
        FrameHeader { step, time: None, bounds, periodic: [false, true, false] }
    }

    fn particle(serial: u64) -> ParticleState {
        let x = 1.0 / (serial + 3) as f64;
        ParticleState {
            id: ParticleId::new(3, serial),
            material: (serial % 3) as u16,
            radius: 1e-3 * (1.0 + x),
            density: 3300.0 + x,
            position: vec3(x, -x / 3.0, 1e-17 * x),
            velocity: vec3(1e17 * x, 0.0, -0.0),
            spin: vec3(f64::MIN_POSITIVE, f64::MAX, 5e-324),
        }
    }

    /// Everything of the frames as read back: header, then particles.
    fn read_all(bytes: &[u8]) -> Result<Vec<(FrameHeader, Vec<ParticleState>)>, crate::storage::StorageError> {
        let mut reader = DumpReader::new(bytes, "dump.lammpstrj");
        let mut frames = Vec::new();
        while let Some(header) = reader.next_frame()? {
            frames.push((header, reader.particles(&Body::Sphere)?));
        }
        Ok(frames)
    }

    fn written(frames: u64, count: u64) -> (Vec<u8>, Vec<ParticleState>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("dump.lammpstrj");
        let particles: Vec<_> = (0..count).map(particle).collect();
        let forces = vec![vec3(1.0 / 7.0, -2.0, 0.0); particles.len()];
        let mut writer = DumpWriter::create(&path).unwrap();
        for frame in 0..frames {
            writer.add_frame(&header(frame * 100), &particles, Some(&forces), &Body::Sphere).unwrap();
        }
        (fs::read(&path).unwrap(), particles)
    }

    #[test]
    fn a_round_trip_keeps_every_bit() {
        let (bytes, particles) = written(3, 10);
        let frames = read_all(&bytes).unwrap();
        assert_eq!(frames.len(), 3);
        for (index, (read, states)) in frames.iter().enumerate() {
            assert_eq!(read, &header(index as u64 * 100));
            assert_eq!(states, &particles);
        }
        let zero = frames[0].1[0].velocity.z;
        assert!(zero == 0.0 && zero.is_sign_negative(), "the sign of zero");
    }

    #[test]
    fn forces_masses_and_images_stand_in_their_columns() {
        let (bytes, particles) = written(1, 2);
        let mut reader = DumpReader::new(&bytes[..], "dump");
        reader.next_frame().unwrap().unwrap();
        assert_eq!(reader.columns(), COLUMNS);
        let columns = ["fx", "mass", "iy", "type", "id"].map(|name| reader.column(name).unwrap());
        let row = reader.next_row().unwrap().unwrap();
        assert_eq!(row.f64(columns[0]).unwrap(), 1.0 / 7.0);
        assert_eq!(row.f64(columns[1]).unwrap(), Body::Sphere.mass(particles[0].radius, particles[0].density));
        assert_eq!(row.u64(columns[2]).unwrap(), 0);
        assert_eq!(row.u64(columns[3]).unwrap(), 1);
        assert_eq!(row.u64(columns[4]).unwrap(), ParticleId::new(3, 0).0);
        assert_eq!(reader.column("quatw").unwrap_err().to_string().matches("radius").count(), 1, "lists the columns");
    }

    #[test]
    fn frames_may_be_skipped_half_way() {
        let (bytes, _) = written(3, 5);
        let mut reader = DumpReader::new(&bytes[..], "dump");
        let mut steps = Vec::new();
        while let Some(header) = reader.next_frame().unwrap() {
            reader.next_row().unwrap().unwrap();
            steps.push(header.step);
        }
        assert_eq!(steps, [0, 100, 200]);
    }

    #[test]
    fn a_dump_cut_anywhere_gives_its_whole_frames_and_then_the_byte() {
        let (bytes, particles) = written(2, 3);
        let first = read_all(&bytes).map(|_| bytes.len() / 2).unwrap();
        for cut in first..bytes.len() {
            let mut reader = DumpReader::new(&bytes[..cut], "dump");
            reader.next_frame().unwrap().unwrap();
            let whole = reader.particles(&Body::Sphere);
            assert_eq!(whole.unwrap(), particles);
            let rest = reader.next_frame().and_then(|next| match next {
                Some(_) => reader.particles(&Body::Sphere).map(Some),
                None => Ok(None),
            });
            match rest {
                Ok(None) => assert_eq!(cut, reader.whole_frames_end() as usize),
                Ok(Some(_)) => panic!("a frame cut at byte {cut} of {} was taken as whole", bytes.len()),
                Err(error) => {
                    assert!(error.to_string().contains("byte"), "{error}");
                    assert!(reader.whole_frames_end() as usize <= cut);
                }
            }
        }
    }

    #[test]
    fn an_enormous_count_is_not_believed() {
        let text = "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n18446744073709551615\nITEM: BOX BOUNDS ff ff ff\n\
                    0 1\n0 1\n0 1\nITEM: ATOMS id x y z vx vy vz radius density\n1 0 0 0 0 0 0 1 1\n";
        let error = read_all(text.as_bytes()).unwrap_err();
        assert!(error.to_string().contains("ends after 1 of 18446744073709551615"), "{error}");
    }

    #[test]
    fn dumps_of_other_programs_are_read() {
        let text = "ITEM: UNITS\nsi\nITEM: TIME\n0.5\nITEM: TIMESTEP\n50\nITEM: NUMBER OF ATOMS\n1\n\
                    ITEM: BOX BOUNDS pp fm ss\n0 1\n0 1\n-1e0 1.5e+00\nITEM: ATOMS id type x y z vx vy vz radius mass \n\
                    7 2 0.25 0 0 0 0 1 0.5 3 \n";
        let frames = read_all(text.as_bytes()).unwrap();
        let (header, states) = &frames[0];
        assert_eq!((header.step, header.time, header.periodic), (50, Some(0.5), [true, false, false]));
        assert_eq!(states[0].material, 1);
        let density = 3.0 / (4.0 / 3.0 * std::f64::consts::PI * 0.5_f64.powi(3));
        approx::assert_relative_eq!(states[0].density, density, max_relative = 4.0 * f64::EPSILON);
        assert_eq!(states[0].spin, vec3(0.0, 0.0, 0.0), "no spin in the dump");
    }

    #[test]
    fn a_wrong_number_is_named_with_its_place() {
        let (bytes, _) = written(1, 3);
        let text = String::from_utf8(bytes).unwrap();
        let damaged = text.replacen("-2.0 ", "-2,0 ", 1);
        let offset = damaged.lines().take(9).map(|line| line.len() + 1).sum::<usize>();
        let mut reader = DumpReader::new(damaged.as_bytes(), "dump");
        reader.next_frame().unwrap();
        let fy = reader.column("fy").unwrap();
        let error = reader.next_row().unwrap().unwrap().f64(fy).unwrap_err().to_string();
        assert!(error.contains(&format!("byte {offset}")) && error.contains("\"-2,0\""), "{error}");
    }

    #[test]
    fn a_resumed_dump_continues_after_the_resumed_step() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("dump.lammpstrj");
        let (bytes, particles) = written(4, 3);
        // Killed while frame 3 was being written, resumed from step 100.
        fs::write(&path, &bytes[..bytes.len() - 20]).unwrap();
        let mut writer = DumpWriter::resume(&path, 100).unwrap();
        for step in [200, 300] {
            let forces = vec![vec3(1.0 / 7.0, -2.0, 0.0); particles.len()];
            writer.add_frame(&header(step), &particles, Some(&forces), &Body::Sphere).unwrap();
        }
        assert_eq!(fs::read(&path).unwrap(), bytes);
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..600)) {
            let _ = read_all(&bytes);
        }

        #[test]
        fn a_damaged_dump_is_read_or_refused(at in 0_usize..1200, to: u8, cut in 0_usize..1200) {
            let (mut bytes, _) = written(2, 2);
            let length = bytes.len();
            bytes[at % length] = to;
            bytes.truncate(length - cut % length);
            let _ = read_all(&bytes);
        }

        #[test]
        fn every_finite_number_survives(bits: [u64; 9], radius: f64, density: f64) {
            let numbers = bits.map(f64::from_bits);
            prop_assume!(numbers.iter().chain([&radius, &density]).all(|number| !number.is_nan()));
            let state = ParticleState {
                radius, density,
                position: vec3(numbers[0], numbers[1], numbers[2]),
                velocity: vec3(numbers[3], numbers[4], numbers[5]),
                spin: vec3(numbers[6], numbers[7], numbers[8]),
                ..particle(1)
            };
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("dump.lammpstrj");
            DumpWriter::create(&path).unwrap().add_frame(&header(0), &[state], None, &Body::Sphere).unwrap();
            let read = read_all(&fs::read(&path).unwrap()).unwrap();
            prop_assert_eq!(read[0].1[0], state);
        }
    }
}
