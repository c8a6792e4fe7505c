//! Whether LIGGGHTS can compute a stage, from what decks can be rendered for.

use super::parameters;
use crate::plan::choose::{self, BackendVerdict, Capabilities, Requirement};
use crate::scene::Scene;
use crate::scene::gate::{PathMode, Replay};

/// The verdict on a stage that replays `replays`, or on a whole scene. That a binary is installed is asked when it is to run.
#[must_use]
pub fn verdict(scene: &Scene, replays: &[Replay]) -> BackendVerdict {
    let mut verdict = choose::verdict(scene, &Capabilities::liggghts());
    let yields = replays.iter().any(|replay| replay.path == PathMode::Compliant);
    if yields && !verdict.missing.contains(&Requirement::CompliantGhosts) {
        verdict.missing.push(Requirement::CompliantGhosts);
    }
    // Laws and materials say more of themselves: which pair, which value.
    let of_laws = [Requirement::MixedStiffness, Requirement::IncrementalTangentialLaw];
    let others = verdict.missing.iter().filter(|need| !of_laws.contains(need));
    verdict.reasons = others.map(|need| need.words().to_owned()).collect();
    verdict.reasons.extend(parameters::models(&scene.law, &scene.materials).err().unwrap_or_default());
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
        verdict(&scene, &[])
    }

    #[test]
    fn the_default_scene_can() {
        let verdict = on(&[]);
        assert!(verdict.can() && verdict.reasons.is_empty(), "{verdict:?}");
    }

    #[test]
    fn what_is_lacking_is_named_with_advice() {
        let verdict =
            on(&[("contact.tangential", "\"incremental\""), ("output.energy", "true"), ("pair.0.restitution", "0.04")]);
        let text = verdict.reasons.join("\n");
        assert!(
            !verdict.can() && verdict.missing == [Requirement::IncrementalTangentialLaw, Requirement::EnergyBudget]
        );
        for part in ["output.energy = false", "use \"total\"", "between `glass` and `glass` it is 0.04"] {
            assert!(text.contains(part), "{part} is not in\n{text}");
        }
    }

    #[test]
    fn a_value_that_it_does_not_take_is_a_no_without_anything_missing() {
        let verdict = on(&[("pair.0.restitution", "0.04")]);
        assert!(!verdict.can() && verdict.missing.is_empty() && verdict.reasons.len() == 1, "{verdict:?}");
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
        let verdict = verdict(&scene, &[replay]);
        assert_eq!(verdict.missing, [Requirement::CompliantGhosts]);
        assert!(verdict.reasons[0].contains("path = \"recorded\""));
    }
}
