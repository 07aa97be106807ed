//! Messages about wrong TOML texts in plain words, in place of the parser's.

use crate::config_error::{ConfigError, EXAMPLE, line_at};
use crate::spelling::did_you_mean;
use std::ops::Range;
use toml::de::{DeTable, DeValue};

/// Keys with a choice of forms, and the forms of each.
const CHOICES: [(&str, &str); 9] = [
    ("chain.masses", "\"uniform\", or one of { pattern_kg = […] }, { taper = … }, { list_kg = […] }"),
    ("chain.stiffnesses", "\"uniform\", \"radii\", or one of { pattern = […] }, { list = […] }"),
    (
        "damping",
        "one of the keys viscous_n_s_per_m, restitution, kuwabara_kono_s and power, as in [damping] restitution = 0.9",
    ),
    ("chain.alphas", A_PROFILE),
    ("chain.gaps_m", A_PROFILE),
    ("chain.second.stiffness", A_PROFILE),
    ("on_site", A_PROFILE),
    ("resonators", A_PROFILE),
    ("chain.bonds", A_PROFILE),
];

/// Allowed forms of a number for each bead or contact.
const A_PROFILE: &str = "a number, { pattern = […] } or { list = […] }";

/// The longest part of the text that is shown.
const LONGEST_SHOWN: usize = 60;

impl ConfigError {
    /// An error that `toml` has found in `text`, with the line and the key.
    pub fn of_toml(error: &toml::de::Error, text: &str) -> Self {
        let place = error.span();
        let line = place.as_ref().map(|place| line_at(text, place.start));
        let document = DeTable::parse(text).ok();
        let located = document.as_ref().zip(place.as_ref()).and_then(|(document, place)| {
            Some((key_around(document.get_ref(), place)?, text.get(place.clone())?))
        });
        let (key, written) = located.unwrap_or_default();
        let (key, message) = in_words(error.message(), key, &shown(written));
        Self { path: None, line, key, message }
    }
}

/// Key and message for a parser's error about the value `written` at `key`.
fn in_words(said: &str, key: String, written: &str) -> (String, String) {
    let said = said.trim().replace('\n', ", ");
    if let Some(name) = said.strip_prefix("missing field `").and_then(|rest| rest.strip_suffix('`')) {
        let key = if key.is_empty() { name.to_owned() } else { format!("{key}.{name}") };
        return (key, format!("missing; {EXAMPLE}"));
    }
    if let Some((found, expected)) = said.strip_prefix("unknown field ").and_then(|s| s.split_once(", ")) {
        let hint = match key.as_str() {
            "orbit" | "continue" => "; a file with it is for `beadline orbit`".to_owned(),
            "base" | "grid" => "; a file with it is for `beadline sweep` or `beadline orbit`".to_owned(),
            _ => did_you_mean(found.trim_matches('`'), each_name(expected)),
        };
        return (key, format!("found the unknown key {found}; allowed: {}{hint}", names(expected)));
    }
    let choice =
        CHOICES.iter().find(|(of, _)| key == *of || key.strip_prefix(of).is_some_and(|k| k.starts_with('.')));
    let is_about_choice = said.starts_with("wanted ") || said.contains(" variant");
    let expected = said.split_once(", expected ").map(|(_, expected)| expected);
    let allowed = match (choice, expected) {
        (Some((_, allowed)), _) if is_about_choice => Some((*allowed).to_owned()),
        (_, Some("a sequence")) if is_heading(written) => Some(format!("tables under [{written}]")),
        (_, Some(expected)) if said.starts_with("invalid ") && !written.is_empty() => Some(plain(expected)),
        (_, Some(expected)) if said.starts_with("unknown variant ") => Some(names(expected)),
        _ => None,
    };
    let variant = said.strip_prefix("unknown variant ").and_then(|said| said.split_once(", "));
    let hint = variant.map_or_else(String::new, |(found, expected)| {
        did_you_mean(found.trim_matches('`'), each_name(expected))
    });
    let message = allowed.map(|allowed| format!("found {written}; allowed: {allowed}{hint}"));
    (key, message.unwrap_or(said))
}

/// True if a value is the heading of a table, such as `[drive]`.
fn is_heading(written: &str) -> bool {
    let name = written.strip_prefix('[').and_then(|rest| rest.strip_suffix(']'));
    name.is_some_and(|name| !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'))
}

/// The names in `` one of `a`, `b` ``.
fn names(expected: &str) -> String {
    let names: Vec<&str> = each_name(expected).collect();
    if names.is_empty() { "none here".to_owned() } else { names.join(", ") }
}

fn each_name(expected: &str) -> impl Iterator<Item = &str> {
    expected.split('`').skip(1).step_by(2)
}

/// A type of the parser in plain words.
fn plain(expected: &str) -> String {
    let words = match expected {
        "u64" | "u32" | "usize" => "a whole number, 0 or more",
        "f64" => "a number",
        "a string" | "string" => "a text in quotes",
        "a boolean" => "true or false",
        "a sequence" => "a list in [ ]",
        "a map" => "a table",
        _ if expected.starts_with("struct ") => "a table",
        other => other,
    };
    words.to_owned()
}

/// A value as it is shown in a message: the beginning of its first line.
fn shown(written: &str) -> String {
    let line = written.lines().next().unwrap_or_default();
    let short: String = line.chars().take(LONGEST_SHOWN).collect();
    if short.len() < written.len() { format!("{short}…") } else { short }
}

/// The dotted key of the innermost value around `place`, or of the key that stands there.
fn key_around(table: &DeTable<'_>, place: &Range<usize>) -> Option<String> {
    table.iter().find_map(|(name, value)| {
        let is_here = name.span() == *place;
        let inner = if is_here { None } else { key_in(value, place) };
        inner
            .map(|inner| format!("{}{inner}", name.get_ref()))
            .or_else(|| is_here.then(|| name.get_ref().to_string()))
    })
}

/// The key that leads from `value` to `place`, if `place` lies in `value`.
fn key_in(value: &toml::Spanned<DeValue<'_>>, place: &Range<usize>) -> Option<String> {
    let inner = match value.get_ref() {
        // the entries of a table lie behind its heading, not in it
        DeValue::Table(table) => key_around(table, place).map(|key| format!(".{key}")),
        DeValue::Array(list) => {
            let mut entries = list.iter().enumerate();
            entries.find_map(|(i, entry)| key_in(entry, place).map(|key| format!("[{i}]{key}")))
        }
        _ => None,
    };
    let is_in = value.span().start <= place.start && place.end <= value.span().end;
    inner.or_else(|| is_in.then(String::new))
}

#[cfg(test)]
mod tests {
    use crate::config::RunConfig;

    const WHOLE: &str = "[chain]\nbeads = 10\nbead_mass_kg = 1e-3\nalpha = 1.5\nstiffness = 1e7\n\
        masses = { taper = 0.9 }\nimpurities = [\n  { bead = 5, mass_kg = 1e-3 },\n]\n\
        [striker]\nbead = 0\nvelocity_m_s = 5.0\n[time]\nduration_s = 0.01\n[stream]\nrecord_every_steps = 1\n";

    /// The error message of a configuration with `from` replaced by `to`.
    #[track_caller]
    fn said(from: &str, to: &str) -> String {
        let text = WHOLE.replace(from, to);
        assert_ne!(text, WHOLE, "{from} is not in it");
        RunConfig::from_toml(&text).expect_err(to).to_string()
    }

    #[test]
    fn a_wrong_value_is_named_with_its_key_its_line_and_what_is_allowed() {
        for (from, to, message) in [
            (
                "beads = 10",
                "beads = \"many\"",
                "line 2: chain.beads: found \"many\"; allowed: a whole number, 0 or more",
            ),
            (
                "beads = 10",
                "beads = 10.5",
                "line 2: chain.beads: found 10.5; allowed: a whole number, 0 or more",
            ),
            ("beads = 10", "beads = -1", "line 2: chain.beads: found -1; allowed: a whole number, 0 or more"),
            ("alpha = 1.5", "alpha = \"Hertz\"", "line 4: chain.alpha: found \"Hertz\"; allowed: a number"),
            ("alpha = 1.5\n", "", "chain.alpha: missing; `beadline preset"),
            ("[striker]\nbead = 0\nvelocity_m_s = 5.0\n", "", "striker: missing; `beadline preset"),
            (", mass_kg = 1e-3", "", "line 8: chain.impurities[0].mass_kg: missing; "),
            (
                "bead = 5",
                "bead = \"five\"",
                "line 8: chain.impurities[0].bead: found \"five\"; allowed: a whole number",
            ),
            (
                "alpha",
                "alhpa",
                "line 4: chain.alhpa: found the unknown key `alhpa`; allowed: beads, bead_mass_kg, alpha",
            ),
            ("alpha", "alhpa", "bonds; did you mean `alpha`?"),
            ("bead_mass_kg", "bead_mass", "bonds; did you mean `bead_mass_kg`?"),
            ("[stream]", "[steram]", "provenance; did you mean `stream`?"),
            ("{ taper = 0.9 }", "{ tapper = 0.9 }", "{ list_kg = […] }; did you mean `taper`?"),
            ("[striker]", "[orbit]\n[striker]", "provenance; a file with it is for `beadline orbit`"),
            ("[striker]", "[hitter]", "hitter: found the unknown key `hitter`; allowed: name, seed, chain"),
            (
                "{ taper = 0.9 }",
                "{ taper = 0.9, list_kg = [1.0] }",
                "line 6: chain.masses: found { taper = 0.9, list_kg",
            ),
            (
                "{ taper = 0.9 }",
                "{ taper = 0.9, list_kg = [1.0] }",
                "; allowed: \"uniform\", or one of { pattern_kg",
            ),
            ("{ taper = 0.9 }", "{ grows = 0.9 }", "allowed: \"uniform\", or one of { pattern_kg"),
            (
                "{ taper = 0.9 }",
                "\"taper\"",
                "line 6: chain.masses: found \"taper\"; allowed: \"uniform\", or one of",
            ),
            ("{ taper = 0.9 }", "{}", "line 6: chain.masses: found {}; allowed: \"uniform\", or one of"),
            ("{ taper = 0.9 }", "7", "line 6: chain.masses: found 7; allowed: \"uniform\", or one of"),
            (
                "{ taper = 0.9 }",
                "{ list_kg = 7 }",
                "line 6: chain.masses.list_kg: found 7; allowed: a list in [ ]",
            ),
            (
                "{ taper = 0.9 }",
                "{ list_kg = [1.0, \"x\"] }",
                "chain.masses.list_kg[1]: found \"x\"; allowed: a number",
            ),
            ("[time]", "[damping]\n[time]", "damping: found [damping]; allowed: one of the keys viscous_n_s"),
            (
                "[time]",
                "[ends]\nleft = \"stuck\"\n[time]",
                "ends.left: found \"stuck\"; allowed: free, fixed",
            ),
            (
                "[time]",
                "[integrator]\nmethod = \"euler\"\n[time]",
                "integrator.method: found \"euler\"; allowed: ",
            ),
            ("[chain]", "chain = 5\n[chains]", "chain: found 5; allowed: a table"),
            ("[chain]", "name = 5\n[chain]", "name: found 5; allowed: a text in quotes"),
            ("[chain]", "chain = [1, 2]\n[chains]", "chain"),
        ] {
            let found = said(from, to);
            assert!(found.contains(message), "{to}: {found}");
        }
    }

    /// No word of a parser is left in any message about a value of a wrong type.
    #[test]
    fn no_type_of_the_program_is_named() {
        for (from, _) in
            WHOLE.lines().filter(|line| !line.starts_with(' ')).filter_map(|line| line.split_once(" = "))
        {
            for value in [
                "\"x\"",
                "-1",
                "1.5",
                "true",
                "[]",
                "{}",
                "[{}]",
                "1979-05-27",
                "nan",
                "99999999999999999999",
            ] {
                let text: Vec<String> = WHOLE
                    .lines()
                    .map(|line| {
                        if line.starts_with(&format!("{from} = ")) {
                            format!("{from} = {value}")
                        } else {
                            line.to_owned()
                        }
                    })
                    .collect();
                let Err(error) = RunConfig::from_toml(&text.join("\n")) else { continue };
                let said = error.to_string();
                for leak in [
                    "u64",
                    "f64",
                    "struct ",
                    "variant",
                    "sequence",
                    "element",
                    "invalid type",
                    "map",
                    "field",
                ] {
                    assert!(!said.contains(leak), "{from} = {value}: {said}");
                }
            }
        }
    }
}
