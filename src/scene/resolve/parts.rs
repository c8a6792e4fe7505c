//! `[[part]]`: surfaces, motions, presence.

use super::regions::{Placement, axis, corners, placement, stl};
use super::{Context, Located, PartDraft, trigger};
use crate::geometry::motion::{Motion, MotionKind, MotionTerm};
use crate::geometry::part::{Part, Surface, TriangleMesh, Trigger};
use crate::math::Vec3;
use crate::scene::diagnostics::Place;
use crate::scene::quantity::Dimension::{Angle, AngularVelocity, Frequency, Length, Time, Velocity};
use crate::scene::reader::{Limit, Reader};
use std::path::PathBuf;

#[derive(Clone, Copy)]
enum Shape {
    Plane,
    Box,
    Cylinder,
    Cone,
    Stl,
}

/// All parts, in the file's order.
pub(super) fn parts(
    reader: &Reader<'_>,
    context: &Context<'_>,
    names: &mut Vec<(&'static str, String, Place)>,
) -> Vec<Located<PartDraft>> {
    let mut parts = Vec::new();
    for table in reader.tables("part", "part") {
        let path = table.path();
        let place = table.place_of("name");
        let name = table.name();
        if let Some(name) = &name {
            names.push(("part", name.clone(), place));
        }
        if let Some(item) = part(table, name, context) {
            parts.push(Located { path, item });
        }
    }
    parts
}

fn part(reader: Reader<'_>, name: Option<String>, context: &Context<'_>) -> Option<PartDraft> {
    let material = reader.reference("material", "material", &context.materials);
    let shapes = [
        ("plane", Shape::Plane),
        ("box", Shape::Box),
        ("cylinder", Shape::Cylinder),
        ("cone", Shape::Cone),
        ("stl", Shape::Stl),
    ];
    let Some(shape) = reader.need_word("shape", &shapes) else {
        // Without its shape, no other key of the part can be judged.
        return None;
    };
    let surface = surface(&reader, shape, context);
    let motion = Motion { terms: reader.tables("motion", "part.motion").into_iter().filter_map(term).collect() };
    let appears = trigger(&reader, "appears", Trigger::Always);
    let disappears = trigger(&reader, "disappears", Trigger::Never);
    reader.finish();
    let (surface, file) = surface?;
    let part = Part { name: name?, material: u16::try_from(material?).ok()?, surface, motion, appears, disappears };
    Some(PartDraft { part, file })
}

fn surface(reader: &Reader<'_>, shape: Shape, context: &Context<'_>) -> Option<(Surface, Option<PathBuf>)> {
    let place = placement(reader);
    let surface = match shape {
        Shape::Plane => {
            let (point, normal) = (reader.need_vector("point", Length), reader.need_direction("normal"));
            Surface::Plane { point: place.point(point?), normal: place.direction(normal?) }
        }
        Shape::Box => {
            let (minimum, maximum) = (reader.need_vector("min", Length), reader.need_vector("max", Length));
            let (minimum, maximum) = corners(reader, minimum, maximum)?;
            Surface::Mesh(place.mesh(TriangleMesh::box_mesh(&minimum, &maximum)))
        }
        Shape::Cylinder => {
            let (start, end) = (reader.need_vector("start", Length), reader.need_vector("end", Length));
            let radius = reader.need_quantity("radius", Length, Limit::Positive);
            frustum(&place, axis(reader, start, end)?, radius?, radius?)
        }
        Shape::Cone => {
            let (start, end) = (reader.need_vector("start", Length), reader.need_vector("end", Length));
            let start_radius = reader.need_quantity("start_radius", Length, Limit::NotNegative);
            let end_radius = reader.need_quantity("end_radius", Length, Limit::NotNegative);
            let ends = axis(reader, start, end)?;
            let (start_radius, end_radius) = (start_radius?, end_radius?);
            if start_radius == 0.0 && end_radius == 0.0 {
                reader.report.error(
                    "out-of-range",
                    &reader.place_of("end_radius"),
                    "`end_radius` and `start_radius` cannot both be 0",
                    "a cone has at least one end that is open",
                );
                return None;
            }
            frustum(&place, ends, start_radius, end_radius)
        }
        Shape::Stl => {
            let (mesh, path) = stl(reader, context)?;
            return Some((Surface::Mesh(place.mesh(mesh)), Some(path)));
        }
    };
    Some((surface, None))
}

fn frustum(place: &Placement, (start, end): (Vec3, Vec3), start_radius: f64, end_radius: f64) -> Surface {
    Surface::Frustum {
        start: place.point(start),
        end: place.point(end),
        start_radius: place.length(start_radius),
        end_radius: place.length(end_radius),
    }
}

#[derive(Clone, Copy)]
enum Kind {
    Rotate,
    Translate,
    Oscillate,
    Conveyor,
}

fn term(reader: Reader<'_>) -> Option<MotionTerm> {
    let kinds = [
        ("rotate", Kind::Rotate),
        ("translate", Kind::Translate),
        ("oscillate", Kind::Oscillate),
        ("conveyor", Kind::Conveyor),
    ];
    let kind = match reader.need_word("kind", &kinds)? {
        Kind::Rotate => {
            let origin = reader.need_vector("origin", Length);
            let axis = reader.need_direction("axis");
            let rate = reader.need_quantity("rate", AngularVelocity, Limit::Any);
            (|| Some(MotionKind::Rotate { origin: origin?, axis: axis?, rate: rate? }))()
        }
        Kind::Translate => reader.need_vector("velocity", Velocity).map(|velocity| MotionKind::Translate { velocity }),
        Kind::Oscillate => {
            let amplitude = reader.need_vector("amplitude", Length);
            let frequency = reader.need_quantity("frequency", Frequency, Limit::Positive);
            let phase = reader.quantity("phase", Angle, Limit::Any).unwrap_or(0.0);
            (|| Some(MotionKind::Oscillate { amplitude: amplitude?, frequency: frequency?, phase }))()
        }
        Kind::Conveyor => reader.need_vector("velocity", Velocity).map(|velocity| MotionKind::Conveyor { velocity }),
    };
    let from = reader.quantity("from", Time, Limit::NotNegative).unwrap_or(0.0);
    let until = reader.quantity("until", Time, Limit::NotNegative).unwrap_or(f64::INFINITY);
    if until <= from {
        reader.report.error(
            "motion-window",
            &reader.place_of("until"),
            format!("the motion stops at {until} s, and starts at {from} s"),
            "make `until` later than `from`, or remove it for a motion without end",
        );
    }
    reader.finish();
    Some(MotionTerm { kind: kind?, from, until })
}
