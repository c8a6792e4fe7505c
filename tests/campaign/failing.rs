//! One that fails never stops the rest.

use super::common::{SMALL, bench, dry_run, due, results, run, statuses, write};

/// The second floor is so high that the heap backs up to the gate, which stops its run; the third cannot be.
const FAILING: &str = r#"
[[axis]]
name = "floor"
keys = "part.floor.point_mm"
values = [[0, 0, 140], [0, 0, 196], [0, 0, "high"], [0, 0, 150]]
"#;

#[test]
fn a_failed_and_a_refused_variant_are_told_and_the_rest_is_done() {
    let bench = bench(&[SMALL, FAILING]);
    let answer = run(&bench, &[]);
    assert_eq!(answer.code, 9, "{answer:?}");
    assert_eq!(statuses(&bench), ["done", "failed", "refused", "done"], "{answer:?}");
    let rows = results(&bench);
    assert!(rows[1]["reason"].contains("heap (exit 7)") && rows[1]["reason"].contains("stopped at a gate"), "{:?}", rows[1]);
    assert!(rows[2]["reason"].contains("point"), "{:?}", rows[2]);
    assert!(rows[1]["heap.centre_z_m"].is_empty() && !rows[3]["heap.centre_z_m"].is_empty());
    let status = bench.tollgate(&["campaign", "status", ".", "--out", "out"]);
    assert_eq!(status.code, 9);
    assert!(status.out.contains("heap: 1 failed") && status.out.contains("refused: floor"), "{status:?}");

    // Once failed, it is left alone, until it is asked for.
    let dry = dry_run(&bench, &[]);
    assert_eq!(due(&dry)["heap"], (0, 3), "{dry:#}");
    assert_eq!(run(&bench, &[]).code, 9);
    assert_eq!(due(&dry_run(&bench, &["--rerun", "failed"]))["heap"], (1, 3));
    let before = bench.changes("out/failed");
    assert_eq!(run(&bench, &["--rerun", "failed"]).code, 9);
    let after = bench.changes("out/failed");
    assert!(before.len() == 1 && before.keys().eq(after.keys()) && before != after, "it failed anew");
    // Without the two there is nothing left to fail.
    let only = run(&bench, &["--only", "1", "--only", "4"]);
    assert_eq!(only.code, 0, "{only:?}");
}

#[test]
fn where_every_variant_is_wrong_nothing_starts_and_all_is_told() {
    let bench = bench(&[SMALL, "[[axis]]\nname = \"floor\"\nkeys = \"part.flor.point_mm\"\nvalues = [1, 2]\n"]);
    run(&bench, &[]).refused(2, &["`part.flor.point_mm` does not exist", "did you mean `floor`?", "2 variants cannot run"]);
    assert!(!bench.path("out").exists());
    write(&bench, &[SMALL, "[[axis]]\nname = \"floor\"\nvalues = []\nspeed = 1\n"]);
    run(&bench, &[]).refused(2, &["has no `keys`", "at least one value", "`speed` is not a key"]);
    let nowhere = bench.tollgate(&["campaign", "run", "nowhere.toml"]);
    nowhere.refused(2, &["the campaign \"nowhere.toml\" cannot be read"]);
}

#[test]
fn what_depends_on_a_failed_upstream_is_held_up_and_says_so() {
    // So many particles do not fit through the watchdog: an overlap limit that the fall breaks, of one value only.
    let limits = "[[axis]]\nname = \"limit\"\nkeys = \"solver.overlap_limit\"\nvalues = [0.9, 0.001]\n";
    let bench = bench(&[SMALL, limits]);
    let answer = run(&bench, &[]);
    assert_eq!(answer.code, 9, "{answer:?}");
    assert_eq!(statuses(&bench), ["done", "failed"], "{answer:?}");
    let status = bench.tollgate(&["campaign", "status", ".", "--out", "out"]);
    assert!(status.out.contains("heap: 1 held up") && status.out.contains("hopper: 1 failed"), "{status:?}");
}
