//! Vectors in space, one a lane.

use super::Lanes;
use crate::math::Vec3;
use std::ops::{Add, Mul, Neg, Sub};

/// A vector in every lane. Sums run over x, y, z in this order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LaneVector<L = f64> {
    /// Components along x.
    pub x: L,
    /// Components along y.
    pub y: L,
    /// Components along z.
    pub z: L,
}

impl<L: Lanes> LaneVector<L> {
    /// From components.
    #[inline(always)]
    pub fn new(x: L, y: L, z: L) -> Self {
        Self { x, y, z }
    }

    /// No length in any lane.
    #[inline(always)]
    pub fn zeros() -> Self {
        Self { x: L::zero(), y: L::zero(), z: L::zero() }
    }

    /// The same vector in every lane.
    #[inline(always)]
    pub fn everywhere(vector: Vec3) -> Self {
        Self { x: L::splat(vector.x), y: L::splat(vector.y), z: L::splat(vector.z) }
    }

    /// Scalar product.
    #[inline(always)]
    pub fn dot(&self, other: &Self) -> L {
        self.x.mul_add(other.x, self.y.mul_add(other.y, self.z * other.z))
    }

    /// Vector product.
    #[inline(always)]
    pub fn cross(&self, other: &Self) -> Self {
        Self {
            x: self.z.mul_from(other.y, self.y * other.z),
            y: self.x.mul_from(other.z, self.z * other.x),
            z: self.y.mul_from(other.x, self.x * other.y),
        }
    }

    /// `self + way * factor`.
    #[inline(always)]
    pub fn plus(&self, way: &Self, factor: L) -> Self {
        Self { x: way.x.mul_add(factor, self.x), y: way.y.mul_add(factor, self.y), z: way.z.mul_add(factor, self.z) }
    }

    /// `self - way * factor`.
    #[inline(always)]
    pub fn minus(&self, way: &Self, factor: L) -> Self {
        Self { x: way.x.mul_from(factor, self.x), y: way.y.mul_from(factor, self.y), z: way.z.mul_from(factor, self.z) }
    }

    /// Square of the length.
    #[inline(always)]
    pub fn norm_squared(&self) -> L {
        self.dot(self)
    }

    /// `this` in the lanes of the mask, else `other`.
    #[inline(always)]
    pub fn select(mask: L::Mask, this: &Self, other: &Self) -> Self {
        Self {
            x: L::select(mask, this.x, other.x),
            y: L::select(mask, this.y, other.y),
            z: L::select(mask, this.z, other.z),
        }
    }

    /// The vectors of the mask's lanes, no length in the others.
    #[inline(always)]
    pub fn only(&self, mask: L::Mask) -> Self {
        Self::select(mask, self, &Self::zeros())
    }

    /// From three lists of components, from a place on.
    #[inline(always)]
    pub fn read_from<S: AsRef<[f64]>>([x, y, z]: &[S; 3], from: usize) -> Self {
        Self {
            x: L::from_slice(&x.as_ref()[from..]),
            y: L::from_slice(&y.as_ref()[from..]),
            z: L::from_slice(&z.as_ref()[from..]),
        }
    }

    /// Into three lists of components, from a place on.
    #[inline(always)]
    pub fn write_to(&self, [x, y, z]: &mut [Vec<f64>; 3], from: usize) {
        self.x.write_to(&mut x[from..]);
        self.y.write_to(&mut y[from..]);
        self.z.write_to(&mut z[from..]);
    }

    /// Lane by lane.
    #[inline(always)]
    pub fn to_arrays(&self) -> [[f64; super::MOST_LANES]; 3] {
        [self.x.to_array(), self.y.to_array(), self.z.to_array()]
    }
}

impl<L: Lanes> Add for LaneVector<L> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl<L: Lanes> Sub for LaneVector<L> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl<L: Lanes> Mul<L> for LaneVector<L> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, factor: L) -> Self {
        Self { x: self.x * factor, y: self.y * factor, z: self.z * factor }
    }
}

impl<L: Lanes> Neg for LaneVector<L> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { x: -self.x, y: -self.y, z: -self.z }
    }
}

impl From<Vec3> for LaneVector<f64> {
    #[inline(always)]
    fn from(vector: Vec3) -> Self {
        Self { x: vector.x, y: vector.y, z: vector.z }
    }
}

impl From<LaneVector<f64>> for Vec3 {
    #[inline(always)]
    fn from(vector: LaneVector<f64>) -> Self {
        Self::new(vector.x, vector.y, vector.z)
    }
}
