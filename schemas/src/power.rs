//! The project's own powers, the same bits on every machine.
//!
//! Platform `pow` differs between C libraries and their versions, so nothing that decides bits calls it. The dynamics has
//! one exponent for a run and takes its powers from a [`PowerTable`], with `+ − × ÷`, each rounded once. Tables and
//! configurations are made with [`power`], by integers.

mod fixed;
mod table;

use fixed::Power;
pub(crate) use table::bounds;
pub use table::{PowerTable, Powers};

/// `x^exponent` for `x` of 0 or more and a finite exponent: rounded to 90 binary digits, and these to a double; NaN for any other `x`
/// or exponent.
///
/// It is `+0` below `2^−1021` and `+∞` from `2^1023` on, and takes about a microsecond.
///
/// ```
/// assert_eq!(schemas::power::power(4.0, 2.5), 32.0);
/// assert_eq!(schemas::power::power(0.0, 2.5), 0.0);
/// ```
pub fn power(x: f64, exponent: f64) -> f64 {
    let is_number = x >= 0.0 && exponent.is_finite();
    if !is_number || x == 0.0 || x == f64::INFINITY {
        return match (is_number, exponent == 0.0) {
            (false, _) => f64::NAN,
            (true, true) => 1.0,
            (true, false) if (x == 0.0) == (exponent > 0.0) => 0.0,
            (true, false) => f64::INFINITY,
        };
    }
    let beyond = if (x < 1.0) == (exponent > 0.0) { 0.0 } else { f64::INFINITY };
    Power::of(x, exponent).filter(Power::is_normal).map_or(beyond, |power| power.in_two_doubles()[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Arbitrary-precision values (`tests/reference/powers.py`), over overlaps from 1e-290 m up and close to 1.
    #[test]
    fn both_powers_are_next_to_the_exact_one() {
        let reference = include_str!("../../tests/reference/powers.csv");
        let double = |bits: &str| f64::from_bits(u64::from_str_radix(bits, 16).expect("16 hex digits"));
        let (mut rows, mut worst, mut worst_of_tables) = (0, 0.0_f64, 0.0_f64);
        for line in reference.lines().skip(1) {
            let fields: Vec<&str> = line.split(',').collect();
            let (x, exponent, nearest) = (double(fields[0]), double(fields[1]), double(fields[2]));
            let remainder: f64 = fields[3].parse().expect("a number");
            // both are normal doubles a few ulp apart, so the difference of their bits counts ulps
            let error = |found: f64| {
                let ulps = found.to_bits().wrapping_sub(nearest.to_bits()).cast_signed();
                (ulps as f64 - remainder).abs()
            };
            worst = worst.max(error(power(x, exponent)));
            let table = PowerTable::shared(exponent);
            if x > table.zero_up_to() && x < bounds(exponent)[1] {
                worst_of_tables = worst_of_tables.max(error(table.powers().raise_one(x)));
                rows += 1;
            }
        }
        assert!(rows > 1000, "{rows} rows");
        assert!(worst <= 0.5, "{worst} ulp");
        assert!(worst_of_tables < 0.7, "{worst_of_tables} ulp");
    }

    /// Against 90 digits, which `tests/python/kernel.py` finds in another way, at random overlaps from bound to bound.
    /// `BEADLINE_POWERS=10000000` tries so many for each α; `--nocapture` names the worst.
    #[test]
    fn a_table_is_within_0_7_ulp() {
        let tries =
            std::env::var("BEADLINE_POWERS").map_or(20_000_u64, |tries| tries.parse().expect("a number"));
        for alpha in [1.01, 1.1, 1.3, 1.7, 2.5, 4.6, 5.5, 10.0, 31.7, 511.0, 677.0, 1000.0] {
            let table = PowerTable::shared(alpha);
            let (powers, mut worst, mut worst_at) = (table.powers(), 0.0, 0.0);
            let (first, end) = (table.zero_up_to().to_bits() + 1, bounds(alpha)[1].to_bits());
            for n in 1..=tries {
                // a Weyl sequence, scrambled: bits of doubles are nearly uniform in their logarithms
                let random = n.wrapping_mul(0x9e37_79b9_7f4a_7c15);
                let random = (random ^ random >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
                let x = f64::from_bits(first + (random ^ random >> 27) % (end - first));
                let [high, low] = Power::of(x, alpha).expect("within the bounds").in_two_doubles();
                let error = ((powers.raise_one(x) - high) - low).abs() / (high.next_up() - high);
                if error > worst {
                    (worst, worst_at) = (error, x);
                }
            }
            println!("α = {alpha}: {worst:.4} ulp at {worst_at:e}");
            assert!(worst < 0.7, "α = {alpha}: {worst} ulp at {worst_at:e}");
        }
    }

    #[test]
    fn powers_of_two_are_exact() {
        for e in (-200_i32..200).step_by(2) {
            assert_eq!(power(2.0_f64.powi(e), 2.5), 2.0_f64.powf(2.5 * f64::from(e)));
            assert_eq!(power(2.0_f64.powi(e), 1.0), 2.0_f64.powi(e));
        }
    }

    #[test]
    fn one_to_any_power_is_one() {
        for exponent in [1.0, 1.3, 400.0] {
            assert_eq!(power(1.0, exponent), 1.0);
        }
    }

    /// A displacement of 0 and an overlap beyond all doubles are numbers that configurations lead to.
    #[test]
    fn nothing_and_infinity_have_powers() {
        assert_eq!([2.5, 0.0, -1.0].map(|exponent| power(0.0, exponent)), [0.0, 1.0, f64::INFINITY]);
        assert_eq!(
            [2.5, 0.0, -1.0].map(|exponent| power(f64::INFINITY, exponent)),
            [f64::INFINITY, 1.0, 0.0]
        );
        assert!(power(-1.0, 2.0).is_nan() && power(f64::NAN, 2.0).is_nan() && power(2.0, f64::NAN).is_nan());
    }

    #[test]
    fn leaves_the_range_without_subnormals() {
        assert_eq!(power(1e-40, 10.0), 0.0);
        assert_eq!(power(1e40, 10.0), f64::INFINITY);
        assert!(power(2.0_f64.powi(-102), 10.0) >= f64::MIN_POSITIVE);
    }

    /// Half-way cases have exact powers, which are no noise of the computation: `3^34` has 54 digits.
    #[test]
    fn exact_powers_are_rounded_to_even() {
        assert_eq!(power(3.0, 33.0), 5_559_060_566_555_523.0);
        assert_eq!(power(3.0, 34.0), 16_677_181_699_666_568.0);
        assert_eq!(power(1.5, -1.0), 1.0 / 1.5);
        assert_eq!(power(f64::MIN_POSITIVE / 4.0, -0.5), 2.0_f64.powi(512));
    }

    #[test]
    fn a_table_ends_without_subnormals() {
        for alpha in [1.01, 1.3, 2.5, 4.0, 5.5, 10.0, 448.0, 1000.0] {
            let table = PowerTable::shared(alpha);
            let (powers, zero_up_to) = (table.powers(), table.zero_up_to());
            assert_eq!(powers.raise_one(zero_up_to).to_bits(), 0, "α = {alpha}");
            assert_eq!(powers.raise_one(-1.0).to_bits(), 0);
            assert_eq!(powers.raise_one(f64::NAN).to_bits(), 0);
            let first = zero_up_to.next_up();
            assert!(powers.raise_one(first) * first >= 2.0_f64.powi(-900), "α = {alpha}");
            let [_, infinite_from] = bounds(alpha);
            assert!(powers.raise_one(infinite_from.next_down()).is_finite(), "α = {alpha}");
            assert_eq!(powers.raise_one(infinite_from), f64::INFINITY);
            assert_eq!(powers.raise_one(f64::INFINITY), f64::INFINITY);
        }
    }

    /// Neighbours where intervals meet: what one ends with is not above what the next begins with.
    #[test]
    fn a_power_never_falls() {
        for alpha in [1.01, 1.1, 1.3, 1.7, 2.5, 4.6, 10.0, 31.7, 511.0, 1000.0] {
            let table = PowerTable::shared(alpha);
            let powers = table.powers();
            let step = 1_u64 << 36; // an interval is a multiple of it
            let first = table.zero_up_to().next_up().to_bits();
            for edge in
                (first..first.saturating_add(1 << 54)).step_by(usize::try_from(step).expect("64 bits"))
            {
                let [below, at, above] =
                    [edge - 1, edge, edge + 1].map(|bits| powers.raise_one(f64::from_bits(bits)));
                assert!(below <= at && at <= above, "α = {alpha} at {:e}", f64::from_bits(edge));
            }
        }
    }

    /// Pins the bits: these change only together with the kernel version. `tests/python/kernel.py` makes the same tables.
    #[test]
    fn bits_are_pinned() {
        for (alpha, pinned) in PINNED {
            let found = PowerTable::shared(alpha).hash();
            assert_eq!(found, pinned, "α = {alpha}: {found:#018x}");
        }
    }
    const PINNED: [(f64, u64); 4] = [
        (1.01, 0x1fb0_49b6_eb51_8178),
        (1.3, 0xe82b_bbe9_8fcb_e5f2),
        (10.0, 0x22d3_4b2b_3623_d00e),
        (1000.0, 0xd011_98a0_6d75_e208),
    ];
}
