//! Files of the product, and the parts of a Rust file.

use std::fs;
use std::path::{Path, PathBuf};

/// The directory of the project.
pub(super) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Text of a file.
pub(super) fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Files below `directory` whose names end with one of `extensions`, in order; tests are left out.
pub(super) fn files(directory: &Path, extensions: &[&str]) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut left = vec![directory.to_owned()];
    while let Some(directory) = left.pop() {
        let entries = fs::read_dir(&directory).into_iter().flatten().map(|entry| entry.unwrap().path());
        for path in entries.filter(|path| path.file_stem().is_some_and(|stem| stem != "tests")) {
            if path.is_dir() {
                left.push(path);
            } else if path.extension().is_some_and(|found| extensions.iter().any(|known| found == *known)) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// A Rust file without what only its tests see.
pub(super) struct Source {
    pub(super) path: PathBuf,
    pub(super) lines: Vec<String>,
}

impl Source {
    /// All files of a crate.
    pub(super) fn of_crate(directory: &Path) -> Vec<Self> {
        files(&directory.join("src"), &["rs"]).into_iter().map(Self::read).collect()
    }

    pub(super) fn read(path: PathBuf) -> Self {
        let text = read(&path);
        let mut lines = Vec::new();
        let mut rest = text.lines();
        while let Some(line) = rest.next() {
            if line.trim_start() == "#[cfg(test)]" {
                rest.find(|next| indent(next) == indent(line) && next.ends_with([';', ',', '}']));
            } else {
                lines.push(line.to_owned());
            }
        }
        Self { path, lines }
    }

    /// Lines that are neither blank nor comments.
    pub(super) fn code(&self) -> impl Iterator<Item = &str> {
        let lines = self.lines.iter().map(|line| line.trim());
        lines.filter(|line| !line.is_empty() && !line.starts_with("//"))
    }

    /// Each function: its name, the place of its first line, and its lines.
    pub(super) fn functions(&self) -> impl Iterator<Item = (&str, usize, &[String])> {
        self.lines.iter().enumerate().filter_map(|(at, line)| {
            let (before, rest) = line.split_once("fn ").filter(|_| !line.trim_start().starts_with("//"))?;
            let (name, _) =
                rest.split_once(['(', '<']).filter(|_| before.is_empty() || before.ends_with(' '))?;
            let end = |last: &String| indent(last) == indent(line) && last.ends_with([';', '}']);
            let length = 1 + self.lines[at..].iter().position(end)?;
            Some((name, at, &self.lines[at..at + length]))
        })
    }

    /// The type that the line at `at` implements something for, if it lies in an `impl`.
    pub(super) fn implements(&self, at: usize) -> Option<&str> {
        let above =
            self.lines[..at].iter().rev().find(|line| indent(line) == 0 && line.ends_with(['{', '}']))?;
        let mut words = above.strip_prefix("impl")?.split([' ', '<', '>']);
        words.rfind(|word| word.starts_with(char::is_uppercase))
    }
}

fn indent(line: &str) -> usize {
    line.len() - line.trim_start().len()
}
