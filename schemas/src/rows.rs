//! The rows of `extra` in a frame, N values each.

/// The rows of a run's `extra`, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[expect(clippy::struct_excessive_bools, reason = "each is a row, which is there or not")]
pub struct Rows {
    /// Terms of the motion that the method carries: `gear5` has four.
    pub of_method: usize,
    /// True if resonators have two rows: their displacements (m), their velocities (m/s).
    pub resonators: bool,
    /// True if there is a row of the dissipated work (J). Value i is the work of contact i and of the drag of bead i; the last value is
    /// that of the walls, or of the contact that closes a ring, and of the drag of the last bead.
    pub work: bool,
    /// True if there is a row of the drives: value 2d is the work (J) that drive d has done, 2d + 1 the displacement (m) of
    /// the wall or bead that it moves.
    pub drives: bool,
    /// True if there is a row of the heat (J) that baths have given: value i to bead i, or by a bath of pairs in contact i.
    pub heat: bool,
}

impl Rows {
    /// Number of rows.
    pub fn count(&self) -> usize {
        self.before_heat() + usize::from(self.heat)
    }

    /// The row of `extra` that begins `after` rows of N values behind those of the method; empty unless `is_there`.
    fn row<'a>(&self, extra: &'a [f64], after: usize, is_there: bool) -> &'a [f64] {
        let n = if is_there { extra.len() / self.count() } else { 0 };
        let start = (self.of_method + after) * n;
        &extra[start..start + n]
    }

    /// Displacements (m) and velocities (m/s) of the resonators, N values each, or none.
    pub fn resonators_of<'a>(&self, extra: &'a [f64]) -> [&'a [f64]; 2] {
        [self.row(extra, 0, self.resonators), self.row(extra, 1, self.resonators)]
    }

    /// Number of rows between those of the method and the row of the dissipated work.
    fn before_work(self) -> usize {
        2 * usize::from(self.resonators)
    }

    /// The work (J) that was dissipated at each place, N values, or none.
    pub fn work_of<'a>(&self, extra: &'a [f64]) -> &'a [f64] {
        self.row(extra, self.before_work(), self.work)
    }

    /// The row of the drives, N values, or none.
    pub fn drives_of<'a>(&self, extra: &'a [f64]) -> &'a [f64] {
        self.row(extra, self.before_work() + usize::from(self.work), self.drives)
    }

    /// Number of rows before that of the heat, which is the last one.
    fn before_heat(self) -> usize {
        self.of_method + self.before_work() + usize::from(self.work) + usize::from(self.drives)
    }

    /// The heat (J) that baths have given at each place, N values, or none.
    pub fn heat_of<'a>(&self, extra: &'a [f64]) -> &'a [f64] {
        self.row(extra, self.before_heat() - self.of_method, self.heat)
    }

    /// [`heat_of`](Self::heat_of), to write to.
    pub fn heat_mut<'a>(&self, extra: &'a mut [f64]) -> &'a mut [f64] {
        let start = extra.len() - self.heat_of(extra).len();
        &mut extra[start..]
    }

    /// The rows before that, to write to: resonators (displacements, velocities), work, drives.
    pub fn split_mut<'a>(&self, extra: &'a mut [f64]) -> [&'a mut [f64]; 4] {
        let n = if self.count() > 0 { extra.len() / self.count() } else { 0 };
        let rest = &mut extra[self.of_method * n..];
        let of = |is_there: bool| if is_there { n } else { 0 };
        let (w_m, rest) = rest.split_at_mut(of(self.resonators));
        let (w_m_s, rest) = rest.split_at_mut(of(self.resonators));
        let (work_j, rest) = rest.split_at_mut(of(self.work));
        [w_m, w_m_s, work_j, &mut rest[..of(self.drives)]]
    }
}
