//! Parts as LIGGGHTS has them: meshes, and endless walls for planes that lie across an axis and stand still.

use super::bounds::particle_zone;
use super::motion::{Move, belt, moves};
use super::names::{file_name, identifiers};
use crate::backend::liggghts::Schedule;
use crate::geometry::frustum::Frustum;
use crate::geometry::motion::Motion;
use crate::geometry::part::{Part, Surface, TriangleMesh, Trigger};
use crate::math::{Bounds, Vec3};
use crate::scene::{Domain, Scene, extent};

/// Generators that a cylinder or cone is made of.
const SEGMENTS: u32 = 128;

/// A part in a deck.
#[derive(Debug, Clone)]
pub struct Wall<'a> {
    /// The part.
    pub part: &'a Part,
    /// Its name in the deck.
    pub id: String,
    /// Its surface.
    pub shape: Shape,
    /// Its motions.
    pub moves: Vec<Move>,
    /// Velocity of a belt [m/s].
    pub belt: Option<Vec3>,
    /// From its place to where it is parked while it is not there [m]; `None` where it always is, or cannot be parked.
    pub parking: Option<Vec3>,
}

/// A surface.
#[derive(Debug, Clone)]
pub enum Shape {
    /// Triangles.
    Mesh(TriangleMesh),
    /// The plane x, y or z = place [m], endless.
    Across {
        /// 0 = x, 1 = y, 2 = z.
        axis: usize,
        /// Where \[m\].
        place: f64,
    },
}

impl Wall<'_> {
    /// Name of its file in the folder of meshes.
    #[must_use]
    pub fn file(&self) -> String {
        format!("{}.stl", file_name(&self.part.name))
    }

    /// True where it may appear or disappear.
    #[must_use]
    pub fn comes_or_goes(&self) -> bool {
        comes_or_goes(self.part)
    }

    /// The triangles, where it consists of some.
    #[must_use]
    pub fn mesh(&self) -> Option<&TriangleMesh> {
        match &self.shape {
            Shape::Mesh(mesh) => Some(mesh),
            Shape::Across { .. } => None,
        }
    }

    /// Where it comes within a run of `end` [s]; nowhere where it is endless.
    #[must_use]
    pub fn reach(&self, end: f64) -> Bounds {
        let mut bounds = Bounds::EMPTY;
        self.mesh().into_iter().flat_map(|mesh| &mesh.vertices).for_each(|vertex| bounds.include(vertex));
        if bounds.is_empty() { bounds } else { extent::moved(bounds, &self.part.motion, end) }
    }

    /// What its mesh is, for whoever reads the deck.
    #[must_use]
    pub fn remark(&self) -> String {
        let count = self.mesh().map_or(0, |mesh| mesh.triangles.len());
        match self.part.surface {
            Surface::Frustum { .. } => format!("{count} triangles for a surface of revolution"),
            Surface::Plane { .. } => "2 triangles for a plane".to_owned(),
            Surface::Mesh(_) => format!("{count} triangles"),
        }
    }
}

fn comes_or_goes(part: &Part) -> bool {
    part.appears != Trigger::Always || part.disappears != Trigger::Never
}

/// The way to beside the domain, along the open axis that makes the box least larger; `None` where all axes are periodic.
fn parking(scene: &Scene, schedule: &Schedule, reach: &Bounds) -> Option<Vec3> {
    let zone = particle_zone(scene, schedule);
    let gap = scene.largest_diameter();
    let size = zone.size();
    let open = (0..3).filter(|axis| !scene.domain.periodic[*axis]);
    let ways = open.map(|axis| {
        let mut way = Vec3::zeros();
        way[axis] = zone.maximum[axis] + gap - reach.minimum[axis];
        (way, (reach.maximum[axis] - reach.minimum[axis]) / size[axis])
    });
    ways.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(way, _)| way)
}

/// All parts of a scene. Planes across an axis that stand still are `endless`, or meshes as well: LIGGGHTS says nothing of contacts
/// with endless walls.
#[must_use]
pub fn walls<'a>(scene: &'a Scene, schedule: &Schedule, endless: bool) -> Vec<Wall<'a>> {
    let ids = identifiers(scene.parts.iter().map(|part| part.name.as_str()));
    let end = schedule.time(schedule.steps);
    let wall = |(part, id): (&'a Part, String)| {
        let shape = shape(scene, part, end, endless);
        let (moves, belt) = (moves(&part.motion, schedule), belt(&part.motion));
        let mut wall = Wall { part, id, shape, moves, belt, parking: None };
        if wall.comes_or_goes() {
            wall.parking = parking(scene, schedule, &wall.reach(end));
        }
        wall
    };
    scene.parts.iter().zip(ids).map(wall).collect()
}

fn shape(scene: &Scene, part: &Part, end: f64, endless: bool) -> Shape {
    match &part.surface {
        Surface::Mesh(mesh) => Shape::Mesh(without_ends(mesh, &scene.domain).unwrap_or_else(|| mesh.clone())),
        Surface::Frustum { start, end, start_radius, end_radius } => {
            Shape::Mesh(Frustum::new(*start, *end, *start_radius, *end_radius).to_mesh(SEGMENTS))
        }
        Surface::Plane { point, normal } => match across(normal) {
            Some(axis) if endless && part.motion.terms.is_empty() && !comes_or_goes(part) => {
                Shape::Across { axis, place: point[axis] }
            }
            _ => Shape::Mesh(rectangle(scene, point, normal, &part.motion, end)),
        },
    }
}

/// A mesh between periodic borders without its triangles on them; `None` where it does not end on both borders of an axis. Where it does,
/// its ends are one and the same place inside of it, which nobody touches, and LIGGGHTS refuses them as duplicates.
#[must_use]
pub fn without_ends(mesh: &TriangleMesh, domain: &Domain) -> Option<TriangleMesh> {
    let mut kept = mesh.clone();
    for (axis, period) in domain.periods().into_iter().enumerate() {
        let Some(period) = period else { continue };
        let lies = |triangle: &[u32; 3], border: f64| {
            triangle.iter().all(|&vertex| (mesh.vertices[vertex as usize][axis] - border).abs() <= 1e-9 * period)
        };
        let borders = [domain.bounds.minimum[axis], domain.bounds.maximum[axis]];
        if borders.iter().all(|&border| mesh.triangles.iter().any(|triangle| lies(triangle, border))) {
            kept.triangles.retain(|triangle| !borders.iter().any(|&border| lies(triangle, border)));
        }
    }
    (kept.triangles.len() < mesh.triangles.len()).then_some(kept)
}

/// The axis along which a unit normal lies.
pub(super) fn across(normal: &Vec3) -> Option<usize> {
    (0..3).find(|axis| normal[*axis].abs() == 1.0)
}

/// Two triangles that cover a plane wherever a particle in the domain may touch it, also while it moves.
fn rectangle(scene: &Scene, point: &Vec3, normal: &Vec3, motion: &Motion, end: f64) -> TriangleMesh {
    let mut start = Bounds::EMPTY;
    start.include(point);
    let travel = extent::moved(start, motion, end).size().norm();
    let margin = scene.largest_diameter() + travel;
    let mut covered = scene.domain.bounds;
    for axis in (0..3).filter(|axis| !scene.domain.periodic[*axis]) {
        covered.minimum[axis] -= margin;
        covered.maximum[axis] += margin;
    }
    let mut side = Vec3::zeros();
    side[normal.iamin()] = 1.0;
    let side = (side - normal * normal.dot(&side)).normalize();
    let other = normal.cross(&side);
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for corner in extent::corners(&covered) {
        for (k, direction) in [side, other].iter().enumerate() {
            let along = (corner - point).dot(direction);
            (low[k], high[k]) = (low[k].min(along), high[k].max(along));
        }
    }
    let at = |a: f64, b: f64| point + side * a + other * b;
    let corners = [at(low[0], low[1]), at(high[0], low[1]), at(high[0], high[1]), at(low[0], high[1])];
    TriangleMesh::from_soup(&[[corners[0], corners[1], corners[2]], [corners[0], corners[2], corners[3]]])
}

/// What LIGGGHTS needs to be told of a mesh that it would refuse otherwise.
#[must_use]
pub fn tolerances(mesh: &TriangleMesh) -> String {
    /// LIGGGHTS calls a mesh with a sharper corner highly skewed [rad].
    const SHARPEST: f64 = 0.006;
    let sharp = (0..mesh.triangles.len()).any(|triangle| {
        let corners = mesh.corners(triangle);
        (0..3).any(|k| {
            let (a, b) = (corners[(k + 1) % 3] - corners[k], corners[(k + 2) % 3] - corners[k]);
            a.cross(&b).norm().atan2(a.dot(&b)) < SHARPEST
        })
    });
    let mut seen = std::collections::HashSet::new();
    let doubled = mesh.triangles.iter().any(|triangle| {
        let mut corners = *triangle;
        corners.sort_unstable();
        !seen.insert(corners)
    });
    let mut text = String::new();
    if doubled {
        text.push_str(" heal auto_remove_duplicates");
    }
    if sharp {
        text.push_str(" curvature_tolerant yes");
    }
    text
}
