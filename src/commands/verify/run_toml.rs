//! The configuration in a recording, against its manifest.

use schemas::config::RunConfig;
use schemas::credit::Credit;
use schemas::manifest::{Physics, RunManifest};
use serde_json::Value;

/// The result for the attachment `run.toml`.
#[derive(Debug)]
pub(crate) enum RunToml {
    /// There is none.
    Absent,
    /// The physics and the credit of the manifest; the time step, too, or that is derived and taken from the manifest.
    Agrees { has_dt: bool },
    /// This version makes no run of it.
    NotResolved(String),
    /// Another physics or credit: what differs.
    Differs(Vec<String>),
}

impl RunToml {
    /// Resolves `text` and compares it with the physics and the credit of `manifest`.
    pub(crate) fn compare(text: Option<&str>, manifest: &RunManifest) -> Self {
        let Some(text) = text else { return Self::Absent };
        let physics = &manifest.physics;
        if let Some(feature) = physics.retired() {
            return Self::NotResolved(format!("{} with {feature} is not computed any more", physics.method));
        }
        let mut config = match RunConfig::from_toml(text) {
            Ok(config) => config,
            Err(error) => return Self::NotResolved(error.to_string()),
        };
        // another version may have derived another step
        let has_dt = config.time.dt_s.is_some();
        let dt_s = *config.time.dt_s.get_or_insert(physics.dt_s);
        let mut resolved = match Physics::resolve(&config) {
            Ok(resolved) => resolved,
            Err(error) => return Self::NotResolved(error.to_string()),
        };
        resolved.kernel_version = physics.kernel_version;
        if dt_s.to_bits() == physics.dt_s.to_bits() {
            resolved.dt_s = dt_s;
        }
        let says = entries(&resolved, &config.provenance);
        let has = entries(physics, &manifest.provenance.credit);
        let keys: std::collections::BTreeSet<_> = says.keys().chain(has.keys()).collect();
        let text = |value: Option<&Value>| value.map_or_else(|| "not given".to_owned(), Value::to_string);
        let differs = keys.into_iter().filter(|key| says.get(*key) != has.get(*key));
        let differs: Vec<_> = differs
            .map(|key| {
                let (says, has) = (text(says.get(key)), text(has.get(key)));
                format!("{key} is {says} by run.toml, {has} by the manifest")
            })
            .collect();
        if differs.is_empty() { Self::Agrees { has_dt } } else { Self::Differs(differs) }
    }
}

/// The physics and the credit by key; doubles are in their shortest form, so that equal texts are equal bits.
fn entries(physics: &Physics, credit: &Credit) -> serde_json::Map<String, Value> {
    let credit = credit.rows().into_iter().filter_map(|(key, text)| Some((key.to_owned(), text?.into())));
    match serde_json::from_str(&physics.to_json()) {
        Ok(Value::Object(entries)) => entries.into_iter().chain(credit).collect(),
        // a plain struct always is one
        _ => serde_json::Map::new(),
    }
}
