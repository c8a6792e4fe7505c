//! Findings: what is wrong with a scene, where, and what to do next. All of them at once.

use annotate_snippets::{AnnotationKind, Level, Renderer, Snippet};
use serde::Serialize;
use std::cell::RefCell;
use std::ops::Range;

/// How bad a finding is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// The scene cannot run.
    Error,
    /// The scene runs, but perhaps not as meant.
    Warning,
}

/// One finding.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Identifier of the rule; see [`ALL_IDS`] and `docs/rules.md`.
    pub rule: &'static str,
    /// How bad it is.
    pub severity: Severity,
    /// The scene file as it was named, or the `--set` that brought the value in.
    pub file: String,
    /// Line from 1; 0 for an override.
    pub line: usize,
    /// Column from 1, in characters; 0 for an override.
    pub column: usize,
    /// Bytes of the scene's text.
    pub span: Range<usize>,
    /// What is wrong.
    pub what: String,
    /// What to do next.
    pub next: String,
}

/// Every identifier a finding can have: first those of the reader, then the rules between several keys.
pub const ALL_IDS: &[&str] = &[
    // what the reader of single keys finds
    "bad-name",
    "bad-quantity",
    "bare-number",
    "file-unreadable",
    "given-twice",
    "initial-state",
    "key-not-here",
    "missing-key",
    "out-of-range",
    "set-path",
    "stl-unreadable",
    "toml-syntax",
    "unknown-key",
    "unknown-name",
    "unknown-unit",
    "unknown-version",
    "unknown-word",
    "wrong-dimension",
    "wrong-length",
    "wrong-type",
    "zero-vector",
    // what holds between keys
    "at-rest-never",
    "characteristic-velocity",
    "checkpoint-stages",
    "density-missing",
    "domain-empty",
    "duplicate-name",
    "elasticity-missing",
    "feed-crowded",
    "feed-in-geometry",
    "feed-nowhere",
    "feed-outside-domain",
    "feed-straddles",
    "feed-too-small",
    "feed-twice",
    "feed-window",
    "gap-too-narrow",
    "gate-aperture",
    "gate-gravity",
    "gate-outside-domain",
    "gate-periodic",
    "gate-recorder",
    "gate-unused",
    "ghost-zone",
    "interval-below-timestep",
    "liggghts-cadence",
    "measure-outside-domain",
    "measure-upstream",
    "motion-window",
    "no-feed",
    "pair-both",
    "pair-missing",
    "pair-twice",
    "part-nowhere",
    "path-storage",
    "periodic-extent",
    "periodic-part",
    "plane-gravity",
    "plane-hertz",
    "plane-region",
    "plane-thickness",
    "region-inverted",
    "region-open",
    "replay-loops",
    "replay-window",
    "rigid-pair",
    "rolling-friction",
    "rolling-friction-unused",
    "sieve-count",
    "sieve-sum",
    "size-cut",
    "size-order",
    "sleeping-gravity",
    "stage-cycle",
    "stage-empty",
    "stiffness-law",
    "stl-degenerate",
    "stl-inconsistent",
    "stl-inverted",
    "stl-non-manifold",
    "stl-open",
    "stl-too-large",
    "stream-standing",
    "stream-turned",
    "trigger-order",
    "unused-material",
    "unused-particle",
    "zone-length",
];

/// Where something stands: bytes of the scene's text, or an override.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Place {
    /// In the scene's text.
    File(Range<usize>),
    /// In an override, as given.
    Setting(String),
}

impl Place {
    /// Bytes of the scene's text.
    pub fn in_file(span: Range<usize>) -> Self {
        Self::File(span)
    }

    /// An override.
    pub fn in_setting(setting: String) -> Self {
        Self::Setting(setting)
    }

    /// First byte; overrides come last.
    pub fn start(&self) -> usize {
        match self {
            Self::File(span) => span.start,
            Self::Setting(_) => usize::MAX,
        }
    }
}

/// Collects findings while a scene is read.
#[derive(Debug)]
pub(crate) struct Report<'a> {
    file: &'a str,
    text: &'a str,
    findings: RefCell<Vec<Finding>>,
}

impl<'a> Report<'a> {
    /// An empty report about `text`, which came from `file`.
    pub fn new(file: &'a str, text: &'a str) -> Self {
        Self { file, text, findings: RefCell::default() }
    }

    /// An error.
    pub fn error(&self, rule: &'static str, place: &Place, what: impl Into<String>, next: impl Into<String>) {
        self.add(rule, Severity::Error, place, what.into(), next.into());
    }

    /// A warning.
    pub fn warning(&self, rule: &'static str, place: &Place, what: impl Into<String>, next: impl Into<String>) {
        self.add(rule, Severity::Warning, place, what.into(), next.into());
    }

    fn add(&self, rule: &'static str, severity: Severity, place: &Place, what: String, next: String) {
        debug_assert!(ALL_IDS.contains(&rule), "`{rule}` is not registered");
        let finding = match place {
            Place::File(span) => {
                let span = clip(self.text, span);
                let before = &self.text[..span.start];
                let line = before.matches('\n').count() + 1;
                let column = before.chars().rev().take_while(|c| *c != '\n').count() + 1;
                Finding { rule, severity, file: self.file.to_owned(), line, column, span, what, next }
            }
            Place::Setting(setting) => {
                Finding { rule, severity, file: setting.clone(), line: 0, column: 0, span: 0..0, what, next }
            }
        };
        self.findings.borrow_mut().push(finding);
    }

    /// True while nothing was found.
    pub fn is_empty(&self) -> bool {
        self.findings.borrow().is_empty()
    }

    /// True once an error was found.
    pub fn has_errors(&self) -> bool {
        self.findings.borrow().iter().any(|finding| finding.severity == Severity::Error)
    }

    /// The findings in the order of the file, errors before warnings at the same place.
    pub fn into_findings(self) -> Vec<Finding> {
        let mut findings = self.findings.into_inner();
        findings.sort_by(|a, b| {
            let key = |f: &Finding| (f.line == 0, f.span.start, f.severity);
            key(a).cmp(&key(b))
        });
        findings.dedup();
        findings
    }
}

/// `span` cut down to `text` and to its first line, on character borders.
fn clip(text: &str, span: &Range<usize>) -> Range<usize> {
    let border = |mut at: usize| {
        at = at.min(text.len());
        while !text.is_char_boundary(at) {
            at -= 1;
        }
        at
    };
    let (start, end) = (border(span.start), border(span.end.max(span.start)));
    let end = text[start..end].find('\n').map_or(end, |line| start + line);
    start..end
}

/// Findings as text for people: each with its line of `source`, a caret, and what to do next.
#[must_use]
pub fn render(findings: &[Finding], source: &str) -> String {
    let renderer = Renderer::plain();
    let mut text = String::new();
    for finding in findings {
        let level = match finding.severity {
            Severity::Error => Level::ERROR,
            Severity::Warning => Level::WARNING,
        };
        let next = Level::HELP.with_name(Some("next")).message(finding.next.as_str());
        let title = level.primary_title(finding.what.as_str()).id(finding.rule);
        let group = if finding.line > 0 {
            let span = clip(source, &finding.span);
            let snippet =
                Snippet::source(source).path(finding.file.as_str()).annotation(AnnotationKind::Primary.span(span));
            title.element(snippet).element(next)
        } else {
            title.element(annotate_snippets::Origin::path(finding.file.as_str())).element(next)
        };
        text.push_str(&renderer.render(&[group]));
        text.push_str("\n\n");
    }
    text
}

/// "did you mean" for a near miss, else the list of what is known.
pub(crate) fn hint(given: &str, known: &[&str]) -> String {
    if let Some(near) = nearest(given, known) {
        return format!("did you mean `{near}`?");
    }
    if known.is_empty() {
        return "none is known here".to_owned();
    }
    let mut names = known.to_vec();
    names.sort_unstable();
    names.dedup();
    format!("known: {}", names.join(", "))
}

/// The known word nearest to `given`, if fewer than three edits and less than half of it would have to change.
pub(crate) fn nearest<'a>(given: &str, known: &[&'a str]) -> Option<&'a str> {
    let length = given.chars().count();
    known
        .iter()
        .map(|word| (edit_distance(given, word), *word))
        .filter(|(distance, _)| *distance < 3 && 2 * distance <= length)
        .min()
        .map(|(_, word)| word)
}

/// Levenshtein distance (Levenshtein 1966); more than 40 characters count as far away.
fn edit_distance(a: &str, b: &str) -> usize {
    const LONGEST: usize = 40;
    let b: Vec<char> = b.chars().take(LONGEST + 1).collect();
    if a.chars().count() > LONGEST || b.len() > LONGEST {
        return usize::MAX;
    }
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let substitution = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = substitution.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_levenshteins() {
        for (a, b, distance) in [
            ("kitten", "sitting", 3),
            ("", "abc", 3),
            ("abc", "abc", 0),
            ("flaw", "lawn", 2),
            ("frction", "friction", 1),
        ] {
            assert_eq!(edit_distance(a, b), distance, "{a} {b}");
            assert_eq!(edit_distance(b, a), distance, "{b} {a}");
        }
    }

    #[test]
    fn a_near_miss_is_offered_and_else_all_names() {
        assert_eq!(hint("frction", &["friction", "restitution"]), "did you mean `friction`?");
        assert_eq!(hint("cohesion", &["friction", "between"]), "known: between, friction");
    }

    #[test]
    fn places_are_lines_and_columns_in_characters() {
        let text = "a = 1\nµ = 2\n";
        let report = Report::new("scene.toml", text);
        report.error("unknown-key", &Place::in_file(11..12), "wrong", "right");
        let findings = report.into_findings();
        assert_eq!((findings[0].line, findings[0].column), (2, 5));
    }

    #[test]
    fn a_rendered_finding_says_where_what_and_next() {
        let text = "a = 1\nbb = 2\n";
        let report = Report::new("some/scene.toml", text);
        report.error("unknown-key", &Place::in_file(6..8), "`bb` is no key of a scene", "did you mean `b`?");
        report.warning("no-feed", &Place::in_setting("--set a=2".into()), "nothing happens", "add a feed");
        let rendered = render(&report.into_findings(), text);
        for part in [
            "error[unknown-key]: `bb` is no key of a scene",
            "some/scene.toml:2:1",
            "bb = 2",
            "^^",
            "next: did you mean `b`?",
            "warning[no-feed]: nothing happens",
            "--set a=2",
            "next: add a feed",
        ] {
            assert!(rendered.contains(part), "{part} in\n{rendered}");
        }
    }

    #[test]
    fn identifiers_are_unique() {
        let mut ids = ALL_IDS.to_vec();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), ALL_IDS.len());
    }
}
