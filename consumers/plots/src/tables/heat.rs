//! A column of a table in colours over two others.

use super::column_label;
use figure::{Axis, ColourScale, Figure, FigureError, Panel, Raster};

/// Cells of each side of a map whose cells are not all of one size.
const FINE: u16 = 480;

/// Values nearer to 0 than this part of the largest make the colours begin at 0.
const NEAR_ZERO: f64 = 0.35;

/// A quantity over two parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct HeatMap {
    /// The columns of the x axis, the y axis and the colours.
    pub columns: [String; 3],
    /// True if the axes, x and y, are logarithmic.
    pub log: [bool; 2],
    /// True if colours follow the logarithm.
    pub log_colours: bool,
    /// Their values, one for each pair of x and y.
    pub values: Vec<[f64; 3]>,
    /// Text under the panel.
    pub caption: String,
}

/// Draws it: a cell for each pair of x and y where these form a grid, else means over cells that have about two rows.
///
/// # Errors
/// When the map cannot be drawn, which is a mistake of ours.
pub fn heat_map(map: &HeatMap) -> Result<Figure, FigureError> {
    let [x, y] = map.sides();
    let scale = scale(map, map.means(&x, &y).into_iter().flatten());
    let binned = if x.is_grid && y.is_grid { "" } else { "; of the rows in a cell the mean" };
    Ok(Figure::new().caption(format!("{}{binned}", map.caption)).panel(map.panel(scale, "no value")?))
}

impl HeatMap {
    fn sides(&self) -> [Side; 2] {
        let places = [0, 1].map(|side| places(self, side));
        // a grid has each of its values many times, or nearly all of its pairs
        let (pairs, rows) = (places[0].len() * places[1].len(), self.values.len());
        let is_grid = |places: &[f64]| places.len() * 2 <= rows || rows <= 2 || pairs <= 2 * rows;
        let are_grids = [is_grid(&places[0]), is_grid(&places[1])];
        [0, 1].map(|side| Side::new(self.log[side], &places[side], rows, are_grids[side]))
    }

    /// The mean in each cell.
    fn means(&self, x: &Side, y: &Side) -> Vec<Option<f64>> {
        let mut sums = vec![(0.0, 0_u32); x.cells() * y.cells()];
        for [at_x, at_y, value] in self.values.iter().filter(|row| row[2].is_finite()) {
            if let (Some(column), Some(row)) = (x.cell(*at_x), y.cell(*at_y)) {
                let (sum, count) = &mut sums[row * x.cells() + column];
                (*sum, *count) = (*sum + value, *count + 1);
            }
        }
        sums.iter().map(|(sum, count)| (*count > 0).then(|| sum / f64::from(*count))).collect()
    }

    /// Its panel with the colours of `scale`; cells without a value are named `nothing`.
    ///
    /// # Errors
    /// As [`heat_map`].
    pub fn panel(&self, scale: ColourScale, nothing: &str) -> Result<Panel, FigureError> {
        let [x, y] = self.sides();
        let means = self.means(&x, &y);
        let (columns, rows) = (x.drawn(), y.drawn());
        let cells = x.cells();
        let drawn = rows
            .iter()
            .flat_map(|row| columns.iter().map(|column| means[*row * cells + *column]).collect::<Vec<_>>());
        let drawn: Vec<Option<f64>> = drawn.collect();
        let count = |cells: &[usize]| u32::try_from(cells.len()).unwrap_or(u32::MAX);
        let raster = Raster::values(count(&columns), count(&rows), &drawn, scale)?.nothing(nothing);
        let axis = |side: &Side, name: &str| {
            let (from, to) = side.ends();
            let axis = Axis::new(column_label(name)).limits(from, to);
            if side.log { axis.log() } else { axis }
        };
        Ok(Panel::new()
            .x_axis(axis(&x, &self.columns[0]))
            .y_axis(axis(&y, &self.columns[1]))
            .raster(raster.over(x.ends(), y.ends()))
            .height(1.35))
    }

    /// The border, as pieces of a line, between cells of a grid whose rows are in `region` and others.
    pub fn border(&self, region: &[bool]) -> Vec<(f64, f64)> {
        let [x, y] = self.sides();
        let mut cells = vec![false; x.cells() * y.cells()];
        for ([at_x, at_y, _], is_in) in self.values.iter().zip(region) {
            if let (Some(column), Some(row)) = (x.cell(*at_x), y.cell(*at_y)) {
                cells[row * x.cells() + column] = *is_in;
            }
        }
        let mut pieces = Vec::new();
        for (row, column) in (0..y.cells()).flat_map(|row| (0..x.cells()).map(move |column| (row, column))) {
            let is_in = |row: usize, column: usize| cells[row * x.cells() + column];
            let corner = |row: usize, column: usize| (x.edge(column), y.edge(row));
            let mut piece = |to| pieces.extend([corner(row + 1, column + 1), to, (f64::NAN, f64::NAN)]);
            if column + 1 < x.cells() && is_in(row, column) != is_in(row, column + 1) {
                piece(corner(row, column + 1));
            }
            if row + 1 < y.cells() && is_in(row, column) != is_in(row + 1, column) {
                piece(corner(row + 1, column));
            }
        }
        pieces
    }
}

fn scale(map: &HeatMap, values: impl Iterator<Item = f64>) -> ColourScale {
    let label = column_label(&map.columns[2]);
    let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| {
        [if value < low { value } else { low }, if value > high { value } else { high }]
    });
    let far = if high > -low { high } else { -low };
    let is_far_from_zero = low > NEAR_ZERO * far || high < -NEAR_ZERO * far;
    if map.log_colours {
        ColourScale::new(label, low, high).log_beyond(1e-4 * far)
    } else if is_far_from_zero {
        ColourScale::between(label, low, high)
    } else {
        ColourScale::new(label, low, high)
    }
}

/// The cells along one axis, in its own coordinate: the value or its logarithm.
struct Side {
    log: bool,
    /// One more than there are cells, rising.
    edges: Vec<f64>,
    is_even: bool,
    /// The values of the table have a cell each.
    is_grid: bool,
}

impl Side {
    fn new(log: bool, places: &[f64], rows: usize, is_grid: bool) -> Self {
        let edges = if is_grid { around(places) } else { spread(places, rows) };
        let gaps: Vec<f64> = edges.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let mean = gaps.iter().sum::<f64>() / gaps.len().max(1) as f64;
        let is_even = gaps.iter().all(|gap| (gap - mean).abs() < 1e-6 * mean);
        Self { log, edges, is_even, is_grid }
    }

    fn cells(&self) -> usize {
        self.edges.len() - 1
    }

    /// The cell of a value.
    fn cell(&self, value: f64) -> Option<usize> {
        self.cell_at(if self.log { value.log10() } else { value })
    }

    fn cell_at(&self, place: f64) -> Option<usize> {
        place.is_finite().then(|| self.edges[1..self.cells()].partition_point(|edge| *edge <= place))
    }

    /// The cells as they are drawn: each once if all have one size, else as often as it is large.
    fn drawn(&self) -> Vec<usize> {
        if self.is_even {
            return (0..self.cells()).collect();
        }
        let (from, to) = (self.edges[0], self.edges[self.cells()]);
        let middle = |i: u16| from + (to - from) * (f64::from(i) + 0.5) / f64::from(FINE);
        (0..FINE).filter_map(|i| self.cell_at(middle(i))).collect()
    }

    fn ends(&self) -> (f64, f64) {
        (self.edge(0), self.edge(self.cells()))
    }

    /// The value at the edge before cell `number`.
    fn edge(&self, number: usize) -> f64 {
        if self.log { 10_f64.powf(self.edges[number]) } else { self.edges[number] }
    }
}

/// The places of the values of a side, each once.
fn places(map: &HeatMap, side: usize) -> Vec<f64> {
    let place = |value: f64| if map.log[side] { value.log10() } else { value };
    let mut places: Vec<f64> = map.values.iter().map(|row| place(row[side])).collect();
    places.retain(|place| place.is_finite());
    places.sort_by(f64::total_cmp);
    places.dedup();
    places
}

/// The edges of cells around each of the `places`: halfway between them.
fn around(places: &[f64]) -> Vec<f64> {
    let (Some(first), Some(last)) = (places.first(), places.last()) else { return vec![0.0, 1.0] };
    let inner: Vec<f64> = places.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
    let alone = if *first == 0.0 { 0.5 } else { 0.1 * first.abs() };
    let before = inner.first().map_or(first - alone, |edge| first - (edge - first));
    let after = inner.last().map_or(last + alone, |edge| last + (last - edge));
    [vec![before], inner, vec![after]].concat()
}

/// The edges of even cells, as many as give about two of `rows` to each cell of a map.
fn spread(places: &[f64], rows: usize) -> Vec<f64> {
    let (Some(first), Some(last)) = (places.first(), places.last()) else { return vec![0.0, 1.0] };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "3 to 100")]
    let cells = (rows as f64 / 2.0).sqrt().floor().clamp(3.0, 100.0) as u32;
    (0..=cells).map(|i| first + (last - first) * f64::from(i) / f64::from(cells)).collect()
}
