//! Where many spheres touch one part: several elements at once, and only those that can have come near.

use super::{Candidate, GAP_MARGIN, Shape, WallPoint, Walls, footprint};
use crate::dem::particles::Sphere;
use crate::geometry::triangle::{Foot, closest_in_lanes};
use crate::math::Vec3;
use crate::math::lanes::{LaneVector, Lanes, MOST_LANES, Mask};

/// Elements of one part near particles, by particle.
#[derive(Debug, Clone, Default)]
pub struct NearElements {
    /// Storage index of the particle that each is near.
    particles: Vec<u32>,
    candidates: Vec<Candidate>,
    /// What the approach of particles and parts must have reached before each can be touched [m]; as long as whole blocks of lanes.
    due: Vec<f64>,
}

/// Elements that are due: scratch lists, as long as whole blocks of lanes.
#[derive(Debug, Clone, Default)]
pub struct Due {
    /// Which of the elements near particles.
    numbers: Vec<u32>,
    particles: Vec<u32>,
    elements: Vec<u32>,
    /// The particles' centres in the coordinates of a part that moves [m].
    centres: [Vec<f64>; 3],
    points: Vec<WallPoint>,
}

impl NearElements {
    /// Adds the elements near a particle, which follows all that are here.
    pub fn push(&mut self, particle: u32, found: &[Candidate]) {
        self.due.truncate(self.candidates.len());
        self.candidates.extend_from_slice(found);
        let count = self.candidates.len();
        self.particles.resize(count, particle);
        self.due.resize(count, 0.0);
        self.due.resize(count.next_multiple_of(MOST_LANES), f64::INFINITY);
    }

    /// The particles, by storage index, and the elements near each.
    pub fn rows(&self) -> impl Iterator<Item = (usize, &[Candidate])> {
        let mut rest = self.candidates.as_slice();
        self.particles.chunk_by(|a, b| a == b).map(move |row| {
            let (here, next) = rest.split_at(row.len());
            rest = next;
            (row[0] as usize, here)
        })
    }

    /// How many are due.
    #[cfg(test)]
    pub(super) fn count_due(&self, approached: f64) -> usize {
        self.due.iter().filter(|due| **due <= approached).count()
    }

    /// Lists those that are due, but for the particles that `skip` picks.
    #[inline(always)]
    fn list_due<L: Lanes>(&self, approached: f64, skip: impl Fn(u32) -> bool, due: &mut Due) {
        due.numbers.clear();
        due.particles.clear();
        due.elements.clear();
        for from in (0..self.due.len()).step_by(L::COUNT) {
            let mut bits = (!L::from_slice(&self.due[from..]).exceeds(L::splat(approached))).bits();
            while bits != 0 {
                let number = from + bits.trailing_zeros() as usize;
                bits &= bits - 1;
                if number < self.candidates.len() && !skip(self.particles[number]) {
                    due.numbers.push(number as u32);
                    due.particles.push(self.particles[number]);
                    due.elements.push(self.candidates[number].element);
                }
            }
        }
    }
}

impl Walls {
    /// Finds the contact points of spheres with one part, as [`Walls::contacts`] finds them: calls `visit` with the storage index and the
    /// points of each particle that touches it. `near` must hold at least all elements that they overlap, and particles that `skip`
    /// picks are left out.
    ///
    /// `approached` [m] bounds from above how far particles and parts have come closer to each other since `near` was made. What it must
    /// reach before an element can be touched is known of each, and renewed of those that are looked at.
    #[inline(always)]
    pub fn contacts_when_due<L: Lanes>(
        &self,
        near: &mut NearElements,
        approached: f64,
        spheres: &[Sphere],
        skip: impl Fn(u32) -> bool,
        due: &mut Due,
        mut visit: impl FnMut(u32, &[WallPoint]),
    ) {
        let Some(&Candidate { part, .. }) = near.candidates.first() else { return };
        let wall = &self.walls[usize::from(part)];
        if !wall.present {
            return;
        }
        near.list_due::<L>(approached, skip, due);
        let Due { numbers, particles, elements, centres, points } = due;
        let count = numbers.len();
        let whole = count.next_multiple_of(MOST_LANES);
        if !wall.is_static {
            centres.iter_mut().for_each(Vec::clear);
            for &particle in &*particles {
                let centre = wall.to_body(&spheres[particle as usize].position());
                centres.iter_mut().zip(centre.iter()).for_each(|(list, component)| list.push(*component));
            }
            centres.iter_mut().for_each(|list| list.resize(whole, 0.0));
        }
        particles.resize(whole, particles.last().copied().unwrap_or_default());
        elements.resize(whole, elements.last().copied().unwrap_or_default());
        assert!(particles.iter().all(|&index| (index as usize) < spheres.len()), "particles that there are");
        points.clear();
        let mut current = None;
        let mut finish = |particle: u32, points: &mut Vec<WallPoint>| {
            footprint::keep_separate(points, 0, spheres[particle as usize].radius);
            wall.to_plant(points, 0..);
            visit(particle, points);
            points.clear();
        };
        for from in (0..count).step_by(L::COUNT) {
            let (particles, elements) = (&particles[from..from + L::COUNT], &elements[from..from + L::COUNT]);
            // SAFETY: spheres are rows of four numbers, and there are as many as just looked at.
            let [x, y, z, radius] = unsafe { L::gather_four(spheres.as_ptr().cast(), particles) };
            let centre = if wall.is_static { LaneVector::new(x, y, z) } else { LaneVector::read_from(centres, from) };
            let (offset, square, on_face) = wall.shape.closest_in_lanes(elements, &centre);
            let (distance, overlaps) = (square.sqrt(), square.below(radius * radius));
            let gap = (distance - radius - L::splat(GAP_MARGIN) * radius).larger(L::zero());
            let next = (L::splat(approached) + L::select(overlaps, L::zero(), gap)).to_array();
            let here = (count - from).min(L::COUNT);
            numbers[from..from + here].iter().zip(&next).for_each(|(&number, next)| near.due[number as usize] = *next);
            let mut touching = overlaps.bits() & u16::MAX >> (MOST_LANES - here);
            if touching == 0 {
                continue;
            }
            let ([x, y, z], centre) = (offset.to_arrays(), centre.to_arrays());
            let (square, on_face) = (square.to_array(), on_face.bits());
            while touching != 0 {
                let lane = touching.trailing_zeros() as usize;
                touching &= touching - 1;
                let particle = particles[lane];
                if let Some(last) = current.replace(particle).filter(|last| *last != particle && !points.is_empty()) {
                    finish(last, points);
                }
                let foot = Foot {
                    offset: Vec3::new(x[lane], y[lane], z[lane]),
                    squared_distance: square[lane],
                    on_face: on_face >> lane & 1 == 1,
                };
                let centre = Vec3::new(centre[0][lane], centre[1][lane], centre[2][lane]);
                let candidate = Candidate { part, element: elements[lane] };
                points.extend(wall.shape.meet(candidate, &foot, &centre, spheres[particle as usize].radius));
            }
        }
        if let Some(last) = current.filter(|_| !points.is_empty()) {
            finish(last, points);
        }
    }
}

impl Shape {
    /// The point of an element closest to another in each lane: the offset [m], its square, and where it is on the face.
    #[inline(always)]
    fn closest_in_lanes<L: Lanes>(&self, elements: &[u32], point: &LaneVector<L>) -> (LaneVector<L>, L, L::Mask) {
        if let Self::Mesh(tree) = self {
            return closest_in_lanes(tree.triangles(), elements, point);
        }
        let [x, y, z] = point.to_arrays();
        let (mut offsets, mut squares, mut on_face) = ([[0.0; MOST_LANES]; 3], [0.0; MOST_LANES], 0);
        for (lane, &element) in elements.iter().enumerate() {
            let foot = self.closest(element, &Vec3::new(x[lane], y[lane], z[lane]));
            offsets.iter_mut().zip(foot.offset.iter()).for_each(|(list, component)| list[lane] = *component);
            squares[lane] = foot.squared_distance;
            on_face |= u16::from(foot.on_face) << lane;
        }
        (LaneVector::read_from(&offsets, 0), L::from_slice(&squares), L::Mask::from_bits(on_face))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::motion::{Motion, MotionKind, MotionTerm};
    use crate::geometry::part::{Part, Surface, TriangleMesh, Trigger};
    use crate::math::lanes::{LaneWork, SimdLevel, at_level};
    use crate::math::vec3;
    use rand::{RngExt as _, SeedableRng as _};

    const RADIUS: f64 = 0.1;

    fn part(surface: Surface, kinds: &[MotionKind]) -> Part {
        let terms = kinds.iter().map(|kind| MotionTerm { kind: kind.clone(), from: 0.0, until: f64::INFINITY });
        let motion = Motion { terms: terms.collect() };
        Part { name: String::new(), material: 0, surface, motion, appears: Trigger::Always, disappears: Trigger::Never }
    }

    /// A tilted floor and a lifted one, a corner of triangles at rest and one that turns, and a pipe.
    fn walls() -> Walls {
        let lift = MotionKind::Translate { velocity: vec3(0.01, 0.02, 0.03) };
        let turn = MotionKind::Rotate { origin: vec3(0.5, 0.5, 0.0), axis: vec3(0.6, 0.0, 0.8), rate: 0.3 };
        let floor =
            |slope: f64| Surface::Plane { point: vec3(0.1, 0.2, 0.0), normal: vec3(slope, 0.0, 1.0).normalize() };
        let corner = |height: f64| {
            let at = |x: f64, y: f64, z: f64| vec3(x, y, z + height);
            Surface::Mesh(TriangleMesh::from_soup(&[
                [at(0.0, 0.0, 0.0), at(1.0, 0.0, 0.0), at(1.0, 1.0, 0.0)],
                [at(0.0, 0.0, 0.0), at(1.0, 1.0, 0.0), at(0.0, 1.0, 0.0)],
                [at(0.0, 0.0, 0.0), at(0.0, 1.0, 0.0), at(0.0, 1.0, 1.0)],
                [at(0.0, 0.0, 0.0), at(0.0, 1.0, 1.0), at(0.0, 0.0, 1.0)],
            ]))
        };
        let (start, end) = (vec3(0.5, 0.5, 0.0), vec3(0.5, 0.5, 1.0));
        let pipe = Surface::Frustum { start, end, start_radius: 0.3, end_radius: 0.2 };
        let mut walls = Walls::new(&[
            part(floor(0.3), &[]),
            part(floor(0.0), &[lift]),
            part(corner(0.0), &[]),
            part(corner(0.2), &[turn]),
            part(pipe, &[]),
        ]);
        walls.set_time(0.7);
        walls
    }

    fn spheres(count: usize) -> Vec<Sphere> {
        let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(7);
        let mut number = || random.random_range(-0.1..1.0);
        (0..count)
            .map(|index| Sphere { centre: [number(), number(), number()], radius: RADIUS / (1 + index % 3) as f64 })
            .collect()
    }

    struct AllContacts<'a> {
        walls: &'a Walls,
        part: u16,
        spheres: &'a [Sphere],
    }

    impl LaneWork for AllContacts<'_> {
        type Output = Vec<(u32, WallPoint)>;

        #[inline(always)]
        fn run<L: Lanes>(self) -> Self::Output {
            let (mut near, mut due, mut found) = (NearElements::default(), Due::default(), Vec::new());
            for (index, sphere) in self.spheres.iter().enumerate() {
                self.walls.candidates(&sphere.position(), 2.0 * sphere.radius, &mut found);
                found.retain(|candidate| candidate.part == self.part);
                near.push(index as u32, &found);
            }
            let mut all = Vec::new();
            let take = |particle: u32, points: &[WallPoint]| all.extend(points.iter().map(|point| (particle, *point)));
            self.walls.contacts_when_due::<L>(&mut near, 0.0, self.spheres, |index| index % 7 == 0, &mut due, take);
            all
        }
    }

    #[test]
    fn lanes_find_the_contacts_of_each_sphere_alone() {
        let (walls, spheres) = (walls(), spheres(300));
        for part in 2..5 {
            let mut expected = Vec::new();
            for (index, sphere) in spheres.iter().enumerate().filter(|(index, _)| index % 7 != 0) {
                let (mut candidates, mut points) = (Vec::new(), Vec::new());
                walls.candidates(&sphere.position(), sphere.radius, &mut candidates);
                candidates.retain(|candidate| candidate.part == part);
                walls.contacts(&candidates, &sphere.position(), sphere.radius, &mut points);
                expected.extend(points.into_iter().map(|point| (index as u32, point)));
            }
            assert!(expected.len() > 20, "only {} contacts prove nothing", expected.len());
            for level in SimdLevel::ALL.into_iter().filter(|level| level.is_available()) {
                let found = at_level(level, AllContacts { walls: &walls, part, spheres: &spheres });
                assert_eq!(found, expected, "part {part}, {}", level.name());
            }
        }
    }

    struct Overlaps<'a>(super::super::Plane, &'a [Sphere]);

    impl LaneWork for Overlaps<'_> {
        type Output = Vec<f64>;

        #[inline(always)]
        fn run<L: Lanes>(self) -> Vec<f64> {
            let mut overlaps = Vec::new();
            for from in (0..self.1.len()).step_by(L::COUNT) {
                let index: Vec<u32> = (from as u32..).take(L::COUNT).collect();
                // SAFETY: spheres are rows of four numbers, and there are whole blocks of them.
                let [x, y, z, radius] = unsafe { L::gather_four(self.1.as_ptr().cast(), &index) };
                overlaps.extend(&self.0.overlap(&LaneVector::new(x, y, z), radius).to_array()[..L::COUNT]);
            }
            overlaps
        }
    }

    #[test]
    fn lanes_overlap_planes_as_each_sphere_alone_does() {
        let (walls, spheres) = (walls(), spheres(10 * MOST_LANES));
        for part in 0..2 {
            let plane = walls.plane(part).expect("a plane");
            for level in SimdLevel::ALL.into_iter().filter(|level| level.is_available()) {
                let overlaps = at_level(level, Overlaps(plane, &spheres));
                for (sphere, overlap) in spheres.iter().zip(overlaps) {
                    let (candidate, mut points) = (Candidate { part, element: 0 }, Vec::new());
                    walls.contacts(&[candidate], &sphere.position(), sphere.radius, &mut points);
                    let expected: Vec<f64> = if overlap > 0.0 { vec![overlap] } else { Vec::new() };
                    assert_eq!(points.iter().map(|point| point.overlap).collect::<Vec<_>>(), expected);
                }
            }
        }
    }
}
