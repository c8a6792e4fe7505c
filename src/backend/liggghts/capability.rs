//! Whether LIGGGHTS can compute a stage, from what decks can be rendered for.

use super::{deck, parameters};
use crate::plan::choose::{self, BackendVerdict, Capabilities, Requirement};
use crate::scene::Scene;
use crate::scene::gate::{PathMode, Replay};
use crate::stage::split::Recording;

/// All that LIGGGHTS cannot do of a stage, each with its reason and what to do.
#[must_use]
pub fn refusals<'a>(
    scene: &Scene,
    records: &[Recording],
    replays: impl IntoIterator<Item = &'a Replay>,
) -> Vec<String> {
    let mut found = deck::refusals(scene, records);
    found.extend(parameters::models(&scene.law, &scene.materials).err().unwrap_or_default());
    let mut lacks = |requirement: Requirement, asked: bool| {
        if asked {
            found.push(format!("LIGGGHTS lacks {}, or use the native solver", requirement.words()));
        }
    };
    lacks(Requirement::CompliantGhosts, replays.into_iter().any(|replay| replay.path == PathMode::Compliant));
    lacks(Requirement::Sleeping, scene.solver.sleeping.is_some());
    found
}

/// The verdict on a stage. Whether a binary is installed is asked when it is to run.
#[must_use]
pub fn verdict(scene: &Scene, records: &[Recording], replays: &[Replay]) -> BackendVerdict {
    let mut verdict = choose::verdict(scene, &Capabilities::liggghts());
    let yields = replays.iter().any(|replay| replay.path == PathMode::Compliant);
    if yields && !verdict.missing.contains(&Requirement::CompliantGhosts) {
        verdict.missing.push(Requirement::CompliantGhosts);
    }
    let of_stages = scene.stages.iter().flat_map(|stage| &stage.replays);
    verdict.reasons = refusals(scene, records, of_stages.chain(replays));
    verdict
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::gate::{BackingUp, Clock, Fate, StreamSource, Timing, Transform};
    use std::path::Path;

    const SCENE: &str = include_str!("../../../templates/scene.default.toml");

    fn on(settings: &[(&str, &str)]) -> BackendVerdict {
        let settings: Vec<(String, String)> =
            settings.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
        let (scene, _) = crate::scene::read_text(SCENE, "scene.toml", Path::new("."), &settings)
            .unwrap_or_else(|findings| panic!("{findings:?}"));
        verdict(&scene, &[], &[])
    }

    #[test]
    fn the_default_scene_can_although_it_asks_for_an_energy_budget() {
        let verdict = on(&[]);
        assert!(verdict.can() && verdict.reasons.is_empty(), "{verdict:?}");
    }

    #[test]
    fn what_is_lacking_is_named_with_advice() {
        let verdict = on(&[("contact.tangential", "\"incremental\""), ("pair.0.restitution", "0.04")]);
        let text = verdict.reasons.join("\n");
        assert!(!verdict.can() && verdict.missing == [Requirement::IncrementalTangentialLaw]);
        for part in ["use \"total\"", "between `glass` and `glass` it is 0.04"] {
            assert!(text.contains(part), "{part} is not in\n{text}");
        }
    }

    #[test]
    fn a_value_that_it_does_not_take_is_a_no_without_anything_missing() {
        let verdict = on(&[("pair.0.restitution", "0.04")]);
        assert!(!verdict.can() && verdict.missing.is_empty() && verdict.reasons.len() == 1, "{verdict:?}");
    }

    #[test]
    fn sleep_is_for_the_native_solver() {
        let verdict = on(&[("solver.sleeping", "{ speed = \"0.1 mm/s\", hold = \"20 ms\" }")]);
        assert_eq!(verdict.missing, [Requirement::Sleeping]);
        assert!(verdict.reasons.iter().any(|reason| reason.contains("remove solver.sleeping")), "{verdict:?}");
    }

    #[test]
    fn ghosts_that_yield_are_for_the_native_solver() {
        let (scene, _) = crate::scene::read_text(SCENE, "scene.toml", Path::new("."), &[]).expect("a valid scene");
        let replay = Replay {
            source: StreamSource::Gate(0),
            path: PathMode::Compliant,
            length: 0.006,
            clock: Clock::Plant,
            timing: Timing::Arrival,
            window: [0.0, f64::INFINITY],
            loops: 1,
            gap: 0.0,
            transform: Transform::IDENTITY,
            leaving: Fate::Keep,
            backing_up: BackingUp::Warn,
            compliance: 0.001,
        };
        let verdict = verdict(&scene, &[], &[replay]);
        assert_eq!(verdict.missing, [Requirement::CompliantGhosts]);
        assert!(verdict.reasons.iter().any(|reason| reason.contains("path = \"recorded\"")), "{verdict:?}");
    }
}
