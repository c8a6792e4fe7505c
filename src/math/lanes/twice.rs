//! Twice as many lanes: two registers side by side, where a register is narrower than a row of four.

use super::{Lanes, Mask};
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// Two registers of lanes, or two masks.
#[derive(Debug, Clone, Copy)]
pub struct Twice<T>(T, T);

macro_rules! both {
    ($bound:ident, $trait:ident, $function:ident) => {
        impl<T: $bound> $trait for Twice<T> {
            type Output = Self;
            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                Self(self.0.$function(other.0), self.1.$function(other.1))
            }
        }
    };
}

both!(Lanes, Add, add);
both!(Lanes, Sub, sub);
both!(Lanes, Mul, mul);
both!(Lanes, Div, div);
both!(Mask, BitAnd, bitand);
both!(Mask, BitOr, bitor);

impl<T: Lanes> Neg for Twice<T> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0, -self.1)
    }
}

impl<T: Mask> Not for Twice<T> {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(!self.0, !self.1)
    }
}

impl<T: Mask> Mask for Twice<T> {
    const COUNT: usize = 2 * T::COUNT;

    #[inline(always)]
    fn from_bits(bits: u16) -> Self {
        Self(T::from_bits(bits), T::from_bits(bits >> T::COUNT))
    }

    #[inline(always)]
    fn bits(self) -> u16 {
        self.0.bits() | self.1.bits() << T::COUNT
    }
}

impl<L: Lanes> Lanes for Twice<L> {
    type Mask = Twice<L::Mask>;
    type Row = L::Row;
    const COUNT: usize = 2 * L::COUNT;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        Self(L::splat(value), L::splat(value))
    }

    #[inline(always)]
    fn from_slice(list: &[f64]) -> Self {
        let (low, high) = list[..Self::COUNT].split_at(L::COUNT);
        Self(L::from_slice(low), L::from_slice(high))
    }

    #[inline(always)]
    fn write_to(self, list: &mut [f64]) {
        let (low, high) = list[..Self::COUNT].split_at_mut(L::COUNT);
        self.0.write_to(low);
        self.1.write_to(high);
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        Self(self.0.mul_add(factor.0, addend.0), self.1.mul_add(factor.1, addend.1))
    }

    #[inline(always)]
    fn mul_from(self, factor: Self, minuend: Self) -> Self {
        Self(self.0.mul_from(factor.0, minuend.0), self.1.mul_from(factor.1, minuend.1))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.sqrt(), self.1.sqrt())
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.abs(), self.1.abs())
    }

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        Self(self.0.larger(other.0), self.1.larger(other.1))
    }

    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        Self(self.0.smaller(other.0), self.1.smaller(other.1))
    }

    #[inline(always)]
    fn exceeds(self, other: Self) -> Self::Mask {
        Twice(self.0.exceeds(other.0), self.1.exceeds(other.1))
    }

    #[inline(always)]
    fn select(mask: Self::Mask, this: Self, other: Self) -> Self {
        Self(L::select(mask.0, this.0, other.0), L::select(mask.1, this.1, other.1))
    }

    #[inline(always)]
    unsafe fn gather_four(rows: *const [f64; 4], index: &[u32]) -> [Self; 4] {
        let (low, high) = index.split_at(L::COUNT);
        // SAFETY: the caller vouches for the rows.
        let ([a, b, c, d], [e, f, g, h]) = unsafe { (L::gather_four(rows, low), L::gather_four(rows, high)) };
        [Self(a, e), Self(b, f), Self(c, g), Self(d, h)]
    }

    #[inline(always)]
    unsafe fn gather_eight(rows: *const [f64; 8], index: &[u32]) -> [Self; 8] {
        let (low, high) = index.split_at(L::COUNT);
        // SAFETY: the caller vouches for the rows.
        let (low, high) = unsafe { (L::gather_eight(rows, low), L::gather_eight(rows, high)) };
        let [a, b, c, d, e, f, g, h] = low;
        let [i, j, k, l, m, n, o, p] = high;
        [Self(a, i), Self(b, j), Self(c, k), Self(d, l), Self(e, m), Self(f, n), Self(g, o), Self(h, p)]
    }

    #[inline(always)]
    unsafe fn add_to_rows<const N: usize>(rows: *mut [f64; 8], index: [&[u32]; N], columns: [[Self; 8]; N]) {
        // SAFETY: the caller vouches for the rows; the lower lanes come first.
        unsafe {
            L::add_to_rows(
                rows,
                index.map(|list| &list[..L::COUNT]),
                columns.map(|columns| columns.map(|both| both.0)),
            );
            L::add_to_rows(
                rows,
                index.map(|list| &list[L::COUNT..]),
                columns.map(|columns| columns.map(|both| both.1)),
            );
        }
    }

    #[inline(always)]
    unsafe fn gather_differences(rows: *const [f64; 8], of: &[u32], less: &[u32]) -> [Self; 3] {
        let ((a, b), (c, d)) = (of.split_at(L::COUNT), less.split_at(L::COUNT));
        // SAFETY: the caller vouches for the rows.
        let ([x, y, z], [u, v, w]) = unsafe { (L::gather_differences(rows, a, c), L::gather_differences(rows, b, d)) };
        [Self(x, u), Self(y, v), Self(z, w)]
    }

    #[inline(always)]
    unsafe fn add_action(rows: *mut [f64; 8], index: [&[u32]; 2], action: [Self; 3], turns: [[Self; 3]; 2]) {
        let [own, partner] = index.map(|list| list.split_at(L::COUNT));
        // SAFETY: the caller vouches for the rows; the lower lanes come first.
        unsafe {
            L::add_action(
                rows,
                [own.0, partner.0],
                action.map(|both| both.0),
                turns.map(|turn| turn.map(|both| both.0)),
            );
            L::add_action(
                rows,
                [own.1, partner.1],
                action.map(|both| both.1),
                turns.map(|turn| turn.map(|both| both.1)),
            );
        }
    }
}
