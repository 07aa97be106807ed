//! The bundled font in a PDF: only the outlines that are used, under the numbers that they have.

use std::collections::{BTreeMap, BTreeSet};

use pdf_writer::types::{CidFontType, FontFlags, SystemInfo, UnicodeCmap};
use pdf_writer::{Filter, Finish, Name, Pdf, Rect, Ref, Str};
use skrifa::raw::TableProvider;
use skrifa::raw::tables::glyf::Glyph;
use skrifa::raw::types::{GlyphId, Tag};
use skrifa::{FontRef, MetadataProvider};

use super::super::picture::failed;
use super::super::{FigureError, text};
use super::deflated;

/// Objects that the font takes.
pub(super) const OBJECTS: i32 = 5;
/// Units in which the font's outlines are drawn.
pub(super) const UNITS_PER_EM: f32 = 2048.0;

/// The used glyphs and their characters.
pub(super) type Used = BTreeMap<u16, String>;

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
    for glyph in used.keys() {
        let width = metrics.advance_width(GlyphId::from(*glyph)).unwrap_or_default();
        widths.consecutive(*glyph, [to_em(width)]);
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
    for (glyph, text) in used {
        map.pair_with_multiple(*glyph, text.chars());
    }
    pdf.stream(unicode, &deflated(&map.finish())?).filter(Filter::FlateDecode);
    let subset = subset(&font, used.keys().copied())?;
    pdf.stream(file, &deflated(&subset)?)
        .filter(Filter::FlateDecode)
        .pair(Name(b"Length1"), i32::try_from(subset.len()).unwrap_or(i32::MAX));
    Ok(())
}

/// The font with the outlines of `glyphs` only; all others are empty.
fn subset(font: &FontRef<'_>, glyphs: impl Iterator<Item = u16>) -> Result<Vec<u8>, FigureError> {
    let (loca, glyf) = (font.loca(None).map_err(failed)?, font.glyf().map_err(failed)?);
    let mut kept: BTreeSet<u32> = glyphs.map(u32::from).chain([0]).collect();
    let mut open: Vec<u32> = kept.iter().copied().collect();
    while let Some(glyph) = open.pop() {
        // letters with accents are made of others
        if let Ok(Some(Glyph::Composite(parts))) = loca.get_glyf(GlyphId::new(glyph), &glyf) {
            open.extend(
                parts
                    .components()
                    .map(|part| u32::from(part.glyph.to_u16()))
                    .filter(|part| kept.insert(*part)),
            );
        }
    }
    let whole = glyf.offset_data();
    let (mut outlines, mut places) = (Vec::new(), vec![0_u32]);
    for glyph in 0..loca.len() {
        if kept.contains(&u32::try_from(glyph).unwrap_or(u32::MAX)) {
            let range =
                loca.get_raw(glyph).unwrap_or(0) as usize..loca.get_raw(glyph + 1).unwrap_or(0) as usize;
            outlines.extend_from_slice(whole.slice(range).unwrap_or_default().as_bytes());
            outlines.resize(outlines.len().next_multiple_of(4), 0);
        }
        places.push(u32::try_from(outlines.len()).map_err(failed)?);
    }
    let mut tables = Vec::new();
    for tag in [b"cvt ", b"fpgm", b"glyf", b"head", b"hhea", b"hmtx", b"loca", b"maxp", b"prep"] {
        let mut table = match tag {
            b"glyf" => std::mem::take(&mut outlines),
            b"loca" => places.iter().flat_map(|place| place.to_be_bytes()).collect(),
            tag => font.table_data(Tag::new(tag)).map(|data| data.as_bytes().to_vec()).unwrap_or_default(),
        };
        if tag == b"head" {
            // places are in four bytes each
            table[50..52].copy_from_slice(&1_u16.to_be_bytes());
        }
        tables.push((*tag, table));
    }
    Ok(file(&tables))
}

/// A TrueType file of these tables, which are in the order of their names. Nobody checks the sums in a PDF; they are 0.
fn file(tables: &[([u8; 4], Vec<u8>)]) -> Vec<u8> {
    let count = u16::try_from(tables.len()).unwrap_or(u16::MAX);
    let power = count.ilog2();
    let range = 16 << power;
    let mut file = 0x0001_0000_u32.to_be_bytes().to_vec();
    for number in [count, range, u16::try_from(power).unwrap_or(0), 16 * count - range] {
        file.extend(number.to_be_bytes());
    }
    let mut place = file.len() + 16 * tables.len();
    for (tag, table) in tables {
        file.extend(tag);
        for number in [0, place, table.len()] {
            file.extend(u32::try_from(number).unwrap_or(u32::MAX).to_be_bytes());
        }
        place += table.len().next_multiple_of(4);
    }
    for (_, table) in tables {
        file.extend(table);
        file.resize(file.len().next_multiple_of(4), 0);
    }
    file
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_subset_is_a_font_with_the_outlines_that_are_used() {
        let whole = FontRef::new(text::FONT).expect("the bundled font");
        let glyph = |character: char| whole.charmap().map(character).expect("a glyph");
        let id = |character| u16::try_from(glyph(character).to_u32()).expect("few glyphs");
        // an accent makes a letter of two others
        let file = subset(&whole, [id('v'), id('é')].into_iter()).expect("made");
        assert!(file.len() < text::FONT.len() / 4, "{} bytes", file.len());
        let part = FontRef::new(&file).expect("a font");
        let outline = |font: &FontRef<'_>, character| {
            let (loca, glyf) = (font.loca(None).expect("places"), font.glyf().expect("outlines"));
            let found = loca.get_glyf(glyph(character), &glyf).expect("in the file");
            found.map(|found| found.offset_data().as_bytes().to_vec())
        };
        for (character, is_kept) in [('v', true), ('é', true), ('e', true), ('w', false)] {
            let found = outline(&part, character);
            assert_eq!(found.is_some(), is_kept, "{character}");
            // filled up to four bytes
            let same =
                found.is_none_or(|found| found.starts_with(&outline(&whole, character).unwrap_or_default()));
            assert!(same, "{character}: another outline");
        }
    }
}
