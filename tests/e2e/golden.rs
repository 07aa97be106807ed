//! Recordings that earlier versions wrote open for ever, and mean what they meant.
//!
//! `tests/golden/VERSION` holds small recordings of each schema and kernel version, never changed and never made again,
//! with what is in them in `expected.json`. What no kernel computes any more has the exit codes of another kernel. A new version adds a directory: `tests/golden/make tests/golden/1.1-kernel-1`,
//! and this test says what to write into its `expected.json`, to be looked at before it is believed.

use crate::harness::Place;
use recording::{RecordingSource, hex, state_hash};
use schemas::frame::{FrameSource, Received};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};

fn entries(directory: &Path) -> Vec<PathBuf> {
    let mut found: Vec<_> = fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path()).collect();
    found.sort();
    found
}

#[test]
fn recordings_of_every_version_are_read_for_ever() {
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    let versions: Vec<_> = entries(&golden).into_iter().filter(|path| path.is_dir()).collect();
    assert!(!versions.is_empty());
    for version in versions {
        let place = Place::new();
        let mut found = serde_json::Map::new();
        for file in entries(&version) {
            let name = file.file_name().unwrap().to_string_lossy().into_owned();
            if name != "expected.json" {
                fs::copy(&file, place.path(&name)).unwrap();
                found.insert(name.clone(), contents(&place, &name));
            }
        }
        let found = Value::Object(found);
        let expected = version.join("expected.json");
        let mut expected =
            fs::read(&expected).map_or(Value::Null, |text| serde_json::from_slice(&text).unwrap());
        if version.ends_with("1.0-kernel-2") {
            for (name, command) in
                RETIRED.iter().flat_map(|name| [(name, "verify"), (name, "energies --every-step")])
            {
                expected[name]["exit_codes"][command] = 3.into();
            }
        }
        let text = serde_json::to_string_pretty(&found).unwrap();
        assert!(
            found == expected,
            "{} does not hold what its expected.json says, but\n{text}",
            version.display()
        );
    }
}

/// Recordings of kernel 2 by `gear5` with damping.
pub(crate) const RETIRED: [&str; 2] = ["damped.mcap", "dashpots.mcap"];

/// They are read as ever; what would take their steps says why there are none.
#[test]
fn what_no_kernel_computes_any_more_is_said() {
    let place = Place::new();
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/1.0-kernel-2");
    let words = ["gear5 with [damping]", "nothing is wrong with it"];
    for name in RETIRED {
        fs::copy(golden.join(name), place.path(name)).unwrap();
        for command in ["energies NAME --every-step", "expand NAME --out more.mcap", "check NAME"] {
            place.run(&command.replace("NAME", name)).exits(3).says(&words);
        }
        let text = place.run(&format!("verify {name}")).exits(3).stdout();
        assert!(words.iter().all(|word| text.contains(word)), "{text}");
    }
    let new = place.run("run --preset damped --method gear5 --out new.mcap");
    new.exits(2).says(&["integrator.method", "found gear5; allowed: rk5 with [damping]"]);
}

/// What the commands say of a recording, and the hash of all of its states.
fn contents(place: &Place, name: &str) -> Value {
    let info = place.run(&format!("info {name} --json"));
    let exits = |command: &str| place.run(command).code();
    let about = info.json();
    let mut found = json!({
        "exit_codes": {
            "info": info.code(),
            "verify": exits(&format!("verify {name}")),
            "energies": exits(&format!("energies {name}")),
            "energies --every-step": exits(&format!("energies {name} --every-step")),
            "contacts": exits(&format!("contacts {name}")),
            "recover": exits(&format!("recover {name} --out recovered.mcap --force")),
        },
        "schema_version": about["manifest"]["schema_version"],
        "last_step": about["last_step"],
        "end_reason": about["end_reason"],
        "messages": about["channels"].as_array().unwrap().iter()
            .map(|channel| (channel["topic"].as_str().unwrap().to_owned(), channel["messages"].clone()))
            .collect::<serde_json::Map<_, _>>(),
    });
    let Ok(mut source) = RecordingSource::open(&place.path(name)) else { return found };
    found["physics_sha256"] = hex(&source.manifest().physics.hash()).into();
    let mut hashes = Vec::new();
    while let Received::Frame(frame) = source.receive().unwrap() {
        hashes.push(state_hash(frame.step, &[frame.u_m, frame.v_m_s, frame.extra].concat()));
    }
    found["last_state_hash"] = hashes.last().cloned().into();
    let energies = place.run(&format!("energies {name} --json")).json();
    found["total_j"] = energies["results"]["last"]["total_j"].clone();
    // the values do not depend on the machine, but their order of summation might be changed one day
    found["total_j"] = format!("{:.9e}", found["total_j"].as_f64().unwrap_or(f64::NAN)).into();
    found
}
