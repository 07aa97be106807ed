//! `beadline presets` and `beadline preset NAME`.

use crate::commands::schema;
use crate::configuration::preset;
use crate::display;
use crate::failure::{Done, Failure};
use schemas::presets::PRESETS;

pub(crate) fn list() -> Result<Done, Failure> {
    for preset in PRESETS {
        display::print(format_args!("{:16} {}\n", preset.name, preset.about))?;
    }
    Ok(Done::Whole)
}

pub(crate) fn print(name: &str) -> Result<Done, Failure> {
    let preset = preset(name)?;
    let (about, config) = (preset.about, preset.config().to_toml());
    let schema = schema::line("run");
    display::print(format_args!("{schema}# {about}\n# run it with `beadline run FILE.toml`\n{config}"))?;
    Ok(Done::Whole)
}
