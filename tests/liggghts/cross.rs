//! The native solver against LIGGGHTS, contact by contact: the same start, the same time step, the same formulas
//! (`compatibility = "liggghts"`), and how the default formulas come together with LIGGGHTS' as the time step shrinks.

use tollgate::dem::law::{Compatibility, LawSettings, NormalLaw, RollingLaw, TangentialLaw};
use tollgate::geometry::motion::Motion;
use tollgate::geometry::part::{Part, Surface, TriangleMesh, Trigger};
use tollgate::material::{Elasticity, Material, MaterialTable, PairContact, PairProperties};
use tollgate::math::{Vec3, vec3};
use tollgate::verify::{CaseSetup, Experiment, Liggghts, Native, Sample};

const HERTZ: LawSettings = LawSettings {
    normal: NormalLaw::HertzMindlin,
    tangential: TangentialLaw::Total,
    tangential_damping: true,
    attraction: true,
    rolling: RollingLaw::None,
    characteristic_velocity: 1.0,
    compatibility: Compatibility::Liggghts,
};
const LINEAR: LawSettings = LawSettings { normal: NormalLaw::Linear, ..HERTZ };

/// Largest diameter in these cases [m].
const DIAMETER: f64 = 6e-3;

fn materials(contact: PairContact, friction: f64, rolling: f64) -> MaterialTable {
    let elasticity = Elasticity::Isotropic { youngs_modulus: 1e7, poissons_ratio: 0.3 };
    let mut table = MaterialTable::new(vec![
        Material { name: "grain".into(), density: Some(2500.0), elasticity: Some(elasticity) },
        Material { name: "wall".into(), density: None, elasticity: Some(Elasticity::Rigid) },
    ]);
    let pair = PairProperties { contact, sliding_friction: friction, rolling_friction: rolling };
    table.set_pair(0, 0, pair);
    table.set_pair(0, 1, pair);
    table
}

fn restitution() -> PairContact {
    PairContact::Restitution { coefficient: 0.7 }
}

fn direct() -> PairContact {
    PairContact::Stiffness {
        normal_stiffness: 2000.0,
        tangential_stiffness: 700.0,
        normal_damping: 0.05,
        tangential_damping: 0.02,
    }
}

/// Two unlike spheres meet obliquely and with spin, and part.
fn two_spheres(law: LawSettings, contact: PairContact, timestep: f64) -> CaseSetup {
    let mut setup = CaseSetup::new(materials(contact, 0.3, 0.05), law, 0.05);
    setup.add_sphere(0.002, vec3(-0.00505, 0.0003, 0.0), vec3(0.5, 0.1, 0.05), vec3(10.0, -40.0, 60.0));
    setup.add_sphere(0.003, Vec3::zeros(), vec3(-0.3, 0.2, -0.1), vec3(0.0, 20.0, -10.0));
    setup.run_for(1.6e-3, timestep, 400);
    setup
}

/// A sphere hits a floor obliquely and with spin, and leaves it.
fn sphere_and_floor(law: LawSettings, contact: PairContact, timestep: f64) -> CaseSetup {
    let mut setup = CaseSetup::new(materials(contact, 0.3, 0.05), law, 0.05);
    setup.gravity = vec3(0.0, 0.0, -9.81);
    setup.add_floor(1);
    setup.add_sphere(0.003, vec3(0.0, 0.0, 0.00303), vec3(0.4, 0.1, -0.5), vec3(10.0, -40.0, 60.0));
    setup.run_for(2.4e-3, timestep, 400);
    setup
}

/// As [`sphere_and_floor`], on two triangles instead of a plane.
fn sphere_and_mesh(law: LawSettings, contact: PairContact, timestep: f64) -> CaseSetup {
    let mut setup = sphere_and_floor(law, contact, timestep);
    let corner = |x: f64, y: f64| vec3(0.02 * x, 0.02 * y, 0.0);
    let mesh = TriangleMesh::from_soup(&[
        [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.3)],
        [corner(-1.0, -1.0), corner(1.0, 1.3), corner(-1.0, 1.3)],
    ]);
    setup.parts[0] = Part {
        name: "floor".into(),
        material: 1,
        surface: Surface::Mesh(mesh),
        motion: Motion::default(),
        appears: Trigger::Always,
        disappears: Trigger::Never,
    };
    setup
}

/// As [`apart`], of both codes; the impact must have taken place.
fn difference(setup: &CaseSetup) -> f64 {
    let ours = Native.run(setup).unwrap();
    let theirs = Liggghts.run(setup).unwrap();
    assert_eq!(ours.len(), theirs.len());
    let first = setup.particles[0].velocity;
    assert!((ours.last().unwrap().particles[0].velocity - first).norm() > 0.1, "there was no impact");
    apart(&ours, &theirs)
}

/// Largest distance of positions over all samples, and largest difference of spin times radius times 1 ms, as a share of the
/// diameter.
fn apart(ours: &[Sample], theirs: &[Sample]) -> f64 {
    let apart = |(a, b): (&Sample, &Sample)| {
        let pairs = a.particles.iter().zip(&b.particles);
        pairs
            .map(|(a, b)| {
                let turn = (a.spin - b.spin).norm() * a.radius * 1e-3;
                (a.position - b.position).norm().max(turn)
            })
            .fold(0.0, f64::max)
    };
    ours.iter().zip(theirs).map(apart).fold(0.0, f64::max) / DIAMETER
}

type Scene = fn(LawSettings, PairContact, f64) -> CaseSetup;
const SCENES: [(&str, Scene); 3] =
    [("two spheres", two_spheres), ("sphere and plane", sphere_and_floor), ("sphere and mesh", sphere_and_mesh)];

#[test]
fn with_liggghts_formulas_impacts_are_those_of_liggghts() {
    let mut worst = 0.0_f64;
    for (normal, law, contact) in
        [("Hertz", HERTZ, restitution()), ("linear", LINEAR, restitution()), ("stiffness given", LINEAR, direct())]
    {
        for (rolling, resistance) in
            [("no rolling", RollingLaw::None), ("CDT", RollingLaw::Cdt), ("EPSD2", RollingLaw::Epsd2)]
        {
            for (options, attraction, tangential_damping) in [("", true, true), (", cut-off, no dashpot", false, false)]
            {
                let law = LawSettings { rolling: resistance, attraction, tangential_damping, ..law };
                for (bodies, scene) in SCENES {
                    let found = difference(&scene(law, contact, 1e-6));
                    println!("{bodies}, {normal}, {rolling}{options}: {found:.1e} d");
                    worst = worst.max(found);
                }
            }
        }
    }
    // Positions of 5 mm are known to 1e-18 m; every step adds as much. One formula apart is 1e-7 d and more.
    assert!(worst < 1e-12, "{worst:e} of a diameter");
}

/// Four spheres as a pyramid on a floor: dropped by a little, they come to rest by friction alone.
fn stack(law: LawSettings, timestep: f64) -> CaseSetup {
    let law = LawSettings { rolling: RollingLaw::Epsd2, ..law };
    let mut setup = CaseSetup::new(materials(restitution(), 0.5, 0.1), law, 0.05);
    setup.gravity = vec3(0.0, 0.0, -9.81);
    setup.add_floor(1);
    let (radius, gap) = (0.5 * DIAMETER, 1e-5);
    let ring = (DIAMETER + gap) / 3.0_f64.sqrt();
    for degrees in [10.0_f64, 130.0, 250.0] {
        let (sine, cosine) = degrees.to_radians().sin_cos();
        setup.add_sphere(radius, vec3(ring * cosine, ring * sine, radius + gap), Vec3::zeros(), Vec3::zeros());
    }
    let top = radius + 2.0 * gap + (DIAMETER * DIAMETER - ring * ring).sqrt();
    setup.add_sphere(radius, vec3(0.0, 0.0, top), Vec3::zeros(), Vec3::zeros());
    setup.run_for(0.3, timestep, 200);
    setup
}

#[test]
fn a_stack_at_rest_is_that_of_liggghts() {
    // Without attraction no spring outlasts its contact in LIGGGHTS either.
    let setup = stack(LawSettings { attraction: false, ..HERTZ }, 5e-6);
    let (ours, theirs) = (Native.run(&setup).unwrap(), Liggghts.run(&setup).unwrap());
    for samples in [&ours, &theirs] {
        let end = &samples.last().unwrap().particles;
        let fastest = end.iter().map(|p| p.velocity.norm() + p.radius * p.spin.norm()).fold(0.0, f64::max);
        assert!(fastest < 1e-9, "not at rest: {fastest:e} m/s");
        assert!(end[3].position.z > 1.25 * DIAMETER, "the stack has fallen down");
    }
    let found = apart(&ours, &theirs);
    println!("stack: {found:.1e} d");
    // Round-off, grown by the bounces before it comes to rest.
    assert!(found < 1e-9, "{found:e} of a diameter");
}

/// Differences at a time step, its half and its quarter shrink to nothing, or to `limit` of a diameter, in proportion to the step.
fn assert_first_order(what: &str, differences: &[f64; 3], limit: std::ops::Range<f64>) {
    let [coarse, middle, fine] = differences;
    let ratio = (coarse - middle) / (middle - fine);
    let rest = 2.0 * fine - middle;
    assert!((ratio - 2.0).abs() < 0.2, "{what}: {differences:?}, ratio {ratio:.3}, rest {rest:.1e}");
    assert!(limit.contains(&rest), "{what}: {rest:e} of a diameter is left at step 0");
}

#[test]
fn default_formulas_come_together_with_those_of_liggghts() {
    for (normal, law, contact) in [("Hertz", HERTZ, restitution()), ("stiffness given", LINEAR, direct())] {
        // Formulas that stay apart at any time step are switched off: the cap of a dashpot, friction under attraction.
        let compatibility = Compatibility::Tollgate;
        let law = LawSettings { compatibility, attraction: false, tangential_damping: false, ..law };
        for (bodies, scene) in SCENES {
            for friction in [0.0, 0.3] {
                let at = |timestep: f64| {
                    let mut setup = scene(law, contact, timestep);
                    setup.materials = materials(contact, friction, 0.0);
                    difference(&setup)
                };
                // At parts the lever arms r - delta and r - delta / 2 stay apart; the overlap is some percent of the radius.
                let differs = friction > 0.0 && bodies != "two spheres";
                let limit = if differs { 1e-3..1e-2 } else { -2e-6..2e-6 };
                let what = format!("{bodies}, {normal}, friction {friction}");
                assert_first_order(&what, &[4e-6, 2e-6, 1e-6].map(at), limit);
            }
        }
    }
}
