//! Plans of small scenes against closed forms.

use super::cost::FeedSupply;
use super::plan as plan_of;
use super::timestep::{Limit, round_down};
use super::*;
use crate::dem::feed::{Amount, Face, Feed, FeedKind, Rate, Region};
use crate::dem::law::{Compatibility, LawSettings, NormalLaw, RollingLaw, TangentialLaw};
use crate::dem::timescale as scale;
use crate::geometry::motion::{Motion, MotionKind, MotionTerm};
use crate::geometry::part::{Part, Surface, Trigger};
use crate::material::{Elasticity, Material, MaterialTable, PairContact, PairProperties};
use crate::math::{Bounds, Vec3};
use crate::particle::{Body, ParticleClass, ParticleId, ParticleState, SizeDistribution};
use crate::scene::{Domain, EndConditions, OutputSettings, SolverSettings};
use approx::assert_relative_eq;
use std::f64::consts::PI;

const RADIUS: f64 = 0.002;
const DENSITY: f64 = 3300.0;
const YOUNGS: f64 = 1e8;
const POISSON: f64 = 0.25;

fn pair(friction: f64) -> PairProperties {
    let contact = PairContact::Restitution { coefficient: 0.5 };
    PairProperties { contact, sliding_friction: friction, rolling_friction: 0.0 }
}

/// A hundred spheres in a cube of 0.1 m, from 0.1 m to 0.2 m above a rigid floor.
fn scene() -> Scene {
    let solid = Elasticity::Isotropic { youngs_modulus: YOUNGS, poissons_ratio: POISSON };
    let mut materials = MaterialTable::new(vec![
        Material { name: "ore".to_owned(), density: Some(DENSITY), elasticity: Some(solid) },
        Material { name: "steel".to_owned(), density: None, elasticity: Some(Elasticity::Rigid) },
    ]);
    materials.set_pair(0, 0, pair(0.5));
    materials.set_pair(0, 1, pair(0.5));
    let fill = FeedKind::Fill {
        class: 0,
        region: Region::Box { minimum: Vec3::new(0.0, 0.0, 0.1), maximum: Vec3::new(0.1, 0.1, 0.2) },
        amount: Amount::Count(100),
        velocity: Vec3::z() * -1.0,
        start: 0.0,
        interval: f64::INFINITY,
        until: f64::INFINITY,
    };
    Scene {
        name: "heap".to_owned(),
        seed: 1,
        body: Body::Sphere,
        gravity: Vec3::z() * -9.81,
        domain: Domain { bounds: Bounds { minimum: [-0.1; 3], maximum: [0.3; 3] }, periodic: [false; 3] },
        materials,
        law: LawSettings {
            normal: NormalLaw::HertzMindlin,
            tangential: TangentialLaw::Total,
            tangential_damping: true,
            attraction: false,
            rolling: RollingLaw::None,
            characteristic_velocity: 1.0,
            compatibility: Compatibility::Tollgate,
        },
        classes: vec![ParticleClass {
            name: "ore".to_owned(),
            material: 0,
            diameter: SizeDistribution::Fixed { diameter: 2.0 * RADIUS },
        }],
        feeds: vec![Feed { name: "fill".to_owned(), kind: fill }],
        parts: vec![floor(Motion::default())],
        solver: SolverSettings {
            timestep: None,
            timestep_fraction: 0.2,
            skin: None,
            sleeping: None,
            overlap_limit: 0.1,
            impact_speed: None,
            forced_models: Vec::new(),
        },
        end: EndConditions { time: 2.0, at_rest: None, empty: false, left_count: None },
        output: OutputSettings {
            frame_interval: None,
            vtp: false,
            lammps: false,
            contacts: false,
            series_interval: 0.01,
            energy: false,
            checkpoint_interval: None,
        },
        measures: Vec::new(),
        gates: Vec::new(),
        stages: Vec::new(),
        backend: crate::scene::backend::BackendName::Native,
        liggghts: crate::scene::backend::LiggghtsSettings::default(),
        start_checkpoint: None,
    }
}

fn floor(motion: Motion) -> Part {
    Part {
        name: "floor".to_owned(),
        material: 1,
        surface: Surface::Plane { point: Vec3::zeros(), normal: Vec3::z() },
        motion,
        appears: Trigger::Always,
        disappears: Trigger::Never,
    }
}

fn limit(plan: &Plan, name: &str) -> f64 {
    plan.timestep.limits.iter().find(|limit| limit.name == name).unwrap().value
}

fn decision<'a>(plan: &'a Plan, name: &str) -> &'a ModelDecision {
    plan.models.iter().find(|model| model.name == name).unwrap()
}

fn finding(plan: &Plan, name: &str) -> Option<Severity> {
    plan.findings.iter().find(|finding| finding.name == name).map(|finding| finding.severity)
}

/// Speed after the fall from the top of the region to the floor, with the feed's own speed.
fn fall() -> f64 {
    (1.0_f64 + 2.0 * 9.81 * 0.2).sqrt()
}

#[test]
fn impact_speed_is_that_of_the_highest_fall() {
    let plan = plan_of(&scene(), None);
    assert_relative_eq!(plan.impact.speed, fall(), max_relative = 1e-14);
    // without a floor the domain ends the fall; a given speed rules
    let mut open = scene();
    open.parts.clear();
    assert_relative_eq!(plan_of(&open, None).impact.speed, (1.0 + 2.0 * 9.81 * 0.3_f64).sqrt(), max_relative = 1e-14);
    open.solver.impact_speed = Some(7.0);
    assert_eq!(plan_of(&open, None).impact.speed, 7.0);
    // along a periodic axis nothing but friction ends a fall
    let mut incline = scene();
    incline.gravity = Vec3::new(5.0, 0.0, -9.81);
    incline.domain.periodic[0] = true;
    assert_relative_eq!(plan_of(&incline, None).impact.speed, fall(), max_relative = 1e-14);
    // a floor that rises meets them
    let rise = MotionTerm { kind: MotionKind::Translate { velocity: Vec3::z() * 0.5 }, from: 0.0, until: 1.0 };
    let mut moving = scene();
    moving.parts = vec![floor(Motion { terms: vec![rise] })];
    let plan = plan_of(&moving, None);
    assert_relative_eq!(plan.impact.wall_speed, 0.5, max_relative = 1e-14);
    assert_relative_eq!(plan.impact.speed, 0.5 + (1.0 + 2.0 * 9.81 * 0.3_f64).sqrt(), max_relative = 1e-14);
    assert!(plan.is_on("moving_walls"));
}

#[test]
fn every_limit_has_its_closed_form() {
    let plan = plan_of(&scene(), None);
    let mass = 4.0 / 3.0 * PI * RADIUS.powi(3) * DENSITY;
    let shear = YOUNGS / (2.0 * (1.0 + POISSON));
    assert_relative_eq!(
        limit(&plan, "rayleigh_time"),
        PI * RADIUS * (DENSITY / shear).sqrt() / (0.1631 * POISSON + 0.8766),
        max_relative = 1e-14
    );
    // the stiffer partner is the rigid floor: E* = E / (1 - nu^2), m* = m, R* = r
    let effective_youngs = YOUNGS / (1.0 - POISSON * POISSON);
    let on_floor = scale::hertz_contact_duration(mass, RADIUS, effective_youngs, fall());
    let on_another = scale::hertz_contact_duration(mass / 2.0, RADIUS / 2.0, effective_youngs / 2.0, fall());
    assert_relative_eq!(limit(&plan, "hertz_contact_duration"), on_floor.min(on_another) / 3.0, max_relative = 1e-13);
    // a sphere in a corner of the bed at 1 % of its radius, hit on the stiffest side: 11/12 (9 k_pp + 3 k_pw) + k_impact
    let tangent = |youngs: f64, radius: f64, overlap: f64| 2.0 * youngs * (radius * overlap).sqrt();
    let (e_pp, e_pw) = (effective_youngs / 2.0, effective_youngs);
    let resting = 9.0 * tangent(e_pp, RADIUS / 2.0, 0.01 * RADIUS) + 3.0 * tangent(e_pw, RADIUS, 0.01 * RADIUS);
    let hit = tangent(e_pw, RADIUS, scale::hertz_maximum_overlap(mass, RADIUS, e_pw, fall()));
    // the wall's own compliance is none, and Mindlin's ratio k_t / k_n = 4 G* / E* = 2 (1 - nu) / (2 - nu) for both
    let ratio = 2.0 * (1.0 - POISSON) / (2.0 - POISSON);
    let omega_squared = 2.0 * (11.0 / 12.0 * resting + hit) * ratio * (2.0 / 3.0) / 0.4 / mass;
    let damping = scale::damping_ratio(0.5);
    let factor = (1.0 + damping * damping).sqrt() - damping;
    assert_relative_eq!(limit(&plan, "spring_period"), 2.0 / omega_squared.sqrt() * factor, max_relative = 1e-12);
    assert_relative_eq!(limit(&plan, "displacement"), 0.1 * RADIUS / fall(), max_relative = 1e-14);
    assert_eq!(limit(&plan, "moving_wall"), f64::INFINITY);
    // 0.2 of the limits of accuracy, three times that of the limit of stability
    let share = |limit: &Limit| if limit.stability { 0.6 } else { 0.2 };
    let smallest = plan.timestep.limits.iter().map(|limit| share(limit) * limit.value).fold(f64::INFINITY, f64::min);
    let binding = plan.timestep.limits.iter().find(|limit| Some(limit.name) == plan.timestep.binding).unwrap();
    assert_eq!(share(binding) * binding.value, smallest);
    assert_eq!(plan.timestep.chosen, round_down(smallest));
    assert!(plan.timestep.fraction <= share(binding) && plan.timestep.fraction > 0.9 * share(binding));
    assert!(!plan.is_refused(), "{:?}", plan.findings);
}

#[test]
fn the_spring_period_of_given_stiffnesses_has_its_closed_form() {
    let mut scene = scene();
    scene.law.normal = NormalLaw::Linear;
    let (k, mass) = (1e4, 4.0 / 3.0 * PI * RADIUS.powi(3) * DENSITY);
    let contact = PairContact::Stiffness {
        normal_stiffness: k,
        tangential_stiffness: 0.5 * k,
        normal_damping: 0.0,
        tangential_damping: 0.0,
    };
    for other in [0, 1] {
        let properties = PairProperties { contact, sliding_friction: 0.3, rolling_friction: 0.0 };
        scene.materials.set_pair(0, other, properties);
    }
    let plan = plan_of(&scene, None);
    // twelve contacts: rotation is faster than translation, 2/3 xi / (2/5) = 5/6 > 1/3 + 2/3 xi = 2/3 at xi = 1/2
    let omega = (2.0 * 12.0 * k * (5.0 / 6.0) / mass).sqrt();
    assert_relative_eq!(limit(&plan, "spring_period"), 2.0 / omega, max_relative = 1e-13);
    // two spheres in line have the shortest contact: half the mass
    let duration = PI * (mass / 2.0 / k).sqrt();
    assert_relative_eq!(limit(&plan, "linear_contact_duration"), duration / 3.0, max_relative = 1e-13);
    // the deepest overlap is that on the floor, v sqrt(m/k)
    let overlap = plan.overlap.as_ref().unwrap();
    let share = fall() * (mass / k).sqrt() / RADIUS;
    assert_relative_eq!(overlap.share, share, max_relative = 1e-7);
    assert_relative_eq!(overlap.stiffening, (share / 0.1).powi(2), max_relative = 1e-6);
    assert_eq!(finding(&plan, "overlap-at-impact"), Some(Severity::Warning));
    // with the stiffness asked for, the warning is gone
    let stiffer = PairContact::Stiffness {
        normal_stiffness: 1.001 * overlap.stiffening * k,
        tangential_stiffness: 0.5 * k,
        normal_damping: 0.0,
        tangential_damping: 0.0,
    };
    for other in [0, 1] {
        let properties = PairProperties { contact: stiffer, sliding_friction: 0.3, rolling_friction: 0.0 };
        scene.materials.set_pair(0, other, properties);
    }
    assert_eq!(finding(&plan_of(&scene, None), "overlap-at-impact"), None);
}

#[test]
fn a_softer_hertz_particle_is_told_the_modulus_it_needs() {
    let mut scene = scene();
    let soften = |scene: &mut Scene, youngs_modulus: f64| {
        scene.materials.materials[0].elasticity =
            Some(Elasticity::Isotropic { youngs_modulus, poissons_ratio: POISSON });
    };
    soften(&mut scene, 1e5);
    let stiffening = plan_of(&scene, None).overlap.unwrap().stiffening;
    assert!(stiffening > 1.0);
    soften(&mut scene, 1e5 * stiffening * (1.0 + 1e-9));
    let plan = plan_of(&scene, None);
    assert_eq!(finding(&plan, "overlap-at-impact"), None);
    assert_relative_eq!(plan.overlap.unwrap().share, 0.1, max_relative = 1e-9);
}

#[test]
fn an_unstable_step_is_refused_and_a_coarse_one_warned_about() {
    let mut scene = scene();
    let spring = limit(&plan_of(&scene, None), "spring_period");
    scene.solver.timestep = Some(1.01 * spring);
    let plan = plan_of(&scene, None);
    assert!(plan.is_refused());
    assert_eq!(finding(&plan, "unstable-timestep"), Some(Severity::Refusal));
    assert_eq!(plan.timestep.chosen, 1.01 * spring);
    scene.solver.timestep = Some(0.99 * spring);
    assert!(!plan_of(&scene, None).is_refused());
    scene.solver.timestep = Some(1e-4 * spring);
    assert_eq!(finding(&plan_of(&scene, None), "wasteful-timestep"), Some(Severity::Warning));
    let shortest = limit(&plan_of(&scene, None), "hertz_contact_duration");
    scene.solver.timestep = Some(1.01 * shortest);
    assert!(finding(&plan_of(&scene, None), "coarse-timestep").is_some());
}

#[test]
fn models_follow_from_the_scene() {
    let plan = plan_of(&scene(), None);
    for (name, on) in [
        ("gravity", true),
        ("normal_damping", true),
        ("sliding_friction", true),
        ("tangential_history", true),
        ("tangential_damping", true),
        ("rolling_resistance", false),
        ("spin", true),
        ("material_table", true),
        ("walls", true),
        ("moving_walls", false),
        ("meshes", false),
        ("part_events", false),
        ("periodic_borders", false),
        ("plane_problem", false),
        ("energy_budget", false),
    ] {
        assert_eq!(decision(&plan, name).on, on, "{name}");
        assert!(!decision(&plan, name).reason.is_empty());
    }
    assert_eq!(plan.models.len(), 15);
    let mut smooth = scene();
    smooth.materials.set_pair(0, 0, pair(0.0));
    smooth.materials.set_pair(0, 1, pair(0.0));
    let plan = plan_of(&smooth, None);
    for name in ["sliding_friction", "tangential_history", "tangential_damping", "spin"] {
        assert!(!plan.is_on(name), "{name}");
    }
    // friction of a pair that cannot touch counts for nothing
    smooth.materials.set_pair(1, 1, pair(0.7));
    assert!(!plan_of(&smooth, None).is_on("sliding_friction"));
}

#[test]
fn forcing_a_model_says_what_it_risks() {
    let mut scene = scene();
    scene.solver.forced_models = vec![("sliding-friction".to_owned(), false), ("energy_budget".to_owned(), true)];
    let plan = plan_of(&scene, None);
    assert!(!plan.is_on("sliding_friction") && !plan.is_on("tangential_history") && !plan.is_on("spin"));
    assert!(plan.is_on("energy_budget"));
    assert!(decision(&plan, "sliding_friction").risk.unwrap().contains("heaps"));
    assert_eq!(finding(&plan, "forced-model"), Some(Severity::Warning));
    scene.solver.forced_models = vec![("gravity".to_owned(), false)];
    assert!(plan_of(&scene, None).is_refused());
    scene.solver.forced_models = vec![("magic".to_owned(), true)];
    assert!(plan_of(&scene, None).findings[0].text.contains("unknown model 'magic'"));
}

#[test]
fn cost_counts_what_the_feeds_bring() {
    let mut scene = scene();
    let mass = 4.0 / 3.0 * PI * RADIUS.powi(3) * DENSITY;
    let stream = FeedKind::Stream {
        class: 0,
        face: Face::Disc { centre: Vec3::repeat(0.2), normal: Vec3::z(), radius: 0.05 },
        rate: Rate::Mass(1000.0 * mass),
        amount: None,
        velocity: Vec3::zeros(),
        start: 0.5,
        until: 1.5,
    };
    scene.feeds.push(Feed { name: "stream".to_owned(), kind: stream });
    scene.solver.timestep = Some(1e-5);
    let calibration = Calibration {
        particle_steps_per_second_dense: 1e7,
        particle_steps_per_second_dilute: 1e8,
        bytes_per_particle: 1000.0,
        base_bytes: 5e6,
        threads: 1,
    };
    let cost = plan_of(&scene, Some(calibration)).cost;
    let by_feed: Vec<f64> = cost.feeds.iter().map(|feed: &FeedSupply| feed.particles).collect();
    // the mean mass is that of the one size, but for round-off: at most one particle more
    assert!(by_feed[0] == 100.0 && (1000.0..=1001.0).contains(&by_feed[1]), "{by_feed:?}");
    assert_eq!(cost.steps, 2e5);
    // the stream's particles are there from 1 s on average, half of the time
    assert_relative_eq!(cost.particle_steps, 2e5 * (100.0 + 0.5 * by_feed[1]), max_relative = 1e-3);
    assert_relative_eq!(cost.wall_s.unwrap(), cost.particle_steps / 1e7, max_relative = 1e-14);
    assert_relative_eq!(cost.memory_bytes.unwrap(), 5e6 + 1000.0 * cost.particles, max_relative = 1e-14);
    assert_eq!(plan_of(&scene, None).cost.wall_s, None);
    // free particles in a periodic box without gravity
    scene.gravity = Vec3::zeros();
    let plan = plan_of(&scene, Some(calibration));
    assert_relative_eq!(plan.cost.wall_s.unwrap(), plan.cost.particle_steps / 1e8, max_relative = 1e-14);
    assert_relative_eq!(plan.skin.skin, round_down(2.0 * RADIUS), max_relative = 1e-14);
}

/// The scene with spheres from a file instead, on a lattice of six to an edge and so many radii apart; run for `time` [s].
fn filed(apart: f64, time: f64) -> Scene {
    let mut scene = scene();
    let place = |axis: usize| move |number: usize| (number / 6_usize.pow(axis as u32) % 6) as f64 * apart * RADIUS;
    let sphere = |number: usize| ParticleState {
        id: ParticleId::new(0, number as u64),
        material: 0,
        radius: RADIUS,
        density: DENSITY,
        position: Vec3::new(place(0)(number), place(1)(number), place(2)(number)),
        velocity: Vec3::zeros(),
        spin: Vec3::zeros(),
    };
    scene.feeds =
        vec![Feed { name: "cloud".to_owned(), kind: FeedKind::File { particles: (0..216).map(sphere).collect() } }];
    scene.end.time = time;
    scene
}

#[test]
fn a_cloud_that_has_no_time_to_fall_is_dilute_and_whatever_comes_to_rest_is_not() {
    // Ten radii apart, the centres span 0.1 m, of which a quarter is fallen through in 0.0714 s.
    assert_relative_eq!(plan_of(&filed(10.0, 0.071), None).skin.skin, round_down(2.0 * RADIUS), max_relative = 1e-14);
    let dilute = |scene: &Scene| plan_of(scene, None).skin.reason.contains("few contacts");
    assert!(dilute(&filed(10.0, 0.071)));
    assert!(!dilute(&filed(10.0, 0.072)), "it falls");
    assert!(!dilute(&filed(2.1, 0.01)), "a bed, in however large a domain");
    let mut more = filed(10.0, 0.07);
    more.feeds.push(scene().feeds.remove(0));
    assert!(!dilute(&more), "more comes");
    let mut goes_on = filed(10.0, 0.07);
    goes_on.start_checkpoint = Some("state.checkpoint".into());
    assert!(!dilute(&goes_on), "more is there");
}

#[test]
fn a_fill_beyond_its_region_is_not_counted() {
    let mut scene = scene();
    if let FeedKind::Fill { amount, .. } = &mut scene.feeds[0].kind {
        *amount = Amount::Count(1_000_000);
    }
    let full = 0.38 * 1e-3 / (4.0 / 3.0 * PI * RADIUS.powi(3));
    assert_eq!(plan_of(&scene, None).cost.particles, full.floor());
}

#[test]
fn two_digits_are_kept_and_never_rounded_up() {
    for (value, expected) in [(1.239e-5, 1.2e-5), (9.99e-7, 9.9e-7), (1e-5, 1e-5), (3.0e-6, 3e-6), (123.0, 120.0)] {
        assert_eq!(round_down(value), expected);
    }
    assert_eq!(round_down(0.2 * 3.5e-5), 7e-6);
}

#[test]
fn requirements_meet_capabilities() {
    use super::choose::{Capabilities, Requirement, requirements, verdict};
    let mut scene = scene();
    assert_eq!(requirements(&scene), [Requirement::HertzMindlinLaw]);
    scene.law.rolling = RollingLaw::Epsd2;
    scene.output.energy = true;
    let mut plan = plan_of(&scene, None);
    assert!(plan.backends[0].can());
    let other = Capabilities { backend: "other".to_owned(), can: vec![Requirement::HertzMindlinLaw] };
    plan.add_backend(&scene, &other);
    assert_eq!(plan.backends[1].missing, [Requirement::Epsd2Rolling, Requirement::EnergyBudget]);
    let text = plan.to_text();
    for need in [Requirement::Epsd2Rolling, Requirement::EnergyBudget] {
        assert!(text.contains(need.words()), "{text}");
    }
    let liggghts = verdict(&scene, &Capabilities::liggghts());
    assert!(liggghts.can(), "it has EPSD2, and an energy budget is only left out: {liggghts:?}");
}

#[test]
fn text_and_json_name_everything() {
    let plan = plan_of(&scene(), None);
    let text = plan.to_text();
    for limit in &plan.timestep.limits {
        assert!(text.contains(limit.name));
    }
    for model in &plan.models {
        assert!(text.contains(model.name) && text.contains(&model.reason));
    }
    assert!(text.contains("binds: ") && text.contains("wall_time"));
    let json = serde_json::to_value(&plan).unwrap();
    assert_eq!(json["timestep"]["chosen"], plan.timestep.chosen);
    assert!(json["timestep"]["limits"][4]["value"].is_null(), "a limit that does not apply is no number in JSON");
}
