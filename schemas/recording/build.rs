//! Compiles `proto/` to Rust and to one descriptor set for each file, without protoc.
#![allow(clippy::print_stdout, reason = "that is how cargo is told")]

use std::error::Error;
use std::path::PathBuf;
use std::{env, fs};

/// Each file is self-contained, so that the descriptor set of a message is its own file alone.
const PROTO_FILES: [&str; 5] = ["chain_state", "chain", "summary", "contact_classes", "bead_motion"];

/// The messages that are made of the lists of their columns, for the test that compares both.
const OF_COLUMNS: [&str; 3] = ["energies", "impurity_motion", "pulses"];

/// Messages of Foxglove's, each with the files that it imports in its descriptor set.
const FOXGLOVE: [&str; 3] = ["Log", "PointCloud", "RawImage"];

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed=proto");
    println!("cargo::rerun-if-changed=build.rs");
    let out = PathBuf::from(env::var_os("OUT_DIR").ok_or("OUT_DIR is not set")?);
    let ours = |name| (name, format!("beadline/v1/{name}.proto"));
    let foxgloves = FOXGLOVE.map(|name| (name, format!("foxglove/{name}.proto")));
    let files: Vec<_> = PROTO_FILES.map(ours).into_iter().chain(foxgloves).collect();
    for (name, path) in OF_COLUMNS.map(ours).iter().chain(&files) {
        let mut compiler = protox::Compiler::new(["proto"])?;
        compiler.include_source_info(false).include_imports(true).open_file(path)?;
        fs::write(out.join(format!("{name}.binpb")), compiler.encode_file_descriptor_set())?;
    }
    let paths = files.iter().map(|(_, path)| path);
    prost_build::Config::new().compile_fds(protox::compile(paths, ["proto"])?)?;
    Ok(())
}
