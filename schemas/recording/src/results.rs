//! Rows of results as messages of a recording, and contact maps as files of their own.

pub(crate) mod contacts;
mod descriptor;
pub(crate) mod recorded_rows;
pub(crate) mod row_messages;
