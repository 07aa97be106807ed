//! Tests that return before their end say why.

use super::source::{Source, files, root};
use std::collections::BTreeSet;

/// A test without what it needs passes; only a line that begins with SKIPPED tells, and `.ci/run` fails on it.
#[test]
fn a_test_that_returns_early_calls_what_says_skipped() {
    let (mut functions, mut tests) = (Vec::new(), Vec::new());
    for source in files(&root().join("tests/e2e"), &["rs"]).into_iter().map(Source::read) {
        for (name, at, lines) in source.functions() {
            let text = lines[1..].join("\n");
            let is_test = at > 0 && source.lines[at - 1].trim() == "#[test]";
            if is_test && (text.contains("{ return }") || text.contains("return;")) {
                tests.push((format!("{}: {name}", source.path.display()), text));
            } else if !is_test {
                let of = source.implements(at).map_or(String::new(), |of| format!("{of}::"));
                functions.push((format!("{of}{name}("), text));
            }
        }
    }
    let mut saying = BTreeSet::from(["skip(".to_owned()]);
    let is_called = |call: &str, text: &str| {
        let of_others = |before: char| before.is_alphanumeric() || "_:.".contains(before);
        text.match_indices(call).any(|(at, _)| !text[..at].ends_with(of_others))
    };
    let says = |text: &str, saying: &BTreeSet<String>| saying.iter().any(|call| is_called(call, text));
    for _ in 0..9 {
        let more: Vec<_> =
            functions.iter().filter(|(_, text)| says(text, &saying)).map(|(call, _)| call.clone()).collect();
        saying.extend(more);
    }
    assert!(tests.len() > 40, "{} tests that may return early were found", tests.len());
    let silent: Vec<_> =
        tests.iter().filter(|(_, text)| !says(text, &saying)).map(|(name, _)| name).collect();
    assert!(silent.is_empty(), "these may pass without a word: {silent:#?}");
}
