//! Cells over the particles' bounds, one grid per size level.

use crate::dem::particles::Sphere;
use crate::math::{Bounds, Vec3};

/// A grid of cells with the particles of one size level, in ascending storage order within a cell.
#[derive(Debug, Clone)]
pub struct CellGrid {
    origin: [f64; 3],
    cell: [f64; 3],
    counts: [usize; 3],
    periodic: [bool; 3],
    start: Vec<u32>,
    members: Vec<u32>,
    /// Largest radius in this level [m].
    pub largest_radius: f64,
}

/// Cells per particle that a grid may have at most: a cloud of far-flung particles gets larger cells, not more memory.
const CELLS_PER_PARTICLE: usize = 4;

impl CellGrid {
    /// Sorts `members` into cells of at least `edge` [m]; along a periodic axis the cells tile `domain` exactly.
    #[must_use]
    pub fn new(spheres: &[Sphere], members: &[u32], edge: f64, domain: &Bounds, periodic: [bool; 3]) -> Self {
        let mut bounds = Bounds::EMPTY;
        let mut largest_radius = 0.0_f64;
        for &member in members {
            let sphere = &spheres[member as usize];
            bounds.include(&sphere.position());
            largest_radius = largest_radius.max(sphere.radius);
        }
        for axis in (0..3).filter(|&axis| periodic[axis]) {
            bounds.minimum[axis] = domain.minimum[axis];
            bounds.maximum[axis] = domain.maximum[axis];
        }
        let size = bounds.size();
        let limit = CELLS_PER_PARTICLE * members.len() + 64;
        let mut edge = edge;
        let mut counts = [1_usize; 3];
        loop {
            let wanted = |axis: usize| (size[axis] / edge).floor().max(1.0);
            if wanted(0) * wanted(1) * wanted(2) <= limit as f64 {
                (0..3).for_each(|axis| counts[axis] = wanted(axis) as usize);
                break;
            }
            edge *= 1.26;
        }
        let cell = std::array::from_fn(|axis| (size[axis] / counts[axis] as f64).max(f64::MIN_POSITIVE));
        let mut grid = Self {
            origin: bounds.minimum,
            cell,
            counts,
            periodic,
            start: Vec::new(),
            members: Vec::new(),
            largest_radius,
        };
        grid.fill(spheres, members);
        grid
    }

    fn fill(&mut self, spheres: &[Sphere], members: &[u32]) {
        let total = self.counts.iter().product::<usize>();
        let cells: Vec<u32> = members.iter().map(|&m| self.cell_of(&spheres[m as usize].position())).collect();
        let mut start = vec![0_u32; total + 1];
        cells.iter().for_each(|&cell| start[cell as usize + 1] += 1);
        (0..total).for_each(|cell| start[cell + 1] += start[cell]);
        let mut next = start.clone();
        let mut sorted = vec![0_u32; members.len()];
        for (&member, &cell) in members.iter().zip(&cells) {
            sorted[next[cell as usize] as usize] = member;
            next[cell as usize] += 1;
        }
        self.start = start;
        self.members = sorted;
    }

    fn coordinate(&self, position: f64, axis: usize) -> usize {
        let cell = ((position - self.origin[axis]) / self.cell[axis]).floor();
        cell.clamp(0.0, (self.counts[axis] - 1) as f64) as usize
    }

    fn cell_of(&self, position: &Vec3) -> u32 {
        let [x, y, z] = [0, 1, 2].map(|axis| self.coordinate(position[axis], axis));
        ((z * self.counts[1] + y) * self.counts[0] + x) as u32
    }

    /// Particles of the level in the order of their cells, x fastest: the order of storage.
    #[must_use]
    pub fn in_cell_order(&self) -> &[u32] {
        &self.members
    }

    /// Calls `visit(member, image)` for every particle of the level whose cell lies within `reach` [m] of `position`;
    /// `image` is the number of domain lengths to add to the member's position, per axis.
    #[inline]
    pub fn for_each_near(&self, position: &Vec3, reach: f64, mut visit: impl FnMut(u32, [i8; 3])) {
        let ranges: [(isize, isize); 3] = std::array::from_fn(|axis| self.cell_range(position[axis], reach, axis));
        for z in ranges[2].0..=ranges[2].1 {
            let (z, image_z) = self.wrapped(z, 2);
            for y in ranges[1].0..=ranges[1].1 {
                let (y, image_y) = self.wrapped(y, 1);
                let row = (z * self.counts[1] + y) * self.counts[0];
                if !self.periodic[0] {
                    // Cells of a row are neighbours in memory: one run of members.
                    let from = self.start[row + ranges[0].0 as usize] as usize;
                    let to = self.start[row + ranges[0].1 as usize + 1] as usize;
                    self.members[from..to].iter().for_each(|&member| visit(member, [0, image_y, image_z]));
                    continue;
                }
                for x in ranges[0].0..=ranges[0].1 {
                    let (x, image_x) = self.wrapped(x, 0);
                    let (from, to) = (self.start[row + x] as usize, self.start[row + x + 1] as usize);
                    self.members[from..to].iter().for_each(|&member| visit(member, [image_x, image_y, image_z]));
                }
            }
        }
    }

    /// Offset [m] of the image shifted by so many domain lengths.
    #[must_use]
    pub fn image_offset(&self, shift: [i8; 3]) -> Vec3 {
        let length = |axis: usize| f64::from(shift[axis]) * self.cell[axis] * self.counts[axis] as f64;
        Vec3::new(length(0), length(1), length(2))
    }

    fn cell_range(&self, position: f64, reach: f64, axis: usize) -> (isize, isize) {
        if self.periodic[axis] {
            let low = ((position - reach - self.origin[axis]) / self.cell[axis]).floor() as isize;
            let high = ((position + reach - self.origin[axis]) / self.cell[axis]).floor() as isize;
            return (low, high);
        }
        (self.coordinate(position - reach, axis) as isize, self.coordinate(position + reach, axis) as isize)
    }

    fn wrapped(&self, cell: isize, axis: usize) -> (usize, i8) {
        let count = self.counts[axis] as isize;
        (cell.rem_euclid(count) as usize, cell.div_euclid(count) as i8)
    }
}

/// The cells of all size levels; a level holds radii within a factor of two.
#[derive(Debug, Clone, Default)]
pub struct CellLevels {
    /// Grids from the finest to the coarsest level.
    pub grids: Vec<CellGrid>,
    /// Level of each particle.
    pub level: Vec<u8>,
}

impl CellLevels {
    /// Sorts all particles into levels and cells, for pairs within `skin` [m] of contact.
    #[must_use]
    pub fn new(spheres: &[Sphere], skin: f64, domain: &Bounds, periodic: [bool; 3]) -> Self {
        let smallest = spheres.iter().map(|sphere| sphere.radius).fold(f64::INFINITY, f64::min);
        let level: Vec<u8> = spheres.iter().map(|sphere| (sphere.radius / smallest).log2() as u8).collect();
        let deepest = level.iter().copied().max().unwrap_or(0);
        let mut grids = Vec::new();
        let mut compact = vec![0_u8; usize::from(deepest) + 1];
        for number in 0..=deepest {
            let members: Vec<u32> =
                (0..spheres.len() as u32).filter(|&index| level[index as usize] == number).collect();
            if members.is_empty() {
                continue;
            }
            let largest = members.iter().map(|&m| spheres[m as usize].radius).fold(0.0, f64::max);
            compact[usize::from(number)] = grids.len() as u8;
            grids.push(CellGrid::new(spheres, &members, 2.0 * largest + skin, domain, periodic));
        }
        let level = level.into_iter().map(|number| compact[usize::from(number)]).collect();
        Self { grids, level }
    }
}
