//! What the scene's feeds bring to a LIGGGHTS case, batch by batch: the draws of our own solver, made in advance.
//!
//! A fill or file enters at the batch at or after its start. A particle of a stream that is due between two batches enters at the
//! later one, moved on in free fall. What depends on how particles move in between cannot be told in advance and is refused.

use super::Schedule;
use crate::backend::BackendError;
use crate::backend::native::feeds::{Fed, FeedsInAdvance};
use crate::dem::feed::{FeedKind, FeedReport};
use crate::particle::ParticleState;
use crate::scene::Scene;

/// The feeds of a scene, asked batch by batch.
#[derive(Debug)]
pub struct BatchFeeds<'a> {
    scene: &'a Scene,
    schedule: Schedule,
    feeds: FeedsInAdvance,
    /// The next time step to be asked for.
    next: u64,
    /// Whether anything has been brought at an earlier time step.
    has_brought: bool,
    /// Fills that have not begun, as indices of feeds.
    fills: Vec<usize>,
}

impl<'a> BatchFeeds<'a> {
    /// The feeds before the first batch.
    #[must_use]
    pub fn new(scene: &'a Scene, schedule: Schedule) -> Self {
        let is_fill = |index: &usize| matches!(scene.feeds[*index].kind, FeedKind::Fill { .. });
        Self {
            scene,
            schedule,
            feeds: FeedsInAdvance::new(scene, schedule.timestep),
            next: 0,
            has_brought: false,
            fills: (0..scene.feeds.len()).filter(is_fill).collect(),
        }
    }

    /// What enters at the batch at time step `step`; `occupied` where particles have come from elsewhere, too.
    ///
    /// # Errors
    /// When that cannot be told in advance.
    pub fn batch(&mut self, step: u64, occupied: bool) -> Result<Vec<ParticleState>, BackendError> {
        let mut entering = Vec::new();
        while self.next <= step {
            if self.feeds.is_finished() {
                self.next = step + 1;
                break;
            }
            let (at, fed) = (self.next, self.feeds.advance());
            self.next += 1;
            self.look_at_fills(at)?;
            if let Some(late) = fed.iter().find(|fed| !fed.falls)
                && (self.has_brought || occupied)
            {
                return Err(self.crowded(late));
            }
            self.has_brought |= !fed.is_empty();
            let later = (step - at) as f64 * self.schedule.timestep;
            for Fed { state, falls } in fed {
                entering.push(if falls && later > 0.0 { self.moved_on(&state, later)? } else { state });
            }
        }
        Ok(entering)
    }

    fn moved_on(&mut self, state: &ParticleState, later: f64) -> Result<ParticleState, BackendError> {
        let moved = self.feeds.fallen(state, later);
        let every = self.schedule.cadence.hand_over;
        let part = self.feeds.touches(&moved.position, moved.radius).map(str::to_owned);
        match part {
            None => Ok(moved),
            Some(part) => Err(BackendError::Incapable(format!(
                "feed '{}': particle {} is due {:.3} ms before LIGGGHTS' next batch and would touch part '{part}' by then; set \
                 liggghts.batch_every lower than {every}, or move the feed's face away from the part",
                self.name(moved.id.feed() as usize),
                moved.id.serial(),
                1e3 * later
            ))),
        }
    }

    /// A fill that begins now and has to be repeated brings what depends on the particles' motion.
    fn look_at_fills(&mut self, step: u64) -> Result<(), BackendError> {
        let time = self.schedule.time(step);
        let end = self.schedule.time(self.schedule.steps);
        let (scene, feeds) = (self.scene, &self.feeds);
        let mut repeated = None;
        self.fills.retain(|&index| {
            let FeedKind::Fill { start, interval, until, .. } = scene.feeds[index].kind else { return false };
            if time < start {
                return true;
            }
            if start + interval <= until.min(end) && feeds.reports()[index].shortfall.is_some() {
                repeated = Some(index);
            }
            false
        });
        repeated.map_or(Ok(()), |index| {
            Err(BackendError::Incapable(format!(
                "feed '{}' does not bring its amount at once, and what it brings later depends on how the region empties, which \
                 LIGGGHTS does not tell in advance; enlarge its region, lower its amount, or compute this stage with the native \
                 solver",
                self.name(index)
            )))
        })
    }

    fn crowded(&self, late: &Fed) -> BackendError {
        BackendError::Incapable(format!(
            "feed '{}' fills its region after other particles have entered, and nobody can tell in advance where these are by \
             then; let it begin at time 0, take a stream through a face instead, or compute this stage with the native solver",
            self.name(late.state.id.feed() as usize)
        ))
    }

    fn name(&self, feed: usize) -> &str {
        self.scene.feeds.get(feed).map_or("", |feed| feed.name.as_str())
    }

    /// Asked against brought up to the last batch, for each feed in the scene's order.
    #[must_use]
    pub fn reports(&self) -> Vec<FeedReport> {
        self.feeds.reports()
    }

    /// True once nothing more will come.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.feeds.is_finished()
    }
}
