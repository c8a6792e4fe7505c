//! Crossings as named columns and back: what chunk files and checkpoints store.

use crate::gate::crossing::{ContactPartner, Crossing, Motion, Passage, StoredContact};
use crate::math::Vec3;
use crate::particle::{ParticleId, ParticleState};
use crate::storage::{Column, StorageError};
use std::collections::BTreeMap;
use std::path::Path;

const PARTICLE: u8 = 0;
const PART: u8 = 1;

/// The columns of `crossings`: one row a crossing, then one row a contact, then one row a motion of a path. Numbers are kept
/// to the last bit.
#[must_use]
pub fn columns(crossings: &[Crossing]) -> Vec<(&'static str, Column<'static>)> {
    let mut all = crossing_columns(crossings);
    all.extend(contact_columns(crossings));
    all.extend(path_columns(crossings));
    all
}

/// Bytes of one crossing, of one contact, and of one motion of a path.
#[must_use]
pub fn row_bytes() -> (u64, u64, u64) {
    let width = |column: &Column| {
        let number = match column {
            Column::F64(_) | Column::Vec3(_) | Column::U64(_) => 8,
            Column::U32(_) => 4,
            Column::U16(_) => 2,
            Column::U8(_) => 1,
        };
        number * column.components() as u64
    };
    let sum = |columns: Vec<(&str, Column)>| columns.iter().map(|(_, column)| width(column)).sum();
    (sum(crossing_columns(&[])), sum(contact_columns(&[])), sum(path_columns(&[])))
}

fn of<T, V>(rows: &[T], value: impl Fn(&T) -> V) -> Column<'static>
where
    Column<'static>: From<Vec<V>>,
{
    Column::from(rows.iter().map(value).collect::<Vec<V>>())
}

fn crossing_columns(rows: &[Crossing]) -> Vec<(&'static str, Column<'static>)> {
    vec![
        ("step", of(rows, |c| c.step)),
        ("id", of(rows, |c| c.state.id.0)),
        ("material", of(rows, |c| c.state.material)),
        ("radius", of(rows, |c| c.state.radius)),
        ("density", of(rows, |c| c.state.density)),
        ("position", of(rows, |c| c.state.position)),
        ("velocity", of(rows, |c| c.state.velocity)),
        ("spin", of(rows, |c| c.state.spin)),
        ("force", of(rows, |c| c.force)),
        ("torque", of(rows, |c| c.torque)),
        ("passage_time", of(rows, |c| c.passage.time)),
        ("passage_position", of(rows, |c| c.passage.position)),
        ("passage_velocity", of(rows, |c| c.passage.velocity)),
        ("passage_spin", of(rows, |c| c.passage.spin)),
        ("contact_count", of(rows, |c| c.contacts.len() as u64)),
        ("path_start", of(rows, |c| c.path_start)),
        ("path_count", of(rows, |c| c.path.len() as u64)),
    ]
}

fn contact_columns(crossings: &[Crossing]) -> Vec<(&'static str, Column<'static>)> {
    let count = crossings.iter().map(|crossing| crossing.contacts.len()).sum();
    let mut rows: Vec<StoredContact> = Vec::with_capacity(count);
    crossings.iter().for_each(|crossing| rows.extend_from_slice(&crossing.contacts));
    let partner = |row: &StoredContact| match row.partner {
        ContactPartner::Particle(id) => (PARTICLE, id.0, 0),
        ContactPartner::Part { part, element } => (PART, u64::from(part), element),
    };
    vec![
        ("partner_kind", of(&rows, |row| partner(row).0)),
        ("partner", of(&rows, |row| partner(row).1)),
        ("partner_element", of(&rows, |row| partner(row).2)),
        ("contact_point", of(&rows, |row| row.point)),
        ("contact_normal", of(&rows, |row| row.normal)),
        ("contact_overlap", of(&rows, |row| row.overlap)),
        ("normal_force", of(&rows, |row| row.normal_force)),
        ("tangential_force", of(&rows, |row| row.tangential_force)),
        ("tangential_memory", of(&rows, |row| row.tangential_memory)),
        ("rolling_memory", of(&rows, |row| row.rolling_memory)),
    ]
}

fn path_columns(crossings: &[Crossing]) -> Vec<(&'static str, Column<'static>)> {
    let count = crossings.iter().map(|crossing| crossing.path.len()).sum();
    let gather = |value: fn(&Motion) -> Vec3| {
        let mut rows: Vec<Vec3> = Vec::with_capacity(count);
        crossings.iter().for_each(|crossing| rows.extend(crossing.path.iter().map(value)));
        Column::from(rows)
    };
    vec![
        ("path_position", gather(|m| m.position)),
        ("path_velocity", gather(|m| m.velocity)),
        ("path_spin", gather(|m| m.spin)),
        ("path_acceleration", gather(|m| m.acceleration)),
        ("path_spin_acceleration", gather(|m| m.spin_acceleration)),
    ]
}

/// Takes the crossings out of `columns`, where each of [`columns`] is found under its name after `prefix`. `path` is the file
/// they come from, for messages.
///
/// # Errors
/// When a column is missing, of another type or length, holds a number that is not finite, or names what cannot be.
pub fn from_columns(
    path: &Path,
    columns: &mut BTreeMap<String, Column<'static>>,
    prefix: &str,
) -> Result<Vec<Crossing>, StorageError> {
    let mut taken = Taken { path, prefix, columns };
    let (states, steps) = states(&mut taken)?;
    let count = states.len();
    let (force, torque) = (taken.vectors("force", count)?, taken.vectors("torque", count)?);
    let passages = passages(&mut taken, count)?;
    let contact_counts = taken.u64s("contact_count", count)?;
    let (path_start, path_counts) = (taken.u64s("path_start", count)?, taken.u64s("path_count", count)?);
    let mut contacts = Ranges::new(contacts(&mut taken)?);
    let mut motions = Motions::take(&mut taken)?;
    let mut crossings = Vec::with_capacity(count);
    for row in 0..count {
        let refuse = |what| taken.refuse(&format!("crossing {row} claims {what} than are there"));
        crossings.push(Crossing {
            step: steps[row],
            state: states[row],
            force: force[row],
            torque: torque[row],
            passage: passages[row],
            contacts: contacts.next(contact_counts[row]).ok_or_else(|| refuse("more contacts"))?,
            path: motions.next(path_counts[row]).ok_or_else(|| refuse("more motions of its path"))?,
            path_start: path_start[row],
        });
    }
    match (contacts.left(), motions.left()) {
        (0, 0) => Ok(crossings),
        (0, left) => Err(taken.refuse(&format!("{left} motions of paths belong to no crossing"))),
        (left, _) => Err(taken.refuse(&format!("{left} contacts belong to no crossing"))),
    }
}

fn states(taken: &mut Taken) -> Result<(Vec<ParticleState>, Vec<u64>), StorageError> {
    let steps = taken.any_u64s("step")?;
    let count = steps.len();
    let id = taken.u64s("id", count)?;
    let Column::U16(material) = taken.column("material", Some(count))? else { return Err(taken.wrong("material")) };
    let (radius, density) = (taken.reals("radius", count)?, taken.reals("density", count)?);
    let position = taken.vectors("position", count)?;
    let (velocity, spin) = (taken.vectors("velocity", count)?, taken.vectors("spin", count)?);
    let state = |row: usize| ParticleState {
        id: ParticleId(id[row]),
        material: material[row],
        radius: radius[row],
        density: density[row],
        position: position[row],
        velocity: velocity[row],
        spin: spin[row],
    };
    Ok(((0..count).map(state).collect(), steps))
}

fn passages(taken: &mut Taken, count: usize) -> Result<Vec<Passage>, StorageError> {
    let time = taken.reals("passage_time", count)?;
    let position = taken.vectors("passage_position", count)?;
    let velocity = taken.vectors("passage_velocity", count)?;
    let spin = taken.vectors("passage_spin", count)?;
    let passage =
        |row: usize| Passage { time: time[row], position: position[row], velocity: velocity[row], spin: spin[row] };
    Ok((0..count).map(passage).collect())
}

fn contacts(taken: &mut Taken) -> Result<Vec<StoredContact>, StorageError> {
    let partner = taken.any_u64s("partner")?;
    let count = partner.len();
    let Column::U8(kind) = taken.column("partner_kind", Some(count))? else { return Err(taken.wrong("partner_kind")) };
    let Column::U32(element) = taken.column("partner_element", Some(count))? else {
        return Err(taken.wrong("partner_element"));
    };
    let partner = |row: usize| match (kind[row], u16::try_from(partner[row])) {
        (PARTICLE, _) => Ok(ContactPartner::Particle(ParticleId(partner[row]))),
        (PART, Ok(part)) => Ok(ContactPartner::Part { part, element: element[row] }),
        _ => Err(taken.refuse(&format!("contact {row} has a partner that cannot be"))),
    };
    let partners: Vec<ContactPartner> = (0..count).map(partner).collect::<Result<_, _>>()?;
    let point = taken.vectors("contact_point", count)?;
    let normal = taken.vectors("contact_normal", count)?;
    let overlap = taken.reals("contact_overlap", count)?;
    let normal_force = taken.vectors("normal_force", count)?;
    let tangential_force = taken.vectors("tangential_force", count)?;
    let tangential_memory = taken.vectors("tangential_memory", count)?;
    let rolling_memory = taken.vectors("rolling_memory", count)?;
    let contact = |row: usize| StoredContact {
        partner: partners[row],
        point: point[row],
        normal: normal[row],
        overlap: overlap[row],
        normal_force: normal_force[row],
        tangential_force: tangential_force[row],
        tangential_memory: tangential_memory[row],
        rolling_memory: rolling_memory[row],
    };
    Ok((0..count).map(contact).collect())
}

/// The columns of paths, handed out path by path.
struct Motions {
    position: Vec<Vec3>,
    velocity: Vec<Vec3>,
    spin: Vec<Vec3>,
    acceleration: Vec<Vec3>,
    spin_acceleration: Vec<Vec3>,
    next: usize,
}

impl Motions {
    fn take(taken: &mut Taken) -> Result<Self, StorageError> {
        let Column::Vec3(position) = taken.column("path_position", None)? else {
            return Err(taken.wrong("path_position"));
        };
        let count = position.len();
        Ok(Self {
            position: position.into_owned(),
            velocity: taken.vectors("path_velocity", count)?,
            spin: taken.vectors("path_spin", count)?,
            acceleration: taken.vectors("path_acceleration", count)?,
            spin_acceleration: taken.vectors("path_spin_acceleration", count)?,
            next: 0,
        })
    }

    fn next(&mut self, count: u64) -> Option<Vec<Motion>> {
        let end = usize::try_from(count).ok().and_then(|count| self.next.checked_add(count))?;
        if end > self.position.len() {
            return None;
        }
        let motion = |row: usize| Motion {
            position: self.position[row],
            velocity: self.velocity[row],
            spin: self.spin[row],
            acceleration: self.acceleration[row],
            spin_acceleration: self.spin_acceleration[row],
        };
        let path = (self.next..end).map(motion).collect();
        self.next = end;
        Some(path)
    }

    const fn left(&self) -> usize {
        self.position.len() - self.next
    }
}

/// Columns that are being taken, and where they come from.
struct Taken<'a> {
    path: &'a Path,
    prefix: &'a str,
    columns: &'a mut BTreeMap<String, Column<'static>>,
}

impl Taken<'_> {
    fn refuse(&self, what: &str) -> StorageError {
        StorageError::unusable(self.path, format!("{what}; record the stream again"))
    }

    fn wrong(&self, name: &str) -> StorageError {
        self.refuse(&format!("column {:?} holds another type of number than it must", format!("{}{name}", self.prefix)))
    }

    /// The column `name`, of `length` rows where that is known, all numbers finite.
    fn column(&mut self, name: &str, length: Option<usize>) -> Result<Column<'static>, StorageError> {
        let full = format!("{}{name}", self.prefix);
        let column = self.columns.remove(&full);
        let column = column.ok_or_else(|| self.refuse(&format!("it has no column {full:?}")))?;
        if let Some(length) = length.filter(|&length| length != column.len()) {
            return Err(self.refuse(&format!("column {full:?} has {} rows instead of {length}", column.len())));
        }
        match infinite_row(&column) {
            Some(row) => Err(self.refuse(&format!("row {row} of column {full:?} is not a finite number"))),
            None => Ok(column),
        }
    }

    fn any_u64s(&mut self, name: &str) -> Result<Vec<u64>, StorageError> {
        let Column::U64(values) = self.column(name, None)? else { return Err(self.wrong(name)) };
        Ok(values.into_owned())
    }

    fn u64s(&mut self, name: &str, length: usize) -> Result<Vec<u64>, StorageError> {
        let Column::U64(values) = self.column(name, Some(length))? else { return Err(self.wrong(name)) };
        Ok(values.into_owned())
    }

    fn reals(&mut self, name: &str, length: usize) -> Result<Vec<f64>, StorageError> {
        let Column::F64(values) = self.column(name, Some(length))? else { return Err(self.wrong(name)) };
        Ok(values.into_owned())
    }

    fn vectors(&mut self, name: &str, length: usize) -> Result<Vec<Vec3>, StorageError> {
        let Column::Vec3(values) = self.column(name, Some(length))? else { return Err(self.wrong(name)) };
        Ok(values.into_owned())
    }
}

/// The first row that holds a number that is not finite.
pub(super) fn infinite_row(column: &Column) -> Option<usize> {
    match column {
        Column::F64(values) => values.iter().position(|value| !value.is_finite()),
        Column::Vec3(values) => values.iter().position(|vector| !vector.data.0[0].iter().all(|x| x.is_finite())),
        Column::U64(_) | Column::U32(_) | Column::U16(_) | Column::U8(_) => None,
    }
}

/// Rows handed out in consecutive ranges.
struct Ranges<T> {
    rows: Vec<T>,
    next: usize,
}

impl<T: Copy> Ranges<T> {
    const fn new(rows: Vec<T>) -> Self {
        Self { rows, next: 0 }
    }

    fn next(&mut self, count: u64) -> Option<Vec<T>> {
        let end = usize::try_from(count).ok().and_then(|count| self.next.checked_add(count))?;
        let range = self.rows.get(self.next..end)?.to_vec();
        self.next = end;
        Some(range)
    }

    const fn left(&self) -> usize {
        self.rows.len() - self.next
    }
}
