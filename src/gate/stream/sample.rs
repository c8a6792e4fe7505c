//! Streams for tests: numbers that follow from the crossing's number, so that any two differ everywhere.

use super::format::{Manifest, Origin, Role, StoredEvent};
use super::writer::{Closing, StreamWriter};
use crate::gate::crossing::{ContactPartner, Crossing, Motion, Passage, StoredContact};
use crate::geometry::plane::{Aperture, GatePlane};
use crate::material::{Elasticity, Material};
use crate::math::{Vec3, vec3};
use crate::particle::{Body, ParticleId, ParticleState};
use crate::scene::gate::{Exclusion, ExclusionMode, PassingPoint, PathRecording};
use std::path::Path;

pub const TIMESTEP: f64 = 1e-5;
pub const EVERY: u64 = 3;

pub fn origin() -> Origin {
    let steel = Elasticity::Isotropic { youngs_modulus: 5e6, poissons_ratio: 0.3 };
    Origin {
        gate: "outlet".to_owned(),
        plane: GatePlane {
            point: vec3(0.0, 0.0, 0.2),
            normal: vec3(0.0, 0.0, -1.0),
            aperture: Aperture::Disc { radius: 0.03 },
        },
        passage: PassingPoint::Centre,
        gravity: vec3(0.0, 0.0, -9.81),
        exclusion: Some(Exclusion { mode: ExclusionMode::Buffer, length: 0.02 }),
        paths: Some(PathRecording { every: EVERY, length: 0.006 }),
        role: Role::HandOver,
        stage: "filling".to_owned(),
        stage_key: "0123456789abcdef".to_owned(),
        backend: "native".to_owned(),
        backend_version: "0.1.0".to_owned(),
        numerics_version: 1,
        timestep: TIMESTEP,
        contacts: true,
        materials: vec![
            Material { name: "sinter".to_owned(), density: Some(3300.0), elasticity: Some(steel) },
            Material { name: "coke".to_owned(), density: Some(1000.0), elasticity: None },
        ],
        part_names: vec!["hopper".to_owned(), "lid".to_owned()],
        body: Body::Sphere,
        feeds: vec!["fill".to_owned()],
        laws: "hertz-mindlin; the tangential memory leads by half a time step".to_owned(),
        provenance: Vec::new(),
    }
}

/// A vector of numbers without short decimal forms.
fn irregular(seed: u64) -> Vec3 {
    let number = |salt: u64| ((seed.wrapping_mul(2_654_435_761) + salt * 7919) % 1_000_003) as f64 / 1_000_003.0 - 0.5;
    vec3(number(1), number(2), number(3))
}

pub fn contact(seed: u64, partner: ContactPartner) -> StoredContact {
    let normal = irregular(seed + 1).normalize();
    StoredContact {
        partner,
        point: irregular(seed + 2),
        normal,
        overlap: 1e-6 + 1e-9 * seed as f64,
        normal_force: normal * -0.3,
        tangential_force: irregular(seed + 3),
        tangential_memory: irregular(seed + 4),
        rolling_memory: irregular(seed + 5),
    }
}

/// Crossing number `index`: two of three in contact, every second with a path.
pub fn crossing(index: u64) -> Crossing {
    let step = 1000 + 7 * (index / 2);
    let position = vec3(0.0, 0.0, 0.2) + irregular(index) * 0.01;
    let velocity = vec3(0.0, 0.0, -0.5) + irregular(index + 10) * 0.1;
    let spin = irregular(index + 20);
    let contacts = match index % 3 {
        0 => vec![],
        1 => vec![contact(index, ContactPartner::Particle(ParticleId::new(0, index + 1)))],
        _ => vec![
            contact(index, ContactPartner::Particle(ParticleId::new(0, index + 5))),
            contact(index + 50, ContactPartner::Part { part: 1, element: 17 }),
        ],
    };
    let motion = |number: u64| Motion {
        position: position + velocity * (number as f64 * TIMESTEP),
        velocity,
        spin,
        acceleration: irregular(index + number),
        spin_acceleration: irregular(index + number + 1),
    };
    let length = if index.is_multiple_of(2) { 4 } else { 0 };
    Crossing {
        step,
        state: ParticleState {
            id: ParticleId::new(0, index),
            material: (index % 2) as u16,
            radius: 0.002 + 1e-7 * (index % 13) as f64,
            density: 3300.0,
            position,
            velocity,
            spin,
        },
        force: irregular(index + 30),
        torque: irregular(index + 40),
        passage: Passage { time: (step as f64 - 0.25) * TIMESTEP, position, velocity, spin },
        contacts,
        path: (0..length).map(motion).collect(),
        path_start: if length == 0 { 0 } else { step - length * EVERY },
    }
}

pub fn closing() -> Closing {
    let events = vec![StoredEvent { part: "lid".to_owned(), present: false, time: 0.25 }];
    Closing { events, quality: serde_json::json!({ "contact_share": 0.31 }) }
}

/// A finished stream of `count` crossings.
pub fn write(place: &Path, count: u64) -> Manifest {
    let mut writer = StreamWriter::create(place, origin()).unwrap();
    (0..count).for_each(|index| writer.push(crossing(index)).unwrap());
    writer.finish(closing()).unwrap()
}
