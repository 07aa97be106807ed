//! Velocities over space and time, as a picture of bounded size.

use schemas::frame::Frame;

/// A picture of the velocities over beads (across) and steps (along). A cell that stands for several beads or
/// frames has the velocity that is largest in magnitude, so that no pulse is lost between pixels.
#[derive(Debug, Clone)]
pub struct VelocityMap {
    step_count: u64,
    bead_count: usize,
    columns: usize,
    rows: usize,
    /// In m/s, row by row, the earliest first.
    cells: Vec<f32>,
}

impl VelocityMap {
    /// The largest number of columns and of rows.
    pub const MAX_SIDE: usize = 1000;

    /// An empty picture for `bead_count` beads over the steps 0 to `step_count`.
    pub fn new(bead_count: usize, step_count: u64) -> Self {
        let columns = bead_count.clamp(1, Self::MAX_SIDE);
        let frames = usize::try_from(step_count.saturating_add(1)).unwrap_or(usize::MAX);
        let rows = frames.clamp(1, Self::MAX_SIDE);
        Self { step_count, bead_count, columns, rows, cells: vec![0.0; columns * rows] }
    }

    /// Enters a frame.
    pub fn push(&mut self, frame: &Frame<'_>) {
        let scaled = u128::from(frame.step) * self.rows as u128 / (u128::from(self.step_count) + 1);
        let row = usize::try_from(scaled).unwrap_or(usize::MAX).min(self.rows - 1);
        let cells = &mut self.cells[row * self.columns..(row + 1) * self.columns];
        let mut begin = 0;
        for (column, cell) in cells.iter_mut().enumerate() {
            let end = (column + 1) * self.bead_count / self.columns;
            for v_m_s in &frame.v_m_s[begin..end] {
                #[expect(clippy::cast_possible_truncation, reason = "seven digits are enough for a colour")]
                let v_m_s = *v_m_s as f32;
                if v_m_s.abs() > cell.abs() {
                    *cell = v_m_s;
                }
            }
            begin = end;
        }
    }

    /// Number of columns.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The velocities (m/s), row by row, the earliest row first; 0 where no frame fell.
    pub fn cells(&self) -> &[f32] {
        &self.cells
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fastest_bead_of_a_cell_is_shown() {
        let (beads, steps) = (2500, 5000);
        let mut map = VelocityMap::new(beads, steps);
        let mut v_m_s = vec![0.0; beads];
        (v_m_s[1234], v_m_s[1235]) = (-2.0, 1.0);
        let u_m = vec![0.0; beads];
        let frame = |step| Frame { frame: step, step, time_s: 0.0, u_m: &u_m, v_m_s: &v_m_s, extra: &[] };
        map.push(&frame(0));
        map.push(&frame(5000));
        assert_eq!((map.columns(), map.rows()), (1000, 1000));
        let filled: Vec<_> = map.cells().iter().enumerate().filter(|(_, v)| **v != 0.0).collect();
        // beads 1234 and 1235 share column 493 of 2.5 beads or are neighbours
        assert_eq!((filled[0], filled.len() % 2), ((493, &-2.0), 0), "{filled:?}");
        assert!(filled[filled.len() / 2].0 >= 999_000);
    }
}
