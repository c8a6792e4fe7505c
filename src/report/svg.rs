//! The little of SVG that figures and pictures need.

use std::fmt::Write;

/// Height of the letters [px].
pub(super) const FONT_SIZE: f64 = 14.0;
/// Distance between two lines of a caption [px].
pub(super) const LINE_HEIGHT: f64 = 19.0;

/// An SVG document that grows element by element.
#[derive(Debug)]
pub(super) struct Document {
    text: String,
}

/// Where a text stands against its point.
#[derive(Debug, Clone, Copy)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

impl Document {
    /// A white page of `width` x `height` [px]; `style` holds the document's own classes.
    pub(super) fn new(width: f64, height: f64, title: &str, style: &str) -> Self {
        let (w, h) = (number(width), number(height));
        let text = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\">\n\
             <title>{}</title>\n\
             <style>\ntext{{font:{}px Helvetica,Arial,sans-serif;fill:#222}}\n\
             .halo{{paint-order:stroke;stroke:#fff;stroke-width:4px;stroke-linejoin:round}}\n{style}</style>\n\
             <rect width=\"{w}\" height=\"{h}\" fill=\"#fff\"/>\n",
            escaped(title),
            number(FONT_SIZE),
        );
        Self { text }
    }

    /// Adds a line of SVG as it is.
    pub(super) fn raw(&mut self, element: &str) {
        self.text.push_str(element);
        self.text.push('\n');
    }

    /// Adds a text at a point.
    pub(super) fn label(&mut self, at: [f64; 2], anchor: Anchor, class: &str, text: &str) {
        let anchor = match anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        let class = if class.is_empty() { String::new() } else { format!(" class=\"{class}\"") };
        let (x, y) = (number(at[0]), number(at[1]));
        self.raw(&format!("<text x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\"{class}>{}</text>", escaped(text)));
    }

    /// Adds a path through points; `class` says how it looks.
    pub(super) fn path(&mut self, class: &str, points: impl IntoIterator<Item = [f64; 2]>, closed: bool) {
        let mut path = String::new();
        for (k, point) in points.into_iter().enumerate() {
            let command = if k == 0 { 'M' } else { 'L' };
            let _ = write!(path, "{command}{} {}", number(point[0]), number(point[1]));
        }
        if !path.is_empty() {
            let end = if closed { "Z" } else { "" };
            self.raw(&format!("<path class=\"{class}\" d=\"{path}{end}\"/>"));
        }
    }

    /// Adds a straight line.
    pub(super) fn line(&mut self, class: &str, from: [f64; 2], to: [f64; 2]) {
        self.path(class, [from, to], false);
    }

    /// The whole document.
    pub(super) fn finish(mut self) -> String {
        self.text.push_str("</svg>\n");
        self.text
    }
}

/// A number with at most two decimals and no needless zeros.
pub(super) fn number(value: f64) -> String {
    let rounded = (value * 100.0).round() / 100.0;
    // Adding zero turns -0 into 0.
    format!("{}", rounded + 0.0)
}

/// Text without characters that mean something in XML; control characters, which XML cannot hold, become spaces.
pub(super) fn escaped(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => safe.push_str("&amp;"),
            '<' => safe.push_str("&lt;"),
            '>' => safe.push_str("&gt;"),
            '"' => safe.push_str("&quot;"),
            '\u{FFFE}' | '\u{FFFF}' => safe.push(' '),
            letter if letter.is_control() => safe.push(' '),
            letter => safe.push(letter),
        }
    }
    safe
}

/// Words of `text` in lines of at most `letters`, longer words alone in theirs.
pub(super) fn wrapped(text: &str, letters: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= letters => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

/// Round numbers from `low` to `high`: multiples of 1, 2 or 5 times a power of ten, about `wanted` of them; and how many
/// decimals tell them apart.
pub(super) fn round_ticks(low: f64, high: f64, wanted: usize) -> (Vec<f64>, usize) {
    let span = high - low;
    if !(span.is_finite() && span > 0.0) || wanted == 0 {
        return (if low.is_finite() { vec![low] } else { Vec::new() }, 2);
    }
    let step = round_length(span / wanted as f64);
    let (first, last) = ((low / step - 1e-9).ceil(), (high / step + 1e-9).floor());
    let ticks = (0..=(last - first).max(0.0) as usize).map(|k| (first + k as f64) * step + 0.0).collect();
    (ticks, (-step.log10().floor()).max(0.0) as usize)
}

/// The smallest of 1, 2, 5, 10 times a power of ten that is at least `length`.
pub(super) fn round_length(length: f64) -> f64 {
    let power = 10f64.powf(length.log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|f| f * power >= length * (1.0 - 1e-9)).unwrap_or(10.0);
    factor * power
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn numbers_are_short() {
        assert_eq!([1.0, -0.001, 2.345_678, 1e3].map(number), ["1", "0", "2.35", "1000"]);
    }

    #[test]
    fn ticks_are_round_numbers_inside_the_range() {
        assert_eq!(round_ticks(0.0, 1.0, 5), (vec![0.0, 0.2, 0.4, 0.6000000000000001, 0.8, 1.0], 1));
        assert_eq!(round_ticks(3.2, 4.9, 4).0, [3.5, 4.0, 4.5]);
        assert_eq!(round_ticks(2.0, 2.0, 4).0, [2.0]);
        assert!(round_ticks(f64::NAN, 2.0, 4).0.is_empty());
    }

    #[test]
    fn captions_are_wrapped_between_words() {
        assert_eq!(wrapped("a bb ccc dddd", 6), ["a bb", "ccc", "dddd"]);
    }

    proptest! {
        #[test]
        fn texts_cannot_break_out_of_their_element(text in ".*") {
            let safe = escaped(&text);
            prop_assert!(!safe.contains(['<', '>', '"']) && !safe.chars().any(char::is_control));
        }

        #[test]
        fn there_are_about_as_many_ticks_as_wanted(low in -1e6..1e6f64, span in 1e-3..1e6f64, wanted in 3usize..9) {
            let (ticks, _) = round_ticks(low, low + span, wanted);
            // Steps grow at most 2.5-fold from one to the next.
            prop_assert!(ticks.len() <= wanted + 1 && ticks.len() + 1 >= wanted * 2 / 5, "{ticks:?}");
            prop_assert!(ticks.iter().all(|t| *t >= low - 1e-6 * span && *t <= low + span * (1.0 + 1e-6)));
        }
    }
}
