//! All feeds of a run: asked every step whether anything is due, and for the particles when it is.

use super::draw::FeedKey;
use super::fill::{Fill, FillProgress};
use super::fresh::FreshParticles;
use super::queue::{Exact, Queue, QueueProgress, Site};
use super::report::{FeedReport, Shortfall};
use super::stream::{Stream, StreamProgress};
use super::{Amount, Feed, FeedKind};
use crate::math::Vec3;
use crate::particle::{Body, ParticleClass, ParticleState};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// What a feed asks the solver: where there is room.
pub trait Occupancy {
    /// True where a body of `radius` [m] at `centre` [m] would touch no particle and no wall.
    fn is_free(&self, centre: &Vec3, radius: f64) -> bool;
}

/// All feeds of a run.
#[derive(Debug, Clone)]
pub struct FeedRunner {
    feeds: Vec<Source>,
    body: Body,
    /// Plant time of the last step at which a feed was due [s].
    last_time: f64,
}

/// Everything that a feed runner needs to continue as if it had not stopped.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FeedRunnerState {
    last_time: Exact,
    feeds: Vec<Progress>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
enum Progress {
    Fill { queue: QueueProgress, fill: FillProgress },
    Stream { queue: QueueProgress, stream: StreamProgress },
    File { inserted: bool },
}

#[derive(Debug, Clone)]
enum Source {
    Fill(Fill),
    Stream(Stream),
    File { name: String, particles: Arc<[ParticleState]>, inserted: bool },
}

impl FeedRunner {
    /// All `feeds` of a scene, none of which has begun. `densities` [kg/m3] by material.
    ///
    /// # Panics
    /// Where a feed's class has no density: the scene's checks refuse such a scene.
    #[must_use]
    pub fn new(feeds: &[Feed], classes: &[ParticleClass], densities: &[Option<f64>], body: Body, seed: u64) -> Self {
        let queue = |number: u32, class: usize, velocity: Vec3| {
            let class = &classes[class];
            let density = densities[usize::from(class.material)]
                .unwrap_or_else(|| panic!("the material of particle class '{}' has no density", class.name));
            Queue::new(FeedKey::new(seed, number), class, density, body, velocity)
        };
        let source = |(number, feed): (u32, &Feed)| {
            let name = feed.name.clone();
            match &feed.kind {
                FeedKind::Fill { class, velocity, .. } => {
                    Fill::new(name, &feed.kind, queue(number, *class, *velocity)).map(Source::Fill)
                }
                FeedKind::Stream { class, velocity, .. } => {
                    Stream::new(name, &feed.kind, queue(number, *class, *velocity)).map(Source::Stream)
                }
                FeedKind::File { particles } => {
                    Some(Source::File { name, particles: Arc::clone(particles), inserted: false })
                }
            }
        };
        Self { feeds: (0..).zip(feeds).filter_map(source).collect(), body, last_time: f64::NEG_INFINITY }
    }

    /// Whether a feed wants to insert at plant time `time` [s]; cheap enough to be asked at every step.
    #[must_use]
    pub fn due(&self, time: f64) -> bool {
        self.feeds.iter().any(|feed| feed.is_due(time))
    }

    /// The new particles at plant time `time` [s], in the order of their feeds' attempts. They overlap neither each
    /// other nor what `occupancy` knows of; only particles from files come as they are.
    pub fn insert(&mut self, time: f64, occupancy: &dyn Occupancy) -> Vec<ParticleState> {
        let mut site = Site { occupancy, fresh: FreshParticles::new(), inserted: Vec::new() };
        self.last_time = time;
        // files first: their places are given, the other feeds look for theirs around them
        for feed in &mut self.feeds {
            if let Source::File { particles, inserted, .. } = feed
                && !std::mem::replace(inserted, true)
            {
                for particle in particles.iter() {
                    site.fresh.add(particle.position, particle.radius);
                    site.inserted.push(*particle);
                }
            }
        }
        for feed in &mut self.feeds {
            if feed.is_due(time) {
                feed.insert(time, &mut site);
            }
        }
        site.inserted
    }

    /// True once nothing more will come from any feed: the amounts are reached, or their time is over.
    #[must_use]
    pub fn finished(&self, time: f64) -> bool {
        self.feeds.iter().all(|feed| match feed {
            Source::Fill(fill) => fill.is_finished(),
            Source::Stream(stream) => stream.is_finished(),
            Source::File { inserted, .. } => *inserted,
        }) && !self.due(time)
    }

    /// Asked against inserted, for each feed in the scene's order.
    #[must_use]
    pub fn reports(&self) -> Vec<FeedReport> {
        self.feeds.iter().map(|feed| self.report(feed)).collect()
    }

    fn report(&self, feed: &Source) -> FeedReport {
        match feed {
            Source::Fill(fill) => fill.report(),
            Source::Stream(stream) => stream.report(self.last_time),
            Source::File { name, particles, inserted } => {
                let asked = Amount::Count(particles.len() as u64);
                let mass: f64 =
                    particles.iter().map(|particle| self.body.mass(particle.radius, particle.density)).sum();
                let cause = || "the run has not begun: the file is read in at its first step".to_owned();
                FeedReport {
                    name: name.clone(),
                    asked,
                    inserted_count: if *inserted { particles.len() as u64 } else { 0 },
                    inserted_mass: if *inserted { mass } else { 0.0 },
                    grading: Vec::new(),
                    shortfall: (!inserted).then(|| Shortfall { missing: asked, cause: cause() }),
                }
            }
        }
    }

    /// What a checkpoint keeps.
    #[must_use]
    pub fn state(&self) -> FeedRunnerState {
        let progress = |feed: &Source| match feed {
            Source::Fill(fill) => Progress::Fill { queue: fill.queue().progress.clone(), fill: fill.progress.clone() },
            Source::Stream(stream) => {
                Progress::Stream { queue: stream.queue().progress.clone(), stream: stream.progress.clone() }
            }
            Source::File { inserted, .. } => Progress::File { inserted: *inserted },
        };
        FeedRunnerState { last_time: Exact(self.last_time), feeds: self.feeds.iter().map(progress).collect() }
    }

    /// Whether `state` was taken from feeds of the same number and kinds.
    #[must_use]
    pub fn fits(&self, state: &FeedRunnerState) -> bool {
        let same = |(feed, progress): (&Source, &Progress)| {
            matches!(
                (feed, progress),
                (Source::Fill(_), Progress::Fill { .. })
                    | (Source::Stream(_), Progress::Stream { .. })
                    | (Source::File { .. }, Progress::File { .. })
            )
        };
        self.feeds.len() == state.feeds.len() && self.feeds.iter().zip(&state.feeds).all(same)
    }

    /// Continues from `state`, which was taken from the same feeds; a feed it does not fit begins anew.
    pub fn restore(&mut self, state: FeedRunnerState) {
        self.last_time = state.last_time.0;
        for (feed, progress) in self.feeds.iter_mut().zip(state.feeds) {
            match (feed, progress) {
                (Source::Fill(own), Progress::Fill { queue, fill }) => {
                    own.queue_mut().progress = queue;
                    own.progress = fill;
                }
                (Source::Stream(own), Progress::Stream { queue, stream }) => {
                    own.queue_mut().progress = queue;
                    own.progress = stream;
                }
                (Source::File { inserted, .. }, Progress::File { inserted: before }) => *inserted = before,
                _ => {}
            }
        }
    }
}

impl Source {
    fn is_due(&self, time: f64) -> bool {
        match self {
            Self::Fill(fill) => fill.next_time() <= time,
            Self::Stream(stream) => stream.is_due(time),
            Self::File { inserted, .. } => !inserted,
        }
    }

    fn insert(&mut self, time: f64, site: &mut Site) {
        match self {
            Self::Fill(fill) => fill.insert(time, site),
            Self::Stream(stream) => stream.insert(time, site),
            Self::File { .. } => {}
        }
    }
}

#[cfg(test)]
mod tests;
