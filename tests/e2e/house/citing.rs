//! Files for those who cite the program, which say the same as the program.

use super::source::{read, root};

#[test]
fn files_for_citing_have_the_version_of_the_program() {
    let version = env!("CARGO_PKG_VERSION");
    assert!(read(&root().join("CITATION.cff")).contains(&format!("\nversion: {version}\n")));
    let meta: serde_json::Value = serde_json::from_str(&read(&root().join("codemeta.json"))).expect("JSON");
    assert_eq!(meta["version"], version);
}

/// A journal takes at most 1,000 words; each source that the text names is in the list, and each figure is there.
#[test]
fn the_paper_is_short_and_its_sources_exist() {
    let (text, sources) = (read(&root().join("paper/paper.md")), read(&root().join("paper/paper.bib")));
    assert!(text.split_whitespace().count() <= 1000);
    let keys: Vec<&str> = text.split("[@").skip(1).filter_map(|rest| rest.split(']').next()).collect();
    assert!(keys.len() > 5 && keys.iter().all(|key| sources.contains(&format!("{{{key},"))), "{keys:?}");
    for figure in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
        assert!(root().join("paper").join(figure).is_file(), "{figure}");
    }
}
