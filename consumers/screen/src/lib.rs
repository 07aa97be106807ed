//! The screen of `beadline top`: live runs, and one of them from the first state that was seen until now, on a screen
//! of characters.
//!
//! Nothing here reads a bus, a terminal or a clock: a [`Screen`] is filled with what is known, and [`draw`] is a pure
//! function of it and of the size of the buffer.

mod colours;
mod draw;
mod field;
mod profile;
mod strip;
mod watched;

pub use colours::{Depth, Palette};
pub use draw::draw;
pub use field::Field;
pub use watched::Watched;

/// Everything that is shown.
#[derive(Debug, Clone, Default)]
pub struct Screen {
    /// The runs.
    pub runs: Vec<RunLine>,
    /// The one among them that is watched.
    pub chosen: Option<usize>,
    /// Its consumers, a line each.
    pub consumers: Vec<String>,
    /// Its newest state, and those before.
    pub watched: Option<Watched>,
    /// The quantity shown.
    pub field: Field,
    /// Colours are linear where they are logarithmic by default, and the other way round.
    pub other_scale: bool,
    /// Nothing changes, though the runs go on.
    pub is_paused: bool,
    /// The keys are explained.
    pub shows_help: bool,
    /// A message about the whole, such as that there are no runs.
    pub notice: String,
}

/// One line of the list of runs, in the order of [`RunLine::HEADER`].
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RunLine(pub [String; 6]);

impl RunLine {
    /// Heads of the columns.
    pub const HEADER: [&'static str; 6] = ["NAME", "STATE", "STEP", "DONE", "RATE", "ENDS IN"];
}
