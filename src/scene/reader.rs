//! A typed reader over one table: each accessor marks its key as asked for and collects findings; what nobody asked for
//! is a finding at the end.

use super::diagnostics::{Place, Report, hint, nearest};
use super::quantity;
use super::schema;
use super::tree::{Entry, Node, Table, Value};
use std::cell::RefCell;

mod quantities;

pub(crate) use quantities::Limit;

/// Reads one table.
pub(crate) struct Reader<'a> {
    table: &'a Table,
    /// Where the table stands.
    pub place: Place,
    /// Its path: `feed.0`; empty for the whole scene.
    pub path: String,
    /// What it is called in messages: `feed "fill"`; empty for the whole scene.
    label: String,
    /// Its section in [`schema::SECTIONS`].
    section: &'static str,
    /// Where findings go.
    pub report: &'a Report,
    asked: RefCell<Vec<&'static str>>,
    /// Keys as written that were read.
    used: RefCell<Vec<String>>,
}

impl<'a> Reader<'a> {
    /// A reader of a whole file; `section` is what the file is: a scene, a campaign.
    pub fn root(table: &'a Table, section: &'static str, report: &'a Report) -> Self {
        Self::new(table, Place::in_file(0..0), String::new(), String::new(), section, report)
    }

    fn new(
        table: &'a Table,
        place: Place,
        path: String,
        label: String,
        section: &'static str,
        report: &'a Report,
    ) -> Self {
        for entry in &table.entries {
            let base = quantity::base_of_key(&entry.key);
            for key in [base, &entry.key] {
                report.remember(join(&path, key), entry.key_place.clone());
            }
        }
        report.remember(path.clone(), place.clone());
        Self { table, place, path, label, section, report, asked: RefCell::default(), used: RefCell::default() }
    }

    /// The entry `key`, marked as asked for.
    fn entry(&self, key: &'static str) -> Option<&'a Node> {
        self.ask(key);
        let node = self.table.get(key)?;
        self.used.borrow_mut().push(key.to_owned());
        Some(node)
    }

    fn ask(&self, key: &'static str) {
        debug_assert!(schema::knows(self.section, key), "`{key}` is missing in the schema of [{}]", self.section);
        self.asked.borrow_mut().push(key);
    }

    /// Where `key` stands, or the table if it is absent.
    pub fn place_of(&self, key: &str) -> Place {
        self.report.place(&join(&self.path, key))
    }

    /// True where `key` is given, with or without a unit at its end, even one that is unknown.
    pub fn has(&self, key: &str) -> bool {
        self.table.entries.iter().any(|entry| {
            let base = quantity::base_of_key(&entry.key);
            entry.key == key || base == key || (!schema::knows(self.section, base) && ends_oddly(&entry.key, key))
        })
    }

    /// Reports that `key` is missing.
    pub fn missing(&self, key: &str, example: &str) {
        self.report.error(
            "missing-key",
            &self.place,
            format!("{} has no `{key}`", self.words()),
            format!("add `{example}`"),
        );
    }

    fn words(&self) -> String {
        if self.label.is_empty() { format!("the {}", self.section) } else { self.label.clone() }
    }

    /// Reports that `key` is not `wanted`.
    pub fn wrong_type(&self, key: &str, node: &Node, wanted: &str, example: &str) {
        self.report.error(
            "wrong-type",
            &node.place,
            format!("`{key}` must be {wanted}, not {}", node.value.kind()),
            format!("write for example `{key} = {example}`"),
        );
    }

    /// A string.
    pub fn text(&self, key: &'static str) -> Option<&'a str> {
        let node = self.entry(key)?;
        match &node.value {
            Value::Text(text) => Some(text),
            _ => {
                self.wrong_type(key, node, "a string", "\"…\"");
                None
            }
        }
    }

    /// A string that must be there.
    pub fn need_text(&self, key: &'static str, example: &str) -> Option<&'a str> {
        if !self.has(key) {
            self.missing(key, &format!("{key} = \"{example}\""));
        }
        self.text(key)
    }

    /// True or false.
    pub fn boolean(&self, key: &'static str, default: bool) -> bool {
        match self.entry(key) {
            None => default,
            Some(Node { value: Value::Boolean(flag), .. }) => *flag,
            Some(node) => {
                self.wrong_type(key, node, "true or false", &default.to_string());
                default
            }
        }
    }

    /// A non-negative integer.
    pub fn integer(&self, key: &'static str, example: u64) -> Option<u64> {
        let node = self.entry(key)?;
        match node.value {
            Value::Integer(number) => match u64::try_from(number) {
                Ok(number) => Some(number),
                Err(_) => {
                    self.out_of_range(key, &node.place, "not be negative", &number.to_string());
                    None
                }
            },
            _ => {
                self.wrong_type(key, node, "an integer", &example.to_string());
                None
            }
        }
    }

    /// One of a list of words.
    pub fn word<T: Copy>(&self, key: &'static str, words: &[(&'static str, T)]) -> Option<T> {
        let node = self.entry(key)?;
        self.word_of(key, node, words)
    }

    /// One of a list of words; it must be there.
    pub fn need_word<T: Copy>(&self, key: &'static str, words: &[(&'static str, T)]) -> Option<T> {
        if !self.has(key) {
            let known: Vec<&str> = words.iter().map(|(word, _)| *word).collect();
            self.report.error(
                "missing-key",
                &self.place,
                format!("{} has no `{key}`", self.words()),
                format!("add `{key} = \"…\"`; known: {}", known.join(", ")),
            );
        }
        self.word(key, words)
    }

    /// `node` as one of a list of words.
    pub fn word_of<T: Copy>(&self, key: &str, node: &Node, words: &[(&'static str, T)]) -> Option<T> {
        let Value::Text(text) = &node.value else {
            self.wrong_type(key, node, "a string", &format!("\"{}\"", words[0].0));
            return None;
        };
        let found = words.iter().find(|(word, _)| word == text).map(|(_, value)| *value);
        if found.is_none() {
            let known: Vec<&str> = words.iter().map(|(word, _)| *word).collect();
            self.report.error("unknown-word", &node.place, format!("`{key}` cannot be \"{text}\""), hint(text, &known));
        }
        found
    }

    /// The name of something declared elsewhere under `section.NAME`: its index in `known`.
    pub fn reference(&self, key: &'static str, section: &str, known: &[String]) -> Option<usize> {
        if !self.has(key) {
            self.missing(key, &format!("{key} = \"…\""));
        }
        let node = self.entry(key)?;
        self.reference_of(key, node, section, known)
    }

    /// `node` as the name of something declared elsewhere.
    pub fn reference_of(&self, key: &str, node: &Node, section: &str, known: &[String]) -> Option<usize> {
        let Value::Text(name) = &node.value else {
            self.wrong_type(key, node, "a string", "\"…\"");
            return None;
        };
        let found = known.iter().position(|other| other == name);
        // What was declared, but is no table, has its finding there.
        if found.is_none() && !self.report.was_given(&join(section, name)) {
            let names: Vec<&str> = known.iter().map(String::as_str).collect();
            let what = if section == "particle" { "particle class" } else { section };
            self.report.error(
                "unknown-name",
                &node.place,
                format!("there is no {what} \"{name}\""),
                hint(name, &names),
            );
        }
        found
    }

    /// The raw value of `key`.
    pub fn node(&self, key: &'static str) -> Option<&'a Node> {
        self.entry(key)
    }

    /// The table `key`.
    pub fn table(&self, key: &'static str, section: &'static str) -> Option<Reader<'a>> {
        let node = self.entry(key)?;
        let found = self.table_of(node, join(&self.path, key), self.of(format!("`{key}`")), section);
        if found.is_none() {
            self.wrong_type(key, node, "a table", "{ … }");
        }
        found
    }

    fn of(&self, own: String) -> String {
        if self.label.is_empty() {
            // At the top, a table is shown as it is written: [contact].
            if own.starts_with('`') { own.replacen('`', "[", 1).replacen('`', "]", 1) } else { own }
        } else {
            format!("{own} of {}", self.label)
        }
    }

    fn table_of(&self, node: &'a Node, path: String, label: String, section: &'static str) -> Option<Reader<'a>> {
        match &node.value {
            Value::Table(table) => Some(Reader::new(table, node.place.clone(), path, label, section, self.report)),
            _ => None,
        }
    }

    /// The tables of the array `key`; each has the path `key.<number>`.
    pub fn tables(&self, key: &'static str, section: &'static str) -> Vec<Reader<'a>> {
        let Some(node) = self.entry(key) else { return Vec::new() };
        let Value::Array(items) = &node.value else {
            self.wrong_type(key, node, "an array of tables", &format!("[{{ … }}]`, or better write `[[{key}]]"));
            return Vec::new();
        };
        let read = |(index, item): (usize, &'a Node)| {
            let path = join(&join(&self.path, key), &index.to_string());
            let own = match &item.value {
                Value::Table(Table { entries }) => entries.iter().find(|entry| entry.key == "name"),
                _ => None,
            };
            let own = match own {
                Some(Entry { node: Node { value: Value::Text(name), .. }, .. }) => format!("{key} \"{name}\""),
                _ => format!("{key} {index}"),
            };
            let reader = self.table_of(item, path, self.of(own), section);
            if reader.is_none() {
                self.wrong_type(key, item, "an array of tables", "[{ … }]");
            }
            reader
        };
        items.iter().enumerate().filter_map(read).collect()
    }

    /// The named tables under `key`, with their names.
    pub fn named_tables(&self, key: &'static str, section: &'static str) -> Vec<(String, Reader<'a>)> {
        let Some(node) = self.entry(key) else { return Vec::new() };
        let Value::Table(table) = &node.value else {
            self.wrong_type(
                key,
                node,
                "a table of tables",
                &format!("{{ NAME = {{ … }} }}`, or better write `[{key}.NAME]"),
            );
            return Vec::new();
        };
        let mut found = Vec::new();
        for entry in &table.entries {
            let path = join(&join(&self.path, key), &entry.key);
            self.check_name(&entry.key, &entry.key_place);
            self.report.remember(path.clone(), entry.key_place.clone());
            match self.table_of(&entry.node, path, self.of(format!("[{key}.{}]", entry.key)), section) {
                Some(reader) => found.push((entry.key.clone(), reader)),
                None => self.report.error(
                    "wrong-type",
                    &entry.node.place,
                    format!("`{key}.{}` must be a table, not {}", entry.key, entry.node.value.kind()),
                    format!("write it as `[{key}.NAME]` with its keys below"),
                ),
            }
        }
        found
    }

    /// The entries of a free table (keys are names).
    pub fn entries(&self) -> &'a Table {
        self.table
    }

    /// The mandatory `name` of an array's element, good for file names and `--set`.
    pub fn name(&self) -> Option<String> {
        let name = self.need_text("name", "…")?;
        self.check_name(name, &self.place_of("name"));
        Some(name.to_owned())
    }

    fn check_name(&self, name: &str, place: &Place) {
        let allowed = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
        if name.is_empty() || !name.chars().all(allowed) || name.chars().all(|c| c.is_ascii_digit()) {
            self.report.error(
                "bad-name",
                place,
                format!("\"{name}\" cannot be a name"),
                "use letters, digits, `_` and `-`, and not digits alone: names stand in file names and in --set",
            );
        }
    }

    /// Reports every key that was not asked for.
    pub fn finish(self) {
        let used = self.used.borrow();
        let asked = self.asked.borrow();
        for entry in self.table.entries.iter().filter(|entry| !used.contains(&entry.key)) {
            let key = entry.key.as_str();
            let base = quantity::base_of_key(key);
            if asked.contains(&base) {
                self.report.error(
                    "unknown-unit",
                    &entry.key_place,
                    format!("`{base}` does not take the unit at the end of `{key}`"),
                    format!("write `{base} = \"…\"` with a unit that fits, or see the reference of the scene"),
                );
            } else if schema::knows(self.section, base) {
                self.report.error(
                    "key-not-here",
                    &entry.key_place,
                    format!("`{base}` has no meaning in {} as it stands", self.words()),
                    format!("remove it; known here: {}", list(&asked)),
                );
            } else if let Some(asked) = asked.iter().find(|asked| ends_oddly(key, asked)) {
                self.report.error(
                    "unknown-unit",
                    &entry.key_place,
                    format!("the end of `{key}` names no unit known to `{asked}`"),
                    format!("write `{asked} = \"…\"` with number and unit"),
                );
            } else {
                let next = match nearest(base, &asked) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!("known: {}", list(&asked)),
                };
                self.report.error(
                    "unknown-key",
                    &entry.key_place,
                    format!("`{key}` is not a key of {}", self.words()),
                    next,
                );
            }
        }
    }
}

/// True for `diameter_furlong` where `diameter` was asked for.
fn ends_oddly(key: &str, asked: &str) -> bool {
    key.strip_prefix(asked).is_some_and(|rest| rest.starts_with('_') && rest.len() > 1) && schema::is_measured(asked)
}

fn list(keys: &[&str]) -> String {
    let mut keys = keys.to_vec();
    keys.sort_unstable();
    keys.dedup();
    keys.join(", ")
}

/// `path.key`, or `key` alone at the top.
pub(crate) fn join(path: &str, key: &str) -> String {
    if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") }
}
