//! The JSON Schema of sweep files. Their reader is written by hand; the tests compare its keys with these.

#![expect(dead_code, reason = "the fields of these types are read as keys and their text alone")]

use super::super::MAX_POINTS;
use super::Until;
use super::sample::MOST;
use super::series::{Spacing, Written};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use schemas::config::RunConfig;
use schemas::json_schema::{of, require_nothing};
use std::collections::BTreeMap;

/// The schema of sweep files.
pub fn schema() -> Schema {
    let mut schema = of::<SweepFile>("A sweep of Beadline", "A grid of runs, and what is kept of each.");
    require_nothing(&mut schema, "/$defs/Base");
    schema
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct SweepFile {
    /// The configuration that all points have in common, over that of a preset or of a file.
    base: Base,
    /// Values of keys: each combination of them is a point.
    grid: Option<Grid>,
    /// Tables of keys that are set together: each is a case, and all points are made of each.
    #[schemars(default, length(min = 1), schema_with = "cases")]
    case: Option<Vec<toml::Table>>,
    /// Values that are drawn together from ranges.
    sample: Option<Sample>,
    /// Seeds of each point, over which statistics are made.
    seeds: Option<Seeds>,
    /// The values over which statistics are made [default: the seeds].
    ensemble: Option<Ensemble>,
    /// The end of a point [default: "end"].
    until: Option<Until>,
    /// True if each point is recorded [default: false].
    record: Option<bool>,
    /// True if each point is checked as `beadline check` does it [default: false].
    check: Option<bool>,
    /// The bead at which the energies on the left and on the right part [default: the impurity].
    split_bead: Option<u64>,
    /// Columns of analyses, such as `energies.driven_j`, `forces.peak_n@right`; `beadline analyses` lists them.
    measure: Option<Vec<String>>,
    /// The time (s) from which these look at frames [default: 0].
    #[schemars(range(min = 0))]
    measure_from_s: Option<f64>,
    /// Columns of analyses over time.
    series: Option<Written>,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Base {
    /// Name of a preset that the base begins with; `beadline presets` lists them.
    preset: Option<String>,
    /// A configuration file that the base begins with, beside this file.
    file: Option<String>,
    #[schemars(flatten)]
    config: RunConfig,
}

/// Values of keys. A key is written in quotes, `"chain.alpha"`, or as tables in tables.
#[derive(JsonSchema)]
pub struct Grid(BTreeMap<String, Values<Axis>>);

/// The values of a key, or further keys.
#[derive(JsonSchema)]
#[schemars(untagged)]
enum Values<T> {
    Of(T),
    Below(BTreeMap<String, Values<T>>),
}

/// The values of a key.
#[derive(JsonSchema)]
#[schemars(untagged)]
enum Axis {
    /// A list of values.
    #[schemars(schema_with = "list")]
    List(Vec<toml::Value>),
    /// Values at equal distances, or in equal ratios, both ends included.
    Range(Range),
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Range {
    /// The first value.
    from: f64,
    /// The last value.
    to: f64,
    /// Number of values.
    #[schemars(range(min = 2, max = MAX_POINTS))]
    count: u64,
    /// The distances: equal, or in equal ratios [default: "linear"].
    spacing: Option<Spacing>,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Sample {
    /// The method of drawing.
    method: Method,
    /// Number of samples; at most 100,000 of a Latin hypercube.
    #[schemars(range(min = 1, max = MOST))]
    count: u32,
    /// Seed of the samples [default: 0].
    seed: Option<u64>,
    /// Keys, each with a range.
    ranges: BTreeMap<String, Values<Interval>>,
}

#[derive(JsonSchema)]
#[schemars(rename_all = "kebab-case")]
enum Method {
    /// One sample in each part of each range.
    LatinHypercube,
    /// Points that fill the space evenly.
    Sobol,
    /// Each on its own.
    Random,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Interval {
    /// The smallest value.
    from: f64,
    /// The largest value.
    to: f64,
    /// The density: equal for equal differences, or for equal ratios [default: "linear"].
    spacing: Option<Spacing>,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Seeds {
    /// The first seed [default: 0].
    from: Option<u64>,
    /// Number of seeds.
    #[schemars(range(min = 1, max = MAX_POINTS))]
    count: u64,
}

#[derive(JsonSchema)]
#[schemars(deny_unknown_fields)]
struct Ensemble {
    /// A key of the grid, or "sample" [default: "seed"].
    over: Option<String>,
}

fn cases(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "array", "items": { "type": "object" } })
}

fn list(_: &mut SchemaGenerator) -> Schema {
    json_schema!({ "type": "array", "minItems": 1 })
}

#[cfg(test)]
mod tests {
    use super::super::{KNOWN, sample};
    use super::*;
    use std::collections::BTreeSet;

    /// The keys of a table of the schema, by a pointer.
    fn keys(schema: &Schema, place: &str) -> BTreeSet<String> {
        let table = schema.pointer(place).and_then(|table| table["properties"].as_object()).expect(place);
        table.keys().cloned().collect()
    }

    #[test]
    fn the_schema_and_the_reader_know_the_same_keys() {
        let schema = schema();
        let known = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<BTreeSet<_>>();
        assert_eq!(keys(&schema, ""), known(&KNOWN));
        assert_eq!(keys(&schema, "/$defs/Sample"), known(&sample::KNOWN));
        let mut of_run = keys(&RunConfig::schema(), "");
        of_run.extend(["preset", "file"].map(str::to_owned));
        assert_eq!(keys(&schema, "/$defs/Base"), of_run);
        assert_eq!(
            schema.get("required"),
            Some(&["base"].into_iter().collect()),
            "all others may be left out"
        );
        assert!(schema.pointer("/$defs/ChainConfig/required").is_none(), "the grid may give the beads");
    }
}
