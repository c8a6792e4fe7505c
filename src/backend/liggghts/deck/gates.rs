//! Gates that a case records: what is sampled, who has passed, who is taken out.

use super::names::{comment, file_name, identifiers, vector};
use super::parts::across;
use super::template::Templates;
use crate::backend::liggghts::record::slab;
use crate::backend::liggghts::{COLUMNS, Schedule, deck_number, files, groups};
use crate::geometry::plane::{Aperture, GatePlane};
use crate::math::{Bounds, Vec3};
use crate::scene::Scene;
use crate::scene::gate::{ExclusionMode, Fate, Gate, PassingPoint};
use crate::stage::split::Recording;
use std::f64::consts::PI;

/// Text formats of the columns of a particle dump: two whole numbers, and reals that read back to the same bits.
#[must_use]
pub fn column_formats() -> String {
    let columns = COLUMNS.split(' ').count();
    let mut formats = vec!["%d"; 2];
    formats.resize(columns, "%.17g");
    formats.join(" ")
}

/// A gate in a deck.
#[derive(Debug)]
pub struct GateText<'a> {
    /// The gate.
    pub gate: &'a Gate,
    /// Its plane, whose opening reaches beyond periodic borders that it spans.
    plane: GatePlane,
    /// Its name in the deck.
    pub id: String,
    /// Whether particles that have passed are handed over, so that the deck must know them.
    hands_over: bool,
    /// Whether the deck must know who has passed since the last sample.
    finds_crossings: bool,
    /// Distances before and behind the plane within which particles are sampled \[m\].
    near: (f64, f64),
    /// How far beside the opening they are sampled \[m\].
    margin: f64,
    /// Unit vector along gravity, where a particle's lowest point is what passes.
    pub lowest: Option<Vec3>,
}

/// All gates of a deck.
#[must_use]
pub fn gates<'a>(scene: &Scene, records: &'a [Recording], schedule: &Schedule, contacts: bool) -> Vec<GateText<'a>> {
    let ids = identifiers(records.iter().map(|recording| recording.gate.name.as_str()));
    let diameter = scene.largest_diameter();
    let speed = super::bounds::speed_limit(scene);
    let text = |(recording, id): (&'a Recording, String)| {
        let gate = &recording.gate;
        let down = scene.gravity.try_normalize(0.0).unwrap_or_else(Vec3::zeros);
        let lowest = (gate.passage == PassingPoint::LowestPoint).then_some(down);
        let [from, to] = slab(scene, recording, schedule, speed);
        GateText {
            gate,
            plane: gate.plane.over_borders(&scene.domain.periods()),
            id,
            hands_over: !recording.observes,
            finds_crossings: !recording.observes || contacts,
            near: (-from, to),
            // Who comes from the side or leaves to the side is seen on the whole of a path that is as long sideways as along.
            margin: (-from).max(to) + diameter,
            lowest,
        }
    };
    records.iter().zip(ids).map(text).collect()
}

/// Definition of the variable `radius` \[m\]: LIGGGHTS has no radius in formulas, but mass and, by material, density.
#[must_use]
pub fn radius_variable(scene: &Scene) -> String {
    let materials = scene.materials.materials.iter().zip(1..);
    let terms = materials.filter_map(|(material, number)| {
        let cubed = 3.0 / (4.0 * PI * material.density?);
        Some(format!("(type=={number})*(mass*{})^(1/3)", deck_number(cubed)))
    });
    format!("variable radius atom {} # [m]", terms.collect::<Vec<_>>().join("+"))
}

/// Formula of (x - point) . direction; x is the centre, or where `lowest` is given the centre plus a radius along it.
fn along(point: &Vec3, direction: &Vec3, lowest: Option<&Vec3>) -> String {
    let terms = (0..3).filter(|axis| direction[*axis] != 0.0).map(|axis| {
        let place = coordinate(axis, lowest);
        format!("({place}-({}))*({})", deck_number(point[axis]), deck_number(direction[axis]))
    });
    terms.collect::<Vec<_>>().join("+")
}

fn coordinate(axis: usize, lowest: Option<&Vec3>) -> String {
    let name = ["x", "y", "z"][axis];
    match lowest.map(|down| down[axis]).filter(|down| *down != 0.0) {
        Some(down) => format!("({name}+({})*v_radius)", deck_number(down)),
        None => name.to_owned(),
    }
}

/// The axis of an opening that LIGGGHTS has a region for, and that region.
fn opening_region(plane: &GatePlane, margin: f64) -> Option<String> {
    let (point, axis) = (&plane.point, across(&plane.normal)?);
    let infinite = |axis: usize, low: f64, high: f64, free: usize| {
        if axis == free { "INF INF".to_owned() } else { format!("{} {}", deck_number(low), deck_number(high)) }
    };
    match &plane.aperture {
        Aperture::Unbounded => None,
        Aperture::Disc { radius } => {
            let [a, b] = [(axis + 1) % 3, (axis + 2) % 3];
            let [a, b] = if axis == 1 { [b, a] } else { [a.min(b), a.max(b)] };
            let name = ["x", "y", "z"][axis];
            let (a, b, radius) = (deck_number(point[a]), deck_number(point[b]), deck_number(radius + margin));
            Some(format!("cylinder {name} {a} {b} {radius} INF INF"))
        }
        Aperture::Rectangle { side_a, side_b } => {
            let straight = |side: &Vec3| (0..3).filter(|k| side[*k] != 0.0).count() == 1;
            if !straight(side_a) || !straight(side_b) {
                return None;
            }
            let reach = (side_a.abs() + side_b.abs()) / 2.0;
            let side = |k: usize| infinite(k, point[k] - reach[k] - margin, point[k] + reach[k] + margin, axis);
            Some(format!("block {} {} {}", side(0), side(1), side(2)))
        }
    }
}

/// A box around an opening, as a region.
fn opening_box(plane: &GatePlane, margin: f64) -> Option<String> {
    let reach = match &plane.aperture {
        Aperture::Unbounded => return None,
        Aperture::Disc { radius } => Vec3::repeat(*radius),
        Aperture::Rectangle { side_a, side_b } => (side_a.abs() + side_b.abs()) / 2.0,
    };
    let mut bounds = Bounds::EMPTY;
    bounds.include(&(plane.point - reach));
    bounds.include(&(plane.point + reach));
    let bounds = bounds.grown(margin);
    let side = |k: usize| format!("{} {}", deck_number(bounds.minimum[k]), deck_number(bounds.maximum[k]));
    Some(format!("block {} {} {}", side(0), side(1), side(2)))
}

/// Formula that is 1 in the column over an opening.
fn opening_formula(plane: &GatePlane, lowest: Option<&Vec3>) -> Option<String> {
    let point = &plane.point;
    match &plane.aperture {
        Aperture::Unbounded => None,
        Aperture::Disc { radius } => {
            let squares = (0..3).map(|k| format!("({}-({}))^2", coordinate(k, lowest), deck_number(point[k])));
            let from_centre = squares.collect::<Vec<_>>().join("+");
            let distance = along(point, &plane.normal, lowest);
            Some(format!("({from_centre}-({distance})^2<={})", deck_number(radius * radius)))
        }
        Aperture::Rectangle { side_a, side_b } => {
            // x - p = a side_a + b side_b + s n: a and b by the dual vectors of the sides.
            let (aa, ab, bb) = (side_a.norm_squared(), side_a.dot(side_b), side_b.norm_squared());
            let determinant = aa * bb - ab * ab;
            let dual_a = (side_a * bb - side_b * ab) / determinant;
            let dual_b = (side_b * aa - side_a * ab) / determinant;
            let within = |dual: &Vec3| format!("(abs({})<=0.5)", along(point, dual, lowest));
            Some(format!("{}*{}", within(&dual_a), within(&dual_b)))
        }
    }
}

impl GateText<'_> {
    /// Formula of the distance s of a centre from the plane \[m\].
    pub fn distance(&self) -> String {
        along(&self.plane().point, &self.plane().normal, None)
    }

    fn plane(&self) -> &GatePlane {
        &self.plane
    }

    fn at(&self, distance: f64) -> String {
        vector(&(self.plane().point + self.plane().normal * distance))
    }

    /// By a region where LIGGGHTS has one for the opening, and the centre is what passes.
    fn by_region(&self) -> bool {
        let unbounded = self.plane().aperture == Aperture::Unbounded;
        self.lowest.is_none() && (unbounded || opening_region(self.plane(), 0.0).is_some())
    }

    /// Regions, variables and groups.
    pub fn definition(&self, templates: &Templates) -> Result<String, String> {
        let (id, normal) = (&self.id, vector(&self.plane().normal));
        let aperture = opening_region(self.plane(), self.margin).or_else(|| opening_box(self.plane(), self.margin));
        let parts = if aperture.is_some() {
            format!("3 near_{id}_from near_{id}_to near_{id}_opening")
        } else {
            format!("2 near_{id}_from near_{id}_to")
        };
        let aperture =
            aperture.map_or_else(String::new, |region| format!("region near_{id}_opening {region} units box"));
        let crossing = if self.finds_crossings {
            templates.fill("gate_crossing.in", &[("id", id), ("behind", &self.behind())])?
                + &self.removal_regions(templates)?
        } else {
            String::new()
        };
        templates.fill(
            "gate.in",
            &[
                ("name", &comment(&self.gate.name)),
                ("id", id),
                ("point", &vector(&self.plane().point)),
                ("normal", &normal),
                ("near_from", &self.at(-self.near.0)),
                ("near_to", &self.at(self.near.1)),
                ("near_before", &deck_number(self.near.0)),
                ("near_behind", &deck_number(self.near.1)),
                ("near_opening", &aperture),
                ("near_parts", &parts),
                ("crossing", &crossing),
            ],
        )
    }

    /// What says who is behind the plane within its opening, and who is before it.
    fn behind(&self) -> String {
        let (id, plane) = (&self.id, self.plane());
        let (point, normal) = (vector(&plane.point), vector(&plane.normal));
        if self.by_region() {
            let opening = opening_region(plane, 0.0);
            let side = format!("region behind_{id}_plane plane {point} {normal}\n");
            let before = format!("region before_{id} plane {point} {normal} side out\n");
            return match opening {
                None => format!("region behind_{id} plane {point} {normal}\n{before}"),
                Some(region) => format!(
                    "{side}region behind_{id}_opening {region} units box\n\
                     region behind_{id} intersect 2 behind_{id}_plane behind_{id}_opening\n{before}"
                ),
            };
        }
        let s = along(&plane.point, &plane.normal, self.lowest.as_ref());
        let opening =
            opening_formula(plane, self.lowest.as_ref()).map_or_else(String::new, |formula| format!("*{formula}"));
        format!("variable behind_{id} atom ({s}>=0){opening}\nvariable before_{id} atom ({s}<0)\n")
    }

    fn removal_regions(&self, templates: &Templates) -> Result<String, String> {
        if !self.hands_over {
            return Ok(String::new());
        }
        let mode = match self.gate.exclusion.mode {
            ExclusionMode::Constant => {
                "Who has passed goes on as a ghost at constant velocity and spin, until it is taken out."
            }
            ExclusionMode::Ballistic => "Who has passed goes on as a ghost in free fall, until it is taken out.",
            ExclusionMode::Buffer => "Who has passed goes on as an ordinary particle, until it is taken out.",
        };
        let length = self.gate.exclusion.length;
        templates.fill(
            "gate_removal.in",
            &[
                ("id", &self.id),
                ("mode", mode),
                ("excluded", &self.at(length)),
                ("normal", &vector(&self.plane().normal)),
                ("length", &deck_number(length)),
            ],
        )
    }

    /// What is done at a sample.
    pub fn sample(&self, templates: &Templates, contacts: bool) -> Result<String, String> {
        let id = &self.id;
        let by = if self.by_region() { "region" } else { "variable" };
        let mut passed = String::new();
        if self.hands_over {
            passed = format!("group passed_{id} union passed_{id} crossing\n");
            let ghosts = match self.gate.exclusion.mode {
                ExclusionMode::Constant => Some(groups::CONSTANT),
                ExclusionMode::Ballistic => Some(groups::BALLISTIC),
                ExclusionMode::Buffer => None,
            };
            if let Some(ghosts) = ghosts {
                passed.push_str(&format!("group {ghosts} union {ghosts} crossing\n"));
                passed.push_str(&format!("group {0} subtract {0} crossing\n", groups::ACTIVE));
            }
        }
        let crossing = if self.finds_crossings {
            let values = [
                ("id", id.as_str()),
                ("behind", &format!("{by} behind_{id}")),
                ("before", &format!("{by} before_{id}")),
                ("passed", &passed),
                ("fresh", if contacts { "group fresh union fresh crossing" } else { "" }),
            ];
            templates.fill("gate_sample_crossing.in", &values)?
        } else {
            String::new()
        };
        templates.fill(
            "gate_sample.in",
            &[
                ("name", &comment(&self.gate.name)),
                ("id", id),
                ("file", &file_name(&self.gate.name)),
                ("columns", COLUMNS),
                ("crossing", &crossing),
            ],
        )
    }

    /// What is taken out between two batches.
    pub fn removals(&self, templates: &Templates) -> Result<String, String> {
        if !self.hands_over {
            return Ok(String::new());
        }
        let (id, name) = (&self.id, comment(&self.gate.name));
        let by = if self.by_region() { "region" } else { "variable" };
        let clear = "group behind subtract behind all\n";
        let mut text = removal(
            templates,
            &Removal {
                what: &format!("who has passed gate {name} and is beyond its exclusion plane"),
                gone: &format!("{clear}group behind region excluded_{id}\ngroup gone intersect behind passed_{id}"),
                name: &file_name(&self.gate.name),
                label: &format!("{id}_excluded"),
                count: "",
            },
        )?;
        if self.gate.returning == Fate::Delete {
            let gone = format!("{clear}group behind {by} before_{id}\ngroup gone intersect behind passed_{id}");
            let what = format!("who has come back over gate {name}");
            let name = format!("{}.returning", file_name(&self.gate.name));
            let label = format!("{id}_returned");
            text += &removal(templates, &Removal { what: &what, gone: &gone, name: &name, label: &label, count: "" })?;
        }
        if self.gate.sitting == Fate::Delete {
            let gone = format!(
                "{clear}group behind {by} behind_{id}\ngroup gone union gone behind\ngroup gone subtract gone passed_{id}"
            );
            let what = format!("who is behind gate {name} without having passed it");
            let name = format!("{}.sitting", file_name(&self.gate.name));
            let label = format!("{id}_sitting");
            text += &removal(templates, &Removal { what: &what, gone: &gone, name: &name, label: &label, count: "" })?;
        }
        Ok(text)
    }
}

struct Removal<'a> {
    what: &'a str,
    gone: &'a str,
    name: &'a str,
    label: &'a str,
    count: &'a str,
}

fn removal(templates: &Templates, removal: &Removal<'_>) -> Result<String, String> {
    templates.fill(
        "removal.in",
        &[
            ("what", removal.what),
            ("gone", removal.gone),
            ("label", removal.label),
            ("file", &format!("{}/{}", files::REMOVED, removal.name)),
            ("columns", COLUMNS),
            ("format", &column_formats()),
            ("name", removal.name),
            ("count", removal.count),
        ],
    )
}

/// Who has left the domain, which is smaller than the box.
///
/// # Errors
/// Of templates.
pub fn domain_removal(templates: &Templates) -> Result<String, String> {
    removal(
        templates,
        &Removal {
            what: "who has left the domain",
            gone: "group gone region outside",
            name: "domain",
            label: "domain_empty",
            count: "variable left equal ${left}+${found}",
        },
    )
}
