//! A stream as tables (CSV) and as points (VTP): one chunk in memory at a time.

use super::pvd::{Collection, Entry};
use super::vtp::{NamedColumn, Precision, write_particles};
use crate::gate::crossing::{ContactPartner, Crossing, StoredContact};
use crate::gate::stream::format::Manifest;
use crate::gate::stream::reader::StreamReader;
use crate::math::Vec3;
use crate::particle::ParticleState;
use crate::storage::staging::StagedFile;
use crate::storage::{Column, StorageError};
use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;

/// Columns of the table of crossings: the passage, then the grid state and what acts in it. `stream import` reads it.
pub const CROSSING_HEADER: &str = "id,feed,serial,material,radius_m,density_kg_per_m3,time_s,x_m,y_m,z_m,vx_m_per_s,vy_m_per_s,\
    vz_m_per_s,spin_x_rad_per_s,spin_y_rad_per_s,spin_z_rad_per_s,step,grid_x_m,grid_y_m,grid_z_m,grid_vx_m_per_s,\
    grid_vy_m_per_s,grid_vz_m_per_s,grid_spin_x_rad_per_s,grid_spin_y_rad_per_s,grid_spin_z_rad_per_s,force_x_N,force_y_N,\
    force_z_N,torque_x_Nm,torque_y_Nm,torque_z_Nm,contacts";

/// Columns of the table of contacts: `partner` is a particle's id, or a part's name with its triangle.
pub const CONTACT_HEADER: &str = "id,step,partner_kind,partner,element,point_x_m,point_y_m,point_z_m,normal_x,normal_y,normal_z,\
    overlap_m,normal_force_x_N,normal_force_y_N,normal_force_z_N,tangential_force_x_N,tangential_force_y_N,\
    tangential_force_z_N,tangential_memory_x,tangential_memory_y,tangential_memory_z,rolling_memory_x_Nm,\
    rolling_memory_y_Nm,rolling_memory_z_Nm";

/// Writes the crossings to `table`, one row each, and their contacts to `contacts`, where that is given. Numbers have the
/// shortest form that reads back as the same.
///
/// # Errors
/// When the stream is unusable or the disk refuses.
pub fn write_csv(reader: &StreamReader, table: &Path, contacts: Option<&Path>) -> Result<(), StorageError> {
    let start = |path: &Path, header: &str| {
        let mut file = StagedFile::create(path)?;
        writeln!(file, "{header}").map_err(|source| file.failed(source))?;
        Ok::<StagedFile, StorageError>(file)
    };
    let mut crossings = start(table, CROSSING_HEADER)?;
    let mut contacts = contacts.map(|path| start(path, CONTACT_HEADER)).transpose()?;
    let manifest = reader.manifest();
    for index in 0..reader.chunk_count() {
        let (mut rows, mut contact_rows) = (String::new(), String::new());
        for crossing in reader.chunk(index)? {
            crossing_row(manifest, &crossing, &mut rows);
            if contacts.is_some() {
                crossing
                    .contacts
                    .iter()
                    .for_each(|contact| contact_row(manifest, &crossing, contact, &mut contact_rows));
            }
        }
        crossings.write_all(rows.as_bytes()).map_err(|source| crossings.failed(source))?;
        if let Some(file) = &mut contacts {
            file.write_all(contact_rows.as_bytes()).map_err(|source| file.failed(source))?;
        }
    }
    crossings.commit()?;
    contacts.map_or(Ok(()), StagedFile::commit)
}

fn crossing_row(manifest: &Manifest, crossing: &Crossing, row: &mut String) {
    let Crossing { step, state, force, torque, passage, .. } = crossing;
    let ParticleState { id, radius, density, .. } = state;
    let material = &manifest.origin.materials[usize::from(state.material)].name;
    let (feed, serial) = (id.feed(), id.serial());
    let _ = write!(row, "{},{feed},{serial},{},{radius:?},{density:?},{:?}", id.0, quoted(material), passage.time);
    [passage.position, passage.velocity, passage.spin].iter().for_each(|vector| numbers(vector, row));
    let _ = write!(row, ",{step}");
    [state.position, state.velocity, state.spin, *force, *torque].iter().for_each(|vector| numbers(vector, row));
    let _ = writeln!(row, ",{}", crossing.contacts.len());
}

fn contact_row(manifest: &Manifest, crossing: &Crossing, contact: &StoredContact, row: &mut String) {
    let (id, step) = (crossing.state.id.0, crossing.step);
    let _ = match contact.partner {
        ContactPartner::Particle(partner) => write!(row, "{id},{step},particle,{},", partner.0),
        ContactPartner::Part { part, element } => {
            let name = quoted(&manifest.origin.part_names[usize::from(part)]);
            write!(row, "{id},{step},part,{name},{element}")
        }
    };
    numbers(&contact.point, row);
    numbers(&contact.normal, row);
    let _ = write!(row, ",{:?}", contact.overlap);
    let StoredContact { normal_force, tangential_force, tangential_memory, rolling_memory, .. } = contact;
    [normal_force, tangential_force, tangential_memory, rolling_memory].iter().for_each(|vector| numbers(vector, row));
    row.push('\n');
}

fn numbers(vector: &Vec3, row: &mut String) {
    let _ = write!(row, ",{:?},{:?},{:?}", vector.x, vector.y, vector.z);
}

/// A name as a value of a CSV table.
fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r', '#']) {
        format!("\"{}\"", name.replace('"', "\"\""))
    } else {
        name.to_owned()
    }
}

/// Writes the passages as points into the folder `place`: one file a chunk, and `passages.pvd`, which shows them together.
/// Beside the arrays of particle frames they have `time` [s], `step`, `contact_force` [N], `contact_torque` [N m] and
/// `contacts`.
///
/// # Errors
/// When the stream is unusable or the disk refuses.
pub fn write_vtp(reader: &StreamReader, place: &Path, precision: Precision) -> Result<(), StorageError> {
    let time = reader.manifest().counts.range.map_or(0.0, |range| range.last_time);
    let mut shown = Vec::with_capacity(reader.chunk_count());
    for index in 0..reader.chunk_count() {
        let crossings = reader.chunk(index)?;
        let file = format!("passages_{index:06}.vtp");
        write_points(&place.join(&file), time, &crossings, precision)?;
        shown.push(Entry { time, part: u32::try_from(index).unwrap_or(u32::MAX), name: "passages".to_owned(), file });
    }
    let mut collection = Collection::create(&place.join("passages.pvd"))?;
    collection.add_frame(shown)
}

fn write_points(path: &Path, time: f64, crossings: &[Crossing], precision: Precision) -> Result<(), StorageError> {
    let passing = |crossing: &Crossing| ParticleState {
        position: crossing.passage.position,
        velocity: crossing.passage.velocity,
        spin: crossing.passage.spin,
        ..crossing.state
    };
    let particles: Vec<ParticleState> = crossings.iter().map(passing).collect();
    let extra: [NamedColumn; 5] = [
        ("time", gather(crossings, |crossing| crossing.passage.time)),
        ("step", gather(crossings, |crossing| crossing.step)),
        ("contact_force", gather(crossings, |crossing| crossing.force)),
        ("contact_torque", gather(crossings, |crossing| crossing.torque)),
        ("contacts", gather(crossings, |crossing| u32::try_from(crossing.contacts.len()).unwrap_or(u32::MAX))),
    ];
    write_particles(path, time, &particles, &extra, precision)
}

fn gather<V>(crossings: &[Crossing], value: impl Fn(&Crossing) -> V) -> Column<'static>
where
    Column<'static>: From<Vec<V>>,
{
    Column::from(crossings.iter().map(value).collect::<Vec<V>>())
}
