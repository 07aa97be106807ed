//! Recordings as damage and malice would leave them.
//!
//! Shared by the fuzz targets (`fuzz/`), the test of the built command and the program `mutate`. Everything here
//! is a function of its seed, so that what was found can be found again.

pub mod campaign;
pub mod checksums;
pub mod corpus;
pub mod metadata;
pub mod mutation;
pub mod random;
pub mod records;
pub mod structure;
pub mod summary;
pub mod trial;
