//! Colours, strokes and markers, and how curves take them in turn.

use super::path::Step;

/// A colour of the figure's palette (Okabe and Ito), which colour-blind readers can tell apart.
///
/// # Source
/// M. Okabe and K. Ito, *Color Universal Design* (2008).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Colour {
    /// Black.
    Black,
    /// Blue, the first curve's.
    Blue,
    /// Vermillion, a red that leans to orange.
    Vermillion,
    /// Bluish green.
    Green,
    /// Orange.
    Orange,
    /// Reddish purple.
    Purple,
    /// Sky blue.
    Sky,
    /// Yellow: for areas, too light for lines.
    Yellow,
    /// A middle grey.
    Grey,
    /// A grey just off white: for areas.
    LightGrey,
    /// The paper's white.
    White,
    /// Any other colour: red, green, blue.
    Rgb(u8, u8, u8),
}

impl Colour {
    /// The colours that unstyled curves take in turn.
    pub(super) const CYCLE: [Self; 7] =
        [Self::Blue, Self::Vermillion, Self::Green, Self::Purple, Self::Orange, Self::Sky, Self::Black];

    /// Red, green and blue.
    pub fn rgb(self) -> [u8; 3] {
        match self {
            Self::Black => [0, 0, 0],
            Self::Blue => [0x00, 0x72, 0xB2],
            Self::Vermillion => [0xD5, 0x5E, 0x00],
            Self::Green => [0x00, 0x9E, 0x73],
            Self::Orange => [0xE6, 0x9F, 0x00],
            Self::Purple => [0xCC, 0x79, 0xA7],
            Self::Sky => [0x56, 0xB4, 0xE9],
            Self::Yellow => [0xF0, 0xE4, 0x42],
            Self::Grey => [0x80, 0x80, 0x80],
            Self::LightGrey => [0xE4, 0xE4, 0xE4],
            Self::White => [0xFF, 0xFF, 0xFF],
            Self::Rgb(red, green, blue) => [red, green, blue],
        }
    }

    /// As SVG writes it.
    pub(super) fn hex(self) -> String {
        let [red, green, blue] = self.rgb();
        format!("#{red:02x}{green:02x}{blue:02x}")
    }
}

/// Stroke of a line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stroke {
    /// Without gaps.
    Solid,
    /// In dashes.
    Dashed,
    /// In dots.
    Dotted,
}

impl Stroke {
    /// The strokes that curves take in turn once the colours are used up.
    pub(super) const CYCLE: [Self; 3] = [Self::Solid, Self::Dashed, Self::Dotted];
}

/// The shape that marks a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// A disc.
    Circle,
    /// A square.
    Square,
    /// A triangle, point up.
    Triangle,
    /// A square on its corner.
    Diamond,
    /// A thin upright cross, wider than the others: it is seen under one of them.
    Cross,
}

impl Mark {
    /// Its outline around a place; shapes have about the same area, but for the cross.
    pub(super) fn path(self, (x, y): (f64, f64), radius: f64) -> Vec<Step> {
        let corners: &[(f64, f64)] = match self {
            Self::Circle => return vec![Step::Circle { x, y, radius }],
            Self::Square => &[(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)],
            Self::Triangle => &[(0.0, -1.3), (1.2, 0.8), (-1.2, 0.8)],
            Self::Diamond => &[(0.0, -1.3), (1.3, 0.0), (0.0, 1.3), (-1.3, 0.0)],
            Self::Cross => &[
                (-0.3, -2.2),
                (0.3, -2.2),
                (0.3, -0.3),
                (2.2, -0.3),
                (2.2, 0.3),
                (0.3, 0.3),
                (0.3, 2.2),
                (-0.3, 2.2),
                (-0.3, 0.3),
                (-2.2, 0.3),
                (-2.2, -0.3),
                (-0.3, -0.3),
            ],
        };
        let places: Vec<_> =
            corners.iter().map(|(right, down)| (x + right * radius, y + down * radius)).collect();
        Step::line(&places).chain([Step::Close]).collect()
    }
}

/// Colour and stroke of a curve once its turn in the palette is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ink {
    pub(super) colour: Colour,
    pub(super) stroke: Option<Stroke>,
    pub(super) mark: Option<Mark>,
    pub(super) thin: bool,
}
