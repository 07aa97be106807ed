//! JSON Schemas for editors, against the files that the program takes and refuses.

use crate::harness::{Place, python};
use std::process::Command;

/// Files that the program takes are valid; 200 wrong ones are not, and whatever a schema refuses, the program refuses.
#[test]
fn schemas_refuse_what_the_program_refuses_and_nothing_else() {
    let Some(python) = python() else { return };
    let place = Place::new();
    let root = env!("CARGO_MANIFEST_DIR");
    let script = format!("{root}/tests/python/check_schemas.py");
    let mut command = Command::new(python);
    command.args([&script, env!("CARGO_BIN_EXE_beadline"), root]).current_dir(place.path("."));
    let output = command.output().unwrap();
    let (said, wrong) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{said}{wrong}");
}

#[test]
fn files_to_begin_with_name_their_schemas() {
    let place = Place::new();
    for (words, kind) in
        [("preset walls", "run"), ("sweep --example", "sweep"), ("orbit --example fput", "orbit")]
    {
        let text = place.run(words).exits(0).stdout();
        let mut lines = text.lines();
        assert_eq!(lines.next(), Some(format!("#:schema ./beadline-{kind}.schema.json").as_str()));
        let told = lines.next().and_then(|line| line.split('`').nth(1)).unwrap();
        let (told, file) = told.split_once(" > ").unwrap();
        assert_eq!(file, format!("beadline-{kind}.schema.json"));
        let schema = place.run(told.strip_prefix("beadline ").unwrap()).exits(0).json();
        assert_eq!(schema["$schema"], "https://json-schema.org/draft/2020-12/schema");
    }
    place.run("schema chain").exits(2).says(&["run, sweep, orbit"]);
}
