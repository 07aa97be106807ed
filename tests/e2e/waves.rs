//! Spectra, modes and forces, through the command, against exact relations.

use crate::harness::Place;
use crate::reference::rows;
use consumers::theory::{SolitaryWave, Strength};
use serde_json::Value;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

/// The rows of a table as numbers; empty fields are NaN.
fn table(place: &Place, name: &str) -> Vec<Vec<f64>> {
    let text = place.read(name);
    let row = |line: &str| line.split(',').map(|field| field.parse().unwrap_or(f64::NAN)).collect();
    text.lines().skip(1).map(row).collect()
}

/// The preset `precompressed`: F = 10 N, k = 1e7 N·m^−3/2, so K = 3/2·k^(2/3)·F^(1/3) = 1.5e5 N/m; beads of 1 g.
const TOP_HZ: f64 = 2.0 * 12_247.448_713_915_89 / TAU;

/// A pulse of sound lies on ω = 2√(K/m)·sin(q/2), within a line of the map; the other half of the map is empty.
#[test]
fn sound_has_the_dispersion_of_the_linear_chain() {
    let place = Place::new();
    place.run("run --preset precompressed --name sound").exits(0);
    let found = place.run("spectrum sound.mcap --map --out map.csv --figure map.png --json").exits(0).json();
    let resolution_hz = number(&found["results"]["resolution_hz"]);
    assert!((number(&found["results"]["bands_hz"][0][1]) / TOP_HZ - 1.0).abs() < 1e-12, "{found}");
    let mut ridges: BTreeMap<i64, (f64, f64, f64)> = BTreeMap::new();
    let (mut right, mut left) = (0.0, 0.0);
    for row in table(&place, "map.csv") {
        let [frequency_hz, q, density] = row[..] else { panic!("{row:?}") };
        if q.abs() > 0.3 {
            *if q > 0.0 { &mut right } else { &mut left } += density;
        }
        #[expect(clippy::cast_possible_truncation, reason = "a key")]
        let ridge = ridges.entry((q * 1e9) as i64).or_insert((q, frequency_hz, density));
        if density > ridge.2 {
            *ridge = (q, frequency_hz, density);
        }
    }
    // the pulse goes to the right alone
    assert!(left < 1e-4 * right, "{left} {right}");
    let seen = ridges.values().filter(|(q, ..)| *q > 0.3 && *q < 2.0);
    let mut count = 0;
    for (q, frequency_hz, _) in seen {
        let expected = TOP_HZ * (q / 2.0).sin();
        assert!((frequency_hz - expected).abs() < resolution_hz, "q = {q}: {frequency_hz}, {expected}");
        count += 1;
    }
    assert!(count > 50, "{count}");
}

/// Without a window, and with all samples in one segment, the density integrates to the variance of the samples.
#[test]
fn a_density_integrates_to_the_mean_square() {
    let place = Place::new();
    place.run("run --preset precompressed --name sound --beads 40 --duration 0.003").exits(0);
    place.run("impurity sound.mcap --bead 20 --out motion.csv").exits(0);
    let command = "spectrum sound.mcap --at bead:20 --window none --out psd.csv --json";
    let found = place.run(command).exits(0).json();
    let length = found["results"]["segment_samples"].as_u64().unwrap();
    let samples: Vec<f64> = table(&place, "motion.csv").iter().map(|row| row[4]).collect();
    let samples = &samples[..usize::try_from(length).unwrap()];
    let mean = samples.iter().sum::<f64>() / length as f64;
    let variance = samples.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / length as f64;
    let said = number(&found["results"]["places"][0]["mean_square"]);
    assert!((said / variance - 1.0).abs() < 1e-12, "{said} {variance}");
    let psd = table(&place, "psd.csv");
    let integral = psd.iter().map(|row| row[1]).sum::<f64>() * psd[1][0];
    assert!((integral / variance - 1.0).abs() < 1e-12);
}

/// Sound reaches a bead further on as it was, but for the highest frequencies, which are still under way.
#[test]
fn a_chain_of_equal_beads_transmits_its_band() {
    let place = Place::new();
    place.run("run --preset precompressed --name sound").exits(0);
    let command =
        "spectrum sound.mcap --transmission bead:20,bead:60 --window none --out t.csv --figure t.svg";
    place.run(command).exits(0);
    let (mut within, mut beyond) = (0, 0);
    for row in table(&place, "t.csv") {
        let [frequency_hz, psd, _, gain, ..] = row[..] else { panic!("{row:?}") };
        // the run ends at 15 ms: what is cut off there ripples by some hundredths
        if frequency_hz > 100.0 && frequency_hz < 2500.0 {
            assert!((gain - 1.0).abs() < 0.1, "{row:?}");
            within += 1;
        } else if frequency_hz > 1.2 * TOP_HZ && frequency_hz < 2.0 * TOP_HZ {
            assert!(psd < 1e-12, "{row:?}");
            beyond += 1;
        }
    }
    assert!(within > 20 && beyond > 20, "{within} {beyond}");
    // segments that are shorter than the way say nothing, and that is told
    place
        .run("spectrum sound.mcap --transmission bead:20,bead:100")
        .exits(0)
        .says(&["coherence", "--window none"]);
}

const LOADED: &str = "[chain]\nbeads = 60\nbead_mass_kg = 2e-3\nalpha = 1.5\nstiffness = 1e7\nMASSES\n\
    [load]\nprecompression_n = 10.0\n[ends]\nleft = \"fixed\"\nright = \"fixed\"\n\
    [striker]\nbead = 0\nvelocity_m_s = 0.001\n[time]\nduration_s = 0.002\n";

/// N equal beads between walls of the same contacts: ωₙ = 2√(K/m)·sin(nπ/(2(N + 1))).
#[test]
fn modes_of_a_chain_between_walls_are_those_of_the_textbook() {
    let place = Place::new();
    place.write("fixed.toml", &LOADED.replace("MASSES", ""));
    let found = place.run("modes fixed.toml --json --out modes.csv --figure modes.svg").exits(0).json();
    let modes = found["results"]["modes"].as_array().unwrap();
    assert_eq!(modes.len(), 60);
    for (n, mode) in (1_u32..).zip(modes) {
        let expected = 2.0 * (1.5e5_f64 / 2e-3).sqrt() * (f64::from(n) * PI / 122.0).sin() / TAU;
        // eigenvalues are good to 1e-15 of the largest one, the first is 1e-3 of that
        let frequency_hz = number(&mode["frequency_hz"]);
        assert!((frequency_hz / expected - 1.0).abs() < 1e-10, "{n}: {frequency_hz} {expected}");
        // Σ sin⁴ = 3(N + 1)/8, half of the modes' shapes are that of another one with signs
        assert!((number(&mode["participation_beads"]) / (61.0 * 2.0 / 3.0) - 1.0).abs() < 1e-8, "{mode}");
    }
    let table = table(&place, "modes.csv");
    assert_eq!((table.len(), table[3][1]), (60, number(&modes[3]["frequency_hz"])));
    place.run("modes fixed.toml --shapes --mode 1 --out shapes.csv").exits(0);
    let shapes = place.read("shapes.csv");
    let shape: Vec<f64> =
        shapes.lines().skip(1).map(|line| line.split_once(',').unwrap().1.parse().unwrap()).collect();
    for (bead, u) in (1_u32..).zip(&shape) {
        let expected = (f64::from(bead) * PI / 61.0).sin() / (30.0 * PI / 61.0).sin();
        assert!((u - expected).abs() < 1e-9, "{bead}: {u} {expected}");
    }
}

/// Masses M > m in turn: 0 to √(2K/M), a gap, √(2K/m) to √(2K(1/m + 1/M)); a light bead has a mode in the gap.
#[test]
fn a_dimer_chain_has_its_gap_and_an_impurity_its_mode_in_it() {
    let place = Place::new();
    let masses =
        "impurities = [{ bead = 30, mass_kg = 0.2e-3 }]\n[chain.masses]\npattern_kg = [1e-3, 0.4e-3]";
    place.write("dimer.toml", &LOADED.replace("MASSES", masses));
    let found = place.run("modes dimer.toml --json").exits(0).json();
    let bands = found["results"]["bands_hz"].as_array().unwrap();
    let root = |over_kg: f64| (2.0 * 1.5e5 * over_kg).sqrt() / TAU;
    let expected = [[0.0, root(1e3)], [root(2.5e3), root(3.5e3)]];
    for (band, expected) in bands.iter().zip(expected) {
        for (edge, expected) in band.as_array().unwrap().iter().zip(expected) {
            assert!((number(edge) - expected).abs() < 1e-9 * root(3.5e3), "{bands:?}");
        }
    }
    let modes = found["results"]["modes"].as_array().unwrap();
    let outside: Vec<&Value> = modes.iter().filter(|mode| mode["in_band"] == false).collect();
    assert!(outside.iter().all(|mode| mode["centre_bead"] == 30), "{outside:?}");
    assert_eq!(outside.len(), 2, "one in the gap, one above: {outside:?}");
    // what is not loaded has no modes
    let refused = place.run("modes --preset dimer").exits(2);
    refused.says(&["contact 0 is not pressed together", "precompression_n"]);
}

/// The striker of a chain is no matter of its modes: the same with a striker, without one, and of bonds that nothing loads.
#[test]
fn modes_need_no_striker() {
    let place = Place::new();
    let chain = "[chain]\nbeads = 9\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n[ends]\nleft = \"fixed\"\n\
        right = \"fixed\"\n[load]\nprecompression_n = 10.0\n[time]\nduration_s = 1e-3\n";
    place.write("still.toml", chain);
    place.write("struck.toml", &format!("{chain}[striker]\nbead = 0\nvelocity_m_s = 0.1\n"));
    let bonds = "[chain]\nbeads = 9\nbead_mass_kg = 1.0\nbonds = { linear = 1.0, cubic = 0.5 }\n[time]\nduration_s = 1.0\n";
    place.write("bonds.toml", bonds);
    let modes =
        |name: &str| place.run(&format!("modes {name}.toml --json")).exits(0).json()["results"].clone();
    assert_eq!(modes("still"), modes("struck"));
    let top_hz = number(&modes("bonds")["modes"][8]["frequency_hz"]);
    assert!((top_hz - 2.0 * (8.0 * PI / 18.0).sin() / TAU).abs() < 1e-12, "{top_hz}");
    // nor have bonds a linear motion that only the cube of their stretch pulls
    place.write("cubic.toml", &bonds.replace("linear = 1.0, ", ""));
    place.run("modes cubic.toml").exits(2).says(&["its bonds have no linear part"]);
    // a chain that is not linear says so, not that nothing moves it
    place.write("loose.toml", &chain.replace("10.0", "0.0"));
    place.run("modes loose.toml").exits(2).says(&["is not pressed together at rest"]);
    // a run needs something that moves
    place.run("run still.toml").exits(2).says(&["striker: missing"]);
}

/// Beyond the band there is no motion to transmit: what is drawn ends there, and says why.
#[test]
fn a_transmission_is_drawn_where_it_is_coherent() {
    let place = Place::new();
    place.run("run --preset thermal --name shaken").exits(0);
    let words = "spectrum shaken.mcap --transmission bead:1,bead:30 --figure t.svg --json";
    let ended = place.run(words).exits(0).json();
    let segments = ended["results"]["segment_count"].as_u64().unwrap();
    assert!(segments > 1, "{ended}");
    // captions are broken into lines where it suits them
    let svg = place.read("t.svg").replace('\u{a0}', " ");
    let texts = svg.split('<').filter_map(|piece| Some(piece.split_once('>')?.1.trim()));
    let text = texts.filter(|text| !text.is_empty()).collect::<Vec<_>>().join(" ");
    for says in [format!("the coherence of {segments} segments"), "least for |H".to_owned()] {
        assert!(text.contains(&says), "{says} is not in {text}");
    }
}

/// Energies in modes stay while motion is small, and together are the energy of the chain.
#[test]
fn weak_sound_keeps_the_energy_of_each_mode() {
    let place = Place::new();
    let few = LOADED.replace("MASSES", "").replace("beads = 60", "beads = 12").replace("0.001", "1e-6");
    place.write("few.toml", &few);
    place.run("run few.toml").exits(0);
    let all: Vec<String> = (1..=12).map(|mode| format!("--mode {mode}")).collect();
    let all = all.join(" ");
    place.run(&format!("modes few.mcap --energy {all} --out e.csv --figure e.svg")).exits(0);
    let table = table(&place, "e.csv");
    let total_j = 0.5 * 2e-3 * 1e-12;
    // the contacts' next order is δ/(4·δ₀) of the force: 1e-4 here, of which most swings away
    for row in &table {
        let sum: f64 = row[3..].iter().sum();
        assert!((sum / total_j - 1.0).abs() < 1e-3, "{sum}");
        for (energy_j, first_j) in row[3..].iter().zip(&table[0][3..]) {
            assert!((energy_j - first_j).abs() < 1e-3 * total_j, "{row:?}");
        }
    }
    place.run("modes few.toml --energy").exits(2).says(&["name a recording or a live run"]);
}

/// The solitary wave of α = 3/2: its force at a contact, and the mean of two of them at a bead.
#[test]
fn a_solitary_wave_has_the_force_of_theory() {
    let row = rows("homogeneous-contact-100.csv").into_iter().find(|row| row[0] == "1.5").unwrap();
    let [t_peak_s, peak_m, v_max] = [1, 2, 5].map(|i| row[i].parse::<f64>().unwrap());
    let place = Place::new();
    place.run("run --preset homogeneous --name h").exits(0);
    let command =
        "forces h.mcap --at contact:100 --at bead:100 --out f.csv --peaks p.csv --figure f.svg --json";
    let found = place.run(command).exits(0).json();
    let [contact, bead] = [0, 1].map(|index| found["results"]["places"][index]["peaks"][0].clone());
    // against the independent program: steps of 0.02 T and a parabola through three of them
    assert!((number(&contact["time_s"]) / t_peak_s - 1.0).abs() < 1e-5, "{contact}");
    assert!((number(&contact["force_n"]) / (1e7 * peak_m.powf(1.5)) - 1.0).abs() < 1e-5, "{contact}");
    // against the exact wave of that velocity
    let wave = SolitaryWave::new(1.5).unwrap();
    let scale = wave.coefficients().scaled(1e-3, 1e7, Strength::PeakVelocity { m_s: v_max }).unwrap();
    let force = |xi: f64| 1e7 * (scale.overlap_m * wave.overlap(xi) / wave.overlap(0.0)).powf(1.5);
    assert!((number(&contact["force_n"]) / force(0.0) - 1.0).abs() < 1e-5, "{contact} {}", force(0.0));
    // half a bead from the centre on both sides
    assert!((number(&bead["force_n"]) / force(0.5) - 1.0).abs() < 1e-5, "{bead} {}", force(0.5));
    let peaks = place.read("p.csv");
    // in the order in which they end
    assert!(peaks.starts_with("place,time_s,force_n,width_s,above_s\nbead:100,"), "{peaks}");
    assert!(place.read("f.csv").starts_with(
        "frame,step,time_s,overlap_contact_100_m,force_contact_100_n,force_bead_100_n\n0,0,0e0,"
    ));
    // the width of the force by the wave's shape
    let speed = scale.speed_beads_per_s;
    let (mut low, mut high) = (0.0, 3.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if force(middle) > 0.5 * force(0.0) { low = middle } else { high = middle }
    }
    let width_s = 2.0 * low / speed;
    // straight lines between frames are off by 1e-4 of a width of 90 frames
    assert!((number(&contact["width_s"]) / width_s - 1.0).abs() < 2e-4, "{contact} {width_s}");
}

/// Live, from the file, and from a sparse one whose steps are recomputed.
#[test]
fn waves_live_and_from_the_recording_are_the_same_bytes() {
    let place = Place::new();
    let commands = [
        (
            "psd",
            "spectrum SOURCE --at bead:20 --at contact:7 --at wall:right --of force --transmission bead:5,bead:30",
        ),
        ("map", "spectrum SOURCE --map"),
        ("gram", "spectrum SOURCE --at bead:20 --spectrogram --of displacement"),
        ("modes", "modes SOURCE --energy --mode 2 --mode 3"),
        ("forces", "forces SOURCE --at wall:right --at bead:20 --threshold 1e-3"),
    ];
    let outputs =
        |name: &str, kind: &str| format!("--out {name}-{kind}.csv --figure {name}-{kind}.svg --json");
    let small = LOADED.replace("MASSES", "").replace("beads = 60", "beads = 40");
    place.write("small.toml", &small);
    let run = place.start(&format!("run small.toml --wait-for {}", commands.len()));
    let live = commands.map(|(name, words)| {
        place.start(&format!("{} {}", words.replace("SOURCE", "live:small"), outputs(name, "live")))
    });
    run.wait().exits(0);
    let live = live.map(|live| live.wait().exits(0).json());
    place.run("thin small.mcap --every-steps 50 --out thin.mcap").exits(0);
    for ((name, words), live) in commands.into_iter().zip(live) {
        let from =
            |file: &str, kind: &str| format!("{} {}", words.replace("SOURCE", file), outputs(name, kind));
        let file = place.run(&from("small.mcap", "file")).exits(0).json();
        let thin = place.run(&(from("thin.mcap", "thin") + " --every-step")).exits(0).json();
        assert_eq!(live["results"], file["results"], "{name}");
        assert_eq!(thin["results"], file["results"], "{name}");
        for end in ["csv", "svg"] {
            let [live, file, thin] =
                ["live", "file", "thin"].map(|kind| place.read(&format!("{name}-{kind}.{end}")));
            assert!(live == file && thin == file, "{name}.{end}");
        }
    }
    // a sparse recording says what it cannot tell
    place.run("run --preset precompressed --name sparse --record-every-steps 100").exits(0);
    place.run("spectrum sparse.mcap --at bead:20").exits(0).says(&["waves up to 3898.48 Hz", "--every-step"]);
}

/// Two beads between walls swing 11,000 times: lists are cut, and counts, extremes and tables are of all.
#[test]
fn lists_end_and_counts_go_on() {
    let place = Place::new();
    let chain = "[chain]\nbeads = 2\nbead_mass_kg = 1.0\nbonds = { linear = 1.0 }\n[ends]\nleft = \"fixed\"\n\
        right = \"fixed\"\n[initial]\nvelocities_m_s = [1.0, 1.0]\n[time]\nduration_s = 70000.0\ndt_s = 0.2\n\
        [stream]\nrecord_every_steps = 4\n";
    place.write("box.toml", chain);
    place.run("run box.toml --no-publish").exits(0);
    let found = place.run("forces box.mcap --at wall:right --peaks p.csv --json").exits(0).json();
    let wall = &found["results"]["places"][0];
    let table = place.read("p.csv");
    let forces: Vec<f64> =
        table.lines().skip(1).map(|line| line.split(',').nth(2).unwrap().parse().unwrap()).collect();
    assert!(forces.len() > 11_000 && wall["peak_count"] == forces.len(), "{}", wall["peak_count"]);
    let kept = wall["peaks"].as_array().unwrap().len();
    assert_eq!((kept, &wall["left_out_count"]), (10_000, &(forces.len() - kept).into()));
    assert_eq!(number(&wall["highest"]["force_n"]), forces.iter().copied().fold(0.0, f64::max));

    let impurity = "impurity box.mcap --bead 0 --events e.csv";
    let found = place.run(&format!("{impurity} --json")).exits(0).json()["results"].clone();
    let events = place.read("e.csv");
    let turns = events.lines().filter(|line| line.contains(",turns,")).count();
    assert_eq!((turns, &found["turn_count"]), (22_282, &turns.into()));
    assert_eq!(found["left_out_count"], events.lines().count() - 1 - 10_000);
    let told = place.run("impurity box.mcap --bead 0").exits(0).stdout();
    assert!(told.contains(", 22,282 turning points"), "{told}");
}
