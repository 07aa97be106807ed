//! From a manifest to frames: the dynamics, and the loop that publishes and records them.
//!
//! Start with [`run::run`], the one path of a frame: advance → publish → record. The dynamics is
//! [`integrator::Integrator`], which works on a [`state::ChainState`] with the forces of [`kernel`].

mod aligned;
mod baths;
mod drives;
pub mod energy_error;
pub mod growth;
pub mod integrator;
pub mod kernel;
mod pieces;
pub mod recovery;
pub mod replay;
pub mod resimulation;
mod roundings;
pub mod run;
pub mod state;
pub mod step_time;
pub mod sweep;
pub mod tangents;
pub mod time_step;
pub mod twins;
pub mod verification;
