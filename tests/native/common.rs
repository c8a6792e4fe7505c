//! Builders of small scenes, and what is drawn for them.

pub use crate::draw::Draw;

use tollgate::dem::feed::Feed;
use tollgate::dem::law::{Compatibility, LawSettings, NormalLaw, RollingLaw, TangentialLaw};
use tollgate::dem::release::Arrival;
use tollgate::dem::simulation::{Setup, Simulation};
use tollgate::dem::timescale::rayleigh_time;
use tollgate::geometry::motion::{Motion, MotionKind, MotionTerm};
use tollgate::geometry::part::{Part, Surface, TriangleMesh, Trigger};
use tollgate::material::{Elasticity, Material, MaterialTable, PairContact, PairProperties};
use tollgate::math::lanes::SimdLevel;
use tollgate::math::{Bounds, Vec3, vec3};
use tollgate::particle::{Body, ParticleId, ParticleState};

/// Density of all particles [kg/m3].
pub const DENSITY: f64 = 2500.0;
/// Young's modulus of both materials [Pa].
pub const YOUNGS_MODULUS: f64 = 5.0e6;
/// Poisson's ratio of both materials [-].
pub const POISSONS_RATIO: f64 = 0.3;
/// The particles' material.
pub const GRAIN: u16 = 0;
/// The parts' material.
pub const WALL: u16 = 1;

/// Hertz-Mindlin, incremental spring, no rolling resistance, our conventions.
pub const HERTZ: LawSettings = LawSettings {
    normal: NormalLaw::HertzMindlin,
    tangential: TangentialLaw::Incremental,
    tangential_damping: true,
    attraction: false,
    rolling: RollingLaw::None,
    characteristic_velocity: 1.0,
    compatibility: Compatibility::Tollgate,
};

/// Linear spring and dashpot with stiffness from the materials.
pub const LINEAR: LawSettings = LawSettings { normal: NormalLaw::Linear, ..HERTZ };

/// Properties of a pair by restitution.
pub fn pair(restitution: f64, sliding_friction: f64, rolling_friction: f64) -> PairProperties {
    PairProperties {
        contact: PairContact::Restitution { coefficient: restitution },
        sliding_friction,
        rolling_friction,
    }
}

/// Two elastic materials with the same properties in every pair.
pub fn materials(properties: PairProperties) -> MaterialTable {
    let elastic = Elasticity::Isotropic { youngs_modulus: YOUNGS_MODULUS, poissons_ratio: POISSONS_RATIO };
    let material = |name: &str| Material { name: name.to_owned(), density: Some(DENSITY), elasticity: Some(elastic) };
    let mut table = MaterialTable::new(vec![material("grain"), material("wall")]);
    for (a, b) in [(GRAIN, GRAIN), (GRAIN, WALL), (WALL, WALL)] {
        table.set_pair(a, b, properties);
    }
    table
}

/// `share` of the Rayleigh time of a sphere of `radius` [s].
pub fn rayleigh_share(share: f64, radius: f64) -> f64 {
    let shear = YOUNGS_MODULUS / (2.0 * (1.0 + POISSONS_RATIO));
    share * rayleigh_time(radius, DENSITY, shear, POISSONS_RATIO)
}

/// An empty scene without gravity for spheres of about `radius` [m]: 10 % of the Rayleigh time, skin of 0.4 radii.
pub fn empty(radius: f64, law: LawSettings, properties: PairProperties) -> Setup {
    Setup {
        body: Body::Sphere,
        gravity: Vec3::zeros(),
        domain: Bounds { minimum: [-10.0; 3], maximum: [10.0; 3] },
        periodic: [false; 3],
        materials: materials(properties),
        law,
        classes: Vec::new(),
        feeds: Vec::<Feed>::new(),
        parts: Vec::new(),
        seed: 1,
        timestep: rayleigh_share(0.1, radius),
        skin: 0.4 * radius,
        overlap_limit: 0.3,
        energy: true,
        momentum: false,
        sleeping: None,
        threads: 1,
        simd: SimdLevel::best(),
    }
}

/// Standard gravity downwards [m/s2].
pub fn gravity() -> Vec3 {
    vec3(0.0, 0.0, -9.81)
}

/// Particle number `serial` of feed 1000 (no scene here has so many feeds).
pub fn id(serial: u64) -> ParticleId {
    ParticleId::new(1000, serial)
}

/// A particle.
pub fn grain(serial: u64, radius: f64, position: Vec3, velocity: Vec3) -> ParticleState {
    ParticleState { id: id(serial), material: GRAIN, radius, density: DENSITY, position, velocity, spin: Vec3::zeros() }
}

/// A part of the wall material that is there all the time.
pub fn part(name: &str, surface: Surface, kinds: Vec<MotionKind>) -> Part {
    let term = |kind| MotionTerm { kind, from: 0.0, until: f64::INFINITY };
    Part {
        name: name.to_owned(),
        material: WALL,
        surface,
        motion: Motion { terms: kinds.into_iter().map(term).collect() },
        appears: Trigger::Always,
        disappears: Trigger::Never,
    }
}

/// The plane through `point` with the outward normal `normal`.
pub fn plane(name: &str, point: Vec3, normal: Vec3) -> Part {
    part(name, Surface::Plane { point, normal: normal.normalize() }, Vec::new())
}

/// The parallelogram `corner`, `corner + a`, `corner + b` cut into `along_a` by `along_b` cells of two triangles.
pub fn sheet(corner: Vec3, a: Vec3, b: Vec3, along_a: u32, along_b: u32) -> TriangleMesh {
    let at =
        |i: u32, j: u32| corner + a * (f64::from(i) / f64::from(along_a)) + b * (f64::from(j) / f64::from(along_b));
    let mut soup = Vec::new();
    for i in 0..along_a {
        for j in 0..along_b {
            let [p, q, r, s] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            soup.extend([[p, q, r], [p, r, s]]);
        }
    }
    TriangleMesh::from_soup(&soup)
}

impl Draw {
    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Uniform between two numbers.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Uniform in a cube of half edge `half`.
    pub fn vector(&mut self, half: f64) -> Vec3 {
        Vec3::new(self.between(-half, half), self.between(-half, half), self.between(-half, half))
    }
}

/// Particles on a cubic lattice of spacing `pitch` from `corner`, with drawn velocities and spins.
pub fn lattice(
    counts: [u64; 3],
    corner: Vec3,
    pitch: f64,
    radius: f64,
    speed: f64,
    draw: &mut Draw,
) -> Vec<ParticleState> {
    let mut states = Vec::new();
    for z in 0..counts[2] {
        for y in 0..counts[1] {
            for x in 0..counts[0] {
                let place =
                    corner + vec3(x as f64, y as f64, z as f64) * pitch + draw.vector(0.1 * (pitch - 2.0 * radius));
                let mut state = grain(states.len() as u64, radius, place, draw.vector(speed));
                state.spin = draw.vector(speed / radius);
                states.push(state);
            }
        }
    }
    states
}

/// Runs so many steps; a stop is a failure of the test.
pub fn run(simulation: &mut Simulation, steps: u64) {
    for _ in 0..steps {
        if let Err(stop) = simulation.step() {
            panic!("the run stopped: {stop}");
        }
    }
}

/// A simulation with these particles.
pub fn with(setup: Setup, states: &[ParticleState]) -> Simulation {
    let mut simulation = Simulation::new(setup);
    simulation.insert(states);
    simulation
}

/// The five inner faces of an open box from `minimum` to `maximum`, as a mesh with `cells` cells an edge.
pub fn open_box(minimum: Vec3, maximum: Vec3, cells: u32) -> TriangleMesh {
    let size = maximum - minimum;
    let [x, y, z] = [vec3(size.x, 0.0, 0.0), vec3(0.0, size.y, 0.0), vec3(0.0, 0.0, size.z)];
    let faces = [(minimum, x, y), (minimum, x, z), (minimum, y, z), (minimum + y, x, z), (minimum + x, y, z)];
    let mut soup = Vec::new();
    for (corner, a, b) in faces {
        let mesh = sheet(corner, a, b, cells, cells);
        soup.extend((0..mesh.triangles.len()).map(|triangle| mesh.corners(triangle)));
    }
    TriangleMesh::from_soup(&soup)
}

/// Frees prescribed particles where they are, with the loads they bear and without memory of their contacts.
pub fn release_as_they_are(simulation: &mut Simulation, ids: &[ParticleId]) {
    let states: Vec<ParticleState> =
        simulation.particles().into_iter().filter(|state| ids.contains(&state.id)).collect();
    let loads: Vec<_> = simulation.views().map(|view| (view.id, view.force, view.torque)).collect();
    let arrival = |state: &ParticleState| {
        let (_, force, torque) = loads.iter().copied().find(|(id, ..)| *id == state.id).expect("it is there");
        Arrival { state: *state, force, torque, contacts: Vec::new() }
    };
    simulation.release(&states.iter().map(arrival).collect::<Vec<_>>());
}
