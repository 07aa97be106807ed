//! Numbers that Beadline did not compute; `tests/reference/README.md` says where they come from.

use super::judgement::StudyError;

/// A table of numbers and words, with a header.
#[derive(Debug, Clone, Copy)]
pub(super) struct ReferenceTable {
    file: &'static str,
    text: &'static str,
}

/// The pulse at contact 100 of 200 equal beads; good to 1e-6, for α = 1.01 to 1e-5.
pub(super) const CONTACT_100: ReferenceTable = ReferenceTable {
    file: "homogeneous-contact-100.csv",
    text: include_str!("../../../tests/reference/homogeneous-contact-100.csv"),
};

/// Speeds and widths of waves; good to 1e-9.
pub(super) const SOLITARY_WAVE: ReferenceTable = ReferenceTable {
    file: "solitary-wave.csv",
    text: include_str!("../../../tests/reference/solitary-wave.csv"),
};

/// Reflected energies; good to 3e-5.
pub(super) const REFLECTED: ReferenceTable = ReferenceTable {
    file: "reflected-energy.csv",
    text: include_str!("../../../tests/reference/reflected-energy.csv"),
};

/// Pulses that pass bead 700 (forward) and bead 300 (backward) of the light-impurity run; good to 1e-5.
pub(super) const LIGHT_PULSES: ReferenceTable = ReferenceTable {
    file: "light-impurity-pulses.csv",
    text: include_str!("../../../tests/reference/light-impurity-pulses.csv"),
};

/// The same pulses of the heavy-impurity run; good to 1e-6.
pub(super) const HEAVY_PULSES: ReferenceTable = ReferenceTable {
    file: "heavy-impurity-pulses.csv",
    text: include_str!("../../../tests/reference/heavy-impurity-pulses.csv"),
};

/// Turning points of the light impurity; good to 0.1 µs and 0.01 µm.
pub(super) const LIGHT_TURNS: ReferenceTable = ReferenceTable {
    file: "light-impurity-turning-points.csv",
    text: include_str!("../../../tests/reference/light-impurity-turning-points.csv"),
};

impl ReferenceTable {
    /// The rows below the header, as words.
    pub(super) fn rows(self) -> impl Iterator<Item = Vec<&'static str>> {
        self.text.lines().skip(1).map(|line| line.split(',').collect())
    }

    /// The same, of a table without words.
    pub(super) fn numbers(self) -> Result<Vec<Vec<f64>>, StudyError> {
        self.rows().map(|row| self.parsed(&row)).collect()
    }

    /// The values after the number `key`, however it is written.
    pub(super) fn at(self, key: f64) -> Result<Vec<f64>, StudyError> {
        let row = self.numbers()?.into_iter().find(|row| row[0] == key);
        row.map(|row| row[1..].to_vec()).ok_or_else(|| self.missing(format!("{key:?}")))
    }

    /// The values after the words `key` that the row begins with.
    pub(super) fn values(self, key: &[&str]) -> Result<Vec<f64>, StudyError> {
        let row = self.rows().find(|row| row.starts_with(key));
        self.parsed(&row.ok_or_else(|| self.missing(key.join(",")))?[key.len()..])
    }

    fn parsed(self, words: &[&str]) -> Result<Vec<f64>, StudyError> {
        words.iter().map(|word| word.parse().map_err(|_| self.missing(words.join(",")))).collect()
    }

    fn missing(self, row: String) -> StudyError {
        StudyError::NoReference { file: self.file, row }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_found_by_their_first_words() {
        assert_eq!(LIGHT_PULSES.values(&["backward", "2"]).unwrap(), [-0.150_378_6, 6212.545]);
        assert_eq!(LIGHT_TURNS.rows().count(), 8);
        assert!(REFLECTED.numbers().unwrap().contains(&vec![1.5, 1.0, 0.006_339, 0.006_379]));
        assert_eq!(CONTACT_100.at(10.0).unwrap()[0], 4.100_157_75);
        let missing = LIGHT_PULSES.values(&["sideways", "2"]).unwrap_err();
        assert_eq!(missing.to_string(), "the reference light-impurity-pulses.csv has no row sideways,2");
    }
}
