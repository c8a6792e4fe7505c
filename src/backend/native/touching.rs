//! Who touches whom in a state that another code computed.

use super::processor::Processor;
use super::setup::setup;
use crate::dem::inspect::Partner;
use crate::dem::simulation::Simulation;
use crate::geometry::motion::{Motion, Pose};
use crate::geometry::part::{Part, Surface, Trigger};
use crate::particle::{ParticleId, ParticleState};
use crate::plan::Plan;
use crate::scene::Scene;

/// Contacts of a state.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Touching {
    /// Pairs of particles in contact, each once.
    pub pairs: Vec<(ParticleId, ParticleId)>,
    /// Particles in contact with a part, one entry a contact.
    pub walls: Vec<ParticleId>,
}

/// The contacts of `particles` with each other and with the parts that are `present`, where these are at plant time `time` [s].
#[must_use]
pub fn touching(scene: &Scene, plan: &Plan, particles: &[ParticleState], present: &[bool], time: f64) -> Touching {
    let mut setup = setup(scene, plan, Processor::new(Some(1), None));
    setup.feeds.clear();
    let there = scene.parts.iter().zip(present).filter(|(_, present)| **present);
    setup.parts = there.map(|(part, _)| standing(part, &part.motion.pose(time))).collect();
    let mut simulation = Simulation::new(setup);
    simulation.insert(particles);
    simulation.prepare();
    let mut found = Touching::default();
    for contact in simulation.contacts() {
        match contact.j {
            Partner::Particle(other) => found.pairs.push((contact.i, other)),
            Partner::Part { .. } => found.walls.push(contact.i),
        }
    }
    found
}

/// A part as it stands at `pose`, at rest and always there.
fn standing(part: &Part, pose: &Pose) -> Part {
    let surface = match &part.surface {
        Surface::Plane { point, normal } => {
            Surface::Plane { point: pose.apply(point), normal: pose.apply_direction(normal) }
        }
        Surface::Frustum { start, end, start_radius, end_radius } => Surface::Frustum {
            start: pose.apply(start),
            end: pose.apply(end),
            start_radius: *start_radius,
            end_radius: *end_radius,
        },
        Surface::Mesh(mesh) => {
            let mut mesh = mesh.clone();
            mesh.vertices.iter_mut().for_each(|vertex| *vertex = pose.apply(vertex));
            Surface::Mesh(mesh)
        }
    };
    Part { surface, motion: Motion::default(), appears: Trigger::Always, disappears: Trigger::Never, ..part.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::plan;
    use std::path::Path;

    const SCENE: &str = r#"
version = 1
[contact]
law = "hertz-mindlin"
[material.glass]
density = "2500 kg/m3"
youngs_modulus = "10 MPa"
poissons_ratio = 0.25
[[pair]]
between = ["glass", "glass"]
restitution = 0.9
friction = 0.3
[particle.bead]
material = "glass"
diameter = "4 mm"
[[feed]]
name = "fill"
kind = "fill"
particle = "bead"
region = { shape = "box", min_mm = [0, 0, 100], max_mm = [50, 50, 150] }
amount = 10
[[part]]
name = "floor"
material = "glass"
shape = "box"
min_mm = [-50, -50, -10]
max_mm = [100, 100, 0]
[[part.motion]]
kind = "translate"
velocity_mm_per_s = [0, 0, 1]
[end]
time = "10 s"
"#;

    #[test]
    fn a_moving_floor_touches_who_lies_where_it_is_by_then() {
        let (scene, _) = crate::scene::read_text(SCENE, "scene.toml", Path::new("."), &[]).unwrap();
        let plan = plan(&scene, None);
        let bead = |serial: u64, x: f64, z: f64| ParticleState {
            id: ParticleId::new(0, serial),
            material: 0,
            radius: 2e-3,
            density: 2500.0,
            position: crate::math::vec3(x, 0.02, z),
            velocity: crate::math::Vec3::zeros(),
            spin: crate::math::Vec3::zeros(),
        };
        // The first two overlap by 0.1 mm; the floor has risen by 5 mm and meets the third.
        let beads = [bead(0, 0.0, 0.02), bead(1, 0.0039, 0.02), bead(2, 0.03, 0.0069), bead(3, 0.04, 0.0071)];
        let found = touching(&scene, &plan, &beads, &[true], 5.0);
        assert_eq!(found.pairs, [(beads[0].id, beads[1].id)]);
        assert_eq!(found.walls, [beads[2].id]);
        assert_eq!(touching(&scene, &plan, &beads, &[false], 5.0).walls, []);
    }
}
