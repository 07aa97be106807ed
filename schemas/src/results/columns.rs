//! The columns of rows of results.

/// Longest list of names that a service can carry (bytes).
pub const MOST_NAMES_BYTES: usize = 256;
/// Names that every row has without its columns.
const ROW_HEAD: [&str; 3] = ["frame", "step", "time_s"];

/// The meaning of the elements of a row.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ResultColumns {
    /// Elements in each row.
    pub width: usize,
    /// Names of the columns with their units, separated by commas; at most 256 bytes, as long names are cut.
    pub names: String,
    /// The largest overlap or gap (m) that counts as touching, NaN if it is not known. Only rows that are classes of
    /// contacts have one.
    pub tolerance_m: Option<f64>,
}

impl ResultColumns {
    /// Columns of these names, which end in their units: `energy_j`, `front_velocity_m_s`.
    pub fn named(names: &[&str]) -> Self {
        Self { width: names.len(), names: names.join(","), tolerance_m: None }
    }

    /// One quantity that has `width` values in each row, such as one for each bead.
    pub fn array(name: &str, width: usize) -> Self {
        Self { width, names: name.to_owned(), tolerance_m: None }
    }

    /// The names of the columns, from which a recording makes the fields of a message: one for each value, or one for all
    /// of them.
    ///
    /// # Errors
    /// The message says what was expected and found.
    pub fn fields(&self) -> Result<Vec<&str>, String> {
        let names: Vec<&str> = self.names.split(',').collect();
        let is_name = |name: &&str| {
            let letters = name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
            letters && name.starts_with(|first: char| first.is_ascii_alphabetic())
        };
        if let Some(name) = names.iter().find(|name| !is_name(name)) {
            return Err(format!(
                "`{name}` is no name of a column; allowed: letters, digits and _, beginning with a letter"
            ));
        }
        // readers of protobuf also know a field by its name without `_` and with capitals
        let plain = |name: &str| name.replace('_', "").to_ascii_lowercase();
        let same = |one: &str, other: &str| plain(one) == plain(other);
        let all: Vec<&str> = ROW_HEAD.iter().chain(&names).copied().collect();
        if let Some((_, name)) =
            all.iter().enumerate().find(|(at, name)| all[..*at].iter().any(|other| same(name, other)))
        {
            return Err(format!("`{name}` is there twice, but for `_` and capitals"));
        }
        if self.names.len() > MOST_NAMES_BYTES {
            let bytes = self.names.len();
            return Err(format!(
                "the names have {bytes} bytes, at most {MOST_NAMES_BYTES} fit; shorten them"
            ));
        }
        if self.width == 0 || (names.len() != self.width && names.len() != 1) {
            let (names, width) = (names.len(), self.width);
            return Err(format!("{names} names for {width} values; expected as many, or one for all"));
        }
        Ok(names)
    }
}
