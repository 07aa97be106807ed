//! Roots of registers, found by multiply-adds beside the unit that divides.
//!
//! A correctly rounded root has one answer, however it is found. So this is the one module that may use fused multiply-add.

use crate::simd::{in_vectors, load, store};
use pulp::{Arch, Simd, WithSimd};
#[cfg(target_arch = "x86_64")]
use pulp::{bytemuck, f64x8, x86::V4};
use std::hint::black_box;
use std::sync::LazyLock;
use std::time::Instant;

/// The registers whose roots are found by multiply-adds, where there is an estimate to begin with (AVX-512).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ByMultiplyAdds {
    /// None: the unit that divides finds all roots.
    None,
    /// Every other one: both units work side by side.
    EveryOther,
    /// All.
    All,
}

impl ByMultiplyAdds {
    /// The choice that is faster on this machine, made once. What a loop over beads computes beside roots keeps the multipliers busy, too: so they
    /// take a share if they alone take less than 0.6 of the time of the other unit.
    pub(crate) fn measured() -> Self {
        static MEASURED: LazyLock<ByMultiplyAdds> = LazyLock::new(|| {
            let [all, none] = [ByMultiplyAdds::All, ByMultiplyAdds::None].map(|by_multiply_adds| {
                let mut numbers = [2.0; 256];
                let times = (0..16).map(|_| {
                    let began = Instant::now();
                    for _ in 0..8 {
                        in_vectors(Arch::new(), Roots { by_multiply_adds, numbers: black_box(&mut numbers) });
                    }
                    began.elapsed()
                });
                times.min().unwrap_or_default()
            });
            if all < none.mul_f64(0.6) { ByMultiplyAdds::EveryOther } else { ByMultiplyAdds::None }
        });
        *MEASURED
    }

    /// The roots of `numbers` that are 0 or from `2^−900` on, and anything for others, in the register with this number.
    #[inline(always)]
    pub(crate) fn root<S: Simd>(self, simd: S, numbers: S::f64s, register: usize) -> S::f64s {
        #[cfg(target_arch = "x86_64")]
        if (self == Self::All || self == Self::EveryOther && register.is_multiple_of(2))
            && let Some(wide) = (&simd as &dyn std::any::Any).downcast_ref::<V4>()
        {
            return bytemuck::cast(by_multiply_adds(*wide, bytemuck::cast(numbers)));
        }
        let _ = register;
        simd.sqrt_f64s(numbers)
    }
}

/// Writes roots over numbers.
struct Roots<'a> {
    by_multiply_adds: ByMultiplyAdds,
    numbers: &'a mut [f64],
}

impl WithSimd for Roots<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        for at in (0..self.numbers.len()).step_by(S::F64_LANES) {
            let roots = self.by_multiply_adds.root(simd, load::<S>(self.numbers, at), 0);
            store::<S>(roots, self.numbers, at);
        }
    }
}

/// Two steps of Newton's for `g ≈ √x` and `h ≈ 1/(2·√x)`, then one with the exact remainder `x − g²`.
///
/// # Source
/// P. Markstein, IBM J. Res. Dev. 34 (1990) 111, doi:10.1147/rd.341.0111.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn by_multiply_adds(simd: V4, x: f64x8) -> f64x8 {
    let half = simd.splat_f64x8(0.5);
    // to 14 binary digits
    let estimate = pulp::cast(simd.avx512f._mm512_rsqrt14_pd(pulp::cast(x)));
    let (mut g, mut h) = (simd.mul_f64x8(x, estimate), simd.mul_f64x8(half, estimate));
    for _ in 0..2 {
        let error = simd.negate_mul_add_f64x8(g, h, half);
        g = simd.mul_add_f64x8(g, error, g);
        h = simd.mul_add_f64x8(h, error, h);
    }
    let root = simd.mul_add_f64x8(simd.negate_mul_add_f64x8(g, g, x), h, g);
    // 0 and infinity, which have themselves as roots, lead to what is not a number
    simd.select_f64x8(simd.cmp_eq_f64x8(root, root), root, x)
}

#[cfg(test)]
mod tests {
    use super::*;
    fn assert_are_roots(numbers: &[f64]) {
        let mut found = numbers.to_vec();
        in_vectors(Arch::new(), Roots { by_multiply_adds: ByMultiplyAdds::All, numbers: &mut found });
        for (number, found) in numbers.iter().zip(found) {
            assert_eq!(found.to_bits(), number.sqrt().to_bits(), "√{number:e}");
        }
    }

    /// Numbers of any size, next to squares, and next to squares of numbers half-way between two doubles, where rounding is hardest.
    /// `BEADLINE_ROOTS=1000000000` tries so many.
    #[test]
    fn roots_have_the_bits_of_the_instruction() {
        let tries =
            std::env::var("BEADLINE_ROOTS").map_or(10_000_000_u64, |tries| tries.parse().expect("a number"));
        let mut numbers = [0.0; 24];
        for n in 0..tries / 24 {
            for (case, three) in (8 * n..).zip(numbers.as_chunks_mut::<3>().0) {
                // a Weyl sequence, scrambled
                let random = case.wrapping_mul(0x9e37_79b9_7f4a_7c15);
                let random = (random ^ random >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                let random = random ^ random >> 27;
                let any = f64::from_bits((124 + (random >> 52) % 1922) << 52 | random & ((1 << 52) - 1));
                let short = ((random >> 37) as f64 + 2.0).powi(2);
                let half_way = u128::from(random >> 11 | 1 << 52) * 2 + 1;
                let near = |x: f64, by: u64| f64::from_bits(x.to_bits() + random % by - by / 2);
                *three = [any, near(short, 3), near((half_way * half_way) as f64, 5)];
            }
            assert_are_roots(&numbers);
        }
    }

    #[test]
    fn roots_end_as_those_of_the_instruction() {
        let least = 2.0_f64.powi(-900);
        assert_are_roots(&[
            0.0,
            f64::INFINITY,
            f64::MAX,
            f64::MAX.next_down(),
            least,
            least.next_up(),
            1.0,
            4.0,
        ]);
    }
}
