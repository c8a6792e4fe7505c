//! Splitting small plants by hand.

use super::*;
use crate::geometry::part::AtRest;
use crate::scene::gate::{ExclusionMode, PathMode, Transform};
use crate::scene::read_text;
use std::path::Path;

/// Feed over a hopper, gate under it, a second gate lower down, a box, and a side wall that is a plane.
const SERIES: &str = r#"
version = 1
[contact]
law = "hertz-mindlin"
[material.ore]
density = "3000 kg/m3"
youngs_modulus = "50 MPa"
poissons_ratio = 0.25
[[pair]]
between = ["ore", "ore"]
restitution = 0.5
friction = 0.5
[particle.ore]
material = "ore"
diameter = "5 mm"
[[feed]]
name = "low"
kind = "fill"
particle = "ore"
region = { shape = "box", min_mm = [-20, -20, 120], max_mm = [20, 20, 140] }
amount = 5
[[feed]]
name = "top"
kind = "fill"
particle = "ore"
region = { shape = "box", min_mm = [-20, -20, 620], max_mm = [20, 20, 690] }
amount = 5
[[part]]
name = "hopper"
material = "ore"
shape = "cone"
start_mm = [0, 0, 600]
end_mm = [0, 0, 700]
start_radius = "50 mm"
end_radius = "80 mm"
[[part]]
name = "flap"
material = "ore"
shape = "box"
min_mm = [-60, -60, 590]
max_mm = [60, 60, 598]
disappears = { at_rest = { speed = "1 mm/s", hold = "10 ms" } }
[[part]]
name = "sieve"
material = "ore"
shape = "box"
min_mm = [50, -50, 400]
max_mm = [60, 50, 410]
[[part]]
name = "box"
material = "ore"
shape = "box"
min_mm = [-50, -50, 0]
max_mm = [50, 50, 100]
[[part]]
name = "side"
material = "ore"
shape = "plane"
point_mm = [0, 90, 0]
normal = [0, -1, 0]
[[gate]]
name = "outlet"
point_mm = [0, 0, 595]
normal = [0, 0, -1]
[[gate]]
name = "lower"
point_mm = [0, 0, 300]
normal = [0, 0, -1]
exclusion = { mode = "constant", length_mm = 8 }
paths = "none"
[end]
time = "2 s"
[[measure]]
name = "centre"
kind = "centre-of-mass"
"#;

fn scene_of(text: &str) -> Scene {
    match read_text(text, "series.toml", Path::new("tests/scenes/good"), &[]) {
        Ok((scene, _)) => scene,
        Err(findings) => panic!("{findings:#?}"),
    }
}

fn parts_of(job: &StageJob) -> Vec<&str> {
    job.scene.parts.iter().map(|part| part.name.as_str()).collect()
}

#[test]
fn gates_in_series_imply_their_stages() {
    let scene = scene_of(SERIES);
    let jobs = stage_jobs(&scene);
    let names: Vec<&str> = jobs.iter().map(|job| job.name.as_str()).collect();
    assert_eq!(names, ["before-outlet", "outlet-to-lower", "after-lower"]);
    assert_eq!(jobs.iter().map(|job| job.waits_for.clone()).collect::<Vec<_>>(), [vec![], vec![0], vec![1]]);
    assert_eq!(jobs.iter().map(|job| job.is_leaf).collect::<Vec<_>>(), [false, false, true]);
    // L1 = L2 = 1.2 x 5 mm and d = 5 mm: what reaches within 11 mm of a plane is on both sides of it.
    assert_eq!(parts_of(&jobs[0]), ["hopper", "flap", "side"]);
    assert_eq!(parts_of(&jobs[1]), ["hopper", "flap", "sieve", "side"]);
    assert_eq!(parts_of(&jobs[2]), ["box", "side"]);
    assert_eq!(jobs.iter().map(|job| job.own_feeds.clone()).collect::<Vec<_>>(), [vec![1], vec![], vec![0]]);
    assert_eq!(jobs[2].upstream_feeds, [1]);
    assert_eq!(jobs[1].upstream_parts, ["hopper", "flap", "side"]);
    assert!(jobs.iter().all(|job| job.scene.gates.is_empty() && job.scene.stages.is_empty()));
    // A feed that is elsewhere keeps its place, and with it the numbers in particle ids.
    assert_eq!(jobs[0].scene.feeds[0], scene.feeds[0].elsewhere());
    assert_eq!(jobs[0].scene.feeds[1], scene.feeds[1]);
    assert_eq!(jobs.iter().map(|job| job.scene.end.empty).collect::<Vec<_>>(), [true, true, false]);
    assert_eq!(jobs.iter().map(|job| job.scene.measures.len()).collect::<Vec<_>>(), [0, 0, 1]);
    assert_eq!(jobs[0].records, [Recording { gate: scene.gates[0].clone(), observes: false }]);
    assert_eq!(scene.gates[1].exclusion.mode, ExclusionMode::Constant);
    assert_eq!((jobs[1].replays[0].path, jobs[2].replays[0].path), (PathMode::Recorded, PathMode::Ballistic));
}

#[test]
fn a_part_between_both_lengths_is_in_both_stages_only_within_reach() {
    // The sieve's top lies at 410 mm: 185 mm under the outlet, 110 mm above the lower plane.
    let near = SERIES.replace("exclusion = { mode = \"constant\", length_mm = 8 }", "exclusion = { length_mm = 8 }");
    let jobs = |z: f64| {
        let text = near.replace("point_mm = [0, 0, 300]", &format!("point_mm = [0, 0, {z}]"));
        stage_jobs(&scene_of(&text))
    };
    // Downstream: s = z - 400 >= -(6 + 5) mm holds the sieve's lower face; upstream: s = z - 410 <= 8 + 5 mm its upper one.
    assert!(parts_of(&jobs(390.0)[2]).contains(&"sieve") && !parts_of(&jobs(388.0)[2]).contains(&"sieve"));
    assert!(parts_of(&jobs(422.0)[1]).contains(&"sieve") && !parts_of(&jobs(424.0)[1]).contains(&"sieve"));
}

#[test]
fn branches_have_a_whole_run_each() {
    let scene = scene_of(include_str!("../../../tests/scenes/good/gates.toml"));
    let names: Vec<String> = stage_jobs(&scene).into_iter().map(|job| job.name).collect();
    assert_eq!(names, ["hopper", "chute", "plate", "box"]);
    let wholes = whole_jobs(&scene);
    assert_eq!(wholes.iter().map(|job| job.name.as_str()).collect::<Vec<_>>(), ["plate", "box"]);
    assert_eq!(parts_of(&wholes[0]), ["hopper", "plate"]);
    assert_eq!(parts_of(&wholes[1]), ["hopper", "chute", "box"]);
    assert_eq!((&wholes[0].own_feeds[..], &wholes[1].own_feeds[..]), (&[0][..], &[0, 1][..]));
    let observed = |job: &StageJob| job.records.iter().map(|r| (r.gate.name.clone(), r.observes)).collect::<Vec<_>>();
    assert_eq!(observed(&wholes[1]), [("outlet".to_owned(), true), ("edge".to_owned(), true)]);
    // Only the stored stream is replayed in it.
    assert_eq!(wholes[1].replays.len(), 1);
    assert!(wholes.iter().all(|job| job.scene.end == scene.end && job.scene.measures == scene.measures));
    assert_eq!(why_not_whole(&scene, "box"), None);
    assert_eq!(why_not_whole(&scene, "plate").as_deref(), Some("stage \"plate\" moves its stream to another place"));
}

#[test]
fn a_stage_may_be_written_before_the_one_it_waits_for() {
    let text = format!(
        "{SERIES}[[stage]]\nname = \"down\"\nrecords = [\"lower\"]\n[[stage.replay]]\ngate = \"outlet\"\n\
         [[stage]]\nname = \"last\"\n[[stage.replay]]\ngate = \"lower\"\n[[stage]]\nname = \"up\"\nrecords = [\"outlet\"]\n"
    );
    let jobs = stage_jobs(&scene_of(&text));
    assert_eq!(jobs.iter().map(|job| job.name.as_str()).collect::<Vec<_>>(), ["up", "down", "last"]);
    assert_eq!(jobs.iter().map(|job| job.waits_for.clone()).collect::<Vec<_>>(), [vec![], vec![0], vec![1]]);
}

#[test]
fn the_checkpoint_belongs_to_the_first_stage() {
    let jobs = stage_jobs(&scene_of(&SERIES.replace("version = 1", "version = 1\nstart_checkpoint = \"full\"")));
    let starts: Vec<bool> = jobs.iter().map(|job| job.scene.start_checkpoint.is_some()).collect();
    assert_eq!(starts, [true, false, false]);
}

#[test]
fn a_scene_without_gates_has_no_stages() {
    let text =
        SERIES.split("[[gate]]").next().expect("the part before the gates").to_owned() + "[end]\ntime = \"1 s\"\n";
    let scene = scene_of(&text);
    assert!(stage_jobs(&scene).is_empty() && whole_jobs(&scene).is_empty());
}

#[test]
fn events_upstream_are_replayed_and_those_that_never_came_stay_away() {
    let rest = AtRest { speed: 1e-3, hold: 0.01, not_before: 0.0 };
    let scene = || stage_jobs(&scene_of(SERIES)).swap_remove(1).scene;
    let flap = |scene: &Scene| scene.parts.iter().find(|part| part.name == "flap").expect("the flap").disappears;
    assert_eq!(flap(&scene()), Trigger::AtRest(rest));
    let upstream = ["flap".to_owned()];
    let mut opened = scene();
    take_events(&mut opened, &upstream, &[("flap".to_owned(), false, 0.75)]);
    assert_eq!(flap(&opened), Trigger::At { time: 0.75 });
    let mut closed = scene();
    take_events(&mut closed, &upstream, &[("flap".to_owned(), true, 0.75)]);
    assert_eq!(flap(&closed), Trigger::Never);
    let mut own = scene();
    take_events(&mut own, &[], &[]);
    assert_eq!(flap(&own), Trigger::AtRest(rest), "a part that is here only waits for the rest here");
}

#[test]
fn a_moved_stream_moves_the_borders_of_its_stage() {
    let (head, rest) = SERIES.split_once("[[gate]]\nname = \"lower\"").expect("the lower gate");
    let (_, tail) = rest.split_once("paths = \"none\"\n").expect("the end of the lower gate");
    let stages = "[[stage]]\nname = \"up\"\nrecords = [\"outlet\"]\n[[stage]]\nname = \"last\"\n[[stage.replay]]\n\
                  gate = \"outlet\"\nplace = { move_mm = [0, 0, -300] }\n";
    let scene = scene_of(&format!("{head}{tail}{stages}"));
    assert_ne!(scene.stages[1].replays[0].transform, Transform::IDENTITY);
    // The sieve at 400 mm lies behind the gate, and before the plane at 295 mm that its stream is moved to.
    assert_eq!(parts_of(&stage_jobs(&scene)[1]), ["box", "side"]);
}
