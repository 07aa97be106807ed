//! Analyses: from frames to results.
//!
//! An analysis takes frames one by one and cannot tell a live run, a replay, a file or a
//! re-simulation apart: [`follow::follow`] is the one loop that reads a source. Each analysis is a
//! module: [`deformation`], [`energies`], [`impurity`], [`contacts`], [`pulses`]; the crate `analyses` offers them. What theory expects is in [`theory`].

pub mod analysis;
pub mod blocks;
pub mod contacts;
pub mod deformation;
pub mod determination;
pub mod energies;
pub mod fields;
pub mod follow;
pub mod footage;
pub mod impurity;
pub mod journal;
pub mod local_energy;
pub mod power_law;
pub mod pulses;
pub mod series;
pub mod space_time;
pub mod statistics;
pub mod table;
pub mod theory;
pub mod uncertain;
