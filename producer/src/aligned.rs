//! Arrays that begin at a cache line and have whole groups.

use aligned_vec::{AVec, avec};
use schemas::contact::BLOCK;
use std::ops::{Deref, DerefMut};

/// Numbers of the beads of a chain, with room behind them, so that loops in registers need no special case at the end.
///
/// It begins at a cache line: vectors of numbers that lie across two lines take longer to fetch, a sixth of a step. The room takes in
/// one number at least, for a wall; whatever is in it counts for nothing.
#[derive(Debug, Clone)]
pub struct Padded {
    numbers: AVec<f64>,
    count: usize,
}

impl Padded {
    /// A copy of `numbers`.
    pub fn of(numbers: &[f64]) -> Self {
        let mut padded = Self::zeros(numbers.len());
        padded.copy_from_slice(numbers);
        padded
    }

    /// So many zeros.
    pub(crate) fn zeros(count: usize) -> Self {
        Self { numbers: avec![0.0; with_room(count)], count }
    }

    /// All numbers, those behind the last bead among them.
    pub(crate) fn whole(&mut self) -> &mut [f64] {
        &mut self.numbers
    }
}

/// Length of an array for `count` numbers of beads.
pub(crate) fn with_room(count: usize) -> usize {
    (count + 1).next_multiple_of(BLOCK)
}

impl Deref for Padded {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.numbers[..self.count]
    }
}

impl DerefMut for Padded {
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.numbers[..self.count]
    }
}

impl PartialEq for Padded {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}
