//! Columns of any analysis in a sweep, by name: the numbers of the commands, and refusals that say what there is.

use crate::harness::Place;
use serde_json::Value;

/// A chain that strikes a wall, with a light bead that rattles and a force that does work.
const STRUCK: &str = "\
measure = [
    \"energies.driven_j\", \"energies.left_j\", \"impurity.event_count@10\", \"impurity.turn_count@10\",
    \"contacts.compressed_count\", \"pulses.v_peak@forward\", \"pulses.pulse_count\", \"spreading.participation\",
    \"deformation.overlap_peak_m@20\", \"deformation.exact_l2@20\", \"forces.peak_n@right\", \"forces.peak_count@contact:7\",
]
[base]
preset = \"homogeneous\"
chain.beads = 40
chain.impurities = [{ bead = 10, mass_kg = 0.3e-3 }]
ends.right = \"fixed\"
drive = [{ bead = 39, force_n = { half_sine = { amplitude = 2.0, duration_s = 2e-3 } } }]
time.duration_s = 5e-3
stream = { publish_every_steps = 2, record_every_steps = 2 }
[grid]
chain.alpha = [1.5]
";

const PRESSED: &str = "\
measure = [
    \"modes.frequency_hz@1\", \"modes.centre_bead@3\", \"modes.largest_j@2\", \"spectrum.peak_hz@12\",
    \"spectrum.mean_square@contact:7\", \"forces.rest_force_n@contact:7\",
]
[base]
preset = \"precompressed\"
chain.beads = 40
time.duration_s = 5e-3
stream = { publish_every_steps = 4, record_every_steps = 4 }
[grid]
chain.alpha = [1.5]
";

/// The one row of a sweep by its columns, which is recorded as the first point.
fn row(place: &Place, sweep: &str) -> Vec<(String, String)> {
    place.write("s.toml", sweep);
    place.run("sweep s.toml --out dir --record --force").exits(0);
    let csv = place.read("dir/results.csv");
    let mut lines = csv.lines().map(|line| line.split(',').map(str::to_owned));
    lines.next().unwrap().zip(lines.next().unwrap()).collect()
}

/// The results of an analysis in the recording of the first point.
fn found(place: &Place, analysis: &str) -> Value {
    let (name, flags) = analysis.split_once(' ').unwrap_or((analysis, ""));
    let words = format!("{name} dir/recordings/point-000000.mcap {flags} --json");
    place.run(&words).exits(0).json()["results"].clone()
}

#[track_caller]
fn assert_is(row: &[(String, String)], column: &str, expected: &Value) {
    let cell = row.iter().find(|(name, _)| name == column);
    let (_, cell) = cell.unwrap_or_else(|| panic!("no {column} in {row:?}"));
    let bits = |value: Option<f64>| value.map(f64::to_bits);
    assert_eq!(bits(cell.parse().ok()), bits(expected.as_f64()), "{column}: {cell}, {expected}");
    assert!(expected.is_number(), "{column}: {expected}");
}

fn largest<'a>(rows: &'a Value, key: &str) -> &'a Value {
    let size = |row: &&Value| row[key].as_f64().unwrap();
    let largest = rows.as_array().unwrap().iter().max_by(|a, b| size(a).total_cmp(&size(b)));
    &largest.unwrap()[key]
}

#[test]
fn columns_of_any_analysis_are_those_of_its_command() {
    let place = Place::new();
    let row = row(&place, STRUCK);
    let is = |column: &str, expected: &Value| assert_is(&row, column, expected);
    let energies = found(&place, "energies");
    is("energies.driven_j", &energies["last"]["driven_j"]);
    is("energies.left_j", &energies["last"]["left_j"]);
    assert!(energies["last"]["driven_j"].as_f64().unwrap().abs() > 0.0);
    let impurity = found(&place, "impurity --bead 10");
    let turns =
        impurity["events"].as_array().unwrap().iter().filter(|event| event["event"] == "turns").count();
    is("impurity.event_count@10", &impurity["event_count"]);
    is("impurity.turn_count@10", &turns.into());
    is("contacts.compressed_count", &found(&place, "contacts")["last"]["compressed"]);
    let pulses = found(&place, "pulses");
    let strongest = pulses["pulses"].as_array().unwrap().iter().find(|pulse| pulse["direction"] == "forward");
    is("pulses.v_peak_m_s@forward", &strongest.unwrap()["v_peak_m_s"]);
    is("pulses.pulse_count", &pulses["pulse_count"]);
    is("spreading.participation_beads", &found(&place, "spreading")["participation_beads"]);
    let contact = &found(&place, "deformation --contact 20")["contacts"][0];
    is("deformation.overlap_peak_m@20", &contact["first_pulse"]["overlap_peak_m"]);
    is("deformation.exact_l2@20", &contact["exact"]["l2"]);
    let places = &found(&place, "forces --at wall:right --at contact:7")["places"];
    is("forces.peak_n@right", largest(&places[0]["peaks"], "force_n"));
    is("forces.peak_count@contact:7", &places[1]["peak_count"]);
    // what was asked for is drawn by its name
    place.run("plot dir/results.csv --x chain.alpha --y forces.peak_n@right --out f.svg").exits(0);
    assert!(place.read("f.svg").contains("forces peak at right (N)"));
}

#[test]
fn modes_and_spectra_are_columns_too() {
    let place = Place::new();
    let row = row(&place, PRESSED);
    let is = |column: &str, expected: &Value| assert_is(&row, column, expected);
    let modes = &found(&place, "modes")["modes"];
    is("modes.frequency_hz@1", &modes[0]["frequency_hz"]);
    is("modes.centre_bead@3", &modes[2]["centre_bead"]);
    is("modes.largest_j@2", &found(&place, "modes --energy --mode 2")["modes"][0]["largest_j"]);
    let places = &found(&place, "spectrum --at bead:12 --at contact:7")["places"];
    is("spectrum.peak_hz@12", &places[0]["peak_hz"]);
    is("spectrum.mean_square@contact:7", &places[1]["mean_square"]);
    is("forces.rest_force_n@contact:7", &found(&place, "forces --at contact:7")["places"][0]["rest_force_n"]);
}

/// A sweep with other columns is another sweep; one without keeps the identity that it always had.
#[test]
fn what_is_measured_belongs_to_the_sweep() {
    let place = Place::new();
    let sweep = "[base]\npreset = \"homogeneous\"\nchain.beads = 20\ntime.duration_s = 1e-3\n[grid]\nchain.alpha = [1.5]\n";
    place.write("s.toml", sweep);
    place.run("sweep s.toml --out dir").exits(0);
    place.write("s.toml", &format!("measure = [\"spreading.centre\"]\n{sweep}"));
    place.run("sweep s.toml --out dir").exits(2).says(&["another sweep"]);
    place.write("s.toml", &format!("measure = []\n{sweep}"));
    assert_eq!(place.run("sweep s.toml --out dir --json").exits(0).json()["computed"], 0);
}

#[test]
fn what_cannot_be_measured_is_refused_with_its_line() {
    let place = Place::new();
    let base = "[base]\npreset = \"homogeneous\"\nchain.beads = 20\ntime.duration_s = 1e-3\n[grid]\nchain.alpha = [1.5, 2.0]\n";
    for (measure, says) in [
        (
            "[\"energies.drivn_j\"]",
            "measure[0]: found the unknown column `drivn_j` of energies; allowed: split_bead",
        ),
        ("[\"energies.drivn_j\"]", "did you mean `driven_j`?"),
        (
            "[\"energy.driven_j\"]",
            "found the unknown analysis `energy`; allowed: energies, impurity, contacts, pulses",
        ),
        ("[\"forces.peak_n\"]", "found no place; allowed: `forces.peak_n@…`"),
        ("[\"forces.peak_n@right\"]", "wall:right: this end of the chain is free"),
        ("[\"forces.peak_n@99\"]", "bead:99: the chain has beads 0 to 19"),
        ("[\"impurity.u_m@99\"]", "found @99; the chain has beads 0 to 19"),
        ("[\"modes.frequency_hz@1\"]", "contact 0 is not pressed together at rest"),
        (
            "[\"spreading.centre\", \"spreading.centre_beads\"]",
            "measure[1]: found `spreading.centre_beads` twice",
        ),
        (
            "\"energies.driven_j\"",
            "measure: found \"energies.driven_j\"; allowed: a list of columns of analyses",
        ),
        ("[3]", "measure[0]: found 3; allowed: a text in quotes"),
    ] {
        place.write("s.toml", &format!("# a comment\nmeasure = {measure}\n{base}"));
        place.run("sweep s.toml --out dir").exits(2).says(&["s.toml:2: ", says]);
    }
    // frames that are too far apart for the waves of the chain
    let sparse = "measure = [\"spectrum.peak_hz@12\"]\n[base]\npreset = \"precompressed\"\nchain.beads = 40\n\
        time.duration_s = 5e-3\nstream = { publish_every_steps = 500, record_every_steps = 500 }\n";
    place.write("s.toml", sparse);
    place
        .run("sweep s.toml --out dir")
        .exits(2)
        .says(&["s.toml:1: measure[0]", "set stream.publish_every_steps to less"]);
    place.write("s.toml", &format!("mesure = []\n{base}"));
    place.run("sweep s.toml --out dir").exits(2).says(&["s.toml:1: mesure", "did you mean `measure`?"]);
}
