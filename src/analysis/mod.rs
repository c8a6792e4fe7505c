//! Measures of a run, one a file. They work on plain slices (particles, contact pairs, series), so that a live run, a
//! stored frame and another code's output are measured by the same code.
//!
//! Every measure says what it is worth: a standard uncertainty where there is one, and a note where there is none.

pub mod angle_of_repose;
pub mod at_rest;
pub mod centre_of_mass;
pub mod compare;
pub mod coordination_number;
pub mod energy_budget;
pub mod mass_flow_rate;
pub mod measure;
pub mod replicates;
pub mod size_distribution;
pub mod solid_fraction;
pub mod statistics;
pub mod surface_profile;

pub use measure::{MassSeries, MeasureResult, Observed, evaluate};

/// Why a measure has no value for what it was given, in the user's words.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unmeasurable(pub String);

impl std::fmt::Display for Unmeasurable {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(&self.0)
    }
}

impl std::error::Error for Unmeasurable {}
