//! Draws a figure that is laid out.

use super::layout::{Layout, Placed};
use super::look::{LEADING, Look};
use super::panel::{Along, Curve, Panel, Reference};
use super::path::Step;
use super::raster::{Cells, Raster};
use super::sheet::{Anchor, Element, Pen, Rect, Sheet};
use super::style::{Colour, Ink, Mark};
use super::text::{CAP_HEIGHT, width};
use super::{Figure, Size, decimate, legend};

/// Bytes that all curves of a figure may take; with a raster of 0.4 MB a file stays below 1 MB.
const CURVE_BYTES: usize = 500_000;
/// Longest forms of a point of a line and of a marker.
const LINE_POINT_BYTES: usize = 15;
const MARK_BYTES: usize = 65;

/// Opacity of a band in the colour of its curve.
const BAND_OPACITY: f64 = 0.22;
/// Frame, ticks and numbers.
const INK: Colour = Colour::Rgb(0x26, 0x26, 0x26);
const CAPTION: Colour = Colour::Rgb(0x6e, 0x6e, 0x6e);

/// The figure on a sheet; with `dots_per_point`, fitted to the dots of a device.
pub(super) fn document(figure: &Figure, size: Size, dots_per_point: Option<f64>) -> Sheet {
    document_of(&Layout::new(figure, size, dots_per_point), dots_per_point)
}

/// The same of a figure that is laid out.
pub(super) fn document_of(layout: &Layout<'_>, dots_per_point: Option<f64>) -> Sheet {
    let curves: usize = layout.panels.iter().map(|placed| placed.panel.curves.len()).sum();
    let mut sheet = Sheet { width: layout.look.width, height: layout.height, ..Sheet::default() };
    for placed in &layout.panels {
        let mut drawing = Drawing {
            sheet: &mut sheet,
            look: &layout.look,
            placed,
            curve_bytes: CURVE_BYTES / curves.max(1),
        };
        drawing.panel(dots_per_point);
    }
    let size = layout.look.caption;
    for (index, line) in layout.caption.iter().enumerate() {
        let baseline = layout.caption_y + (index as f64 + 0.5) * LEADING * size;
        let place = (0.5 * layout.look.label, baseline + 0.5 * CAP_HEIGHT * size);
        sheet.text(place, Anchor::Start, (size, CAPTION), line);
    }
    sheet
}

/// Contents of other panels in the places of the panels of `layout`, one after the other.
pub(super) fn over(layout: &Layout<'_>, panels: &[Panel]) -> Sheet {
    let mut sheet = Sheet::default();
    for (placed, panel) in layout.panels.iter().zip(panels) {
        let mut drawing = Drawing { sheet: &mut sheet, look: &layout.look, placed, curve_bytes: CURVE_BYTES };
        drawing.contents(panel, None);
        legend::draw_title(&mut sheet, &panel.title, placed.frame, &layout.look);
    }
    sheet
}

struct Drawing<'a> {
    sheet: &'a mut Sheet,
    look: &'a Look,
    placed: &'a Placed<'a>,
    curve_bytes: usize,
}

impl Drawing<'_> {
    fn panel(&mut self, dots_per_point: Option<f64>) {
        let placed = self.placed;
        legend::draw(self.sheet, &placed.legend, placed.frame, self.look);
        legend::draw_title(self.sheet, &placed.panel.title, placed.frame, self.look);
        self.contents(placed.panel, dots_per_point);
        self.x_axis();
        self.y_axis();
        self.colour_bar(dots_per_point);
        let pen = Pen::solid(INK, self.look.frame);
        self.sheet.outline(placed.frame, pen);
    }

    /// Draws bands, raster, lines and curves of `panel` within the axes.
    fn contents(&mut self, panel: &Panel, dots_per_point: Option<f64>) {
        self.sheet.elements.push(Element::Clip(self.placed.frame));
        for band in panel.references.iter().filter(|item| !item.is_line()) {
            self.band(band);
        }
        if let Some(raster) = &panel.raster {
            self.raster(raster, dots_per_point);
        }
        for line in panel.references.iter().filter(|item| item.is_line()) {
            self.reference_line(line);
        }
        for (curve, ink) in panel.curves.iter().zip(panel.inks()) {
            for band in &curve.bands {
                self.curve_band(band, ink.colour);
            }
        }
        for (curve, ink) in panel.curves.iter().zip(panel.inks()) {
            self.curve(curve, ink);
        }
        self.sheet.elements.push(Element::EndClip);
    }

    fn x(&self, value: f64) -> Option<f64> {
        let frame = self.placed.frame;
        let fraction = self.placed.x.place(value)?;
        Some(frame.x + fraction * frame.width)
    }

    fn y(&self, value: f64) -> Option<f64> {
        let frame = self.placed.frame;
        let fraction = self.placed.y.place(value)?;
        Some(frame.bottom() - fraction * frame.height)
    }

    /// The rectangle between two values of each axis, with whether the first ones lie right or below.
    fn rect(&self, x: (f64, f64), y: (f64, f64)) -> Option<(Rect, (bool, bool))> {
        let (left, right) = (self.x(x.0)?, self.x(x.1)?);
        let (top, bottom) = (self.y(y.0)?, self.y(y.1)?);
        let rect = Rect {
            x: left.min(right),
            y: top.min(bottom),
            width: (right - left).abs(),
            height: (bottom - top).abs(),
        };
        Some((rect, (left > right, top > bottom)))
    }

    fn band(&mut self, band: &Reference) {
        let mut rect = self.placed.frame;
        let at = |value| match band.along {
            Along::X => self.x(value),
            Along::Y => self.y(value),
        };
        let (Some(from), Some(to)) = (at(band.from), at(band.to)) else {
            return;
        };
        let (start, length) = (from.min(to), (to - from).abs());
        match band.along {
            Along::X => (rect.x, rect.width) = (start, length),
            Along::Y => (rect.y, rect.height) = (start, length),
        }
        self.sheet.fill(rect, Colour::LightGrey, 1.0);
    }

    fn reference_line(&mut self, line: &Reference) {
        let frame = self.placed.frame;
        let ends = match line.along {
            Along::X => self.x(line.from).map(|x| ((x, frame.y), (x, frame.bottom()))),
            Along::Y => self.y(line.from).map(|y| ((frame.x, y), (frame.right(), y))),
        };
        let Some((from, to)) = ends else { return };
        let pen = self.look.reference_pen();
        if self.placed.panel.raster.is_some() {
            // On a raster of any colour the dashes need a ground.
            let ground = Pen::solid(Colour::White, pen.width);
            self.sheet.line(from, to, ground);
        }
        self.sheet.line(from, to, pen);
    }

    fn raster(&mut self, raster: &Raster, dots_per_point: Option<f64>) {
        let Some((rect, mirror)) = self.rect(raster.x, raster.y) else { return };
        if raster.is_empty() {
            return;
        }
        // A paper's worth of dots; `as` saturates.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let dots = dots_per_point.map(|dots| {
            let count = |length: f64| (length * dots).round() as u32;
            (count(rect.width), count(rect.height))
        });
        self.sheet.elements.push(Element::Image(rect, raster.cells(mirror, dots)));
    }

    fn colour_bar(&mut self, dots_per_point: Option<f64>) {
        let (look, placed) = (self.look, self.placed);
        let scale = placed.panel.raster.as_ref().and_then(|raster| raster.scale.as_ref());
        let (Some(scale), Some(bar)) = (scale, &placed.bar) else { return };
        let snap = |place: f64| dots_per_point.map_or(place, |dots| (place * dots).round() / dots);
        let left = snap(placed.frame.right() + look.bar_gap());
        let right = snap(left + look.bar_width());
        let rect = Rect { x: left, width: right - left, ..placed.frame };
        self.sheet.elements.push(Element::Image(rect, Cells::of_scale(scale)));
        let pen = Pen::solid(INK, look.frame);
        self.sheet.outline(rect, pen);
        for (fraction, label) in &bar.ticks.numbers {
            let y = rect.bottom() - fraction * rect.height;
            self.sheet.line((right, y), (right + look.tick_length(), y), pen);
            let number = (right + look.tick_length() + look.number_gap(), y + 0.5 * CAP_HEIGHT * look.number);
            self.sheet.text(number, Anchor::Start, (look.number, INK), label);
        }
        let numbers_end = placed.frame.right() + bar.numbers_end(look);
        for (index, line) in bar.label.iter().enumerate() {
            let baseline = numbers_end + (index as f64 + 1.0) * LEADING * look.label;
            let place = (baseline, rect.y + 0.5 * rect.height);
            self.sheet.text_upwards(place, (look.label, Colour::Black), line);
        }
    }

    fn curve(&mut self, curve: &Curve, ink: Ink) {
        let places = curve.points.iter().map(|&(x, y)| Some((self.x(x)?, self.y(y)?)));
        let places: Vec<Option<(f64, f64)>> = places.collect();
        if let Some(stroke) = ink.stroke {
            // on a raster of any colour a line needs a ground, which is drawn like it
            let has_ground = self.placed.panel.raster.is_some();
            let limit = self.curve_bytes / LINE_POINT_BYTES / (1 + usize::from(has_ground));
            let mut path = Vec::new();
            for piece in places.split(Option::is_none) {
                let piece: Vec<_> = piece.iter().copied().flatten().collect();
                // Each piece gets its part of the limit.
                let part = limit * piece.len() / places.len().max(1);
                path.extend(Step::line(&decimate::line(&piece, part)));
            }
            let pen = self.look.curve_pen(ink, stroke);
            if has_ground && !path.is_empty() {
                self.sheet.path(path.clone(), Pen::solid(Colour::White, pen.width + 0.8 * self.look.frame));
            }
            if !path.is_empty() {
                self.sheet.path(path, pen);
            }
        }
        if let Some(mark) = ink.mark {
            let marked: Vec<_> = places.into_iter().flatten().collect();
            let marked = decimate::marks(&marked, self.curve_bytes / MARK_BYTES);
            self.marks(mark, ink.colour, &marked);
        }
    }

    /// Fills the area of a band, piece by piece.
    fn curve_band(&mut self, band: &[(f64, f64, f64)], colour: Colour) {
        let places = band.iter().map(|&(x, low, high)| Some((self.x(x)?, self.y(low)?, self.y(high)?)));
        let places: Vec<Option<(f64, f64, f64)>> = places.collect();
        for piece in places.split(Option::is_none) {
            let upper = piece.iter().flatten().map(|&(x, _, high)| (x, high));
            let lower = piece.iter().rev().flatten().map(|&(x, low, _)| (x, low));
            let outline: Vec<_> = upper.chain(lower).collect();
            // of a single x there is no area, but an extent
            match outline.as_slice() {
                [] => {}
                [top, bottom] => {
                    self.sheet.line(*top, *bottom, Pen::solid(tint(colour), 2.0 * self.look.mark));
                }
                outline => {
                    let path = Step::line(outline).chain([Step::Close]).collect();
                    self.sheet.tinted(path, colour, BAND_OPACITY);
                }
            }
        }
    }

    fn marks(&mut self, mark: Mark, colour: Colour, places: &[(f64, f64)]) {
        let radius = self.look.mark;
        let frame = self.placed.frame;
        let visible = places.iter().filter(|(x, y)| {
            (frame.x - radius..=frame.right() + radius).contains(x)
                && (frame.y - radius..=frame.bottom() + radius).contains(y)
        });
        let path: Vec<_> = visible.flat_map(|place| mark.path(*place, radius)).collect();
        if !path.is_empty() {
            self.sheet.area(path, colour, 0.25 * radius);
        }
    }

    fn x_axis(&mut self) {
        let (look, placed) = (self.look, self.placed);
        let frame = placed.frame;
        let pen = Pen::solid(INK, look.frame);
        let bottom = frame.bottom();
        for fraction in sparse(&placed.x_ticks.minor, frame.width, look) {
            let x = frame.x + fraction * frame.width;
            self.sheet.line((x, bottom), (x, bottom + 0.55 * look.tick_length()), pen);
        }
        let below = bottom + look.tick_length() + look.number_gap() + CAP_HEIGHT * look.number;
        for (fraction, label) in &placed.x_ticks.major {
            let x = frame.x + fraction * frame.width;
            self.sheet.line((x, bottom), (x, bottom + look.tick_length()), pen);
            if placed.has_x_text {
                self.sheet.text((x, below), Anchor::Middle, (look.number, INK), label);
            }
        }
        if !placed.has_x_text {
            return;
        }
        for (index, line) in placed.x_label.iter().enumerate() {
            let baseline = below + (index as f64 + 1.0) * LEADING * look.label;
            let place = (frame.x + 0.5 * frame.width, baseline);
            self.sheet.text(place, Anchor::Middle, (look.label, Colour::Black), line);
        }
    }

    fn y_axis(&mut self) {
        let (look, placed) = (self.look, self.placed);
        let frame = placed.frame;
        let pen = Pen::solid(INK, look.frame);
        for fraction in sparse(&placed.y_ticks.minor, frame.height, look) {
            let y = frame.bottom() - fraction * frame.height;
            self.sheet.line((frame.x, y), (frame.x - 0.55 * look.tick_length(), y), pen);
        }
        let right = frame.x - look.tick_length() - look.number_gap();
        for (fraction, label) in &placed.y_ticks.major {
            let y = frame.bottom() - fraction * frame.height;
            self.sheet.line((frame.x, y), (frame.x - look.tick_length(), y), pen);
            let place = (right, y + 0.5 * CAP_HEIGHT * look.number);
            self.sheet.text(place, Anchor::End, (look.number, INK), label);
        }
        // A label that was wrapped for a somewhat higher panel is made smaller.
        let widths = placed.y_label.iter().map(|line| width(line, look.label));
        let widest = widths.fold(frame.height, f64::max);
        let size = look.label * frame.height / widest;
        for (above, line) in placed.y_label.iter().rev().enumerate() {
            let baseline = frame.x - placed.y_label_distance - above as f64 * LEADING * look.label;
            let place = (baseline, frame.y + 0.5 * frame.height);
            self.sheet.text_upwards(place, (size, Colour::Black), line);
        }
    }
}

/// Minor ticks, as long as they can be told apart.
fn sparse<'a>(minor: &'a [f64], length: f64, look: &Look) -> &'a [f64] {
    let dense = minor.len() as f64 * 0.4 * look.number > length;
    if dense { &[] } else { minor }
}

/// The colour of a band on white paper.
fn tint(colour: Colour) -> Colour {
    let part = |part: u8| 255.0 - BAND_OPACITY * (255.0 - f64::from(part));
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
    let [red, green, blue] = colour.rgb().map(|byte| part(byte).round() as u8);
    Colour::Rgb(red, green, blue)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Axis, Options, picture};

    const RED: Colour = Colour::Rgb(255, 0, 0);
    const GREEN: Colour = Colour::Rgb(0, 255, 0);

    /// A figure's pixels, with its first frame in dots.
    fn pixels(figure: &Figure, size: Size) -> (usize, Vec<[u8; 3]>, Rect) {
        let dpi = 144.0;
        let file = figure.to_png(Options { size, dpi }).expect("draws");
        let frame = Layout::new(figure, size, Some(2.0)).panels[0].frame;
        let frame =
            Rect { x: 2.0 * frame.x, y: 2.0 * frame.y, width: 2.0 * frame.width, height: 2.0 * frame.height };
        let (width, _, pixels) = picture::decode(&file);
        (width, pixels, frame)
    }

    /// The pixel at fractions of the frame, from its upper left corner.
    fn at(drawn: &(usize, Vec<[u8; 3]>, Rect), across: f64, down: f64) -> [u8; 3] {
        let (width, pixels, frame) = drawn;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let index = |place: f64| place as usize;
        let row = index(frame.y + down * frame.height);
        pixels[row * width + index(frame.x + across * frame.width)]
    }

    #[test]
    fn a_raster_lies_where_its_axes_say() {
        let raster =
            Raster::classes(2, 2, vec![0, 1, 2, 2], &[("red", RED), ("green", GREEN), ("sky", Colour::Sky)]);
        let raster = raster.expect("fits").over((0.0, 5.0), (0.0, 10.0));
        let panel = |y| Panel::new().x_axis(Axis::new("x").limits(0.0, 10.0)).y_axis(y);
        let up = Figure::new().panel(panel(Axis::new("y")).raster(raster.clone()));
        let drawn = pixels(&up, Size::Column);
        assert_eq!(at(&drawn, 0.23, 0.52), RED.rgb());
        assert_eq!(at(&drawn, 0.27, 0.98), GREEN.rgb());
        assert_eq!(at(&drawn, 0.48, 0.48), Colour::Sky.rgb());
        assert_eq!(at(&drawn, 0.52, 0.48), Colour::White.rgb());
        let down = Figure::new().panel(panel(Axis::new("y").reversed()).raster(raster));
        let drawn = pixels(&down, Size::Column);
        assert_eq!(at(&drawn, 0.23, 0.48), RED.rgb());
        assert_eq!(at(&drawn, 0.27, 0.02), GREEN.rgb());
        assert_eq!(at(&drawn, 0.02, 0.52), Colour::Sky.rgb());
    }

    #[test]
    fn one_peak_in_55_000_points_is_drawn() {
        let value = |index: u32| if index == 27_500 { 1.0 } else { 0.0 };
        let points = (0..55_000).map(|index| (f64::from(index), value(index)));
        let axes =
            Panel::new().x_axis(Axis::new("").limits(0.0, 55_000.0)).y_axis(Axis::new("").limits(-1.0, 1.0));
        let curve = Curve::line("", points).colour(RED);
        let drawn = pixels(&Figure::new().panel(axes.curve(curve)), Size::Page);
        let [red, green, _] = at(&drawn, 0.5, 0.1);
        assert!(red > 200 && green < 150);
        assert_eq!(at(&drawn, 0.51, 0.1), Colour::White.rgb());
    }

    #[test]
    fn nothing_is_cut_off_at_the_edges() {
        let long = "a label <that> is & much too long for its axis, in some unit (µm·s⁻¹) ".repeat(2);
        let panel = |scale: f64| {
            Panel::new()
                .x_axis(long.as_str())
                .y_axis(long.as_str())
                .line(long.as_str(), [(0.0, -scale), (1e6, scale)])
                .points("p", [(f64::NAN, 0.0), (3.0, f64::INFINITY), (5.0, scale)])
                .vertical("at", 1e6)
                .note("a note")
        };
        let figure = Figure::new()
            .caption(long.repeat(3) + &"x".repeat(500))
            .panel(panel(1e-7))
            .panel(Panel::new())
            .panel(panel(123_456.0));
        for size in [Size::Column, Size::Page, Size::Slide] {
            let (width, pixels, _) = pixels(&figure, size);
            let is_white = |pixel: &[u8; 3]| pixel.iter().all(|part| *part == 255);
            let rows = || pixels.chunks_exact(width);
            assert!(rows().all(|row| is_white(&row[0]) && is_white(&row[width - 1])));
            let edges = [rows().next(), rows().next_back()];
            assert!(edges.into_iter().flatten().flatten().all(is_white));
        }
    }

    /// A line over a raster is seen on dark and on light cells: it lies on a white one.
    #[test]
    fn a_line_over_a_raster_has_a_ground() {
        let raster = Raster::classes(1, 1, vec![0], &[("dark", Colour::Black)]).expect("fits");
        let panel = Panel::new().raster(raster).curve(Curve::line("", [(0.0, 0.0), (1.0, 1.0)]).thin());
        let svg = Figure::new().panel(panel).to_svg(Size::Column).expect("draws");
        let lines: Vec<&str> = svg.lines().filter(|line| line.starts_with("<path")).collect();
        assert_eq!(lines.len(), 2);
        assert!(lines[0].contains("stroke=\"#ffffff\"") && !lines[1].contains("#ffffff"), "{lines:?}");
        let outline = |line: &str| line.split('"').nth(1).map(str::to_owned);
        assert_eq!(outline(lines[0]), outline(lines[1]));
    }

    #[test]
    fn a_band_lies_between_its_bounds_behind_the_curves() {
        let axes =
            Panel::new().x_axis(Axis::new("").limits(0.0, 10.0)).y_axis(Axis::new("").limits(0.0, 10.0));
        let band =
            [(0.0, 2.0, 4.0), (5.0, 2.0, 4.0), (6.0, f64::NAN, 4.0), (7.0, 6.0, 8.0), (10.0, 6.0, 8.0)];
        let curve = Curve::line("", [(0.0, 3.0), (10.0, 3.0)]).colour(RED).band(band);
        let drawn = pixels(&Figure::new().panel(axes.curve(curve)), Size::Page);
        assert_eq!(at(&drawn, 0.25, 0.7), RED.rgb());
        let [red, green, _] = at(&drawn, 0.25, 0.65);
        assert!(red == 255 && (190..210).contains(&green));
        for (across, down) in [(0.25, 0.55), (0.25, 0.85), (0.6, 0.65), (0.8, 0.65)] {
            assert_eq!(at(&drawn, across, down), Colour::White.rgb());
        }
        assert_ne!(at(&drawn, 0.8, 0.3), Colour::White.rgb());
    }

    #[test]
    fn values_that_are_not_finite_break_a_line() {
        let points = [(0.0, 0.0), (1.0, 1.0), (2.0, f64::NAN), (3.0, 1.0), (4.0, 0.0)];
        let figure = Figure::new().panel(Panel::new().line("", points));
        let svg = figure.to_svg(Size::Column).expect("draws");
        let path = svg.lines().find(|line| line.starts_with("<path")).expect("a line");
        assert_eq!(path.matches('M').count(), 2);
    }

    #[test]
    fn a_large_figure_stays_below_a_megabyte() {
        let noise = |index: u32| f64::from(index.wrapping_mul(2_654_435_761) >> 12);
        let points = || (0..55_000).map(move |index| (noise(index), noise(index + 77)));
        let mut panel = Panel::new();
        for _ in 0..5 {
            panel = panel.curve(Curve::line("", points()).mark(Mark::Triangle));
        }
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let cells = (0..1_000_000).map(|index| noise(index) as u8 % 3).collect();
        let classes = [("a", Colour::Blue), ("b", RED), ("c", GREEN)];
        let raster = Raster::classes(1000, 1000, cells, &classes).expect("fits");
        let figure = Figure::new().panel(panel).panel(Panel::new().raster(raster));
        let bytes = figure.to_svg(Size::Page).expect("draws").len();
        assert!(bytes < 1_000_000, "{bytes}");
    }
}
