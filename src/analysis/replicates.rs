//! Replicates of a run: mean and scatter of every measure over them.

use super::statistics::student::student_quantile;
use super::statistics::two_samples::CONFIDENCE;
use super::statistics::{mean, standard_deviation};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;

/// A measure over replicates, in the measure's unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ReplicateFigure {
    /// Replicates in which it has a value.
    pub count: u64,
    /// Mean of them.
    pub mean: f64,
    /// Standard deviation of single replicates; null for fewer than two.
    pub standard_deviation: Option<f64>,
    /// 95 % interval of the mean, mean +- t s / sqrt(n) with n - 1 degrees of freedom (Student 1908); null for fewer than two.
    pub interval_95: Option<[f64; 2]>,
    /// Smallest value.
    pub minimum: f64,
    /// Largest value.
    pub maximum: f64,
}

impl ReplicateFigure {
    /// Mean and scatter of `values`; `None` where there is none.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Self> {
        let centre = mean(values)?;
        let deviation = standard_deviation(values);
        let count = values.len() as f64;
        let half_width = deviation.map(|s| student_quantile(0.5 * (1.0 + CONFIDENCE), count - 1.0) * s / count.sqrt());
        Some(Self {
            count: values.len() as u64,
            mean: centre,
            standard_deviation: deviation,
            interval_95: half_width.map(|half| [centre - half, centre + half]),
            minimum: values.iter().copied().fold(f64::INFINITY, f64::min),
            maximum: values.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        })
    }
}

/// True for the name of a figure that replicates have in common: no note, and no uncertainty of a single run, which the
/// scatter over the replicates replaces.
#[must_use]
pub fn is_figure(name: &str) -> bool {
    let last = name.rsplit('.').next().unwrap_or(name);
    !last.contains("_uncertainty") && !last.ends_with("_note")
}

/// Every figure of the replicates' `measures` by name. A figure without a value in some replicates has a smaller `count`,
/// one without any value is left out.
#[must_use]
pub fn figures<'a>(
    replicates: impl IntoIterator<Item = &'a BTreeMap<String, Value>>,
) -> BTreeMap<String, ReplicateFigure> {
    let mut values: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    for measures in replicates {
        for (name, value) in measures.iter().filter(|(name, _)| is_figure(name)) {
            values.entry(name).or_default().extend(value.as_f64());
        }
    }
    values.into_iter().filter_map(|(name, values)| Some((name.to_owned(), ReplicateFigure::of(&values)?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use serde_json::json;

    fn measures(value: Value) -> BTreeMap<String, Value> {
        serde_json::from_value(value).unwrap()
    }

    #[test]
    fn figures_over_replicates() {
        let runs = [
            measures(
                json!({"chute.angle_deg": 30.0, "chute.angle_uncertainty_deg": 1.0, "chute.angle_note": "x", "never_m": null}),
            ),
            measures(json!({"chute.angle_deg": 32.0, "count": 7})),
            measures(json!({"chute.angle_deg": null, "count": 7})),
        ];
        let found = figures(&runs);
        assert_eq!(found.keys().collect::<Vec<_>>(), ["chute.angle_deg", "count"]);
        let angle = &found["chute.angle_deg"];
        assert_eq!((angle.count, angle.mean, angle.minimum, angle.maximum), (2, 31.0, 30.0, 32.0));
        assert_relative_eq!(angle.standard_deviation.unwrap(), 2f64.sqrt(), max_relative = 1e-12);
        // n = 2: t of one degree of freedom is tan(0.475 pi), s / sqrt(n) = 1.
        let half = (0.475 * std::f64::consts::PI).tan();
        assert_relative_eq!(angle.interval_95.unwrap()[1], 31.0 + half, max_relative = 1e-9);
        assert_eq!(found["count"].interval_95, Some([7.0, 7.0]));
    }

    #[test]
    fn one_replicate_has_no_scatter() {
        let one = ReplicateFigure::of(&[4.0]).unwrap();
        assert_eq!((one.count, one.mean, one.standard_deviation, one.interval_95), (1, 4.0, None, None));
        assert_eq!(ReplicateFigure::of(&[]), None);
        let text = serde_json::to_value(&one).unwrap();
        assert_eq!(text["interval_95"], Value::Null);
    }
}
