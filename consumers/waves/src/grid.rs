//! Densities over two axes, no finer than a figure shows.

/// Values over x (across) and frequency (up), each the mean over the lines that fall into a cell.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// The middle of each column.
    pub x: Vec<f64>,
    /// Left end of the first column, and right end of the last one.
    pub x_edges: (f64, f64),
    /// The middle of each row (Hz).
    pub frequency_hz: Vec<f64>,
    /// Lower end of the first row, and upper end of the last one (Hz).
    pub frequency_edges_hz: (f64, f64),
    /// The values, row by row from the lowest frequency on; none where unknown.
    pub values: Vec<Option<f64>>,
}

/// Most columns and rows.
const MOST: usize = 500;

impl Grid {
    /// Makes one of `columns` equal columns between `x_edges`. For each column `density` gives the lines of frequencies
    /// `line·step_hz`. Line 0, which lacks the mean, and lines above `top_hz` are left out.
    pub fn new(
        x_edges: (f64, f64),
        columns: usize,
        (step_hz, top_hz): (f64, f64),
        density: impl Fn(usize, usize) -> Option<f64>,
        lines: usize,
    ) -> Self {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped below")]
        let wanted = (top_hz / step_hz).ceil().max(1.0) as usize;
        let lines = wanted.clamp(1, lines.saturating_sub(1).max(1));
        let (across, up) = (columns.div_ceil(MOST).max(1), lines.div_ceil(MOST));
        // a last cell that would be narrower is left out, so that all are the same size
        let (wide, high) = (columns / across, lines / up);
        let step = (x_edges.1 - x_edges.0) / columns.max(1) as f64;
        let mean = |column: usize, row: usize| {
            let cells = (column * across..(column + 1) * across)
                .flat_map(|x| (row * up + 1..=(row + 1) * up).map(move |line| (x, line)));
            let (sum, count) = cells
                .filter_map(|(x, line)| density(x, line))
                .fold((0.0, 0_u32), |(sum, count), value| (sum + value, count + 1));
            (count > 0).then(|| sum / f64::from(count))
        };
        let values = (0..high).flat_map(|row| (0..wide).map(move |column| (column, row)));
        Self {
            x: (0..wide).map(|column| x_edges.0 + (column as f64 + 0.5) * step * across as f64).collect(),
            x_edges: (x_edges.0, x_edges.0 + (wide * across) as f64 * step),
            frequency_hz: (0..high)
                .map(|row| (row as f64 * up as f64 + 0.5 * (up + 1) as f64) * step_hz)
                .collect(),
            frequency_edges_hz: (0.5 * step_hz, ((high * up) as f64 + 0.5) * step_hz),
            values: values.map(|(column, row)| mean(column, row)).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_means_in_their_place() {
        // 1000 columns and 2001 lines: 2 by 4 in a cell
        let grid = Grid::new((0.0, 1000.0), 1000, (2.0, 1e9), |x, line| Some((x * line) as f64), 2001);
        assert_eq!((grid.x.len(), grid.frequency_hz.len(), grid.values.len()), (500, 500, 250_000));
        assert_eq!((grid.x[0], grid.frequency_hz[0]), (1.0, 5.0)); // columns 0 and 1, lines 1 to 4
        assert_eq!(grid.values[0], Some(0.5 * 2.5));
        assert_eq!((grid.x_edges, grid.frequency_edges_hz), ((0.0, 1000.0), (1.0, 4001.0)));
    }
}
