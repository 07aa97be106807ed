//! Arrays that begin at a cache line and have whole groups.

use schemas::contact::BLOCK;
use std::ops::{Deref, DerefMut};

/// Bytes of two cache lines, which processors fetch as a pair.
const LINES: usize = 128;

/// Numbers that begin at a cache line: vectors of numbers that lie across two lines take longer to fetch, a sixth of a step.
#[derive(Debug)]
pub(crate) struct Aligned {
    numbers: Vec<f64>,
    /// The place of the first one, at a line.
    start: usize,
}

impl Aligned {
    /// A copy of `numbers`.
    pub(crate) fn of(numbers: &[f64]) -> Self {
        let mut aligned = Self::zeros(numbers.len());
        aligned.copy_from_slice(numbers);
        aligned
    }

    /// So many zeros.
    pub(crate) fn zeros(count: usize) -> Self {
        let room = LINES / size_of::<f64>();
        let mut numbers = vec![0.0; count + room];
        let start = numbers.as_ptr().align_offset(LINES).min(room); // integers
        numbers.truncate(start + count);
        Self { numbers, start }
    }
}

impl Clone for Aligned {
    fn clone(&self) -> Self {
        Self::of(self)
    }
}

impl Deref for Aligned {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.numbers[self.start..]
    }
}

impl DerefMut for Aligned {
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.numbers[self.start..]
    }
}

/// Numbers of the beads of a chain, with room behind them, so that loops in registers need no special case at the end.
///
/// The room takes in one number at least, for a wall; whatever is in it counts for nothing.
#[derive(Debug, Clone)]
pub struct Padded {
    numbers: Aligned,
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
        Self { numbers: Aligned::zeros(with_room(count)), count }
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
