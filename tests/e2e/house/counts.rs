//! Sizes that may shrink. One that grows is a decision, with its reason in `docs/DECISIONS.md`.

use super::source::{Source, files, read, root};
use std::fmt::Write as _;
use std::path::Path;

/// Lines of Rust without tests, comments and blanks that each crate may have.
pub(super) const BUDGETS: [(&str, usize); 23] = [
    ("the command", 14_930),
    ("schemas", 9_510),
    ("schemas/bus", 4_595),
    ("schemas/recording", 6_860),
    ("schemas/storage", 2_215),
    ("schemas/system", 150),
    ("schemas/source", 130),
    ("schemas/recorder", 450),
    ("producer", 9_050),
    ("consumers", 6_660),
    ("consumers/analyses", 4_670),
    ("consumers/experiments", 1_765),
    ("consumers/exports", 945),
    ("consumers/figure", 3_045),
    ("consumers/orbits", 3_145),
    ("consumers/paper", 4_650),
    ("consumers/plots", 1_535),
    ("consumers/screen", 650),
    ("consumers/waves", 1_535),
    ("page", 1_250),
    ("relay", 2_500),
    ("python", 2_290),
    ("tests/bench", 2_370),
];

/// Lines of all of them but the bench. The aim is 54,000.
const MOST_LINES: usize = 82_395;

/// Lines of a function, and of a file without its tests. The aim for files is 600.
const LONGEST: (usize, usize) = (100, 615);

/// Files of the product that may name one analysis, one law and one method. The aims are 4, 3 and 2.
const NAMES: [(&str, usize); 3] = [("spreading", 2), ("toda", 4), ("rk5", 3)];

/// Directories of the product, and how its files end.
const PRODUCT: [&str; 7] = ["src", "schemas", "producer", "consumers", "page", "python/src", "relay"];
const LANGUAGES: [&str; 6] = ["rs", "js", "py", "pyi", "bash", "fish"];

/// First words that a doc comment does not have: it says what the thing is or does.
const QUESTIONS: [&str; 7] = ["What", "How", "Whether", "Of", "That of", "Says", "Where"];

fn sources(name: &str) -> Vec<Source> {
    Source::of_crate(&root().join(if name == "the command" { "" } else { name }))
}

/// The text of a line of a doc comment.
fn doc(line: &str) -> Option<&str> {
    let line = line.trim_start();
    line.strip_prefix("///").or_else(|| line.strip_prefix("//!")).map(str::trim_start)
}

/// Numbers of the lines where a doc comment opens with a question word.
fn questions(source: &Source) -> impl Iterator<Item = usize> {
    let is_question = |first: &str| {
        QUESTIONS.iter().any(|word| first.strip_prefix(word).is_some_and(|rest| rest.starts_with(' ')))
    };
    let mut before = None;
    source.lines.iter().enumerate().filter_map(move |(index, line)| {
        let now = doc(line);
        let opens = before.is_none() && now.is_some_and(is_question);
        before = now;
        opens.then_some(index + 1)
    })
}

#[test]
fn doc_comments_open_with_no_question() {
    let mut found = Vec::new();
    for source in BUDGETS.iter().flat_map(|(name, _)| sources(name)) {
        found.extend(questions(&source).map(|line| format!("{}:{line}", source.path.display())));
    }
    assert!(found.is_empty(), "these open with one of {QUESTIONS:?}:\n{}", found.join("\n"));
}

#[test]
fn crates_keep_to_their_budgets() {
    let (mut total, mut kept, mut table) = (0, true, String::new());
    for (name, most_lines) in BUDGETS {
        let lines: usize = sources(name).iter().map(|source| source.code().count()).sum();
        total += if name == "tests/bench" { 0 } else { lines };
        kept &= lines <= most_lines;
        writeln!(table, "{name}: {lines} of {most_lines} lines").unwrap();
    }
    let kept = kept && total <= MOST_LINES;
    assert!(
        kept,
        "\n{table}{total} of {MOST_LINES} lines: a larger budget is a decision for docs/DECISIONS.md"
    );
}

#[test]
fn functions_and_files_are_short() {
    let (longest_function, longest_file) = LONGEST;
    let mut long = Vec::new();
    for source in BUDGETS.iter().flat_map(|(name, _)| sources(name)) {
        let path = source.path.strip_prefix(root()).unwrap().display();
        let functions = source.functions().filter(|(.., lines)| lines.len() > longest_function);
        long.extend(functions.map(|(name, _, lines)| format!("{path}: `{name}` has {} lines", lines.len())));
        if source.lines.len() > longest_file {
            long.push(format!("{path} has {} lines", source.lines.len()));
        }
    }
    assert!(long.is_empty(), "at most {LONGEST:?}:\n{}", long.join("\n"));
}

/// The text of a file without its tests, `today` and `toDataURL`; nothing if it was generated.
fn product_text(path: &Path) -> String {
    let text = if path.extension().is_some_and(|end| end == "rs") {
        Source::read(path.to_owned()).lines.join("\n")
    } else {
        read(path)
    };
    let is_generated = text.lines().next().is_some_and(|first| first.to_lowercase().contains("generated"));
    if is_generated { String::new() } else { text.to_lowercase().replace("today", "").replace("todata", "") }
}

#[test]
fn few_files_name_an_analysis_a_law_a_method() {
    let paths = PRODUCT.iter().flat_map(|directory| files(&root().join(directory), &LANGUAGES));
    let texts: Vec<_> = paths.map(|path| (product_text(&path), path)).collect();
    let naming =
        |name| texts.iter().filter(|(text, _)| text.contains(name)).map(|(_, path)| path).collect::<Vec<_>>();
    let too_many: Vec<_> = NAMES.iter().filter(|(name, most)| naming(*name).len() > *most).collect();
    let found: Vec<_> = too_many.iter().map(|(name, _)| (name, naming(*name).len(), naming(*name))).collect();
    assert!(found.is_empty(), "more files than {NAMES:?} allows: {found:#?}");
}
