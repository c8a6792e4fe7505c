//! Gates of a native run: after every time step, particles arrive, and particles that pass are recorded.
//!
//! Arrivals come first: a particle released at a step is an ordinary particle of that step when recorders look.

mod accounts;
mod arrivals;
mod pressure;
mod recording;

use crate::backend::BackendError;
use crate::backend::stage::{GateResults, Kick, StageRequest};
use crate::dem::simulation::Simulation;
use crate::dem::watchdog::{Stop, StopCause};
use crate::gate::stream::format::StoredEvent;
use crate::math::Vec3;
use crate::scene::Scene;
use crate::storage::columns::{ColumnReader, ColumnWriter};
use arrivals::Arrivals;
use rand::seq::IndexedRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use recording::Recording;

/// Radii within which a ghost's contact counts as near a particle: four diameters, a squeezed layer's thickness.
const REACH: f64 = 8.0;

/// Everything that a run does at its gates.
#[derive(Debug)]
pub struct HandOver {
    arrivals: Vec<Arrivals>,
    recordings: Vec<Recording>,
    kick: Option<Kick>,
}

impl HandOver {
    /// The gates of a stage that begins, or goes on from a checkpoint (`held`).
    pub fn open(
        scene: &Scene,
        request: &StageRequest,
        simulation: &Simulation,
        held: Option<&ColumnReader>,
    ) -> Result<Self, BackendError> {
        let arrivals = request.replays.iter().map(|order| Arrivals::open(scene, order, simulation, held));
        let arrivals = arrivals.collect::<Result<_, _>>()?;
        let recordings = request.records.iter().map(|order| Recording::open(scene, order, request, simulation, held));
        let recordings = recordings.collect::<Result<_, _>>()?;
        Ok(Self { arrivals, recordings, kick: request.kick.filter(|_| held.is_none()) })
    }

    /// True where there is nothing to do.
    pub const fn is_idle(&self) -> bool {
        self.arrivals.is_empty() && self.recordings.is_empty() && self.kick.is_none()
    }

    /// Does what is due after a time step, and before the first one.
    pub fn look(&mut self, simulation: &mut Simulation) -> Result<(), BackendError> {
        if let Some(kick) = self.kick.filter(|_| simulation.particle_count() > 0) {
            displace_one(simulation, kick);
            self.kick = None;
        }
        if !self.arrivals.is_empty() {
            self.bring(simulation)?;
        }
        for recording in &mut self.recordings {
            recording.look(simulation)?;
        }
        Ok(())
    }

    fn bring(&mut self, simulation: &mut Simulation) -> Result<(), BackendError> {
        let step = simulation.steps_done();
        for arrivals in &mut self.arrivals {
            arrivals.insert_due(simulation, step)?;
        }
        if self.arrivals.iter().any(Arrivals::steers) {
            let arrivals = &self.arrivals;
            simulation.steer(|id| arrivals.iter().find_map(|arrivals| arrivals.motion(id, step)));
        }
        for arrivals in &mut self.arrivals {
            arrivals.release_due(simulation, step)?;
        }
        simulation.expect_arrivals(self.arrivals.iter().any(|arrivals| !arrivals.is_finished()));
        Ok(())
    }

    /// What the watchdog's stop has to do with ghosts: an overlap beyond its limit between a ghost and an ordinary particle, or
    /// between ordinary particles that ghosts press on.
    pub fn squeezed(&self, simulation: &Simulation, stop: &Stop) -> Option<BackendError> {
        if self.arrivals.is_empty() || stop.cause != StopCause::DeepOverlap {
            return None;
        }
        let limit = simulation.setup().overlap_limit;
        let contacts = simulation.ghost_pressure();
        let deepest = contacts.iter().max_by(|a, b| a.overlap_ratio.total_cmp(&b.overlap_ratio))?;
        let what = if deepest.overlap_ratio < limit {
            // Two ordinary particles: an affair of the gate only where ghosts press on what is about them.
            let place = simulation.views().find(|view| Some(view.id) == stop.particle)?;
            let reach = REACH * place.radius;
            let pressing = contacts.iter().filter(|contact| (contact.point - place.position).norm() < reach).count();
            if pressing == 0 {
                return None;
            }
            format!("{}, with {pressing} contacts of ghosts within {:.1} mm of it", stop.what, 1e3 * reach)
        } else {
            let (ghost, resident, place) = (deepest.ghost, deepest.resident, deepest.point);
            format!(
                "a ghost (particle {} of feed {}, {:.3} m/s) was driven {:.1} % of the smaller radius (limit {:.1} %) into particle {} of feed {} \
                 ({:.3} m/s) at ({:.6}, {:.6}, {:.6}) m",
                ghost.serial(),
                ghost.feed(),
                deepest.ghost_velocity.norm(),
                100.0 * deepest.overlap_ratio,
                100.0 * limit,
                resident.serial(),
                resident.feed(),
                deepest.resident_velocity.norm(),
                place.x,
                place.y,
                place.z,
            )
        };
        let what = format!(
            "{what}, {:.6} s: what arrives finds no room beyond the gate. either the downstream backs up to it, which a replay cannot \
             follow: put the gate farther upstream, or compute these stages together (run --whole); or ghosts follow a past that the \
             particles did not have: use path \"recorded\" or \"compliant\" and mode \"buffer\"",
            stop.time,
        );
        Some(BackendError::Gate { what, time: stop.time, steps: stop.step })
    }

    /// Puts the gates' state into a checkpoint.
    pub fn save(&self, simulation: &Simulation, writer: &mut ColumnWriter) {
        let step = simulation.steps_done();
        self.recordings.iter().for_each(|recording| recording.save(writer));
        self.arrivals.iter().for_each(|arrivals| arrivals.save(writer, step));
    }

    /// Finishes the streams of a run that came to its end by itself; of another one they stay unfinished.
    pub fn finish(self, simulation: &Simulation, ended: bool) -> Result<GateResults, BackendError> {
        // What happened to parts that this stage does not have may matter to the next one.
        let upstream: Vec<StoredEvent> = self.arrivals.iter().flat_map(Arrivals::events).cloned().collect();
        let recorded = self.recordings.into_iter().map(|recording| recording.finish(simulation, &upstream, ended));
        let recorded = recorded.collect::<Result<_, _>>()?;
        let replayed = self.arrivals.into_iter().map(Arrivals::finish);
        let replayed = replayed.collect::<Result<_, _>>()?;
        let (momentum, energy) = (accounts::momentum(simulation), accounts::energy(simulation));
        Ok(GateResults { recorded, replayed, momentum, energy })
    }
}

/// Moves one particle, drawn by number, by the kick's length into a drawn direction.
fn displace_one(simulation: &mut Simulation, kick: Kick) {
    let mut draw = ChaCha8Rng::seed_from_u64(simulation.setup().seed);
    draw.set_stream(kick.draw);
    let ids: Vec<_> = simulation.particles().iter().map(|particle| particle.id).collect();
    let direction = loop {
        let try_it = Vec3::from_fn(|_, _| draw.random_range(-1.0..1.0));
        let square: f64 = try_it.norm_squared();
        if (1e-3..1.0).contains(&square) {
            break try_it / square.sqrt();
        }
    };
    if let Some(id) = ids.choose(&mut draw) {
        simulation.displace(*id, simulation.setup().body.in_plane(&(direction * kick.length)));
    }
}
