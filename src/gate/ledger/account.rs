//! Accounts of a region: what was there, what came and went, what is there now.

use serde::{Deserialize, Serialize};

/// Momentum of a region.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MomentumAccount {
    /// At the beginning \[kg m/s\].
    pub before_kg_m_s: [f64; 3],
    /// At the end \[kg m/s\].
    pub after_kg_m_s: [f64; 3],
    /// What changed it, by name: gravity, parts, ghosts, particles that came and went \[kg m/s\].
    pub entries: Vec<MomentumEntry>,
    /// |after - before - sum of entries|, over the sum of all their magnitudes \[-\].
    pub closure_error: f64,
}

/// A line of a momentum account.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MomentumEntry {
    /// What it is.
    pub name: String,
    /// What it brought \[kg m/s\].
    pub momentum_kg_m_s: [f64; 3],
}

impl MomentumAccount {
    /// The account of a region; all in \[kg m/s\].
    #[must_use]
    pub fn new(before: [f64; 3], after: [f64; 3], entries: Vec<(&str, [f64; 3])>) -> Self {
        let rest = |axis: usize| after[axis] - before[axis] - entries.iter().map(|(_, entry)| entry[axis]).sum::<f64>();
        let magnitude = |vector: &[f64; 3]| vector.iter().map(|x| x * x).sum::<f64>().sqrt();
        let turnover =
            magnitude(&before) + magnitude(&after) + entries.iter().map(|(_, entry)| magnitude(entry)).sum::<f64>();
        let error = magnitude(&std::array::from_fn(rest));
        let named =
            |(name, momentum_kg_m_s): (&str, [f64; 3])| MomentumEntry { name: name.to_owned(), momentum_kg_m_s };
        Self {
            before_kg_m_s: before,
            after_kg_m_s: after,
            closure_error: share(error, turnover),
            entries: entries.into_iter().map(named).collect(),
        }
    }
}

/// Energy of a region.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[expect(non_snake_case, reason = "the names are keys of summary.json and end in the unit J")]
pub struct EnergyAccount {
    /// At the beginning \[J\].
    pub before_J: f64,
    /// At the end \[J\].
    pub after_J: f64,
    /// What changed it, by name: dissipation, parts, ghosts, particles that came and went \[J\].
    pub entries: Vec<EnergyEntry>,
    /// |after - before - sum of entries|, over the sum of all their magnitudes \[-\].
    pub closure_error: f64,
}

/// A line of an energy account.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[expect(non_snake_case, reason = "the names are keys of summary.json and end in the unit J")]
pub struct EnergyEntry {
    /// What it is.
    pub name: String,
    /// What it brought \[J\].
    pub energy_J: f64,
}

impl EnergyAccount {
    /// The account of a region; all in \[J\].
    #[must_use]
    pub fn new(before: f64, after: f64, entries: Vec<(&str, f64)>) -> Self {
        let error = (after - before - entries.iter().map(|(_, entry)| entry).sum::<f64>()).abs();
        let turnover = before.abs() + after.abs() + entries.iter().map(|(_, entry)| entry.abs()).sum::<f64>();
        let named = |(name, energy): (&str, f64)| EnergyEntry { name: name.to_owned(), energy_J: energy };
        Self {
            before_J: before,
            after_J: after,
            closure_error: share(error, turnover),
            entries: entries.into_iter().map(named).collect(),
        }
    }
}

/// error / turnover; 0 where nothing happened and nothing is missing.
fn share(error: f64, turnover: f64) -> f64 {
    if error == 0.0 { 0.0 } else { error / turnover }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_account_closes_or_says_by_how_much_it_does_not() {
        let entries = || vec![("gravity", [0.0, 0.0, -3.0]), ("parts", [1.0, 0.0, 1.0])];
        let closed = MomentumAccount::new([0.0, 0.0, 1.0], [1.0, 0.0, -1.0], entries());
        assert_eq!(closed.closure_error, 0.0);
        let open = MomentumAccount::new([0.0, 0.0, 1.0], [1.0, 0.0, -0.9], entries());
        let turnover = 1.0 + (1.0_f64 + 0.81).sqrt() + 3.0 + 2.0_f64.sqrt();
        assert!((open.closure_error - 0.1 / turnover).abs() < 1e-15);
        assert_eq!(EnergyAccount::new(0.0, 0.0, Vec::new()).closure_error, 0.0);
        assert_eq!(EnergyAccount::new(2.0, 1.0, vec![("dissipated", -0.5)]).closure_error, 0.5 / 3.5);
    }
}
