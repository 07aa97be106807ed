//! Texts of other people: names, programs, hosts, reasons.

use crate::amounts::count;
use std::borrow::Cow;

/// Longest text that is written or shown (bytes): longer than any sentence, name or path, and short enough for a terminal or a
/// page.
pub const MAX_TEXT_BYTES: usize = 64 << 10;

/// Room (bytes) for the note about the length: a text that was cut once is not cut again.
const LENGTH_BYTES: usize = 40;

/// A text as it is shown. A text of more than [`MAX_TEXT_BYTES`] is shown by its beginning and its length.
pub fn shown(text: &str) -> Cow<'_, str> {
    shown_within(text, MAX_TEXT_BYTES)
}

/// The same with another bound.
pub fn shown_within(text: &str, most_bytes: usize) -> Cow<'_, str> {
    if text.len() <= most_bytes {
        return Cow::Borrowed(text);
    }
    let kept = text.floor_char_boundary(most_bytes.saturating_sub(LENGTH_BYTES));
    Cow::Owned(format!("{}… ({} bytes)", &text[..kept], count(text.len() as u64)))
}

#[cfg(test)]
mod tests {
    use super::{MAX_TEXT_BYTES, shown, shown_within};

    #[test]
    fn a_long_text_is_cut_between_characters_and_says_its_length() {
        let (whole, long) = ("a".repeat(MAX_TEXT_BYTES), "é".repeat(2_500_000));
        assert_eq!(shown(&whole), whole);
        assert!(shown(&long).ends_with("é… (5,000,000 bytes)"));
        assert_eq!(shown(&shown(&long)), shown(&long));
        assert_eq!(shown_within(&"é".repeat(50), 43), "é… (100 bytes)");
    }
}
