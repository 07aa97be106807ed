//! Imports of crates: the table of `docs/ARCHITECTURE.md`, and what cargo knows.

use super::counts::BUDGETS;
use super::source::{read, root};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

type Names = BTreeSet<String>;

/// A crate by its name in the table: the directory of its `Cargo.toml`.
fn name_of(package: &Value) -> String {
    let manifest = package["manifest_path"].as_str().unwrap();
    let directory = manifest.strip_suffix("Cargo.toml").and_then(|path| path.strip_prefix(root().to_str()?));
    match directory.unwrap().trim_matches('/') {
        "" => "the command".to_owned(),
        directory => directory.to_owned(),
    }
}

/// The word by which other rows of the table name a crate.
fn last(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}

/// The dependencies of each crate, without those of its tests and its build script; ours by the last words of their names.
fn dependencies() -> BTreeMap<String, Names> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let packages = ["Cargo.toml", "python/Cargo.toml"].into_iter().flat_map(|manifest| {
        let mut command = Command::new(&cargo);
        command.args(["metadata", "--no-deps", "--format-version=1", "--manifest-path"]);
        let output = command.arg(root().join(manifest)).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let metadata: Value = serde_json::from_slice(&output.stdout).unwrap();
        metadata["packages"].as_array().unwrap().clone()
    });
    let packages: Vec<Value> = packages.collect();
    let ours = packages
        .iter()
        .map(|package| (package["name"].as_str().unwrap(), last(&name_of(package)).to_owned()));
    let ours: BTreeMap<_, _> = ours.collect();
    let used = |package: &Value| {
        let all = package["dependencies"].as_array().unwrap().iter().filter(|it| it["kind"].is_null());
        let names = all.map(|it| it["name"].as_str().unwrap());
        names.map(|name| ours.get(name).map_or(name, String::as_str).to_owned()).collect()
    };
    packages.iter().map(|package| (name_of(package), used(package))).collect()
}

/// Rows of the table: a crate, the crates of ours that it imports, and the foreign ones that only such rows name.
fn table() -> Vec<(String, Names, Names)> {
    let text = read(&root().join("docs/ARCHITECTURE.md"));
    let rows = text.lines().skip_while(|line| !line.starts_with("| crate |")).skip(2);
    let names = |cell: &str| cell.split(", ").map(str::to_owned).filter(|name| !name.is_empty()).collect();
    let row = |line: &str| {
        let cells: Vec<_> = line.trim_matches('|').split('|').map(str::trim).collect();
        let [name, ours, alone] = cells[..] else { panic!("three cells: {line}") };
        (name.to_owned(), names(ours), names(alone))
    };
    rows.take_while(|line| line.starts_with('|')).map(row).collect()
}

#[test]
fn crates_import_what_the_architecture_says() {
    let all = dependencies();
    let table = table();
    let ours: BTreeSet<_> = all.keys().map(|name| last(name).to_owned()).collect();
    let found: BTreeMap<_, _> = all.iter().map(|(name, used)| (name, used & &ours)).collect();
    let said: BTreeMap<_, _> = table.iter().map(|(name, ours, _)| (name, ours.clone())).collect();
    assert_eq!(said, found, "the table of docs/ARCHITECTURE.md, and the imports");
    for foreign in table.iter().flat_map(|(.., alone)| alone) {
        let said: Vec<_> =
            table.iter().filter(|(.., alone)| alone.contains(foreign)).map(|(name, ..)| name).collect();
        let mut found: Vec<_> =
            all.iter().filter(|(_, used)| used.contains(foreign)).map(|(name, _)| name).collect();
        found.sort_by_key(|name| table.iter().position(|(row, ..)| row == *name));
        assert_eq!(said, found, "who imports {foreign}, by docs/ARCHITECTURE.md and by cargo");
    }
}

#[test]
fn every_crate_has_a_budget() {
    let crates = dependencies().into_keys().filter(|name| name != "tests/hostile").collect::<Names>();
    assert_eq!(BUDGETS.iter().map(|(name, _)| (*name).to_owned()).collect::<Names>(), crates);
}

/// All that a crate is built with.
fn needed<'a>(all: &'a BTreeMap<String, Names>, name: &'a str) -> BTreeSet<&'a str> {
    let (mut found, mut left) = (BTreeSet::new(), vec![name]);
    while let Some(next) = left.pop() {
        let used = all.iter().filter(|(name, _)| last(name) == last(next)).flat_map(|(_, used)| used);
        left.extend(used.map(String::as_str).filter(|used| found.insert(*used)));
    }
    found
}

#[test]
fn producer_and_consumers_meet_only_above_them_and_need_no_bus() {
    let all = dependencies();
    assert!(
        !needed(&all, "producer").contains("consumers") && !needed(&all, "consumers").contains("producer")
    );
    for name in all.keys().filter(|name| name.starts_with("producer") || name.starts_with("consumers")) {
        assert!(!needed(&all, name).contains("iceoryx2"), "{name} is built with the bus");
    }
}
