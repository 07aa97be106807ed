//! Ensembles and samples of a sweep: statistics that anybody can recompute, and bytes that depend on nobody.

use crate::harness::Place;
use parquet::file::reader::{FileReader, SerializedFileReader};
use std::collections::HashMap;
use std::fs::{self, File};

/// Six runs that differ in the velocity alone, for each of two contact laws; a run of no length has no pulses.
const ENSEMBLE: &str = "\
[ensemble]
over = \"striker.velocity_m_s\"
[base]
preset = \"homogeneous\"
chain.beads = 30
time.duration_s = 3e-3
[grid]
chain.alpha = [1.5, 2.0]
\"striker.velocity_m_s\" = { from = 0.5, to = 3.0, count = 6 }
\"time.dt_s\" = [1e-6, 2e-6]
";

const SAMPLE: &str = "\
[sample]
method = \"latin-hypercube\"
count = 10
seed = 4
ranges = { \"striker.velocity_m_s\" = { from = 1.0, to = 2.0 }, \"chain.beads\" = { from = 20, to = 29 } }
[base]
preset = \"homogeneous\"
time.duration_s = 1e-3
[grid]
chain.alpha = [1.5, 2.0]
";

fn place(sweep: &str) -> Place {
    let place = Place::new();
    place.write("s.toml", sweep);
    place
}

/// The rows of a table, by column; empty fields are left out. No field has a comma in it.
fn rows(csv: &str) -> Vec<HashMap<String, String>> {
    let mut lines = csv.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let head = lines.next().unwrap();
    let row =
        |line: Vec<String>| head.iter().cloned().zip(line).filter(|(_, cell)| !cell.is_empty()).collect();
    lines.map(row).collect()
}

fn number(row: &HashMap<String, String>, column: &str) -> f64 {
    row.get(column).unwrap_or_else(|| panic!("no {column} in {row:?}")).parse().unwrap()
}

#[test]
fn statistics_are_those_of_the_rows() {
    let place = place(ENSEMBLE);
    let summary = place.run("sweep s.toml --out dir --json").exits(0).json();
    assert!(summary["results"].to_string().contains("ensemble.csv"), "{summary}");
    let (all, found) = (rows(&place.read("dir/results.csv")), rows(&place.read("dir/ensemble.csv")));
    assert_eq!((all.len(), found.len()), (24, 4));
    for (index, group) in found.iter().enumerate() {
        assert_eq!(number(group, "index"), index as f64);
        assert!(!group.contains_key("striker.velocity_m_s"), "{group:?}");
        let same = |key: &str, row: &HashMap<String, String>| row[key] == group[key];
        let members: Vec<_> =
            all.iter().filter(|row| same("chain.alpha", row) && same("time.dt_s", row)).collect();
        assert_eq!((members.len() as f64, number(group, "count")), (6.0, 6.0));
        let mut values: Vec<f64> = members.iter().map(|row| number(row, "total_j")).collect();
        values.sort_by(f64::total_cmp);
        let mean = values.iter().sum::<f64>() / 6.0;
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / 5.0;
        // sums of another order: a few units in the last place
        let is = |column: &str, expected: f64| {
            let found = number(group, column);
            assert!(
                (found - expected).abs() <= 1e-14 * expected.abs(),
                "{column}: {found}, expected {expected}"
            );
        };
        is("mean_total_j", mean);
        is("standard_error_total_j", (variance / 6.0).sqrt());
        is("median_total_j", 0.5 * (values[2] + values[3]));
        is("q05_total_j", values[0] + 0.25 * (values[1] - values[0]));
        is("q75_total_j", values[3] + 0.75 * (values[4] - values[3]));
        // what does not exist is counted, and has no mean
        let missing: Vec<&str> = group.keys().filter_map(|column| column.strip_prefix("missing_")).collect();
        for column in &missing {
            let lacking = members.iter().filter(|row| !row.contains_key(*column)).count() as f64;
            assert_eq!(number(group, &format!("missing_{column}")), lacking, "{column}");
            assert_eq!(group.contains_key(&format!("mean_{column}")), lacking < 6.0, "{column}");
        }
        assert!(missing.iter().any(|column| number(group, &format!("missing_{column}")) == 6.0));
    }
}

#[test]
fn an_ensemble_is_the_same_bytes_whoever_computed_it() {
    let place = place(ENSEMBLE);
    place.run("sweep s.toml --out one --jobs 1").exits(0);
    place.run("sweep s.toml --out parts --shard 0/3 --jobs 2").exits(0);
    // what is there is made a table of: two points of six
    place.run("sweep s.toml --out parts --merge").exits(3);
    assert_eq!(number(&rows(&place.read("parts/ensemble.csv"))[0], "count"), 2.0);
    for shard in [2, 1] {
        place.run(&format!("sweep s.toml --out parts --shard {shard}/3 --jobs 1")).exits(0);
    }
    for file in ["ensemble.csv", "ensemble.parquet", "results.csv"] {
        let [one, parts] = ["one", "parts"].map(|dir| fs::read(place.path(format!("{dir}/{file}"))).unwrap());
        assert!(one == parts, "{file}");
    }
    let parquet = SerializedFileReader::new(File::open(place.path("one/ensemble.parquet")).unwrap()).unwrap();
    let csv = place.read("one/ensemble.csv");
    let columns =
        parquet.metadata().file_metadata().schema().get_fields().iter().map(|field| field.name().to_owned());
    assert!(columns.eq(csv.lines().next().unwrap().split(',').map(str::to_owned)));
    // a sweep file that asks for no statistics any more has none
    place.write("s.toml", &ENSEMBLE.replace("[ensemble]\nover = \"striker.velocity_m_s\"\n", ""));
    place.run("sweep s.toml --out one").exits(0);
    assert!(!place.path("one/ensemble.csv").exists() && place.path("one/results.csv").exists());
}

/// Each tenth of each range has one of the ten samples, and each sample is combined with the grid.
#[test]
fn a_sample_fills_its_ranges() {
    let place = place(SAMPLE);
    place.run("sweep s.toml --out dir").exits(0);
    let found = rows(&place.read("dir/results.csv"));
    assert_eq!(found.len(), 20);
    for alpha in ["1.5e0", "2e0"] {
        let of = |column: &str| -> Vec<f64> {
            found.iter().filter(|row| row["chain.alpha"] == alpha).map(|row| number(row, column)).collect()
        };
        let mut beads = of("chain.beads");
        beads.sort_by(f64::total_cmp);
        assert_eq!(beads, (20..30).map(f64::from).collect::<Vec<_>>());
        let mut parts: Vec<f64> =
            of("striker.velocity_m_s").iter().map(|v| ((v - 1.0) * 10.0).floor()).collect();
        parts.sort_by(f64::total_cmp);
        assert_eq!(parts, (0..10).map(f64::from).collect::<Vec<_>>());
    }
    // another seed, another sample
    place.write("s.toml", &SAMPLE.replace("seed = 4", "seed = 5"));
    place.run("sweep s.toml --out other").exits(0);
    assert_ne!(place.read("dir/results.csv"), place.read("other/results.csv"));
    // statistics over all that is drawn
    place.write("s.toml", &format!("[ensemble]\nover = \"sample\"\n{SAMPLE}"));
    place.run("sweep s.toml --out dir").exits(0);
    let means = rows(&place.read("dir/ensemble.csv"));
    assert_eq!(means.iter().map(|row| row["count"].as_str()).collect::<Vec<_>>(), ["10", "10"]);
    assert!(!means[0].contains_key("chain.beads"));
}

#[test]
fn mistakes_say_what_is_allowed() {
    let place = Place::new();
    for (from, to, says) in [
        (
            "latin-hypercube",
            "latin",
            "s.toml:2: sample.method: found \"latin\"; allowed: \"latin-hypercube\"",
        ),
        ("count = 10", "count = 0", "s.toml:3: sample.count: found 0; allowed: a whole number from 1"),
        (
            "seed = 4",
            "sed = 4",
            "s.toml:4: sample.sed: found an unknown key; allowed: method, count, seed, ranges",
        ),
        ("from = 20, to = 29", "from = 29, to = 20", "s.toml:5: chain.beads: found a range from 29 to 20"),
        (
            "from = 1.0, to",
            "from = 0.0, spacing = \"log\", to",
            "s.toml:5: striker.velocity_m_s: a range from 0 to 2",
        ),
        ("chain.alpha = ", "chain.beads = ", "s.toml:10: chain.beads: is set twice"),
        (
            "[grid]",
            "[ensemble]\nover = \"seed\"\n[grid]",
            "ensemble.over: found `seed`, which the grid does not have; allowed: chain.alpha, sample",
        ),
        ("chain.beads\" = { from = 20", "chain.beads\" = { from = 1", "chain.beads: found 1; allowed"),
    ] {
        assert!(SAMPLE.contains(from), "{from}");
        place.write("s.toml", &SAMPLE.replace(from, to));
        place.run("sweep s.toml --out dir").exits(2).says(&[says]);
    }
}

/// Disordered chains with two measures over time, in intervals that grow.
const SERIES: &str = "\
seeds = { from = 0, count = 3 }
record = true
[series]
measure = [\"spreading.second_moment\", \"spreading.participation\"]
count = 6
spacing = \"log\"
from_s = 2e-4
[base]
preset = \"disordered\"
chain.beads = 60
striker.bead = 30
time.duration_s = 4e-3
time.dt_s = 1e-5
stream = { publish_every_steps = 4, record_every_steps = 4 }
[grid]
\"disorder[0].uniform\" = [0.2, 0.6]
";

/// Lines over time are the means of the rows that the analysis has of the recordings, and statistics of those of the seeds; whoever
/// computes them, they are the same bytes.
#[test]
fn columns_over_time_are_means_of_the_rows_of_the_analysis() {
    let place = place(SERIES);
    place.run("sweep s.toml --out one").exits(0);
    let edges: Vec<f64> = (0..=6).map(|i| 2e-4 * 20_f64.powf(f64::from(i) / 6.0)).collect();
    let found = rows(&place.read("one/series.csv"));
    assert_eq!(found.len(), 36);
    let (moment, shared) = ("spreading.second_moment_beads2", "spreading.participation_beads");
    for index in 0..6 {
        let recording = format!("one/recordings/point-{index:06}.mcap");
        place.run(&format!("spreading {recording} --out rows-{index}.csv")).exits(0);
        let all = rows(&place.read(&format!("rows-{index}.csv")));
        let lines = found.iter().filter(|line| number(line, "index") == f64::from(index));
        for (interval, line) in lines.enumerate() {
            let within = |row: &&HashMap<String, String>| {
                let time_s = number(row, "time_s");
                time_s <= edges[interval + 1] * (1.0 + 1e-12) && time_s > edges[interval] * (1.0 + 1e-12)
                    || interval == 0 && (time_s - edges[0]).abs() < 1e-12
            };
            let within: Vec<_> = all.iter().filter(within).collect();
            for (of, to) in
                [("time_s", "time_s"), ("second_moment_beads2", moment), ("participation_beads", shared)]
            {
                let mean = within.iter().map(|row| number(row, of)).sum::<f64>() / within.len() as f64;
                let is = number(line, to);
                assert!(
                    (is - mean).abs() <= 1e-13 * mean,
                    "point {index}, interval {interval}, {to}: {is}, {mean}"
                );
            }
        }
    }
    for group in rows(&place.read("one/ensemble-series.csv")) {
        let of = |line: &&HashMap<String, String>| {
            let same_time = (number(line, "time_s") / number(&group, "time_s") - 1.0).abs() < 1e-12;
            line["disorder[0].uniform"] == group["disorder[0].uniform"] && same_time
        };
        let values: Vec<f64> = found.iter().filter(of).map(|line| number(line, moment)).collect();
        let (mean, count) = (values.iter().sum::<f64>() / 3.0, number(&group, "count"));
        let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / 2.0;
        assert_eq!((values.len(), count), (3, 3.0));
        let is = |column: String, value: f64| assert!((number(&group, &column) / value - 1.0).abs() < 1e-12);
        is(format!("mean_{moment}"), mean);
        is(format!("standard_error_{moment}"), (variance / 3.0).sqrt());
    }
    place.run("sweep s.toml --out parts --shard 1/2").exits(0);
    place.run("sweep s.toml --out parts --shard 0/2").exits(0);
    for file in
        ["series.csv", "series.parquet", "ensemble-series.csv", "ensemble-series.parquet", "results.csv"]
    {
        let [one, parts] = ["one", "parts"].map(|dir| fs::read(place.path(format!("{dir}/{file}"))).unwrap());
        assert!(one == parts, "{file}");
    }
    let plot = "plot one/ensemble-series.csv --y spreading.second_moment_beads2 --band --fit=5e-4.. --json";
    let fitted = place.run(plot).exits(0).json();
    assert_eq!((&fitted["x"], &fitted["by"]), (&"time_s".into(), &"disorder[0].uniform".into()));
    let exponents = fitted["fits"].as_array().expect("fits").iter();
    let exponents: Vec<f64> = exponents.map(|fit| fit["exponent"].as_f64().expect("a number")).collect();
    // without disorder a struck chain has 2
    assert!(exponents.len() == 2 && exponents[1] < exponents[0] && exponents[0] < 2.1, "{exponents:?}");
    let told = place.run(&plot.replace("--json", "--out again.png")).exits(0).stdout();
    assert!(told.contains("takes the times of a run for independent"), "{told}");
}

/// A chain that a bath sets in motion spreads no energy at first: its first interval has the mean of the later frames.
#[test]
fn a_frame_without_a_value_counts_nothing_in_its_interval() {
    let place = place(
        "seeds = { from = 0, count = 1 }\n[series]\nmeasure = [\"spreading.participation\", \"heat.kinetic_temperature_j\"]\ncount = 2\n[base]\n\
         chain = { beads = 8, bead_mass_kg = 1.0, bonds = { linear = 1.0 } }\nends = { left = \"fixed\", right = \"fixed\" }\n\
         bath = [{ beads = \"..2\", temperature_j = 1.5, friction_per_s = 0.5 }]\n\
         time = { duration_s = 4.0, dt_s = 0.02 }\nstream = { publish_every_steps = 20 }\n",
    );
    place.run("sweep s.toml --out dir").exits(0);
    let found = rows(&place.read("dir/series.csv"));
    assert_eq!(found.len(), 2);
    assert!(found.iter().all(|line| number(line, "spreading.participation_beads") >= 1.0), "{found:?}");
}

#[test]
fn columns_over_time_that_cannot_be_are_refused() {
    for (replaced, with, says) in [
        (
            "spreading.second_moment",
            "spreading.nothing",
            "series.measure[0]: found the unknown column `nothing`",
        ),
        (
            "spreading.second_moment",
            "spreading.moment_exponent",
            "unknown column `moment_exponent` of spreading",
        ),
        (
            "spreading.participation",
            "pulses.pulse_count",
            "series.measure[1]: found the unknown column `pulse_count` of pulses",
        ),
        ("spreading.participation", "spreading.second_moment_beads2", "twice"),
        ("count = 6", "count = 0", "series.count: found 0; allowed: a whole number from 1 to"),
        ("count = 6", "count = 9999", "series.count: found 9999; allowed"),
        ("from_s = 2e-4", "from_s = 0.0", "allowed: a time above 0 (s), as spacing is \"log\""),
        (
            "from_s = 2e-4",
            "from_s = 5e-3",
            "series.from_s: found 0.005; allowed: less than the duration, 0.004 s",
        ),
        ("from_s = 2e-4", "until_s = 5e-3", "unknown field `until_s`"),
        (
            "record = true",
            "measure_from_s = 5e-3",
            "measure_from_s: found 0.005; allowed: less than the duration, 0.004 s",
        ),
        ("\"log\"", "\"equal\"", "unknown variant `equal`"),
    ] {
        let place = place(&SERIES.replace(replaced, with));
        place.run("sweep s.toml --out one").exits(2).says(&[says]);
    }
}
