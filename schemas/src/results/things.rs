//! Rows about numbered things.

use super::ResultColumns;

/// Rows with the same few numbers about each of several numbered things, such as beads. A message of a recording has an
/// array of each.
#[derive(Debug, PartialEq, Eq)]
pub struct Things {
    /// Topic of the rows.
    pub topic: &'static str,
    /// File of the message in `beadline/v1`, without its ending.
    pub file: &'static str,
    /// The message in `beadline.v1`.
    pub message: &'static str,
    /// Field with the numbers of the things.
    pub number: &'static str,
    /// Fields with their values.
    pub fields: &'static [&'static str],
    /// Place of the things' numbers in rows on the bus.
    pub numbers: ThingsNumbers,
}

/// The place of the things' numbers in rows on the bus.
#[derive(Debug, PartialEq, Eq)]
pub enum ThingsNumbers {
    /// In the names of the columns, between these names and units: bead 60 in `u_60_m`.
    InNames(&'static [(&'static str, &'static str)]),
    /// In the first value of each thing. A row is filled up with NaN.
    InRows,
}

impl Things {
    /// Values of each thing in a row.
    pub fn width(&self) -> usize {
        self.fields.len() + usize::from(self.numbers == ThingsNumbers::InRows)
    }

    pub(super) fn names(quantities: &[(&str, &str)], numbers: &[u64]) -> String {
        let of_one = |number| quantities.iter().map(move |(name, unit)| format!("{name}_{number}_{unit}"));
        numbers.iter().flat_map(of_one).collect::<Vec<_>>().join(",")
    }

    /// The things that rows of these columns are about; none if each row says that itself.
    ///
    /// The bus cuts the names after 256 bytes: they are the names of the `usual` things if those begin like them.
    ///
    /// # Errors
    /// When the columns are of no things; the message says what was found.
    pub fn numbers_of(&self, columns: &ResultColumns, usual: &[u64]) -> Result<Option<Vec<u64>>, String> {
        let ResultColumns { width, names, .. } = columns;
        let ThingsNumbers::InNames(quantities) = self.numbers else {
            let is_whole = width.is_multiple_of(self.width());
            let each = || format!("{width} columns, expected {} for each {}", self.width(), self.number);
            return if is_whole { Ok(None) } else { Err(each()) };
        };
        let (head, unit) = quantities[0];
        let number = |name: &str| {
            name.strip_prefix(head)?.strip_prefix('_')?.strip_suffix(unit)?.strip_suffix('_')?.parse().ok()
        };
        let named: Option<Vec<u64>> = names.split(',').step_by(self.width()).map(number).collect();
        match named {
            Some(numbers) if numbers.len() * self.width() == *width => Ok(Some(numbers)),
            _ if usual.len() * self.width() == *width
                && Self::names(quantities, usual).starts_with(names.as_str()) =>
            {
                Ok(Some(usual.to_vec()))
            }
            _ => {
                let number = self.number;
                Err(format!(
                    "{width} columns whose {number}s the bus does not name: {names}; follow fewer {number}s"
                ))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bus cuts long lists of columns.
    #[test]
    fn the_beads_of_a_row_are_those_that_its_columns_name() {
        let usual: Vec<u64> = (300..340).collect();
        let motion = Things::of_topic("impurity").expect("known");
        let named = |names: &str, width| {
            let columns = ResultColumns { width, names: names.into(), tolerance_m: None };
            motion.numbers_of(&columns, &usual)
        };
        let two = "u_3_m,v_3_m_s,overlap_left_3_m,overlap_right_3_m,u_5_m,v_5_m_s,overlap_left_5_m,overlap_right_5_m";
        assert_eq!(named(two, 8), Ok(Some(vec![3, 5])));
        assert_eq!(motion.numbers_of(&ResultColumns::motion(&[3, 5]), &usual), Ok(Some(vec![3, 5])));
        let cut = "u_300_m,v_300_m_s,overlap_left_300_m,overlap_right_300_m,u_301_m,v_30";
        assert_eq!(named(cut, 160), Ok(Some(usual.clone())));
        assert!(named(cut, 164).is_err());
        assert!(named("u_3_m,v_3_m_s,overlap_left_3_m,overlap_right_3_m,u_301_m,v_30", 160).is_err());
    }
}
