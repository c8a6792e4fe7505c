//! Storage of the particles: records in the order of the cells, so that neighbours lie close in memory.

use super::integrate::Correction;
use super::threads::Threads;
use crate::math::{Vec3, vec3};
use crate::particle::{Body, ParticleId, ParticleState};
use std::borrow::Cow;

/// Centre [m] and radius [m]: all that the search for contacts reads.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(32))]
pub struct Sphere {
    /// Centre [m].
    pub centre: [f64; 3],
    /// Radius [m].
    pub radius: f64,
}

/// Reads a record as two rows of four numbers.
macro_rules! rows {
    ($name:ident) => {
        impl $name {
            /// Its two rows of four numbers.
            #[inline(always)]
            pub(super) fn rows(&self) -> [&[f64; 4]; 2] {
                let first: *const [f64; 4] = std::ptr::from_ref(self).cast();
                // SAFETY: eight numbers one after the other, none of them uninitialised.
                unsafe { [&*first, &*first.add(1)] }
            }
        }
    };
}

/// Writes a record as two rows of four numbers.
macro_rules! rows_mut {
    ($name:ident) => {
        impl $name {
            /// Its two rows of four numbers, to be changed. The last one of a velocity is two whole numbers of any bits, and must be
            /// written back as it was.
            #[inline(always)]
            pub(super) fn rows_mut(&mut self) -> [&mut [f64; 4]; 2] {
                let first: *mut [f64; 4] = std::ptr::from_mut(self).cast();
                // SAFETY: eight numbers one after the other, none of them uninitialised; the two rows do not overlap.
                unsafe { [&mut *first, &mut *first.add(1)] }
            }
        }
    };
}

rows!(Acceleration);
rows!(Load);
rows_mut!(Acceleration);
rows_mut!(Velocity);

impl Sphere {
    /// Centre and radius.
    #[inline(always)]
    pub(super) fn row(&self) -> &[f64; 4] {
        // SAFETY: four numbers one after the other.
        unsafe { &*std::ptr::from_ref(self).cast() }
    }

    /// Centre and radius, to be changed.
    #[inline(always)]
    pub(super) fn row_mut(&mut self) -> &mut [f64; 4] {
        // SAFETY: four numbers one after the other.
        unsafe { &mut *std::ptr::from_mut(self).cast() }
    }

    /// Centre as a vector [m].
    #[inline(always)]
    #[must_use]
    pub fn position(&self) -> Vec3 {
        Vec3::from(self.centre)
    }
}

/// Velocities, and what else the contact kernel needs of a particle.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct Velocity {
    /// Velocity of the centre [m/s].
    pub linear: [f64; 3],
    /// 1/m [1/kg].
    pub inverse_mass: f64,
    /// Spin [rad/s].
    pub angular: [f64; 3],
    /// Material.
    pub material: u32,
    /// How the particle moves.
    pub path: Path,
}

/// How a particle moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum Path {
    /// By the forces on it.
    Free = 0,
    /// Prescribed: constant velocity and spin. It acts on others and is not acted upon.
    Constant = 1,
    /// Prescribed: free fall.
    Ballistic = 2,
    /// Prescribed from outside after every time step: place, velocity, spin and their accelerations.
    Recorded = 3,
    /// By the forces on it, a tether to a recorded path among them.
    Tethered = 4,
    /// Not at all, until the forces on it are out of balance: see [`super::sleep`].
    Asleep = 5,
}

impl Path {
    /// The path of a stored number.
    #[must_use]
    pub const fn from_number(number: u8) -> Option<Self> {
        match number {
            0 => Some(Self::Free),
            1 => Some(Self::Constant),
            2 => Some(Self::Ballistic),
            3 => Some(Self::Recorded),
            4 => Some(Self::Tethered),
            5 => Some(Self::Asleep),
            _ => None,
        }
    }

    /// Whether the particle follows its path whatever acts on it.
    #[inline(always)]
    #[must_use]
    pub const fn is_prescribed(self) -> bool {
        matches!(self, Self::Constant | Self::Ballistic | Self::Recorded)
    }

    /// Whether the forces on the particle move it.
    #[inline(always)]
    #[must_use]
    pub const fn yields(self) -> bool {
        matches!(self, Self::Free | Self::Tethered)
    }
}

/// Force and torque on a particle: a row of eight numbers, as the contact kernel adds to it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct Load {
    /// Force [N].
    pub force: Vec3,
    /// Not used.
    spare: f64,
    /// Torque about the centre [N m].
    pub torque: Vec3,
    /// Not used.
    other_spare: f64,
}

impl Load {
    /// No load.
    pub const ZERO: Self = Self::new(vec3(0.0, 0.0, 0.0), vec3(0.0, 0.0, 0.0));

    /// Force [N] and torque [N m].
    #[must_use]
    pub const fn new(force: Vec3, torque: Vec3) -> Self {
        Self { force, spare: 0.0, torque, other_spare: 0.0 }
    }
}

/// Acceleration of a particle: a row of eight numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct Acceleration {
    /// Of the centre [m/s2].
    pub linear: Vec3,
    /// Zero.
    spare: f64,
    /// Of the spin [rad/s2].
    pub angular: Vec3,
    /// Zero.
    other_spare: f64,
}

impl Acceleration {
    /// None.
    pub const ZERO: Self = Self::new(vec3(0.0, 0.0, 0.0), vec3(0.0, 0.0, 0.0));

    /// Of the centre [m/s2] and of the spin [rad/s2].
    #[must_use]
    pub const fn new(linear: Vec3, angular: Vec3) -> Self {
        Self { linear, spare: 0.0, angular, other_spare: 0.0 }
    }
}

/// All particles, in storage order. Every list has the same length, but for the last one while it is empty.
///
/// A time step may be left to be completed: velocities are still those that the contact laws saw then, and accelerations those of
/// the full step before. Readers get the present ones all the same, made for them; whoever changes something completes the step.
#[derive(Debug, Clone, Default)]
pub struct Particles {
    /// Centres and radii.
    pub spheres: Vec<Sphere>,
    /// Velocities at the present time; within a time step and while it is late, those the contact laws see.
    velocities: Vec<Velocity>,
    /// Present loads.
    loads: Vec<Load>,
    /// Accelerations at the last full step; while it is late, at the one before.
    accelerations: Vec<Acceleration>,
    /// What completes the last time step, where that is still to be done.
    late: Option<Correction>,
    /// Identities.
    pub ids: Vec<ParticleId>,
    /// Particle densities [kg/m3].
    pub densities: Vec<f64>,
    /// At how many looks in a row each was calm; empty while nobody was looked at.
    pub calm_looks: Vec<u8>,
}

/// The lists that a time step works on.
#[derive(Debug)]
pub(super) struct MotionLists<'a> {
    pub spheres: &'a mut [Sphere],
    pub velocities: &'a mut [Velocity],
    pub accelerations: &'a mut [Acceleration],
    pub loads: &'a mut [Load],
}

impl Particles {
    /// Particles of these records, which lie in the same order.
    #[must_use]
    pub const fn of_records(
        spheres: Vec<Sphere>,
        velocities: Vec<Velocity>,
        accelerations: Vec<Acceleration>,
        loads: Vec<Load>,
        ids: Vec<ParticleId>,
        densities: Vec<f64>,
    ) -> Self {
        Self { spheres, velocities, loads, accelerations, late: None, ids, densities, calm_looks: Vec::new() }
    }

    /// The lists as they are kept, late or not, for who carries out a time step.
    pub(super) fn kept_lists(&mut self) -> MotionLists<'_> {
        let Self { spheres, velocities, accelerations, loads, .. } = self;
        MotionLists { spheres, velocities, accelerations, loads }
    }

    /// Leaves the last time step to be completed by `correction`; every particle must be moved by its load.
    pub(super) fn put_off(&mut self, correction: Correction) {
        debug_assert!(self.late.is_none() && self.velocities.iter().all(|velocity| velocity.path.yields()));
        self.late = Some(correction);
    }

    /// What is left to be done of the last time step, for who does it now.
    pub(super) const fn take_late(&mut self) -> Option<Correction> {
        self.late.take()
    }

    /// Completes the last time step.
    fn complete(&mut self) {
        let Some(correction) = self.late.take() else { return };
        let moved = self.velocities.iter_mut().zip(&mut self.accelerations);
        for ((velocity, acceleration), (load, sphere)) in moved.zip(self.loads.iter().zip(&self.spheres)) {
            correction.complete(velocity, acceleration, load, sphere);
        }
    }

    /// Velocity and acceleration of a particle at the present full step; within a time step, the velocity that the laws see.
    #[must_use]
    pub fn motion(&self, index: usize) -> (Velocity, Acceleration) {
        let (mut velocity, mut acceleration) = (self.velocities[index], self.accelerations[index]);
        if let Some(correction) = &self.late {
            correction.complete(&mut velocity, &mut acceleration, &self.loads[index], &self.spheres[index]);
        }
        (velocity, acceleration)
    }

    /// The velocity of [`Particles::motion`].
    #[must_use]
    pub fn velocity(&self, index: usize) -> Velocity {
        self.motion(index).0
    }

    /// The acceleration of [`Particles::motion`].
    #[must_use]
    pub fn acceleration(&self, index: usize) -> Acceleration {
        self.motion(index).1
    }

    /// Velocities of all particles as [`Particles::motion`] gives them.
    #[must_use]
    pub fn velocities(&self) -> Cow<'_, [Velocity]> {
        match self.late {
            None => Cow::Borrowed(&self.velocities),
            Some(_) => (0..self.len()).map(|index| self.velocity(index)).collect(),
        }
    }

    /// What does not change within a time step is true of these: path, material and mass. Their velocities are those that the
    /// contact laws see, or full-step ones where the last step is complete.
    #[must_use]
    pub fn laws_velocities(&self) -> &[Velocity] {
        &self.velocities
    }

    /// How a particle moves.
    #[must_use]
    pub fn path(&self, index: usize) -> Path {
        self.velocities[index].path
    }

    /// Present loads.
    #[must_use]
    pub fn loads(&self) -> &[Load] {
        &self.loads
    }

    /// The velocities at the present full step, to be changed.
    pub fn velocities_mut(&mut self) -> &mut [Velocity] {
        self.complete();
        &mut self.velocities
    }

    /// The accelerations at the present full step, to be changed.
    pub fn accelerations_mut(&mut self) -> &mut [Acceleration] {
        self.complete();
        &mut self.accelerations
    }

    /// The present loads, to be changed.
    pub fn loads_mut(&mut self) -> &mut [Load] {
        self.complete();
        &mut self.loads
    }

    /// Number of particles.
    #[must_use]
    pub fn len(&self) -> usize {
        self.ids.len()
    }

    /// True where there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.ids.is_empty()
    }

    /// Adds a free particle. Of a disc, what lies outside of its plane is left out.
    pub fn push(&mut self, state: &ParticleState, body: Body) {
        self.complete();
        self.spheres.push(Sphere { centre: body.in_plane(&state.position).into(), radius: state.radius });
        self.velocities.push(Velocity {
            linear: body.in_plane(&state.velocity).into(),
            inverse_mass: 1.0 / body.mass(state.radius, state.density),
            angular: body.about_plane(&state.spin).into(),
            material: u32::from(state.material),
            path: Path::Free,
        });
        self.loads.push(Load::ZERO);
        self.accelerations.push(Acceleration::ZERO);
        self.ids.push(state.id);
        self.densities.push(state.density);
        if !self.calm_looks.is_empty() {
            self.calm_looks.push(0);
        }
    }

    /// Particle number `index` as others see it.
    #[must_use]
    pub fn state(&self, index: usize) -> ParticleState {
        let velocity = self.velocity(index);
        ParticleState {
            id: self.ids[index],
            material: velocity.material as u16,
            radius: self.spheres[index].radius,
            density: self.densities[index],
            position: self.spheres[index].position(),
            velocity: Vec3::from(velocity.linear),
            spin: Vec3::from(velocity.angular),
        }
    }

    /// Puts the particles into a new order, `order[new] = old`; drops those that `order` does not name.
    pub fn reorder(&mut self, order: &[u32], threads: &Threads) {
        fn pick<T: Copy + Send + Sync>(list: &mut Vec<T>, order: &[u32], threads: &Threads) {
            *list = threads.collect(order.len(), |new| list[order[new] as usize]);
        }
        pick(&mut self.spheres, order, threads);
        pick(&mut self.velocities, order, threads);
        pick(&mut self.loads, order, threads);
        pick(&mut self.accelerations, order, threads);
        pick(&mut self.ids, order, threads);
        pick(&mut self.densities, order, threads);
        if !self.calm_looks.is_empty() {
            pick(&mut self.calm_looks, order, threads);
        }
    }

    /// Root-mean-square speed of the centres [m/s]; 0 without particles.
    #[must_use]
    pub fn rms_speed(&self) -> f64 {
        let square = |index| Vec3::from(self.velocity(index).linear).norm_squared();
        let sum: f64 = (0..self.len()).map(square).sum();
        if self.is_empty() { 0.0 } else { (sum / self.len() as f64).sqrt() }
    }

    /// Mass of particle `index` [kg].
    #[must_use]
    pub fn mass(&self, index: usize) -> f64 {
        1.0 / self.velocities[index].inverse_mass
    }
}
