//! The particles that one insertion has placed so far, found by place: new particles must not overlap each other, and
//! the solver does not know of them before the insertion is over.

use crate::math::Vec3;

const NOBODY: u32 = u32::MAX;

/// New particles of one insertion, in a grid for each size range of a factor two, so that a wide size distribution
/// costs a look into a few cells for every range.
#[derive(Debug, Default)]
pub struct FreshParticles {
    levels: Vec<Level>,
}

#[derive(Debug)]
struct Level {
    /// Edge of a cell [m]: at least the diameter of every particle of this level.
    cell: f64,
    /// Head of the chain in each bucket; several cells may share one, since the distance decides in the end.
    buckets: Vec<u32>,
    /// The particles with the next one in their chain.
    particles: Vec<(Vec3, f64, u32)>,
}

impl FreshParticles {
    /// No particles yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a particle of `radius` [m] at `centre` [m].
    pub fn add(&mut self, centre: Vec3, radius: f64) {
        // cells are powers of two, so that a size belongs to the same level whatever came before it
        let cell = (2.0 * radius).log2().ceil().exp2().max(2.0 * radius);
        let level = match self.levels.iter().position(|level| level.cell == cell) {
            Some(level) => level,
            None => {
                self.levels.push(Level { cell, buckets: vec![NOBODY; 64], particles: Vec::new() });
                self.levels.len() - 1
            }
        };
        self.levels[level].add(centre, radius);
    }

    /// True where a sphere of `radius` [m] at `centre` [m] overlaps none of them.
    #[must_use]
    pub fn is_free(&self, centre: &Vec3, radius: f64) -> bool {
        self.levels.iter().all(|level| level.is_free(centre, radius))
    }
}

impl Level {
    fn add(&mut self, centre: Vec3, radius: f64) {
        self.particles.push((centre, radius, NOBODY));
        if self.particles.len() > self.buckets.len() {
            self.buckets = vec![NOBODY; 4 * self.buckets.len()];
            for index in 0..self.particles.len() {
                self.link(index);
            }
        } else {
            self.link(self.particles.len() - 1);
        }
    }

    fn link(&mut self, index: usize) {
        let bucket = self.bucket(self.cell_of(&self.particles[index].0));
        self.particles[index].2 = self.buckets[bucket];
        self.buckets[bucket] = u32::try_from(index).unwrap_or(NOBODY);
    }

    fn is_free(&self, centre: &Vec3, radius: f64) -> bool {
        let reach = radius + 0.5 * self.cell;
        let lower = self.cell_of(&centre.map(|x| x - reach));
        let upper = self.cell_of(&centre.map(|x| x + reach));
        let cells: f64 = (0..3).map(|axis| (upper[axis] - lower[axis] + 1) as f64).product();
        if cells > self.particles.len() as f64 {
            return self.particles.iter().all(|(other, other_radius, _)| apart(centre, radius, other, *other_radius));
        }
        for x in lower[0]..=upper[0] {
            for y in lower[1]..=upper[1] {
                for z in lower[2]..=upper[2] {
                    if !self.is_bucket_free(self.bucket([x, y, z]), centre, radius) {
                        return false;
                    }
                }
            }
        }
        true
    }

    fn is_bucket_free(&self, bucket: usize, centre: &Vec3, radius: f64) -> bool {
        let mut index = self.buckets[bucket];
        while index != NOBODY {
            let (other, other_radius, next) = &self.particles[index as usize];
            if !apart(centre, radius, other, *other_radius) {
                return false;
            }
            index = *next;
        }
        true
    }

    fn cell_of(&self, point: &Vec3) -> [i64; 3] {
        [point.x, point.y, point.z].map(|x| (x / self.cell).floor() as i64)
    }

    fn bucket(&self, [x, y, z]: [i64; 3]) -> usize {
        let mixed = (x.wrapping_mul(73_856_093)) ^ (y.wrapping_mul(19_349_663)) ^ (z.wrapping_mul(83_492_791));
        mixed.cast_unsigned() as usize & (self.buckets.len() - 1)
    }
}

fn apart(a: &Vec3, a_radius: f64, b: &Vec3, b_radius: f64) -> bool {
    let reach = a_radius + b_radius;
    (a - b).norm_squared() >= reach * reach
}

#[cfg(test)]
mod tests {
    use super::super::draw::FeedKey;
    use super::*;

    #[test]
    fn agrees_with_asking_every_particle() {
        let key = FeedKey::new(5, 0);
        let mut fresh = FreshParticles::new();
        let mut all: Vec<(Vec3, f64)> = Vec::new();
        let mut refused = 0;
        for serial in 0..3000 {
            // radii over a range of 1:100, the small ones common
            let radius = 0.001 * 100_f64.powf(key.size(serial)[0].powi(4));
            let [x, y, z] = key.places(serial).attempt(0).map(|u| u - 0.5);
            let centre = Vec3::new(x, y, z);
            let expected = all.iter().all(|(other, other_radius)| (centre - other).norm() >= radius + other_radius);
            assert_eq!(fresh.is_free(&centre, radius), expected, "particle {serial}");
            if expected {
                fresh.add(centre, radius);
                all.push((centre, radius));
            } else {
                refused += 1;
            }
        }
        assert!(refused > 100 && all.len() > 500, "the comparison must see both answers");
    }
}
