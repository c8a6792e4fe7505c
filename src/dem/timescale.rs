//! Time scales of contacts and motion, each with its own name, and the contact constants that follow from materials.
//!
//! Starred values are effective: 1/m* = 1/m_i + 1/m_j, 1/R* = 1/R_i + 1/R_j (a wall adds 0),
//! 1/E* = (1 - nu_i^2)/E_i + (1 - nu_j^2)/E_j. A wall has infinite mass and radius, so m* and R* are the sphere's.

use std::f64::consts::PI;

/// Rayleigh time t_R = pi R sqrt(rho / G) / (0.1631 nu + 0.8766) \[s\].
///
/// R radius \[m\], rho particle density \[kg/m3\], G shear modulus \[Pa\], nu Poisson's ratio \[-\]: the time a surface
/// wave takes round half a sphere. The denominator is the fit of the Rayleigh wave speed over that of shear.
/// Source: Thornton and Randall (1988); Ning and Ghadiri (2006). Valid: elastic spheres; time steps of 10 to 20 % of it
/// are common. Rival convention: 0.8766 is printed as 0.876605 in places.
#[must_use]
pub fn rayleigh_time(radius: f64, density: f64, shear_modulus: f64, poissons_ratio: f64) -> f64 {
    PI * radius * (density / shear_modulus).sqrt() / (0.1631 * poissons_ratio + 0.8766)
}

/// Duration of an elastic Hertz impact, t_c = 2.8683 (m*^2 / (R* E*^2 v))^(1/5) \[s\], loading and unloading together.
///
/// m* effective mass \[kg\], R* effective radius \[m\], E* effective Young's modulus \[Pa\], v speed of approach
/// \[m/s\]. Exactly t_c = 2 I delta_max / v with I = integral of (1 - x^(5/2))^(-1/2) over \[0, 1\] = 1.4716.
/// Source: Hertz (1882); Johnson, Contact Mechanics (1985), section 11.4. Valid: elastic, quasi-static contact.
#[must_use]
pub fn hertz_contact_duration(
    effective_mass: f64,
    effective_radius: f64,
    effective_youngs_modulus: f64,
    speed: f64,
) -> f64 {
    /// Twice the integral above, 4 sqrt(pi) Gamma(2/5) / (5 Gamma(9/10)).
    const TWICE_INTEGRAL: f64 = 2.943_275_184_324_704;
    TWICE_INTEGRAL * hertz_maximum_overlap(effective_mass, effective_radius, effective_youngs_modulus, speed) / speed
}

/// Largest overlap of an elastic Hertz impact, delta_max = (15 m* v^2 / (16 E* sqrt(R*)))^(2/5) \[m\].
///
/// m* effective mass \[kg\], R* effective radius \[m\], E* effective Young's modulus \[Pa\], v speed of approach
/// \[m/s\]. All kinetic energy of the approach is elastic: m* v^2 / 2 = 8/15 E* sqrt(R*) delta^(5/2).
/// Source: Johnson (1985), section 11.4. Valid: elastic impact without other forces.
#[must_use]
pub fn hertz_maximum_overlap(
    effective_mass: f64,
    effective_radius: f64,
    effective_youngs_modulus: f64,
    speed: f64,
) -> f64 {
    (15.0 * effective_mass * speed * speed / (16.0 * effective_youngs_modulus * effective_radius.sqrt())).powf(0.4)
}

/// Tangent stiffness of a Hertz contact, dF/d delta = 2 E* sqrt(R* delta) \[N/m\].
///
/// E* effective Young's modulus \[Pa\], R* effective radius \[m\], delta overlap \[m\].
/// Source: Johnson (1985), section 4.2. Rival convention: the secant stiffness F/delta is two thirds of it.
#[must_use]
pub fn hertz_tangent_stiffness(effective_youngs_modulus: f64, effective_radius: f64, overlap: f64) -> f64 {
    2.0 * effective_youngs_modulus * (effective_radius * overlap).sqrt()
}

/// Duration of a linear spring-dashpot impact, t_c = pi / sqrt(k/m* - (c / (2 m*))^2) \[s\]; infinite when overdamped.
///
/// k normal stiffness \[N/m\], m* effective mass \[kg\], c normal damping \[kg/s\].
/// Source: Schaefer, Dippel and Wolf (1996). Valid: attraction at the end allowed (half a period of the oscillator);
/// without it see [`linear_contact_duration_without_attraction`].
#[must_use]
pub fn linear_contact_duration(effective_mass: f64, normal_stiffness: f64, normal_damping: f64) -> f64 {
    let squared = normal_stiffness / effective_mass - (normal_damping / (2.0 * effective_mass)).powi(2);
    if squared > 0.0 { PI / squared.sqrt() } else { f64::INFINITY }
}

/// Duration of a linear spring-dashpot impact that ends when its force would attract,
/// t_c = 2 arccos(zeta) / (omega_0 sqrt(1 - zeta^2)) \[s\], with omega_0 = sqrt(k/m*).
///
/// m* effective mass \[kg\], k normal stiffness \[N/m\], zeta = c / (2 sqrt(m* k)) damping ratio \[-\], below 1.
/// Source: Schwager and Poeschel (2007), eq. (17), with 2 arcsin(zeta) for their arctan. Valid: 0 <= zeta < 1.
#[must_use]
pub fn linear_contact_duration_without_attraction(
    effective_mass: f64,
    normal_stiffness: f64,
    damping_ratio: f64,
) -> f64 {
    let slowed = (1.0 - damping_ratio * damping_ratio).sqrt();
    2.0 * damping_ratio.acos() / (slowed * (normal_stiffness / effective_mass).sqrt())
}

/// Largest overlap of a linear spring-dashpot impact,
/// delta_max = v / omega_0 exp(-zeta / sqrt(1 - zeta^2) arccos(zeta)) \[m\], with omega_0 = sqrt(k/m*).
///
/// m* effective mass \[kg\], k normal stiffness \[N/m\], zeta damping ratio \[-\], v speed of approach \[m/s\]. Undamped:
/// v sqrt(m*/k). Source: solution of the damped oscillator at its first turning point. Valid: 0 <= zeta < 1.
#[must_use]
pub fn linear_maximum_overlap(effective_mass: f64, normal_stiffness: f64, damping_ratio: f64, speed: f64) -> f64 {
    let slowed = (1.0 - damping_ratio * damping_ratio).sqrt();
    speed * (effective_mass / normal_stiffness).sqrt() * (-damping_ratio / slowed * damping_ratio.acos()).exp()
}

/// Linear stiffness that follows from elastic constants,
/// k_n = 16/15 sqrt(R*) E* (15 m* v_c^2 / (16 sqrt(R*) E*))^(1/5) \[N/m\].
///
/// R* effective radius \[m\], E* effective Young's modulus \[Pa\], m* effective mass \[kg\], v_c characteristic
/// collision velocity \[m/s\]: the linear contact stores at its largest overlap, k_n delta^2 / 2, what the Hertz contact
/// does, and reaches the same overlap. Source: Hertz energy balance; the form of LIGGGHTS' `hooke` model (Kloss et al.,
/// 2012). Valid: impacts near v_c; at other speeds overlap and duration differ from Hertz.
#[must_use]
pub fn linear_stiffness(
    effective_mass: f64,
    effective_radius: f64,
    effective_youngs_modulus: f64,
    characteristic_velocity: f64,
) -> f64 {
    let root = effective_radius.sqrt() * effective_youngs_modulus;
    16.0 / 15.0
        * root
        * (15.0 * effective_mass * characteristic_velocity * characteristic_velocity / (16.0 * root)).powf(0.2)
}

/// Damping ratio that gives a coefficient of restitution, zeta = -ln e / sqrt(pi^2 + ln^2 e) \[-\].
///
/// e coefficient of restitution \[-\], 0 < e <= 1. Source: damped oscillator over half a period, e = exp(-pi zeta /
/// sqrt(1 - zeta^2)). Valid: linear law, and Hertz with Tsuji's damping, while the force may attract at the end; else the
/// realised value is [`restitution_without_attraction`].
#[must_use]
pub fn damping_ratio(restitution: f64) -> f64 {
    let logarithm = restitution.ln();
    // not -ln(1) = -0: a ratio of zero has no sign
    logarithm.abs() / PI.hypot(logarithm)
}

/// Damping of the linear law, c = 2 zeta sqrt(m* k) \[kg/s\].
///
/// zeta damping ratio \[-\] ([`damping_ratio`]), m* effective mass \[kg\], k normal stiffness \[N/m\].
/// Source: Schaefer, Dippel and Wolf (1996). Rival convention: some codes state c / m* in 1/s.
#[must_use]
pub fn linear_damping(effective_mass: f64, normal_stiffness: f64, restitution: f64) -> f64 {
    2.0 * damping_ratio(restitution) * (effective_mass * normal_stiffness).sqrt()
}

/// Damping of the Hertz law at an overlap, gamma = 2 sqrt(5/6) zeta sqrt(S m*) \[kg/s\], with the tangent stiffness
/// S = 2 E* sqrt(R* delta).
///
/// zeta damping ratio \[-\] ([`damping_ratio`]), m* effective mass \[kg\], S tangent stiffness \[N/m\]
/// ([`hertz_tangent_stiffness`]). Grows with delta^(1/4), so that restitution does not depend on speed.
/// Source: Tsuji, Tanaka and Ishida (1992); the closed form of zeta: Antypov and Elliott (2011). Valid: exact while the
/// force may attract at the end.
#[must_use]
pub fn hertz_damping(effective_mass: f64, tangent_stiffness: f64, restitution: f64) -> f64 {
    2.0 * (5.0_f64 / 6.0).sqrt() * damping_ratio(restitution) * (tangent_stiffness * effective_mass).sqrt()
}

/// Restitution that a contact realises when its force is cut off where it would attract,
/// e = exp(-2 zeta arccos(zeta) / sqrt(1 - zeta^2)) \[-\].
///
/// zeta damping ratio \[-\] of the restitution asked for. Source: Schwager and Poeschel (2007), eq. (20), with
/// 2 arcsin(zeta) for their arctan(2 zeta sqrt(1 - zeta^2) / (1 - 2 zeta^2)). Valid: linear law, and by the substitution
/// of Antypov and Elliott (2011) Hertz with Tsuji's damping as well; 0 <= zeta < 1.
#[must_use]
pub fn restitution_without_attraction(damping_ratio: f64) -> f64 {
    let slowed = (1.0 - damping_ratio * damping_ratio).sqrt();
    (-2.0 * damping_ratio * damping_ratio.acos() / slowed).exp()
}

/// A particle held by springs on all sides, for its critical time step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SpringBed {
    /// Mass m of the particle \[kg\].
    pub mass: f64,
    /// Factor of its moment of inertia, I = factor m r^2 \[-\].
    pub inertia_factor: f64,
    /// Normal stiffness k_n of one contact \[N/m\].
    pub normal_stiffness: f64,
    /// Tangential over normal stiffness xi \[-\].
    pub tangential_ratio: f64,
    /// Contacts Z at the same time, spread evenly over all directions \[-\].
    pub contacts: f64,
    /// Dimensions: 3, or 2 in a plane problem.
    pub dimensions: f64,
    /// Damping ratio zeta \[-\].
    pub damping_ratio: f64,
}

/// Critical time step of a particle held by springs,
/// dt_c = 2 / omega (sqrt(1 + zeta^2) - zeta) \[s\], the smaller one of translation and rotation:
/// omega^2 = 2 Z k_n (1/D + xi (1 - 1/D)) / m, and omega^2 = 2 Z k_n xi a / (c m) with I = c m r^2.
///
/// Symbols: [`SpringBed`]. D dimensions; a = 1 - 1/D is the share of a contact's tangential stiffness that acts on one
/// axis of rotation (1 in the plane). The factor 2 bounds the largest frequency of the whole assembly (Gershgorin: the
/// neighbours move against the particle).
/// Source: O'Sullivan and Bray (2004); Otsubo, O'Sullivan and Shire (2017); damping: Belytschko, Liu and Moran (2000).
/// Valid: a bound for even contacts of one stiffness; exact for a cubic lattice of normal springs.
#[must_use]
pub fn spring_period_timestep(bed: &SpringBed) -> f64 {
    let normal_share = 1.0 / bed.dimensions;
    let spin_share = if bed.dimensions > 2.0 { 1.0 - normal_share } else { 1.0 };
    let translation = normal_share + bed.tangential_ratio * (1.0 - normal_share);
    let rotation = bed.tangential_ratio * spin_share / bed.inertia_factor;
    let squared = 2.0 * bed.contacts * bed.normal_stiffness * translation.max(rotation) / bed.mass;
    2.0 / squared.sqrt() * (bed.damping_ratio.mul_add(bed.damping_ratio, 1.0).sqrt() - bed.damping_ratio)
}

/// Time step at which something moves by a distance, dt = s / v \[s\].
///
/// s distance \[m\], v speed \[m/s\]; infinite at rest. For particles and moving walls: a partner must be seen before it
/// has passed, and the overlap of one step must be small.
#[must_use]
pub fn displacement_timestep(distance: f64, speed: f64) -> f64 {
    distance / speed
}

/// Effective value of two, 1 / (1/a + 1/b): of masses, radii or moduli; infinity for a wall's mass or radius.
#[must_use]
pub fn effective(a: f64, b: f64) -> f64 {
    1.0 / (1.0 / a + 1.0 / b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Time and force-free state at the end of an impact, by classical Runge-Kutta; `force(overlap, rate)` \[N\].
    fn impact(mass: f64, speed: f64, dt: f64, attraction: bool, force: impl Fn(f64, f64) -> f64) -> (f64, f64, f64) {
        let acceleration = |x: f64, v: f64| -force(x.max(0.0), v) / mass;
        let (mut x, mut v, mut time, mut deepest) = (0.0, speed, 0.0, 0.0_f64);
        loop {
            let (k1, l1) = (v, acceleration(x, v));
            let (k2, l2) = (v + 0.5 * dt * l1, acceleration(x + 0.5 * dt * k1, v + 0.5 * dt * l1));
            let (k3, l3) = (v + 0.5 * dt * l2, acceleration(x + 0.5 * dt * k2, v + 0.5 * dt * l2));
            let (k4, l4) = (v + dt * l3, acceleration(x + dt * k3, v + dt * l3));
            let (x_new, v_new) =
                (x + dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4), v + dt / 6.0 * (l1 + 2.0 * l2 + 2.0 * l3 + l4));
            let over = if attraction { x_new <= 0.0 } else { v_new < 0.0 && force(x_new.max(0.0), v_new) <= 0.0 };
            if over {
                return (time + 0.5 * dt, deepest, -v_new / speed);
            }
            (x, v, time, deepest) = (x_new, v_new, time + dt, deepest.max(x_new));
        }
    }

    #[test]
    fn glass_spheres_have_their_reference_impact() {
        // two glass spheres of 10 mm radius at 10 m/s each: Chung and Ooi (2011), test 1
        let (radius, density, youngs, poisson) = (0.01_f64, 2800.0, 4.8e10, 0.2_f64);
        let mass = 4.0 / 3.0 * PI * radius.powi(3) * density;
        let (m, r) = (effective(mass, mass), effective(radius, radius));
        let e = effective(youngs / (1.0 - poisson.powi(2)), youngs / (1.0 - poisson.powi(2)));
        // references have four or five digits
        assert_relative_eq!(hertz_maximum_overlap(m, r, e, 20.0), 274.11e-6, max_relative = 2e-5);
        assert_relative_eq!(hertz_contact_duration(m, r, e, 20.0), 40.34e-6, max_relative = 2e-4);
        let closed = 2.8683 * (m * m / (r * e * e * 20.0)).powf(0.2);
        // 2.8683 has five digits
        assert_relative_eq!(hertz_contact_duration(m, r, e, 20.0), closed, max_relative = 2e-5);
    }

    #[test]
    fn the_hertz_duration_is_twice_its_integral() {
        // x = 1 - u^2 takes the root out of the integrand; at u = 0 it is 2 / sqrt(5/2)
        let integrand =
            |u: f64| if u == 0.0 { 2.0 / 2.5_f64.sqrt() } else { 2.0 * u / (1.0 - (1.0 - u * u).powf(2.5)).sqrt() };
        let intervals = 2000;
        let h = 1.0 / f64::from(intervals);
        let weight = |k: i32| if k == 0 || k == intervals { 1.0 } else { f64::from(2 + 2 * (k % 2)) };
        let integral: f64 = (0..=intervals).map(|k| weight(k) * integrand(f64::from(k) * h) * h / 3.0).sum();
        let (mass, radius, youngs, speed) = (0.03, 0.01, 1e7, 1.5);
        let expected = 2.0 * integral * hertz_maximum_overlap(mass, radius, youngs, speed) / speed;
        // Simpson's rule at this width, with the cancellation near u = 0
        assert_relative_eq!(hertz_contact_duration(mass, radius, youngs, speed), expected, max_relative = 1e-11);
    }

    #[test]
    fn a_hertz_impact_lasts_and_sinks_in_as_it_is_integrated() {
        let (mass, radius, youngs, speed) = (0.03, 0.01, 1e7, 1.5);
        let duration = hertz_contact_duration(mass, radius, youngs, speed);
        let dt = duration / 5e4;
        let force = |x: f64, _: f64| 4.0 / 3.0 * youngs * radius.sqrt() * x.powf(1.5);
        let (found, deepest, restitution) = impact(mass, speed, dt, true, force);
        // the end is known to half a step, the deepest point to the square of one
        assert_relative_eq!(found, duration, max_relative = 2e-5);
        assert_relative_eq!(deepest, hertz_maximum_overlap(mass, radius, youngs, speed), max_relative = 1e-7);
        assert_relative_eq!(restitution, 1.0, max_relative = 1e-8);
    }

    #[test]
    fn damping_realises_its_restitution() {
        let (mass, radius, youngs, speed) = (0.03, 0.01, 1e7, 1.5);
        for asked in [0.1, 0.3, 0.5, 0.9] {
            let ratio = damping_ratio(asked);
            let k = linear_stiffness(mass, radius, youngs, speed);
            let c = linear_damping(mass, k, asked);
            let linear = |x: f64, v: f64| k * x + c * v;
            let dt = linear_contact_duration(mass, k, c) / 5e4;
            let hertz = |x: f64, v: f64| {
                let stiffness = hertz_tangent_stiffness(youngs, radius, x);
                2.0 / 3.0 * stiffness * x + hertz_damping(mass, stiffness, asked) * v
            };
            // the end is known to a step, over which speed changes by up to 2 pi / 5e4 of itself
            let tolerance = 3e-4;
            let (duration, deepest, restitution) = impact(mass, speed, dt, true, linear);
            assert_relative_eq!(restitution, asked, max_relative = tolerance);
            assert_relative_eq!(duration, linear_contact_duration(mass, k, c), max_relative = 5e-5);
            assert_relative_eq!(deepest, linear_maximum_overlap(mass, k, ratio, speed), max_relative = 1e-6);
            let (duration, _, restitution) = impact(mass, speed, dt, false, linear);
            let cut = restitution_without_attraction(ratio);
            assert_relative_eq!(restitution, cut, max_relative = tolerance);
            let expected = linear_contact_duration_without_attraction(mass, k, ratio);
            assert_relative_eq!(duration, expected, max_relative = 5e-5);
            assert_relative_eq!(impact(mass, speed, dt, false, hertz).2, cut, max_relative = tolerance);
            // with attraction the Hertz contact creeps out with its damping vanishing: the end costs accuracy
            assert_relative_eq!(impact(mass, speed, dt, true, hertz).2, asked, max_relative = 10.0 * tolerance);
        }
    }

    #[test]
    fn restitution_without_attraction_is_the_published_one() {
        let table = [(0.1, 0.2527), (0.3, 0.3971), (0.5, 0.5503), (0.7, 0.7182), (0.9, 0.9020), (0.98, 0.9801)];
        for (asked, realised) in table {
            // the table has four digits
            assert_relative_eq!(restitution_without_attraction(damping_ratio(asked)), realised, epsilon = 5.1e-5);
            // the form in print, valid below zeta = 1 / sqrt 2
            let zeta: f64 = damping_ratio(asked);
            let slowed = (1.0 - zeta * zeta).sqrt();
            let printed = (2.0 * zeta * slowed / (1.0 - 2.0 * zeta * zeta)).atan();
            assert_relative_eq!(
                restitution_without_attraction(zeta),
                (-zeta / slowed * (PI - printed)).exp(),
                max_relative = 1e-12
            );
        }
        assert_eq!(restitution_without_attraction(damping_ratio(1.0)), 1.0);
    }

    #[test]
    fn linear_stiffness_stores_what_hertz_stores() {
        let (mass, radius, youngs, speed) = (0.004, 0.002, 5e6, 1.2);
        let k = linear_stiffness(mass, radius, youngs, speed);
        let overlap = hertz_maximum_overlap(mass, radius, youngs, speed);
        assert_relative_eq!(0.5 * k * overlap * overlap, 0.5 * mass * speed * speed, max_relative = 1e-13);
        assert_relative_eq!(linear_maximum_overlap(mass, k, 0.0, speed), overlap, max_relative = 1e-13);
    }

    #[test]
    fn a_cubic_lattice_has_its_exact_critical_step() {
        // each row of a cubic lattice of normal springs is a chain: omega_max = 2 sqrt(k/m), dt_c = sqrt(m/k)
        let bed = SpringBed {
            mass: 0.5,
            inertia_factor: 0.4,
            normal_stiffness: 2e3,
            tangential_ratio: 0.0,
            contacts: 6.0,
            dimensions: 3.0,
            damping_ratio: 0.0,
        };
        assert_relative_eq!(spring_period_timestep(&bed), (0.5_f64 / 2e3).sqrt(), max_relative = 1e-14);
        let square = SpringBed { contacts: 4.0, dimensions: 2.0, ..bed };
        assert_relative_eq!(spring_period_timestep(&square), (0.5_f64 / 2e3).sqrt(), max_relative = 1e-14);
        // a sphere in a cubic lattice whose neighbours spin the same way: omega^2 = 4 k_t r^2 2 / (2/5 m r^2), each of the
        // four contacts beside the axis being sheared by both partners
        let rough = SpringBed { tangential_ratio: 1.0, ..bed };
        let omega_squared: f64 = 4.0 * 2.0 * 2e3 / (0.4 * 0.5);
        assert_relative_eq!(spring_period_timestep(&rough), 2.0 / omega_squared.sqrt(), max_relative = 1e-14);
    }

    #[test]
    fn velocity_verlet_with_lagged_damping_turns_unstable_at_the_damped_limit() {
        // one mass between two springs against fixed walls (omega^2 = K/m): the limit formula with 2 Z k / D = K
        let (mass, k) = (1.0, 1.0);
        for zeta in [0.0_f64, 0.2, 0.6] {
            let bed = SpringBed {
                mass,
                inertia_factor: 0.4,
                normal_stiffness: k,
                tangential_ratio: 0.0,
                contacts: 1.0,
                dimensions: 2.0,
                damping_ratio: zeta,
            };
            let limit = spring_period_timestep(&bed);
            let grows = |dt: f64| {
                let (mut x, mut v) = (1.0_f64, 0.0_f64);
                for _ in 0..20_000 {
                    // leapfrog whose dashpot sees the velocity half a step earlier
                    v -= dt * (k * x + 2.0 * zeta * v);
                    x += dt * v;
                    if x.abs() > 1e6 {
                        return true;
                    }
                }
                false
            };
            assert!(!grows(0.99 * limit), "zeta {zeta}");
            assert!(grows(1.01 * limit), "zeta {zeta}");
        }
    }

    #[test]
    fn rayleigh_time_of_a_glass_bead() {
        // d = 4 mm, rho = 2500, E = 1 GPa, nu = 0.2: 1.693e-5 s in four digits
        let shear = 1e9 / (2.0 * 1.2);
        assert_relative_eq!(rayleigh_time(0.002, 2500.0, shear, 0.2), 1.693e-5, max_relative = 3e-4);
    }
}
