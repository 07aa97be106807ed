//! Texts of other people: names, programs, hosts, reasons.

use crate::amounts::count;
use std::borrow::Cow;
use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;

/// Longest text that is written or shown (bytes): longer than any sentence, name or path, and short enough for a terminal or a
/// page.
pub const MAX_TEXT_BYTES: usize = 64 << 10;

/// Longest file that is read as one text (bytes): longer than any manifest that could come of it.
const MAX_FILE_BYTES: u64 = 256 << 20;

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

/// The text of the file `path`. A device or a pipe may have no end.
///
/// # Errors
/// When it cannot be read, is longer than 256 MiB, or is not UTF-8.
pub fn read(path: &Path) -> io::Result<String> {
    let mut text = String::new();
    let read = File::open(path)?.take(MAX_FILE_BYTES + 1).read_to_string(&mut text)?;
    if read as u64 > MAX_FILE_BYTES {
        let why = "it is longer than the 256 MiB that are read of a text";
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, why));
    }
    Ok(text)
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
