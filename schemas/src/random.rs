//! Random numbers and orders for disorder and thermal motion: every one of them depends on (seed, stream, index) alone.

use crate::functions::{ln, sine_cosine};
use crate::philox::{uniform, words};

/// A normal number with mean 0 and variance 1: `√(−2·ln a)·cos 2πb`, with `a` from (0, 1] of the first two words of the index and `b` from
/// [0, 1) of the other two; within 3 ulp, and never beyond 8.6.
///
/// # Source
/// G. E. P. Box and M. E. Muller, Ann. Math. Stat. 29 (1958) 610, doi:10.1214/aoms/1177706645
///
/// ```
/// use schemas::random::normal;
/// assert_eq!(normal(7, 0, 12), normal(7, 0, 12));
/// ```
pub fn normal(seed: u64, stream: u32, index: u64) -> f64 {
    normals(seed, index, [stream, 0])[0]
}

/// Two independent [`normal`] numbers of an index in a stream of two words: the cosine's, and with the sine in its place another one.
#[inline(always)]
pub fn normals(seed: u64, index: u64, stream: [u32; 2]) -> [f64; 2] {
    let [w0, w1, w2, w3] = words(seed, index, stream);
    let whole = (1_u64 << 53) as f64;
    let bits = |high: u32, low: u32| (u64::from(high) >> 5 << 26) + (u64::from(low) >> 6);
    let (a, b) = ((bits(w0, w1) + 1) as f64 / whole, bits(w2, w3) as f64 / whole);
    let radius = (0.0 - 2.0 * ln(a)).sqrt();
    let (sine, cosine) = sine_cosine((b, 0.0));
    [radius * cosine, radius * sine]
}

/// A random order of the numbers from 0 to below `count`: for i = count − 1 … 1 in turn, the numbers at the places i and
/// `⌊(i + 1)·uniform(seed, stream, i)⌋` change places (Fisher and Yates). Each place has its probability to `count`·2^−52.
///
/// ```
/// let mut order = schemas::random::permutation(1, 0, 5);
/// order.sort();
/// assert_eq!(order, [0, 1, 2, 3, 4]);
/// ```
pub fn permutation(seed: u64, stream: u32, count: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    for i in (1..count).rev() {
        let place = ((i + 1) as f64 * uniform(seed, stream, i as u64)).floor();
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "from 0 to i")]
        order.swap(i, place as usize);
    }
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The numbers of `tests/reference/random_numbers.py`, which shares nothing with us: its normal numbers are exact ones, rounded.
    #[test]
    fn another_program_makes_the_same_numbers() {
        let (mut normals, mut orders) = (0, 0);
        for line in include_str!("../../tests/reference/random-numbers.csv").lines().skip(1) {
            let fields: Vec<&str> = line.split(',').collect();
            let seed = fields[1].parse().expect("a seed");
            let stream = fields[2].parse().expect("a stream");
            if fields[0] == "normal" {
                let expected: f64 = fields[4].parse().expect("a number");
                let found = normal(seed, stream, fields[3].parse().expect("an index"));
                let ulp = expected.abs().next_up() - expected.abs();
                assert!((found - expected).abs() <= 3.0 * ulp, "{line}: {found:?}");
                normals += 1;
            } else {
                let expected: Vec<usize> =
                    fields[4].split(' ').map(|place| place.parse().expect("a number")).collect();
                assert_eq!(permutation(seed, stream, expected.len()), expected, "{line}");
                orders += 1;
            }
        }
        assert_eq!((normals, orders), (200, 8));
    }

    /// The values in `docs/CONFIGURATION.md`, which `tests/python/random_chains.py` computes from that page.
    #[test]
    fn the_values_of_the_page_are_made() {
        let page = include_str!("../../docs/CONFIGURATION.md");
        let (_, values) = page.split_once("```json random\n").expect("values to check with");
        let (values, _) = values.split_once("```").expect("their end");
        let rows: Vec<serde_json::Value> = serde_json::from_str(values).expect("rows");
        let hex = |x: f64| format!("{:016x}", x.to_bits());
        for row in &rows {
            let number = |key: &str| row[key].as_u64().expect("a whole number");
            let stream = || u32::try_from(number("stream")).expect("a stream");
            let seed = number("seed");
            let found = match row["of"].as_str().expect("of what") {
                "words" => {
                    let words = crate::philox::words(seed, number("index"), [stream(), 0]);
                    words.map(|word| format!("{word:08x}")).to_vec().into()
                }
                "uniform" => hex(uniform(seed, stream(), number("index"))).into(),
                "normal" => hex(normal(seed, stream(), number("index"))).into(),
                "order" => {
                    permutation(seed, stream(), usize::try_from(number("count")).expect("a count")).into()
                }
                "masses" => of_chain(row).0.into_iter().map(hex).collect::<Vec<_>>().into(),
                "velocities" => of_chain(row).1.into_iter().map(hex).collect::<Vec<_>>().into(),
                other => serde_json::Value::from(format!("{other} is unknown")),
            };
            assert_eq!(found, row["value"], "{row}");
        }
        assert!(rows.len() >= 10);
    }

    /// Masses (kg) and thermal velocities (m/s) of the chain of a row.
    fn of_chain(row: &serde_json::Value) -> (Vec<f64>, Vec<f64>) {
        let disorder: Vec<String> = row["disorder"]
            .as_array()
            .expect("a list")
            .iter()
            .map(|entry| {
                let (key, value) = entry.as_object().and_then(|entry| entry.iter().next()).expect("a key");
                let value = match &value["factor"] {
                    serde_json::Value::Null => value.to_string(),
                    factor => format!("{{ fraction = {}, factor = {factor} }}", value["fraction"]),
                };
                format!("[[disorder]]\nof = \"masses\"\n{key} = {value}\n")
            })
            .collect();
        let energy_j = row["energy_j"].as_f64().unwrap_or(1.0);
        let text = format!(
            "seed = {}\n[chain]\nbeads = {}\nbead_mass_kg = {}\nalpha = 1.5\nstiffness = 1e7\n{}\
             [initial]\nthermal = {{ energy_j = {energy_j:e} }}\n[striker]\nbead = 0\nvelocity_m_s = 0\n[time]\nduration_s = 1e-6\n",
            row["seed"],
            row["beads"],
            row["bead_mass_kg"],
            disorder.concat()
        );
        let config = crate::config::RunConfig::from_toml(&text).expect("valid");
        let physics = crate::manifest::Physics::resolve(&config).expect("possible");
        (physics.chain().mass_kg, physics.initial_state().1)
    }

    /// Moments of n numbers have the standard deviations √(1/n), √(2/n), √(15/n) and √(96/n); the largest distance between
    /// the distributions is above 1.63/√n once in a hundred times. The seed is fixed, so the test is, too.
    #[test]
    fn normal_numbers_are_normal() {
        let n = 20_000_u32;
        let root = f64::from(n).sqrt();
        let mut numbers: Vec<f64> = (0..u64::from(n)).map(|index| normal(11, 5, index)).collect();
        let moment = |power: i32| numbers.iter().map(|x| x.powi(power)).sum::<f64>() / f64::from(n);
        for (power, expected, variance) in [(1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0_f64)]
        {
            let found = moment(power);
            assert!((found - expected).abs() < 3.0 * variance.sqrt() / root, "moment {power}: {found}");
        }
        numbers.sort_by(f64::total_cmp);
        // the distribution, by Simpson's rule from one number to the next
        let density = |x: f64| (-0.5 * x * x).exp() / std::f64::consts::TAU.sqrt();
        let (mut below, mut at, mut distance) = (0.0_f64, -8.0_f64, 0.0_f64);
        for (index, x) in numbers.into_iter().enumerate() {
            let parts = ((x - at) / 0.01).ceil().max(1.0);
            let h = (x - at) / parts;
            let mut part = 0.0;
            while part < parts {
                let from = at + h * part;
                below += h / 6.0 * (density(from) + 4.0 * density(from + 0.5 * h) + density(from + h));
                part += 1.0;
            }
            at = x;
            distance = distance.max((below - index as f64 / f64::from(n)).abs());
        }
        assert!(distance < 1.63 / root, "{distance}");
    }

    #[test]
    fn orders_are_all_equally_frequent() {
        let mut counts = std::collections::BTreeMap::new();
        for seed in 0..12_000 {
            *counts.entry(permutation(seed, 0, 4)).or_insert(0) += 1;
        }
        assert_eq!(counts.len(), 24);
        // 500 each with a standard deviation of 22
        assert!(counts.values().all(|count| (400..600).contains(count)), "{counts:?}");
        assert!(permutation(1, 0, 0).is_empty());
        assert_eq!(permutation(1, 0, 1), [0]);
    }
}
