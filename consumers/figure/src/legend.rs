//! The legend: rows of swatches and names above the axes, and a note.

use super::look::{LEADING, Look};
use super::panel::Panel;
use super::sheet::{Anchor, Pen, Rect, Sheet};
use super::style::{Colour, Ink};
use super::text::{CAP_HEIGHT, width, wrap};

/// Lengths in units of the font's size: a piece of line, a square or marker, from these to the name, and
/// from one entry to the next.
const LINE: f64 = 1.9;
const SQUARE: f64 = 0.85;
const GAP: f64 = 0.45;
const BETWEEN: f64 = 1.5;

/// Sample before a name.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Swatch {
    Curve(Ink),
    Area(Colour),
    Reference,
}

impl Swatch {
    /// In units of the font's size.
    fn width(self) -> f64 {
        match self {
            Self::Area(_) | Self::Curve(Ink { stroke: None, .. }) => SQUARE,
            Self::Curve(_) | Self::Reference => LINE,
        }
    }
}

/// An entry with its distance from the left edge of the axes.
#[derive(Debug)]
pub(super) struct Entry {
    x: f64,
    /// None where the name goes on from the row above, and before a note.
    swatch: Option<Swatch>,
    name_x: f64,
    name: String,
}

pub(super) type Row = Vec<Entry>;

/// Names with their swatches; the note has none.
fn entries(panel: &Panel) -> Vec<(Option<Swatch>, &str)> {
    let mut entries = Vec::new();
    for (curve, ink) in panel.curves.iter().zip(panel.inks()) {
        entries.push((Some(Swatch::Curve(ink)), curve.label.as_str()));
    }
    for (name, colour) in panel.raster.iter().flat_map(super::Raster::named_classes) {
        entries.push((Some(Swatch::Area(colour)), name));
    }
    for reference in &panel.references {
        let swatch = if reference.is_line() { Swatch::Reference } else { Swatch::Area(Colour::LightGrey) };
        entries.push((Some(swatch), reference.label.as_str()));
    }
    entries.push((None, panel.note.as_str()));
    entries.retain(|(_, name)| !name.trim().is_empty());
    entries
}

/// Lays the entries out in rows no wider than `limit`.
pub(super) fn rows(panel: &Panel, size: f64, limit: f64) -> Vec<Row> {
    let mut rows: Vec<Row> = Vec::new();
    let mut x = limit;
    for (swatch, name) in entries(panel) {
        let name_x = swatch.map_or(0.0, |swatch| (swatch.width() + GAP) * size);
        for (index, line) in wrap(name, size, limit - name_x).into_iter().enumerate() {
            let advance = name_x + width(&line, size);
            if rows.is_empty() || index > 0 || x + advance > limit {
                rows.push(Row::new());
                x = 0.0;
            }
            if let Some(row) = rows.last_mut() {
                row.push(Entry { x, swatch: swatch.filter(|_| index == 0), name_x: x + name_x, name: line });
            }
            x += advance + BETWEEN * size;
        }
    }
    rows
}

/// Height that the rows take above the axes.
pub(super) fn height(rows: usize, size: f64) -> f64 {
    if rows == 0 { 0.0 } else { (rows as f64 * LEADING + 0.25) * size }
}

/// Draws the rows above `frame`.
pub(super) fn draw(sheet: &mut Sheet, rows: &[Row], frame: Rect, look: &Look) {
    let size = look.label;
    let top = frame.y - height(rows.len(), size);
    for (index, row) in rows.iter().enumerate() {
        let middle = top + (index as f64 + 0.5) * LEADING * size;
        for entry in row {
            if let Some(swatch) = entry.swatch {
                draw_swatch(sheet, swatch, (frame.x + entry.x, middle), look);
            }
            let place = (frame.x + entry.name_x, middle + 0.5 * CAP_HEIGHT * size);
            sheet.text(place, Anchor::Start, (size, Colour::Black), &entry.name);
        }
    }
}

/// Draws a title above the right end of `frame`, on the last row of the legend.
pub(super) fn draw_title(sheet: &mut Sheet, title: &str, frame: Rect, look: &Look) {
    let size = look.label;
    let middle = frame.y - height(1, size) + 0.5 * LEADING * size;
    let place = (frame.right(), middle + 0.5 * CAP_HEIGHT * size);
    sheet.text(place, Anchor::End, (size, Colour::Black), title);
}

fn draw_swatch(sheet: &mut Sheet, swatch: Swatch, (x, middle): (f64, f64), look: &Look) {
    let length = swatch.width() * look.label;
    let ends = ((x, middle), (x + length, middle));
    match swatch {
        Swatch::Reference => sheet.line(ends.0, ends.1, look.reference_pen()),
        Swatch::Area(colour) => {
            let square = Rect { x, y: middle - 0.5 * length, width: length, height: length };
            sheet.fill(square, colour, 1.0);
            sheet.outline(square, Pen::solid(Colour::Grey, 0.7 * look.frame));
        }
        Swatch::Curve(ink) => {
            if let Some(stroke) = ink.stroke {
                sheet.line(ends.0, ends.1, look.curve_pen(ink, stroke));
            }
            if let Some(mark) = ink.mark {
                let path = mark.path((x + 0.5 * length, middle), look.mark);
                sheet.area(path, ink.colour, 0.25 * look.mark);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn entries_stay_within_the_axes_and_unnamed_curves_out_with_a_note_at_the_end() {
        let long = "a name that is a good deal longer than one row of this legend is wide";
        let panel = Panel::new()
            .line("u", [])
            .line("", [])
            .line(long, [])
            .vertical("impurity", 5.0)
            .band_x("window", 0.0, 1.0)
            .note("a note");
        let rows = rows(&panel, 7.0, 120.0);
        assert!(rows.len() > 3);
        for entry in rows.iter().flatten() {
            let right = entry.name_x + width(&entry.name, 7.0);
            assert!(right <= 120.0, "{entry:?}");
            assert!(!entry.name.is_empty());
        }
        let last = rows.iter().flatten().last().map(|entry| (entry.swatch, entry.name.as_str()));
        assert_eq!(last, Some((None, "a note")));
    }
}
