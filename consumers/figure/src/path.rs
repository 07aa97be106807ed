//! Steps of a path, in dots from the upper left corner.

/// A step of a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Step {
    Move(f64, f64),
    Line(f64, f64),
    Circle { x: f64, y: f64, radius: f64 },
    Close,
}

impl Step {
    /// A line through places; a single one becomes a dot.
    pub(super) fn line(places: &[(f64, f64)]) -> impl Iterator<Item = Self> {
        let begin = places.first().map(|&(x, y)| Self::Move(x, y));
        // a line of no length has round ends
        let rest = if places.len() == 1 { places } else { places.get(1..).unwrap_or_default() };
        begin.into_iter().chain(rest.iter().map(|&(x, y)| Self::Line(x, y)))
    }
}
