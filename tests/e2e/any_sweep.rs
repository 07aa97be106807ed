//! Sweeps over what goes beyond one struck bead and one power law.

use crate::harness::Place;

const CHAIN: &str = "[base.chain]\nbeads = 30\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n";

/// The rows of a sweep, by column.
fn rows(place: &Place, sweep: &str) -> Vec<Vec<(String, String)>> {
    place.write("s.toml", sweep);
    place.run("sweep s.toml --out dir --force").exits(0);
    let csv = place.read("dir/results.csv");
    let mut lines = csv.lines().map(|line| line.split(',').map(str::to_owned));
    let head: Vec<String> = lines.next().unwrap().collect();
    lines.map(|line| head.iter().cloned().zip(line).collect()).collect()
}

fn column(rows: &[Vec<(String, String)>], name: &str) -> Vec<String> {
    let cell = |row: &Vec<(String, String)>| {
        let found = row.iter().find(|(column, _)| column == name);
        found.unwrap_or_else(|| panic!("no {name} in {row:?}")).1.clone()
    };
    rows.iter().map(cell).collect()
}

/// A hash of the last state tells runs apart.
fn differ(rows: &[Vec<(String, String)>]) -> bool {
    let mut hashes = column(rows, "state_sha256");
    let all = hashes.len();
    hashes.sort();
    hashes.dedup();
    hashes.len() == all
}

#[test]
fn drives_and_strikers_are_swept() {
    let place = Place::new();
    let driven = format!(
        "{CHAIN}[[base.drive]]\nbead = 0\n\
         displacement_m = {{ sine = {{ amplitude = 1e-5, frequency_hz = 1e3 }} }}\n\
         [base.time]\nduration_s = 1e-3\n\
         [grid]\n\"drive[0].displacement_m.sine.frequency_hz\" = {{ from = 1e3, to = 3e3, count = 3 }}\n"
    );
    let found = rows(&place, &driven);
    let hz = column(&found, "drive[0].displacement_m.sine.frequency_hz");
    assert_eq!(hz.iter().map(|hz| hz.parse().unwrap()).collect::<Vec<f64>>(), [1e3, 2e3, 3e3]);
    assert!(differ(&found));
    let struck = format!(
        "{CHAIN}[[base.striker]]\nbead = 0\nvelocity_m_s = 5.0\n[[base.striker]]\nbead = 29\nvelocity_m_s = -5.0\n\
         [base.time]\nduration_s = 1e-3\n[grid]\n\"striker[1].velocity_m_s\" = [-1.0, -2.0]\n"
    );
    assert!(differ(&rows(&place, &struck)));
    place.write("s.toml", &struck.replace("[-1.0, -2.0]", "[-1.0, 1e200]"));
    place.run("sweep s.toml --out dir --force").exits(2).says(&[
        "s.toml:",
        "striker[1].velocity_m_s",
        "allowed",
    ]);
}

/// What is beside a sweep file is found from there, whatever the directory of the command.
#[test]
fn tables_states_and_waves_are_those_beside_the_sweep_file() {
    let place = Place::new();
    std::fs::create_dir(place.path("sub")).unwrap();
    place.write("sub/push.csv", "time_s,value\n0.0,0.0\n5e-4,3.0\n2e-3,0.0\n");
    let table = format!(
        "{CHAIN}[[base.drive]]\nbead = 0\nforce_n = {{ csv = \"push.csv\" }}\n[base.time]\nduration_s = 1e-3\n\
         [grid]\nchain.alpha = [1.5, 2.0]\n"
    );
    place.write("sub/s.toml", &table);
    place.run("sweep sub/s.toml --out dir").exits(0);
    place.write("sub/s.toml", &table.replace("push.csv", "gone.csv"));
    place.run("sweep sub/s.toml --out dir --force").exits(2).says(&["s.toml:", "force_n", "gone.csv"]);
    // the same wave at every speed
    let wave = format!(
        "{CHAIN}[base.initial]\nsolitary = {{ bead = 10.0, speed_beads_s = 2e4 }}\n[base.time]\nduration_s = 1e-4\n\
         [grid]\n\"initial.solitary.speed_beads_s\" = [2e4, 3e4]\n"
    );
    assert!(differ(&rows(&place, &wave)));
    place.run("run --preset homogeneous --beads 30 --duration 1e-3 --out sub/before.mcap").exits(0);
    let from = format!(
        "{CHAIN}[base.initial]\nfrom = {{ recording = \"before.mcap\", step = 100 }}\n[base.time]\nduration_s = 1e-4\n\
         [grid]\n\"initial.from.step\" = [100, 200]\n"
    );
    place.write("sub/s.toml", &from);
    place.run("sweep sub/s.toml --out from").exits(0);
    place.write("sub/s.toml", &from.replace("before.mcap", "gone.mcap"));
    place.run("sweep sub/s.toml --out from --force").exits(2).says(&["s.toml:", "initial.from", "gone.mcap"]);
}

/// A base file in another directory names what lies beside itself, as it does for `run`.
#[test]
fn what_a_base_file_names_lies_beside_it() {
    let place = Place::new();
    std::fs::create_dir(place.path("sub")).unwrap();
    place.write("sub/push.csv", "time_s,value\n0.0,0.0\n5e-4,3.0\n2e-3,0.0\n");
    place.write("push.csv", "time_s,value\n0.0,0.0\n5e-4,300.0\n2e-3,0.0\n");
    let chain = CHAIN.replace("base.", "");
    let base = format!(
        "{chain}[[drive]]\nbead = 0\nforce_n = {{ csv = \"push.csv\" }}\n[time]\nduration_s = 1e-3\n"
    );
    place.write("sub/base.toml", &base);
    let found = rows(&place, "[base]\nfile = \"sub/base.toml\"\n[grid]\n\"chain.alpha\" = [1.5]\n");
    place.run("run sub/base.toml --out r.mcap --no-publish").exits(0);
    place.run("energies r.mcap --out e.csv").exits(0);
    let csv = place.read("e.csv");
    let at = csv.lines().next().unwrap().split(',').position(|name| name == "total_j").unwrap();
    let last: f64 = csv.lines().last().unwrap().split(',').nth(at).unwrap().parse().unwrap();
    assert_eq!(column(&found, "total_j")[0].parse(), Ok(last));
}

/// Columns over time are those of the split bead that the row has, and what a frame has several of is refused. A point that ends before
/// `measure_from_s` has no numbers, not those of nothing.
#[test]
fn columns_are_of_the_bead_and_the_times_that_are_asked_for() {
    let place = Place::new();
    let sweep = format!(
        "split_bead = 3\nmeasure = [\"forces.peak_count@20\", \"contacts.open_count\"]\nmeasure_from_s = 9e-4\n\
         until = \"stationary\"\nseries = {{ measure = [\"energies.left_j\", \"contacts.open_count\"], count = 1000 }}\n\
         {CHAIN}impurities = [{{ bead = 20, mass_kg = 2e-3 }}]\n[base.striker]\nbead = 0\nvelocity_m_s = 5.0\n\
         [base.time]\nduration_s = 1e-3\n[grid]\n\"striker.velocity_m_s\" = [5.0]\n"
    );
    let told = |sweep: &str| {
        let names = ["end", "forces.peak_count@20", "contacts.open_count", "left_j"];
        let found = rows(&place, sweep);
        names.map(|name| column(&found, name)[0].clone())
    };
    let ended = told(&sweep);
    assert!(ended[0] == "met end" && ended[1].is_empty() && ended[2].is_empty(), "{ended:?}");
    let whole = sweep.replace("until = \"stationary\"\n", "");
    let [end, peaks, open, left_j] = told(&whole);
    assert!(end == "complete" && !peaks.is_empty() && !open.is_empty(), "{end} {peaks} {open}");
    let series = place.read("dir/series.csv");
    let head: Vec<&str> = series.lines().next().unwrap().split(',').collect();
    let at = head.iter().position(|name| *name == "energies.left_j").unwrap();
    // one frame falls into the last interval
    let last = series.lines().last().unwrap().split(',').nth(at).unwrap();
    assert_eq!(last.parse::<f64>(), left_j.parse());
    place.write("s.toml", &whole.replace("\"contacts.open_count\"], count", "\"pulses.bead\"], count"));
    place.run("sweep s.toml --out dir --force").exits(2).says(&["pulses.bead", "several"]);
}

#[test]
fn seeds_are_swept_and_make_an_ensemble() {
    let place = Place::new();
    let disordered = format!(
        "{CHAIN}[[base.disorder]]\nof = \"masses\"\nuniform = 0.2\n[base.striker]\nbead = 0\nvelocity_m_s = 5.0\n\
         [base.time]\nduration_s = 5e-4\n"
    );
    let sweep = format!("seeds = {{ from = 0, count = 20 }}\n[ensemble]\n{disordered}");
    let found = rows(&place, &sweep);
    assert_eq!(found.len(), 20);
    assert!(differ(&found));
    assert_eq!(place.read("dir/ensemble.csv").lines().count(), 2);
    let gridded = rows(&place, &format!("{disordered}[grid]\nseed = [3, 4]\n"));
    let hashes = column(&found, "state_sha256");
    assert_eq!(column(&gridded, "state_sha256"), hashes[3..5], "a seed is the same chain in every sweep");
    // states that are made before a run begins are drawn, too
    let begun = |initial: &str| {
        format!(
            "[chain]\nbeads = 8\nbead_mass_kg = 1.0\nbonds = {{ linear = 1.0 }}\n[ends]\nleft = \"fixed\"\nright = \"fixed\"\n\
             [initial]\n{initial}\n[time]\nduration_s = 1.0\n"
        )
    };
    for initial in
        ["modes = { energies_j = [[1, 1e-3]] }", "thermal = { energy_j = 1e-3 }\nenergy_per_bead_j = 1e-3"]
    {
        place.write("m.toml", &begun(initial));
        place.run("run m.toml --no-record --seed 2").exits(0);
    }
    place.write("m.toml", &begun("modes = { energies_j = [[1, 1e-3]], phase = 0.0 }"));
    place.run("run m.toml --no-record --seed 2").exits(2).says(&["--seed 2", "[[disorder]]"]);
}
