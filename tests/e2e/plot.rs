//! `beadline plot`: one figure at a time, from whatever holds the run.

use crate::harness::{Place, python};
use std::fs;
use std::path::Path;

/// Everything that the light-impurity run has, in a chain small enough to be quick.
const SMALL: &str = "run --beads 120 --impurity 60=0.6e-3 --duration 0.012 --name small";

const FIELDS: [&str; 3] = ["velocity", "displacement", "overlap"];
const ANALYSES: [&str; 4] = ["energies", "impurity", "contacts", "pulses"];

/// Width and height of a PNG, and its dots per metre.
fn png_size(path: &Path) -> (u32, u32, u32) {
    let bytes = fs::read(path).unwrap();
    assert_eq!(&bytes[1..4], b"PNG", "{}", path.display());
    let number = |at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
    let physical = bytes.windows(4).position(|word| word == b"pHYs").unwrap() + 4;
    (number(16), number(20), number(physical))
}

#[track_caller]
fn assert_same(place: &Place, one: &str, other: &str) {
    assert!(place.read(one) == place.read(other), "{one} and {other} differ");
}

#[test]
fn a_figure_is_the_same_from_the_live_run_from_its_recording_and_from_a_sparse_one() {
    let place = Place::new();
    let run = place.start(&format!("{SMALL} --wait-for 6"));
    let live: Vec<_> = FIELDS
        .iter()
        .map(|what| place.start(&format!("plot live:small --what {what} --out {what}-live.svg")))
        .chain([
            place.start("plot --what velocity --at 0.006 --out at-live.svg"),
            place.start("plot --what overlap --frame 5000 --out frame-live.svg"),
            place.start("plot --what pulses --out pulses-live.svg"),
        ])
        .collect();
    run.wait().exits(0);
    for plot in live {
        plot.wait().exits(0);
    }
    place.run("thin small.mcap --every-steps 500 --out sparse.mcap").exits(0);
    for (source, flag) in [("small", ""), ("sparse", "--fill-gaps")] {
        for what in FIELDS {
            place.run(&format!("plot {source}.mcap --what {what} {flag} --out {what}-{source}.svg")).exits(0);
            assert_same(&place, &format!("{what}-live.svg"), &format!("{what}-{source}.svg"));
        }
        // one frame is recomputed without being asked
        place.run(&format!("plot {source}.mcap --what velocity --at 0.006 --out at-{source}.svg")).exits(0);
        assert_same(&place, "at-live.svg", &format!("at-{source}.svg"));
        place.run(&format!("plot {source}.mcap --what overlap --frame 5000 --out f-{source}.svg")).exits(0);
        assert_same(&place, "frame-live.svg", &format!("f-{source}.svg"));
    }
    place.run("pulses small.mcap --figure pulses-file.svg").exits(0);
    assert_same(&place, "pulses-live.svg", "pulses-file.svg");
    // what a sparse recording holds is shown until the next state: no stripes of "no frames"
    place.run("plot sparse.mcap --what velocity --out held.svg").exits(0);
    assert!(!place.read("held.svg").contains("no frames"));
}

#[test]
fn each_figure_is_drawn_by_default_named_after_source_and_quantity_below_a_megabyte() {
    let place = Place::new();
    // strikes that meet each other in a chain between walls: as much detail as there can be
    let walls = "run --preset walls --beads 300 --duration 0.06 --publish-every-steps 4 --name walls";
    place.run(walls).exits(0);
    for what in FIELDS.iter().chain(&ANALYSES) {
        let plot = place.run(&format!("plot walls.mcap --what {what}")).exits(0);
        let name = format!("walls-{what}.png");
        assert!(plot.stdout().contains(&name), "{}", plot.stdout());
        place.run(&format!("plot walls.mcap --what {what} --out {what}.svg")).exits(0);
        for name in [name, format!("{what}.svg")] {
            let bytes = fs::metadata(place.path(&name)).unwrap().len();
            assert!((5_000..1_000_000).contains(&bytes), "{name}: {bytes}");
        }
    }
    for what in FIELDS {
        let json = place.run(&format!("plot walls.mcap --what {what} --at 0.01 --json")).exits(0).json();
        assert_eq!(json["figures"][0], format!("walls-{what}-at-0.01s.png"));
        assert!(json["results"]["time_s"].as_f64().unwrap() >= 0.01);
        place.run(&format!("plot walls.mcap --what {what} --frame 7")).exits(0);
        assert!(place.path(format!("walls-{what}-frame-7.png")).exists());
    }
}

#[test]
fn sizes_and_resolutions_are_those_asked_for() {
    let place = Place::new();
    place.run(SMALL).exits(0);
    // 86, 178 and 254 mm; 300 dpi is 11811 dots per metre
    for (flags, width, per_metre) in [
        ("", 1016, 11_811),
        ("--size page", 2102, 11_811),
        ("--size slide", 1920, 7559),
        ("--size slide --dpi 96", 960, 3780),
    ] {
        for command in ["plot small.mcap --what velocity --out", "energies small.mcap --figure"] {
            place.run(&format!("{command} f.png {flags} --force")).exits(0);
            let (found, height, density) = png_size(&place.path("f.png"));
            assert_eq!((found, density), (width, per_metre), "{command} {flags}");
            if flags.contains("slide") {
                assert_eq!(height * 16, width * 9, "{command} {flags}");
            }
        }
    }
}

/// The text of an SVG figure, word by word.
fn words(place: &Place, file: &str) -> Vec<String> {
    let svg = place.read(file);
    let texts = svg.split("<text").skip(1).map(|text| {
        let content = text.split_once('>').unwrap().1.split_once("</text>").unwrap().0;
        content.split('<').filter_map(|part| part.split('>').next_back()).collect::<String>()
    });
    texts.collect()
}

#[test]
fn a_part_of_a_chain_and_of_a_run_is_what_is_drawn() {
    let place = Place::new();
    place.run(SMALL).exits(0);
    place
        .run("plot small.mcap --what velocity --from 0.004 --until 0.008 --beads 40..=80 --out m.svg")
        .exits(0);
    let labels = words(&place, "m.svg");
    for expected in ["40", "80", "4.0", "8.0", "bead", "time (ms)", "velocity (m/s)"] {
        assert!(labels.iter().any(|label| label == expected), "{expected}: {labels:?}");
    }
    assert!(!labels.iter().any(|label| label == "20" || label == "10.0"), "{labels:?}");
    let profile = "plot small.mcap --what overlap --at 0.004 --beads 30..60 --out p.svg --json";
    let largest = place.run(profile).exits(0).json()["results"]["largest"].as_f64().unwrap();
    assert!(largest > 1e-4, "the pulse is there: {largest}");
    assert!(words(&place, "p.svg").iter().any(|label| label.contains("t = 4.00")));
    // the maps of the analyses end where they were told to, too
    place.run("contacts small.mcap --from 0.004 --until 0.008 --figure c.svg").exits(0);
    assert!(!words(&place, "c.svg").iter().any(|label| label == "0.0" || label == "12"));
}

#[test]
fn what_cannot_be_drawn_is_refused_with_what_can() {
    let place = Place::new();
    place.run(SMALL).exits(0);
    let refuse = |words: &str, said: &[&str]| {
        place.run(&format!("plot small.mcap {words}")).exits(2).says(said);
    };
    refuse("", &["--what"]);
    refuse("--what warmth", &["warmth", "velocity", "pulses"]);
    refuse("--what energies --at 0.005", &["--at is not for --what energies", "--from and --until"]);
    refuse("--what pulses --beads 1..5", &["--beads", "beadline pulses --figure"]);
    refuse("--what velocity --at 0.02", &["--at 0.02", "the run ends at 0.012 s"]);
    // the run's own duration is a part of a step beyond its last frame
    place.run("plot small.mcap --what velocity --at 0.012").exits(0);
    refuse("--what velocity --frame 99999", &["--frame 99999", "frames 0 to"]);
    refuse("--what velocity --at 0.005 --frame 1", &["--frame"]);
    refuse("--what velocity --beads 100..200", &["--beads 100..200", "beads 0 to 119"]);
    refuse("--what overlap --beads 5..6", &["--beads 5..6", "between two beads"]);
    refuse("--what velocity --out f.eps", &["f.eps", ".svg, .pdf or .png"]);
    refuse("--what velocity --out f.svg --dpi 600", &["--dpi", "PNG"]);
    refuse("--what velocity --dpi 9", &["36 to 2400"]);
    refuse("--what velocity --size poster", &["poster", "slide"]);
    place.run("energies small.mcap --size page").exits(2).says(&["--size", "--figure"]);
    place.run("plot small.mcap --what velocity").exits(0);
    let before = fs::read(place.path("small-velocity.png")).unwrap();
    refuse("--what velocity --beads 5..50", &["small-velocity.png exists already", "--force"]);
    assert!(before == fs::read(place.path("small-velocity.png")).unwrap());
    place.run("plot small.mcap --what velocity --beads 5..50 --force").exits(0);
    assert!(before != fs::read(place.path("small-velocity.png")).unwrap());
}

/// A PDF holds the words of the SVG as text, in a font that goes with it, and its rasters. Another program reads it.
#[test]
fn a_pdf_is_the_same_figure() {
    let place = Place::new();
    place.run(SMALL).exits(0);
    for what in ["velocity", "velocity --at 0.006", "energies", "contacts", "pulses"] {
        place.run(&format!("plot small.mcap --what {what} --size page --out f.pdf --force")).exits(0);
        place.run(&format!("plot small.mcap --what {what} --size page --out f.svg --force")).exits(0);
        let pdf = fs::read(place.path("f.pdf")).unwrap();
        assert!(pdf.starts_with(b"%PDF-1."), "{what}");
        assert!(pdf.len() < 600_000, "{what}: {} bytes", pdf.len());
        let Some(python) = python() else { continue };
        let check = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/python/check_figure.py");
        let checked = place.foreign(python.to_str().unwrap(), [check, "f.pdf", "f.svg"]).output().unwrap();
        assert!(checked.status.success(), "{what}: {}", String::from_utf8_lossy(&checked.stderr));
    }
}

/// Maps with the same range have the same colours for the same numbers, whatever else is on them.
#[test]
fn colours_end_where_they_are_told_to() {
    let place = Place::new();
    place.run(SMALL).exits(0);
    let plot = |range: &str, until: &str| {
        let map = format!("plot small.mcap --what velocity --colours linear --until {until}");
        place.run(&format!("{map} --range {range} --out map.svg --force")).exits(0);
        words(&place, "map.svg").join(" ").replace('\u{a0}', " ")
    };
    for until in ["0.004", "0.008"] {
        let said = plot("0.5", until);
        assert!(said.contains(" −0.4 ") && said.contains(" 0.4 "), "{said}");
        assert!(said.contains("beyond ±0.5 m/s") && said.contains("as far as 5"), "{said}");
    }
    let said = plot("-0.1..0.5", "0.004");
    assert!(said.contains("outside of −0.1 m/s to 0.5 m/s") && !said.contains(" −0.2 "), "{said}");
    assert!(!plot("20", "0.004").contains("darkest"));
    for (range, said) in [("0", "above 0"), ("1..2", "between them"), ("-1", "above 0"), ("x", "above 0")] {
        place
            .run(&format!("plot small.mcap --what velocity --range {range} --out r.svg"))
            .exits(2)
            .says(&[said]);
    }
    let refused = "plot small.mcap --what energies --range 1 --out r.svg";
    place.run(refused).exits(2).says(&["--range is not for --what energies"]);
}

#[test]
fn a_recording_that_begins_late_or_ends_early_says_so() {
    let place = Place::new();
    let run = place.start(&format!("{SMALL} --no-record --wait-for 1"));
    place.run("record --out parts.mcap --split-duration 0.006").exits(0);
    run.wait().exits(0);
    let second = "plot parts-part-0002.mcap --what velocity --out f.svg";
    place.run(&format!("{second} --at 0.002")).exits(2).says(&["begins after it", "--from-start"]);
    place.run(&format!("{second} --at 0.002 --from-start")).exits(0);
    place.run(&format!("{second} --force")).exits(0);
    assert!(place.read("f.svg").contains("no frames"));
    let first = "plot parts-part-0001.mcap --what velocity --out g.svg";
    place.run(&format!("{first} --at 0.009")).exits(2).says(&["the frames ended before it"]);
}
