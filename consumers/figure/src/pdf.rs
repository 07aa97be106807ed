//! PDF files: curves stay curves, text is text in the bundled font, of which only the glyphs that are used go along,
//! and images keep their cells.

mod font;

use std::collections::BTreeMap;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use pdf_writer::types::{LineCapStyle, LineJoinStyle};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Ref, Str, TextStr};
use std::io::Write as _;
use tiny_skia::PathSegment;

use super::FigureError;
use super::picture::{self, failed};
use super::raster::Cells;
use super::sheet::{Element, Outline, Rect, Shape, Sheet, Text};
use super::style::{Colour, Stroke};
use font::Used;

/// The sheet as a PDF of one page.
pub(super) fn pdf(drawn: &Sheet) -> Result<Vec<u8>, FigureError> {
    // a point of the sheet is one of the page
    #[expect(clippy::cast_possible_truncation, reason = "a length on paper")]
    let (width, height) = (drawn.width as f32, drawn.height as f32);
    let mut page = Page {
        content: Content::new(),
        images: Vec::new(),
        opacities: BTreeMap::new(),
        used: Used::default(),
    };
    // y runs downwards on the sheet, upwards on the page
    page.content.transform([1.0, 0.0, 0.0, -1.0, 0.0, height]);
    for element in &drawn.elements {
        page.element(element);
    }

    let [catalog, pages, sheet, content, info, font] = [1, 2, 3, 4, 5, 6].map(Ref::new);
    let mut free = Ref::new(6 + font::OBJECTS);
    let mut pdf = Pdf::new();
    pdf.catalog(catalog).pages(pages);
    pdf.pages(pages).kids([sheet]).count(1);
    pdf.document_info(info).producer(TextStr("Beadline"));
    let mut writer = pdf.page(sheet);
    writer.parent(pages).media_box(pdf_writer::Rect::new(0.0, 0.0, width, height)).contents(content);
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
    for (cells, id) in page.images.iter().zip(images) {
        write_image(&mut pdf, id, cells)?;
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
struct Page<'a> {
    content: Content,
    images: Vec<&'a Cells>,
    /// Opacities of areas in per cent, and their names.
    opacities: BTreeMap<u8, String>,
    used: Used,
}

impl<'a> Page<'a> {
    fn element(&mut self, element: &'a Element) {
        match element {
            Element::Shape(shape) => self.shape(shape),
            Element::Text(text) => self.text(text),
            Element::Image(rect, cells) => self.image(*rect, cells),
            Element::Clip(rect) => {
                self.content.save_state();
                self.outline(&Outline::Rect(*rect));
                self.content.clip_nonzero().end_path();
            }
            Element::EndClip => {
                self.content.restore_state();
            }
        }
    }

    /// An outline; curves of second order become ones of third order.
    fn outline(&mut self, outline: &Outline) {
        let Some(path) = outline.path() else { return };
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

    fn shape(&mut self, shape: &Shape) {
        self.content.save_state();
        if let Some((colour, opacity)) = shape.fill {
            self.fill(colour, opacity);
        }
        if let Some(pen) = shape.pen {
            let [red, green, blue] = parts(pen.colour);
            #[expect(clippy::cast_possible_truncation, reason = "a length on paper")]
            self.content.set_stroke_rgb(red, green, blue).set_line_width(pen.width as f32);
            if shape.is_round() {
                self.content.set_line_join(LineJoinStyle::RoundJoin);
                if pen.stroke != Stroke::Dashed {
                    self.content.set_line_cap(LineCapStyle::RoundCap);
                }
            }
            if let Some(dashes) = pen.dashes() {
                #[expect(clippy::cast_possible_truncation, reason = "lengths on paper")]
                self.content.set_dash_pattern(dashes.map(|length| length as f32), 0.0);
            }
        }
        self.outline(&shape.outline);
        match (shape.fill.is_some(), shape.pen.is_some()) {
            (true, true) => self.content.fill_nonzero_and_stroke(),
            (true, false) => self.content.fill_nonzero(),
            (false, true) => self.content.stroke(),
            (false, false) => self.content.end_path(),
        };
        self.content.restore_state();
    }

    fn fill(&mut self, colour: Colour, opacity: f64) {
        let [red, green, blue] = parts(colour);
        self.content.set_fill_rgb(red, green, blue);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 100")]
        let percent = (100.0 * opacity).round() as u8;
        if percent < 100 {
            let name = self.opacities.entry(percent).or_insert_with(|| format!("A{percent}"));
            self.content.set_parameters(Name(name.as_bytes()));
        }
    }

    fn image(&mut self, rect: Rect, cells: &'a Cells) {
        let name = image_name(self.images.len());
        self.images.push(cells);
        // an image fills the unit square, its first row on top
        let matrix = [rect.width, 0.0, 0.0, -rect.height, rect.x, rect.bottom()];
        #[expect(clippy::cast_possible_truncation, reason = "a place on paper")]
        self.content.save_state().transform(matrix.map(|part| part as f32));
        self.content.x_object(Name(name.as_bytes())).restore_state();
    }

    fn text(&mut self, text: &Text) {
        self.content.save_state();
        self.fill(text.colour, 1.0);
        self.content.begin_text().set_font(FONT, 1.0);
        for (glyph, matrix) in text.glyphs() {
            let id = self.used.id_of(glyph);
            self.content.set_text_matrix(matrix).show(Str(&id.to_be_bytes()));
        }
        self.content.end_text().restore_state();
    }
}

/// Red, green and blue, from 0 to 1.
fn parts(colour: Colour) -> [f32; 3] {
    colour.rgb().map(|part| f32::from(part) / 255.0)
}

/// Writes an image as object `id`, with as few bits a cell as its palette needs.
fn write_image(pdf: &mut Pdf, id: Ref, cells: &Cells) -> Result<(), FigureError> {
    let Cells { width, height, palette, bytes } = cells;
    let bits = palette.as_ref().map_or(8, |palette| picture::bits_of(palette));
    let rows = match palette {
        Some(_) => deflated(&picture::packed(bytes, *width, bits))?,
        None => deflated(bytes)?,
    };
    let side = |length: u32| i32::try_from(length).map_err(failed);
    let mut object = pdf.image_xobject(id, &rows);
    object.filter(Filter::FlateDecode);
    object.width(side(*width)?).height(side(*height)?);
    object.bits_per_component(i32::try_from(bits).map_err(failed)?);
    match palette {
        Some(palette) => {
            let last = i32::try_from(palette.len() / 3).unwrap_or(1) - 1;
            object.color_space().indexed(Name(b"DeviceRGB"), last, palette);
        }
        None => object.color_space().device_rgb(),
    }
    Ok(())
}
