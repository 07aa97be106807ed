//! PNG files: images for embedding, and whole sheets.

use png::{BitDepth, ColorType, Compression, Encoder, PixelDimensions, Unit};
use skrifa::instance::{LocationRef, Size};
use skrifa::outline::{DrawSettings, OutlinePen};
use skrifa::{FontRef, GlyphId, MetadataProvider};
use tiny_skia::{
    Color, FillRule, FilterQuality, LineCap, LineJoin, Mask, Paint, PathBuilder, Pixmap, PixmapPaint, Stroke,
    StrokeDash, Transform,
};

use super::raster::Cells;
use super::sheet::{Element, Outline, Pen, Rect, Shape, Sheet, Text};
use super::style::{self, Colour};
use super::{FigureError, text};

pub(super) fn failed(reason: impl std::fmt::Display) -> FigureError {
    FigureError::Render { reason: reason.to_string() }
}

/// Renders a sheet.
pub(super) fn png(sheet: &Sheet, dpi: f64) -> Result<Vec<u8>, FigureError> {
    let dots = |length: f64| (length * dpi / 72.0).round().max(1.0);
    // a sheet of paper at 2400 dpi at most
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "`as` saturates")]
    let (width, height) = (dots(sheet.width) as u32, dots(sheet.height) as u32);
    let mut pixels = paper(width, height)?;
    #[expect(clippy::cast_possible_truncation, reason = "f32 holds it well enough")]
    draw(sheet, &mut pixels, Transform::from_scale((dpi / 72.0) as f32, (dpi / 72.0) as f32))?;
    let colours = pixels.pixels().iter();
    let rgb: Vec<u8> = colours.flat_map(|pixel| [pixel.red(), pixel.green(), pixel.blue()]).collect();
    encode_below(LARGEST_FILE, (width, height), &rgb, dpi)
}

/// White dots.
pub(super) fn paper(width: u32, height: u32) -> Result<Pixmap, FigureError> {
    let mut pixels = Pixmap::new(width, height).ok_or_else(no_room)?;
    pixels.fill(Color::WHITE);
    Ok(pixels)
}

fn no_room() -> FigureError {
    failed("no room for the pixels")
}

/// Draws a sheet over the dots that are there.
pub(super) fn draw(sheet: &Sheet, pixels: &mut Pixmap, to_dots: Transform) -> Result<(), FigureError> {
    let (width, height) = (pixels.width(), pixels.height());
    let font = FontRef::new(text::FONT).map_err(failed)?;
    let mut canvas = Canvas { pixels, to_dots, clip: None, font };
    for element in &sheet.elements {
        match element {
            Element::Shape(shape) => canvas.shape(shape),
            Element::Text(text) => canvas.text(text),
            Element::Image(rect, cells) => canvas.image(*rect, cells),
            Element::Clip(rect) => {
                let mut mask = Mask::new(width, height).ok_or_else(no_room)?;
                if let Some(path) = Outline::Rect(*rect).path() {
                    mask.fill_path(&path, FillRule::Winding, true, to_dots);
                }
                canvas.clip = Some(mask);
            }
            Element::EndClip => canvas.clip = None,
        }
    }
    Ok(())
}

/// The dots of a sheet in the making.
struct Canvas<'a> {
    pixels: &'a mut Pixmap,
    to_dots: Transform,
    clip: Option<Mask>,
    font: FontRef<'static>,
}

impl Canvas<'_> {
    fn shape(&mut self, shape: &Shape) {
        let Some(path) = shape.outline.path() else { return };
        if let Some((colour, opacity)) = shape.fill {
            let paint = paint(colour, opacity);
            self.pixels.fill_path(&path, &paint, FillRule::Winding, self.to_dots, self.clip.as_ref());
        }
        if let Some(pen) = shape.pen {
            let stroke = stroke(&pen, shape.is_round());
            self.pixels.stroke_path(
                &path,
                &paint(pen.colour, 1.0),
                &stroke,
                self.to_dots,
                self.clip.as_ref(),
            );
        }
    }

    fn text(&mut self, text: &Text) {
        let outlines = self.font.outline_glyphs();
        let mut path = Outlines { path: PathBuilder::new(), matrix: Transform::identity() };
        for (glyph, [sx, ky, kx, sy, tx, ty]) in text.glyphs() {
            let em = 1.0 / text::UNITS_PER_EM;
            path.matrix = Transform::from_row(sx * em, ky * em, kx * em, sy * em, tx, ty);
            if let Some(outline) = outlines.get(GlyphId::from(glyph.id)) {
                // an outline that cannot be drawn is that of a mistake in the font, which is a constant of this program
                let _ =
                    outline.draw(DrawSettings::unhinted(Size::unscaled(), LocationRef::default()), &mut path);
            }
        }
        if let Some(path) = path.path.finish() {
            let paint = paint(text.colour, 1.0);
            self.pixels.fill_path(&path, &paint, FillRule::Winding, self.to_dots, self.clip.as_ref());
        }
    }

    fn image(&mut self, rect: Rect, cells: &Cells) {
        let Some(mut image) = Pixmap::new(cells.width, cells.height) else { return };
        for (pixel, [red, green, blue]) in image.pixels_mut().iter_mut().zip(cells.rgb()) {
            *pixel = tiny_skia::ColorU8::from_rgba(red, green, blue, 255).premultiply();
        }
        let scale = [rect.width / f64::from(cells.width), rect.height / f64::from(cells.height)];
        #[expect(clippy::cast_possible_truncation, reason = "a place on paper")]
        let [sx, sy, x, y] = [scale[0], scale[1], rect.x, rect.y].map(|length| length as f32);
        let place = self.to_dots.pre_concat(Transform::from_row(sx, 0.0, 0.0, sy, x, y));
        let sharp = PixmapPaint { quality: FilterQuality::Nearest, ..PixmapPaint::default() };
        self.pixels.draw_pixmap(0, 0, image.as_ref(), &sharp, place, self.clip.as_ref());
    }
}

fn paint(colour: Colour, opacity: f64) -> Paint<'static> {
    let [red, green, blue] = colour.rgb();
    let mut paint = Paint::default();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 255")]
    paint.set_color_rgba8(red, green, blue, (255.0 * opacity).round() as u8);
    paint
}

#[expect(clippy::cast_possible_truncation, reason = "a length on paper")]
fn stroke(pen: &Pen, is_round: bool) -> Stroke {
    let is_dashed = pen.stroke == style::Stroke::Dashed;
    let dashes = pen.dashes().map(|dashes| dashes.map(|length| length as f32).to_vec());
    Stroke {
        width: pen.width as f32,
        line_cap: if is_round && !is_dashed { LineCap::Round } else { LineCap::Butt },
        line_join: if is_round { LineJoin::Round } else { LineJoin::Miter },
        dash: dashes.and_then(|dashes| StrokeDash::new(dashes, 0.0)),
        ..Stroke::default()
    }
}

/// Outlines of glyphs on their way to the sheet.
struct Outlines {
    path: PathBuilder,
    matrix: Transform,
}

impl Outlines {
    fn place(&self, x: f32, y: f32) -> (f32, f32) {
        let Transform { sx, ky, kx, sy, tx, ty } = self.matrix;
        (sx * x + kx * y + tx, ky * x + sy * y + ty)
    }
}

impl OutlinePen for Outlines {
    fn move_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.place(x, y);
        self.path.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.place(x, y);
        self.path.line_to(x, y);
    }

    fn quad_to(&mut self, by_x: f32, by_y: f32, x: f32, y: f32) {
        let (by, to) = (self.place(by_x, by_y), self.place(x, y));
        self.path.quad_to(by.0, by.1, to.0, to.1);
    }

    fn curve_to(&mut self, ax: f32, ay: f32, bx: f32, by: f32, x: f32, y: f32) {
        let (a, b, to) = (self.place(ax, ay), self.place(bx, by), self.place(x, y));
        self.path.cubic_to(a.0, a.1, b.0, b.1, to.0, to.1);
    }

    fn close(&mut self) {
        self.path.close();
    }
}

/// Largest file (bytes) of a figure, if fewer colours are enough for that.
const LARGEST_FILE: usize = 1_000_000;

/// The picture in all of its colours or, where that takes more than `limit` bytes, in as many as fit: 32 or 16
/// shades of red, green and blue are as good to the eye in a picture so full of detail. If even these do not fit,
/// which takes a high resolution, all colours stay.
fn encode_below(
    limit: usize,
    (width, height): (u32, u32),
    rgb: &[u8],
    dpi: f64,
) -> Result<Vec<u8>, FigureError> {
    let whole = encode_rgb(width, height, rgb, Some(dpi))?;
    if whole.len() <= limit {
        return Ok(whole);
    }
    for steps in [31, 15] {
        let coarse: Vec<u8> = rgb.iter().map(|part| coarsened(*part, steps)).collect();
        let file = encode_rgb(width, height, &coarse, Some(dpi))?;
        if file.len() <= limit {
            return Ok(file);
        }
    }
    Ok(whole)
}

/// The nearest of `steps + 1` evenly spread shades, white and black among them.
fn coarsened(part: u8, steps: u16) -> u8 {
    let step = (u16::from(part) * steps + 127) / 255;
    u8::try_from((step * 255 + steps / 2) / steps).unwrap_or(u8::MAX)
}

/// The cells as a PNG of one pixel a cell.
pub(super) fn png_of(cells: &Cells) -> Result<Vec<u8>, FigureError> {
    let Cells { width, height, palette, bytes } = cells;
    match palette {
        None => encode_rgb(*width, *height, bytes, None),
        Some(palette) => {
            let bits = bits_of(palette);
            let depth =
                [BitDepth::One, BitDepth::Two, BitDepth::Four, BitDepth::Eight][bits.ilog2() as usize];
            let rows = packed(bytes, *width, bits);
            encode((*width, *height), (ColorType::Indexed, depth), &rows, |encoder| {
                encoder.set_palette(palette.clone());
            })
        }
    }
}

/// The fewest bits that an index into `palette` (3 bytes a colour) takes.
pub(super) fn bits_of(palette: &[u8]) -> usize {
    match palette.len() / 3 {
        0..=2 => 1,
        3..=4 => 2,
        5..=16 => 4,
        _ => 8,
    }
}

/// Rows of indices of so many bits each; a row begins a byte.
pub(super) fn packed(indices: &[u8], width: u32, bits: usize) -> Vec<u8> {
    let rows = indices.chunks(width.max(1) as usize);
    rows.flat_map(|row| row.chunks(8 / bits).map(|cells| pack(cells, bits))).collect()
}

/// A PNG of `rgb`, of shape (`height`, `width`, 3); with `dpi` it states its physical size.
fn encode_rgb(width: u32, height: u32, rgb: &[u8], dpi: Option<f64>) -> Result<Vec<u8>, FigureError> {
    encode((width, height), (ColorType::Rgb, BitDepth::Eight), rgb, |encoder| {
        if let Some(dpi) = dpi {
            // At most 94,488.
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
            let per_metre = (dpi / 0.0254).round() as u32;
            encoder.set_pixel_dims(Some(PixelDimensions {
                xppu: per_metre,
                yppu: per_metre,
                unit: Unit::Meter,
            }));
        }
    })
}

/// A PNG of bytes as they are, with what `particulars` says of it.
fn encode(
    (width, height): (u32, u32),
    (color, depth): (ColorType, BitDepth),
    bytes: &[u8],
    particulars: impl FnOnce(&mut Encoder<'_, &mut Vec<u8>>),
) -> Result<Vec<u8>, FigureError> {
    let mut file = Vec::new();
    let mut encoder = Encoder::new(&mut file, width, height);
    encoder.set_color(color);
    encoder.set_depth(depth);
    encoder.set_compression(Compression::High);
    particulars(&mut encoder);
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.write_image_data(bytes).map_err(failed)?;
    writer.finish().map_err(failed)?;
    Ok(file)
}

/// Up to a byte's worth of cells, the first in the highest bits.
fn pack(cells: &[u8], bits: usize) -> u8 {
    let place = |(index, cell): (usize, &u8)| cell << (8 - bits * (index + 1));
    cells.iter().enumerate().map(place).fold(0, |byte, cell| byte | cell)
}

/// Width, height and RGB of a PNG.
#[cfg(test)]
pub(super) fn decode(file: &[u8]) -> (usize, usize, Vec<[u8; 3]>) {
    let mut decoder = png::Decoder::new(std::io::Cursor::new(file));
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().expect("a header");
    let mut rgb = vec![0; reader.output_buffer_size().expect("a size")];
    let info = reader.next_frame(&mut rgb).expect("a frame");
    let pixels = rgb.chunks_exact(3).map(|p| [p[0], p[1], p[2]]);
    (info.width as usize, info.height as usize, pixels.collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_full_of_detail_gets_fewer_colours() {
        // the high bits of a linear congruential sequence
        let mut state = 1_u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            state.to_be_bytes()[0]
        };
        let rgb: Vec<u8> = (0..30_000).map(|_| noise()).collect();
        let drawn = |limit| {
            let file = encode_below(limit, (100, 100), &rgb, 72.0).expect("encodes");
            let (_, _, pixels) = decode(&file);
            (pixels.into_iter().flatten().collect::<std::collections::BTreeSet<_>>().len(), file.len())
        };
        let (all, whole_bytes) = drawn(usize::MAX);
        let (fewer, fewer_bytes) = drawn(whole_bytes - 1);
        let (fewest, _) = drawn(fewer_bytes - 1);
        assert_eq!([all, fewer, fewest, drawn(10).0], [256, 32, 16, 256]);
        assert_eq!([0, 255].map(|part| coarsened(part, 31)), [0, 255]);
    }

    #[test]
    fn packed_cells_come_back() {
        let palette = vec![0, 0, 0, 50, 50, 50, 100, 100, 100];
        let cells = [0, 1, 2, 2, 1, 2, 0, 1, 1, 0];
        let image = Cells { width: 5, height: 2, palette: Some(palette), bytes: cells.to_vec() };
        let file = png_of(&image).expect("encodes");
        let (width, height, rgb) = decode(&file);
        assert_eq!((width, height), (5, 2));
        let reds: Vec<u8> = rgb.iter().map(|pixel| pixel[0] / 50).collect();
        assert_eq!(reds, cells);
    }
}
