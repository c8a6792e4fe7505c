//! The sections of a deck, in their order.

use super::gates::{GateText, gates};
use super::names::{comment, vector};
use super::parts::{Wall, walls};
use super::template::Templates;
use super::walls::WallText;
use super::{DeckOrder, output, processors, run};
use crate::backend::liggghts::parameters::{self, Models};
use crate::backend::liggghts::{deck_number, files, groups};
use crate::math::Bounds;
use crate::scene::backend::DeckPlace;

/// Side of the bins that neighbours are looked for in, over the reach of a contact with its skin.
///
/// LIGGGHTS' own bins have half the reach. With them it needs 40 % of the time on a chute of few large triangles to find out, whenever
/// particles enter, which bins each triangle meets: 39.6, 31.2, 26.4, 22.2, 24.4 s of processor time with bins of 3.3 (its own), 4, 6,
/// 10, 16 mm, spheres of 3 to 5 mm and a skin of 1.6 mm; a hopper 18.2, 15.1, 15.7, 18.0 s with 3.3, 6, 10, 16 mm.
const BIN: f64 = 1.5;

/// The text of the deck.
///
/// # Errors
/// Where the laws are none of LIGGGHTS', or a template of the user's own is wrong.
pub fn render(order: &DeckOrder<'_>) -> Result<String, String> {
    let scene = order.scene;
    let templates = Templates::new(order.settings.templates.as_deref());
    let models = parameters::models(&scene.law, &scene.materials).map_err(|faults| faults.join("\n"))?;
    let walls: Vec<Wall<'_>> = walls(scene, &order.schedule, !order.records_contacts());
    let beyond = order.bounds.minimum[0] - 100.0 * (order.bounds.maximum[0] - order.bounds.minimum[0]);
    let wall_text = WallText { walls: &walls, models: &models, contacts: order.records_contacts(), beyond };
    let gates: Vec<GateText<'_>> = gates(scene, order.records, &order.schedule, order.settings.contacts);
    let own = |place: DeckPlace| -> String {
        let given = order.settings.lines.get(&place).into_iter().flatten();
        let text: String = given.map(|line| format!("{line}\n")).collect();
        if text.is_empty() { text } else { format!("# the user's own lines: {}\n{text}", place.text()) }
    };
    let wall_section = [
        ("meshes", wall_text.meshes()),
        ("motions", wall_text.motions()),
        ("states", wall_text.states()),
        ("walls", wall_text.walls()),
    ];
    let wall_section: Vec<(&str, &str)> = wall_section.iter().map(|(name, text)| (*name, text.as_str())).collect();
    let sections = [
        head(order, &templates)?,
        system(order, &templates)?,
        own(DeckPlace::AfterSystem),
        materials(order, &models, &templates)?,
        own(DeckPlace::AfterMaterials),
        templates.fill("walls.in", &wall_section)?,
        own(DeckPlace::AfterWalls),
        feeds(order, &templates)?,
        integration(order, &templates)?,
        own(DeckPlace::AfterIntegration),
        run::gates_section(order, &gates, &wall_text, &templates)?,
        output::output(scene, &walls, &order.schedule, &templates)?,
        own(DeckPlace::BeforeRun),
        run::run_section(order, &gates, &wall_text, &templates)?,
        own(DeckPlace::AfterRun),
    ];
    let sections: Vec<&str> = sections.iter().map(String::as_str).filter(|section| !section.is_empty()).collect();
    Ok(sections.join("\n"))
}

fn head(order: &DeckOrder<'_>, templates: &Templates) -> Result<String, String> {
    let stage =
        if order.stage == order.scene.name { String::new() } else { format!(", stage {}", comment(order.stage)) };
    let ranks = order.settings.ranks;
    let serial = format!("liggghts -in {}", files::DECK);
    let command = if ranks > 1 { format!("mpirun -np {ranks} {serial}") } else { serial };
    templates.fill(
        "head.in",
        &[
            ("title", &format!("{}{stage}", comment(&order.scene.name))),
            ("version", env!("CARGO_PKG_VERSION")),
            ("command", &command),
        ],
    )
}

fn system(order: &DeckOrder<'_>, templates: &Templates) -> Result<String, String> {
    let boundary = order.scene.domain.periodic.map(|periodic| if periodic { "p" } else { "f" }).join(" ");
    let processors = match order.settings.processors {
        Some([x, y, z]) => {
            format!("processors {x} {y} {z}                         # ranks along x, y, z, as the scene says")
        }
        None if order.settings.ranks > 1 => {
            let [x, y, z] = processors::grid(order);
            format!(
                "processors {x} {y} {z}                         # ranks along x, y, z: each gets its share of the particles, \
                 and none is above another where that can be"
            )
        }
        None => String::new(),
    };
    templates.fill(
        "system.in",
        &[
            ("boundary", &boundary),
            ("processors", &processors),
            ("box", &block(&order.bounds)),
            ("types", &order.scene.materials.materials.len().to_string()),
            ("skin", &deck_number(order.skin)),
            ("bin", &deck_number(two_digits(BIN * (order.scene.largest_diameter() + order.skin)))),
        ],
    )
}

/// A positive number rounded to two digits.
fn two_digits(value: f64) -> f64 {
    let unit = 10_f64.powi(1 - value.log10().floor() as i32);
    (value * unit).round() / unit
}

/// Six numbers: x from, x to, y from, ...
pub(super) fn block(bounds: &Bounds) -> String {
    let side = |axis: usize| format!("{} {}", deck_number(bounds.minimum[axis]), deck_number(bounds.maximum[axis]));
    format!("{} {} {}", side(0), side(1), side(2))
}

fn materials(order: &DeckOrder<'_>, models: &Models, templates: &Templates) -> Result<String, String> {
    templates.fill(
        "materials.in",
        &[
            ("timestep", &deck_number(order.schedule.timestep)),
            ("properties", &models.properties.join("\n")),
            ("pair_style", &models.pair_style),
        ],
    )
}

fn feeds(order: &DeckOrder<'_>, templates: &Templates) -> Result<String, String> {
    let kinds = order.all_ghosts();
    let kinds = [
        (kinds.constant, groups::CONSTANT, "ghosts at constant velocity and spin: they act, and nothing acts on them"),
        (kinds.ballistic, groups::BALLISTIC, "ghosts in free fall"),
        (kinds.recorded, groups::RECORDED, "ghosts on their recorded paths: set at every sample"),
        (order.ghosts.any(), groups::RELEASED, "ghosts that become ordinary particles at a sample"),
    ];
    let here = kinds.iter().filter(|(there, _, _)| *there);
    let text: String = here.map(|(_, group, what)| format!("group {group} subtract all all # {what}\n")).collect();
    let (batch, particles) = (order.schedule.cadence.hand_over.to_string(), order.particles_to_come.to_string());
    templates.fill(
        "feeds.in",
        &[("particles", &particles), ("last", &order.last_entry.to_string()), ("batch", &batch), ("ghosts", &text)],
    )
}

fn integration(order: &DeckOrder<'_>, templates: &Templates) -> Result<String, String> {
    let kinds = order.all_ghosts();
    let mut text = String::new();
    for (there, group) in [(kinds.constant, groups::CONSTANT), (kinds.recorded, groups::RECORDED)] {
        if there {
            text += &format!("fix move_{group} {group} nve/noforce\n");
        }
    }
    if kinds.ballistic {
        let group = groups::BALLISTIC;
        text += &format!("fix move_{group} {group} nve\n");
        text +=
            &format!("fix free_{group} {group} setforce 0 0 0 # before gravity, which is all that is left to them\n");
    }
    let gravity = order.scene.gravity;
    let size = gravity.norm();
    let gravity = if size > 0.0 {
        format!("fix gravity all gravity {} vector {} # [m/s2]\n", deck_number(size), vector(&gravity))
    } else {
        String::new()
    };
    templates.fill("integration.in", &[("ghosts", &text), ("gravity", &gravity)])
}
