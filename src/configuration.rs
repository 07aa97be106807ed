//! Makes a manifest from the flags of `run`.

use crate::args::{CreditArgs, Overrides};
use crate::failure::{BadInput, Failure};
use crate::time_step::{self, TimeStep};
use anyhow::{Context, anyhow};
use recording::RecordingInfo;
use schemas::config::{
    ConfigError, DRAWS, End, Impurity, MassRule, OWN_STIFFNESSES, RunConfig, StiffnessRule, StrikerConfig,
    Strikers,
};
use schemas::manifest::{Origin, RunManifest};
use schemas::presets::{PRESETS, Preset};
use schemas::text;
use std::fmt::Write;
use std::path::PathBuf;
use std::time::{SystemTime, UNIX_EPOCH};

/// A run to be made, and the text of its configuration for the recording.
pub(crate) struct Configured {
    pub(crate) manifest: RunManifest,
    pub(crate) toml: String,
    /// The duration (s) that was asked for.
    pub(crate) duration_s: f64,
    /// The files that it was read from.
    pub(crate) inputs: Vec<PathBuf>,
}

impl Configured {
    /// As it was recorded.
    pub(crate) fn recorded(info: &RecordingInfo) -> Self {
        let physics = &info.manifest.physics;
        Self {
            manifest: info.manifest.clone(),
            toml: info.run_toml.clone().unwrap_or_default(),
            duration_s: physics.time_s(physics.step_count),
            inputs: Vec::new(),
        }
    }
}

/// The flags that name and change a configuration.
pub(crate) struct Asked<'a> {
    pub(crate) config: Option<&'a PathBuf>,
    pub(crate) preset: &'a str,
    pub(crate) name: Option<&'a String>,
    pub(crate) credit: Option<&'a CreditArgs>,
    pub(crate) overrides: &'a Overrides,
}

/// Reads the configuration that `args` name and applies the overrides.
pub(crate) fn configure(args: &Asked<'_>) -> Result<Configured, Failure> {
    let (text, mut config) = if let Some(path) = args.config {
        let unreadable = || format!("{} cannot be read", path.display());
        let text = text::read(path).with_context(unreadable).bad_input()?;
        let config = RunConfig::from_toml(&text).map_err(|e| e.located(&text, Some(path))).bad_input()?;
        (text, config)
    } else {
        let config = preset(args.preset)?.config();
        (config.to_toml(), config)
    };
    let written = config.clone();
    let replaced = apply(args, &mut config);
    if let Some((flag, allowed)) =
        replaced.iter().find_map(|(_, flag)| Some((flag, without_effect(flag, &config)?)))
    {
        return Err(bad_input!("{flag}: allowed: {allowed}"));
    }
    if let (Some(seed), false) = (args.overrides.seed, config.draws()) {
        return Err(bad_input!("--seed {seed}: allowed: {DRAWS}"));
    }
    let stem = args.config.and_then(|path| path.file_stem()).map(|stem| stem.to_string_lossy());
    let beside = args.config.and_then(|path| path.parent());
    let located = |error: ConfigError| error.located(&text, args.config.map(PathBuf::as_path));
    let inputs = args.config.cloned().into_iter().chain(experiments::files_of(&mut config, beside)).collect();
    config = experiments::prepared(config, beside).map_err(located).bad_input()?;
    let manifest_of = |config: &RunConfig| {
        let manifest =
            RunManifest::new(config, stem.as_deref().unwrap_or("run"), origin()).map_err(|error| {
                // a value set by a flag is not in the file
                match replaced.iter().find(|(key, _)| error.key.starts_with(key)) {
                    Some((_, flag)) => ConfigError { key: format!("{flag} ({})", error.key), ..error },
                    None => located(error),
                }
            });
        manifest.bad_input()
    };
    let mut manifest = manifest_of(&config)?;
    let mut chosen = None;
    if let Some(TimeStep::Auto(tolerance)) = args.overrides.dt {
        let (dt_s, measured) = time_step::choose(&config, tolerance)?;
        config.time.dt_s = Some(dt_s);
        manifest = manifest_of(&config)?;
        chosen = Some(measured);
    }
    if let (None, Some(path), Some(stem)) = (&config.name, args.config, &stem) {
        let name = &manifest.provenance.name;
        if name.as_str() != stem.as_ref() {
            notice!("{}: the run is called {name}", path.display());
        }
    }
    let toml = if config == written || replaced.is_empty() && chosen.is_none() {
        text
    } else {
        overridden(args, &config, chosen.as_deref())
    };
    Ok(Configured { manifest, toml, duration_s: config.time.duration_s, inputs })
}

/// The preset of that name.
pub(crate) fn preset(name: &str) -> Result<Preset, Failure> {
    let known = || PRESETS.map(|preset| preset.name).join(", ");
    Preset::find(name)
        .ok_or_else(|| anyhow!("there is no preset `{name}`; there are: {}", known()))
        .bad_input()
}

/// A key of a configuration, and the flag that replaces its value.
type Replaced = (&'static str, &'static str);

/// A key of a configuration that the flags replace, if there is one.
pub(crate) fn replaced_key(overrides: &Overrides) -> Option<&'static str> {
    let asked = Asked { config: None, preset: "", name: None, credit: None, overrides };
    apply(&asked, &mut PRESETS[0].config()).first().map(|(key, _)| *key)
}

/// Applies the flags, and names the keys that they replaced.
fn apply(args: &Asked<'_>, config: &mut RunConfig) -> Vec<Replaced> {
    fn set<T>(replaced: &mut Vec<Replaced>, by: Replaced, value: &mut T, with: Option<T>) {
        if let Some(with) = with {
            *value = with;
            replaced.push(by);
        }
    }
    let overrides = args.overrides;
    let mut replaced = Vec::new();
    let r = &mut replaced;
    let impurity = |(bead, mass_kg): &(u64, f64)| Impurity { bead: *bead, mass_kg: *mass_kg };
    let impurities = overrides.impurity.iter().flatten().map(impurity).collect();
    let impurities = (!overrides.impurity.is_empty()).then_some(impurities);
    let mut strikers =
        (overrides.striker.iter()).map(|&(bead, velocity_m_s)| StrikerConfig { bead, velocity_m_s });
    let striker = strikers.next().map(|first| {
        let mut all = Strikers::from(first);
        all.more = strikers.collect();
        all
    });
    set(r, ("name", "--name"), &mut config.name, args.name.cloned().map(Some));
    set(r, ("seed", "--seed"), &mut config.seed, overrides.seed);
    set(r, ("chain.beads", "--beads"), &mut config.chain.beads, overrides.beads);
    set(r, ("chain.alpha", "--alpha"), &mut config.chain.alpha, overrides.alpha.map(Some));
    set(r, ("chain.stiffness", "--stiffness"), &mut config.chain.stiffness, overrides.stiffness.map(Some));
    set(
        r,
        ("chain.bead_mass_kg", "--bead-mass"),
        &mut config.chain.bead_mass_kg,
        overrides.bead_mass.map(Some),
    );
    set(r, ("chain.impurities", "--impurity"), &mut config.chain.impurities, impurities);
    set(r, ("striker", "--striker"), &mut config.striker, striker);
    set(r, ("time.duration_s", "--duration"), &mut config.time.duration_s, overrides.duration);
    let dt_s = overrides.dt.map(|dt| match dt {
        TimeStep::Seconds(dt_s) => Some(dt_s),
        TimeStep::Auto(_) => None,
    });
    set(r, ("time.dt_s", "--dt"), &mut config.time.dt_s, dt_s);
    set(r, ("integrator.method", "--method"), &mut config.integrator.method, overrides.method);
    let stream = &mut config.stream;
    set(
        r,
        ("stream.publish_every_steps", "--publish-every-steps"),
        &mut stream.publish_every_steps,
        overrides.publish_every_steps,
    );
    // asking for fewer published frames asks for fewer recorded ones, unless both are given
    let published = stream.publish_every_steps.max(1);
    let follows =
        overrides.publish_every_steps.map(|_| stream.record_every_steps.next_multiple_of(published));
    set(
        r,
        ("stream.record_every_steps", "--record-every-steps"),
        &mut stream.record_every_steps,
        overrides.record_every_steps.or(follows),
    );
    if let Some(CreditArgs { author, orcid, licence, doi }) = args.credit {
        let credit = &mut config.provenance;
        set(r, ("provenance.author", "--author"), &mut credit.author, author.clone().map(Some));
        set(r, ("provenance.orcid", "--orcid"), &mut credit.orcid, orcid.clone().map(Some));
        set(r, ("provenance.licence", "--licence"), &mut credit.licence, licence.clone().map(Some));
        set(r, ("provenance.doi", "--doi"), &mut credit.doi, doi.clone().map(Some));
    }
    replaced
}

/// Allowed values of `flag` in a chain in which its number moves no bead: there it would only set the scales L and T.
fn without_effect(flag: &str, RunConfig { chain, ends, damping, .. }: &RunConfig) -> Option<&'static str> {
    let is_at = |end| [ends.left, ends.right].contains(&end);
    let is_free = [ends.left, ends.right] == [End::Free; 2];
    match flag {
        "--alpha" | "--stiffness" if chain.bonds.is_some() => Some(OWN_STIFFNESSES),
        "--alpha" if chain.alphas.is_some() && damping.is_none() && is_free => {
            Some("nothing beside chain.alphas, which has the α of each contact")
        }
        "--stiffness"
            if is_free && matches!(chain.stiffnesses, StiffnessRule::Pattern(_) | StiffnessRule::List(_)) =>
        {
            Some("nothing beside chain.stiffnesses, which has the stiffness of each contact")
        }
        // the usual drag of an absorbing end follows from the scales
        "--bead-mass"
            if matches!(chain.masses, MassRule::PatternKg(_) | MassRule::ListKg(_))
                && chain.stiffnesses != StiffnessRule::Radii
                && !is_at(End::Absorbing) =>
        {
            Some("nothing beside chain.masses, which has the mass of each bead")
        }
        _ => None,
    }
}

/// The effective configuration, with a line that says what it was made from, and one about how a time step
/// was `chosen`.
fn overridden(args: &Asked<'_>, config: &RunConfig, chosen: Option<&str>) -> String {
    let mut text = match args.config {
        Some(path) => format!("# {}, with values replaced on the command line\n", path.display()),
        None => format!("# preset {}, with values replaced on the command line\n", args.preset),
    };
    // writing to a String cannot fail
    let _ = chosen.map_or(Ok(()), |chosen| writeln!(text, "# {chosen}"));
    let _ = write!(text, "{}", config.to_toml());
    text
}

/// Place and time of a run's making, and the program that makes it.
pub fn origin() -> Origin {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    Origin {
        program: format!("beadline {}", env!("CARGO_PKG_VERSION")),
        host: system::host_name(),
        started_unix_ns: u64::try_from(since_epoch.as_nanos()).unwrap_or(u64::MAX),
    }
}
