//! The author and the licence of a run, from the command line to every file that is made of its recording.

use crate::harness::Place;
use serde_json::{Value, json};
use std::fs;

const RUN: &str = "[chain]\nbeads = 20\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n[striker]\nbead = 0\n\
    velocity_m_s = 5.0\n[time]\nduration_s = 2e-3\n[provenance]\nauthor = \"Ada Lovelace\"\nlicence = \"CC0-1.0\"\n";

fn info(place: &Place, file: &str) -> Value {
    place.run(&format!("info {file} --json")).json()
}

#[test]
fn credit_stays_with_the_run() {
    let place = Place::new();
    place.write("mine.toml", RUN);
    let flags = "--licence CC-BY-4.0 --orcid 0000-0002-1825-0097 --doi 10.5281/zenodo.1";
    place.run(&format!("run mine.toml --no-publish {flags}")).exits(0);
    place.run("run mine.toml --no-publish --name plain --out plain.mcap").exits(0);
    place.run("thin mine.mcap --every-steps 50 --out thin.mcap").exits(0);
    place.run("expand thin.mcap --out whole.mcap").exits(0);
    let bytes = fs::read(place.path("mine.mcap")).unwrap();
    fs::write(place.path("cut.mcap"), &bytes[..bytes.len() * 3 / 4]).unwrap();
    place.run("recover cut.mcap --out saved.mcap");
    place.run("run --resume saved.mcap --out resumed.mcap --no-publish").exits(0);
    for file in ["mine", "thin", "whole", "saved", "resumed"] {
        let provenance = &info(&place, &format!("{file}.mcap"))["provenance"];
        let found = ["author", "orcid", "licence", "doi"].map(|key| &provenance[key]);
        let expected = json!(["Ada Lovelace", "0000-0002-1825-0097", "CC-BY-4.0", "10.5281/zenodo.1"]);
        assert_eq!(json!(found), expected, "{file}");
    }
    let text = place.run("info mine.mcap").exits(0).stdout();
    assert!(text.contains("Ada Lovelace") && text.contains("CC-BY-4.0"), "{text}");
    let [mine, plain] = ["mine.mcap", "plain.mcap"].map(|file| info(&place, file));
    assert_eq!(plain["provenance"]["licence"], "CC0-1.0");
    assert_eq!(mine["physics"], plain["physics"], "credit is no physics");
    place.run("run --resume saved.mcap --author Eve").exits(2);
}

#[test]
fn wrong_credit_is_refused_with_its_place() {
    let place = Place::new();
    place.write("mine.toml", &format!("{RUN}orcid = \"0000-0002-1825-0098\"\n"));
    let said = ["mine.toml:14: provenance.orcid: found \"0000-0002-1825-0098\"; allowed: an ORCID"];
    place.run("run mine.toml --dry-run").exits(2).says(&said);
    let said = ["--doi (provenance.doi): found \"doi.org/10.1/x\"; allowed: a DOI that begins with 10."];
    place.run("run --doi doi.org/10.1/x --dry-run").exits(2).says(&said);
}
