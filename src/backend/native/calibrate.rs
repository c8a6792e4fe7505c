//! How fast this computer is with a scene's laws: two small lattices, stepped for a moment. Changes nothing of a run.

use super::processor::Processor;
use crate::dem::feed::size::SizeSampler;
use crate::dem::neighbor::list::Memory;
use crate::dem::particles::{Acceleration, Load, Sphere, Velocity};
use crate::dem::simulation::{Setup, Simulation};
use crate::math::{Bounds, Vec3, vec3};
use crate::output::timing::ProcessUse;
use crate::particle::{ParticleId, ParticleState};
use crate::plan::{Calibration, Plan};
use crate::scene::Scene;
use std::mem::size_of;
use std::time::{Duration, Instant};

/// Particles along the edge of the lattices.
const EDGE: u64 = 18;
/// Wall time for each lattice that gives a few percent.
pub const TIME: Duration = Duration::from_millis(400);
/// Candidate pairs of a particle in a dense bed at the usual skin, and those within the inner skin: measured on settled beds.
const OUTER_PAIRS: f64 = 4.5;
const INNER_PAIRS: f64 = 2.9;
/// Contacts of a particle there, each counted once.
const CONTACTS: f64 = 2.5;

/// Measures the speed with the scene's laws and first particle class for about `time` on each of two lattices; `None` where it has no class of particles.
#[must_use]
pub fn calibrate(scene: &Scene, plan: &Plan, processor: Processor, time: Duration) -> Option<Calibration> {
    let class = scene.classes.first()?;
    let density = scene.materials.materials[usize::from(class.material)].density?;
    let base_bytes = ProcessUse::now().peak_memory_bytes.map_or(0.0, |bytes| bytes as f64);
    let sphere = ParticleState {
        id: ParticleId::new(0, 0),
        material: class.material,
        radius: 0.5 * SizeSampler::new(&class.diameter, scene.body).mean_power(1),
        density,
        position: Vec3::zeros(),
        velocity: Vec3::zeros(),
        spin: Vec3::zeros(),
    };
    let rate = |spacing: f64| measure(&mut lattice(scene, plan, processor, &sphere, spacing), time);
    // Touching by a thousandth: six contacts a particle, as in a bed with its neighbours in the corners counted.
    Some(Calibration {
        particle_steps_per_second_dense: rate(0.999),
        particle_steps_per_second_dilute: rate(2.5),
        bytes_per_particle: bytes_per_particle(),
        base_bytes,
        threads: processor.threads,
    })
}

fn lattice(scene: &Scene, plan: &Plan, processor: Processor, sphere: &ParticleState, spacing: f64) -> Simulation {
    let edge = 2.0 * sphere.radius * spacing;
    let place = |index: u64| {
        let along = |n: u64| ((n % EDGE) as f64 + 0.5) * edge;
        vec3(along(index), along(index / EDGE), along(index / (EDGE * EDGE)))
    };
    let particles: Vec<ParticleState> = (0..EDGE.pow(3))
        .map(|index| ParticleState {
            id: ParticleId::new(0, index),
            position: place(index),
            // A little disorder, so that springs and neighbour lists have work to do.
            velocity: vec3((index % 7) as f64 - 3.0, (index % 5) as f64 - 2.0, (index % 3) as f64 - 1.0) * 1e-3,
            ..*sphere
        })
        .collect();
    let room = EDGE as f64 * edge;
    let setup = Setup {
        parts: Vec::new(),
        feeds: Vec::new(),
        periodic: [false; 3],
        domain: Bounds { minimum: [-room; 3], maximum: [2.0 * room; 3] },
        gravity: Vec3::zeros(),
        overlap_limit: f64::INFINITY,
        sleeping: None,
        ..super::setup::setup(scene, plan, processor)
    };
    let mut simulation = Simulation::new(setup);
    simulation.insert(&particles);
    simulation
}

/// Particle steps in a second; the first steps, with their set-up, do not count.
fn measure(simulation: &mut Simulation, time: Duration) -> f64 {
    let mut step = || drop(simulation.step());
    (0..3).for_each(|_| step());
    let (started, mut steps) = (Instant::now(), 0_u32);
    while started.elapsed() < time {
        (0..4).for_each(|_| step());
        steps += 4;
    }
    EDGE.pow(3) as f64 * f64::from(steps) / started.elapsed().as_secs_f64()
}

/// Most memory that one particle takes in a dense bed, its share of the pair lists included [B]; array by array in
/// `docs/theory/memory.md`.
fn bytes_per_particle() -> f64 {
    let records = size_of::<Sphere>() + size_of::<Velocity>() + size_of::<Load>() + size_of::<Acceleration>();
    let references = 2 * size_of::<[f64; 3]>() + size_of::<ParticleId>() + size_of::<f64>() + 2 * size_of::<u32>();
    // Of a pair: owner and partner; then owner, partner, place in the outer list, R*, m* and memory, once more as storage for the
    // next list.
    let outer = 2 * size_of::<u32>();
    let inner = 2 * (3 * size_of::<u32>() + 2 * size_of::<f64>() + size_of::<Memory>());
    // While lists are made anew: memories from both sides of a contact. A frame may be on its way to the disk, being sorted.
    let memories = 2 * (size_of::<u32>() + size_of::<Memory>());
    let frame = 2 * size_of::<ParticleState>() + size_of::<Vec3>();
    let pairs = OUTER_PAIRS * outer as f64 + INNER_PAIRS * inner as f64 + CONTACTS * memories as f64;
    (records + references + frame) as f64 + pairs
}
