//! Bytes → records → messages → frames, within bounds; claims of a file are checked before they are used.

pub(crate) mod ahead;
pub(crate) mod chunk;
pub(crate) mod chunk_head;
pub(crate) mod contents;
pub(crate) mod decode;
pub(crate) mod encoded;
pub(crate) mod index;
pub(crate) mod info;
pub(crate) mod messages;
pub(crate) mod others;
pub(crate) mod parse;
pub(crate) mod records;
pub(crate) mod salvage;
pub(crate) mod source;
pub(crate) mod summary;
