//! Two, four and eight lanes on x86-64 processors.
//!
//! The types must only be used in code compiled for their instruction set: [`run`] is the one way in.

use super::twice::Twice;
use super::{LaneWork, Lanes, Mask, SimdLevel, place};
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

/// Answers kept as bits.
#[derive(Debug, Clone, Copy)]
pub struct BitMask(u8);

impl Mask for BitMask {
    const COUNT: usize = 8;

    #[inline(always)]
    fn from_bits(bits: u16) -> Self {
        Self(bits as u8)
    }
    #[inline(always)]
    fn bits(self) -> u16 {
        u16::from(self.0)
    }
}

impl BitAnd for BitMask {
    type Output = Self;
    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }
}

impl BitOr for BitMask {
    type Output = Self;
    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl Not for BitMask {
    type Output = Self;
    #[inline(always)]
    fn not(self) -> Self {
        Self(!self.0)
    }
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

/// Eight lanes: AVX-512.
#[derive(Debug, Clone, Copy)]
pub struct Eight(__m512d);
operators!(Eight, __m512d, _mm512_add_pd, _mm512_sub_pd, _mm512_mul_pd, _mm512_div_pd, _mm512_xor_pd, _mm512_set1_pd);

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

impl Lanes for Eight {
    type Mask = BitMask;
    type Row = Four;
    lanes_in_common!(
        8,
        _mm512_set1_pd,
        _mm512_loadu_pd,
        _mm512_storeu_pd,
        _mm512_sqrt_pd,
        _mm512_max_pd,
        _mm512_min_pd,
        four_of_eight
    );

    #[inline(always)]
    fn mul_add(self, factor: Self, addend: Self) -> Self {
        // SAFETY: only used in code for this instruction set.
        unsafe { Self(_mm512_fmadd_pd(self.0, factor.0, addend.0)) }
    }
    #[inline(always)]
    fn mul_from(self, factor: Self, minuend: Self) -> Self {
        // SAFETY: only used in code for this instruction set.
        unsafe { Self(_mm512_fnmadd_pd(self.0, factor.0, minuend.0)) }
    }
    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: only used in code for this instruction set.
        unsafe { Self(_mm512_andnot_pd(_mm512_set1_pd(-0.0), self.0)) }
    }
    #[inline(always)]
    fn exceeds(self, other: Self) -> BitMask {
        // SAFETY: only used in code for this instruction set.
        unsafe { BitMask(_mm512_cmp_pd_mask::<_CMP_GT_OQ>(self.0, other.0)) }
    }
    #[inline(always)]
    fn select(mask: BitMask, this: Self, other: Self) -> Self {
        // SAFETY: only used in code for this instruction set.
        unsafe { Self(_mm512_mask_blend_pd(mask.0, other.0, this.0)) }
    }
    #[inline(always)]
    unsafe fn add_to_rows<const N: usize>(rows: *mut [f64; 8], index: [&[u32]; N], columns: [[Self; 8]; N]) {
        let mut turned = [[Self::zero().0; 8]; N];
        for (turned, columns) in turned.iter_mut().zip(columns) {
            // SAFETY: only used in code for this instruction set.
            *turned = unsafe { turned_eight(columns.map(|column| column.0)) };
        }
        for lane in 0..8 {
            for (index, turned) in index.iter().zip(&turned) {
                // SAFETY: the caller vouches for the row.
                unsafe {
                    let place: *mut f64 = rows.add(place(index, lane)).cast();
                    _mm512_storeu_pd(place, _mm512_add_pd(_mm512_loadu_pd(place), turned[lane]));
                }
            }
        }
    }

    #[inline(always)]
    unsafe fn gather_differences(rows: *const [f64; 8], of: &[u32], less: &[u32]) -> [Self; 3] {
        // SAFETY: the caller vouches for the rows.
        unsafe {
            let of = halves_of_eight(&rows_of::<8, 8>(rows.cast(), of));
            let less = halves_of_eight(&rows_of::<8, 8>(rows.cast(), less));
            let difference = |k: usize| _mm512_sub_pd(of[k], less[k]);
            let [x, y, z, _] = columns_of_halves([difference(0), difference(1), difference(2), difference(3)]);
            [x, y, z]
        }
    }

    #[inline(always)]
    unsafe fn add_action(rows: *mut [f64; 8], index: [&[u32]; 2], action: [Self; 3], turns: [[Self; 3]; 2]) {
        // SAFETY: only used in code for this instruction set.
        let (own, partner) = unsafe {
            let action = pairs_of_columns(action);
            // What is subtracted from the partner's rows.
            let [x, y, z] = turns[1];
            let (turn, less) = (pairs_of_columns(turns[0]), pairs_of_columns([-x, -y, -z]));
            (rows_of_pairs(&action, &turn), rows_of_pairs(&action, &less))
        };
        for lane in 0..8 {
            // SAFETY: the caller vouches for the rows.
            unsafe {
                let place_of = |list: &[u32]| -> *mut f64 { rows.add(place(list, lane)).cast() };
                let (first, second) = (place_of(index[0]), place_of(index[1]));
                _mm512_storeu_pd(first, _mm512_add_pd(_mm512_loadu_pd(first), own[lane]));
                _mm512_storeu_pd(second, _mm512_sub_pd(_mm512_loadu_pd(second), partner[lane]));
            }
        }
    }
}

/// # Safety
/// Four numbers must be readable at every row.
#[inline(always)]
unsafe fn four_of_eight(rows: &[*const f64; 8]) -> [Eight; 4] {
    // SAFETY: the caller vouches for it.
    unsafe { columns_of_halves(halves_of_eight(rows)) }
}

/// Four numbers of each of eight rows, of two rows in a register: those of lanes 0 and 2, 1 and 3, 4 and 6, 5 and 7, so that the columns
/// come out in the lanes' order.
///
/// # Safety
/// Only in code for AVX-512; four numbers must be readable at every row.
#[inline(always)]
unsafe fn halves_of_eight(rows: &[*const f64; 8]) -> [__m512d; 4] {
    // SAFETY: the caller vouches for it.
    unsafe {
        let row = |lane: usize| _mm256_loadu_pd(rows[lane]);
        let two = |a: usize, b: usize| _mm512_insertf64x4::<1>(_mm512_castpd256_pd512(row(a)), row(b));
        [two(0, 2), two(1, 3), two(4, 6), two(5, 7)]
    }
}

/// Columns of what [`halves_of_eight`] gives.
///
/// # Safety
/// Only in code for AVX-512.
#[inline(always)]
unsafe fn columns_of_halves([a, b, c, d]: [__m512d; 4]) -> [Eight; 4] {
    // SAFETY: only used in code for this instruction set.
    unsafe {
        let (ab_low, ab_high) = (_mm512_unpacklo_pd(a, b), _mm512_unpackhi_pd(a, b));
        let (cd_low, cd_high) = (_mm512_unpacklo_pd(c, d), _mm512_unpackhi_pd(c, d));
        [
            Eight(_mm512_shuffle_f64x2::<0x88>(ab_low, cd_low)),
            Eight(_mm512_shuffle_f64x2::<0x88>(ab_high, cd_high)),
            Eight(_mm512_shuffle_f64x2::<0xdd>(ab_low, cd_low)),
            Eight(_mm512_shuffle_f64x2::<0xdd>(ab_high, cd_high)),
        ]
    }
}

/// Three columns as pieces of two numbers: of the even lanes (x, y) and (z, 0), both for lanes 0 and 4, then both for lanes 2 and 6; and
/// the same of the odd lanes.
///
/// # Safety
/// Only in code for AVX-512.
#[inline(always)]
unsafe fn pairs_of_columns([x, y, z]: [Eight; 3]) -> [[__m512d; 2]; 2] {
    // SAFETY: only used in code for this instruction set.
    unsafe {
        let part = |xy, z| [_mm512_shuffle_f64x2::<0x88>(xy, z), _mm512_shuffle_f64x2::<0xdd>(xy, z)];
        [
            part(_mm512_unpacklo_pd(x.0, y.0), _mm512_maskz_mov_pd(0x55, z.0)),
            part(_mm512_unpackhi_pd(x.0, y.0), _mm512_maskz_unpackhi_pd(0x55, z.0, z.0)),
        ]
    }
}

/// Rows of eight, lane by lane, from the pieces of their first and their second three columns.
///
/// # Safety
/// Only in code for AVX-512.
#[inline(always)]
unsafe fn rows_of_pairs(first: &[[__m512d; 2]; 2], second: &[[__m512d; 2]; 2]) -> [__m512d; 8] {
    // SAFETY: only used in code for this instruction set.
    unsafe {
        let lane = |k: usize| (first[k % 2][k / 2 % 2], second[k % 2][k / 2 % 2]);
        let low = |k: usize| _mm512_shuffle_f64x2::<0x88>(lane(k).0, lane(k).1);
        let high = |k: usize| _mm512_shuffle_f64x2::<0xdd>(lane(k).0, lane(k).1);
        [low(0), low(1), low(2), low(3), high(0), high(1), high(2), high(3)]
    }
}

/// Rows and columns of an 8 x 8 matrix exchanged.
///
/// # Safety
/// Only in code for AVX-512.
#[inline(always)]
unsafe fn turned_eight(rows: [__m512d; 8]) -> [__m512d; 8] {
    // SAFETY: only used in code for this instruction set.
    unsafe {
        let low = |k: usize| _mm512_unpacklo_pd(rows[2 * k], rows[2 * k + 1]);
        let high = |k: usize| _mm512_unpackhi_pd(rows[2 * k], rows[2 * k + 1]);
        let (low, high) = ([low(0), low(1), low(2), low(3)], [high(0), high(1), high(2), high(3)]);
        let even = |list: &[__m512d; 4], k: usize| _mm512_shuffle_f64x2::<0x88>(list[2 * k], list[2 * k + 1]);
        let odd = |list: &[__m512d; 4], k: usize| _mm512_shuffle_f64x2::<0xdd>(list[2 * k], list[2 * k + 1]);
        let (a, b) = (even(&low, 0), even(&low, 1));
        let (c, d) = (odd(&low, 0), odd(&low, 1));
        let (e, f) = (even(&high, 0), even(&high, 1));
        let (g, h) = (odd(&high, 0), odd(&high, 1));
        [
            _mm512_shuffle_f64x2::<0x88>(a, b),
            _mm512_shuffle_f64x2::<0x88>(e, f),
            _mm512_shuffle_f64x2::<0x88>(c, d),
            _mm512_shuffle_f64x2::<0x88>(g, h),
            _mm512_shuffle_f64x2::<0xdd>(a, b),
            _mm512_shuffle_f64x2::<0xdd>(e, f),
            _mm512_shuffle_f64x2::<0xdd>(c, d),
            _mm512_shuffle_f64x2::<0xdd>(g, h),
        ]
    }
}
