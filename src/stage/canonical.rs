//! JSON with the fields of every object in the order of their names: equal contents have one text, in whatever order their types
//! declare them, and none of it is held as a tree.

use serde::Serialize;
use serde_json::Serializer;
use serde_json::ser::Formatter;
use std::borrow::Cow;
use std::cell::RefCell;
use std::io;

/// `value` as that text: what `serde_json::to_value(value)` prints.
///
/// # Panics
/// Where `value` has no JSON: maps whose keys are no names, or a type that refuses.
#[must_use]
pub fn text_of(value: &impl Serialize) -> String {
    let state = RefCell::new(State { text: Vec::with_capacity(USUAL_LENGTH), ..State::default() });
    let written = value.serialize(&mut Serializer::with_formatter(Sink(&state), Ordered(&state)));
    written.expect("plain numbers and names become JSON");
    String::from_utf8(state.into_inner().text).expect("JSON is UTF-8")
}

/// Length of a usual text [bytes]; longer ones grow.
const USUAL_LENGTH: usize = 4096;

/// What has been written, and where the fields of the objects that are still open stand in it.
#[derive(Default)]
struct State {
    text: Vec<u8>,
    /// For each open object, where its fields begin among `fields`.
    objects: Vec<usize>,
    fields: Vec<Field>,
    /// Room for bringing fields into order.
    ordered: Vec<u8>,
}

/// A field of an open object: `"name":value,`.
#[derive(Clone, Copy)]
struct Field {
    start: usize,
    name_end: usize,
    end: usize,
    /// Whether characters of the name are escaped.
    is_escaped: bool,
}

impl Field {
    fn name<'a>(&self, text: &'a [u8]) -> Cow<'a, [u8]> {
        let quoted = &text[self.start..self.name_end];
        if self.is_escaped {
            // The order is that of the names themselves, not of how their characters are escaped.
            let name: String = serde_json::from_slice(quoted).expect("a name that was just written");
            return Cow::Owned(name.into_bytes());
        }
        Cow::Borrowed(&quoted[1..quoted.len() - 1])
    }
}

impl State {
    fn end_object(&mut self) {
        let first = self.objects.pop().expect("what ends has begun");
        let (fields, text, ordered) = (&mut self.fields[first..], &mut self.text, &mut self.ordered);
        if !fields.is_sorted_by(|a, b| a.name(text) <= b.name(text)) {
            let start = fields[0].start;
            fields.sort_by(|a, b| a.name(text).cmp(&b.name(text)));
            ordered.clear();
            fields.iter().for_each(|field| ordered.extend_from_slice(&text[field.start..field.end]));
            text[start..].copy_from_slice(ordered);
        }
        if self.fields.len() > first {
            text.pop();
        }
        self.fields.truncate(first);
    }
}

/// Where the serializer writes to.
struct Sink<'a>(&'a RefCell<State>);

impl io::Write for Sink<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.borrow_mut().text.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Brings fields into order as their object ends.
struct Ordered<'a>(&'a RefCell<State>);

impl Formatter for Ordered<'_> {
    fn begin_object<W: ?Sized + io::Write>(&mut self, writer: &mut W) -> io::Result<()> {
        let mut state = self.0.borrow_mut();
        let first = state.fields.len();
        state.objects.push(first);
        drop(state);
        writer.write_all(b"{")
    }

    fn begin_object_key<W: ?Sized + io::Write>(&mut self, _: &mut W, _: bool) -> io::Result<()> {
        let mut state = self.0.borrow_mut();
        let start = state.text.len();
        state.fields.push(Field { start, name_end: start, end: start, is_escaped: false });
        Ok(())
    }

    fn end_object_key<W: ?Sized + io::Write>(&mut self, _: &mut W) -> io::Result<()> {
        let State { text, fields, .. } = &mut *self.0.borrow_mut();
        let field = fields.last_mut().expect("its field has begun");
        field.name_end = text.len();
        field.is_escaped = text[field.start..].contains(&b'\\');
        Ok(())
    }

    fn end_object_value<W: ?Sized + io::Write>(&mut self, writer: &mut W) -> io::Result<()> {
        writer.write_all(b",")?;
        let mut state = self.0.borrow_mut();
        let end = state.text.len();
        state.fields.last_mut().expect("its field has begun").end = end;
        Ok(())
    }

    fn end_object<W: ?Sized + io::Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.0.borrow_mut().end_object();
        writer.write_all(b"}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::{Map, Value, json};

    #[test]
    fn fields_stand_in_the_order_of_their_names() {
        #[derive(Serialize)]
        enum Kind {
            Some { z: f64, a: Option<u8> },
            None,
        }
        #[derive(Serialize)]
        struct Thing<'a> {
            zebra: [Kind; 2],
            apple: &'a str,
            #[serde(rename = "app")]
            short: f64,
            empty: Map<String, Value>,
        }
        let zebra = [Kind::Some { z: f64::INFINITY, a: None }, Kind::None];
        let thing = Thing { zebra, apple: "a \"b\"\n", short: -0.0, empty: Map::new() };
        let text = r#"{"app":-0.0,"apple":"a \"b\"\n","empty":{},"zebra":[{"Some":{"a":null,"z":null}},"None"]}"#;
        assert_eq!(text_of(&thing), text);
        assert_eq!(text_of(&thing), serde_json::to_value(&thing).expect("plain").to_string());
    }

    #[test]
    fn names_are_ordered_before_they_are_escaped() {
        // Escaped, a line feed begins with a backslash, which comes after all capital letters.
        #[derive(Serialize)]
        struct Thing {
            #[serde(rename = "A")]
            capital: u8,
            #[serde(rename = "\n")]
            feed: u8,
        }
        let thing = Thing { capital: 1, feed: 2 };
        assert_eq!(text_of(&thing), "{\"\\n\":2,\"A\":1}");
        assert_eq!(text_of(&thing), serde_json::to_value(&thing).expect("plain").to_string());
    }

    /// Fields in an order of their own.
    struct Pairs(Vec<(String, Value)>);

    impl Serialize for Pairs {
        fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            serializer.collect_map(self.0.iter().map(|(name, value)| (name, value)))
        }
    }

    proptest! {
        #[test]
        fn it_is_what_the_tree_prints(
            names in proptest::collection::btree_set("[a-c\"\\\\!\n]{0,3}", 0..6),
            numbers in proptest::collection::vec(any::<f64>(), 6),
            rotation in 0..6_usize,
        ) {
            let mut pairs: Vec<(String, Value)> =
                names.into_iter().zip(&numbers).map(|(name, number)| (name, json!([number, {"b": 1, "a": -3}]))).collect();
            let by = rotation.min(pairs.len());
            pairs.rotate_left(by);
            let pairs = Pairs(pairs);
            prop_assert_eq!(text_of(&pairs), serde_json::to_value(&pairs).expect("plain").to_string());
        }
    }
}
