//! Start states: made once, kept under `target/`, and handed to all codes as text with 17 digits.

use crate::bed::Bed;
use crate::code::{Code, last_state};
use crate::commands::{Options, run_scene};
use crate::mesh;
use crate::scene::{Scene, Start};
use crate::state::{write_liggghts, write_table};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use std::collections::HashMap;
use std::f64::consts::TAU;
use std::fs;
use std::path::Path;
use tollgate::math::{Vec3, vec3};
use tollgate::particle::{ParticleId, ParticleState};

const DENSITY: f64 = 2500.0;

/// Why a scene has no start state, if so.
pub fn missing(scene: &Scene) -> Option<String> {
    let (Start::Bed(bed) | Start::Tiles(bed, _)) = scene.start else { return None };
    let reason = Code::Liggghts.missing(1).filter(|_| !bed.folder().join("fill_bed.dump").exists());
    reason.map(|reason| format!("{}, whose bed LIGGGHTS settles: {reason}", scene.name))
}

/// Makes the state where it is not there yet, and writes it in the codes' formats into the scene's folder; how many spheres.
pub fn prepare(scene: &Scene, tollgate: &Path) -> usize {
    let folder = scene.folder();
    fs::create_dir_all(&folder).expect("a folder under target/");
    if scene.has_machine() {
        mesh::write(&folder);
    }
    let states = match scene.start {
        Start::Bed(bed) => bed.start(),
        Start::Cloud => cloud(scene),
        Start::Tiles(bed, tiles) => settled(scene, tollgate, 0.02, || tiled(&bed, tiles)),
        Start::TwoSizes => settled(scene, tollgate, 0.25, || two_sizes(scene)),
        Start::Hopper => settled(scene, tollgate, 0.5, in_funnel),
    };
    let states = cell_by_cell(states);
    write_table(&folder.join("fill_bed.csv"), &states);
    write_liggghts(&folder.join("fill_bed.data"), &states, &scene.size());
    states.len()
}

/// Neighbours in space become neighbours in the files: a code that keeps the order it is given is not the worse for it.
fn cell_by_cell(mut states: Vec<ParticleState>) -> Vec<ParticleState> {
    let cell = 4.0 * states.iter().map(|state| state.radius).fold(f64::INFINITY, f64::min);
    let key = |place: &Vec3| [place.z, place.y, place.x].map(|x| (x / cell).floor() as i64);
    states.sort_by_key(|state| (key(&state.position), state.id));
    states
}

/// What `loose` becomes in `time` [s] of tollgate; kept while scene file and settings are the same.
fn settled(scene: &Scene, tollgate: &Path, time: f64, loose: impl Fn() -> Vec<ParticleState>) -> Vec<ParticleState> {
    let folder = scene.folder().join("start");
    let (kept, dump) = (folder.join("made-of"), folder.join("start.dump"));
    let settings = settling(scene, time);
    let made_of = format!("{}\n{settings:?}\n", fs::read_to_string(scene.deck()).expect("a scene file"));
    if dump.exists() && fs::read_to_string(&kept).ok().as_ref() == Some(&made_of) {
        return last_state(&dump);
    }
    eprintln!("{}: settling the start state, once ...", scene.name);
    drop(fs::remove_dir_all(&folder));
    fs::create_dir_all(&folder).expect("a folder under target/");
    if scene.has_machine() {
        mesh::write(&folder);
    }
    write_table(&folder.join("fill_bed.csv"), &loose());
    let (file, out) = (folder.join("scene.toml"), folder.join("out"));
    fs::copy(scene.deck(), &file).expect("the scene file in its folder");
    let threads = std::thread::available_parallelism().map_or(1, |count| count.get() as u32);
    let options = Options { settings: &settings, threads, simd: None };
    let (_, state) = run_scene(tollgate, &file, options, &out, &folder.join("start.log"));
    fs::rename(state, &dump).expect("the settled state");
    drop(fs::remove_dir_all(out));
    fs::write(&kept, made_of).expect("what the state was made of");
    last_state(&dump)
}

/// Settings of the way into the packing, which does not matter: long steps, much dissipation, and deep overlaps on the way.
fn settling(scene: &Scene, time: f64) -> Vec<(String, String)> {
    let calm = Scene { timestep: 20.0, ..*scene };
    let mut settings = calm.settings((time * 1e6 / calm.timestep) as u64);
    settings.push(("pair.grain-grain.restitution".into(), "0.1".into()));
    settings.push(("solver.overlap_limit".into(), "0.9".into()));
    if scene.has_machine() {
        let floor = format!("[\"0 m\", \"0 m\", \"{} m\"]", mesh::OUTLET - 0.002);
        settings.extend([("part.floor.point".into(), floor), ("part.paddle.motion".into(), "[]".into())]);
    }
    settings
}

fn sphere(serial: usize, radius: f64, position: Vec3, velocity: Vec3) -> ParticleState {
    let id = ParticleId(serial as u64);
    ParticleState { id, material: 0, radius, density: DENSITY, position, velocity, spin: Vec3::zeros() }
}

/// A number in [0, 1).
fn unit(random: &mut ChaCha8Rng) -> f64 {
    (random.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

/// Diameters 3.0, 3.5, 4.0, 4.5 and 5.0 mm, as many of each, as in the beds.
fn radius_of(serial: usize) -> f64 {
    1.5e-3 + 0.25e-3 * (serial % 5) as f64
}

/// Random places without overlaps, velocities normal in each component.
fn cloud(scene: &Scene) -> Vec<ParticleState> {
    const COUNT: usize = 20_000;
    const DEVIATION: f64 = 0.5;
    let mut random = ChaCha8Rng::seed_from_u64(20);
    let largest = 5e-3;
    let mut cells: HashMap<[i64; 3], Vec<ParticleState>> = HashMap::new();
    let mut serial = 0;
    while serial < COUNT {
        let radius = radius_of(serial);
        let place = scene.size().map(|edge| radius + (edge - 2.0 * radius) * unit(&mut random));
        let home = place.map(|x| (x / largest).floor() as i64);
        let near = (0..27).map(|n| [home.x + n % 3 - 1, home.y + n / 3 % 3 - 1, home.z + n / 9 - 1]);
        let touches = |other: &ParticleState| (other.position - place).norm() < radius + other.radius;
        if near.filter_map(|cell| cells.get(&cell)).flatten().any(touches) {
            continue;
        }
        let velocity = Vec3::from_fn(|_, _| DEVIATION * normal(&mut random));
        cells.entry(home.into()).or_default().push(sphere(serial, radius, place, velocity));
        serial += 1;
    }
    cells.into_values().flatten().collect()
}

/// Box and Muller's normal number.
fn normal(random: &mut ChaCha8Rng) -> f64 {
    (-2.0 * (1.0 - unit(random)).ln()).sqrt() * (TAU * unit(random)).cos()
}

/// Beds side by side; spheres at the seams touched a wall there and now hardly touch each other.
fn tiled(bed: &Bed, tiles: [u32; 2]) -> Vec<ParticleState> {
    let one = bed.start();
    let places = (0..tiles[0]).flat_map(|x| (0..tiles[1]).map(move |y| vec3(f64::from(x), f64::from(y), 0.0)));
    let moved = places.flat_map(|place| {
        let shift = place * bed.width;
        one.iter().map(move |state| ParticleState { position: state.position + shift, ..*state })
    });
    moved.enumerate().map(|(serial, state)| ParticleState { id: ParticleId(serial as u64), ..state }).collect()
}

/// Small spheres on a lattice, and big ones in place of those they displace.
fn two_sizes(scene: &Scene) -> Vec<ParticleState> {
    const SMALL: f64 = 1e-3;
    const BIG: f64 = 10e-3;
    const COUNT: usize = 20_000;
    let pitch = scene.size[0] / 3.0;
    let at = |n: i32| vec3(f64::from(n % 3), f64::from(n / 3 % 3), f64::from(n / 9)) + Vec3::repeat(0.5);
    let big: Vec<Vec3> = (0..27).map(|n| at(n) * pitch).collect();
    let side = (scene.size[0] / (2.0 * SMALL * 1.02)) as usize;
    let pitch = scene.size[0] / side as f64;
    let lattice = (0..).map(|n: usize| {
        let cell = vec3((n % side) as f64, (n / side % side) as f64, (n / (side * side)) as f64);
        (cell + Vec3::repeat(0.5)) * pitch
    });
    let free = lattice.filter(|place| big.iter().all(|centre| (centre - place).norm() > BIG + SMALL)).take(COUNT);
    let radii = big.iter().map(|&place| (place, BIG)).chain(free.map(|place| (place, SMALL)));
    let mut random = ChaCha8Rng::seed_from_u64(10);
    let mut jolt = || Vec3::from_fn(|_, _| 0.02 * normal(&mut random));
    radii.enumerate().map(|(serial, (place, radius))| sphere(serial, radius, place, jolt())).collect()
}

/// Spheres on a lattice in the funnel's cylinder, on their way down.
fn in_funnel() -> Vec<ParticleState> {
    const COUNT: usize = 12_000;
    const PITCH: f64 = 5.1e-3;
    const SIDE: usize = 23;
    let mut random = ChaCha8Rng::seed_from_u64(12);
    let middle = (SIDE / 2) as f64;
    let lattice = (0..).map(|n: usize| {
        vec3((n % SIDE) as f64 - middle, (n / SIDE % SIDE) as f64 - middle, (n / (SIDE * SIDE)) as f64)
    });
    let inside = lattice.filter(|cell| vec3(cell.x, cell.y, 0.0).norm() * PITCH < mesh::RADIUS - 2.6e-3);
    let places = inside.map(|cell| mesh::on_axis(cell * PITCH + vec3(0.0, 0.0, mesh::SHOULDER + 3e-3)));
    let mut jolt = || vec3(0.05 * normal(&mut random), 0.05 * normal(&mut random), -0.4);
    places.take(COUNT).enumerate().map(|(n, place)| sphere(n, radius_of(n), place, jolt())).collect()
}
