//! The section of the walls: meshes, motions that run from the start, and `fix wall/gran`.

use super::names::{comment, lines, vector};
use super::parts::{Shape, Wall, tolerances};
use crate::backend::liggghts::parameters::Models;
use crate::backend::liggghts::{deck_number, files};
use crate::geometry::part::Trigger;

/// What the walls of a deck have in common.
#[derive(Debug)]
pub struct WallText<'a> {
    /// The walls.
    pub walls: &'a [Wall<'a>],
    /// The contact laws.
    pub models: &'a Models,
}

impl WallText<'_> {
    /// `fix mesh/surface` of each mesh.
    pub fn meshes(&self) -> String {
        let texts = self.walls.iter().filter_map(|wall| {
            let mesh = wall.mesh()?;
            let belt = wall.belt.map_or_else(String::new, |velocity| format!(" surface_vel {}", vector(&velocity)));
            let (name, remark) = (comment(&wall.part.name), wall.remark());
            let unit = if belt.is_empty() { "" } else { "; surface_vel [m/s]" };
            Some(format!(
                "fix part_{} all mesh/surface/stress file {}/{} type {}{}{belt} # {name}: {remark}{unit}",
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
        let mut text = String::new();
        for wall in self.walls.iter().filter(|wall| wall.comes_or_goes()) {
            let there = wall.part.appears == Trigger::Always;
            let state = u8::from(there);
            let name = comment(&wall.part.name);
            text.push_str(&format!("variable there_{} equal {state} # {name}: 0 not yet, 1 there, 2 gone\n", wall.id));
            if wall.mesh().is_some() {
                text.push_str(&format!("{}\n", listed(wall, there)));
            }
        }
        if self.may_lack_meshes() {
            text.push_str("variable walled equal 0            # whether there is a wall of meshes\n");
        }
        text
    }

    /// All walls that are there at the start.
    pub fn walls(&self) -> String {
        let across = self.walls.iter().filter(|wall| wall.part.appears == Trigger::Always);
        let mut text = lines(across.filter_map(|wall| self.endless(wall)));
        text.push_str(&self.mesh_wall());
        text
    }

    /// The wall of a plane across an axis.
    fn endless(&self, wall: &Wall<'_>) -> Option<String> {
        let Shape::Across { axis, place } = wall.shape else { return None };
        Some(format!(
            "fix wall_{} all wall/gran {} primitive type {} {}plane {} {} # {}: [m]",
            wall.id,
            self.models.wall_model,
            wall.part.material + 1,
            ["x", "y", "z"][axis],
            deck_number(place),
            self.models.wall_options,
            comment(&wall.part.name),
        ))
    }

    /// The one wall of all meshes that are there, as the variables say.
    fn mesh_wall(&self) -> String {
        let meshes: Vec<&Wall<'_>> = self.walls.iter().filter(|wall| wall.mesh().is_some()).collect();
        if meshes.is_empty() {
            return String::new();
        }
        let changing: Vec<&&Wall<'_>> = meshes.iter().filter(|wall| wall.comes_or_goes()).collect();
        let steady = meshes.len() - changing.len();
        let list = meshes.iter().map(|wall| {
            if wall.comes_or_goes() { format!("${{mesh_{}}}", wall.id) } else { format!("part_{}", wall.id) }
        });
        let list = list.collect::<Vec<_>>().join(" ");
        let command = |count: &str| {
            let (model, options) = (&self.models.wall_model, &self.models.wall_options);
            format!("fix walls all wall/gran {model} mesh n_meshes {count} meshes {list} {options}")
                .trim_end()
                .to_owned()
        };
        if changing.is_empty() {
            return format!("{}\n", command(&steady.to_string()));
        }
        let terms = changing.iter().map(|wall| format!("+(v_there_{}==1)", wall.id)).collect::<String>();
        let count = format!("variable meshes equal {steady}{terms} # meshes that are there\n");
        if steady > 0 {
            return format!("{count}{}\n", command("${meshes}"));
        }
        let wall = command("${meshes}");
        format!("{count}if \"${{meshes}} > 0\" then \"{wall}\" \"variable walled equal 1\"\n")
    }

    /// True where there may be no mesh at all at some time.
    fn may_lack_meshes(&self) -> bool {
        let mut meshes = self.walls.iter().filter(|wall| wall.mesh().is_some()).peekable();
        meshes.peek().is_some() && meshes.all(Wall::comes_or_goes)
    }

    /// The commands that let a wall come or go.
    pub fn change(&self, wall: &Wall<'_>, comes: bool) -> String {
        if wall.mesh().is_none() {
            return match self.endless(wall) {
                Some(command) if comes => format!("{command}\n"),
                _ => format!("unfix wall_{}\n", wall.id),
            };
        }
        let away = if self.may_lack_meshes() {
            "if \"${walled} == 1\" then \"unfix walls\"\nvariable walled equal 0\n"
        } else {
            "unfix walls\n"
        };
        format!("{}\n{away}{}", listed(wall, comes), self.mesh_wall())
    }
}

/// The variable that stands for a mesh in the list of the wall.
fn listed(wall: &Wall<'_>, there: bool) -> String {
    let name = if there { format!("part_{}", wall.id) } else { String::new() };
    format!("variable mesh_{} string \"{name}\"", wall.id)
}

/// The command that starts a motion.
pub fn start_of(wall: &Wall<'_>, one: &super::motion::Move) -> String {
    format!("fix move_{}_{} all move/mesh mesh part_{} {}", wall.id, one.number, wall.id, one.arguments)
}

/// The command that ends a motion.
pub fn end_of(wall: &Wall<'_>, one: &super::motion::Move) -> String {
    format!("unfix move_{}_{}", wall.id, one.number)
}
