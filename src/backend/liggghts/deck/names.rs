//! Names in a deck.

use crate::math::Vec3;

/// As a name in a deck: letters, digits and `_`. Names that become equal are told apart by a number.
#[must_use]
pub fn identifiers<'a>(names: impl Iterator<Item = &'a str>) -> Vec<String> {
    let mut taken: Vec<String> = Vec::new();
    for name in names {
        let plain = safe(name, false);
        let mut id = plain.clone();
        let mut number = 2;
        while taken.contains(&id) {
            id = format!("{plain}_{number}");
            number += 1;
        }
        taken.push(id);
    }
    taken
}

/// As a file's name, and as a name in comments: letters, digits, `_` and `-`.
#[must_use]
pub fn file_name(name: &str) -> String {
    safe(name, true)
}

fn safe(name: &str, hyphen: bool) -> String {
    let kept = |c: char| c.is_ascii_alphanumeric() || c == '_' || (hyphen && c == '-');
    name.chars().map(|c| if kept(c) { c } else { '_' }).collect()
}

/// A text that may stand in a comment: one line, and no `&` or `$` to which LIGGGHTS pays attention.
#[must_use]
pub fn comment(text: &str) -> String {
    text.chars().map(|c| if c.is_control() || c == '&' || c == '$' { ' ' } else { c }).collect()
}

/// Three numbers.
#[must_use]
pub fn vector(vector: &Vec3) -> String {
    let [x, y, z] = [vector.x, vector.y, vector.z].map(crate::backend::liggghts::deck_number);
    format!("{x} {y} {z}")
}

/// Lines, each ended.
#[must_use]
pub fn lines(lines: impl IntoIterator<Item = String>) -> String {
    let mut text = String::new();
    for line in lines {
        text.push_str(line.trim_end());
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_stay_apart() {
        assert_eq!(identifiers(["a-b", "a_b", "c", "a b"].into_iter()), ["a_b", "a_b_2", "c", "a_b_3"]);
        assert_eq!(comment("one\ntwo & $x"), "one two    x");
    }
}
