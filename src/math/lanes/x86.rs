//! Two, four and, in a file of their own, eight lanes on x86-64 processors.
//!
//! The types must only be used in code compiled for their instruction set: [`run`] is the one way in.

use super::twice::Twice;
use super::{LaneWork, Lanes, Mask, SimdLevel, place};
use eight::Eight;
use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

/// Does work at a level other than scalar.
pub(super) fn run<W: LaneWork>(level: SimdLevel, work: W) -> W::Output {
    assert!(level.is_available(), "this processor has no {}", level.name());
    match level {
        SimdLevel::Scalar => work.run::<f64>(),
        SimdLevel::Baseline => work.run::<Two>(),
        // SAFETY: the level is available.
        SimdLevel::Avx2 => unsafe { run_avx2(work) },
        // SAFETY: the level is available.
        SimdLevel::Avx512 => unsafe { run_avx512(work) },
    }
}

#[target_feature(enable = "avx2,fma")]
fn run_avx2<W: LaneWork>(work: W) -> W::Output {
    work.run::<Four>()
}

#[target_feature(enable = "avx2,fma,avx512f,avx512dq,avx512vl")]
fn run_avx512<W: LaneWork>(work: W) -> W::Output {
    work.run::<Eight>()
}

macro_rules! operators {
    ($name:ident, $raw:ty, $add:ident, $sub:ident, $mul:ident, $div:ident, $xor:ident, $set:ident) => {
        operators!(@binary $name, Add, add, $add);
        operators!(@binary $name, Sub, sub, $sub);
        operators!(@binary $name, Mul, mul, $mul);
        operators!(@binary $name, Div, div, $div);
        impl Neg for $name {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                // SAFETY: only used in code for this instruction set.
                unsafe { Self($xor(self.0, $set(-0.0))) }
            }
        }
    };
    (@binary $name:ident, $trait:ident, $function:ident, $intrinsic:ident) => {
        impl $trait for $name {
            type Output = Self;
            #[inline(always)]
            fn $function(self, other: Self) -> Self {
                // SAFETY: only used in code for this instruction set.
                unsafe { Self($intrinsic(self.0, other.0)) }
            }
        }
    };
}

macro_rules! mask_as_vector {
    ($name:ident, $raw:ty, $and:ident, $or:ident, $xor:ident, $ones:expr, $movemask:ident, $from_bits:expr) => {
        /// Answers kept as all ones or all zeros in each lane.
        #[derive(Debug, Clone, Copy)]
        pub struct $name($raw);

        impl Mask for $name {
            const COUNT: usize = size_of::<$raw>() / size_of::<f64>();

            #[inline(always)]
            fn from_bits(bits: u16) -> Self {
                Self($from_bits(bits))
            }
            #[inline(always)]
            fn bits(self) -> u16 {
                // SAFETY: only used in code for this instruction set.
                unsafe { $movemask(self.0) as u16 }
            }
        }
        impl BitAnd for $name {
            type Output = Self;
            #[inline(always)]
            fn bitand(self, other: Self) -> Self {
                // SAFETY: only used in code for this instruction set.
                unsafe { Self($and(self.0, other.0)) }
            }
        }
        impl BitOr for $name {
            type Output = Self;
            #[inline(always)]
            fn bitor(self, other: Self) -> Self {
                // SAFETY: only used in code for this instruction set.
                unsafe { Self($or(self.0, other.0)) }
            }
        }
        impl Not for $name {
            type Output = Self;
            #[inline(always)]
            fn not(self) -> Self {
                // SAFETY: only used in code for this instruction set.
                unsafe { Self($xor(self.0, $ones)) }
            }
        }
    };
}

/// Two lanes: SSE2.
#[derive(Debug, Clone, Copy)]
pub struct Two(__m128d);
operators!(Two, __m128d, _mm_add_pd, _mm_sub_pd, _mm_mul_pd, _mm_div_pd, _mm_xor_pd, _mm_set1_pd);
mask_as_vector!(
    TwoMask,
    __m128d,
    _mm_and_pd,
    _mm_or_pd,
    _mm_xor_pd,
    _mm_castsi128_pd(_mm_set1_epi32(-1)),
    _mm_movemask_pd,
    // SAFETY: only used in code for this instruction set.
    |bits: u16| unsafe {
        let lane = |k: u16| -i64::from(bits >> k & 1);
        _mm_castsi128_pd(_mm_set_epi64x(lane(1), lane(0)))
    }
);

/// Four lanes: AVX2.
#[derive(Debug, Clone, Copy)]
pub struct Four(__m256d);
operators!(Four, __m256d, _mm256_add_pd, _mm256_sub_pd, _mm256_mul_pd, _mm256_div_pd, _mm256_xor_pd, _mm256_set1_pd);
mask_as_vector!(
    FourMask,
    __m256d,
    _mm256_and_pd,
    _mm256_or_pd,
    _mm256_xor_pd,
    _mm256_castsi256_pd(_mm256_set1_epi32(-1)),
    _mm256_movemask_pd,
    // SAFETY: only used in code for this instruction set.
    |bits: u16| unsafe {
        let lane = |k: u16| -i64::from(bits >> k & 1);
        _mm256_castsi256_pd(_mm256_set_epi64x(lane(3), lane(2), lane(1), lane(0)))
    }
);

/// Where the rows of a list begin that has `STRIDE` numbers a row.
///
/// # Safety
/// There must be `COUNT` indices, and rows at them.
#[inline(always)]
unsafe fn rows_of<const STRIDE: usize, const COUNT: usize>(first: *const f64, index: &[u32]) -> [*const f64; COUNT] {
    let mut rows = [first; COUNT];
    for (lane, row) in rows.iter_mut().enumerate() {
        // SAFETY: the caller vouches for it.
        *row = unsafe { first.add(STRIDE * place(index, lane)) };
    }
    rows
}

/// What the three have in common; `$four` reads columns of four numbers from rows.
macro_rules! lanes_in_common {
    ($count:literal, $set:ident, $load:ident, $store:ident, $sqrt:ident, $max:ident, $min:ident, $four:ident) => {
        const COUNT: usize = $count;

        #[inline(always)]
        fn splat(value: f64) -> Self {
            // SAFETY: only used in code for this instruction set.
            unsafe { Self($set(value)) }
        }
        #[inline(always)]
        fn from_slice(list: &[f64]) -> Self {
            let list = &list[..$count];
            // SAFETY: the list is long enough.
            unsafe { Self($load(list.as_ptr())) }
        }
        #[inline(always)]
        fn write_to(self, list: &mut [f64]) {
            let list = &mut list[..$count];
            // SAFETY: the list is long enough.
            unsafe { $store(list.as_mut_ptr(), self.0) }
        }
        #[inline(always)]
        fn sqrt(self) -> Self {
            // SAFETY: only used in code for this instruction set.
            unsafe { Self($sqrt(self.0)) }
        }
        #[inline(always)]
        fn larger(self, other: Self) -> Self {
            // SAFETY: only used in code for this instruction set.
            unsafe { Self($max(self.0, other.0)) }
        }
        #[inline(always)]
        fn smaller(self, other: Self) -> Self {
            // SAFETY: only used in code for this instruction set.
            unsafe { Self($min(self.0, other.0)) }
        }
        #[inline(always)]
        unsafe fn gather_four(rows: *const [f64; 4], index: &[u32]) -> [Self; 4] {
            // SAFETY: the caller vouches for the rows.
            unsafe { $four(&rows_of::<4, $count>(rows.cast(), index)) }
        }
        #[inline(always)]
        unsafe fn gather_eight(rows: *const [f64; 8], index: &[u32]) -> [Self; 8] {
            // SAFETY: the caller vouches for the rows.
            unsafe {
                let mut rows = rows_of::<8, $count>(rows.cast(), index);
                let [a, b, c, d] = $four(&rows);
                for row in &mut rows {
                    *row = row.add(4);
                }
                let [e, f, g, h] = $four(&rows);
                [a, b, c, d, e, f, g, h]
            }
        }
    };
}

impl Lanes for Two {
    type Mask = TwoMask;
    type Row = Twice<Self>;
    lanes_in_common!(2, _mm_set1_pd, _mm_loadu_pd, _mm_storeu_pd, _mm_sqrt_pd, _mm_max_pd, _mm_min_pd, four_of_two);

    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        Self::lane_by_lane(self, factor, addend, f64::mul_add)
    }
    #[inline(always)]
    fn mul_from(self, factor: Self, minuend: Self) -> Self {
        (-self).mul_add(factor, minuend)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: SSE2 is always there.
        unsafe { Self(_mm_andnot_pd(_mm_set1_pd(-0.0), self.0)) }
    }
    #[inline(always)]
    fn exceeds(self, other: Self) -> TwoMask {
        // SAFETY: SSE2 is always there.
        unsafe { TwoMask(_mm_cmpgt_pd(self.0, other.0)) }
    }
    #[inline(always)]
    fn select(mask: TwoMask, this: Self, other: Self) -> Self {
        // SAFETY: SSE2 is always there.
        unsafe { Self(_mm_or_pd(_mm_and_pd(mask.0, this.0), _mm_andnot_pd(mask.0, other.0))) }
    }
    #[inline(always)]
    unsafe fn add_to_rows<const N: usize>(rows: *mut [f64; 8], index: [&[u32]; N], columns: [[Self; 8]; N]) {
        for lane in 0..2 {
            for (index, columns) in index.iter().zip(&columns) {
                // SAFETY: the caller vouches for the row.
                let row: *mut f64 = unsafe { rows.add(place(index, lane)) }.cast();
                for pair in 0..4 {
                    let (a, b) = (columns[2 * pair].0, columns[2 * pair + 1].0);
                    // SAFETY: within the row.
                    unsafe {
                        let part = if lane == 0 { _mm_unpacklo_pd(a, b) } else { _mm_unpackhi_pd(a, b) };
                        let place = row.add(2 * pair);
                        _mm_storeu_pd(place, _mm_add_pd(_mm_loadu_pd(place), part));
                    }
                }
            }
        }
    }
}

/// # Safety
/// Four numbers must be readable at every row.
#[inline(always)]
unsafe fn four_of_two(rows: &[*const f64; 2]) -> [Two; 4] {
    // SAFETY: the caller vouches for it.
    unsafe {
        let [a, b] = *rows;
        let (a0, b0) = (_mm_loadu_pd(a), _mm_loadu_pd(b));
        let (a2, b2) = (_mm_loadu_pd(a.add(2)), _mm_loadu_pd(b.add(2)));
        [_mm_unpacklo_pd(a0, b0), _mm_unpackhi_pd(a0, b0), _mm_unpacklo_pd(a2, b2), _mm_unpackhi_pd(a2, b2)].map(Two)
    }
}

impl Lanes for Four {
    type Mask = FourMask;
    type Row = Self;
    lanes_in_common!(
        4,
        _mm256_set1_pd,
        _mm256_loadu_pd,
        _mm256_storeu_pd,
        _mm256_sqrt_pd,
        _mm256_max_pd,
        _mm256_min_pd,
        four_of_four
    );

    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        // SAFETY: only used in code for this instruction set.
        unsafe { Self(_mm256_fmadd_pd(self.0, factor.0, addend.0)) }
    }
    #[inline(always)]
    fn mul_from(self, factor: Self, minuend: Self) -> Self {
        // SAFETY: only used in code for this instruction set.
        unsafe { Self(_mm256_fnmadd_pd(self.0, factor.0, minuend.0)) }
    }
    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: only used in code for this instruction set.
        unsafe { Self(_mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0)) }
    }
    #[inline(always)]
    fn exceeds(self, other: Self) -> FourMask {
        // SAFETY: only used in code for this instruction set.
        unsafe { FourMask(_mm256_cmp_pd::<_CMP_GT_OQ>(self.0, other.0)) }
    }
    #[inline(always)]
    fn select(mask: FourMask, this: Self, other: Self) -> Self {
        // SAFETY: only used in code for this instruction set.
        unsafe { Self(_mm256_blendv_pd(other.0, this.0, mask.0)) }
    }
    #[inline(always)]
    unsafe fn add_to_rows<const N: usize>(rows: *mut [f64; 8], index: [&[u32]; N], columns: [[Self; 8]; N]) {
        for half in 0..2 {
            let mut turned = [[Self::zero().0; 4]; N];
            for (turned, columns) in turned.iter_mut().zip(&columns) {
                let [a, b, c, d] = [0, 1, 2, 3].map(|k| columns[4 * half + k].0);
                // SAFETY: only used in code for this instruction set.
                *turned = unsafe { turned_four(a, b, c, d) };
            }
            for lane in 0..4 {
                for (index, turned) in index.iter().zip(&turned) {
                    // SAFETY: the caller vouches for the row.
                    unsafe {
                        let place = rows.add(place(index, lane)).cast::<f64>().add(4 * half);
                        _mm256_storeu_pd(place, _mm256_add_pd(_mm256_loadu_pd(place), turned[lane]));
                    }
                }
            }
        }
    }
}

/// Rows and columns of a 4 x 4 matrix exchanged.
///
/// # Safety
/// Only in code for AVX2.
#[inline(always)]
unsafe fn turned_four(a: __m256d, b: __m256d, c: __m256d, d: __m256d) -> [__m256d; 4] {
    // SAFETY: only used in code for this instruction set.
    unsafe {
        let (ab_low, ab_high) = (_mm256_unpacklo_pd(a, b), _mm256_unpackhi_pd(a, b));
        let (cd_low, cd_high) = (_mm256_unpacklo_pd(c, d), _mm256_unpackhi_pd(c, d));
        [
            _mm256_permute2f128_pd::<0x20>(ab_low, cd_low),
            _mm256_permute2f128_pd::<0x20>(ab_high, cd_high),
            _mm256_permute2f128_pd::<0x31>(ab_low, cd_low),
            _mm256_permute2f128_pd::<0x31>(ab_high, cd_high),
        ]
    }
}

/// # Safety
/// Four numbers must be readable at every row.
#[inline(always)]
unsafe fn four_of_four(rows: &[*const f64; 4]) -> [Four; 4] {
    // SAFETY: the caller vouches for it.
    unsafe {
        let row = |lane: usize| _mm256_loadu_pd(rows[lane]);
        turned_four(row(0), row(1), row(2), row(3)).map(Four)
    }
}

mod eight;
