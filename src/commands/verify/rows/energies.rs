//! Rows of `/energies`: which bead divided the chain, and what the analysis had seen before, is not written in them.

use super::is_same;
use consumers::energies::{Energies, EnergyRow, default_split_bead};
use producer::state::ChainState;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;

/// Places of the columns that depend on the split bead: left, split, right, inbound.
const OF_SPLIT: [usize; 4] = [3, 4, 5, 8];

/// Place of the column that depends on earlier frames, too.
const CORRECTED: usize = 9;

/// Most beads of a chain in which another split bead is looked for: the time for that grows with their square.
const MOST_BEADS: u64 = 20_000;

/// The analysis beside its rows.
#[expect(clippy::struct_excessive_bools, reason = "each tells of the rows by itself")]
pub(super) struct EnergyRows {
    split: u64,
    /// Analyses since the first frame there is, and since the first row.
    since: [Energies; 2],
    has_begun: bool,
    /// Step of the first frame there is.
    first_step: Option<u64>,
    /// Which of the two the corrected energies may be of, or of an analysis that came after the pulse had arrived.
    possible: [bool; 3],
    inconsistent_from: Option<(u64, bool)>,
    /// True if a frame between two rows had none: the analysis may have missed it.
    has_gap: bool,
    /// True if a column that depends on the split bead has differed.
    differs_in_split: bool,
    /// True if another column has.
    differs_elsewhere: bool,
    /// The last frame with a row, once one has differed.
    last: Option<(ChainState, [f64; EnergyRow::COLUMNS.len()])>,
}

impl EnergyRows {
    pub(super) fn of(manifest: &RunManifest) -> Self {
        Self::new(manifest, default_split_bead(manifest))
    }

    pub(super) fn new(manifest: &RunManifest, split: u64) -> Self {
        let energies = Energies::new(manifest, split);
        Self {
            split,
            since: [energies.clone(), energies],
            has_begun: false,
            first_step: None,
            possible: [true; 3],
            inconsistent_from: None,
            has_gap: false,
            differs_in_split: false,
            differs_elsewhere: false,
            last: None,
        }
    }

    /// The error in the row of `frame`, which has values of these names; none if the row is right.
    pub(super) fn take_named(&mut self, frame: &Frame<'_>, names: &[&str], values: &[f64]) -> Option<String> {
        if !EnergyRow::COLUMNS.starts_with(names) {
            return Some(format!("it has the columns {}", names.join(",")));
        }
        // rows of schema version 1.0 know nothing of drives
        self.take(frame, Some(&std::array::from_fn(|at| values.get(at).copied().unwrap_or(0.0))))
    }

    /// The error in the row of `frame`; none if the row is right, or if the frame should have none and has none.
    pub(super) fn take(
        &mut self,
        frame: &Frame<'_>,
        found: Option<&[f64; EnergyRow::COLUMNS.len()]>,
    ) -> Option<String> {
        self.has_begun |= found.is_some();
        self.first_step.get_or_insert(frame.step);
        let [first, second] = &mut self.since;
        let computed = first.observe(frame).values();
        let since_row = if self.has_begun { second.observe(frame).values() } else { computed };
        self.has_gap |= self.has_begun && found.is_none();
        let found = found?;
        let corrected = found[CORRECTED];
        let is = [computed[CORRECTED], since_row[CORRECTED], f64::NAN].map(|value| is_same(value, corrected));
        for (possible, is) in self.possible.iter_mut().zip(is) {
            *possible &= is;
        }
        if !self.possible.contains(&true) {
            let is_wrong = self.first_step == Some(0) && !self.has_gap;
            self.inconsistent_from.get_or_insert((frame.frame, is_wrong));
        }
        let mut columns = (0..computed.len()).filter(|column| *column != CORRECTED);
        let column = columns.find(|column| !is_same(computed[*column], found[*column]));
        if let Some(column) = column {
            self.differs_in_split |= OF_SPLIT.contains(&column);
            self.differs_elsewhere |= !OF_SPLIT.contains(&column);
        }
        if self.differs_in_split {
            self.last = Some((ChainState::of_frame(frame), *found));
        }
        let column = column?;
        let (name, found, computed) = (EnergyRow::COLUMNS[column], found[column], computed[column]);
        Some(format!("{name} is {found:e}, the state gives {computed:e} with split bead {}", self.split))
    }

    /// The first frame from which on the corrected energies are of no analysis that saw what we do; whether that is wrong,
    /// because we saw all of the run, and the rows are of all of its frames.
    pub(super) fn inconsistent_from(&self) -> Option<(u64, bool)> {
        self.inconsistent_from
    }

    /// Another bead that divides the last frame as its row has it, if rows differ as if there were one.
    pub(super) fn other_split(&self, manifest: &RunManifest) -> Option<u64> {
        let (state, found) = self.last.as_ref()?;
        if self.differs_elsewhere || manifest.physics.beads > MOST_BEADS {
            return None;
        }
        let frame = state.as_frame(manifest, manifest.frame_at(state.step));
        (0..manifest.physics.beads).filter(|split| *split != self.split).find(|split| {
            let computed = Energies::new(manifest, *split).observe(&frame).values();
            (0..CORRECTED).all(|column| is_same(computed[column], found[column]))
        })
    }
}
