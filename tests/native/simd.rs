//! The instruction set changes no bit: every law, in every combination that a plan can choose, with particles of two materials among
//! each other, prescribed ones among them, over periodic borders, and on planes, moving planes and meshes.

use crate::common::{DENSITY, GRAIN, HERTZ, WALL, gravity, lattice, open_box, part, run, with};
use crate::draw::Draw;
use tollgate::dem::law::{Compatibility, LawSettings, NormalLaw, RollingLaw, TangentialLaw};
use tollgate::dem::particles::Path;
use tollgate::dem::simulation::{Setup, Simulation};
use tollgate::geometry::motion::MotionKind;
use tollgate::geometry::part::Surface;
use tollgate::material::PairContact;
use tollgate::math::lanes::SimdLevel;
use tollgate::math::{Bounds, vec3};
use tollgate::particle::{Body, ParticleId, ParticleState};

const RADIUS: f64 = 2e-3;

/// Every combination of settings.
fn laws() -> Vec<LawSettings> {
    let mut laws = Vec::new();
    for normal in [NormalLaw::Linear, NormalLaw::HertzMindlin] {
        for tangential in [TangentialLaw::Total, TangentialLaw::Incremental] {
            for rolling in [RollingLaw::None, RollingLaw::Cdt, RollingLaw::Epsd2] {
                for compatibility in [Compatibility::Tollgate, Compatibility::Liggghts] {
                    for flag in [true, false] {
                        let (tangential_damping, attraction) = (flag, !flag);
                        laws.push(LawSettings {
                            normal,
                            tangential,
                            tangential_damping,
                            attraction,
                            rolling,
                            compatibility,
                            ..HERTZ
                        });
                    }
                }
            }
        }
    }
    laws
}

/// What is computed besides the law.
#[derive(Debug, Clone, Copy)]
struct Case {
    friction: bool,
    energy: bool,
    /// Some pairs with stiffnesses given directly, where the law is linear.
    given: bool,
    disc: bool,
}

fn setup(law: LawSettings, case: Case, simd: SimdLevel) -> Setup {
    let friction = if case.friction { 0.4 } else { 0.0 };
    let mut setup = crate::common::empty(RADIUS, law, crate::common::pair(0.4, friction, 0.2 * friction));
    // Materials differ, so that lanes of one block have different constants.
    let mut properties = crate::common::pair(0.7, 0.5 * friction, 0.1 * friction);
    if case.given {
        properties.contact = PairContact::Stiffness {
            normal_stiffness: 4e3,
            tangential_stiffness: 3e3,
            normal_damping: 0.05,
            tangential_damping: 0.03,
        };
    }
    setup.materials.set_pair(GRAIN, WALL, properties);
    let width = 10.0 * RADIUS;
    setup.domain = Bounds { minimum: [0.0, 0.0, -RADIUS], maximum: [width, 4.0 * width, 6.0 * width] };
    setup.periodic = [!case.disc, false, false];
    setup.gravity = gravity();
    setup.overlap_limit = 0.5;
    (setup.energy, setup.simd) = (case.energy, simd);
    if case.disc {
        setup.body = Body::Disc { thickness: RADIUS };
    }
    let turn = MotionKind::Rotate { origin: vec3(0.0, width, 0.0), axis: vec3(1.0, 0.0, 0.0), rate: 6.0 };
    setup.parts = vec![
        part("floor", Surface::Plane { point: vec3(0.0, 0.0, 0.0), normal: vec3(0.0, 0.0, 1.0) }, Vec::new()),
        part(
            "tilted",
            Surface::Plane { point: vec3(0.0, 0.0, 0.0), normal: vec3(0.0, 1.0, 0.2).normalize() },
            Vec::new(),
        ),
        part(
            "box",
            Surface::Mesh(open_box(vec3(-width, -width, 0.0), vec3(2.0 * width, 1.2 * width, 2.0 * width), 3)),
            if case.disc { Vec::new() } else { vec![turn] },
        ),
    ];
    if case.disc {
        // Discs lie in the plane y = 0, and in this one.
        setup.parts.remove(1);
    }
    setup
}

/// A heap of two materials and sizes, touching from the start, that falls apart; every tenth particle is a ghost.
/// Also how many contacts there were early on.
fn fallen(law: LawSettings, case: Case, simd: SimdLevel) -> (Simulation, u64) {
    let mut draw = Draw(7);
    let pitch = 1.96 * RADIUS;
    let counts = if case.disc { [4, 1, 12] } else { [4, 4, 6] };
    let start = vec3(1.1 * RADIUS, if case.disc { 0.0 } else { 2.0 } * RADIUS, 1.2 * RADIUS);
    let mut states: Vec<ParticleState> = lattice(counts, start, pitch, RADIUS, 0.03, &mut draw);
    for (number, state) in states.iter_mut().enumerate() {
        (state.material, state.density) = (if number % 3 == 0 { WALL } else { GRAIN }, DENSITY);
        state.radius *= draw.between(0.94, 1.0);
    }
    let mut simulation = with(setup(law, case, simd), &states);
    let ghosts: Vec<ParticleId> = states.iter().step_by(10).map(|state| state.id).collect();
    simulation.prescribe(&ghosts, Path::Constant);
    run(&mut simulation, 10);
    let contacts = simulation.contact_survey().count;
    run(&mut simulation, 190);
    (simulation, contacts)
}

fn compare(law: LawSettings, case: Case) -> u64 {
    let (reference, contacts) = fallen(law, case, SimdLevel::Scalar);
    let record = reference.record();
    for level in SimdLevel::ALL.into_iter().filter(|level| level.is_available()).skip(1) {
        let other = fallen(law, case, level).0;
        assert_eq!(other.energy(), reference.energy(), "{}: {law:?} {case:?}", level.name());
        let other = other.record();
        for ((name, column), (_, expected)) in other.reals.iter().zip(&record.reals) {
            let bits = |list: &[f64]| list.iter().map(|x| x.to_bits()).collect::<Vec<u64>>();
            assert!(bits(column) == bits(expected), "column {name} differs at {}: {law:?} {case:?}", level.name());
        }
        assert!(other == record, "the record differs at {}: {law:?} {case:?}", level.name());
    }
    contacts
}

#[test]
fn every_level_gives_the_same_bits_with_every_law() {
    let mut contacts = 0;
    for law in laws() {
        for (friction, energy) in [(true, true), (true, false), (false, true), (false, false)] {
            let given = law.normal == NormalLaw::Linear && !energy;
            contacts += compare(law, Case { friction, energy, given, disc: false });
        }
    }
    assert!(contacts > 192 * 40, "only {contacts} contacts in 192 heaps: they prove nothing");
}

#[test]
fn every_level_gives_the_same_bits_with_discs() {
    for law in laws().into_iter().filter(|law| law.normal == NormalLaw::Linear) {
        assert!(compare(law, Case { friction: true, energy: true, given: false, disc: true }) > 5);
    }
}
