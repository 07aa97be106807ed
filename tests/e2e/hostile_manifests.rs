//! Manifests that somebody made to do harm, under right checksums: in files of a folder, and alone.

use crate::ctrl_c::state_of;
use crate::harness::{Place, Running, node, package_python, wait_until};
use hostile::random::Random;
use hostile::structure::{self, manifest_of, mutate, with_manifest};
use recording::RecordingInfo;
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};

/// Golden recordings of chains of many kinds.
const FILES: [&str; 6] = [
    "1.0-kernel-2/sparse.mcap",
    "1.0-kernel-2/damped.mcap",
    "1.1-kernel-3/driven.mcap",
    "1.1-kernel-3/driven-rk5.mcap",
    "1.1-kernel-3/ring.mcap",
    "1.1-kernel-3/spheres.mcap",
];

/// Changed files, by default.
const MOST_FILES: usize = 400;

fn golden(name: &str) -> Vec<u8> {
    fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name)).unwrap()
}

/// The golden recording `name`, with a manifest that `change` has changed, and right checksums.
fn forged(name: &str, change: impl FnOnce(&mut Value)) -> Vec<u8> {
    let recording = golden(name);
    let mut manifest = manifest_of(&recording).unwrap();
    change(&mut manifest);
    with_manifest(&recording, &manifest.to_string()).unwrap()
}

/// A folder with a recording, and `bad.mcap`.
fn folder(bad: &[u8]) -> Place {
    let place = Place::new();
    fs::write(place.path("a-good.mcap"), golden(FILES[0])).unwrap();
    fs::write(place.path("bad.mcap"), bad).unwrap();
    fs::write(place.path("c-good.mcap"), golden(FILES[2])).unwrap();
    place
}

/// A table with fewer values than times made every reader panic, and with it everything that lists a folder.
#[test]
fn one_bad_file_stops_no_folder() {
    let short =
        json!([{ "bead": 3, "force_n": { "table": { "times_s": [0.0, 1.0, 2.0], "values": [1.0] } } }]);
    let place = folder(&forged(FILES[2], |manifest| manifest["physics"]["drives"] = short));
    let listed = place.run("ls . --json").exits(3);
    let rows: Vec<Value> = serde_json::from_str(&listed.stdout()).unwrap();
    assert_eq!(rows.len(), 3, "{rows:#?}");
    assert!(rows[0]["beads"].is_u64() && rows[2]["beads"].is_u64(), "{rows:#?}");
    assert!(
        rows[1]["path"] == "./bad.mcap" && rows[1]["error"].as_str().unwrap().contains("values"),
        "{rows:#?}"
    );
    place.run("catalog . --out table.csv").exits(3);
    let catalog = fs::read_to_string(place.path("table.csv")).unwrap();
    assert!(catalog.contains("a-good.mcap") && catalog.contains("c-good.mcap"), "{catalog}");
    for command in
        ["info", "verify", "energies", "recover --out new.mcap", "plot --what velocity --out p.png"]
    {
        let ended = place.run(&format!("{command} bad.mcap")).exits(2);
        assert!(ended.stderr().contains("values"), "{command}: {}", ended.stderr());
    }
}

/// Writes recordings with manifests that are changed by their structure: [`MOST_FILES`], or as many as `BEADLINE_MANIFESTS` says.
fn changed(place: &Place) -> Vec<PathBuf> {
    let asked = std::env::var("BEADLINE_MANIFESTS").ok().and_then(|count| count.parse().ok());
    let count = asked.unwrap_or(MOST_FILES);
    let others = structure::runs();
    let mut paths: Vec<PathBuf> = Vec::new();
    for seed in 0.. {
        if paths.len() == count {
            break;
        }
        let mut random = Random::new(seed);
        let recording = golden(FILES[random.below(FILES.len())]);
        let manifest = manifest_of(&recording).unwrap();
        let Some(bytes) = with_manifest(&recording, &mutate(&manifest, &others, &mut random)) else {
            continue;
        };
        paths.push(place.path(format!("{seed:06}.mcap")));
        fs::write(&paths[paths.len() - 1], bytes).unwrap();
    }
    paths
}

/// Each is refused with a reason, or does what it is asked: nothing panics, in a file alone and in a folder.
#[test]
fn manifests_changed_by_their_structure_are_survived() {
    let place = Place::new();
    let count = changed(&place).len();
    let listed = place.run("ls . --json");
    assert!(!listed.stderr().contains("panicked"), "{}", listed.stderr());
    let mut rows: Vec<Value> = serde_json::from_str(&listed.stdout()).unwrap();
    assert_eq!(rows.len(), count);
    rows.retain(|row| row.get("error").is_none());
    assert!(rows.len() > count / 10 && rows.len() < count * 9 / 10, "{} of {count} can be read", rows.len());
    let catalog = place.run("catalog . --out table.csv").exits(3);
    assert!(!catalog.stderr().contains("panicked"), "{}", catalog.stderr());
    // those that are read are computed, too, and none of a changed run is proven
    for row in rows.iter().step_by(4) {
        let path = row["path"].as_str().unwrap();
        for command in ["info", "verify", "forces --beads 1 --out f.csv --force"] {
            let ended = place.run(&format!("{command} {path}"));
            assert!(matches!(ended.code(), Some(0..=3)), "{command} {path}: {}", ended.stderr());
            assert!(!ended.stderr().contains("panicked"), "{command} {path}: {}", ended.stderr());
        }
    }
}

/// True if the manifest of a file cannot be read, and JavaScript can tell: it has no whole numbers, of which `1.0` would be none.
fn is_refused(path: &Path) -> bool {
    let Err(error) = RecordingInfo::glance(path) else { return false };
    !words_of(&error).contains("floating point")
}

fn words_of(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(error.source(), |cause| (*cause).source());
    causes.fold(error.to_string(), |text, cause| format!("{text}: {cause}"))
}

/// What the page and the Python package make of them: no more than the command, and nothing that is a mistake of ours.
#[test]
fn the_page_and_the_package_survive_them_and_refuse_what_the_command_refuses() {
    let (Some(node), Some(python)) = (node(), package_python()) else { return };
    let place = Place::new();
    let pairs: Vec<_> = changed(&place).into_iter().map(|path| (path.clone(), is_refused(&path))).collect();
    fs::write(place.path("list.json"), json!(pairs).to_string()).unwrap();
    for (program, script) in
        [(node, "tests/node/check_manifests.mjs"), (python, "tests/python/check_manifests.py")]
    {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join(script);
        let words = [script.into_os_string(), place.path("list.json").into_os_string()];
        Running::start("manifests", place.foreign(program, words)).wait().exits(0);
    }
}

/// 400 disorders of 2·10⁷ beads in 18 kB took 40 s, 10⁵ drives 11 s; what is there takes no more time than it is long.
#[test]
fn a_glance_takes_no_longer_than_the_file_is_long() {
    let disorder = |count: usize| {
        let one = json!({ "of": "masses", "uniform": 0.1 });
        move |manifest: &mut Value| {
            let physics = &mut manifest["physics"];
            (physics["beads"], physics["disorder"]) = (json!(20_000_000), json!(vec![one; count]));
        }
    };
    let strikers = |manifest: &mut Value| {
        let physics = &mut manifest["physics"];
        physics["beads"] = json!(20_000_000);
        physics["strikers"] = (1..60_000).map(|bead| json!({ "bead": bead, "velocity_m_s": 1.0 })).collect();
    };
    let drives = |manifest: &mut Value| {
        let physics = &mut manifest["physics"];
        physics["beads"] = json!(20_000_000);
        let one = |bead: u64| json!({ "bead": bead, "force_n": { "constant": 1.0 } });
        physics["drives"] = (1..60_000).map(one).collect();
    };
    for (what, bytes) in [
        ("400 disorders", forged(FILES[2], disorder(400))),
        ("16 disorders", forged(FILES[2], disorder(16))),
        ("spheres", forged(FILES[5], |manifest| manifest["physics"]["beads"] = json!(20_000_000))),
        ("strikers", forged(FILES[2], strikers)),
        ("drives", forged(FILES[2], drives)),
    ] {
        let place = folder(&bytes);
        place.run("info a-good.mcap").exits(0);
        for command in ["info bad.mcap", "ls .", "catalog . --out table.csv --force"] {
            let took_s = computed_s(&place, command);
            // a start of the command included, as it is built for tests: 10 MB of JSON is not free either
            let most_s = 0.4 + bytes.len() as f64 / 1e7;
            assert!(took_s < most_s, "{what}: {command} took {took_s} s of {} bytes", bytes.len());
        }
    }
}

/// Time of processors (s) that a command takes.
fn computed_s(place: &Place, command: &str) -> f64 {
    let running = place.start(command);
    let computed_s = wait_until(command, || {
        let (state, computed_s) = state_of(running.id())?;
        (state == 'Z').then_some(computed_s)
    });
    assert!(!running.wait().stderr().contains("panicked"), "{command}");
    computed_s
}

/// What decides no bit is compared, or said to be taken as given.
#[test]
fn numbers_that_decide_nothing_are_not_proven() {
    let place = Place::new();
    let spheres = "name = \"spheres\"\n[chain]\nbeads = 6\nspheres = { material = \"steel\", radius_m = 5e-3 }\n\
                   [striker]\nbead = 0\nvelocity_m_s = 1.0\n[time]\nduration_s = 1e-4\n";
    fs::write(place.path("spheres.toml"), spheres).unwrap();
    place.run("run spheres.toml --out good.mcap").exits(0);
    place.run("verify good.mcap").exits(0);
    let good = fs::read(place.path("good.mcap")).unwrap();
    let mut manifest = manifest_of(&good).unwrap();
    manifest["physics"]["bead_mass_kg"] = json!(12.0);
    fs::write(place.path("bad.mcap"), with_manifest(&good, &manifest.to_string()).unwrap()).unwrap();
    let verified = place.run("verify bad.mcap --json").exits(3);
    let found: Value = serde_json::from_str(&verified.stdout()).unwrap();
    assert_eq!(found["proven"], false);
    assert!(found["manifest_difference"].as_str().unwrap().contains("bead_mass_kg"), "{found:#}");
    let info = place.run("info bad.mcap");
    assert!(!info.stdout().contains("12 kg"), "{}", info.stdout());

    // a version that had no such keys
    fs::write(place.path("bad.mcap"), structure::with_version(&golden(FILES[4]), "1.0").unwrap()).unwrap();
    let refused = place.run("verify bad.mcap").exits(2);
    assert!(refused.stderr().contains("1.0") && refused.stderr().contains("1.1"), "{}", refused.stderr());
}

/// A manifest that none of the states follows is no reason to compute another run and call it recovered.
#[test]
fn what_a_manifest_does_not_lead_to_is_not_recovered() {
    let heavier = |manifest: &mut Value| manifest["physics"]["bead_mass_kg"] = json!(1.1e-3);
    let place = folder(&forged(FILES[0], heavier));
    let refused = place.run("recover bad.mcap --out new.mcap").exits(1);
    assert!(refused.stderr().contains("fits none of its states"), "{}", refused.stderr());
    assert!(!place.path("new.mcap").exists() && !place.path("new.mcap.partial").exists());
}
