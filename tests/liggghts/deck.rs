//! Decks, run by the binary.

use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;
use tollgate::backend::liggghts::deck::{self, DeckOrder, Ghosts};
use tollgate::backend::liggghts::{Schedule, groups};
use tollgate::gate::Cadence;
use tollgate::math::{Vec3, vec3};
use tollgate::scene::Scene;
use tollgate::scene::backend::LiggghtsSettings;
use tollgate::stage::split::{StageJob, stage_jobs};

const CADENCE: Cadence = Cadence { look: 20, hand_over: 100 };

/// A particle of a case: tag, material from 0, diameter [m], density [kg/m3], place [m], velocity [m/s].
type Particle = (u32, u16, f64, f64, Vec3, Vec3);

fn scene(path: &str, settings: &[(&str, &str)]) -> Scene {
    let settings: Vec<(String, String)> = settings.iter().map(|(k, v)| ((*k).into(), (*v).into())).collect();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    tollgate::scene::read(&root.join(path), &settings).unwrap().0
}

fn job(scene: &Scene, stage: &str) -> StageJob {
    stage_jobs(scene).into_iter().find(|job| job.name == stage).unwrap()
}

fn order<'a>(job: &'a StageJob, timestep: f64, steps: u64, settings: &'a LiggghtsSettings) -> DeckOrder<'a> {
    let schedule = Schedule { timestep, cadence: CADENCE, steps };
    DeckOrder {
        scene: &job.scene,
        stage: &job.name,
        schedule,
        skin: 1e-3,
        records: &job.records,
        ghosts: Ghosts { recorded: !job.replays.is_empty(), ..Ghosts::default() },
        particles_to_come: 0,
        last_entry: 0,
        bounds: deck::bounds(&job.scene, &schedule),
        settings,
    }
}

/// Writes what enters at step 0, and nothing at all other batches.
fn enter(case: &Path, schedule: &Schedule, group: &str, particles: &[Particle]) {
    let mut atoms = format!("particles\n\n{} atoms\n\nAtoms\n\n", particles.len());
    let mut velocities = "\nVelocities\n\n".to_owned();
    for (tag, material, diameter, density, at, velocity) in particles {
        writeln!(atoms, "{tag} {} {diameter} {density} {} {} {}", material + 1, at.x, at.y, at.z).unwrap();
        writeln!(velocities, "{tag} {} {} {} 0 0 0", velocity.x, velocity.y, velocity.z).unwrap();
    }
    let batches = case.join("batches");
    for step in (0..schedule.steps).step_by(schedule.cadence.hand_over as usize) {
        fs::write(batches.join(format!("{step}.in")), format!("# batch {step}\n")).unwrap();
    }
    if !particles.is_empty() {
        fs::write(batches.join("0.data"), atoms + &velocities).unwrap();
        let entry = format!("read_data batches/0.data add\ngroup {group} id 1:{}\n", particles.len());
        fs::write(batches.join("0.in"), entry).unwrap();
    }
}

/// Runs the binary in a case; its output.
fn run(case: &Path) -> String {
    let done = Command::new("stdbuf")
        .args(["-oL", "liggghts", "-in", "in.liggghts"])
        .current_dir(case)
        .output()
        .expect("liggghts is installed");
    let said = String::from_utf8_lossy(&done.stdout).into_owned();
    assert!(done.status.success(), "{}\n{said}", done.status);
    assert!(!said.contains("ERROR"), "{said}");
    let known = "The contact model you specified is not located in any whitelist.";
    let mut lines = said.lines();
    while let Some(line) = lines.next() {
        assert!(
            !line.starts_with("WARNING") || lines.next().is_some_and(|next| next.trim() == known),
            "{line}\n{said}"
        );
    }
    said
}

/// A block of spheres at rest: `count` along each axis from `corner` on [m], `pitch` [m] apart.
fn lattice(count: [u32; 3], corner: Vec3, pitch: f64, diameter: f64, velocity: Vec3) -> Vec<Particle> {
    let mut particles = Vec::new();
    for (i, j, k) in (0..count[2]).flat_map(|k| (0..count[1]).flat_map(move |j| (0..count[0]).map(move |i| (i, j, k))))
    {
        let place = corner + vec3(f64::from(i), f64::from(j), f64::from(k)) * pitch;
        particles.push((particles.len() as u32 + 1, 0, diameter, 3300.0, place, velocity));
    }
    particles
}

#[test]
fn the_hopper_opens_once_at_rest_and_hands_over_what_passes() {
    let plant = scene(
        "tests/scenes/hopper",
        &[("part.plate.disappears", "{ at_rest = { speed = \"100 mm/s\", hold = \"1 ms\", not_before = \"1 ms\" } }")],
    );
    let job = job(&plant, "hopper");
    let settings = LiggghtsSettings::default();
    let order = order(&job, 1e-5, 9000, &settings);
    let folder = TempDir::new().unwrap();
    let case = folder.path();
    deck::write(&order, case).unwrap();
    enter(
        case,
        &order.schedule,
        groups::ACTIVE,
        &lattice([5, 5, 8], vec3(-0.009, -0.009, 0.2025), 0.0045, 0.004, Vec3::zeros()),
    );
    let said = run(case);
    assert!(said.contains("tollgate event plate 0"), "{said}");
    assert!(said.contains("tollgate end time 9000"), "{said}");
}

/// Writes paths and releases of ghosts that fall at `speed` [m/s] and are released at the first sample at which they are below `plane` [m].
fn paths(case: &Path, schedule: &Schedule, ghosts: &[Particle], plane: f64) {
    fs::create_dir_all(case.join("paths")).unwrap();
    let names = ["px", "py", "pz", "qx", "qy", "qz", "wx", "wy", "wz", "release"];
    let mut texts = names.map(|_| String::new());
    let interval = schedule.timestep * schedule.cadence.look as f64;
    let released = |ghost: &Particle, sample: u64| ghost.4.z + ghost.5.z * interval * sample as f64 <= plane;
    for sample in 0..=schedule.steps / schedule.cadence.look + 1 {
        let steered: Vec<&Particle> =
            ghosts.iter().filter(|ghost| sample > 0 && !released(ghost, sample - 1)).collect();
        for (column, text) in texts.iter_mut().enumerate() {
            let rows = steered.iter().filter(|ghost| column < 9 || released(ghost, sample));
            let rows: Vec<String> = rows
                .map(|(tag, _, _, _, at, velocity)| {
                    let at = at + velocity * (interval * sample as f64);
                    let value = [at.x, at.y, at.z, velocity.x, velocity.y, velocity.z, 0.0, 0.0, 0.0, 1.0][column];
                    format!("{tag} {value}\n")
                })
                .collect();
            write!(text, "{}\n{}", rows.len(), rows.concat()).unwrap();
        }
    }
    for (name, text) in names.iter().zip(texts) {
        fs::write(case.join("paths").join(name), text).unwrap();
    }
}

#[test]
fn ghosts_on_recorded_paths_become_particles_that_fall_on_the_chute() {
    let plant = scene("tests/scenes/hopper", &[]);
    let job = job(&plant, "chute");
    let settings = LiggghtsSettings::default();
    let order = order(&job, 1e-5, 9000, &settings);
    let folder = TempDir::new_in("/tmp/deck").unwrap();
    let folder = folder.keep();
    let case = folder.as_path();
    deck::write(&order, case).unwrap();
    let ghosts = lattice([5, 5, 4], vec3(-0.009, -0.009, 0.1903), 0.0045, 0.004, vec3(0.0, 0.0, -0.5));
    enter(case, &order.schedule, groups::RECORDED, &ghosts);
    paths(case, &order.schedule, &ghosts, 0.19);
    let said = run(case);
    println!("{}", case.display());
    assert!(said.contains("tollgate end time 9000"), "{said}");
}

#[test]
fn the_sinter_chute_is_taken_as_it_is() {
    let plant = scene("examples/sinter-chute", &[]);
    let settings = LiggghtsSettings::default();
    for (stage, height) in [("hopper", 0.64), ("chute-40", 0.52)] {
        let job = job(&plant, stage);
        let order = DeckOrder { ghosts: Ghosts::default(), ..order(&job, 1e-5, 2000, &settings) };
        let folder = TempDir::new().unwrap();
        deck::write(&order, folder.path()).unwrap();
        let grains = lattice([6, 6, 5], vec3(-0.014, -0.012, height), 0.0045, 0.004, vec3(0.0, 0.0, -0.5));
        enter(folder.path(), &order.schedule, groups::ACTIVE, &grains);
        let said = run(folder.path());
        assert!(said.contains("tollgate end time 2000"), "{said}");
        let rows = fs::read_to_string(folder.path().join("series.txt")).unwrap();
        let last: Vec<f64> = rows.lines().last().unwrap().split(' ').map(|value| value.parse().unwrap()).collect();
        assert_eq!((last[0], last[2]), (2000.0, grains.len() as f64), "{rows}");
        println!("{rows}");
    }
}
