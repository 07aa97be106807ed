//! Meaning of keys on the screen.

use crate::keyboard::{Meaning, Press, presses};

/// A wish of the user, or an answer of the terminal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Key {
    /// The run above.
    Up,
    /// The run below.
    Down,
    /// The next field.
    NextField,
    /// The field before.
    LastField,
    /// Linear colours, or logarithmic ones.
    Colours,
    /// The screen stands still, or goes on.
    Pause,
    /// The keys explained, or not.
    Help,
    /// The terminal's background.
    Background {
        /// True if text on it is light.
        is_dark: bool,
    },
    /// The end.
    End,
}

impl Meaning for Key {
    fn of(bytes: &[u8]) -> Vec<Self> {
        let key = |press| match press {
            Press::Byte(b'k') | Press::Special(_, b'A') => Some(Self::Up),
            Press::Byte(b'j') | Press::Special(_, b'B') => Some(Self::Down),
            Press::Byte(b'f') => Some(Self::NextField),
            Press::Byte(b'F') => Some(Self::LastField),
            Press::Byte(b'l') => Some(Self::Colours),
            Press::Byte(b'p' | b' ') => Some(Self::Pause),
            Press::Byte(b'?' | b'h') => Some(Self::Help),
            Press::Byte(b'q' | b'Q' | 0x1b) => Some(Self::End),
            Press::Answer(answer) => is_dark(answer).map(|is_dark| Self::Background { is_dark }),
            _ => None,
        };
        presses(bytes).into_iter().filter_map(key).collect()
    }

    fn is_end(&self) -> bool {
        *self == Self::End
    }
}

/// True if the background is dark, from an answer such as `11;rgb:1e1e/2020/ffff`.
fn is_dark(answer: &[u8]) -> Option<bool> {
    let text = std::str::from_utf8(answer).ok()?.strip_prefix("11;rgb:")?;
    let part = |digits: &str| {
        let most = 16_u32.checked_pow(u32::try_from(digits.len()).ok()?)? - 1;
        Some(f64::from(u32::from_str_radix(digits, 16).ok()?) / f64::from(most))
    };
    let parts: Vec<f64> = text.split('/').map(part).collect::<Option<_>>()?;
    let [red, green, blue] = parts.try_into().ok()?;
    Some(0.30 * red + 0.59 * green + 0.11 * blue < 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_terminal_tells_keys_and_its_background() {
        let keys = Key::of(b"\x1b[A\x1bOBfF\x1b]11;rgb:1e1e/2020/2222\x1b\\l?\x1b]11;rgb:ff/ff/dd\x07q\x1b");
        let told = [true, false].map(|is_dark| Key::Background { is_dark });
        let expected = [Key::Up, Key::Down, Key::NextField, Key::LastField, told[0]];
        assert_eq!(keys[..5], expected);
        assert_eq!(keys[5..], [Key::Colours, Key::Help, told[1], Key::End, Key::End]);
        for odd in ["\x1b]11;rgb:", "\x1b]11;rgb:1/2", "\x1b]11;rgb:////", "\x1b]", "\x1b]52;c;\x07x"] {
            assert_eq!(Key::of(odd.as_bytes()), [], "{odd:?}");
        }
    }
}
