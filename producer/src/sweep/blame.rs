//! Place of a value that makes a point impossible.

use super::Sweep;
use super::definition::Setting;
use super::document::KeyPath;
use schemas::config::{ConfigError, line_of_key};
use std::fmt::Write;
use std::path::Path;
use toml::{Table, Value};

/// `error`, which point `index` of `sweep` has met in the configuration `document`, with the place of the wrong value:
/// in the case or the grid if those set it, or else in the base.
pub(super) fn blame(
    sweep: &Sweep,
    mut error: ConfigError,
    settings: &[Setting],
    document: &Table,
    index: u64,
) -> ConfigError {
    if error.key.is_empty() {
        let text = toml::to_string(document).unwrap_or_default(); // a table is always TOML
        error.key = error.line.and_then(|line| key_at(&text, line)).unwrap_or_default();
    }
    error.line = None;
    if sweep.point_count() > 1 {
        // writing to a String cannot fail
        let _ = write!(error.message, " (point {index})");
    }
    let key = KeyPath::parse(&error.key).ok();
    let sets = |setting: &&Setting| key.as_ref().is_some_and(|key| setting.key.overlaps(key));
    if let Some(setting) = settings.iter().rev().find(sets) {
        error.path = Some(sweep.path.clone());
        error.line = Some(setting.line);
        return error;
    }
    let located = |prefix: &str, text: &str, path: &Path| {
        let line = line_of_key(text, &format!("{prefix}{}", error.key))?;
        Some(ConfigError { path: Some(path.to_owned()), line: Some(line), ..error.clone() })
    };
    let own = |prefix| located(prefix, &sweep.text, &sweep.path);
    let of_file = || sweep.definition.base_file.as_ref().and_then(|file| located("", &file.text, &file.path));
    own("base.")
        .or_else(|| own(""))
        .or_else(of_file)
        .unwrap_or_else(|| ConfigError { path: Some(sweep.path.clone()), ..error.clone() })
}

/// The innermost key whose value stands at `line` of a TOML document.
fn key_at(document: &str, line: usize) -> Option<String> {
    let table: Table = document.parse().ok()?;
    let mut keys = Vec::new();
    collect_keys("", &Value::Table(table), &mut keys);
    keys.into_iter().rev().find(|key| line_of_key(document, key) == Some(line))
}

fn collect_keys(prefix: &str, value: &Value, keys: &mut Vec<String>) {
    match value {
        Value::Table(table) => {
            for (name, inner) in table {
                let key = if prefix.is_empty() { name.clone() } else { format!("{prefix}.{name}") };
                keys.push(key.clone());
                collect_keys(&key, inner, keys);
            }
        }
        Value::Array(list) => {
            for (i, inner) in list.iter().enumerate() {
                collect_keys(&format!("{prefix}[{i}]"), inner, keys);
            }
        }
        _ => {}
    }
}
