//! Sweeps: the same bytes however they were computed, and rows that are those of single runs.

use crate::harness::{Place, Running, wait_until};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::Field;
use recording::RecordingInfo;
use serde_json::Value;
use std::collections::HashMap;
use std::fs::{self, File};

/// Twelve short chains, some of which end early, with a key that not every point sets.
const SWEEP: &str = "\
until = \"stationary\"
[base]
preset = \"homogeneous\"
chain.beads = 40
chain.impurities = [{ bead = 10, mass_kg = 1e-3 }]
time.duration_s = 4e-3
[grid]
\"chain.impurities[0].mass_kg\" = { from = 0.6e-3, to = 5e-3, count = 3 }
chain.alpha = [1.5, 2.0]
[[case]]
\"integrator.method\" = \"rkn4\"
[[case]]
\"integrator.method\" = \"velocity-verlet\"
\"time.dt_s\" = 2e-7
";

/// A sweep that does not end while a test looks at it: after a few points come some of hours.
const ENDLESS: &str = "\
[base]
preset = \"homogeneous\"
chain.beads = 40
[grid]
time.duration_s = [8e-3, 9e-3, 1e4, 2e4]
";

/// Points of about a millisecond each.
const SHORT: &str = "\
[base]
preset = \"homogeneous\"
chain.beads = 40
[grid]
time.duration_s = { from = 8e-3, to = 16e-3, count = 40 }
";

fn place(sweep: &str) -> Place {
    let place = Place::new();
    place.write("s.toml", sweep);
    place
}

fn results(place: &Place, dir: &str) -> (String, Vec<u8>) {
    (place.read(&format!("{dir}/results.csv")), fs::read(place.path(dir).join("results.parquet")).unwrap())
}

/// The rows of a table, by column. No field has a comma in it.
fn rows(csv: &str) -> Vec<HashMap<&str, &str>> {
    let mut lines = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let head = lines.next().unwrap();
    lines.map(|line| head.iter().copied().zip(line).collect()).collect()
}

/// Order, workers and shards leave no trace in the results.
#[test]
fn results_do_not_depend_on_who_computed_them() {
    let place = place(SWEEP);
    let one = place.run("sweep s.toml --out one --jobs 1 --json").exits(0).json();
    assert_eq!((one["points"].as_u64(), one["computed"].as_u64()), (Some(12), Some(12)));
    place.run("sweep s.toml --out three --jobs 3").exits(0);
    let first = place.run("sweep s.toml --out shards --shard 1/2 --jobs 1").exits(0);
    first.says(&["not there yet: 6 points", "--merge"]);
    assert!(!place.path("shards/results.csv").exists());
    place.run("sweep s.toml --out shards --shard 0/2 --jobs 2").exits(0);
    let expected = results(&place, "one");
    assert!(expected == results(&place, "three") && expected == results(&place, "shards"));
    assert_eq!(expected.0.lines().count(), 13);
    assert_eq!(place.read("shards/timings.csv").lines().count(), 13);
    assert_eq!(place.read("shards/sweep.toml"), SWEEP);
}

/// Two shards at the same time; whichever ends last finds everything.
#[test]
fn shards_work_side_by_side() {
    let place = place(SWEEP);
    let shards = [0, 1, 2].map(|i| place.start(&format!("sweep s.toml --out side --shard {i}/3 --jobs 1")));
    for shard in shards {
        shard.wait().exits(0);
    }
    place.run("sweep s.toml --out alone").exits(0);
    assert!(results(&place, "side") == results(&place, "alone"));
}

/// A row is what the run and the analysis of that configuration give, to the last bit.
#[test]
fn a_row_is_what_run_and_energies_say() {
    let place = place(SWEEP);
    place.run("sweep s.toml --out dir --record").exits(0);
    let csv = place.read("dir/results.csv");
    for row in rows(&csv) {
        // the recording keeps the configuration of the point
        let index: u64 = row["index"].parse().unwrap();
        let recording = place.path(format!("dir/recordings/point-{index:06}.mcap"));
        let recorded = RecordingInfo::read(&recording).unwrap();
        assert_eq!(recorded.end.as_ref().unwrap().last_state_hash.as_deref(), Some(row["state_sha256"]));
        assert_eq!(recorded.last_step, Some(row["steps"].parse().unwrap()));
        place.write("point.toml", recorded.run_toml.as_ref().unwrap());
        let duration = row["time_s"];
        let run = format!("run point.toml --name p{index} --duration {duration} --record-every-steps");
        let every = recorded.manifest.provenance.publish_every_steps;
        let run = place.run(&format!("{run} {every} --json")).exits(0).json();
        assert_eq!(run["steps"].to_string(), row["steps"]);
        let is = |column: &str, value: &Value| {
            let (found, expected) = (row[column].parse::<f64>().ok(), value.as_f64());
            assert_eq!(found.map(f64::to_bits), expected.map(f64::to_bits), "{column} of point {index}");
        };
        is("relative_drift", &run["relative_drift"]);
        let energies = place.run(&format!("energies p{index}.mcap --json")).exits(0).json();
        let energies = &energies["results"];
        for column in ["kinetic_j", "potential_j", "total_j", "left_j", "split_j", "right_j", "dissipated_j"]
        {
            is(column, &energies["last"][column]);
        }
        is("max_abs_relative_drift", &energies["max_abs_relative_drift"]);
        let reflection = &energies["reflection"];
        is("reflected_over_total", &energies["reflected_over_total"]);
        is("reflected_over_transmitted", &energies["reflected_over_transmitted"]);
        is("reflected_at_s", &reflection["energies"]["at"]["time_s"]);
        is("reflected_uncertainty_j", &reflection["energies"]["uncertainty_j"]);
        is("stationary_since_s", &reflection["stationary_since"]["time_s"]);
        is("recoil_j", &reflection["recoil"]["energy_j"]);
        is("corrected_over_incident", &reflection["corrected"]["reflected_over_incident"]);
        let pulses = place.run(&format!("pulses p{index}.mcap --json")).exits(0).json();
        let pulses = &pulses["results"];
        is("pulses", &pulses["pulse_count"]);
        // the strongest first; bead 10 divides the chain
        let pulses = pulses["pulses"].as_array().unwrap();
        for (way, beyond) in [("forward", 11..40), ("backward", 0..10)] {
            let leaves = |pulse: &&Value| {
                pulse["direction"] == way && beyond.contains(&pulse["bead"].as_u64().unwrap())
            };
            let leaving: Vec<_> = pulses.iter().filter(leaves).collect();
            is(&format!("{way}_pulses"), &leaving.len().into());
            let Some(strongest) = leaving.first() else { continue };
            for quantity in ["bead", "v_peak_m_s", "speed_beads_per_s", "fwhm_beads", "energy_j"] {
                is(&format!("{way}_{quantity}"), &strongest[quantity]);
            }
        }
    }
}

/// A killed sweep goes on where it was, wherever its last row was torn. The kill comes from the operating system, in
/// the middle of a row, when the journal reaches a size that is not allowed: at the same point on any machine.
#[test]
fn a_killed_sweep_goes_on() {
    let place = place(SHORT);
    place.run("sweep s.toml --out whole").exits(0);
    let limited = "ulimit -c 0; ulimit -f 16; exec \"$0\" sweep s.toml --out killed --jobs 2";
    let command = place.foreign("sh", ["-c", limited, env!("CARGO_BIN_EXE_beadline")]);
    Running::start(limited, command).wait();
    assert!(!place.path("killed/results.csv").exists());
    let torn = fs::read(place.path("killed/rows/0-of-1.rows")).unwrap();
    // whole lines, the first of which is no row
    let kept = String::from_utf8_lossy(&torn).matches('\n').count() as u64 - 1;
    assert!((1..40).contains(&kept), "{kept} rows in {} bytes", torn.len());
    let again = place.run("sweep s.toml --out killed --json").exits(0).json();
    assert_eq!(again["computed"], 40 - kept);
    assert!(results(&place, "whole") == results(&place, "killed"));
    let idle = place.run("sweep s.toml --out killed --json").exits(0).json();
    assert_eq!(idle["computed"], 0);
}

/// Waits until `count` rows are there.
fn wait_for_rows(place: &Place, count: usize) {
    let journal = place.path("dir/rows/0-of-1.rows");
    wait_until("rows", || fs::read_to_string(&journal).ok().filter(|text| text.lines().count() > count));
}

/// A signal ends a sweep in order: what is finished stays, and the user is told how to go on.
#[test]
fn an_interrupted_sweep_keeps_what_it_has() {
    let place = place(ENDLESS);
    let sweep = place.start("sweep s.toml --out dir --jobs 1 --json");
    wait_for_rows(&place, 2);
    sweep.signal("INT");
    let ended = sweep.wait().exits(3).says(&["the same command goes on"]).json();
    assert_eq!(ended["stopped"], true);
    assert!(!place.path("dir/results.csv").exists());
    assert_eq!(ended["rows"], 2);
    let merged = place
        .run("sweep s.toml --out dir --merge --json")
        .exits(3)
        .says(&["missing in the results: 2 points"])
        .json();
    assert_eq!((merged["rows"].as_u64(), merged["computed"].as_u64()), (Some(2), Some(0)));
    assert_eq!(place.read("dir/results.csv").lines().count(), 3);
}

/// Rows that vanish while they are written are not passed over.
#[test]
fn a_journal_that_is_deleted_meanwhile_is_told() {
    let place = place(ENDLESS);
    let sweep = place.start("sweep s.toml --out dir --jobs 1");
    wait_for_rows(&place, 2);
    fs::remove_file(place.path("dir/rows/0-of-1.rows")).unwrap();
    sweep.signal("INT");
    sweep.wait().exits(1).says(&["0-of-1.rows was moved or deleted while it was being written"]);
}

/// A run that leaves the range of doubles has a row that says so; the others are computed.
#[test]
fn a_failed_run_has_a_row() {
    // the longest step that is taken resolves a contact, but the Gear method gains energy with it, slowly between
    // two walls and ever faster: 70 times as much as there was at 0.5 s, without bounds soon after
    let place = place(
        "[base]\npreset = \"homogeneous\"\nchain.beads = 10\nends = { left = \"fixed\", right = \"fixed\" }\n\
         integrator.method = \"gear5\"\ntime.duration_s = 1.0\n[grid]\ntime.dt_s = [1.8e-5, 2e-6]\n",
    );
    let ended = place.run("sweep s.toml --out dir --json").exits(3).says(&["1 run failed", "`error`"]).json();
    assert_eq!((ended["rows"].as_u64(), &ended["failed"]), (Some(2), &serde_json::json!([0])));
    let csv = place.read("dir/results.csv");
    let mut lines = csv.lines().skip(1);
    let failed = lines.next().unwrap();
    assert!(failed.starts_with("0,1.8e-5,failed,,,") && failed.contains("not finite at step"), "{failed}");
    assert!(lines.next().unwrap().starts_with("1,2e-6,complete,"));
    // it would fail again
    let again = place.run("sweep s.toml --out dir --json").exits(3).json();
    assert_eq!(again["computed"], 0);
}

#[test]
fn a_directory_is_of_one_sweep() {
    let place = place(SWEEP);
    place.run("sweep s.toml --out dir --merge").exits(2).says(&["dir holds no sweep"]);
    assert!(!place.path("dir").exists());
    place.run("sweep s.toml --out dir").exits(0);
    place.write("other.toml", &SWEEP.replace("5e-3", "4e-3"));
    place.run("sweep other.toml --out dir").exits(2).says(&["dir", "another sweep", "--force"]);
    place.write("same.toml", &format!("# a comment changes nothing\n{SWEEP}"));
    let same = place.run("sweep same.toml --out dir --json").exits(0).json();
    assert_eq!(same["computed"], 0);
    let other = place.run("sweep other.toml --out dir --force --json").exits(0).json();
    assert_eq!(other["computed"], 12);
    fs::create_dir(place.path("mine")).unwrap();
    place.write("mine/notes.txt", "keep me");
    place.run("sweep s.toml --out mine").exits(2).says(&["mine", "notes.txt", "another directory"]);
    assert_eq!(place.read("mine/notes.txt"), "keep me");
    assert!(!place.path("mine/rows").exists());
}

#[test]
fn one_process_computes_a_shard() {
    let place = place(ENDLESS);
    let first = place.start("sweep s.toml --out dir --jobs 1");
    // what has rows is locked, and hours from its end
    wait_for_rows(&place, 2);
    place.run("sweep s.toml --out dir").exits(1).says(&["another process", "--shard"]);
    place.run("sweep s.toml --out dir --force").exits(1).says(&["another process"]);
    first.signal("INT");
    first.wait().exits(3);
}

#[test]
fn mistakes_are_found_before_anything_is_computed() {
    let place = place(&SWEEP.replace("[1.5, 2.0]", "[1.5, 0.5]"));
    place.run("sweep s.toml --out dir").exits(2).says(&["s.toml:9: chain.alpha", "0.5", "point 1"]);
    assert!(!place.path("dir").exists());
    place.run("sweep s.toml").exits(2).says(&["--out"]);
    place.run("sweep missing.toml --out dir").exits(2).says(&["missing.toml"]);
    place.run("sweep s.toml --out dir --shard 2/2").exits(2).says(&["0/2"]);
    place.run("sweep s.toml --out dir --jobs 0").exits(2);
}

#[test]
fn the_example_is_a_sweep() {
    let place = Place::new();
    let example = place.run("sweep --example").exits(0).stdout();
    let short = example.replace("400", "40").replace("80", "8").replace("0.2", "1e-3");
    place.write("s.toml", &short);
    let ended = place.run("sweep s.toml --out dir --json").exits(0).json();
    assert_eq!(ended["rows"], 36);
}

/// Parquet has the values of the CSV, bit for bit.
#[test]
fn parquet_has_the_bits_of_the_csv() {
    let place = place(SWEEP);
    place.run("sweep s.toml --out dir").exits(0);
    place.run("run --preset homogeneous --name run --duration 1e-3").exits(0);
    place.run("energies run.mcap --out dir/e.csv").exits(0);
    place.run("energies run.mcap --out dir/e.parquet").exits(0);
    for (table, rows) in [("results", 12), ("e", 691)] {
        let csv = place.read(&format!("dir/{table}.csv"));
        let file = File::open(place.path(format!("dir/{table}.parquet"))).unwrap();
        let reader = SerializedFileReader::new(file).unwrap();
        let mut lines = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
        let head = lines.next().unwrap();
        let mut count = 0;
        for (row, line) in reader.get_row_iter(None).unwrap().zip(lines) {
            let row = row.unwrap();
            let names: Vec<_> = row.get_column_iter().map(|(name, _)| name.as_str()).collect();
            assert_eq!(names, head);
            for ((name, field), text) in row.get_column_iter().zip(&line) {
                match field {
                    Field::Null => assert_eq!(*text, "", "{name}"),
                    Field::ULong(value) => assert_eq!(value.to_string(), *text, "{name}"),
                    Field::Str(word) => assert_eq!(word, text, "{name}"),
                    Field::Double(value) => {
                        assert_eq!(value.to_bits(), text.parse::<f64>().unwrap().to_bits(), "{name}");
                    }
                    other => panic!("{name}: {other:?}"),
                }
            }
            count += 1;
        }
        assert!(count >= rows, "{table}: {count} rows");
    }
}

/// The light beads of a decorated chain, from a twentieth to a fifth of the heavy ones: the front is found at each, and
/// its speed and peak change little from one to the next.
#[test]
fn the_front_changes_smoothly_with_the_mass_of_light_beads() {
    let place = place(
        "[base]\nname = \"decorated\"\n[base.chain]\nbeads = 201\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n\
         masses = { pattern_kg = [1e-3, 0.1e-3] }\n[base.striker]\nbead = 0\nvelocity_m_s = 1.0\n\
         [base.time]\nduration_s = 0.016\n\
         [grid]\n\"chain.masses.pattern_kg[1]\" = { from = 0.05e-3, to = 0.2e-3, count = 16 }\n",
    );
    place.run("sweep s.toml --out s").exits(0);
    let (csv, _) = results(&place, "s");
    let rows = rows(&csv);
    for (column, change) in [("forward_v_peak_m_s", 0.05), ("forward_speed_beads_per_s", 0.02)] {
        let values: Vec<f64> = rows.iter().map(|row| row[column].parse().expect(column)).collect();
        let smooth = values.windows(2).all(|pair| (pair[1] / pair[0] - 1.0).abs() < change);
        assert!(values.len() == 16 && smooth, "{column}: {values:?}");
    }
    assert!(rows.iter().all(|row| row["unfollowed"] == "0"), "{csv}");
}
