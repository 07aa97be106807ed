//! Random numbers by index: Philox4x32-10, a counter-based generator. The number of an index depends on
//! (seed, stream, index) and on nothing drawn before, so that any program can make any one of them alone.
//!
//! # Source
//! J. K. Salmon, M. A. Moraes, R. O. Dror and D. E. Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC'11 (2011), article 16,
//! DOI 10.1145/2063384.2063405; the known answers are those of the authors' Random123 (`kat_vectors`).

/// Multipliers of a round.
const MULTIPLIERS: [u32; 2] = [0xD251_1F53, 0xCD9E_8D57];
/// Increments of the key from one round to the next.
const WEYL: [u32; 2] = [0x9E37_79B9, 0xBB67_AE85];
const ROUNDS: u32 = 10;

/// The four words of a counter under a key.
///
/// A round makes of the counter `(c0, c1, c2, c3)` and the key `(k0, k1)`, with `high` and `low` words of the 64-bit products:
/// `(high(M1·c2) ⊕ c1 ⊕ k0, low(M1·c2), high(M0·c0) ⊕ c3 ⊕ k1, low(M0·c0))`; between rounds the key grows by `WEYL`.
///
/// ```
/// use schemas::philox::philox4x32;
/// assert_eq!(philox4x32([0, 0], [0; 4]), [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]);
/// ```
#[must_use]
#[inline(always)]
pub fn philox4x32(key: [u32; 2], counter: [u32; 4]) -> [u32; 4] {
    let mut key = key;
    let mut words = counter;
    for round in 0..ROUNDS {
        if round > 0 {
            key = [key[0].wrapping_add(WEYL[0]), key[1].wrapping_add(WEYL[1])];
        }
        let [low_0, high_0] = halves(u64::from(MULTIPLIERS[0]) * u64::from(words[0]));
        let [low_1, high_1] = halves(u64::from(MULTIPLIERS[1]) * u64::from(words[2]));
        words = [high_1 ^ words[1] ^ key[0], low_1, high_0 ^ words[3] ^ key[1], low_0];
    }
    words
}

/// The four words of an index in a stream of a seed: the key is the seed (low word, high word), the counter is the index (low word,
/// high word) and the stream.
#[must_use]
#[inline(always)]
pub fn words(seed: u64, index: u64, stream: [u32; 2]) -> [u32; 4] {
    let ([index_low, index_high], [first, second]) = (halves(index), stream);
    philox4x32(halves(seed), [index_low, index_high, first, second])
}

/// A number in `[0, 1)`, a multiple of 2⁻⁵³: `((w0 ≫ 5)·2²⁶ + (w1 ≫ 6)) / 2⁵³` of the first two [`words`], exact in a double.
///
/// ```
/// use schemas::philox::uniform;
/// let w0 = 0x6627_e8d5_u64 >> 5;
/// let w1 = 0xe169_c58d_u64 >> 6;
/// assert_eq!(uniform(0, 0, 0), (w0 * 67_108_864 + w1) as f64 / 9_007_199_254_740_992.0);
/// ```
#[must_use]
#[expect(clippy::cast_precision_loss, reason = "53 bits are exact in a double")]
pub fn uniform(seed: u64, stream: u32, index: u64) -> f64 {
    let [first, second, ..] = words(seed, index, [stream, 0]);
    let bits = ((u64::from(first) >> 5) << 26) + (u64::from(second) >> 6);
    bits as f64 / (1_u64 << 53) as f64
}

/// The low and the high word.
#[expect(clippy::cast_possible_truncation, reason = "words are what is wanted")]
#[inline(always)]
pub fn halves(value: u64) -> [u32; 2] {
    [value as u32, (value >> 32) as u32]
}

#[cfg(test)]
mod tests {
    use super::{philox4x32, uniform, words};

    /// `philox4x32 10` in `tests/kat_vectors` of Random123.
    #[test]
    fn the_published_answers_are_met() {
        assert_eq!(philox4x32([0; 2], [0; 4]), [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]);
        assert_eq!(
            philox4x32([u32::MAX; 2], [u32::MAX; 4]),
            [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]
        );
        assert_eq!(
            philox4x32([0xa409_3822, 0x299f_31d0], [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344]),
            [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1]
        );
    }

    #[test]
    fn seed_index_and_stream_stand_where_they_are_said_to() {
        let seed = 0x299f_31d0_a409_3822;
        let index = 0x85a3_08d3_243f_6a88;
        assert_eq!(
            words(seed, index, [0x1319_8a2e, 0x0370_7344]),
            philox4x32([0xa409_3822, 0x299f_31d0], [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344])
        );
    }

    /// The mean of n uniform numbers has a standard deviation of √(1/12n): 0.0029 here; the seed is fixed, so the test is, too.
    #[test]
    fn uniform_numbers_fill_the_interval() {
        let count = 10_000_u32;
        let numbers: Vec<f64> = (0..u64::from(count)).map(|index| uniform(7, 3, index)).collect();
        assert!(numbers.iter().all(|number| (0.0..1.0).contains(number)));
        let mean = numbers.iter().sum::<f64>() / f64::from(count);
        assert!((mean - 0.5).abs() < 0.01, "{mean}");
    }
}
