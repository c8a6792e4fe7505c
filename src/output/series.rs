//! `series.csv`: one row per interval of plant time; readable at any moment, also after a kill.
//!
//! Every column's name ends with its unit. Numbers are printed in the shortest form that reads back as the same `f64`.

use crate::math::Vec3;
use crate::storage::StorageError;
use std::fs::{self, File, OpenOptions};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Column of the mass beyond a measure's plane.
#[must_use]
pub fn mass_column(measure: &str) -> String {
    format!("{measure}.mass_beyond_kg")
}

/// State of the particles and loads on the parts at one time.
#[derive(Debug, Clone, Default)]
pub struct SeriesRow {
    /// Plant time [s].
    pub time: f64,
    /// Number of the time step.
    pub step: u64,
    /// Particles in the scene.
    pub particles: u64,
    /// Their mass [kg].
    pub mass: f64,
    /// Contacts between particles and with parts; `None` where the backend does not tell.
    pub contacts: Option<u64>,
    /// Kinetic energy of the centres [J].
    pub kinetic_energy: f64,
    /// Kinetic energy of the own rotation [J].
    pub rotational_energy: f64,
    /// Root-mean-square speed of the centres [m/s].
    pub rms_speed: f64,
    /// Largest speed of a centre [m/s].
    pub maximum_speed: f64,
    /// Largest overlap as a share of the smaller radius [-]; `None` where the backend does not tell.
    pub maximum_overlap: Option<f64>,
    /// Particles inserted so far.
    pub inserted: u64,
    /// Particles removed so far, by any cause.
    pub removed: u64,
    /// Energy budget, where the scene asks for it.
    pub energy: Option<SeriesEnergy>,
    /// Loads by the particles on each part, in the scene's order.
    pub parts: Vec<PartRow>,
    /// Further columns by name, unit included: measures that need a history.
    pub further: Vec<(String, f64)>,
}

/// Energy budget: stores at this time, and what has been turned over since the start. All [J].
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SeriesEnergy {
    /// Potential energy in gravity.
    pub gravitational: f64,
    /// Stored in normal and tangential springs.
    pub elastic: f64,
    /// Dissipated by slip.
    pub slip: f64,
    /// Dissipated by dashpots.
    pub dashpot: f64,
    /// Dissipated by rolling resistance.
    pub rolling: f64,
    /// Work of the moving parts on the particles.
    pub wall_work: f64,
    /// Brought in by inserted particles.
    pub inserted: f64,
    /// Taken out by removed particles.
    pub removed: f64,
    /// Signed residual of the contact law.
    pub law_residual: f64,
    /// Motion taken from particles that fell asleep; `None` where nobody may.
    pub sleep: Option<f64>,
    /// What the budget leaves unexplained.
    pub imbalance: f64,
}

/// Load on one part.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PartRow {
    /// The part's name in the scene.
    pub name: String,
    /// Force [N].
    pub force: Vec3,
    /// Torque about the plant's origin [N m].
    pub torque: Vec3,
    /// Power the particles do on the part [W].
    pub power: f64,
}

enum Cell {
    Whole(u64),
    Real(f64),
}

impl SeriesRow {
    fn cells(&self) -> Vec<(String, Cell)> {
        let mut cells = vec![("time_s".to_owned(), Cell::Real(self.time))];
        let mut whole = |name: &str, value| cells.push((name.to_owned(), Cell::Whole(value)));
        whole("step", self.step);
        whole("particles", self.particles);
        if let Some(contacts) = self.contacts {
            whole("contacts", contacts);
        }
        whole("inserted", self.inserted);
        whole("removed", self.removed);
        let mut real = |name: String, value| cells.push((name, Cell::Real(value)));
        real("mass_kg".to_owned(), self.mass);
        real("kinetic_energy_J".to_owned(), self.kinetic_energy);
        real("rotational_energy_J".to_owned(), self.rotational_energy);
        real("rms_speed_m_per_s".to_owned(), self.rms_speed);
        real("maximum_speed_m_per_s".to_owned(), self.maximum_speed);
        if let Some(overlap) = self.maximum_overlap {
            real("maximum_overlap_over_radius".to_owned(), overlap);
        }
        if let Some(energy) = &self.energy {
            for (name, value) in energy.columns() {
                real(format!("{name}_J"), value);
            }
        }
        for PartRow { name, force, torque, power } in &self.parts {
            for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
                real(format!("{name}.force_{letter}_N"), force[axis]);
            }
            for (axis, letter) in ["x", "y", "z"].into_iter().enumerate() {
                real(format!("{name}.torque_{letter}_Nm"), torque[axis]);
            }
            real(format!("{name}.power_W"), *power);
        }
        for (name, value) in &self.further {
            real(name.clone(), *value);
        }
        cells
    }
}

impl SeriesEnergy {
    fn columns(&self) -> Vec<(&'static str, f64)> {
        let mut columns = vec![
            ("gravitational_energy", self.gravitational),
            ("elastic_energy", self.elastic),
            ("slip_dissipation", self.slip),
            ("dashpot_dissipation", self.dashpot),
            ("rolling_dissipation", self.rolling),
            ("wall_work", self.wall_work),
            ("inserted_energy", self.inserted),
            ("removed_energy", self.removed),
            ("law_residual", self.law_residual),
            ("energy_imbalance", self.imbalance),
        ];
        columns.extend(self.sleep.map(|lost| ("sleep_dissipation", lost)));
        columns
    }
}

/// Grows `series.csv` row by row. The first row decides the columns.
#[derive(Debug)]
pub struct SeriesWriter {
    path: PathBuf,
    file: File,
    /// The header as it stands in the file; empty before the first row.
    header: String,
    /// Time of the last row [s] and where it starts [bytes].
    last: Option<(f64, u64)>,
    end: u64,
}

impl SeriesWriter {
    /// Starts an empty series.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn create(path: &Path) -> Result<Self, StorageError> {
        let file = File::create(path).map_err(|source| StorageError::system("create", path, source))?;
        Ok(Self { path: path.to_path_buf(), file, header: String::new(), last: None, end: 0 })
    }

    /// Continues a series after its last row not later than the plant time `time` [s]; what is later is cut off.
    ///
    /// # Errors
    /// When the disk refuses or the file is no series.
    pub fn resume(path: &Path, time: f64) -> Result<Self, StorageError> {
        let failed = |source| StorageError::system("continue", path, source);
        let bytes = fs::read(path).map_err(failed)?;
        let text = std::str::from_utf8(&bytes).map_err(|error| {
            StorageError::unusable(path, format!("it is not text at byte {}; move it away", error.valid_up_to()))
        })?;
        let mut lines = text.split_inclusive('\n').filter(|line| line.ends_with('\n'));
        let header = lines.next().unwrap_or_default().to_owned();
        if !header.is_empty() && !header.starts_with("time_s") {
            return Err(StorageError::unusable(path, "it is not a series of tollgate; move it away"));
        }
        let mut end = header.len() as u64;
        let mut last = None;
        for line in lines {
            let first = line.split(',').next().unwrap_or_default().trim_end();
            let row_time: f64 = first.parse().map_err(|_| {
                let reason = format!("at byte {end} a row starts with {first:?} instead of a time; move it away");
                StorageError::unusable(path, reason)
            })?;
            if row_time > time {
                break;
            }
            last = Some((row_time, end));
            end += line.len() as u64;
        }
        let mut file = OpenOptions::new().write(true).open(path).map_err(failed)?;
        file.set_len(end).and_then(|()| file.seek(SeekFrom::Start(end))).map_err(failed)?;
        Ok(Self { path: path.to_path_buf(), file, header, last, end })
    }

    /// Adds a row and hands it to the system at once. A row at the time of the last one replaces it, so that the row
    /// written once more after a resume does not stand there twice.
    ///
    /// # Errors
    /// When the disk refuses, or the row has not the columns of the rows before.
    pub fn add(&mut self, row: &SeriesRow) -> Result<(), StorageError> {
        let cells = row.cells();
        let header = line(&self.path, cells.iter().map(|(name, _)| name.clone()))?;
        let values = line(&self.path, cells.iter().map(|(_, cell)| cell.to_string()))?;
        let first = self.header.is_empty();
        if !first && header != self.header {
            let reason = "the columns changed within a run; give --out a new folder if the scene was edited";
            return Err(StorageError::mismatch(&self.path, reason));
        }
        let start = match self.last {
            Some((time, start)) if time == row.time => start,
            _ => self.end,
        };
        let text = if first { header.clone() + &values } else { values.clone() };
        self.replace_tail(start, &text)?;
        self.end = start + text.len() as u64;
        self.last = Some((row.time, self.end - values.len() as u64));
        self.header = header;
        Ok(())
    }

    /// One system call for the row: a kill leaves it whole or absent, or cut, which readers drop.
    fn replace_tail(&mut self, start: u64, text: &str) -> Result<(), StorageError> {
        let written = if start < self.end {
            self.file.set_len(start).and_then(|()| self.file.seek(SeekFrom::Start(start)).map(drop))
        } else {
            Ok(())
        };
        let written = written.and_then(|()| self.file.write_all(text.as_bytes()));
        written.map_err(|source| StorageError::system("write", &self.path, source))
    }
}

impl std::fmt::Display for Cell {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Whole(value) => write!(f, "{value}"),
            Self::Real(value) => write!(f, "{value:?}"),
        }
    }
}

/// One line of CSV; a part's name may need quotes.
fn line(path: &Path, fields: impl Iterator<Item = String>) -> Result<String, StorageError> {
    let mut writer = csv::WriterBuilder::new().terminator(csv::Terminator::Any(b'\n')).from_writer(Vec::new());
    let failed = |error: &dyn std::error::Error| StorageError::mismatch(path, error.to_string());
    writer.write_record(fields.map(String::into_bytes)).map_err(|error| failed(&error))?;
    let bytes = writer.into_inner().map_err(|error| failed(&error))?;
    String::from_utf8(bytes).map_err(|error| failed(&error))
}

/// A series as read back: columns by name.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Series {
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
}

impl Series {
    /// Reads a series; a last row that was cut by a kill is dropped.
    ///
    /// # Errors
    /// When the file cannot be read or a row does not fit the header.
    pub fn read(path: &Path) -> Result<Self, StorageError> {
        let mut bytes = fs::read(path).map_err(|source| StorageError::system("read", path, source))?;
        let whole = bytes.iter().rposition(|&byte| byte == b'\n').map_or(0, |last| last + 1);
        bytes.truncate(whole);
        let unusable = |error: csv::Error| StorageError::unusable(path, format!("it is no series ({error})"));
        let mut reader = csv::Reader::from_reader(&bytes[..]);
        let names: Vec<String> = reader.headers().map_err(unusable)?.iter().map(str::to_owned).collect();
        let mut columns = vec![Vec::new(); names.len()];
        for (index, record) in reader.records().enumerate() {
            let record = record.map_err(unusable)?;
            for (column, (name, field)) in columns.iter_mut().zip(names.iter().zip(&record)) {
                column.push(field.parse().map_err(|_| {
                    let reason = format!("row {} has {field:?} for {name}, which is not a number", index + 1);
                    StorageError::unusable(path, reason)
                })?);
            }
        }
        Ok(Self { names, columns })
    }

    /// Names of the columns, units included, in the file's order.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The column of this name.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        let place = self.names.iter().position(|other| other == name)?;
        Some(&self.columns[place])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec3;
    use proptest::prelude::*;

    fn row(step: u64) -> SeriesRow {
        let time = 0.1 * step as f64;
        SeriesRow {
            time,
            step,
            particles: u64::MAX - step,
            mass: 1.0 / (time + 3.0),
            energy: Some(SeriesEnergy { slip: -time, ..SeriesEnergy::default() }),
            parts: vec![PartRow {
                name: "drum, \"big\"".to_owned(),
                force: vec3(time, 2.0, -0.0),
                torque: vec3(0.0, 1e-300, 0.0),
                power: 4.5,
            }],
            further: vec![("outlet.mass_beyond_kg".to_owned(), time * 7.0)],
            ..SeriesRow::default()
        }
    }

    fn write(path: &Path, steps: std::ops::Range<u64>) {
        let mut writer = SeriesWriter::create(path).unwrap();
        steps.for_each(|step| writer.add(&row(step)).unwrap());
    }

    #[test]
    fn every_column_reads_back_to_the_last_bit_under_a_name_with_its_unit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("series.csv");
        write(&path, 0..4);
        let series = Series::read(&path).unwrap();
        let times: Vec<f64> = (0..4).map(|step| row(step).time).collect();
        assert_eq!(series.column("time_s").unwrap(), times);
        assert_eq!(series.column("mass_kg").unwrap(), times.iter().map(|t| 1.0 / (t + 3.0)).collect::<Vec<_>>());
        assert_eq!(series.column("drum, \"big\".force_x_N").unwrap(), times);
        assert_eq!(series.column("drum, \"big\".torque_y_Nm").unwrap(), [1e-300; 4]);
        assert_eq!(series.column("drum, \"big\".power_W").unwrap(), [4.5; 4]);
        assert_eq!(series.column("slip_dissipation_J").unwrap()[3], -times[3]);
        assert_eq!(series.column("outlet.mass_beyond_kg").unwrap()[2], times[2] * 7.0);
        assert!(series.column("mass").is_none());
        let unitless = ["step", "particles", "contacts", "inserted", "removed", "maximum_overlap_over_radius"];
        let units = ["_s", "_kg", "_J", "_N", "_Nm", "_W", "_m_per_s"];
        for name in series.names() {
            let named = units.iter().any(|unit| name.ends_with(unit)) || unitless.contains(&name.as_str());
            assert!(named, "{name} lacks its unit");
        }
    }

    #[test]
    fn killed_and_resumed_gives_the_same_bytes() {
        let folder = tempfile::tempdir().unwrap();
        let [whole, cut] = ["whole.csv", "cut.csv"].map(|name| folder.path().join(name));
        write(&whole, 0..6);
        let bytes = fs::read(&whole).unwrap();
        for resumed in 0..5 {
            for kept in [bytes.len(), bytes.len() - 1, bytes.len() - 30] {
                for repeats_its_row in [false, true] {
                    fs::write(&cut, &bytes[..kept]).unwrap();
                    let mut writer = SeriesWriter::resume(&cut, row(resumed).time).unwrap();
                    let first = if repeats_its_row { resumed } else { resumed + 1 };
                    (first..6).for_each(|step| writer.add(&row(step)).unwrap());
                    assert_eq!(fs::read(&cut).unwrap(), bytes, "resumed at row {resumed}, {kept} bytes kept");
                }
            }
        }
    }

    #[test]
    fn a_cut_row_is_dropped_and_a_wrong_one_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("series.csv");
        fs::write(&path, "time_s,mass_kg\n0.0,1.0\n0.1,2.").unwrap();
        assert_eq!(Series::read(&path).unwrap().column("mass_kg").unwrap(), [1.0]);
        fs::write(&path, "time_s,mass_kg\n0.0,1.0\n0.1,2,0\n").unwrap();
        assert!(Series::read(&path).unwrap_err().to_string().contains("no series"));
        fs::write(&path, "time_s,mass_kg\n0.0,heavy\n").unwrap();
        assert!(Series::read(&path).unwrap_err().to_string().contains("row 1 has \"heavy\" for mass_kg"));
        assert!(SeriesWriter::resume(&path, f64::NEG_INFINITY).is_ok());
        fs::write(&path, "x,y\n").unwrap();
        assert!(SeriesWriter::resume(&path, 0.0).unwrap_err().to_string().contains("not a series"));
    }

    #[test]
    fn columns_cannot_change_half_way() {
        let folder = tempfile::tempdir().unwrap();
        let mut writer = SeriesWriter::create(&folder.path().join("series.csv")).unwrap();
        writer.add(&row(0)).unwrap();
        let error = writer.add(&SeriesRow { energy: None, ..row(1) }).unwrap_err();
        assert!(error.to_string().contains("columns changed"), "{error}");
    }

    proptest! {
        #[test]
        fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("series.csv");
            for start in ["", "time_s,a\n0.5,"] {
                fs::write(&path, [start.as_bytes(), &bytes].concat()).unwrap();
                let _ = Series::read(&path);
                let _ = SeriesWriter::resume(&path, 1.0);
            }
        }
    }
}
