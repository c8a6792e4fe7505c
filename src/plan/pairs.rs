//! The contacts that can occur in a scene, with the constants that their time scales need.

use crate::dem::feed::size::SizeSampler;
use crate::dem::feed::{Feed, FeedKind};
use crate::dem::law::constants::PairConstants;
use crate::dem::law::{Compatibility, NormalLaw};
use crate::dem::timescale as scale;
use crate::scene::Scene;

/// Overlap over the radius at which the stiffness of a Hertz contact in a bed is taken, and of an impact where that is
/// gentler: the weight of a bed presses its contacts harder than a slow impact does.
const LEAST_OVERLAP: f64 = 0.01;

/// Particles that can be in a scene: one class, or one material of an initial-state file.
#[derive(Debug, Clone, PartialEq)]
pub struct Kind {
    /// Name for texts.
    pub name: String,
    /// Index into the scene's materials.
    pub material: u16,
    /// Particle density [kg/m3].
    pub density: f64,
    /// Smallest radius [m].
    pub smallest: f64,
    /// Largest radius [m].
    pub largest: f64,
}

/// A contact that can occur: the smallest particle of a kind against a partner.
#[derive(Debug, Clone, PartialEq)]
pub struct PossibleContact {
    /// Who touches whom.
    pub name: String,
    /// Whether the partner is a part.
    pub with_wall: bool,
    /// Radius of the particle [m].
    pub radius: f64,
    /// Mass of the particle [kg].
    pub mass: f64,
    /// Effective mass m* [kg].
    pub effective_mass: f64,
    /// Effective radius R* [m].
    pub effective_radius: f64,
    /// Effective Young's modulus E* [Pa]; 0 where the stiffness is given directly.
    pub effective_youngs_modulus: f64,
    /// Normal stiffness k_n [N/m]: of the linear law, or the tangent one of Hertz at the largest expected overlap.
    pub normal_stiffness: f64,
    /// The same while the particle lies in a bed [N/m]: of Hertz the tangent one at an overlap of 1 % of the radius.
    pub resting_stiffness: f64,
    /// Tangential over normal stiffness [-].
    pub tangential_ratio: f64,
    /// Damping ratio zeta [-].
    pub damping_ratio: f64,
    /// Overlap at the expected impact speed [m].
    pub impact_overlap: f64,
    /// Duration of a contact at the expected impact speed [s].
    pub duration: f64,
    /// Whether the stiffness is given directly.
    pub is_direct: bool,
}

/// All kinds of particles that the scene's feeds bring (all classes, where it starts from a checkpoint).
#[must_use]
pub fn particle_kinds(scene: &Scene) -> Vec<Kind> {
    let from_checkpoint = scene.start_checkpoint.is_some();
    let fed = |class: usize| {
        let brings = |feed: &Feed| match feed.kind {
            FeedKind::Fill { class: own, .. } | FeedKind::Stream { class: own, .. } => own == class,
            FeedKind::File { .. } => false,
        };
        from_checkpoint || scene.feeds.iter().any(brings)
    };
    let mut kinds = Vec::new();
    for (_, class) in scene.classes.iter().enumerate().filter(|&(index, _)| fed(index)) {
        let Some(density) = scene.materials.materials[usize::from(class.material)].density else { continue };
        let sampler = SizeSampler::new(&class.diameter, scene.body);
        kinds.push(Kind {
            name: class.name.clone(),
            material: class.material,
            density,
            smallest: 0.5 * sampler.minimum(),
            largest: 0.5 * sampler.maximum(),
        });
    }
    for feed in &scene.feeds {
        if let FeedKind::File { particles } = &feed.kind {
            kinds.extend(kinds_of_file(scene, feed, particles));
        }
    }
    kinds
}

fn kinds_of_file(scene: &Scene, feed: &Feed, particles: &[crate::particle::ParticleState]) -> Vec<Kind> {
    let mut kinds: Vec<Kind> = Vec::new();
    for particle in particles {
        match kinds.iter_mut().find(|kind| kind.material == particle.material) {
            Some(kind) => {
                kind.smallest = kind.smallest.min(particle.radius);
                kind.largest = kind.largest.max(particle.radius);
                kind.density = kind.density.min(particle.density);
            }
            None => kinds.push(Kind {
                name: format!("{} of {}", scene.materials.materials[usize::from(particle.material)].name, feed.name),
                material: particle.material,
                density: particle.density,
                smallest: particle.radius,
                largest: particle.radius,
            }),
        }
    }
    kinds
}

/// Every contact that can occur, with the constants at impact speed `speed` [m/s].
#[must_use]
pub fn possible_contacts(scene: &Scene, speed: f64) -> Vec<PossibleContact> {
    let kinds = particle_kinds(scene);
    let mut walls: Vec<u16> = scene.parts.iter().map(|part| part.material).collect();
    walls.sort_unstable();
    walls.dedup();
    let mut contacts = Vec::new();
    for kind in &kinds {
        let mass = scene.body.mass(kind.smallest, kind.density);
        for partner in &kinds {
            // the smallest particle on the largest partner is the stiffest of a Hertz contact, on its like the lightest
            for radius in [partner.smallest, partner.largest] {
                let other = scene.body.mass(radius, partner.density);
                let name = format!("{} on {}", kind.name, partner.name);
                let ends = (scale::effective(mass, other), scale::effective(kind.smallest, radius));
                contacts.extend(contact(scene, kind, name, (partner.material, false), ends, speed));
            }
        }
        for &material in &walls {
            let name = format!("{} on a part of {}", kind.name, scene.materials.materials[usize::from(material)].name);
            contacts.extend(contact(scene, kind, name, (material, true), (mass, kind.smallest), speed));
        }
    }
    contacts
}

fn contact(
    scene: &Scene,
    kind: &Kind,
    name: String,
    (partner, with_wall): (u16, bool),
    (effective_mass, effective_radius): (f64, f64),
    speed: f64,
) -> Option<PossibleContact> {
    let pair = PairConstants::of(&scene.materials, kind.material, partner)?;
    let youngs = pair.effective_youngs_modulus;
    let hertz = scene.law.normal == NormalLaw::HertzMindlin;
    let mindlin = 4.0 * pair.effective_shear_modulus / youngs;
    let (normal_stiffness, resting_stiffness, tangential_ratio, damping_ratio) =
        match pair.given.map(|(given, _)| given) {
            Some(direct) => (
                direct.normal_stiffness,
                direct.normal_stiffness,
                direct.tangential_stiffness / direct.normal_stiffness,
                direct.normal_damping / (2.0 * (effective_mass * direct.normal_stiffness).sqrt()),
            ),
            // neither given directly nor to be had from the materials: two rigid bodies, which the scene's checks refuse
            None if youngs.is_nan() || youngs <= 0.0 => return None,
            None if hertz => {
                let deepest = scale::hertz_maximum_overlap(effective_mass, effective_radius, youngs, speed);
                let stiffness = |overlap| scale::hertz_tangent_stiffness(youngs, effective_radius, overlap);
                let resting = LEAST_OVERLAP * kind.smallest;
                (stiffness(deepest.max(resting)), stiffness(resting), mindlin, pair.damping_factor)
            }
            None => {
                let velocity = scene.law.characteristic_velocity;
                let ratio = if scene.law.compatibility == Compatibility::Liggghts { 1.0 } else { mindlin };
                let stiffness = scale::linear_stiffness(effective_mass, effective_radius, youngs, velocity);
                (stiffness, stiffness, ratio, pair.damping_factor)
            }
        };
    let is_direct = pair.given.is_some();
    let (impact_overlap, duration) = if hertz && !is_direct {
        (
            scale::hertz_maximum_overlap(effective_mass, effective_radius, youngs, speed),
            scale::hertz_contact_duration(effective_mass, effective_radius, youngs, speed),
        )
    } else {
        let damping = 2.0 * damping_ratio * (effective_mass * normal_stiffness).sqrt();
        let below_one = damping_ratio.min(1.0 - f64::EPSILON);
        (
            scale::linear_maximum_overlap(effective_mass, normal_stiffness, below_one, speed),
            scale::linear_contact_duration(effective_mass, normal_stiffness, damping),
        )
    };
    Some(PossibleContact {
        name,
        with_wall,
        radius: kind.smallest,
        mass: scene.body.mass(kind.smallest, kind.density),
        effective_mass,
        effective_radius,
        effective_youngs_modulus: if is_direct { 0.0 } else { youngs },
        normal_stiffness,
        resting_stiffness,
        // without friction nothing acts along the tangent
        tangential_ratio: if pair.sliding_friction > 0.0 { tangential_ratio } else { 0.0 },
        damping_ratio,
        impact_overlap,
        duration,
        is_direct,
    })
}
