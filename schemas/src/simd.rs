//! Loops that are compiled for every width of SIMD registers and give the same bits at each.

use pulp::{Arch, NullaryFnOnce, Scalar128b, Simd, WithSimd, bytemuck};

/// The most doubles that a register has.
pub const LANES: usize = 8;

/// Neighbouring numbers that a loop takes together, in registers.
#[derive(Debug, Clone, Copy)]
#[repr(C, align(64))]
pub struct Group<const G: usize>(pub [f64; G]);

/// Runs `work` with the vectors of `arch`, which it names in its loops.
#[inline(always)]
pub fn in_vectors<W: WithSimd>(arch: Arch, work: W) -> W::Output {
    /// The loops are long: they are compiled once, not in each caller.
    #[inline(never)]
    fn in_pairs<W: WithSimd>(work: W) -> W::Output {
        work.with_simd(Scalar128b)
    }
    match arch {
        Arch::Scalar => in_pairs(work),
        arch => arch.dispatch(work),
    }
}

/// The vector that begins at `numbers[at]`.
#[inline(always)]
pub fn load<S: Simd>(numbers: &[f64], at: usize) -> S::f64s {
    bytemuck::pod_read_unaligned(bytemuck::cast_slice(&numbers[at..at + S::F64_LANES]))
}

/// Writes `vector` from `numbers[at]` on.
#[inline(always)]
pub fn store<S: Simd>(vector: S::f64s, numbers: &mut [f64], at: usize) {
    let to = &mut numbers[at..at + S::F64_LANES];
    bytemuck::cast_slice_mut::<f64, u8>(to).copy_from_slice(bytemuck::bytes_of(&vector));
}

/// `numbers` where they are above `bound`, 0 elsewhere.
#[inline(always)]
pub fn above<S: Simd>(simd: S, numbers: S::f64s, bound: S::f64s) -> S::f64s {
    simd.select_f64s(simd.greater_than_f64s(numbers, bound), numbers, simd.splat_f64s(0.0))
}

/// Runs `work` with the instructions of `arch`: the closure, and all that it inlines, is compiled for each.
///
/// Write `#[inline(always)]` before the closure and each function in it with a loop: a function that is not inlined is
/// compiled for any machine, without wide vectors.
///
/// ```
/// let sum = schemas::simd::vectorized(
///     pulp::Arch::new(),
///     #[inline(always)]
///     || schemas::simd::ordered_sum([&[1.0, 2.0, 3.0]], |[x]| x * x),
/// );
/// assert_eq!(sum, 14.0);
/// ```
pub fn vectorized<R>(arch: Arch, work: impl FnOnce() -> R) -> R {
    // A closure given to `dispatch` itself may be called through a function of the compiler's that is not inlined:
    // here it is known to be called once.
    struct Work<F>(F);
    impl<R, F: FnOnce() -> R> NullaryFnOnce for Work<F> {
        type Output = R;
        #[inline(always)]
        fn call(self) -> R {
            (self.0)()
        }
    }
    arch.dispatch(Work(work))
}

/// Slices cut to `count` numbers: in [`vectorized`] one check for each slice instead of one for each number.
#[inline(always)]
pub fn cut<const K: usize>(slices: [&[f64]; K], count: usize) -> [&[f64]; K] {
    slices.map(
        #[inline(always)]
        |slice| &slice[..count],
    )
}

/// `Σ term([a[i], b[i], …])` over slices `[a, b, …]` of one length, in an order that is the same at any width:
/// eight interleaved partial sums, added up in pairs.
///
/// ```
/// let x: Vec<f64> = (0..10).map(f64::from).collect();
/// assert_eq!(schemas::simd::ordered_sum([&x], |[x]| x), 45.0);
/// ```
#[inline(always)]
pub fn ordered_sum<const K: usize>(slices: [&[f64]; K], term: impl Fn([f64; K]) -> f64) -> f64 {
    let count = slices.first().map_or(0, |slice| slice.len());
    // one check for each slice instead of one for each number
    let slices = slices.map(
        #[inline(always)]
        |slice| slice[..count].as_chunks::<8>(),
    );
    let mut partial = [0.0; 8];
    for chunk in 0..count / 8 {
        let lanes = slices.map(
            #[inline(always)]
            |(chunks, _)| &chunks[chunk],
        );
        for lane in 0..8 {
            partial[lane] += term(lanes.map(
                #[inline(always)]
                |numbers| numbers[lane],
            ));
        }
    }
    for lane in 0..count % 8 {
        partial[lane] += term(slices.map(
            #[inline(always)]
            |(_, rest)| rest[lane],
        ));
    }
    let [a, b, c, d, e, f, g, h] = partial;
    ((a + e) + (c + g)) + ((b + f) + (d + h))
}
