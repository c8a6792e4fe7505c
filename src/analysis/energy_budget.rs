//! Whether an energy budget closes.

/// What an energy column stands for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EnergyRole {
    /// Stored now: kinetic, rotational, gravitational, elastic.
    Stored,
    /// Turned into heat since the start: slip, dashpots, rolling.
    Dissipated,
    /// Left the particles otherwise since the start: removed ones, the signed residual of a law.
    Taken,
    /// Brought in since the start: inserted particles, work of moving walls.
    Supplied,
}

/// One column of a budget.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnergyColumn<'a> {
    /// What it stands for.
    pub role: EnergyRole,
    /// Energy [J] at each sample, the same samples for all columns.
    pub values: &'a [f64],
}

/// How well a budget closes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Closing {
    /// max over the samples k of |S_k - S_0| [J].
    pub largest_error: f64,
    /// The sample k where that is.
    pub sample: usize,
    /// Energy dissipated between the first and the last sample [J].
    pub dissipation: f64,
    /// `largest_error / dissipation` [-]; infinite where an error stands against no dissipation, 0 for 0 / 0.
    pub relative: f64,
}

/// Closing error of a budget: S = stored + dissipated + taken - supplied must be the same at every sample.
///
/// The error is the solver's (time step, accounting), not a statistical one. Compare `relative` with what the largest
/// single term can resolve: sums of terms of size E carry round-off of about E 2^-52. `None` where the columns differ in
/// length or are empty.
#[must_use]
pub fn closing(columns: &[EnergyColumn]) -> Option<Closing> {
    let samples = columns.first()?.values.len();
    if samples == 0 || columns.iter().any(|c| c.values.len() != samples) {
        return None;
    }
    let total = |k: usize| -> f64 {
        let signed = |c: &EnergyColumn| if c.role == EnergyRole::Supplied { -c.values[k] } else { c.values[k] };
        columns.iter().map(signed).sum()
    };
    let start = total(0);
    // A budget with a NaN never closes: the comparison is the other way round on purpose.
    let (mut sample, mut largest_error) = (0, 0.0);
    for k in 0..samples {
        let error = (total(k) - start).abs();
        if error.is_nan() || error > largest_error {
            (sample, largest_error) = (k, error);
        }
        if error.is_nan() {
            break;
        }
    }
    let dissipated = columns.iter().filter(|c| c.role == EnergyRole::Dissipated);
    let dissipation: f64 = dissipated.map(|c| c.values[samples - 1] - c.values[0]).sum();
    let relative = if largest_error == 0.0 { 0.0 } else { largest_error / dissipation.max(0.0) };
    Some(Closing { largest_error, sample, dissipation, relative })
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn column(role: EnergyRole, values: &[f64]) -> EnergyColumn<'_> {
        EnergyColumn { role, values }
    }

    #[test]
    fn a_sliding_block_pulled_along_closes() {
        // Work W(t) = F v t goes in, mu m g v t goes out as slip, the rest is kinetic; F = 3, mu m g = 1, v = t here.
        let time: Vec<f64> = (0..100).map(|k| f64::from(k) * 0.01).collect();
        let work: Vec<f64> = time.iter().map(|t| 3.0 * 0.5 * t * t).collect();
        let slip: Vec<f64> = time.iter().map(|t| 0.5 * t * t).collect();
        let kinetic: Vec<f64> = time.iter().map(|t| t * t).collect();
        let columns = [
            column(EnergyRole::Supplied, &work),
            column(EnergyRole::Dissipated, &slip),
            column(EnergyRole::Stored, &kinetic),
        ];
        let found = closing(&columns).unwrap();
        assert!(found.relative < 1e-14, "{found:?}");
        let forgotten = closing(&columns[..2]).unwrap();
        assert_eq!(forgotten.sample, 99);
        assert_relative_eq!(forgotten.relative, 2.0, epsilon = 1e-12);
    }

    #[test]
    fn not_a_number_never_closes() {
        let found = closing(&[
            column(EnergyRole::Stored, &[1.0, f64::NAN, 1.0]),
            column(EnergyRole::Dissipated, &[0.0, 1.0, 1.0]),
        ])
        .unwrap();
        assert!(found.largest_error.is_nan() && found.relative.is_nan());
    }

    #[test]
    fn an_error_without_dissipation_is_infinite() {
        assert_eq!(closing(&[column(EnergyRole::Stored, &[1.0, 2.0])]).unwrap().relative, f64::INFINITY);
        assert_eq!(closing(&[column(EnergyRole::Stored, &[1.0, 1.0])]).unwrap().relative, 0.0);
        assert_eq!(closing(&[]), None);
        let uneven = [column(EnergyRole::Stored, &[1.0, 2.0]), column(EnergyRole::Taken, &[1.0])];
        assert_eq!(closing(&uneven), None);
    }
}
