//! The dynamics is right: runs against solvers that share nothing with it, against results that can be
//! worked out by hand, and against the symmetries of the equations of motion.

#![allow(clippy::unwrap_used, reason = "a test that cannot read its own files has failed")]

mod baths;
mod bits;
mod chains;
mod collisions;
mod damped;
mod damped_states;
mod default_steps;
mod default_steps_elsewhere;
mod driven_states;
mod field;
mod final_states;
mod gravity;
mod growth;
mod knots;
mod loaded;
mod orders;
mod page;
mod random_chains;
mod reference;
mod sound;
mod stationary;
mod symmetries;
mod table;
mod unequal;
