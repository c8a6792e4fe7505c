//! Mass flow rate from mass passed against time, or from single crossings.

use super::Unmeasurable;
use super::statistics::{
    BlockBootstrap, autocorrelation_time, block_length, quantile_of_sorted, standard_deviation, theil_sen,
};

/// Share of the mass passed at which the steady part begins and ends [-].
const STEADY: [f64; 2] = [0.2, 0.8];
/// Fewest sampling intervals in the steady part: below, blocks of correlated intervals cannot be told from the whole.
const FEWEST_INTERVALS: usize = 8;
/// Most sampling intervals that enter the fit (its cost grows with their square); neighbours are merged above.
const MOST_INTERVALS: usize = 120;
/// Equal time intervals in which single crossings are counted.
const CROSSING_INTERVALS: usize = 128;
const RESAMPLES: usize = 500;
const SEED: u64 = 0x6d61_7373;

/// A steady mass flow rate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MassFlowRate {
    /// Rate W [kg/s].
    pub rate: f64,
    /// Standard uncertainty of W [kg/s].
    pub uncertainty: f64,
    /// 95 % interval of W [kg/s].
    pub interval: [f64; 2],
    /// First and last time of the steady part [s].
    pub window: [f64; 2],
    /// (rate of the second half - rate of the first half) / W [-].
    pub drift: f64,
    /// Standard uncertainty of `drift` [-]: a drift of more than three times that says the flow was not steady.
    pub drift_uncertainty: f64,
}

/// Mass flow rate W of the steady part of a discharge, from samples (time [s], mass passed [kg]) in order of time   [kg/s]
///
/// Steady part: from 20 % to 80 % of the mass that has passed by the last sample. W is the Theil-Sen slope of mass over
/// time there. Mass passed is a sum, so its errors add up along the series and residuals of the line say nothing about
/// the error of its slope; instead the increments between samples are resampled in moving blocks (Künsch 1989), at least
/// twice their autocorrelation time long, each resample is summed and fitted again, and the scatter of the slopes, times
/// sqrt(n / (n - b)) for n increments in blocks of b, is the uncertainty. Fixed seed.
/// Valid: at least 8 sampling intervals in the steady part; a flow that is steady there (see `drift`).
pub fn mass_flow_rate(samples: &[(f64, f64)]) -> Result<MassFlowRate, Unmeasurable> {
    let steady = steady_part(samples)?;
    let increments = merge(&steady);
    let rate = slope(&increments).ok_or_else(|| Unmeasurable("all samples have the same time".into()))?;
    let rates: Vec<f64> = increments.iter().map(|(time, mass)| mass / time).collect();
    let block = block_length(&rates);
    let inflation = (rates.len() as f64 / (rates.len() - block) as f64).sqrt();
    let mut resampler = BlockBootstrap::new(rates.len(), block, SEED);
    let mut slopes: Vec<f64> = (0..RESAMPLES)
        .filter_map(|_| {
            let drawn: Vec<_> = resampler.draw().into_iter().map(|k| increments[k]).collect();
            slope(&drawn)
        })
        .collect();
    slopes.sort_by(f64::total_cmp);
    let uncertainty = inflation * standard_deviation(&slopes).unwrap_or(f64::INFINITY);
    let end = |share| rate + inflation * (quantile_of_sorted(&slopes, share).unwrap_or(f64::NAN) - rate);
    let (first, second) = increments.split_at(increments.len() / 2);
    Ok(MassFlowRate {
        rate,
        uncertainty,
        interval: [end(0.025), end(0.975)],
        window: [steady[0].0, steady[steady.len() - 1].0],
        drift: (average(second) - average(first)) / rate,
        drift_uncertainty: drift_scatter(&rates) / rate,
    })
}

/// Mass flow rate from single crossings (time [s], mass [kg]; negative mass for a particle that came back), in any order.
///
/// Counts the mass in 128 equal intervals between the first and the last crossing and goes on as [`mass_flow_rate`].
pub fn mass_flow_rate_of_crossings(crossings: &[(f64, f64)]) -> Result<MassFlowRate, Unmeasurable> {
    let mut crossings = crossings.to_vec();
    crossings.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (Some(first), Some(last)) = (crossings.first(), crossings.last()) else {
        return Err(Unmeasurable("no particle has crossed".into()));
    };
    let (start, step) = (first.0, (last.0 - first.0) / CROSSING_INTERVALS as f64);
    let mut pending = crossings.iter().peekable();
    let mut passed = 0.0;
    let samples: Vec<(f64, f64)> = (0..=CROSSING_INTERVALS)
        .map(|k| {
            let time = if k == CROSSING_INTERVALS { last.0 } else { start + k as f64 * step };
            while let Some((_, mass)) = pending.next_if(|(t, _)| *t <= time) {
                passed += mass;
            }
            (time, passed)
        })
        .collect();
    mass_flow_rate(&samples)
}

fn steady_part(samples: &[(f64, f64)]) -> Result<Vec<(f64, f64)>, Unmeasurable> {
    if samples.iter().any(|(t, m)| !(t.is_finite() && m.is_finite())) || samples.windows(2).any(|w| w[1].0 < w[0].0) {
        return Err(Unmeasurable("times and masses must be finite and in order of time".into()));
    }
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
        return Err(Unmeasurable("no samples of the mass beyond the plane".into()));
    };
    let passed = last.1 - first.1;
    if passed <= 0.0 {
        return Err(Unmeasurable("no mass has passed the plane along its normal".into()));
    }
    let reaches = |share: f64| samples.iter().position(|(_, m)| m - first.1 >= share * passed);
    let window = [reaches(STEADY[0]).unwrap_or(0), reaches(STEADY[1]).unwrap_or(0)];
    let mut steady = samples[window[0]..=window[1]].to_vec();
    steady.dedup_by(|later, earlier| later.0 == earlier.0);
    if steady.len() <= FEWEST_INTERVALS {
        let found = steady.len() - 1;
        return Err(Unmeasurable(format!(
            "only {found} sampling intervals between 20 % and 80 % of the mass, {FEWEST_INTERVALS} are needed; \
             shorten the interval of the series"
        )));
    }
    Ok(steady)
}

/// Increments (time, mass) between samples, at most [`MOST_INTERVALS`].
fn merge(samples: &[(f64, f64)]) -> Vec<(f64, f64)> {
    let intervals = samples.len() - 1;
    let wanted = intervals.min(MOST_INTERVALS);
    let at = |k: usize| samples[k * intervals / wanted];
    (0..wanted).map(|k| (at(k + 1).0 - at(k).0, at(k + 1).1 - at(k).1)).collect()
}

fn slope(increments: &[(f64, f64)]) -> Option<f64> {
    let (mut times, mut masses) = (vec![0.0], vec![0.0]);
    for (k, (time, mass)) in increments.iter().enumerate() {
        times.push(times[k] + time);
        masses.push(masses[k] + mass);
    }
    theil_sen(&times, &masses).map(|line| line.slope)
}

/// Standard uncertainty of the difference of the means of both halves [kg/s], from the scatter about a straight trend: a
/// drift must not count as its own scatter. n rates with autocorrelation time tau are worth n / (2 tau) independent ones.
fn drift_scatter(rates: &[f64]) -> f64 {
    let count = rates.len() as f64;
    let average = rates.iter().sum::<f64>() / count;
    let place = |k: usize| k as f64 - 0.5 * (count - 1.0);
    let squares: f64 = (0..rates.len()).map(|k| place(k).powi(2)).sum();
    let trend = rates.iter().enumerate().map(|(k, rate)| place(k) * rate).sum::<f64>() / squares;
    let residuals: Vec<f64> = rates.iter().enumerate().map(|(k, rate)| rate - average - trend * place(k)).collect();
    let independent = count / (2.0 * autocorrelation_time(&residuals));
    2.0 * standard_deviation(&residuals).unwrap_or(f64::INFINITY) / independent.sqrt()
}

fn average(increments: &[(f64, f64)]) -> f64 {
    let time: f64 = increments.iter().map(|(time, _)| time).sum();
    let mass: f64 = increments.iter().map(|(_, mass)| mass).sum();
    mass / time
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::statistics::mean;
    use approx::assert_relative_eq;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Discharge of 1 kg at 2 kg/s between waits of 0.2 s, with a slow start and a slow end of 0.1 kg each.
    fn discharge(time: f64) -> f64 {
        match time - 0.2 {
            t if t < 0.0 => 0.0,
            t if t < 0.1 => 10.0 * t * t,
            t if t < 0.5 => 0.1 + 2.0 * (t - 0.1),
            t if t < 0.6 => 1.0 - 10.0 * (0.6 - t).powi(2),
            _ => 1.0,
        }
    }

    #[test]
    fn start_and_end_do_not_disturb_the_rate() {
        let samples: Vec<_> = (0..=200).map(|k| (f64::from(k) * 0.005, discharge(f64::from(k) * 0.005))).collect();
        let flow = mass_flow_rate(&samples).unwrap();
        // Exact within the steady part; only round-off is left.
        assert_relative_eq!(flow.rate, 2.0, max_relative = 1e-12);
        assert!(flow.uncertainty < 1e-9 && flow.drift.abs() < 1e-9);
        assert!(flow.window[0] >= 0.3 && flow.window[1] <= 0.7, "{:?}", flow.window);
    }

    #[test]
    fn crossings_give_the_rate_of_the_series() {
        let mass = 1e-3;
        // Crossing k happens when (k + 1/2) masses are through: invert the ramp by bisection.
        let crossings: Vec<_> = (0..1000)
            .map(|k| {
                let passed = (f64::from(k) + 0.5) * mass;
                let (mut low, mut high) = (0.0, 1.0);
                for _ in 0..60 {
                    let middle = 0.5 * (low + high);
                    if discharge(middle) < passed { low = middle } else { high = middle }
                }
                (low, mass)
            })
            .collect();
        let flow = mass_flow_rate_of_crossings(&crossings).unwrap();
        // One particle more or less at each end of the 600 in the steady part.
        assert_relative_eq!(flow.rate, 2.0, max_relative = 2.0 / 600.0);
    }

    #[test]
    fn stated_uncertainty_is_the_scatter_of_correlated_discharges() {
        // Increments with memory (AR(1), coefficient 0.5): the scatter of the rate is sqrt(3) times that without.
        let mut random = ChaCha8Rng::seed_from_u64(11);
        let (mut rates, mut stated, mut inside) = (Vec::new(), Vec::new(), 0);
        for _ in 0..200 {
            let (mut noise, mut passed) = (0.0, 0.0);
            let samples: Vec<_> = (0..=200)
                .map(|k| {
                    noise = 0.5 * noise + random.random_range(-0.5..0.5);
                    passed += 0.01 * (1.0 + noise);
                    (0.01 * f64::from(k), passed)
                })
                .collect();
            let flow = mass_flow_rate(&samples).unwrap();
            inside += usize::from((flow.interval[0]..=flow.interval[1]).contains(&1.0));
            rates.push(flow.rate);
            stated.push(flow.uncertainty);
        }
        let scatter = standard_deviation(&rates).unwrap();
        let ratio = mean(&stated).unwrap() / scatter;
        // 200 runs know their scatter to 5 %. Resampling 120 increments in blocks of 5 to 10 misses some of the memory
        // (the block bootstrap's known bias, about tau / b), hence more room below than above.
        assert!((0.75..1.2).contains(&ratio), "stated / scatter = {ratio}");
        assert!((170..=199).contains(&inside), "{inside} of 200 intervals of 95 % hold the truth");
    }

    #[test]
    fn a_flow_that_slows_down_shows_a_drift() {
        let samples: Vec<_> = (0..=100).map(|k| (f64::from(k), 100.0 - 0.01 * f64::from(100 - k).powi(2))).collect();
        let flow = mass_flow_rate(&samples).unwrap();
        assert!(flow.drift < -3.0 * flow.drift_uncertainty, "{flow:?}");
    }

    #[test]
    fn says_why_there_is_no_rate() {
        let reason = |samples: &[(f64, f64)]| mass_flow_rate(samples).unwrap_err().0;
        assert!(reason(&[]).contains("no samples"));
        assert!(reason(&[(0.0, 1.0), (1.0, 1.0)]).contains("no mass has passed"));
        assert!(reason(&[(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)]).contains("sampling intervals"));
        assert!(reason(&[(1.0, 0.0), (0.0, 1.0)]).contains("in order"));
        assert!(mass_flow_rate_of_crossings(&[]).unwrap_err().0.contains("no particle has crossed"));
    }
}
