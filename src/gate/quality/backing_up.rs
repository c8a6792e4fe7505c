//! Whether the downstream backs up to the gate.
//!
//! A replay goes one way: residents cannot hold back what comes. Where they pile up to the gate, the ghosts are driven into them, and
//! from then on no replay can be right. The sign of it: most contacts of the ghosts near the plane push into residents that
//! rest or go upstream, and it stays so while a particle would pass its own diameter.
//!
//! In a dense discharge that flows, ghosts and residents touch too, but both move: there the residents have the ghosts' speed.
//! Residents that can still escape sideways are no sign to the contrary: they move because the ghosts drive them. What tells is
//! that many ghosts at once are pressed into slower ones beyond all that was seen upstream.

use crate::math::Vec3;
use crate::particle::ParticleId;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// A resident slower than this share of the ghost that pushes it rests.
const RESTING: f64 = 0.1;
/// A resident slower than this share of the ghost yields too little if it is also pressed beyond all that was seen upstream.
const YIELDING: f64 = 0.5;
/// Overlaps this many times the largest one of the upstream's crossings, ...
const BEYOND_UPSTREAM: f64 = 3.0;
/// ... and this share of the radius, are pressed.
const PRESSED: f64 = 0.1;
/// Share of the contacts that must push, and of the ghosts near the plane.
const MOST_CONTACTS: f64 = 0.5;
const MANY_GHOSTS: f64 = 0.25;
/// Share of the ghosts near the plane that are pressed into residents which are slower, and their least number: many at once are
/// no squeeze of one that drifted. In dense discharges cut inside of the outlet there is none at most looks.
const PRESSED_GHOSTS: f64 = 0.2;
const FEWEST_PRESSED: usize = 3;
/// Ghosts below this share of sqrt(g d) creep: they say nothing about residents that rest.
const CREEPING: f64 = 0.02;

/// A contact between a ghost and a resident.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GhostContact {
    /// The ghost.
    pub ghost: ParticleId,
    /// The resident.
    pub resident: ParticleId,
    /// Overlap \[m\].
    pub overlap: f64,
    /// The smaller of the two radii \[m\].
    pub smaller_radius: f64,
    /// Speed of the ghost along the plane's normal \[m/s\].
    pub ghost_speed: f64,
    /// Speed of the resident along the plane's normal \[m/s\].
    pub resident_speed: f64,
    /// Contact point \[m\].
    pub place: Vec3,
}

/// What is seen at the gate at a look.
#[derive(Debug, Clone, Copy)]
pub struct GateLook<'a> {
    /// Plant time \[s\].
    pub time: f64,
    /// Number of ghosts within one largest diameter before the plane.
    pub near: usize,
    /// Their mean speed along the plane's normal \[m/s\]; not used where there is none.
    pub mean_speed: f64,
    /// All contacts between ghosts and residents.
    pub contacts: &'a [GhostContact],
}

/// What a watch has seen; part of a checkpoint.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct BackingUpState {
    /// Time for which it has looked blocked, less that for which it has not since \[s\].
    pub blocked: f64,
    /// Time of the last look \[s\].
    pub last: Option<f64>,
    /// Sum over looks of number of ghosts near the plane and of their speeds \[m/s\].
    pub speeds: (f64, f64),
    /// Largest overlap over the radius since it began to look blocked \[-\].
    pub deepest: f64,
    /// Whether it has been said.
    pub fired: bool,
}

/// Watches whether the downstream backs up to a gate.
#[derive(Debug, Clone, PartialEq)]
pub struct BackingUpWatch {
    gate: String,
    diameter: f64,
    creeping: f64,
    upstream_overlap: f64,
    state: BackingUpState,
}

/// The downstream backs up.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BackedUp {
    /// Plant time \[s\].
    pub time_s: f64,
    /// For how long \[s\].
    pub lasting_s: f64,
    /// Contacts that push into residents that rest, and all contacts at the last look.
    pub pushing: [usize; 2],
    /// Mean speed of the residents in these along the normal \[m/s\].
    pub resident_speed_m_s: f64,
    /// Mean speed of the ghosts in these along the normal \[m/s\].
    pub ghost_speed_m_s: f64,
    /// Largest overlap over the radius meanwhile \[-\].
    pub overlap_share: f64,
    /// The same with the gate's name, and what to do.
    pub words: String,
}

impl BackingUpWatch {
    /// For a gate by its name, particles up to `diameter` \[m\], the magnitude of gravity \[m/s2\], and the largest overlap over
    /// the radius at the crossings of the stream \[-\].
    #[must_use]
    pub fn new(gate: &str, diameter: f64, gravity: f64, upstream_overlap: f64) -> Self {
        let creeping = CREEPING * (gravity * diameter).sqrt();
        Self { gate: gate.to_owned(), diameter, creeping, upstream_overlap, state: BackingUpState::default() }
    }

    /// State for a checkpoint.
    #[must_use]
    pub const fn state(&self) -> BackingUpState {
        self.state
    }

    /// Goes on from a checkpoint.
    pub const fn restore(&mut self, state: BackingUpState) {
        self.state = state;
    }

    /// Looks at the gate; reports once.
    pub fn look(&mut self, look: &GateLook) -> Option<BackedUp> {
        let passed = self.state.last.replace(look.time).map_or(0.0, |last| look.time - last);
        if look.near > 0 {
            let near = look.near as f64;
            self.state.speeds.0 += near;
            self.state.speeds.1 += near * look.mean_speed;
        }
        let mut pushing: Vec<&GhostContact> = look.contacts.iter().filter(|contact| self.pushes(contact)).collect();
        let squeezing: Vec<&GhostContact> = look.contacts.iter().filter(|contact| self.squeezes(contact)).collect();
        let squeezed = is_squeezed(look, &squeezing);
        if squeezed {
            pushing = squeezing;
        }
        if squeezed || self.is_blocked(look, &pushing) {
            self.state.blocked += passed;
            let deepest = pushing.iter().map(|contact| contact.overlap / contact.smaller_radius).fold(0.0, f64::max);
            self.state.deepest = self.state.deepest.max(deepest);
        } else {
            // Contacts flicker: one look without them takes back no more than one with them brought.
            self.state.blocked = (self.state.blocked - passed).max(0.0);
            if self.state.blocked == 0.0 {
                self.state.deepest = 0.0;
            }
        }
        let (count, sum) = self.state.speeds;
        let speed = (sum / count.max(1.0)).max(self.creeping);
        let sustained = self.state.blocked * speed >= self.diameter && !pushing.is_empty();
        if self.state.fired || !sustained {
            return None;
        }
        self.state.fired = true;
        Some(self.report(look, &pushing))
    }

    fn is_pressed(&self, contact: &GhostContact) -> bool {
        let share = contact.overlap / contact.smaller_radius;
        share > PRESSED && share > BEYOND_UPSTREAM * self.upstream_overlap
    }

    fn pushes(&self, contact: &GhostContact) -> bool {
        let limit = if self.is_pressed(contact) { YIELDING } else { RESTING };
        contact.ghost_speed > self.creeping && contact.resident_speed < limit * contact.ghost_speed
    }

    fn squeezes(&self, contact: &GhostContact) -> bool {
        let slower = contact.ghost_speed > self.creeping && contact.resident_speed < contact.ghost_speed;
        slower && self.is_pressed(contact)
    }

    fn is_blocked(&self, look: &GateLook, pushing: &[&GhostContact]) -> bool {
        let ghosts: BTreeSet<ParticleId> = pushing.iter().map(|contact| contact.ghost).collect();
        !pushing.is_empty()
            && pushing.len() as f64 >= MOST_CONTACTS * look.contacts.len() as f64
            && ghosts.len() as f64 >= MANY_GHOSTS * look.near as f64
    }

    fn report(&self, look: &GateLook, pushing: &[&GhostContact]) -> BackedUp {
        let mean = |speed: fn(&GhostContact) -> f64| {
            pushing.iter().map(|contact| speed(contact)).sum::<f64>() / pushing.len() as f64
        };
        let (resident, ghost) = (mean(|contact| contact.resident_speed), mean(|contact| contact.ghost_speed));
        let (lasting, deepest) = (self.state.blocked, self.state.deepest);
        let words = format!(
            "the downstream backs up to gate {:?}: at {:.6} s, and for {lasting:.6} s now, ghosts are driven into particles just \
             beyond it that rest or cannot yield: {} of {} contacts, at {ghost:.3} m/s along the normal against {resident:.3} m/s, overlaps up to {:.1} % \
             of the radius ({:.1} % at the crossings upstream). what cannot flow off would hold back the upstream, which a replay \
             cannot know: put the gate farther upstream, compute these stages together (run --whole), or set `backing_up` to \
             \"warn\" to go on nevertheless",
            self.gate,
            look.time,
            pushing.len(),
            look.contacts.len(),
            100.0 * deepest,
            100.0 * self.upstream_overlap,
        );
        BackedUp {
            time_s: look.time,
            lasting_s: lasting,
            pushing: [pushing.len(), look.contacts.len()],
            resident_speed_m_s: resident,
            ghost_speed_m_s: ghost,
            overlap_share: deepest,
            words,
        }
    }
}

/// Whether many of the ghosts near the plane are among those of `squeezing`.
fn is_squeezed(look: &GateLook, squeezing: &[&GhostContact]) -> bool {
    let ghosts: BTreeSet<ParticleId> = squeezing.iter().map(|contact| contact.ghost).collect();
    ghosts.len() >= FEWEST_PRESSED && ghosts.len() as f64 >= PRESSED_GHOSTS * look.near as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::vec3;
    use proptest::test_runner::{RngAlgorithm, TestRng};
    use rand::Rng;

    const LOOK: f64 = 1.6e-4;
    const DIAMETER: f64 = 0.004;

    fn watch() -> BackingUpWatch {
        BackingUpWatch::new("outlet", DIAMETER, 9.81, 0.04)
    }

    fn contact(serial: u64, ghost_speed: f64, resident_speed: f64, share: f64) -> GhostContact {
        GhostContact {
            ghost: ParticleId::new(0, serial),
            resident: ParticleId::new(1, serial),
            overlap: share * 0.002,
            smaller_radius: 0.002,
            ghost_speed,
            resident_speed,
            place: vec3(0.0, 0.0, 0.2),
        }
    }

    /// Uniform numbers in [0, 1).
    fn uniform() -> impl FnMut() -> f64 {
        let mut source = TestRng::from_seed(RngAlgorithm::ChaCha, &[7; 32]);
        move || (source.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Looks at contacts made anew each time until it fires; the time then.
    fn fires(
        watch: &mut BackingUpWatch,
        near: usize,
        speed: f64,
        mut contacts: impl FnMut(usize) -> Vec<GhostContact>,
    ) -> Option<BackedUp> {
        (0..6000).find_map(|index| {
            let contacts = contacts(index);
            watch.look(&GateLook { time: index as f64 * LOOK, near, mean_speed: speed, contacts: &contacts })
        })
    }

    #[test]
    fn residents_that_rest_fire_it_after_a_diameter_s_time() {
        let resting = |_| (0..8).map(|serial| contact(serial, 0.4, 0.01, 0.05)).collect();
        let report = fires(&mut watch(), 12, 0.4, resting).unwrap();
        // 4 mm at 0.4 m/s, and one look to begin with.
        assert!((report.time_s - DIAMETER / 0.4).abs() <= 1.01 * LOOK, "{}", report.time_s);
        assert_eq!(report.pushing, [8, 8]);
        for figure in ["gate \"outlet\"", "8 of 8 contacts", "0.400 m/s", "0.010 m/s", "5.0 % of the radius (4.0 %"] {
            assert!(report.words.contains(figure), "{figure} in {}", report.words);
        }
        let pushed_back = |_| (0..8).map(|serial| contact(serial, 0.4, -0.2, 0.01)).collect();
        assert!(fires(&mut watch(), 12, 0.4, pushed_back).is_some());
        let pressed = |_| (0..8).map(|serial| contact(serial, 0.4, 0.15, 0.3)).collect();
        assert!(fires(&mut watch(), 12, 0.4, pressed).is_some(), "they yield too little and are pressed");
    }

    #[test]
    fn flicker_does_not_hide_it() {
        let mut draw = uniform();
        // A third of the looks without any contact, single residents that happen to move.
        let flickering = |_| {
            let number = if draw() < 0.33 { 0 } else { 6 };
            (0..number).map(|serial| contact(serial, 0.4, if draw() < 0.2 { 0.3 } else { 0.0 }, 0.05)).collect()
        };
        let report = fires(&mut watch(), 12, 0.4, flickering).unwrap();
        assert!(report.time_s < 10.0 * DIAMETER / 0.4, "{}", report.time_s);
    }

    #[test]
    fn a_dense_discharge_does_not_fire_it() {
        let mut draw = uniform();
        // Contacts at every look; residents at the ghosts' speed give or take half of it, so that some rest by chance.
        let flowing = |_| {
            (0..15)
                .map(|serial| contact(serial, 0.3, 0.3 * (1.0 + 1.2 * (draw() - 0.5) * 1.7), 0.08 * draw()))
                .collect()
        };
        assert_eq!(fires(&mut watch(), 20, 0.3, flowing), None);
        // Isolated squeezes: one deep contact at a time that lasts, among many that flow.
        let squeezed = |_| {
            let mut contacts: Vec<GhostContact> = (1..10).map(|serial| contact(serial, 0.3, 0.29, 0.03)).collect();
            contacts.push(contact(0, 0.3, 0.0, 0.3));
            contacts
        };
        assert_eq!(fires(&mut watch(), 20, 0.3, squeezed), None);
    }

    #[test]
    fn a_free_jet_a_bouncing_grain_and_a_standing_flow_do_not_fire_it() {
        assert_eq!(fires(&mut watch(), 20, 0.6, |_| Vec::new()), None);
        // One that comes back from a chute stops a ghost for 2 ms every 30 ms.
        let bouncing = |index: usize| if index % 187 < 12 { vec![contact(1, 0.6, -0.3, 0.05)] } else { Vec::new() };
        assert_eq!(fires(&mut watch(), 3, 0.6, bouncing), None);
        // One grain that lies on the rim while others pass: few of the ghosts touch it.
        assert_eq!(fires(&mut watch(), 10, 0.6, |_| vec![contact(1, 0.6, 0.0, 0.05)]), None);
        // The upstream itself stands still: ghosts creep.
        assert_eq!(fires(&mut watch(), 20, 1e-4, |_| vec![contact(1, 1e-4, 0.0, 0.05); 10]), None);
    }

    #[test]
    fn it_is_said_once_and_a_restored_watch_goes_on() {
        let contacts: Vec<GhostContact> = (0..8).map(|serial| contact(serial, 0.4, 0.0, 0.05)).collect();
        let look = |index: usize| GateLook { time: index as f64 * LOOK, near: 8, mean_speed: 0.4, contacts: &contacts };
        let mut whole = watch();
        let reports: Vec<Option<BackedUp>> = (0..200).map(|index| whole.look(&look(index))).collect();
        assert_eq!(reports.iter().flatten().count(), 1);
        let mut first = watch();
        (0..40).for_each(|index| drop(first.look(&look(index))));
        let text = serde_json::to_string(&first.state()).unwrap();
        let mut second = watch();
        second.restore(serde_json::from_str(&text).unwrap());
        let rest: Vec<Option<BackedUp>> = (40..200).map(|index| second.look(&look(index))).collect();
        assert_eq!(rest, reports[40..]);
    }
}
