//! Who belongs where: the stages' parts and feeds, as the scene names them or as the gate planes decide, and the order that
//! the gates give them.

use super::gate::{Gate, StageOutline, StreamSource};
use super::{Scene, extent, reach};
use crate::dem::feed::{Face, Feed, FeedKind, Region};
use crate::geometry::part::Part;
use crate::geometry::plane::GatePlane;
use crate::math::{Bounds, Vec3};

/// Stages, gates and what lies around them.
#[derive(Debug)]
pub struct Layout<'a> {
    /// The gates.
    pub gates: Vec<&'a Gate>,
    /// The stages.
    pub stages: Vec<&'a StageOutline>,
    /// The parts.
    pub parts: Vec<&'a Part>,
    /// The feeds.
    pub feeds: Vec<&'a Feed>,
    /// Largest diameter of any particle [m].
    pub largest: f64,
    /// Plant time up to which motions are followed [s].
    pub end: f64,
}

/// A plane at a border of a stage, and the length of the zone there [m].
type Border = (GatePlane, f64);

impl<'a> Layout<'a> {
    /// The layout of a scene.
    #[must_use]
    pub fn of(scene: &'a Scene) -> Self {
        let ends = scene.stages.iter().filter_map(|stage| stage.end).map(|end| end.time);
        Self {
            gates: scene.gates.iter().collect(),
            stages: scene.stages.iter().collect(),
            parts: scene.parts.iter().collect(),
            feeds: scene.feeds.iter().collect(),
            largest: scene.largest_diameter(),
            end: ends.fold(scene.end.time, f64::max),
        }
    }

    /// The stages that record a gate.
    pub fn recorders(&self, gate: usize) -> impl Iterator<Item = usize> + '_ {
        (0..self.stages.len()).filter(move |stage| self.stages[*stage].records.contains(&gate))
    }

    /// The stages that replay a gate.
    pub fn replayers(&self, gate: usize) -> impl Iterator<Item = usize> + '_ {
        let replays = move |stage: &usize| {
            self.stages[*stage].replays.iter().any(|replay| replay.source == StreamSource::Gate(gate))
        };
        (0..self.stages.len()).filter(replays)
    }

    /// The stages whose streams enter a stage, ascending, each once.
    #[must_use]
    pub fn parents(&self, stage: usize) -> Vec<usize> {
        let sources = self.stages[stage].replays.iter().filter_map(|replay| match replay.source {
            StreamSource::Gate(gate) => Some(gate),
            StreamSource::Folder(_) => None,
        });
        let mut parents: Vec<usize> = sources.flat_map(|gate| self.recorders(gate)).collect();
        parents.sort_unstable();
        parents.dedup();
        parents
    }

    /// Everything upstream of a stage, ascending; the stage itself only where the stages form a cycle.
    #[must_use]
    pub fn ancestors(&self, stage: usize) -> Vec<usize> {
        let mut found = vec![false; self.stages.len()];
        let mut waiting = self.parents(stage);
        while let Some(next) = waiting.pop() {
            if !found[next] {
                found[next] = true;
                waiting.extend(self.parents(next));
            }
        }
        (0..found.len()).filter(|stage| found[*stage]).collect()
    }

    /// The calculation planes through which streams enter a stage, with their L2; of a stored stream the plane is not known.
    #[must_use]
    pub fn entering(&self, stage: usize) -> Vec<Border> {
        let replays = self.stages[stage].replays.iter();
        replays
            .filter_map(|replay| match replay.source {
                StreamSource::Gate(gate) => Some((replay.transform.plane(&self.gates.get(gate)?.plane), replay.length)),
                StreamSource::Folder(_) => None,
            })
            .collect()
    }

    /// The gate planes through which particles leave a stage, with their L1.
    #[must_use]
    pub fn leaving(&self, stage: usize) -> Vec<Border> {
        let gates = self.stages[stage].records.iter().filter_map(|gate| self.gates.get(*gate));
        gates.map(|gate| (gate.plane, gate.exclusion.length)).collect()
    }

    /// For each part, whether a stage has it: as the stage names its parts, or else where it reaches behind every entering
    /// plane (s >= -(L2 + d)) and before every leaving one (s <= L1 + d). Unbounded surfaces are everywhere.
    #[must_use]
    pub fn parts_of(&self, stage: usize) -> Vec<bool> {
        if let Some(named) = &self.stages[stage].parts {
            return (0..self.parts.len()).map(|part| named.contains(&part)).collect();
        }
        let (entering, leaving) = (self.entering(stage), self.leaving(stage));
        let reaches = |part: &&Part| {
            let behind = |(plane, length): &Border| {
                reach::along(part, plane, self.end).is_none_or(|(_, high)| high >= -(length + self.largest))
            };
            let before = |(plane, length): &Border| {
                reach::along(part, plane, self.end).is_none_or(|(low, _)| low <= length + self.largest)
            };
            entering.iter().all(behind) && leaving.iter().all(before)
        };
        self.parts.iter().map(reaches).collect()
    }

    /// The feeds of a stage, ascending: those that it names; where it names none, those that no stage names and whose centre
    /// lies on its side of every plane.
    #[must_use]
    pub fn feeds_of(&self, stage: usize) -> Vec<usize> {
        if let Some(named) = &self.stages[stage].feeds {
            let mut named = named.clone();
            named.sort_unstable();
            return named;
        }
        let taken = |feed: &usize| self.is_named(*feed);
        let (entering, leaving) = (self.entering(stage), self.leaving(stage));
        let is_here = |feed: &usize| {
            let Some(centre) = centre(&self.feeds[*feed].kind) else { return false };
            entering.iter().all(|(plane, _)| plane.distance(&centre) >= 0.0)
                && leaving.iter().all(|(plane, _)| plane.distance(&centre) < 0.0)
        };
        (0..self.feeds.len()).filter(|feed| !taken(feed) && is_here(feed)).collect()
    }

    /// True where a stage names the feed.
    #[must_use]
    pub fn is_named(&self, feed: usize) -> bool {
        self.stages.iter().any(|stage| stage.feeds.as_ref().is_some_and(|feeds| feeds.contains(&feed)))
    }
}

/// Where a feed is: the centre of its region, face or particles [m]; `None` for one that brings nothing.
fn centre(kind: &FeedKind) -> Option<Vec3> {
    let middle = |bounds: Bounds| (Vec3::from(bounds.minimum) + Vec3::from(bounds.maximum)) / 2.0;
    Some(match kind {
        FeedKind::Fill { region: Region::Cylinder { start, end, .. }, .. } => (start + end) / 2.0,
        FeedKind::Stream { face: Face::Disc { centre, .. } | Face::Rectangle { centre, .. }, .. } => *centre,
        FeedKind::File { particles } if particles.is_empty() => return None,
        FeedKind::File { particles } => {
            let sum: Vec3 = particles.iter().map(|particle| particle.position).sum();
            sum / particles.len() as f64
        }
        other => middle(extent::of_feed(other)),
    })
}
