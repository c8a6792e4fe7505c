//! The section of the walls: meshes, motions that run from the start, and `fix wall/gran`.
//!
//! All meshes belong to one wall for the whole run, as contacts with them could not be dumped otherwise. A mesh that is not there
//! is parked: it stands beside the domain, where no particle comes, and is carried from one place to the other within one time step.

use super::motion::Move;
use super::names::{comment, lines, vector};
use super::parts::{Shape, Wall, tolerances};
use crate::backend::liggghts::parameters::Models;
use crate::backend::liggghts::record::contacts::{FRESH, QUANTITIES};
use crate::backend::liggghts::{Schedule, deck_number, files};
use crate::geometry::part::Trigger;

/// What the walls of a deck have in common.
#[derive(Debug)]
pub struct WallText<'a> {
    /// The walls.
    pub walls: &'a [Wall<'a>],
    /// The contact laws.
    pub models: &'a Models,
    /// Whether contacts with meshes are looked at.
    pub contacts: bool,
    /// A place on the x axis far outside of the box [m].
    pub beyond: f64,
}

impl WallText<'_> {
    /// `fix mesh/surface` of each mesh.
    pub fn meshes(&self) -> String {
        let texts = self.walls.iter().filter_map(|wall| {
            let mesh = wall.mesh()?;
            let belt = wall.belt.map_or_else(String::new, |velocity| format!(" surface_vel {}", vector(&velocity)));
            let parked = wall.parking.filter(|_| wall.part.appears != Trigger::Always);
            let parked = parked.map_or_else(String::new, |way| format!(" move {}", vector(&way)));
            let mut remark = format!("{}: {}", comment(&wall.part.name), wall.remark());
            for (text, what) in [(&belt, "; belt [m/s]"), (&parked, "; parked beside the domain [m]")] {
                remark += if text.is_empty() { "" } else { what };
            }
            Some(format!(
                "fix part_{} all mesh/surface/stress file {}/{} type {}{parked}{}{belt} # {remark}",
                wall.id,
                files::MESHES,
                wall.file(),
                wall.part.material + 1,
                tolerances(mesh),
            ))
        });
        lines(texts)
    }

    /// `fix move/mesh` of what moves from the start.
    pub fn motions(&self) -> String {
        let all = self.walls.iter().flat_map(|wall| wall.moves.iter().map(move |one| (wall, one)));
        lines(all.filter(|(_, one)| one.from == 0).map(|(wall, one)| start_of(wall, one)))
    }

    /// Variables that say which parts are there, where that may change.
    pub fn states(&self) -> String {
        let changing = self.walls.iter().filter(|wall| wall.comes_or_goes());
        lines(changing.flat_map(|wall| {
            let state = u8::from(wall.part.appears == Trigger::Always);
            let name = comment(&wall.part.name);
            [
                format!("variable there_{} equal {state} # {name}: 0 not yet, 1 there, 2 gone", wall.id),
                format!("variable carried_{} equal 0 # 1 while it is carried from its place or to it", wall.id),
            ]
        }))
    }

    /// All walls.
    pub fn walls(&self) -> String {
        let mut text = lines(self.walls.iter().filter_map(|wall| self.endless(wall)));
        let meshes: Vec<String> =
            self.walls.iter().filter(|wall| wall.mesh().is_some()).map(|wall| format!("part_{}", wall.id)).collect();
        if !meshes.is_empty() {
            let (model, options) = (&self.models.wall_model, &self.models.wall_options);
            let (count, list) = (meshes.len(), meshes.join(" "));
            let command = format!("fix walls all wall/gran {model} mesh n_meshes {count} meshes {list} {options}");
            text += &lines([command]);
        }
        if self.walls.iter().all(|wall| wall.part.material > 0) {
            text += &lines([
                "# LIGGGHTS asks for somebody of type 1 at every set-up, also while the box is empty: a plane far outside of it.".to_owned(),
                format!(
                    "fix first_type all wall/gran {} primitive type 1 xplane {}{}{}",
                    self.models.wall_model,
                    deck_number(self.beyond),
                    if self.models.wall_options.is_empty() { "" } else { " " },
                    self.models.wall_options,
                ),
            ]);
        }
        text
    }

    /// The wall of a plane across an axis.
    fn endless(&self, wall: &Wall<'_>) -> Option<String> {
        let Shape::Across { axis, place } = wall.shape else { return None };
        let options = &self.models.wall_options;
        Some(format!(
            "fix wall_{} all wall/gran {} primitive type {} {}plane {}{}{options} # {} [m]",
            wall.id,
            self.models.wall_model,
            wall.part.material + 1,
            ["x", "y", "z"][axis],
            deck_number(place),
            if options.is_empty() { "" } else { " " },
            comment(&wall.part.name),
        ))
    }

    /// True where contacts with meshes are dumped.
    pub fn looks_at_contacts(&self) -> bool {
        self.contacts && self.walls.iter().any(|wall| wall.mesh().is_some())
    }

    /// The compute of contacts with meshes.
    pub fn contact_compute(&self) -> String {
        if self.looks_at_contacts() {
            format!("compute walls {FRESH} wall/gran/local {QUANTITIES}\n")
        } else {
            String::new()
        }
    }

    /// True where a part may be carried during the run.
    pub fn carries(&self) -> bool {
        self.walls.iter().any(Wall::comes_or_goes)
    }

    /// Lines that end the carrying of every part, after its one time step.
    pub fn put_down(&self) -> String {
        let changing = self.walls.iter().filter(|wall| wall.comes_or_goes());
        let id = changing.map(|wall| &wall.id);
        lines(id.map(|id| {
            format!("if \"${{carried_{id}}} == 1\" then \"unfix carry_{id}\" \"variable carried_{id} equal 0\"")
        }))
    }
}

/// The commands that let a mesh come or go: the fix that carries it within the next time step.
pub fn change(wall: &Wall<'_>, comes: bool, schedule: &Schedule) -> String {
    let way = wall.parking.unwrap_or_default() * (if comes { -1.0 } else { 1.0 } / schedule.timestep);
    let id = &wall.id;
    format!(
        "variable carried_{id} equal 1\nvariable carried equal 1\n\
         fix carry_{id} all move/mesh mesh part_{id} linear {} # [m/s], for one time step\n",
        vector(&way)
    )
}

/// The command that starts a motion.
pub fn start_of(wall: &Wall<'_>, one: &Move) -> String {
    format!("fix move_{}_{} all move/mesh mesh part_{} {}", wall.id, one.number, wall.id, one.arguments)
}

/// The command that ends a motion.
pub fn end_of(wall: &Wall<'_>, one: &Move) -> String {
    format!("unfix move_{}_{}", wall.id, one.number)
}
