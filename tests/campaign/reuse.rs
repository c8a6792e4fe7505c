//! What is computed once, what is used again, and what a change makes due.

use super::common::{FLOORS, SMALL, bench, dry_run, due, reasons, results, run, starts, statuses, write};
use std::fs;

const MORE: &str = r#"
[[axis]]
name = "floor"
keys = "part.floor.point_mm"
values = [[0, 0, 140], [0, 0, 150], [0, 0, 160]]
"#;

#[test]
fn the_upstream_is_computed_once_and_a_new_value_makes_only_its_own_runs_due() {
    let bench = bench(&[SMALL, FLOORS]);
    let first = dry_run(&bench, &[]);
    assert_eq!(due(&first), [("heap".to_owned(), (2, 2)), ("hopper".to_owned(), (1, 1))].into());
    assert!(!bench.path("out").exists(), "a dry run writes nothing");
    let answer = run(&bench, &[]);
    assert_eq!(answer.code, 0, "{answer:?}");
    assert!(answer.out.contains("hopper: 1 done") && answer.out.contains("heap: 2 done"), "{answer:?}");
    assert_eq!(starts(&bench), [1, 1, 1]);
    assert_eq!(statuses(&bench), ["done", "done"]);
    // What falls on a higher floor lies higher, and by no more than the floor is higher.
    let heights: Vec<f64> = results(&bench).iter().map(|row| row["heap.centre_z_m"].parse().unwrap()).collect();
    assert!((0.0..0.01).contains(&(heights[1] - heights[0])) && heights[1] > heights[0], "{heights:?}");
    let columns = results(&bench);
    assert_eq!(columns[0]["key.hopper"], columns[1]["key.hopper"]);
    assert_ne!(columns[0]["key.heap"], columns[1]["key.heap"]);

    write(&bench, &[SMALL, MORE]);
    let more = dry_run(&bench, &[]);
    assert_eq!(due(&more), [("heap".to_owned(), (1, 3)), ("hopper".to_owned(), (0, 1))].into());
    let [reason] = &reasons(&more)[..] else { panic!("{more:#}") };
    assert!(reason.contains("new: differs from stored") && reason.contains("parts.floor"), "{reason}");
    let changed = bench.changes("out/stages");
    assert_eq!(run(&bench, &[]).code, 0);
    assert_eq!(statuses(&bench), ["done"; 3]);
    let after = bench.changes("out/stages");
    assert!(changed.iter().all(|(name, time)| after[name] == *time), "what was stored is not touched");
}

#[test]
fn comments_names_paths_and_threads_make_nothing_due() {
    let bench = bench(&[SMALL, FLOORS]);
    assert_eq!(run(&bench, &["--jobs", "1"]).code, 0);
    let scene = bench.text("scene.toml");
    let nothing = |what: &str| {
        let dry = dry_run(&bench, &["--jobs", "2"]);
        assert!(reasons(&dry).is_empty(), "{what}: {:?}", reasons(&dry));
    };
    fs::write(bench.path("scene.toml"), scene.replace("title = \"small hopper\"", "# renamed\ntitle = \"another\""))
        .unwrap();
    nothing("a comment and the title");
    fs::create_dir(bench.path("elsewhere")).unwrap();
    fs::rename(bench.path("scene.toml"), bench.path("elsewhere/base.toml")).unwrap();
    write(&bench, &["scene = \"elsewhere/base.toml\"\n# moved\n", SMALL, FLOORS]);
    nothing("another path");
    write(
        &bench,
        &[
            "title = \"renamed\"\nscene = \"elsewhere/base.toml\"\n",
            SMALL,
            FLOORS,
            "[[sample]]\ncount = 2\n\
        [[sample.axis]]\nname = \"friction\"\nkeys = \"pair.sinter-steel.friction\"\nfrom = 0.4\nto = 0.6\n",
        ],
    );
    let dry = dry_run(&bench, &[]);
    assert_eq!(due(&dry)["hopper"], (2, 2), "friction on steel is the hopper's too: {dry:#}");
}

#[test]
fn a_material_that_only_the_downstream_has_leaves_the_upstream_alone() {
    let bench = bench(&[SMALL, FLOORS]);
    let scene = bench.text("scene.toml");
    let liner = "[material.liner]\nyoungs_modulus = \"rigid\"\n\n[[pair]]\nbetween = [\"sinter\", \"liner\"]\n\
                 restitution = 0.4\nfriction = 0.3\nrolling_friction = 0.1\n\n[particle.sinter]";
    let floor = scene.find("name = \"floor\"").unwrap();
    let (above, below) = scene.split_at(floor);
    let below = below.replacen("material = \"steel\"", "material = \"liner\"", 1);
    fs::write(bench.path("scene.toml"), format!("{above}{below}").replace("[particle.sinter]", liner)).unwrap();
    write(&bench, &[SMALL, "[[axis]]\nname = \"liner\"\nkeys = \"pair.sinter-liner.friction\"\nvalues = [0.3, 0.6]\n"]);
    let dry = dry_run(&bench, &[]);
    assert_eq!(due(&dry), [("heap".to_owned(), (2, 2)), ("hopper".to_owned(), (1, 1))].into(), "{dry:#}");
}

#[test]
fn a_new_output_is_asked_for_and_one_that_is_taken_back_is_not() {
    let bench = bench(&[SMALL, FLOORS]);
    assert_eq!(run(&bench, &[]).code, 0);
    let scene = bench.text("scene.toml");
    let measure = "\n[[measure]]\nname = \"contacts\"\nkind = \"coordination-number\"\n";
    fs::write(bench.path("scene.toml"), scene.clone() + measure).unwrap();
    let refused = run(&bench, &[]);
    refused
        .refused(2, &["2 stored stages lack outputs that are asked for now", "measures.contacts", "--rerun outputs"]);
    let dry = dry_run(&bench, &["--rerun", "outputs"]);
    assert_eq!(due(&dry), [("heap".to_owned(), (2, 2)), ("hopper".to_owned(), (0, 1))].into(), "{dry:#}");
    assert!(reasons(&dry).iter().all(|reason| reason.contains("lacks measures.contacts")), "{dry:#}");
    assert_eq!(run(&bench, &["--rerun", "outputs"]).code, 0);
    assert!(results(&bench).iter().all(|row| row["heap.contacts"].parse::<f64>().is_ok()));
    // Back to the old outputs: both results have them.
    fs::write(bench.path("scene.toml"), scene).unwrap();
    assert!(reasons(&dry_run(&bench, &[])).is_empty());
    assert_eq!(run(&bench, &[]).code, 0);
    assert!(results(&bench).iter().all(|row| !row.keys().any(|name| name.contains("contacts"))));
    // Now the results with more outputs are the ones that nobody refers to.
    let dry = bench.tollgate(&["campaign", "clean", ".", "--out", "out", "--dry-run"]);
    assert!(dry.code == 0 && dry.out.contains("2 results that no variant refers to"), "{dry:?}");
    let clean = bench.tollgate(&["campaign", "clean", ".", "--out", "out"]);
    assert!(clean.code == 0 && clean.out.contains("removed 2 results"), "{clean:?}");
    let status = bench.tollgate(&["campaign", "status", ".", "--out", "out"]);
    assert!(status.code == 0 && status.out.contains("heap: 2 done"), "{status:?}");
}

#[test]
fn replicates_whole_runs_and_load_are_in_the_tables() {
    let bench = bench(&["replicates = 2\nwhole_runs = 2\n", SMALL, FLOORS]);
    let answer = run(&bench, &[]);
    assert_eq!(answer.code, 0, "{answer:?}");
    assert_eq!(statuses(&bench), ["done"; 4]);
    let rows = results(&bench);
    let seeds: Vec<&str> = rows.iter().map(|row| row["seed"].as_str()).collect();
    assert_eq!(seeds, ["1", "2", "1", "2"]);
    assert_ne!(rows[0]["key.hopper"], rows[1]["key.hopper"], "each seed has its own upstream");
    assert_eq!(rows[0]["key.hopper"], rows[2]["key.hopper"]);
    let load = bench.json("out/load.json");
    assert_eq!((load["upstream_runs"].as_u64(), load["downstream_runs"].as_u64()), (Some(2), Some(4)));
    assert_eq!(load["whole_runs"], 2);
    let (a, b) = (load["upstream_cpu_s"].as_f64().unwrap(), load["downstream_cpu_s"].as_f64().unwrap());
    let (split, ratio) = (load["split_cpu_s"].as_f64().unwrap(), load["ratio"].as_f64().unwrap());
    assert!((split - (2.0 * a + 4.0 * b)).abs() < 1e-9, "{load:#}");
    assert!((ratio - 4.0 * (a + b) / split).abs() < 1e-9, "{load:#}");
    let whole = load["whole_cpu_s"].as_f64().unwrap();
    assert!((load["ratio_measured"].as_f64().unwrap() - 4.0 * whole / split).abs() < 1e-9, "{load:#}");
    // The mean of two replicates, and an interval of one degree of freedom: t = tan(0.475 pi) times half their difference.
    let text = bench.text("out/summary.csv");
    let line = text.lines().find(|line| line.contains("heap.centre_z_m")).unwrap();
    let cells: Vec<&str> = csv_cells(line);
    let of = |k: usize| rows[k]["heap.centre_z_m"].parse::<f64>().unwrap();
    let (mean, half) = (0.5 * (of(0) + of(1)), 0.5 * (of(0) - of(1)).abs() * (0.475 * std::f64::consts::PI).tan());
    let numbers: Vec<f64> = cells[cells.len() - 6..].iter().map(|cell| cell.parse().unwrap()).collect();
    assert!((numbers[0] - mean).abs() < 1e-12, "{line}");
    assert!((numbers[3] - (mean + half)).abs() < 1e-6 * mean, "{line}: {}", mean + half);
    assert!(bench.text("out/figures/load.svg").contains("unsplit, by measured whole runs"));
}

/// Cells after the quoted one.
fn csv_cells(line: &str) -> Vec<&str> {
    line.rsplit(',').collect::<Vec<_>>().into_iter().rev().collect()
}

/// The upstream on LIGGGHTS with two ranks, the downstream on the native solver. So stiff that LIGGGHTS takes it.
#[test]
fn backends_can_be_mixed() {
    let mixed = r#"
"stage.hopper.backend" = "liggghts"
"liggghts.ranks" = 2
"material.sinter.youngs_modulus" = "5 MPa"
"solver.timestep" = "20 us"
"#;
    let bench = bench(&[SMALL, mixed, FLOORS]);
    let answer = run(&bench, &[]);
    assert_eq!(answer.code, 0, "{answer:?}");
    assert_eq!(statuses(&bench), ["done", "done"]);
    let rows = results(&bench);
    assert_eq!(rows[0]["key.hopper"], rows[1]["key.hopper"]);
    let upstream = bench.summary(&format!("out/stages/hopper/{}", rows[0]["key.hopper"]));
    assert_eq!((upstream.word("/stages/0/backend"), upstream.number("/stages/0/threads")), ("liggghts", 2.0));
    let downstream = bench.summary(&format!("out/stages/heap/{}", rows[1]["key.heap"]));
    assert_eq!(downstream.word("/stages/0/backend"), "native");
    assert_eq!(
        downstream.number("/gates/0/replayed/arrivals/recorded/count"),
        downstream.number("/gates/0/replayed/arrivals/arrived/count")
    );
    // Another number of ranks is another upstream.
    write(&bench, &[SMALL, &mixed.replace("ranks\" = 2", "ranks\" = 1"), FLOORS]);
    let dry = dry_run(&bench, &[]);
    assert_eq!(due(&dry), [("heap".to_owned(), (2, 2)), ("hopper".to_owned(), (1, 1))].into(), "{dry:#}");
    assert!(reasons(&dry)[0].contains("choices.external.ranks: 2 then, 1 now"), "{dry:#}");
}
