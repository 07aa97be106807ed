//! `beadline schema KIND`: the JSON Schema of runs, sweeps or orbits as files, for editors.

use crate::display;
use crate::failure::{Done, Failure};
use schemas::config::RunConfig;

pub(crate) fn print(kind: &str) -> Result<Done, Failure> {
    let schema = match kind {
        "sweep" => producer::sweep::schema(),
        "orbit" => orbits::file::schema(),
        _ => RunConfig::schema(),
    };
    display::print(format_args!("{}\n", serde_json::to_string_pretty(&schema)?))?;
    Ok(Done::Whole)
}

/// The first lines of a file of a kind, by which an editor finds the schema beside it.
pub(crate) fn line(kind: &str) -> String {
    let file = format!("beadline-{kind}.schema.json");
    format!("#:schema ./{file}\n# editors know the keys after `beadline schema {kind} > {file}`\n")
}
