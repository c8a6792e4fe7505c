//! `size-order` (error): sizes ascend: `minimum` below `maximum`, each sieve above the one before.

use super::Subject;
use crate::particle::SizeDistribution;

pub(super) fn check(subject: &Subject<'_>) {
    for class in &subject.draft.classes {
        let Some(sizes) = class.item.as_ref().map(|class| &class.diameter) else { continue };
        let (key, ordered) = match sizes {
            SizeDistribution::Fixed { .. } => continue,
            SizeDistribution::Uniform { minimum, maximum } => ("uniform", minimum < maximum),
            SizeDistribution::Normal { minimum, maximum, .. } => ("normal.maximum", minimum < maximum),
            SizeDistribution::Lognormal { minimum, maximum, .. } => ("lognormal.maximum", minimum < maximum),
            SizeDistribution::Sieve { sieves, .. } => ("sieve.sizes", sieves.windows(2).all(|pair| pair[0] < pair[1])),
        };
        if !ordered {
            subject.error(
                "size-order",
                &format!("{}.diameter.{key}", class.path),
                "the sizes must ascend, from the smallest to the largest".to_owned(),
                "put them in order; for one size write `diameter = \"4 mm\"`",
            );
        }
    }
}
