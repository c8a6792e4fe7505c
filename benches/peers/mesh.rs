//! The hopper's surfaces as STL files: a funnel, a cylinder over a cone, and a paddle of four blades.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use tollgate::math::{Vec3, vec3};

/// Axis of the hopper [m]; also stands in the decks.
const AXIS: [f64; 2] = [0.070, 0.070];
/// Height of the outlet [m].
pub const OUTLET: f64 = 0.300;
/// Where cone and cylinder meet, and the upper rim [m].
pub const SHOULDER: f64 = 0.410;
const RIM: f64 = 0.610;
const OUTLET_RADIUS: f64 = 0.018;
pub const RADIUS: f64 = 0.060;
/// Strips around, along the cone and along the cylinder: triangles of about 4 by 6 mm, the size of the spheres.
const AROUND: u32 = 96;
const ALONG: [u32; 2] = [24, 20];
/// Lower corner and edges of a blade before it is turned about the axis [m], and into how many squares each edge is cut.
const BLADE: [[f64; 3]; 2] = [[0.005, -0.002, 0.365], [0.030, 0.004, 0.040]];
const CUTS: [u32; 3] = [8, 1, 10];
const BLADES: u32 = 4;

type Triangle = [Vec3; 3];

/// Writes `funnel.stl` and `paddle.stl` into a folder.
pub fn write(folder: &Path) {
    for (name, triangles) in [("funnel", funnel()), ("paddle", paddle())] {
        let path = folder.join(name).with_extension("stl");
        fs::write(&path, text(name, &triangles)).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }
}

/// A point on the hopper's axis, moved by `offset`.
pub fn on_axis(offset: Vec3) -> Vec3 {
    vec3(AXIS[0], AXIS[1], 0.0) + offset
}

fn square(corners: [Vec3; 4]) -> [Triangle; 2] {
    let [a, b, c, d] = corners;
    [[a, b, c], [a, c, d]]
}

fn funnel() -> Vec<Triangle> {
    let rings = ALONG[0] + ALONG[1];
    let point = |ring: u32, strip: u32| {
        let share = |from: u32, of: u32| f64::from(ring - from) / f64::from(of);
        let (radius, z) = if ring <= ALONG[0] {
            let up = share(0, ALONG[0]);
            (OUTLET_RADIUS + (RADIUS - OUTLET_RADIUS) * up, OUTLET + (SHOULDER - OUTLET) * up)
        } else {
            (RADIUS, SHOULDER + (RIM - SHOULDER) * share(ALONG[0], ALONG[1]))
        };
        let angle = TAU * f64::from(strip % AROUND) / f64::from(AROUND);
        on_axis(vec3(radius * angle.cos(), radius * angle.sin(), z))
    };
    let squares = (0..rings).flat_map(|ring| (0..AROUND).map(move |strip| (ring, strip)));
    squares.flat_map(|(r, s)| square([point(r, s), point(r, s + 1), point(r + 1, s + 1), point(r + 1, s)])).collect()
}

fn paddle() -> Vec<Triangle> {
    let turned = |triangle: Triangle, blade: u32| {
        let (sin, cos) = (TAU * f64::from(blade) / f64::from(BLADES)).sin_cos();
        triangle.map(|p| on_axis(vec3(cos * p.x - sin * p.y, sin * p.x + cos * p.y, p.z)))
    };
    (0..BLADES).flat_map(|blade| this_blade().into_iter().map(move |triangle| turned(triangle, blade))).collect()
}

/// The six faces of a blade, each cut into squares.
fn this_blade() -> Vec<Triangle> {
    let at = |cell: [u32; 3]| {
        let along = |axis: usize| BLADE[0][axis] + BLADE[1][axis] * f64::from(cell[axis]) / f64::from(CUTS[axis]);
        vec3(along(0), along(1), along(2))
    };
    let mut triangles = Vec::new();
    for (axis, &far) in CUTS.iter().enumerate() {
        let [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        for side in [0, far] {
            for cut in 0..CUTS[u] * CUTS[v] {
                let corner = |du: u32, dv: u32| {
                    let mut cell = [side; 3];
                    (cell[u], cell[v]) = (cut % CUTS[u] + du, cut / CUTS[u] + dv);
                    at(cell)
                };
                triangles.extend(square([corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)]));
            }
        }
    }
    triangles
}

/// An ASCII file with 17 digits.
fn text(name: &str, triangles: &[Triangle]) -> String {
    let mut text = format!("solid {name}\n");
    for triangle in triangles {
        let normal = (triangle[1] - triangle[0]).cross(&(triangle[2] - triangle[0])).normalize();
        let _ = writeln!(text, "facet normal {:e} {:e} {:e}\n outer loop", normal.x, normal.y, normal.z);
        for corner in triangle {
            let _ = writeln!(text, "  vertex {:.17e} {:.17e} {:.17e}", corner.x, corner.y, corner.z);
        }
        text.push_str(" endloop\nendfacet\n");
    }
    let _ = writeln!(text, "endsolid {name}");
    text
}
