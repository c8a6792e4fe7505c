//! The scene file as a tree of values that know where they stand: TOML text in, `--set` overrides applied. Trees that differ by
//! overrides share all tables and arrays that no override reaches into.

use super::diagnostics::{Place, Report};
use super::quantity;
use std::ops::Range;
use std::sync::Arc;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// A value and its place.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Node {
    /// The value.
    pub value: Value,
    /// Where it stands.
    pub place: Place,
}

/// A TOML value.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Value {
    /// String.
    Text(String),
    /// Integer that fits 64 bits.
    Integer(i64),
    /// Any other number, as written.
    Number(f64),
    /// `true` or `false`.
    Boolean(bool),
    /// Date or time: never what a scene wants.
    Date,
    /// Array.
    Array(Arc<Vec<Node>>),
    /// Table.
    Table(Table),
}

impl Value {
    /// What it is, in words.
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Text(_) => "a string",
            Self::Integer(_) => "an integer",
            Self::Number(_) => "a number",
            Self::Boolean(_) => "true or false",
            Self::Date => "a date",
            Self::Array(_) => "an array",
            Self::Table(_) => "a table",
        }
    }
}

/// A table, in the file's order.
#[derive(Debug, Clone, PartialEq, Default)]
pub(crate) struct Table {
    /// Its entries.
    pub entries: Arc<Vec<Entry>>,
}

/// A key and its value.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Entry {
    /// Key as written.
    pub key: String,
    /// Where the key stands.
    pub key_place: Place,
    /// Its value.
    pub node: Node,
}

impl Table {
    /// The entry that gives `key`, with or without a unit at its end.
    pub fn named(&self, key: &str) -> Option<&Entry> {
        let exact = self.entries.iter().find(|entry| entry.key == key);
        exact.or_else(|| self.entries.iter().find(|entry| quantity::base_of_key(&entry.key) == key))
    }

    /// True where the value of `path` is given, right or wrong: dotted keys, elements of arrays by their number.
    pub fn has_path(&self, path: &str) -> bool {
        self.walk(path).is_some_and(|(_, rest)| rest.is_empty())
    }

    /// Where the longest known beginning of `path` stands; the start of the file if none does.
    pub fn place_of_path(&self, path: &str) -> Place {
        self.walk(path).map_or(Place::in_file(0..0), |(place, _)| place.clone())
    }

    /// Where the longest known beginning of `path` stands, and what of it is not known. Tables stand where they begin, other
    /// values where their key is.
    fn walk<'a>(&'a self, path: &'a str) -> Option<(&'a Place, &'a str)> {
        let exact = |entry: &'a Entry| Some((entry, after(path, &entry.key)?));
        let measured = |entry: &'a Entry| Some((entry, after(path, quantity::base_of_key(&entry.key))?));
        let found = self.entries.iter().find_map(exact).or_else(|| self.entries.iter().find_map(measured));
        let (entry, rest) = found?;
        let (place, deeper) = match &entry.node.value {
            Value::Table(inner) => (&entry.node.place, inner.walk(rest)),
            Value::Array(items) => (&entry.key_place, walk_into(items, rest)),
            _ => (&entry.key_place, None),
        };
        Some(deeper.unwrap_or((place, rest)))
    }

    /// The value of `key`.
    pub fn get(&self, key: &str) -> Option<&Node> {
        self.entries.iter().find(|entry| entry.key == key).map(|entry| &entry.node)
    }

    fn name(&self) -> Option<&str> {
        match self.get("name") {
            Some(Node { value: Value::Text(name), .. }) => Some(name),
            _ => None,
        }
    }

    /// The gate that a replay names.
    fn gate(&self) -> Option<&str> {
        match self.get("gate") {
            Some(Node { value: Value::Text(gate), .. }) => Some(gate),
            _ => None,
        }
    }

    /// The two materials of a pair.
    fn between(&self) -> Option<(&str, &str)> {
        let Some(Node { value: Value::Array(ends), .. }) = self.get("between") else { return None };
        match ends.as_slice() {
            [Node { value: Value::Text(a), .. }, Node { value: Value::Text(b), .. }] => Some((a, b)),
            _ => None,
        }
    }

    /// The two materials of a pair, joined by a hyphen.
    fn pair(&self) -> Option<String> {
        self.between().map(|(a, b)| format!("{a}-{b}"))
    }

    /// True where it is the pair that `name` joins by a hyphen, in either order.
    fn is_pair(&self, name: &str) -> bool {
        self.between().is_some_and(|(a, b)| name == format!("{a}-{b}") || name == format!("{b}-{a}"))
    }
}

/// What follows `name` and its dot in `path`; names may have dots themselves.
fn after<'a>(path: &'a str, name: &str) -> Option<&'a str> {
    let rest = path.strip_prefix(name)?;
    if rest.is_empty() { Some(rest) } else { rest.strip_prefix('.') }
}

/// [`Table::walk`] among the elements of an array, of which only tables are known.
fn walk_into<'a>(items: &'a [Node], path: &'a str) -> Option<(&'a Place, &'a str)> {
    let (number, rest) = path.split_once('.').unwrap_or((path, ""));
    let item = items.get(number.parse::<usize>().ok()?)?;
    let Value::Table(inner) = &item.value else { return None };
    Some(inner.walk(rest).unwrap_or((&item.place, rest)))
}

/// So many syntax errors are shown; a file that is no TOML at all has one in each line.
const MOST_SYNTAX_ERRORS: usize = 20;

/// Parses a scene's text; syntax errors go to the report, and what could be read comes back.
pub(crate) fn parse(text: &str, report: &Report<'_>) -> Table {
    let (document, errors) = DeTable::parse_recoverable(text);
    for error in errors.iter().take(MOST_SYNTAX_ERRORS) {
        let span = error.span().unwrap_or(0..0);
        report.error(
            "toml-syntax",
            &Place::in_file(span),
            format!("the file is not TOML here: {}", error.message().to_lowercase()),
            "correct the TOML; strings stand in double quotes, tables in [brackets]",
        );
    }
    table(document.get_ref(), &Place::in_file)
}

fn table(source: &DeTable<'_>, place: &dyn Fn(Range<usize>) -> Place) -> Table {
    let mut entries: Vec<Entry> = source
        .iter()
        .map(|(key, value)| Entry {
            key: key.get_ref().to_string(),
            key_place: place(key.span()),
            node: Node { value: convert(value.get_ref(), place), place: place(value.span()) },
        })
        .collect();
    entries.sort_by_key(|entry| entry.key_place.start());
    Table { entries: Arc::new(entries) }
}

fn convert(value: &DeValue<'_>, place: &dyn Fn(Range<usize>) -> Place) -> Value {
    match value {
        DeValue::String(text) => Value::Text(text.to_string()),
        DeValue::Integer(number) => match i64::from_str_radix(number.as_str(), number.radix()) {
            Ok(number) => Value::Integer(number),
            Err(_) => Value::Number(number.as_str().parse().unwrap_or(f64::NAN)),
        },
        DeValue::Float(number) => Value::Number(number.as_str().parse().unwrap_or(f64::NAN)),
        DeValue::Boolean(flag) => Value::Boolean(*flag),
        DeValue::Datetime(_) => Value::Date,
        DeValue::Array(items) => {
            let node =
                |item: &Spanned<DeValue<'_>>| Node { value: convert(item.get_ref(), place), place: place(item.span()) };
            Value::Array(Arc::new(items.iter().map(node).collect()))
        }
        DeValue::Table(inner) => Value::Table(table(inner, place)),
    }
}

/// Applies one `--set path=text` to the tree. `text` is a TOML value; what is none is taken as a string.
pub(crate) fn set(root: &mut Table, path: &str, text: &str, report: &Report<'_>) {
    let place = Place::in_setting(format!("--set {path}={text}"));
    let at = |_: Range<usize>| place.clone();
    let value = match DeValue::parse(text) {
        Ok(value) => convert(value.get_ref(), &at),
        Err(_) => Value::Text(text.to_owned()),
    };
    let steps: Vec<&str> = path.split('.').collect();
    if let Err((what, next)) = place_in(root, &steps, path, Node { value, place: place.clone() }) {
        report.error("set-path", &place, what, next);
    }
}

type Refusal = (String, String);

/// Walks down `steps` from a table and puts the node there.
fn place_in(table: &mut Table, steps: &[&str], path: &str, node: Node) -> Result<(), Refusal> {
    let [step, rest @ ..] = steps else { return Ok(()) };
    let entries = Arc::make_mut(&mut table.entries);
    if rest.is_empty() {
        let base = quantity::base_of_key(step);
        entries.retain(|entry| entry.key == *step || quantity::base_of_key(&entry.key) != base);
    }
    let index = entries.iter().position(|entry| entry.key == *step).unwrap_or_else(|| {
        let (key_place, place) = (node.place.clone(), node.place.clone());
        let value = Value::Table(Table::default());
        entries.push(Entry { key: (*step).to_owned(), key_place, node: Node { value, place } });
        entries.len() - 1
    });
    let entry = &mut entries[index];
    if rest.is_empty() {
        entry.key_place = node.place.clone();
    }
    place_below(&mut entry.node, rest, path, node)
}

/// Walks down `steps` from a node and puts the other one there.
fn place_below(node: &mut Node, steps: &[&str], path: &str, other: Node) -> Result<(), Refusal> {
    let [step, rest @ ..] = steps else {
        *node = other;
        return Ok(());
    };
    match &mut node.value {
        Value::Table(inner) => place_in(inner, steps, path, other),
        Value::Array(items) => {
            let index = element(items, step).ok_or_else(|| missing_element(items, step, path))?;
            place_below(&mut Arc::make_mut(items)[index], rest, path, other)
        }
        value => Err((
            format!("`{path}` does not exist: the value above `{step}` is {}", value.kind()),
            "name a key of the scene file, in dots".to_owned(),
        )),
    }
}

/// Position of the element that `step` names: its `name`, its `gate`, its materials `a-b`, or its number from 0.
fn element(items: &[Node], step: &str) -> Option<usize> {
    let named = items.iter().position(|item| match &item.value {
        Value::Table(inner) => inner.name() == Some(step) || inner.gate() == Some(step) || inner.is_pair(step),
        _ => false,
    });
    named.or_else(|| step.parse().ok().filter(|index| *index < items.len()))
}

fn missing_element(items: &[Node], step: &str, path: &str) -> Refusal {
    let named = |item: &Node| match &item.value {
        Value::Table(inner) => inner.name().or_else(|| inner.gate()).map(str::to_owned).or_else(|| inner.pair()),
        _ => None,
    };
    let names: Vec<String> = items.iter().filter_map(named).collect();
    let known = if names.is_empty() {
        format!("elements go by their number from 0; there are {}", items.len())
    } else {
        super::diagnostics::hint(step, &names.iter().map(String::as_str).collect::<Vec<_>>())
    };
    (format!("`{path}` does not exist: nothing is called `{step}` there"), known)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tree(text: &str) -> Table {
        let report = Report::new("scene.toml", text);
        let table = parse(text, &report);
        assert!(report.into_findings().is_empty());
        table
    }

    fn at<'a>(table: &'a Table, steps: &[&str]) -> &'a Value {
        let first = &table.get(steps[0]).expect("the key exists").value;
        steps[1..].iter().fold(first, |value, step| match value {
            Value::Table(table) => &table.get(step).expect("the key exists").value,
            Value::Array(items) => &items[step.parse::<usize>().expect("a number")].value,
            other => panic!("{step} in {other:?}"),
        })
    }

    #[test]
    fn an_override_reaches_into_named_elements_pairs_and_numbers() {
        let mut node = tree(
            "seed = 1\n[[part]]\nname = \"wall\"\n[[part]]\nname = \"mill\"\n[[part.motion]]\nrate = \"1 rpm\"\n\
             [[pair]]\nbetween = [\"a\", \"b\"]\nfriction = 0.1\n",
        );
        let report = Report::new("scene.toml", "");
        for (path, text) in [
            ("part.mill.motion.0.rate", "20 rpm"),
            ("pair.b-a.friction", "0.5"),
            ("seed", "7"),
            ("output.frames", "\"1 s\""),
            ("output.formats", "[\"vtp\"]"),
        ] {
            set(&mut node, path, text, &report);
        }
        assert!(report.into_findings().is_empty());
        assert_eq!(at(&node, &["part", "1", "motion", "0", "rate"]), &Value::Text("20 rpm".into()));
        assert_eq!(at(&node, &["pair", "0", "friction"]), &Value::Number(0.5));
        assert_eq!(at(&node, &["seed"]), &Value::Integer(7));
        assert_eq!(at(&node, &["output", "frames"]), &Value::Text("1 s".into()));
        assert!(matches!(at(&node, &["output", "formats"]), Value::Array(items) if items.len() == 1));
    }

    #[test]
    fn an_override_replaces_another_spelling_of_the_same_key() {
        let mut node = tree("[particle.ore]\ndiameter = \"3 mm\"\nmaterial = \"ore\"\n");
        let report = Report::new("scene.toml", "");
        set(&mut node, "particle.ore.diameter_mm", "4", &report);
        assert_eq!(at(&node, &["particle", "ore", "diameter_mm"]), &Value::Integer(4));
        let Value::Table(ore) = at(&node, &["particle", "ore"]) else { panic!("a table") };
        assert!(ore.get("diameter").is_none());
    }

    #[test]
    fn an_override_leaves_the_tree_that_it_was_made_of_and_shares_the_rest() {
        let text = "[[part]]\nname = \"wall\"\nplace = { move_mm = [1, 2, 3] }\n[[part]]\nname = \"mill\"\n[end]\ntime = \"1 s\"\n";
        let (base, report) = (tree(text), Report::new("scene.toml", ""));
        let mut other = base.clone();
        set(&mut other, "part.mill.material", "steel", &report);
        assert_eq!(base, tree(text));
        assert_eq!(at(&other, &["part", "1", "material"]), &Value::Text("steel".into()));
        let entries = |table: &Table, steps: &[&str]| match at(table, steps) {
            Value::Table(table) => Arc::clone(&table.entries),
            other => panic!("{other:?}"),
        };
        for steps in [&["end"][..], &["part", "0"]] {
            assert!(Arc::ptr_eq(&entries(&base, steps), &entries(&other, steps)), "{steps:?}");
        }
        assert!(!Arc::ptr_eq(&entries(&base, &["part", "1"]), &entries(&other, &["part", "1"])));
    }

    #[test]
    fn a_path_leads_to_where_its_longest_known_beginning_stands() {
        let text = "gravity_m_per_s2 = [0, 0, 1]\n[material.\"a.b\"]\ndensity = \"1 kg/m3\"\n[[part]]\nname = \"x\"\n[[part.motion]]\nrate = 1\n";
        let table = tree(text);
        let shown = |path: &str| match table.place_of_path(path) {
            Place::File(span) => text[span].to_owned(),
            Place::Setting(setting) => setting,
        };
        for (path, expected, is_whole) in [
            ("gravity", "gravity_m_per_s2", true),
            ("gravity_m_per_s2", "gravity_m_per_s2", true),
            ("gravity.0", "gravity_m_per_s2", false),
            ("material.a.b.density", "density", true),
            ("material.a.b.youngs_modulus", "[material.\"a.b\"]", false),
            ("part.0.name", "name", true),
            ("part.0.file", "[[part]]", false),
            ("part.1.file", "part", false),
            ("part.0.motion.0.rate.x", "rate", false),
            ("nothing.at.all", "", false),
        ] {
            assert_eq!((shown(path).as_str(), table.has_path(path)), (expected, is_whole), "{path}");
        }
    }

    #[test]
    fn entries_keep_the_order_of_the_file() {
        let node = tree("[material.z]\na = 1\n[material.a]\nb = 1\n");
        let Value::Table(materials) = at(&node, &["material"]) else { panic!("a table") };
        assert_eq!(materials.entries.iter().map(|entry| entry.key.as_str()).collect::<Vec<_>>(), ["z", "a"]);
    }
}
