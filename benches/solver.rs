//! Benches of the native solver's time step, named module::case::operation.
//!
//! All scenes are made here, without files: a bed of spheres at rest on a floor between walls. `cargo bench` prints a time
//! for each; the size-ratio pair gives the time per contact, whose ratio is the cost of a wide size distribution.

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use std::time::{Duration, Instant};
use tollgate::dem::law::{Compatibility, LawSettings, NormalLaw, RollingLaw, TangentialLaw};
use tollgate::dem::particles::Path;
use tollgate::dem::simulation::{Setup, Simulation};
use tollgate::dem::sleep::SleepSettings;
use tollgate::geometry::motion::Motion;
use tollgate::geometry::part::{Part, Surface, TriangleMesh, Trigger};
use tollgate::material::{Elasticity, Material, MaterialTable, PairContact, PairProperties};
use tollgate::math::lanes::SimdLevel;
use tollgate::math::{Bounds, Vec3, vec3};
use tollgate::particle::{Body, ParticleId, ParticleState};

const LAW: LawSettings = LawSettings {
    normal: NormalLaw::HertzMindlin,
    tangential: TangentialLaw::Total,
    tangential_damping: true,
    attraction: true,
    rolling: RollingLaw::None,
    characteristic_velocity: 1.0,
    compatibility: Compatibility::Tollgate,
};
const DENSITY: f64 = 2500.0;

fn materials(friction: f64) -> MaterialTable {
    let elasticity = Some(Elasticity::Isotropic { youngs_modulus: 5e6, poissons_ratio: 0.45 });
    let mut table = MaterialTable::new(vec![Material { name: "grain".into(), density: Some(DENSITY), elasticity }]);
    let contact = PairContact::Restitution { coefficient: 0.3 };
    table.set_pair(0, 0, PairProperties { contact, sliding_friction: friction, rolling_friction: 0.0 });
    table
}

fn part(name: &str, surface: Surface) -> Part {
    Part {
        name: name.into(),
        material: 0,
        surface,
        motion: Motion::default(),
        appears: Trigger::Always,
        disappears: Trigger::Never,
    }
}

/// Floor and four sides of a box with a square floor.
fn box_planes(width: f64) -> Vec<Part> {
    let plane = |name, point, normal| part(name, Surface::Plane { point, normal });
    vec![
        plane("floor", Vec3::zeros(), vec3(0.0, 0.0, 1.0)),
        plane("left", Vec3::zeros(), vec3(1.0, 0.0, 0.0)),
        plane("right", vec3(width, 0.0, 0.0), vec3(-1.0, 0.0, 0.0)),
        plane("front", Vec3::zeros(), vec3(0.0, 1.0, 0.0)),
        plane("back", vec3(0.0, width, 0.0), vec3(0.0, -1.0, 0.0)),
    ]
}

/// A floor of `side` x `side` squares, two triangles each.
fn mesh_floor(width: f64, side: u32) -> Part {
    let step = width / f64::from(side);
    let corner = |i: u32, j: u32| i * (side + 1) + j;
    let vertices =
        (0..=side).flat_map(|i| (0..=side).map(move |j| vec3(f64::from(i) * step, f64::from(j) * step, 0.0))).collect();
    let squares = (0..side).flat_map(|i| (0..side).map(move |j| (i, j)));
    let triangles = squares
        .flat_map(|(i, j)| {
            let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
            [[a, b, c], [a, c, d]]
        })
        .collect();
    part("floor", Surface::Mesh(TriangleMesh { vertices, triangles }))
}

fn simulation(particles: &[ParticleState], parts: Vec<Part>, size: Vec3, timestep: f64, skin: f64) -> Simulation {
    let mut simulation = Simulation::new(Setup {
        body: Body::Sphere,
        gravity: vec3(0.0, 0.0, -9.81),
        domain: Bounds { minimum: [0.0; 3], maximum: size.into() },
        periodic: [false; 3],
        materials: materials(0.5),
        law: LAW,
        classes: Vec::new(),
        feeds: Vec::new(),
        parts,
        seed: 1,
        timestep,
        skin,
        overlap_limit: 0.5,
        energy: false,
        momentum: false,
        sleeping: None,
        threads: 1,
        simd: SimdLevel::best(),
    });
    simulation.insert(particles);
    simulation
}

fn sphere(serial: usize, radius: f64, position: Vec3) -> ParticleState {
    ParticleState {
        id: ParticleId::new(0, serial as u64),
        material: 0,
        radius,
        density: DENSITY,
        position,
        velocity: Vec3::zeros(),
        spin: Vec3::zeros(),
    }
}

/// Even spread in 0..1: the fractional parts of multiples of an irrational number.
fn spread(index: usize, salt: f64) -> f64 {
    (index as f64 * 0.618_033_988_749_894_9 + salt).fract()
}

/// Spheres of 3 to 5 mm, loosely stacked layer by layer over a floor of `side` x `side`, then let settle for `steps`.
fn settled_bed(side: usize, layers: usize, floor: fn(f64) -> Vec<Part>, steps: u32) -> Simulation {
    let pitch = 5.05e-3;
    let width = side as f64 * pitch;
    let particles: Vec<ParticleState> = (0..side * side * layers)
        .map(|k| {
            let radius = 1.5e-3 + 1e-3 * spread(k, 0.0);
            let room = 0.5 * pitch - radius;
            let cell = vec3((k % side) as f64, (k / side % side) as f64, (k / (side * side)) as f64);
            let jitter = vec3(spread(k, 0.1), spread(k * 7, 0.2), 0.0) * 2.0 - vec3(1.0, 1.0, 0.0);
            sphere(k, radius, (cell + Vec3::repeat(0.5)) * pitch + jitter * room)
        })
        .collect();
    let size = vec3(width, width, (layers + 1) as f64 * pitch);
    let mut simulation = simulation(&particles, floor(width), size, 4e-5, 0.5e-3);
    for _ in 0..steps {
        simulation.step().expect("a stable bed");
    }
    simulation
}

fn timed_steps(simulation: &mut Simulation, iterations: u64) -> Duration {
    let started = Instant::now();
    for _ in 0..iterations {
        simulation.step().expect("a stable bed");
    }
    started.elapsed()
}

fn dense_bed(criterion: &mut Criterion) {
    let mut bed = settled_bed(20, 24, box_planes, 3000);
    let count = bed.particle_count() as u64;
    let mut group = criterion.benchmark_group("dem::dense_bed_9600");
    group.throughput(Throughput::Elements(count)).sample_size(20);
    group.bench_function("step", |bencher| bencher.iter_custom(|n| timed_steps(&mut bed, n)));
    group.finish();
}

/// The same bed once it has come to rest: asleep but for some that keep moving, and woken. At a time step that lets accelerations come to
/// rest too.
fn sleeping_bed(criterion: &mut Criterion) {
    let settled = settled_bed(20, 24, box_planes, 12_000);
    let sleeping = Some(SleepSettings { speed: 5e-3, hold: 5e-3, acceleration: 0.02 * 9.81 });
    let setup = Setup { timestep: 1e-5, ..settled.setup().clone() };
    let asking = Setup { sleeping, ..setup.clone() };
    let mut asleep = Simulation::start_from(asking, &settled.record()).expect("the same bed");
    let sleepers = |bed: &Simulation| bed.views().filter(|view| view.path == Path::Asleep).count();
    for _ in 0..30 {
        timed_steps(&mut asleep, 1000);
        if sleepers(&asleep) == asleep.particle_count() {
            break;
        }
    }
    assert!(10 * sleepers(&asleep) > 9 * asleep.particle_count(), "{} sleep", sleepers(&asleep));
    let mut awake = Simulation::start_from(setup, &asleep.record()).expect("the same materials");
    let mut group = criterion.benchmark_group("dem::sleeping_bed_9600");
    group.throughput(Throughput::Elements(settled.particle_count() as u64)).sample_size(20);
    for turn in 0..2 {
        group.bench_function(format!("awake_{turn}"), |bencher| bencher.iter_custom(|n| timed_steps(&mut awake, n)));
        group.bench_function(format!("asleep_{turn}"), |bencher| bencher.iter_custom(|n| timed_steps(&mut asleep, n)));
    }
    group.finish();
}

/// Inserting nothing but one far particle rebuilds cells and lists, as a used-up skin does.
fn rebuild(criterion: &mut Criterion) {
    let bed = settled_bed(20, 24, box_planes, 500);
    let particles = bed.particles();
    let size = bed.setup().domain.size();
    criterion.bench_function("dem::dense_bed_9600::neighbour_rebuild", |bencher| {
        bencher.iter(|| simulation(&particles, box_planes(size.x), size, 4e-5, 0.5e-3).particle_count());
    });
}

/// One layer of spheres at rest: a contact with the floor each, hardly any with each other.
fn wall_contacts(criterion: &mut Criterion) {
    for (name, floor) in [
        ("plane", (|width| vec![box_planes(width).swap_remove(0)]) as fn(f64) -> Vec<Part>),
        ("mesh_200_triangles", |width| vec![mesh_floor(width, 10)]),
        ("mesh_20000_triangles", |width| vec![mesh_floor(width, 100)]),
    ] {
        let mut layer = settled_bed(40, 1, floor, 500);
        let mut group = criterion.benchmark_group(format!("dem::wall_layer_1600_{name}"));
        group.throughput(Throughput::Elements(layer.particle_count() as u64)).sample_size(20);
        group.bench_function("step", |bencher| bencher.iter_custom(|n| timed_steps(&mut layer, n)));
        group.finish();
    }
}

/// Big spheres bedded in small ones, 1:20 in diameter, against the small ones alone. Throughput counts contacts.
fn size_ratio(criterion: &mut Criterion) {
    for (name, big) in [("monodisperse", 0), ("size_ratio_20", 4)] {
        let mut bed = mixed_bed(big);
        let contacts = bed.contacts().len() as u64;
        assert!(contacts > 10_000, "a bed with contacts, not {contacts}");
        let mut group = criterion.benchmark_group(format!("dem::{name}"));
        group.throughput(Throughput::Elements(contacts)).sample_size(20);
        group.bench_function("step_per_contact", |bencher| bencher.iter_custom(|n| timed_steps(&mut bed, n)));
        group.finish();
    }
}

/// Small spheres of 2 mm on a lattice with `big` spheres of 40 mm put in place of those they displace, settled.
fn mixed_bed(big: usize) -> Simulation {
    let (small_radius, big_radius) = (1e-3, 20e-3);
    let pitch = 2.0 * small_radius * 1.005;
    let (side, layers) = (45, 22);
    let width = f64::from(side) * pitch;
    let floor_height = big_radius * 1.01;
    let centres: Vec<Vec3> = (0..big)
        .map(|k| {
            vec3(0.25 + 0.5 * (k % 2) as f64, 0.25 + 0.5 * (k / 2) as f64, 0.0) * width + vec3(0.0, 0.0, floor_height)
        })
        .collect();
    let cells = (0..side * side * layers).map(|k| {
        let cell = vec3(f64::from(k % side), f64::from(k / side % side), f64::from(k / (side * side)));
        (cell + Vec3::repeat(0.5)) * pitch
    });
    let free = cells.filter(|at| centres.iter().all(|c| (c - at).norm() > big_radius + 1.01 * small_radius));
    let mut particles: Vec<ParticleState> =
        centres.iter().enumerate().map(|(k, &c)| sphere(k, big_radius, c)).collect();
    particles.extend(free.enumerate().map(|(k, at)| sphere(big + k, small_radius, at)));
    let size = vec3(width, width, 2.0 * f64::from(layers) * pitch);
    let mut bed = simulation(&particles, box_planes(width), size, 2e-5, 0.2e-3);
    for _ in 0..4000 {
        bed.step().expect("a stable bed");
    }
    bed
}

criterion_group!(benches, dense_bed, sleeping_bed, rebuild, wall_contacts, size_ratio);
criterion_main!(benches);
