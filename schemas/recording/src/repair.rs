//! What is wrong with a file, and how an interrupted one goes on.

pub(crate) mod audit;
pub(crate) mod interrupted;
pub(crate) mod layout;
