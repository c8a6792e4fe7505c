//! Parts that appear and disappear, at a time or once the particles are at rest.

use super::wall::Walls;
use crate::geometry::part::{AtRest, Part, Trigger};
use serde::{Deserialize, Serialize};

/// A part appeared or disappeared.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PartEvent {
    /// Part.
    pub part: u16,
    /// Whether it is there from now on.
    pub present: bool,
    /// Plant time [s].
    pub time: f64,
}

/// Watches whether the particles are at rest. All times are whole steps, so that a resumed run decides alike.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RestWatch {
    /// Step since which the particles have been slow, as far as known.
    slow_since: Option<u64>,
}

/// How often within the hold time the speed is looked at.
const LOOKS_PER_HOLD: f64 = 20.0;

impl RestWatch {
    /// Nothing seen yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { slow_since: None }
    }

    /// True once the condition holds. `fed`: no feed brings any more; `speed` root-mean-square speed [m/s], asked only when due.
    pub fn holds(
        &mut self,
        condition: &AtRest,
        step: u64,
        timestep: f64,
        fed: bool,
        empty: bool,
        speed: impl Fn() -> f64,
    ) -> bool {
        let every = (condition.hold / timestep / LOOKS_PER_HOLD).floor().max(1.0) as u64;
        if !step.is_multiple_of(every) {
            return false;
        }
        let time = step as f64 * timestep;
        if !fed || empty || time < condition.not_before || speed() >= condition.speed {
            self.slow_since = None;
            return false;
        }
        let since = *self.slow_since.get_or_insert(step);
        (step - since) as f64 * timestep >= condition.hold
    }
}

impl Default for RestWatch {
    fn default() -> Self {
        Self::new()
    }
}

/// Which parts are there, and what may change that.
#[derive(Debug, Clone)]
pub struct Presence {
    parts: Vec<PartPresence>,
    events: Vec<PartEvent>,
}

#[derive(Debug, Clone)]
struct PartPresence {
    appears: Trigger,
    disappears: Trigger,
    state: PresenceState,
    watch: RestWatch,
}

impl PartPresence {
    /// What the part waits for now.
    const fn pending(&self) -> Option<Trigger> {
        match self.state {
            PresenceState::Awaited => Some(self.appears),
            PresenceState::Present => Some(self.disappears),
            PresenceState::Gone => None,
        }
    }
}

/// Where a part stands between appearing and disappearing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
enum PresenceState {
    Awaited,
    Present,
    Gone,
}

/// What a checkpoint keeps.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct PresenceRecord {
    parts: Vec<(PresenceState, RestWatch)>,
    events: Vec<PartEvent>,
}

impl Presence {
    /// Parts that are there before the start are present in `walls`, the others are not.
    #[must_use]
    pub fn new(parts: &[Part], walls: &mut Walls) -> Self {
        let parts: Vec<PartPresence> = parts
            .iter()
            .enumerate()
            .map(|(index, part)| {
                let there = part.appears == Trigger::Always;
                walls.set_present(index as u16, there);
                let state = if there { PresenceState::Present } else { PresenceState::Awaited };
                PartPresence { appears: part.appears, disappears: part.disappears, state, watch: RestWatch::new() }
            })
            .collect();
        Self { parts, events: Vec::new() }
    }

    /// What happened so far.
    #[must_use]
    pub fn events(&self) -> &[PartEvent] {
        &self.events
    }

    /// True while a part waits for the particles to come to rest.
    #[must_use]
    pub fn awaits_rest(&self) -> bool {
        self.parts.iter().any(|part| matches!(part.pending(), Some(Trigger::AtRest(_))))
    }

    /// Lets parts appear and disappear; returns the changes of this step.
    pub fn update(
        &mut self,
        time: f64,
        step: u64,
        timestep: f64,
        fed: bool,
        empty: bool,
        speed: impl Fn() -> f64,
    ) -> Vec<PartEvent> {
        let mut changes = Vec::new();
        for (index, part) in self.parts.iter_mut().enumerate() {
            let Some(trigger) = part.pending() else { continue };
            let fires = match trigger {
                Trigger::Always | Trigger::Never => false,
                Trigger::At { time: due } => time >= due,
                Trigger::AtRest(condition) => part.watch.holds(&condition, step, timestep, fed, empty, &speed),
            };
            if fires {
                let present = part.state == PresenceState::Awaited;
                part.state = if present { PresenceState::Present } else { PresenceState::Gone };
                part.watch = RestWatch::new();
                changes.push(PartEvent { part: index as u16, present, time });
            }
        }
        self.events.extend_from_slice(&changes);
        changes
    }

    /// What a checkpoint keeps.
    #[must_use]
    pub fn record(&self) -> PresenceRecord {
        let parts = self.parts.iter().map(|part| (part.state, part.watch)).collect();
        PresenceRecord { parts, events: self.events.clone() }
    }

    /// Continues from a checkpoint.
    pub fn restore(&mut self, record: PresenceRecord, walls: &mut Walls) {
        for (index, (part, (state, watch))) in self.parts.iter_mut().zip(record.parts).enumerate() {
            (part.state, part.watch) = (state, watch);
            walls.set_present(index as u16, state == PresenceState::Present);
        }
        self.events = record.events;
    }
}
