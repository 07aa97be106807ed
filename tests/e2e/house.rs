//! Promises of this repository about its own sources: who imports what, how long, how many.

mod architecture;
mod circles;
mod citing;
mod counts;
mod skipping;
mod source;
