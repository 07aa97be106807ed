//! `beadline reproduce`: figures, verdicts, the cache.

use crate::harness::Place;
use serde_json::Value;
use std::fs;

/// Two figures whose runs take seconds.
const FIGURES: &str = "reproduce striker-3g deformation-1.5 --out paper --json";

fn names(of: &Value) -> Vec<&str> {
    of.as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect()
}

/// The claim of that name in a report.
fn claim<'a>(report: &'a Value, id: &str) -> &'a Value {
    let figures = report["figures"].as_array().unwrap();
    let mut claims = figures.iter().flat_map(|figure| figure["claims"].as_array().unwrap());
    claims.find(|claim| claim["id"] == id).unwrap_or_else(|| panic!("no claim {id}"))
}

#[test]
fn figures_are_made_once_and_claims_are_judged_by_numbers() {
    let place = Place::new();
    let summary = place.run(FIGURES).exits(0).json();
    assert_eq!(summary["figures"], 2);
    assert_eq!(summary["numbers_that_contradict_it"], 0);
    // two with two steps, or with three partners each
    assert_eq!(names(&summary["simulated"]).len(), 2 + 1 + 2 * 3);
    assert!(names(&summary["reused"]).is_empty());
    for file in ["striker-3g", "deformation-1.5"] {
        for end in ["svg", "png"] {
            assert!(place.path(format!("paper/img/paper/{file}.{end}")).is_file(), "{file}.{end}");
        }
    }

    let report: Value = serde_json::from_str(&place.read("paper/report.json")).unwrap();
    assert_eq!(claim(&report, "striker-3g-train")["verdict"], "reproduced");
    assert_eq!(claim(&report, "stiffness-unit")["verdict"], "reproduced with a correction");
    let tails = claim(&report, "deformation-1.5-tails");
    assert_eq!(tails["verdict"], "reproduced");
    let numbers = tails["numbers"].as_array().unwrap();
    let overlap = numbers.iter().find(|number| number["what"] == "largest overlap, α = 1.5").unwrap();
    let (value, reference) = (overlap["value"].as_f64().unwrap(), &overlap["reference"]);
    // shared reference, good to 1e-6; ours is good to 1e-5
    assert!((value / reference["value"].as_f64().unwrap() - 1.0).abs() < 1e-5, "{overlap}");
    assert!(overlap["uncertainty"]["plus_minus"].as_f64().unwrap() < 1e-4 * value, "{overlap}");
    let page = place.read("paper/REPORT.md");
    // counts are told with what they are in runs that ought to give the same
    let count = &claim(&report, "striker-1g-single")["numbers"][0];
    assert_eq!((&count["range"]["least"], &count["range"]["most"]), (&1.0.into(), &1.0.into()), "{count}");
    assert!(page.contains("one unit in the last place faster"), "{page}");
    assert!(page.contains("![") && page.contains("[stiffness-unit](#deformation-15)"), "{page}");

    // nothing is replaced unless asked for, and nothing is simulated twice
    place.run(FIGURES).exits(2).says(&["REPORT.md exists already", "--force"]);
    let again = place.run(&format!("{FIGURES} --force")).exits(0).json();
    assert!(names(&again["simulated"]).is_empty());
    let renewed: Value = serde_json::from_str(&place.read("paper/report.json")).unwrap();
    assert_eq!(renewed, report);
}

#[test]
fn a_broken_recording_is_made_again_and_no_other() {
    let place = Place::new();
    let figure = "reproduce striker-3g --out paper --json --force";
    place.run(figure).exits(0);
    let recordings = || -> Vec<_> {
        let entries = fs::read_dir(place.path("paper/recordings")).unwrap();
        entries.map(|entry| entry.unwrap().path()).collect()
    };
    let is_short = |path: &std::path::PathBuf| {
        path.to_string_lossy().contains("/striker-3g-") && !path.to_string_lossy().contains("long")
    };
    let victim = recordings().into_iter().find(is_short).unwrap();
    // the end looks whole, the middle is not
    let mut bytes = fs::read(&victim).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle..middle + 64].fill(0x5a);
    fs::write(&victim, bytes).unwrap();
    let summary = place.run(figure).exits(0).json();
    assert_eq!(names(&summary["simulated"]), ["striker-3g"]);
    let long = |mass_g| ["", "-step-x2", "-twin"].map(|partner| format!("striker-{mass_g}g-long{partner}"));
    assert_eq!(names(&summary["reused"]), [long(1), long(3)].concat());
}

#[test]
fn figures_are_listed_and_others_refused() {
    let place = Place::new();
    let list = place.run("reproduce --list").exits(0).stdout();
    for figure in ["deformation-1.2 ", "width ", "contacts-heavy ", "reflected-corrected "] {
        assert!(list.contains(figure), "{list}");
    }
    place.run("reproduce figure-3").exits(2).says(&["no figure `figure-3`", "velocity-light"]);
    assert!(!place.path("paper").exists());
}
