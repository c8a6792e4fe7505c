//! The free surface of a bed or heap: its height along one horizontal axis.

use super::statistics::median;
use crate::math::Bounds;
use crate::particle::ParticleState;

/// One point of a surface profile.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Place along the axis [m].
    pub position: f64,
    /// Height of the surface, z [m].
    pub height: f64,
}

/// Surface of the particles whose centres lie in `region`, in bins of `width` [m] along axis `along` (0 = x, 1 = y).
///
/// Each bin is cut across into square cells of about `width`; the highest sphere top z + r of a cell stands for its
/// surface, and the medians over the cells, of place and height, for the bin. So a few particles in flight or perched on
/// the surface move nothing where a bin has several cells. Tops lie above the mean surface by a share of a diameter that
/// is the same everywhere: heights are biased by that, slopes are not. Valid: `width` about one particle diameter or
/// more. Bins come in order from the first particle to the last; those with particles in fewer than half of their cells
/// have no surface (`None`).
#[must_use]
pub fn surface_profile(
    particles: &[ParticleState],
    region: &Bounds,
    along: usize,
    width: f64,
) -> Vec<Option<SurfacePoint>> {
    let across = 1 - along;
    let inside: Vec<&ParticleState> = particles.iter().filter(|p| region.contains(&p.position)).collect();
    let mut extent = Bounds::EMPTY;
    inside.iter().for_each(|p| extent.include(&p.position));
    if inside.is_empty() || width.is_nan() || width <= 0.0 {
        return Vec::new();
    }
    let size = extent.size();
    let bins = (size[along] / width) as usize + 1;
    let cells = ((size[across] / width).round() as usize).max(1);
    let cell_width = size[across] / cells as f64;
    let mut tops: Vec<Option<SurfacePoint>> = vec![None; bins * cells];
    for particle in inside {
        let bin = (((particle.position[along] - extent.minimum[along]) / width) as usize).min(bins - 1);
        let offset = particle.position[across] - extent.minimum[across];
        let cell = if cells == 1 { 0 } else { ((offset / cell_width) as usize).min(cells - 1) };
        let top = SurfacePoint { position: particle.position[along], height: particle.position.z + particle.radius };
        let highest = &mut tops[bin * cells + cell];
        if highest.is_none_or(|known| known.height < top.height) {
            *highest = Some(top);
        }
    }
    tops.chunks(cells).map(middle).collect()
}

fn middle(bin: &[Option<SurfacePoint>]) -> Option<SurfacePoint> {
    let covered: Vec<SurfacePoint> = bin.iter().flatten().copied().collect();
    if 2 * covered.len() < bin.len() {
        return None;
    }
    let of = |get: fn(&SurfacePoint) -> f64| median(&covered.iter().map(get).collect::<Vec<_>>());
    Some(SurfacePoint { position: of(|p| p.position)?, height: of(|p| p.height)? })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::measure::tests::particle;
    use approx::assert_relative_eq;

    const ALL: Bounds = Bounds { minimum: [-1e9; 3], maximum: [1e9; 3] };

    /// A layer of touching unit spheres on a square lattice, 10 along x and 5 along y, at height z.
    fn layer(z: f64) -> Vec<ParticleState> {
        (0..50).map(|k| particle(k, [2.0 * (k % 10) as f64, 2.0 * (k / 10) as f64, z], 1.0)).collect()
    }

    #[test]
    fn tops_of_a_layer_are_its_surface_on_both_axes() {
        for along in [0, 1] {
            let profile = surface_profile(&layer(3.0), &ALL, along, 2.0);
            assert_eq!(profile.len(), [10, 5][along]);
            for (k, point) in profile.iter().enumerate() {
                assert_relative_eq!(point.unwrap().height, 4.0, epsilon = 1e-12);
                assert_relative_eq!(point.unwrap().position, 2.0 * k as f64, epsilon = 1e-12);
            }
        }
    }

    #[test]
    fn a_minority_of_perched_particles_moves_nothing() {
        let mut particles = layer(3.0);
        // The layer is four cells deep.
        particles.push(particle(90, [6.0, 4.0, 50.0], 1.0));
        assert_eq!(surface_profile(&particles, &ALL, 0, 2.0)[3].unwrap().height, 4.0);
    }

    #[test]
    fn scattered_particles_are_no_surface() {
        let mut particles = layer(3.0);
        particles.push(particle(90, [40.0, 4.0, 1.0], 1.0));
        let profile = surface_profile(&particles, &ALL, 0, 2.0);
        assert_eq!(profile.len(), 21);
        assert!(profile[10..].iter().all(Option::is_none));
        assert!(surface_profile(&particles, &Bounds::EMPTY, 0, 2.0).is_empty());
    }
}
