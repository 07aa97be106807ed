//! A drawn figure: the few elements that it is made of. Lengths are points (1/72 inch), y grows downwards.

use super::path::Step;
use super::raster::Cells;
use super::style::{Colour, Stroke};
use super::text::{self, Glyph};
use tiny_skia::{Path, PathBuilder};

/// A rectangle by its upper left corner.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rect {
    pub(super) x: f64,
    pub(super) y: f64,
    pub(super) width: f64,
    pub(super) height: f64,
}

impl Rect {
    pub(super) fn right(&self) -> f64 {
        self.x + self.width
    }

    pub(super) fn bottom(&self) -> f64 {
        self.y + self.height
    }
}

/// The part of a text that lies at its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Anchor {
    Start,
    Middle,
    End,
}

/// A pen: colour, width, gaps.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pen {
    pub(super) colour: Colour,
    pub(super) width: f64,
    pub(super) stroke: Stroke,
}

impl Pen {
    pub(super) fn solid(colour: Colour, width: f64) -> Self {
        Self { colour, width, stroke: Stroke::Solid }
    }

    /// Lengths of dashes and gaps.
    pub(super) fn dashes(&self) -> Option<[f64; 2]> {
        match self.stroke {
            Stroke::Solid => None,
            Stroke::Dashed => Some([5.0 * self.width, 3.0 * self.width]),
            // With round caps a dash of no length is a dot.
            Stroke::Dotted => Some([0.01, 2.5 * self.width]),
        }
    }
}

/// An outline that is filled, drawn with a pen, or both.
#[derive(Debug)]
pub(super) struct Shape {
    pub(super) outline: Outline,
    /// Colour, and opacity from 0 to 1.
    pub(super) fill: Option<(Colour, f64)>,
    pub(super) pen: Option<Pen>,
}

#[derive(Debug)]
pub(super) enum Outline {
    Rect(Rect),
    Line((f64, f64), (f64, f64)),
    Path(Vec<Step>),
}

/// One line of text.
#[derive(Debug)]
pub(super) struct Text {
    /// On its baseline.
    pub(super) place: (f64, f64),
    pub(super) is_upwards: bool,
    pub(super) anchor: Anchor,
    pub(super) size: f64,
    pub(super) colour: Colour,
    pub(super) content: String,
}

#[derive(Debug)]
pub(super) enum Element {
    Shape(Shape),
    Text(Text),
    /// Cells stretched over a rectangle, kept as sharp squares.
    Image(Rect, Cells),
    /// Cuts off what follows, up to [`Element::EndClip`], outside of a rectangle.
    Clip(Rect),
    EndClip,
}

/// A sheet in the making, white where nothing is.
#[derive(Debug, Default)]
pub(super) struct Sheet {
    pub(super) width: f64,
    pub(super) height: f64,
    pub(super) elements: Vec<Element>,
}

impl Sheet {
    fn shape(&mut self, outline: Outline, fill: Option<(Colour, f64)>, pen: Option<Pen>) {
        self.elements.push(Element::Shape(Shape { outline, fill, pen }));
    }

    pub(super) fn text(
        &mut self,
        place: (f64, f64),
        anchor: Anchor,
        (size, colour): (f64, Colour),
        content: &str,
    ) {
        let text = Text { place, is_upwards: false, anchor, size, colour, content: content.to_owned() };
        self.elements.push(Element::Text(text));
    }

    /// Text that reads upwards; the middle of its baseline is at `place`.
    pub(super) fn text_upwards(&mut self, place: (f64, f64), (size, colour): (f64, Colour), content: &str) {
        let (anchor, content) = (Anchor::Middle, content.to_owned());
        self.elements.push(Element::Text(Text { place, is_upwards: true, anchor, size, colour, content }));
    }

    /// A filled rectangle, `opacity` from 0 to 1.
    pub(super) fn fill(&mut self, rect: Rect, colour: Colour, opacity: f64) {
        self.shape(Outline::Rect(rect), Some((colour, opacity)), None);
    }

    /// The outline of a rectangle.
    pub(super) fn outline(&mut self, rect: Rect, pen: Pen) {
        self.shape(Outline::Rect(rect), None, Some(pen));
    }

    /// A drawn path.
    pub(super) fn path(&mut self, path: Vec<Step>, pen: Pen) {
        self.shape(Outline::Path(path), None, Some(pen));
    }

    /// A path with its inside filled and a hairline of white around, which keeps neighbours apart.
    pub(super) fn area(&mut self, path: Vec<Step>, colour: Colour, rim: f64) {
        self.shape(Outline::Path(path), Some((colour, 1.0)), Some(Pen::solid(Colour::White, rim)));
    }

    /// The inside of a path, `opacity` from 0 to 1.
    pub(super) fn tinted(&mut self, path: Vec<Step>, colour: Colour, opacity: f64) {
        self.shape(Outline::Path(path), Some((colour, opacity)), None);
    }

    pub(super) fn line(&mut self, from: (f64, f64), to: (f64, f64), pen: Pen) {
        self.shape(Outline::Line(from, to), None, Some(pen));
    }
}

impl Shape {
    /// True if corners and ends of the pen are round, as those of curves and dots are.
    pub(super) fn is_round(&self) -> bool {
        let is_dotted = self.pen.is_some_and(|pen| pen.stroke == Stroke::Dotted);
        is_dotted || self.fill.is_none() && matches!(self.outline, Outline::Path(_))
    }
}

impl Outline {
    /// Its path; none of what is empty.
    #[expect(clippy::cast_possible_truncation, reason = "a place on paper")]
    pub(super) fn path(&self) -> Option<Path> {
        let mut path = PathBuilder::new();
        match self {
            Self::Rect(Rect { x, y, width, height }) => {
                let [x, y, width, height] = [x, y, width, height].map(|length| *length as f32);
                path.push_rect(tiny_skia::Rect::from_xywh(x, y, width, height)?);
            }
            Self::Line(from, to) => {
                path.move_to(from.0 as f32, from.1 as f32);
                path.line_to(to.0 as f32, to.1 as f32);
            }
            Self::Path(steps) => {
                for step in steps {
                    match *step {
                        Step::Move(x, y) => path.move_to(x as f32, y as f32),
                        Step::Line(x, y) => path.line_to(x as f32, y as f32),
                        Step::Circle { x, y, radius } => path.push_circle(x as f32, y as f32, radius as f32),
                        Step::Close => path.close(),
                    }
                }
            }
        }
        path.finish()
    }
}

impl Text {
    /// Its glyphs, each with the matrix from a unit em, whose y grows upwards, to the sheet.
    pub(super) fn glyphs(&self) -> impl Iterator<Item = (Glyph, [f32; 6])> {
        let (glyphs, width) = text::set(&self.content, self.size);
        let begin = match self.anchor {
            Anchor::Start => 0.0,
            Anchor::Middle => -0.5 * width,
            Anchor::End => -width,
        };
        glyphs.into_iter().map(move |glyph| {
            let (right, down, size) = (begin + glyph.x, glyph.y, glyph.size);
            let matrix = if self.is_upwards {
                [0.0, -size, -size, 0.0, self.place.0 + down, self.place.1 - right]
            } else {
                [size, 0.0, 0.0, -size, self.place.0 + right, self.place.1 + down]
            };
            #[expect(clippy::cast_possible_truncation, reason = "a place on paper")]
            let matrix = matrix.map(|part| part as f32);
            (glyph, matrix)
        })
    }
}
