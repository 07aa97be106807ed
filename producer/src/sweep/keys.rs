//! Check of the keys that a sweep sets.

use super::SweepError;
use super::definition::{Definition, Setting};
use schemas::config::ConfigError;
use std::path::Path;

/// Refuses the sweep file `path` if it sets a name, which is no physics, or if two keys of a point lie in each other:
/// the later would replace the value of the earlier, but the row would still name the earlier. One sample stands for
/// all, because all set the same keys.
pub(super) fn check(path: &Path, definition: &Definition) -> Result<(), SweepError> {
    let Definition { cases, samples, axes, .. } = definition;
    let one_of_each: Vec<_> = samples.at(0).into_iter().chain(axes.iter().map(|axis| axis.at(0))).collect();
    for case in cases {
        let all: Vec<_> = case.iter().chain(&one_of_each).collect();
        for (i, setting) in all.iter().enumerate() {
            let earlier = all[..i].iter().find(|other| other.key.overlaps(&setting.key));
            if let Some(message) = mistake(setting, earlier.copied()) {
                return Err(SweepError::Config(ConfigError {
                    path: Some(path.to_owned()),
                    line: Some(setting.line),
                    key: setting.key.to_string(),
                    message,
                }));
            }
        }
    }
    Ok(())
}

/// The conflict between `setting` and `earlier`, one of which is a part of the other.
fn mistake(setting: &Setting, earlier: Option<&Setting>) -> Option<String> {
    match earlier {
        Some(Setting { key, line, .. }) if *key == setting.key => {
            Some(format!("is set twice at a point, before in line {line}"))
        }
        Some(Setting { key, line, .. }) => Some(format!(
            "and `{key}` of line {line} are set at one point, but one of them lies in the other"
        )),
        None if setting.key.is_name() => Some("is not for a sweep to set".to_owned()),
        None => None,
    }
}
