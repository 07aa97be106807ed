//! The page refuses a manifest for what the command refuses it for.

use crate::harness::Place;
use crate::page_data::check;
use schemas::config::RunConfig;
use schemas::manifest::{ManifestError, Origin, RunManifest};
use serde_json::{Value, json};
use std::error::Error as _;
use std::fs;

/// Chains of every kind, small.
const BASES: [&str; 6] = [
    "chain = { beads = 10, bead_mass_kg = 1e-3, alpha = 1.5, stiffness = 1e7, impurities = [{ bead = 2, mass_kg = 2e-3 }, { bead = 5, mass_kg = 1e-3 }], \
     contacts = [{ contact = 1, stiffness = 2e7 }, { contact = 4, stiffness = 3e7 }] }\n\
     striker = { bead = 0, velocity_m_s = 5.0 }\ntime = { duration_s = 1e-4 }\nstream = { publish_every_steps = 2, record_every_steps = 4 }",
    "chain = { beads = 6, bead_mass_kg = 1e-3, alpha = 2.0, stiffness = 1e7, masses = { pattern_kg = [1e-3, 2e-3] }, \
     stiffnesses = { list = [1e7, 2e7, 1e7, 2e7, 1e7] } }\nends = { left = \"fixed\", right = \"fixed\", right_stiffness = 2e7 }\n\
     load = { gravity_m_s2 = 9.81, precompression_n = 10.0 }\ndamping = { restitution = 0.9 }\n\
     striker = [{ bead = 0, velocity_m_s = 1.0 }, { bead = 3, velocity_m_s = -1.0 }]\ntime = { duration_s = 1e-4 }",
    "seed = 3\nchain = { beads = 8, spheres = { material = \"steel\", radius_m = 5e-3 }, odd_spheres = [{ bead = 2, material = \"brass\", radius_m = 4e-3 }] }\n\
     disorder = [{ of = \"radii\", uniform = 0.1 }, { of = \"masses\", permuted = true }]\nends = { left = \"fixed\", left_material = \"brass\", right = \"absorbing\", absorbing_beads = 2 }\n\
     drive = [{ wall = \"left\", displacement_m = { sine = { amplitude = 1e-6, frequency_hz = 5e3, ramp_s = 1e-3 } } }]\ntime = { duration_s = 1e-4 }",
    "chain = { beads = 8, bead_mass_kg = 1e-3, bonds = { linear = 1e5, cubic = { pattern = [1e12, 2e12] } } }\nends = { left = \"periodic\", right = \"periodic\" }\n\
     on_site = { linear_n_per_m = 10.0 }\nresonators = { mass_kg = 1e-4, stiffness_n_per_m = 1e4 }\n\
     initial = { plane_wave = { cycles = 1.0, displacement_m = 1e-6 }, gaussian = { bead = 3.0, width_beads = 1.0, velocity_m_s = 0.1 }, resonator_displacements_m = [0.0, 1e-6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0] }\ntime = { duration_s = 1e-4 }",
    "chain = { beads = 6, bead_mass_kg = 1e-3, alpha = 1.5, stiffness = 1e7, alphas = { pattern = [1.5, 2.0] }, second = { alpha = 3.0, stiffness = 1e9 }, gaps_m = 1e-6 }\n\
     initial = { thermal = { temperature_k = 1e15 } }\n\
     drive = [{ bead = 1, force_n = { table = { times_s = [0.0, 1.0], values = [1.0, 2.0] } } }, { bead = 3, velocity_m_s = { gaussian = { amplitude = 0.1, at_s = 1e-3, width_s = 1e-3 } } }]\n\
     time = { duration_s = 1e-4 }",
    "chain = { beads = 5, bead_mass_kg = 1e-3, alpha = 1.5, stiffness = 1e7, masses = { taper = 0.9 } }\ndamping = { power = { coefficient = 1.0, exponent = 0.5 } }\n\
     initial = { mode = { number = 2, velocity_m_s = 0.1 }, velocities_m_s = [0.0, 1.0, 0.0, 0.0, 0.0] }\ntime = { duration_s = 1e-4 }",
];

/// What physics may hold besides, right by itself or not.
fn additions() -> Vec<Value> {
    let sphere = json!({ "radius_m": 5e-3, "density_kg_m3": 8000.0, "young_pa": 193e9, "poisson": 0.3 });
    let drive = |place: Value, shape: Value| {
        let mut drive = place;
        drive.as_object_mut().unwrap().extend(shape.as_object().unwrap().clone());
        json!({ "drives": [drive] })
    };
    let sine = json!({ "sine": { "amplitude": 1e-6, "frequency_hz": 1e3 } });
    let (left, bead) = (json!({ "wall": "left" }), json!({ "bead": 1 }));
    vec![
        json!({ "method": "velocity-verlet" }),
        json!({ "method": "gear5" }),
        json!({ "method": "rk5" }),
        json!({ "kernel_version": 3 }),
        json!({ "alpha": 2.0 }),
        json!({ "impurities": [] }),
        json!({ "striker": { "bead": 1, "velocity_m_s": 0.0 } }),
        json!({ "striker": { "bead": 1, "velocity_m_s": -0.0 } }),
        json!({ "strikers": [{ "bead": 1, "velocity_m_s": 1.0 }] }),
        json!({ "masses": "uniform" }),
        json!({ "masses": { "taper": 1e-50 } }),
        json!({ "masses": { "list_kg": [1e-3, 1e-3] } }),
        json!({ "stiffnesses": "radii" }),
        json!({ "stiffnesses": { "pattern": [1e7] } }),
        json!({ "contacts": [{ "contact": 0, "stiffness": 1e7 }] }),
        json!({ "ends": { "left": "fixed", "right": "fixed" } }),
        json!({ "ends": { "left": "periodic", "right": "periodic" } }),
        json!({ "ends": { "left": "periodic", "right": "free" } }),
        json!({ "ends": { "left": "absorbing", "right": "free" } }),
        json!({ "ends": { "left": "free", "right": "free", "left_stiffness": 1e7 } }),
        json!({ "ends": { "left": "free", "right": "free", "absorbing_beads": 2 } }),
        json!({ "load": { "gravity_m_s2": -9.81 } }),
        json!({ "load": { "precompression_n": 1.0 } }),
        json!({ "load": {} }),
        json!({ "damping": { "viscous_n_s_per_m": 1.0 } }),
        json!({ "damping": { "kuwabara_kono_s": 1e-6 } }),
        json!({ "damping": { "restitution": { "coefficient": 0.9, "damping_ratio": 0.5 } } }),
        json!({ "seed": 18_446_744_073_709_551_615_u64 }),
        json!({ "disorder": [{ "of": "masses", "two_valued": { "fraction": 0.5, "factor": 2.0 } }] }),
        json!({ "disorder": [{ "of": "radii", "normal": 0.1 }] }),
        json!({ "disorder": [{ "of": "masses", "normal": 0.1, "permuted": true }] }),
        json!({ "spheres": sphere.clone() }),
        json!({ "spheres": [sphere.clone(), sphere], "alpha": 1.5, "impurities": [] }),
        json!({ "alphas": 2.0 }),
        json!({ "second": { "alpha": 2.0, "stiffness": { "pattern": [1e7, 0.0] } } }),
        json!({ "gaps_m": { "list": [0.0] } }),
        json!({ "bonds": { "quadratic": -1e8 } }),
        json!({ "bonds": { "toda": { "stiffness": 1e5, "steepness_per_m": 1e3 } } }),
        json!({ "on_site": {} }),
        json!({ "on_site": { "drag_n_s_per_m": 0.1 } }),
        json!({ "on_site": { "cubic_n_per_m3": 1e9 } }),
        json!({ "resonators": { "mass_kg": 0.0, "stiffness_n_per_m": 1e4 } }),
        json!({ "initial": { "displacements_m": [0.0, 1e-6] } }),
        json!({ "initial": { "resonator_velocities_m_s": [0.0, 1e-6] } }),
        json!({ "initial": { "resonator_displacements_m": [] } }),
        json!({ "initial": { "from": { "recording": "a", "step": 3 } } }),
        json!({ "initial": { "solitary": [{ "bead": 3.0, "velocity_m_s": 1.0 }] } }),
        json!({ "initial": { "thermal": { "temperature_k": 1.0, "energy_j": 1.0 } } }),
        json!({ "initial": { "mode": { "number": 1 } }, "striker": { "bead": 0, "velocity_m_s": 0.0 } }),
        drive(left.clone(), json!({ "displacement_m": sine })),
        drive(left, json!({ "force_n": sine })),
        drive(bead.clone(), json!({ "force_n": { "constant": 0.0 } })),
        drive(bead.clone(), json!({ "velocity_m_s": sine, "force_n": sine })),
        drive(bead.clone(), json!({ "displacement_m": { "step": { "amplitude": 1e-6 } } })),
        drive(
            bead.clone(),
            json!({ "velocity_m_s": { "ramp": { "amplitude": 1.0, "from_s": 1.0, "to_s": 0.5 } } }),
        ),
        drive(
            bead.clone(),
            json!({ "force_n": { "sine": { "amplitude": 1.0, "frequency_hz": 1e3, "ramp_down_s": 1e-3 } } }),
        ),
        drive(bead.clone(), json!({ "force_n": { "half_sine": { "amplitude": 1.0, "duration_s": 1e-9 } } })),
        drive(
            bead,
            json!({ "force_n": { "table": { "times_s": [0.0, 1e-9], "values": [1.0, 1.0], "interpolation": "cubic" } } }),
        ),
    ]
}

/// Other values in the place of one.
fn others(value: &Value) -> Vec<Value> {
    let mut others = match value {
        Value::Number(number) if number.is_u64() => {
            let number = number.as_u64().unwrap();
            vec![
                json!(0),
                json!(-1),
                json!(number + 1),
                json!(number * 3 + 7),
                json!(number as f64 + 0.5),
                json!(1u64 << 60),
            ]
        }
        Value::Number(number) => {
            let number = number.as_f64().unwrap();
            vec![json!(0.0), json!(-number), json!(1e200), json!(1e-200), json!(1.5), json!(2000.0)]
        }
        Value::Bool(value) => vec![json!(!value)],
        Value::Array(list) => {
            let (mut twice, mut less) = (list.clone(), list.clone());
            twice.extend(list.first().cloned());
            less.pop();
            vec![json!([]), list.iter().rev().cloned().collect(), twice.into(), less.into()]
        }
        Value::Object(entries) => {
            let without = entries.keys().map(|key| {
                let mut entries = entries.clone();
                entries.remove(key);
                Value::from(entries)
            });
            let mut more = entries.clone();
            more.insert("weather".to_owned(), json!(1));
            without.chain([json!({}), more.into()]).collect()
        }
        Value::Null | Value::String(_) => Vec::new(),
    };
    others.extend([json!("nonsense"), json!([1]), json!({ "weather": 1 }), json!(true)]);
    others
}

/// All that `value` becomes when one thing in it is another.
fn changed(value: &Value) -> Vec<Value> {
    let mut all = others(value);
    match value {
        Value::Array(list) => {
            for (i, inside) in list.iter().enumerate() {
                all.extend(changed(inside).into_iter().map(|inside| {
                    let mut list = list.clone();
                    list[i] = inside;
                    Value::from(list)
                }));
            }
        }
        Value::Object(entries) => {
            for (key, inside) in entries {
                all.extend(changed(inside).into_iter().map(|inside| {
                    let mut entries = entries.clone();
                    entries.insert(key.clone(), inside);
                    Value::from(entries)
                }));
            }
        }
        _ => {}
    }
    all
}

/// Why the command refuses a manifest, if it does.
fn refusal(manifest: &Value) -> Option<String> {
    let error = RunManifest::from_json(manifest.to_string().as_bytes()).err()?;
    // a value of another type is found by its reader, before what it means
    let kind = if matches!(error, ManifestError::Json(_)) { "json: " } else { "" };
    Some(format!("{kind}{}", error.source().map_or_else(|| error.to_string(), ToString::to_string)))
}

#[test]
fn the_page_refuses_the_manifests_that_the_command_refuses() {
    let place = Place::new();
    let origin = Origin { program: "test".into(), host: "here".into(), started_unix_ns: 1 };
    let mut cases = Vec::new();
    for base in BASES {
        let config = RunConfig::from_toml(base).unwrap_or_else(|error| panic!("{error} in\n{base}"));
        let manifest = RunManifest::new(&config, "run", origin.clone())
            .unwrap_or_else(|error| panic!("{error} in\n{base}"));
        let manifest: Value = serde_json::from_str(&manifest.to_json()).unwrap();
        assert_eq!(refusal(&manifest), None, "{base}");
        let with = |part: &str, value: Value| {
            let mut manifest = manifest.clone();
            manifest[part] = value;
            manifest
        };
        cases.push(manifest.clone());
        for part in ["physics", "provenance"] {
            cases.extend(changed(&manifest[part]).into_iter().map(|value| with(part, value)));
        }
        let added = |physics: &Value, addition: &Value| {
            let mut physics = physics.clone();
            physics.as_object_mut().unwrap().extend(addition.as_object().unwrap().clone());
            physics
        };
        let additions = additions();
        for (i, one) in additions.iter().enumerate() {
            let physics = added(&manifest["physics"], one);
            cases.push(with("physics", physics.clone()));
            // two of them in the plain chain
            let others = if base == BASES[0] { &additions[i + 1..] } else { &[] };
            cases.extend(others.iter().map(|other| with("physics", added(&physics, other))));
        }
    }
    let told = cases
        .iter()
        .map(|manifest| json!({ "manifest": manifest, "refused": refusal(manifest) }).to_string());
    let path = place.path("manifests.jsonl");
    fs::write(&path, told.collect::<Vec<_>>().join("\n")).unwrap();
    check(&place, ["--manifests".as_ref(), path.as_os_str()], "manifests");
}
