//! What a scene's feeds bring, told in advance: the same draws as in a run of our own solver, without its particles.
//!
//! A run asks its feeds at every time step, and so does this. What they find in their way is known as far as it does not depend on
//! contacts: the parts, what enters at the same time step, and the particles of streams as they fall freely behind their face. At
//! time 0 that is everything, so fills and files bring exactly the particles of our own solver.

use crate::dem::feed::{Face, FeedKind, FeedReport, FeedRunner, Occupancy};
use crate::dem::presence::Presence;
use crate::dem::wall::Walls;
use crate::gate::crossing::Motion;
use crate::gate::ghost::advanced;
use crate::math::{Bounds, Vec3};
use crate::particle::ParticleState;
use crate::scene::Scene;

/// The feeds of a scene, asked step by step.
#[derive(Debug)]
pub struct FeedsInAdvance {
    runner: FeedRunner,
    presence: Presence,
    way: InTheWay,
    gravity: Vec3,
    timestep: f64,
    step: u64,
    /// Of each feed, whether it is a stream.
    streams: Vec<bool>,
    /// Beyond it no particle of a stream is in the way of later ones [m].
    near_faces: Bounds,
}

/// A particle that a feed brings at a time step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fed {
    /// The particle, as it is at its time step.
    pub state: ParticleState,
    /// True for one of a stream, which falls freely from then on.
    pub falls: bool,
}

#[derive(Debug)]
struct InTheWay {
    walls: Walls,
    /// Particles of streams, now.
    falling: Vec<ParticleState>,
}

impl Occupancy for InTheWay {
    fn is_free(&self, centre: &Vec3, radius: f64) -> bool {
        let apart = |other: &ParticleState| {
            let reach = radius + other.radius;
            (other.position - centre).norm_squared() >= reach * reach
        };
        self.falling.iter().all(apart) && self.touches(centre, radius).is_none()
    }
}

impl InTheWay {
    /// Name of a part that a sphere touches.
    fn touches(&self, centre: &Vec3, radius: f64) -> Option<&str> {
        let (mut near, mut points) = (Vec::new(), Vec::new());
        self.walls.candidates(centre, radius, &mut near);
        self.walls.contacts(&near, centre, radius, &mut points);
        points.first().and_then(|point| self.walls.part_names().nth(usize::from(point.part)))
    }
}

impl FeedsInAdvance {
    /// All feeds of a scene before time step 0 of `timestep` \[s\].
    #[must_use]
    pub fn new(scene: &Scene, timestep: f64) -> Self {
        let densities: Vec<Option<f64>> = scene.materials.materials.iter().map(|material| material.density).collect();
        let runner = FeedRunner::new(&scene.feeds, &scene.classes, &densities, scene.body, scene.seed);
        let mut walls = Walls::new(&scene.parts);
        let presence = Presence::new(&scene.parts, &mut walls);
        let mut faces = Bounds::EMPTY;
        for feed in &scene.feeds {
            let FeedKind::Stream { face, .. } = &feed.kind else { continue };
            let (centre, half) = match face {
                Face::Disc { centre, radius, .. } => (centre, Vec3::from_element(*radius)),
                Face::Rectangle { centre, side_a, side_b } => (centre, (side_a.abs() + side_b.abs()) * 0.5),
            };
            faces.include(&(centre - half));
            faces.include(&(centre + half));
        }
        Self {
            runner,
            presence,
            way: InTheWay { walls, falling: Vec::new() },
            gravity: scene.body.in_plane(&scene.gravity),
            timestep,
            step: 0,
            streams: scene.feeds.iter().map(|feed| matches!(feed.kind, FeedKind::Stream { .. })).collect(),
            near_faces: faces.grown(2.0 * scene.largest_diameter()),
        }
    }

    /// What enters at the next time step, beginning with step 0.
    pub fn advance(&mut self) -> Vec<Fed> {
        let (step, time) = (self.step, self.step as f64 * self.timestep);
        self.step += 1;
        // Nobody knows when particles will be at rest: parts that wait for that stay as they are.
        let changed = self.presence.update(time, step, self.timestep, false, false, || f64::INFINITY);
        let due = self.runner.due(time);
        if due {
            self.way.walls.set_time(time);
        }
        let mut fed = if due { self.runner.insert(time, &self.way) } else { Vec::new() };
        // A run asks twice at its start: before its first state is looked at, and before its first time step.
        if step == 0 && self.runner.due(time) {
            self.way.falling.clone_from(&fed);
            fed.extend(self.runner.insert(time, &self.way));
            self.way.falling.clear();
        }
        // As in a run: first what is due enters, then parts appear and disappear.
        changed.iter().for_each(|event| self.way.walls.set_present(event.part, event.present));
        let falls = |state: &ParticleState| self.streams.get(state.id.feed() as usize).copied().unwrap_or(false);
        let fed: Vec<Fed> = fed.into_iter().map(|state| Fed { state, falls: falls(&state) }).collect();
        self.way.falling.extend(fed.iter().filter(|fed| fed.falls).map(|fed| fed.state));
        for state in &mut self.way.falling {
            *state = fallen(state, &self.gravity, self.timestep);
        }
        let near = self.near_faces;
        self.way.falling.retain(|state| near.contains(&state.position));
        fed
    }

    /// A particle `later` \[s\], if it touches nothing.
    #[must_use]
    pub fn fallen(&self, state: &ParticleState, later: f64) -> ParticleState {
        fallen(state, &self.gravity, later)
    }

    /// Name of a part that a sphere touches now.
    pub fn touches(&mut self, centre: &Vec3, radius: f64) -> Option<&str> {
        self.way.walls.set_time(self.step.saturating_sub(1) as f64 * self.timestep);
        self.way.touches(centre, radius)
    }

    /// True once nothing more will come.
    #[must_use]
    pub fn is_finished(&self) -> bool {
        self.step > 0 && self.runner.finished((self.step - 1) as f64 * self.timestep)
    }

    /// Asked against brought, for each feed in the scene's order.
    #[must_use]
    pub fn reports(&self) -> Vec<FeedReport> {
        self.runner.reports()
    }
}

/// A particle after a free fall of `later` \[s\].
fn fallen(state: &ParticleState, gravity: &Vec3, later: f64) -> ParticleState {
    let ParticleState { position, velocity, spin, .. } = *state;
    let motion = Motion { position, velocity, spin, acceleration: *gravity, spin_acceleration: Vec3::zeros() };
    let Motion { position, velocity, spin, .. } = advanced(&motion, later);
    ParticleState { position, velocity, spin, ..*state }
}
