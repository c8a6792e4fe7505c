//! What is true of all particles, found by all threads.

use super::particles::{Sphere, Velocity};
use super::threads::Threads;
use crate::math::Vec3;
use std::ops::Range;

/// Smallest and largest radius [m]; infinite and zero without particles.
pub(super) fn radii(spheres: &[Sphere], threads: &Threads) -> [f64; 2] {
    let pieces = threads.map_pieces(spheres.len(), |places| {
        let (mut smallest, mut largest) = (f64::INFINITY, 0.0_f64);
        for sphere in &spheres[places] {
            smallest = smallest.min(sphere.radius);
            largest = largest.max(sphere.radius);
        }
        [smallest, largest]
    });
    pieces.iter().fold([f64::INFINITY, 0.0], |all, piece| [all[0].min(piece[0]), all[1].max(piece[1])])
}

/// The material that all particles have, where it is one.
pub(super) fn only_material(velocities: &[Velocity], threads: &Threads) -> Option<u32> {
    let first = velocities.first()?.material;
    let is_only = threads
        .map_pieces(velocities.len(), |places| velocities[places].iter().all(|velocity| velocity.material == first));
    is_only.into_iter().all(|is_only| is_only).then_some(first)
}

/// Entries between two looks whether the answer is known.
const LOOK: usize = 128;

/// Largest distance [m] between where the particles are and where they were; `None` where `is_far` is true of it. What is true of a
/// distance must be true of larger ones.
pub(super) fn displacement_unless(
    spheres: &[Sphere],
    reference: &[[f64; 3]],
    threads: &Threads,
    is_far: impl Fn(f64) -> bool + Sync,
) -> Option<f64> {
    let square = |(sphere, old): (&Sphere, &[f64; 3])| (sphere.position() - Vec3::from(*old)).norm_squared();
    let of_piece = |places: Range<usize>| {
        let mut largest = 0.0_f64;
        for (spheres, reference) in spheres[places.clone()].chunks(LOOK).zip(reference[places].chunks(LOOK)) {
            largest = spheres.iter().zip(reference).map(square).fold(largest, f64::max);
            if is_far(largest.sqrt()) {
                return None;
            }
        }
        Some(largest)
    };
    let squares: Option<Vec<f64>> = threads.map_pieces(spheres.len(), of_piece).into_iter().collect();
    Some(squares?.into_iter().fold(0.0, f64::max).sqrt())
}

#[cfg(test)]
mod tests {
    use super::super::particles::Path;
    use super::*;

    #[test]
    fn the_extreme_one_is_found_wherever_it_stands() {
        for threads in [1, 2, 3, 7].map(Threads::new) {
            assert_eq!(radii(&[], &threads), [f64::INFINITY, 0.0]);
            assert_eq!(
                (only_material(&[], &threads), displacement_unless(&[], &[], &threads, |_| true)),
                (None, Some(0.0))
            );
            for count in [1_usize, 2, 9000] {
                for place in [0, count / 2, count - 1] {
                    let mut spheres = vec![Sphere { centre: [1.0; 3], radius: 2.0 }; count];
                    let reference: Vec<[f64; 3]> = spheres.iter().map(|sphere| sphere.centre).collect();
                    let moved = |spheres: &[Sphere], limit: f64| {
                        displacement_unless(spheres, &reference, &threads, |moved| moved > limit)
                    };
                    assert_eq!(moved(&spheres, 0.0), Some(0.0));
                    spheres[place] = Sphere { centre: [4.0, 1.0, 5.0], radius: 1.0 };
                    assert_eq!((moved(&spheres, 5.0), moved(&spheres, 4.999)), (Some(5.0), None));
                    assert_eq!(radii(&spheres, &threads), [1.0, if count == 1 { 1.0 } else { 2.0 }]);
                    spheres[place].radius = 3.0;
                    assert_eq!(radii(&spheres, &threads), [if count == 1 { 3.0 } else { 2.0 }, 3.0]);

                    let grain = |material| Velocity {
                        linear: [0.0; 3],
                        inverse_mass: 1.0,
                        angular: [0.0; 3],
                        material,
                        path: Path::Free,
                    };
                    let mut velocities = vec![grain(4); count];
                    assert_eq!(only_material(&velocities, &threads), Some(4));
                    velocities[place] = grain(5);
                    assert_eq!(only_material(&velocities, &threads), (count == 1).then_some(5));
                }
            }
        }
    }
}
