//! Contacts of crossings, from text dumps of LIGGGHTS' local computes.
//!
//! LIGGGHTS has one `compute pair/gran/local` and one `compute wall/gran/local` in a deck, so one file of each serves all gates:
//! [`PAIRS_FILE`] and [`WALLS_FILE`], a snapshot at every sample (an empty one where nothing has passed). The computes stand
//! before the first run, that of the walls after their fix. They look at two groups only, which the deck fills at every sample:
//! [`FRESH`], what has come behind a gate plane since the last sample, and [`TOUCH`], `FRESH` and whatever may touch it.
//!
//! ```text
//! compute pairs touch pair/gran/local pos id force_normal force_tangential history delta
//! compute walls fresh wall/gran/local pos id force_normal force_tangential history delta
//! # at every sample, for each gate; behind_GATE is an atom-style variable, s >= 0, and was_GATE a group:
//! group fresh subtract fresh all
//! group touch subtract touch all
//! group behind_GATE subtract behind_GATE all
//! group behind_GATE variable behind_GATE
//! group fresh_GATE subtract fresh_GATE all
//! group fresh_GATE union fresh_GATE behind_GATE
//! group fresh_GATE subtract fresh_GATE was_GATE
//! group was_GATE subtract was_GATE all
//! group was_GATE union was_GATE behind_GATE
//! group fresh union fresh fresh_GATE
//! group touch variable touch_GATE
//! # once:
//! write_dump touch local contacts/pairs c_pairs[1] ... modify append yes format '%.10g ...'
//! write_dump fresh local contacts/walls c_walls[1] ... modify append yes format '%.10g ...'
//! ```
//!
//! On one rank `touch_GATE` is the box around `fresh_GATE` ([`touch_box`]), so that the dumps stay small. Several ranks learn of
//! a change of a group of their neighbours' particles only when neighbour lists are made: there it must be the whole slab within
//! a largest diameter and a skin of the plane ([`touch_slab`]), or pairs across ranks are missing.

/// Dump of contacts between particles, in the case.
pub const PAIRS_FILE: &str = "contacts/pairs";
/// Dump of contacts with walls, in the case.
pub const WALLS_FILE: &str = "contacts/walls";
/// Group of particles that have come behind a gate plane since the last sample, of all gates.
pub const FRESH: &str = "fresh";
/// Group of these and of whatever may touch them.
pub const TOUCH: &str = "touch";
/// Quantities of both computes where the contact model remembers something ([`history_numbers`] > 0).
pub const QUANTITIES: &str = "pos id force_normal force_tangential history delta";
/// Quantities of the compute of pairs where it does not; LIGGGHTS has no compute of walls then.
pub const QUANTITIES_WITHOUT_HISTORY: &str = "pos id force_normal force_tangential delta";

/// Columns of a pair besides the history: centre of i, centre of j, tag of i, tag of j, whether a periodic image, normal force
/// on i, tangential force on i; the history; overlap.
pub const PAIR_COLUMNS: usize = 16;
/// Columns of a wall contact besides the history: contact point, centre, mesh, triangle, tag, normal force on the particle,
/// tangential force on it; the history; overlap.
pub const WALL_COLUMNS: usize = 16;

/// Numbers that LIGGGHTS remembers of a contact: `tangential history` 3 (none with `no_history`), `rolling_friction epsd2` 3 more.
#[must_use]
pub const fn history_numbers(tangential_history: bool, epsd2: bool) -> usize {
    (if tangential_history { 3 } else { 0 }) + (if epsd2 { 3 } else { 0 })
}

/// What follows `write_dump GROUP local FILE`: columns of the compute `compute` of `columns` in all.
#[must_use]
pub fn dump_arguments(compute: &str, columns: usize) -> String {
    use std::fmt::Write;
    let mut text = String::new();
    (1..=columns).for_each(|column| drop(write!(text, "c_{compute}[{column}] ")));
    let format = vec!["%.10g"; columns].join(" ");
    let _ = write!(text, "modify append yes format '{format}'");
    text
}

/// Formula of the atom-style variable `touch_GATE` on one rank: the box around group `fresh`, wider by a largest diameter \[m\].
/// `open` says which of x, y, z are not periodic: across a periodic border the box does not reach.
#[must_use]
pub fn touch_box(fresh: &str, largest_diameter: f64, open: [bool; 3]) -> String {
    let mut terms = vec![format!("(count({fresh})>0)")];
    for axis in ["x", "y", "z"].into_iter().zip(open).filter_map(|(axis, open)| open.then_some(axis)) {
        terms.push(format!("({axis}>=bound({fresh},{axis}min)-{largest_diameter})"));
        terms.push(format!("({axis}<=bound({fresh},{axis}max)+{largest_diameter})"));
    }
    terms.join("*")
}

/// Formula of the atom-style variable `touch_GATE` on several ranks: `distance` is the formula of the centre's distance s from the
/// plane \[m\]; what has passed since the last sample lies within `travel` \[m\] behind it.
#[must_use]
pub fn touch_slab(distance: &str, largest_diameter: f64, skin: f64, travel: f64) -> String {
    // A radius more where the lowest point is what passes.
    let before = 1.5 * largest_diameter + skin;
    let behind = travel + largest_diameter + skin;
    format!("(({distance})>=-{before})*(({distance})<={behind})")
}
