//! How ranks share the box.

use super::DeckOrder;
use crate::geometry::part::Surface;
use crate::math::{Bounds, Vec3};
use crate::scene::extent;

/// A rank's share of the box is at least so many of the largest diameters thick: thinner ones exchange more than they compute.
const THINNEST: f64 = 4.0;

/// Ranks along x, y and z, of all grids of so many ranks the first by these rules:
///
/// 1. no share of the box is thinner than four of the largest diameters;
/// 2. no cut across the axis that is nearest to gravity, for there particles fall, pile up and drain: a rank above or below
///    others has nothing to do for much of the run;
/// 3. the fullest rank has the least to do, if the particles are spread evenly over the box around what brings them in (feeds
///    of the stage; where there are none, its parts): LIGGGHTS cuts the box into equal shares, wherever in it the particles are;
///    differences of about a twentieth of all particles do not count;
/// 4. the cuts have the least area, over which ranks tell each other of their particles;
/// 5. more ranks along x, then along y.
///
/// A rule that no grid keeps falls for all of them.
#[must_use]
pub fn grid(order: &DeckOrder<'_>) -> [u32; 3] {
    let along_gravity = order.scene.gravity.iamax();
    let vertical = (order.scene.gravity.norm() > 0.0).then_some(along_gravity);
    let thinnest = THINNEST * order.scene.largest_diameter();
    choose(order.settings.ranks, &order.bounds, &occupied(order), vertical, thinnest)
}

/// The box around what brings particles in.
fn occupied(order: &DeckOrder<'_>) -> Bounds {
    let scene = order.scene;
    let feeds = scene.feeds.iter().map(|feed| extent::of_feed(&feed.kind));
    let feeds = feeds.filter(|bounds| !bounds.is_empty()).fold(Bounds::EMPTY, |all, one| all.union(&one));
    if !feeds.is_empty() {
        return feeds;
    }
    let meshes = scene.parts.iter().filter(|part| !matches!(part.surface, Surface::Plane { .. }));
    let parts = meshes.map(|part| extent::of_surface(&part.surface)).fold(Bounds::EMPTY, |all, one| all.union(&one));
    if parts.is_empty() { order.bounds } else { parts }
}

fn choose(ranks: u32, all: &Bounds, occupied: &Bounds, vertical: Option<usize>, thinnest: f64) -> [u32; 3] {
    let size = all.size();
    let rank = |grid: &[u32; 3]| {
        let thin = (0..3).any(|axis| grid[axis] > 1 && size[axis] / f64::from(grid[axis]) < thinnest);
        let stacked = vertical.is_some_and(|axis| grid[axis] > 1);
        let fullest: f64 = (0..3).map(|axis| fullest_share(grid[axis], all, occupied, axis)).product();
        (thin, stacked, (20.0 * fullest).round(), cut_area(grid, &size))
    };
    let order = |a: &[u32; 3], b: &[u32; 3]| {
        let ((thin_a, stacked_a, full_a, area_a), (thin_b, stacked_b, full_b, area_b)) = (rank(a), rank(b));
        let by_rules = thin_a.cmp(&thin_b).then(stacked_a.cmp(&stacked_b)).then(full_a.total_cmp(&full_b));
        by_rules.then(area_a.total_cmp(&area_b)).then(b.cmp(a))
    };
    grids(ranks).into_iter().min_by(order).unwrap_or([ranks, 1, 1])
}

fn grids(ranks: u32) -> Vec<[u32; 3]> {
    let divides = |whole: u32| (1..=whole).filter(move |part| whole.is_multiple_of(*part));
    divides(ranks).flat_map(|x| divides(ranks / x).map(move |y| [x, y, ranks / x / y])).collect()
}

/// What the fullest of equal slices of the box holds of particles that are spread evenly between the bounds of where they are.
fn fullest_share(slices: u32, all: &Bounds, occupied: &Bounds, axis: usize) -> f64 {
    let (low, high) = (all.minimum[axis], all.maximum[axis]);
    let (from, to) = (occupied.minimum[axis].max(low), occupied.maximum[axis].min(high));
    let width = (high - low) / f64::from(slices);
    if to <= from {
        // All in one place, and in one slice.
        return 1.0;
    }
    let within = |slice: u32| {
        let start = low + width * f64::from(slice);
        (to.min(start + width) - from.max(start)).max(0.0) / (to - from)
    };
    (0..slices).map(within).fold(0.0, f64::max)
}

/// Area of all cuts \[m2\].
fn cut_area(grid: &[u32; 3], size: &Vec3) -> f64 {
    (0..3).map(|axis| f64::from(grid[axis] - 1) * size[(axis + 1) % 3] * size[(axis + 2) % 3]).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bounds(minimum: [f64; 3], maximum: [f64; 3]) -> Bounds {
        Bounds { minimum, maximum }
    }

    #[test]
    fn a_silo_is_cut_into_columns() {
        let silo = bounds([0.0; 3], [1.0, 1.0, 4.0]);
        let cut = |ranks| choose(ranks, &silo, &silo, Some(2), 0.02);
        assert_eq!([1, 2, 4, 6].map(cut), [[1, 1, 1], [2, 1, 1], [2, 2, 1], [3, 2, 1]]);
        // Without gravity the silo is cut across its length.
        assert_eq!(choose(4, &silo, &silo, None, 0.02), [1, 1, 4]);
    }

    #[test]
    fn a_long_box_with_its_particles_at_one_end_is_cut_along() {
        // A hopper at one end of a box that holds the chute too: a cut across x leaves the other rank empty.
        let all = bounds([-0.1, -0.1, 0.0], [0.5, 0.1, 0.4]);
        let hopper = bounds([-0.04, -0.04, 0.3], [0.04, 0.04, 0.4]);
        assert_eq!(choose(2, &all, &hopper, Some(2), 0.02), [1, 2, 1]);
        // Where particles are everywhere, the shorter cut.
        assert_eq!(choose(2, &all, &all, Some(2), 0.02), [2, 1, 1]);
        // Of six slices across y (33 mm each) the two in the middle hold 5/12 of the hopper (80 mm) each; two slices across y hold
        // half of it each, and so do six across x (0.1 m each, with a cut at x = 0).
        assert!((fullest_share(6, &all, &hopper, 1) - 5.0 / 12.0).abs() < 1e-12);
        assert!((fullest_share(6, &all, &hopper, 0) - 0.5).abs() < 1e-12);
        assert_eq!(choose(6, &all, &hopper, Some(2), 0.02), [1, 6, 1]);
        // Four slices across y hold no less than two, so the shorter cuts.
        assert_eq!(choose(4, &all, &hopper, Some(2), 0.02), [2, 2, 1]);
    }

    #[test]
    fn a_thin_slot_is_cut_along_its_length_or_else_by_height() {
        let slot = bounds([0.0; 3], [0.5, 0.02, 1.0]);
        assert_eq!(choose(4, &slot, &slot, Some(2), 0.016), [4, 1, 1]);
        let pipe = bounds([0.0; 3], [0.02, 0.02, 1.0]);
        assert_eq!(choose(4, &pipe, &pipe, Some(2), 0.016), [1, 1, 4]);
    }

    #[test]
    fn every_grid_has_as_many_places_as_ranks() {
        for ranks in 1..=24 {
            let grids = grids(ranks);
            assert!(grids.iter().all(|grid| grid.iter().product::<u32>() == ranks), "{ranks}");
            assert!(grids.contains(&[ranks, 1, 1]) && grids.contains(&[1, 1, ranks]), "{ranks}");
        }
    }
}
