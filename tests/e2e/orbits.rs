//! Periodic orbits: what the command finds, writes and refuses.

use crate::harness::{Place, wait_until};
use recording::RecordingSource;
use schemas::frame::{FrameSource as _, Received};
use serde_json::Value;
use std::fs;

/// An example that the command prints, in a place of its own.
fn example(name: &str) -> Place {
    let place = Place::new();
    let text = place.run(&format!("orbit --example {name}")).exits(0).stdout();
    place.write(&format!("{name}.toml"), &text);
    place
}

/// The example without its table `[continue]`, with a line added to `[orbit]`.
fn one(place: &Place, name: &str, line: &str) {
    let text = place.read(&format!("{name}.toml"));
    let text = text.split("# leave this out").next().unwrap().split("[continue]").next().unwrap();
    place.write("one.toml", &text.replace("[orbit]\n", &format!("[orbit]\n{line}\n")));
}

fn changes(found: &Value) -> Vec<(String, f64)> {
    let changes = found["changes"].as_array().unwrap().iter();
    changes
        .map(|change| (change["name"].as_str().unwrap().to_owned(), change["parameter"].as_f64().unwrap()))
        .collect()
}

#[test]
fn the_diode_jumps_at_a_fold_and_is_unsteady_beyond() {
    let place = example("diode");
    let found = place.run("orbit diode.toml --out diode --json").exits(0).json();
    let changes = changes(&found);
    let names: Vec<&str> = changes.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["fold", "fold", "Neimark–Sacker"], "{changes:?}");
    // a run that is shaken harder jumps between 0.61 and 0.74 µm
    assert!((0.61e-6..0.74e-6).contains(&changes[0].1) && changes[1].1 < changes[0].1, "{changes:?}");
    for file in
        ["branch.csv", "branch.png", "multipliers.csv", "multipliers.png", "change-1.mcap", "last.mcap"]
    {
        assert!(place.path("diode").join(file).exists(), "{file}");
    }
    let rms = |run: usize| found["runs"][run]["rms_m_s"].as_f64().unwrap();
    assert!(rms(0) < 1e-7 && rms(1) > 1e-4 && place.path("diode/spectra.png").exists(), "{}", found["runs"]);
    place.run("verify diode/change-1.mcap").exits(0);
    // however often it is interrupted, it has the same bytes
    let running = place.start("orbit diode.toml --out parts");
    wait_until("some orbits", || {
        let journal = fs::read_to_string(place.path("parts").join("branch.journal")).ok()?;
        (journal.lines().count() > 5).then_some(())
    });
    running.signal("INT");
    running.wait().exits(3);
    place.run("orbit diode.toml --out parts").exits(0);
    for file in ["branch.csv", "branch.journal", "branch.png", "orbit.json"] {
        let [whole, parts] =
            ["diode", "parts"].map(|directory| fs::read(place.path(directory).join(file)).unwrap());
        assert!(whole == parts, "{file}");
    }
}

#[test]
fn the_recording_of_an_orbit_comes_back() {
    let place = example("breather");
    one(&place, "breather", "steps = 200");
    let found = place.run("orbit one.toml --out one --json").exits(0).json();
    assert_eq!(
        (found["steps"].as_u64(), found["frequency_is"].as_str()),
        (Some(200), Some("in a band of linear waves"))
    );
    assert!(found["returns"].as_f64().unwrap() < 1e-12 && found["is_stable"] == true, "{found}");
    place.run("verify one/orbit.mcap").exits(0);
    place.run("export one/orbit.mcap --out states.csv").exits(0);
    let states = place.read("states.csv");
    let rows: Vec<Vec<f64>> = states
        .lines()
        .filter_map(|line| line.split(',').map(|field| field.parse().ok()).collect::<Option<Vec<f64>>>())
        .collect();
    let of_step = |step: f64| rows.iter().filter(move |row| row[1] == step).collect::<Vec<_>>();
    let (first, last) = (of_step(0.0)[0], of_step(200.0)[0]);
    assert!(
        first.len() >= 82 && first.iter().zip(last).skip(3).all(|(a, b)| (a - b).abs() < 1e-12),
        "{first:?} {last:?}"
    );
}

/// Resonators that move at first are a part of the initial state.
#[test]
fn orbits_of_resonators_are_recorded() {
    let place = Place::new();
    let text = "[chain]\nbeads = 5\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n[ends]\nleft = \"fixed\"\nright = \"fixed\"\n\
        [load]\nprecompression_n = 20.0\n[resonators]\nmass_kg = { pattern = [4e-4, 0.0] }\nstiffness_n_per_m = 3e5\n\
        [orbit]\namplitude_m = 1e-6\nsteps = 200\nmode = { number = 5, displacement_m = 1e-6 }\n";
    place.write("one.toml", text);
    place.run("orbit one.toml --out one").exits(0);
    place.run("verify one/orbit.mcap").exits(0);
    let mut source = RecordingSource::open(&place.path("one/orbit.mcap")).unwrap();
    let rows = source.manifest().physics.rows();
    let mut states = Vec::new();
    while let Received::Frame(frame) = source.receive().unwrap() {
        let [w_m, w_m_s] = rows.resonators_of(frame.extra);
        states.push((frame.u_m.to_vec(), w_m.to_vec(), w_m_s.to_vec()));
    }
    let ((u_m, w_m, _), (_, last_w_m, last_w_m_s)) = (&states[0], &states[states.len() - 1]);
    assert!(states.len() > 100 && w_m != u_m, "{u_m:?} {w_m:?}");
    let is_close = |(one, other): (&f64, &f64)| (one - other).abs() < 1e-12;
    assert!(w_m.iter().zip(last_w_m).all(is_close), "{w_m:?} {last_w_m:?}");
    assert!(last_w_m_s.iter().all(|w_m_s| w_m_s.abs() < 1e-8), "{last_w_m_s:?}");
    // a key at the wrong place has its line
    let run = "[chain]\nbeads = 2\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n[time]\nduration_s = 1e-3\n[initial]\n";
    for (resonators, list, told) in [
        (
            "",
            "[1e-6, 0.0]",
            "run.toml:9: initial.resonator_displacements_m: found 2 values; allowed: none without",
        ),
        (
            "[resonators]\nmass_kg = 1e-3\nstiffness_n_per_m = 1e5\n",
            "[1e-6]",
            "run.toml:9: initial.resonator_displacements_m: found 1 values; allowed: 2 values",
        ),
    ] {
        place.write("run.toml", &format!("{run}resonator_displacements_m = {list}\n{resonators}"));
        place.run("run run.toml").exits(2).says(&[told]);
    }
}

/// However often a branch is interrupted, its files are the same.
#[test]
fn an_interrupted_branch_goes_on_to_the_same_bytes() {
    let place = example("fput");
    place.run("orbit fput.toml --out whole").exits(0);
    place.run("orbit fput.toml --out parts").exits(0);
    // as a kill leaves it: some rows, the last of them torn
    let journal = place.path("parts").join("branch.journal");
    let text = fs::read_to_string(&journal).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert!(lines.len() > 6, "{}", lines.len());
    let torn = format!("{}\n{}", lines[..5].join("\n"), &lines[5][..lines[5].len() / 2]);
    fs::write(&journal, torn).unwrap();
    for file in ["branch.csv", "orbit.json", "last.mcap"] {
        fs::remove_file(place.path("parts").join(file)).unwrap();
    }
    place.run("orbit fput.toml --out parts").exits(0);
    for file in ["branch.csv", "branch.journal", "branch.png", "multipliers.csv", "orbit.json"] {
        let [whole, parts] =
            ["whole", "parts"].map(|directory| fs::read(place.path(directory).join(file)).unwrap());
        assert!(whole == parts, "{file}");
    }
    // one that has ended is told again, and what is damaged is found again
    fs::write(&journal, text.replacen(lines[3], &lines[3].replacen("index", "indes", 1), 1)).unwrap();
    let told = place.run("orbit fput.toml --out parts").exits(0);
    assert!(told.stderr().contains("is damaged: 2 orbits before it kept"), "{}", told.stderr());
    let told = place.run("orbit fput.toml --out parts").exits(0);
    assert!(!told.stderr().contains("is damaged"), "{}", told.stderr());
    let rows = |directory: &str| fs::read(place.path(directory).join("branch.csv")).unwrap();
    assert!(rows("whole") == rows("parts"));
    let others =
        ["orbit7", "last5", "last-"].map(|other| place.write(&format!("parts/{other}.mcap"), "other"));
    let found = place.run("orbit fput.toml --out parts --force --json").exits(0).json();
    assert!(others.iter().all(|other| other.exists()));
    let changes = changes(&found);
    assert!(changes.len() == 1 && (changes[0].1 - 0.218_181_686_716).abs() < 1e-9, "{changes:?}");
}

/// Two shaken beads: where the orbit doubles its period, the branch that is born there turns twice, and is followed as the first one is.
#[test]
fn a_branch_that_is_born_is_followed_recorded_and_goes_on_to_the_same_bytes() {
    let place = example("pair");
    let found = place.run("orbit pair.toml --out whole --json").exits(0).json();
    let names: Vec<String> = changes(&found).into_iter().map(|(name, _)| name).collect();
    assert_eq!(names, ["period doubling", "fold"], "{found}");
    assert_eq!(found["changes"][0]["bears"], serde_json::json!([1]), "{found}");
    let born = &found["branches"][0];
    assert!(born["periods"] == 2 && born["end"] == "reached" && born["last"]["is_stable"] == true, "{born}");
    assert!(found["last"]["is_stable"] == false);
    place.run("verify whole/last-1.mcap").exits(0);
    let lines = rows(&place, "whole/branch.csv");
    let of_branch = |number: &str| lines.iter().filter(|row| row[7] == number).count();
    assert!(of_branch("0") + of_branch("1") == lines.len() && of_branch("1") > 10, "{lines:?}");
    // as a kill leaves it in the second branch, and beside its beginning
    place.run("orbit pair.toml --out parts").exits(0);
    let journal = place.path("parts").join("branch.journal");
    let text = fs::read_to_string(&journal).unwrap();
    let kept: Vec<&str> = text.lines().collect();
    for kept_count in [of_branch("0") + 1, of_branch("0") + 6] {
        fs::write(&journal, kept[..kept_count].join("\n") + "\n").unwrap();
        place.run("orbit pair.toml --out parts").exits(0);
        for file in ["branch.csv", "branch.journal", "branch.png", "multipliers.csv", "orbit.json"] {
            let [whole, parts] =
                ["whole", "parts"].map(|directory| fs::read(place.path(directory).join(file)).unwrap());
            assert!(whole == parts, "{file}");
        }
    }
    // a ring loses two directions at once, and this is told
    let ring = place.run("orbit --example fput").exits(0).stdout() + "branches = true\n";
    place.write("ring.toml", &ring);
    let found = place.run("orbit ring.toml --out ring --json").exits(3).json();
    let why = found["changes"][0]["bears_none"].as_str().unwrap();
    assert!(why.contains("two multipliers pass at once"), "{why}");
}

#[test]
fn an_orbit_of_a_long_chain_tells_which_multipliers_are_known() {
    let place = Place::new();
    let text = "[chain]\nbeads = 1200\nbead_mass_kg = 1.0\nalpha = 1.5\nstiffness = 1.0\nimpurities = [{ bead = 600, mass_kg = 0.2 }]\n\
        [ends]\nleft = \"fixed\"\nright = \"fixed\"\n[load]\nprecompression_n = 1.0\n\
        [orbit]\namplitude_m = 0.2\nmode = { number = 1200, displacement_m = 0.1 }\n";
    place.write("one.toml", text);
    let told = place.run("orbit one.toml --out one").exits(0).stdout();
    assert!(told.contains("stable as far as known") && told.contains("above 1.0"), "{told}");
    place.run("verify one/orbit.mcap").exits(0);
    let found: Value = serde_json::from_str(&place.read("one/orbit.json")).unwrap();
    let above = found["multipliers_limit"]["above"].as_f64().unwrap();
    assert!((1.0..1.1).contains(&above) && found["is_stable"].is_null(), "{found}");
    assert!(
        found["returns"].as_f64().unwrap() < 1e-11 && place.path("one/multipliers.png").exists(),
        "{found}"
    );
}

#[test]
fn impossible_orbits_are_refused_with_the_key_and_leave_nothing() {
    let place = example("breather");
    let text = place.read("breather.toml");
    let text = text.split("# leave this out").next().unwrap();
    let drive = "\n[[drive]]\nwall = \"left\"\ndisplacement_m = { sine = { amplitude = 0.01, frequency_hz = 0.4 } }\n";
    for (from, to, code, expected) in [
        ("amplitude_m = 0.02\n", "", 2, "orbit.period_s: found nothing"),
        ("amplitude_m = 0.02\n", "amplitude_m = 0.02\nenergy_j = 1.0\n", 2, "one of the two"),
        ("amplitude_m = 0.02\n", "amplitude_m = 0.02\nperiod = 3\n", 2, "unknown key"),
        ("amplitude_m = 0.02\n", "period_s = -1.0\n", 2, "above 0"),
        ("number = 22", "number = 99", 2, "a mode from 1 to 41"),
        ("mode = { number = 22, displacement_m = 0.02 }\n", "period_s = 2.0\n", 2, "a seed"),
        ("[load]\nprecompression_n = 1.0\n", "", 2, "pressed together"),
        ("[orbit]", "[on_site]\ndrag_n_s_per_m = 0.1\n[orbit]", 2, "loses energy"),
        ("[orbit]", "[integrator]\nmethod = \"gear5\"\n[orbit]", 2, "choose another method"),
        ("[orbit]", &format!("{drive}[orbit]"), 2, "leave energy_j and amplitude_m out"),
        ("beads = 41", "beads = 4", 2, "a mode from 1 to 4"),
        (
            "[orbit]",
            "[continue]\nkey = \"orbit.amplitude_m\"\nfrom = 1.0\nto = 1.0\n[orbit]",
            2,
            "other than continue.from",
        ),
        (
            "amplitude_m = 0.02\n",
            "amplitude_m = 0.02\nsteps = 41\n",
            2,
            "orbit.steps: found 41; allowed: a multiple of 2",
        ),
        ("amplitude_m = 0.02\n", "amplitude_m = 0.02\nperiods = 2\n", 2, "nothing without [[drive]]"),
        (
            "[orbit]",
            "[continue]\nkey = \"orbit.mode.number\"\nfrom = 1.0\nto = 2.0\n[orbit]",
            2,
            "orbit.mode.number: found 1; allowed: a key that takes every number",
        ),
        ("[orbit]", "[continue]\nkey = \"chain[0].no\"\nfrom = 1.0\nto = 2.0\n[orbit]", 2, "no list"),
    ] {
        let wrong = text.replace(from, to);
        assert_ne!(wrong, text, "{from}");
        place.write("wrong.toml", &wrong);
        let refused = place.run("orbit wrong.toml --out wrong").exits(code);
        assert!(refused.stderr().contains(expected), "{expected}: {}", refused.stderr());
        assert!(!place.path("wrong").exists(), "{expected}");
    }
    fs::create_dir(place.path("other")).unwrap();
    place.write("other/notes.txt", "mine");
    let refused = place.run("orbit breather.toml --out other").exits(2);
    assert!(refused.stderr().contains("holds something else"), "{}", refused.stderr());
    assert!(place.run("orbit --example no").exits(2).stderr().contains("breather, diode, fput, map, pair"));
}

/// The example of a map with 6 values of each key.
fn small_map(place: &Place) {
    let text = place.read("map.toml").replace("count = 13", "count = 6").replace("count = 16", "count = 6");
    // the run's own number differs along a line
    let text = text.replace("[orbit]\n", "[orbit]\nsteps = 1000\n");
    place.write("map.toml", &text);
}

fn rows(place: &Place, file: &str) -> Vec<Vec<String>> {
    place.read(file).lines().skip(1).map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

#[test]
fn points_of_a_map_are_orbits_of_their_own() {
    let place = example("map");
    small_map(&place);
    let found = place.run("orbit map.toml --out map --json").exits(0).json();
    let rows = rows(&place, "map/map.csv");
    assert_eq!((found["points"].as_u64(), rows.len()), (Some(36), 36));
    let counted: u64 = found["stability"].as_object().unwrap().values().map(|n| n.as_u64().unwrap()).sum();
    assert!(counted == 36 && found["stability"]["period doubling"].as_u64() > Some(0), "{found}");
    assert!(place.path("map/map.png").exists());
    let text = place.read("map.toml");
    for row in [0, 5, 17, 35].map(|row| &rows[row]) {
        let one = text.split("# two keys").next().unwrap();
        let one = one.replace("frequency_hz = 10500.0", &format!("frequency_hz = {}", row[0]));
        place.write("one.toml", &one.replace("amplitude = 1e-8", &format!("amplitude = {}", row[1])));
        let alone = place.run("orbit one.toml --out one --force --json").exits(0).json();
        let largest = alone["multipliers"][0].clone();
        let size = largest["re"].as_f64().unwrap().hypot(largest["im"].as_f64().unwrap());
        let number = |column: usize| row[column].parse::<f64>().unwrap();
        let energy = alone["energy_j"].as_f64().unwrap();
        assert!(
            (number(3) / energy - 1.0).abs() < 1e-9 && (number(5) - size).abs() < 1e-7,
            "{row:?} {alone}"
        );
        assert_eq!(row[9] == "stable", alone["is_stable"] == true, "{row:?}");
        assert_eq!(row[8].is_empty(), alone["is_stable"] == true, "{row:?}");
    }
}

/// However many threads find a map, and however often it is interrupted, its files are the same.
#[test]
fn an_interrupted_map_goes_on_to_the_same_bytes() {
    let place = example("map");
    small_map(&place);
    place.run("orbit map.toml --out whole --jobs 2").exits(0);
    place.run("orbit map.toml --out parts --jobs 1").exits(0);
    // as a kill leaves it: a line of the map, a part of the next one, a torn row
    let journal = place.path("parts").join("map.journal");
    let text = fs::read_to_string(&journal).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 37);
    fs::write(&journal, format!("{}\n{}", lines[..10].join("\n"), &lines[10][..20])).unwrap();
    for file in ["map.csv", "map.png", "orbit.json"] {
        fs::remove_file(place.path("parts").join(file)).unwrap();
    }
    place.run("orbit map.toml --out parts").exits(0);
    for file in ["map.csv", "map.png", "orbit.json"] {
        let [whole, parts] =
            ["whole", "parts"].map(|directory| fs::read(place.path(directory).join(file)).unwrap());
        assert!(whole == parts, "{file}");
    }
    // a signal keeps whole lines, and the same command goes on
    let large = place.read("map.toml").replace("count = 6", "count = 61");
    place.write("large.toml", &large);
    let running = place.start("orbit large.toml --out large --jobs 1");
    wait_until("a line", || {
        let journal = fs::read_to_string(place.path("large").join("map.journal")).ok()?;
        (journal.lines().count() > 61).then_some(())
    });
    running.signal("INT");
    running.wait().exits(3);
    assert!(!place.path("large/map.csv").exists());
}

#[test]
fn impossible_maps_are_refused_with_the_line_and_leave_nothing() {
    let place = example("map");
    let text = place.read("map.toml");
    let amplitude = "\"drive[0].displacement_m.sine.amplitude\" = { from = 5e-8, to = 8e-7, count = 16 }\n";
    let follow = "[continue]\nkey = \"orbit.periods\"\nfrom = 1.0\nto = 2.0\n[grid]";
    for (from, to, expected) in [
        (amplitude, "", "map.toml:28: grid: found 1 key;"),
        ("count = 16", "count = 1", "map.toml:30: drive[0]"),
        ("count = 16", "count = 4000", "at most 10000"),
        ("from = 10000", "from = -10000", "map.toml:29: drive[0]"),
        ("{ from = 5e-8, to = 8e-7, count = 16 }", "[\n1e-7,\n\"much\"]", "map.toml:32: drive[0]"),
        ("{ from = 5e-8, to = 8e-7, count = 16 }", "[1e-7, 3e-7, 2e-7]", "rise or fall"),
        ("drive[0].displacement_m.sine.amplitude", "drive[1].displacement_m.sine.amplitude", "entry 1"),
        ("[grid]", follow, "[grid] beside it"),
    ] {
        let wrong = text.replace(from, to);
        assert_ne!(wrong, text, "{from}");
        place.write("map.toml", &wrong);
        let refused = place.run("orbit map.toml --out wrong").exits(2);
        assert!(refused.stderr().contains(expected), "{expected}: {}", refused.stderr());
        assert!(!place.path("wrong").exists(), "{expected}");
    }
    // beyond the last orbit of a branch nothing is found, and this is told
    let example = place.run("orbit --example diode").exits(0).stdout();
    let beyond = "\n[grid]\n\"drive[0].displacement_m.sine.frequency_hz\" = [10490.0, 10500.0]\n\
        \"drive[0].displacement_m.sine.amplitude\" = [6e-7, 8e-7]\n";
    place.write("beyond.toml", &(example.split("[continue]").next().unwrap().to_owned() + beyond));
    let missed = place.run("orbit beyond.toml --out beyond --json").exits(3);
    assert!(missed.stderr().contains("no orbit was found at 2 points"), "{}", missed.stderr());
    assert_eq!(missed.json()["points"], 4);
}

/// Towards low frequencies the steps of a period become longer than those of any run: nothing there is an orbit, and this is told.
#[test]
fn steps_that_become_too_long_end_a_branch_and_leave_points_of_a_map_out() {
    let place = Place::new();
    let chain = "[chain]\nbeads = 3\nbead_mass_kg = 1.0\nalpha = 1.5\nstiffness = 1.0\n[ends]\nleft = \"fixed\"\nright = \"fixed\"\n\
        [load]\nprecompression_n = 1.0\n[on_site]\ndrag_n_s_per_m = 0.1\n[[drive]]\nwall = \"left\"\n\
        displacement_m = { sine = { amplitude = 0.05, frequency_hz = 0.5 } }\n[orbit]\n";
    let sine = "drive[0].displacement_m.sine";
    place.write(
        "map.toml",
        &format!(
            "{chain}[grid]\n\"{sine}.amplitude\" = [0.02, 0.05]\n\"{sine}.frequency_hz\" = [0.5, 0.005]\n"
        ),
    );
    let missed = place.run("orbit map.toml --out map --json").exits(3);
    assert!(missed.stderr().contains("no orbit was found at 2 points"), "{}", missed.stderr());
    let counted = missed.json()["stability"].clone();
    assert_eq!(counted["no orbit found: steps too long (orbit.steps)"], 2, "{counted}");
    let along = format!(
        "steps = 200\n[continue]\nkey = \"{sine}.frequency_hz\"\nfrom = 0.05\nto = 0.01\nstep = 0.1\n"
    );
    place.write("branch.toml", &format!("{chain}{along}"));
    let ended = place.run("orbit branch.toml --out branch --json").exits(3);
    assert!(ended.stderr().contains("orbit.steps: found"), "{}", ended.stderr());
    let found = ended.json();
    assert!(found["end"] == "lost" && found["orbits"].as_u64() > Some(2), "{found}");
    place.run("verify branch/last.mcap").exits(0);
    // no distance is a part of the size of a seed at rest
    place.write("rest.toml", &chain.replace("0.5 }", "0.05 }").replace("[orbit]", "[orbit]\nsteps = 200"));
    let residuals = place.run("orbit rest.toml --out rest --json").exits(0).json()["residuals"].clone();
    assert!(residuals[0].is_null() && residuals[1].is_f64(), "{residuals}");
    place.write("slow.toml", &chain.replace("0.5 }", "0.005 }").replace("[orbit]", "[orbit]\nsteps = 100"));
    let refused = place.run("orbit slow.toml --out slow").exits(2);
    assert!(refused.stderr().contains("orbit.steps: found 100, of 2.00000 s"), "{}", refused.stderr());
}

/// In a ring two modes have one frequency, and Newton's method may add the other one to the seed: the bead that was asked for then moves less
/// than others, and that is said.
#[test]
fn a_bead_that_moves_less_than_others_is_told() {
    let place = Place::new();
    let text = "[chain]\nbeads = 5\nbead_mass_kg = 1.0\nbonds = { linear = 1.0, cubic = 1.0 }\n[ends]\nleft = \"periodic\"\n\
        right = \"periodic\"\n[orbit]\namplitude_m = 0.3\nmode = { number = 2, displacement_m = 0.3 }\n";
    place.write("one.toml", text);
    let words = place.run("orbit one.toml --out one").exits(0).stdout();
    let found = place.run("orbit one.toml --out again --json").exits(0).json();
    let is_surpassed = found["amplitude_m"].as_f64().unwrap() > 0.3 * (1.0 + 1e-6);
    assert!(found["asked_bead"].is_u64(), "{found}");
    assert_eq!(words.contains("asked for             300.000 mm, of bead"), is_surpassed, "{words}");
}

/// Bonds without a linear part carry no linear waves that an orbit could lie above.
#[test]
fn an_orbit_of_cubic_bonds_lies_beside_no_bands() {
    let place = Place::new();
    let text = "[chain]\nbeads = 4\nbead_mass_kg = 1.0\nbonds = { cubic = 1e6 }\n[ends]\nleft = \"fixed\"\nright = \"fixed\"\n\
        [initial]\ndisplacements_m = [0.01, -0.01, 0.01, -0.01]\n[orbit]\nperiod_s = 0.2\namplitude_m = 0.01\n";
    place.write("cubic.toml", text);
    let found = place.run("orbit cubic.toml --out cubic --json").exits(0).json();
    assert!(found["frequency_is"].is_null(), "{found}");
}
