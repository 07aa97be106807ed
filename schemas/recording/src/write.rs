//! Frames and results → messages → chunks → a file that has its name when it is finished.

pub(crate) mod channel_writer;
pub(crate) mod disk;
pub(crate) mod encode;
pub(crate) mod foreign;
pub mod foxglove;
pub(crate) mod parts;
pub(crate) mod scalars;
pub(crate) mod schedule;
pub(crate) mod space;
pub(crate) mod sync;
pub(crate) mod writer;
