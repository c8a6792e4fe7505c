//! LIGGGHTS' box.

use super::parts::walls;
use crate::backend::liggghts::Schedule;
use crate::math::{Bounds, Vec3};
use crate::plan::impact::expected_speed;
use crate::scene::Scene;

/// Speed above which no particle is expected [m/s]: twice the plan's estimate.
#[must_use]
pub fn speed_limit(scene: &Scene) -> f64 {
    2.0 * expected_speed(scene).speed
}

/// Where particles may be: the domain, and around it as far as who leaves it can come before the batch at which it is taken out.
#[must_use]
pub fn particle_zone(scene: &Scene, schedule: &Schedule) -> Bounds {
    let travel = speed_limit(scene) * schedule.time(schedule.cadence.hand_over);
    scene.domain.bounds.grown(2.0 * scene.largest_diameter() + 2.0 * travel)
}

/// The box: the scene's domain, enlarged along open axes so that all meshes lie inside along their motion and where they are parked,
/// and that whoever leaves the domain is taken out, a batch at a time, before the box's border loses it.
#[must_use]
pub fn bounds(scene: &Scene, schedule: &Schedule) -> Bounds {
    let end = schedule.time(schedule.steps);
    let mut meshes = Bounds::EMPTY;
    for wall in walls(scene, schedule, false) {
        let reach = wall.reach(end);
        meshes = meshes.union(&reach);
        if let (Some(way), false) = (wall.parking, reach.is_empty()) {
            let shifted = |corner: [f64; 3]| (Vec3::from(corner) + way).into();
            meshes = meshes.union(&Bounds { minimum: shifted(reach.minimum), maximum: shifted(reach.maximum) });
        }
    }
    let particles = particle_zone(scene, schedule);
    // LIGGGHTS drops triangles on the border itself.
    let margin = 0.5 * scene.largest_diameter();
    let mut all = if meshes.is_empty() { particles } else { particles.union(&meshes.grown(margin)) };
    for axis in (0..3).filter(|axis| scene.domain.periodic[*axis]) {
        all.minimum[axis] = scene.domain.bounds.minimum[axis];
        all.maximum[axis] = scene.domain.bounds.maximum[axis];
    }
    all
}
