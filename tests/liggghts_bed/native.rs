//! The bed on the native solver, in the conventions of LIGGGHTS.

use crate::bed::Bed;
use tollgate::dem::law::{Compatibility, LawSettings, NormalLaw, RollingLaw, TangentialLaw};
use tollgate::dem::simulation::{Setup, Simulation};
use tollgate::geometry::motion::Motion;
use tollgate::geometry::part::{Part, Surface, Trigger};
use tollgate::material::{Elasticity, Material, MaterialTable, PairContact, PairProperties};
use tollgate::math::{Bounds, Vec3, vec3};
use tollgate::particle::{Body, ParticleState};

/// Hertz-Mindlin as LIGGGHTS' `hertz` with `tangential history`.
const LAW: LawSettings = LawSettings {
    normal: NormalLaw::HertzMindlin,
    tangential: TangentialLaw::Total,
    tangential_damping: true,
    attraction: true,
    rolling: RollingLaw::None,
    characteristic_velocity: 1.0,
    compatibility: Compatibility::Liggghts,
};

/// The bed in its box, ready to step.
pub fn simulation(bed: &Bed, start: &[ParticleState], threads: usize) -> Simulation {
    let elasticity = Some(Elasticity::Isotropic { youngs_modulus: 5e6, poissons_ratio: 0.45 });
    let mut materials = MaterialTable::new(vec![Material { name: "grain".into(), density: Some(2500.0), elasticity }]);
    let contact = PairContact::Restitution { coefficient: 0.5 };
    materials.set_pair(0, 0, PairProperties { contact, sliding_friction: 0.5, rolling_friction: 0.0 });
    let size = bed.size();
    let wall = |(axis, far): (usize, bool)| {
        let mut normal = Vec3::zeros();
        normal[axis] = if far { -1.0 } else { 1.0 };
        Part {
            name: format!("wall {axis} {far}"),
            material: 0,
            surface: Surface::Plane { point: if far { size } else { Vec3::zeros() }, normal },
            motion: Motion::default(),
            appears: Trigger::Always,
            disappears: Trigger::Never,
        }
    };
    let sides = (0..3).flat_map(|axis| [(axis, false), (axis, true)]);
    let mut simulation = Simulation::new(Setup {
        body: Body::Sphere,
        gravity: vec3(0.0, 0.0, -9.81),
        domain: Bounds { minimum: [0.0; 3], maximum: size.into() },
        periodic: [false; 3],
        materials,
        law: LAW,
        classes: Vec::new(),
        feeds: Vec::new(),
        parts: sides.map(wall).collect(),
        seed: 1,
        timestep: 1e-5,
        skin: 0.5e-3,
        overlap_limit: 0.5,
        energy: false,
        threads,
    });
    simulation.insert(start);
    simulation
}

/// State after `steps` steps.
pub fn run(bed: &Bed, start: &[ParticleState], steps: u64, threads: usize) -> Vec<ParticleState> {
    let mut simulation = simulation(bed, start, threads);
    for _ in 0..steps {
        simulation.step().unwrap_or_else(|stop| panic!("{stop}"));
    }
    simulation.particles()
}
