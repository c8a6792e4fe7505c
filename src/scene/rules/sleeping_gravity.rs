//! `sleeping-gravity` (error): a sleeper wakes at a share of its weight. Without gravity it has none, and the least touch would do.

use super::Subject;

pub(super) fn check(subject: &Subject<'_>) {
    if subject.draft.solver.sleeping.is_some() && subject.draft.gravity.norm_squared() == 0.0 {
        subject.error(
            "sleeping-gravity",
            "solver.sleeping",
            "without gravity there is no weight to wake a sleeper at a share of".to_owned(),
            "remove `sleeping`, or set `gravity`",
        );
    }
}
