//! `replay-loops` (error): how often a stream is replayed: at least once, with a gap between two loops, and to an end before
//! the stage ends.

use super::{Subject, join, round};

pub(super) fn check(subject: &Subject<'_>) {
    let draft = subject.draft;
    if !draft.stages.whole {
        return;
    }
    for stage in &draft.stages.stages {
        let end = stage.item.end.or(draft.end).map(|end| end.time);
        for (index, replay) in stage.item.replays.iter().enumerate() {
            let path = |key: &str| join(&stage.path, &format!("replay.{index}.{key}"));
            let error = |key: &str, what: String, next: &str| subject.error("replay-loops", &path(key), what, next);
            let gaps = replay.loops.saturating_sub(1) as f64 * replay.gap;
            if replay.loops == 0 {
                error(
                    "loops",
                    "a stream that is replayed 0 times brings nothing".to_owned(),
                    "write `loops = 1` or more",
                );
            } else if replay.loops == 1 && subject.written.has_path(&path("gap")) {
                let next = "add `loops = 2` or more, or remove it";
                error("gap", "`gap` stands between two loops, and the stream is replayed once".to_owned(), next);
            } else if replay.loops > 1 && replay.gap == 0.0 {
                let next = "add for example `gap = \"0.1 s\"`";
                error("loops", "the last particle of one loop would meet the first of the next".to_owned(), next);
            } else if end.is_some_and(|end| gaps >= end) {
                let (gaps, end) = (round(gaps), round(end.unwrap_or(f64::NAN)));
                let what =
                    format!("the loops never end: their gaps alone last {gaps} s, and the stage ends at {end} s");
                error("loops", what, "ask for fewer loops, or end the stage later");
            }
        }
    }
}
