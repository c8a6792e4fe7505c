//! Decks, run by the binary.

use std::fmt::Write;
use std::fs;
use std::path::Path;
use std::process::Command;
use tempfile::TempDir;
use tollgate::backend::liggghts::deck::{self, DeckOrder, Ghosts};
use tollgate::backend::liggghts::{Schedule, groups, launch};
use tollgate::gate::Cadence;
use tollgate::math::{Vec3, vec3};
use tollgate::scene::Scene;
use tollgate::scene::backend::{DeckPlace, LiggghtsSettings};
use tollgate::stage::split::{StageJob, stage_jobs};

const CADENCE: Cadence = Cadence { look: 20, hand_over: 100 };

/// A particle of a case: tag, material from 0, diameter [m], density [kg/m3], place [m], velocity [m/s].
pub type Particle = (u32, u16, f64, f64, Vec3, Vec3);

pub fn scene(path: &str, settings: &[(&str, &str)]) -> Scene {
    let settings: Vec<(String, String)> = settings.iter().map(|(k, v)| ((*k).into(), (*v).into())).collect();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    tollgate::scene::read(&root.join(path), &settings).unwrap().0
}

pub fn job(scene: &Scene, stage: &str) -> StageJob {
    stage_jobs(scene).into_iter().find(|job| job.name == stage).unwrap()
}

pub fn order<'a>(job: &'a StageJob, timestep: f64, steps: u64, settings: &'a LiggghtsSettings) -> DeckOrder<'a> {
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
pub fn enter(case: &Path, group: &str, particles: &[Particle]) {
    let mut atoms = format!("particles\n\n{} atoms\n\nAtoms\n\n", particles.len());
    let mut velocities = "\nVelocities\n\n".to_owned();
    for (tag, material, diameter, density, at, velocity) in particles {
        writeln!(atoms, "{tag} {} {diameter} {density} {} {} {}", material + 1, at.x, at.y, at.z).unwrap();
        writeln!(velocities, "{tag} {} {} {} 0 0 0", velocity.x, velocity.y, velocity.z).unwrap();
    }
    let batches = case.join("batches");
    fs::write(batches.join("0.in"), "# batch 0\n").unwrap();
    fs::write(batches.join("entering"), "-1\n").unwrap();
    if !particles.is_empty() {
        fs::write(batches.join("0.data"), atoms + &velocities).unwrap();
        let entry = format!("read_data batches/0.data add\ngroup {group} id 1:{}\n", particles.len());
        fs::write(batches.join("0.in"), entry).unwrap();
    }
}

/// Runs the binary in a case; its output.
pub fn run(case: &Path) -> String {
    run_on(1, case)
}

/// Runs the binary in a case on so many ranks; its output.
pub fn run_on(ranks: u32, case: &Path) -> String {
    let line = launch::command_line(case, ranks, &[]);
    let done = Command::new("sh").args(["-c", &line]).output().expect("there is a shell");
    let said = String::from_utf8_lossy(&done.stdout).into_owned();
    assert!(done.status.success(), "{}\n{said}", done.status);
    assert!(!said.contains("ERROR"), "{said}");
    // LIGGGHTS does not list this combination of models, and contacts are recorded of meshes only.
    let known = ["The contact model you specified is not located", "Compute wall/gran/local detected primitive wall"];
    let mut lines = said.lines();
    while let Some(line) = lines.next() {
        if let Some(warning) = line.strip_prefix("WARNING:") {
            let warning = if warning.trim().is_empty() { lines.next().unwrap_or_default() } else { warning };
            assert!(known.iter().any(|known| warning.trim().starts_with(known)), "{warning}\n{said}");
        }
    }
    said
}

/// Rows of particles in a text dump.
pub fn rows_of(path: &Path) -> Vec<Vec<f64>> {
    let text = fs::read_to_string(path).unwrap();
    let numbers =
        text.lines().map(|line| line.split_ascii_whitespace().map(str::parse).collect::<Result<Vec<f64>, _>>());
    numbers.filter_map(Result::ok).filter(|row| row.len() > 6).collect()
}

/// The last row of a case's series.
fn last_row(case: &Path) -> Vec<f64> {
    let text = fs::read_to_string(case.join("series.txt")).unwrap();
    text.lines().last().unwrap().split(' ').map(|value| value.parse().unwrap()).collect()
}

/// A block of spheres at rest: `count` along each axis from `corner` on [m], `pitch` [m] apart.
pub fn lattice(count: [u32; 3], corner: Vec3, pitch: f64, diameter: f64, velocity: Vec3) -> Vec<Particle> {
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
    enter(case, groups::ACTIVE, &lattice([5, 5, 8], vec3(-0.009, -0.009, 0.2025), 0.0045, 0.004, Vec3::zeros()));
    let said = run(case);
    assert!(said.contains("tollgate event plate 0"), "{said}");
    assert!(said.contains("tollgate end time 9000"), "{said}");
    let removed = rows_of(&case.join("removed/outlet.dump"));
    let last = last_row(case);
    assert_eq!(last[2] as usize + removed.len(), 200, "nobody is lost");
    // 0.5 mm to the plate, then 10 mm to the plane and 6 mm behind it: the first layers are through after 60 ms.
    assert!(removed.len() >= 50 && removed.iter().all(|row| row[6] < 0.184), "{}", removed.len());
}

/// Writes paths and releases of ghosts that fall at `speed` [m/s] and are released at the first sample at which they are below `plane` [m].
pub fn paths(case: &Path, schedule: &Schedule, ghosts: &[Particle], plane: f64) {
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
    let order = order(&job, 1e-5, 5000, &settings);
    let folder = TempDir::new().unwrap();
    let case = folder.path();
    deck::write(&order, case).unwrap();
    let ghosts = lattice([5, 5, 4], vec3(-0.009, -0.009, 0.1903), 0.0045, 0.004, vec3(0.0, 0.0, -0.5));
    enter(case, groups::RECORDED, &ghosts);
    paths(case, &order.schedule, &ghosts, 0.19);
    let said = run(case);
    assert!(said.contains("tollgate end time 5000"), "{said}");
    let released: usize = rows_of(&case.join("arrivals.dump")).len();
    assert_eq!(released, ghosts.len());
    for row in rows_of(&case.join("arrivals.dump")) {
        let ghost = &ghosts[row[0] as usize - 1];
        // Along its path by whole samples, to round-off: three sums of numbers below 1 m.
        assert!((row[4] - ghost.4.x).abs() < 1e-15 && (row[5] - ghost.4.y).abs() < 1e-15, "{row:?}");
        assert!(row[6] <= 0.19 + 1e-15 && row[6] > 0.19 - 0.5 * 20.0 * 1e-5 - 1e-15, "{row:?}");
        assert_eq!(row[7..10], [0.0, 0.0, -0.5], "the path's velocity");
    }
    let last = last_row(case);
    assert_eq!((last[0], last[2]), (5000.0, ghosts.len() as f64));
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
        enter(folder.path(), groups::ACTIVE, &grains);
        let said = run(folder.path());
        assert!(said.contains("tollgate end time 2000"), "{said}");
        let last = last_row(folder.path());
        assert_eq!((last[0], last[2]), (2000.0, grains.len() as f64));
    }
}

/// Materials, a domain of 400 mm edge, and no gravity where `gravity` is 0.
pub fn inline(gravity: f64, parts: &str) -> Scene {
    let head = format!(
        r#"
version = 1
title = "inline"
gravity_m_per_s2 = [0, 0, {gravity:?}]
[domain]
min_mm = [-200, -200, -200]
max_mm = [200, 200, 200]
[contact]
law = "hertz-mindlin"
[material.glass]
density = "3300 kg/m3"
youngs_modulus = "5 MPa"
poissons_ratio = 0.25
[[pair]]
between = ["glass", "glass"]
restitution = 0.5
friction = 0.5
[particle.bead]
material = "glass"
diameter_mm = 4
[[feed]]
name = "block"
kind = "fill"
particle = "bead"
region = {{ shape = "box", min_mm = [-20, -20, 150], max_mm = [20, 20, 190] }}
amount = 25
[end]
time = "0.1 s"
[output]
series = "2 ms"
"#
    );
    tollgate::scene::read_text(&(head + parts), "inline.toml", Path::new("."), &[]).unwrap().0
}

fn crate_with(name: &str, motions: &str) -> String {
    format!(
        "[[part]]\nname = \"{name}\"\nmaterial = \"glass\"\nshape = \"box\"\nmin_mm = [10, 20, -30]\nmax_mm = [30, 50, 10]\n{motions}"
    )
}

#[test]
fn parts_move_as_the_scene_says() {
    let turn = "[[part.motion]]\nkind = \"rotate\"\norigin_mm = [10, 0, 5]\naxis = [0, 1, 0]\nrate_rpm = -300\n";
    let shift = "[[part.motion]]\nkind = \"translate\"\nvelocity_m_per_s = [0.5, -1, 0.2]\n";
    let shake = "[[part.motion]]\nkind = \"oscillate\"\namplitude_mm = [0, 3, 4]\nfrequency = \"40 Hz\"\n";
    let parts = [
        ("turns", turn.to_owned()),
        ("shifts", format!("{shift}from = \"4 ms\"\nuntil = \"12 ms\"\n")),
        ("shakes", shake.to_owned()),
        ("both", format!("{shift}{shake}")),
        ("one-by-one", format!("{turn}until = \"8 ms\"\n{shift}from = \"10 ms\"\n")),
        ("comes", format!("appears = \"5 ms\"\ndisappears = \"15 ms\"\n{shake}")),
    ];
    let text: String = parts.iter().map(|(name, motions)| crate_with(name, motions)).collect();
    let plant = inline(-9.81, &text);
    let job = StageJob::uncut(&plant);
    let mut settings = LiggghtsSettings::default();
    settings.lines.insert(DeckPlace::BeforeRun, vec!["dump meshes all mesh/stl 500 meshes/at*.stl".to_owned()]);
    let order = order(&job, 1e-5, 2000, &settings);
    let folder = TempDir::new().unwrap();
    deck::write(&order, folder.path()).unwrap();
    enter(folder.path(), groups::ACTIVE, &lattice([2, 2, 1], vec3(0.1, 0.1, 0.15), 0.01, 0.004, Vec3::zeros()));
    let said = run(folder.path());
    assert!(said.contains("tollgate event comes 1 500") && said.contains("tollgate event comes 0 1500"), "{said}");
    for step in [500_u32, 1000, 1500, 2000] {
        let mesh = tollgate::geometry::stl::read_stl(&folder.path().join(format!("meshes/at{step}.stl"))).unwrap();
        for part in &plant.parts {
            let tollgate::geometry::part::Surface::Mesh(own) = &part.surface else { panic!("boxes are meshes") };
            // Events follow the dump of their time step.
            let there = part.name != "comes" || [1000, 1500].contains(&step);
            let time = f64::from(step) * 1e-5;
            // LIGGGHTS' meshes are up to a time step ahead, and the dump has single-step old places: 2 steps at 2 m/s.
            let allowed = 2.0 * 1e-5 * 2.0;
            for vertex in &own.vertices {
                let expected = part.motion.pose(time).apply(vertex);
                let nearest = mesh.vertices.iter().map(|other| (other - expected).norm()).fold(f64::INFINITY, f64::min);
                if there {
                    assert!(nearest < allowed, "{} at {time} s: {nearest} m", part.name);
                }
            }
        }
        let beside = mesh.vertices.iter().filter(|vertex| vertex.x.max(vertex.y).max(vertex.z) > 0.208).count();
        assert_eq!(beside > 0, ![1000, 1500].contains(&step), "what is not there is beside the domain, at step {step}");
    }
}

#[test]
fn recorded_particles_go_on_as_the_gate_says_until_they_are_taken_out() {
    let disc = "point_mm = [0, 0, 0]\nnormal = [0, 0, -1]\naperture = { shape = \"disc\", radius_mm = 12 }\n";
    let slot = "point_mm = [0, 0, 0]\nnormal = [0, 0, -1]\naperture = { shape = \"rectangle\", side_a_mm = [21, 0, 0], side_b_mm = [0, 13, 0] }\n";
    let skew = "point_mm = [0, 0, 0]\nnormal = [1, 0, -1]\naperture = { shape = \"rectangle\", side_a_mm = [21, 0, 21], side_b_mm = [0, 13, 0] }\n";
    let low = "passage = \"lowest-point\"\n";
    // 5 x 5 beads 5 mm apart about the axis: 21 of them within 12 mm; 5 x 3 in the slot.
    for (mode, plane, passage, through) in [
        ("constant", disc, "", 21),
        ("ballistic", slot, low, 15),
        ("constant", skew, "", 15),
        ("buffer", skew, low, 15),
    ] {
        let gate = format!(
            "[[gate]]\nname = \"the-gate\"\n{plane}{passage}exclusion = {{ mode = \"{mode}\", length_mm = 6 }}\n\
             [[stage]]\nname = \"up\"\nfeeds = [\"block\"]\nrecords = [\"the-gate\"]\n[[stage]]\nname = \"down\"\n\
             [[stage.replay]]\ngate = \"the-gate\"\npath = \"ballistic\"\nlength_mm = 6\n"
        );
        let floor = "[[part]]\nname = \"lid\"\nmaterial = \"glass\"\nshape = \"box\"\nmin_mm = [-20, -20, 190]\nmax_mm = [20, 20, 195]\n";
        let plant = inline(-9.81, &(floor.to_owned() + &gate));
        let job = job(&plant, "up");
        let settings = LiggghtsSettings::default();
        let order = DeckOrder { ghosts: Ghosts::default(), ..order(&job, 1e-5, 5000, &settings) };
        let folder = TempDir::new().unwrap();
        deck::write(&order, folder.path()).unwrap();
        let beads = lattice([5, 5, 1], vec3(-0.010, -0.010, 0.015), 0.005, 0.004, vec3(0.0, 0.0, -0.6));
        enter(folder.path(), groups::ACTIVE, &beads);
        let said = run(folder.path());
        let removed = rows_of(&folder.path().join("removed/the-gate.dump"));
        assert_eq!(removed.len(), through, "{mode} {plane}\n{said}");
        for row in removed {
            let fallen = row[9] + 0.6;
            // Constant: frozen at a sample, a whole number of 20 steps of free fall; else that of a batch.
            let every = if mode == "constant" { 20.0 } else { 100.0 };
            let samples = fallen / (-9.81 * 1e-5 * every);
            assert!((samples - samples.round()).abs() < 1e-8, "{mode}: {samples}");
            assert_eq!(row[7], 0.0, "{mode}: nothing pushes it aside");
        }
    }
}
