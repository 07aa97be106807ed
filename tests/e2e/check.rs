//! Until when runs are determined: `beadline check`, `run --check`, sweeps and presets.

use crate::harness::Place;
use schemas::presets::PRESETS;
use serde_json::Value;

/// The collision time T (s) of the presets: 1 g at 5 m/s with k = 1e7.
const T_S: f64 = 72.477_966e-6;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn of<'a>(check: &'a Value, quantity: &str) -> &'a Value {
    let all = check["quantities"].as_array().unwrap();
    all.iter().find(|each| each["quantity"] == quantity).unwrap_or_else(|| panic!("no {quantity}: {check}"))
}

/// 50 beads between walls over 276 T with 0.01 T: DOP853 (`SciPy`, rtol 3e-14, steps of at most 0.01 T) ends 2.0e-3 L away;
/// it differs by 4.5e-5 L from itself with 0.002 T. The energy of the run drifts by 9.5e-8 and says nothing.
#[test]
fn the_error_of_the_step_is_that_against_another_solver() {
    let place = Place::new();
    let check = place.run(&format!("check --preset walls --dt {} --json", 0.01 * T_S)).exits(3).json();
    let displacement = of(&check, "displacement");
    let estimated = number(&displacement["step"]["at_end"]);
    assert!((2.0e-3 / 3.0..3.0 * 2.0e-3).contains(&estimated), "{estimated}");
    assert_eq!(displacement["bounded_by"], "step");
    // one unit in the last place grows by a factor of 1e7 or more all the same, and stays far below
    let rounding = number(&displacement["rounding"]["at_end"]);
    assert!((1e-10..1e-5).contains(&rounding), "{rounding}");
    let drift = number(
        &place.run(&format!("run --preset walls --dt {} --no-record --json", 0.01 * T_S)).exits(0).json()["relative_drift"],
    );
    assert!(drift.abs() < 1e-7, "{drift}");
}

/// 1200 beads struck by one of 10 g: solvers agree within 1e-3 L up to 570 T, and at 600 T differ by 5e-3 L, whether the
/// step is 0.02 T, 0.01 T or 0.005 T, or the striker faster by one unit in the last place (an independent `rkn4` in `NumPy`).
#[test]
fn chaos_is_told_from_the_step() {
    let place = Place::new();
    let run = format!("--beads 1200 --impurity 0=10e-3 --dt {} --duration {}", 0.02 * T_S, 700.0 * T_S);
    let check = place.run(&format!("check {run} --tolerance 1e-3 --json")).exits(3).json();
    let displacement = of(&check, "displacement");
    assert_eq!(displacement["bounded_by"], "chaos", "{displacement}");
    let until_t = number(&displacement["determined_until_s"]) / T_S;
    assert!((480.0..620.0).contains(&until_t), "{until_t}");
    let rate = number(&check["growth_per_s"]) * T_S;
    assert!((0.03..0.07).contains(&rate), "{rate}"); // from 1e-16 to 1e-3 in 550 T: 0.054
}

/// The runs of the paper are determined to their ends, and say nothing; those that are not say so without being asked for twins.
#[test]
fn a_run_says_that_it_is_chaotic() {
    let place = Place::new();
    let chaotic = format!("run --beads 1200 --impurity 0=10e-3 --duration {} --no-record", 700.0 * T_S);
    let run =
        place.run(&chaotic).exits(0).says(&["the run is chaotic", "grows as exp(0.0", "beadline check"]);
    let lost_t = number(&place.run(&format!("{chaotic} --json")).exits(0).json()["lost_at_s"]) / T_S;
    assert!((380.0..660.0).contains(&lost_t), "{lost_t}: {}", run.stderr());
    place.run("run --preset walls --duration 0.1 --no-record").exits(0).says(&["the run is chaotic"]);
    for preset in &PRESETS[..5] {
        let run = place.run(&format!("run --preset {} --no-record", preset.name)).exits(0);
        assert!(!run.stderr().contains("chaotic"), "{}: {}", preset.name, run.stderr());
    }
}

/// Under 100 N overlaps are 0.46 mm, rounded to 5e-20 m, and a kick of 1e-13 m/s moves beads by some 1e-17 m: no step helps.
#[test]
fn a_kick_too_weak_for_its_load_is_bounded_by_rounding() {
    let place = Place::new();
    place.write(
        "weak.toml",
        "[chain]\nbeads = 100\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n\
         [load]\nprecompression_n = 100\n[striker]\nbead = 0\nvelocity_m_s = 1e-13\n[time]\nduration_s = 5e-3\n",
    );
    let check = place.run("check weak.toml --json").exits(3).json();
    assert_eq!(of(&check, "velocity")["bounded_by"], "rounding");
    let finer = place.run("check weak.toml --dt 2e-7 --json").exits(3).json();
    assert_eq!(of(&finer, "velocity")["bounded_by"], "rounding");
    assert!(number(&of(&finer, "velocity")["rounding"]["worst"]) > 1e-3);
}

/// A preset that is not determined to its end would have to say so.
#[test]
fn presets_are_determined_to_their_ends() {
    let place = Place::new();
    for preset in PRESETS {
        if !preset.config().bath.is_empty() {
            let refused = place.run(&format!("check --preset {}", preset.name)).exits(2);
            refused.says(&["other noise", "[[bath]]"]);
            place.run(&format!("run --check --preset {}", preset.name)).exits(2).says(&["other noise"]);
            continue;
        }
        let check = place.run(&format!("check --preset {} --json", preset.name)).exits(0).json();
        assert_eq!(check["determined_until_s"], Value::Null, "{}", preset.name);
    }
}

/// A recording is checked up to where it ends, and its last state is compared with the run that is made again.
#[test]
fn a_recording_is_checked_like_its_configuration() {
    let place = Place::new();
    place.run("run --preset homogeneous --beads 40 --duration 2e-3 --record-every-steps 10").exits(0);
    let of_file = place.run("check homogeneous.mcap --json").exits(0).json();
    let of_flags = place.run("check --preset homogeneous --beads 40 --duration 2e-3 --json").exits(0).json();
    assert_eq!(of_file["quantities"], of_flags["quantities"]);
    place.run("check homogeneous.mcap --alpha 2").exits(2).says(&["chain.alpha", "CONFIG.toml"]);
    place.run("check nothing.mcap").exits(2);
    place.run("check --preset walls --tolerance 0").exits(2).says(&["1e-15"]);
}

#[test]
fn growth_is_drawn_and_tabled() {
    let place = Place::new();
    let files = "--figure g.svg --figure g.png --out g.csv";
    let text = place.run(&format!("check --preset walls --duration 5e-3 {files}")).stdout();
    assert!(text.contains("displacement of any bead") && text.contains("dt = "), "{text}");
    let table = place.read("g.csv");
    assert!(table.starts_with("time_s,displacement_step,displacement_rounding,velocity_step,"), "{table}");
    assert!(table.lines().count() > 100);
    assert!(place.read("g.svg").contains("tolerance") && place.path("g.png").exists());
    place.run(&format!("check --preset walls --duration 5e-3 {files}")).exits(2).says(&["--force"]);
    place.run("check --preset walls --figure g.gif").exits(2);
}

/// The twins run beside the run, and change nothing of it.
#[test]
fn a_run_is_checked_while_it_goes() {
    let place = Place::new();
    let walls = format!("--preset walls --duration 20e-3 --dt {} --json", 0.01 * T_S);
    let run = format!("run {walls}");
    let plain = place.run(&format!("{run} --out plain.mcap")).exits(0).json();
    assert_eq!(plain["check"], Value::Null);
    let checked = place.run(&format!("{run} --out checked.mcap --check")).exits(3).json();
    let alone = place.run(&format!("check {walls}")).exits(3).json();
    assert_eq!(checked["check"]["quantities"], alone["quantities"]);
    assert_eq!(checked["relative_drift"], plain["relative_drift"]);
    let hash = |file: &str| {
        let info = recording::RecordingInfo::read(&place.path(file)).unwrap();
        info.end.unwrap().last_state_hash
    };
    assert_eq!(hash("plain.mcap"), hash("checked.mcap"));
    let text = place.run("run --preset homogeneous --beads 40 --duration 2e-3 --no-record --check").exits(0);
    assert!(text.stdout().contains("determined"));
}

/// Rows tell until when their run is determined, if the sweep file asks, whoever computes them.
#[test]
fn sweeps_tell_until_when_each_run_is_determined() {
    let place = Place::new();
    let dt_s = 0.01 * T_S;
    let sweep = format!(
        "[base]\npreset = \"walls\"\ntime.dt_s = {dt_s:e}\n[grid]\ntime.duration_s = [3e-3, 20e-3]\n"
    );
    place.write("plain.toml", &sweep);
    place.write("s.toml", &format!("check = true\n{sweep}"));
    place.run("sweep plain.toml --out plain").exits(0);
    place.run("sweep s.toml --out one --jobs 1").exits(0);
    place.run("sweep s.toml --out two --jobs 2").exits(0);
    let (plain, csv) = (place.read("plain/results.csv"), place.read("one/results.csv"));
    assert_eq!(csv, place.read("two/results.csv"));
    // the columns are added, the others are what they were
    for (line, before) in csv.lines().zip(plain.lines()) {
        assert!(line.starts_with(before), "{line}\n{before}");
    }
    let last = |line: usize| -> Vec<String> {
        let line = csv.lines().nth(line).unwrap();
        line.rsplitn(5, ',').take(4).map(str::to_owned).collect::<Vec<_>>().into_iter().rev().collect()
    };
    let heads = ["determined_until_s", "bounded_by", "reflected_step_error", "reflected_rounding_error"];
    assert_eq!(last(0), heads);
    assert_eq!(last(1)[1], "end");
    assert_eq!(last(2)[1], "step");
    let until_s: f64 = last(2)[0].parse().unwrap();
    assert!((10e-3..20e-3).contains(&until_s), "{until_s}");
    assert!(last(1)[2].parse::<f64>().unwrap() < 1e-6);
    // a sweep with and without the columns are two sweeps
    place.run("sweep s.toml --out plain").exits(2);
}
