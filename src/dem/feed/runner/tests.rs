//! Feeds as the solver meets them.

use super::super::{Face, Rate, Region};
use super::*;
use crate::particle::{GradingBy, SizeDistribution};
use approx::assert_relative_eq;

/// A world of spheres that fall out of it with a speed, for occupancy only.
#[derive(Default)]
struct World {
    spheres: Vec<ParticleState>,
}

impl Occupancy for World {
    fn is_free(&self, centre: &Vec3, radius: f64) -> bool {
        self.spheres.iter().all(|other| (other.position - centre).norm() >= other.radius + radius)
    }
}

impl World {
    fn advance(&mut self, time: f64) {
        for sphere in &mut self.spheres {
            sphere.position += sphere.velocity * time;
        }
    }
}

fn class(diameter: SizeDistribution) -> ParticleClass {
    ParticleClass { name: "ore".to_owned(), material: 0, diameter }
}

fn uniform() -> ParticleClass {
    class(SizeDistribution::Uniform { minimum: 0.003, maximum: 0.005 })
}

fn cube(edge: f64) -> Region {
    Region::Box { minimum: Vec3::zeros(), maximum: Vec3::repeat(edge) }
}

fn fill(region: Region, amount: Amount) -> FeedKind {
    FeedKind::Fill {
        class: 0,
        region,
        amount,
        velocity: Vec3::z() * -1.0,
        start: 0.0,
        interval: f64::INFINITY,
        until: f64::INFINITY,
    }
}

fn stream(rate: Rate, amount: Option<Amount>, until: f64) -> FeedKind {
    let face = Face::Disc { centre: Vec3::zeros(), normal: Vec3::z(), radius: 0.05 };
    FeedKind::Stream { class: 0, face, rate, amount, velocity: Vec3::z() * 2.0, start: 0.1, until }
}

fn runner(kinds: Vec<FeedKind>, class: ParticleClass, body: Body, seed: u64) -> FeedRunner {
    let feeds: Vec<Feed> =
        kinds.into_iter().enumerate().map(|(k, kind)| Feed { name: format!("feed {k}"), kind }).collect();
    FeedRunner::new(&feeds, &[class], &[Some(3300.0)], body, seed)
}

fn assert_no_overlap(particles: &[ParticleState]) {
    for (k, a) in particles.iter().enumerate() {
        for b in &particles[..k] {
            // round-off of a sum of squares of lengths near 0.1 m
            assert!((a.position - b.position).norm() >= a.radius + b.radius - 1e-15, "{:?} overlaps {:?}", a.id, b.id);
        }
    }
}

/// Runs `steps` steps of `dt` and returns all particles; `world` moves meanwhile.
fn drive(runner: &mut FeedRunner, world: &mut World, first: u64, last: u64, dt: f64) -> Vec<ParticleState> {
    let mut all = Vec::new();
    for step in first..last {
        let time = step as f64 * dt;
        if runner.due(time) {
            let new = runner.insert(time, world);
            world.spheres.extend(&new);
            all.extend(new);
        }
        world.advance(dt);
    }
    all
}

#[test]
fn a_fill_brings_its_count_inside_without_overlaps() {
    type Inside = fn(&Vec3) -> f64;
    let in_cube: Inside = |x| x.min().min(0.05 - x.max());
    let in_cylinder: Inside = |x| {
        let (axis, length) = (Vec3::new(0.03, 0.0, 0.05).normalize(), 0.03_f64.hypot(0.05));
        let height = x.dot(&axis);
        (0.03 - (x - axis * height).norm()).min(height).min(length - height)
    };
    let in_tetrahedron: Inside = |x| x.min().min((0.1 - x.sum()) / 3.0_f64.sqrt());
    let cylinder = Region::Cylinder { start: Vec3::zeros(), end: Vec3::new(0.03, 0.0, 0.05), radius: 0.03 };
    let mesh = Region::Inside(super::super::region::tests::tetrahedron(0.1));
    for (region, depth) in [(cube(0.05), in_cube), (cylinder, in_cylinder), (mesh, in_tetrahedron)] {
        let mut feeds = runner(vec![fill(region, Amount::Count(500))], uniform(), Body::Sphere, 1);
        let new = feeds.insert(0.0, &World::default());
        assert_eq!(new.len(), 500);
        assert!(feeds.finished(0.0) && !feeds.due(0.1));
        assert_no_overlap(&new);
        assert!(new.iter().all(|p| depth(&p.position) >= p.radius - 1e-15), "a sphere sticks out of the region");
        let report = &feeds.reports()[0];
        assert_eq!((report.inserted_count, &report.shortfall), (500, &None));
        assert_relative_eq!(
            report.inserted_mass,
            new.iter().map(|p| Body::Sphere.mass(p.radius, 3300.0)).sum::<f64>(),
            max_relative = 1e-12
        );
        assert_eq!(report.grading.iter().map(|row| row.count).sum::<u64>(), 500);
    }
}

#[test]
fn a_fill_by_mass_stops_at_the_first_particle_that_reaches_it() {
    let asked = 0.05;
    let mut feeds = runner(vec![fill(cube(0.1), Amount::Mass(asked))], uniform(), Body::Sphere, 1);
    let mut new = feeds.insert(0.0, &World::default());
    new.sort_by_key(|p| p.id);
    let masses: Vec<f64> = new.iter().map(|p| Body::Sphere.mass(p.radius, 3300.0)).collect();
    let before_last: f64 = masses[..masses.len() - 1].iter().sum();
    assert!(before_last < asked && before_last + masses[masses.len() - 1] >= asked);
    assert!(new.iter().enumerate().all(|(serial, p)| p.id.serial() == serial as u64));
    // a sum of equal masses that is the amount but for round-off needs no further particle
    let fixed = class(SizeDistribution::Fixed { diameter: 0.004 });
    let amount = Amount::Mass(100.0 * Body::Sphere.mass(0.002, 3300.0));
    let mut feeds = runner(vec![fill(cube(0.1), amount)], fixed, Body::Sphere, 1);
    assert_eq!(feeds.insert(0.0, &World::default()).len(), 100);
    assert_eq!(feeds.reports()[0].shortfall, None);
}

#[test]
fn sizes_belong_to_the_serial_number_wherever_the_particle_comes() {
    let mut wide = runner(vec![fill(cube(0.1), Amount::Count(300))], uniform(), Body::Sphere, 9);
    let mut narrow = runner(
        vec![FeedKind::Fill {
            class: 0,
            region: cube(0.025),
            amount: Amount::Count(300),
            velocity: Vec3::x(),
            start: 0.0,
            interval: 0.03,
            until: f64::INFINITY,
        }],
        uniform(),
        Body::Sphere,
        9,
    );
    let mut once = wide.insert(0.0, &World::default());
    let mut world = World::default();
    let mut repeated = drive(&mut narrow, &mut world, 0, 200, 0.01);
    once.sort_by_key(|p| p.id);
    repeated.sort_by_key(|p| p.id);
    assert_eq!(repeated.len(), 300);
    assert!(narrow.finished(2.0));
    assert!(once.iter().zip(&repeated).all(|(a, b)| a.id == b.id && a.radius.to_bits() == b.radius.to_bits()));
    // all of it has come, so the grading is the one that was drawn
    let rows = narrow.reports()[0].grading.clone();
    for row in rows {
        let tolerance = 5.0 * (row.asked * (1.0 - row.asked) / 300.0).sqrt();
        assert!((row.inserted - row.asked).abs() < tolerance, "{row:?}");
    }
}

#[test]
fn a_fill_goes_to_the_limit_of_random_addition_and_says_so() {
    let edge = 0.05;
    let fixed = class(SizeDistribution::Fixed { diameter: 0.004 });
    let mut feeds = runner(vec![fill(cube(edge), Amount::Count(100_000))], fixed, Body::Sphere, 4);
    let new = feeds.insert(0.0, &World::default());
    assert_no_overlap(&new);
    // centres lie in a cube smaller by a diameter, and spheres reach half a diameter beyond that one on average half:
    // saturation 0.38 of a volume between the two; 300 attempts stay a few hundredths below it
    let volume = new.iter().map(|p| Body::Sphere.mass(p.radius, 1.0)).sum::<f64>();
    assert!(volume > 0.30 * (edge - 0.002_f64).powi(3), "solid fraction {}", volume / edge.powi(3));
    assert!(feeds.finished(0.0));
    let shortfall = feeds.reports()[0].shortfall.clone().unwrap();
    assert_eq!(shortfall.missing, Amount::Count(100_000 - new.len() as u64));
    assert!(shortfall.cause.contains("the region is full"), "{}", shortfall.cause);
}

#[test]
fn a_particle_larger_than_the_region_is_given_up_with_its_cause() {
    let sizes = SizeDistribution::Sieve {
        by: GradingBy::Number,
        sieves: vec![0.004, 0.005, 0.06, 0.07],
        fractions: vec![0.8, 0.0, 0.2],
    };
    let mut kind = fill(cube(0.05), Amount::Count(50));
    if let FeedKind::Fill { interval, .. } = &mut kind {
        *interval = 0.1;
    }
    let mut feeds = runner(vec![kind], class(sizes.clone()), Body::Sphere, 4);
    let new = feeds.insert(0.0, &World::default());
    assert!(new.iter().all(|p| p.radius < 0.0025));
    assert!(feeds.finished(0.0), "waiting for a place that cannot exist");
    let report = feeds.reports().remove(0);
    assert_eq!(report.shortfall.as_ref().unwrap().missing, Amount::Count(50 - new.len() as u64));
    assert!(report.shortfall.unwrap().cause.contains("do not fit into the region"));
    // neither do they block a stream
    let kind = stream(Rate::Count(1000.0), Some(Amount::Count(200)), f64::INFINITY);
    let face = Face::Disc { centre: Vec3::zeros(), normal: Vec3::z(), radius: 0.02 };
    let FeedKind::Stream { class: index, rate, amount, velocity, start, until, .. } = kind else { unreachable!() };
    let kind = FeedKind::Stream { class: index, face, rate, amount, velocity, start, until };
    let mut feeds = runner(vec![kind], class(sizes), Body::Sphere, 4);
    let new = drive(&mut feeds, &mut World::default(), 0, 1000, 1e-3);
    assert!(new.len() > 120 && feeds.finished(1.0));
    assert!(feeds.reports()[0].shortfall.as_ref().unwrap().cause.contains("do not fit through the face"));
}

#[test]
fn two_feeds_of_one_step_and_a_file_do_not_overlap() {
    let from_file = ParticleState {
        id: crate::particle::ParticleId::new(2, 0),
        material: 0,
        radius: 0.01,
        density: 3300.0,
        position: Vec3::repeat(0.02),
        velocity: Vec3::zeros(),
        spin: Vec3::zeros(),
    };
    let kinds = vec![
        fill(cube(0.05), Amount::Count(300)),
        fill(cube(0.05), Amount::Count(300)),
        FeedKind::File { particles: vec![from_file].into() },
    ];
    let mut feeds = runner(kinds, uniform(), Body::Sphere, 3);
    let new = feeds.insert(0.0, &World::default());
    assert_eq!(new.len(), 601);
    assert_no_overlap(&new);
    assert_eq!(feeds.reports()[2].inserted_count, 1);
    // other feeds' particles keep their own draws
    let first: Vec<f64> = new.iter().filter(|p| p.id.feed() == 0).map(|p| p.radius).collect();
    let second: Vec<f64> = new.iter().filter(|p| p.id.feed() == 1).map(|p| p.radius).collect();
    assert_ne!(first, second);
}

#[test]
fn a_stream_keeps_its_mean_rate_whatever_the_time_step() {
    for dt in [1e-4, 3.7e-4, 0.013] {
        let rate = 700.0;
        let mut feeds = runner(vec![stream(Rate::Count(rate), None, 1.1)], uniform(), Body::Sphere, 5);
        let mut world = World::default();
        let mut inserted = 0;
        for step in 0..(1.3 / dt) as u64 {
            let time = step as f64 * dt;
            inserted += drive(&mut feeds, &mut world, step, step + 1, dt).len();
            let due = rate * (time.min(1.1) - 0.1);
            // exactly the particles due so far: the count is the due amount rounded up, particle 0 being due at once
            if time > 0.1 && dt < 0.01 {
                assert!((inserted as f64 - due).abs() <= 1.0 + 1e-9, "{inserted} of {due} at {time} s");
            }
        }
        assert_eq!(inserted, 700, "time step {dt} s");
        assert!(feeds.finished(1.3));
        assert_eq!(feeds.reports()[0].shortfall, None);
    }
}

#[test]
fn a_stream_by_mass_keeps_its_rate_to_one_particle() {
    let rate = 0.2;
    let mut feeds = runner(vec![stream(Rate::Mass(rate), None, 2.1)], uniform(), Body::Sphere, 5);
    let new = drive(&mut feeds, &mut World::default(), 0, 24_000, 1e-4);
    let mass: f64 = new.iter().map(|p| Body::Sphere.mass(p.radius, 3300.0)).sum();
    let largest = Body::Sphere.mass(0.0025, 3300.0);
    assert!(mass >= rate * 2.0 * (1.0 - 1e-9) && mass < rate * 2.0 + largest, "{mass}");
    assert!(new.iter().all(|p| p.position.z == 0.0 && p.position.norm() <= 0.05 - p.radius + 1e-12));
    let mut limited =
        runner(vec![stream(Rate::Mass(rate), Some(Amount::Count(100)), f64::INFINITY)], uniform(), Body::Sphere, 5);
    assert_eq!(drive(&mut limited, &mut World::default(), 0, 24_000, 1e-4).len(), 100);
    assert!(limited.finished(2.4) && limited.reports()[0].shortfall.is_none());
}

#[test]
fn a_crowded_stream_carries_over_and_reports_its_deficit() {
    // 20 000 spheres a second of 4 mm through a disc of 100 mm at 2 m/s: a solid fraction of 0.04, with room
    let fixed = class(SizeDistribution::Fixed { diameter: 0.004 });
    let ample = |rate| {
        let mut feeds = runner(vec![stream(Rate::Count(rate), None, 0.15)], fixed.clone(), Body::Sphere, 5);
        let mut world = World::default();
        let new = drive(&mut feeds, &mut world, 0, 800, 2e-4);
        assert_no_overlap(&world.spheres);
        (new.len(), feeds.reports().remove(0))
    };
    let (inserted, report) = ample(20_000.0);
    assert_eq!(inserted, 1000);
    assert_eq!(report.shortfall, None);
    // half a million: a solid fraction above one, which no feed can bring
    let (inserted, report) = ample(500_000.0);
    assert_eq!(report.asked, Amount::Count(25_000));
    let shortfall = report.shortfall.unwrap();
    assert_eq!(shortfall.missing, Amount::Count(25_000 - inserted as u64));
    assert!(inserted > 3_000, "{inserted}");
    assert!(shortfall.cause.contains("too crowded"), "{}", shortfall.cause);
}

#[test]
fn a_time_window_that_ends_says_so() {
    let kind = FeedKind::Fill {
        class: 0,
        region: cube(0.02),
        amount: Amount::Count(1000),
        velocity: Vec3::zeros(),
        start: 0.05,
        interval: 0.1,
        until: 0.3,
    };
    let mut feeds = runner(vec![kind], uniform(), Body::Sphere, 5);
    assert!(!feeds.due(0.04));
    assert!(feeds.reports()[0].shortfall.as_ref().unwrap().cause.contains("first insertion is due at 0.05 s"));
    let mut world = World::default();
    drive(&mut feeds, &mut world, 0, 20, 0.01);
    assert!(!feeds.finished(0.2));
    assert!(feeds.reports()[0].shortfall.as_ref().unwrap().cause.contains("next one is due at"));
    drive(&mut feeds, &mut world, 20, 40, 0.01);
    assert!(feeds.finished(0.4) && !feeds.due(10.0));
    assert!(feeds.reports()[0].shortfall.as_ref().unwrap().cause.contains("time window ended at 0.3 s"));
}

#[test]
fn discs_stay_in_their_plane() {
    let body = Body::Disc { thickness: 0.01 };
    let kinds = vec![fill(cube(0.2), Amount::Count(800)), stream(Rate::Count(100.0), Some(Amount::Count(20)), 1.0)];
    let mut feeds = runner(kinds, uniform(), body, 2);
    let new = drive(&mut feeds, &mut World::default(), 0, 100, 0.01);
    assert_eq!(new.len(), 820);
    assert!(new.iter().all(|p| p.position.y == 0.0 && p.velocity.y == 0.0));
}

#[test]
fn restoring_continues_bit_for_bit_through_text() {
    let sizes = SizeDistribution::Lognormal { median: 0.004, geometric_deviation: 1.4, minimum: 0.002, maximum: 0.012 };
    let kinds = || {
        let repeated = FeedKind::Fill {
            class: 0,
            region: Region::Box { minimum: Vec3::new(0.0, 0.0, 0.1), maximum: Vec3::new(0.03, 0.03, 0.13) },
            amount: Amount::Mass(0.2),
            velocity: Vec3::x() * 0.5,
            start: 0.02,
            interval: 0.04,
            until: 1.0,
        };
        vec![repeated, stream(Rate::Mass(2.0), None, 0.9), stream(Rate::Count(123.0), Some(Amount::Mass(0.05)), 0.9)]
    };
    let make = || runner(kinds(), class(sizes.clone()), Body::Sphere, 77);
    let mut whole = make();
    let mut whole_world = World::default();
    let expected = drive(&mut whole, &mut whole_world, 0, 500, 2e-3);
    for stop in [1, 60, 233] {
        let mut first = make();
        let mut world = World::default();
        let mut found = drive(&mut first, &mut world, 0, stop, 2e-3);
        let text = serde_json::to_string(&first.state()).unwrap();
        let state: FeedRunnerState = serde_json::from_str(&text).unwrap();
        let mut second = make();
        assert!(second.fits(&state));
        second.restore(state);
        found.extend(drive(&mut second, &mut world, stop, 500, 2e-3));
        assert_eq!(found, expected, "stopped at step {stop}");
        assert_eq!(second.reports(), whole.reports());
        assert_eq!(second.state(), whole.state());
    }
    assert!(expected.len() > 400, "{}", expected.len());
}

#[test]
fn another_seed_is_another_fill() {
    let draw = |seed| {
        runner(vec![fill(cube(0.1), Amount::Count(50))], uniform(), Body::Sphere, seed).insert(0.0, &World::default())
    };
    assert_eq!(draw(1), draw(1));
    assert_ne!(draw(1), draw(2));
}
