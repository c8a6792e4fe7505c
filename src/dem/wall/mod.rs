//! Walls: which points of the plant's parts a sphere touches, and how these points move.
//!
//! Surfaces stay in the coordinates in which they were placed (body coordinates) and so do the trees over their
//! triangles; a sphere's centre is carried there by the part's pose, and the points found are carried back.

mod footprint;
mod near;

pub use near::{Due, NearElements};

use crate::dem::particles::Sphere;
use crate::geometry::frustum::{Frustum, Side};
use crate::geometry::motion::{Motion, Pose, Twist};
use crate::geometry::part::{Part, Surface};
use crate::geometry::tree::TriangleTree;
use crate::geometry::triangle::Foot;
use crate::math::lanes::{LaneVector, Lanes};
use crate::math::{Bounds, Vec3};

/// Share of the radius by which a gap between sphere and element is taken to be smaller than it is: round-off of places is far less.
const GAP_MARGIN: f64 = 1e-9;
/// Distance over radius below which a centre lies in the surface itself, and the direction to the surface is noise.
const IN_SURFACE: f64 = 1e-12;

/// The parts of a plant, ready to be asked for contacts.
#[derive(Debug, Clone)]
pub struct Walls {
    walls: Vec<Wall>,
}

/// One element of a part near a sphere.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Candidate {
    /// Index of the part.
    pub part: u16,
    /// The triangle, by its number in the file; of a frustum 0 for the generator on the centre's side of the axis and 1
    /// for the one across; 0 for a plane.
    pub element: u32,
}

/// A point at which a sphere touches a part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallPoint {
    /// Index of the part.
    pub part: u16,
    /// Element of the part, as in [`Candidate::element`].
    pub element: u32,
    /// The surface's closest point to the centre [m], plant coordinates.
    pub point: Vec3,
    /// Unit normal from the particle's centre to the surface [-].
    pub normal: Vec3,
    /// Radius less distance of the centre from the surface [m], positive. It exceeds the radius for a centre behind a
    /// plane, and only there.
    pub overlap: f64,
    /// True where the element is touched inside, along its normal; false on its edge or corner.
    pub on_face: bool,
}

/// A plane where it is now: a half space, of which the normal points out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// A point of it [m], plant coordinates.
    pub point: Vec3,
    /// Unit normal, to the side of the particles [-].
    pub normal: Vec3,
}

#[derive(Debug, Clone)]
struct Wall {
    name: String,
    material: u16,
    shape: Shape,
    motion: Motion,
    is_static: bool,
    speed_bound: f64,
    present: bool,
    pose: Pose,
    twist: Twist,
}

#[derive(Debug, Clone)]
enum Shape {
    Plane { point: Vec3, normal: Vec3 },
    Frustum(Frustum),
    Mesh(TriangleTree),
}

impl Walls {
    /// Walls from the parts of a scene, all present, at the plant time 0.
    #[must_use]
    pub fn new(parts: &[Part]) -> Self {
        let mut walls = Self { walls: parts.iter().map(Wall::new).collect() };
        walls.set_time(0.0);
        walls
    }

    /// Moves all parts to where they are at a plant time [s].
    pub fn set_time(&mut self, time: f64) {
        for wall in self.walls.iter_mut().filter(|wall| !wall.motion.terms.is_empty()) {
            wall.twist = wall.motion.twist(time);
            // a static part keeps the exact identity: no arithmetic, no round-off
            if !wall.is_static {
                wall.pose = wall.motion.pose(time);
            }
        }
    }

    /// Makes a part exist or not.
    pub fn set_present(&mut self, part: u16, present: bool) {
        self.walls[usize::from(part)].present = present;
    }

    /// True where a part exists.
    #[must_use]
    pub fn is_present(&self, part: u16) -> bool {
        self.walls[usize::from(part)].present
    }

    /// True where a part stays as it is for ever: neither it nor its surface moves.
    #[must_use]
    pub fn stands(&self, part: u16) -> bool {
        self.walls[usize::from(part)].motion.terms.is_empty()
    }

    /// Names of the parts, by index.
    pub fn part_names(&self) -> impl ExactSizeIterator<Item = &str> {
        self.walls.iter().map(|wall| wall.name.as_str())
    }

    /// Material of a part.
    #[must_use]
    pub fn material(&self, part: u16) -> u16 {
        self.walls[usize::from(part)].material
    }

    /// A part that is a plane, where it is now.
    #[must_use]
    pub fn plane(&self, part: u16) -> Option<Plane> {
        self.walls[usize::from(part)].plane()
    }

    /// Angular velocity of a part [rad/s].
    #[must_use]
    pub fn spin(&self, part: u16) -> Vec3 {
        self.walls[usize::from(part)].twist.spin
    }

    /// Velocity of the surface of a part at its points [m/s], with the unit normals of the surface there.
    ///
    /// v = V + W x x + (b - (b.n) n): the rigid motion at x plus the belt's velocity b along the surface.
    #[inline(always)]
    #[must_use]
    pub fn surface_velocity<L: Lanes>(
        &self,
        part: u16,
        point: &LaneVector<L>,
        normal: &LaneVector<L>,
    ) -> LaneVector<L> {
        let twist = &self.walls[usize::from(part)].twist;
        let (velocity, spin) = (LaneVector::everywhere(twist.velocity), LaneVector::everywhere(twist.spin));
        let belt = LaneVector::everywhere(twist.belt);
        velocity + spin.cross(point) + belt.plus(normal, -belt.dot(normal))
    }

    /// Upper bound over all time of the speed at which any present surface can approach a point [m/s].
    ///
    /// A plane turning about its own normal and a frustum about its own axis cover the same points all the time: such
    /// rotations count as nothing. A plane that rotates otherwise has no bound and does not count, as
    /// [`Walls::candidates`] always names it. A mesh that is carried away for ever and rotated after that makes the
    /// bound infinite.
    #[must_use]
    pub fn speed_bound(&self) -> f64 {
        let present = self.walls.iter().filter(|wall| wall.present && !wall.is_always_candidate());
        present.map(|wall| wall.speed_bound).fold(0.0, f64::max)
    }

    /// A box around all present parts at their present pose [m], planes left out; it may be larger than the smallest.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        let present = self.walls.iter().filter(|wall| wall.present);
        present.map(Wall::bounds).fold(Bounds::EMPTY, |all, bounds| all.union(&bounds))
    }

    /// Finds every element of a present part within `reach` [m] of `centre` [m] at the present pose, ascending.
    /// `found` is emptied first.
    pub fn candidates(&self, centre: &Vec3, reach: f64, found: &mut Vec<Candidate>) {
        found.clear();
        self.present_parts().for_each(|part| self.walls[usize::from(part)].add_candidates(part, centre, reach, found));
    }

    /// The parts that exist, ascending.
    pub fn present_parts(&self) -> impl Iterator<Item = u16> {
        (0_u16..).zip(&self.walls).filter_map(|(part, wall)| wall.present.then_some(part))
    }

    /// Calls `visit` with the number of each sphere, and the elements of one part within `skin` [m] of it at the present pose,
    /// ascending, where there are such. `found` is scratch, and must be empty.
    pub fn candidates_of(
        &self,
        part: u16,
        spheres: &[Sphere],
        skin: f64,
        found: &mut Vec<Candidate>,
        mut visit: impl FnMut(usize, &[Candidate]),
    ) {
        let wall = &self.walls[usize::from(part)];
        if let Shape::Plane { point, normal } = &wall.shape {
            for (number, sphere) in spheres.iter().enumerate() {
                if wall.is_near_plane(point, normal, &sphere.position(), sphere.radius + skin) {
                    visit(number, &[Candidate { part, element: 0 }]);
                }
            }
            return;
        }
        for (number, sphere) in spheres.iter().enumerate() {
            wall.add_candidates(part, &sphere.position(), sphere.radius + skin, found);
            if !found.is_empty() {
                visit(number, found);
                found.clear();
            }
        }
    }

    /// Finds the contact points of a sphere, given at least all elements that it overlaps, ascending. `found` is emptied
    /// first; points come by part, within a part deepest first. Absent parts are skipped.
    ///
    /// Of each element the point closest to the centre counts; which of them are contacts of their own is decided by
    /// the rule of `footprint.rs`, within each part alone: two parts that meet are two bodies, each with its own material.
    pub fn contacts(&self, candidates: &[Candidate], centre: &Vec3, radius: f64, found: &mut Vec<WallPoint>) {
        found.clear();
        for group in candidates.chunk_by(|a, b| a.part == b.part) {
            let wall = &self.walls[usize::from(group[0].part)];
            if !wall.present {
                continue;
            }
            if let Some(plane) = wall.plane() {
                found.extend(plane.touch(group[0], centre, radius));
                continue;
            }
            let (start, local) = (found.len(), wall.to_body(centre));
            let touch = |candidate: &Candidate| {
                let foot = wall.shape.closest(candidate.element, &local);
                wall.shape.meet(*candidate, &foot, &local, radius)
            };
            found.extend(group.iter().filter_map(touch));
            footprint::keep_separate(found, start, radius);
            wall.to_plant(found, start..);
        }
    }
}

impl Wall {
    fn new(part: &Part) -> Self {
        let shape = match &part.surface {
            Surface::Plane { point, normal } => Shape::Plane { point: *point, normal: *normal },
            Surface::Frustum { start, end, start_radius, end_radius } => {
                Shape::Frustum(Frustum::new(*start, *end, *start_radius, *end_radius))
            }
            Surface::Mesh(mesh) => Shape::Mesh(TriangleTree::new(mesh.prepared_triangles())),
        };
        Self {
            name: part.name.clone(),
            material: part.material,
            speed_bound: shape.motion_that_displaces(&part.motion).speed_bound(&shape.bounds()),
            shape,
            is_static: part.motion.is_static(),
            motion: part.motion.clone(),
            present: true,
            pose: Pose::IDENTITY,
            twist: Twist::REST,
        }
    }

    /// True for a plane swinging about an axis across its normal: far out it sweeps past at any speed.
    fn is_always_candidate(&self) -> bool {
        matches!(self.shape, Shape::Plane { .. }) && self.speed_bound.is_infinite()
    }

    /// Adds to `found` every element within `reach` [m] of `centre` [m] at the present pose, ascending; this is part number `part`.
    fn add_candidates(&self, part: u16, centre: &Vec3, reach: f64, found: &mut Vec<Candidate>) {
        match &self.shape {
            Shape::Plane { point, normal } => {
                if self.is_near_plane(point, normal, centre, reach) {
                    found.push(Candidate { part, element: 0 });
                }
            }
            Shape::Frustum(frustum) => {
                for (element, side) in [(0, Side::Near), (1, Side::Far)] {
                    if frustum.closest(&self.to_body(centre), side).squared_distance <= reach * reach {
                        found.push(Candidate { part, element });
                    }
                }
            }
            Shape::Mesh(tree) => {
                let start = found.len();
                tree.within(&self.to_body(centre), reach, |element| found.push(Candidate { part, element }));
                found[start..].sort_unstable();
            }
        }
    }

    /// Whether `centre` [m] is within `reach` [m] of the plane that this is, through `point` [m] in body coordinates, or may soon be.
    #[inline(always)]
    fn is_near_plane(&self, point: &Vec3, normal: &Vec3, centre: &Vec3, reach: f64) -> bool {
        self.is_always_candidate() || normal.dot(&(self.to_body(centre) - point)) <= reach
    }

    fn plane(&self) -> Option<Plane> {
        let Shape::Plane { point, normal } = self.shape else { return None };
        let moved = || Plane { point: self.pose.apply(&point), normal: self.pose.apply_direction(&normal) };
        Some(if self.is_static { Plane { point, normal } } else { moved() })
    }

    fn bounds(&self) -> Bounds {
        let body = self.shape.bounds();
        if matches!(self.shape, Shape::Plane { .. }) || body.is_empty() {
            return Bounds::EMPTY;
        }
        if self.is_static {
            return body;
        }
        let ends = [body.minimum, body.maximum];
        let mut bounds = Bounds::EMPTY;
        for corner in 0..8_usize {
            bounds.include(&self.pose.apply(&Vec3::from_fn(|axis, _| ends[corner >> axis & 1][axis])));
        }
        bounds
    }

    fn to_body(&self, point: &Vec3) -> Vec3 {
        if self.is_static { *point } else { self.pose.inverse_apply(point) }
    }

    fn to_plant(&self, found: &mut [WallPoint], range: std::ops::RangeFrom<usize>) {
        if self.is_static {
            return;
        }
        for touch in &mut found[range] {
            touch.point = self.pose.apply(&touch.point);
            touch.normal = self.pose.apply_direction(&touch.normal);
        }
    }
}

impl Shape {
    /// The box around it in body coordinates [m]; infinite for a plane.
    fn bounds(&self) -> Bounds {
        match self {
            Self::Plane { .. } => Bounds { minimum: [f64::NEG_INFINITY; 3], maximum: [f64::INFINITY; 3] },
            Self::Frustum(frustum) => frustum.bounds(),
            Self::Mesh(tree) => tree.bounds(),
        }
    }

    /// The motion without the leading rotations that map the surface onto itself.
    fn motion_that_displaces(&self, motion: &Motion) -> Motion {
        use crate::geometry::motion::MotionKind::{Conveyor, Rotate};
        // round-off of a unit vector written with 17 digits, with room to spare: 1e-12 rad of 1 m is 1e-12 m
        let parallel = |a: &Vec3, b: &Vec3| a.cross(b).norm() <= 1e-12;
        let keeps = |origin: &Vec3, axis: &Vec3| match self {
            Self::Plane { normal, .. } => parallel(axis, normal),
            Self::Frustum(frustum) => {
                let (point, own) = frustum.axis();
                let apart = origin - point;
                parallel(axis, own) && apart.cross(own).norm() <= 1e-12 * (origin.norm() + point.norm())
            }
            Self::Mesh(_) => false,
        };
        let terms = motion.terms.iter().skip_while(|term| match &term.kind {
            Rotate { origin, axis, .. } => keeps(origin, axis),
            Conveyor { .. } => true,
            _ => false,
        });
        Motion { terms: terms.cloned().collect() }
    }

    /// The point of one element closest to another, in body coordinates.
    fn closest(&self, element: u32, point: &Vec3) -> Foot {
        match self {
            Self::Plane { .. } => unreachable!("a plane is looked at where it is now"),
            Self::Frustum(frustum) => frustum.closest(point, Self::side(element)),
            Self::Mesh(tree) => tree.triangles()[element as usize].closest(point),
        }
    }

    const fn side(element: u32) -> Side {
        if element == 0 { Side::Near } else { Side::Far }
    }

    /// The direction to an element for a centre that lies in it. Both sides are equally right; the surface's normal is taken to point
    /// at the particle, as it does on the outside of a closed surface.
    fn normal_at(&self, element: u32, centre: &Vec3) -> Vec3 {
        match self {
            Self::Plane { normal, .. } => -normal,
            Self::Frustum(frustum) => -frustum.outward_normal(centre, Self::side(element)),
            Self::Mesh(tree) => match &tree.triangles()[element as usize] {
                // a degenerate triangle has no normal: any unit vector keeps the numbers finite
                triangle if triangle.is_degenerate() => -Vec3::z(),
                triangle => -triangle.normal(),
            },
        }
    }

    /// Where a sphere overlaps an element whose closest point to the centre is known, all in body coordinates.
    fn meet(&self, candidate: Candidate, foot: &Foot, centre: &Vec3, radius: f64) -> Option<WallPoint> {
        let distance = foot.squared_distance.sqrt();
        let (overlap, Candidate { part, element }) = (radius - distance, candidate);
        if foot.squared_distance >= radius * radius || overlap <= 0.0 {
            return None;
        }
        let known = distance > IN_SURFACE * radius;
        let normal = if known { foot.offset / distance } else { self.normal_at(element, centre) };
        Some(WallPoint { part, element, point: centre + foot.offset, normal, overlap, on_face: foot.on_face })
    }
}

impl Plane {
    /// Overlap of spheres with it [m], negative where they are apart: r - n.(x - p). The distance has a sign, and a centre that got
    /// behind the plane is still pushed out.
    #[inline(always)]
    #[must_use]
    pub fn overlap<L: Lanes>(&self, centre: &LaneVector<L>, radius: L) -> L {
        radius - (*centre - LaneVector::everywhere(self.point)).dot(&LaneVector::everywhere(self.normal))
    }

    fn touch(&self, candidate: Candidate, centre: &Vec3, radius: f64) -> Option<WallPoint> {
        let overlap = self.overlap::<f64>(&(*centre).into(), radius);
        let Candidate { part, element } = candidate;
        let point = || centre - self.normal * (radius - overlap);
        (overlap > 0.0).then(|| WallPoint {
            part,
            element,
            point: point(),
            normal: -self.normal,
            overlap,
            on_face: true,
        })
    }
}

#[cfg(test)]
mod tests;
