//! A long recording on LIGGGHTS: a million crossings of one contact each are read from samples in bounded memory, and the
//! processor time for it is told.
//!
//! Not part of the ordinary suite, because it measures: `cargo test --release --test sample_volume -- --ignored --nocapture`.
#![expect(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::fmt::Write;
use std::fs::{self, File};
use std::io::{BufWriter, Write as _};
use std::path::Path;
use std::sync::atomic::AtomicBool;
use tollgate::backend::liggghts::record::Recordings;
use tollgate::backend::liggghts::record::contacts::{PAIRS_FILE, WALLS_FILE};
use tollgate::backend::liggghts::tags::Tags;
use tollgate::backend::liggghts::{Schedule, files};
use tollgate::backend::stage::StageRequest;
use tollgate::gate::Cadence;
use tollgate::geometry::plane::{Aperture, GatePlane};
use tollgate::math::{Vec3, vec3};
use tollgate::output::progress::Verbosity;
use tollgate::particle::ParticleId;
use tollgate::scene::gate::{Exclusion, ExclusionMode, Fate, Gate, PassingPoint, PathRecording};
use tollgate::stage::split::Recording;

const CROSSINGS: u64 = 1_000_000;
/// Crossings between two samples.
const RATE: u64 = 50;
const LOOK: u64 = 20;
const BATCH: u64 = 100;
const TIMESTEP: f64 = 1e-5;
/// Everything falls at this speed [m/s].
const SPEED: f64 = 2.0;
const RADIUS: f64 = 0.002;
const DENSITY: f64 = 2500.0;
/// Exclusion plane behind the gate [m].
const EXCLUSION: f64 = 0.004;
/// Samples begin so far before the gate [m].
const BEFORE: f64 = 0.006;
/// Peak resident memory [bytes].
const MEMORY_LIMIT: u64 = 200_000_000;
/// Processor time per megabyte of samples [s]. A run of 2 835 crossings in a hopper of 3 000 spheres gives 120 MB and takes the
/// solver 30 s, of which 3 % are 7.5 ms per megabyte.
const TIME_PER_MEGABYTE: f64 = 7.5e-3;

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
min_mm = [-500, -500, -500]
max_mm = [500, 500, 500]
[[part]]
name = "lid"
material = "glass"
shape = "box"
min_mm = [-400, -400, 400]
max_mm = [-350, 400, 450]
[[feed]]
name = "start"
kind = "fill"
particle = "bead"
region = { shape = "box", min_mm = [-100, -100, 100], max_mm = [100, 100, 200] }
amount = 10
[end]
time = "1 s"
"#;

/// Height of a particle at a sample [m]: 50 pass the plane between two samples.
fn height(serial: u64, sample: u64) -> f64 {
    let number = serial as f64 / RATE as f64 + 0.01;
    (number - sample as f64) * SPEED * TIMESTEP * LOOK as f64
}

/// Serial numbers of those near the gate at a sample; the deck has taken out whom it found beyond the exclusion plane at the last
/// batch.
fn near(sample: u64) -> std::ops::Range<u64> {
    let per_metre = RATE as f64 / (SPEED * TIMESTEP * LOOK as f64);
    let last_batch = sample.saturating_sub(1) / (BATCH / LOOK) * (BATCH / LOOK);
    let first = (last_batch * RATE).saturating_sub((EXCLUSION * per_metre) as u64);
    let end = sample * RATE + (BEFORE * per_metre) as u64;
    first.min(CROSSINGS)..end.min(CROSSINGS)
}

fn write_sample(folder: &Path, sample: u64) -> u64 {
    let weight = 4.0 / 3.0 * std::f64::consts::PI * RADIUS.powi(3) * DENSITY * -9.81;
    let range = near(sample);
    let count = range.end - range.start;
    let mut file = BufWriter::new(File::create(folder.join(format!("{}.bin", sample * LOOK))).unwrap());
    let mut put = |bytes: &[u8]| file.write_all(bytes).unwrap();
    put(&(sample * LOOK).to_le_bytes());
    put(&count.to_le_bytes());
    [0_i32, 1, 1, 1, 1, 1, 1].iter().for_each(|number| put(&number.to_le_bytes()));
    (0..6).for_each(|_| put(&0.0_f64.to_le_bytes()));
    [19_i32, 1, count as i32 * 19].iter().for_each(|number| put(&number.to_le_bytes()));
    for serial in range {
        let (x, z) = ((serial % RATE) as f64 * 0.005, height(serial, sample));
        let row = [
            [serial as f64 + 1.0, 1.0, RADIUS, DENSITY, x, 0.0, z],
            [0.0, 0.0, -SPEED, 1.0, 2.0, 3.0, 1e-4],
            [0.0, weight, 0.0, 1e-7, 0.0, f64::NAN, f64::NAN],
        ];
        row.iter().flatten().take(19).for_each(|value| put(&value.to_le_bytes()));
    }
    count
}

/// One contact with the next particle for each that has just passed.
fn write_contacts(pairs: &mut File, walls: &mut File, sample: u64) {
    let serials = (sample.saturating_sub(1) * RATE..sample * RATE).filter(|serial| *serial + 1 < CROSSINGS);
    let rows: Vec<String> = serials
        .map(|serial| {
            let (x, z) = ((serial % RATE) as f64 * 0.005, height(serial, sample));
            let (i, j) = (serial + 1, serial + 2);
            format!(
                "{x:.9} 0 {z:.9} {:.9} 0 {z:.9} {i} {j} 0 0.0001 0 0 0 1e-05 0 1.234567e-07 0 0 1e-05 \n",
                x + 0.004
            )
        })
        .collect();
    let head = |count: usize| {
        let names: String = (1..=19).map(|column| format!("c_x[{column}] ")).collect();
        let bounds = "ITEM: BOX BOUNDS ff ff ff\n-0.5 0.5\n-0.5 0.5\n-0.5 0.5\n";
        format!("ITEM: TIMESTEP\n{}\nITEM: NUMBER OF ENTRIES\n{count}\n{bounds}ITEM: ENTRIES {names}\n", sample * LOOK)
    };
    pairs.write_all((head(rows.len()) + &rows.concat()).as_bytes()).unwrap();
    walls.write_all(head(0).as_bytes()).unwrap();
}

/// Processor time of this thread [s].
fn processor_time() -> f64 {
    let text = fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    text.split(' ').next().unwrap().parse::<f64>().unwrap() * 1e-9
}

/// Peak resident memory of this process [bytes], where the system tells.
fn peak_memory() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(1024 * line.trim().trim_end_matches(" kB").parse::<u64>().ok()?)
}

fn gate() -> Gate {
    Gate {
        name: "outlet".to_owned(),
        plane: GatePlane { point: Vec3::zeros(), normal: vec3(0.0, 0.0, -1.0), aperture: Aperture::Unbounded },
        passage: PassingPoint::Centre,
        exclusion: Exclusion { mode: ExclusionMode::Buffer, length: EXCLUSION },
        paths: Some(PathRecording { every: LOOK, length: 0.002 }),
        returning: Fate::Keep,
        sitting: Fate::Keep,
    }
}

#[test]
#[ignore = "measures time and memory: needs a release build, and three gigabytes pass through the disk"]
fn a_million_crossings_in_200_mb() {
    let folder = tempfile::tempdir().unwrap();
    let samples = folder.path().join(files::SAMPLES).join("outlet");
    fs::create_dir_all(&samples).unwrap();
    fs::create_dir_all(folder.path().join(files::CONTACTS)).unwrap();
    let [mut pairs, mut walls] = [PAIRS_FILE, WALLS_FILE].map(|name| File::create(folder.path().join(name)).unwrap());
    let (scene, _) = tollgate::scene::read_text(SCENE, "scene.toml", folder.path(), &[]).unwrap();
    let records = [Recording { gate: gate(), observes: false }];
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
    let last = (CROSSINGS / RATE + 20).next_multiple_of(BATCH / LOOK);
    let cadence = Cadence { look: LOOK, hand_over: BATCH };
    let schedule = Schedule { timestep: TIMESTEP, cadence, steps: last * LOOK };
    let mut tags = Tags::default();
    for serial in 0..CROSSINGS {
        tags.add(ParticleId::new(0, serial));
    }
    let mut recordings = Recordings::open(&scene, &request, &schedule, folder.path(), &tags, "3.8.0").unwrap();
    drop(tags);
    let (mut used, mut rows) = (0.0, 0);
    for sample in 0..=last {
        rows += write_sample(&samples, sample);
        write_contacts(&mut pairs, &mut walls, sample);
        let before = processor_time();
        recordings.read_up_to(sample * LOOK).unwrap();
        used += processor_time() - before;
    }
    let bytes = recordings.bytes_read();
    let before = processor_time();
    let result = recordings.finish(Vec::new(), true).unwrap().pop().unwrap();
    used += processor_time() - before;
    let (memory, counts) = (peak_memory(), result.manifest.unwrap().counts);
    let megabytes = bytes as f64 / 1e6;
    let mut text = String::new();
    writeln!(
        text,
        "{CROSSINGS} crossings, {rows} rows in {} samples, {megabytes:.0} MB, {} motions",
        last + 1,
        counts.motions
    )
    .unwrap();
    writeln!(text, "{used:.2} s of the processor: {:.3} ms per 1000 crossings,", 1e6 * used / CROSSINGS as f64)
        .unwrap();
    write!(text, "{:.3} ms per MB; peak memory {memory:?} bytes", 1e3 * used / megabytes).unwrap();
    eprintln!("{text}");
    // Each row is a contact of i, and of j where it passes at the same sample.
    let contacts = CROSSINGS - 1 + CROSSINGS - CROSSINGS / RATE;
    assert_eq!((counts.crossings, counts.contacts), (CROSSINGS, contacts));
    assert_eq!((result.tally.recorded, result.tally.excluded, result.tally.came_around), (CROSSINGS, CROSSINGS, 0));
    assert!(memory.is_none_or(|memory| memory < MEMORY_LIMIT), "{memory:?}");
    assert!(used / megabytes < TIME_PER_MEGABYTE, "{used} s for {megabytes} MB");
}
