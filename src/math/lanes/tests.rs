//! Every level against plain f64, bit by bit.

use super::*;

/// Numbers of every kind, not-a-number and infinity among them.
fn numbers(count: usize, salt: u64) -> Vec<f64> {
    let special = [0.0, -0.0, 1.0, -1.5, f64::NAN, f64::INFINITY, f64::MIN_POSITIVE, 1e-310];
    let mut state = salt.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    (0..count)
        .map(|k| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            if k % 7 == 0 {
                special[k / 7 % special.len()]
            } else {
                ((state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5) * 8.0
            }
        })
        .collect()
}

fn bits(list: &[f64]) -> Vec<u64> {
    // Which not-a-number comes out is not defined.
    list.iter().map(|x| if x.is_nan() { u64::MAX } else { x.to_bits() }).collect()
}

struct Arithmetic<'a>(&'a [f64], &'a [f64]);

impl LaneWork for Arithmetic<'_> {
    type Output = Vec<f64>;
    #[inline(always)]
    fn run<L: Lanes>(self) -> Vec<f64> {
        let mut results = vec![0.0; 14 * self.0.len()];
        for k in (0..self.0.len()).step_by(L::COUNT) {
            let (a, b) = (L::from_slice(&self.0[k..]), L::from_slice(&self.1[k..]));
            let (more, less) = (a.exceeds(b), a.below(b));
            let columns = [
                a + b,
                a - b,
                a * b,
                a / b,
                -a,
                a.mul_add(b, a),
                b.mul_from(a, b),
                a.sqrt(),
                a.abs(),
                a.larger(b),
                a.smaller(b),
                L::select(more | less, a, b),
                L::select(!more & !less, a, b),
                L::select(L::Mask::from_bits(more.bits()), a, L::splat(3.0)),
            ];
            for (n, column) in columns.into_iter().enumerate() {
                column.write_to(&mut results[n * self.0.len() + k..]);
            }
        }
        results
    }
}

#[test]
fn arithmetic_has_the_same_bits_at_every_level() {
    let (a, b) = (numbers(4096, 1), numbers(4096, 2));
    let reference = bits(&at_level(SimdLevel::Scalar, Arithmetic(&a, &b)));
    for level in SimdLevel::ALL.into_iter().filter(|level| level.is_available()) {
        assert!(bits(&at_level(level, Arithmetic(&a, &b))) == reference, "{}", level.name());
    }
}

struct Rows<'a> {
    four: &'a [[f64; 4]],
    eight: &'a [[f64; 8]],
    index: &'a [u32],
}

impl LaneWork for Rows<'_> {
    type Output = (Vec<f64>, [Vec<[f64; 8]>; 2]);
    #[inline(always)]
    fn run<L: Lanes>(self) -> Self::Output {
        let mut columns = vec![0.0; 15 * self.index.len()];
        let mut sums = [vec![[0.0; 8]; self.eight.len()], vec![[0.0; 8]; self.eight.len()]];
        for k in (0..self.index.len()).step_by(L::COUNT) {
            let index = &self.index[k..k + L::COUNT];
            // SAFETY: the indices lie within the lists.
            let (four, eight) =
                unsafe { (L::gather_four(self.four.as_ptr(), index), L::gather_eight(self.eight.as_ptr(), index)) };
            // Every other row also gets the columns of the row before, within the same lane.
            let others: Vec<u32> = index.iter().map(|row| (row + 1) % 50).collect();
            // SAFETY: the indices lie within the list.
            let differences = unsafe {
                let ([a, b, c, d], [e, f, g, h, ..]) = (four, eight);
                L::add_to_rows(sums[0].as_mut_ptr(), [index, &others], [eight, eight]);
                L::add_action(sums[1].as_mut_ptr(), [index, &others], [a, b, c], [[d, e, f], [g, h, a]]);
                L::gather_differences(self.eight.as_ptr(), index, &others)
            };
            for (n, column) in four.into_iter().chain(eight).chain(differences).enumerate() {
                column.write_to(&mut columns[n * self.index.len() + k..]);
            }
        }
        (columns, sums)
    }
}

#[test]
fn rows_are_gathered_and_added_to_in_order_at_every_level() {
    let four: Vec<[f64; 4]> = numbers(4 * 50, 3).as_chunks::<4>().0.to_vec();
    let eight: Vec<[f64; 8]> = numbers(8 * 50, 4).as_chunks::<8>().0.to_vec();
    // Repeated within a block: sums depend on the order.
    let index: Vec<u32> = (0..800).map(|k| k * k % 50).collect();
    let work = || Rows { four: &four, eight: &eight, index: &index };
    let reference = at_level(SimdLevel::Scalar, work());
    for (k, &row) in index.iter().enumerate() {
        assert_eq!(reference.0[800 + k].to_bits(), four[row as usize][1].to_bits());
    }
    for level in SimdLevel::ALL.into_iter().filter(|level| level.is_available()) {
        let found = at_level(level, work());
        assert!(bits(&found.0) == bits(&reference.0), "columns, {}", level.name());
        for (found, reference) in found.1.iter().zip(&reference.1) {
            assert!(bits(found.as_flattened()) == bits(reference.as_flattened()), "sums, {}", level.name());
        }
    }
}

struct Packed<'a>(&'a [u32], &'a [u16]);

impl LaneWork for Packed<'_> {
    type Output = Vec<u32>;
    #[inline(always)]
    fn run<L: Lanes>(self) -> Vec<u32> {
        let (mut list, mut count) = (vec![0; self.0.len()], 0);
        for from in (0..self.0.len()).step_by(L::COUNT) {
            let bits = self.1[from / MOST_LANES] >> (from % MOST_LANES);
            count += L::pack(&self.0[from..], bits, &mut list[count..]);
        }
        list.truncate(count);
        list
    }
}

#[test]
fn numbers_whose_bit_is_set_are_packed_at_every_level() {
    // Every set of sixteen bits once.
    let bits: Vec<u16> = (0..=u16::MAX).collect();
    let numbers: Vec<u32> = (0..16 << 16).map(|k: u32| k.wrapping_mul(2_654_435_761)).collect();
    let is_set = |&k: &usize| bits[k / 16] >> (k % 16) & 1 == 1;
    let expected: Vec<u32> = (0..numbers.len()).filter(is_set).map(|k| numbers[k]).collect();
    for level in SimdLevel::ALL.into_iter().filter(|level| level.is_available()) {
        assert!(at_level(level, Packed(&numbers, &bits)) == expected, "{}", level.name());
    }
}

#[test]
fn the_best_level_is_available() {
    assert!(SimdLevel::best().is_available());
    assert!(SimdLevel::Scalar.is_available());
}
