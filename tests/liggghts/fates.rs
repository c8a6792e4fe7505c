//! Who is taken out at a gate without having been recorded, and what waits for rest in a stage that is still empty.

use super::deck::{enter, inline, job, lattice, order, rows_of, run, scene};
use std::fs;
use tempfile::TempDir;
use tollgate::backend::liggghts::deck::{self, DeckOrder, Ghosts};
use tollgate::backend::liggghts::groups;
use tollgate::math::{Vec3, vec3};
use tollgate::scene::backend::LiggghtsSettings;

/// Two stages about a gate through the origin that is passed downwards, with `fate` among its keys, and a plate.
fn cut(fate: &str, plate: &str) -> String {
    format!(
        "[[part]]\nname = \"plate\"\nmaterial = \"glass\"\nshape = \"box\"\n{plate}\n\
         [[gate]]\nname = \"the-gate\"\npoint_mm = [0, 0, 0]\nnormal = [0, 0, -1]\n{fate}\n\
         aperture = {{ shape = \"disc\", radius_mm = 20 }}\nexclusion = {{ mode = \"buffer\", length_mm = 6 }}\n\
         [[stage]]\nname = \"up\"\nparts = [\"plate\"]\nfeeds = [\"block\"]\nrecords = [\"the-gate\"]\n\
         [[stage]]\nname = \"down\"\nparts = [\"plate\"]\n\
         [[stage.replay]]\ngate = \"the-gate\"\npath = \"ballistic\"\nlength_mm = 6\n"
    )
}

#[test]
fn who_comes_back_over_the_gate_is_taken_out() {
    // The plate is 5 mm behind the plane: beads of 4 mm are through by 3 mm when they meet it, and come back at half their speed.
    let plant = inline(-9.81, &cut("returning = \"delete\"", "min_mm = [-40, -40, -10]\nmax_mm = [40, 40, -5]"));
    let job = job(&plant, "up");
    let settings = LiggghtsSettings::default();
    let order = DeckOrder { ghosts: Ghosts::default(), ..order(&job, 1e-5, 4000, &settings) };
    let folder = TempDir::new().unwrap();
    deck::write(&order, folder.path()).unwrap();
    let beads = lattice([3, 3, 1], vec3(-0.006, -0.006, 0.003), 0.006, 0.004, vec3(0.0, 0.0, -0.8));
    enter(folder.path(), groups::ACTIVE, &beads);
    let said = run(folder.path());
    let returned = rows_of(&folder.path().join("removed/the-gate.returning.dump"));
    assert_eq!(returned.len(), beads.len(), "{said}");
    for row in returned {
        // At the first batch (1 ms) after it came back.
        assert!(row[9] > 0.0 && row[6] > 0.0 && row[6] <= 1e-3 * row[9] + 1e-5, "{row:?}");
    }
    assert!(!folder.path().join("removed/the-gate.dump").exists(), "nobody reaches the exclusion plane");
}

#[test]
fn who_sits_behind_the_gate_is_taken_out() {
    let plant = inline(-9.81, &cut("sitting = \"delete\"", "min_mm = [-40, -40, -50]\nmax_mm = [40, 40, -45]"));
    let job = job(&plant, "up");
    let settings = LiggghtsSettings::default();
    let order = DeckOrder { ghosts: Ghosts::default(), ..order(&job, 1e-5, 3000, &settings) };
    let folder = TempDir::new().unwrap();
    deck::write(&order, folder.path()).unwrap();
    let mut beads = lattice([3, 3, 1], vec3(-0.006, -0.006, 0.003), 0.006, 0.004, vec3(0.0, 0.0, -0.8));
    let above = beads.len();
    let sitting = lattice([3, 2, 1], vec3(-0.006, -0.006, -0.004), 0.006, 0.004, Vec3::zeros());
    beads.extend(sitting.into_iter().map(|bead| (bead.0 + above as u32, bead.1, bead.2, bead.3, bead.4, bead.5)));
    enter(folder.path(), groups::ACTIVE, &beads);
    let said = run(folder.path());
    let sat = rows_of(&folder.path().join("removed/the-gate.sitting.dump"));
    assert_eq!(sat.len(), beads.len() - above, "{said}");
    assert!(sat.iter().all(|row| row[0] > above as f64), "those that were there from the start");
    let passed = rows_of(&folder.path().join("removed/the-gate.dump"));
    assert_eq!(passed.len(), above, "who has passed is taken out at the exclusion plane alone");
}

#[test]
fn an_empty_stage_is_not_at_rest() {
    let at_rest = "{ at_rest = { speed = \"100 mm/s\", hold = \"1 ms\", not_before = \"1 ms\" } }";
    let plant = scene("tests/scenes/hopper", &[("part.plate.disappears", at_rest)]);
    let job = job(&plant, "hopper");
    let settings = LiggghtsSettings::default();
    let entry = 2000;
    let order = order(&job, 1e-5, 3000, &settings);
    let folder = TempDir::new().unwrap();
    deck::write(&order, folder.path()).unwrap();
    let spheres = lattice([5, 5, 2], vec3(-0.009, -0.009, 0.2025), 0.0045, 0.004, Vec3::zeros());
    enter(folder.path(), groups::ACTIVE, &spheres);
    let batches = folder.path().join("batches");
    let entering = fs::read_to_string(batches.join("0.in")).unwrap();
    fs::write(batches.join("0.in"), "# nobody yet\n").unwrap();
    fs::write(batches.join(format!("{entry}.in")), entering).unwrap();
    fs::write(batches.join("entering"), format!("{entry}\n-1\n")).unwrap();
    // The run must not end for being empty before they come; of rest the deck does not know when that is.
    let deck_path = folder.path().join("in.liggghts");
    let text = fs::read_to_string(&deck_path).unwrap();
    let later = text.replace("(count(all)==0)*(step>0)", &format!("(count(all)==0)*(step>{entry})"));
    fs::write(&deck_path, later).unwrap();
    let said = run(folder.path());
    let event = said.lines().find_map(|line| line.strip_prefix("tollgate event plate 0 ")).unwrap();
    let step: u64 = event.parse().unwrap();
    // They fall 0.5 mm, at 0.1 m/s at most: slow from the start, and for 1 ms at the second look.
    assert!(step > entry && step <= entry + 300, "{step}");
}
