//! Contents of a panel, as its caller describes them: axes, curves, reference lines, a raster, a note.

use super::axis::Axis;
use super::raster::Raster;
use super::scale::Margin;
use super::style::{Colour, Ink, Mark, Stroke};

/// Points (x, y) drawn as a line, as markers, or both. An empty label keeps it out of the legend.
///
/// Where x or y is not finite a line is broken. Long lines are thinned for drawing, keeping the extremes
/// of every dot, so that no peak disappears.
#[derive(Debug, Clone)]
#[must_use]
pub struct Curve {
    pub(super) label: String,
    pub(super) points: Vec<(f64, f64)>,
    /// Points of each band: the x, the lower y, the upper y.
    pub(super) bands: Vec<Vec<(f64, f64, f64)>>,
    pub(super) colour: Option<Colour>,
    pub(super) stroke: Option<Stroke>,
    pub(super) line: bool,
    pub(super) mark: Option<Mark>,
    pub(super) thin: bool,
}

impl Curve {
    /// A line through points (x, y), in the order given.
    pub fn line(label: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self {
            label: label.into(),
            points: points.into_iter().collect(),
            bands: Vec::new(),
            colour: None,
            stroke: None,
            line: true,
            mark: None,
            thin: false,
        }
    }

    /// Markers at points (x, y), without a line.
    pub fn points(label: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        Self { line: false, mark: Some(Mark::Circle), ..Self::line(label, points) }
    }

    /// Sets the colour; otherwise curves take those of the palette in turn.
    pub fn colour(mut self, colour: Colour) -> Self {
        self.colour = Some(colour);
        self
    }

    /// Adds a band (x, lower y, upper y) in a light shade of the curve's colour, behind all curves. Where a value is not
    /// finite the band is broken.
    pub fn band(mut self, band: impl IntoIterator<Item = (f64, f64, f64)>) -> Self {
        self.bands.push(band.into_iter().collect());
        self
    }

    /// Draws a line, in this way.
    pub fn stroke(mut self, stroke: Stroke) -> Self {
        self.line = true;
        self.stroke = Some(stroke);
        self
    }

    /// Draws the line half as wide: for many lines side by side.
    pub fn thin(mut self) -> Self {
        self.thin = true;
        self
    }

    /// Marks each point with this shape.
    pub fn mark(mut self, mark: Mark) -> Self {
        self.mark = Some(mark);
        self
    }
}

/// Axis that a reference lies on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Along {
    X,
    Y,
}

/// A line (where `from == to`) or a band at values of one axis.
#[derive(Debug, Clone)]
pub(super) struct Reference {
    pub(super) label: String,
    pub(super) along: Along,
    pub(super) from: f64,
    pub(super) to: f64,
}

impl Reference {
    pub(super) fn is_line(&self) -> bool {
        self.from == self.to
    }
}

/// One pair of axes and its contents: first bands, then the raster, reference lines, curves.
///
/// The legend stands in rows above the axes, with the note at its end, where they can hide nothing.
#[derive(Debug, Clone)]
#[must_use]
pub struct Panel {
    pub(super) x: Axis,
    pub(super) y: Axis,
    pub(super) curves: Vec<Curve>,
    pub(super) references: Vec<Reference>,
    pub(super) raster: Option<Raster>,
    pub(super) note: String,
    pub(super) title: String,
    pub(super) height: f64,
}

impl Default for Panel {
    fn default() -> Self {
        Self::new()
    }
}

impl Panel {
    /// An empty panel.
    pub fn new() -> Self {
        Self {
            x: Axis::default(),
            y: Axis::default(),
            curves: Vec::new(),
            references: Vec::new(),
            raster: None,
            note: String::new(),
            title: String::new(),
            height: 1.0,
        }
    }

    /// Sets the x axis, or its label alone.
    pub fn x_axis(mut self, axis: impl Into<Axis>) -> Self {
        self.x = axis.into();
        self
    }

    /// Sets the y axis, or its label alone.
    pub fn y_axis(mut self, axis: impl Into<Axis>) -> Self {
        self.y = axis.into();
        self
    }

    /// Adds a line in the next colour; see [`Curve::line`].
    pub fn line(self, label: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        self.curve(Curve::line(label, points))
    }

    /// Adds markers in the next colour; see [`Curve::points`].
    pub fn points(self, label: impl Into<String>, points: impl IntoIterator<Item = (f64, f64)>) -> Self {
        self.curve(Curve::points(label, points))
    }

    /// Adds a curve.
    pub fn curve(mut self, curve: Curve) -> Self {
        self.curves.push(curve);
        self
    }

    /// Adds a thin dashed line at one x. References do not widen the range of the axes.
    pub fn vertical(self, label: impl Into<String>, x: f64) -> Self {
        self.reference(label, Along::X, x, x)
    }

    /// Adds a thin dashed line at one y.
    pub fn horizontal(self, label: impl Into<String>, y: f64) -> Self {
        self.reference(label, Along::Y, y, y)
    }

    /// Adds a grey band over a range of x, behind everything else.
    pub fn band_x(self, label: impl Into<String>, from: f64, to: f64) -> Self {
        self.reference(label, Along::X, from, to)
    }

    /// Adds a grey band over a range of y, behind everything else.
    pub fn band_y(self, label: impl Into<String>, from: f64, to: f64) -> Self {
        self.reference(label, Along::Y, from, to)
    }

    fn reference(mut self, label: impl Into<String>, along: Along, from: f64, to: f64) -> Self {
        self.references.push(Reference { label: label.into(), along, from, to });
        self
    }

    /// Sets the raster; it belongs on linear axes, over which its cells are spread evenly.
    pub fn raster(mut self, raster: Raster) -> Self {
        self.raster = Some(raster);
        self
    }

    /// Sets a short text at the end of the legend.
    pub fn note(mut self, text: impl Into<String>) -> Self {
        self.note = text.into();
        self
    }

    /// Sets a text above the right end of the axes; a space keeps the row free for it.
    pub fn title(mut self, text: impl Into<String>) -> Self {
        self.title = text.into();
        self
    }

    /// Makes the panel this many times as high as usual (0.2 to 5).
    pub fn height(mut self, factor: f64) -> Self {
        let usable = if factor.is_finite() { factor } else { 1.0 };
        self.height = usable.clamp(0.2, 5.0);
        self
    }

    /// Ink of each curve: colours in turn, other strokes once they are used up.
    pub(super) fn inks(&self) -> impl Iterator<Item = Ink> {
        let colours = Colour::CYCLE.len();
        let mut turn = 0;
        self.curves.iter().map(move |curve| {
            let colour = curve.colour.unwrap_or(Colour::CYCLE[turn % colours]);
            let stroke = Stroke::CYCLE[turn / colours % Stroke::CYCLE.len()];
            turn += usize::from(curve.colour.is_none());
            Ink {
                colour,
                stroke: curve.line.then(|| curve.stroke.unwrap_or(stroke)),
                mark: curve.mark,
                thin: curve.thin,
            }
        })
    }

    pub(super) fn x_values(&self) -> impl Iterator<Item = f64> {
        let raster = self.raster.iter().flat_map(|raster| [raster.x.0, raster.x.1]);
        let points = self.curves.iter().flat_map(|curve| &curve.points);
        let bands = self.curves.iter().flat_map(|curve| curve.bands.iter().flatten());
        raster.chain(points.map(|point| point.0)).chain(bands.map(|band| band.0))
    }

    pub(super) fn y_values(&self) -> impl Iterator<Item = f64> {
        let raster = self.raster.iter().flat_map(|raster| [raster.y.0, raster.y.1]);
        let points = self.curves.iter().flat_map(|curve| &curve.points);
        let bands = self.curves.iter().flat_map(|curve| curve.bands.iter().flatten());
        raster.chain(points.map(|point| point.1)).chain(bands.flat_map(|band| [band.1, band.2]))
    }

    pub(super) fn x_room(&self) -> Margin {
        let marked = self.curves.iter().any(|curve| curve.mark.is_some());
        match (&self.raster, marked) {
            (Some(_), _) => Margin::Nothing,
            (None, true) => Margin::Part(0.04),
            (None, false) => Margin::ToRound,
        }
    }

    pub(super) fn y_room(&self) -> Margin {
        match self.raster {
            Some(_) => Margin::Nothing,
            None => Margin::Part(0.06),
        }
    }
}
