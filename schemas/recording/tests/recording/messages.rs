//! The files in `proto/made`, which are compiled here: nobody who builds a recording needs a compiler of protobuf.

use std::collections::BTreeMap;
use std::path::Path;
use std::{env, fs};

/// Each file is self-contained, so that the descriptor set of a message is its own file alone.
const OURS: [&str; 5] = ["chain_state", "chain", "summary", "contact_classes", "bead_motion"];

/// The messages that are made of the lists of their columns, for the test that compares both.
const OF_COLUMNS: [&str; 3] = ["energies", "impurity_motion", "pulses"];

/// Messages of Foxglove's, each with the files that it imports in its descriptor set.
const FOXGLOVE: [&str; 3] = ["Log", "PointCloud", "RawImage"];

/// The files by name: messages in Rust, and a descriptor set for each file.
fn compiled() -> BTreeMap<String, Vec<u8>> {
    let proto = Path::new(env!("CARGO_MANIFEST_DIR")).join("proto");
    let ours = |name| (name, format!("beadline/v1/{name}.proto"));
    let foxgloves = FOXGLOVE.map(|name| (name, format!("foxglove/{name}.proto")));
    let files: Vec<_> = OURS.map(ours).into_iter().chain(foxgloves).collect();
    let mut made = BTreeMap::new();
    for (name, path) in OF_COLUMNS.map(ours).iter().chain(&files) {
        let mut compiler = protox::Compiler::new([&proto]).unwrap();
        compiler.include_source_info(false).include_imports(true).open_file(path).unwrap();
        made.insert(format!("{name}.binpb"), compiler.encode_file_descriptor_set());
    }
    let descriptors = protox::compile(files.iter().map(|(_, path)| path), [&proto]).unwrap();
    let out = tempfile::tempdir().unwrap();
    prost_build::Config::new().out_dir(out.path()).compile_fds(descriptors).unwrap();
    for file in fs::read_dir(out.path()).unwrap() {
        let path = file.unwrap().path();
        made.insert(path.file_name().unwrap().to_string_lossy().into_owned(), fs::read(path).unwrap());
    }
    made
}

#[test]
fn what_is_compiled_of_the_messages_is_up_to_date() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("proto/made");
    let made = compiled();
    if env::var_os("BEADLINE_COMPILE_MESSAGES").is_some() {
        for (name, bytes) in &made {
            fs::write(folder.join(name), bytes).unwrap();
        }
    }
    for (name, bytes) in &made {
        let kept = fs::read(folder.join(name)).unwrap_or_default();
        assert!(
            kept == *bytes,
            "proto/made/{name} is not what proto/ says: run this test with BEADLINE_COMPILE_MESSAGES=1"
        );
    }
    assert_eq!(fs::read_dir(folder).unwrap().count(), made.len(), "files that no message has");
}
