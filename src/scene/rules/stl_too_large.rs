//! `stl-too-large` (error): an STL file has no unit, and drawings are made in millimetres; read as metres they are 1000
//! times too large.
//!
//! Suspected where a part without `scale` is more than 300 times as large as everything else in the scene and more than
//! 3000 of the largest particles, or, where there is nothing to compare, more than 100 000 of them.

use super::{Subject, join, round};
use crate::dem::feed::{FeedKind, Region};
use crate::geometry::part::Surface;
use crate::math::Bounds;
use crate::scene::extent;

const OTHERS: f64 = 300.0;
const PARTICLES_BESIDE_OTHERS: f64 = 3_000.0;
const PARTICLES_ALONE: f64 = 100_000.0;

pub(super) fn check(subject: &Subject<'_>) {
    if subject.largest == 0.0 {
        return;
    }
    let others = others(subject);
    for part in &subject.draft.parts {
        if part.item.file.is_some() && !subject.written.has_path(&join(&part.path, "scale")) {
            let size = largest_edge(&extent::of_surface(&part.item.part.surface));
            judge(subject, &join(&part.path, "file"), size, others);
        }
    }
    for feed in &subject.draft.feeds {
        let path = join(&feed.path, "region");
        if let FeedKind::Fill { region: Region::Inside(mesh), .. } = &feed.item.kind
            && !subject.written.has_path(&join(&path, "scale"))
        {
            let size = largest_edge(&extent::of_surface(&Surface::Mesh(mesh.clone())));
            judge(subject, &join(&path, "file"), size, others);
        }
    }
}

fn judge(subject: &Subject<'_>, path: &str, size: f64, others: Option<f64>) {
    let particles = size / subject.largest;
    let suspect = match others {
        Some(others) => size > OTHERS * others && particles > PARTICLES_BESIDE_OTHERS,
        None => particles > PARTICLES_ALONE,
    };
    if suspect {
        subject.error(
            "stl-too-large",
            path,
            format!(
                "the surface is {} m large, {} times the largest particle: probably drawn in millimetres",
                round(size),
                round(particles)
            ),
            "add `scale = 0.001` if the file is in millimetres, or `scale = 1` if it is really in metres",
        );
    }
}

/// The largest edge of all that is not from an STL file [m].
fn others(subject: &Subject<'_>) -> Option<f64> {
    let mut bounds = Bounds::EMPTY;
    for part in subject.draft.parts.iter().filter(|part| part.item.file.is_none()) {
        if !matches!(part.item.part.surface, Surface::Plane { .. }) {
            bounds = bounds.union(&extent::of_surface(&part.item.part.surface));
        }
    }
    for feed in &subject.draft.feeds {
        if !matches!(&feed.item.kind, FeedKind::Fill { region: Region::Inside(_), .. }) {
            bounds = bounds.union(&extent::of_feed(&feed.item.kind));
        }
    }
    Some(largest_edge(&bounds)).filter(|edge| *edge > 0.0)
}

fn largest_edge(bounds: &Bounds) -> f64 {
    if bounds.is_empty() { 0.0 } else { bounds.size().max() }
}
