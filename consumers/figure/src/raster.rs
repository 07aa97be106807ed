//! Images of cells: classes with names and colours, spread over a range of x and y.

use super::FigureError;
use super::colour_scale::{ColourScale, diverging};
use super::style::Colour;

/// Name of cells without a number, unless their maker names them.
const NO_NUMBER: &str = "no frames";

/// A grid of cells placed over the axes of a panel.
///
/// It is embedded as a palette PNG of one pixel a cell, so a map of 1000 × 1000 cells in up to four
/// classes takes at most 0.4 MB, and one of numbers that are pure noise 1.4 MB. Where a PNG figure has fewer dots than cells, colours are averaged;
/// rasters much finer than print are better binned by their maker.
#[derive(Debug, Clone)]
#[must_use]
pub struct Raster {
    width: u32,
    height: u32,
    /// The class of each cell, row by row.
    cells: Vec<u8>,
    classes: Vec<(String, Colour)>,
    /// Scale that the bar beside the raster explains.
    pub(super) scale: Option<ColourScale>,
    pub(super) x: (f64, f64),
    pub(super) y: (f64, f64),
}

/// An image as it is drawn, row by row.
#[derive(Debug)]
pub(super) struct Cells {
    pub(super) width: u32,
    pub(super) height: u32,
    /// 3 bytes a colour; without it, the cells are colours themselves.
    pub(super) palette: Option<Vec<u8>>,
    /// A byte for each cell, or three.
    pub(super) bytes: Vec<u8>,
}

impl Cells {
    /// The colours of `scale` from its upper end to its lower one, in one column.
    pub(super) fn of_scale(scale: &ColourScale) -> Self {
        const HEIGHT: u16 = 256;
        let (low, high) = scale.shades();
        let shade = |row: u16| low + (high - low) * f64::from(row) / f64::from(HEIGHT - 1);
        let bytes = (0..HEIGHT).rev().flat_map(|row| diverging(shade(row)).rgb()).collect();
        Self { width: 1, height: HEIGHT.into(), palette: None, bytes }
    }

    /// The colour of each cell.
    pub(super) fn rgb(&self) -> impl Iterator<Item = [u8; 3]> {
        let of_palette = self.palette.as_ref().map(|palette| palette.as_chunks::<3>().0);
        let count = self.width as usize * self.height as usize;
        (0..count).map(move |cell| match of_palette {
            Some(palette) => palette[usize::from(self.bytes[cell])],
            None => [0, 1, 2].map(|part| self.bytes[3 * cell + part]),
        })
    }
}

impl Raster {
    /// Cells of named classes: `cells` has shape (`height`, `width`), row by row, each an index into
    /// `classes` (name and colour; an empty name keeps a class out of the legend).
    ///
    /// # Errors
    /// [`FigureError::RasterLength`] where `cells` is not `width · height` long,
    /// [`FigureError::RasterClass`] where a cell's class has no entry.
    pub fn classes(
        width: u32,
        height: u32,
        cells: Vec<u8>,
        classes: &[(&str, Colour)],
    ) -> Result<Self, FigureError> {
        check_length(width, height, cells.len())?;
        if let Some(cell) = cells.iter().position(|class| usize::from(*class) >= classes.len()) {
            return Err(FigureError::RasterClass {
                cell,
                class: cells[cell],
                last: classes.len().saturating_sub(1),
            });
        }
        let classes = classes.iter().map(|(name, colour)| ((*name).to_owned(), *colour));
        Ok(Self::new((width, height), cells, classes.collect()))
    }

    /// Cells of signed numbers, each in the colour that `scale` gives it, with a bar beside the axes: `values` has
    /// shape (`height`, `width`), row by row. Cells without a number are grey, and named so in the legend.
    ///
    /// # Errors
    /// [`FigureError::RasterLength`] where `values` is not `width · height` long.
    pub fn values(
        width: u32,
        height: u32,
        values: &[Option<impl Into<f64> + Copy>],
        scale: ColourScale,
    ) -> Result<Self, FigureError> {
        /// Colours of each sign; with white and grey they fill a palette of bytes.
        const SHADES: u8 = 127;
        const NOTHING: u8 = 2 * SHADES + 1;
        check_length(width, height, values.len())?;
        let cell = |value: Option<f64>| {
            let shade = value.map(|value| scale.shade(value) * f64::from(SHADES));
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 254")]
            let cell = |shade: f64| (shade + f64::from(SHADES)).round() as u8;
            shade.map_or(NOTHING, cell)
        };
        let cells: Vec<u8> = values.iter().map(|value| cell(value.map(Into::into))).collect();
        let shades = (0..NOTHING).map(|cell| diverging(f64::from(cell) / f64::from(SHADES) - 1.0));
        let mut classes: Vec<_> = shades.map(|colour| (String::new(), colour)).collect();
        if cells.contains(&NOTHING) {
            classes.push((NO_NUMBER.to_owned(), Colour::LightGrey));
        }
        Ok(Self { scale: Some(scale), ..Self::new((width, height), cells, classes) })
    }

    /// Names the cells of [`Raster::values`] that have no number, if there are any.
    pub fn nothing(mut self, name: &str) -> Self {
        let without = self.classes.iter_mut().filter(|(known, _)| known == NO_NUMBER);
        without.for_each(|class| name.clone_into(&mut class.0));
        self
    }

    fn new((width, height): (u32, u32), cells: Vec<u8>, classes: Vec<(String, Colour)>) -> Self {
        let (x, y) = ((0.0, f64::from(width)), (0.0, f64::from(height)));
        Self { width, height, cells, classes, scale: None, x, y }
    }

    /// Spreads the cells over these ranges of the axes: the first column begins at `x.0`, the first row
    /// at `y.0`. Without it one cell is one unit, from 0 on.
    pub fn over(mut self, x: (f64, f64), y: (f64, f64)) -> Self {
        self.x = x;
        self.y = y;
        self
    }

    /// The names and colours for the legend.
    pub(super) fn named_classes(&self) -> impl Iterator<Item = (&str, Colour)> {
        let named = self.classes.iter().filter(|(name, _)| !name.is_empty());
        named.map(|(name, colour)| (name.as_str(), *colour))
    }

    pub(super) fn is_empty(&self) -> bool {
        self.width == 0 || self.height == 0
    }

    /// The cells as they are drawn, mirrored as the axes ask. With `dots`, the size on paper in device dots, each dot gets
    /// the mean colour of what it covers, unless cells are many dots large.
    pub(super) fn cells(&self, mirror: (bool, bool), dots: Option<(u32, u32)>) -> Cells {
        if let Some((width, height)) = dots.filter(|dots| self.is_better_averaged(*dots)) {
            let bytes = mirrored::<3>(&self.averaged(width, height), width, mirror);
            return Cells { width, height, palette: None, bytes };
        }
        let palette = self.classes.iter().flat_map(|(_, colour)| colour.rgb()).collect();
        let bytes = mirrored::<1>(&self.cells, self.width, mirror);
        Cells { width: self.width, height: self.height, palette: Some(palette), bytes }
    }

    /// True if picking the nearest cell for each dot would lose cells or make them visibly uneven.
    fn is_better_averaged(&self, (across, down): (u32, u32)) -> bool {
        const LARGE: u32 = 6;
        // A raster that reaches far beyond the axes must not become a huge image.
        const MOST_DOTS: u64 = 40_000_000;
        let count = u64::from(across) * u64::from(down);
        let coarse = across / LARGE >= self.width && down / LARGE >= self.height;
        (1..=MOST_DOTS).contains(&count) && !coarse
    }

    fn colour_at(&self, cell: usize) -> [f64; 3] {
        self.classes[usize::from(self.cells[cell])].1.rgb().map(f64::from)
    }

    /// The image at a coarser size: each new cell has the mean colour of the area it covers.
    fn averaged(&self, width: u32, height: u32) -> Vec<u8> {
        let columns: Vec<_> = (0..width).map(|cell| shares(cell, width, self.width)).collect();
        let mut rgb = Vec::with_capacity(3 * width as usize * height as usize);
        for row in 0..height {
            let rows = shares(row, height, self.height);
            for columns in &columns {
                let (mut sum, mut weight) = ([0.0; 3], 0.0);
                for (row, row_share) in &rows {
                    for (column, column_share) in columns {
                        let share = row_share * column_share;
                        let colour = self.colour_at(row * self.width as usize + column);
                        for (sum, part) in sum.iter_mut().zip(colour) {
                            *sum += share * part;
                        }
                        weight += share;
                    }
                }
                // A mean of bytes is one.
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                rgb.extend(sum.map(|sum| (sum / weight).round() as u8));
            }
        }
        rgb
    }
}

/// The cells of `fine` that one cell of `coarse` covers, and how much of each.
fn shares(cell: u32, coarse: u32, fine: u32) -> Vec<(usize, f64)> {
    let ratio = f64::from(fine) / f64::from(coarse);
    let (from, to) = (f64::from(cell) * ratio, f64::from(cell + 1) * ratio);
    // Not negative and below `fine`.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let first = from as u32;
    (first..fine)
        .take_while(|fine| f64::from(*fine) < to)
        .map(|fine| {
            let share = (f64::from(fine) + 1.0).min(to) - f64::from(fine).max(from);
            (fine as usize, share)
        })
        .collect()
}

/// Rows of `N`-byte cells with their columns, their rows, or both in reverse.
fn mirrored<const N: usize>(bytes: &[u8], width: u32, (mirror_x, mirror_y): (bool, bool)) -> Vec<u8> {
    let mut rows: Vec<&[u8]> = bytes.chunks_exact((N * width as usize).max(1)).collect();
    if mirror_y {
        rows.reverse();
    }
    if !mirror_x {
        return rows.concat();
    }
    let reverse = |row: &[u8]| row.chunks_exact(N).rev().collect::<Vec<_>>().concat();
    rows.into_iter().flat_map(reverse).collect()
}

fn check_length(width: u32, height: u32, found: usize) -> Result<(), FigureError> {
    let expected = u64::from(width) * u64::from(height);
    if expected == found as u64 {
        return Ok(());
    }
    Err(FigureError::RasterLength { width, height, expected, found })
}

#[cfg(test)]
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "made-up numbers")]
mod tests {
    use super::*;

    const CLASSES: [(&str, Colour); 2] = [("open", Colour::White), ("compressed", Colour::Black)];

    #[test]
    fn cells_that_do_not_fill_the_raster_are_refused() {
        let error = Raster::classes(3, 2, vec![0; 5], &CLASSES).expect_err("too short");
        assert_eq!(error.to_string(), "a raster of 3 × 2 cells takes 6 bytes, not 5");
        let error = Raster::classes(1, 2, vec![0, 2], &CLASSES).expect_err("no class 2");
        assert!(error.to_string().contains("cell 1"));
    }

    #[test]
    fn mirrors_swap_columns_and_rows() {
        assert_eq!(mirrored::<1>(b"abcdef", 3, (true, false)), b"cbafed");
        assert_eq!(mirrored::<1>(b"abcdef", 3, (false, true)), b"defabc");
        assert_eq!(mirrored::<3>(b"abcdef", 2, (true, false)), b"defabc");
    }

    #[test]
    fn averaging_keeps_the_share_of_each_colour() {
        // Each of three new cells covers 1⅓ of four: the first one all of the black and ⅓ white.
        let raster = Raster::classes(4, 1, vec![1, 0, 0, 0], &CLASSES).expect("fits");
        let reds: Vec<u8> = raster.averaged(3, 1).into_iter().step_by(3).collect();
        assert_eq!(reds, [64, 255, 255]);
    }

    #[test]
    fn numbers_get_the_colours_of_their_scale_and_nothing_is_grey() {
        let scale = ColourScale::new("v (m/s)", -2.0, 4.0);
        let values = [Some(0.0), Some(4.0), Some(9.0), Some(-4.0), None];
        let raster = Raster::values(5, 1, &values, scale).expect("fits");
        let colours: Vec<[u8; 3]> =
            (0..5).map(|cell| raster.colour_at(cell).map(|part| part as u8)).collect();
        let expected = [Colour::White, diverging(1.0), diverging(1.0), diverging(-1.0), Colour::LightGrey];
        assert_eq!(colours, expected.map(Colour::rgb));
        assert_eq!(raster.named_classes().collect::<Vec<_>>(), [("no frames", Colour::LightGrey)]);
    }

    #[test]
    fn noise_in_numbers_stays_under_a_megabyte() {
        // as large as maps of space and time become
        let side: usize = 750;
        let noise =
            |index: u32| (f64::from(index.wrapping_mul(2_654_435_761)) / f64::from(u32::MAX) - 0.5) as f32;
        let values: Vec<_> =
            (0..side * side).map(|index| Some(noise(u32::try_from(index).unwrap_or(0)))).collect();
        let side = u32::try_from(side).expect("small");
        let raster = Raster::values(side, side, &values, ColourScale::new("", -0.5, 0.5)).expect("fits");
        let png = crate::picture::png_of(&raster.cells((false, false), None)).expect("encodes");
        assert!(png.len() < 600_000, "{}", png.len());
    }

    #[test]
    fn a_million_cells_of_noise_stay_under_a_megabyte() {
        let noise = |index: u32| (index.wrapping_mul(2_654_435_761) >> 13) % 3;
        let cells = (0..1_000_000).map(|index| u8::try_from(noise(index)).unwrap_or(0));
        let classes = [CLASSES[0], CLASSES[1], ("touching", Colour::Grey)];
        let raster = Raster::classes(1000, 1000, cells.collect(), &classes).expect("fits");
        let png = crate::picture::png_of(&raster.cells((false, false), None)).expect("encodes");
        assert!(png.len() < 300_000, "{}", png.len());
    }
}
