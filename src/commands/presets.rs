//! `beadline presets` and `beadline preset NAME`.

use crate::configuration::preset;
use crate::display;
use crate::failure::{Done, Failure};
use consumers::determination::TOLERANCE;
use schemas::presets::PRESETS;

pub(crate) fn list() -> Result<Done, Failure> {
    for preset in PRESETS {
        display::print(format_args!("{:16} {}\n", preset.name, preset.about))?;
    }
    Ok(Done::Whole)
}

pub(crate) fn print(name: &str) -> Result<Done, Failure> {
    let preset = preset(name)?;
    let determined = preset.determined_until.map_or_else(String::new, |(until_ms, bound)| {
        format!("# determined to {TOLERANCE:e} until {until_ms} ms, which the {bound} bounds; see `beadline check --preset {name}`\n")
    });
    let (about, config) = (preset.about, preset.config().to_toml());
    display::print(format_args!("# {about}\n{determined}# run it with `beadline run FILE.toml`\n{config}"))?;
    Ok(Done::Whole)
}
