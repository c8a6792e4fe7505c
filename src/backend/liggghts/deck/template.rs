//! Texts with places to fill in: `{{name}}`. A line that consists of one place alone takes as many lines as its value has, and
//! vanishes where the value is empty.

use crate::storage::StorageError;
use std::path::{Path, PathBuf};

/// Our templates by file name.
const OURS: [(&str, &str); 20] = [
    ("head.in", include_str!("../../../../templates/liggghts/head.in")),
    ("system.in", include_str!("../../../../templates/liggghts/system.in")),
    ("materials.in", include_str!("../../../../templates/liggghts/materials.in")),
    ("walls.in", include_str!("../../../../templates/liggghts/walls.in")),
    ("feeds.in", include_str!("../../../../templates/liggghts/feeds.in")),
    ("integration.in", include_str!("../../../../templates/liggghts/integration.in")),
    ("gates.in", include_str!("../../../../templates/liggghts/gates.in")),
    ("gate.in", include_str!("../../../../templates/liggghts/gate.in")),
    ("gate_crossing.in", include_str!("../../../../templates/liggghts/gate_crossing.in")),
    ("gate_removal.in", include_str!("../../../../templates/liggghts/gate_removal.in")),
    ("gate_sample.in", include_str!("../../../../templates/liggghts/gate_sample.in")),
    ("gate_sample_crossing.in", include_str!("../../../../templates/liggghts/gate_sample_crossing.in")),
    ("output.in", include_str!("../../../../templates/liggghts/output.in")),
    ("run.in", include_str!("../../../../templates/liggghts/run.in")),
    ("removal.in", include_str!("../../../../templates/liggghts/removal.in")),
    ("event.in", include_str!("../../../../templates/liggghts/event.in")),
    ("hold.in", include_str!("../../../../templates/liggghts/hold.in")),
    ("set_up.in", include_str!("../../../../templates/liggghts/set_up.in")),
    ("carry.in", include_str!("../../../../templates/liggghts/carry.in")),
    ("rest.in", include_str!("../../../../templates/liggghts/rest.in")),
];

/// Our templates, or those of a folder that replace them file by file.
#[derive(Debug, Clone, Default)]
pub struct Templates {
    folder: Option<PathBuf>,
}

impl Templates {
    /// Ours where `folder` is `None` or does not have a file.
    #[must_use]
    pub fn new(folder: Option<&Path>) -> Self {
        Self { folder: folder.map(Path::to_owned) }
    }

    /// File names of all templates.
    pub fn names() -> impl Iterator<Item = &'static str> {
        OURS.iter().map(|(name, _)| *name)
    }

    /// The template `name` with its places filled in.
    ///
    /// # Errors
    /// Where a template of the user's own cannot be read, names a place that does not exist, or leaves one out that has a value.
    pub fn fill(&self, name: &str, values: &[(&str, &str)]) -> Result<String, String> {
        let own = self.folder.as_ref().map(|folder| folder.join(name)).filter(|path| path.exists());
        match own {
            None => {
                let found = OURS.iter().find(|(ours, _)| *ours == name);
                let (_, text) = found.ok_or_else(|| format!("there is no template {name:?}"))?;
                fill(text, &format!("templates/liggghts/{name}"), values)
            }
            Some(path) => {
                let text = std::fs::read_to_string(&path)
                    .map_err(|source| StorageError::system("read", &path, source).to_string())?;
                fill(&text, &path.display().to_string(), values)
            }
        }
    }
}

/// Fills in the places of `text`, whose origin is `file`.
fn fill(text: &str, file: &str, values: &[(&str, &str)]) -> Result<String, String> {
    let mut filled = String::with_capacity(2 * text.len());
    let mut used = vec![false; values.len()];
    for (number, line) in text.lines().enumerate() {
        let value = |name: &str, used: &mut Vec<bool>| -> Result<&str, String> {
            let index = values.iter().position(|(known, _)| *known == name).ok_or_else(|| {
                let known: Vec<&str> = values.iter().map(|(known, _)| *known).collect();
                format!("{file}:{}: {{{{{name}}}}} is no place here; there are {}", number + 1, known.join(", "))
            })?;
            used[index] = true;
            Ok(values[index].1)
        };
        if let Some(name) = alone(line) {
            for line in value(name, &mut used)?.lines() {
                filled.push_str(line);
                filled.push('\n');
            }
            continue;
        }
        let mut rest = line;
        while let Some((before, after)) = rest.split_once("{{") {
            let (name, after) = after
                .split_once("}}")
                .ok_or_else(|| format!("{file}:{}: {{{{ without }}}}; a place is {{{{name}}}}", number + 1))?;
            filled.push_str(before);
            filled.push_str(value(name.trim(), &mut used)?);
            rest = after;
        }
        filled.push_str(rest);
        filled.push('\n');
    }
    let missing = values.iter().zip(&used).find(|((_, value), used)| !**used && !value.is_empty());
    match missing {
        Some(((name, _), _)) => Err(format!(
            "{file}: {{{{{name}}}}} is missing, without which the deck is another one: put it where it belongs"
        )),
        None => Ok(filled),
    }
}

/// The name of the place that is all there is in a line.
fn alone(line: &str) -> Option<&str> {
    let name = line.trim().strip_prefix("{{")?.strip_suffix("}}")?.trim();
    (!name.contains("}}")).then_some(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_filled_in_and_empty_lines_of_their_own_vanish() {
        let text = "run {{steps}}   # ${held_{{id}}}\n{{none}}\n{{lines}}\nend\n";
        let values = [("steps", "5"), ("id", "lid"), ("none", ""), ("lines", "a\nb")];
        assert_eq!(fill(text, "f", &values).as_deref(), Ok("run 5   # ${held_lid}\na\nb\nend\n"));
    }

    #[test]
    fn a_wrong_template_is_named_with_its_line() {
        let unknown = fill("a\nb {{speed}}\n", "own/run.in", &[("steps", "5")]).expect_err("unknown");
        assert!(unknown.starts_with("own/run.in:2: {{speed}} is no place here; there are steps"), "{unknown}");
        let missing = fill("a\n", "own/run.in", &[("steps", "5")]).expect_err("missing");
        assert!(missing.starts_with("own/run.in: {{steps}} is missing"), "{missing}");
        let open = fill("{{steps\n", "own/run.in", &[("steps", "5")]).expect_err("open");
        assert!(open.starts_with("own/run.in:1: {{ without }}"), "{open}");
    }

    #[test]
    fn a_folder_replaces_templates_file_by_file() {
        let folder = tempfile::tempdir().expect("a folder");
        std::fs::write(folder.path().join("rest.in"), "# {{rests}} {{id}} {{batch}}\n").expect("written");
        let templates = Templates::new(Some(folder.path()));
        let values = [("rests", "1"), ("id", "lid"), ("batch", "100")];
        assert_eq!(templates.fill("rest.in", &values).as_deref(), Ok("# 1 lid 100\n"));
        assert!(templates.fill("head.in", &[]).is_err_and(|error| error.starts_with("templates/liggghts/head.in:1:")));
    }
}
