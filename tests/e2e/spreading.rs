//! Where the energy is, bead by bead: the same numbers from wherever the frames come, and none lost.

use crate::harness::Place;

/// Between walls, so that these hold energy, too.
const SMALL: &str = "run --preset walls --beads 60 --duration 0.01 --name small --publish-every-steps 5";

fn column(csv: &str, name: &str) -> Vec<f64> {
    let place = csv.lines().next().unwrap().split(',').position(|column| column == name).unwrap();
    csv.lines().skip(1).map(|line| line.split(',').nth(place).unwrap().parse().unwrap()).collect()
}

#[test]
fn live_file_and_recomputed_frames_give_the_same_table() {
    let place = Place::new();
    let run = place.start(&format!("{SMALL} --wait-for 2"));
    let live = place.start("spreading live:small --out live.csv --figure live.svg");
    let map = place.start("plot live:small --what energy-density --out map-live.svg");
    run.wait().exits(0);
    live.wait().exits(0);
    map.wait().exits(0);
    place.run("thin small.mcap --every-steps 200 --out sparse.mcap").exits(0);
    for (source, flag) in [("small", ""), ("sparse", "--fill-gaps")] {
        place.run(&format!("spreading {source}.mcap {flag} --out s.csv --figure s.svg --force")).exits(0);
        assert!(place.read("s.csv") == place.read("live.csv"), "{source}");
        assert!(place.read("s.svg") == place.read("live.svg"), "{source}");
        place.run(&format!("plot {source}.mcap {flag} --what energy-density --out m.svg --force")).exits(0);
        assert!(place.read("m.svg") == place.read("map-live.svg"), "{source}");
    }
    place.run("plot small.mcap --what spreading --out p.svg").exits(0);
    assert!(place.read("p.svg") == place.read("live.svg"));
    let at = place.run("plot small.mcap --what energy-density --at 0.004 --out at.svg").exits(0);
    assert!(at.stdout().contains("values") && at.stdout().contains(" mJ"), "{}", at.stdout());
}

/// The sum over the beads is the total energy, but for the rounding of sums in two orders: N units in the last place.
#[test]
fn no_energy_is_lost_between_the_beads() {
    let place = Place::new();
    let preset = place.run("preset homogeneous").exits(0).stdout();
    place.write("loaded.toml", &format!("{preset}\n[load]\nprecompression_n = 10.0\n"));
    for (name, words) in [
        ("walls", "--preset walls --beads 60"),
        ("loaded", "loaded.toml --beads 60"),
        ("light", "--beads 80 --impurity 40=0.6e-3 --alpha 2.2"),
    ] {
        place.run(&format!("run {words} --duration 0.006 --name {name} --publish-every-steps 10")).exits(0);
        place.run(&format!("spreading {name}.mcap --out {name}-s.csv")).exits(0);
        place.run(&format!("energies {name}.mcap --out {name}-e.csv")).exits(0);
        let local = column(&place.read(&format!("{name}-s.csv")), "energy_j");
        let total = column(&place.read(&format!("{name}-e.csv")), "total_j");
        assert_eq!(local.len(), total.len());
        for (local, total) in local.iter().zip(&total) {
            assert!((local - total).abs() <= 80.0 * f64::EPSILON * total, "{name}: {local} and {total}");
        }
    }
}

/// Nearly all of the energy is in one pulse: the centre moves, and as many beads take part as in its middle: between 1.9, where a
/// bead is at its peak, and 2.3, where a contact is.
#[test]
fn a_solitary_wave_stays_together() {
    let place = Place::new();
    place
        .run("run --preset homogeneous --beads 100 --duration 0.008 --name wave --publish-every-steps 10")
        .exits(0);
    let said = place.run("spreading wave.mcap --out w.csv --json").exits(0).json();
    let last = &said["results"];
    let (centre, part) =
        (last["centre_beads"].as_f64().unwrap(), last["participation_beads"].as_f64().unwrap());
    assert!(centre > 20.0, "{last}");
    assert!((1.9..2.3).contains(&part), "{last}");
    let csv = place.read("w.csv");
    // at first one bead has everything, whose second moment is 0
    assert_eq!((column(&csv, "participation_beads")[0], column(&csv, "second_moment_beads2")[0]), (1.0, 0.0));
}
