//! Reference solutions: closed forms, and where there is none a Runge-Kutta integration of the contact's own equation
//! of motion. Nothing here calls the solver or its laws.

use std::f64::consts::PI;

/// A contact of two bodies as one: effective modulus E* [Pa], radius R* [m], mass m* [kg].
#[derive(Debug, Clone, Copy)]
pub struct HertzContact {
    /// 1/E* = (1 - nu_i^2) / E_i + (1 - nu_j^2) / E_j.
    pub modulus: f64,
    /// 1/R* = 1/r_i + 1/r_j.
    pub radius: f64,
    /// 1/m* = 1/m_i + 1/m_j.
    pub mass: f64,
}

/// What an impact shows.
#[derive(Debug, Clone, Copy)]
pub struct Impact {
    /// Largest overlap [m].
    pub overlap: f64,
    /// Largest force [N].
    pub force: f64,
    /// Time from touch to separation [s].
    pub duration: f64,
    /// Speed of separation over speed of approach [-].
    pub restitution: f64,
}

/// Mass of a sphere, 4/3 pi r^3 rho [kg].
#[must_use]
pub fn sphere_mass(radius: f64, density: f64) -> f64 {
    4.0 / 3.0 * PI * radius.powi(3) * density
}

/// Elastic Hertz impact at relative speed v [m/s]:
/// delta_max = (15 m* v^2 / (16 E* sqrt(R*)))^(2/5), F_max = 4/3 E* sqrt(R*) delta_max^(3/2),
/// t_c = 2 delta_max / v * integral of dx / sqrt(1 - x^(5/2)) over 0..1 = 2.943 delta_max / v.
/// Source: Hertz (1882); Johnson (1985), eq. 11.21-11.24. Valid: frictionless, quasi-static elastic spheres.
#[must_use]
pub fn hertz_impact(contact: &HertzContact, speed: f64) -> Impact {
    let factor = contact.modulus * contact.radius.sqrt();
    let overlap = (15.0 * contact.mass * speed * speed / (16.0 * factor)).powf(0.4);
    // x = 1 - u^2 takes the square-root singularity at x = 1 away
    let integrand =
        |u: f64| if u == 0.0 { 2.0 / 2.5_f64.sqrt() } else { 2.0 * u / (1.0 - (1.0 - u * u).powf(2.5)).sqrt() };
    Impact {
        overlap,
        force: 4.0 / 3.0 * factor * overlap.powf(1.5),
        duration: 2.0 * overlap / speed * simpson(integrand, 0.0, 1.0, 2000),
        restitution: 1.0,
    }
}

/// Share of critical damping that gives restitution e without cut-off: beta = -ln e / sqrt(pi^2 + ln^2 e) [-].
#[must_use]
pub fn damping_ratio(restitution: f64) -> f64 {
    -restitution.ln() / PI.hypot(restitution.ln())
}

/// Whether the normal force may attract at the end of a contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Attraction {
    /// Spring and dashpot act until the overlap is zero.
    Allowed,
    /// The force is never below zero.
    CutOff,
}

/// Damped impact by integration of m* delta'' = -F, F = k(delta) delta + 2 beta' sqrt(m* S(delta)) delta', until the overlap is zero.
/// Hertz: S = 2 E* sqrt(R* delta), k = 2/3 S, beta' = sqrt(5/6) beta (Tsuji 1992; Antypov and Elliott 2011).
#[must_use]
pub fn damped_hertz_impact(contact: &HertzContact, speed: f64, restitution: f64, attraction: Attraction) -> Impact {
    let elastic = hertz_impact(contact, speed);
    let damping = 2.0 * (5.0_f64 / 6.0).sqrt() * damping_ratio(restitution);
    let force = |overlap: f64, rate: f64| {
        let tangent = 2.0 * contact.modulus * (contact.radius * overlap.max(0.0)).sqrt();
        let total = 2.0 / 3.0 * tangent * overlap + damping * (tangent * contact.mass).sqrt() * rate;
        if attraction == Attraction::CutOff { total.max(0.0) } else { total }
    };
    normal_impact(force, contact.mass, speed, elastic.duration)
}

/// As [`damped_hertz_impact`] for the linear law with stiffness k [N/m] and mass m* [kg].
#[must_use]
pub fn damped_linear_impact(stiffness: f64, mass: f64, speed: f64, restitution: f64, attraction: Attraction) -> Impact {
    let damping = 2.0 * damping_ratio(restitution) * (stiffness * mass).sqrt();
    let force = |overlap: f64, rate: f64| {
        let total = stiffness * overlap + damping * rate;
        if attraction == Attraction::CutOff { total.max(0.0) } else { total }
    };
    normal_impact(force, mass, speed, PI * (mass / stiffness).sqrt())
}

fn normal_impact(force: impl Fn(f64, f64) -> f64, mass: f64, speed: f64, elastic_duration: f64) -> Impact {
    let step = elastic_duration / 20_000.0;
    let rates = |y: &[f64; 2]| [y[1], -force(y[0], y[1]) / mass];
    let (mut state, mut time) = ([0.0, speed], 0.0);
    let (mut overlap, mut peak) = (0.0_f64, 0.0_f64);
    loop {
        let next = runge_kutta(&rates, &state, step);
        if next[0] <= 0.0 && time > 0.0 {
            let share = state[0] / (state[0] - next[0]);
            let rate = state[1] + share * (next[1] - state[1]);
            return Impact { overlap, force: peak, duration: time + share * step, restitution: -rate / speed };
        }
        state = next;
        time += step;
        overlap = overlap.max(state[0]);
        peak = peak.max(force(state[0], state[1]));
    }
}

/// Restitution of the linear law with the no-attraction cut-off:
/// e = exp(-zeta / sqrt(1 - zeta^2) (pi - arctan(2 zeta sqrt(1 - zeta^2) / (1 - 2 zeta^2)))), zeta the damping ratio;
/// Schwager and Poeschel (2007). The same for Hertz with Tsuji's damping.
#[must_use]
pub fn cut_off_restitution(restitution: f64) -> f64 {
    let zeta = damping_ratio(restitution);
    let root = (1.0 - zeta * zeta).sqrt();
    // two-argument arctangent: the branch for zeta > 1 / sqrt 2, where the denominator turns negative
    let angle = (2.0 * zeta * root).atan2(1.0 - 2.0 * zeta * zeta);
    (-zeta / root * (PI - angle)).exp()
}

/// How the tangential spring follows a changing stiffness.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tangential {
    /// F_t = k_t(delta) xi, xi the whole displacement.
    Total,
    /// dF_t = k_t(delta) dxi.
    Incremental,
}

/// A sphere that hits a rigid plane obliquely.
#[derive(Debug, Clone, Copy)]
pub struct ObliqueImpact {
    /// Normal contact.
    pub contact: HertzContact,
    /// Effective shear modulus G* [Pa], 1/G* = (2 - nu) / G for a rigid partner; k_t = 8 G* sqrt(R* delta).
    pub shear_modulus: f64,
    /// Normal restitution [-]; attraction allowed.
    pub restitution: f64,
    /// Friction [-].
    pub friction: f64,
    /// Tangential law.
    pub law: Tangential,
    /// Share s of the overlap by which the lever arm r - s delta is shorter than the radius [-]: 1 to the surface of a
    /// rigid wall, 0 in the limit of small overlap.
    pub arm_shortening: f64,
}

/// State after an oblique impact.
#[derive(Debug, Clone, Copy)]
pub struct Rebound {
    /// Velocity of the centre along the plane [m/s].
    pub tangential_velocity: f64,
    /// Spin [rad/s], positive where it adds to the contact point's velocity.
    pub spin: f64,
}

/// Rebound of a sphere without spin that comes with normal speed `normal` and tangential speed `tangential` [m/s].
/// Integration of the equations of motion of centre and spin.
#[must_use]
pub fn oblique_rebound(impact: &ObliqueImpact, normal: f64, tangential: f64) -> Rebound {
    let contact = &impact.contact;
    let damping = 2.0 * (5.0_f64 / 6.0).sqrt() * damping_ratio(impact.restitution);
    let step = hertz_impact(contact, normal).duration / 200_000.0;
    let inertia = 0.4 * contact.mass * contact.radius.powi(2);
    let normal_force = |overlap: f64, rate: f64| {
        let tangent = 2.0 * contact.modulus * (contact.radius * overlap.max(0.0)).sqrt();
        2.0 / 3.0 * tangent * overlap + damping * (tangent * contact.mass).sqrt() * rate
    };
    let rates = |y: &[f64; 2]| [y[1], -normal_force(y[0], y[1]) / contact.mass];
    let mut state = [0.0, normal];
    let (mut velocity, mut spin, mut force, mut displacement) = (tangential, 0.0, 0.0_f64, 0.0_f64);
    loop {
        let next = runge_kutta(&rates, &state, step);
        if next[0] <= 0.0 && state[0] > 0.0 {
            return Rebound { tangential_velocity: velocity, spin };
        }
        // tangential motion: semi-implicit Euler, the step is small enough (error of first order, 1e-5)
        state = next;
        let arm = contact.radius - impact.arm_shortening * state[0];
        let slip = (velocity + spin * arm) * step;
        let stiffness = 8.0 * impact.shear_modulus * (contact.radius * state[0].max(0.0)).sqrt();
        displacement += slip;
        let trial = match impact.law {
            Tangential::Total => stiffness * displacement,
            Tangential::Incremental => force + stiffness * slip,
        };
        let cap = impact.friction * normal_force(state[0], state[1]).abs();
        force = trial.clamp(-cap, cap);
        if trial.abs() > cap && stiffness > 0.0 {
            displacement = force / stiffness;
        }
        velocity -= force / contact.mass * step;
        spin -= force * arm / inertia * step;
    }
}

/// Linear spring-dashpot bounce under gravity: heights of a sphere's centre over a plane, with gravity kept while in contact.
///
/// Free: z'' = -g. In contact (z < r): m z'' = -m g + k (r - z) - eta z', that is with x = z - r + m g / k
/// x = exp(-b t) (x_0 cos w t + (v_0 + b x_0) / w sin w t), b = eta / 2m, w = sqrt(k/m - b^2); contact ends where z = r again.
#[derive(Debug, Clone, Copy)]
pub struct Bounce {
    /// Radius r [m].
    pub radius: f64,
    /// Mass m [kg].
    pub mass: f64,
    /// Stiffness k [N/m].
    pub stiffness: f64,
    /// Damping eta [kg/s].
    pub damping: f64,
    /// Gravity g [m/s2].
    pub gravity: f64,
}

impl Bounce {
    /// Height and velocity at `time` [s] after release at rest from `height` [m].
    #[must_use]
    pub fn state(&self, height: f64, time: f64) -> (f64, f64) {
        let (mut left, mut start, mut speed) = (time, height, 0.0);
        loop {
            let fall = self.fall_time(start, speed);
            if left <= fall {
                return (start + speed * left - 0.5 * self.gravity * left * left, speed - self.gravity * left);
            }
            left -= fall;
            let touch = speed - self.gravity * fall;
            let duration = self.contact_duration(touch);
            if left <= duration {
                return self.in_contact(touch, left);
            }
            left -= duration;
            (start, speed) = (self.radius, self.in_contact(touch, duration).1);
        }
    }

    /// Heights of the centre at the tops of the first `count` bounces [m].
    #[must_use]
    pub fn apexes(&self, height: f64, count: usize) -> Vec<f64> {
        let mut touch = -(2.0 * self.gravity * (height - self.radius)).sqrt();
        (0..count)
            .map(|_| {
                let up = self.in_contact(touch, self.contact_duration(touch)).1;
                touch = -up;
                self.radius + up * up / (2.0 * self.gravity)
            })
            .collect()
    }

    /// Duration of a contact entered with velocity `touch` < 0 [s].
    #[must_use]
    pub fn contact_duration(&self, touch: f64) -> f64 {
        let period = PI / self.frequency();
        let above = |time: f64| self.in_contact(touch, time).0 - self.radius;
        let scan = period / 1000.0;
        let mut low = scan;
        while above(low + scan) < 0.0 {
            low += scan;
            // a sphere that stays in contact for ever has no bounce; the cases choose impacts that rebound
            assert!(low < 10.0 * period, "the sphere does not separate");
        }
        bisect(above, low, low + scan)
    }

    fn fall_time(&self, start: f64, speed: f64) -> f64 {
        (speed + (speed * speed + 2.0 * self.gravity * (start - self.radius)).sqrt()) / self.gravity
    }

    fn decay(&self) -> f64 {
        self.damping / (2.0 * self.mass)
    }

    fn frequency(&self) -> f64 {
        (self.stiffness / self.mass - self.decay().powi(2)).sqrt()
    }

    fn in_contact(&self, touch: f64, time: f64) -> (f64, f64) {
        let (decay, frequency) = (self.decay(), self.frequency());
        let sag = self.mass * self.gravity / self.stiffness;
        let (cosine, sine) = ((frequency * time).cos(), (frequency * time).sin());
        let weight = (touch + decay * sag) / frequency;
        let envelope = (-decay * time).exp();
        let position = envelope * (sag * cosine + weight * sine);
        let velocity = envelope * (frequency * (weight * cosine - sag * sine)) - decay * position;
        (self.radius - sag + position, velocity)
    }
}

/// Hertz's static overlap under `force` [N]: (3 F / (4 E* sqrt(R*)))^(2/3) [m].
#[must_use]
pub fn static_overlap(modulus: f64, radius: f64, force: f64) -> f64 {
    (0.75 * force / (modulus * radius.sqrt())).powf(2.0 / 3.0)
}

/// One step of the classical fourth-order Runge-Kutta method for an autonomous system.
pub fn runge_kutta<const N: usize>(rates: &impl Fn(&[f64; N]) -> [f64; N], state: &[f64; N], step: f64) -> [f64; N] {
    let shifted = |slope: &[f64; N], share: f64| std::array::from_fn(|k| state[k] + share * step * slope[k]);
    let first = rates(state);
    let second = rates(&shifted(&first, 0.5));
    let third = rates(&shifted(&second, 0.5));
    let fourth = rates(&shifted(&third, 1.0));
    std::array::from_fn(|k| state[k] + step / 6.0 * (first[k] + 2.0 * second[k] + 2.0 * third[k] + fourth[k]))
}

/// Root of `f` between `low`, where it is negative, and `high`, where it is not.
pub fn bisect(f: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if f(middle) < 0.0 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

fn simpson(f: impl Fn(f64) -> f64, from: f64, to: f64, intervals: u32) -> f64 {
    let width = (to - from) / f64::from(intervals);
    (0..intervals)
        .map(|k| {
            let left = from + f64::from(k) * width;
            width / 6.0 * (f(left) + 4.0 * f(left + 0.5 * width) + f(left + width))
        })
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const CONTACT: HertzContact = HertzContact { modulus: 1e9, radius: 0.01, mass: 0.02 };

    #[test]
    fn closed_form_and_integration_agree_where_nothing_is_lost() {
        let exact = hertz_impact(&CONTACT, 0.7);
        let integrated = damped_hertz_impact(&CONTACT, 0.7, 1.0, Attraction::Allowed);
        // 20 000 steps a contact, sampled peaks: (pi / 20 000)^2
        assert!((integrated.overlap / exact.overlap - 1.0).abs() < 1e-7);
        assert!((integrated.force / exact.force - 1.0).abs() < 1e-7);
        assert!((integrated.duration / exact.duration - 1.0).abs() < 1e-7);
        assert!((integrated.restitution - 1.0).abs() < 1e-7);
    }

    #[test]
    fn damped_impacts_realise_their_restitution() {
        for e in [0.2, 0.4, 0.6, 0.8] {
            let hertz = damped_hertz_impact(&CONTACT, 0.7, e, Attraction::Allowed);
            assert!((hertz.restitution - e).abs() < 1e-5, "{e}: {}", hertz.restitution);
            let linear = damped_linear_impact(1e5, 0.02, 0.7, e, Attraction::Allowed);
            assert!((linear.restitution - e).abs() < 1e-6, "{e}: {}", linear.restitution);
        }
    }

    #[test]
    fn the_cut_off_formula_holds_for_both_laws() {
        for e in [0.1, 0.3, 0.5, 0.7, 0.9] {
            let expected = cut_off_restitution(e);
            let linear = damped_linear_impact(1e5, 0.02, 0.7, e, Attraction::CutOff).restitution;
            let hertz = damped_hertz_impact(&CONTACT, 0.7, e, Attraction::CutOff).restitution;
            assert!((linear - expected).abs() < 1e-5, "{e}: {linear} {expected}");
            assert!((hertz - expected).abs() < 1e-4, "{e}: {hertz} {expected}");
        }
    }

    #[test]
    fn gross_sliding_needs_no_law() {
        let impact = ObliqueImpact {
            contact: CONTACT,
            shear_modulus: 0.4e9,
            restitution: 0.98,
            friction: 0.1,
            law: Tangential::Total,
            arm_shortening: 1.0,
        };
        let (normal, tangential) = (1.0, 3.0);
        let rebound = oblique_rebound(&impact, normal, tangential);
        let expected = tangential - 0.1 * 1.98 * normal;
        // first-order integration and the short stick at the end: 1e-3 of the loss
        assert!((rebound.tangential_velocity - expected).abs() < 1e-3 * 0.198, "{rebound:?} {expected}");
    }

    #[test]
    fn a_bounce_without_loss_returns_and_its_contact_is_continuous() {
        let mut bounce = Bounce { radius: 0.1, mass: 10.0, stiffness: 5e4, damping: 0.0, gravity: 9.81 };
        for apex in bounce.apexes(0.5, 3) {
            assert!((apex - 0.5).abs() < 1e-12);
        }
        bounce.damping = 100.0;
        let touch_time = (2.0 * 0.4_f64 / 9.81).sqrt();
        let (before, after) = (bounce.state(0.5, touch_time - 1e-9), bounce.state(0.5, touch_time + 1e-9));
        assert!((before.0 - after.0).abs() < 1e-8 && (before.1 - after.1).abs() < 1e-6);
        // the derivative of the height is the velocity, and the equation of motion holds
        let at = |time| bounce.state(0.5, time);
        let (t, h) = (touch_time + 0.01, 1e-5);
        assert!(((at(t + h).0 - at(t - h).0) / (2.0 * h) - at(t).1).abs() < 1e-6);
        let acceleration = (at(t + h).1 - at(t - h).1) / (2.0 * h);
        let force = 5e4 * (0.1 - at(t).0) - 100.0 * at(t).1 - 98.1;
        assert!((10.0 * acceleration - force).abs() < 1e-4 * force.abs());
    }
}
