use super::*;
use crate::backend::liggghts::Schedule;
use crate::backend::liggghts::deck::parts::walls;
use crate::gate::Cadence;
use crate::gate::crossing::ContactPartner;
use crate::gate::crossing::Crossing;
use crate::gate::stream::reader::StreamReader;
use crate::geometry::plane::{Aperture, GatePlane};
use crate::math::vec3;
use crate::output::progress::Verbosity;
use crate::scene::gate::{Exclusion, ExclusionMode, Fate, Gate, PassingPoint, PathRecording};
use std::sync::atomic::AtomicBool;
use tempfile::TempDir;

const TIMESTEP: f64 = 1e-5;
const RADIUS: f64 = 0.002;
const DENSITY: f64 = 2500.0;
const G: f64 = 9.81;
const LOOK: u64 = 20;
const BATCH: u64 = 100;

const SCENE: &str = r#"
version = 1
seed = 1
[contact]
law = "hertz-mindlin"
[material.glass]
density = "2500 kg/m3"
youngs_modulus = "5 MPa"
poissons_ratio = 0.3
[[pair]]
between = ["glass", "glass"]
restitution = 0.4
friction = 0.5
[solver]
timestep = "1e-5 s"
[particle.bead]
material = "glass"
diameter_mm = 4
[domain]
min_mm = [-50, -50, -50]
max_mm = [50, 50, 50]
[[part]]
name = "plane"
material = "glass"
shape = "plane"
point_mm = [0, 0, -50]
normal = [0, 0, 1]
[[part]]
name = "lid"
material = "glass"
shape = "box"
min_mm = [-40, -40, 40]
max_mm = [-35, 40, 45]
[[part]]
name = "pipe"
material = "glass"
shape = "cylinder"
start_mm = [30, 0, 30]
end_mm = [30, 0, 40]
radius_mm = 5
[[feed]]
name = "start"
kind = "fill"
particle = "bead"
region = { shape = "box", min_mm = [-10, -10, 10], max_mm = [10, 10, 20] }
amount = 10
[end]
time = "1 s"
"#;

fn scene() -> Scene {
    let read = crate::scene::read_text(SCENE, "scene.toml", Path::new(""), &[]);
    read.unwrap_or_else(|findings| panic!("{findings:?}")).0
}

/// A gate in the plane z = 0, passed downwards.
fn gate() -> Gate {
    Gate {
        name: "outlet".to_owned(),
        plane: GatePlane {
            point: Vec3::zeros(),
            normal: vec3(0.0, 0.0, -1.0),
            aperture: Aperture::Disc { radius: 0.03 },
        },
        passage: PassingPoint::Centre,
        exclusion: Exclusion { mode: ExclusionMode::Buffer, length: 0.01 },
        paths: Some(PathRecording { every: 30, length: 0.003 }),
        returning: Fate::Keep,
        sitting: Fate::Keep,
    }
}

/// Particle `tag` at a time step, with a force \[N\] besides its weight.
#[derive(Clone, Copy)]
struct Bead {
    tag: u32,
    position: Vec3,
    velocity: Vec3,
    force: Vec3,
}

/// Falls freely from `height` \[m\] at rest at time step 0.
fn falling(tag: u32, x: f64, height: f64, step: u64) -> Bead {
    let time = step as f64 * TIMESTEP;
    let (position, velocity) = (vec3(x, 0.0, height - 0.5 * G * time * time), vec3(0.0, 0.0, -G * time));
    Bead { tag, position, velocity, force: Vec3::zeros() }
}

/// The deck takes out at a batch, after its sample, what is beyond the exclusion plane.
fn is_taken_out(height: f64, step: u64) -> bool {
    step > 0 && falling(1, 0.0, height, (step - 1) / BATCH * BATCH).position.z <= -0.01
}

fn write_sample(case: &Path, gate: &str, step: u64, beads: &[Bead]) {
    let mut bytes = Vec::new();
    bytes.extend((step as i64).to_le_bytes());
    bytes.extend((beads.len() as i64).to_le_bytes());
    bytes.extend(0_i32.to_le_bytes());
    (0..6).for_each(|_| bytes.extend(1_i32.to_le_bytes()));
    (0..6).for_each(|_| bytes.extend(0.0_f64.to_le_bytes()));
    bytes.extend(19_i32.to_le_bytes());
    bytes.extend(1_i32.to_le_bytes());
    bytes.extend((beads.len() as i32 * 19).to_le_bytes());
    let weight = Body::Sphere.mass(RADIUS, DENSITY) * vec3(0.0, 0.0, -G);
    for bead in beads {
        let mut values = vec![f64::from(bead.tag), 1.0, RADIUS, DENSITY];
        let vectors = [bead.position, bead.velocity, vec3(1.0, 2.0, 3.0), bead.force + weight, vec3(0.0, 1e-7, 0.0)];
        vectors.iter().for_each(|vector| values.extend(vector.iter()));
        values.iter().for_each(|value: &f64| bytes.extend(value.to_le_bytes()));
    }
    let folder = case.join(files::SAMPLES).join(gate);
    fs::create_dir_all(&folder).unwrap();
    fs::write(folder.join(format!("{step}.bin")), bytes).unwrap();
}

/// Opens the recordings of `gates` in a case whose folder is also the stage's.
fn open(folder: &TempDir, scene: &Scene, gates: &[Gate], observes: bool) -> Result<Recordings, BackendError> {
    let records: Vec<Recording> = gates.iter().map(|gate| Recording { gate: gate.clone(), observes }).collect();
    let interrupted = AtomicBool::new(false);
    let request = StageRequest {
        folder: folder.path(),
        key: "key",
        stage: "filling",
        resume: false,
        verbosity: Verbosity::Silent,
        interrupted: &interrupted,
        records: &records,
        replays: &[],
        kick: None,
    };
    let cadence = Cadence { look: LOOK, hand_over: BATCH };
    let schedule = Schedule { timestep: TIMESTEP, cadence, steps: 10_000 };
    let mut tags = Tags::default();
    for serial in 0..50 {
        tags.add(ParticleId::new(0, 49 - serial));
    }
    Recordings::open(scene, &request, &schedule, folder.path(), &tags, "3.8.0")
}

fn crossings(folder: &TempDir, gate: &str) -> Vec<Crossing> {
    let reader = StreamReader::open(&folder.path().join("streams").join(gate)).unwrap();
    reader.verify(|_| {}).unwrap();
    reader.crossings().map(Result::unwrap).collect()
}

#[test]
fn free_fall_passes_where_and_when_it_must() {
    let folder = tempfile::tempdir().unwrap();
    let mut scene = scene();
    scene.liggghts.contacts = false;
    let mut recordings = open(&folder, &scene, &[gate()], false).unwrap();
    let heights = [0.002, 0.0035, 0.008];
    for step in (0..=5000).step_by(LOOK as usize) {
        let beads = (1..).zip(heights).filter(|(_, height)| !is_taken_out(*height, step));
        let beads: Vec<Bead> = beads.map(|(tag, height)| falling(tag, 0.001 * f64::from(tag), height, step)).collect();
        write_sample(folder.path(), "outlet", step, &beads);
        recordings.read_up_to(step).unwrap();
    }
    assert!(recordings.bytes_read() > 0);
    assert!(!folder.path().join("samples/outlet/5000.bin").exists(), "what has been read is removed");
    let result = recordings.finish(Vec::new(), true).unwrap().pop().unwrap();
    let found = crossings(&folder, "outlet");
    assert_eq!((found.len(), result.tally.recorded, result.tally.in_contact), (3, 3, 0));
    // The lowest one alone has come to the exclusion plane.
    assert_eq!((result.tally.excluded, result.tally.came_around, result.tally.still_in_run), (1, 0, 2));
    for (crossing, (height, serial)) in found.iter().zip(heights.into_iter().zip([49, 48, 47])) {
        assert_eq!(crossing.state.id, ParticleId::new(0, serial));
        let time = (2.0 * height / G).sqrt();
        // The polynomial is the parabola; what is left is round-off of the time, 1e-16 of some ms, and of the place, 1e-18 m.
        assert!((crossing.passage.time - time).abs() < 1e-15 + 1e-17 / (G * time));
        assert!(crossing.passage.position.z.abs() < 1e-17);
        assert!((crossing.passage.velocity.z + G * time).abs() < 1e-12);
        assert_eq!(crossing.step, ((time / TIMESTEP / LOOK as f64).ceil() as u64) * LOOK);
        let at = falling(1, crossing.state.position.x, height, crossing.step);
        assert_eq!((crossing.state.position, crossing.force), (at.position, Vec3::zeros()));
        // Stored every 30, rounded up to 40.
        assert!(crossing.path_start.is_multiple_of(40));
        for (motion, step) in crossing.path.iter().zip((crossing.path_start..).step_by(40)) {
            assert_eq!(motion.position, falling(1, crossing.state.position.x, height, step).position);
            assert!((motion.acceleration - vec3(0.0, 0.0, -G)).norm() < 1e-14);
        }
    }
    let manifest = result.manifest.unwrap();
    assert_eq!((manifest.origin.paths.unwrap().every, manifest.origin.contacts), (40, false));
    assert_eq!(manifest.origin.feeds, ["start"]);
}

#[test]
fn ghosts_behind_the_plane_confuse_no_figure() {
    let folder = tempfile::tempdir().unwrap();
    let mut scene = scene();
    scene.liggghts.contacts = false;
    let ballistic = Gate { exclusion: Exclusion { mode: ExclusionMode::Ballistic, length: 0.01 }, ..gate() };
    let mut recordings = open(&folder, &scene, &[ballistic], false).unwrap();
    for step in (0..=5000).step_by(LOOK as usize) {
        let mut bead = falling(1, 0.0, 0.001, step);
        // As a ghost it is pressed by those above, which means nothing; before the plane nothing touches it.
        if bead.position.z < -0.0002 {
            bead.force = vec3(5.0, 0.0, 3.0);
        }
        let there = !is_taken_out(0.001, step);
        write_sample(folder.path(), "outlet", step, &[bead][..usize::from(there)]);
    }
    recordings.read_up_to(5000).unwrap();
    let result = recordings.finish(Vec::new(), true).unwrap().pop().unwrap();
    assert_eq!((result.tally.recorded, result.tally.in_contact, result.tally.excluded), (1, 0, 1));
    assert!(result.tally.free_flow.is_empty());
    assert_eq!(result.crossings.contact_share, 0.0);
    assert_eq!(crossings(&folder, "outlet")[0].force, Vec3::zeros());
}

#[test]
fn a_force_counts_as_contact_and_contacts_are_joined_at_their_own_gate() {
    let folder = tempfile::tempdir().unwrap();
    let scene = scene();
    let lower =
        Gate { name: "lower".to_owned(), plane: GatePlane { point: vec3(0.0, 0.0, -0.001), ..gate().plane }, ..gate() };
    let mut recordings = open(&folder, &scene, &[gate(), lower], false).unwrap();
    fs::create_dir_all(folder.path().join("contacts")).unwrap();
    let (mut pairs, mut walls) = (String::new(), String::new());
    for step in (0..=3000).step_by(LOOK as usize) {
        let mut beads = [falling(1, 0.0, 0.001, step), falling(2, 0.0039, 0.001, step)];
        let push = vec3(-1e-3, 0.0, 0.0);
        (beads[0].force, beads[1].force) = (push, -push);
        for gate in ["outlet", "lower"] {
            write_sample(folder.path(), gate, step, &beads);
        }
        let head = |rows: usize, columns: usize| {
            let names: String = (1..=columns).map(|column| format!("c_x[{column}] ")).collect();
            format!(
                "ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ENTRIES\n{rows}\nITEM: BOX BOUNDS ff ff ff\n0 1\n0 1\n0 1\nITEM: ENTRIES {names}\n"
            )
        };
        let z = beads[0].position.z;
        pairs += &head(1, 19);
        pairs += &format!("0 0 {z} 0.0039 0 {z} 1 2 0 -0.001 0 0 0 0 0 1e-6 0 0 1e-4 \n");
        walls += &head(1, 19);
        walls += &format!("-0.0019 0 {z} 0 0 {z} 2 4 1 0.002 0 0 0 0 0 0 0 0 1e-4 \n");
    }
    fs::write(folder.path().join("contacts/pairs"), pairs).unwrap();
    fs::write(folder.path().join("contacts/walls"), walls).unwrap();
    recordings.read_up_to(3000).unwrap();
    let results = recordings.finish(Vec::new(), true).unwrap();
    assert!(!folder.path().join("contacts/pairs").exists());
    for (result, name) in results.iter().zip(["outlet", "lower"]) {
        assert_eq!((result.tally.recorded, result.tally.in_contact), (2, 2));
        let found = crossings(&folder, name);
        // Sorted by our identities: tag 2 is particle 48, tag 1 particle 49.
        let partners =
            |crossing: &Crossing| crossing.contacts.iter().map(|contact| contact.partner).collect::<Vec<_>>();
        assert_eq!(partners(&found[0]), [ContactPartner::Particle(ParticleId::new(0, 49))]);
        let wall = ContactPartner::Part { part: 2, element: 0 };
        assert_eq!(partners(&found[1]), [ContactPartner::Particle(ParticleId::new(0, 48)), wall]);
        assert!((found[1].force - vec3(-1e-3, 0.0, 0.0)).norm() < 1e-15);
    }
}

#[test]
fn meshes_are_the_scene_s_parts_also_planes_and_those_that_go() {
    let text = SCENE.replace("max_mm = [-35, 40, 45]", "max_mm = [-35, 40, 45]\ndisappears = \"0.1 s\"");
    let (scene, _) = crate::scene::read_text(&text, "scene.toml", Path::new(""), &[]).unwrap();
    let cadence = Cadence { look: LOOK, hand_over: BATCH };
    let schedule = Schedule { timestep: TIMESTEP, cadence, steps: 10_000 };
    let walls = walls(&scene, &schedule, false);
    let meshes: Vec<&Part> = walls.iter().filter(|wall| wall.mesh().is_some()).map(|wall| wall.part).collect();
    assert_eq!(meshes, scene.parts.iter().collect::<Vec<_>>(), "a contact's mesh number is its part's");
}

#[test]
fn a_fate_that_is_an_error_ends_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let mut scene = scene();
    scene.liggghts.contacts = false;
    let stern = Gate { returning: Fate::Error, ..gate() };
    let mut recordings = open(&folder, &scene, &[stern], false).unwrap();
    for (step, z) in (0..).step_by(LOOK as usize).zip([0.001, -0.001, 0.0005]) {
        let bead = Bead { tag: 1, position: vec3(0.0, 0.0, z), velocity: Vec3::zeros(), force: Vec3::zeros() };
        write_sample(folder.path(), "outlet", step, &[bead]);
    }
    recordings.read_up_to(20).unwrap();
    let error = recordings.read_up_to(40).unwrap_err();
    assert!(matches!(error, BackendError::Gate { steps: 40, .. }), "{error}");
    assert!(error.to_string().contains("came back over it"), "{error}");
}

#[test]
fn who_is_not_there_at_the_end_was_lost() {
    let folder = tempfile::tempdir().unwrap();
    let mut scene = scene();
    scene.liggghts.contacts = false;
    let mut recordings = open(&folder, &scene, &[gate()], false).unwrap();
    for step in [0, 20] {
        let sign = if step == 0 { 1.0 } else { -1.0 };
        let bead = |tag: u32| Bead {
            tag,
            position: vec3(0.005 * f64::from(tag), 0.0, 1e-4 * sign),
            ..falling(tag, 0.0, 0.0, 20)
        };
        write_sample(folder.path(), "outlet", step, &[bead(1), bead(2)]);
    }
    recordings.read_up_to(39).unwrap();
    recordings.settle(&std::iter::once((ParticleId::new(0, 48), ())).collect());
    let tally = recordings.tallies().next().unwrap().1;
    assert_eq!((tally.recorded, tally.lost_after_crossing, tally.still_in_run), (2, 1, 1));
    let result = recordings.finish(Vec::new(), false).unwrap().pop().unwrap();
    assert!(result.manifest.is_none(), "an unfinished run has no stream");
}

#[test]
fn a_sample_of_another_case_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut scene = scene();
    scene.liggghts.contacts = false;
    let mut recordings = open(&folder, &scene, &[gate()], false).unwrap();
    let bead = falling(51, 0.0, 0.01, 0);
    write_sample(folder.path(), "outlet", 0, &[bead]);
    let text = recordings.read_up_to(0).unwrap_err().to_string();
    assert!(text.contains("holds particle 51 of type 1; there are 50 particles"), "{text}");
}
