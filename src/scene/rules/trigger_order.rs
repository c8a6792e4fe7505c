//! `trigger-order` (error): a part that is gone before it appears, or that appears when the run is over.

use super::{Subject, join, round};
use crate::geometry::part::Trigger;

pub(super) fn check(subject: &Subject<'_>) {
    for part in &subject.draft.parts {
        let item = &part.item.part;
        if let (Trigger::At { time: appears }, Trigger::At { time: disappears }) = (item.appears, item.disappears)
            && disappears <= appears
        {
            let (from, to) = (round(appears), round(disappears));
            subject.error(
                "trigger-order",
                &join(&part.path, "disappears"),
                format!("part \"{}\" disappears at {to} s, and appears at {from} s", item.name),
                "let it appear before it disappears",
            );
        }
        if let (Trigger::At { time }, Some(end)) = (item.appears, subject.draft.end)
            && time > end.time
        {
            subject.error(
                "trigger-order",
                &join(&part.path, "appears"),
                format!(
                    "part \"{}\" appears at {} s, and the run ends at {} s",
                    item.name,
                    round(time),
                    round(end.time)
                ),
                "let it appear earlier, or end the run later",
            );
        }
    }
}
