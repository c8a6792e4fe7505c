//! The motion of a chunk's particles over a time step, row by row: see [`super::step`] for the scheme.

use super::particles::{Acceleration, Load, Path, Sphere, Velocity};
use super::sleep::SleepSettings;
use crate::math::lanes::{LaneWork, Lanes, Mask};
use crate::math::{Bounds, Vec3};
use crate::particle::Body;

/// What moving a chunk's particles found.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct MotionNote {
    /// Square of the longest way of a particle [m2].
    pub farthest_squared: f64,
    /// Whether a centre is beyond an open border.
    pub leaves: bool,
}

/// Lower and upper borders [m] as rows; infinite where there is none.
pub(super) fn border_rows(domain: &Bounds, periodic: [bool; 3]) -> [[f64; 4]; 2] {
    let row = |border: [f64; 3], none: f64| {
        std::array::from_fn(|axis| if axis < 3 && !periodic[axis] { border[axis] } else { none })
    };
    [row(domain.minimum, f64::NEG_INFINITY), row(domain.maximum, f64::INFINITY)]
}

/// x += v dt + a dt^2 / 2, v += a lead dt, and spins likewise.
pub(super) struct Advance<'a> {
    pub spheres: &'a mut [Sphere],
    pub velocities: &'a mut [Velocity],
    pub accelerations: &'a [Acceleration],
    /// Time step [s].
    pub dt: f64,
    /// Share of it that the laws' velocities are ahead.
    pub lead: f64,
    /// Open borders, lower and upper.
    pub domain: &'a [[f64; 4]; 2],
}

/// A vector in the first three lanes of a row.
fn row<R: Lanes>(vector: &Vec3) -> R {
    R::from_slice(&[vector.x, vector.y, vector.z, 0.0])
}

/// `changed` in the first three lanes, `kept` in the last: the radius, or what is no number.
#[inline(always)]
fn first_three<R: Lanes>(changed: R, kept: R) -> R {
    R::select(R::Mask::from_bits(0b0111), changed, kept)
}

impl LaneWork for Advance<'_> {
    type Output = MotionNote;

    #[inline(always)]
    fn run<L: Lanes>(self) -> MotionNote {
        let number = L::Row::splat;
        let (dt, half_square, lead) = (number(self.dt), number(0.5 * self.dt * self.dt), number(self.lead * self.dt));
        let [lower, upper] = [&self.domain[0], &self.domain[1]];
        let (lower, upper) = (L::Row::from_slice(lower), L::Row::from_slice(upper));
        let mut note = MotionNote::default();
        for ((sphere, velocity), acceleration) in self.spheres.iter_mut().zip(self.velocities).zip(self.accelerations) {
            let [linear, angular] = acceleration.rows();
            let (linear, angular) = (L::Row::from_slice(linear), L::Row::from_slice(angular));
            let [v, w] = velocity.rows_mut();
            let (old, spin) = (L::Row::from_slice(v), L::Row::from_slice(w));
            let way = old * dt + linear * half_square;
            let place = L::Row::from_slice(sphere.row());
            let centre = first_three(place + way, place);
            centre.write_to(sphere.row_mut());
            // The inverse mass stays as it is: its acceleration is 0.
            (old + linear * lead).write_to(v);
            first_three(spin + angular * lead, spin).write_to(w);
            let mut square = [0.0; 4];
            (way * way).write_to(&mut square);
            note.farthest_squared = note.farthest_squared.max(square[0] + square[1] + square[2]);
            note.leaves |= (centre.below(lower) | centre.exceeds(upper)).any();
        }
        note
    }
}

/// What a chunk's particles did in a time step.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct StepNote {
    /// Work that contacts did, springs in normal direction apart, beyond what the laws have booked [J].
    pub late_work: f64,
    pub prescribed_work: f64,
    /// Sum of the loads on prescribed particles [N].
    pub prescribed_force: Vec3,
    /// Whether every place and velocity is.
    pub is_finite: bool,
    /// Whether somebody woke up.
    pub woke: bool,
    /// Sum of the loads and weights of those who sleep on [N].
    pub unbalanced: Vec3,
}

impl StepNote {
    /// Of a chunk in which nothing happened.
    pub const SKIPPED: Self = Self {
        late_work: 0.0,
        prescribed_work: 0.0,
        prescribed_force: Vec3::new(0.0, 0.0, 0.0),
        is_finite: true,
        woke: false,
        unbalanced: Vec3::new(0.0, 0.0, 0.0),
    };
}

/// New accelerations from loads, and v += (a_new / 2 + a_old (1/2 - lead)) dt, spins likewise.
pub(super) struct Correct<'a> {
    pub velocities: &'a mut [Velocity],
    pub accelerations: &'a mut [Acceleration],
    pub loads: &'a [Load],
    pub spheres: &'a [Sphere],
    /// Forces of the normal springs; empty where losses are not accounted for.
    pub springs: &'a [Vec3],
    /// Time step [s].
    pub dt: f64,
    /// Share of it that the laws' velocities are ahead.
    pub lead: f64,
    pub gravity: Vec3,
    pub body: Body,
    /// When sleepers wake, where anybody may sleep.
    pub sleep: Option<&'a SleepSettings>,
}

impl LaneWork for Correct<'_> {
    type Output = StepNote;

    #[inline(always)]
    fn run<L: Lanes>(self) -> StepNote {
        let number = L::Row::splat;
        let gravity = row::<L::Row>(&self.body.in_plane(&self.gravity));
        let [in_plane, about_plane] = axes(self.body).map(<L::Row as Lanes>::Mask::from_bits);
        let inertia_factor = self.body.inertia_factor();
        let (dt, half, rest) = (number(self.dt), number(0.5), number(0.5 - self.lead));
        let zero = L::Row::zero();
        let mut note = StepNote::default();
        // Finite exactly while all that is added is.
        let mut sum = zero;
        for index in 0..self.velocities.len() {
            let (velocity, sphere) = (&mut self.velocities[index], &self.spheres[index]);
            let held = &mut self.accelerations[index];
            let old = [L::Row::from_slice(held.rows()[0]), L::Row::from_slice(held.rows()[1])];
            let seen = *velocity;
            let (linear, angular);
            let wakes = self.sleep.is_some_and(|sleep| {
                velocity.path == Path::Asleep
                    && note.wakes(sleep, velocity, sphere, &self.loads[index], &self.gravity, self.body)
            });
            if !velocity.path.yields() {
                *held = acceleration(&self.loads[index], velocity, sphere.radius, held, &self.gravity, self.body);
                let rows = held.rows();
                (linear, angular) = (L::Row::from_slice(rows[0]), L::Row::from_slice(rows[1]));
            } else {
                let [force, torque] = self.loads[index].rows();
                let (force, torque) = (L::Row::from_slice(force), L::Row::from_slice(torque));
                let inverse_inertia = velocity.inverse_mass / (inertia_factor * sphere.radius * sphere.radius);
                linear = L::Row::select(in_plane, force * number(velocity.inverse_mass) + gravity, zero);
                angular = L::Row::select(about_plane, torque * number(inverse_inertia), zero);
                let rows = held.rows_mut();
                linear.write_to(rows[0]);
                angular.write_to(rows[1]);
            }
            let [v, w] = velocity.rows_mut();
            let corrected = L::Row::from_slice(v) + (linear * half + old[0] * rest) * dt;
            let spin = L::Row::from_slice(w);
            let turned = first_three(spin + (angular * half + old[1] * rest) * dt, spin);
            corrected.write_to(v);
            turned.write_to(w);
            sum = sum + corrected + first_three(turned, zero) + L::Row::from_slice(sphere.row());
            // Of who wakes the springs are not known apart, and the late work is of the second order of dt.
            if !wakes {
                note.account(&seen, velocity, &self.loads[index], self.springs.get(index), self.dt);
            }
        }
        note.is_finite = sum.to_array().iter().sum::<f64>().is_finite();
        note
    }
}

impl StepNote {
    /// Wakes a sleeper that the forces on it would move; true where they do.
    #[cold]
    #[inline(never)]
    fn wakes(
        &mut self,
        sleep: &SleepSettings,
        velocity: &mut Velocity,
        sphere: &Sphere,
        load: &Load,
        gravity: &Vec3,
        body: Body,
    ) -> bool {
        let free = free_acceleration(load, velocity, sphere.radius, gravity, body);
        if sleep.wakes(&free, sphere.radius) {
            velocity.path = Path::Free;
            self.woke = true;
            return true;
        }
        self.unbalanced += free.linear / velocity.inverse_mass;
        false
    }

    /// Books the works of a particle whose velocity was `seen` by the laws.
    #[inline(always)]
    fn account(&mut self, seen: &Velocity, now: &Velocity, load: &Load, spring: Option<&Vec3>, dt: f64) {
        if spring.is_none() && !now.path.is_prescribed() {
            return;
        }
        let (linear, angular) = (Vec3::from(now.linear), Vec3::from(now.angular));
        if let Some(spring) = spring {
            // The laws booked what they took at the velocities they saw; it was done at these.
            let late = (linear - Vec3::from(seen.linear), angular - Vec3::from(seen.angular));
            self.late_work += ((load.force - spring).dot(&late.0) + load.torque.dot(&late.1)) * dt;
        }
        if now.path.is_prescribed() {
            self.prescribed_force += load.force;
            // Its contacts do this work on it; it gives the same to the others.
            self.prescribed_work -= (load.force.dot(&linear) + load.torque.dot(&angular)) * dt;
        }
    }
}

/// Lanes along which a body can move, and about which it can turn.
const fn axes(body: Body) -> [u16; 2] {
    match body {
        Body::Sphere => [0b0111, 0b0111],
        Body::Disc { .. } => [0b0101, 0b0010],
    }
}

/// Acceleration of a particle under its load and gravity; a prescribed one follows its path, on a recorded path with the
/// acceleration `held` that came with it.
#[inline(always)]
pub(super) fn acceleration(
    load: &Load,
    velocity: &Velocity,
    radius: f64,
    held: &Acceleration,
    gravity: &Vec3,
    body: Body,
) -> Acceleration {
    match velocity.path {
        Path::Free | Path::Tethered => free_acceleration(load, velocity, radius, gravity, body),
        Path::Constant | Path::Asleep => Acceleration::ZERO,
        Path::Recorded => *held,
        Path::Ballistic => Acceleration::new(body.in_plane(gravity), Vec3::zeros()),
    }
}

/// Acceleration that a load and gravity give to a particle that they move: F / m + g, and M / (c m r^2).
#[inline(always)]
pub(super) fn free_acceleration(
    load: &Load,
    velocity: &Velocity,
    radius: f64,
    gravity: &Vec3,
    body: Body,
) -> Acceleration {
    let inverse_inertia = velocity.inverse_mass / (body.inertia_factor() * radius * radius);
    Acceleration::new(
        body.in_plane(&(load.force * velocity.inverse_mass + gravity)),
        body.about_plane(&(load.torque * inverse_inertia)),
    )
}
