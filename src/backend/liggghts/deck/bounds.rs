//! LIGGGHTS' box.

use super::parts::walls;
use crate::backend::liggghts::Schedule;
use crate::math::Bounds;
use crate::plan::impact::expected_speed;
use crate::scene::Scene;

/// Speed above which no particle is expected [m/s]: twice the plan's estimate.
#[must_use]
pub fn speed_limit(scene: &Scene) -> f64 {
    2.0 * expected_speed(scene).speed
}

/// The box: the scene's domain, enlarged along open axes so that all meshes lie inside along their motion, and that whoever leaves
/// the domain is taken out, a batch at a time, before the box's border loses it.
#[must_use]
pub fn bounds(scene: &Scene, schedule: &Schedule) -> Bounds {
    let end = schedule.time(schedule.steps);
    let domain = scene.domain.bounds;
    let diameter = scene.largest_diameter();
    let travel = speed_limit(scene) * schedule.time(schedule.cadence.hand_over);
    let particles = domain.grown(2.0 * diameter + 2.0 * travel);
    let meshes = walls(scene, schedule).iter().fold(Bounds::EMPTY, |all, wall| all.union(&wall.reach(end)));
    // LIGGGHTS drops triangles on the border itself.
    let mut all = if meshes.is_empty() { particles } else { particles.union(&meshes.grown(0.5 * diameter)) };
    for axis in (0..3).filter(|axis| scene.domain.periodic[*axis]) {
        (all.minimum[axis], all.maximum[axis]) = (domain.minimum[axis], domain.maximum[axis]);
    }
    all
}
