//! The bundled font in a PDF: only the outlines that are used, numbered anew.

use std::collections::BTreeMap;

use pdf_writer::types::{CidFontType, FontFlags, SystemInfo, UnicodeCmap};
use pdf_writer::{Filter, Finish, Name, Pdf, Rect, Ref, Str};
use skrifa::raw::TableProvider;
use skrifa::raw::types::GlyphId;
use skrifa::{FontRef, MetadataProvider};
use subsetter::GlyphRemapper;

use super::super::picture::failed;
use super::super::text::{Glyph, UNITS_PER_EM};
use super::super::{FigureError, text};
use super::deflated;

/// Objects that the font takes.
pub(super) const OBJECTS: i32 = 5;

/// The used glyphs: their numbers in the PDF, and their characters.
#[derive(Default)]
pub(super) struct Used {
    numbers: GlyphRemapper,
    characters: BTreeMap<u16, char>,
}

impl Used {
    /// The number of `glyph` in the PDF.
    pub(super) fn id_of(&mut self, glyph: Glyph) -> u16 {
        let id = self.numbers.remap(glyph.id);
        self.characters.entry(id).or_insert(glyph.character);
        id
    }
}

/// A subset has six letters before its name.
const NAME: Name<'static> = Name(b"BEADLN+LiberationSans");
const SYSTEM: SystemInfo<'static> =
    SystemInfo { registry: Str(b"Adobe"), ordering: Str(b"Identity"), supplement: 0 };

/// Writes the font as object `id` and the ones after it.
pub(super) fn write(pdf: &mut Pdf, id: Ref, used: &Used) -> Result<(), FigureError> {
    let font = FontRef::new(text::FONT).map_err(failed)?;
    let [cid, descriptor, unicode, file] = [1, 2, 3, 4].map(|next| Ref::new(id.get() + next));
    let to_em = |units: f32| 1000.0 * units / UNITS_PER_EM;
    pdf.type0_font(id)
        .base_font(NAME)
        .encoding_predefined(Name(b"Identity-H"))
        .descendant_font(cid)
        .to_unicode(unicode);
    let metrics =
        font.glyph_metrics(skrifa::instance::Size::unscaled(), skrifa::instance::LocationRef::default());
    let mut writer = pdf.cid_font(cid);
    writer.subtype(CidFontType::Type2).base_font(NAME).system_info(SYSTEM).font_descriptor(descriptor);
    writer.cid_to_gid_map_predefined(Name(b"Identity")).default_width(0.0);
    let mut widths = writer.widths();
    for (new, old) in (0..).zip(used.numbers.remapped_gids()) {
        let width = metrics.advance_width(GlyphId::from(old)).unwrap_or_default();
        widths.consecutive(new, [to_em(width)]);
    }
    widths.finish();
    writer.finish();
    let head = font.head().map_err(failed)?;
    let [left, low, right, high] =
        [head.x_min(), head.y_min(), head.x_max(), head.y_max()].map(|units| to_em(f32::from(units)));
    let line = font.hhea().map_err(failed)?;
    pdf.font_descriptor(descriptor)
        .name(NAME)
        .flags(FontFlags::NON_SYMBOLIC)
        .bbox(Rect::new(left, low, right, high))
        .italic_angle(0.0)
        .ascent(to_em(f32::from(line.ascender().to_i16())))
        .descent(to_em(f32::from(line.descender().to_i16())))
        .cap_height(729.0)
        .stem_v(80.0)
        .font_file2(file);
    let mut map = UnicodeCmap::new(Name(b"Beadline"), SYSTEM);
    for (id, character) in &used.characters {
        map.pair(*id, *character);
    }
    pdf.stream(unicode, &deflated(&map.finish())?).filter(Filter::FlateDecode);
    let subset = subsetter::subset(text::FONT, 0, &used.numbers).map_err(failed)?;
    pdf.stream(file, &deflated(&subset)?)
        .filter(Filter::FlateDecode)
        .pair(Name(b"Length1"), i32::try_from(subset.len()).unwrap_or(i32::MAX));
    Ok(())
}
