//! What is declared and never used is often a slip in a name.
//!
//! - `unused-particle` (warning): no feed draws from the class.
//! - `unused-material` (warning): neither a particle class nor a part nor an initial state is made of it.

use super::Subject;
use crate::dem::feed::FeedKind;

pub(super) fn check(subject: &Subject<'_>) {
    let draft = subject.draft;
    if subject.report.has_errors() || draft.start_checkpoint.is_some() || subject.has_stored_stream() {
        // What is broken may use it, and a checkpoint or a stored stream brings particles of its own.
        return;
    }
    for (index, class) in draft.classes.iter().enumerate() {
        let used = draft.feeds.iter().any(|feed| match feed.item.kind {
            FeedKind::Fill { class, .. } | FeedKind::Stream { class, .. } => class == index,
            FeedKind::File { .. } => false,
        });
        if let (false, Some(class), path) = (used, &class.item, &class.path) {
            let what = format!("no feed draws from particle class \"{}\"", class.name);
            subject.warning("unused-particle", path, what, "remove it, or name it in a [[feed]]");
        }
    }
    let particles = subject.particle_materials();
    for (index, material) in draft.materials.iter().enumerate() {
        let is = |other: u16| usize::from(other) == index;
        let used = particles.iter().any(|m| is(*m)) || draft.parts.iter().any(|part| is(part.item.part.material));
        if !used {
            let what = format!("nothing is made of material \"{}\"", material.name);
            subject.warning("unused-material", &format!("material.{}", material.name), what, "remove it, or use it");
        }
    }
}
