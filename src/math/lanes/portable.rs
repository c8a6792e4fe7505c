//! One lane: a plain f64.

use super::twice::Twice;
use super::{Lanes, Mask, place};

impl Mask for bool {
    const COUNT: usize = 1;

    #[inline(always)]
    fn from_bits(bits: u16) -> Self {
        bits & 1 == 1
    }

    #[inline(always)]
    fn bits(self) -> u16 {
        u16::from(self)
    }
}

impl Lanes for f64 {
    type Mask = bool;
    type Row = Twice<Twice<Self>>;
    const COUNT: usize = 1;

    #[inline(always)]
    fn splat(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn from_slice(list: &[f64]) -> Self {
        list[0]
    }

    #[inline(always)]
    fn write_to(self, list: &mut [f64]) {
        list[0] = self;
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        Self::mul_add(self, factor, addend)
    }

    #[inline(always)]
    fn mul_from(self, factor: Self, minuend: Self) -> Self {
        Self::mul_add(-self, factor, minuend)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self::sqrt(self)
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self::abs(self)
    }

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        if self > other { self } else { other }
    }

    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        if self < other { self } else { other }
    }

    #[inline(always)]
    fn exceeds(self, other: Self) -> bool {
        self > other
    }

    #[inline(always)]
    fn select(mask: bool, this: Self, other: Self) -> Self {
        if mask { this } else { other }
    }

    #[inline(always)]
    unsafe fn gather_four(rows: *const [f64; 4], index: &[u32]) -> [Self; 4] {
        // SAFETY: the caller vouches for the row.
        unsafe { *rows.add(place(index, 0)) }
    }

    #[inline(always)]
    unsafe fn gather_eight(rows: *const [f64; 8], index: &[u32]) -> [Self; 8] {
        // SAFETY: the caller vouches for the row.
        unsafe { *rows.add(place(index, 0)) }
    }

    #[inline(always)]
    unsafe fn add_to_rows<const N: usize>(rows: *mut [f64; 8], index: [&[u32]; N], columns: [[Self; 8]; N]) {
        for (index, columns) in index.into_iter().zip(columns) {
            // SAFETY: the caller vouches for the row, and that it is nobody else's.
            let row = unsafe { &mut *rows.add(place(index, 0)) };
            row.iter_mut().zip(columns).for_each(|(sum, value)| *sum += value);
        }
    }
}
