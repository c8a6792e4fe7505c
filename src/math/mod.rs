//! Vectors and rotations: thin names over `nalgebra`, so that the rest of the code speaks of one kind of vector.

pub mod lanes;

/// A vector in space; its unit is said where it is used.
pub type Vec3 = nalgebra::Vector3<f64>;
/// A rotation in space.
pub type Rotation = nalgebra::UnitQuaternion<f64>;

/// A vector from its components.
#[must_use]
pub const fn vec3(x: f64, y: f64, z: f64) -> Vec3 {
    Vec3::new(x, y, z)
}

/// An axis-aligned box, `minimum` and `maximum` corners [m].
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Bounds {
    /// Lower corner [m].
    pub minimum: [f64; 3],
    /// Upper corner [m].
    pub maximum: [f64; 3],
}

impl Bounds {
    /// The empty box: contains nothing, grows by [`Bounds::include`].
    pub const EMPTY: Self = Self { minimum: [f64::INFINITY; 3], maximum: [f64::NEG_INFINITY; 3] };

    /// Grows to contain `point` [m].
    pub fn include(&mut self, point: &Vec3) {
        for axis in 0..3 {
            self.minimum[axis] = self.minimum[axis].min(point[axis]);
            self.maximum[axis] = self.maximum[axis].max(point[axis]);
        }
    }

    /// The smallest box that contains both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        Self {
            minimum: std::array::from_fn(|axis| self.minimum[axis].min(other.minimum[axis])),
            maximum: std::array::from_fn(|axis| self.maximum[axis].max(other.maximum[axis])),
        }
    }

    /// The box grown by `margin` [m] on every side.
    #[must_use]
    pub fn grown(&self, margin: f64) -> Self {
        Self { minimum: self.minimum.map(|x| x - margin), maximum: self.maximum.map(|x| x + margin) }
    }

    /// True where `point` [m] lies inside or on the border.
    #[must_use]
    pub fn contains(&self, point: &Vec3) -> bool {
        (0..3).all(|axis| (self.minimum[axis]..=self.maximum[axis]).contains(&point[axis]))
    }

    /// True where it contains no point at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        (0..3).any(|axis| self.minimum[axis] > self.maximum[axis])
    }

    /// Edge lengths [m].
    #[must_use]
    pub fn size(&self) -> Vec3 {
        Vec3::from(self.maximum) - Vec3::from(self.minimum)
    }
}
