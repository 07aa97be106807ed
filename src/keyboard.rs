//! Keys pressed on the terminal while a run or a replay goes on, or on a screen of its own.
//!
//! The terminal hands out each key at once and shows none of them until the [`Keyboard`] is dropped. The terminal is
//! restored on every way out: a return, a panic, a signal that ends or suspends the process.

#[cfg(not(unix))]
mod no_terminal;
#[cfg(unix)]
mod terminal;

#[cfg(not(unix))]
pub(crate) use no_terminal::Keyboard;
#[cfg(unix)]
pub(crate) use terminal::Keyboard;
#[cfg(feature = "live")]
pub(crate) use terminal::Terminal;

/// Meaning of presses.
pub(crate) trait Meaning: Sized + Send + 'static {
    /// The meanings of these bytes of a terminal.
    fn of(bytes: &[u8]) -> Vec<Self>;
    /// True if this one means the end.
    fn is_end(&self) -> bool;
}

/// Command that a person gives by a key.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Key {
    /// Pause or go on.
    Pause,
    /// One more frame.
    Step,
    /// Twice the rate.
    Faster,
    /// Half the rate.
    Slower,
    /// Go to another place; means something where frames are there already.
    Seek(Seek),
    /// The end.
    Quit,
}

/// Place at which frames go on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Seek {
    /// The frame before the last one, and a pause there.
    FrameBack,
    /// A twentieth of the whole back.
    Back,
    /// A twentieth of the whole on.
    On,
    /// The first frame.
    Home,
}

/// One press, or one answer, in the bytes of a terminal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Press<'a> {
    /// A character's byte, or Esc by itself.
    Byte(u8),
    /// The rest after ESC [ or ESC O: a key by its numbers and its last byte.
    Special(&'a [u8], u8),
    /// The rest after ESC ]: the answer to a question.
    Answer(&'a [u8]),
}

/// Splits bytes of a terminal into presses.
pub(crate) fn presses(mut bytes: &[u8]) -> Vec<Press<'_>> {
    let mut presses = Vec::new();
    while let [first, rest @ ..] = bytes {
        bytes = rest;
        match (first, rest) {
            (0x1b, [b'[' | b'O', rest @ ..]) => {
                let length = rest.iter().position(|byte| (0x40..=0x7e).contains(byte));
                let length = length.unwrap_or(rest.len());
                bytes = rest.get(length + 1..).unwrap_or_default();
                presses.extend(rest.get(length).map(|last| Press::Special(&rest[..length], *last)));
            }
            (0x1b, [b']', rest @ ..]) => {
                let length = rest.iter().position(|byte| matches!(byte, 0x07 | 0x1b)).unwrap_or(rest.len());
                presses.push(Press::Answer(&rest[..length]));
                let end = rest.get(length..).unwrap_or_default();
                bytes = end.strip_prefix(b"\x1b\\").unwrap_or(end.get(1..).unwrap_or_default());
            }
            _ => presses.push(Press::Byte(*first)),
        }
    }
    presses
}

impl Meaning for Key {
    fn of(bytes: &[u8]) -> Vec<Self> {
        let key = |press| match press {
            Press::Byte(b' ') => Some(Self::Pause),
            Press::Byte(b'.') | Press::Special(_, b'C') => Some(Self::Step),
            Press::Byte(b'+' | b'=') => Some(Self::Faster),
            Press::Byte(b'-') => Some(Self::Slower),
            Press::Byte(b'[') => Some(Self::Seek(Seek::Back)),
            Press::Byte(b']') => Some(Self::Seek(Seek::On)),
            Press::Byte(b'q' | b'Q') => Some(Self::Quit),
            Press::Special(_, b'D') => Some(Self::Seek(Seek::FrameBack)),
            // terminals have several for Home
            Press::Special(_, b'H') | Press::Special(b"1" | b"7", b'~') => Some(Self::Seek(Seek::Home)),
            _ => None,
        };
        presses(bytes).into_iter().filter_map(key).collect()
    }

    fn is_end(&self) -> bool {
        *self == Self::Quit
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_known_by_their_bytes() {
        use Key::{Faster, Pause, Quit, Slower, Step};
        assert_eq!(Key::of(b" .+=-q"), [Pause, Step, Faster, Faster, Slower, Quit]);
        assert_eq!(Key::of(b"\x1b[C\x1bOC\x1b[1;5C"), [Step, Step, Step], "arrows to the right");
        assert_eq!(Key::of(b"\x1b[A\x1b[3~x\x1b \x1b["), [Pause], "other keys mean nothing");
        let back = [Seek::FrameBack, Seek::Back, Seek::On, Seek::Home, Seek::Home, Seek::Home];
        assert_eq!(Key::of(b"\x1b[D[]\x1b[H\x1bOH\x1b[1~"), back.map(Key::Seek));
    }
}
