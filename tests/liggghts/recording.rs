//! Recording at a gate, on a small case by hand: spheres run out of a box.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::atomic::AtomicBool;
use tempfile::TempDir;
use tollgate::backend::liggghts::record::Recordings;
use tollgate::backend::liggghts::record::contacts::{PAIR_COLUMNS, WALL_COLUMNS, dump_arguments, touch_box};
use tollgate::backend::liggghts::record::samples::{Row, Sample};
use tollgate::backend::liggghts::tags::Tags;
use tollgate::backend::liggghts::{COLUMNS, Schedule};
use tollgate::backend::stage::{RecordResult, StageRequest};
use tollgate::gate::Cadence;
use tollgate::gate::crossing::{ContactPartner, Crossing};
use tollgate::gate::id_map::IdMap;
use tollgate::gate::stream::reader::StreamReader;
use tollgate::geometry::plane::{Aperture, GatePlane};
use tollgate::math::{Vec3, vec3};
use tollgate::output::progress::Verbosity;
use tollgate::particle::ParticleId;
use tollgate::scene::Scene;
use tollgate::scene::gate::{Exclusion, ExclusionMode, Fate, Gate, PassingPoint, PathRecording};
use tollgate::stage::split::Recording;

const DECK: &str = include_str!("outlet.in");
const TIMESTEP: f64 = 1e-5;
const BATCH: u64 = 100;
const LARGEST: f64 = 0.005;
const PLANE: f64 = 0.047;
const GRAVITY: Vec3 = vec3(0.0, 0.0, -9.81);
/// Numbers that `tangential history` remembers of a contact.
const HISTORY: usize = 3;

const SCENE: &str = r#"
version = 1
seed = 1
[contact]
law = "hertz-mindlin"
[material.stone]
density = "3300 kg/m3"
youngs_modulus = "5 MPa"
poissons_ratio = 0.3
[[pair]]
between = ["stone", "stone"]
restitution = 0.4
friction = 0.5
[solver]
timestep = "1e-5 s"
[particle.stone]
material = "stone"
diameter_mm = 5
[domain]
min_mm = [-50, -50, -10]
max_mm = [50, 50, 130]
[[part]]
name = "walls"
material = "stone"
shape = "stl"
file = "meshes/walls.stl"
[[part]]
name = "floor"
material = "stone"
shape = "stl"
file = "meshes/floor.stl"
[[feed]]
name = "start"
kind = "file"
file = "start.csv"
[end]
time = "1 s"
"#;

/// A case in a folder of its own.
struct Case {
    folder: TempDir,
    spheres: u64,
    look: u64,
    steps: u64,
}

impl Case {
    /// Samples every `look` time steps of what lies within `near` \[m\] of height; contacts where `contacts`.
    fn new(look: u64, steps: u64, near: [f64; 2], contacts: bool) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let case = folder.path();
        for name in ["samples/outlet", "contacts", "meshes"] {
            fs::create_dir_all(case.join(name)).unwrap();
        }
        write_meshes(&case.join("meshes"));
        let spheres = write_spheres(case);
        let [pairs, walls] = [("pairs", PAIR_COLUMNS), ("walls", WALL_COLUMNS)].map(|(name, columns)| {
            let group = if name == "pairs" { "touch" } else { "fresh" };
            format!("write_dump {group} local contacts/{name} {}", dump_arguments(name, columns + HISTORY))
        });
        let (first, every) = if contacts {
            (format!("{pairs}\n{walls}"), format!("\"{pairs}\" \"{walls}\""))
        } else {
            Default::default()
        };
        let mut deck = DECK.replace("CONTACTS_FIRST", &first);
        for (name, text) in [
            ("CONTACTS", every),
            ("COLUMNS", COLUMNS.to_owned()),
            ("TOUCH_BOX", touch_box("fresh", LARGEST, [true; 3])),
            ("NEAR_FROM", near[0].to_string()),
            ("NEAR_TO", near[1].to_string()),
            ("LOOK", look.to_string()),
            ("BATCHES", (steps / BATCH).to_string()),
        ] {
            // The first line says what these words stand for.
            let (head, body) = deck.split_once('\n').unwrap();
            deck = format!("{head}\n{}", body.replace(name, &text));
        }
        fs::write(case.join("in.liggghts"), deck).unwrap();
        Self { folder, spheres, look, steps }
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    fn run(&self) {
        let mut command = Command::new("stdbuf");
        command.args(["-oL", "liggghts", "-in", "in.liggghts"]).current_dir(self.path());
        let output = command.output().expect("stdbuf and liggghts are installed");
        let text = String::from_utf8_lossy(&output.stdout);
        let tail: Vec<&str> = text.lines().rev().take(5).collect();
        assert!(output.status.success(), "{:?}\n{tail:?}", output.status);
    }

    fn schedule(&self) -> Schedule {
        let cadence = Cadence { look: self.look, hand_over: BATCH };
        Schedule { timestep: TIMESTEP, cadence, steps: self.steps }
    }

    fn tags(&self) -> Tags {
        let mut tags = Tags::default();
        for serial in 0..self.spheres {
            tags.add(ParticleId::new(0, serial));
        }
        tags
    }

    fn scene(&self, contacts: bool, keep: bool) -> Scene {
        let read = tollgate::scene::read_text(SCENE, "scene.toml", self.path(), &[]);
        let (mut scene, _) = read.unwrap_or_else(|findings| panic!("{findings:?}"));
        (scene.liggghts.contacts, scene.liggghts.keep_samples) = (contacts, keep);
        scene
    }

    /// Reads all samples into a stream, and the stream.
    fn record(&self, gate: &Gate, contacts: bool) -> (RecordResult, Vec<Crossing>) {
        let records = [Recording { gate: gate.clone(), observes: false }];
        let interrupted = AtomicBool::new(false);
        let request = StageRequest {
            folder: self.path(),
            key: "key",
            stage: "filling",
            resume: false,
            verbosity: Verbosity::Silent,
            interrupted: &interrupted,
            records: &records,
            replays: &[],
            kick: None,
        };
        let scene = self.scene(contacts, true);
        let mut recordings =
            Recordings::open(&scene, &request, &self.schedule(), self.path(), &self.tags(), "3.8.0").unwrap();
        for batch in 0..=self.steps / BATCH {
            recordings.read_up_to(batch * BATCH).unwrap();
        }
        let present: IdMap<()> = self.end().map(|row| (self.tags().id(row.tag).unwrap(), ())).collect();
        recordings.settle(&present);
        let result = recordings.finish(Vec::new(), true).unwrap().pop().unwrap();
        let reader = StreamReader::open(&self.path().join("streams/outlet")).unwrap();
        reader.verify(|_| {}).unwrap();
        let crossings = reader.crossings().map(Result::unwrap).collect();
        (result, crossings)
    }

    fn sample(&self, step: u64) -> Sample {
        let mut sample = Sample::default();
        sample.read(&self.path().join(format!("samples/outlet/{step}.bin")), step).unwrap();
        sample
    }

    /// All particles at the end.
    fn end(&self) -> impl Iterator<Item = Row> {
        let mut sample = Sample::default();
        sample.read(&self.path().join("end.bin"), self.steps).unwrap();
        sample.rows().collect::<Vec<_>>().into_iter()
    }
}

/// The inside of a box of 60 mm, and a floor with a square opening of 36 mm.
fn write_meshes(folder: &Path) {
    let square = |half: f64, z: f64| [[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]];
    let ring = |outer: [[f64; 3]; 4], inner: [[f64; 3]; 4]| {
        let mut triangles = Vec::new();
        for k in 0..4 {
            let next = (k + 1) % 4;
            triangles.push([outer[k], outer[next], inner[next]]);
            triangles.push([outer[k], inner[next], inner[k]]);
        }
        triangles
    };
    let (bottom, top, rim) = (square(0.03, 0.05), square(0.03, 0.12), square(0.018, 0.046));
    for (name, triangles) in [("walls", ring(bottom, top)), ("floor", ring(bottom, rim))] {
        let mut text = format!("solid {name}\n");
        for corners in triangles {
            text += "facet normal 0 0 0\nouter loop\n";
            corners.iter().for_each(|[x, y, z]| writeln!(text, "vertex {x:?} {y:?} {z:?}").unwrap());
            text += "endloop\nendfacet\n";
        }
        fs::write(folder.join(format!("{name}.stl")), text + "endsolid\n").unwrap();
    }
}

/// Layers of spheres of 3 to 5 mm in a lattice a little out of line; returns their number.
fn write_spheres(case: &Path) -> u64 {
    let (mut atoms, mut velocities, mut table) =
        (String::new(), String::new(), String::from("x_m,y_m,z_m,radius_m,material\n"));
    let mut count = 0_u64;
    for (layer, row, column) in (0..4).flat_map(|a| (0..10).flat_map(move |b| (0..10).map(move |c| (a, b, c)))) {
        count += 1;
        let jitter = |salt: u64| ((count * 7919 + salt * 104_729) % 1009) as f64 / 1009.0;
        let diameter = 0.003 + 0.002 * jitter(1);
        let place = |index: i32, salt: u64| -0.024_3 + 0.005_4 * f64::from(index) + 2e-4 * (jitter(salt) - 0.5);
        let (x, y, z) = (place(column, 2), place(row, 3), 0.054 + 0.005_4 * f64::from(layer));
        writeln!(atoms, "{count} 1 {diameter:?} 3300 {x:?} {y:?} {z:?}").unwrap();
        writeln!(velocities, "{count} 0 0 0 0 0 0").unwrap();
        writeln!(table, "{x:?},{y:?},{z:?},{:?},stone", diameter / 2.0).unwrap();
    }
    let data = format!("spheres\n\n{count} atoms\n\nAtoms\n\n{atoms}\nVelocities\n\n{velocities}");
    fs::write(case.join("init.data"), data).unwrap();
    fs::write(case.join("start.csv"), table).unwrap();
    count
}

fn gate(paths: Option<PathRecording>) -> Gate {
    Gate {
        name: "outlet".to_owned(),
        plane: GatePlane { point: vec3(0.0, 0.0, PLANE), normal: vec3(0.0, 0.0, -1.0), aperture: Aperture::Unbounded },
        passage: PassingPoint::Centre,
        exclusion: Exclusion { mode: ExclusionMode::Buffer, length: 0.012 },
        paths,
        returning: Fate::Keep,
        sitting: Fate::Keep,
    }
}

fn bits(vector: &Vec3) -> [u64; 3] {
    std::array::from_fn(|axis| vector[axis].to_bits())
}

#[test]
fn what_passes_is_recorded_with_its_bits_its_path_and_its_contacts() {
    let (look, steps) = (20, 14_000);
    let case = Case::new(look, steps, [0.0, 0.06], true);
    case.run();
    let (result, crossings) = case.record(&gate(Some(PathRecording { every: 50, length: 0.006 })), true);

    // Nobody is lost: who is not above the plane at the end has passed it, who is not there any more was excluded.
    let above = case.end().filter(|row| row.position.z > PLANE).count() as u64;
    let left = case.end().count() as u64;
    assert!(crossings.len() > 200, "only {} crossings", crossings.len());
    assert_eq!(crossings.len() as u64, case.spheres - above);
    let tally = &result.tally;
    assert_eq!((tally.recorded, tally.excluded), (crossings.len() as u64, case.spheres - left));
    assert_eq!((tally.came_around, tally.lost_after_crossing, tally.still_in_run), (0, 0, left - above));
    assert!(tally.free_flow.iter().map(|bin| bin.samples).sum::<u64>() > 1000);

    let manifest = result.manifest.unwrap();
    // Every 50 is rounded up to a multiple of the samples' distance.
    assert_eq!(manifest.origin.paths.unwrap().every, 60);
    assert_eq!((manifest.origin.backend.as_str(), manifest.origin.backend_version.as_str()), ("liggghts", "3.8.0"));

    for crossing in &crossings {
        let rows: Vec<Row> = case.sample(crossing.step).rows().collect();
        let own = rows.iter().find(|row| u64::from(row.tag) == crossing.state.id.serial() + 1).unwrap();
        check_state(crossing, own);
        check_contacts(crossing, own, &rows);
    }
    let touching = crossings.iter().filter(|crossing| !crossing.contacts.is_empty()).count();
    assert!(touching > 20, "only {touching} were in contact");
    assert!(tally.in_contact >= touching as u64);
    let partners = crossings.iter().flat_map(|crossing| &crossing.contacts).map(|contact| contact.partner);
    let parts: Vec<ContactPartner> =
        partners.filter(|partner| matches!(partner, ContactPartner::Part { .. })).collect();
    // Part 1 is the floor, of eight triangles; nobody touches the walls there.
    let floor = |partner: &ContactPartner| matches!(partner, ContactPartner::Part { part: 1, element: 0..8 });
    assert!(!parts.is_empty() && parts.iter().all(floor), "{parts:?}");
    check_paths(&case, &crossings);
    check_sums(&crossings);
}

fn check_state(crossing: &Crossing, own: &Row) {
    let state = &crossing.state;
    assert_eq!(bits(&state.position), bits(&own.position));
    assert_eq!((bits(&state.velocity), bits(&state.spin)), (bits(&own.velocity), bits(&own.spin)));
    assert_eq!(
        (state.radius.to_bits(), state.density.to_bits(), state.material),
        (own.radius.to_bits(), 3300.0_f64.to_bits(), 0)
    );
    assert_eq!(bits(&crossing.torque), bits(&own.torque));
    let mass = 4.0 / 3.0 * std::f64::consts::PI * state.radius.powi(3) * state.density;
    // f = F + m g to the round-off of m g.
    assert!((crossing.force + GRAVITY * mass - own.force).norm() <= 1e-9 * mass * GRAVITY.norm());
    // The passage lies on the plane, before the sample.
    assert!((crossing.passage.position.z - PLANE).abs() < 1e-15);
    let late = crossing.step as f64 * TIMESTEP - crossing.passage.time;
    assert!((0.0..20.0 * TIMESTEP).contains(&(late - 1e-15)) || late == 0.0, "{late}");
}

/// The contacts with particles are those that the sample shows to overlap, with that overlap and direction.
fn check_contacts(crossing: &Crossing, own: &Row, rows: &[Row]) {
    let mut overlapping = 0;
    for other in rows.iter().filter(|row| row.tag != own.tag) {
        let branch = other.position - own.position;
        let overlap = own.radius + other.radius - branch.norm();
        let partner = ContactPartner::Particle(ParticleId::new(0, u64::from(other.tag) - 1));
        let found = crossing.contacts.iter().find(|contact| contact.partner == partner);
        // Beyond the ten digits of the dump there may be a contact or none.
        if overlap > 1e-11 {
            overlapping += 1;
            let found = found.unwrap_or_else(|| panic!("{:?} touches {partner:?}", crossing.state.id));
            assert!((found.overlap - overlap).abs() < 1e-11);
            assert!((found.normal - branch.normalize()).norm() < 1e-7);
            let point = own.position + branch.normalize() * (own.radius - 0.5 * overlap);
            assert!((found.point - point).norm() < 1e-10);
            assert!(found.tangential_force.dot(&found.normal).abs() < 1e-6 * found.normal_force.norm().max(1e-9));
        } else {
            assert!(found.is_none() || overlap > -1e-11);
        }
    }
    let with_particles =
        crossing.contacts.iter().filter(|contact| matches!(contact.partner, ContactPartner::Particle(_)));
    assert_eq!(with_particles.count(), overlapping);
}

/// Paths are the samples' bits, at multiples of 60 time steps.
fn check_paths(case: &Case, crossings: &[Crossing]) {
    let with_path: Vec<&Crossing> = crossings.iter().filter(|crossing| !crossing.path.is_empty()).collect();
    assert!(with_path.len() > crossings.len() / 2);
    for crossing in with_path.iter().step_by(10) {
        assert!(crossing.path_start.is_multiple_of(60));
        for (motion, step) in crossing.path.iter().zip((crossing.path_start..).step_by(60)) {
            let sample = case.sample(step);
            let row = sample.rows().find(|row| u64::from(row.tag) == crossing.state.id.serial() + 1).unwrap();
            assert_eq!(bits(&motion.position), bits(&row.position));
            let mass = 4.0 / 3.0 * std::f64::consts::PI * row.radius.powi(3) * row.density;
            let difference = (motion.acceleration * mass - row.force).norm();
            assert!(difference <= 1e-14 * row.force.norm());
        }
    }
}

/// Contact forces add up to the force, but for the dashpots: the computes see velocities half a time step later.
fn check_sums(crossings: &[Crossing]) {
    let mut shares: Vec<f64> = Vec::new();
    for crossing in crossings.iter().filter(|crossing| !crossing.contacts.is_empty()) {
        let sum: Vec3 = crossing.contacts.iter().map(|contact| contact.normal_force + contact.tangential_force).sum();
        shares.push((sum - crossing.force).norm() / crossing.force.norm());
    }
    shares.sort_by(f64::total_cmp);
    assert!(shares[shares.len() / 2] < 0.05, "{shares:?}");
}

#[test]
fn the_passage_between_samples_agrees_with_finer_samples() {
    let steps = 9_000;
    let coarse_case = Case::new(20, steps, [0.03, 0.052], false);
    coarse_case.run();
    let (_, coarse) = coarse_case.record(&gate(None), false);
    // A crossing moves less than 1.5 mm in four time steps.
    let fine_case = Case::new(4, steps, [0.0455, 0.0485], false);
    fine_case.run();
    let (_, fine) = fine_case.record(&gate(None), false);
    assert!(coarse.len() > 100);
    assert_eq!(coarse.len(), fine.len());
    let (mut free, mut worst) = (0, 0.0_f64);
    for crossing in &coarse {
        let other = fine.iter().find(|other| other.state.id == crossing.state.id).unwrap();
        let (a, b) = (&crossing.passage, &other.passage);
        let distance = (a.position - b.position).norm();
        let speed = a.velocity.norm();
        let interval = 20.0 * TIMESTEP;
        if crossing.force == Vec3::zeros() && other.force == Vec3::zeros() && (b.velocity - a.velocity).norm() < 1e-9 {
            // A parabola, which a cubic polynomial is exactly; LIGGGHTS' own step differs from it by dt^2 g / 8.
            free += 1;
            assert!(distance < TIMESTEP * TIMESTEP * 9.81, "{distance}");
            assert!((a.time - b.time).abs() * speed < TIMESTEP * TIMESTEP * 9.81);
        } else {
            // Velocities that change by dv within the interval T: at most dv T / 8 at its middle, here of both runs' curves.
            let change = (crossing.state.velocity - other.state.velocity).norm() + (b.velocity - a.velocity).norm();
            let bound = 0.25 * interval * (change + 0.02);
            assert!(distance < bound, "{distance} m, {bound} m");
            worst = worst.max(distance);
        }
    }
    assert!(free > 30, "only {free} fell freely");
    assert!(worst < 20e-6, "{worst} m");
}

/// The stream of a case whose samples are damaged says which, and where.
#[test]
fn a_half_written_or_missing_sample_is_found() {
    let case = Case::new(20, 400, [0.03, 0.052], false);
    case.run();
    let records = [Recording { gate: gate(None), observes: false }];
    let interrupted = AtomicBool::new(false);
    let folder: PathBuf = case.path().to_owned();
    let request = StageRequest {
        folder: &folder,
        key: "key",
        stage: "filling",
        resume: false,
        verbosity: Verbosity::Silent,
        interrupted: &interrupted,
        records: &records,
        replays: &[],
        kick: None,
    };
    let scene = case.scene(false, false);
    let mut recordings = Recordings::open(&scene, &request, &case.schedule(), &folder, &case.tags(), "3.8.0").unwrap();
    recordings.read_up_to(100).unwrap();
    let left = |step: u64| case.path().join(format!("samples/outlet/{step}.bin")).exists();
    assert!(!left(0) && !left(100) && left(120), "what was read is removed, what was not is there");
    let damaged = case.path().join("samples/outlet/140.bin");
    let bytes = fs::read(&damaged).unwrap();
    fs::write(&damaged, &bytes[..bytes.len() - 9]).unwrap();
    let text = recordings.read_up_to(400).unwrap_err().to_string();
    assert!(text.contains("140.bin") && text.contains(&format!("ends at byte {}", bytes.len() - 9)), "{text}");
    fs::remove_file(&damaged).unwrap();
    let text = recordings.read_up_to(400).unwrap_err().to_string();
    assert!(text.contains("140.bin"), "{text}");
}
