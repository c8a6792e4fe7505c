//! The surface of a region to fill must say what is inside.
//!
//! - `region-open` (error): an open surface has no inside.
//! - `region-inverted` (error): a surface whose normals point inwards encloses the rest of the world.

use super::{Subject, join};
use crate::dem::feed::{FeedKind, Region};

pub(super) fn check(subject: &Subject<'_>) {
    for feed in &subject.draft.feeds {
        let FeedKind::Fill { region: Region::Inside(mesh), .. } = &feed.item.kind else { continue };
        let inspection = mesh.inspect();
        let path = join(&join(&feed.path, "region"), "file");
        if !inspection.is_closed() {
            subject.error(
                "region-open",
                &path,
                format!(
                    "the surface has no inside to fill: {} open edges, {} edges where the normals disagree",
                    inspection.open_edges, inspection.inconsistent_edges
                ),
                "close the surface where it was drawn, and export it again",
            );
        } else if inspection.inverted == Some(true) {
            subject.error(
                "region-inverted",
                &path,
                "the surface is inside out: its normals point inwards".to_owned(),
                "flip the normals where the surface was drawn, and export it again",
            );
        }
    }
}
