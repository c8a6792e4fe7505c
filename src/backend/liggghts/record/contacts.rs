//! Contacts of crossings, from text dumps of LIGGGHTS' local computes.
//!
//! LIGGGHTS has one `compute pair/gran/local` and one `compute wall/gran/local` in a deck, so one file of each serves all gates:
//! [`PAIRS_FILE`] and [`WALLS_FILE`], a snapshot at every sample (an empty one where nothing has passed). The computes stand
//! before the first run, that of the walls after their fix. They look at two groups only, which the deck fills at every sample:
//! [`FRESH`], what has come behind a gate plane since the last sample, and [`TOUCH`], `FRESH` and whatever may touch it.
//!
//! ```text
//! compute pairs touch pair/gran/local pos id force_normal force_tangential history delta
//! compute walls fresh wall/gran/local pos id force_normal force_tangential history delta
//! # at every sample, for each gate; behind_GATE is an atom-style variable, s >= 0, and was_GATE a group:
//! group fresh subtract fresh all
//! group touch subtract touch all
//! group behind_GATE subtract behind_GATE all
//! group behind_GATE variable behind_GATE
//! group fresh_GATE subtract fresh_GATE all
//! group fresh_GATE union fresh_GATE behind_GATE
//! group fresh_GATE subtract fresh_GATE was_GATE
//! group was_GATE subtract was_GATE all
//! group was_GATE union was_GATE behind_GATE
//! group fresh union fresh fresh_GATE
//! group touch variable touch_GATE
//! # once:
//! write_dump touch local contacts/pairs c_pairs[1] ... modify append yes format '%.10g ...'
//! write_dump fresh local contacts/walls c_walls[1] ... modify append yes format '%.10g ...'
//! ```
//!
//! On one rank `touch_GATE` is the box around `fresh_GATE` ([`touch_box`]), so that the dumps stay small. Several ranks learn of
//! a change of a group of their neighbours' particles only when neighbour lists are made: there it must be the whole slab within
//! a largest diameter and a skin of the plane ([`touch_slab`]), or pairs across ranks are missing.

use super::local_dump::LocalDump;
use crate::gate::crossing::{ContactPartner, StoredContact};
use crate::math::{Vec3, vec3};
use crate::particle::ParticleId;
use crate::storage::StorageError;
use std::path::Path;

/// Dump of contacts between particles, in the case.
pub const PAIRS_FILE: &str = "contacts/pairs";
/// Dump of contacts with walls, in the case.
pub const WALLS_FILE: &str = "contacts/walls";
/// Group of particles that have come behind a gate plane since the last sample, of all gates.
pub const FRESH: &str = "fresh";
/// Group of these and of whatever may touch them.
pub const TOUCH: &str = "touch";
/// Quantities of both computes where the contact model remembers something ([`history_numbers`] > 0).
pub const QUANTITIES: &str = "pos id force_normal force_tangential history delta";
/// Quantities of the compute of pairs where it does not; LIGGGHTS has no compute of walls then.
pub const QUANTITIES_WITHOUT_HISTORY: &str = "pos id force_normal force_tangential delta";

/// Columns of a pair besides the history: centre of i, centre of j, tag of i, tag of j, whether a periodic image, normal force
/// on i, tangential force on i; the history; overlap.
pub const PAIR_COLUMNS: usize = 16;
/// Columns of a wall contact besides the history: contact point, centre, mesh, triangle, tag, normal force on the particle,
/// tangential force on it; the history; overlap.
pub const WALL_COLUMNS: usize = 16;

/// Numbers that LIGGGHTS remembers of a contact: `tangential history` 3 (none with `no_history`), `rolling_friction epsd2` 3 more.
#[must_use]
pub const fn history_numbers(tangential_history: bool, epsd2: bool) -> usize {
    (if tangential_history { 3 } else { 0 }) + (if epsd2 { 3 } else { 0 })
}

/// What follows `write_dump GROUP local FILE`: columns of the compute `compute` of `columns` in all.
#[must_use]
pub fn dump_arguments(compute: &str, columns: usize) -> String {
    let names: Vec<String> = (1..=columns).map(|column| format!("c_{compute}[{column}]")).collect();
    let formats = vec!["%.10g"; columns].join(" ");
    format!("{} modify append yes format '{formats}'", names.join(" "))
}

/// Formula of the atom-style variable `touch_GATE` on one rank: the box around group `fresh`, wider by a largest diameter \[m\].
/// `open` says which of x, y, z are not periodic: across a periodic border the box does not reach.
#[must_use]
pub fn touch_box(fresh: &str, largest_diameter: f64, open: [bool; 3]) -> String {
    let mut terms = vec![format!("(count({fresh})>0)")];
    for axis in ["x", "y", "z"].into_iter().zip(open).filter_map(|(axis, open)| open.then_some(axis)) {
        terms.push(format!("({axis}>=bound({fresh},{axis}min)-{largest_diameter})"));
        terms.push(format!("({axis}<=bound({fresh},{axis}max)+{largest_diameter})"));
    }
    terms.join("*")
}

/// Formula of the atom-style variable `touch_GATE` on several ranks: `distance` is the formula of the centre's distance s from the
/// plane \[m\]; what has passed since the last sample lies within `travel` \[m\] behind it.
#[must_use]
pub fn touch_slab(distance: &str, largest_diameter: f64, skin: f64, travel: f64) -> String {
    // A radius more where the lowest point is what passes.
    let before = 1.5 * largest_diameter + skin;
    let behind = travel + largest_diameter + skin;
    format!("(({distance})>=-{before})*(({distance})<={behind})")
}

/// A particle whose contacts are wanted.
#[derive(Debug, Clone, Copy)]
pub struct Wanted {
    /// LIGGGHTS' number.
    pub tag: u32,
    /// Centre, from the sample \[m\].
    pub position: Vec3,
    /// Radius \[m\].
    pub radius: f64,
}

/// Contacts of some particles, by their tags.
pub type Found = Vec<(u32, StoredContact)>;

/// The contact dumps of a case.
#[derive(Debug)]
pub struct Contacts {
    pairs: LocalDump,
    walls: LocalDump,
    /// For each mesh of the deck, which is the part of the same number, whether its triangles are the part's own.
    meshes: Vec<bool>,
    periods: [Option<f64>; 3],
}

impl Contacts {
    /// The dumps of the case in the folder `case`, whose domain has `periods` \[m\]. Where contacts are recorded, every part of the
    /// scene is a mesh of one wall for the whole run, in the scene's order; `meshes` says of each whether its triangles are the part's own.
    #[must_use]
    pub fn new(case: &Path, meshes: Vec<bool>, periods: [Option<f64>; 3]) -> Self {
        let dump = |name: &str| LocalDump::new(case.join(name));
        Self { pairs: dump(PAIRS_FILE), walls: dump(WALLS_FILE), meshes, periods }
    }

    /// Files that have been read, to be removed.
    pub fn files(&self) -> [&Path; 2] {
        [self.pairs.path(), self.walls.path()]
    }

    /// Bytes read so far.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        self.pairs.bytes() + self.walls.bytes()
    }

    /// Contacts of the particles `wanted`, sorted by tag, at the sample of time step `step`; sorted by tag and partner.
    ///
    /// # Errors
    /// When a dump is damaged, or has nothing of that time step.
    pub fn of(
        &mut self,
        step: u64,
        wanted: &[Wanted],
        id: &impl Fn(u32) -> Option<ParticleId>,
    ) -> Result<Found, StorageError> {
        let mut found = Found::new();
        let wants = |tag: u32| wanted.binary_search_by_key(&tag, |wanted| wanted.tag).ok().map(|at| wanted[at]);
        let periods = self.periods;
        let has = self.pairs.visit(step, |row| {
            let pair = Pair::of(row, &periods)?;
            for (own, other, seen) in [(pair.tags[0], pair.tags[1], false), (pair.tags[1], pair.tags[0], true)] {
                if let Some(wanted) = wants(own) {
                    let partner = id(other).ok_or_else(|| format!("no particle has the number {other}"))?;
                    found.push((own, pair.seen_from(&wanted, seen, ContactPartner::Particle(partner))));
                }
            }
            Ok(())
        })?;
        Self::require(has, wanted, &self.pairs, step)?;
        if !self.meshes.is_empty() {
            let meshes = &self.meshes;
            let has = self.walls.visit(step, |row| {
                let wall = Wall::of(row)?;
                if wants(wall.tag).is_some() {
                    found.push((wall.tag, wall.stored(meshes)?));
                }
                Ok(())
            })?;
            Self::require(has, wanted, &self.walls, step)?;
        }
        found.sort_by_key(|(tag, contact)| (*tag, contact.partner));
        // Two ranks or two periodic images may both tell of one contact.
        found.dedup_by_key(|(tag, contact)| (*tag, contact.partner));
        Ok(found)
    }

    fn require(has: bool, wanted: &[Wanted], dump: &LocalDump, step: u64) -> Result<(), StorageError> {
        if has || wanted.is_empty() {
            return Ok(());
        }
        let reason = format!("it says nothing of time step {step}, at which particles passed; run the stage again");
        Err(StorageError::unusable(dump.path(), reason))
    }
}

/// A row between two particles, seen from i.
struct Pair {
    tags: [u32; 2],
    normal: Vec3,
    forces: [Vec3; 2],
    memories: [Vec3; 2],
    overlap: f64,
}

impl Pair {
    fn of(row: &[f64], periods: &[Option<f64>; 3]) -> Result<Self, String> {
        let memories = memories(row, PAIR_COLUMNS)?;
        let mut branch = vector(row, 3) - vector(row, 0);
        for (axis, period) in periods.iter().enumerate() {
            if let Some(period) = period {
                branch[axis] -= (branch[axis] / period).round() * period;
            }
        }
        let normal = branch.try_normalize(0.0).ok_or("two particles lie in one place")?;
        let tags = [tag(row[6])?, tag(row[7])?];
        let forces = [vector(row, 9), vector(row, 12)];
        Ok(Self { tags, normal, forces, memories, overlap: row[row.len() - 1] })
    }

    /// Seen from the particle `own`, which is j where `mirrored`: everything that has a direction turns round.
    fn seen_from(&self, own: &Wanted, mirrored: bool, partner: ContactPartner) -> StoredContact {
        let sign = if mirrored { -1.0 } else { 1.0 };
        let normal = self.normal * sign;
        StoredContact {
            partner,
            point: own.position + normal * (own.radius - 0.5 * self.overlap),
            normal,
            overlap: self.overlap,
            normal_force: self.forces[0] * sign,
            tangential_force: self.forces[1] * sign,
            tangential_memory: self.memories[0] * sign,
            rolling_memory: self.memories[1] * sign,
        }
    }
}

/// A row between a particle and a wall.
struct Wall {
    tag: u32,
    mesh: u32,
    element: u32,
    point: Vec3,
    normal: Vec3,
    forces: [Vec3; 2],
    memories: [Vec3; 2],
    overlap: f64,
}

impl Wall {
    fn of(row: &[f64]) -> Result<Self, String> {
        let memories = memories(row, WALL_COLUMNS)?;
        let point = vector(row, 0);
        let normal = (point - vector(row, 3)).try_normalize(0.0);
        Ok(Self {
            tag: tag(row[8])?,
            mesh: number(row[6])?,
            element: number(row[7])?,
            point,
            normal: normal.ok_or("a particle's centre lies on a wall")?,
            forces: [vector(row, 9), vector(row, 12)],
            memories,
            overlap: row[row.len() - 1],
        })
    }

    fn stored(&self, meshes: &[bool]) -> Result<StoredContact, String> {
        let own = *meshes
            .get(self.mesh as usize)
            .ok_or_else(|| format!("mesh {} is none of the {} of the deck", self.mesh, meshes.len()))?;
        Ok(StoredContact {
            partner: ContactPartner::Part { part: self.mesh as u16, element: if own { self.element } else { 0 } },
            point: self.point,
            normal: self.normal,
            overlap: self.overlap,
            normal_force: self.forces[0],
            tangential_force: self.forces[1],
            tangential_memory: self.memories[0],
            rolling_memory: self.memories[1],
        })
    }
}

/// Memories of the tangential and of the rolling law, which stand before the overlap.
fn memories(row: &[f64], columns: usize) -> Result<[Vec3; 2], String> {
    let first = columns - 1;
    match row.len().checked_sub(columns) {
        Some(0) => Ok([Vec3::zeros(); 2]),
        Some(3) => Ok([vector(row, first), Vec3::zeros()]),
        Some(6) => Ok([vector(row, first), vector(row, first + 3)]),
        _ => Err(format!("a row has {} numbers, {columns} and none, 3 or 6 of memory are known", row.len())),
    }
}

fn vector(row: &[f64], first: usize) -> Vec3 {
    vec3(row[first], row[first + 1], row[first + 2])
}

fn number(value: f64) -> Result<u32, String> {
    let fits = value >= 0.0 && value <= f64::from(u32::MAX) && value.fract() == 0.0;
    if fits { Ok(value as u32) } else { Err(format!("{value} is not a whole number")) }
}

fn tag(value: f64) -> Result<u32, String> {
    number(value).ok().filter(|tag| *tag > 0).ok_or_else(|| format!("{value} is no particle's number"))
}

#[cfg(test)]
mod tests;
