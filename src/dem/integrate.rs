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
    /// Whether places and velocities are numbers far from overflow.
    pub is_moderate: bool,
}

/// Lower and upper borders [m] as rows; infinite where there is none.
pub(super) fn border_rows(domain: &Bounds, periodic: [bool; 3]) -> [[f64; 4]; 2] {
    let row = |border: [f64; 3], none: f64| {
        std::array::from_fn(|axis| if axis < 3 && !periodic[axis] { border[axis] } else { none })
    };
    [row(domain.minimum, f64::NEG_INFINITY), row(domain.maximum, f64::INFINITY)]
}

/// The end of a time step: new accelerations from loads, and v += (a_new / 2 + a_old (1/2 - lead)) dt, spins likewise.
#[derive(Debug, Clone, Copy)]
pub struct Correction {
    /// Time step [s].
    pub dt: f64,
    /// Share of it that the laws' velocities are ahead.
    pub lead: f64,
    /// Gravity [m/s2].
    pub gravity: Vec3,
    /// Spheres or discs.
    pub body: Body,
}

impl Correction {
    /// Turns the velocities that the laws saw and the accelerations of the last full step into those of the present one, of a
    /// particle that its `load` moves.
    pub(super) fn complete(
        &self,
        velocity: &mut Velocity,
        acceleration: &mut Acceleration,
        load: &Load,
        sphere: &Sphere,
    ) {
        let rows = CorrectionRows::<<f64 as Lanes>::Row>::new(self);
        let old = read(acceleration.rows());
        let new = rows.accelerations(load, velocity.inverse_mass, sphere.radius);
        let [v, w] = velocity.rows_mut();
        let full = rows.velocities(read([v, w]), old, new);
        write(full, [v, w]);
        write(new, acceleration.rows_mut());
    }
}

/// Two rows of a record.
#[inline(always)]
fn read<R: Lanes>(rows: [&[f64; 4]; 2]) -> [R; 2] {
    [R::from_slice(rows[0]), R::from_slice(rows[1])]
}

/// Writes two rows of a record.
#[inline(always)]
fn write<R: Lanes>(values: [R; 2], rows: [&mut [f64; 4]; 2]) {
    values[0].write_to(rows[0]);
    values[1].write_to(rows[1]);
}

/// A correction's numbers as rows.
struct CorrectionRows<R: Lanes> {
    gravity: R,
    in_plane: R::Mask,
    about_plane: R::Mask,
    inertia_factor: f64,
    dt: R,
    half: R,
    rest: R,
}

impl<R: Lanes> CorrectionRows<R> {
    #[inline(always)]
    fn new(correction: &Correction) -> Self {
        let Correction { dt, lead, gravity, body } = correction;
        let ([in_plane, about_plane], gravity) = (axes(*body), body.in_plane(gravity));
        Self {
            gravity: R::from_slice(&[gravity.x, gravity.y, gravity.z, 0.0]),
            in_plane: R::Mask::from_bits(in_plane),
            about_plane: R::Mask::from_bits(about_plane),
            inertia_factor: body.inertia_factor(),
            dt: R::splat(*dt),
            half: R::splat(0.5),
            rest: R::splat(0.5 - lead),
        }
    }

    /// F / m + g and M / (c m r^2) of a particle that its load moves.
    #[inline(always)]
    fn accelerations(&self, load: &Load, inverse_mass: f64, radius: f64) -> [R; 2] {
        let [force, torque] = read::<R>(load.rows());
        let inverse_inertia = inverse_mass / (self.inertia_factor * radius * radius);
        [
            R::select(self.in_plane, force * R::splat(inverse_mass) + self.gravity, R::zero()),
            R::select(self.about_plane, torque * R::splat(inverse_inertia), R::zero()),
        ]
    }

    /// Full-step velocities from those that the laws `saw`, with the accelerations at both ends of the time step.
    #[inline(always)]
    fn velocities(&self, saw: [R; 2], old: [R; 2], new: [R; 2]) -> [R; 2] {
        let angular = saw[1] + self.change(old[1], new[1]);
        [saw[0] + self.change(old[0], new[0]), first_three(angular, saw[1])]
    }

    /// What accelerations at both ends of the time step add to a velocity that the laws saw.
    #[inline(always)]
    fn change(&self, old: R, new: R) -> R {
        (new * self.half + old * self.rest) * self.dt
    }
}

/// The particles of a chunk that a time step moves.
pub(super) struct Moved<'a> {
    pub spheres: &'a mut [Sphere],
    pub velocities: &'a mut [Velocity],
    pub accelerations: &'a mut [Acceleration],
    /// Of the time step before.
    pub loads: &'a [Load],
    pub correction: &'a Correction,
    /// Open borders, lower and upper.
    pub domain: &'a [[f64; 4]; 2],
    /// Places of those who were touched lately, ascending, where the records of all others say that they fall freely.
    pub among_falling: Option<&'a [u32]>,
}

/// x += v dt + a dt^2 / 2, v += a lead dt, and spins likewise. With `LATE`, the time step before is completed first.
pub(super) struct Advance<'a, const LATE: bool>(pub Moved<'a>);

/// `changed` in the first three lanes, `kept` in the last: the radius, or what is no number.
#[inline(always)]
fn first_three<R: Lanes>(changed: R, kept: R) -> R {
    R::select(R::Mask::from_bits(0b0111), changed, kept)
}

impl<const LATE: bool> LaneWork for Advance<'_, LATE> {
    type Output = MotionNote;

    #[inline(always)]
    fn run<L: Lanes>(self) -> MotionNote {
        let Moved { spheres, velocities, accelerations, loads, correction, domain, among_falling } = self.0;
        let mut motion = Motion::<L::Row>::new(correction);
        if let Some(places) = among_falling {
            let mut next = 0;
            for place in places.iter().map(|&place| place as usize) {
                motion.fall(&mut spheres[next..place], &mut velocities[next..place]);
                let (sphere, velocity) = (&mut spheres[place], &mut velocities[place]);
                motion.advance::<LATE>(sphere, velocity, &mut accelerations[place], &loads[place]);
                next = place + 1;
            }
            motion.fall(&mut spheres[next..], &mut velocities[next..]);
        } else {
            let particles = spheres.iter_mut().zip(velocities).zip(accelerations).zip(loads);
            for (((sphere, velocity), acceleration), load) in particles {
                motion.advance::<LATE>(sphere, velocity, acceleration, load);
            }
        }
        motion.note(domain)
    }
}

/// A time step's numbers as rows, and what moving particles by them has found so far.
struct Motion<R: Lanes> {
    late: CorrectionRows<R>,
    dt: R,
    half_square: R,
    lead: R,
    /// What free fall adds: to the velocity that the laws saw, to reach that of the full step [m/s]; to the place, besides v dt [m]; to
    /// the velocity of the full step, for the laws [m/s].
    falling: [R; 3],
    /// Square of the longest way [m2].
    farthest_squared: f64,
    /// Smallest and largest coordinates [m].
    extent: [R; 2],
    /// Sum of the squares of places and velocities.
    squares: R,
}

impl<R: Lanes> Motion<R> {
    #[inline(always)]
    fn new(correction: &Correction) -> Self {
        let Correction { dt, lead, .. } = *correction;
        let late = CorrectionRows::<R>::new(correction);
        // The same bits whatever its mass and radius.
        let [fall, _] = late.accelerations(&Load::ZERO, 1.0, 1.0);
        let [dt, half_square, lead] = [dt, 0.5 * dt * dt, lead * dt].map(R::splat);
        Self {
            falling: [late.change(fall, fall), fall * half_square, fall * lead],
            late,
            dt,
            half_square,
            lead,
            farthest_squared: 0.0,
            extent: [R::splat(f64::INFINITY), R::splat(f64::NEG_INFINITY)],
            squares: R::zero(),
        }
    }

    /// Moves a particle by what its records say.
    #[inline(always)]
    fn advance<const LATE: bool>(
        &mut self,
        sphere: &mut Sphere,
        velocity: &mut Velocity,
        acceleration: &mut Acceleration,
        load: &Load,
    ) {
        let mut a = read::<R>(acceleration.rows());
        let inverse_mass = velocity.inverse_mass;
        let [v, w] = velocity.rows_mut();
        let mut full = read::<R>([v, w]);
        if LATE {
            let new = self.late.accelerations(load, inverse_mass, sphere.radius);
            full = self.late.velocities(full, a, new);
            a = new;
            write(new, acceleration.rows_mut());
        }
        let [linear, angular] = a;
        let centre = self.shift(sphere, full[0], linear * self.half_square);
        // The inverse mass stays as it is: its acceleration is 0.
        let seen = full[0] + linear * self.lead;
        seen.write_to(v);
        let turned = full[1] + angular * self.lead;
        first_three(turned, full[1]).write_to(w);
        let turned = first_three(turned, R::zero());
        self.squares = self.squares + (centre * centre + (seen * seen + turned * turned));
    }

    /// Moves particles that have fallen freely since they were last moved by their records, and do so now: v += g (1 - lead) dt,
    /// x += v dt + g dt^2 / 2, v += g lead dt, with the gravity g [m/s2]; the same bits as by [`Motion::advance`]. Their spins stay.
    /// Numbers that were moderate then grow by v dt and g dt at most in a time step: far from overflow in any run.
    #[inline(always)]
    fn fall(&mut self, spheres: &mut [Sphere], velocities: &mut [Velocity]) {
        let [completed, way, ahead] = self.falling;
        for (sphere, velocity) in spheres.iter_mut().zip(velocities) {
            let [v, _] = velocity.rows_mut();
            let full = R::from_slice(v) + completed;
            self.shift(sphere, full, way);
            (full + ahead).write_to(v);
        }
    }

    /// Moves a sphere by v dt and `more` [m].
    #[inline(always)]
    fn shift(&mut self, sphere: &mut Sphere, velocity: R, more: R) -> R {
        let way = velocity * self.dt + more;
        let place = R::from_slice(sphere.row());
        let centre = first_three(place + way, place);
        centre.write_to(sphere.row_mut());
        let mut square = [0.0; 4];
        (way * way).write_to(&mut square);
        let square = square[0] + square[1] + square[2];
        // What is no number counts for nothing, as in `f64::max`, which looks for it in both and takes longer.
        self.farthest_squared = if square > self.farthest_squared { square } else { self.farthest_squared };
        self.extent = [centre.smaller(self.extent[0]), centre.larger(self.extent[1])];
        centre
    }

    #[inline(always)]
    fn note(&self, domain: &[[f64; 4]; 2]) -> MotionNote {
        let ([lower, upper], [least, most]) = (read::<R>([&domain[0], &domain[1]]), self.extent);
        MotionNote {
            farthest_squared: self.farthest_squared,
            leaves: (least.below(lower) | most.exceeds(upper)).any(),
            is_moderate: is_moderate(self.squares),
        }
    }
}

/// Sum of squares, each in its SI unit, up to which a particle's motion and load make finite places and velocities for certain.
///
/// Each number is below 1e100 then. 1/m is among them, so that no radius is below 1e-35 m, and accelerations stay below 1e280: far
/// from the largest number, as are the sums by which [`Correct`] looks for what is not finite.
const MODERATE: f64 = 1e200;

/// Whether a sum of squares is that of numbers far from overflow: not-a-number is not.
#[inline(always)]
fn is_moderate<R: Lanes>(squares: R) -> bool {
    squares.to_array().iter().sum::<f64>() < MODERATE
}

/// Whether all loads of a chunk's particles are numbers far from overflow.
pub(super) struct ModerateLoads<'a> {
    pub loads: &'a [Load],
    /// Places of those who carry one, where they are known.
    pub of: Option<&'a [u32]>,
}

impl LaneWork for ModerateLoads<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self) -> bool {
        let mut sum = L::Row::zero();
        let mut add = |load: &Load| {
            let [force, torque] = read::<L::Row>(load.rows());
            sum = sum + (force * force + torque * torque);
        };
        match self.of {
            Some(places) => places.iter().for_each(|&place| add(&self.loads[place as usize])),
            None => self.loads.iter().for_each(add),
        }
        is_moderate(sum)
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

/// Completes a time step at its end, and books what was done in it.
pub(super) struct Correct<'a> {
    pub velocities: &'a mut [Velocity],
    pub accelerations: &'a mut [Acceleration],
    pub loads: &'a [Load],
    pub spheres: &'a [Sphere],
    /// Forces of the normal springs; empty where losses are not accounted for.
    pub springs: &'a [Vec3],
    pub correction: &'a Correction,
    /// When sleepers wake, where anybody may sleep.
    pub sleep: Option<&'a SleepSettings>,
}

impl LaneWork for Correct<'_> {
    type Output = StepNote;

    #[inline(always)]
    fn run<L: Lanes>(self) -> StepNote {
        let Correction { dt, gravity, body, .. } = *self.correction;
        let rows = CorrectionRows::<L::Row>::new(self.correction);
        let zero = L::Row::zero();
        let mut note = StepNote::default();
        // Finite exactly while all that is added is.
        let mut sum = zero;
        for index in 0..self.velocities.len() {
            let (velocity, sphere) = (&mut self.velocities[index], &self.spheres[index]);
            let held = &mut self.accelerations[index];
            let old = read(held.rows());
            let seen = *velocity;
            let wakes = self.sleep.is_some_and(|sleep| {
                velocity.path == Path::Asleep && note.wakes(sleep, velocity, sphere, &self.loads[index], &gravity, body)
            });
            let new = if velocity.path.yields() {
                let new = rows.accelerations(&self.loads[index], velocity.inverse_mass, sphere.radius);
                write(new, held.rows_mut());
                new
            } else {
                *held = acceleration(&self.loads[index], velocity, sphere.radius, held, &gravity, body);
                read(held.rows())
            };
            let [v, w] = velocity.rows_mut();
            let [corrected, turned] = rows.velocities(read([v, w]), old, new);
            write([corrected, turned], [v, w]);
            sum = sum + corrected + first_three(turned, zero) + L::Row::from_slice(sphere.row());
            // Of who wakes the springs are not known apart, and the late work is of the second order of dt.
            if !wakes {
                note.account(&seen, velocity, &self.loads[index], self.springs.get(index), dt);
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
