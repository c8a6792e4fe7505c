//! Eight lanes: AVX-512.

use super::{Four, rows_of};
use crate::math::lanes::{Lanes, Mask, place};
use std::arch::x86_64::*;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Not, Sub};

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

/// Eight lanes: AVX-512.
#[derive(Debug, Clone, Copy)]
pub struct Eight(__m512d);
operators!(Eight, __m512d, _mm512_add_pd, _mm512_sub_pd, _mm512_mul_pd, _mm512_div_pd, _mm512_xor_pd, _mm512_set1_pd);

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
    fn pack(numbers: &[u32], bits: u16, list: &mut [u32]) -> usize {
        let (numbers, list) = (&numbers[..8], &mut list[..8]);
        // SAFETY: both lists are long enough, and this is only used in code for this instruction set.
        unsafe {
            // Not by a store that packs: some processors take long over that.
            let packed = _mm256_maskz_compress_epi32(bits as u8, _mm256_loadu_si256(numbers.as_ptr().cast()));
            _mm256_storeu_si256(list.as_mut_ptr().cast(), packed);
        }
        (bits as u8).count_ones() as usize
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
