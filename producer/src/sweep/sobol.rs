//! Sobol points: they fill a cube of up to 16 sides evenly, for any number of points.
//!
//! Side `d` of point `n` is the exclusive or of the direction numbers `v_k` of that side for every bit `k` that is set in `n`:
//! `v_k = m_k·2^(32 − k)` for k = 1, 2, …, where for a side of the polynomial `x^s + a₁·x^(s−1) + … + a_(s−1)·x + 1`
//! `m_k = 2·a₁·m_(k−1) ⊕ 2²·a₂·m_(k−2) ⊕ … ⊕ 2^s·m_(k−s) ⊕ m_(k−s)`, and `m_k = 1` for the first side.
//!
//! # Source
//! I. M. Sobol', USSR Comput. Math. Math. Phys. 7 (1967) 86, DOI 10.1016/0041-5553(67)90144-9; the polynomials and first numbers are those
//! of S. Joe and F. Y. Kuo, SIAM J. Sci. Comput. 30 (2008) 2635, DOI 10.1137/070709359, `new-joe-kuo-6.21201`, sides 2 to 16.

/// Most sides of the cube.
pub(super) const MOST_SIDES: usize = 16;

/// Bits of a number.
pub(super) const BITS: usize = 32;

/// The polynomial's inner coefficients as bits, and the first direction numbers, of the second side and those after it.
const SIDES: [(u32, &[u32]); MOST_SIDES - 1] = [
    (0, &[1]),
    (1, &[1, 3]),
    (1, &[1, 3, 1]),
    (2, &[1, 1, 1]),
    (1, &[1, 1, 3, 3]),
    (4, &[1, 3, 5, 13]),
    (2, &[1, 1, 5, 5, 17]),
    (4, &[1, 1, 5, 5, 5]),
    (7, &[1, 1, 7, 11, 19]),
    (11, &[1, 1, 5, 1, 1]),
    (13, &[1, 1, 1, 3, 11]),
    (14, &[1, 3, 5, 5, 31]),
    (1, &[1, 3, 3, 9, 7, 49]),
    (13, &[1, 1, 1, 15, 21, 21]),
    (16, &[1, 3, 1, 13, 27, 49]),
];

/// The direction numbers of side `side`, which is below [`MOST_SIDES`].
pub(super) fn directions(side: usize) -> [u32; BITS] {
    let mut numbers = [1_u32; BITS];
    if let Some((coefficients, first)) = side.checked_sub(1).and_then(|side| SIDES.get(side)) {
        let degree = first.len();
        numbers[..degree].copy_from_slice(first);
        for k in degree..BITS {
            let mut number = numbers[k - degree] ^ (numbers[k - degree] << degree);
            for back in 1..degree {
                if coefficients >> (degree - 1 - back) & 1 == 1 {
                    number ^= numbers[k - back] << back;
                }
            }
            numbers[k] = number;
        }
    }
    for (k, number) in numbers.iter_mut().enumerate() {
        *number <<= BITS - 1 - k;
    }
    numbers
}

/// Point `index` on the side of these directions, as a fraction of 2³².
pub(super) fn point(directions: &[u32; BITS], index: u32) -> u32 {
    let set = directions.iter().enumerate().filter(|(bit, _)| index >> bit & 1 == 1);
    set.fold(0, |point, (_, direction)| point ^ direction)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first eight points of the first three sides, as every description of the sequence prints them (in another order:
    /// that of the Gray code).
    #[test]
    fn the_first_points_are_the_published_ones() {
        let expected: [[f64; 3]; 8] = [
            [0.0, 0.0, 0.0],
            [0.5, 0.5, 0.5],
            [0.25, 0.75, 0.75],
            [0.75, 0.25, 0.25],
            [0.125, 0.625, 0.375],
            [0.625, 0.125, 0.875],
            [0.375, 0.375, 0.625],
            [0.875, 0.875, 0.125],
        ];
        for (index, expected) in (0..).zip(expected) {
            let found = [0, 1, 2].map(|side| f64::from(point(&directions(side), index)) / 4_294_967_296.0);
            assert_eq!(found, expected, "point {index}");
        }
    }

    /// The condition on the table: each side has one of 2^k points in each of 2^k equal parts.
    #[test]
    fn every_side_is_filled_evenly() {
        for side in 0..MOST_SIDES {
            let directions = directions(side);
            let mut parts: Vec<u32> = (0..1024).map(|index| point(&directions, index) >> 22).collect();
            parts.sort_unstable();
            assert!(parts.iter().copied().eq(0..1024), "side {side}");
        }
    }

    /// Property A of Sobol', which Joe and Kuo's table has for its sides: of 2^d points one is in each of the 2^d halves of halves.
    #[test]
    fn all_sides_together_are_filled_evenly() {
        for sides in 1..=MOST_SIDES {
            let directions: Vec<_> = (0..sides).map(directions).collect();
            let mut seen = vec![false; 1 << sides];
            for index in 0..1_u32 << sides {
                let halves = directions.iter().map(|side| point(side, index) >> 31);
                let place = halves.fold(0_usize, |place, half| place << 1 | usize::from(half == 1));
                assert!(!std::mem::replace(&mut seen[place], true), "{sides} sides, point {index}");
            }
        }
    }
}
