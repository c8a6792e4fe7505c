//! Sums without rounding.

use serde::{Deserialize, Serialize};

/// A sum of numbers that is exact: two sums of the same numbers are equal in any order.
///
/// Kept as a list of numbers of growing size that do not overlap and whose sum is the exact one; each new number is passed through
/// it by two-sums, whose rounding error is a number itself. Source: Shewchuk (1997), grow-expansion. Valid for finite numbers
/// whose sum does not overflow.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ExactSum {
    parts: Vec<f64>,
}

impl ExactSum {
    /// Adds `number`.
    pub fn add(&mut self, number: f64) {
        let mut carried = number;
        let mut kept = 0;
        for index in 0..self.parts.len() {
            let part = self.parts[index];
            let sum = carried + part;
            // Two-sum (Knuth 1969): error = (a - (s - b')) + (b - b'), b' = s - a.
            let virtual_part = sum - carried;
            let error = (carried - (sum - virtual_part)) + (part - virtual_part);
            if error != 0.0 {
                self.parts[kept] = error;
                kept += 1;
            }
            carried = sum;
        }
        self.parts.truncate(kept);
        if carried != 0.0 {
            self.parts.push(carried);
        }
    }

    /// The sum, rounded to within its last bit.
    #[must_use]
    pub fn value(&self) -> f64 {
        self.parts.iter().sum()
    }

    /// True where the exact sums are the same.
    #[must_use]
    pub fn equals(&self, other: &Self) -> bool {
        let mut difference = self.clone();
        other.parts.iter().for_each(|part| difference.add(-part));
        difference.parts.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sum(numbers: &[f64]) -> ExactSum {
        let mut sum = ExactSum::default();
        numbers.iter().for_each(|number| sum.add(*number));
        sum
    }

    #[test]
    fn nothing_is_lost() {
        assert_eq!(sum(&[1e16, 1.0, -1e16]).value(), 1.0);
        assert_eq!(sum(&[0.1; 10]).value(), 1.0, "ten times the double 0.1 is nearer to 1 than its last bit");
        // Adding one after the other would find these equal.
        assert!(!sum(&[1.0, 1e-30]).equals(&sum(&[1.0])));
        assert!(sum(&[]).equals(&sum(&[1.0, -1.0])));
    }

    proptest! {
        #[test]
        fn the_order_does_not_matter_and_one_bit_does(
            mut numbers in prop::collection::vec(-1e9_f64..1e9, 1..40), scale in -200_i32..200, seed in any::<usize>()
        ) {
            for (index, number) in numbers.iter_mut().enumerate() {
                *number *= 2.0_f64.powi(scale * (index as i32 % 3 - 1));
            }
            let before = sum(&numbers);
            let length = numbers.len();
            numbers.rotate_left(seed % length);
            numbers.reverse();
            prop_assert!(sum(&numbers).equals(&before));
            let one = &mut numbers[seed % length];
            *one = f64::from_bits(one.to_bits() ^ 1);
            prop_assert!(!sum(&numbers).equals(&before));
        }
    }
}
