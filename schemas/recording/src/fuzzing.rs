//! Entry points for the fuzz targets into private functions; no part of the interface.

use crate::head::{self, EndRecord};
use crate::read::contents::parse_metadata;
use crate::read::decode::{self, StateLengths};
use schemas::manifest::RunManifest;
use std::path::Path;

/// Decodes a `ChainState` of `beads` beads with `extra` further values: its step and `[u | v | extra]`.
///
/// # Errors
/// When the message is not such a state.
pub fn state(message: &[u8], beads: usize, extra: usize) -> Result<(u64, Vec<f64>), String> {
    let mut doubles = Vec::new();
    let state = decode::state(message, StateLengths { beads, extra }, &mut doubles)?;
    Ok((state.step, doubles))
}

/// Like [`state()`], without the fast path for the states that we write.
///
/// # Errors
/// When the message is not such a state.
pub fn state_by_prost(message: &[u8], beads: usize, extra: usize) -> Result<(u64, Vec<f64>), String> {
    let mut doubles = Vec::new();
    let state = decode::general(message, StateLengths { beads, extra }, &mut doubles)?;
    Ok((state.step, doubles))
}

/// The step of a `ChainState` of any length.
///
/// # Errors
/// When the message is not a state.
pub fn state_step(message: &[u8]) -> Result<u64, String> {
    decode::head(message).map(|state| state.step)
}

/// The manifest in the contents of a metadata record `beadline.run`.
///
/// # Errors
/// When the record holds no manifest.
pub fn manifest(record: &[u8]) -> Result<RunManifest, String> {
    let path = Path::new("fuzzed.mcap");
    let metadata = parse_metadata(path, 0, record).map_err(|error| error.to_string())?;
    // any metadata may be read as an end
    let _ = EndRecord::from_metadata(&metadata);
    let manifest = head::read_run(path, &metadata).map_err(|error| error.to_string())?;
    manifest.check_whole().map(|()| manifest).map_err(|error| error.to_string())
}
