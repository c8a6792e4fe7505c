//! What a stream says about the place of its cut: plane, exclusion length L1, generation length L2.
//!
//! The thresholds are those of one measured geometry, a conical hopper over a chute, cut at planes from 15 mm inside to
//! 20 mm under the outlet: planes whose crossings had a contact in 30 % of cases agreed with the whole run in every pair of
//! modes, in 60 % of cases with an undisturbed exclusion zone and recorded paths, in up to 80 % with isolated squeezes.

use super::format::Manifest;
use crate::gate::HAND_OVER_STEPS;
use serde::Serialize;

/// Share of crossings in contact up to which every pair of modes agreed with the whole run [-].
pub const FREE_SHARE: f64 = 0.3;
/// Share up to which recorded paths behind an undisturbed exclusion zone did [-].
pub const RECORDED_SHARE: f64 = 0.6;
/// Share up to which they did with isolated squeezes [-].
pub const SQUEEZED_SHARE: f64 = 0.8;
/// Exclusion length of a free jet over the largest diameter [-] (patent JP5440448B2: at least one).
const FREE_EXCLUSION: f64 = 1.2;

/// How good a place for a cut the plane is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Place {
    /// Free: any pair of modes will do.
    Free,
    /// Dense: recorded paths and the exclusion mode `buffer` will do.
    Dense,
    /// Very dense: as before, with isolated squeezes.
    Squeezed,
    /// Too dense: move the plane.
    TooDense,
    /// Nothing crossed, or contacts were not recorded.
    Unknown,
}

/// What follows from a stream for its cut.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Advice {
    /// How good a place the plane is.
    pub place: Place,
    /// The least exclusion length L1 [m]; `None` where the stream does not tell.
    pub exclusion_length_m: Option<f64>,
    /// L1 of the recording [m].
    pub recorded_exclusion_length_m: Option<f64>,
    /// The least generation length L2 [m]: the largest diameter, and the way between two looks at the gate.
    pub generation_length_m: f64,
    /// Length of the stored paths [m].
    pub recorded_path_length_m: Option<f64>,
    /// Time steps between two stored states of a path.
    pub recorded_path_interval: Option<u64>,
}

/// One row of the stored profile behind the plane.
#[derive(serde::Deserialize)]
struct Profile {
    distance_m: f64,
    contact_share: f64,
}

pub(super) fn advise(manifest: &Manifest, contact_share: Option<f64>, largest: f64, fastest: f64) -> Advice {
    let origin = &manifest.origin;
    let place = match contact_share {
        None => Place::Unknown,
        Some(share) if share <= FREE_SHARE => Place::Free,
        Some(share) if share <= RECORDED_SHARE => Place::Dense,
        Some(share) if share <= SQUEEZED_SHARE => Place::Squeezed,
        Some(_) => Place::TooDense,
    };
    let profile: Option<Vec<Profile>> =
        manifest.quality.get("free_flow").cloned().and_then(|rows| serde_json::from_value(rows).ok());
    let free_from = profile.as_deref().and_then(free_from);
    let exclusion_length_m = match place {
        Place::Free => Some(FREE_EXCLUSION * largest),
        _ => free_from.map(|distance| distance + largest),
    };
    Advice {
        place,
        exclusion_length_m,
        recorded_exclusion_length_m: origin.exclusion.map(|exclusion| exclusion.length),
        generation_length_m: largest + fastest * origin.timestep * HAND_OVER_STEPS as f64,
        recorded_path_length_m: origin.paths.map(|paths| paths.length),
        recorded_path_interval: origin.paths.map(|paths| paths.every),
    }
}

/// The smallest distance from which on the flow behind the plane stays free [m].
fn free_from(profile: &[Profile]) -> Option<f64> {
    let mut rows: Vec<(f64, f64)> = profile.iter().map(|row| (row.distance_m, row.contact_share)).collect();
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let last_dense = rows.iter().rposition(|(_, share)| *share > FREE_SHARE);
    rows.get(last_dense.map_or(0, |index| index + 1)).map(|(distance, _)| *distance)
}

impl Advice {
    /// The advice, each with what it is about.
    pub(super) fn lines(&self) -> Vec<(&'static str, String)> {
        let place = match self.place {
            Place::Free => "the flow is free here: every path mode and exclusion mode is fine",
            Place::Dense => "dense: replay recorded paths, and let the upstream run on in mode buffer",
            Place::Squeezed => {
                "very dense: recorded paths and mode buffer are right but for isolated squeezes; better move the \
                                plane to where the flow is freer"
            }
            Place::TooDense => "too dense for a cut that can be trusted: move the plane to where the flow is freer",
            Place::Unknown => "contacts are not known: record with the native solver to have the plane judged",
        };
        let mut lines = vec![("advice: plane", place.to_owned())];
        let millimetres = |length: f64| format!("{:.3} mm", 1e3 * length);
        let compared = |recorded: Option<f64>, least: f64| match recorded {
            Some(length) if length < least => format!(", recorded with {}: too short", millimetres(length)),
            Some(length) => format!(", recorded with {}: long enough", millimetres(length)),
            None => String::new(),
        };
        let exclusion = self.exclusion_length_m.map_or_else(
            || {
                "not known: the flow behind the plane was not seen to become free; record with a longer L1 in mode buffer"
                    .to_owned()
            },
            |least| {
                format!("at least {}{}", millimetres(least), compared(self.recorded_exclusion_length_m, least))
            },
        );
        lines.push(("advice: L1", exclusion));
        let least = self.generation_length_m;
        let paths = compared(self.recorded_path_length_m, least);
        let paths = if paths.is_empty() { "; no paths are stored".to_owned() } else { paths };
        lines.push(("advice: L2", format!("at least {}{paths}", millimetres(least))));
        let is_dense = matches!(self.place, Place::Dense | Place::Squeezed | Place::TooDense);
        if let Some(every) = self.recorded_path_interval.filter(|every| is_dense && *every > 1) {
            let advice = format!(
                "stored every {every} time steps: where particles touch, store every one (paths.every = 1); else contacts are \
                 interpolated, and residents are pushed off their way"
            );
            lines.push(("advice: paths", advice));
        }
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::super::sample;
    use super::*;

    fn advice(share: f64, profile: serde_json::Value) -> Advice {
        let mut manifest = Manifest::new(sample::origin());
        manifest.quality = serde_json::json!({ "free_flow": profile });
        advise(&manifest, Some(share), 0.005, 0.5)
    }

    #[test]
    fn the_place_is_judged_by_the_share_in_contact() {
        let place = |share| advice(share, serde_json::Value::Null).place;
        let cases = [
            (0.3, Place::Free),
            (0.31, Place::Dense),
            (0.6, Place::Dense),
            (0.7, Place::Squeezed),
            (0.81, Place::TooDense),
        ];
        cases.iter().for_each(|&(share, expected)| assert_eq!(place(share), expected));
    }

    #[test]
    fn the_exclusion_plane_lies_where_the_flow_stays_free() {
        let row = |distance: f64, share: f64| serde_json::json!({ "distance_m": distance, "contact_share": share });
        let profile =
            serde_json::json!([row(0.0, 0.6), row(0.004, 0.25), row(0.008, 0.4), row(0.012, 0.3), row(0.016, 0.1)]);
        // Free at 4 mm, dense again at 8 mm: it stays free from 12 mm on; one largest diameter more.
        let found = advice(0.6, profile);
        assert_eq!(found.exclusion_length_m, Some(0.012 + 0.005));
        let text: Vec<String> = found.lines().into_iter().map(|(_, text)| text).collect();
        assert!(text[1].contains("at least 17.000 mm, recorded with 20.000 mm: long enough"), "{text:?}");
        let never = advice(0.6, serde_json::json!([row(0.0, 0.6), row(0.02, 0.5)]));
        assert_eq!(never.exclusion_length_m, None);
        assert!(never.lines()[1].1.contains("longer L1"));
        assert_eq!(advice(0.1, serde_json::Value::Null).exclusion_length_m, Some(1.2 * 0.005));
    }

    #[test]
    fn the_generation_zone_holds_a_particle_and_its_way_between_two_looks() {
        let found = advice(0.6, serde_json::Value::Null);
        let way = 0.5 * sample::TIMESTEP * HAND_OVER_STEPS as f64;
        assert_eq!(found.generation_length_m, 0.005 + way);
        assert!(found.lines()[2].1.contains("recorded with 6.000 mm: long enough"), "{:?}", found.lines());
    }
}
