//! `size-cut` (error): a distribution that is cut so far out that hardly anything is left.
//!
//! Where both cuts lie more than four deviations on the same side of the centre, fewer than one in 30 000 of the
//! distribution is left, all of it at one of the cuts: not what was meant.

use super::Subject;
use crate::particle::SizeDistribution;

const DEVIATIONS: f64 = 4.0;

pub(super) fn check(subject: &Subject<'_>) {
    for class in &subject.draft.classes {
        let Some(sizes) = class.item.as_ref().map(|class| &class.diameter) else { continue };
        let (kind, low, high) = match sizes {
            SizeDistribution::Normal { mean, deviation, minimum, maximum } => {
                ("normal", (minimum - mean) / deviation, (maximum - mean) / deviation)
            }
            SizeDistribution::Lognormal { median, geometric_deviation, minimum, maximum } => {
                let scale = geometric_deviation.ln();
                ("lognormal", (minimum / median).ln() / scale, (maximum / median).ln() / scale)
            }
            _ => continue,
        };
        if low > DEVIATIONS || high < -DEVIATIONS {
            subject.error(
                "size-cut",
                &format!("{}.diameter.{kind}", class.path),
                format!("`minimum` and `maximum` leave hardly anything of the {kind} distribution"),
                "move them to both sides of its centre",
            );
        }
    }
}
