//! What is known of a case while it runs, and when it must be stopped.

use super::launch::{Deleted, Event, Finished};
use super::probe::{self, Unusable};
use super::screen::Line;
use crate::backend::stage::EndReason;
use crate::output::progress::Status;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Most different warnings that are kept; those with numbers in them never end.
const MOST_WARNINGS: usize = 200;

/// Why a case is stopped, or is not what was asked for.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Trouble {
    /// The program is of another version.
    Incapable(Unusable),
    /// Numbers are no longer finite.
    NotFinite { step: u64 },
    /// The wall time is over.
    TimeLimit,
    /// It was told from outside to stop, and not by us.
    ToldToStop { step: u64 },
    /// The deck did not come to its end.
    NoEnd { step: Option<u64> },
    /// It came to its end at another time step than it was to.
    WrongEnd { said: u64, printed: Option<u64>, asked: u64 },
    /// Told already.
    Failed(String),
}

impl Trouble {
    /// In the user's words.
    pub fn text(&self, time_limit: f64) -> String {
        match self {
            Self::Incapable(unusable) => unusable.to_string(),
            Self::NotFinite { step } => format!(
                "the kinetic energy in LIGGGHTS is not a number, first seen at time step {step}: particles were too near to each other, \
                 or the time step is too long; look at the frames before it, at what enters, and choose a smaller time step"
            ),
            Self::TimeLimit => {
                format!("LIGGGHTS was stopped after its time limit of {time_limit} s ([liggghts] time_limit)")
            }
            Self::ToldToStop { step } => {
                format!("LIGGGHTS was asked from outside to stop (SIGINT or SIGTERM), after time step {step}")
            }
            Self::NoEnd { step } => {
                let reached =
                    step.map_or_else(|| "before its first time step".to_owned(), |step| format!("at time step {step}"));
                format!("LIGGGHTS ended {reached} without a word, and its deck was not at its end")
            }
            Self::WrongEnd { said, printed, asked } => {
                let printed = printed.map_or_else(|| "none".to_owned(), |step| step.to_string());
                format!(
                    "the case ended at time step {said}, the last one printed is {printed}, and {asked} were asked for; \
                     lines of your own must neither run nor reset time steps"
                )
            }
            Self::Failed(text) => text.clone(),
        }
    }
}

/// Gathers what is printed.
#[derive(Debug)]
pub(super) struct Watch {
    timestep: f64,
    program: PathBuf,
    step: Option<u64>,
    end_step: u64,
    trouble: Option<Trouble>,
    error: Option<Instant>,
    finished: Finished,
}

impl Watch {
    /// Of a case with time step `timestep` [s] that `program` runs.
    pub fn new(timestep: f64, program: &Path) -> Self {
        let program = program.to_path_buf();
        Self { timestep, program, step: None, end_step: 0, trouble: None, error: None, finished: Finished::default() }
    }

    /// Takes note of a line; gives back what the user should read at once.
    pub fn take(&mut self, line: Line) -> Option<String> {
        match line {
            Line::Version(version) => {
                let refused = probe::check_version(&self.program, &version).err();
                self.note(refused.map(Trouble::Incapable));
            }
            Line::Thermo { step, atoms, kinetic_energy } => {
                self.step = Some(step);
                self.finished.steps = step;
                self.finished.atoms = atoms;
                self.note((!kinetic_energy.is_finite()).then_some(Trouble::NotFinite { step }));
            }
            Line::Event { part, present, step } => {
                let text =
                    format!("part '{part}' {} at time step {step}", if present { "appears" } else { "disappears" });
                self.finished.events.push(Event { part, present, step });
                return Some(text);
            }
            Line::End { reason, step } => {
                self.finished.end = Some(reason);
                self.end_step = step;
            }
            Line::Deleted { what, count, step } if count > 0 => {
                self.finished.deleted.push(Deleted { what, count, step })
            }
            Line::Warning(text)
                if !self.finished.warnings.contains(&text) && self.finished.warnings.len() < MOST_WARNINGS =>
            {
                let said = format!("LIGGGHTS warns: {text}");
                self.finished.warnings.push(text);
                return Some(said);
            }
            Line::ToldToStop => self.note(Some(Trouble::ToldToStop { step: self.step.unwrap_or(0) })),
            Line::Error(_) => self.error = self.error.or_else(|| Some(Instant::now())),
            Line::Deleted { .. } | Line::Warning(_) | Line::Other => {}
        }
        None
    }

    /// The first trouble counts.
    fn note(&mut self, trouble: Option<Trouble>) {
        self.trouble = self.trouble.take().or(trouble);
    }

    /// Why it must be stopped; a rank that is asked to stop is so by another one's error, which is told instead.
    pub fn trouble(&self) -> Option<Trouble> {
        self.trouble.clone().filter(|trouble| !matches!(trouble, Trouble::ToldToStop { .. }))
    }

    /// True where it was asked from outside to stop, and has not said that it was at its end.
    pub fn told_to_stop(&self) -> Option<Trouble> {
        self.trouble.clone().filter(|_| self.finished.end.is_none())
    }

    /// True where an error was printed so long ago.
    pub fn has_error_for(&self, time: Duration) -> bool {
        self.error.is_some_and(|since| since.elapsed() > time)
    }

    /// What is wrong with a case that has ended without an error.
    pub fn unfinished(&self, steps: u64) -> Option<Trouble> {
        let said = self.end_step;
        match self.finished.end {
            None => Some(self.trouble.clone().unwrap_or(Trouble::NoEnd { step: self.step })),
            Some(reason) => {
                let is_as_asked = if reason == EndReason::Time { said == steps } else { said <= steps };
                let is_right = is_as_asked && self.step == Some(said);
                (!is_right).then_some(Trouble::WrongEnd { said, printed: self.step, asked: steps })
            }
        }
    }

    /// The time step printed last.
    pub fn step(&self) -> Option<u64> {
        self.step
    }

    /// The same in words.
    pub fn last_step(&self) -> String {
        self.step.map_or_else(|| "none".to_owned(), |step| step.to_string())
    }

    /// For the line of progress.
    pub fn status(&self) -> Status {
        let steps = self.step.unwrap_or(0);
        Status { time: steps as f64 * self.timestep, steps, particles: self.finished.atoms }
    }

    /// What was printed; times and memory are not known here.
    pub fn finished(&self) -> Finished {
        self.finished.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn watch(lines: impl IntoIterator<Item = Line>) -> Watch {
        let mut watch = Watch::new(1e-5, Path::new("liggghts"));
        for line in lines {
            watch.take(line);
        }
        watch
    }

    fn row(step: u64, kinetic_energy: f64) -> Line {
        Line::Thermo { step, atoms: 2, kinetic_energy }
    }

    fn end(reason: EndReason, step: u64) -> Line {
        Line::End { reason, step }
    }

    #[test]
    fn a_case_is_finished_at_the_step_that_was_asked_for() {
        assert_eq!(watch([row(100, 1.0), end(EndReason::Time, 100)]).unfinished(100), None);
        assert_eq!(watch([row(60, 1.0), end(EndReason::AtRest, 60)]).unfinished(100), None);
        let wrong = |said, printed| Some(Trouble::WrongEnd { said, printed: Some(printed), asked: 100 });
        assert_eq!(watch([row(80, 1.0), end(EndReason::Time, 80)]).unfinished(100), wrong(80, 80));
        assert_eq!(watch([row(80, 1.0), end(EndReason::Time, 100)]).unfinished(100), wrong(100, 80));
        assert_eq!(watch([row(120, 1.0), end(EndReason::AtRest, 120)]).unfinished(100), wrong(120, 120));
        assert_eq!(watch([row(100, 1.0)]).unfinished(100), Some(Trouble::NoEnd { step: Some(100) }));
        assert_eq!(watch([row(60, 1.0), Line::ToldToStop]).unfinished(100), Some(Trouble::ToldToStop { step: 60 }));
    }

    #[test]
    fn the_first_number_that_is_none_counts() {
        let watch = watch([row(20, 1.0), row(40, f64::NAN), row(60, f64::INFINITY)]);
        assert_eq!(watch.trouble(), Some(Trouble::NotFinite { step: 40 }));
    }

    #[test]
    fn warnings_are_kept_once_and_empty_deletions_not_at_all() {
        let mut watch = watch([Line::Deleted { what: "below".into(), count: 0, step: 1 }]);
        let warning = || Line::Warning("odd".into());
        assert_eq!(watch.take(warning()).as_deref(), Some("LIGGGHTS warns: odd"));
        assert_eq!(watch.take(warning()), None);
        watch.take(Line::Deleted { what: "below".into(), count: 3, step: 2 });
        let finished = watch.finished();
        assert_eq!(finished.warnings, ["odd"]);
        assert_eq!(finished.deleted, [Deleted { what: "below".into(), count: 3, step: 2 }]);
    }

    #[test]
    fn another_version_is_trouble() {
        assert!(watch([Line::Version("3.8.0".into())]).trouble().is_none());
        assert!(matches!(watch([Line::Version("3.6.1".into())]).trouble(), Some(Trouble::Incapable(_))));
    }
}
