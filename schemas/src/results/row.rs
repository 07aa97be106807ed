//! A row of results.

/// One row of results.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResultRow<'a> {
    /// The frame it belongs to.
    pub frame: u64,
    /// The step of that frame.
    pub step: u64,
    /// The time of that frame (s).
    pub time_s: f64,
    /// The values, as on the bus.
    pub values: RowValues<'a>,
}

/// The values of a row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RowValues<'a> {
    /// Numbers.
    Numbers(&'a [f64]),
    /// Classes of contacts.
    Classes(&'a [u8]),
}

impl<'a> RowValues<'a> {
    /// True if there are no values.
    pub fn is_empty(self) -> bool {
        match self {
            Self::Numbers(numbers) => numbers.is_empty(),
            Self::Classes(classes) => classes.is_empty(),
        }
    }

    /// The numbers; none if the values are classes.
    pub fn numbers(self) -> &'a [f64] {
        match self {
            Self::Numbers(numbers) => numbers,
            Self::Classes(_) => &[],
        }
    }
}

/// The values of a row, kept.
#[derive(Debug, Clone, PartialEq)]
pub enum KeptValues {
    /// Numbers.
    Numbers(Vec<f64>),
    /// Classes of contacts.
    Classes(Vec<u8>),
}

impl KeptValues {
    /// The values, lent.
    pub fn lend(&self) -> RowValues<'_> {
        match self {
            Self::Numbers(numbers) => RowValues::Numbers(numbers),
            Self::Classes(classes) => RowValues::Classes(classes),
        }
    }
}

impl From<RowValues<'_>> for KeptValues {
    fn from(values: RowValues<'_>) -> Self {
        match values {
            RowValues::Numbers(numbers) => Self::Numbers(numbers.to_vec()),
            RowValues::Classes(classes) => Self::Classes(classes.to_vec()),
        }
    }
}
