//! How fast particles are expected to hit something, and how deep they sink in then.

use super::pairs::PossibleContact;
use super::{PlanFinding, warning};
use crate::dem::feed::{Face, Feed, FeedKind, Region};
use crate::geometry::part::{Part, Surface};
use crate::math::{Bounds, Vec3};
use crate::scene::Scene;
use serde::Serialize;

/// The speed at which particles are expected to hit something.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ImpactSpeed {
    /// Speed of the impact [m/s].
    pub speed: f64,
    /// Speed of the particles themselves [m/s].
    pub particle_speed: f64,
    /// Fastest point of a moving part [m/s].
    pub wall_speed: f64,
    /// Where it comes from.
    pub reason: String,
}

/// The deepest overlap expected.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OverlapForecast {
    /// Who touches whom.
    pub contact: String,
    /// Overlap at the expected impact speed over the particle's radius [-].
    pub share: f64,
    /// What the watchdog allows [-].
    pub limit: f64,
    /// What the stiffness would have to be multiplied by to keep the limit [-]: Young's modulus, or a stiffness given
    /// directly; 1 where it does.
    pub stiffening: f64,
}

/// The scene's impact speed, or the estimate from feeds, drop height and moving parts.
#[must_use]
pub fn expected_speed(scene: &Scene) -> ImpactSpeed {
    let wall_speed = wall_speed(scene);
    if let Some(speed) = scene.solver.impact_speed {
        let reason = "given in the scene".to_owned();
        return ImpactSpeed { speed, particle_speed: speed, wall_speed, reason };
    }
    let mut fastest = (0.0, "no feed brings particles".to_owned());
    for feed in &scene.feeds {
        let (energy, text) = fall_of(scene, feed);
        if energy >= fastest.0 {
            fastest = (energy, text);
        }
    }
    if scene.start_checkpoint.is_some() {
        let energy = work_of_gravity(scene, &scene.domain.bounds);
        if energy >= fastest.0 {
            fastest = (energy, "a fall through the whole domain, from a checkpoint or a stored stream".to_owned());
        }
    }
    let particle_speed = (2.0 * fastest.0).sqrt();
    let mut reason = fastest.1;
    if wall_speed > 0.0 {
        reason = format!("{reason}; and against it the fastest part at {wall_speed:.3} m/s");
    }
    ImpactSpeed { speed: particle_speed + wall_speed, particle_speed, wall_speed, reason }
}

/// Energy over mass [m2/s2] that a feed's particles can have when they hit something, and its reason.
fn fall_of(scene: &Scene, feed: &Feed) -> (f64, String) {
    let (bounds, speed_squared) = match &feed.kind {
        FeedKind::Fill { region, velocity, .. } => (region_bounds(region), velocity.norm_squared()),
        FeedKind::Stream { face, velocity, .. } => (face_bounds(face), velocity.norm_squared()),
        FeedKind::File { particles } => {
            let mut bounds = Bounds::EMPTY;
            let mut fastest = 0.0_f64;
            for particle in particles.iter() {
                bounds.include(&particle.position);
                fastest = fastest.max(particle.velocity.norm_squared());
            }
            (bounds, fastest)
        }
    };
    let work = work_of_gravity(scene, &bounds);
    let gravity = scene.gravity.norm();
    let height = if gravity > 0.0 { work / gravity } else { 0.0 };
    let text = format!(
        "sqrt(v^2 + 2 g h) with v = {:.3} m/s of feed '{}' and h = {height:.3} m from its top to the lowest part, or to the \
         border of the domain",
        speed_squared.sqrt(),
        feed.name
    );
    (0.5 * speed_squared + work, text)
}

/// Largest work of gravity over mass [m2/s2] on the way from `start` to the end of a fall; along a periodic axis nothing
/// ends a fall, so friction must: that axis is left out.
fn work_of_gravity(scene: &Scene, start: &Bounds) -> f64 {
    if start.is_empty() {
        return 0.0;
    }
    let floor = lowest_parts(scene);
    let along = |axis: usize| {
        let gravity = scene.gravity[axis];
        if gravity == 0.0 || scene.domain.periodic[axis] {
            return 0.0;
        }
        let domain = &scene.domain.bounds;
        // no part along this axis: only the domain ends the fall
        let is_bounded = floor.minimum[axis] <= floor.maximum[axis];
        let drop = match (gravity < 0.0, is_bounded) {
            (true, true) => start.maximum[axis] - domain.minimum[axis].max(floor.minimum[axis]),
            (true, false) => start.maximum[axis] - domain.minimum[axis],
            (false, true) => domain.maximum[axis].min(floor.maximum[axis]) - start.minimum[axis],
            (false, false) => domain.maximum[axis] - start.minimum[axis],
        };
        gravity.abs() * drop.max(0.0)
    };
    (0..3).map(along).filter(|work| work.is_finite()).sum()
}

/// Where the parts end; without limits where a part moves from its place, so that the domain decides.
fn lowest_parts(scene: &Scene) -> Bounds {
    let everything = Bounds { minimum: [f64::NEG_INFINITY; 3], maximum: [f64::INFINITY; 3] };
    if scene.parts.is_empty() || scene.parts.iter().any(|part| !part.motion.is_static()) {
        return everything;
    }
    // axis by axis: a plane bounds one axis only
    let mut all = Bounds::EMPTY;
    for bounds in scene.parts.iter().map(part_bounds) {
        for axis in 0..3 {
            all.minimum[axis] = all.minimum[axis].min(bounds.minimum[axis]);
            all.maximum[axis] = all.maximum[axis].max(bounds.maximum[axis]);
        }
    }
    all
}

/// Bounds of a part [m]; of a plane square to an axis those of its face, of any other plane none.
fn part_bounds(part: &Part) -> Bounds {
    match &part.surface {
        Surface::Plane { point, normal } => {
            let mut bounds = Bounds { minimum: [f64::NEG_INFINITY; 3], maximum: [f64::INFINITY; 3] };
            let axis = normal.iamax();
            if normal[axis].abs() > 1.0 - 1e-12 {
                // a plane bounds the space before it; sideways it says nothing about where a fall ends
                let everywhere = [f64::INFINITY; 3];
                bounds = Bounds { minimum: everywhere, maximum: everywhere.map(|x| -x) };
                bounds.minimum[axis] = point[axis];
                bounds.maximum[axis] = point[axis];
            }
            bounds
        }
        Surface::Frustum { start, end, start_radius, end_radius } => {
            let mut bounds = Bounds::EMPTY;
            for (centre, radius) in [(start, start_radius), (end, end_radius)] {
                bounds.include(&centre.map(|x| x - radius));
                bounds.include(&centre.map(|x| x + radius));
            }
            bounds
        }
        Surface::Mesh(mesh) => mesh.bounds(),
    }
}

fn region_bounds(region: &Region) -> Bounds {
    match region {
        Region::Box { minimum, maximum } => Bounds { minimum: (*minimum).into(), maximum: (*maximum).into() },
        Region::Cylinder { start, end, radius } => {
            let axis = (end - start).normalize();
            let reach = axis.map(|x| radius * (1.0 - x * x).max(0.0).sqrt());
            let mut bounds = Bounds::EMPTY;
            for centre in [start, end] {
                bounds.include(&(centre - reach));
                bounds.include(&(centre + reach));
            }
            bounds
        }
        Region::Inside(mesh) => mesh.bounds(),
    }
}

fn face_bounds(face: &Face) -> Bounds {
    let mut bounds = Bounds::EMPTY;
    match face {
        Face::Disc { centre, normal, radius } => {
            let reach: Vec3 = normal.map(|x| radius * (1.0 - x * x).max(0.0).sqrt());
            bounds.include(&(centre - reach));
            bounds.include(&(centre + reach));
        }
        Face::Rectangle { centre, side_a, side_b } => {
            for (a, b) in [(-0.5, -0.5), (-0.5, 0.5), (0.5, -0.5), (0.5, 0.5)] {
                bounds.include(&(centre + side_a * a + side_b * b));
            }
        }
    }
    bounds
}

/// Fastest point of any part inside the domain [m/s]. A conveyor counts: it drags particles to its speed.
fn wall_speed(scene: &Scene) -> f64 {
    let domain = &scene.domain.bounds;
    let speed = |part: &Part| {
        let own = part_bounds(part);
        let bounds = if own.is_empty() || own.minimum.iter().chain(&own.maximum).any(|x| !x.is_finite()) {
            *domain
        } else {
            own
        };
        let rigid = part.motion.speed_bound(&bounds);
        let belt = super::physics::belt_speed(part);
        (if rigid.is_finite() { rigid } else { 0.0 }) + belt
    };
    scene.parts.iter().map(speed).fold(0.0, f64::max)
}

/// The deepest overlap at the expected impact speed, and a warning where it passes what the watchdog allows.
pub fn forecast_overlap(
    scene: &Scene,
    contacts: &[PossibleContact],
    findings: &mut Vec<PlanFinding>,
) -> Option<OverlapForecast> {
    let share = |contact: &PossibleContact| contact.impact_overlap / contact.radius;
    let deepest = contacts.iter().max_by(|a, b| share(a).total_cmp(&share(b)))?;
    let limit = scene.solver.overlap_limit;
    let excess = (share(deepest) / limit).max(1.0);
    // delta ~ k^(-1/2) of a spring given directly; delta ~ E^(-2/5) of Hertz, and of the linear stiffness from E
    let stiffening = excess.powf(if deepest.is_direct { 2.0 } else { 2.5 });
    if stiffening > 1.0 {
        let quantity = if deepest.is_direct { "normal stiffness" } else { "Young's modulus" };
        findings.push(warning(
            "overlap-at-impact",
            format!(
                "{} at the expected impact speed reaches an overlap of {:.1} % of the radius, above the limit of {:.1} %: the \
                 watchdog would stop the run; make the {quantity} {:.2} times as large, or give solver.impact_speed if \
                 impacts are slower",
                deepest.name,
                100.0 * share(deepest),
                100.0 * limit,
                stiffening
            ),
        ));
    }
    Some(OverlapForecast { contact: deepest.name.clone(), share: share(deepest), limit, stiffening })
}
