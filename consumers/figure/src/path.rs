//! Steps of a path, in dots from the upper left corner.

/// A step of a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Step {
    Move(f64, f64),
    Line(f64, f64),
    Circle { x: f64, y: f64, radius: f64 },
    Close,
}
