//! Gates and stages of a scene: where the plant is cut, what a stage consists of, how a stream is replayed.

use super::EndConditions;
use super::backend::BackendName;
use crate::geometry::plane::GatePlane;
use crate::math::Vec3;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// A gate: the joint between two stages.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Gate {
    /// Name in the scene.
    pub name: String,
    /// Gate plane.
    pub plane: GatePlane,
    /// Which point of a particle must pass the plane.
    pub passage: PassingPoint,
    /// What becomes of a recorded particle in the upstream run.
    pub exclusion: Exclusion,
    /// Recorded paths; `None` where none are stored.
    pub paths: Option<PathRecording>,
    /// A recorded particle that comes back over the plane in the upstream run.
    pub returning: Fate,
    /// A particle beyond the plane that never passed it: it was there at the start, or came around the aperture.
    pub sitting: Fate,
}

/// The point of a particle whose passage counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PassingPoint {
    /// The centre.
    Centre,
    /// The lowest point: centre + radius times the direction of gravity.
    LowestPoint,
}

/// The upstream run after the gate.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Exclusion {
    /// How a recorded particle moves on.
    pub mode: ExclusionMode,
    /// Distance L1 of the exclusion plane behind the gate plane [m], at which it is taken out.
    pub length: f64,
}

/// Motion of a recorded particle up to the exclusion plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ExclusionMode {
    /// A ghost at constant velocity and spin: it acts and is not acted upon (patent JP5440448B2).
    Constant,
    /// A ghost in free fall.
    Ballistic,
    /// An ordinary particle: nothing is frozen.
    Buffer,
}

/// How paths before the gate are stored.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PathRecording {
    /// Time steps between two stored states; 1 is exact.
    pub every: u64,
    /// Distance before the gate plane from which on the path is stored [m].
    pub length: f64,
}

/// What is done with a particle that leaves the ordinary course.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fate {
    /// It stays; it is counted.
    Keep,
    /// It is taken out; it is counted.
    Delete,
    /// The run ends with an error.
    Error,
}

/// A stage as the scene gives it, or as the gate planes imply it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StageOutline {
    /// Name.
    pub name: String,
    /// Indices into the scene's parts; `None` where the planes decide.
    pub parts: Option<Vec<usize>>,
    /// Indices into the scene's feeds; `None` where the planes decide.
    pub feeds: Option<Vec<usize>>,
    /// Gates through which particles leave the stage, as indices into the scene's gates.
    pub records: Vec<usize>,
    /// Streams that enter the stage.
    pub replays: Vec<Replay>,
    /// When it ends; `None` for the scene's conditions, and once it is empty where particles leave through a gate.
    pub end: Option<EndConditions>,
    /// Who computes it; `None` for whoever computes the scene.
    pub backend: Option<BackendName>,
}

/// A stream that enters a stage, and how.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Replay {
    /// Where the stream comes from.
    pub source: StreamSource,
    /// How a particle moves before its passage.
    pub path: PathMode,
    /// Distance L2 of the generation plane before the calculation plane [m].
    pub length: f64,
    /// What the stream's times count from.
    pub clock: Clock,
    /// Whether passages or creations happen at the stored times.
    pub timing: Timing,
    /// Passages outside of these plant times of the stream are left out [s]; the upper one is infinite where none is given.
    pub window: [f64; 2],
    /// How often the stream is replayed.
    pub loops: u64,
    /// Time between the last passage of one loop and the first of the next [s].
    pub gap: f64,
    /// From storage plane to calculation plane.
    pub transform: Transform,
    /// A particle that goes back upstream beyond the generation plane.
    pub leaving: Fate,
    /// What is done when the downstream backs up to the gate.
    pub backing_up: BackingUp,
    /// Largest distance of a compliant ghost from its recorded path [m].
    pub compliance: f64,
}

/// Where a stream comes from.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub enum StreamSource {
    /// A gate of the same scene, as an index into its gates.
    Gate(usize),
    /// A stored stream.
    Folder(PathBuf),
}

/// Motion of a ghost before its passage.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PathMode {
    /// Constant velocity and spin (patent JP5440448B2).
    Constant,
    /// Free fall.
    Ballistic,
    /// The path it took upstream.
    Recorded,
    /// Bound to the path it took upstream by a spring, and acted upon.
    Compliant,
}

/// What the times of a replay count from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Clock {
    /// Plant time.
    Plant,
    /// The stream's first passage happens at time 0, shifted by whole time steps.
    FirstPassage,
}

/// What happens at the stored times.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Timing {
    /// The passage of the calculation plane.
    Arrival,
    /// The creation at the generation plane (the base procedure of patent JP5440448B2).
    Creation,
}

/// What is done when residents just beyond the gate rest or cannot yield.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BackingUp {
    /// The run ends.
    Stop,
    /// The run goes on; the summary says so.
    Warn,
}

/// Moves a stream: mirrored first, then rotated, then moved.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Transform {
    /// Mirror plane: a point [m] and its unit normal.
    pub mirror: Option<(Vec3, Vec3)>,
    /// Rotation: unit axis, angle [rad], a point of the axis [m].
    pub rotation: Option<(Vec3, f64, Vec3)>,
    /// Translation [m].
    pub translation: Vec3,
}

impl Transform {
    /// Leaves everything where it is.
    pub const IDENTITY: Self = Self { mirror: None, rotation: None, translation: Vec3::new(0.0, 0.0, 0.0) };

    /// True where nothing changes, not by a bit.
    #[must_use]
    pub fn is_identity(&self) -> bool {
        *self == Self::IDENTITY
    }
}
