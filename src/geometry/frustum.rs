//! The shell of revolution of one straight generator, and its closest points to a given point.

use super::part::TriangleMesh;
use super::triangle::Foot;
use crate::math::{Bounds, Vec3};

/// An open cylinder or cone, prepared for distance queries.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frustum {
    start: Vec3,
    /// Unit vector from start to end.
    axis: Vec3,
    length: f64,
    start_radius: f64,
    end_radius: f64,
}

/// Which of the two generators in the meridian plane of the asking point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// On the point's side of the axis: holds the closest point of the whole shell.
    Near,
    /// Across the axis.
    Far,
}

impl Frustum {
    /// A shell from the ends of its axis and the radii there [m]. Equal ends make a flat ring normal to z.
    #[must_use]
    pub fn new(start: Vec3, end: Vec3, start_radius: f64, end_radius: f64) -> Self {
        let along = end - start;
        let length = along.norm();
        let axis = if length > 0.0 { along / length } else { Vec3::z() };
        Self { start, axis, length, start_radius, end_radius }
    }

    /// The shell as triangles between `segments` generators, to be looked at.
    #[must_use]
    pub fn to_mesh(&self, segments: u32) -> TriangleMesh {
        let side = perpendicular(&self.axis);
        let other = self.axis.cross(&side);
        let end = self.start + self.axis * self.length;
        let on_rim = |centre: &Vec3, radius: f64, step: u32| {
            let angle = std::f64::consts::TAU * f64::from(step % segments) / f64::from(segments);
            centre + (side * angle.cos() + other * angle.sin()) * radius
        };
        let soup: Vec<[Vec3; 3]> = (0..segments)
            .flat_map(|step| {
                let [a, b] = [step, step + 1].map(|n| on_rim(&self.start, self.start_radius, n));
                let [c, d] = [step, step + 1].map(|n| on_rim(&end, self.end_radius, n));
                [[a, b, d], [a, d, c]]
            })
            // A cone's tip has no second triangle.
            .filter(|[a, b, c]| a != b && b != c && a != c)
            .collect();
        TriangleMesh::from_soup(&soup)
    }

    /// The smallest box around it: a disc of radius R about axis u reaches R sqrt(1 - u_x^2) along x.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        let reach = self.axis.map(|component| (1.0 - component * component).max(0.0).sqrt());
        let mut bounds = Bounds::EMPTY;
        for (centre, radius) in
            [(self.start, self.start_radius), (self.start + self.axis * self.length, self.end_radius)]
        {
            bounds.include(&(centre - reach * radius));
            bounds.include(&(centre + reach * radius));
        }
        bounds
    }

    /// A point of the axis [m] and its unit direction [-].
    #[must_use]
    pub fn axis(&self) -> (&Vec3, &Vec3) {
        (&self.start, &self.axis)
    }

    /// The closest point to `point` [m] on the generator at one side.
    ///
    /// In cylinder coordinates (z, rho) about the axis the squared distance to the shell's point at angle phi is
    /// (z - z')^2 + rho^2 + rho'^2 - 2 rho rho' cos phi: least at phi = 0, so the closest point of the shell lies in the
    /// meridian half-plane of `point`, on the segment (0, R_start)-(L, R_end), rims included. The half-plane across
    /// the axis, phi = pi, is asked the same way with (z, -rho). It matters where a sphere is as wide as the shell and
    /// touches it all round: one point would push it sideways only.
    #[must_use]
    pub fn closest(&self, point: &Vec3, side: Side) -> Foot {
        let meridian = self.meridian(point, side);
        let (offset_along, offset_out) = self.closest_on_generator(meridian.height, meridian.distance);
        Foot {
            offset: self.axis * offset_along + meridian.outward * offset_out,
            squared_distance: offset_along * offset_along + offset_out * offset_out,
            // one smooth element: no face beside it competes with its rims
            on_face: true,
        }
    }

    /// Unit normal of the generator, away from the axis, at the meridian of `point` [-]: the direction to fall back to
    /// where `point` lies in the shell itself.
    #[must_use]
    pub fn outward_normal(&self, point: &Vec3, side: Side) -> Vec3 {
        let slope = self.end_radius - self.start_radius;
        let size = self.length.hypot(slope);
        let outward = self.meridian(point, side).outward;
        if size > 0.0 { (outward * self.length - self.axis * slope) / size } else { outward }
    }

    fn meridian(&self, point: &Vec3, side: Side) -> Meridian {
        let from_start = point - self.start;
        let height = from_start.dot(&self.axis);
        let radial = from_start - self.axis * height;
        let distance = radial.norm();
        // on the axis every meridian is as good as the other; one is taken, always the same
        let outward = if distance > 1e-14 * from_start.norm() { radial / distance } else { perpendicular(&self.axis) };
        match side {
            Side::Near => Meridian { height, distance, outward },
            Side::Far => Meridian { height, distance: -distance, outward: -outward },
        }
    }

    /// The offset (along the axis, away from it) from (height, distance) to the generator.
    fn closest_on_generator(&self, height: f64, distance: f64) -> (f64, f64) {
        let slope = self.end_radius - self.start_radius;
        let squared_size = self.length * self.length + slope * slope;
        let (below, within) = (-height, self.start_radius - distance);
        let along = -(below * self.length + within * slope);
        if along <= 0.0 || squared_size == 0.0 {
            (below, within)
        } else if along >= squared_size {
            (self.length - height, self.end_radius - distance)
        } else {
            // by the generator's normal (-slope, length): full precision however near the surface is
            let gap = (within * self.length - below * slope) / squared_size;
            (-slope * gap, self.length * gap)
        }
    }
}

struct Meridian {
    height: f64,
    distance: f64,
    outward: Vec3,
}

/// A unit vector perpendicular to the unit vector `axis`.
fn perpendicular(axis: &Vec3) -> Vec3 {
    let mut other = Vec3::zeros();
    other[axis.iamin()] = 1.0;
    (other - axis * axis.dot(&other)).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec3;
    use proptest::prelude::*;
    use std::f64::consts::TAU;

    fn cone() -> Frustum {
        Frustum::new(vec3(0.1, -0.2, 0.3), vec3(0.4, 0.5, 1.2), 0.3, 0.7)
    }

    proptest! {
        /// No sampled point of the shell is nearer than the near foot, and the foot lies on the shell.
        #[test]
        fn the_near_foot_is_the_closest(x in -2.0..2.0_f64, y in -2.0..2.0_f64, z in -2.0..2.0_f64) {
            let shell = cone();
            let p = vec3(x, y, z);
            let foot = shell.closest(&p, Side::Near);
            let side = perpendicular(&shell.axis);
            let other = shell.axis.cross(&side);
            for i in 0..=40_u32 {
                let t = f64::from(i) / 40.0;
                for k in 0..60_u32 {
                    let angle = TAU * f64::from(k) / 60.0;
                    let radius = shell.start_radius + t * (shell.end_radius - shell.start_radius);
                    let sample = shell.start + shell.axis * (t * shell.length)
                        + (side * angle.cos() + other * angle.sin()) * radius;
                    prop_assert!((sample - p).norm_squared() >= foot.squared_distance - 1e-13);
                }
            }
            let on = p + foot.offset - shell.start;
            let height = on.dot(&shell.axis);
            let radius = (on - shell.axis * height).norm();
            prop_assert!((-1e-13..=shell.length + 1e-13).contains(&height));
            let expected = shell.start_radius + height / shell.length * (shell.end_radius - shell.start_radius);
            prop_assert!((radius - expected).abs() < 1e-13);
            prop_assert!(shell.closest(&p, Side::Far).squared_distance >= foot.squared_distance - 1e-13);
        }
    }

    #[test]
    fn cylinder_faces_and_rims_in_closed_form() {
        let pipe = Frustum::new(vec3(0.0, 0.0, 0.0), vec3(0.0, 0.0, 2.0), 1.0, 1.0);
        let inside = pipe.closest(&vec3(0.75, 0.0, 1.0), Side::Near);
        assert!((inside.offset - vec3(0.25, 0.0, 0.0)).norm() < 1e-15);
        let across = pipe.closest(&vec3(0.75, 0.0, 1.0), Side::Far);
        assert!((across.offset - vec3(-1.75, 0.0, 0.0)).norm() < 1e-15);
        let above = pipe.closest(&vec3(0.0, 1.5, 2.5), Side::Near);
        assert!((above.offset - vec3(0.0, -0.5, -0.5)).norm() < 1e-15);
        assert!((above.squared_distance - 0.5).abs() < 1e-15);
        let centred = pipe.closest(&vec3(0.0, 0.0, 1.0), Side::Near);
        assert!((centred.offset.norm() - 1.0).abs() < 1e-15 && centred.offset.z == 0.0);
    }

    #[test]
    fn bounds_are_those_of_the_two_rims() {
        let shell = Frustum::new(vec3(0.0, 0.0, 0.0), vec3(3.0, 0.0, 0.0), 1.0, 2.0);
        let bounds = shell.bounds();
        assert_eq!(bounds.minimum, [0.0, -2.0, -2.0]);
        assert_eq!(bounds.maximum, [3.0, 2.0, 2.0]);
    }
}
