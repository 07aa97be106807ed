//! Tables of recordings.

use crate::harness::{Place, python};
use std::fs;

/// Three recordings of which one is cut off and one is none, and something else.
fn shelf(place: &Place) {
    fs::create_dir_all(place.path("runs/a/b")).unwrap();
    let run = "run --preset homogeneous --beads 50 --duration 1e-3 --record-every-steps 10";
    place.run(&format!("{run} --name one --out runs/a/b/one.mcap")).exits(0);
    place.run(&format!("{run} --name two --alpha 2 --impurity 20=5e-4 --out runs/two.mcap")).exits(0);
    let bytes = fs::read(place.path("runs/two.mcap")).unwrap();
    fs::write(place.path("runs/cut, off.mcap.partial"), &bytes[..bytes.len() / 2]).unwrap();
    place.write("runs/bad.mcap", "no recording");
    place.write("runs/notes.txt", "mine");
}

/// The values of a column of a table without commas in its values but for the paths.
fn column(table: &str, name: &str) -> Vec<String> {
    let lines: Vec<Vec<String>> = table.lines().map(fields).collect();
    let index = lines[0].iter().position(|column| column == name).unwrap();
    lines[1..].iter().map(|line| line[index].clone()).collect()
}

/// The fields of a line, without their quotes.
fn fields(line: &str) -> Vec<String> {
    let (mut fields, mut is_quoted) = (vec![String::new()], false);
    for character in line.chars() {
        match character {
            '"' => is_quoted = !is_quoted,
            ',' if !is_quoted => fields.push(String::new()),
            _ => fields.last_mut().unwrap().push(character),
        }
    }
    fields
}

#[test]
fn a_catalog_has_a_row_for_each_recording() {
    let place = Place::new();
    shelf(&place);
    let json = place.run("catalog runs --out catalog.csv --json").exits(3).json();
    assert_eq!((&json["recordings"], &json["errors"]), (&4.into(), &1.into()));
    let table = place.read("catalog.csv");
    let paths = ["runs/a/b/one.mcap", "runs/bad.mcap", "runs/cut, off.mcap.partial", "runs/two.mcap"];
    assert_eq!(column(&table, "path"), paths);
    assert_eq!(column(&table, "alpha"), ["1.5e0", "", "2e0", "2e0"]);
    assert_eq!(column(&table, "finished"), ["1", "", "0", "1"]);
    assert_eq!(column(&table, "impurity_bead"), ["", "", "20", "20"]);
    let states = column(&table, "states");
    assert!(states[0].parse::<u64>().unwrap() > 2 && states[2].is_empty(), "{states:?}");
    let errors = column(&table, "error");
    assert!(errors[1].contains("bad.mcap") && errors[0].is_empty() && errors[2].is_empty(), "{errors:?}");
    // the same table twice
    place.run("catalog runs --out again.csv").exits(3);
    assert_eq!(place.read("again.csv"), table);
    place.run("catalog runs --out catalog.csv").exits(2).says(&["exists already"]);
    place.run("catalog nowhere --out other.csv").exits(2).says(&["nowhere"]);
    place.run("catalog runs --out other.txt").exits(2).says(&[".csv or .parquet"]);
}

#[test]
fn an_odd_sphere_is_an_impurity() {
    let place = Place::new();
    fs::create_dir(place.path("runs")).unwrap();
    place.write(
        "runs/odd.toml",
        "[chain]\nbeads = 9\nspheres = { material = \"steel\", radius_m = 5e-3 }\n\
         odd_spheres = [{ bead = 3, material = \"steel\", radius_m = 4e-3 }]\n\
         [striker]\nbead = 0\nvelocity_m_s = 0.1\n[time]\nduration_s = 1e-5\n",
    );
    place.run("run runs/odd.toml --out runs/odd.mcap").exits(0);
    place.run("catalog runs --out catalog.csv").exits(0);
    let table = place.read("catalog.csv");
    assert_eq!(["impurities", "impurity_bead"].map(|name| column(&table, name)), [["1"], ["3"]]);
    assert!(place.run("info runs/odd.mcap").exits(0).stdout().contains("bead 3 of 0.00"));
}

/// The query of the documentation.
#[test]
fn duckdb_reads_a_catalog() {
    let Some(python) = python() else { return };
    let place = Place::new();
    shelf(&place);
    place.run("catalog runs --out catalog.parquet").exits(3);
    let docs = include_str!("../../docs/SCALE.md");
    let query = docs.split("```python\n").find(|block| block.starts_with("import duckdb")).unwrap();
    let query = query.split("```").next().unwrap();
    let output = place.foreign(python, ["-c", query]).output().unwrap();
    let said = String::from_utf8(output.stdout).unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(said.contains("runs/a/b/one.mcap") && said.contains("runs/two.mcap"), "{said}");
    assert!(!said.contains("bad.mcap") && !said.contains("cut"), "{said}");
}

#[cfg(feature = "remote")]
#[test]
fn a_catalog_of_objects_is_that_of_files() {
    use crate::object_store::{Bucket, Request};
    let (place, Some(bucket)) = (Place::new(), Bucket::new()) else { return };
    shelf(&place);
    let names = ["a/b/one.mcap", "bad.mcap", "cut, off.mcap.partial", "two.mcap", "notes.txt"];
    for name in names {
        bucket.put(
            &format!("runs/{}", name.replace(' ', "%20")),
            &fs::read(place.path("runs").join(name)).unwrap(),
        );
    }
    place.run("catalog runs --out here.csv").exits(3);
    let url = bucket.url("runs");
    bucket.run(&place, &format!("catalog {url} --out there.csv")).exits(3);
    let there = place.read("there.csv").replace(&format!("{url}/"), "runs/");
    assert_eq!(there, place.read("here.csv"));
    let requests = bucket.take_requests();
    // one that lists, and two for each recording: its end and its beginning
    assert!(requests.len() <= 1 + 2 * 4, "{requests:?}");
    let is_bounded = |request: &Request| request.target.contains("list-type") || !request.range().is_empty();
    assert!(requests.iter().all(is_bounded), "{requests:?}");
}
