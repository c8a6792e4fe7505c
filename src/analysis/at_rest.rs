//! Whether, and since when, particles are at rest.

use crate::geometry::part::AtRest;
use crate::math::Vec3;
use crate::particle::ParticleState;

/// Root-mean-square speed of the centres, v_rms = sqrt(sum |v_i|^2 / N)   [m/s]
///
/// Exact for its state. `None` for no particle.
#[must_use]
pub fn rms_speed(particles: &[ParticleState]) -> Option<f64> {
    root_mean_square(particles.iter().map(|p| p.velocity.norm_squared()))
}

/// Unbalanced force ratio I_uf = rms |F_i| / rms |f_c|   [-]
///
/// F_i resultant force [N] on particle i, gravity included; f_c force [N] at contact c (particles and walls). 0 in
/// equilibrium, about 1 in free flow; packings below 1e-2 to 1e-3 are usually called static.
/// Source: Ng (2006), J. Eng. Mech. 132(7), 723-729. Rival convention: means instead of root mean squares (YADE).
/// `None` without particles or without a contact force.
#[must_use]
pub fn unbalanced_force_ratio(resultants: &[Vec3], contact_forces: &[Vec3]) -> Option<f64> {
    let resultant = root_mean_square(resultants.iter().map(Vec3::norm_squared))?;
    let contact = root_mean_square(contact_forces.iter().map(Vec3::norm_squared))?;
    (contact > 0.0).then(|| resultant / contact)
}

/// When a series of (time [s], root-mean-square speed [m/s]) came to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestTime {
    /// First sampled time at which `condition` held [s].
    pub time: f64,
    /// The condition began to hold at most so much earlier [s]: the sampling interval before `time`.
    pub uncertainty: f64,
}

/// First time at which the speed has stayed below the condition's limit for its hold time; `None` if never.
/// Whether all feeds have finished is not seen here: samples from before that are the caller's to leave out.
#[must_use]
pub fn rest_time(speeds: &[(f64, f64)], condition: &AtRest) -> Option<RestTime> {
    let mut slow_since = None;
    let mut before = None;
    for &(time, speed) in speeds {
        slow_since = if speed < condition.speed { slow_since.or(Some(time)) } else { None };
        // Half a millionth of the hold time absorbs the rounding of sample times.
        let held = slow_since.is_some_and(|since| time - since >= condition.hold * (1.0 - 5e-7));
        if held && time >= condition.not_before {
            return Some(RestTime { time, uncertainty: time - before.unwrap_or(time) });
        }
        before = Some(time);
    }
    None
}

fn root_mean_square(squares: impl ExactSizeIterator<Item = f64>) -> Option<f64> {
    let count = squares.len();
    (count > 0).then(|| (squares.sum::<f64>() / count as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::measure::tests::particle;
    use crate::math::vec3;
    use approx::assert_relative_eq;

    #[test]
    fn rms_of_known_speeds() {
        let moving = |id, speed| ParticleState { velocity: vec3(0.0, speed, 0.0), ..particle(id, [0.0; 3], 1.0) };
        let particles = [moving(0, 3.0), moving(1, -4.0)];
        assert_relative_eq!(rms_speed(&particles).unwrap(), (25.0_f64 / 2.0).sqrt(), epsilon = 1e-15);
        assert_eq!(rms_speed(&[]), None);
    }

    #[test]
    fn ratio_of_a_hanging_and_of_a_falling_particle() {
        let weight = vec3(0.0, 0.0, -2.0);
        assert_eq!(unbalanced_force_ratio(&[weight - weight], &[-weight]), Some(0.0));
        assert_eq!(unbalanced_force_ratio(&[weight, weight], &[2.0 * weight]), Some(0.5));
        assert_eq!(unbalanced_force_ratio(&[weight], &[]), None);
    }

    #[test]
    fn rest_needs_the_whole_hold_time_without_a_break() {
        let condition = AtRest { speed: 0.1, hold: 0.3, not_before: 0.0 };
        let series: Vec<(f64, f64)> = (0..20)
            .map(|k| {
                let time = 0.1 * f64::from(k);
                (time, if (0.45..0.65).contains(&time) || time < 0.15 { 1.0 } else { 0.01 })
            })
            .collect();
        // Slow from 0.2 to 0.4 (too short), then from 0.7 on.
        let rest = rest_time(&series, &condition).unwrap();
        assert_relative_eq!(rest.time, 1.0, epsilon = 1e-9);
        assert_relative_eq!(rest.uncertainty, 0.1, epsilon = 1e-9);
        let later = rest_time(&series, &AtRest { not_before: 1.45, ..condition }).unwrap();
        assert_relative_eq!(later.time, 1.5, epsilon = 1e-9);
        assert_eq!(rest_time(&series, &AtRest { hold: 5.0, ..condition }), None);
    }
}
