//! Finds damage in a file, and prepares an interrupted recording for being resumed.

pub(crate) mod audit;
pub(crate) mod interrupted;
pub(crate) mod layout;
