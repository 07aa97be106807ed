//! Which crate may use which: the arrows of `docs/ARCHITECTURE.md`, as cargo knows them.

use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

/// What the sources of each package may name, without what only its tests and its build script use.
fn dependencies() -> BTreeMap<String, BTreeSet<String>> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let mut command = Command::new(cargo);
    command.args(["metadata", "--no-deps", "--format-version=1"]).current_dir(env!("CARGO_MANIFEST_DIR"));
    let output = command.output().expect("cargo runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let text = |value: &Value| value.as_str().expect("a text").to_owned();
    let of = |package: &Value| {
        let normal =
            package["dependencies"].as_array().expect("a list").iter().filter(|it| it["kind"].is_null());
        normal.map(|it| text(&it["name"])).collect()
    };
    let packages = metadata["packages"].as_array().expect("a list").iter();
    packages.map(|package| (text(&package["name"]), of(package))).collect()
}

/// The packages of ours that use `name`.
fn users<'a>(all: &'a BTreeMap<String, BTreeSet<String>>, name: &str) -> Vec<&'a str> {
    all.iter().filter(|(_, uses)| uses.contains(name)).map(|(package, _)| package.as_str()).collect()
}

/// Everything of ours that `package` is built with.
fn needed(all: &BTreeMap<String, BTreeSet<String>>, package: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut left = vec![package.to_owned()];
    while let Some(next) = left.pop() {
        for used in all.get(&next).into_iter().flatten() {
            if found.insert(used.clone()) {
                left.push(used.clone());
            }
        }
    }
    found
}

#[test]
fn crates_use_what_the_architecture_says() {
    let all = dependencies();
    let only = |name: &str, expected: &[&str]| assert_eq!(users(&all, name), expected, "who uses {name}");
    // the bench measures ours against them
    only("iceoryx2", &["beadline-bench", "beadline-bus"]);
    only("mcap", &["beadline-bench", "beadline-recording"]);
    only("prost", &["beadline-recording"]);
    only("clap", &["beadline", "beadline-bench"]);
    only("indicatif", &["beadline"]);
    only("hyper", &["beadline-page"]);
    only("tokio", &["beadline-page", "beadline-storage"]);
    only("object_store", &["beadline-storage"]);
    only("realfft", &["beadline-waves"]);
    only("rustfft", &["beadline-waves"]);
    only("ratatui", &["beadline", "beadline-screen"]);
    only("zenoh", &["beadline-relay"]);
    only("anyhow", &["beadline", "beadline-bench", "beadline-paper"]);
    let ours = |package: &str| -> Vec<String> {
        needed(&all, package).into_iter().filter(|name| name.starts_with("beadline")).collect()
    };
    assert_eq!(ours("beadline-schemas"), [""; 0]);
    assert_eq!(ours("beadline-bus"), ["beadline-schemas"]);
    assert_eq!(ours("beadline-recording"), ["beadline-schemas", "beadline-storage"]);
    assert_eq!(ours("beadline-producer"), ["beadline-recording", "beadline-schemas", "beadline-storage"]);
    assert_eq!(ours("beadline-consumers"), ["beadline-recording", "beadline-schemas", "beadline-storage"]);
    assert_eq!(ours("beadline-figure"), ["beadline-schemas"]);
    assert_eq!(ours("beadline-waves"), ["beadline-schemas"]);
    assert_eq!(ours("beadline-page"), ["beadline-schemas", "beadline-storage"]);
    // no arrow of the product points into tests/
    assert_eq!(users(&all, "beadline-bench"), [""; 0]);
    assert_eq!(users(&all, "beadline"), ["beadline-bench"]);
    assert_eq!(
        ours("beadline-recorder"),
        ["beadline-bus", "beadline-recording", "beadline-schemas", "beadline-storage"]
    );
    for package in
        ["beadline-producer", "beadline-consumers", "beadline-paper", "beadline-exports", "beadline-screen"]
    {
        assert!(!needed(&all, package).contains("iceoryx2"), "{package} is built without the bus");
    }
}
