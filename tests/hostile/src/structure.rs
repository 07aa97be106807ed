//! Manifests changed by their structure: keys, lengths, kinds of values, numbers at their ends.

use crate::checksums;
use crate::metadata::Metadata;
use crate::random::Random;
use crate::records::{Parts, op};
use schemas::config::RunConfig;
use schemas::manifest::{Origin, RunManifest};
use schemas::presets::{PRESETS, Preset};
use serde_json::{Map, Number, Value, json};

/// Numbers at which something begins or ends: of doubles, of what a run may have, of whole numbers.
const ENDS: [f64; 24] = [
    0.0,
    -0.0,
    0.5,
    1.0,
    -1.0,
    1.5,
    1000.0,
    1_000.000_000_000_1,
    5e-324,
    2.225_073_858_507_201_4e-308,
    1e-300,
    1e-101,
    1e-100,
    1e-9,
    1e-6,
    0.02,
    2.0,
    1e3,
    1e9,
    1e100,
    1.1e100,
    1e154,
    1e200,
    f64::MAX,
];

/// The same of whole numbers.
const WHOLE_ENDS: [u64; 18] = [
    0,
    1,
    2,
    3,
    4,
    5,
    16,
    17,
    1000,
    20_000_000,
    20_000_001,
    u32::MAX as u64,
    1 << 32,
    1 << 52,
    (1 << 52) + 1,
    1 << 53,
    1 << 63,
    u64::MAX,
];

/// What JSON can say and no value of serde's has: put into the text for a string that stands for it.
const WORDS: [&str; 8] = ["1e999", "-1e999", "1e-400", "1E5", "-0", "1.0", "00", "NaN"];

/// Manifests of runs of every kind: those of the presets, and of the chains that `tests/reference` has states of.
pub fn runs() -> Vec<Value> {
    let of = |text| serde_json::from_str::<Vec<Value>>(text).unwrap_or_default();
    let cases = [
        of(include_str!("../../reference/driven-state-cases.json")),
        of(include_str!("../../reference/bath-cases.json")),
    ];
    let texts = cases.iter().flatten().filter_map(|case| case["toml"].as_str());
    let configs =
        PRESETS.iter().map(Preset::config).chain(texts.filter_map(|text| RunConfig::from_toml(text).ok()));
    let manifest = |config: RunConfig| {
        let origin = Origin { program: "hostile".to_owned(), host: "here".to_owned(), started_unix_ns: 1 };
        let manifest = RunManifest::new(&config, "hostile", origin).ok()?;
        serde_json::from_str(&manifest.to_json()).ok()
    };
    configs.filter_map(manifest).collect()
}

/// The manifest with one to four changes; values come from `others`, too, so that a chain gets what another one has.
pub fn mutate(manifest: &Value, others: &[Value], random: &mut Random) -> String {
    let mut changed = manifest.clone();
    for _ in 0..=random.below(4) {
        change(&mut changed, others, random);
    }
    let mut text = changed.to_string();
    for (i, word) in WORDS.iter().enumerate() {
        text = text.replace(&format!("\"\\u0001{i}\""), word);
    }
    text
}

fn change(manifest: &mut Value, others: &[Value], random: &mut Random) {
    if random.one_in(4) {
        return graft(manifest, others, random);
    }
    let mut paths = Vec::new();
    collect(manifest, &mut String::new(), &mut paths);
    let Some(value) = paths.get(random.below(paths.len())).and_then(|path| manifest.pointer_mut(path)) else {
        return;
    };
    match value {
        Value::Number(number) if !random.one_in(8) => *value = another_number(number, random),
        Value::Array(list) if !random.one_in(8) => change_list(list, random),
        Value::Object(keys) if !random.one_in(8) => change_keys(keys, random),
        _ => *value = another_kind(random),
    }
}

/// The path of every value below `value`, but for those of long lists, of which the first and the last count.
fn collect(value: &Value, path: &mut String, paths: &mut Vec<String>) {
    let length = path.len();
    let mut go = |name: &str, below: &Value| {
        path.push('/');
        path.push_str(name);
        paths.push(path.clone());
        collect(below, path, paths);
        path.truncate(length);
    };
    match value {
        Value::Object(keys) => keys.iter().for_each(|(key, below)| go(key, below)),
        Value::Array(list) => {
            let ends = list.iter().enumerate().filter(|(i, _)| *i < 3 || i + 1 == list.len());
            ends.for_each(|(i, below)| go(&i.to_string(), below));
        }
        _ => {}
    }
}

fn another_number(number: &Number, random: &mut Random) -> Value {
    let (double, whole) = (number.as_f64().unwrap_or_default(), number.as_u64());
    match (random.below(6), whole) {
        (0, _) => json!(double * random.one_of([2.0, 0.5, -1.0, 1e3, 1e-3])),
        (1, Some(whole)) => json!(whole.wrapping_add(random.one_of([1, u64::MAX]))),
        (1, None) => json!(random.one_of([double.next_up(), double.next_down()])),
        (2, _) => json!(format!("\u{1}{}", random.below(WORDS.len()))),
        (_, Some(_)) if !random.one_in(4) => json!(random.one_of(WHOLE_ENDS)),
        _ => json!(random.one_of(ENDS)),
    }
}

fn another_kind(random: &mut Random) -> Value {
    match random.below(8) {
        0 => Value::Null,
        1 => json!(random.one_in(2)),
        2 => json!(random.one_of(["", "fixed", "periodic", "absorbing", "free", "rk5", "gear5", "x"])),
        3 => json!([]),
        4 => json!({}),
        5 => json!(random.one_of(WHOLE_ENDS)),
        6 => json!([random.one_of(ENDS), random.one_of(ENDS)]),
        _ => json!(random.one_of(ENDS)),
    }
}

fn change_list(list: &mut Vec<Value>, random: &mut Random) {
    let at = random.below(list.len());
    match random.below(6) {
        0 => list.clear(),
        1 => list.truncate(at),
        2 if !list.is_empty() => drop(list.remove(at)),
        3 if !list.is_empty() => {
            let again = list[at].clone();
            let count = random.one_of([1, 2, 20, 300]);
            list.extend(std::iter::repeat_n(again, count));
        }
        4 => list.reverse(),
        _ => list.push(another_kind(random)),
    }
}

fn change_keys(keys: &mut Map<String, Value>, random: &mut Random) {
    let Some(key) = keys.keys().nth(random.below(keys.len())).cloned() else { return };
    match random.below(3) {
        0 => drop(keys.remove(&key)),
        1 => {
            let value = keys.remove(&key).unwrap_or_default();
            keys.insert(format!("{key}x"), value);
        }
        _ => {
            keys.insert(key, another_kind(random));
        }
    }
}

/// Gives the physics a key of another run's.
fn graft(manifest: &mut Value, others: &[Value], random: &mut Random) {
    let Some(other) = others.get(random.below(others.len())) else { return };
    let Some(physics) = other.get("physics").and_then(Value::as_object) else { return };
    let Some((key, value)) = physics.iter().nth(random.below(physics.len())) else { return };
    if let Some(own) = manifest.get_mut("physics").and_then(Value::as_object_mut) {
        own.insert(key.clone(), value.clone());
    }
}

/// The manifest of a recording.
pub fn manifest_of(recording: &[u8]) -> Option<Value> {
    let parts = Parts::of_file(recording);
    let record = parts.records.iter().find(|record| record.opcode == op::METADATA)?;
    let mut metadata = Metadata::read(&record.body)?;
    let mut part = |key: &str| metadata.value(key).cloned();
    let version = part("schema_version")?;
    let (major, minor) = version.split_once('.')?;
    let (major, minor): (u32, u32) = (major.parse().ok()?, minor.parse().ok()?);
    let read = |text: String| serde_json::from_str::<Value>(&text).ok();
    let (physics, provenance) = (read(part("physics")?)?, read(part("provenance")?)?);
    Some(json!({
        "schema_version": { "major": major, "minor": minor }, "physics": physics, "provenance": provenance
    }))
}

/// The recording with the physics and the provenance of `manifest`, the text of a whole one, and right checksums; none if that text has
/// not both.
pub fn with_manifest(recording: &[u8], manifest: &str) -> Option<Vec<u8>> {
    let (physics, provenance) = parts_of(manifest)?;
    with_entries(recording, &[("physics", physics), ("provenance", provenance)])
}

/// The recording with another schema version, and right checksums.
pub fn with_version(recording: &[u8], version: &str) -> Option<Vec<u8>> {
    with_entries(recording, &[("schema_version", version)])
}

fn with_entries(recording: &[u8], entries: &[(&str, &str)]) -> Option<Vec<u8>> {
    let mut file = Parts::of_file(recording);
    let record = file.records.iter_mut().find(|record| record.opcode == op::METADATA)?;
    let mut metadata = Metadata::read(&record.body)?;
    for (key, text) in entries {
        (*text).clone_into(metadata.value(key)?);
    }
    record.body = metadata.write();
    let mut bytes = file.put_together();
    checksums::correct(&mut bytes);
    Some(bytes)
}

/// Physics and provenance in the text of a manifest that [`mutate`] made, whose keys are in order.
fn parts_of(manifest: &str) -> Option<(&str, &str)> {
    let (physics, rest) = manifest.strip_prefix("{\"physics\":")?.rsplit_once(",\"provenance\":")?;
    let (provenance, _) = rest.rsplit_once(",\"schema_version\":")?;
    Some((physics, provenance))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_seed_changes_the_same_and_every_kind_of_change_is_made() {
        let manifest =
            json!({ "physics": { "beads": 3, "list": [1.0, 2.0], "ends": "free" }, "provenance": {} });
        let others = [json!({ "physics": { "drives": [] } })];
        assert!(runs().len() >= 40, "{} presets and cases of the reference", runs().len());
        let all: Vec<String> =
            (0..500).map(|seed| mutate(&manifest, &others, &mut Random::new(seed))).collect();
        assert_eq!(all[7], mutate(&manifest, &others, &mut Random::new(7)));
        for part in ["1e999", "drives", "beadsx", "18446744073709551615", "null", "[]", "5e-324"] {
            assert!(all.iter().any(|text| text.contains(part)), "{part}");
        }
    }
}
