//! Particles that do not simply pass: slow ones, grazing ones, those that come back, those that were beyond the gate all the time.

use crate::common::{Bench, Drop, FLOOR, Frames, G, Summary, assert_faultless, number};

/// Speed with which a particle thrown up from `from` turns at `apex` [mm].
fn thrown(from: f64, apex: f64) -> f64 {
    (2.0 * G * (apex - from) * 1e-3).sqrt()
}

/// A fountain: the gate at 100 mm opens upward.
const GATE: &str = "[[gate]]\nname = \"up\"\npoint_mm = [0, 0, 100]\nnormal = [0, 0, 1]\n\
                    aperture = { shape = \"disc\", radius_mm = 60 }\nexclusion = { mode = \"buffer\", length_mm = 6 }\n\
                    paths = { every = 1, length_mm = 6 }\n";
const STAGES: &str = "[[stage]]\nname = \"below\"\nparts = [\"floor\"]\nfeeds = [\"jet\"]\nrecords = [\"up\"]\n\
                      [[stage]]\nname = \"above\"\nparts = []\nfeeds = []\n[[stage.replay]]\ngate = \"up\"\n\
                      path = \"recorded\"\nlength_mm = 6\n";
const END: &str = "[end]\ntime = \"0.3 s\"\n[output]\nframes = \"1 ms\"\nformats = [\"lammps\"]\n";

fn fountain(jet: &[Drop]) -> Bench {
    let bench = Bench::new();
    let feed = bench.drops("jet", jet);
    bench.write_scene("scene.toml", "", &[FLOOR, &feed, END, GATE, STAGES]);
    bench
}

fn tally(summary: &Summary, key: &str) -> f64 {
    number(&summary.recorded("up")["tally"][key])
}

fn up(x: f64, apex: f64) -> Drop {
    Drop::new([x, 0.0, 60.0], [0.0, 0.0, thrown(60.0, apex)])
}

/// Removed particles of a stage by cause.
fn removed(summary: &Summary, cause: &str) -> f64 {
    let rows = summary.list("/removed");
    rows.iter().filter(|row| row["cause"] == cause).map(|row| number(&row["count"])).sum()
}

/// One turns a hundredth of a millimetre short of the plane, one that much beyond it, one in the midst of the exclusion zone,
/// one goes through. Catches a crossing by one that never reached the plane, and one that counts as two when it comes back.
fn four() -> Vec<Drop> {
    vec![up(-40.0, 99.99), up(-20.0, 100.01), up(0.0, 103.0), up(20.0, 180.0)]
}

#[test]
fn who_touches_the_plane_and_turns_is_recorded_once_and_kept() {
    let bench = fountain(&four());
    let summary = bench.run("a", &["--set", "stage.above.replay.up.leaving=keep"]);
    assert_eq!(tally(&summary, "recorded"), 3.0);
    // Two fell back through the gate; one was taken out at the exclusion plane.
    assert_eq!((tally(&summary, "returned"), tally(&summary, "excluded"), tally(&summary, "deleted")), (2.0, 1.0, 0.0));
    assert_eq!(tally(&summary, "still_in_run"), 2.0);
    assert!(tally(&summary, "returned_farthest_m") > 0.09, "they have fallen to the floor");
    assert_faultless(summary.replayed("up", "above"), 3);
    // Downstream all three fall back, below the generation plane; kept there, and counted.
    assert_eq!(number(&summary.replayed("up", "above")["left_upstream"]), 3.0);
    assert!(summary.warns("went back upstream"), "{:#}", summary.at("/warnings"));
    let (_, last) = bench.frames("a", "above").0.pop_last().unwrap();
    // No floor is there: they have left the domain, or fall below the gate.
    assert!(last.values().all(|row| row.place[2] < 0.1), "{last:?}");
    heights_are_those_of_the_throw(&bench.frames("a", "above"));
    // Upstream keeps the three that stay, in the whole as in the part.
    assert_eq!(summary.stage("below")["particles"], 3);
    assert!(summary.recorded("up")["tally"]["grazing"] == 0);
}

/// Downstream, the highest places are the apexes.
fn heights_are_those_of_the_throw(frames: &Frames) {
    for (x, apex) in [(-0.02, 0.10001), (0.0, 0.103), (0.02, 0.18)] {
        let of = frames.0.values().flat_map(|frame| frame.values()).filter(|row| (row.place[0] - x).abs() < 1e-9);
        let highest = of.map(|row| row.place[2]).fold(0.0, f64::max);
        // Frames are 1 ms apart: half of that from the apex, g t^2 / 2 is 1.2 um.
        assert!(highest <= apex + 1e-9 && highest > apex - 2e-6, "{highest} is not {apex}");
    }
}

#[test]
fn who_returns_is_deleted_where_the_scene_says_so() {
    let bench = fountain(&four());
    let summary =
        bench.run("a", &["--set", "gate.up.returning=delete", "--set", "stage.above.replay.up.leaving=delete"]);
    assert_eq!((tally(&summary, "recorded"), tally(&summary, "returned")), (3.0, 2.0));
    assert_eq!((tally(&summary, "deleted"), tally(&summary, "still_in_run")), (2.0, 0.0));
    assert_eq!(removed(&summary, "below: deleted at a gate"), 2.0);
    assert_eq!(removed(&summary, "below: through a gate"), 1.0);
    assert_eq!(removed(&summary, "above: deleted at a gate"), 3.0);
    assert_eq!(number(&summary.replayed("up", "above")["left_upstream"]), 3.0);
    assert_faultless(summary.replayed("up", "above"), 3);
    // The one that never crossed is all that is left.
    assert_eq!((&summary.stage("below")["particles"], &summary.stage("above")["particles"]), (&1.into(), &0.into()));
}

#[test]
fn who_returns_ends_the_run_where_the_scene_says_so() {
    let bench = fountain(&four());
    let answer = bench.attempt("a", &["--set", "gate.up.returning=error"]);
    // Particle 1 (of 0 to 3) turns first beyond the plane.
    answer.refused(7, &["stopped at a gate", "particle 1 of feed 0", "came back", "returning"]);
    let stage = bench.json("a/stages/below/summary.json");
    assert_eq!(stage["outcome"]["exit_code"], 7, "{stage:#}");
    assert!(!bench.path("a/stages/below/streams/up/manifest.json").exists(), "a stream of a run that did not end");
    bench.attempt("a", &["--resume", "--set", "gate.up.returning=error"]).refused(7, &["came back"]);
    let answer = bench.attempt("b", &["--set", "stage.above.replay.up.leaving=error"]);
    answer.refused(7, &["stopped at a gate", "stream 'up'", "went back upstream", "leaving"]);
    assert_eq!(bench.json("b/stages/above/summary.json")["outcome"]["exit_code"], 7);
}

/// Ghosts behind the plane do not come back: what is recorded goes on.
#[test]
fn ghosts_behind_the_plane_never_return() {
    let bench = fountain(&four());
    let summary = bench.run("a", &["--set", "gate.up.exclusion.mode=constant"]);
    assert_eq!((tally(&summary, "recorded"), tally(&summary, "returned")), (3.0, 0.0));
    assert_faultless(summary.replayed("up", "above"), 3);
}

/// A particle that a downstream part throws back over the plane; the gate opens downward here. Catches one that is counted as
/// arriving again, and one that vanishes.
#[test]
fn who_bounces_back_over_the_gate_downstream_is_accounted_for() {
    let table = "[[part]]\nname = \"table\"\nmaterial = \"wall\"\nshape = \"box\"\nmin_mm = [-50, -50, 80]\nmax_mm = [50, 50, 90]\n";
    let gate = GATE.replace("[0, 0, 1]", "[0, 0, -1]");
    let stages = STAGES.replace("parts = []", "parts = [\"table\"]").replace("parts = [\"floor\"]", "parts = []");
    for (leaving, inside, gone) in [("keep", 2, 0.0), ("delete", 1, 1.0)] {
        let bench = Bench::new();
        // From 300 mm it bounces to a quarter of its height, above the gate; from 104 mm it does not reach the gate again.
        let feed =
            bench.drops("jet", &[Drop::new([0.0, 0.0, 300.0], [0.0; 3]), Drop::new([20.0, 0.0, 104.0], [0.0; 3])]);
        bench.write_scene("scene.toml", "", &[FLOOR, table, &feed, END, &gate, &stages]);
        let summary = bench.run("a", &["--set", &format!("stage.above.replay.up.leaving={leaving}")]);
        let replayed = summary.replayed("up", "above");
        assert_faultless(replayed, 2);
        assert_eq!(number(&replayed["left_upstream"]), 1.0, "{leaving}: {replayed:#}");
        assert_eq!(summary.stage("above")["particles"], inside, "{leaving}");
        assert_eq!(removed(&summary, "above: deleted at a gate"), gone, "{leaving}");
        assert!(number(&replayed["momentum"]["closure_error"]) < 1e-9, "{replayed:#}");
    }
}

/// Hardly above the plane and at rest: the slowest crossing there is. Its ballistic path turns where it was let go.
#[test]
fn who_crosses_slowly_arrives_bit_for_bit() {
    for path in ["constant", "ballistic", "recorded"] {
        let bench = Bench::new();
        let feed =
            bench.drops("jet", &[Drop::new([0.0, 0.0, 100.001], [0.0; 3]), Drop::new([20.0, 0.0, 100.0], [0.0; 3])]);
        let gate = GATE.replace("[0, 0, 1]", "[0, 0, -1]");
        let stages = STAGES.replace("parts = [\"floor\"]", "parts = []");
        bench.write_scene("scene.toml", "", &[FLOOR, &feed, END, &gate, &stages]);
        let summary = bench.run("a", &["--set", &format!("stage.above.replay.up.path={path}")]);
        // The one on the plane lies beyond it (s = 0 is not before it): it sits there, and never crosses.
        assert_eq!((tally(&summary, "recorded"), tally(&summary, "sitting_at_start")), (1.0, 1.0), "{path}");
        assert_faultless(summary.replayed("up", "above"), 1);
        if path == "ballistic" {
            assert_eq!(summary.replayed("up", "above")["tally"]["apex_starts"], 1);
        }
    }
}

/// Beyond the gate without having passed it: there from the start, or around the aperture.
fn sitters() -> Vec<Drop> {
    vec![
        Drop::new([0.0, 0.0, 130.0], [0.0; 3]),
        // Past the plane at x = 70 mm, outside of the aperture of 60 mm, then over it.
        Drop::new([78.0, 0.0, 60.0], [-0.2, 0.0, thrown(60.0, 180.0)]),
        up(20.0, 180.0),
    ]
}

#[test]
fn who_is_beyond_the_gate_already_is_kept_deleted_or_refused() {
    let bench = fountain(&sitters());
    let kept = bench.run("kept", &[]);
    assert_eq!(
        (tally(&kept, "recorded"), tally(&kept, "sitting_at_start"), tally(&kept, "came_around")),
        (1.0, 1.0, 1.0)
    );
    assert_eq!((tally(&kept, "deleted"), number(&kept.stage("below")["particles"])), (0.0, 2.0));
    let deleted = bench.run("deleted", &["--set", "gate.up.sitting=delete"]);
    assert_eq!((tally(&deleted, "recorded"), tally(&deleted, "deleted")), (1.0, 2.0));
    assert_eq!(
        (removed(&deleted, "below: deleted at a gate"), number(&deleted.stage("below")["particles"])),
        (2.0, 0.0)
    );
    let answer = bench.attempt("refused", &["--set", "gate.up.sitting=error"]);
    answer.refused(7, &["particle 0 of feed 0", "lies behind it at the start", "sitting"]);
}
