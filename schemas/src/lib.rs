//! Runs, frames and recordings: in memory, on the bus, in a file.
//!
//! Start with [`manifest::RunManifest`], the description of a run, and [`frame::Frame`], one state of
//! it. Producers and consumers must agree to the bit on the [`contact`] law, with its own [`power`]
//! function, over a resolved [`chain`].

pub mod active;
pub mod amounts;
pub mod bath;
pub mod beads;
pub mod chain;
pub mod config;
mod config_error;
pub mod contact;
pub mod credit;
pub mod damping;
pub mod drive;
mod excess;
pub mod frame;
pub mod functions;
pub mod json_schema;
pub mod manifest;
pub mod material;
pub mod method;
pub mod philox;
pub mod power;
pub mod presets;
pub mod random;
pub mod results;
mod roots;
pub mod rows;
pub mod run_name;
pub mod scales;
pub mod simd;
pub mod sites;
pub mod spelling;
pub mod summary;
pub mod term;
pub mod text;
pub mod whole_file;
