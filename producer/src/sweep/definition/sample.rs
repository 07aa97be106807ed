//! Points drawn from ranges, each value a pure function of (sweep file, index of the sample).
//!
//! Architecture invariant: the values decide the bits of runs, and are computed with reproducible arithmetic only.

use super::super::sobol;
use super::super::values::Interval;
use super::{Located, Reader, Setting, SweepError};
use schemas::config::line_at;
use schemas::philox;
use toml::Table;

/// Streams of random numbers, two for each range: no other use of a seed has them.
const STREAMS: u32 = 0x5341_0000;

/// How points are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Method {
    /// Each on its own.
    Random,
    /// One in each of as many equal parts of each range as there are points, the parts of the ranges in random orders.
    LatinHypercube,
    /// Those of [`sobol`], moved by a random digital shift.
    Sobol,
}

const METHODS: [(&str, Method); 3] =
    [("latin-hypercube", Method::LatinHypercube), ("sobol", Method::Sobol), ("random", Method::Random)];

const KNOWN: [&str; 4] = ["method", "count", "seed", "ranges"];

impl Reader<'_> {
    /// The samples of the table `[sample]`; one that sets nothing where there is none.
    pub(super) fn samples(&self, value: Option<&Located<'_>>) -> Result<Vec<Vec<Setting>>, SweepError> {
        let Some(value) = value else { return Ok(vec![Vec::new()]) };
        let table = self.table(value, "sample")?;
        if let Some((key, _)) = table.iter().find(|(key, _)| !KNOWN.contains(&key.get_ref().as_ref())) {
            let allowed = format!("found an unknown key; allowed: {}", KNOWN.join(", "));
            return Err(self.refuse(key.span().start, &format!("sample.{}", key.get_ref()), allowed));
        }
        let needed = |key: &str, allowed: &str| {
            table.get(key).ok_or_else(|| {
                let message = format!("found nothing; allowed: {allowed}");
                self.refuse(value.span().start, &format!("sample.{key}"), message)
            })
        };
        let names = "\"latin-hypercube\", \"sobol\" or \"random\"";
        let written = needed("method", names)?;
        let name: Option<String> = self.option(Some(written), "sample.method", names)?;
        let known = METHODS.into_iter().find(|(known, _)| Some(*known) == name.as_deref());
        let (_, method) = known.ok_or_else(|| {
            let message = format!("found {}; allowed: {names}", self.written(written));
            self.refuse(written.span().start, "sample.method", message)
        })?;
        let counts = "a whole number from 1 to 100000";
        let written = needed("count", counts)?;
        let count: Option<u32> = self.option(Some(written), "sample.count", counts)?;
        let count = count.filter(|count| (1..=100_000).contains(count)).ok_or_else(|| {
            let message = format!("found {}; allowed: {counts}", self.written(written));
            self.refuse(written.span().start, "sample.count", message)
        })?;
        let seed = self.option(table.get("seed"), "sample.seed", "a whole number from 0")?.unwrap_or(0);
        let ranges = self.ranges(needed("ranges", "keys, each with { from = …, to = … }")?)?;
        if method == Method::Sobol && ranges.len() > sobol::MOST_SIDES {
            let message = format!(
                "found {} ranges; allowed: up to {} with \"sobol\", any number with \"latin-hypercube\"",
                ranges.len(),
                sobol::MOST_SIDES
            );
            return Err(self.refuse(value.span().start, "sample.ranges", message));
        }
        let mut samples = vec![Vec::with_capacity(ranges.len()); count as usize];
        for (side, (blank, interval)) in ranges.iter().enumerate() {
            let fractions = fractions(method, side, count, seed);
            for (sample, fraction) in samples.iter_mut().zip(fractions) {
                sample.push(Setting { value: interval.at(fraction), ..blank.clone() });
            }
        }
        Ok(samples)
    }

    /// The ranges, each with a setting that lacks its value.
    fn ranges(&self, value: &Located<'_>) -> Result<Vec<(Setting, Interval)>, SweepError> {
        let mut entries = Vec::new();
        self.entries("", self.table(value, "sample.ranges")?, &mut entries)?;
        if entries.is_empty() {
            let message = "found no range; write at least one key with { from = …, to = … }".to_owned();
            return Err(self.refuse(value.span().start, "sample.ranges", message));
        }
        let range = |(key, value): (_, &Located<'_>)| {
            let plain = self.plain(value, &format!("{key}"))?;
            let found = plain.as_table().ok_or_else(|| {
                let written = self.written(value);
                format!("found {written}; allowed: a range {{ from = …, to = … }}, with spacing = \"log\" if wanted")
            });
            let interval = found
                .and_then(Interval::read)
                .map_err(|message| self.refuse(value.span().start, &format!("{key}"), message))?;
            let line = line_at(self.text, value.span().start);
            Ok((Setting { key, value: toml::Value::Table(Table::new()), line }, interval))
        };
        entries.into_iter().map(range).collect()
    }
}

/// The places, from 0 to 1, of all samples in range `side`.
fn fractions(method: Method, side: usize, count: u32, seed: u64) -> Vec<f64> {
    let stream = STREAMS + 2 * u32::try_from(side).unwrap_or(0);
    let random = |index: u32| philox::uniform(seed, stream, index.into());
    match method {
        Method::Random => (0..count).map(random).collect(),
        Method::LatinHypercube => {
            let parts = permutation(count, seed, stream + 1);
            let place = |(index, part)| (f64::from(part) + random(index)) / f64::from(count);
            (0..count).zip(parts).map(place).collect()
        }
        Method::Sobol => {
            let [shift, ..] = philox::words(seed, stream, 0);
            let directions = sobol::directions(side);
            // the middle of the cell of 2⁻³²
            let place = |index| (f64::from(sobol::point(&directions, index) ^ shift) + 0.5) / 4_294_967_296.0;
            (0..count).map(place).collect()
        }
    }
}

/// The numbers below `count` in a random order (Fisher and Yates): number `i`, from the last to the second, changes its place with
/// number `⌊r·(i + 1)/2⁶⁴⌋`, where `r` is the first two words of index `i`, low word first.
fn permutation(count: u32, seed: u64, stream: u32) -> Vec<u32> {
    let mut order: Vec<u32> = (0..count).collect();
    for i in (1..order.len()).rev() {
        let [low, high, ..] = philox::words(seed, stream, i as u64);
        let random = u128::from(high) << 32 | u128::from(low);
        let other = (random * (i as u128 + 1)) >> 64;
        order.swap(i, usize::try_from(other).unwrap_or(i));
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What makes a Latin hypercube: one sample in each part of each range.
    #[test]
    fn a_latin_hypercube_has_one_sample_in_each_part() {
        for (side, count) in [(0, 7), (3, 100)] {
            let places = fractions(Method::LatinHypercube, side, count, 5);
            let mut parts: Vec<f64> = places.iter().map(|place| (place * f64::from(count)).floor()).collect();
            assert!(parts.windows(2).any(|pair| pair[1] < pair[0]), "in a random order");
            parts.sort_by(f64::total_cmp);
            assert!(parts.into_iter().eq((0..count).map(f64::from)));
        }
    }

    #[test]
    fn seeds_and_ranges_have_numbers_of_their_own() {
        for method in [Method::Random, Method::LatinHypercube, Method::Sobol] {
            let [a, b, c] = [(0, 1), (1, 1), (0, 2)].map(|(side, seed)| fractions(method, side, 16, seed));
            assert!(a != b && a != c && b != c, "{method:?}");
            assert_eq!(a, fractions(method, 0, 16, 1));
            assert!(a.iter().chain(&b).chain(&c).all(|place| (0.0..1.0).contains(place)));
        }
    }

    /// The mean of x·y over the square is ¼. 1024 Sobol points are good to about 1/n, random ones to √(7/144/n) = 0.007.
    #[test]
    fn sobol_points_integrate_better_than_random_ones() {
        let error = |method| {
            let [x, y] = [0, 1].map(|side| fractions(method, side, 1024, 3));
            let sum: f64 = x.iter().zip(&y).map(|(x, y)| x * y).sum();
            (sum / 1024.0 - 0.25).abs()
        };
        assert!(error(Method::Sobol) < 1e-3, "{}", error(Method::Sobol));
        assert!(error(Method::Random) < 0.03, "{}", error(Method::Random));
    }
}
