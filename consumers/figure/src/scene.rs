//! Pictures of a film: figures side by side that are drawn once, and contents that are drawn over them anew.

use super::layout::Layout;
use super::panel::Panel;
use super::{Figure, FigureError, Size, draw, picture};
use tiny_skia::{Pixmap, Transform};

/// A figure in a scene, from its upper to its lower edge.
#[derive(Debug, Clone)]
pub struct Column {
    /// The figure; titles of its panels belong to the pictures.
    pub figure: Figure,
    /// Its width as a part of the scene's.
    pub part: f64,
}

/// Dots of a picture, row by row: red, green, blue, and 255.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Dots {
    /// Dots in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Four bytes a dot.
    pub rgba: Vec<u8>,
}

/// The things that all pictures of a film have in common.
#[derive(Debug)]
pub struct Scene<'a> {
    still: Pixmap,
    /// The figures with the distances of their left edges from that of the scene (dots).
    columns: Vec<(u32, Layout<'a>)>,
}

impl<'a> Scene<'a> {
    /// Lays out and draws figures from left to right on so many dots.
    ///
    /// # Errors
    /// [`FigureError::Render`] where there is no room for the dots.
    pub fn new((width, height): (u32, u32), columns: &'a [Column]) -> Result<Self, FigureError> {
        /// Size of the text as a part of the shorter side, and the least that is read (dots).
        const TEXT: (f64, f64) = (0.026, 9.0);
        let mut scene = Self { still: picture::paper(width, height)?, columns: Vec::new() };
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "dots of a screen")]
        let dots = |length: f64| length.round() as u32;
        let text = dots(TEXT.1.max(TEXT.0 * f64::from(width.min(height))));
        let mut left = 0;
        for Column { figure, part } in columns {
            let size = Size::Screen { width: dots(part * f64::from(width)).max(1), height, text };
            let layout = Layout::new(figure, size, Some(1.0));
            picture::draw(&draw::document_of(&layout, Some(1.0)), &mut scene.still, shifted(left))?;
            scene.columns.push((left, layout));
            left += dots(part * f64::from(width));
        }
        Ok(scene)
    }

    /// The picture with reference lines, curves and titles of `over` in the axes of the figures' panels, from the first
    /// figure to the last one and from top to bottom.
    ///
    /// # Errors
    /// [`FigureError::Render`] where there is no room for the dots.
    pub fn picture(&self, over: &[Panel]) -> Result<Dots, FigureError> {
        let (mut pixels, mut over) = (self.still.clone(), over);
        for (left, layout) in &self.columns {
            let (own, rest) = over.split_at(layout.panels.len().min(over.len()));
            picture::draw(&draw::over(layout, own), &mut pixels, shifted(*left))?;
            over = rest;
        }
        // nothing lets the white paper through, so that premultiplied colours are the colours
        Ok(Dots { width: pixels.width(), height: pixels.height(), rgba: pixels.take() })
    }
}

fn shifted(left: u32) -> Transform {
    Transform::from_translate(left as f32, 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Axis, Colour, Curve};

    /// Drawn over a still figure, or at once: the same dots.
    #[test]
    fn contents_over_a_figure_lie_where_its_own_would() {
        let panel = || {
            let axis = |label| Axis::new(label).limits(0.0, 4.0);
            Panel::new().x_axis(axis("bead")).y_axis(axis("v").reversed())
        };
        let curve = || Curve::line("", [(0.5, 1.0), (2.0, 3.0), (3.5, 0.2)]).colour(Colour::Blue);
        let column = |panel| Column { figure: Figure::new().panel(panel), part: 0.5 };
        let drawn = |panels: [Panel; 2], over: &[Panel]| {
            let columns = panels.map(column);
            Scene::new((640, 360), &columns).and_then(|scene| scene.picture(over)).expect("draws")
        };
        let over = || Panel::new().curve(curve()).title("t = 2");
        let moving = drawn([panel().title(" "), panel().title(" ")], &[over(), over()]);
        let whole = || panel().curve(curve()).title("t = 2");
        assert!(moving == drawn([whole(), whole()], &[]));
        assert!(moving != drawn([whole(), panel().title(" ")], &[]));
        assert_eq!((moving.width, moving.height, moving.rgba.len()), (640, 360, 4 * 640 * 360));
        assert!(moving.rgba.iter().skip(3).step_by(4).all(|opacity| *opacity == 255));
    }
}
