//! LIGGGHTS' errors in the user's words, with the line of the deck and what to do.

use super::files;
use super::screen::beginning;
use std::collections::VecDeque;
use std::fs;
use std::path::Path;

/// What an error means.
struct Meaning {
    /// Part of LIGGGHTS' text.
    says: &'static str,
    what: &'static str,
    next: &'static str,
}

const NOTHING_KNOWN: Meaning = Meaning {
    says: "",
    what: "LIGGGHTS stopped with an error",
    next: "look at that line; lines of your own come from [liggghts] and from your templates",
};

const OWN_LINES: &str = "look at lines of your own in [liggghts] and in your templates";
const BOX: &str = "make [domain] large enough for it, or cut it off";

/// The first that fits counts. The texts are those of 3.8.0.
const MEANINGS: [Meaning; 30] = [
    Meaning {
        says: "Substitution for illegal variable",
        what: "a variable is used that is not defined",
        next: OWN_LINES,
    },
    Meaning {
        says: "Invalid variable in next command",
        what: "a variable is used that is not defined",
        next: OWN_LINES,
    },
    Meaning { says: "Unknown command", what: "there is no such command", next: OWN_LINES },
    Meaning {
        says: "Invalid fix style",
        what: "this LIGGGHTS does not know the fix",
        next: "`tollgate doctor` says what it knows",
    },
    Meaning {
        says: "Invalid compute style",
        what: "this LIGGGHTS does not know the compute",
        next: "`tollgate doctor` says what it knows",
    },
    Meaning {
        says: "Invalid pair style",
        what: "this LIGGGHTS does not know the pair style",
        next: "`tollgate doctor` says what it knows",
    },
    Meaning {
        says: "Invalid atom style",
        what: "this LIGGGHTS does not know the atom style",
        next: "`tollgate doctor` says what it knows",
    },
    Meaning {
        says: "Invalid region style",
        what: "this LIGGGHTS does not know the region",
        next: "`tollgate doctor` says what it knows",
    },
    Meaning {
        says: "Invalid dump style",
        what: "this LIGGGHTS does not know the dump",
        next: "`tollgate doctor` says what it knows",
    },
    Meaning {
        says: "Invalid model specified",
        what: "this LIGGGHTS does not know the contact model",
        next: "`tollgate doctor` says which models it knows",
    },
    Meaning {
        says: "Cannot open mesh file",
        what: "a part's mesh is not there",
        next: "put the file into the case's meshes, or let tollgate write the case anew",
    },
    Meaning {
        says: "Corrupt STL file",
        what: "a part's mesh cannot be read",
        next: "write it as a text STL; `tollgate check` names what is wrong with a mesh",
    },
    Meaning {
        says: "mesh empty",
        what: "a part's mesh has no triangles",
        next: "write it as a text STL; `tollgate check` names what is wrong with a mesh",
    },
    Meaning { says: "left the domain", what: "a part reaches out of the box, or moves out of it", next: BOX },
    Meaning {
        says: "mesh elements",
        what: "a part's mesh has faults",
        next: "repair its triangles; `tollgate check` names what is wrong with a mesh",
    },
    Meaning {
        says: "Could not locate a fix/property storing value(s)",
        what: "a value of a material or a pair is missing",
        next: "give it in [material] or [[pair]]",
    },
    Meaning {
        says: "youngsModulus >= 5e6",
        what: "a material is softer than LIGGGHTS takes without being told",
        next: "write `soft_particles yes` behind `units si`",
    },
    Meaning {
        says: "youngsModulus",
        what: "LIGGGHTS refuses Young's modulus of a material",
        next: "write `soft_particles yes` or `hard_particles yes` behind `units si`",
    },
    Meaning {
        says: "Did not assign all atoms correctly",
        what: "a particle would enter outside of the box",
        next: BOX,
    },
    Meaning {
        says: "atom tag that is already used",
        what: "a particle would enter with a number that is taken",
        next: "let tollgate write the case anew",
    },
    Meaning {
        says: "Invalid atom ID in variable file",
        what: "a path is given for a particle that is not there",
        next: "let tollgate write the case anew",
    },
    Meaning {
        says: "Lost atoms",
        what: "particles left the box",
        next: "make [domain] larger or close the gap; without `thermo_modify lost error` they are only counted",
    },
    Meaning {
        says: "Cannot open input script",
        what: "a file of the case is not there",
        next: "let tollgate write the case anew",
    },
    Meaning {
        says: "Cannot open file",
        what: "a file of the case is not there",
        next: "let tollgate write the case anew",
    },
    Meaning {
        says: "Cannot open dump file",
        what: "LIGGGHTS cannot write into the case",
        next: "look at the rights and the free space of its folder",
    },
    Meaning {
        says: "Failed to allocate",
        what: "the memory is used up",
        next: "use fewer particles, or a computer with more memory",
    },
    Meaning {
        says: "Failed to reallocate",
        what: "the memory is used up",
        next: "use fewer particles, or a computer with more memory",
    },
    Meaning {
        says: "Atom sorting has bin size",
        what: "the box has become empty",
        next: "keep `atom_modify map array sort 0 0`",
    },
    Meaning {
        says: "More than one wall of type 'mesh'",
        what: "there are two walls made of meshes",
        next: "list all meshes in one `fix wall/gran`",
    },
    Meaning {
        says: "processor grid",
        what: "the ranks do not fill the processor grid",
        next: "let the product of [liggghts] processors be the number of ranks",
    },
];

/// An error as `what (LIGGGHTS' text), in FILE:LINE: COMMAND; next`.
pub(super) fn explain(case: &Path, error: &str, recent: &VecDeque<String>) -> String {
    let meaning = MEANINGS.iter().find(|meaning| error.contains(meaning.says)).unwrap_or(&NOTHING_KNOWN);
    let place = definition(case, error).or_else(|| place(case, recent));
    let place = place.map_or_else(String::new, |place| format!("\nat {place}"));
    format!("{}: {error}{place}\n{}", meaning.what, meaning.next)
}

/// The line that defines what an error names: a mesh is found to be wrong only when the run begins.
fn definition(case: &Path, error: &str) -> Option<String> {
    let (name, _) = error.split_once("(id ")?.1.split_once(')')?;
    let deck = Commands::read(case, files::DECK);
    let defines = |command: &str| command.strip_prefix("fix ").is_some_and(|rest| rest.split(' ').next() == Some(name));
    let (_, command) = deck.all.iter().find(|(_, command)| defines(command))?;
    deck.find(command)
}

/// The line that LIGGGHTS read last, as `FILE:LINE: COMMAND`.
fn place(case: &Path, recent: &VecDeque<String>) -> Option<String> {
    let deck = Commands::read(case, files::DECK);
    let included = recent.iter().rev().find_map(|line| included(line)).map(|file| Commands::read(case, file));
    recent.iter().rev().find_map(|line| {
        let find = |commands: &Commands| commands.find(line);
        included.as_ref().and_then(find).or_else(|| find(&deck))
    })
}

/// The file of a command that includes one.
fn included(line: &str) -> Option<&str> {
    let file = line.trim_start().strip_prefix("include ")?.trim();
    (!file.contains('$')).then_some(file)
}

/// The commands of a file, each with its line.
struct Commands {
    file: String,
    all: Vec<(usize, String)>,
}

impl Commands {
    /// None where it cannot be read.
    fn read(case: &Path, file: &str) -> Self {
        let text = fs::read(case.join(file)).unwrap_or_default();
        let mut all: Vec<(usize, String)> = Vec::new();
        let mut is_continued = false;
        for (index, line) in String::from_utf8_lossy(&text).lines().enumerate() {
            let trimmed = line.trim_end();
            let (piece, goes_on) = trimmed.strip_suffix('&').map_or((trimmed, false), |piece| (piece, true));
            match all.last_mut().filter(|_| is_continued) {
                Some((_, command)) => command.push_str(piece),
                None => all.push((index + 1, piece.to_owned())),
            }
            is_continued = goes_on;
        }
        for (_, command) in &mut all {
            *command = normal(command);
        }
        all.retain(|(_, command)| !command.is_empty() && !command.starts_with('#'));
        Self { file: file.to_owned(), all }
    }

    /// The command that was echoed: itself, or in the quotes of another.
    fn find(&self, echoed: &str) -> Option<String> {
        let echoed = normal(echoed);
        if echoed.is_empty() {
            return None;
        }
        let is_quoted = |command: &str| command.split('"').skip(1).step_by(2).any(|part| normal(part) == echoed);
        let (line, command) = self.all.iter().find(|(_, command)| *command == echoed || is_quoted(command))?;
        let shown = if *command == echoed { &echoed } else { &format!("{echoed} (in {})", first_words(command)) };
        Some(format!("{}:{line}: {}", self.file, shortened(shown)))
    }
}

/// With single spaces.
fn normal(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

fn first_words(command: &str) -> String {
    command.split(' ').take(2).collect::<Vec<_>>().join(" ")
}

/// Long commands are known by their beginning.
fn shortened(text: &str) -> String {
    const LIMIT: usize = 200;
    if text.len() <= LIMIT { text.to_owned() } else { format!("{}...", beginning(text, LIMIT)) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn case(deck: &str) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(files::DECK), deck).unwrap();
        folder
    }

    fn seen(lines: &[&str]) -> VecDeque<String> {
        lines.iter().map(|&line| line.to_owned()).collect()
    }

    #[test]
    fn the_last_echoed_line_of_the_deck_is_the_place() {
        let case = case("# a deck\nunits  si\nthermo &\n  ${nope}\nrun 5 every 1 \"group a region b\" \"run 1\"\n");
        let at = |lines: &[&str]| place(case.path(), &seen(lines)).unwrap();
        assert_eq!(at(&["units si", "thermo   ${nope}"]), "in.liggghts:3: thermo ${nope}");
        assert_eq!(at(&["units  si", "Reading data file ..."]), "in.liggghts:2: units si");
        assert_eq!(at(&["group a region b"]), "in.liggghts:5: group a region b (in run 5)");
        assert_eq!(place(case.path(), &seen(&["nowhere"])), None);
    }

    #[test]
    fn included_files_are_searched_too() {
        let case = case("include batches/${step}.in\n");
        fs::create_dir(case.path().join("batches")).unwrap();
        fs::write(case.path().join("batches/7.in"), "# batch\nread_data batches/7.data add\n").unwrap();
        let lines =
            seen(&["include batches/${step}.in", "include batches/7.in", "# batch", "read_data batches/7.data add"]);
        assert_eq!(place(case.path(), &lines).unwrap(), "batches/7.in:2: read_data batches/7.data add");
        assert_eq!(
            place(case.path(), &seen(&["include batches/${step}.in", "include batches/8.in"])).unwrap(),
            "in.liggghts:1: include batches/${step}.in"
        );
    }

    #[test]
    fn what_an_error_names_is_where_it_is_defined() {
        let case = case("fix lid2 all x\nfix  lid all mesh/surface file a.stl type 1\nrun 5\n");
        let text = explain(case.path(), "Mesh (id lid): 1 mesh elements have left the domain", &seen(&["run 5"]));
        assert!(text.contains("at in.liggghts:2: fix lid all mesh/surface"), "{text}");
    }

    #[test]
    fn an_unknown_error_is_told_as_it_is() {
        let case = case("units si\n");
        let text = explain(case.path(), "Something new", &seen(&["units si"]));
        assert!(
            text.starts_with("LIGGGHTS stopped with an error: Something new\nat in.liggghts:1: units si\n"),
            "{text}"
        );
    }
}
