//! The colours of a terminal: ours where it has them, the nearest ones where it has fewer.

use figure::{diverging, diverging_on_dark};
use ratatui::style::Color;

/// Number of colours of a terminal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Depth {
    /// The sixteen that each user chooses.
    Sixteen,
    /// A cube of 6 × 6 × 6, and 24 greys.
    Cube,
    /// All.
    True,
}

/// The colours of a screen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Palette {
    /// Number of colours.
    pub depth: Depth,
    /// True if the terminal's background is dark.
    pub is_dark: bool,
}

impl Palette {
    /// The colour of a shade from −1 to 1.
    pub(crate) fn diverging(self, shade: f64) -> Color {
        if self.depth == Depth::Sixteen {
            let strong = shade.abs() > 0.5;
            // the bright ones are what stands out from a dark background
            return match (shade.abs() > 0.1, shade < 0.0, strong == self.is_dark) {
                (false, _, _) => Color::Reset,
                (true, true, true) => Color::LightBlue,
                (true, true, false) => Color::Blue,
                (true, false, true) => Color::LightRed,
                (true, false, false) => Color::Red,
            };
        }
        let colour = if self.is_dark { diverging_on_dark(shade) } else { diverging(shade) };
        self.nearest(colour.rgb())
    }

    /// The colour of a contact: touching (0), compressed (above) or open (below).
    pub(crate) fn class(self, value: f64) -> Color {
        let colour = match (value > 0.0, value < 0.0) {
            (true, _) if self.depth == Depth::Sixteen => return self.ink(),
            (_, true) if self.depth == Depth::Sixteen => return Color::Yellow,
            (true, _) if self.is_dark => figure::Colour::White,
            (true, _) => figure::Colour::Black,
            (_, true) => figure::Colour::Orange,
            _ => return self.diverging(0.0),
        };
        self.nearest(colour.rgb())
    }

    fn ink(self) -> Color {
        if self.is_dark { Color::White } else { Color::Black }
    }

    /// The colour of lines: the first curve's.
    pub(crate) fn line(self) -> Color {
        match (self.depth, self.is_dark) {
            (Depth::Sixteen, true) => Color::LightBlue,
            (Depth::Sixteen, false) => Color::Blue,
            (_, true) => self.nearest(figure::Colour::Sky.rgb()),
            (_, false) => self.nearest(figure::Colour::Blue.rgb()),
        }
    }

    fn nearest(self, [red, green, blue]: [u8; 3]) -> Color {
        if self.depth == Depth::True {
            return Color::Rgb(red, green, blue);
        }
        let cube = [red, green, blue].map(nearest_level);
        let mean = (u16::from(red) + u16::from(green) + u16::from(blue)) / 3;
        let grey = (mean.saturating_sub(3) / 10).min(23);
        let off = |found: [u16; 3]| -> u32 {
            let pairs = found.into_iter().zip([red, green, blue]);
            pairs.map(|(found, wanted)| u32::from(found.abs_diff(wanted.into())).pow(2)).sum()
        };
        let levels = cube.map(|level| LEVELS[usize::from(level)]);
        if off([8 + 10 * grey; 3]) < off(levels) {
            return Color::Indexed(u8::try_from(232 + grey).unwrap_or(u8::MAX));
        }
        Color::Indexed(16 + 36 * cube[0] + 6 * cube[1] + cube[2])
    }
}

/// The levels of the cube's colours.
const LEVELS: [u16; 6] = [0, 95, 135, 175, 215, 255];

fn nearest_level(byte: u8) -> u8 {
    let off = |level: &u8| LEVELS[usize::from(*level)].abs_diff(byte.into());
    (0..6).min_by_key(off).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fewer_colours_are_the_nearest_ones() {
        let palette = Palette { depth: Depth::Cube, is_dark: false };
        let of = |rgb: [u8; 3]| palette.nearest(rgb);
        assert_eq!(of([255, 255, 255]), Color::Indexed(231));
        assert_eq!(of([255, 0, 0]), Color::Indexed(196));
        assert_eq!(of([128, 128, 128]), Color::Indexed(244));
        assert_eq!(of([0, 0, 0]), Color::Indexed(16));
        assert_eq!(palette.diverging(0.0), Color::Indexed(231));
        let few = Palette { depth: Depth::Sixteen, is_dark: true };
        let found = [-1.0, -0.3, 0.0, 0.3, 1.0].map(|shade| few.diverging(shade));
        assert_eq!(found, [Color::LightBlue, Color::Blue, Color::Reset, Color::Red, Color::LightRed]);
    }
}
