//! A large stream: a million crossings of two contacts each are written, read and verified in bounded time and memory.
//!
//! Not part of the ordinary suite, because it measures: `cargo test --release --test stream_volume -- --ignored --nocapture`.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]
#![expect(clippy::print_stderr, reason = "the figures are what is wanted")]

use std::fs;
use std::hint::black_box;
use std::path::Path;
use std::time::Instant;
use tollgate::gate::crossing::{ContactPartner, Crossing, Passage, StoredContact};
use tollgate::gate::stream::format::{Origin, Role};
use tollgate::gate::stream::reader::StreamReader;
use tollgate::gate::stream::writer::{Closing, StreamWriter};
use tollgate::geometry::plane::{Aperture, GatePlane};
use tollgate::material::Material;
use tollgate::math::{Vec3, vec3};
use tollgate::particle::{Body, ParticleId, ParticleState};
use tollgate::scene::gate::PassingPoint;

const CROSSINGS: u64 = 1_000_000;
const TIMESTEP: f64 = 1e-5;
/// Wall time for writing, reading and verifying [s].
const TIME_LIMIT: f64 = 10.0;
/// Peak resident memory [bytes].
const MEMORY_LIMIT: u64 = 200_000_000;

fn origin() -> Origin {
    Origin {
        gate: "outlet".to_owned(),
        plane: GatePlane { point: Vec3::zeros(), normal: vec3(0.0, 0.0, -1.0), aperture: Aperture::Unbounded },
        passage: PassingPoint::Centre,
        gravity: vec3(0.0, 0.0, -9.81),
        exclusion: None,
        paths: None,
        role: Role::HandOver,
        stage: "filling".to_owned(),
        stage_key: String::new(),
        backend: "native".to_owned(),
        backend_version: String::new(),
        numerics_version: 1,
        timestep: TIMESTEP,
        contacts: true,
        materials: vec![Material { name: "sinter".to_owned(), density: Some(3300.0), elasticity: None }],
        part_names: vec!["hopper".to_owned()],
        body: Body::Sphere,
        feeds: vec!["fill".to_owned()],
        laws: String::new(),
        provenance: Vec::new(),
    }
}

fn crossing(serial: u64) -> Crossing {
    let number = serial as f64 / 3.0;
    let vector = vec3(number, -1.0 / (number + 1.0), number.sqrt());
    let contact = |partner| StoredContact {
        partner,
        point: vector,
        normal: vec3(1.0, 0.0, 0.0),
        overlap: 1e-6,
        normal_force: vector,
        tangential_force: vector * 0.3,
        tangential_memory: vector * 1e-7,
        rolling_memory: vector * 1e-9,
    };
    let next = ParticleId::new(0, serial + 1);
    let wall = ContactPartner::Part { part: 0, element: serial as u32 % 1000 };
    Crossing {
        step: serial / 4 + 1,
        state: ParticleState {
            id: ParticleId::new(0, serial),
            material: 0,
            radius: 0.002,
            density: 3300.0,
            position: vector,
            velocity: vector * 0.1,
            spin: vector * 0.2,
        },
        force: vector * 0.5,
        torque: vector * 0.01,
        passage: Passage { time: (serial / 4) as f64 * TIMESTEP, position: vector, velocity: vector, spin: vector },
        contacts: vec![contact(ContactPartner::Particle(next)), contact(wall)],
        path: vec![],
        path_start: 0,
    }
}

/// Peak resident memory of this process [bytes], where the system tells.
fn peak_memory() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(1024 * line.trim().trim_end_matches(" kB").parse::<u64>().ok()?)
}

fn timed<T>(what: &str, total: &mut f64, action: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = action();
    let seconds = start.elapsed().as_secs_f64();
    *total += seconds;
    eprintln!("{what}: {seconds:.2} s");
    result
}

fn write(place: &Path) {
    let mut writer = StreamWriter::create(place, origin()).unwrap();
    (0..CROSSINGS).for_each(|serial| writer.push(crossing(serial)).unwrap());
    writer.finish(Closing::default()).unwrap();
}

#[test]
#[ignore = "measures time and memory: needs a release build"]
fn a_million_crossings_in_ten_seconds_and_200_mb() {
    let folder = tempfile::tempdir().unwrap();
    let place = folder.path().join("outlet");
    let mut total = 0.0;
    timed("write", &mut total, || write(&place));
    let reader = StreamReader::open(&place).unwrap();
    let read = timed("read", &mut total, || {
        reader.crossings().map(|crossing| black_box(crossing.unwrap()).contacts.len() as u64).sum::<u64>()
    });
    assert_eq!(read, 2 * CROSSINGS);
    let checked = timed("verify", &mut total, || reader.verify(|_| {}).unwrap());
    assert_eq!(checked.counts.crossings, CROSSINGS);
    let memory = peak_memory();
    let load = fs::read_to_string("/proc/loadavg").unwrap_or_default();
    eprintln!(
        "{total:.2} s in all, {} MB on disk, peak memory {memory:?} bytes, load {load}",
        checked.bytes / 1_000_000
    );
    assert!(total < TIME_LIMIT, "{total} s");
    assert!(memory.is_none_or(|memory| memory < MEMORY_LIMIT), "{memory:?}");
}
