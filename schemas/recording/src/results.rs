//! Rows of results as messages of a recording, and contact maps as files of their own.

pub(crate) mod columns;
pub(crate) mod contacts;
pub(crate) mod kind;
pub(crate) mod own_results;
pub(crate) mod recorded_rows;
