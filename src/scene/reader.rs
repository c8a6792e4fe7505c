//! A typed reader over one table: each accessor marks its key as asked for and collects findings; what nobody asked for
//! is a finding at the end.

use super::diagnostics::{Place, Report, hint, nearest};
use super::quantity;
use super::schema;
use super::tree::{Node, Table, Value};
use std::cell::RefCell;

mod quantities;

pub(crate) use quantities::Limit;

/// Reads one table. It borrows all that it knows: what findings say of it is put into words only where there is one.
pub(crate) struct Reader<'a> {
    table: &'a Table,
    /// Where the table stands.
    pub place: &'a Place,
    /// What the table is part of; `None` for the whole file.
    above: Option<&'a Reader<'a>>,
    /// Which part of it.
    step: Step<'a>,
    /// Its section in [`schema::SECTIONS`].
    section: &'static str,
    /// Where findings go.
    pub report: &'a Report<'a>,
    asked: RefCell<Vec<&'static str>>,
    /// Numbers of the entries that were read.
    used: RefCell<Vec<usize>>,
}

/// Which part of the table above a table is.
#[derive(Clone, Copy)]
enum Step<'a> {
    /// The whole file.
    Whole,
    /// The value of a key.
    Key(&'static str),
    /// An element of the array of a key, by its number.
    Element(&'static str, usize),
    /// What has this name in the table of a key.
    Named(&'static str, &'a str),
}

/// Keys that a table is usually asked for.
const USUAL_KEYS: usize = 16;

impl<'a> Reader<'a> {
    /// A reader of a whole file; `section` is what the file is: a scene, a campaign.
    pub fn root(table: &'a Table, section: &'static str, report: &'a Report<'a>) -> Self {
        const START: &Place = &Place::File(0..0);
        Self::new(table, START, None, Step::Whole, section, report)
    }

    fn new(
        table: &'a Table,
        place: &'a Place,
        above: Option<&'a Self>,
        step: Step<'a>,
        section: &'static str,
        report: &'a Report<'a>,
    ) -> Self {
        let asked = RefCell::new(Vec::with_capacity(USUAL_KEYS));
        let used = RefCell::new(Vec::with_capacity(table.entries.len()));
        Self { table, place, above, step, section, report, asked, used }
    }

    /// Path of the table: `feed.0`; empty for the whole file.
    pub fn path(&self) -> String {
        let above = self.above.map_or_else(String::new, Self::path);
        match self.step {
            Step::Whole => above,
            Step::Key(key) => join(&above, key),
            Step::Element(key, number) => join(&above, &format!("{key}.{number}")),
            Step::Named(key, name) => join(&above, &format!("{key}.{name}")),
        }
    }

    /// What the table is called in messages: `feed "fill"`; empty for the whole file.
    fn label(&self) -> String {
        let above = self.above.map_or_else(String::new, Self::label);
        let own = match self.step {
            Step::Whole => return above,
            // At the top, a table is shown as it is written.
            Step::Key(key) if above.is_empty() => format!("[{key}]"),
            Step::Key(key) => format!("`{key}`"),
            Step::Element(key, number) => match self.table.get("name") {
                Some(Node { value: Value::Text(name), .. }) => format!("{key} \"{name}\""),
                _ => format!("{key} {number}"),
            },
            Step::Named(key, name) => format!("[{key}.{name}]"),
        };
        if above.is_empty() { own } else { format!("{own} of {above}") }
    }

    /// The table of the whole file.
    fn whole(&self) -> &'a Table {
        self.above.map_or(self.table, Self::whole)
    }

    /// The entry `key`, marked as asked for.
    fn entry(&self, key: &'static str) -> Option<&'a Node> {
        self.ask(key);
        let (number, entry) = self.table.entries.iter().enumerate().find(|(_, entry)| entry.key == key)?;
        self.used.borrow_mut().push(number);
        Some(&entry.node)
    }

    fn ask(&self, key: &'static str) {
        debug_assert!(schema::knows(self.section, key), "`{key}` is missing in the schema of [{}]", self.section);
        self.asked.borrow_mut().push(key);
    }

    /// Where `key` stands, or the table if it is absent.
    pub fn place_of(&self, key: &str) -> Place {
        self.table.named(key).map_or(self.place, |entry| &entry.key_place).clone()
    }

    /// True where `key` is given, with or without a unit at its end, even one that is unknown.
    pub fn has(&self, key: &str) -> bool {
        self.table.entries.iter().any(|entry| {
            let begins = entry.key.starts_with(key);
            begins && (entry.key == key || quantity::base_of_key(&entry.key) == key || self.ends_oddly(&entry.key, key))
        })
    }

    /// True for `key` with what may be meant as a unit and is none.
    fn ends_oddly(&self, written: &str, key: &str) -> bool {
        ends_oddly(written, key) && !schema::knows(self.section, quantity::base_of_key(written))
    }

    /// Reports that `key` is missing.
    pub fn missing(&self, key: &str, example: &str) {
        self.report.error(
            "missing-key",
            self.place,
            format!("{} has no `{key}`", self.words()),
            format!("add `{example}`"),
        );
    }

    fn words(&self) -> String {
        let label = self.label();
        if label.is_empty() { format!("the {}", self.section) } else { label }
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
                self.place,
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
        if found.is_none() && !self.is_declared(section, name) {
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

    /// True where the file gives something this name, right or wrong, under `section.NAME`.
    fn is_declared(&self, section: &str, name: &str) -> bool {
        matches!(self.whole().get(section), Some(Node { value: Value::Table(table), .. }) if table.get(name).is_some())
    }

    /// The raw value of `key`.
    pub fn node(&self, key: &'static str) -> Option<&'a Node> {
        self.entry(key)
    }

    /// The table `key`.
    pub fn table(&'a self, key: &'static str, section: &'static str) -> Option<Self> {
        let node = self.entry(key)?;
        let found = self.table_of(node, Step::Key(key), section);
        if found.is_none() {
            self.wrong_type(key, node, "a table", "{ … }");
        }
        found
    }

    fn table_of(&'a self, node: &'a Node, step: Step<'a>, section: &'static str) -> Option<Self> {
        match &node.value {
            Value::Table(table) => Some(Self::new(table, &node.place, Some(self), step, section, self.report)),
            _ => None,
        }
    }

    /// The tables of the array `key`; each has the path `key.<number>`.
    pub fn tables(&'a self, key: &'static str, section: &'static str) -> Vec<Self> {
        let Some(node) = self.entry(key) else { return Vec::new() };
        let Value::Array(items) = &node.value else {
            self.wrong_type(key, node, "an array of tables", &format!("[{{ … }}]`, or better write `[[{key}]]"));
            return Vec::new();
        };
        let read = |(number, item): (usize, &'a Node)| {
            let reader = self.table_of(item, Step::Element(key, number), section);
            if reader.is_none() {
                self.wrong_type(key, item, "an array of tables", "[{ … }]");
            }
            reader
        };
        items.iter().enumerate().filter_map(read).collect()
    }

    /// The named tables under `key`, with their names.
    pub fn named_tables(&'a self, key: &'static str, section: &'static str) -> Vec<(String, Self)> {
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
        for entry in table.entries.iter() {
            self.check_name(&entry.key, &entry.key_place);
            match self.table_of(&entry.node, Step::Named(key, &entry.key), section) {
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
        let place = self.table.named("name").map_or(self.place, |entry| &entry.key_place);
        self.check_name(name, place);
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
        for (number, entry) in self.table.entries.iter().enumerate() {
            if used.contains(&number) {
                continue;
            }
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
