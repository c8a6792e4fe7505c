//! A plane with a direction of passage and, where it has one, an opening.

use crate::math::Vec3;
use serde::{Deserialize, Serialize};

/// Opening of a plane, centred on the plane's point.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "shape", rename_all = "snake_case")]
pub enum Aperture {
    /// The whole plane.
    Unbounded,
    /// A disc.
    Disc {
        /// Radius [m].
        radius: f64,
    },
    /// The parallelogram point +- side_a / 2 +- side_b / 2; the sides lie in the plane and are not parallel.
    Rectangle {
        /// First edge [m].
        side_a: Vec3,
        /// Second edge [m].
        side_b: Vec3,
    },
}

/// A plane through `point` with unit normal `normal` along the direction of passage. Outside of its aperture it does nothing.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GatePlane {
    /// A point of the plane, the aperture's centre [m].
    pub point: Vec3,
    /// Unit normal along the direction of passage [-].
    pub normal: Vec3,
    /// Opening.
    pub aperture: Aperture,
}

impl GatePlane {
    /// Signed distance s = (x - p) . n of `position` [m] from the plane [m]: negative upstream.
    #[inline]
    #[must_use]
    pub fn distance(&self, position: &Vec3) -> f64 {
        (position - self.point).dot(&self.normal)
    }

    /// The same plane with an opening that reaches far beyond borders between which it spans whole `periods` \[m\] along x, y, z: no
    /// particle passes beside it, and one that is not yet back at the other side of its domain passes it, too.
    #[must_use]
    pub fn over_borders(mut self, periods: &[Option<f64>; 3]) -> Self {
        let spans = |side: &Vec3| {
            let longest = side.iamax();
            let along = side[longest].abs();
            periods[longest].is_some_and(|period| along >= period * (1.0 - 1e-9)) && side.norm() <= along * (1.0 + 1e-9)
        };
        if let Aperture::Rectangle { side_a, side_b } = &mut self.aperture {
            [side_a, side_b].into_iter().filter(|side| spans(side)).for_each(|side| *side *= 2.0);
        }
        self
    }

    /// True where the foot of the perpendicular from `position` [m] lies in the aperture, its border included.
    #[must_use]
    pub fn holds(&self, position: &Vec3) -> bool {
        let offset = position - self.point;
        let within = offset - self.normal * offset.dot(&self.normal);
        match self.aperture {
            Aperture::Unbounded => true,
            Aperture::Disc { radius } => within.norm_squared() <= radius * radius,
            Aperture::Rectangle { side_a, side_b } => {
                // within = a side_a + b side_b, solved by the sides' Gram matrix.
                let (aa, ab, bb) = (side_a.norm_squared(), side_a.dot(&side_b), side_b.norm_squared());
                let (wa, wb) = (within.dot(&side_a), within.dot(&side_b));
                let determinant = aa * bb - ab * ab;
                let a = (wa * bb - wb * ab) / determinant;
                let b = (wb * aa - wa * ab) / determinant;
                a.abs() <= 0.5 && b.abs() <= 0.5
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_opening_between_periodic_borders_has_no_sides_there() {
        let rectangle = Aperture::Rectangle { side_a: Vec3::new(0.06, 0.0, 0.0), side_b: Vec3::new(0.0, 0.03, 0.0) };
        let plane = GatePlane { point: Vec3::zeros(), normal: -Vec3::z(), aperture: rectangle };
        let beside = |x: f64, y: f64, plane: &GatePlane| plane.holds(&Vec3::new(x, y, 0.0));
        assert!(!beside(0.0, 0.0151, &plane));
        let wide = plane.over_borders(&[None, Some(0.03), None]);
        assert!(beside(0.0, 0.0151, &wide) && beside(0.029, -0.0151, &wide) && !beside(0.031, 0.0, &wide));
        // Another period, or an open axis: as it is.
        assert_eq!(plane.over_borders(&[Some(0.07), Some(0.04), None]), plane);
        assert_eq!(plane.over_borders(&[None; 3]), plane);
    }
    use crate::math::vec3;

    fn plane(aperture: Aperture) -> GatePlane {
        GatePlane { point: vec3(1.0, 2.0, 3.0), normal: vec3(0.0, 0.0, -1.0), aperture }
    }

    #[test]
    fn the_distance_is_negative_upstream() {
        let plane = plane(Aperture::Unbounded);
        assert_eq!(plane.distance(&vec3(5.0, 5.0, 3.5)), -0.5);
        assert_eq!(plane.distance(&vec3(5.0, 5.0, 2.5)), 0.5);
    }

    #[test]
    fn an_aperture_is_centred_on_the_point_and_holds_its_border() {
        assert!(plane(Aperture::Unbounded).holds(&vec3(1e3, 0.0, 7.0)));
        let disc = plane(Aperture::Disc { radius: 0.5 });
        assert!(disc.holds(&vec3(1.5, 2.0, 9.0)) && !disc.holds(&vec3(1.4, 2.4, 3.0)));
        let skew = plane(Aperture::Rectangle { side_a: vec3(2.0, 0.0, 0.0), side_b: vec3(1.0, 1.0, 0.0) });
        // The parallelogram's corner lies at (a + b) / 2 = (1.5, 0.5); a point beside its slanted edge does not.
        assert!(skew.holds(&vec3(2.49, 2.5, 3.0)) && !skew.holds(&vec3(2.2, 1.55, 3.0)));
    }
}
