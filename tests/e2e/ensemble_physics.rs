//! The examples of sweeps about equipartition, conduction and disorder, shortened, against the numbers of the whole ones.

use crate::harness::Place;

/// Means and standard errors of the whole examples (docs/guide/examples.md): times (s) for 0.008 and 0.004 J, conductivities (1/s) of 32 and 64 masses.
const TIMES: [[f64; 2]; 2] = [[717.5, 49.9], [1099.0, 74.4]];
const CONDUCTIVITIES: [[f64; 2]; 2] = [[8.349, 0.065], [13.00, 0.19]];

/// Those of the shortened example of disorder with 200 seeds from 0: exponents after a blow and after a displacement.
const SHORT_EXPONENTS: [[f64; 2]; 2] = [[1.6338, 0.0048], [1.0900, 0.0117]];

/// The mean of a column of an ensemble over seeds, and its standard error, in each row.
fn means(place: &Place, table: &str, column: &str) -> Vec<[f64; 2]> {
    let csv = place.read(table);
    let mut lines = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let head = lines.next().unwrap();
    // from the end, because a key may be a table with commas in it
    let at = |name: String| head.iter().rev().position(|found| *found == name).expect("a column");
    let places = [at(format!("mean_{column}")), at(format!("standard_error_{column}"))];
    lines.map(|line| places.map(|place| line[line.len() - 1 - place].parse().unwrap())).collect()
}

/// A place with a changed example.
fn example(name: &str, changes: &[(&str, &str)]) -> Place {
    let place = Place::new();
    let mut text = place.run(&format!("sweep --example {name}")).exits(0).stdout();
    for (from, to) in changes {
        assert!(text.contains(from), "{name}: {from}");
        text = text.replace(from, to);
    }
    place.write("s.toml", &text);
    place.run("sweep s.toml --out s --yes").exits(0);
    place
}

/// The means of a column are the known ones, to four of their standard errors together.
fn are_known(place: &Place, column: &str, known: [[f64; 2]; 2]) {
    let found = means(place, "s/ensemble.csv", column);
    let agrees = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).abs() < 4.0 * a[1].hypot(b[1]);
    assert!(found.len() == 2 && found.iter().zip(&known).all(agrees), "{column}: {found:?}, known {known:?}");
}

/// Times until a packet of low modes shares the energy, of other phases than those of docs/guide/examples.md.
#[test]
fn packets_form_in_the_known_times() {
    let place = Place::new();
    let example = place.run("sweep --example equipartition").exits(0).stdout();
    let (base, _) = example.split_once("[[case]]").unwrap();
    let base = base.replace("from = 0", "from = 100");
    let cases = "[[case]]\n\"initial.energy_per_bead_j\" = 0.008\n\"time.duration_s\" = 2e3\n\
                 [[case]]\n\"initial.energy_per_bead_j\" = 0.004\n\"time.duration_s\" = 3e3\n";
    place.write("s.toml", &(base + cases));
    place.run("sweep s.toml --out s --yes").exits(0);
    are_known(&place, "modal(threshold=0.5).equipartition_s", TIMES);
}

/// Conductivities of 32 and 64 masses, of other noise and a quarter of the time.
#[test]
fn conductivities_of_short_chains_are_the_known_ones() {
    let changes = [
        ("from = 1, count = 3", "from = 7, count = 4"),
        ("duration_s = 4e4", "duration_s = 1e4"),
        ("measure_from_s = 5e3", "measure_from_s = 2e3"),
        ("[32, 64, 128, 256, 512, 1024]", "[32, 64]"),
    ];
    let place = example("conductivity", &changes);
    are_known(&place, "heat.conductivity_per_s", CONDUCTIVITIES);
}

/// Exponents of the second moment in short chains, after a blow and after a displacement, of other masses.
#[test]
fn energy_spreads_in_disorder_with_the_known_exponents() {
    let changes = [
        ("from = 0, count = 24", "from = 1000, count = 16"),
        ("chain.beads = 4000", "chain.beads = 400"),
        ("bead = 2000", "bead = 200"),
        ("duration_s = 0.12", "duration_s = 0.012"),
        ("publish_every_steps = 200", "publish_every_steps = 50"),
    ];
    let place = example("disorder", &changes);
    are_known(&place, "spreading.moment_exponent", SHORT_EXPONENTS);
}
