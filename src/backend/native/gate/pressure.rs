//! What ghosts do to the particles beyond the gate.

use crate::dem::simulation::Simulation;
use crate::gate::quality::{BackedUp, BackingUpState, BackingUpWatch, GateLook, GhostContact, OverlapFigures};
use crate::geometry::plane::GatePlane;
use serde::{Deserialize, Serialize};

/// Contacts between ghosts and residents at one gate, looked at now and then.
#[derive(Debug)]
pub struct Pressure {
    watch: BackingUpWatch,
    plane: GatePlane,
    diameter: f64,
    overlaps: OverlapFigures,
    backed_up: Option<BackedUp>,
}

/// What a checkpoint keeps.
#[derive(Debug, Serialize, Deserialize)]
pub struct PressureState {
    watch: BackingUpState,
    overlaps: OverlapFigures,
    backed_up: Option<BackedUp>,
}

impl Pressure {
    /// For the calculation plane of a gate, particles up to `diameter` [m], and the largest overlap over the radius at the
    /// crossings upstream [-].
    pub fn new(gate: &str, plane: GatePlane, diameter: f64, gravity: f64, upstream_overlap: f64) -> Self {
        let watch = BackingUpWatch::new(gate, diameter, gravity, upstream_overlap);
        Self { watch, plane, diameter, overlaps: OverlapFigures::default(), backed_up: None }
    }

    pub fn state(&self) -> PressureState {
        let (watch, overlaps, backed_up) = (self.watch.state(), self.overlaps, self.backed_up.clone());
        PressureState { watch, overlaps, backed_up }
    }

    pub fn restore(&mut self, state: PressureState) {
        self.watch.restore(state.watch);
        (self.overlaps, self.backed_up) = (state.overlaps, state.backed_up);
    }

    /// Looks at the gate; says so the first time that the downstream is found to back up.
    pub fn look(&mut self, simulation: &Simulation) -> Option<&BackedUp> {
        let normal = self.plane.normal;
        let (mut near, mut speed) = (0_usize, 0.0);
        for view in simulation.views().filter(|view| view.path.is_prescribed()) {
            let distance = self.plane.distance(&view.position);
            if (-self.diameter..=0.0).contains(&distance) && self.plane.holds(&view.position) {
                near += 1;
                speed += view.velocity.dot(&normal);
            }
        }
        if near == 0 {
            return None;
        }
        let contacts: Vec<GhostContact> = simulation
            .ghost_pressure()
            .iter()
            .filter(|contact| self.plane.holds(&contact.point))
            .map(|contact| GhostContact {
                ghost: contact.ghost,
                resident: contact.resident,
                overlap: contact.overlap_ratio * contact.smaller_radius,
                smaller_radius: contact.smaller_radius,
                ghost_speed: contact.ghost_velocity.dot(&normal),
                resident_speed: contact.resident_velocity.dot(&normal),
                place: contact.point,
            })
            .collect();
        let time = simulation.time();
        self.overlaps.add(time, &contacts);
        let look = GateLook { time, near, mean_speed: speed / near as f64, contacts: &contacts };
        self.backed_up = Some(self.watch.look(&look)?);
        self.backed_up.as_ref()
    }

    /// What has been seen: overlaps, and whether the downstream backed up.
    pub fn finish(self) -> (OverlapFigures, Option<BackedUp>) {
        (self.overlaps, self.backed_up)
    }
}
