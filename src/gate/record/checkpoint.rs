//! A recorder's state as plain columns: what a checkpoint file holds. A recorder goes on from it bit for bit.

use super::{Approach, Gone, RecordTally, Recorder};
use crate::gate::crossing::Motion;
use crate::math::vec3;
use crate::particle::ParticleId;
use serde::{Deserialize, Serialize};

/// Numbers of a stored motion.
const MOTION: usize = 15;
/// Integers of a row of `approach`: identity, time step, path's start, path's motions.
const APPROACH: usize = 4;

/// A recorder's state: named columns. Written with columns sorted by identity, so that equal states are equal files.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RecorderState {
    /// Real columns by name.
    pub reals: Vec<(&'static str, Vec<f64>)>,
    /// Integer columns by name.
    pub integers: Vec<(&'static str, Vec<u64>)>,
    /// Everything small, as JSON.
    pub progress: String,
}

impl RecorderState {
    /// Names of the real columns.
    pub const REALS: [&'static str; 2] = ["approach_motion", "path_motion"];
    /// Names of the integer columns.
    pub const INTEGERS: [&'static str; 4] = ["approach", "after", "sitting", "free_flow"];

    fn real(&self, name: &str) -> Result<&[f64], String> {
        let column = self.reals.iter().find(|(column, _)| *column == name);
        column.map(|(_, values)| values.as_slice()).ok_or_else(|| missing(name))
    }

    fn integer(&self, name: &str) -> Result<&[u64], String> {
        let column = self.integers.iter().find(|(column, _)| *column == name);
        column.map(|(_, values)| values.as_slice()).ok_or_else(|| missing(name))
    }
}

fn missing(name: &str) -> String {
    format!("the recorder's column {name:?} is missing or has a wrong length")
}

#[derive(Debug, Serialize, Deserialize)]
struct Progress {
    looked: bool,
    tally: RecordTally,
}

impl Recorder {
    /// The state after a look and all its crossings.
    #[must_use]
    pub fn state(&self) -> RecorderState {
        let mut approaching: Vec<(&ParticleId, &Approach)> = self.before.iter().collect();
        approaching.sort_unstable_by_key(|(id, _)| **id);
        let (mut rows, mut motions, mut paths) = (Vec::new(), Vec::new(), Vec::new());
        for (id, approach) in approaching {
            rows.extend([id.0, approach.step, approach.path_start, approach.path.len() as u64]);
            motions.push(approach.distance);
            motions.extend(numbers(&approach.motion));
            paths.extend(approach.path.iter().flat_map(numbers));
        }
        let mut after: Vec<[u64; 2]> = self.after.iter().map(|(id, gone)| [id.0, u64::from(gone.returned)]).collect();
        after.sort_unstable();
        let mut sitting: Vec<u64> = self.sitting.keys().map(|id| id.0).collect();
        sitting.sort_unstable();
        let progress = Progress { looked: self.looked, tally: self.tally.clone() };
        RecorderState {
            reals: vec![("approach_motion", motions), ("path_motion", paths)],
            integers: vec![
                ("approach", rows),
                ("after", after.concat()),
                ("sitting", sitting),
                ("free_flow", self.profile.counts.concat()),
            ],
            progress: serde_json::to_string(&progress).expect("plain numbers can be written"),
        }
    }

    /// Goes on from `state`; everything that this recorder has seen is forgotten.
    ///
    /// # Errors
    /// When the state is not that of a recorder of this gate.
    pub fn restore(&mut self, state: &RecorderState) -> Result<(), String> {
        let progress: Progress =
            serde_json::from_str(&state.progress).map_err(|error| format!("the recorder's progress: {error}"))?;
        let (rows, motions) = (state.integer("approach")?, state.real("approach_motion")?);
        if rows.len() % APPROACH != 0 || motions.len() != rows.len() / APPROACH * (MOTION + 1) {
            return Err(missing("approach_motion"));
        }
        let mut path_numbers = state.real("path_motion")?;
        let mut before = super::IdMap::default();
        for (row, motion) in rows.chunks_exact(APPROACH).zip(motions.chunks_exact(MOTION + 1)) {
            let length = (row[3] as usize).checked_mul(MOTION).ok_or_else(|| missing("path_motion"))?;
            let (own, rest) = path_numbers.split_at_checked(length).ok_or_else(|| missing("path_motion"))?;
            path_numbers = rest;
            let path = own.chunks_exact(MOTION).map(motion_of).collect();
            let (distance, motion) = (motion[0], motion_of(&motion[1..]));
            let approach = Approach { step: row[1], distance, motion, path, path_start: row[2] };
            before.insert(ParticleId(row[0]), approach);
        }
        let (after, free_flow) = (state.integer("after")?, state.integer("free_flow")?);
        if after.len() % 2 != 0 || free_flow.len() != 2 * self.profile.counts.len() || !path_numbers.is_empty() {
            return Err(missing("after or free_flow or path_motion"));
        }
        self.sitting = state.integer("sitting")?.iter().map(|&id| (ParticleId(id), ())).collect();
        self.after = after.chunks_exact(2).map(|row| (ParticleId(row[0]), Gone { returned: row[1] != 0 })).collect();
        self.profile.counts = free_flow.chunks_exact(2).map(|row| [row[0], row[1]]).collect();
        self.before = before;
        self.fresh.clear();
        (self.looked, self.tally) = (progress.looked, progress.tally);
        Ok(())
    }
}

fn numbers(motion: &Motion) -> [f64; MOTION] {
    let vectors = [motion.position, motion.velocity, motion.spin, motion.acceleration, motion.spin_acceleration];
    std::array::from_fn(|index| vectors[index / 3][index % 3])
}

fn motion_of(numbers: &[f64]) -> Motion {
    let vector = |index: usize| vec3(numbers[3 * index], numbers[3 * index + 1], numbers[3 * index + 2]);
    Motion {
        position: vector(0),
        velocity: vector(1),
        spin: vector(2),
        acceleration: vector(3),
        spin_acceleration: vector(4),
    }
}
