//! The verdict on a difference: agrees, differs, or not enough runs to say.

use crate::analysis::statistics::two_samples::{Scatter, values_needed};
use serde::{Deserialize, Serialize};

/// What the runs say about a difference, from best to worst.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The whole 95 % interval lies within the margin: the difference is too small to matter.
    Agrees,
    /// The interval reaches over the margin: more runs would tell.
    Inconclusive,
    /// The whole interval lies beyond the margin: the difference matters.
    Differs,
}

impl Verdict {
    /// In one word.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::Agrees => "agrees",
            Self::Inconclusive => "inconclusive",
            Self::Differs => "differs",
        }
    }
}

/// A verdict with what it rests on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Judged {
    pub interval: Option<[f64; 2]>,
    pub verdict: Verdict,
    pub runs_needed: Option<u64>,
}

/// Judges a difference by its scatter against a margin. Without scatter, difference or margin nothing can be said.
pub(super) fn judge(difference: Option<f64>, scatter: Option<Scatter>, margin: f64) -> Judged {
    let (Some(difference), Some(scatter)) = (difference, scatter) else {
        return Judged { interval: None, verdict: Verdict::Inconclusive, runs_needed: None };
    };
    let half = scatter.half_width();
    let interval = [difference - half, difference + half];
    let verdict = verdict_of(interval, margin);
    let undecided = verdict == Verdict::Inconclusive && margin.is_finite();
    let runs_needed = undecided.then(|| values_needed(scatter.variances, (difference.abs() - margin).abs())).flatten();
    Judged { interval: Some(interval), verdict, runs_needed }
}

/// The verdict of an interval: within the margin, wholly beyond it on one side, or neither.
pub(super) fn verdict_of([low, high]: [f64; 2], margin: f64) -> Verdict {
    if low >= -margin && high <= margin {
        Verdict::Agrees
    } else if low > margin || high < -margin {
        Verdict::Differs
    } else {
        Verdict::Inconclusive
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::statistics::two_samples::difference_of_means;

    #[test]
    fn an_interval_is_within_beyond_or_over_the_margin() {
        assert_eq!(verdict_of([-0.9, 1.0], 1.0), Verdict::Agrees);
        assert_eq!(verdict_of([0.5, 0.9], 1.0), Verdict::Agrees, "different from zero, and not by enough to matter");
        assert_eq!(verdict_of([1.1, 3.0], 1.0), Verdict::Differs);
        assert_eq!(verdict_of([-3.0, -1.1], 1.0), Verdict::Differs);
        assert_eq!(verdict_of([0.5, 1.1], 1.0), Verdict::Inconclusive);
        assert_eq!(verdict_of([-3.0, 3.0], 1.0), Verdict::Inconclusive);
        assert_eq!(verdict_of([0.0, 0.0], 0.0), Verdict::Agrees, "nothing scatters, nothing differs");
        assert_eq!(verdict_of([0.0, 0.1], f64::NAN), Verdict::Inconclusive);
    }

    #[test]
    fn the_worst_verdict_is_the_largest() {
        assert!(Verdict::Differs > Verdict::Inconclusive && Verdict::Inconclusive > Verdict::Agrees);
    }

    #[test]
    fn the_runs_needed_would_decide() {
        let (difference, scatter) = difference_of_means(&[1.0, 2.0, 3.0], &[1.1, 1.9, 3.3]).unwrap();
        let judged = judge(Some(difference), scatter, 0.3);
        assert_eq!(judged.verdict, Verdict::Inconclusive);
        let needed = judged.runs_needed.unwrap();
        assert!(needed > 3);
        // As many runs of the same scatter: s^2 = (1 + 1.24) / n.
        let values = crate::analysis::statistics::two_samples::welch_scatter(
            scatter.unwrap().variances.map(Some),
            [needed as usize; 2],
        );
        assert_eq!(judge(Some(difference), values, 0.3).verdict, Verdict::Agrees);
        assert_eq!(judge(Some(1.0), None, 0.3).verdict, Verdict::Inconclusive);
    }
}
