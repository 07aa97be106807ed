//! `beadline pulses`, against numbers that Beadline did not compute and against the exact solitary wave.

use crate::harness::{Place, wait_until};
use bus::{Delivery, ResultReceived, ResultSubscriber};
use consumers::pulses::{Happening, Point, Probes, Pulses};
use consumers::theory::{SolitaryWave, Strength};
use producer::integrator::Integrator;
use producer::state::ChainState;
use recording::RecordingSource;
use schemas::config::{MassRule, RunConfig};
use schemas::frame::{Frame, FrameSource, Received};
use schemas::manifest::{Origin, RunManifest};
use schemas::presets::{PRESETS, Preset};
use schemas::results::Topic;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A row of a table, by column.
type Row = BTreeMap<String, String>;

fn rows(text: &str) -> Vec<Row> {
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned));
    let names: Vec<_> = lines.next().unwrap().collect();
    lines.map(|fields| names.iter().cloned().zip(fields).collect()).collect()
}

fn number(row: &Row, column: &str) -> f64 {
    row[column].parse().unwrap_or_else(|_| panic!("{column}: {row:?}"))
}

/// Asserts the first pulses that pass bead 700 forward and bead 300 backward, in the order of arrival.
fn check(place: &Place, arguments: &str, reference: &str, tolerance: f64) {
    let run = place.start(&format!("run {arguments} --no-record --wait-for 1"));
    place.run("pulses --positions tracks.csv").exits(0);
    run.wait().exits(0);
    let points = rows(&place.read("tracks.csv"));
    let path = format!("{}/tests/reference/{reference}", env!("CARGO_MANIFEST_DIR"));
    for expected in rows(&std::fs::read_to_string(path).unwrap()) {
        let (bead, sign) = if expected["direction"] == "forward" { (700.0, 1.0) } else { (300.0, -1.0) };
        let passes = |row: &&Row| number(row, "bead") == bead && number(row, "v_peak_m_s") * sign > 0.0;
        let mut passing: Vec<_> = points.iter().filter(passes).collect();
        passing.sort_by(|a, b| number(a, "time_s").total_cmp(&number(b, "time_s")));
        let found = passing[expected["order"].parse::<usize>().unwrap() - 1];
        for column in ["v_peak_m_s", "speed_beads_per_s"] {
            let difference = number(found, column) / number(&expected, column) - 1.0;
            assert!(difference.abs() < tolerance, "{expected:?}: {found:?}, {difference:e}");
        }
    }
}

/// Ten pulses; the weakest pass after 0.12 s. The reference is good to 1e-5.
#[test]
fn the_pulses_of_a_light_impurity_are_those_of_the_reference() {
    check(&Place::new(), "--preset light-impurity --duration 0.125", "light-impurity-pulses.csv", 1e-5);
}

/// Eight pulses; the weakest passes after 91 ms. The reference is good to 1e-6.
#[test]
fn the_pulses_of_a_heavy_impurity_are_those_of_the_reference() {
    check(&Place::new(), "--preset heavy-impurity --duration 0.1", "heavy-impurity-pulses.csv", 2e-6);
}

#[test]
fn a_homogeneous_chain_carries_one_pulse_the_solitary_wave() {
    let place = Place::new();
    place.run("run --preset homogeneous").exits(0);
    place.run("pulses homogeneous.mcap --out pulses.csv --figure f.svg --figure f.png").exits(0);
    let pulses = rows(&place.read("pulses.csv"));
    let [pulse] = &pulses[..] else { panic!("{pulses:?}") };
    assert_eq!((pulse["direction"].as_str(), pulse["birth"].as_str()), ("forward", "striker"));
    assert_eq!(pulse["end"], "under-way");
    // 180 beads from the striker the pulse is stationary, so that all is exact but for the interpolation: of the
    // crest by a quartic (the peak to 1e-9, its time to less), of the edges by a cubic (1e-7 of the width), of
    // the sums by frames two steps after the crest (the tails beyond 1e-6 of the peak are left out)
    assert!((number(pulse, "speed_over_solitary") - 1.0).abs() < 1e-9, "{pulse:?}");
    assert!((number(pulse, "fwhm_over_solitary") - 1.0).abs() < 1e-7, "{pulse:?}");
    assert!(number(pulse, "asymmetry").abs() < 1e-7, "{pulse:?}");
    let wave = SolitaryWave::new(1.5).unwrap().coefficients();
    let strength = Strength::PeakVelocity { m_s: number(pulse, "v_peak_m_s") };
    let exact = wave.scaled(1e-3, 1e7, strength).unwrap();
    assert!((number(pulse, "momentum_kg_m_s") / exact.momentum_kg_m_s - 1.0).abs() < 1e-6, "{pulse:?}");
    assert!((number(pulse, "energy_j") / exact.energy_j - 1.0).abs() < 1e-6, "{pulse:?}");
}

/// Nearly hard beads: the pulse is one bead wide, so that at most two beads move at a time.
#[test]
fn a_pulse_of_one_bead_is_measured_as_well() {
    let place = Place::new();
    place.run("run --preset homogeneous --beads 100 --alpha 10 --duration 3 --name hard").exits(0);
    place.run("pulses hard.mcap --out pulses.csv").exits(0);
    let pulses = rows(&place.read("pulses.csv"));
    let [pulse] = &pulses[..] else { panic!("{pulses:?}") };
    // as above; a pulse of one bead takes as many frames for it
    assert!((number(pulse, "speed_over_solitary") - 1.0).abs() < 1e-9, "{pulse:?}");
    assert!((number(pulse, "fwhm_over_solitary") - 1.0).abs() < 1e-7, "{pulse:?}");
}

/// A pulse that comes back from a heavy bead meets one on its way there at bead 17, after 18.5 ms.
#[test]
fn pulses_are_followed_through_each_other() {
    let place = Place::new();
    let beads = "--impurity 0=1 --impurity 199=1 --striker 100=5";
    place.run(&format!("run --preset homogeneous {beads} --duration 0.02 --name box")).exits(0);
    place.run("pulses box.mcap --threshold 0.01 --out pulses.csv").exits(0);
    let pulses = rows(&place.read("pulses.csv"));
    let went = |direction, from: std::ops::Range<f64>, to: std::ops::Range<f64>| {
        let whole = |row: &&Row| {
            let (birth, end) = (number(row, "birth_bead"), number(row, "end_bead"));
            row["direction"] == direction && from.contains(&birth) && to.contains(&end)
        };
        pulses.iter().filter(whole).count()
    };
    assert_eq!(went("backward", 95.0..100.0, 5.0..12.0), 1, "{pulses:?}");
    assert_eq!(went("forward", 1.0..3.0, 25.0..30.0), 1, "{pulses:?}");
}

/// A chain of 201 beads that are not alike, struck with 1 m/s; `rest` is what else its configuration says.
fn uneven(place: &Place, name: &str, masses: &str, duration_s: f64, rest: &str) {
    let text = format!(
        "[chain]\nbeads = 201\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\nmasses = {masses}\n{rest}\n\
         [striker]\nbead = 0\nvelocity_m_s = 1.0\n[time]\nduration_s = {duration_s}\n"
    );
    place.write(&format!("{name}.toml"), &text);
    place.run(&format!("run {name}.toml --publish-every-steps 2 --out {name}.mcap")).exits(0);
}

/// What a recording shows of the front, without any tracks.
struct Front {
    /// When each bead first moved with a hundredth of the striker's speed (s), of those that did.
    arrivals_s: Vec<f64>,
    /// The largest velocity of a bead (m/s) until the front had moved 10 beads farther.
    v_peak_m_s: f64,
}

fn front(place: &Place, recording: &str, bead: usize) -> Front {
    let mut source = RecordingSource::open(&place.path(recording)).unwrap();
    let mut front = Front { arrivals_s: Vec::new(), v_peak_m_s: 0.0 };
    while let Received::Frame(frame) = source.receive().unwrap() {
        while frame.v_m_s.get(front.arrivals_s.len()).is_some_and(|v| v.abs() > 0.01) {
            front.arrivals_s.push(frame.time_s);
        }
        if front.arrivals_s.len() <= bead + 10 && frame.v_m_s[bead] > front.v_peak_m_s {
            front.v_peak_m_s = frame.v_m_s[bead];
        }
    }
    front
}

/// N masses (kg) of `1 + scatter·sin(2.3·i²)` grams: as good as random.
fn scattered(scatter: f64) -> String {
    let masses = (0..201).map(|i| format!("{:e}", 1e-3 * (1.0 + scatter * (2.3 * f64::from(i * i)).sin())));
    format!("{{ list_kg = [{}] }}", masses.collect::<Vec<_>>().join(", "))
}

/// A name, masses, how long (s), what else there is; how many beads the front passes; and how many pulses are at least
/// half as fast as the one that leads, where waves of scattered masses do not hide that.
type Case<'a> = (&'a str, &'a str, f64, &'a str, u32, Option<usize>);

/// Light beads rattle between heavy ones while a pulse passes, with contacts that open in between. The front is one
/// pulse all the same, as fast as its beads ever are, and as what moves first in each bead.
#[test]
fn the_front_of_a_pattern_of_beads_is_one_pulse() {
    check_fronts(&[
        ("decorated", "{ pattern_kg = [1e-3, 0.1e-3] }", 0.02, "", 195, Some(1)),
        ("solitary", "{ pattern_kg = [1e-3, 0.3428e-3] }", 0.02, "", 190, Some(1)),
        ("two-to-one", "{ pattern_kg = [2e-3, 1e-3] }", 0.02, "", 125, Some(4)),
        // at bead 129 a wave behind it, which weakens less, has caught up with the front
        ("less", "{ pattern_kg = [1e-3, 0.6e-3] }", 0.015, "", 115, Some(2)),
        ("heavy", "{ pattern_kg = [4.369e-3, 1e-3] }", 0.035, "", 180, Some(1)),
        ("three", "{ pattern_kg = [1e-3, 1e-3, 0.3e-3] }", 0.02, "", 145, Some(3)),
        ("four", "{ pattern_kg = [2e-3, 0.3e-3, 1e-3, 0.3e-3] }", 0.02, "", 150, Some(1)),
    ]);
}

#[test]
fn the_front_of_scattered_and_tapered_beads_is_one_pulse() {
    let (fifth, more, most) = (scattered(0.2), scattered(0.4), scattered(0.8));
    let two = (0..201).map(|i| if (2.3 * f64::from(i * i)).sin() > 0.0 { "1e-3" } else { "0.3e-3" });
    let two = format!("{{ list_kg = [{}] }}", two.collect::<Vec<_>>().join(", "));
    check_fronts(&[
        ("fifth", fifth.as_str(), 0.02, "", 140, Some(1)),
        ("more", more.as_str(), 0.02, "", 120, None),
        ("most", most.as_str(), 0.02, "", 90, None),
        ("two-kinds", two.as_str(), 0.02, "", 120, None),
        ("tapered", "{ taper = 0.95 }", 0.006, "", 190, Some(1)),
    ]);
}

#[test]
fn the_front_of_a_train_and_of_a_loaded_chain_is_one_pulse() {
    let striker = "impurities = [{ bead = 0, mass_kg = 20e-3 }]";
    let loaded = "[load]\nprecompression_n = 10.0";
    let scattered = scattered(0.2);
    check_fronts(&[
        ("train", "{ pattern_kg = [1e-3, 0.3428e-3] }", 0.014, striker, 150, Some(4)),
        ("loaded", "{ pattern_kg = [1e-3, 0.5e-3] }", 0.012, loaded, 150, Some(1)),
        ("loaded-scatter", scattered.as_str(), 0.012, loaded, 130, None),
    ]);
}

fn check_fronts(chains: &[Case<'_>]) {
    let place = Place::new();
    for (name, masses, duration_s, rest, reached, strong) in chains.iter().copied() {
        uneven(&place, name, masses, duration_s, rest);
        let told = place.run(&format!("pulses {name}.mcap --json --positions {name}.csv")).exits(0);
        let results = told.json()["results"].clone();
        assert_eq!(
            (&results["unfollowed_count"], &results["leading_pulse_followed"]),
            (&0.into(), &true.into()),
            "{name}"
        );
        let points = rows(&place.read(&format!("{name}.csv")));
        let first: Vec<_> = points.iter().filter(|row| number(row, "pulse") == 1.0).collect();
        let beads: Vec<_> = first.iter().map(|row| number(row, "bead")).collect();
        let last = beads[beads.len() - 1];
        assert!(beads[0] < 6.0 && last > f64::from(reached), "{name}: {beads:?}");
        // no bead is skipped, but for a few
        assert!(beads.len() as f64 > 0.9 * (last - beads[0]), "{name}: {beads:?}");
        let at = |bead: f64| first.iter().find(|row| number(row, "bead") >= bead).unwrap();
        let [from, middle, to] = [0.3, 0.6, 0.9].map(|part| at(part * last));
        let [a, bead, b] = [from, middle, to].map(|row| row["bead"].parse::<usize>().unwrap());
        let Front { arrivals_s, v_peak_m_s } = front(&place, &format!("{name}.mcap"), bead);
        assert!(arrivals_s.len() as f64 > last, "{name}: {}, {last}", arrivals_s.len());
        // frames a 25th of a collision time apart, between which the peak lies
        assert!(
            (number(middle, "v_peak_m_s") / v_peak_m_s - 1.0).abs() < 2e-3,
            "{name}: {middle:?}, {v_peak_m_s}"
        );
        // crest and front move alike, but for what a pulse gets wider on its way or, in a taper, narrower and faster
        let apart_s = number(to, "time_s") - number(from, "time_s");
        let ratio = (arrivals_s[b] - arrivals_s[a]) / apart_s;
        let most = if name == "tapered" { 0.07 } else { 0.04 };
        assert!((ratio - 1.0).abs() < most, "{name}: {ratio}");
        let found = results["pulses"].as_array().unwrap();
        let speed = |pulse: &serde_json::Value| pulse["v_peak_m_s"].as_f64().unwrap().abs();
        let leading = speed(found.iter().find(|pulse| pulse["pulse"] == 1).unwrap());
        if let Some(strong) = strong {
            assert_eq!(found.iter().filter(|pulse| speed(pulse) > 0.5 * leading).count(), strong, "{name}");
        }
    }
}

/// Both ends of a chain are struck. The pulses meet in the middle, go on, and reach the other ends.
#[test]
fn pulses_of_unlike_beads_are_followed_through_each_other() {
    for light_kg in [0.1e-3, 0.3428e-3, 1e-3] {
        let mut config = PRESETS[2].config();
        config.chain.beads = 121;
        config.chain.masses = MassRule::PatternKg(vec![1e-3, light_kg]);
        (config.striker.velocity_m_s, config.time.duration_s) = (1.0, 0.014);
        let mut v_m_s = vec![0.0; 121];
        (v_m_s[0], v_m_s[120]) = (1.0, -1.0);
        let mut arrivals_s = Vec::new();
        let points = points_of(&config, &v_m_s, 0.02, |frame| {
            while arrivals_s.len() < 60 && frame.v_m_s[arrivals_s.len()] > 0.01 {
                arrivals_s.push(frame.time_s);
            }
        });
        // of heavy beads
        let front = 40.0 / (arrivals_s[50] - arrivals_s[10]);
        for mirrored in [false, true] {
            let place = |bead: u64| if mirrored { 120 - bead } else { bead };
            let of_pulse = |number: u64| points.iter().filter(move |point| point.pulse == number);
            let is_whole = |number: &u64| {
                let beads: Vec<u64> = of_pulse(*number).map(|point| place(point.bead)).collect();
                beads.len() > 105 && beads[0] < 10 && beads[beads.len() - 1] > 110
            };
            let whole: Vec<u64> = (1..100).filter(is_whole).collect();
            let [number] = whole[..] else { panic!("{light_kg}: {whole:?}") };
            let at = |bead| *of_pulse(number).find(|point| place(point.bead) == bead).unwrap();
            let speed = |from, to| (to - from) as f64 / (at(to).time_s - at(from).time_s);
            // until they meet as fast as the front, and so behind; they settle over the first beads
            assert!((speed(10, 50) / front - 1.0).abs() < 0.01, "{light_kg}: {}, {front}", speed(10, 50));
            assert!((speed(72, 110) / front - 1.0).abs() < 0.02, "{light_kg}: {}, {front}", speed(72, 110));
            // secondary waves from where they met take a little, and beads that the other pulse left loose are faster
            let [before, after] = [50, 110].map(|bead| at(bead).v_peak_m_s.abs());
            assert!((after / before - 1.0).abs() < 0.1 && before > 0.5, "{light_kg}: {before}, {after}");
        }
    }
}

/// The points of the pulses above `threshold_m_s` in a run that starts with velocities of its own.
fn points_of(
    config: &RunConfig,
    v_m_s: &[f64],
    threshold_m_s: f64,
    mut look: impl FnMut(&Frame<'_>),
) -> Vec<Point> {
    let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
    let manifest = RunManifest::new(config, "run", origin).unwrap();
    let mut state = ChainState::starting_at(&manifest.physics, &vec![0.0; v_m_s.len()], v_m_s);
    let mut integrator = Integrator::new(&manifest.physics);
    let mut pulses = Pulses::new(&manifest, threshold_m_s);
    let mut points = Vec::new();
    let mut keep = |happenings: &[Happening]| {
        points.extend(happenings.iter().filter_map(|happening| match happening {
            Happening::Passed(point) => Some(*point),
            Happening::Ended(_) => None,
        }));
    };
    for step in 0..=manifest.physics.step_count {
        if step > 0 {
            integrator.step(&mut state);
        }
        let frame = state.as_frame(&manifest, step);
        keep(pulses.observe(&frame));
        look(&frame);
    }
    keep(pulses.finish());
    assert!(pulses.unfollowed().is_empty(), "{:?}", pulses.unfollowed());
    points
}

/// Without a striker the load gives the scale.
#[test]
fn where_nothing_strikes_pulses_are_found_by_the_scale_of_the_load() {
    let mut config = Preset::find("precompressed").unwrap().config();
    (config.striker.velocity_m_s, config.time.duration_s) = (0.0, 0.01);
    let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
    let scale_m_s = Pulses::velocity_scale_m_s(&RunManifest::new(&config, "run", origin).unwrap());
    let mut v_m_s = vec![0.0; 200];
    v_m_s[0] = 0.1 * scale_m_s;
    let points = points_of(&config, &v_m_s, 1e-3 * scale_m_s, |_| {});
    let at = |bead| points.iter().find(|point| point.pulse == 1 && point.bead == bead).unwrap().time_s;
    // sound on 10 N: √(K/m) with K = 1.5e5 N/m; the first crest of the Airy function falls behind by 1.02·(n/2)^(1/3) beads
    let speed = 60.0 / (at(100) - at(40));
    let late = 1.02 * (50.0_f64.cbrt() - 20.0_f64.cbrt());
    let exact = (1.5e5_f64 / 1e-3).sqrt();
    assert!((speed / exact * (1.0 + late / 60.0) - 1.0).abs() < 0.01, "{speed}, {exact}");
}

/// What is no pulse is told, and so is what none follows: nothing of that in the presets.
#[test]
fn every_preset_is_followed() {
    let place = Place::new();
    for preset in PRESETS {
        let config = preset.config();
        // what is shaken, starts everywhere or has bonds instead of contacts has no pulses, or not only such
        if !config.striker.more.is_empty()
            || config.striker.velocity_m_s == 0.0
            || config.chain.bonds.is_some()
        {
            continue;
        }
        let run = place.start(&format!("run --preset {} --no-record --wait-for 1", preset.name));
        let told = place.run("pulses --json").exits(0);
        run.wait().exits(0);
        let results = told.json()["results"].clone();
        for count in ["unfollowed_count", "unresolved_crest_count"] {
            assert_eq!(results[count], 0, "{}: {count}", preset.name);
        }
        assert!(results["pulse_count"].as_u64() > Some(0), "{}", preset.name);
    }
}

/// How many weak pulses there are is a matter of the threshold; of how many that is not so, the count says.
#[test]
fn the_count_says_what_depends_on_the_threshold() {
    let place = Place::new();
    place.run("run --preset striker-3g --name train").exits(0);
    let count = |threshold: &str| {
        let told = place.run(&format!("pulses train.mcap --json --threshold {threshold}")).exits(0);
        let results = told.json()["results"].clone();
        (results["pulse_count"].as_u64().unwrap(), results["clear_pulse_count"].as_u64().unwrap())
    };
    let ((all, clear), (twice, _)) = (count("0.001"), count("0.002"));
    assert!(clear < all && clear <= twice, "{all}, {clear}, {twice}");
    let told = place.run("pulses train.mcap").exits(0).stdout();
    assert!(told.contains("above twice that over 10 beads"), "{told}");
}

/// By the definition of a pulse 4, 6 and 7 of them pass bead 225; loose beads, which move fastest at times, too, are
/// no pulses.
#[test]
fn probes_count_pulses_and_not_loose_beads() {
    let place = Place::new();
    for (mass, pulses) in [("3e-3", 4), ("5e-3", 6), ("10e-3", 7)] {
        let chain = format!("--beads 300 --impurity 150={mass} --duration 0.0264");
        place
            .run(&format!("run --preset heavy-impurity {chain} --publish-every-steps 5 --name train --force"))
            .exits(0);
        let mut source = RecordingSource::open(&place.path("train.mcap")).unwrap();
        let mut probes = Probes::new(source.manifest(), &[225]);
        while let Received::Frame(frame) = source.receive().unwrap() {
            probes.observe(&frame);
        }
        let forward = probes.passages().iter().filter(|passage| passage.v_peak_m_s > 0.0).count();
        assert_eq!(forward, pulses, "{mass}: {:?}", probes.passages());
    }
}

/// Sound on a load is faster than the pulse that so weak a strike makes without one, and light beads are passed faster
/// than those of the nominal mass.
#[test]
fn how_sparse_is_too_sparse_is_a_matter_of_the_chain() {
    let place = Place::new();
    place.run("run --preset precompressed --record-every-steps 60 --name loaded").exits(0);
    place.run("pulses loaded.mcap --out sparse.csv").exits(0).says(&["one step in 60", "recomputed"]);
    place.run("run --preset precompressed --name full").exits(0);
    place.run("pulses full.mcap --out full.csv").exits(0);
    assert_eq!(place.read("sparse.csv"), place.read("full.csv"));
}

/// Every 200th step shows nothing of a pulse that passes in 220.
#[test]
fn a_sparse_recording_is_followed_step_by_step() {
    let place = Place::new();
    place.run("run --preset homogeneous --record-every-steps 200 --name sparse").exits(0);
    place.run("run --preset homogeneous --name full").exits(0);
    place.run("pulses sparse.mcap --out sparse.csv").exits(0).says(&["one step in 200", "recomputed"]);
    place.run("pulses full.mcap --out full.csv").exits(0);
    assert_eq!(place.read("sparse.csv"), place.read("full.csv"));
    let told = place.run("pulses sparse.mcap --as-recorded --json").exits(3);
    told.says(&["nothing is recomputed, as asked by --as-recorded"]);
    place.run("pulses sparse.mcap --as-recorded --every-step").exits(2);
    // every 70th step shows the front, but no crest
    place.run("thin full.mcap --every-steps 70 --out some.mcap").exits(0);
    let told =
        place.run("pulses some.mcap --as-recorded --json").exits(3).says(&["the leading pulse is missing"]);
    assert_eq!(told.json()["results"]["leading_pulse_followed"], false);
}

#[test]
fn coarse_frames_are_told_and_nonsense_is_refused() {
    let place = Place::new();
    let run = place.start("run --preset homogeneous --publish-every-steps 200 --wait-for 1");
    // what is live is over: steps between can be recomputed, but only if that is asked for
    let told = place.run("pulses --json").exits(3).says(&["200 steps apart", "are enough", "--every-step"]);
    run.wait().exits(0);
    assert_eq!(told.json()["results"]["pulses"].as_array().unwrap().len(), 0);
    place.run("pulses homogeneous.mcap --threshold 0").exits(2).says(&["'0' for '--threshold", "above 0"]);
    place.run("pulses homogeneous.mcap --out a.txt").exits(2);
}

/// The pulses that `beadline pulses` tells of the chain `toml`.
fn told(place: &Place, name: &str, toml: &str) -> Vec<serde_json::Value> {
    place.write(&format!("{name}.toml"), toml);
    place.run(&format!("run {name}.toml --out {name}.mcap")).exits(0);
    let ended = place.run(&format!("pulses {name}.mcap --json")).json();
    ended["results"]["pulses"].as_array().unwrap().clone()
}

/// Gaps that the recoil leaves break the reflected pulse up at bead 5: until there it is a solitary wave, of bead 20 and 0.899 m/s.
#[test]
fn a_pulse_that_breaks_up_is_measured_before() {
    let chain = "[chain]\nbeads = 60\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n\
                 impurities = [{ bead = 30, mass_kg = 2e-3 }]\n[striker]\nbead = 0\nvelocity_m_s = 5.0\n";
    let pulses = told(&Place::new(), "broken", &format!("{chain}[time]\nduration_s = 0.006\n"));
    let back = pulses.iter().find(|pulse| pulse["direction"] == "backward").unwrap();
    let value = |name: &str| back[name].as_f64().unwrap();
    assert!((value("v_peak_m_s") / -0.899 - 1.0).abs() < 0.002, "{back}");
    assert!((value("speed_over_solitary") - 1.0).abs() < 0.002, "{back}");
}

/// Exponents that differ by nothing that matters change no pulse; sound has 12,247 beads/s, and its crests two thirds of that or more.
#[test]
fn several_exponents_and_a_load_make_no_slow_pulses() {
    let place = Place::new();
    let [one, two] =
        [("one", ""), ("two", "alphas = { pattern = [1.5, 1.5000000001] }\n")].map(|(name, alphas)| {
            let chain = "[chain]\nbeads = 40\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n";
            let rest = "[ends]\nleft = \"fixed\"\nright = \"fixed\"\n[load]\nprecompression_n = 10.0\n\
                    [initial]\nthermal = { energy_j = 1e-9 }\n[time]\nduration_s = 0.02\n";
            told(&place, name, &format!("{chain}{alphas}{rest}"))
        });
    assert!(one.len() > 50 && one.len() == two.len(), "{} {}", one.len(), two.len());
    for pulse in one.iter().chain(&two) {
        let lasted =
            |name: &str| pulse["end"][name].as_f64().unwrap() - pulse["birth"][name].as_f64().unwrap();
        assert!(lasted("bead").abs() / lasted("time_s") > 12_247.0 / 3.0, "{pulse}");
    }
}

/// The forces of these bonds are odd: a kick that pulls makes the same waves as one that pushes, with other signs.
#[test]
fn a_pulse_that_pulls_is_followed_like_one_that_pushes() {
    let place = Place::new();
    let [push, pull] = [("push", "3.0"), ("pull", "-3.0")].map(|(name, v)| {
        let bonds = "[chain]\nbeads = 60\nbead_mass_kg = 1.0\nbonds = { linear = 1.0, cubic = 1.0 }\n";
        let text = format!("{bonds}[striker]\nbead = 0\nvelocity_m_s = {v}\n[time]\nduration_s = 25.0\n");
        told(&place, name, &text)
    });
    let strongest = push.iter().filter_map(|pulse| pulse["v_peak_m_s"].as_f64()).fold(0.0, f64::max);
    assert!(strongest > 2.2 && push.len() == pull.len(), "{push:?}");
    for (push, pull) in push.iter().zip(&pull) {
        for same in ["direction", "birth", "end", "energy_j", "speed_beads_per_s"] {
            assert_eq!(push[same], pull[same], "{same}");
        }
        assert_eq!(push["v_peak_m_s"].as_f64().map(|v| -v), pull["v_peak_m_s"].as_f64());
    }
}

/// An observer who moves along sees the same pulse; where no velocity is that of most beads there is no theory.
#[test]
fn pulses_of_a_chain_that_flies_are_those_of_one_at_rest() {
    let place = Place::new();
    let beginning = |name: &str, v_m_s: &[f64]| {
        let hertz = "[chain]\nbeads = 60\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n";
        told(
            &place,
            name,
            &format!("{hertz}[initial]\nvelocities_m_s = {v_m_s:?}\n[time]\nduration_s = 3e-3\n"),
        )
    };
    let [rest, flies] = [("rest", 0.0), ("flies", 1.0)].map(|(name, drift)| {
        let mut v_m_s = vec![drift; 60];
        v_m_s[0] += 5.0;
        beginning(name, &v_m_s)
    });
    assert!((flies[0]["speed_over_solitary"].as_f64().unwrap() - 1.0).abs() < 1e-4, "{flies:?}");
    for same in ["v_peak_m_s", "momentum_kg_m_s", "energy_j"] {
        let [at_rest, flying] = [&rest, &flies].map(|pulses| pulses[0][same].as_f64().unwrap());
        assert!((flying / at_rest - 1.0).abs() < 1e-4, "{same}: {at_rest} {flying}");
    }
    let halves: Vec<f64> = (0..60).map(|bead| if bead < 30 { 2.0 } else { -2.0 }).collect();
    let collided = beginning("halves", &halves);
    assert!(
        !collided.is_empty() && collided.iter().all(|pulse| pulse["speed_over_solitary"].is_null()),
        "{collided:?}"
    );
}

/// What a viewer gets: the pulses under way, in every frame.
#[test]
fn pulses_under_way_are_published() {
    let place = Place::new();
    let run = place.start("run --preset homogeneous --no-record --wait-for 2 --name live");
    let pulses = place.start("pulses");
    let (bus, name) = (place.bus(), "live".parse().unwrap());
    let attach = || {
        ResultSubscriber::attach(
            &bus,
            &name,
            Topic::results("pulses").unwrap(),
            Delivery::Lossless,
            Arc::default(),
        )
    };
    let mut rows = wait_until("pulses on the bus", || attach().unwrap());
    let second = place.start("contacts");
    let mut last = Vec::new();
    loop {
        match rows.receive().unwrap() {
            ResultReceived::Row(row) => last = row.values.numbers().to_vec(),
            ResultReceived::End(_) => break,
            ResultReceived::Missed { .. } => {}
        }
    }
    for process in [run, pulses, second] {
        process.wait().exits(0);
    }
    let [number, bead, v_peak_m_s, velocity, fwhm_beads] = last[..5] else { panic!("{last:?}") };
    // crossed 184 beads when the run of 16 ms ends
    assert!(number == 1.0 && (184.0..186.0).contains(&bead), "{last:?}");
    assert!((v_peak_m_s - 3.408_158).abs() < 1e-5 && (velocity - 11_596.7).abs() < 0.1, "{last:?}");
    assert!((fwhm_beads - 1.579).abs() < 1e-3 && last[5..].iter().all(|value| value.is_nan()), "{last:?}");
}
