//! How particles meet: their relative place and motion, one pair a lane.

use super::contact::Touch;
use super::law::Compatibility;
use super::law::constants::LawTable;
use super::neighbor::list::{Candidate, Images, InnerList, NO_IMAGE};
use super::particles::{Acceleration, Sphere, Velocity};
use crate::math::Vec3;
use crate::math::lanes::{LaneVector, Lanes};

/// What all chunks read while they compute contacts.
#[derive(Debug, Clone, Copy)]
pub struct ContactScene<'a> {
    /// Centres and radii.
    pub spheres: &'a [Sphere],
    /// Velocities.
    pub velocities: &'a [Velocity],
    /// Accelerations at the last full step; none where no losses are to be booked.
    pub accelerations: &'a [Acceleration],
    /// Laws.
    pub law: &'a LawTable,
    /// The particles' material, where all have the same: their pairs need no look-up then.
    pub only_material: Option<u32>,
    /// Periodic images.
    pub images: &'a Images,
    /// Whether contacts have a memory.
    pub remembers: bool,
    /// Time step [s]; 0 where the memory must not move.
    pub timestep: f64,
    /// Watchdog's limit of overlap over the smaller radius [-].
    pub overlap_limit: f64,
    /// Factor c of I = c m r^2 [-].
    pub inertia_factor: f64,
    /// Whether particles may be asleep.
    pub sleeping: bool,
}

/// Pairs of particles, one a lane, as far as their places go.
#[derive(Clone, Copy)]
pub(super) struct Near<L> {
    /// From the first to the second [m].
    pub(super) branch: LaneVector<L>,
    /// Its square [m2].
    pub(super) square: L,
    /// Radii [m].
    pub(super) radii: [L; 2],
    /// Their sum [m].
    pub(super) sum: L,
}

/// Pairs in contact, one a lane, as far as their places go.
#[derive(Clone, Copy)]
pub(super) struct Depth<L> {
    /// Unit normals from the first to the second.
    pub(super) normal: LaneVector<L>,
    /// Overlaps [m].
    pub(super) overlap: L,
    /// Lever arms [m].
    pub(super) levers: [L; 2],
}

/// Storage indices of pairs, one a lane; lanes without a pair repeat one.
#[derive(Clone, Copy)]
pub(super) struct Block<'a> {
    pub(super) own: &'a [u32],
    pub(super) partner: &'a [u32],
}

impl ContactScene<'_> {
    /// Closing speed that the laws see less its mean over the time step [m/s]: half a time step of acceleration, unless the
    /// laws see half-step velocities.
    #[inline(always)]
    #[must_use]
    pub fn closing_lag(&self, acceleration: &Vec3, normal: &Vec3) -> f64 {
        match self.law.settings.compatibility {
            Compatibility::Tollgate => 0.5 * self.timestep * acceleration.dot(normal),
            Compatibility::Liggghts => 0.0,
        }
    }

    /// Places of the pairs of a block. `shift` is what leads to the partners' images [m].
    #[inline(always)]
    pub(super) fn near<L: Lanes>(&self, block: &Block, shift: Option<LaneVector<L>>) -> Near<L> {
        let rows = self.spheres.as_ptr().cast();
        debug_assert!(block.own.iter().chain(block.partner).all(|&index| (index as usize) < self.spheres.len()));
        // SAFETY: spheres are rows of four numbers, and lists name only particles that there are.
        let [own, partner] = unsafe { [L::gather_four(rows, block.own), L::gather_four(rows, block.partner)] };
        let mut branch = LaneVector::new(partner[0] - own[0], partner[1] - own[1], partner[2] - own[2]);
        if let Some(shift) = shift {
            branch = branch + shift;
        }
        Near { branch, square: branch.norm_squared(), radii: [own[3], partner[3]], sum: own[3] + partner[3] }
    }

    /// Places of one pair.
    #[inline(always)]
    pub(super) fn near_pair(&self, index: usize, candidate: Candidate) -> Near<f64> {
        let block = Block { own: &[index as u32], partner: &[candidate.partner] };
        let shift = (candidate.image != NO_IMAGE).then(|| (*self.images.offset(candidate.image)).into());
        self.near(&block, shift)
    }

    /// How the pairs of a block lie to each other; of no use in lanes that do not touch.
    #[inline(always)]
    pub(super) fn depth<L: Lanes>(&self, near: &Near<L>) -> Depth<L> {
        let distance = near.square.sqrt();
        let overlap = near.sum - distance;
        let half = L::splat(0.5) * overlap;
        let normal = near.branch * (L::splat(1.0) / distance);
        Depth { normal, overlap, levers: [near.radii[0] - half, near.radii[1] - half] }
    }

    /// Relative motion of the pairs of a block. Inertias are looked at with `ROLLING`.
    #[inline(always)]
    pub(super) fn touch<L: Lanes, const ROLLING: bool>(
        &self,
        block: &Block,
        near: &Near<L>,
        depth: &Depth<L>,
        effective: [L; 2],
    ) -> Touch<L> {
        let rows = self.velocities.as_ptr().cast();
        // SAFETY: velocities are rows of eight numbers, and lists name only particles that there are.
        let (a, b, [x, y, z]) = unsafe {
            (
                L::gather_eight(rows, block.own),
                L::gather_eight(rows, block.partner),
                L::gather_differences(rows, block.own, block.partner),
            )
        };
        let spins = [LaneVector::new(a[4], a[5], a[6]), LaneVector::new(b[4], b[5], b[6])];
        let mut inverse_inertia = L::zero();
        if ROLLING {
            let factor = L::splat(self.inertia_factor);
            inverse_inertia =
                a[3] / (factor * near.radii[0] * near.radii[0]) + b[3] / (factor * near.radii[1] * near.radii[1]);
        }
        Touch {
            normal: depth.normal,
            overlap: depth.overlap,
            velocity: LaneVector::new(x, y, z),
            // Products rounded on their own, so that it is the same seen from either particle.
            lever_spin: spins[0] * depth.levers[0] + spins[1] * depth.levers[1],
            relative_spin: spins[0] - spins[1],
            effective_radius: effective[0],
            effective_mass: effective[1],
            inverse_inertia,
            closing_lag: L::zero(),
        }
    }
}

impl<'a> Block<'a> {
    /// The block that begins at an entry of a list.
    #[inline(always)]
    pub(super) fn of<L: Lanes>(list: &'a InnerList, from: usize) -> Self {
        let lanes = from..from + L::COUNT;
        Self { own: &list.owners[lanes.clone()], partner: &list.partners[lanes] }
    }
}
