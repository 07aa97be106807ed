//! Places of beads in registers: neighbours along a register, or chains beside each other.

use pulp::{Arch, Simd, WithSimd};
#[cfg(target_arch = "x86_64")]
use pulp::{
    bytemuck,
    x86::{V3, V4},
};
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
pub(crate) trait Layout: Copy {
    /// True if neighbours lie in one register.
    const IS_ALONG: bool = false;

    /// Numbers from a bead to its neighbour on the right.
    fn stride<S: Simd>() -> usize;

    /// The left neighbours of `here`, where `before` is the register before it.
    fn left<S: Simd>(simd: S, before: S::f64s, here: S::f64s) -> S::f64s;

    /// The register before the one that begins at `numbers[at]`.
    fn before<S: Simd>(simd: S, numbers: &[f64], at: usize) -> S::f64s;
}

/// One chain: neighbours lie side by side in a register.
#[derive(Clone, Copy)]
pub(crate) struct Along;

impl Layout for Along {
    const IS_ALONG: bool = true;

    #[inline(always)]
    fn stride<S: Simd>() -> usize {
        1
    }

    #[inline(always)]
    fn left<S: Simd>(simd: S, before: S::f64s, here: S::f64s) -> S::f64s {
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = is::<V4>(&simd) {
            let [before, here] = [before, here].map(bytemuck::cast);
            return bytemuck::cast(simd.avx512f._mm512_alignr_epi64::<7>(here, before));
        } else if let Some(simd) = is::<V3>(&simd) {
            let [before, here] = [before, here].map(bytemuck::cast);
            let between = simd.avx2._mm256_permute2x128_si256::<0x21>(before, here);
            return bytemuck::cast(simd.avx2._mm256_alignr_epi8::<8>(here, between));
        }
        let is_first = simd.less_than_f64s(load::<S>(&COUNTED, 0), simd.splat_f64s(1.0));
        simd.select_f64s(is_first, simd.rotate_right_f64s(before, 1), simd.rotate_right_f64s(here, 1))
    }

    #[inline(always)]
    fn before<S: Simd>(simd: S, numbers: &[f64], at: usize) -> S::f64s {
        simd.splat_f64s(numbers[at - 1])
    }
}

/// The right neighbours of `here`, where `next` is the register after it.
#[inline(always)]
pub(crate) fn right<S: Simd>(simd: S, here: S::f64s, next: S::f64s) -> S::f64s {
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = is::<V4>(&simd) {
        let [here, next] = [here, next].map(bytemuck::cast);
        return bytemuck::cast(simd.avx512f._mm512_alignr_epi64::<1>(next, here));
    } else if let Some(simd) = is::<V3>(&simd) {
        let [here, next] = [here, next].map(bytemuck::cast);
        let between = simd.avx2._mm256_permute2x128_si256::<0x21>(here, next);
        return bytemuck::cast(simd.avx2._mm256_alignr_epi8::<8>(between, here));
    }
    let last = simd.splat_f64s((S::F64_LANES - 1) as f64);
    let is_last = simd.greater_than_or_equal_f64s(load::<S>(&COUNTED, 0), last);
    simd.select_f64s(is_last, simd.rotate_left_f64s(next, 1), simd.rotate_left_f64s(here, 1))
}

/// `simd` if it is of the type `T`.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn is<T: Simd>(simd: &dyn std::any::Any) -> Option<T> {
    simd.downcast_ref().copied()
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

/// The next narrower registers.
pub(super) fn narrower(arch: Arch) -> Arch {
    #[cfg(target_arch = "x86_64")]
    if let (Arch::V4(_), Some(narrow)) = (arch, V3::try_new()) {
        return Arch::V3(narrow);
    }
    arch
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
