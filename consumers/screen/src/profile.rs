//! A curve in braille: two dots across and four down in each cell.

use crate::strip::part;

/// The dots of a cell by their column and row, as Unicode counts them.
const DOTS: [[u32; 4]; 2] = [[0x01, 0x02, 0x04, 0x40], [0x08, 0x10, 0x20, 0x80]];

/// Cells row by row, top row first, that show `values` between `low` and `high`. A column of dots reaches from the
/// least to the largest of its values, and to the column before, so that no pulse disappears; zero is drawn where
/// nothing else is.
pub(crate) fn profile(values: &[f64], [low, high]: [f64; 2], columns: usize, rows: usize) -> Vec<Vec<char>> {
    let mut cells = vec![vec![0_u32; columns]; rows];
    let Some(lowest) = (4 * rows).checked_sub(1) else { return Vec::new() };
    let height = if high > low { high - low } else { 1.0 };
    let row = |value: f64| {
        let down = (high - value) / height * lowest as f64;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
        let row = down.round().max(0.0) as usize;
        row.min(lowest)
    };
    let mut before: Option<(usize, usize)> = None;
    for across in 0..2 * columns {
        let seen = values.get(part(across, 2 * columns, values.len())).unwrap_or_default();
        let rows_of = || seen.iter().filter(|value| value.is_finite()).map(|value| row(*value));
        let (Some(top), Some(bottom)) = (rows_of().min(), rows_of().max()) else { continue };
        // integers
        let (from, to) = before.map_or((top, bottom), |(t, b)| (top.min(b), bottom.max(t)));
        for down in from..=to {
            cells[down / 4][across / 2] |= DOTS[across % 2][down % 4];
        }
        before = Some((top, bottom));
    }
    let zero = row(0.0) / 4;
    let cell = |down: usize, dots: u32| match dots {
        0 if down == zero => '┈',
        0 => ' ',
        dots => char::from_u32(0x2800 + dots).unwrap_or(' '),
    };
    cells
        .into_iter()
        .enumerate()
        .map(|(down, row)| row.into_iter().map(|dots| cell(down, dots)).collect())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pulse_of_one_bead_in_many_is_seen() {
        let mut values = vec![0.0; 100_000];
        values[43_210] = 5.0;
        let cells = profile(&values, [0.0, 5.0], 40, 3);
        let tops: Vec<usize> = (0..40).filter(|column| cells[0][*column] != ' ').collect();
        assert_eq!(tops, [43_210 * 40 / 100_000]);
        assert!(cells[2].iter().all(|cell| *cell != ' '), "the rest is at rest");
    }

    #[test]
    fn a_line_has_no_gaps_and_stays_within() {
        let cells = profile(&[-1.0, 1.0], [-1.0, 1.0], 2, 2);
        let text: Vec<String> = cells.iter().map(|row| row.iter().collect()).collect();
        assert_eq!(text, [" ⡏", "⣀⡇"].map(str::to_owned));
        for values in [vec![], vec![f64::NAN, f64::INFINITY, 1e300]] {
            assert_eq!(profile(&values, [0.0, 0.0], 3, 2).len(), 2);
        }
    }
}
