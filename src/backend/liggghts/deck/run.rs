//! The sections of gates and of the run itself.

use super::DeckOrder;
use super::events::Events;
use super::gates::{GateText, domain_removal, radius_variable};
use super::names::lines;
use super::template::Templates;
use super::walls::WallText;
use crate::backend::liggghts::record::contacts::{
    FRESH, PAIR_COLUMNS, PAIRS_FILE, QUANTITIES, TOUCH, WALL_COLUMNS, WALLS_FILE, dump_arguments, history_numbers,
    touch_box, touch_slab,
};
use crate::backend::liggghts::{COLUMNS, deck_number, groups, replay};
use crate::scene::Domain;

/// Renders the section of gates and borders.
///
/// # Errors
/// Of templates.
pub fn gates_section(
    order: &DeckOrder<'_>,
    gates: &[GateText<'_>],
    walls: &WallText<'_>,
    templates: &Templates,
) -> Result<String, String> {
    let mut text = String::new();
    for gate in gates {
        text += &gate.definition(templates)?;
    }
    let mut helpers = Vec::new();
    if !gates.is_empty() {
        helpers.push(
            "group behind subtract all all            # who is behind a gate plane, one gate at a time".to_owned(),
        );
        helpers.push("group crossing subtract all all          # who has passed it since the last sample".to_owned());
    }
    helpers.extend(gates.iter().any(|gate| gate.lowest.is_some()).then(|| radius_variable(order.scene)));
    let contacts = if order.records_contacts() { contact_computes(order, gates, walls) } else { String::new() };
    templates.fill(
        "gates.in",
        &[
            ("groups", &lines(helpers)),
            ("gates", &text),
            ("contacts", &contacts),
            ("batch", &order.schedule.cadence.hand_over.to_string()),
            ("domain", &borders(&order.scene.domain)),
        ],
    )
}

/// Six numbers as of [`block`], without borders along periodic axes: who comes over those is moved to the other side some steps later.
fn borders(domain: &Domain) -> String {
    let side = |axis: usize| {
        let (low, high) = (domain.bounds.minimum[axis], domain.bounds.maximum[axis]);
        if domain.periodic[axis] { "INF INF".to_owned() } else { format!("{} {}", deck_number(low), deck_number(high)) }
    };
    format!("{} {} {}", side(0), side(1), side(2))
}

fn contact_computes(order: &DeckOrder<'_>, gates: &[GateText<'_>], walls: &WallText<'_>) -> String {
    let diameter = order.scene.largest_diameter();
    let touch = if order.settings.ranks > 1 {
        let travel = super::bounds::speed_limit(order.scene) * order.schedule.time(order.schedule.cadence.look);
        let slabs =
            gates.iter().map(|gate| format!("({})", touch_slab(&gate.distance(), diameter, order.skin, travel)));
        format!("({})>0", slabs.collect::<Vec<_>>().join("+"))
    } else {
        touch_box(FRESH, diameter, order.scene.domain.periodic.map(|periodic| !periodic))
    };
    let mut text = vec![
        "# Contacts of who has passed since the last sample.".to_owned(),
        format!("group {FRESH} subtract all all             # who has passed, at any gate"),
        format!("group {TOUCH} subtract all all             # and who may touch them"),
        format!("variable {TOUCH} atom {touch}"),
        format!("compute pairs {TOUCH} pair/gran/local {QUANTITIES}"),
    ];
    text.push(walls.contact_compute());
    lines(text.into_iter().filter(|line| !line.is_empty()))
}

/// Renders the section of the run.
///
/// # Errors
/// Of templates.
pub fn run_section(
    order: &DeckOrder<'_>,
    gates: &[GateText<'_>],
    walls: &WallText<'_>,
    templates: &Templates,
) -> Result<String, String> {
    let schedule = order.schedule;
    let events = Events { text: walls, schedule, last_entry: order.last_entry, templates };
    let end = &order.scene.end;
    let first = samples(order, gates, walls, templates, true)?;
    let sample = samples(order, gates, walls, templates, false)?;
    // Where nothing is looked at in between, a batch is one run.
    let look = if sample.is_empty() { schedule.cadence.hand_over } else { schedule.cadence.look };
    let mut removals = String::new();
    for gate in gates {
        removals += &gate.removals(templates)?;
    }
    removals += &domain_removal(templates)?;
    let define = if order.ghosts.any() { lines(replay::define(order.ghosts.recorded)) } else { String::new() };
    templates.fill(
        "run.in",
        &[
            ("steps", &schedule.steps.to_string()),
            ("batch", &schedule.cadence.hand_over.to_string()),
            ("look", &look.to_string()),
            ("samples", &(schedule.cadence.hand_over / look).to_string()),
            ("variables", &events.variables(end)),
            ("set_up", &templates.fill("set_up.in", &[("label", "ready")])?),
            ("hold", &templates.fill("hold.in", &[])?),
            ("carry", &events.carry(look)?),
            ("define", &define),
            ("first_sample", &first),
            ("sample", &sample),
            ("events", &events.between_batches()?),
            ("removals", &removals),
            ("ends", &events.ends(end)?),
            ("columns", COLUMNS),
        ],
    )
}

/// What is done every M time steps: ghosts go on, some are released, gates are looked at.
fn samples(
    order: &DeckOrder<'_>,
    gates: &[GateText<'_>],
    walls: &WallText<'_>,
    templates: &Templates,
    first: bool,
) -> Result<String, String> {
    let mut text = ghosts(order, first);
    let contacts = order.records_contacts();
    if contacts {
        text += &format!("group {FRESH} subtract {FRESH} all\n");
    }
    for gate in gates {
        text += &gate.sample(templates, contacts)?;
    }
    if contacts {
        let style = &walls.models.pair_style;
        let history = history_numbers(!style.contains("no_history"), style.contains("epsd2"));
        text += "# contacts of who has passed\n";
        text += &format!("group {TOUCH} subtract {TOUCH} all\ngroup {TOUCH} variable {TOUCH}\n");
        let arguments = dump_arguments("pairs", PAIR_COLUMNS + history);
        text += &format!("write_dump {TOUCH} local {PAIRS_FILE} {arguments}\n");
        if walls.looks_at_contacts() {
            let arguments = dump_arguments("walls", WALL_COLUMNS + history);
            text += &format!("write_dump {FRESH} local {WALLS_FILE} {arguments}\n");
        }
    }
    Ok(text)
}

fn ghosts(order: &DeckOrder<'_>, first: bool) -> String {
    let kinds = order.ghosts;
    if !kinds.any() {
        return String::new();
    }
    let mut text = Vec::new();
    if kinds.recorded {
        text.push("# ghosts on recorded paths are put where they belong".to_owned());
        text.extend((!first).then(|| replay::STEER_NEXT.to_owned()));
        text.push(replay::STEER_SET.to_owned());
    }
    text.push("# ghosts whose time has come are ordinary particles from now on".to_owned());
    text.extend((!first).then(|| replay::RELEASE_NEXT.to_owned()));
    text.extend(replay::RELEASE.map(str::to_owned));
    let groups =
        [(kinds.constant, groups::CONSTANT), (kinds.ballistic, groups::BALLISTIC), (kinds.recorded, groups::RECORDED)];
    text.extend(groups.iter().filter(|(there, _)| *there).map(|(_, group)| replay::leave(group)));
    text.push(replay::ARRIVALS_DUMP.to_owned());
    lines(text)
}
