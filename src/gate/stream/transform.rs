//! Moves crossings: mirrored first, then rotated, then moved.

use super::format::{Manifest, Origin, vector};
use super::reader::StreamReader;
use super::writer::{Closing, StreamWriter};
use crate::gate::crossing::{Crossing, Motion, Passage, StoredContact};
use crate::math::{Vec3, vec3};
use crate::particle::{Body, ParticleState};
use crate::scene::gate::Transform;
use crate::storage::StorageError;
use std::path::Path;

/// A transform, ready to be applied to many crossings: x' = R M (x) + t, with the mirror M and the rotation R.
///
/// Velocities, forces, normals and tangential memories are polar vectors, v' = R M v. Spins, torques and rolling memories are
/// axial ones, w' = det(M) R M w: a mirror turns the sense of rotation of what spins about a line in it.
#[derive(Debug, Clone, Copy)]
pub struct Placement {
    transform: Transform,
    identity: bool,
}

impl From<&Transform> for Placement {
    fn from(transform: &Transform) -> Self {
        let mirror = transform.mirror.map(|(point, normal)| (point, normal.normalize()));
        Self { transform: Transform { mirror, ..*transform }, identity: transform.is_identity() }
    }
}

impl Placement {
    /// A point [m].
    #[must_use]
    pub fn point(&self, point: &Vec3) -> Vec3 {
        if self.identity { *point } else { self.transform.point(*point) }
    }

    /// A polar vector: a velocity, an acceleration, a force, a displacement [any unit].
    #[must_use]
    pub fn polar(&self, vector: &Vec3) -> Vec3 {
        if self.identity { *vector } else { self.transform.direction(*vector) }
    }

    /// An axial vector: a spin, a torque [any unit].
    #[must_use]
    pub fn axial(&self, vector: &Vec3) -> Vec3 {
        let polar = self.polar(vector);
        if self.transform.mirror.is_some() { -polar } else { polar }
    }

    /// A motion of a path.
    #[must_use]
    pub fn motion(&self, motion: &Motion) -> Motion {
        Motion {
            position: self.point(&motion.position),
            velocity: self.polar(&motion.velocity),
            spin: self.axial(&motion.spin),
            acceleration: self.polar(&motion.acceleration),
            spin_acceleration: self.axial(&motion.spin_acceleration),
        }
    }

    /// A particle.
    #[must_use]
    pub fn state(&self, state: &ParticleState) -> ParticleState {
        ParticleState {
            position: self.point(&state.position),
            velocity: self.polar(&state.velocity),
            spin: self.axial(&state.spin),
            ..*state
        }
    }

    /// A contact.
    #[must_use]
    pub fn contact(&self, contact: &StoredContact) -> StoredContact {
        StoredContact {
            point: self.point(&contact.point),
            normal: self.polar(&contact.normal),
            normal_force: self.polar(&contact.normal_force),
            tangential_force: self.polar(&contact.tangential_force),
            tangential_memory: self.polar(&contact.tangential_memory),
            rolling_memory: self.axial(&contact.rolling_memory),
            ..*contact
        }
    }

    /// A whole crossing; not a bit changes where the transform is the identity.
    #[must_use]
    pub fn crossing(&self, crossing: &Crossing) -> Crossing {
        if self.identity {
            return crossing.clone();
        }
        let passage = &crossing.passage;
        Crossing {
            step: crossing.step,
            state: self.state(&crossing.state),
            force: self.polar(&crossing.force),
            torque: self.axial(&crossing.torque),
            passage: Passage {
                time: passage.time,
                position: self.point(&passage.position),
                velocity: self.polar(&passage.velocity),
                spin: self.axial(&passage.spin),
            },
            contacts: crossing.contacts.iter().map(|contact| self.contact(contact)).collect(),
            path: crossing.path.iter().map(|motion| self.motion(motion)).collect(),
            path_start: crossing.path_start,
        }
    }

    /// Why particles of this kind cannot be moved so, if they cannot.
    #[must_use]
    pub fn unfit_for(&self, body: Body) -> Option<&'static str> {
        let out_of_plane = || {
            let axis = self.polar(&vec3(0.0, 1.0, 0.0));
            let tilted = axis.x.hypot(axis.z) > PARALLEL;
            tilted
                || self.point(&Vec3::zeros()).y.abs() > PARALLEL
                || self.point(&vec3(1.0, 0.0, 1.0)).y.abs() > PARALLEL
        };
        (matches!(body, Body::Disc { .. }) && out_of_plane())
            .then_some("discs must stay in the plane y = 0: rotate about y, and do not move them along y")
    }
}

/// Sine of an angle, or length [m], that is round-off of a rotation.
const PARALLEL: f64 = 1e-12;

/// The origin of a stream that was moved. The gravity is moved with it, so that a replay sees whether it still fits.
#[must_use]
pub fn moved_origin(origin: &Origin, transform: &Transform) -> Origin {
    let placement = Placement::from(transform);
    Origin {
        plane: placement.transform.plane(&origin.plane),
        gravity: if transform.is_identity() { origin.gravity } else { placement.polar(&origin.gravity) },
        provenance: origin.provenance.iter().cloned().chain([words(transform)]).collect(),
        ..origin.clone()
    }
}

/// The transform in words.
#[must_use]
pub fn words(transform: &Transform) -> String {
    let mut steps = Vec::new();
    if let Some((point, normal)) = &transform.mirror {
        steps.push(format!("mirrored at the plane through {} m with normal {}", vector(point), vector(normal)));
    }
    if let Some((axis, angle, point)) = &transform.rotation {
        let (axis, point, degrees) = (vector(axis), vector(point), angle.to_degrees());
        steps.push(format!("rotated by {degrees} degrees about {axis} through {point} m"));
    }
    if transform.translation != Vec3::zeros() {
        steps.push(format!("moved by {} m", vector(&transform.translation)));
    }
    if steps.is_empty() { "left where it was".to_owned() } else { steps.join(", ") }
}

/// Writes the moved stream to the folder `out`, chunk by chunk; `progress` is told the chunks done.
///
/// # Errors
/// When the stream is unusable, its particles cannot be moved so, or the disk refuses.
pub fn transform_stream(
    reader: &StreamReader,
    transform: &Transform,
    out: &Path,
    mut progress: impl FnMut(usize),
) -> Result<Manifest, StorageError> {
    let placement = Placement::from(transform);
    let Manifest { origin, events, quality, .. } = reader.manifest();
    if let Some(reason) = placement.unfit_for(origin.body) {
        return Err(StorageError::unusable(reader.place(), reason));
    }
    let mut writer = StreamWriter::create(out, moved_origin(origin, transform))?;
    for index in 0..reader.chunk_count() {
        for crossing in reader.chunk(index)? {
            writer.push(placement.crossing(&crossing))?;
        }
        progress(index + 1);
    }
    writer.finish(Closing { events: events.clone(), quality: quality.clone() })
}

#[cfg(test)]
mod tests {
    use super::super::sample;
    use super::*;
    use approx::assert_relative_eq;
    use std::f64::consts::FRAC_PI_2;

    /// Round-off of a few products of numbers of order ten, some of which cancel.
    const ROUNDING: f64 = 1e-13;

    fn mirror() -> Transform {
        let normal = vec3(1.0, 2.0, -0.5).normalize();
        Transform { mirror: Some((vec3(0.1, 0.2, 0.3), normal)), ..Transform::IDENTITY }
    }

    fn whole() -> Transform {
        let axis = vec3(0.3, -1.0, 2.0).normalize();
        let rotation = Some((axis, 0.7, vec3(-0.2, 0.4, 0.0)));
        Transform { rotation, translation: vec3(1.0, -2.0, 0.5), ..mirror() }
    }

    /// Impact of a sphere of mass 1 and radius 1 on a fixed body that it sticks to while in contact: the impulse reverses the
    /// normal velocity by e and stops the slip of the contact point. J = -(1 + e) v_n n - 2/7 v_t.
    fn impact(velocity: &Vec3, spin: &Vec3, normal: &Vec3) -> (Vec3, Vec3) {
        let lever = *normal;
        let slip = velocity + spin.cross(&lever);
        let (along, across) = (normal * slip.dot(normal), slip - normal * slip.dot(normal));
        let impulse = along * -1.7 - across * (2.0 / 7.0);
        (velocity + impulse, spin + lever.cross(&impulse) / 0.4)
    }

    #[test]
    fn the_mirror_image_of_an_impact_is_the_impact_of_the_mirror_image() {
        let (velocity, spin) = (vec3(0.3, -1.2, 0.8), vec3(5.0, -3.0, 2.0));
        let normal = vec3(-0.4, 0.5, 1.0).normalize();
        for transform in [mirror(), whole(), Transform { mirror: None, ..whole() }] {
            let placement = Placement::from(&transform);
            let (after, after_spin) = impact(&velocity, &spin, &normal);
            let image = impact(&placement.polar(&velocity), &placement.axial(&spin), &placement.polar(&normal));
            assert_relative_eq!(image.0, placement.polar(&after), max_relative = ROUNDING);
            assert_relative_eq!(image.1, placement.axial(&after_spin), max_relative = ROUNDING);
        }
        // The sphere does not slip after the impact: a spin that is mirrored like a velocity would make it slip.
        let (after, after_spin) = impact(&velocity, &spin, &normal);
        let slip = after + after_spin.cross(&normal);
        assert_relative_eq!(slip - normal * slip.dot(&normal), Vec3::zeros(), epsilon = ROUNDING);
    }

    #[test]
    fn distances_and_the_mechanics_of_a_crossing_stay() {
        let before = sample::crossing(2);
        let transform = whole();
        let placement = Placement::from(&transform);
        let after = placement.crossing(&before);
        let lever = |crossing: &Crossing| crossing.contacts[1].point - crossing.state.position;
        let torque = |crossing: &Crossing| lever(crossing).cross(&crossing.contacts[1].tangential_force);
        // Torque = lever x force holds in the image for axial torques alone.
        assert_relative_eq!(torque(&after), placement.axial(&torque(&before)), max_relative = ROUNDING);
        // Power of torque on spin and of force on velocity are the same numbers.
        let power = |c: &Crossing| (c.force.dot(&c.state.velocity), c.torque.dot(&c.state.spin));
        assert_relative_eq!(power(&after).0, power(&before).0, max_relative = ROUNDING);
        assert_relative_eq!(power(&after).1, power(&before).1, max_relative = ROUNDING);
        let plane = sample::origin().plane;
        let moved = placement.transform.plane(&plane);
        for (old, new) in before.path.iter().zip(&after.path) {
            assert_relative_eq!(moved.distance(&new.position), plane.distance(&old.position), epsilon = ROUNDING);
            assert_relative_eq!(new.spin_acceleration, placement.axial(&old.spin_acceleration));
        }
        let rolling = after.contacts[1].rolling_memory;
        assert_relative_eq!(rolling, placement.axial(&before.contacts[1].rolling_memory));
        assert_relative_eq!(
            after.contacts[1].tangential_memory,
            placement.polar(&before.contacts[1].tangential_memory)
        );
        assert_eq!((after.step, after.path_start, after.state.id), (before.step, before.path_start, before.state.id));
    }

    #[test]
    fn a_quarter_turn_and_a_mirror_by_hand() {
        let quarter = Transform {
            rotation: Some((vec3(0.0, 0.0, 1.0), FRAC_PI_2, vec3(1.0, 0.0, 0.0))),
            translation: vec3(0.0, 0.0, 5.0),
            mirror: Some((vec3(0.0, 0.0, 1.0), vec3(0.0, 0.0, 1.0))),
        };
        let placement = Placement::from(&quarter);
        // z = 3 is mirrored to -1 and moved to 4; (2, 0) turns about (1, 0) to (1, 1).
        assert_relative_eq!(placement.point(&vec3(2.0, 0.0, 3.0)), vec3(1.0, 1.0, 4.0), epsilon = ROUNDING);
        // A mirror leaves the spin about its normal and reverses the others.
        assert_relative_eq!(placement.axial(&vec3(0.0, 0.0, 1.0)), vec3(0.0, 0.0, 1.0), epsilon = ROUNDING);
        assert_relative_eq!(placement.axial(&vec3(1.0, 0.0, 0.0)), vec3(0.0, -1.0, 0.0), epsilon = ROUNDING);
    }

    #[test]
    fn the_identity_changes_no_bit() {
        let placement = Placement::from(&Transform::IDENTITY);
        let mut crossing = sample::crossing(5);
        crossing.force.x = -0.0;
        let same = placement.crossing(&crossing);
        assert_eq!(same, crossing);
        assert!(same.force.x.is_sign_negative());
    }

    #[test]
    fn discs_stay_in_their_plane() {
        let disc = Body::Disc { thickness: 0.01 };
        let about = |axis| Transform { rotation: Some((axis, 0.5, vec3(1.0, 0.0, 2.0))), ..Transform::IDENTITY };
        let unfit = |transform: &Transform, body| Placement::from(transform).unfit_for(body).is_some();
        assert!(!unfit(&about(vec3(0.0, 1.0, 0.0)), disc) && unfit(&about(vec3(0.0, 0.0, 1.0)), disc));
        assert!(unfit(&Transform { translation: vec3(0.0, 0.1, 0.0), ..Transform::IDENTITY }, disc));
        assert!(!unfit(&whole(), Body::Sphere));
    }

    #[test]
    fn a_moved_stream_is_a_stream_and_says_what_was_done() {
        let folder = tempfile::tempdir().unwrap();
        let (place, out, back) = (folder.path().join("a"), folder.path().join("b"), folder.path().join("c"));
        let manifest = sample::write(&place, 50);
        let there = Transform { translation: vec3(0.5, 0.25, -2.0), ..Transform::IDENTITY };
        let reader = StreamReader::open(&place).unwrap();
        let moved = transform_stream(&reader, &there, &out, |_| {}).unwrap();
        assert_eq!(moved.origin.provenance, ["moved by (0.5, 0.25, -2) m"]);
        assert_eq!((moved.events, moved.counts), (manifest.events.clone(), manifest.counts));
        assert_ne!(moved.chunks[0].blake3, manifest.chunks[0].blake3);
        let reader = StreamReader::open(&out).unwrap();
        reader.verify(|_| {}).unwrap();
        let first = reader.crossings().next().unwrap().unwrap();
        assert_eq!(first, Placement::from(&there).crossing(&sample::crossing(0)));
        let mirrored = transform_stream(&reader, &mirror(), &back, |_| {}).unwrap();
        assert_eq!(mirrored.origin.provenance.len(), 2);
        let expected = Placement::from(&mirror()).polar(&manifest.origin.gravity);
        assert_eq!(mirrored.origin.gravity, expected);
    }
}
