//! The passage between two time steps.

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

#[cfg(test)]
mod tests {
    use super::*;
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
}
