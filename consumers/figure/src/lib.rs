//! Figures for print: curves, markers and rasters on stacked panels, as SVG, PDF or PNG.
//!
//! A figure is described once and drawn at the width of a journal column, of a page, or of a slide,
//! always in the same look: one font (bundled), colours that colour-blind readers can tell apart, ticks
//! on round numbers. The same figure gives the same bytes. Nothing here knows the meaning of the numbers:
//! labels carry the units. In every text `^{…}` raises and `_{…}` lowers (Unicode's ², ⁻¹ and ₀ are drawn
//! the same way).
//!
//! The SVG is written by this module rather than by a plotting crate: `kuva`, the best-looking one, has
//! neither images nor an axis that runs downwards, and measures text in another font than the one drawn.
//!
//! ```
//! use figure::{Axis, Colour, Curve, Figure, Options, Panel, Raster, Stroke};
//!
//! let wave = (0..1000).map(|bead| (f64::from(bead), (f64::from(bead) * 0.01).sin()));
//! let profile = Panel::new()
//!     .x_axis("bead")
//!     .y_axis("velocity (m/s)")
//!     .line("rkn4", wave.clone())
//!     .curve(Curve::line("theory", wave).stroke(Stroke::Dashed))
//!     .vertical("impurity", 500.0);
//! let map = Raster::classes(3, 2, vec![0, 1, 0, 0, 1, 1], &[
//!     ("open", Colour::White),
//!     ("compressed", Colour::Blue),
//! ])?
//! .over((-0.5, 2.5), (0.0, 80.0));
//! let space_time = Panel::new()
//!     .x_axis("contact")
//!     .y_axis(Axis::new("time (ms)").reversed())
//!     .raster(map);
//! let figure = Figure::new()
//!     .caption("α = 1.5, 1000 beads of 1 g")
//!     .panel(profile)
//!     .panel(space_time);
//! # let folder = tempfile::tempdir().unwrap();
//! # let path = folder.path().join("figure.svg");
//! figure.write(&path, Options::default(), false)?;
//! # Ok::<(), figure::FigureError>(())
//! ```

mod axis;
mod colour_scale;
mod decimate;
mod draw;
mod layout;
mod legend;
mod look;
mod panel;
mod path;
mod pdf;
mod picture;
mod prefixes;
mod raster;
mod reel;
mod scale;
mod scene;
mod sheet;
mod style;
mod svg;
mod text;
mod ticks;

use schemas::whole_file::{self, WholeFileError};
use std::path::{Path, PathBuf};

pub use axis::Axis;
pub use colour_scale::{ColourScale, diverging, diverging_on_dark};
pub use panel::{Curve, Panel};
pub use raster::Raster;
pub use reel::{Apng, Gif};
pub use scene::{Column, Dots, Scene};
pub use style::{Colour, Mark, Stroke};

/// One picture: panels from top to bottom with their axes aligned, and a caption line under them.
#[derive(Debug, Clone, Default)]
#[must_use]
pub struct Figure {
    panels: Vec<Panel>,
    caption: String,
    shared_x: bool,
}

/// Size of a figure on paper or on the screen; text is 7 to 8 pt in print, about 14 pt on a slide.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Size {
    /// One column of a journal, 86 mm wide.
    #[default]
    Column,
    /// The full width of a page, 178 mm.
    Page,
    /// A slide in 16:9, 254 mm × 142.9 mm; higher only where panels would become unreadably low.
    Slide,
    /// A part of a screen, in dots; at 72 dots per inch one is a point.
    Screen {
        /// Its width.
        width: u32,
        /// Its height; more only where panels would become unreadably low.
        height: u32,
        /// Size of the font of labels.
        text: u32,
    },
}

/// Options for writing a figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// The figure's width; the height follows from the panels.
    pub size: Size,
    /// Resolution of a PNG in dots per inch, 36 to 2400; an SVG or a PDF has none.
    pub dpi: f64,
}

impl Options {
    /// The resolutions at which a PNG is drawn, in dots per inch.
    pub const DPI: std::ops::RangeInclusive<f64> = 36.0..=2400.0;

    /// A figure of this size at the resolution that suits it: 300 dpi for print, and for a slide 192, which makes
    /// it 1920 × 1080 dots.
    pub fn of(size: Size) -> Self {
        let dpi = match size {
            Size::Column | Size::Page => 300.0,
            Size::Slide => 192.0,
            Size::Screen { .. } => 72.0,
        };
        Self { size, dpi }
    }
}

impl Default for Options {
    /// A column at 300 dpi.
    fn default() -> Self {
        Self::of(Size::Column)
    }
}

/// Reason why a figure was not made.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    /// The file's name ends in something else than `.svg`, `.pdf` or `.png`.
    #[error("{path}: a figure is written as .svg, .pdf or .png; end the file's name with one of them")]
    Format {
        /// The path asked for.
        path: PathBuf,
    },
    /// The file could not be written.
    #[error(transparent)]
    File(#[from] WholeFileError),
    /// The resolution is outside of what can be drawn.
    #[error("a figure is drawn at 36 to 2400 dpi, not at {dpi}")]
    Resolution {
        /// The resolution asked for, in dots per inch.
        dpi: f64,
    },
    /// A raster's bytes do not fill its cells.
    #[error("a raster of {width} × {height} cells takes {expected} bytes, not {found}")]
    RasterLength {
        /// Cells in a row.
        width: u32,
        /// Rows.
        height: u32,
        /// Bytes that these make.
        expected: u64,
        /// Bytes given.
        found: usize,
    },
    /// A cell of a raster holds a class that has no name and colour.
    #[error("cell {cell} of a raster is of class {class}, but only classes 0 to {last} are named")]
    RasterClass {
        /// Index of the first such cell, row by row.
        cell: usize,
        /// Its class.
        class: u8,
        /// The last class that has a name.
        last: usize,
    },
    /// The drawing could not be turned into pixels: a mistake of this module.
    #[error("the figure could not be rendered: {reason}")]
    Render {
        /// Message of the renderer.
        reason: String,
    },
}

impl Figure {
    /// A figure without panels.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a panel below those that are there.
    pub fn panel(mut self, panel: Panel) -> Self {
        self.panels.push(panel);
        self
    }

    /// Sets the small grey text under the panels, wrapped where it is long: the run's parameters, say.
    pub fn caption(mut self, caption: impl Into<String>) -> Self {
        self.caption = caption.into();
        self
    }

    /// Gives all panels one x range, and numbers and label of the x axis to the last one only.
    pub fn shared_x(mut self) -> Self {
        self.shared_x = true;
        self
    }

    /// The figure as an SVG document; its unit is the point (1/72 inch).
    ///
    /// # Errors
    /// [`FigureError::Render`] where a raster cannot be encoded, which is a mistake of this module.
    pub fn to_svg(&self, size: Size) -> Result<String, FigureError> {
        svg::document(&draw::document(self, size, None))
    }

    /// The figure as a PDF file's bytes, of one page: curves stay curves, the font goes along.
    ///
    /// # Errors
    /// [`FigureError::Render`] where it cannot be written, which is a mistake of this module.
    pub fn to_pdf(&self, size: Size) -> Result<Vec<u8>, FigureError> {
        pdf::pdf(&draw::document(self, size, None))
    }

    /// The figure as a PNG file's bytes, with its physical size stated inside.
    ///
    /// # Errors
    /// [`FigureError::Resolution`] where `options.dpi` is not within 36 to 2400.
    pub fn to_png(&self, options: Options) -> Result<Vec<u8>, FigureError> {
        if !Options::DPI.contains(&options.dpi) {
            return Err(FigureError::Resolution { dpi: options.dpi });
        }
        picture::png(&draw::document(self, options.size, Some(options.dpi / 72.0)), options.dpi)
    }

    /// Writes the figure to `path`, as SVG, PDF or PNG by the end of the name. The file appears whole or not
    /// at all; one that is there is replaced if `force`.
    ///
    /// # Errors
    /// [`FigureError::Format`] where the name ends in none of them, before anything is drawn;
    /// [`FigureError::Resolution`] as in [`Figure::to_png`]; [`FigureError::File`] where the system
    /// refuses.
    pub fn write(&self, path: &Path, options: Options, force: bool) -> Result<(), FigureError> {
        let extension = path.extension().map(std::ffi::OsStr::to_ascii_lowercase);
        let bytes = match extension.as_ref().and_then(|end| end.to_str()) {
            Some("svg") => self.to_svg(options.size)?.into_bytes(),
            Some("pdf") => self.to_pdf(options.size)?,
            Some("png") => self.to_png(options)?,
            _ => return Err(FigureError::Format { path: path.into() }),
        };
        Ok(whole_file::write(path, &bytes, force)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure() -> Figure {
        let greys = [9, 200].map(|grey| ("", Colour::Rgb(grey, grey, grey)));
        let raster = Raster::classes(1, 2, vec![0, 1], &greys);
        Figure::new()
            .caption("</text> & \u{7}")
            .panel(Panel::new().line("<a>", [(0.0, 1.0), (2.0, 3.0)]))
            .panel(Panel::new().raster(raster.expect("two cells")))
    }

    #[test]
    fn a_figure_gives_the_same_bytes_each_time() {
        let svg = figure().to_svg(Size::Page).expect("draws");
        assert_eq!(svg, figure().to_svg(Size::Page).expect("draws"));
        let png = || figure().to_png(Options::default()).expect("draws");
        assert_eq!(png(), png());
        let pdf = || figure().to_pdf(Size::Page).expect("draws");
        assert_eq!(pdf(), pdf());
    }

    #[test]
    fn a_png_is_as_large_as_asked() {
        let (width, _, _) = picture::decode(&figure().to_png(Options::default()).expect("draws"));
        assert_eq!(width, 1016); // 86 mm at 300 dots per inch
        for dpi in [0.0, f64::NAN, 1e9] {
            let options = Options { dpi, ..Options::default() };
            assert!(matches!(figure().to_png(options), Err(FigureError::Resolution { .. })));
        }
    }

    #[test]
    fn files_appear_whole_under_their_name_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.SVG");
        std::fs::write(&path, "old").expect("writes");
        let refused = figure().write(&path, Options::default(), false);
        assert!(matches!(refused, Err(FigureError::File(_))), "{refused:?}");
        figure().write(&path, Options::default(), true).expect("replaces");
        let written = std::fs::read_to_string(&path).expect("reads");
        assert_eq!(written, figure().to_svg(Size::Column).expect("draws"));
        assert_eq!(std::fs::read_dir(folder.path()).expect("lists").count(), 1);
    }

    #[test]
    fn refusals_name_the_path_and_what_is_possible() {
        let error = figure().write(Path::new("run.eps"), Options::default(), false);
        let message = error.expect_err("not a format of ours").to_string();
        assert!(message.starts_with("run.eps: ") && message.contains(".svg, .pdf or .png"));
        let error = figure().write(Path::new("/nowhere/at/all.png"), Options::default(), false);
        let message = error.expect_err("no such folder").to_string();
        assert!(message.contains("/nowhere/at/all.png"));
    }

    #[test]
    fn a_figure_without_panels_or_values_is_still_one() {
        for figure in [Figure::new(), Figure::new().panel(Panel::new().line("", []))] {
            for size in [Size::Column, Size::Page, Size::Slide] {
                let options = Options { size, dpi: 50.0 };
                assert!(figure.to_png(options).is_ok() && figure.to_pdf(size).is_ok());
            }
        }
    }
}
