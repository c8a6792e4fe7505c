//! Sieve gradings.
//!
//! - `sieve-count` (error): between n + 1 sieve sizes lie n fractions.
//! - `sieve-sum` (error): the fractions are shares of one whole.

use super::{Subject, round};
use crate::particle::SizeDistribution;

/// Fractions as printed in data sheets are rounded; their sum may be off by this much.
const SUM_TOLERANCE: f64 = 1e-6;

pub(super) fn check(subject: &Subject<'_>) {
    for class in &subject.draft.classes {
        let Some(SizeDistribution::Sieve { sieves, fractions, .. }) = class.item.as_ref().map(|class| &class.diameter)
        else {
            continue;
        };
        let path = format!("{}.diameter.sieve.fractions", class.path);
        if sieves.len() != fractions.len() + 1 || fractions.is_empty() {
            let what =
                format!("{} sizes need one fraction less than that, and there are {}", sieves.len(), fractions.len());
            subject.error("sieve-count", &path, what, "give each class between two sizes its fraction");
            continue;
        }
        let sum: f64 = fractions.iter().sum();
        if (sum - 1.0).abs() > SUM_TOLERANCE {
            let what = format!("the fractions add up to {}, not to 1", round(sum));
            subject.error("sieve-sum", &path, what, "correct them; \"25 %\" and 0.25 mean the same");
        }
    }
}
