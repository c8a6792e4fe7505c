//! What the figures of a cut mean, in words.
//!
//! The thresholds were measured on a conical hopper of 2 835 spheres that empties onto a chute, cut at planes from the free jet
//! to 15 mm (nearly 4 diameters) inside of the outlet, each against whole runs:
//!
//! | in contact at the gate | ghosts on straight or falling paths | recorded paths, buffer |
//! |---|---|---|
//! | up to 0.3 | agree with the whole run | agree |
//! | 0.47 | discharge rate wrong by 28 % | agree |
//! | 0.60 | lost particles and ejections | agree |
//! | 0.74 | the same | isolated squeezes |
//! | 0.85 | rate wrong by 5 to 80 % | rate up to 4 % high in one of two runs |
//!
//! With a share of slow particles of 0.0007 a ballistic replay was right, at 0.19 it lost 9 of 2 784, at 0.63 it lost 61.
//! Overlaps between ghosts and residents up to 0.15 of the radius are those of the whole run; from 0.25 on there were squeezes, from
//! 0.5 on ejections.

use super::{CrossingFigures, OverlapFigures};
use crate::gate::record::RecordTally;
use crate::scene::gate::{ExclusionMode, PathMode};
use serde::{Deserialize, Serialize};

/// How far a cut can be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Grade {
    /// As the whole run, where it was measured.
    Good,
    /// Right on the whole, with faults of single particles.
    Doubtful,
    /// Wrong by figures that matter.
    Bad,
}

/// Quality of a cut.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quality {
    /// The worst of what was found.
    pub grade: Grade,
    /// Crossings.
    pub crossings: CrossingFigures,
    /// Returns over the plane per crossing \[-\].
    pub back_flow_share: f64,
    /// Contacts of ghosts with residents; `None` where nobody looked.
    pub overlaps: Option<OverlapFigures>,
    /// Share of the looks with such contacts at which one was deeper than a tenth of the radius \[-\].
    pub deep_share: Option<f64>,
    /// What should be known, with the figures.
    pub warnings: Vec<String>,
}

/// A figure is doubtful above the first, bad above the second.
type Limits = (f64, f64);

const CONTACT_OF_STRAIGHT: Limits = (0.3, 0.5);
const CONTACT_OF_RECORDED: Limits = (0.6, 0.8);
const SLOW: Limits = (0.05, 0.5);
const OVERLAP: Limits = (0.25, 0.5);
const BACK_FLOW: Limits = (0.01, 0.1);

/// Judges a cut by the figures of its stream, of its recorder, and of the ghosts' contacts in the stage that replays it.
#[must_use]
pub fn judge(
    crossings: CrossingFigures,
    recorded: &RecordTally,
    overlaps: Option<OverlapFigures>,
    exclusion: ExclusionMode,
    path: PathMode,
) -> Quality {
    let back_flow_share = recorded.returned as f64 / recorded.recorded.max(1) as f64;
    let mut found = Vec::new();
    let follows_record = matches!(path, PathMode::Recorded | PathMode::Compliant);
    judge_contacts(&crossings, exclusion, follows_record, &mut found);
    let slow = crossings.slow_share;
    if let Some(grade) = above(slow, SLOW)
        && !follows_record
    {
        let text = format!(
            "{} of the crossings are slower than {:.3} m/s, the speed gained by falling through the generation zone: their \
             straight or falling paths are not the ones they took; use path \"recorded\"",
            percent(slow),
            crossings.slow_speed_m_s,
        );
        found.push((grade, text));
    }
    if let Some(overlaps) = &overlaps
        && let Some(grade) = above(overlaps.largest_share, OVERLAP)
    {
        let [x, y, z] = overlaps.place_m;
        let text = format!(
            "a ghost was driven {} of the radius into a resident at {:.6} s, at ({x:.6}, {y:.6}, {z:.6}) m; {} of the looks with \
             such contacts had one deeper than {}; use path \"recorded\" with more stored states or \"compliant\", or move the \
             gate to where the flow is freer",
            percent(overlaps.largest_share),
            overlaps.time_s,
            percent(overlaps.deep_share()),
            percent(super::DEEP_OVERLAP),
        );
        found.push((grade, text));
    }
    if let Some(grade) = above(back_flow_share, BACK_FLOW) {
        let text = format!(
            "{} returns over the plane on {} crossings ({}), up to {:.3} mm back: what comes back is not in the stage beyond; move \
             the gate to where nothing comes back",
            recorded.returned,
            recorded.recorded,
            percent(back_flow_share),
            1e3 * recorded.returned_farthest_m,
        );
        found.push((grade, text));
    }
    Quality {
        grade: found.iter().map(|(grade, _)| *grade).max().unwrap_or(Grade::Good),
        crossings,
        back_flow_share,
        overlaps,
        deep_share: overlaps.as_ref().map(OverlapFigures::deep_share),
        warnings: found.into_iter().map(|(_, text)| text).collect(),
    }
}

/// The slow dense gate: particles that touch each other where ghosts do not yield.
fn judge_contacts(
    crossings: &CrossingFigures,
    exclusion: ExclusionMode,
    follows_record: bool,
    found: &mut Vec<(Grade, String)>,
) {
    let share = crossings.contact_share;
    let density = format!(
        "{} of the crossings are in contact, at a mean normal speed of {:.3} m/s ({:.1} sqrt(g d))",
        percent(share),
        crossings.mean_normal_speed_m_s,
        crossings.speed_over_sqrt_gd,
    );
    if let (Some(grade), true) = (above(share, CONTACT_OF_STRAIGHT), exclusion != ExclusionMode::Buffer) {
        let text = format!(
            "{density}: ghosts behind the plane do not yield and brake the discharge (28 % too slow was measured at 47 %, 80 % \
             at 84 %); use exclusion \"buffer\", or move the gate to where the flow is free"
        );
        found.push((grade, text));
    }
    if let (Some(grade), false) = (above(share, CONTACT_OF_STRAIGHT), follows_record) {
        let text = format!(
            "{density}: straight or falling paths before the plane overlap with each other and with residents (lost particles and \
             ejections were measured at 60 %); use path \"recorded\", or move the gate to where the flow is free"
        );
        found.push((grade, text));
    }
    if let (Some(grade), true) = (above(share, CONTACT_OF_RECORDED), follows_record) {
        let text = format!(
            "{density}: recorded ghosts do not yield to residents that have drifted (isolated squeezes were measured at 74 %, a \
             discharge up to 4 % too fast at 85 %); use path \"compliant\", or move the gate to where the flow is freer"
        );
        found.push((grade, text));
    }
}

fn above(figure: f64, (doubtful, bad): Limits) -> Option<Grade> {
    if figure > bad {
        Some(Grade::Bad)
    } else if figure > doubtful {
        Some(Grade::Doubtful)
    } else {
        None
    }
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quality(contact: f64, slow: f64, exclusion: ExclusionMode, path: PathMode) -> Quality {
        let crossings = CrossingFigures {
            crossings: 1000,
            contact_share: contact,
            slow_share: slow,
            slow_speed_m_s: 0.343,
            mean_normal_speed_m_s: 0.4,
            speed_over_sqrt_gd: 2.0,
            largest_overlap_share: 0.02,
        };
        let recorded = RecordTally { recorded: 1000, ..RecordTally::default() };
        judge(crossings, &recorded, None, exclusion, path)
    }

    #[test]
    fn the_measured_cuts_have_the_grades_that_they_earned() {
        use ExclusionMode::{Ballistic, Buffer, Constant};
        // (in contact, slow, modes, grade): the planes in the jet, 2 mm under, and 3, 7.5, 15 mm inside of the outlet.
        let cases = [
            (0.10, 0.0007, Constant, PathMode::Constant, Grade::Good),
            (0.16, 0.0007, Ballistic, PathMode::Ballistic, Grade::Good),
            (0.47, 0.19, Constant, PathMode::Constant, Grade::Doubtful),
            (0.84, 0.63, Constant, PathMode::Constant, Grade::Bad),
            (0.20, 0.19, Buffer, PathMode::Recorded, Grade::Good),
            (0.60, 0.63, Buffer, PathMode::Recorded, Grade::Good),
            (0.60, 0.63, Buffer, PathMode::Ballistic, Grade::Bad),
            (0.74, 0.7, Buffer, PathMode::Recorded, Grade::Doubtful),
            (0.85, 0.8, Buffer, PathMode::Recorded, Grade::Bad),
            (0.60, 0.63, Constant, PathMode::Recorded, Grade::Bad),
        ];
        for (contact, slow, exclusion, path, grade) in cases {
            let quality = quality(contact, slow, exclusion, path);
            assert_eq!(quality.grade, grade, "{contact} {exclusion:?} {path:?}: {:?}", quality.warnings);
            assert_eq!(quality.warnings.is_empty(), grade == Grade::Good);
        }
    }

    #[test]
    fn warnings_carry_their_figures() {
        let dense = quality(0.84, 0.63, ExclusionMode::Constant, PathMode::Constant);
        assert_eq!(dense.warnings.len(), 3);
        assert!(
            dense.warnings[0]
                .starts_with("84.0 % of the crossings are in contact, at a mean normal speed of 0.400 m/s")
        );
        assert!(dense.warnings[2].starts_with("63.0 % of the crossings are slower than 0.343 m/s"));
        let recorded =
            RecordTally { recorded: 200, returned: 5, returned_farthest_m: 0.0012, ..RecordTally::default() };
        let overlaps = Some(OverlapFigures {
            looks: 40,
            deep_looks: 10,
            largest_m: 0.0012,
            largest_share: 0.6,
            place_m: [0.1, 0.2, 0.3],
            time_s: 1.5,
        });
        let free = CrossingFigures::default();
        let quality = judge(free, &recorded, overlaps, ExclusionMode::Buffer, PathMode::Recorded);
        assert_eq!((quality.grade, quality.back_flow_share, quality.deep_share), (Grade::Bad, 0.025, Some(0.25)));
        assert!(quality.warnings[0].contains("60.0 % of the radius into a resident at 1.500000 s, at (0.100000"));
        assert!(
            quality.warnings[1].starts_with("5 returns over the plane on 200 crossings (2.5 %), up to 1.200 mm back")
        );
    }
}
