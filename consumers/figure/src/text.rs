//! Text as it is drawn: its width in the bundled font, raised and lowered figures, wrapping, escaping.

use std::fmt::Write;

use skrifa::instance::{LocationRef, Size};
use skrifa::{FontRef, MetadataProvider};

/// Liberation Sans: the metrics of Arial, with Greek and mathematical signs, under the SIL Open Font License.
pub(super) const FONT: &[u8] = include_bytes!("../fonts/LiberationSans-Regular.ttf");
/// Units in which its outlines are drawn.
pub(super) const UNITS_PER_EM: f32 = 2048.0;
/// Families by preference; the fallbacks have the same metrics.
pub(super) const FAMILIES: &str = "Liberation Sans, Arial, Helvetica, sans-serif";
/// Height of capitals and figures, in units of the font's size.
pub(super) const CAP_HEIGHT: f64 = 0.72;
/// Raised and lowered figures, in units of the text around them.
const SMALL: f64 = 0.72;
const RAISE: f64 = 0.36;
const LOWER: f64 = 0.14;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Height {
    Base,
    Raised,
    Lowered,
}

/// Text as characters at heights. Unicode's super- and subscripts, which few fonts have, become ordinary
/// characters raised or lowered; so does what stands in `^{…}` and `_{…}`.
fn parse(text: &str) -> Vec<(Height, char)> {
    let mut parsed = Vec::new();
    let mut rest = text;
    while let Some(character) = rest.chars().next() {
        let marked = [("^{", Height::Raised), ("_{", Height::Lowered)];
        let found = marked.into_iter().find_map(|(opening, height)| {
            let (inside, after) = rest.strip_prefix(opening)?.split_once('}')?;
            Some((height, inside, after))
        });
        if let Some((height, inside, after)) = found {
            parsed.extend(inside.chars().map(|character| (height, character)));
            rest = after;
        } else {
            parsed.push(at_height(character));
            rest = &rest[character.len_utf8()..];
        }
    }
    parsed
}

fn at_height(character: char) -> (Height, char) {
    const RAISED: [&str; 2] = ["⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻ⁿⁱ", "0123456789+−ni"];
    const LOWERED: [&str; 2] = ["₀₁₂₃₄₅₆₇₈₉₊₋ᵢₙ", "0123456789+−in"];
    for (height, [from, to]) in [(Height::Raised, RAISED), (Height::Lowered, LOWERED)] {
        let mut pairs = from.chars().zip(to.chars());
        if let Some((_, plain)) = pairs.find(|(special, _)| *special == character) {
            return (height, plain);
        }
    }
    // what XML 1.0 cannot hold is U+FFFD
    let character = match character {
        '\t' | '\n' | '\r' => ' ',
        '\0'..='\u{1f}' | '\u{fffe}' | '\u{ffff}' => '\u{fffd}',
        other => other,
    };
    (Height::Base, character)
}

/// A character of a line, as it is drawn.
#[derive(Debug, Clone, Copy)]
pub(super) struct Glyph {
    /// Its number in the font.
    pub(super) id: u16,
    pub(super) character: char,
    /// Its place in the line, from the beginning of the baseline; y grows downwards.
    pub(super) x: f64,
    pub(super) y: f64,
    /// The font's size.
    pub(super) size: f64,
}

/// Sets one line of text at `size`, and gives its width in the unit of `size`; kerning left out.
pub(super) fn set(text: &str, size: f64) -> (Vec<Glyph>, f64) {
    // The font is a constant of this program; a wide guess keeps layout safe if it ever fails to parse.
    let Ok(font) = FontRef::new(FONT) else {
        return (Vec::new(), text.chars().count() as f64 * size);
    };
    let metrics = font.glyph_metrics(Size::new(1.0), LocationRef::default());
    let charmap = font.charmap();
    let mut x = 0.0;
    let glyphs = parse(text).into_iter().map(|(height, character)| {
        let glyph = charmap.map(character).unwrap_or_default();
        let own_size = if height == Height::Base { size } else { size * SMALL };
        let id = u16::try_from(glyph.to_u32()).unwrap_or(0);
        let placed = Glyph { id, character, x, y: offset(height, size), size: own_size };
        x += metrics.advance_width(glyph).map_or(1.0, f64::from) * own_size;
        placed
    });
    (glyphs.collect(), x)
}

/// Width of one line of text set at `size`, in the unit of `size`; kerning left out.
pub(super) fn width(text: &str, size: f64) -> f64 {
    set(text, size).1
}

/// Breaks text into lines no wider than `limit`: at spaces, inside a word only where it is wider itself.
/// A no-break space joins words. Line breaks in the text are kept. An empty text has no lines.
pub(super) fn wrap(text: &str, size: f64, limit: f64) -> Vec<String> {
    if text.trim().is_empty() {
        return Vec::new();
    }
    text.lines().flat_map(|line| wrap_line(line, size, limit)).collect()
}

fn wrap_line(text: &str, size: f64, limit: f64) -> Vec<String> {
    let mut lines = Vec::new();
    let mut line = String::new();
    for word in text.split_ascii_whitespace() {
        let joined = if line.is_empty() { word.to_owned() } else { format!("{line} {word}") };
        if width(&joined, size) <= limit {
            line = joined;
            continue;
        }
        if !line.is_empty() {
            lines.push(std::mem::take(&mut line));
        }
        for character in word.chars() {
            line.push(character);
            if width(&line, size) > limit && line.chars().count() > 1 {
                line.pop();
                lines.push(std::mem::replace(&mut line, character.to_string()));
            }
        }
    }
    lines.push(line);
    lines
}

/// The content of an SVG `<text>` set at `size`.
pub(super) fn spans(text: &str, size: f64) -> String {
    let mut out = String::new();
    let mut current = Height::Base;
    for stretch in parse(text).chunk_by(|a, b| a.0 == b.0) {
        let height = stretch[0].0;
        let content: String = stretch.iter().map(|(_, plain)| escape_char(*plain)).collect();
        // A shift is relative to the baseline reached before.
        let shift = offset(height, size) - offset(current, size);
        current = height;
        let size = if height == Height::Base { size } else { size * SMALL };
        if shift == 0.0 {
            out.push_str(&content);
        } else {
            // Writing to a String cannot fail.
            let _ = write!(out, r#"<tspan dy="{shift:.3}" font-size="{size:.3}">{content}</tspan>"#);
        }
    }
    out
}

fn offset(height: Height, size: f64) -> f64 {
    match height {
        Height::Base => 0.0,
        Height::Raised => -RAISE * size,
        Height::Lowered => LOWER * size,
    }
}

/// One character as XML text.
fn escape_char(character: char) -> String {
    match character {
        '&' => "&amp;".to_owned(),
        '<' => "&lt;".to_owned(),
        '>' => "&gt;".to_owned(),
        '"' => "&quot;".to_owned(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_font_has_the_signs_that_labels_need() {
        let charmap = FontRef::new(FONT).expect("the bundled font parses").charmap();
        for character in "αβγδεκλμνπρστφωΔΩΣ×−·±≈≤≥√∞∂…–—µ°≠→←".chars()
        {
            assert!(charmap.map(character).is_some(), "no glyph for {character}");
        }
    }

    #[test]
    fn widths_are_those_of_arial() {
        // Arial: a figure is 1139 of 2048 units wide, a space 569.
        assert!((width("0", 2048.0) - 1139.0).abs() < 0.5);
        assert!((width("0 0", 2048.0) - 2847.0).abs() < 0.5);
        assert!((width("²", 2048.0) - 1139.0 * SMALL).abs() < 0.5);
    }

    #[test]
    fn wrapped_lines_fit_and_lose_no_word() {
        let text = "k = 10⁷ N·m^−1.5, run 0123456789abcdef0123456789abcdef, dt = 0.005 T";
        let lines = wrap(text, 7.0, 80.0);
        assert!(lines.len() > 2);
        assert!(lines.iter().all(|line| width(line, 7.0) <= 80.0));
        let letters = |text: &str| text.replace(' ', "");
        assert_eq!(letters(&lines.concat()), letters(text));
    }

    #[test]
    fn superscripts_come_back_to_the_baseline() {
        assert_eq!(
            spans("10⁻³ m", 10.0),
            r#"10<tspan dy="-3.600" font-size="7.200">−3</tspan><tspan dy="3.600" font-size="10.000"> m</tspan>"#
        );
        assert_eq!(spans("x^{α} y_{i", 10.0).matches("tspan").count(), 4);
        assert_eq!(width("m^{2}", 9.0), width("m²", 9.0));
    }

    #[test]
    fn text_cannot_break_out_of_the_document() {
        assert_eq!(spans("</text>&\"\u{1}", 1.0), "&lt;/text&gt;&amp;&quot;\u{fffd}");
    }
}
