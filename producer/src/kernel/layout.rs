//! Places of beads in registers: neighbours along a register, or chains beside each other.

use pulp::{Arch, Simd, WithSimd};
use schemas::simd::{LANES, in_vectors, load};
use std::ops::Mul;

/// Beads that a pass takes together: several registers are on their way at a time.
pub(super) const GROUP: usize = 16;

/// A number of each chain that is computed at once: the same for all lanes, or one for each.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct PerLane(pub(crate) [f64; LANES]);

impl PerLane {
    /// The same number in every lane.
    pub(crate) fn same(number: f64) -> Self {
        Self([number; LANES])
    }

    /// As a register.
    #[inline(always)]
    pub(super) fn load<S: Simd>(&self) -> S::f64s {
        load::<S>(&self.0, 0)
    }
}

impl Mul<f64> for PerLane {
    type Output = Self;

    fn mul(self, factor: f64) -> Self {
        Self(self.0.map(|number| factor * number))
    }
}

/// The arrangement of beads.
pub(super) trait Layout: Copy {
    /// Numbers from a bead to its neighbour on the right.
    fn stride<S: Simd>() -> usize;

    /// The left neighbours of `here`, where `before` is the register before it.
    fn left<S: Simd>(simd: S, before: S::f64s, here: S::f64s) -> S::f64s;

    /// The register before the one that begins at `numbers[at]`.
    fn before<S: Simd>(simd: S, numbers: &[f64], at: usize) -> S::f64s;
}

/// One chain: neighbours lie side by side in a register.
#[derive(Clone, Copy)]
pub(super) struct Along;

impl Layout for Along {
    #[inline(always)]
    fn stride<S: Simd>() -> usize {
        1
    }

    #[inline(always)]
    fn left<S: Simd>(simd: S, before: S::f64s, here: S::f64s) -> S::f64s {
        let is_first = simd.less_than_f64s(load::<S>(&COUNTED, 0), simd.splat_f64s(1.0));
        simd.select_f64s(is_first, simd.rotate_right_f64s(before, 1), simd.rotate_right_f64s(here, 1))
    }

    #[inline(always)]
    fn before<S: Simd>(simd: S, numbers: &[f64], at: usize) -> S::f64s {
        simd.splat_f64s(numbers[at - 1])
    }
}

/// Several chains: a register has the same bead of each.
#[derive(Clone, Copy)]
pub(super) struct Across;

impl Layout for Across {
    #[inline(always)]
    fn stride<S: Simd>() -> usize {
        S::F64_LANES
    }

    #[inline(always)]
    fn left<S: Simd>(_: S, before: S::f64s, _: S::f64s) -> S::f64s {
        before
    }

    #[inline(always)]
    fn before<S: Simd>(_: S, numbers: &[f64], at: usize) -> S::f64s {
        load::<S>(numbers, at - S::F64_LANES)
    }
}

/// Numbers of a register: chains that lie [`Across`].
pub(crate) fn lanes(arch: Arch) -> usize {
    struct Count;
    impl WithSimd for Count {
        type Output = usize;

        #[inline(always)]
        fn with_simd<S: Simd>(self, _: S) -> usize {
            S::F64_LANES
        }
    }
    in_vectors(arch, Count)
}

/// The numbers from 0 on.
pub(super) const COUNTED: [f64; GROUP] = {
    let (mut counted, mut n) = ([0.0; GROUP], 0);
    while n < GROUP {
        counted[n] = n as f64;
        n += 1;
    }
    counted
};
