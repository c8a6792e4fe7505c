//! Where feeds put particles: points drawn inside a region or a face, with the whole sphere (or disc) inside.

use super::{Face, Region};
use crate::geometry::solid::Solid;
use crate::math::Vec3;
use crate::particle::Body;
use std::f64::consts::TAU;

/// Share of an axis' length by which it may leave the y direction and still count as along y in a plane problem.
const ALONG: f64 = 1e-9;

/// Draws places inside a region.
#[derive(Debug, Clone)]
pub struct RegionSampler {
    region: Region,
    body: Body,
    /// The mesh, if it is one, with its search tree: built once, asked at every attempt.
    solid: Option<Solid>,
}

impl RegionSampler {
    /// A sampler of `region` for one kind of body.
    #[must_use]
    pub fn new(region: Region, body: Body) -> Self {
        let solid = if let Region::Inside(mesh) = &region { Some(Solid::new(mesh)) } else { None };
        Self { region, body, solid }
    }

    /// The centre that three numbers in [0, 1) stand for, for a body of `radius` [m] that lies inside as a whole;
    /// `None` where these numbers hit no such place. Uniform over all such places. In a plane problem the centre has
    /// y = 0 and the disc lies inside the region's section with that plane; a mesh must reach a radius beyond it.
    #[must_use]
    pub fn place(&self, numbers: [f64; 3], radius: f64) -> Option<Vec3> {
        let flat = is_flat(self.body);
        match &self.region {
            Region::Box { minimum, maximum } => place_in_box(minimum, maximum, numbers, radius, flat),
            Region::Cylinder { start, end, radius: outer } => {
                place_in_cylinder(start, end, *outer, numbers, radius, flat)
            }
            Region::Inside(_) => {
                let solid = self.solid.as_ref()?;
                let bounds = solid.bounds();
                let (minimum, maximum) = (Vec3::from(bounds.minimum), Vec3::from(bounds.maximum));
                place_in_box(&minimum, &maximum, numbers, radius, flat)
                    .filter(|centre| solid.sphere_inside(centre, radius))
            }
        }
    }
}

impl Region {
    /// Volume [m3]; in a plane problem the area [m2] of the section with y = 0.
    #[must_use]
    pub fn measure(&self, body: Body) -> f64 {
        let flat = is_flat(body);
        match self {
            Self::Box { minimum, maximum } => {
                let size = maximum - minimum;
                if flat { size.x * size.z } else { size.x * size.y * size.z }
            }
            Self::Cylinder { start, end, radius } => {
                let axis = end - start;
                let disc = 0.5 * TAU * radius * radius;
                match flat {
                    false => disc * axis.norm(),
                    true if is_along_y(&axis) => disc,
                    true => 2.0 * radius * axis.norm(),
                }
            }
            Self::Inside(mesh) => {
                let depth = if flat { mesh.bounds().size().y } else { 1.0 };
                mesh.signed_volume().abs() / depth
            }
        }
    }

    /// Share of the tried points that fall into the region [-]: one but for a mesh, whose bounding box is tried.
    #[must_use]
    pub fn hit_share(&self) -> f64 {
        match self {
            Self::Box { .. } | Self::Cylinder { .. } => 1.0,
            Self::Inside(mesh) => {
                let size = mesh.bounds().size();
                (mesh.signed_volume().abs() / (size.x * size.y * size.z)).clamp(1e-6, 1.0)
            }
        }
    }
}

impl Face {
    /// The centre that two of the numbers in [0, 1) stand for, for a body of `radius` [m] that lies inside the face as
    /// a whole; `None` where it does not fit. In a plane problem the face is the segment in which it cuts y = 0.
    #[must_use]
    pub fn place(&self, numbers: [f64; 3], radius: f64, body: Body) -> Option<Vec3> {
        match self {
            Self::Disc { centre, normal, radius: outer } => {
                let room = outer - radius;
                if room < 0.0 {
                    return None;
                }
                if is_flat(body) {
                    let along = Vec3::new(-normal.z, 0.0, normal.x);
                    let along = along.try_normalize(ALONG).unwrap_or_else(Vec3::x);
                    return Some(flattened(centre + along * (room * (2.0 * numbers[0] - 1.0))));
                }
                let (first, second) = perpendicular(normal);
                Some(centre + in_disc(&first, &second, room, numbers))
            }
            Self::Rectangle { centre, side_a, side_b } => {
                if is_flat(body) {
                    let (a, b) = (flattened(*side_a), flattened(*side_b));
                    let side = if a.norm() >= b.norm() { a } else { b };
                    let share = inner_share(side.norm(), radius)?;
                    return Some(flattened(centre + side * (share * (numbers[0] - 0.5))));
                }
                // the distance between two opposite edges of a parallelogram is its area over their length
                let area = side_a.cross(side_b).norm();
                let share_a = inner_share(area / side_b.norm(), radius)?;
                let share_b = inner_share(area / side_a.norm(), radius)?;
                Some(centre + side_a * (share_a * (numbers[0] - 0.5)) + side_b * (share_b * (numbers[1] - 0.5)))
            }
        }
    }
}

const fn is_flat(body: Body) -> bool {
    matches!(body, Body::Disc { .. })
}

fn is_along_y(axis: &Vec3) -> bool {
    axis.x.hypot(axis.z) <= ALONG * axis.norm()
}

fn flattened(point: Vec3) -> Vec3 {
    Vec3::new(point.x, 0.0, point.z)
}

/// Share of a width that is left for centres when a radius is kept from both ends.
fn inner_share(width: f64, radius: f64) -> Option<f64> {
    let left = width - 2.0 * radius;
    (left >= 0.0 && width > 0.0).then(|| left / width)
}

fn place_in_box(minimum: &Vec3, maximum: &Vec3, numbers: [f64; 3], radius: f64, flat: bool) -> Option<Vec3> {
    let mut centre = Vec3::zeros();
    for axis in 0..3 {
        if flat && axis == 1 {
            continue;
        }
        let left = maximum[axis] - minimum[axis] - 2.0 * radius;
        if left < 0.0 {
            return None;
        }
        centre[axis] = minimum[axis] + radius + numbers[axis] * left;
    }
    Some(centre)
}

fn place_in_cylinder(start: &Vec3, end: &Vec3, outer: f64, numbers: [f64; 3], radius: f64, flat: bool) -> Option<Vec3> {
    let room = outer - radius;
    if room < 0.0 {
        return None;
    }
    let axis = end - start;
    if flat && is_along_y(&axis) {
        return Some(flattened(start + in_disc(&Vec3::x(), &Vec3::z(), room, numbers)));
    }
    let length = axis.norm();
    let share = inner_share(length, radius)?;
    let along = start + axis * (0.5 + share * (numbers[2] - 0.5));
    if flat {
        let across = Vec3::new(-axis.z, 0.0, axis.x).try_normalize(0.0)?;
        return Some(flattened(along + across * (room * (2.0 * numbers[0] - 1.0))));
    }
    let (first, second) = perpendicular(&axis);
    Some(along + in_disc(&first, &second, room, numbers))
}

/// A point uniform over a disc of `radius`: area grows as the square of the distance from its centre.
fn in_disc(first: &Vec3, second: &Vec3, radius: f64, numbers: [f64; 3]) -> Vec3 {
    let distance = radius * numbers[0].sqrt();
    let (sine, cosine) = (TAU * numbers[1]).sin_cos();
    first * (distance * cosine) + second * (distance * sine)
}

/// Two unit vectors perpendicular to `axis` and to each other.
fn perpendicular(axis: &Vec3) -> (Vec3, Vec3) {
    let axis = axis.normalize();
    let first = axis.cross(&Vec3::ith(axis.iamin(), 1.0)).normalize();
    (first, axis.cross(&first))
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::draw::FeedKey;
    use super::*;
    use crate::geometry::part::TriangleMesh;
    use approx::assert_relative_eq;

    /// A closed tetrahedron with three edges of `length` along the axes.
    pub fn tetrahedron(length: f64) -> TriangleMesh {
        TriangleMesh {
            vertices: vec![Vec3::zeros(), Vec3::x() * length, Vec3::y() * length, Vec3::z() * length],
            triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
        }
    }

    fn places(region: &Region, radius: f64, body: Body, count: u64) -> Vec<Vec3> {
        let sampler = RegionSampler::new(region.clone(), body);
        let mut draws = FeedKey::new(3, 0).places(0);
        (0..count).filter_map(|attempt| sampler.place(draws.attempt(attempt), radius)).collect()
    }

    #[test]
    fn spheres_lie_inside_a_cylinder_and_fill_it_evenly() {
        let (start, end) = (Vec3::new(1.0, 2.0, 3.0), Vec3::new(2.0, 2.0, 5.0));
        let region = Region::Cylinder { start, end, radius: 0.7 };
        let found = places(&region, 0.2, Body::Sphere, 20_000);
        assert_eq!(found.len(), 20_000);
        let axis = (end - start).normalize();
        let mut inner = 0.0;
        for centre in &found {
            let height = (centre - start).dot(&axis);
            let distance = (centre - start - axis * height).norm();
            assert!(distance <= 0.5 + 1e-12 && height >= 0.2 - 1e-12 && height <= (end - start).norm() - 0.2 + 1e-12);
            inner += f64::from(u8::from(distance < 0.25));
        }
        // a quarter of the area: binomial, five standard deviations
        let count = found.len() as f64;
        assert!((inner / count - 0.25).abs() < 5.0 * (0.25 * 0.75 / count).sqrt());
        assert!(places(&region, 0.71, Body::Sphere, 10).is_empty());
    }

    #[test]
    fn spheres_lie_inside_a_mesh() {
        let region = Region::Inside(tetrahedron(1.0));
        let radius = 0.05;
        let found = places(&region, radius, Body::Sphere, 20_000);
        for centre in &found {
            let slanted = (1.0 - centre.sum()) / 3.0_f64.sqrt();
            assert!(centre.min() >= radius - 1e-12 && slanted >= radius - 1e-12, "{centre}");
        }
        // centres fill a similar tetrahedron shrunk by the radius: edge 1 - (3 + sqrt 3) r; the tried box has 1 - 2 r
        let share = ((1.0 - (3.0 + 3.0_f64.sqrt()) * radius) / (1.0 - 2.0 * radius)).powi(3) / 6.0;
        let count = 20_000.0;
        assert!((found.len() as f64 / count - share).abs() < 5.0 * (share * (1.0 - share) / count).sqrt());
        assert_relative_eq!(region.measure(Body::Sphere), 1.0 / 6.0, max_relative = 1e-14);
        assert_relative_eq!(region.hit_share(), 1.0 / 6.0, max_relative = 1e-14);
    }

    #[test]
    fn discs_lie_in_the_plane() {
        let disc = Body::Disc { thickness: 0.01 };
        let regions = [
            Region::Box { minimum: Vec3::new(-1.0, -0.01, 0.0), maximum: Vec3::new(1.0, 0.01, 1.0) },
            Region::Cylinder { start: Vec3::new(0.0, -0.01, 0.0), end: Vec3::new(0.0, 0.01, 0.0), radius: 0.5 },
            Region::Cylinder { start: Vec3::zeros(), end: Vec3::new(1.0, 0.0, 1.0), radius: 0.5 },
        ];
        for region in &regions {
            let found = places(region, 0.1, disc, 100);
            assert_eq!(found.len(), 100);
            assert!(found.iter().all(|centre| centre.y == 0.0));
        }
        assert_relative_eq!(regions[0].measure(disc), 2.0);
        assert_relative_eq!(regions[1].measure(disc), std::f64::consts::PI * 0.25, max_relative = 1e-15);
        let slit = Face::Rectangle { centre: Vec3::zeros(), side_a: Vec3::y() * 0.001, side_b: Vec3::x() };
        let centre = slit.place([0.0, 0.3, 0.9], 0.1, disc).unwrap();
        assert_relative_eq!(centre, Vec3::new(-0.4, 0.0, 0.0), epsilon = 1e-15);
    }

    #[test]
    fn spheres_keep_a_radius_from_the_edges_of_a_slanted_face() {
        let (side_a, side_b) = (Vec3::new(2.0, 0.0, 0.0), Vec3::new(1.0, 0.0, 1.0));
        let face = Face::Rectangle { centre: Vec3::zeros(), side_a, side_b };
        let mut draws = FeedKey::new(3, 0).places(1);
        let mut closest = f64::INFINITY;
        for attempt in 0..5_000 {
            let centre = face.place(draws.attempt(attempt), 0.1, Body::Sphere).unwrap();
            // the slanted edges pass through (+-1, 0, 0) along side_b
            let beside = (1.0 - (centre.x - centre.z).abs()) / 2.0_f64.sqrt();
            closest = closest.min(beside).min(0.5 - centre.z.abs());
        }
        assert!((0.1 - 1e-12..0.101).contains(&closest), "{closest}");
    }
}
