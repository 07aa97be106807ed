//! An axis, as the caller of a figure describes it.

/// An axis: its label with the unit, and how values lie along it. A `&str` is an axis with that label.
#[derive(Debug, Clone, Default)]
#[must_use]
pub struct Axis {
    pub(super) label: String,
    pub(super) limits: Option<(f64, f64)>,
    pub(super) log: bool,
    pub(super) reversed: bool,
}

impl Axis {
    /// An axis over the range of the curves. Put the unit at the end in brackets, `velocity (m/s)`: a
    /// common factor of the numbers is written there, `velocity (10⁻³ m/s)`.
    pub fn new(label: impl Into<String>) -> Self {
        Self { label: label.into(), ..Self::default() }
    }

    /// Shows exactly this range. Limits that make no range are ignored: equal or non-finite ones, and on
    /// a logarithmic axis those that are not positive.
    pub fn limits(mut self, from: f64, to: f64) -> Self {
        self.limits = Some((from, to));
        self
    }

    /// Makes the axis logarithmic; values that are not positive are left out.
    pub fn log(mut self) -> Self {
        self.log = true;
        self
    }

    /// Lets values grow downwards (y) or leftwards (x).
    pub fn reversed(mut self) -> Self {
        self.reversed = true;
        self
    }
}

impl<T: Into<String>> From<T> for Axis {
    fn from(label: T) -> Self {
        Self::new(label)
    }
}
