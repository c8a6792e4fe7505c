//! Lanes: several f64 that go through the same arithmetic at once.
//!
//! A formula is written once, over [`Lanes`], and compiled for every instruction set; [`at_level`] chooses one at run time. Only
//! operations that IEEE 754 rounds correctly are offered, the fused multiply-add among them (no approximate reciprocals), so every
//! level gives the same bits, and a plain f64, which is one lane, is the reference.

mod portable;
mod twice;
mod vector;
#[cfg(target_arch = "x86_64")]
mod x86;

pub use vector::LaneVector;

use serde::{Deserialize, Serialize};
use std::fmt::Debug;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// Most lanes of any level.
pub const MOST_LANES: usize = 16;

/// Answers of a comparison, lane by lane.
pub trait Mask: Copy + Debug + BitAnd<Output = Self> + BitOr<Output = Self> + Not<Output = Self> {
    /// How many lanes.
    const COUNT: usize;
    /// One answer for each lane, bit k for lane k; further bits are ignored.
    fn from_bits(bits: u16) -> Self;
    /// Bit k is the answer of lane k; further bits are 0.
    fn bits(self) -> u16;
    /// True where some lane says so.
    #[inline(always)]
    fn any(self) -> bool {
        self.bits() != 0
    }
}

/// [`Lanes::COUNT`] numbers.
pub trait Lanes:
    Copy + Debug + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// Answers of a comparison.
    type Mask: Mask;
    /// Four lanes of the same level: a row of a list.
    type Row: Lanes;
    /// How many.
    const COUNT: usize;

    /// The same number in every lane.
    fn splat(value: f64) -> Self;
    /// The first `count` lanes, at least one; all where there are no more.
    #[inline(always)]
    #[must_use]
    fn first(count: usize) -> Self::Mask {
        Self::Mask::from_bits(u16::MAX >> (MOST_LANES - count.min(Self::COUNT)))
    }
    /// The first `COUNT` numbers of a list.
    ///
    /// # Panics
    /// Where the list is shorter.
    fn from_slice(list: &[f64]) -> Self;
    /// Writes them to the front of a list.
    ///
    /// # Panics
    /// Where the list is shorter.
    fn write_to(self, list: &mut [f64]);
    /// `self * factor + addend`, rounded once.
    fn mul_add(self, factor: Self, addend: Self) -> Self;
    /// `minuend - self * factor`, rounded once.
    fn mul_from(self, factor: Self, minuend: Self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Absolute value.
    fn abs(self) -> Self;
    /// `self` where it is larger, else `other` (which a comparison with not-a-number gives).
    fn larger(self, other: Self) -> Self;
    /// `self` where it is smaller, else `other`.
    fn smaller(self, other: Self) -> Self;
    /// `self > other`.
    fn exceeds(self, other: Self) -> Self::Mask;
    /// `self < other`.
    #[inline(always)]
    fn below(self, other: Self) -> Self::Mask {
        other.exceeds(self)
    }
    /// `self` in the lanes of the mask, else `other`.
    fn select(mask: Self::Mask, this: Self, other: Self) -> Self;

    /// Writes those of `COUNT` whole numbers whose bit is set to the front of a list, in their order, and says how many they are. What
    /// the first `COUNT` places hold behind them may be anything.
    ///
    /// # Panics
    /// Where either list is shorter than `COUNT`.
    #[inline(always)]
    fn pack(numbers: &[u32], bits: u16, list: &mut [u32]) -> usize {
        let (numbers, list) = (&numbers[..Self::COUNT], &mut list[..Self::COUNT]);
        let mut count = 0;
        for (lane, &number) in numbers.iter().enumerate() {
            // Written whether it counts or not: no processor foresees which do.
            list[count] = number;
            count += usize::from(bits >> lane & 1);
        }
        count
    }

    /// Columns of rows of four: result `c` holds entry `c` of row `index[k]` in lane k.
    ///
    /// # Safety
    /// `index` must have `COUNT` entries, and `rows` be readable at every one.
    unsafe fn gather_four(rows: *const [f64; 4], index: &[u32]) -> [Self; 4];
    /// Columns of rows of eight, as [`Lanes::gather_four`]. The last two 32-bit numbers of a row may be anything.
    ///
    /// # Safety
    /// `index` must have `COUNT` entries, and `rows` be readable at every one.
    unsafe fn gather_eight(rows: *const [f64; 8], index: &[u32]) -> [Self; 8];
    /// Adds columns to rows of eight, lane by lane in their order: for lane k, row `index[n][k]` gets lane k of the columns
    /// `columns[n]`, for one n after the other.
    ///
    /// # Safety
    /// Each `index` must have `COUNT` entries, `rows` be readable and writable at every one, and nobody else may use them meanwhile.
    unsafe fn add_to_rows<const N: usize>(rows: *mut [f64; 8], index: [&[u32]; N], columns: [[Self; 8]; N]);

    /// First three columns of rows of eight at `of`, less those at `less`.
    ///
    /// # Safety
    /// As [`Lanes::gather_eight`], for both.
    #[inline(always)]
    unsafe fn gather_differences(rows: *const [f64; 8], of: &[u32], less: &[u32]) -> [Self; 3] {
        // SAFETY: the caller vouches for the rows.
        let ([a, b, c, ..], [d, e, f, ..]) = unsafe { (Self::gather_eight(rows, of), Self::gather_eight(rows, less)) };
        [a - d, b - e, c - f]
    }
    /// Adds action and reaction to rows of eight, lane by lane in their order: for lane k, the first three numbers of row
    /// `index[0][k]` get those of `action` and its second four's first three those of `turns[0]`; then row `index[1][k]` gets the
    /// opposite of `action`, and `turns[1]`.
    ///
    /// # Safety
    /// As [`Lanes::add_to_rows`].
    #[inline(always)]
    unsafe fn add_action(rows: *mut [f64; 8], index: [&[u32]; 2], action: [Self; 3], turns: [[Self; 3]; 2]) {
        let ([x, y, z], zero) = (action, Self::zero());
        let [[a, b, c], [d, e, f]] = turns;
        // SAFETY: the caller vouches for the rows.
        unsafe {
            Self::add_to_rows(rows, index, [[x, y, z, zero, a, b, c, zero], [-x, -y, -z, -zero, d, e, f, -zero]]);
        }
    }

    /// Zero.
    #[inline(always)]
    fn zero() -> Self {
        Self::splat(0.0)
    }
    /// All lanes, those beyond `COUNT` zero.
    #[inline(always)]
    fn to_array(self) -> [f64; MOST_LANES] {
        let mut list = [0.0; MOST_LANES];
        self.write_to(&mut list);
        list
    }
    /// A function of three numbers that has no lanes of its own, lane by lane.
    #[inline(always)]
    fn lane_by_lane(a: Self, b: Self, c: Self, function: impl Fn(f64, f64, f64) -> f64) -> Self {
        let (a, b, c) = (a.to_array(), b.to_array(), c.to_array());
        let mut result = [0.0; MOST_LANES];
        (0..Self::COUNT).for_each(|lane| result[lane] = function(a[lane], b[lane], c[lane]));
        Self::from_slice(&result)
    }
}

/// Number `lane` of a list of indices.
///
/// # Safety
/// The list must be that long.
#[inline(always)]
unsafe fn place(index: &[u32], lane: usize) -> usize {
    debug_assert!(lane < index.len());
    // SAFETY: the caller vouches for the length. Volatile, since else the compiler loads and scales all indices in a vector
    // register, only to take them out again one by one, which costs more.
    unsafe { std::ptr::read_volatile(index.as_ptr().add(lane)) as usize }
}

/// An instruction set to compute with. No level changes a bit of a result.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SimdLevel {
    /// One number at a time: the reference.
    Scalar,
    /// What every 64-bit processor of this family has: two lanes (SSE2).
    Baseline,
    /// AVX2 and FMA: four lanes.
    Avx2,
    /// AVX-512 F, DQ and VL, and FMA: eight lanes.
    Avx512,
}

impl SimdLevel {
    /// Every level, slowest first.
    pub const ALL: [Self; 4] = [Self::Scalar, Self::Baseline, Self::Avx2, Self::Avx512];

    /// Name on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Baseline => "baseline",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }

    /// Whether this processor has it.
    #[must_use]
    pub fn is_available(self) -> bool {
        #[cfg(target_arch = "x86_64")]
        return match self {
            Self::Scalar | Self::Baseline => true,
            Self::Avx2 => std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma"),
            Self::Avx512 => {
                Self::Avx2.is_available()
                    && std::arch::is_x86_feature_detected!("avx512f")
                    && std::arch::is_x86_feature_detected!("avx512dq")
                    && std::arch::is_x86_feature_detected!("avx512vl")
            }
        };
        #[cfg(not(target_arch = "x86_64"))]
        return self == Self::Scalar;
    }

    /// The fastest that this processor has.
    #[must_use]
    pub fn best() -> Self {
        Self::ALL.into_iter().rev().find(|level| level.is_available()).unwrap_or(Self::Scalar)
    }
}

/// Work that is written over lanes.
pub trait LaneWork {
    /// What it gives.
    type Output;
    /// Does the work with `L`; must be `#[inline(always)]` to be compiled for the level.
    fn run<L: Lanes>(self) -> Self::Output;
}

/// Does work at a level.
///
/// # Panics
/// Where the processor does not have the level.
#[inline]
pub fn at_level<W: LaneWork>(level: SimdLevel, work: W) -> W::Output {
    match level {
        SimdLevel::Scalar => work.run::<f64>(),
        #[cfg(target_arch = "x86_64")]
        _ => x86::run(level, work),
        #[cfg(not(target_arch = "x86_64"))]
        _ => panic!("this processor has no {}", level.name()),
    }
}

#[cfg(test)]
mod tests;
