//! The passage between two time steps, or between two samples that lie farther apart.

use crate::gate::crossing::{Motion, Passage};
use crate::math::Vec3;

/// First time tau in (0, dt] at which s_0 + v_n tau + a_n tau^2 / 2 = 0, the way the solver moves a particle.
///
/// `before` s_0 < 0 [m] distance at the last time step, `speed` v_n [m/s] and `acceleration` a_n [m/s2] along the normal there,
/// `timestep` dt [s]. The particle has been seen at s >= 0 after dt, so there is a root; round-off is cut to dt.
#[must_use]
pub fn substep(before: f64, speed: f64, acceleration: f64, timestep: f64) -> f64 {
    // Written without the difference of two nearly equal numbers: for v_n >= 0 as 2 |s_0| / (v_n + root).
    let root = (speed * speed - 2.0 * acceleration * before).max(0.0).sqrt();
    let tau = if speed >= 0.0 { -2.0 * before / (speed + root) } else { (root - speed) / acceleration };
    if tau > 0.0 && tau < timestep { tau } else { timestep }
}

/// State at `tau` [s] after the motion `old`, before `new`, which is `timestep` dt [s] after it.
///
/// x = x_0 + v_0 tau + a_0 tau^2 / 2, v = v_0 + a_0 tau + (a_1 - a_0) tau^2 / (2 dt), spin likewise: velocity-Verlet's own place,
/// and the velocity whose acceleration is linear in time. Second order in dt, and `new` at tau = dt.
#[must_use]
pub fn state_at(old: &Motion, new: &Motion, tau: f64, timestep: f64, time: f64) -> Passage {
    let half = 0.5 * tau * tau;
    let rate = |a0: &Vec3, a1: &Vec3| a0 * tau + (a1 - a0) * (half / timestep);
    Passage {
        time,
        position: old.position + old.velocity * tau + old.acceleration * half,
        velocity: old.velocity + rate(&old.acceleration, &new.acceleration),
        spin: old.spin + rate(&old.spin_acceleration, &new.spin_acceleration),
    }
}

/// The motion `new` as it would be without periodic borders: `interval` T [s] after `old`, it is moved by whole `periods` [m] to
/// where the mean velocity of both leads.
#[must_use]
pub fn unwrapped(old: &Motion, new: &Motion, interval: f64, periods: &[Option<f64>; 3]) -> Motion {
    let expected = old.position + (old.velocity + new.velocity) * (0.5 * interval);
    let mut moved = *new;
    for (axis, period) in periods.iter().enumerate() {
        if let Some(period) = period {
            moved.position[axis] += ((expected[axis] - new.position[axis]) / period).round() * period;
        }
    }
    moved
}

/// First time tau in (0, T] at which the cubic Hermite polynomial s(tau) of two samples changes from < 0 to >= 0.
///
/// `ends` are (s [m], ds/dtau [m/s]) of both samples, s_0 < 0 <= s_1, `interval` T [s] their distance. Between the polynomial's
/// extrema it is monotonic, so the first of these pieces that ends at >= 0 holds one root, which is bracketed and found by
/// Newton's step where that stays inside, else by halving.
#[must_use]
pub fn first_root(ends: [(f64, f64); 2], interval: f64) -> f64 {
    let [(s0, v0), (s1, v1)] = ends;
    // s(u) = s0 + b u + c u^2 + d u^3 with u = tau / T.
    let (b, end_slope) = (v0 * interval, v1 * interval);
    let c = 3.0 * (s1 - s0) - 2.0 * b - end_slope;
    let d = 2.0 * (s0 - s1) + b + end_slope;
    let value = |u: f64| ((d * u + c) * u + b) * u + s0;
    let slope = |u: f64| (3.0 * d * u + 2.0 * c) * u + b;
    let (mut low, mut high) = (0.0, 1.0);
    for turn in extrema(b, c, d) {
        if value(turn) >= 0.0 {
            high = turn;
            break;
        }
        low = turn;
    }
    let mut at = 0.5 * (low + high);
    for round in 0..120 {
        let s = value(at);
        if s < 0.0 {
            low = at;
        } else {
            high = at;
        }
        // Every third time the middle: Newton's steps alone may creep along a flat piece.
        let newton = at - s / slope(at);
        let next = if round % 3 < 2 && newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if next == at || high - low <= 0.5 * f64::EPSILON * high {
            break;
        }
        at = next;
    }
    let tau = at * interval;
    if tau > 0.0 && tau < interval { tau } else { interval }
}

/// Extrema of s0 + b u + c u^2 + d u^3 in (0, 1), ascending.
fn extrema(b: f64, c: f64, d: f64) -> impl Iterator<Item = f64> {
    let discriminant = c * c - 3.0 * b * d;
    // As -c -+ root without the difference of nearly equal numbers.
    let sum = -(c + c.signum() * discriminant.max(0.0).sqrt());
    let mut roots = if discriminant > 0.0 { [sum / (3.0 * d), b / sum] } else { [f64::NAN; 2] };
    if roots[0] > roots[1] {
        roots.swap(0, 1);
    }
    roots.into_iter().filter(|root| *root > 0.0 && *root < 1.0)
}

/// State at `tau` [s] after the sample `old`, before the sample `new`, which is `interval` T [s] after it.
///
/// The place is the cubic Hermite polynomial of both places and velocities, the velocity its derivative, the spin linear between
/// both. Where the motion is smooth they err by at most T^4 / 384 times the fourth derivative of the place, T^3 sqrt(3) / 216
/// times the same, and T^2 / 8 times the second derivative of the spin. Torques at the samples would not improve the spin: those
/// of contacts may change their sign at every time step.
#[must_use]
pub fn state_between(old: &Motion, new: &Motion, tau: f64, interval: f64, time: f64) -> Passage {
    let u = tau / interval;
    let way = new.position - old.position;
    let (start, end) = (old.velocity * interval, new.velocity * interval);
    let (c, d) = (way * 3.0 - start * 2.0 - end, way * -2.0 + start + end);
    Passage {
        time,
        position: old.position + ((d * u + c) * u + start) * u,
        velocity: ((d * (3.0 * u) + c * 2.0) * u + start) / interval,
        spin: old.spin + (new.spin - old.spin) * u,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec3;
    use approx::assert_relative_eq;

    #[test]
    fn the_root_is_the_first_one_for_every_sign() {
        // (s_0, v_n, a_n): steady, sped up, slowed down and turning later, from rest, going away and pulled back.
        for (before, speed, acceleration) in
            [(-1.0, 2.0, 0.0), (-1.0, 2.0, 3.0), (-1.0, 2.0, -1.5), (-1.0, 0.0, 4.0), (-1.0, -0.5, 6.0)]
        {
            let tau = substep(before, speed, acceleration, 10.0);
            assert_relative_eq!(before + speed * tau + 0.5 * acceleration * tau * tau, 0.0, epsilon = 1e-15);
            let earlier = 0.999 * tau;
            assert!(before + speed * earlier + 0.5 * acceleration * earlier * earlier < 0.0, "a later root");
        }
        // A path that just touches: v^2 = 2 |a| |s_0|.
        assert_relative_eq!(substep(-1.0, 2.0, -2.0, 10.0), 1.0, max_relative = 1e-7);
        assert_eq!(substep(-1.0, 1e-9, 0.0, 0.5), 0.5, "never beyond the time step");
        assert_eq!(substep(-1.0, 0.0, 0.0, 0.5), 0.5, "no root at all: the time step's end");
    }

    /// s(u) of the Hermite polynomial in Bernstein's form: another way to the same number.
    fn hermite([(s0, v0), (s1, v1)]: [(f64, f64); 2], interval: f64, u: f64) -> f64 {
        let (p1, p2) = (s0 + v0 * interval / 3.0, s1 - v1 * interval / 3.0);
        let w = 1.0 - u;
        w.powi(3) * s0 + 3.0 * w * w * u * p1 + 3.0 * w * u * u * p2 + u.powi(3) * s1
    }

    #[test]
    fn the_first_root_between_samples_is_found_where_there_are_three() {
        let interval = 2.0;
        // Steady; from rest; back and forth (three roots); arriving with s = 0; a quadratic; leaving and thrown back.
        for ends in [
            [(-1.0, 1.0), (1.0, 1.0)],
            [(-1.0, 0.0), (0.5, 3.0)],
            [(-0.1, 10.0), (0.1, 10.0)],
            [(-1.0, 2.0), (0.0, 0.5)],
            [(-1.0, 0.0), (3.0, 4.0)],
            [(-1e-9, -5.0), (2.0, 1.0)],
        ] {
            let tau = first_root(ends, interval);
            let largest = ends.iter().map(|(s, v)| s.abs() + (v * interval).abs()).fold(0.0, f64::max);
            assert!(tau > 0.0 && tau <= interval);
            // Coefficients up to six times the largest number, each rounded.
            let residue = hermite(ends, interval, tau / interval);
            assert!(residue.abs() <= 16.0 * f64::EPSILON * largest, "{ends:?} at {tau}: {residue}");
            for part in 0..1000 {
                let u = f64::from(part) / 1000.0 * tau / interval;
                assert!(hermite(ends, interval, u) < 0.0, "{ends:?}: a root before {tau}");
            }
        }
        assert!(first_root([(-0.1, 10.0), (0.1, 10.0)], interval) < 0.02, "the first of three");
        // At the edges, and with numbers of very different size, the root stays inside.
        for (before, after) in [(-1e-300, 1.0), (-1.0, 0.0), (-1.0, 1e-300), (-1e-12, 1e-12)] {
            let tau = first_root([(before, 0.3), (after, 0.3)], 1e-4);
            assert!(tau > 0.0 && tau <= 1e-4);
        }
    }

    /// A motion whose n-th derivatives are of length w^n: sine and cosine of w t.
    fn swinging(rate: f64, time: f64) -> Motion {
        let (sine, cosine) = (rate * time).sin_cos();
        Motion {
            position: vec3(sine, cosine, 0.0),
            velocity: vec3(cosine, -sine, 0.0) * rate,
            spin: vec3(sine, 0.0, cosine),
            acceleration: vec3(-sine, -cosine, 0.0) * (rate * rate),
            spin_acceleration: vec3(cosine, 0.0, -sine) * rate,
        }
    }

    #[test]
    fn between_samples_the_place_is_of_fourth_order_and_the_velocity_of_third() {
        let rate = 3.0;
        let errors = |interval: f64| {
            let (old, new) = (swinging(rate, 0.2), swinging(rate, 0.2 + interval));
            let mut largest = [0.0_f64; 3];
            for part in 1..32 {
                let tau = f64::from(part) / 32.0 * interval;
                let (found, there) = (state_between(&old, &new, tau, interval, 0.0), swinging(rate, 0.2 + tau));
                let own = [
                    (found.position - there.position).norm(),
                    (found.velocity - there.velocity).norm(),
                    (found.spin - there.spin).norm(),
                ];
                largest.iter_mut().zip(own).for_each(|(largest, own)| *largest = largest.max(own));
            }
            largest
        };
        let (coarse, fine) = (errors(0.02), errors(0.01));
        for ((coarse, fine), order) in coarse.iter().zip(fine).zip([4, 3, 2]) {
            // The next order changes the ratio by about the angle between two samples, 0.06.
            assert_relative_eq!(coarse / fine, 2.0_f64.powi(order), max_relative = 0.06);
        }
        let angle = rate * 0.02;
        let bounds = [angle.powi(4) / 384.0, rate * angle.powi(3) * 3.0_f64.sqrt() / 216.0, angle.powi(2) / 8.0];
        assert!(coarse.iter().zip(bounds).all(|(error, bound)| *error <= bound), "{coarse:?} against {bounds:?}");
    }

    #[test]
    fn both_samples_are_reproduced_and_a_border_between_them_is_none() {
        let (old, new) = (swinging(3.0, 0.2), swinging(3.0, 0.21));
        let start = state_between(&old, &new, 0.0, 0.01, 0.0);
        assert_eq!((start.position, start.spin), (old.position, old.spin));
        let end = state_between(&old, &new, 0.01, 0.01, 0.0);
        assert_relative_eq!((end.position - new.position).norm(), 0.0, epsilon = 1e-15);
        assert_relative_eq!((end.velocity - new.velocity).norm(), 0.0, epsilon = 1e-12);
        let beyond = Motion { position: new.position - vec3(0.5, 0.0, 0.0), ..new };
        let found = unwrapped(&old, &beyond, 0.01, &[Some(0.5), None, Some(0.5)]);
        assert_relative_eq!((found.position - new.position).norm(), 0.0, epsilon = 1e-15);
        assert_eq!(unwrapped(&old, &beyond, 0.01, &[None; 3]), beyond);
    }
}
