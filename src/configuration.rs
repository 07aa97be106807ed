//! From the flags of `run` to a manifest.

use crate::args::{Overrides, RunArgs};
use crate::failure::{BadInput, Failure};
use anyhow::{Context, anyhow};
use schemas::config::{Impurity, RunConfig};
use schemas::manifest::{Origin, RunManifest};
use schemas::presets::{PRESETS, Preset};
use std::fmt::Write;
use std::fs;
use std::time::{SystemTime, UNIX_EPOCH};

/// A run to be made, and the text of its configuration for the recording.
pub(crate) struct Configured {
    pub(crate) manifest: RunManifest,
    pub(crate) toml: String,
}

/// Reads the configuration that `args` name and applies the overrides.
pub(crate) fn configure(args: &RunArgs) -> Result<Configured, Failure> {
    let (text, mut config) = if let Some(path) = &args.config {
        let unreadable = || format!("{} cannot be read", path.display());
        let text = fs::read_to_string(path).with_context(unreadable).bad_input()?;
        let config = RunConfig::from_toml(&text).map_err(|e| e.located(&text, Some(path))).bad_input()?;
        (text, config)
    } else {
        let config = preset(&args.preset)?.config();
        (config.to_toml(), config)
    };
    let written = config.clone();
    apply(&args.overrides, args.name.as_ref(), &mut config);
    let fallback = args.config.as_ref().and_then(|path| path.file_stem()).and_then(|stem| stem.to_str());
    let manifest = RunManifest::new(&config, fallback.unwrap_or("run"), origin()).map_err(|error| {
        // a value that an override set has no line in the file
        if config == written { error.located(&text, args.config.as_deref()) } else { error }
    });
    let toml = if config == written { text } else { overridden(args, &config) };
    Ok(Configured { manifest: manifest.bad_input()?, toml })
}

/// The preset of that name.
pub(crate) fn preset(name: &str) -> Result<Preset, Failure> {
    let known = || PRESETS.map(|preset| preset.name).join(", ");
    Preset::find(name)
        .ok_or_else(|| anyhow!("there is no preset `{name}`; there are: {}", known()))
        .bad_input()
}

fn apply(overrides: &Overrides, name: Option<&String>, config: &mut RunConfig) {
    fn set<T: Copy>(value: &mut T, with: Option<T>) {
        *value = with.unwrap_or(*value);
    }
    if let Some(name) = name {
        config.name = Some(name.clone());
    }
    set(&mut config.chain.beads, overrides.beads);
    set(&mut config.chain.alpha, overrides.alpha);
    set(&mut config.chain.stiffness, overrides.stiffness);
    set(&mut config.chain.bead_mass_kg, overrides.bead_mass);
    if !overrides.impurity.is_empty() {
        let listed = overrides.impurity.iter().flatten();
        config.chain.impurities =
            listed.map(|(bead, mass_kg)| Impurity { bead: *bead, mass_kg: *mass_kg }).collect();
    }
    if let Some((bead, velocity_m_s)) = overrides.striker {
        config.striker.bead = bead;
        config.striker.velocity_m_s = velocity_m_s;
    }
    set(&mut config.time.duration_s, overrides.duration);
    config.time.dt_s = overrides.dt.or(config.time.dt_s);
    set(&mut config.integrator.method, overrides.method);
    set(&mut config.stream.publish_every_steps, overrides.publish_every_steps);
    set(&mut config.stream.record_every_steps, overrides.record_every_steps);
    // asking for fewer published frames asks for fewer recorded ones, unless both are given
    if overrides.publish_every_steps.is_some() && overrides.record_every_steps.is_none() {
        let published = config.stream.publish_every_steps.max(1);
        config.stream.record_every_steps = config.stream.record_every_steps.next_multiple_of(published);
    }
}

/// The effective configuration, with a line that says what it was made from.
fn overridden(args: &RunArgs, config: &RunConfig) -> String {
    let mut text = match &args.config {
        Some(path) => format!("# {}, with values replaced on the command line\n", path.display()),
        None => format!("# preset {}, with values replaced on the command line\n", args.preset),
    };
    // writing to a String cannot fail
    let _ = write!(text, "{}", config.to_toml());
    text
}

fn origin() -> Origin {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Origin {
        program: format!("beadline {}", env!("CARGO_PKG_VERSION")),
        host: rustix::system::uname().nodename().to_string_lossy().into_owned(),
        started_unix_ns: u64::try_from(since_epoch.as_nanos()).unwrap_or(u64::MAX),
    }
}
