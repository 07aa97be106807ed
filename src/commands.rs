//! One module for each mode; each reads from top to bottom.

use crate::display;
use crate::failure::{Done, Failure};
use source::Named;
use std::path::PathBuf;

pub(crate) mod analyse;
pub(crate) mod analyses;
pub(crate) mod catalog;
pub(crate) mod check;
pub(crate) mod demo;
pub(crate) mod export;
pub(crate) mod film;
pub(crate) mod info;
pub(crate) mod ls;
pub(crate) mod manual;
pub(crate) mod orbit;
pub(crate) mod plot;
pub(crate) mod presets;
pub(crate) mod record;
pub(crate) mod recover;
pub(crate) mod relay;
pub(crate) mod replay;
pub(crate) mod reproduce;
pub(crate) mod run;
pub(crate) mod schema;
pub(crate) mod share;
pub(crate) mod sweep;
pub(crate) mod thin;
#[cfg_attr(not(feature = "live"), path = "commands/absent.rs")]
pub(crate) mod top;
pub(crate) mod upload;
pub(crate) mod verify;
pub(crate) mod view;

/// Prints the one of `examples`, files of a `kind` to begin with by their names, that is asked for.
pub(crate) fn print_example(kind: &str, examples: &[(&str, &str)], asked: &str) -> Result<Done, Failure> {
    let Some((_, text)) = examples.iter().find(|(name, _)| *name == asked) else {
        let names: Vec<&str> = examples.iter().map(|(name, _)| *name).collect();
        return Err(bad_input!("there is no example `{asked}`; there are: {}", names.join(", ")));
    };
    display::print(schema::line(kind) + text)?;
    Ok(Done::Whole)
}

/// The recording that is named. A live run cannot be `done`, such as exported.
pub(crate) fn recording_of(source: &Named, done: &str) -> Result<PathBuf, Failure> {
    match source {
        Named::File(path) => Ok(path.clone()),
        Named::Live(_) => Err(bad_input!(
            "{source}: a live run cannot be {done}; `beadline record {source} --out FILE.mcap` makes a recording of it"
        )),
    }
}
