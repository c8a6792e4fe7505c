//! What a trajectory tells about an impact: touch and separation from free flight, peaks from a parabola.

use super::{NotRun, Sample};

/// An impact as measured.
#[derive(Debug, Clone, Copy)]
pub(super) struct MeasuredImpact {
    pub overlap: f64,
    pub acceleration: f64,
    pub duration: f64,
    pub restitution: f64,
}

/// Measures one impact from samples at every step; `overlap` and `rate` give the overlap [m] (negative when apart) and
/// its rate [m/s] of a sample. Without forces at a distance the flight before and after is straight, so that the times
/// of touch and separation follow exactly from the last sample before and the first one after.
pub(super) fn measure_impact(
    samples: &[Sample],
    overlap: impl Fn(&Sample) -> f64,
    rate: impl Fn(&Sample) -> f64,
) -> Result<MeasuredImpact, NotRun> {
    let overlaps: Vec<f64> = samples.iter().map(&overlap).collect();
    let first = overlaps.iter().position(|&x| x > 0.0).ok_or("the bodies did not touch")?;
    let length = overlaps[first..].iter().position(|&x| x <= 0.0).ok_or("the bodies did not separate")?;
    if first == 0 || length < 3 {
        return Err("the impact is not resolved by the samples".into());
    }
    let (before, after) = (&samples[first - 1], &samples[first + length]);
    let touch = before.time - overlap(before) / rate(before);
    let separation = after.time - overlap(after) / rate(after);
    let interval = samples[1].time - samples[0].time;
    let accelerations: Vec<f64> = (first - 1..first + length)
        .map(|k| -(overlaps[k + 1] - 2.0 * overlaps[k] + overlaps[k.max(1) - 1]) / (interval * interval))
        .collect();
    Ok(MeasuredImpact {
        overlap: peak(&overlaps[first - 1..=first + length]),
        acceleration: peak(&accelerations),
        duration: separation - touch,
        restitution: -rate(after) / rate(before),
    })
}

/// Top of the parabola through the largest value and its neighbours.
fn peak(values: &[f64]) -> f64 {
    let top = (1..values.len() - 1).max_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(1);
    let (left, middle, right) = (values[top - 1], values[top], values[top + 1]);
    let curvature = left - 2.0 * middle + right;
    if curvature < 0.0 { middle - (right - left).powi(2) / (8.0 * curvature) } else { middle }
}

/// The value that is farthest from `reference`: the worst of several phases between contact and time step.
pub(super) fn worst(values: impl IntoIterator<Item = f64>, reference: f64) -> f64 {
    values.into_iter().fold(reference, |worst, value| {
        if value.is_nan() || (value - reference).abs() > (worst - reference).abs() { value } else { worst }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_top_of_a_sampled_parabola_is_found_between_the_samples() {
        let values: Vec<f64> = (0..9).map(|k| 3.0 - (f64::from(k) - 4.3).powi(2)).collect();
        assert!((peak(&values) - 3.0).abs() < 1e-12);
    }

    #[test]
    fn the_worst_value_keeps_a_nan() {
        assert!(worst([1.0, f64::NAN, 1.5], 1.0).is_nan() || worst([1.0, f64::NAN], 1.0).is_nan());
        assert!((worst([1.0, 0.5, 1.2], 1.0) - 0.5).abs() < 1e-15);
    }
}
