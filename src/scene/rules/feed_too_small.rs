//! `feed-too-small` (error): the largest particle does not fit into the region or through the face.

use super::{Subject, join, mm};
use crate::dem::feed::{Face, FeedKind, Region};
use crate::math::Vec3;
use crate::particle::Body;
use crate::scene::extent;

pub(super) fn check(subject: &Subject<'_>) {
    let plane = subject.draft.body != Body::Sphere;
    for feed in &subject.draft.feeds {
        let Some((_, largest)) = subject.diameters(&feed.item) else { continue };
        let (key, room) = match &feed.item.kind {
            FeedKind::Fill { region, .. } => ("region", room(region, plane)),
            FeedKind::Stream { face, .. } => ("face", opening(face, plane)),
            FeedKind::File { .. } => continue,
        };
        // Equal within round-off fits.
        if room < largest * (1.0 - 1e-12) {
            subject.error(
                "feed-too-small",
                &join(&feed.path, key),
                format!("the largest particle ({}) does not fit: there is room for {}", mm(largest), mm(room)),
                "enlarge it, or feed smaller particles",
            );
        }
    }
}

/// The least width of a region [m], or for a mesh of its bounds.
fn room(region: &Region, plane: bool) -> f64 {
    let least = |size: Vec3| if plane { size.x.min(size.z) } else { size.min() };
    match region {
        Region::Box { minimum, maximum } => least(maximum - minimum),
        Region::Cylinder { start, end, radius } => {
            let length = (end - start).norm();
            if plane && (end - start).y.abs() > 0.5 * length { 2.0 * radius } else { length.min(2.0 * radius) }
        }
        Region::Inside(_) => least(extent::of_region(region).size()),
    }
}

/// The least width of a face [m].
fn opening(face: &Face, plane: bool) -> f64 {
    match face {
        Face::Disc { radius, .. } => 2.0 * radius,
        Face::Rectangle { side_a, side_b, .. } if plane => {
            let seen = |side: &Vec3| side.x.hypot(side.z);
            seen(side_a).max(seen(side_b))
        }
        Face::Rectangle { side_a, side_b, .. } => side_a.cross(side_b).norm() / side_a.norm().max(side_b.norm()),
    }
}
