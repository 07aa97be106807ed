//! Points drawn from ranges, each value a pure function of (sweep file, index of the sample).
//!
//! Architecture invariant: the values decide the bits of runs, and are computed with reproducible arithmetic only.

use super::super::MAX_POINTS;
use super::super::document::KeyPath;
use super::super::sobol;
use super::super::values::Interval;
use super::{Located, Reader, Setting, SweepError, unknown_key};
use schemas::config::line_at;
use schemas::philox;
use schemas::random::permutation;

/// Streams of random numbers, two for each range; no other use of a seed has these streams.
const STREAMS: u32 = 0x5341_0000;

/// Method of drawing points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Method {
    /// Each point on its own.
    Random,
    /// One point in each of as many equal parts of each range as there are points, with the parts of the ranges in
    /// random orders.
    LatinHypercube,
    /// Points of [`sobol`], moved by a random digital shift.
    Sobol,
}

#[expect(clippy::cast_possible_truncation, reason = "far below 2³²")]
pub(super) const MOST: u32 = MAX_POINTS as u32;

/// Most points of a Latin hypercube: memory holds their orders.
const MOST_ORDERED: u32 = 100_000;

const METHODS: [(&str, Method); 3] =
    [("latin-hypercube", Method::LatinHypercube), ("sobol", Method::Sobol), ("random", Method::Random)];

pub(super) const KNOWN: [&str; 4] = ["method", "count", "seed", "ranges"];

/// Values that are drawn together, each computed from the index of its sample. Without a table `[sample]` there is one
/// sample, which sets nothing.
#[derive(Debug)]
pub(in super::super) struct Samples {
    count: u32,
    sides: Vec<Side>,
    meaning: String,
}

/// A range, and the places of its values.
#[derive(Debug)]
struct Side {
    key: KeyPath,
    line: usize,
    interval: Interval,
    places: Places,
}

/// The places of all samples in a range.
#[derive(Debug)]
struct Places {
    seed: u64,
    stream: u32,
    draw: Draw,
}

#[derive(Debug)]
enum Draw {
    Random,
    /// The part of each sample.
    Ordered(Vec<usize>),
    Sobol {
        shift: u32,
        directions: [u32; sobol::BITS],
    },
}

impl Samples {
    /// Number of samples; at least one.
    pub(in super::super) fn count(&self) -> u64 {
        self.count.into()
    }

    /// The settings of sample `index`.
    pub(in super::super) fn at(&self, index: u64) -> Vec<Setting> {
        let index = u32::try_from(index).unwrap_or(u32::MAX);
        self.sides.iter().map(|side| side.setting(side.places.fraction(index, self.count))).collect()
    }

    /// The settings of samples at the ends of all ranges.
    pub(in super::super) fn ends(&self) -> impl Iterator<Item = Setting> {
        self.sides.iter().flat_map(|side| [0.0, 1.0].map(|fraction| side.setting(fraction)))
    }

    /// The keys that a sample sets.
    pub(in super::super) fn keys(&self) -> impl Iterator<Item = String> {
        self.sides.iter().map(|side| side.key.to_string())
    }

    /// Text that decides all values, independent of the layout of the file.
    pub(in super::super) fn meaning(&self) -> &str {
        &self.meaning
    }
}

impl Side {
    fn setting(&self, fraction: f64) -> Setting {
        Setting { key: self.key.clone(), value: self.interval.at(fraction), line: self.line }
    }
}

impl Reader<'_> {
    /// The samples of the table `[sample]`.
    pub(super) fn samples(&self, value: Option<&Located<'_>>) -> Result<Samples, SweepError> {
        let Some(value) = value else {
            return Ok(Samples { count: 1, sides: Vec::new(), meaning: String::new() });
        };
        let table = self.table(value, "sample")?;
        if let Some((key, _)) = table.iter().find(|(key, _)| !KNOWN.contains(&key.get_ref().as_ref())) {
            let name = key.get_ref();
            return Err(self.refuse(key.span().start, &format!("sample.{name}"), unknown_key(name, &KNOWN)));
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
        let most = if method == Method::LatinHypercube { MOST_ORDERED } else { MOST };
        let counts = format!("a whole number from 1 to {most}");
        let written = needed("count", &counts)?;
        let count: Option<u32> = self.option(Some(written), "sample.count", &counts)?;
        let count = count.filter(|count| (1..=most).contains(count)).ok_or_else(|| {
            let others = if most == MOST { "" } else { "; \"sobol\" and \"random\" take more" };
            let message = format!("found {}; allowed: {counts}{others}", self.written(written));
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
        let meaning: Vec<_> = ranges.iter().map(|(key, _, range)| format!("{key} = {range:?}")).collect();
        let meaning = format!("{method:?} {count} {seed} {}", meaning.join(", "));
        let side = |(side, (key, line, interval))| Side {
            key,
            line,
            interval,
            places: Places::new(method, side, count, seed),
        };
        Ok(Samples { count, sides: ranges.into_iter().enumerate().map(side).collect(), meaning })
    }

    /// The ranges, each with its key and its line.
    fn ranges(&self, value: &Located<'_>) -> Result<Vec<(KeyPath, usize, Interval)>, SweepError> {
        let mut entries = Vec::new();
        self.entries("", self.table(value, "sample.ranges")?, false, &mut entries)?;
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
            Ok((key, line_at(self.text, value.span().start), interval))
        };
        entries.into_iter().map(range).collect()
    }
}

impl Places {
    fn new(method: Method, side: usize, count: u32, seed: u64) -> Self {
        let stream = STREAMS + 2 * u32::try_from(side).unwrap_or(0);
        let draw = match method {
            Method::Random => Draw::Random,
            Method::LatinHypercube => Draw::Ordered(permutation(seed, stream + 1, count as usize)),
            Method::Sobol => {
                let [shift, ..] = philox::words(seed, 0, [stream, 0]);
                Draw::Sobol { shift, directions: sobol::directions(side) }
            }
        };
        Self { seed, stream, draw }
    }

    /// The place, from 0 to 1, of sample `index` of `count`.
    fn fraction(&self, index: u32, count: u32) -> f64 {
        let random = || philox::uniform(self.seed, self.stream, index.into());
        match &self.draw {
            Draw::Random => random(),
            Draw::Ordered(parts) => (parts[index as usize] as f64 + random()) / f64::from(count),
            // the middle of the cell of 2⁻³²
            Draw::Sobol { shift, directions } => {
                (f64::from(sobol::point(directions, index) ^ shift) + 0.5) / 4_294_967_296.0
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The places of all samples in range `side`.
    fn fractions(method: Method, side: usize, count: u32, seed: u64) -> Vec<f64> {
        let places = Places::new(method, side, count, seed);
        (0..count).map(|index| places.fraction(index, count)).collect()
    }

    /// The condition on a Latin hypercube: one sample in each part of each range.
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
