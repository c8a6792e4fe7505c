//! What LIGGGHTS prints, line by line.
//!
//! It is started with `-echo both`, so that every command stands on the screen before what it has to say: that is how deletions get
//! the name of their region, and errors the line of the deck. Tables are read by their headers, wherever a column stands.

use crate::backend::stage::EndReason;
use std::collections::VecDeque;

/// A printed line.
#[derive(Debug, Clone, PartialEq)]
pub enum Line {
    /// The version, from the first line.
    Version(String),
    /// A row of the table of a run.
    Thermo {
        /// Time step.
        step: u64,
        /// Particles in the box, ghosts among them.
        atoms: u64,
        /// Kinetic energy [J]; not finite where the run has become unstable.
        kinetic_energy: f64,
    },
    /// The deck says that a part has appeared or disappeared.
    Event {
        /// The part.
        part: String,
        /// It is there from now on.
        present: bool,
        /// Time step.
        step: u64,
    },
    /// The deck says that it is through.
    End {
        /// Why.
        reason: EndReason,
        /// Last time step.
        step: u64,
    },
    /// Particles were deleted.
    Deleted {
        /// The region or group whose particles were deleted.
        what: String,
        /// How many.
        count: u64,
        /// Time step of the last row.
        step: u64,
    },
    /// A warning, in LIGGGHTS' words.
    Warning(String),
    /// An error, in LIGGGHTS' words; what follows may belong to it, see [`Screen::error`].
    Error(String),
    /// It was told from outside to stop.
    ToldToStop,
    /// Anything else.
    Other,
}

/// Where the columns of the present table stand.
#[derive(Debug, Clone, Copy)]
struct Columns {
    count: usize,
    step: usize,
    atoms: usize,
    kinetic_energy: usize,
}

/// Reads the screen of one case.
#[derive(Debug, Default)]
pub struct Screen {
    columns: Option<Columns>,
    /// Region or group of the last command that deletes.
    deleting: String,
    step: u64,
    recent: VecDeque<String>,
    error: Vec<String>,
    error_is_open: bool,
}

/// Lines kept to find the place of an error: enough for the commands of a batch.
const RECENT: usize = 400;
/// Longest line kept [bytes]; commands with thousands of numbers are known by their beginning.
const LONGEST: usize = 2000;
/// Lines of an error; the longest that LIGGGHTS writes have seven.
const ERROR_LINES: usize = 12;

impl Screen {
    /// Understands the next line, given without its end.
    pub fn read(&mut self, line: &str) -> Line {
        let line = line.trim_end();
        if self.error.is_empty() && !line.is_empty() {
            if self.recent.len() == RECENT {
                self.recent.pop_front();
            }
            self.recent.push_back(beginning(line, LONGEST).to_owned());
        }
        self.continue_error(line);
        self.row(line)
            .or_else(|| said_by_deck(line))
            .or_else(|| self.deleted(line))
            .or_else(|| self.complaint(line))
            .or_else(|| version(line).map(Line::Version))
            .unwrap_or(Line::Other)
    }

    /// The first error with the lines that belong to it; empty where there was none.
    #[must_use]
    pub fn error(&self) -> String {
        self.error.join("\n")
    }

    /// The last lines, none of them after the first error.
    #[must_use]
    pub fn recent(&self) -> &VecDeque<String> {
        &self.recent
    }

    /// A table's header or row.
    fn row(&mut self, line: &str) -> Option<Line> {
        let first = line.trim_start().bytes().next()?;
        if first == b'S' && line.trim_start().starts_with("Step ") {
            self.columns = columns(line);
            return None;
        }
        if !first.is_ascii_digit() {
            return None;
        }
        let columns = self.columns?;
        let values: Vec<&str> = line.split_ascii_whitespace().collect();
        if values.len() != columns.count || values.iter().any(|value| value.parse::<f64>().is_err()) {
            return None;
        }
        let step = values[columns.step].parse().ok()?;
        let atoms = values[columns.atoms].parse().ok()?;
        let kinetic_energy = values[columns.kinetic_energy].parse().ok()?;
        self.step = step;
        Some(Line::Thermo { step, atoms, kinetic_energy })
    }

    fn deleted(&mut self, line: &str) -> Option<Line> {
        if let Some(command) = line.trim_start().strip_prefix("delete_atoms ") {
            self.deleting = command.split_ascii_whitespace().nth(1).unwrap_or_default().to_owned();
            return None;
        }
        let (count, _) = line.strip_prefix("Deleted ")?.split_once(" atoms, new total = ")?;
        Some(Line::Deleted { what: self.deleting.clone(), count: count.parse().ok()?, step: self.step })
    }

    /// Warnings and errors.
    fn complaint(&mut self, line: &str) -> Option<Line> {
        if line.starts_with("SIGINT/SIGTERM caught") {
            return Some(Line::ToldToStop);
        }
        if let Some(text) = line.strip_prefix("WARNING:").or_else(|| after_processor(line, "WARNING on proc ")) {
            return Some(Line::Warning(without_source(text).to_owned()));
        }
        let text = line.strip_prefix("ERROR:").or_else(|| after_processor(line, "ERROR on proc "))?;
        if self.error.is_empty() {
            // What was printed before it tells its place.
            self.recent.pop_back();
            self.error.push(without_source(text).to_owned());
            self.error_is_open = !has_source(text);
        }
        Some(Line::Error(without_source(text).to_owned()))
    }

    fn continue_error(&mut self, line: &str) {
        if self.error_is_open && self.error.len() < ERROR_LINES && !line.starts_with("ERROR") {
            self.error_is_open = !has_source(line);
            let text = without_source(line);
            self.error.extend((!text.is_empty()).then(|| text.to_owned()));
        }
    }
}

fn columns(header: &str) -> Option<Columns> {
    let names: Vec<&str> = header.split_ascii_whitespace().collect();
    let place = |name: &str| names.iter().position(|&other| other == name);
    Some(Columns { count: names.len(), step: place("Step")?, atoms: place("Atoms")?, kinetic_energy: place("KinEng")? })
}

/// What the deck prints for us: `tollgate event PART 0|1 STEP`, `tollgate end REASON STEP`.
fn said_by_deck(line: &str) -> Option<Line> {
    let words: Vec<&str> = line.strip_prefix("tollgate ")?.split_ascii_whitespace().collect();
    match words[..] {
        ["event", part, present @ ("0" | "1"), step] => {
            Some(Line::Event { part: part.to_owned(), present: present == "1", step: whole(step)? })
        }
        ["end", reason, step] => Some(Line::End { reason: end_reason(reason)?, step: whole(step)? }),
        _ => None,
    }
}

fn end_reason(word: &str) -> Option<EndReason> {
    Some(match word {
        "time" => EndReason::Time,
        "rest" => EndReason::AtRest,
        "empty" => EndReason::Empty,
        "count" => EndReason::LeftCount,
        _ => return None,
    })
}

/// A time step; variables print large ones as 1e+06.
fn whole(text: &str) -> Option<u64> {
    text.parse().ok().or_else(|| {
        let number: f64 = text.parse().ok()?;
        (number >= 0.0 && number < 2.0_f64.powi(53) && number.fract() == 0.0).then_some(number as u64)
    })
}

/// The version in LIGGGHTS' first line, as `3.8.0`.
#[must_use]
pub fn version(line: &str) -> Option<String> {
    let (_, after) = line.strip_prefix("LIGGGHTS (Version ")?.split_once(' ')?;
    Some(after.split([',', ')']).next()?.trim().to_owned())
}

/// What follows `PREFIX NUMBER:`.
fn after_processor<'a>(line: &'a str, prefix: &str) -> Option<&'a str> {
    let (number, text) = line.strip_prefix(prefix)?.split_once(':')?;
    number.bytes().all(|byte| byte.is_ascii_digit()).then_some(text)
}

/// True where the place in LIGGGHTS' own source ends the text.
fn has_source(text: &str) -> bool {
    text.contains("(./src/") || text.contains("(../src/") || text.contains(".cpp:")
}

/// Without the place in LIGGGHTS' own source, and what was in its memory behind it.
fn without_source(text: &str) -> &str {
    let end = text.find("(./src/").or_else(|| text.find("(../src/")).unwrap_or(text.len());
    text[..end].trim()
}

/// At most the first `limit` bytes, whole characters.
pub(super) fn beginning(text: &str, limit: usize) -> &str {
    let mut end = limit.min(text.len());
    while !text.is_char_boundary(end) {
        end -= 1;
    }
    &text[..end]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(text: &str) -> (Vec<Line>, Screen) {
        let mut screen = Screen::default();
        let lines = text.lines().map(|line| screen.read(line)).filter(|line| *line != Line::Other).collect();
        (lines, screen)
    }

    #[test]
    fn tables_are_read_by_their_headers() {
        let (lines, _) = all("1 2 3\n    Step    Atoms         KinEng \n       0        3              0 \n\
                              Loop time of 1 on 1 procs\n      20        3   4.8e-10 \n      40        3   -nan\n 40 3\n 40 3 x\n");
        let row = |step, kinetic_energy| Line::Thermo { step, atoms: 3, kinetic_energy };
        assert_eq!(lines[..2], [row(0, 0.0), row(20, 4.8e-10)]);
        assert!(matches!(lines[2], Line::Thermo { step: 40, kinetic_energy, .. } if kinetic_energy.is_nan()));
        assert_eq!(lines.len(), 3, "numbers without a header, too few of them, and none are no rows");
        let (lines, _) = all("Step CPU KinEng Atoms\n5 0.1 2.5 7\n");
        assert_eq!(lines, [Line::Thermo { step: 5, atoms: 7, kinetic_energy: 2.5 }]);
    }

    #[test]
    fn the_deck_is_understood_and_its_echo_is_not() {
        let (lines, _) =
            all("print \"tollgate end time ${st}\"\ntollgate event gate-1 0 400\ntollgate event lid 1 1e+06\n\
                              tollgate end rest 500\ntollgate end someday 500\ntollgate end time 1.5\n");
        let event = |part: &str, present, step| Line::Event { part: part.to_owned(), present, step };
        let end = Line::End { reason: EndReason::AtRest, step: 500 };
        assert_eq!(lines, [event("gate-1", false, 400), event("lid", true, 1_000_000), end]);
    }

    #[test]
    fn deletions_have_their_region() {
        let (lines, _) =
            all("Step Atoms KinEng\n100 9 1\ndelete_atoms region below compress no\nDeleted 4 atoms, new total = 5\n");
        assert_eq!(lines[1], Line::Deleted { what: "below".into(), count: 4, step: 100 });
    }

    #[test]
    fn errors_are_freed_of_what_follows_them() {
        let (lines, screen) = all(
            "fix hop all mesh/surface file a.stl type 1\nERROR on proc 0: Cannot open mesh file a.stl (./src/a.cpp:105)\n\
                                   \u{fffd}D[ (./src/a.cpp:105)\nERROR on proc 1: Cannot open\n",
        );
        assert_eq!(lines[0], Line::Error("Cannot open mesh file a.stl".into()));
        assert_eq!(screen.error(), "Cannot open mesh file a.stl");
        assert_eq!(screen.recent().back().unwrap(), "fix hop all mesh/surface file a.stl type 1");
    }

    #[test]
    fn an_error_of_several_lines_is_whole() {
        let text = "ERROR: Mesh (id hop): 1 mesh elements have been lost / left the domain. \nPlease use boundary m\n (./src/m.h:605)\nrest\n";
        assert_eq!(
            all(text).1.error(),
            "Mesh (id hop): 1 mesh elements have been lost / left the domain.\nPlease use boundary m"
        );
    }

    #[test]
    fn long_lines_are_cut_between_characters() {
        assert_eq!((beginning("a\u{e4}b", 2), beginning("a\u{e4}b", 3), beginning("ab", 9)), ("a", "a\u{e4}", "ab"));
    }

    #[test]
    fn warnings_and_the_version_are_found() {
        let (lines, _) = all("LIGGGHTS (Version LIGGGHTS-PUBLIC 3.8.0, compiled 2022 by x, git commit unknown)\n\
                              WARNING: Lost atoms: original 2 current 1 (./src/thermo.cpp:454)\nSIGINT/SIGTERM caught - Writing\n");
        let warning = Line::Warning("Lost atoms: original 2 current 1".into());
        assert_eq!(lines, [Line::Version("3.8.0".into()), warning, Line::ToldToStop]);
    }
}
