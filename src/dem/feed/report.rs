//! What a feed was asked for and what it brought.

use super::Amount;
use super::queue::Exact;
use super::size::{SizeClass, SizeSampler};
use crate::particle::GradingBy;
use serde::{Deserialize, Serialize};

/// What one feed was asked for and what it brought.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FeedReport {
    /// Name in the scene.
    pub name: String,
    /// What was asked for so far: all of a fill, of a stream what was due by the last step.
    pub asked: Amount,
    /// Particles inserted.
    pub inserted_count: u64,
    /// Mass inserted [kg].
    pub inserted_mass: f64,
    /// Asked against inserted grading; empty for a feed from a file.
    pub grading: Vec<GradingRow>,
    /// What is missing, and why.
    pub shortfall: Option<Shortfall>,
}

/// One size class of a feed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct GradingRow {
    /// Smallest diameter [m].
    pub from: f64,
    /// Largest diameter [m].
    pub to: f64,
    /// Whether the shares count mass or particles.
    pub by: GradingBy,
    /// Share asked for [-].
    pub asked: f64,
    /// Share of what was inserted [-]; 0 where nothing was.
    pub inserted: f64,
    /// Particles inserted.
    pub count: u64,
    /// Mass inserted [kg].
    pub mass: f64,
}

/// What a feed could not bring.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Shortfall {
    /// How much, counted as the feed was asked.
    pub missing: Amount,
    /// Why, and what would change it.
    pub cause: String,
}

/// Running count of what a feed inserted.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Tally {
    pub count: u64,
    mass: Exact,
    classes: Vec<ClassTally>,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct ClassTally {
    /// Upper border of the class [m]; in here so that a tally needs nothing else.
    to: Exact,
    count: u64,
    mass: Exact,
}

impl Tally {
    pub fn new(sampler: &SizeSampler) -> Self {
        let empty = |class: SizeClass| ClassTally { to: Exact(class.to), count: 0, mass: Exact(0.0) };
        Self { count: 0, mass: Exact(0.0), classes: sampler.classes().into_iter().map(empty).collect() }
    }

    pub fn add(&mut self, diameter: f64, mass: f64) {
        self.count += 1;
        self.mass.0 += mass;
        let index = self.classes.partition_point(|class| class.to.0 <= diameter);
        // the largest size lies on the upper border of the last class
        let last = self.classes.len().saturating_sub(1);
        if let Some(class) = self.classes.get_mut(index.min(last)) {
            class.count += 1;
            class.mass.0 += mass;
        }
    }

    /// Mass inserted [kg].
    pub const fn mass(&self) -> f64 {
        self.mass.0
    }

    /// Asked against inserted, class by class.
    pub fn grading(&self, sampler: &SizeSampler) -> Vec<GradingRow> {
        let by = sampler.graded_by();
        let row = |(class, tally): (SizeClass, &ClassTally)| {
            let inserted = match by {
                GradingBy::Mass => tally.mass.0 / self.mass(),
                GradingBy::Number => tally.count as f64 / self.count as f64,
            };
            GradingRow {
                from: class.from,
                to: class.to,
                by,
                asked: class.share,
                inserted: if self.count == 0 { 0.0 } else { inserted },
                count: tally.count,
                mass: tally.mass.0,
            }
        };
        sampler.classes().into_iter().zip(&self.classes).map(row).collect()
    }

    /// What is missing of `asked`; `None` where nothing is. By mass, less than `tolerance` [kg] is nothing.
    pub fn missing(&self, asked: Amount, tolerance: f64) -> Option<Amount> {
        match asked {
            Amount::Count(count) => (count > self.count).then(|| Amount::Count(count - self.count)),
            Amount::Mass(mass) => (mass - self.mass() > tolerance).then(|| Amount::Mass(mass - self.mass())),
        }
    }
}
