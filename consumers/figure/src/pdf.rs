//! PDF files: curves stay curves, text is text in the bundled font, of which only the glyphs that are used go along,
//! and rasters are the PNGs of the drawing, as they are.
//!
//! `usvg` reads the document as it does for PNG, so that both show the same. `svg2pdf` and `krilla-svg` would each bring
//! another version of it along.

mod font;

use std::collections::BTreeMap;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use pdf_writer::types::{LineCapStyle, LineJoinStyle, Predictor};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref, Str, TextStr};
use resvg::tiny_skia::{self, PathSegment};
use resvg::usvg::{self, Group, ImageKind, Node, Paint, Transform};
use std::io::Write as _;

use super::picture::failed;
use super::{FigureError, picture};
use font::Used;

/// The document as a PDF of one page.
pub(super) fn pdf(document: &str) -> Result<Vec<u8>, FigureError> {
    // a point of the document is one of the page
    let tree = picture::tree(document, 72.0)?;
    let (width, height) = (tree.size().width(), tree.size().height());
    let mut page =
        Page { content: Content::new(), images: Vec::new(), opacities: BTreeMap::new(), used: Used::new() };
    // y runs downwards in the document, upwards on the page
    page.content.transform([1.0, 0.0, 0.0, -1.0, 0.0, height]);
    page.group(tree.root())?;

    let [catalog, pages, sheet, content, info, font] = [1, 2, 3, 4, 5, 6].map(Ref::new);
    let mut free = Ref::new(6 + font::OBJECTS);
    let mut pdf = Pdf::new();
    pdf.catalog(catalog).pages(pages);
    pdf.pages(pages).kids([sheet]).count(1);
    pdf.document_info(info).producer(TextStr("Beadline"));
    let mut writer = pdf.page(sheet);
    writer.parent(pages).media_box(Rect::new(0.0, 0.0, width, height)).contents(content);
    let mut resources = writer.resources();
    resources.fonts().pair(FONT, font);
    let images: Vec<Ref> = page.images.iter().map(|_| free.bump()).collect();
    let mut objects = resources.x_objects();
    for (index, id) in images.iter().enumerate() {
        objects.pair(Name(image_name(index).as_bytes()), *id);
    }
    objects.finish();
    let mut states = resources.ext_g_states();
    for (percent, name) in &page.opacities {
        let mut state =
            states.insert(Name(name.as_bytes())).start::<pdf_writer::writers::ExtGraphicsState<'_>>();
        state.non_stroking_alpha(f32::from(*percent) / 100.0);
    }
    states.finish();
    resources.finish();
    writer.finish();
    pdf.stream(content, &deflated(&page.content.finish())?).filter(Filter::FlateDecode);
    for (image, id) in page.images.iter().zip(images) {
        image.write(&mut pdf, id);
    }
    font::write(&mut pdf, font, &page.used)?;
    Ok(pdf.finish())
}

const FONT: Name<'static> = Name(b"F");

fn image_name(index: usize) -> String {
    format!("I{index}")
}

fn deflated(bytes: &[u8]) -> Result<Vec<u8>, FigureError> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes).map_err(failed)?;
    encoder.finish().map_err(failed)
}

/// A page in the making.
struct Page {
    content: Content,
    images: Vec<Image>,
    /// Opacities of areas in per cent, and what they are called.
    opacities: BTreeMap<u8, String>,
    used: Used,
}

impl Page {
    fn group(&mut self, group: &Group) -> Result<(), FigureError> {
        let clip = group.clip_path();
        if let Some(clip) = clip {
            self.content.save_state();
            let place = group.abs_transform().pre_concat(clip.transform());
            for node in clip.root().children() {
                if let Node::Path(path) = node {
                    self.outline(path.data(), place.pre_concat(path.abs_transform()));
                }
            }
            self.content.clip_nonzero().end_path();
        }
        for node in group.children() {
            match node {
                Node::Group(inner) => self.group(inner)?,
                Node::Path(path) if path.is_visible() => self.path(path),
                Node::Image(image) if image.is_visible() => self.image(image)?,
                Node::Text(text) => self.text(text),
                Node::Path(_) | Node::Image(_) => {}
            }
        }
        if clip.is_some() {
            self.content.restore_state();
        }
        Ok(())
    }

    /// The outline of a path; curves of second order become ones of third order.
    fn outline(&mut self, path: &tiny_skia::Path, transform: Transform) {
        let Some(path) = path.clone().transform(transform) else { return };
        let content = &mut self.content;
        let mut last = tiny_skia::Point::zero();
        for segment in path.segments() {
            match segment {
                PathSegment::MoveTo(to) => content.move_to(to.x, to.y),
                PathSegment::LineTo(to) => content.line_to(to.x, to.y),
                PathSegment::QuadTo(by, to) => {
                    let near = |end: tiny_skia::Point| {
                        (end.x + 2.0 * (by.x - end.x) / 3.0, end.y + 2.0 * (by.y - end.y) / 3.0)
                    };
                    let ((x1, y1), (x2, y2)) = (near(last), near(to));
                    content.cubic_to(x1, y1, x2, y2, to.x, to.y)
                }
                PathSegment::CubicTo(a, b, to) => content.cubic_to(a.x, a.y, b.x, b.y, to.x, to.y),
                PathSegment::Close => content.close_path(),
            };
            if let PathSegment::MoveTo(to)
            | PathSegment::LineTo(to)
            | PathSegment::QuadTo(_, to)
            | PathSegment::CubicTo(_, _, to) = segment
            {
                last = to;
            }
        }
    }

    /// Figures have no transform that would change the width of a line.
    fn path(&mut self, path: &usvg::Path) {
        self.content.save_state();
        if let Some(fill) = path.fill() {
            self.fill(fill);
        }
        if let Some(stroke) = path.stroke() {
            let [red, green, blue] = colour(stroke.paint());
            self.content.set_stroke_rgb(red, green, blue).set_line_width(stroke.width().get());
            self.content.set_line_cap(match stroke.linecap() {
                usvg::LineCap::Butt => LineCapStyle::ButtCap,
                usvg::LineCap::Round => LineCapStyle::RoundCap,
                usvg::LineCap::Square => LineCapStyle::ProjectingSquareCap,
            });
            self.content.set_line_join(match stroke.linejoin() {
                usvg::LineJoin::Round => LineJoinStyle::RoundJoin,
                usvg::LineJoin::Bevel => LineJoinStyle::BevelJoin,
                usvg::LineJoin::Miter | usvg::LineJoin::MiterClip => LineJoinStyle::MiterJoin,
            });
            if let Some(dashes) = stroke.dasharray() {
                self.content.set_dash_pattern(dashes.iter().copied(), stroke.dashoffset());
            }
        }
        self.outline(path.data(), path.abs_transform());
        match (path.fill().is_some(), path.stroke().is_some()) {
            (true, true) => self.content.fill_nonzero_and_stroke(),
            (true, false) => self.content.fill_nonzero(),
            (false, true) => self.content.stroke(),
            (false, false) => self.content.end_path(),
        };
        self.content.restore_state();
    }

    fn fill(&mut self, fill: &usvg::Fill) {
        let [red, green, blue] = colour(fill.paint());
        self.content.set_fill_rgb(red, green, blue);
        // 0 to 100
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let percent = (100.0 * fill.opacity().get()).round() as u8;
        if percent < 100 {
            let name = self.opacities.entry(percent).or_insert_with(|| format!("A{percent}"));
            self.content.set_parameters(Name(name.as_bytes()));
        }
    }

    fn image(&mut self, image: &usvg::Image) -> Result<(), FigureError> {
        let ImageKind::PNG(file) = image.kind() else { return Err(failed("a raster that is no PNG")) };
        let index = self.images.len();
        self.images.push(Image::of_png(file)?);
        // an image fills the unit square, its first row on top
        let size = image.size();
        let unit = Transform::from_row(size.width(), 0.0, 0.0, -size.height(), 0.0, size.height());
        self.content.save_state().transform(matrix(image.abs_transform().pre_concat(unit)));
        self.content.x_object(Name(image_name(index).as_bytes()));
        self.content.restore_state();
        Ok(())
    }

    fn text(&mut self, text: &usvg::Text) {
        for span in text.layouted().iter().filter(|span| span.visible) {
            self.content.save_state();
            if let Some(fill) = &span.fill {
                self.fill(fill);
            }
            self.content.begin_text().set_font(FONT, 1.0);
            for glyph in &span.positioned_glyphs {
                let Ok(id) = u16::try_from(glyph.id.0) else { continue };
                self.used.entry(id).or_insert_with(|| glyph.text.clone());
                // a font's outline in units of which an em has so many
                let em = Transform::from_scale(font::UNITS_PER_EM, font::UNITS_PER_EM);
                let place = text.abs_transform().pre_concat(glyph.outline_transform()).pre_concat(em);
                self.content.set_text_matrix(matrix(place)).show(Str(&id.to_be_bytes()));
            }
            self.content.end_text().restore_state();
        }
    }
}

fn matrix(transform: Transform) -> [f32; 6] {
    let Transform { sx, ky, kx, sy, tx, ty } = transform;
    [sx, ky, kx, sy, tx, ty]
}

/// Figures have plain colours only.
fn colour(paint: &Paint) -> [f32; 3] {
    match paint {
        Paint::Color(colour) => [colour.red, colour.green, colour.blue].map(|part| f32::from(part) / 255.0),
        _ => [0.0; 3],
    }
}

/// A PNG taken apart: a PDF holds the same rows, compressed in the same way.
struct Image {
    width: i32,
    height: i32,
    bits: i32,
    /// 3 bytes a colour; none if the cells are colours themselves.
    palette: Option<Vec<u8>>,
    rows: Vec<u8>,
}

impl Image {
    /// One that [`picture`] has encoded: not interlaced, in colours or with a palette.
    fn of_png(file: &[u8]) -> Result<Self, FigureError> {
        let mut image = Self { width: 0, height: 0, bits: 8, palette: None, rows: Vec::new() };
        let mut rest = file.get(8..).unwrap_or_default();
        while let Some((head, after)) = rest.split_first_chunk::<8>() {
            let (length, kind) = head.split_at(4);
            let length = usize::try_from(big_endian(length)).map_err(failed)?;
            let data = after.get(..length).ok_or_else(|| failed("a PNG that is cut off"))?;
            match kind {
                b"IHDR" => {
                    (image.width, image.height) = (big_endian(&data[..4]), big_endian(&data[4..8]));
                    image.bits = i32::from(data[8]);
                }
                b"PLTE" => image.palette = Some(data.to_vec()),
                b"IDAT" => image.rows.extend_from_slice(data),
                _ => {}
            }
            rest = after.get(length + 4..).unwrap_or_default();
        }
        Ok(image)
    }

    fn write(&self, pdf: &mut Pdf, id: Ref) {
        let mut object = pdf.image_xobject(id, &self.rows);
        object.filter(Filter::FlateDecode);
        object.width(self.width).height(self.height).bits_per_component(self.bits);
        match &self.palette {
            Some(palette) => {
                let last = i32::try_from(palette.len() / 3).unwrap_or(1) - 1;
                object.color_space().indexed(Name(b"DeviceRGB"), last, palette);
            }
            None => object.color_space().device_rgb(),
        }
        let colours = if self.palette.is_some() { 1 } else { 3 };
        let mut rows = object.decode_parms();
        rows.predictor(Predictor::PngOptimum)
            .colors(colours)
            .bits_per_component(self.bits)
            .columns(self.width);
    }
}

fn big_endian(bytes: &[u8]) -> i32 {
    bytes.iter().fold(0, |number, byte| number << 8 | i32::from(*byte))
}
