//! A stream from a table of passages (CSV), as any other code can write it.
//!
//! A row is a passage: time, centre, velocity, spin, radius, density or material. What is missing is left out: no contacts, no
//! paths. The grid state is that of the first time step at or after the passage, in free fall from it.

use super::format::{Manifest, Origin};
use super::identities::Identities;
use super::writer::{Closing, StreamWriter};
use crate::gate::crossing::{Crossing, Passage};
use crate::math::{Vec3, vec3};
use crate::particle::{ParticleId, ParticleState};
use crate::storage::StorageError;
use csv::StringRecord;
use std::io::Read;
use std::path::Path;

/// Columns that every table has.
pub const NEEDED: [&str; 8] = ["time_s", "x_m", "y_m", "z_m", "vx_m_per_s", "vy_m_per_s", "vz_m_per_s", "radius_m"];
/// Columns that are read where a table has them; without spin a particle does not turn.
pub const FURTHER: [&str; 6] =
    ["spin_x_rad_per_s", "spin_y_rad_per_s", "spin_z_rad_per_s", "density_kg_per_m3", "material", "id"];

/// Something in the table that cannot be used.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// Line of the file, from 1.
    pub line: u64,
    /// Column's name; empty where the row as a whole is meant.
    pub column: String,
    /// What is wrong.
    pub what: String,
}

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { line, column, what } = self;
        if column.is_empty() {
            write!(f, "line {line}: {what}")
        } else {
            write!(f, "line {line}, column {column}: {what}")
        }
    }
}

/// Why a table did not become a stream.
#[derive(Debug)]
pub enum ImportError {
    /// All that is wrong in the table.
    Table(Vec<Fault>),
    /// The stream could not be written.
    Storage(StorageError),
}

impl From<StorageError> for ImportError {
    fn from(error: StorageError) -> Self {
        Self::Storage(error)
    }
}

/// An imported stream.
#[derive(Debug, Clone, PartialEq)]
pub struct Imported {
    /// Its manifest.
    pub manifest: Manifest,
    /// Columns of the table that were not read.
    pub ignored: Vec<String>,
    /// Rows that did not lie on the plane and were moved onto it in free fall.
    pub moved: u64,
    /// The longest such way [m].
    pub longest: f64,
}

/// Reads the table and writes the stream to `place`. The rows are held in memory; they may come in any order. `origin` says
/// plane, time step, materials and gravity; its first material is that of rows which name none.
///
/// # Errors
/// With everything that is wrong in the table, or when the stream cannot be written.
pub fn import(table: impl Read, origin: Origin, place: &Path) -> Result<Imported, ImportError> {
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).flexible(true).from_reader(table);
    let header = reader.headers().map_err(|error| ImportError::Table(vec![of_csv(&error)]))?.clone();
    let layout = Layout::read(&header).map_err(ImportError::Table)?;
    let (mut crossings, mut faults) = (Vec::new(), Vec::new());
    let (mut moved, mut longest) = (0, 0.0_f64);
    let mut seen = Identities::default();
    for (number, record) in reader.records().enumerate() {
        let record = match record {
            Ok(record) => record,
            Err(error) => {
                faults.push(of_csv(&error));
                continue;
            }
        };
        let line = record.position().map_or(0, csv::Position::line);
        let mut row = Row { layout: &layout, record: &record, line, faults: &mut faults };
        let Some((crossing, way)) = row.crossing(&origin, number as u64) else { continue };
        if !seen.insert(crossing.state.id) {
            row.fault("id", format!("particle {} passes a second time", crossing.state.id.0));
        }
        if way > ON_PLANE * crossing.state.radius {
            moved += 1;
            longest = longest.max(way);
        }
        crossings.push(crossing);
    }
    if !faults.is_empty() {
        return Err(ImportError::Table(faults));
    }
    crossings.sort_by_key(|crossing: &Crossing| (crossing.step, crossing.state.id));
    let mut writer = StreamWriter::create(place, origin)?;
    for crossing in crossings {
        writer.push(crossing)?;
    }
    let manifest = writer.finish(Closing::default())?;
    Ok(Imported { manifest, ignored: layout.ignored, moved, longest })
}

/// Distance from the plane over the radius that is round-off of printed digits [-].
const ON_PLANE: f64 = 1e-6;

fn of_csv(error: &csv::Error) -> Fault {
    let line = error.position().map_or(1, csv::Position::line);
    Fault { line, column: String::new(), what: error.to_string() }
}

/// Where each column stands.
struct Layout {
    needed: [usize; NEEDED.len()],
    further: [Option<usize>; FURTHER.len()],
    width: usize,
    ignored: Vec<String>,
}

impl Layout {
    fn read(header: &StringRecord) -> Result<Self, Vec<Fault>> {
        let place = |name: &str| header.iter().position(|column| column == name);
        let fault = |name: &str, what: &str| Fault { line: 1, column: name.to_owned(), what: what.to_owned() };
        let mut faults: Vec<Fault> = NEEDED
            .iter()
            .filter(|name| place(name).is_none())
            .map(|name| fault(name, "the header has no such column"))
            .collect();
        let twice = |name: &&&str| header.iter().filter(|column| column == *name).count() > 1;
        faults.extend(NEEDED.iter().chain(&FURTHER).filter(twice).map(|name| fault(name, "the header has it twice")));
        if !faults.is_empty() {
            return Err(faults);
        }
        let known = |column: &&str| NEEDED.contains(column) || FURTHER.contains(column);
        Ok(Self {
            needed: NEEDED.map(|name| place(name).unwrap_or_default()),
            further: FURTHER.map(place),
            width: header.len(),
            ignored: header.iter().filter(|column| !known(column)).map(str::to_owned).collect(),
        })
    }
}

struct Row<'a> {
    layout: &'a Layout,
    record: &'a StringRecord,
    line: u64,
    faults: &'a mut Vec<Fault>,
}

impl Row<'_> {
    fn fault(&mut self, column: &str, what: String) {
        self.faults.push(Fault { line: self.line, column: column.to_owned(), what });
    }

    fn number(&mut self, column: &str, place: usize) -> Option<f64> {
        let text = self.record.get(place).unwrap_or_default();
        let number = text.parse().ok().filter(|number: &f64| number.is_finite());
        if number.is_none() {
            self.fault(column, format!("{text:?} is not a number"));
        }
        number
    }

    /// The text of a further column, where the table has it and the row fills it.
    fn further(&self, column: usize) -> Option<&str> {
        self.layout.further[column].and_then(|place| self.record.get(place)).filter(|text| !text.is_empty())
    }

    /// The crossing, and how far its passage was moved [m]; `None` where the row is bad.
    fn crossing(&mut self, origin: &Origin, number: u64) -> Option<(Crossing, f64)> {
        let before = self.faults.len();
        if self.record.len() != self.layout.width {
            let (has, needs) = (self.record.len(), self.layout.width);
            self.fault("", format!("it has {has} values, the header names {needs}"));
            return None;
        }
        let values: [f64; NEEDED.len()] =
            std::array::from_fn(|k| self.number(NEEDED[k], self.layout.needed[k]).unwrap_or(f64::NAN));
        let [time, x, y, z, vx, vy, vz, radius] = values;
        let spin: [f64; 3] = std::array::from_fn(|k| match self.further(k) {
            None => 0.0,
            Some(_) => self.number(FURTHER[k], self.layout.further[k].unwrap_or_default()).unwrap_or(f64::NAN),
        });
        let material = self.material(origin);
        let density = self.density(origin, material);
        let id = self.id(number);
        if radius <= 0.0 {
            self.fault("radius_m", format!("{radius} is not positive"));
        }
        if self.faults.len() > before {
            return None;
        }
        let (id, material, density) = (id?, material?, density?);
        let passage = Passage { time, position: vec3(x, y, z), velocity: vec3(vx, vy, vz), spin: Vec3::from(spin) };
        let (passage, way) = self.onto_plane(origin, passage, radius)?;
        let step = (passage.time / origin.timestep).ceil();
        if !(0.0..MOST_STEPS).contains(&step) {
            self.fault("time_s", format!("{} s is no time of a run with steps of {} s", passage.time, origin.timestep));
            return None;
        }
        let fall = free_fall(&passage, &origin.gravity, step * origin.timestep - passage.time);
        let (position, velocity) = (fall.position, fall.velocity);
        let state = ParticleState { id, material, radius, density, position, velocity, spin: passage.spin };
        let (force, torque) = (Vec3::zeros(), Vec3::zeros());
        let crossing = Crossing {
            step: step as u64,
            state,
            force,
            torque,
            passage,
            contacts: vec![],
            path: vec![],
            path_start: 0,
        };
        Some((crossing, way))
    }

    fn material(&mut self, origin: &Origin) -> Option<u16> {
        let Some(name) = self.further(MATERIAL).map(str::to_owned) else { return Some(0) };
        let found = origin.materials.iter().position(|material| material.name == name);
        if found.is_none() {
            self.fault("material", format!("{name:?} is none of the materials given"));
        }
        found.and_then(|index| u16::try_from(index).ok())
    }

    fn density(&mut self, origin: &Origin, material: Option<u16>) -> Option<f64> {
        let density = match self.layout.further[DENSITY].filter(|_| self.further(DENSITY).is_some()) {
            Some(place) => self.number("density_kg_per_m3", place)?,
            None => {
                origin.materials.get(usize::from(material?)).and_then(|material| material.density).unwrap_or(f64::NAN)
            }
        };
        if density > 0.0 {
            return Some(density);
        }
        let what = if density.is_nan() { "neither the row nor its material gives it" } else { "it is not positive" };
        self.fault("density_kg_per_m3", what.to_owned());
        None
    }

    fn id(&mut self, number: u64) -> Option<ParticleId> {
        let Some(text) = self.further(ID).map(str::to_owned) else { return Some(ParticleId::new(0, number)) };
        let id = text.parse().ok().map(ParticleId);
        if id.is_none() {
            self.fault("id", format!("{text:?} is not a whole number below 2^64"));
        }
        id
    }

    /// Follows the free fall to the instant at which the centre is on the plane: s + v_n t + g_n t^2 / 2 = 0.
    fn onto_plane(&mut self, origin: &Origin, passage: Passage, radius: f64) -> Option<(Passage, f64)> {
        let plane = &origin.plane;
        let (distance, speed) = (plane.distance(&passage.position), passage.velocity.dot(&plane.normal));
        if speed <= 0.0 {
            self.fault(
                "",
                format!("it does not move in the direction of passage: {speed} m/s along the plane's normal"),
            );
            return None;
        }
        if distance.abs() <= ON_PLANE * radius {
            return Some((passage, distance.abs()));
        }
        let pull = origin.gravity.dot(&plane.normal);
        let discriminant = speed * speed - 2.0 * pull * distance;
        if distance.abs() > radius || discriminant < 0.0 {
            let words = if distance < 0.0 { "before" } else { "behind" };
            self.fault("", format!("its centre lies {} m {words} the plane: no passage", distance.abs()));
            return None;
        }
        // The root that goes to -s / v_n without gravity, written without a difference of equal numbers.
        let delay = -2.0 * distance / (speed + discriminant.sqrt());
        Some((free_fall(&passage, &origin.gravity, delay), distance.abs()))
    }
}

const DENSITY: usize = 3;
const MATERIAL: usize = 4;
const ID: usize = 5;
/// Steps that a real number still counts one by one.
const MOST_STEPS: f64 = 9e15;

/// The particle `delay` [s] later (or earlier) in free fall under `gravity` [m/s2].
fn free_fall(passage: &Passage, gravity: &Vec3, delay: f64) -> Passage {
    Passage {
        time: passage.time + delay,
        position: passage.position + passage.velocity * delay + gravity * (0.5 * delay * delay),
        velocity: passage.velocity + gravity * delay,
        spin: passage.spin,
    }
}

#[cfg(test)]
mod tests {
    use super::super::reader::StreamReader;
    use super::super::sample;
    use super::*;
    use approx::assert_relative_eq;

    const HEADER: &str = "time_s,x_m,y_m,z_m,vx_m_per_s,vy_m_per_s,vz_m_per_s,radius_m";

    fn origin() -> Origin {
        Origin { paths: None, contacts: false, ..sample::origin() }
    }

    fn imported(table: &str) -> (Result<Imported, ImportError>, Vec<Crossing>) {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("outlet");
        let result = import(table.as_bytes(), origin(), &place);
        let crossings = result.is_ok().then(|| {
            let reader = StreamReader::open(&place).unwrap();
            reader.verify(|_| {}).unwrap();
            reader.crossings().collect::<Result<Vec<_>, _>>().unwrap()
        });
        assert_eq!(place.exists(), crossings.is_some());
        (result, crossings.unwrap_or_default())
    }

    fn faults(table: &str) -> Vec<String> {
        match imported(table).0 {
            Err(ImportError::Table(faults)) => faults.iter().map(ToString::to_string).collect(),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_row_on_the_plane_keeps_its_digits_and_falls_to_the_next_step() {
        let (time, z, speed) = (0.123_456_7, 0.2, -0.7);
        let table =
            format!("{HEADER},spin_y_rad_per_s,weather\n{time},0.001,0.002,{z},0.1,0,{speed},0.0015,4.5,fine\n");
        let (result, crossings) = imported(&table);
        let result = result.unwrap();
        assert_eq!((result.ignored, result.moved), (vec!["weather".to_owned()], 0));
        let crossing = &crossings[0];
        let passage = Passage {
            time,
            position: vec3(0.001, 0.002, z),
            velocity: vec3(0.1, 0.0, speed),
            spin: vec3(0.0, 4.5, 0.0),
        };
        assert_eq!(crossing.passage, passage);
        assert_eq!((crossing.step, crossing.state.density, crossing.state.id), (12_346, 3300.0, ParticleId::new(0, 0)));
        let delay = 12_346.0 * sample::TIMESTEP - time;
        assert!((0.0..sample::TIMESTEP).contains(&delay));
        // Closed form of the free fall; a few roundings of numbers of 0.2.
        let fallen = z + speed * delay - 0.5 * 9.81 * delay * delay;
        assert_relative_eq!(crossing.state.position.z, fallen, epsilon = 1e-15);
        assert_relative_eq!(crossing.state.velocity.z, speed - 9.81 * delay, epsilon = 1e-14);
        assert!(origin().plane.distance(&crossing.state.position) >= 0.0);
    }

    #[test]
    fn a_sample_behind_the_plane_is_taken_back_to_it_along_its_fall() {
        // Released at z = 0.25 at rest at t = 0, sampled 1 mm behind the plane z = 0.2.
        let at = |z: f64| (2.0 * (0.25 - z) / 9.81).sqrt();
        let (seen, crossed) = (at(0.199), at(0.2));
        let table = format!("{HEADER}\n{seen:?},0,0,0.199,0,0,{:?},0.002\n", -9.81 * seen);
        let (result, crossings) = imported(&table);
        let result = result.unwrap();
        assert_eq!(result.moved, 1);
        assert_relative_eq!(result.longest, 1e-3, max_relative = 1e-12);
        let passage = &crossings[0].passage;
        assert_relative_eq!(passage.time, crossed, max_relative = 1e-13);
        assert_relative_eq!(passage.position.z, 0.2, max_relative = 1e-13);
        assert_relative_eq!(passage.velocity.z, -9.81 * crossed, max_relative = 1e-13);
    }

    #[test]
    fn rows_may_come_in_any_order_and_bring_identities_and_materials() {
        let row = |time: f64, id: u64, material: &str| format!("{time},0,0,0.2,0,0,-1,0.002,{id},{material},\n");
        let table = format!(
            "{HEADER},id,material,density_kg_per_m3\n{}{}{}",
            row(0.3, 7, "coke"),
            row(0.1, 9, "sinter"),
            row(0.1, 8, "")
        );
        let (_, crossings) = imported(&table);
        let found: Vec<(u64, u16, f64)> =
            crossings.iter().map(|c| (c.state.id.0, c.state.material, c.state.density)).collect();
        assert_eq!(found, [(8, 0, 3300.0), (9, 0, 3300.0), (7, 1, 1000.0)]);
    }

    #[test]
    fn every_bad_row_is_listed_at_once() {
        let table = format!(
            "{HEADER},id,material,density_kg_per_m3\n\
             0.1,0,0,0.2,0,0,-1,0.002,1,sinter,\n\
             x,0,0,0.2,0,nan,-1,0.002,2,sinter,\n\
             0.1,0,0,0.2,0,0,-1,-0.002,3,sinter,\n\
             0.1,0,0,0.2,0,0,1,0.002,4,sinter,\n\
             0.1,0,0,0.3,0,0,-1,0.002,5,sinter,\n\
             0.1,0,0,0.2,0,0,-1,0.002,-6,brass,\n\
             0.1,0,0,0.2\n\
             0.1,0,0,0.2,0,0,-1,0.002,1,sinter,-2\n\
             -5,0,0,0.2,0,0,-1,0.002,8,sinter,\n\
             0.2,0,0,0.2,0,0,-1,0.002,1,sinter,\n"
        );
        let expected = [
            "line 3, column time_s: \"x\" is not a number",
            "line 3, column vy_m_per_s: \"nan\" is not a number",
            "line 4, column radius_m: -0.002 is not positive",
            "line 5: it does not move in the direction of passage",
            "line 6: its centre lies 0.09999999999999998 m before the plane",
            "line 7, column material: \"brass\" is none of the materials given",
            "line 7, column id: \"-6\" is not a whole number",
            "line 8: it has 4 values, the header names 11",
            "line 9, column density_kg_per_m3: it is not positive",
            "line 10, column time_s: -5 s is no time",
            "line 11, column id: particle 1 passes a second time",
        ];
        let found = faults(&table);
        assert_eq!(found.len(), expected.len(), "{found:#?}");
        found.iter().zip(expected).for_each(|(found, expected)| assert!(found.starts_with(expected), "{found}"));
    }

    #[test]
    fn a_header_without_what_is_needed_is_refused() {
        let found = faults("time_s,x_m,y_m,z_m,vx_m_per_s,vy_m_per_s,time_s\n1,2,3,4,5,6,7\n");
        assert_eq!(
            found,
            [
                "line 1, column vz_m_per_s: the header has no such column",
                "line 1, column radius_m: the header has no such column",
                "line 1, column time_s: the header has it twice"
            ]
        );
    }
}
