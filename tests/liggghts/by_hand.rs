//! Rendered decks against decks written by hand, `liggghts_inputs/{hopper,chute}_stage.in`: the same numbers, and the same physics.

use super::deck::{enter, job, lattice, order, paths, rows_of, run, run_on, scene};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use tempfile::TempDir;
use tollgate::backend::liggghts::deck::{self, DeckOrder, render};
use tollgate::backend::liggghts::groups;
use tollgate::backend::liggghts::record::samples::Sample;
use tollgate::geometry::plane::Aperture;
use tollgate::math::{Vec3, vec3};
use tollgate::scene::Scene;
use tollgate::scene::backend::LiggghtsSettings;
use tollgate::scene::gate::Gate;

/// The plate goes at a time that the decks by hand know as well.
fn plant(plate_goes: &str) -> Scene {
    scene("tests/scenes/hopper", &[("part.plate.disappears", plate_goes)])
}

fn by_hand(stage: &str) -> String {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("liggghts_inputs");
    fs::read_to_string(folder.join(format!("{stage}_stage.in"))).unwrap()
}

/// The commands of a deck: no comments, continued lines joined.
fn commands(deck: &str) -> Vec<Vec<String>> {
    let joined = deck.replace("&\n", " ");
    let bare = joined.lines().map(|line| line.split('#').next().unwrap_or_default());
    let words = bare.map(|line| line.split_ascii_whitespace().map(str::to_owned).collect::<Vec<_>>());
    words.filter(|words| !words.is_empty()).collect()
}

fn numbers(words: &[String]) -> Vec<f64> {
    words.iter().filter_map(|word| word.parse().ok()).collect()
}

/// What a deck says of the physics, whatever its order and its names.
#[derive(Debug, PartialEq)]
struct Said {
    /// Properties, time step, skin, gravity, number of types.
    numbers: BTreeMap<String, Vec<f64>>,
    /// Units, boundaries, laws, motions, and the meshes in the order of the wall.
    words: BTreeMap<String, Vec<String>>,
}

fn said(deck: &str) -> Said {
    let mut said = Said { numbers: BTreeMap::new(), words: BTreeMap::new() };
    let mut meshes = BTreeMap::new();
    let mut motions = Vec::new();
    for line in commands(deck) {
        let words: Vec<&str> = line.iter().map(String::as_str).collect();
        let rest = || line[1..].to_vec();
        match words.as_slice() {
            [key @ ("units" | "boundary" | "atom_style" | "hard_particles" | "newton" | "pair_style"), ..] => {
                said.words.insert((*key).to_owned(), rest());
            }
            [key @ ("timestep" | "neighbor" | "create_box"), value, ..] => {
                said.numbers.insert((*key).to_owned(), vec![value.parse().unwrap()]);
            }
            ["fix", _, _, "property/global", name, ..] => {
                let mut values = numbers(&line[6..]);
                if line[5] == "peratomtypepair" {
                    assert_eq!(values.remove(0), 2.0, "two materials");
                }
                // What steel has with itself, or beside its stiffness, acts on nothing: walls do not meet walls, and all that is
                // rigid is divided by an infinite Young's modulus.
                if *name != "youngsModulus" {
                    values.pop();
                }
                said.numbers.insert((*name).to_owned(), values);
            }
            ["fix", id, _, style, "file", file, "type", kind] if style.starts_with("mesh/surface") => {
                meshes.insert((*id).to_owned(), format!("{file} {kind}"));
            }
            // Rendered decks have a plane far outside of the box as well, for set-ups of an empty box.
            ["fix", _, _, "wall/gran", model @ ..] if model.contains(&"mesh") => {
                let mesh = model.iter().position(|word| *word == "mesh").unwrap();
                said.words.insert("wall".to_owned(), model[..mesh].iter().map(|word| (*word).to_owned()).collect());
                let order = model[mesh + 4..].iter().map(|id| meshes[*id].clone()).collect();
                said.words.insert("meshes".to_owned(), order);
            }
            ["fix", _, "all", "gravity", size, "vector", direction @ ..] => {
                let size: f64 = size.parse().unwrap();
                let direction: Vec<f64> = direction.iter().map(|value| value.parse().unwrap()).collect();
                let direction = vec3(direction[0], direction[1], direction[2]).normalize();
                said.numbers.insert("gravity".to_owned(), (size * direction).as_slice().to_vec());
            }
            ["fix", _, _, style, ..] if style.starts_with("nve") => motions.push((*style).to_owned()),
            _ => (),
        }
    }
    motions.sort();
    said.words.insert("motions".to_owned(), motions);
    said
}

/// Numbers of the regions, but for the box and the border of the domain.
fn region_numbers(deck: &str, but: &[&str]) -> Vec<f64> {
    let regions = commands(deck).into_iter().filter(|words| words[0] == "region" && !but.contains(&words[1].as_str()));
    regions.flat_map(|words| numbers(&words)).filter(|number| *number != 0.0 && number.is_finite()).collect()
}

/// Heights of the gate plane and of the exclusion plane, and the radius of the opening [m].
fn planes(gate: &Gate) -> [f64; 3] {
    let Aperture::Disc { radius } = gate.plane.aperture else { panic!("the outlet is a disc") };
    [gate.plane.point.z, (gate.plane.point + gate.plane.normal * gate.exclusion.length).z, radius]
}

fn near(number: f64, others: &[f64]) -> bool {
    others.iter().any(|other| (number - other).abs() <= 1e-15)
}

/// Place [m] and velocity [m/s] by tag.
type States = BTreeMap<u32, (Vec3, Vec3)>;

fn frame(path: &Path, step: u64) -> States {
    let mut sample = Sample::default();
    sample.read(path, step).unwrap();
    sample.rows().map(|row| (row.tag, (row.position, row.velocity))).collect()
}

/// Rows of a dump by hand (id type x y z vx vy vz), each with its time step.
fn noted(path: &Path) -> Vec<(u64, u32, (Vec3, Vec3))> {
    let text = fs::read_to_string(path).unwrap();
    let mut step = 0;
    let mut rows = Vec::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if line == "ITEM: TIMESTEP" {
            step = lines.next().unwrap().parse().unwrap();
        }
        let row: Vec<f64> = line.split(' ').filter_map(|word| word.parse().ok()).collect();
        if let [id, _, x, y, z, u, v, w] = row[..] {
            rows.push((step, id as u32, (vec3(x, y, z), vec3(u, v, w))));
        }
    }
    rows
}

fn states(path: &Path) -> States {
    noted(path).into_iter().map(|(_, tag, state)| (tag, state)).collect()
}

/// Time steps of the samples at which particles were first seen through the gate, by tag.
fn passages(case: &Path, order: &DeckOrder<'_>) -> BTreeMap<u32, u64> {
    let gate = &order.records[0].gate;
    let mut passed = BTreeMap::new();
    for step in (0..=order.schedule.steps).step_by(order.schedule.cadence.look as usize) {
        for (tag, (place, _)) in frame(&case.join(format!("samples/outlet/{step}.bin")), step) {
            if gate.plane.distance(&place) >= 0.0 && gate.plane.holds(&place) {
                passed.entry(tag).or_insert(step);
            }
        }
    }
    passed
}

fn farthest(a: &States, b: &States) -> f64 {
    assert!(a.keys().eq(b.keys()), "the same particles");
    a.iter().map(|(tag, (place, _))| (place - b[tag].0).norm()).fold(0.0, f64::max)
}

/// What the two decks of a stage say, compared.
fn compare_numbers(stage: &str, rendered: &str, gate: &Gate) {
    let hand = by_hand(stage);
    let (ours, theirs) = (said(rendered), said(&hand));
    assert_eq!(ours, theirs, "{stage}");
    // Nothing was overlooked: 5 properties, time step, skin, types, gravity; 6 commands, wall, meshes, motions.
    assert_eq!((ours.numbers.len(), ours.words.len()), (9, 9), "{stage}: {ours:?}");
    let regions = region_numbers(&hand, &["room", "plant"]);
    assert!(!regions.is_empty() && regions.iter().all(|number| near(*number, &planes(gate))), "{stage}: {regions:?}");
}

#[test]
fn the_hopper_does_as_one_by_hand() {
    let plant = plant("\"20 ms\"");
    let job = job(&plant, "hopper");
    let settings = LiggghtsSettings::default();
    let order = order(&job, 1e-5, 9000, &settings);
    let rendered = render(&order).unwrap();
    let gate = &job.records[0].gate;
    compare_numbers("hopper", &rendered, gate);
    let regions = region_numbers(&rendered, &["box", "outside"]);
    assert!(planes(gate).iter().all(|number| near(*number, &regions)), "{regions:?}");

    let spheres = lattice([5, 5, 8], vec3(-0.009, -0.009, 0.2025), 0.0045, 0.004, Vec3::zeros());
    let cases = [TempDir::new().unwrap(), TempDir::new().unwrap()];
    for case in &cases {
        deck::write(&order, case.path()).unwrap();
        enter(case.path(), groups::ACTIVE, &spheres);
    }
    let [ours, theirs] = cases.each_ref().map(TempDir::path);
    fs::write(theirs.join("in.liggghts"), by_hand("hopper")).unwrap();
    assert!(run(ours).contains("tollgate event plate 0 2000"));
    run(theirs);

    // Until the plate goes nobody has been taken out, and both run the same time steps: the same bits.
    assert_eq!(frame(&ours.join("frames/2000.bin"), 2000), states(&theirs.join("opened.dump")));
    // Afterwards the deck by hand sets up every batch anew and leaves it at that. A set-up evaluates contacts with velocities of the
    // whole step and springs that stand still: it brakes whoever slides, for half of one step in a hundred. The rendered deck takes
    // that back. 10 um is a four-hundredth of a diameter, a tenth of the way between samples.
    let allowed = 1e-5;
    assert!(farthest(&frame(&ours.join("frames/9000.bin"), 9000), &states(&theirs.join("final.dump"))) < allowed);
    let through = noted(&theirs.join("passed.dump"));
    let by_tag: BTreeMap<u32, u64> = through.iter().map(|(step, tag, _)| (*tag, *step)).collect();
    let passed = passages(ours, &order);
    assert!(passed.len() > 100 && through.len() == passed.len(), "{}, once each", passed.len());
    for (tag, step) in &passed {
        // Who is within 10 um of the plane at a sample may be seen at the next.
        assert!(step.abs_diff(by_tag[tag]) <= 20, "{tag}: {step}, {}", by_tag[tag]);
    }
    assert_eq!(rows_of(&ours.join("removed/outlet.dump")).len(), noted(&theirs.join("taken.dump")).len());
}

#[test]
fn the_chute_does_as_one_by_hand() {
    let plant = scene("tests/scenes/hopper", &[]);
    let job = job(&plant, "chute");
    let settings = LiggghtsSettings::default();
    let order = order(&job, 1e-5, 8000, &settings);
    compare_numbers("chute", &render(&order).unwrap(), &plant.gates[0]);

    let ghosts = lattice([5, 5, 4], vec3(-0.009, -0.009, 0.1903), 0.0045, 0.004, vec3(0.0, 0.0, -0.5));
    let cases = [TempDir::new().unwrap(), TempDir::new().unwrap()];
    for case in &cases {
        deck::write(&order, case.path()).unwrap();
        enter(case.path(), groups::RECORDED, &ghosts);
        paths(case.path(), &order.schedule, &ghosts, 0.19);
    }
    let [ours, theirs] = cases.each_ref().map(TempDir::path);
    fs::write(theirs.join("in.liggghts"), by_hand("chute")).unwrap();
    run(ours);
    run(theirs);

    // Nobody enters or leaves on the way: the same time steps, the same looks, the same bits, on the chute too.
    let last = frame(&ours.join("frames/8000.bin"), 8000);
    assert_eq!(last, states(&theirs.join("final.dump")));
    assert!(last.values().filter(|(_, velocity)| velocity.x > 0.1).count() > 20, "some have met the chute");
    let arrived = rows_of(&ours.join("arrivals.dump"));
    let released = noted(&theirs.join("passed.dump"));
    assert_eq!((arrived.len(), released.len()), (ghosts.len(), ghosts.len()));
    for (row, (_, tag, (place, velocity))) in arrived.iter().zip(&released) {
        let own = (row[0] as u32, vec3(row[4], row[5], row[6]), vec3(row[7], row[8], row[9]));
        assert_eq!(own, (*tag, *place, *velocity));
    }
}

#[test]
fn a_set_up_moves_nobody() {
    let plant = scene("tests/scenes/hopper", &[]);
    let job = job(&plant, "chute");
    let settings = LiggghtsSettings::default();
    let order = order(&job, 1e-5, 8000, &settings);
    let ghosts = lattice([5, 5, 4], vec3(-0.009, -0.009, 0.1903), 0.0045, 0.004, vec3(0.0, 0.0, -0.5));
    let last = |change: &dyn Fn(String) -> String| {
        let case = TempDir::new().unwrap();
        deck::write(&order, case.path()).unwrap();
        enter(case.path(), groups::RECORDED, &ghosts);
        paths(case.path(), &order.schedule, &ghosts, 0.19);
        let file = case.path().join("in.liggghts");
        fs::write(&file, change(fs::read_to_string(&file).unwrap())).unwrap();
        run(case.path());
        frame(&case.path().join("frames/8000.bin"), 8000)
    };
    let changed = |deck: String, from: &str, to: &str| {
        assert!(deck.contains(from), "{from}");
        deck.replace(from, to)
    };
    let at_every_batch = |deck: String| changed(deck, "label entered\n", "label entered\nvariable set_up equal 1\n");
    let without = last(&|deck| deck);
    let with = last(&at_every_batch);
    // What LIGGGHTS' own set-up does: the first half step goes with its forces.
    let as_it_is = last(&|deck| changed(at_every_batch(deck), "if \"${holds} > 0\"", "if \"${holds} < 0\""));

    // To rounding: 4e-16 m after 80 set-ups. Collisions may spread that, on another machine or with other libraries, by a few orders.
    assert!(farthest(&without, &with) < 1e-12, "{}", farthest(&without, &with));
    assert!(farthest(&without, &as_it_is) > 1e-6, "{}", farthest(&without, &as_it_is));
}

#[test]
fn two_ranks_pass_as_many_as_one() {
    let plant = plant("\"1 ms\"");
    let job = job(&plant, "hopper");
    let on = |ranks: u32| LiggghtsSettings { ranks, contacts: false, ..LiggghtsSettings::default() };
    // The hopper stands at one end of the box and in its middle across: cuts across y, none by height.
    for (ranks, grid) in [(2, "processors 1 2 1 "), (4, "processors 2 2 1 "), (6, "processors 1 6 1 ")] {
        let settings = on(ranks);
        let text = render(&order(&job, 1e-5, 7000, &settings)).unwrap();
        let line = text.lines().find(|line| line.starts_with("processors")).unwrap();
        assert!(line.starts_with(grid), "{ranks}: {line}");
    }
    let spheres = lattice([5, 5, 6], vec3(-0.009, -0.009, 0.2025), 0.0045, 0.004, Vec3::zeros());
    let passed = [1, 2].map(|ranks| {
        let settings = on(ranks);
        let order = order(&job, 1e-5, 7000, &settings);
        let folder = TempDir::new().unwrap();
        deck::write(&order, folder.path()).unwrap();
        enter(folder.path(), groups::ACTIVE, &spheres);
        assert!(run_on(ranks, folder.path()).contains("tollgate end time 7000"));
        passages(folder.path(), &order)
    });
    assert!(passed[0].len() > 20, "{}", passed[0].len());
    assert!(passed[0].keys().eq(passed[1].keys()), "{} and {}", passed[0].len(), passed[1].len());
}
