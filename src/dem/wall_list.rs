//! Who of a chunk is near which part, and their contacts with it.
//!
//! Kept part by part: the contacts of a block of lanes then share the part's material, and the motion of its surface.
//!
//! A plane has one element, so whoever is near it keeps a place in the list, touching or not, and his memory stays where it is.
//! Of other parts the contacts themselves are listed, anew in every time step; memory moves only where they begin, end or go on in
//! another order.

use super::neighbor::list::{Memory, PairMemory};
use super::particles::Sphere;
use super::pieces::add_up;
use super::threads::Threads;
use super::wall::{Candidate, NearElements, Plane, WallPoint, Walls};
use crate::math::Vec3;
use crate::math::lanes::MOST_LANES;
use std::ops::Range;

/// Cosine of the angle by which the normal may turn where a contact goes on: sliding over an edge turns it by less than 60 degrees
/// a step; a new wall of a corner does not.
const SAME_SURFACE: f64 = 0.5;
/// In place of a contact's number: there is none.
pub(super) const NONE: u32 = u32::MAX;

/// A contact with a part that lasts, with its memory.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallContact {
    /// Storage index of the particle.
    pub particle: u32,
    /// Part.
    pub part: u16,
    /// Triangle touched last.
    pub element: u32,
    /// Normal at the last time step.
    pub normal: Vec3,
    /// Memory.
    pub memory: Memory,
}

/// What a chunk's particles have to do with parts, part by part, ascending; parts that nobody is near are left out.
#[derive(Debug, Clone, Default)]
pub struct WallList {
    pub(super) parts: Vec<PartList>,
    /// Whether loads have been computed from these.
    pub(super) were_seen: bool,
}

/// What a chunk's particles have to do with one part.
#[derive(Debug, Clone)]
pub(super) struct PartList {
    pub(super) part: u16,
    pub(super) is_plane: bool,
    /// Elements near the particles; of a plane none.
    pub(super) near: NearElements,
    /// All of a plane, which is one element.
    whole: Candidate,
    /// Where contacts are; of a plane, whoever is near it.
    pub(super) places: Places,
    /// Memory of each contact.
    pub(super) memory: PairMemory,
    /// Unit normal of the contacts with a plane at the last time step, to the plane.
    pub(super) plane_normal: Vec3,
}

/// Places of contacts, by particle. Between [`PartList::pad`] and a change, lists are as long as whole blocks of lanes.
#[derive(Debug, Clone, Default)]
pub(super) struct Places {
    pub(super) count: usize,
    /// Storage indices; padded with the last one.
    pub(super) particles: Vec<u32>,
    /// Elements touched; empty for planes, as are the next two.
    elements: Vec<u32>,
    /// Unit normals to the part.
    pub(super) normals: [Vec<f64>; 3],
    /// Overlaps [m].
    pub(super) overlaps: Vec<f64>,
}

/// The elements of all parts near each particle, chunk by chunk, ascending.
pub(super) struct NearParts(Vec<ChunkParts>);

/// Those near the particles of one chunk.
struct ChunkParts {
    range: Range<usize>,
    /// Where each particle's begin, and where the last one's end.
    starts: Vec<usize>,
    candidates: Vec<Candidate>,
}

impl NearParts {
    /// Of the particles in the chunks' lists.
    pub(super) fn new(lists: &[(Range<usize>, WallList)], threads: &Threads) -> Self {
        Self(threads.map(lists.len(), |number| ChunkParts::new(&lists[number].0, &lists[number].1)))
    }

    /// The elements near the particle stored at `index`, by part; `None` where the lists did not know it.
    pub(super) fn of(&self, index: usize) -> Option<&[Candidate]> {
        self.0.get(self.0.partition_point(|chunk| chunk.range.end <= index)).map(|chunk| chunk.of(index))
    }
}

impl ChunkParts {
    fn new(range: &Range<usize>, list: &WallList) -> Self {
        let mut starts = vec![0; range.len() + 1];
        list.rows().for_each(|(index, near)| starts[index - range.start + 1] += near.len());
        add_up(&mut starts);
        let mut ends = starts.clone();
        let mut candidates = vec![Candidate { part: 0, element: 0 }; starts[range.len()]];
        for (index, near) in list.rows() {
            let end = &mut ends[index - range.start];
            candidates[*end..][..near.len()].copy_from_slice(near);
            *end += near.len();
        }
        Self { range: range.clone(), starts, candidates }
    }

    fn of(&self, index: usize) -> &[Candidate] {
        let row = index - self.range.start;
        &self.candidates[self.starts[row]..self.starts[row + 1]]
    }
}

impl WallList {
    /// Collects every element within `skin` [m] of the surface of the particles in `range`.
    #[must_use]
    pub fn collect(spheres: &[Sphere], walls: &Walls, range: &Range<usize>, skin: f64) -> Self {
        let mut result = Self::default();
        let mut found = Vec::new();
        for part in walls.present_parts() {
            walls.candidates_of(part, &spheres[range.clone()], skin, &mut found, |place, found| {
                result.push(walls, range.start + place, found);
            });
        }
        result
    }

    /// Adds the elements near the particle stored at `index`, which follows all that are here of the same parts.
    pub fn push(&mut self, walls: &Walls, index: usize, found: &[Candidate]) {
        for group in found.chunk_by(|a, b| a.part == b.part) {
            self.part(walls, group[0].part).push(index as u32, group);
        }
    }

    fn part(&mut self, walls: &Walls, part: u16) -> &mut PartList {
        let place = self.parts.binary_search_by_key(&part, |list| list.part).unwrap_or_else(|place| {
            self.parts.insert(place, PartList::new(part, walls.plane(part)));
            place
        });
        &mut self.parts[place]
    }

    /// The particles, by storage index, and the elements of one part near each.
    pub fn rows(&self) -> impl Iterator<Item = (usize, &[Candidate])> {
        self.parts.iter().flat_map(PartList::rows)
    }

    /// Those near a part whom `concerned` picks, by storage index, ascending.
    pub fn particles(&self, concerned: impl Fn(usize) -> bool) -> Vec<usize> {
        let near = self.rows().map(|(particle, _)| particle);
        let mut particles: Vec<usize> = near.filter(|&particle| concerned(particle)).collect();
        particles.sort_unstable();
        particles.dedup();
        particles
    }

    /// How many contacts there may be: with planes, all who are near.
    pub(super) fn count(&self) -> usize {
        self.parts.iter().map(|list| list.places.count).sum()
    }

    /// Parts that some particle is near.
    pub fn parts(&self) -> impl Iterator<Item = u16> {
        self.parts.iter().map(|list| list.part)
    }

    /// All contacts by particle; of planes those with a memory.
    #[must_use]
    pub fn contacts(&self) -> Vec<WallContact> {
        let mut contacts: Vec<WallContact> =
            self.parts.iter().flat_map(|list| (0..list.places.count).filter_map(|place| list.contact(place))).collect();
        contacts.sort_by_key(|contact| contact.particle);
        contacts
    }

    /// Memory of the contacts that go on where the particle stored at `index` touches parts, point by point; `points` come by part.
    #[must_use]
    pub fn recall(&self, index: usize, points: &[WallPoint]) -> Vec<Memory> {
        let of_part = |group: &[WallPoint]| -> Vec<Memory> {
            let list = self.parts.binary_search_by_key(&group[0].part, |list| list.part);
            let nothing = || vec![Memory::NONE; group.len()];
            list.map_or_else(|_| nothing(), |place| self.parts[place].memories(index as u32, group))
        };
        points.chunk_by(|a, b| a.part == b.part).flat_map(of_part).collect()
    }

    /// Adds a contact behind those of its particle.
    pub fn hold(&mut self, walls: &Walls, contact: &WallContact) {
        self.part(walls, contact.part).hold(contact);
    }

    /// Drops the contacts that `gone` picks, with their memory.
    pub fn forget(&mut self, gone: impl Fn(&WallContact) -> bool) {
        for list in &mut self.parts {
            list.forget(&gone);
        }
    }
}

impl PartList {
    fn new(part: u16, plane: Option<Plane>) -> Self {
        Self {
            part,
            is_plane: plane.is_some(),
            near: NearElements::default(),
            whole: Candidate { part, element: 0 },
            places: Places::default(),
            memory: PairMemory::default(),
            plane_normal: plane.map_or_else(Vec3::zeros, |plane| -plane.normal),
        }
    }

    fn push(&mut self, particle: u32, found: &[Candidate]) {
        if self.is_plane {
            self.places.particles.push(particle);
            self.places.count += 1;
        } else {
            self.near.push(particle, found);
        }
    }

    fn rows(&self) -> impl Iterator<Item = (usize, &[Candidate])> {
        let near_plane = if self.is_plane { &self.places.particles[..self.places.count] } else { &[] };
        let whole = std::slice::from_ref(&self.whole);
        near_plane.iter().map(move |&particle| (particle as usize, whole)).chain(self.near.rows())
    }

    /// The contact at a place; none where one near a plane has no memory of it.
    fn contact(&self, place: usize) -> Option<WallContact> {
        let memory = self.memory.get(place).unwrap_or(Memory::NONE);
        let (particle, part) = (self.places.particles[place], self.part);
        if self.is_plane {
            let contact = WallContact { particle, part, element: 0, normal: self.plane_normal, memory };
            return (memory != Memory::NONE).then_some(contact);
        }
        let (element, normal) = (self.places.elements[place], self.places.normal(place));
        Some(WallContact { particle, part, element, normal, memory })
    }

    /// Memory of the contacts of a particle that go on at each of the points.
    fn memories(&self, particle: u32, points: &[WallPoint]) -> Vec<Memory> {
        let held = self.places.of(particle);
        let mut taken = vec![false; held.len()];
        let place = |point: &WallPoint| {
            if self.is_plane { held.clone().next() } else { self.places.recall(&held, &mut taken, point) }
        };
        let kept = |place: Option<usize>| place.and_then(|place| self.memory.get(place)).unwrap_or(Memory::NONE);
        points.iter().map(place).map(kept).collect()
    }

    /// Memory of places that were at the numbers in `old` before; nothing where that is [`NONE`].
    pub(super) fn move_memory(&mut self, old: &[u32], component: &mut Vec<f64>) {
        if old.len() == self.places.count && (0_u32..).zip(old).all(|(place, &old)| place == old) {
            return;
        }
        for list in self.memory.tangential.iter_mut().chain(&mut self.memory.rolling) {
            component.clear();
            component.extend(old.iter().map(|&old| if old == NONE { 0.0 } else { list[old as usize] }));
            std::mem::swap(list, component);
        }
    }

    fn hold(&mut self, contact: &WallContact) {
        self.resize(self.places.count);
        let own = self.places.of(contact.particle);
        if !self.is_plane {
            self.places.insert(own.end, contact);
            self.insert_memory(own.end, &contact.memory);
        } else if contact.element != 0 && contact.normal.dot(&self.plane_normal) <= SAME_SURFACE {
            // The part was of another shape where the contact comes from.
        } else if own.is_empty() {
            self.places.particles.insert(own.start, contact.particle);
            self.places.count += 1;
            self.insert_memory(own.start, &contact.memory);
        } else {
            self.memory.set(own.start, &contact.memory);
        }
    }

    fn insert_memory(&mut self, place: usize, memory: &Memory) {
        for (lists, vector) in
            [(&mut self.memory.tangential, &memory.tangential), (&mut self.memory.rolling, &memory.rolling)]
        {
            lists.iter_mut().zip(vector.iter()).for_each(|(list, component)| list.insert(place, *component));
        }
    }

    fn forget(&mut self, gone: impl Fn(&WallContact) -> bool) {
        let is_gone = |list: &Self, place: usize| list.contact(place).is_some_and(|contact| gone(&contact));
        if self.is_plane {
            for place in 0..self.places.count {
                if is_gone(self, place) {
                    self.memory.set(place, &Memory::NONE);
                }
            }
            return;
        }
        let kept: Vec<u32> = (0..self.places.count as u32).filter(|&place| !is_gone(self, place as usize)).collect();
        if kept.len() < self.places.count {
            self.move_memory(&kept, &mut Vec::new());
            self.places.keep(&kept);
        }
    }

    /// Makes all lists as long as whole blocks of lanes.
    pub(super) fn pad(&mut self) {
        self.resize(self.places.count.next_multiple_of(MOST_LANES));
    }

    fn resize(&mut self, length: usize) {
        if self.is_plane {
            let last = self.places.particles[..self.places.count].last().copied().unwrap_or_default();
            self.places.particles.resize(length, last);
        } else {
            self.places.resize(length);
        }
        for list in self.memory.tangential.iter_mut().chain(&mut self.memory.rolling) {
            list.resize(length, 0.0);
        }
    }
}

impl Places {
    fn normal(&self, place: usize) -> Vec3 {
        Vec3::from_fn(|axis, _| self.normals[axis][place])
    }

    /// The places of a particle.
    fn of(&self, particle: u32) -> Range<usize> {
        let particles = &self.particles[..self.count];
        particles.partition_point(|&held| held < particle)..particles.partition_point(|&held| held <= particle)
    }

    /// The places of a particle that is none of those before `from`.
    pub(super) fn next_of(&self, from: usize, particle: u32) -> Range<usize> {
        let particles = &self.particles[..self.count];
        let first = particles[from..].iter().position(|&held| held >= particle).map_or(self.count, |n| from + n);
        let end = particles[first..].iter().position(|&held| held != particle).map_or(self.count, |n| first + n);
        first..end
    }

    /// The contact among `held` that `point` continues: on the same triangle, else the one whose normal is closest. It is marked
    /// in `taken`, and none that was is found again.
    pub(super) fn recall(&self, held: &Range<usize>, taken: &mut [bool], point: &WallPoint) -> Option<usize> {
        let free = |place: &usize| !taken[place - held.start];
        let same = held.clone().filter(free).find(|&place| self.elements[place] == point.element);
        let closest = || {
            held.clone()
                .filter(free)
                .map(|place| (place, self.normal(place).dot(&point.normal)))
                .filter(|(_, cosine)| *cosine > SAME_SURFACE)
                .max_by(|a, b| a.1.total_cmp(&b.1))
                .map(|(place, _)| place)
        };
        let found = same.or_else(closest)?;
        taken[found - held.start] = true;
        Some(found)
    }

    pub(super) fn push(&mut self, particle: u32, point: &WallPoint) {
        self.count += 1;
        self.particles.push(particle);
        self.elements.push(point.element);
        self.normals.iter_mut().zip(point.normal.iter()).for_each(|(list, component)| list.push(*component));
        self.overlaps.push(point.overlap);
    }

    fn insert(&mut self, place: usize, contact: &WallContact) {
        self.count += 1;
        self.particles.insert(place, contact.particle);
        self.elements.insert(place, contact.element);
        for (list, component) in self.normals.iter_mut().zip(contact.normal.iter()) {
            list.insert(place, *component);
        }
        self.overlaps.insert(place, 0.0);
    }

    /// Drops all places but those in `kept`.
    fn keep(&mut self, kept: &[u32]) {
        let picked = |list: &[f64]| kept.iter().map(|&place| list[place as usize]).collect();
        self.normals = self.normals.each_ref().map(|list| picked(list));
        self.overlaps = picked(&self.overlaps);
        self.particles = kept.iter().map(|&place| self.particles[place as usize]).collect();
        self.elements = kept.iter().map(|&place| self.elements[place as usize]).collect();
        self.count = kept.len();
    }

    /// What lies beyond the places counts for nothing.
    pub(super) fn resize(&mut self, length: usize) {
        self.count = self.count.min(length);
        let last = self.particles[..self.count].last().copied().unwrap_or_default();
        self.particles.truncate(self.count);
        self.particles.resize(length, last);
        self.elements.resize(length, 0);
        self.normals.iter_mut().chain([&mut self.overlaps]).for_each(|list| list.resize(length, 0.0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::motion::Motion;
    use crate::geometry::part::{Part, Surface, TriangleMesh, Trigger};
    use crate::math::vec3;

    const PLANE: u16 = 0;
    const MESH: u16 = 1;

    fn walls() -> Walls {
        let part = |surface: Surface| Part {
            name: String::new(),
            material: 0,
            surface,
            motion: Motion::default(),
            appears: Trigger::Always,
            disappears: Trigger::Never,
        };
        let triangle = [vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0)];
        let plane = Surface::Plane { point: Vec3::zeros(), normal: Vec3::z() };
        Walls::new(&[part(plane), part(Surface::Mesh(TriangleMesh::from_soup(&[triangle])))])
    }

    fn contact(particle: u32, part: u16, element: u32, spring: f64) -> WallContact {
        let memory = Memory { tangential: vec3(spring, 2.0, 3.0), rolling: vec3(4.0, 5.0, spring) };
        WallContact { particle, part, element, normal: -Vec3::z(), memory }
    }

    fn point(part: u16, element: u32, normal: Vec3) -> WallPoint {
        WallPoint { part, element, point: Vec3::zeros(), normal, overlap: 0.1, on_face: true }
    }

    #[test]
    fn contacts_come_out_as_they_were_put_in() {
        let walls = walls();
        let mut list = WallList::default();
        (4..8).for_each(|index| list.push(&walls, index, &[Candidate { part: PLANE, element: 0 }]));
        assert_eq!(list.contacts(), [], "who is near a plane has no contact yet");
        let held = [
            contact(3, MESH, 8, 0.1),
            contact(3, MESH, 2, 0.2),
            contact(5, PLANE, 0, 0.3),
            contact(5, MESH, 9, 0.4),
            contact(9, PLANE, 0, 0.5),
        ];
        // In any order of particles; padded lists take more, too.
        for place in [3, 0, 4, 2, 1] {
            list.parts.iter_mut().for_each(PartList::pad);
            list.hold(&walls, &held[place]);
        }
        assert_eq!(list.contacts(), held);
        list.forget(|contact| contact.particle == 5);
        assert_eq!(list.contacts(), [held[0], held[1], held[4]]);
        assert_eq!(
            list.rows().map(|(index, _)| index).collect::<Vec<_>>(),
            [4, 5, 6, 7, 9],
            "places near the plane stay"
        );
    }

    #[test]
    fn a_contact_goes_on_at_its_triangle_else_where_the_surface_turns_least() {
        let walls = walls();
        let mut list = WallList::default();
        let mut side = contact(3, MESH, 2, 0.2);
        side.normal = Vec3::x();
        for held in [contact(3, MESH, 8, 0.1), side, contact(4, PLANE, 0, 0.3), contact(4, MESH, 8, 0.4)] {
            list.hold(&walls, &held);
        }
        let spring = |index: usize, points: &[WallPoint]| -> Vec<f64> {
            list.recall(index, points).iter().map(|memory| memory.tangential.x).collect()
        };
        let down = -Vec3::z();
        assert_eq!(spring(3, &[point(MESH, 2, down), point(MESH, 8, down)]), [0.2, 0.1]);
        assert_eq!(spring(3, &[point(MESH, 5, down), point(MESH, 6, down)]), [0.1, 0.0], "each goes on once");
        assert_eq!(spring(3, &[point(MESH, 5, vec3(0.4, 0.0, -0.6).normalize())]), [0.1]);
        assert_eq!(spring(3, &[point(MESH, 5, Vec3::y())]), [0.0], "a new wall of a corner");
        assert_eq!(spring(4, &[point(PLANE, 0, down), point(MESH, 8, down)]), [0.3, 0.4]);
        assert_eq!(spring(5, &[point(PLANE, 0, down), point(MESH, 8, down)]), [0.0, 0.0]);
    }

    #[test]
    fn a_plane_takes_up_what_a_mesh_in_its_place_has_left() {
        let walls = walls();
        let mut list = WallList::default();
        list.hold(&walls, &contact(3, PLANE, 17, 0.1));
        list.hold(&walls, &WallContact { normal: Vec3::x(), ..contact(4, PLANE, 17, 0.2) });
        let flat: Vec<f64> = list.contacts().iter().map(|contact| contact.memory.tangential.x).collect();
        assert_eq!(flat, [0.1]);
    }
}
