//! `replay-window` (error): a window of a stream that is empty, or that starts when the stage has ended.

use super::{Subject, join, round};
use crate::scene::gate::Clock;

pub(super) fn check(subject: &Subject<'_>) {
    let draft = subject.draft;
    if !draft.stages.whole {
        return;
    }
    for stage in &draft.stages.stages {
        let end = stage.item.end.or(draft.end).map(|end| end.time);
        for (index, replay) in stage.item.replays.iter().enumerate() {
            let path = |key: &str| join(&stage.path, &format!("replay.{index}.{key}"));
            let [from, until] = replay.window;
            if until <= from {
                let what = format!("the window ends at {} s, and starts at {} s", round(until), round(from));
                subject.error("replay-window", &path("until"), what, "make `until` later than `from`");
            } else if replay.clock == Clock::Plant && end.is_some_and(|end| from >= end) {
                let end = round(end.unwrap_or(f64::NAN));
                let what = format!("the window starts at {} s, and the stage ends at {end} s", round(from));
                let next = "start it earlier, end the stage later, or write `clock = \"first-passage\"`";
                subject.error("replay-window", &path("from"), what, next);
            }
        }
    }
}
