//! `duplicate-name` (error): feeds, parts, gates, stages and measures go by their names in results and overrides.

use super::Subject;

pub(super) fn check(subject: &Subject<'_>) {
    let names = &subject.draft.names;
    for (index, (kind, name, place)) in names.iter().enumerate() {
        if names[..index].iter().any(|(other_kind, other, _)| other_kind == kind && other == name) {
            subject.report.error(
                "duplicate-name",
                place,
                format!("there is another {kind} called \"{name}\""),
                "give each its own name",
            );
        }
    }
}
