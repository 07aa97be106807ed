//! Values of a TOML document by dotted path.

use std::fmt;
use toml::{Table, Value};

/// The place of a value in a configuration, such as `chain.impurities[0].mass_kg`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeyPath {
    parts: Vec<Part>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Part {
    Key(String),
    Index(usize),
}

impl KeyPath {
    /// Reads a dotted path with indices in brackets.
    ///
    /// # Errors
    /// When it is none.
    pub fn parse(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!("`{text}` is no key; allowed: names and indices such as `chain.impurities[0].mass_kg`")
        };
        let mut parts = Vec::new();
        for piece in text.split('.') {
            let mut brackets = piece.split('[');
            let name = brackets.next().unwrap_or_default();
            let plain = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
            if name.is_empty() || !name.chars().all(plain) {
                return Err(wrong());
            }
            parts.push(Part::Key(name.to_owned()));
            for bracket in brackets {
                let index = bracket.strip_suffix(']').and_then(|index| index.parse().ok());
                parts.push(Part::Index(index.ok_or_else(wrong)?));
            }
        }
        Ok(Self { parts })
    }

    /// True if one of the two lies in the other, or both are the same.
    pub(super) fn overlaps(&self, other: &Self) -> bool {
        self.parts.iter().zip(&other.parts).all(|(a, b)| a == b)
    }

    /// True if the key is the name of the run.
    pub(super) fn is_name(&self) -> bool {
        self.parts == [Part::Key("name".to_owned())]
    }

    /// Sets the value in `document`. Makes missing tables on the way, but no entries of lists.
    ///
    /// # Errors
    /// When something else stands on the way.
    pub fn set(&self, document: &mut Table, value: Value) -> Result<(), String> {
        let [Part::Key(first), rest @ ..] = self.parts.as_slice() else {
            return Err(format!("`{self}` does not begin with a name"));
        };
        let mut place = document.entry(first.clone()).or_insert_with(|| empty_for(rest));
        for (done, part) in rest.iter().enumerate() {
            check_unread(place)?;
            let walked = || display(&self.parts[..=done]);
            place = match (part, place) {
                (Part::Key(key), Value::Table(table)) => {
                    table.entry(key.clone()).or_insert_with(|| empty_for(&rest[done + 1..]))
                }
                (Part::Key(_), _) => return Err(format!("`{}` is no table in the base", walked())),
                (Part::Index(index), Value::Array(list)) => {
                    let length = list.len();
                    list.get_mut(*index).ok_or_else(|| {
                        format!(
                            "`{}` has {length} entries in the base; entry {index} does not exist",
                            walked()
                        )
                    })?
                }
                (Part::Index(_), _) => return Err(format!("`{}` is no list in the base", walked())),
            };
        }
        check_unread(place)?;
        *place = value;
        Ok(())
    }
}

/// Refuses to change a state of a recording that has been read: the lists beside it would stay as they are.
fn check_unread(place: &Value) -> Result<(), String> {
    if place.get("sha256").is_none() {
        return Ok(());
    }
    Err("found a state that has been read, whose numbers stand in the lists beside it; leave out these lists and the `sha256` in the base"
        .to_owned())
}

/// Placeholder for a value that is about to be set.
fn empty_for(rest: &[Part]) -> Value {
    match rest.first() {
        Some(Part::Index(_)) => Value::Array(Vec::new()),
        _ => Value::Table(Table::new()),
    }
}

fn display(parts: &[Part]) -> String {
    let mut text = String::new();
    for part in parts {
        match part {
            Part::Key(key) if text.is_empty() => text.push_str(key),
            Part::Key(key) => text.extend([".", key]),
            Part::Index(index) => text.extend(["[", &index.to_string(), "]"]),
        }
    }
    text
}

impl fmt::Display for KeyPath {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&display(&self.parts))
    }
}

/// Replaces values of `document` by those of `over`; tables are merged, everything else is replaced.
///
/// # Errors
/// When one of them is a state that has been read.
pub(super) fn merge(document: &mut Table, over: Table) -> Result<(), String> {
    for (key, value) in over {
        let place = document.get_mut(&key);
        place.iter().try_for_each(|place| check_unread(place))?;
        match (place, value) {
            (Some(Value::Table(below)), Value::Table(above)) => merge(below, above)?,
            (_, value) => {
                document.insert(key, value);
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Table {
        text.parse().expect("TOML")
    }

    fn set(document: &str, key: &str, value: f64) -> Result<Table, String> {
        let mut document = table(document);
        KeyPath::parse(key)?.set(&mut document, Value::Float(value)).map(|()| document)
    }

    #[test]
    fn values_are_set_where_the_path_leads() {
        let base = "[chain]\nalpha = 1.5\nimpurities = [{ bead = 5, mass_kg = 1.0 }]";
        assert_eq!(set(base, "chain.alpha", 2.0).expect("key")["chain"]["alpha"].as_float(), Some(2.0));
        let document = set(base, "chain.impurities[0].mass_kg", 3.0).expect("index");
        assert_eq!(document["chain"]["impurities"][0]["mass_kg"].as_float(), Some(3.0));
        assert_eq!(document["chain"]["impurities"][0]["bead"].as_integer(), Some(5));
        assert_eq!(set(base, "time.dt_s", 1e-6).expect("new table")["time"]["dt_s"].as_float(), Some(1e-6));
    }

    #[test]
    fn paths_that_lead_nowhere_are_refused() {
        let base = "[chain]\nalpha = 1.5\nimpurities = []";
        for (key, says) in [
            ("chain.impurities[0].mass_kg", "has 0 entries"),
            ("chain.alpha.beta", "`chain.alpha` is no table"),
            ("chain[0]", "`chain` is no list"),
            ("chain..alpha", "is no key"),
            ("chain.impurities[x]", "is no key"),
            ("", "is no key"),
        ] {
            let error = set(base, key, 1.0).expect_err(key);
            assert!(error.contains(says), "{key}: {error}");
        }
    }

    #[test]
    fn tables_are_merged_and_lists_replaced() {
        let mut document = table("a = 1\n[b]\nc = 2\nd = [1, 2]");
        merge(&mut document, table("[b]\nd = [3]\n[e]\nf = 4")).unwrap();
        assert_eq!(document, table("a = 1\n[b]\nc = 2\nd = [3]\n[e]\nf = 4"));
    }

    /// The lists of a stored configuration are those of the step that was read.
    #[test]
    fn a_state_that_has_been_read_keeps_its_step() {
        let written = "[initial]\nfrom = { recording = \"a.mcap\", step = 3";
        let read = format!("{written}, sha256 = \"ab\" }}\ndisplacements_m = [0.1]");
        for key in ["initial.from", "initial.from.step"] {
            assert!(set(&format!("{written} }}"), key, 1.0).is_ok());
            let error = set(&read, key, 1.0).expect_err(key);
            assert!(error.contains("leave out these lists and the `sha256`"), "{error}");
        }
        assert!(set(&read, "initial.displacements_m[0]", 1.0).is_ok());
        assert!(merge(&mut table(&read), table("[initial.from]\nstep = 1")).is_err());
    }

    #[test]
    fn keys_overlap_when_one_contains_the_other() {
        let path = |text| KeyPath::parse(text).expect(text);
        assert!(path("chain").overlaps(&path("chain.alpha")));
        assert!(path("chain.impurities[0].mass_kg").overlaps(&path("chain.impurities")));
        assert!(!path("chain.impurities[0]").overlaps(&path("chain.impurities[1]")));
    }
}
