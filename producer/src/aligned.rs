//! Arrays that begin at a cache line.

use aligned_vec::{AVec, CACHELINE_ALIGN};

/// A copy of `numbers` that begins at a cache line.
pub(crate) fn aligned(numbers: &[f64]) -> AVec<f64> {
    AVec::from_slice(CACHELINE_ALIGN, numbers)
}
