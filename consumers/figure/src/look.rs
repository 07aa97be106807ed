//! Lengths of figures, by their size.

use super::panel::Panel;
use super::sheet::Pen;
use super::style::{Colour, Ink, Stroke};
use super::{Figure, Size};

const POINTS_PER_MM: f64 = 72.0 / 25.4;
/// Distance from one baseline to the next, in units of the font's size.
pub(super) const LEADING: f64 = 1.28;

/// The lengths that make the look at one size, in points.
#[derive(Debug, Clone, Copy)]
pub(super) struct Look {
    pub(super) width: f64,
    /// The whole height where it is fixed, else the largest.
    pub(super) height: f64,
    pub(super) fixed_height: bool,
    /// Font sizes of axis labels and legend, of numbers, of the caption.
    pub(super) label: f64,
    pub(super) number: f64,
    pub(super) caption: f64,
    /// Widths of a curve and of the frame.
    pub(super) line: f64,
    pub(super) frame: f64,
    /// Radius of a marker.
    pub(super) mark: f64,
    /// Height of an only, of a stacked, and of a raster panel as parts of the figure's width.
    only: f64,
    stacked: f64,
    raster: f64,
}

impl Look {
    pub(super) fn of(size: Size) -> Self {
        let column = Self {
            width: 86.0 * POINTS_PER_MM,
            height: 235.0 * POINTS_PER_MM,
            fixed_height: false,
            label: 7.5,
            number: 7.0,
            caption: 6.0,
            line: 0.8,
            frame: 0.5,
            mark: 1.6,
            only: 0.56,
            stacked: 0.34,
            raster: 0.8,
        };
        match size {
            Size::Column => column,
            Size::Page => Self {
                width: 178.0 * POINTS_PER_MM,
                label: 8.0,
                number: 7.5,
                caption: 6.5,
                line: 0.9,
                mark: 1.9,
                only: 0.4,
                stacked: 0.22,
                raster: 0.55,
                ..column
            },
            Size::Slide => Self {
                width: 254.0 * POINTS_PER_MM,
                height: 254.0 * 9.0 / 16.0 * POINTS_PER_MM,
                fixed_height: true,
                label: 14.0,
                number: 12.5,
                caption: 9.5,
                line: 1.7,
                frame: 0.9,
                mark: 3.3,
                only: 0.4,
                stacked: 0.2,
                raster: 0.4,
            },
            Size::Screen { width, height, text } => {
                let text = f64::from(text);
                Self {
                    width: width.into(),
                    height: height.into(),
                    label: text,
                    number: 0.9 * text,
                    caption: 0.72 * text,
                    line: 0.11 * text,
                    frame: 0.06 * text,
                    mark: 0.27 * text,
                    ..Self::of(Size::Slide)
                }
            }
        }
    }

    pub(super) fn tick_length(&self) -> f64 {
        0.36 * self.number
    }

    pub(super) fn number_gap(&self) -> f64 {
        0.32 * self.number
    }

    pub(super) fn bar_gap(&self) -> f64 {
        0.8 * self.label
    }

    pub(super) fn bar_width(&self) -> f64 {
        1.1 * self.label
    }

    pub(super) fn curve_pen(&self, ink: Ink, stroke: Stroke) -> Pen {
        let width = if ink.thin { 0.5 * self.line } else { self.line };
        Pen { colour: ink.colour, width, stroke }
    }

    /// Reference lines are thin, dashed and grey.
    pub(super) fn reference_pen(&self) -> Pen {
        Pen { colour: Colour::Rgb(0x55, 0x55, 0x55), width: 0.75 * self.line, stroke: Stroke::Dashed }
    }

    pub(super) fn pad(&self) -> f64 {
        0.5 * self.label
    }

    /// The height a panel has where there is room.
    pub(super) fn wanted_height(&self, figure: &Figure, panel: &Panel) -> f64 {
        let part = match (&panel.raster, figure.panels.len()) {
            (Some(_), _) => self.raster,
            (None, 1) => self.only,
            (None, _) => self.stacked,
        };
        part * self.width * panel.height
    }
}
