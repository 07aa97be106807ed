//! Every command that the guide shows, run page by page as a reader would.
//!
//! A block of code says by its first line how: `sh` has to succeed, `sh fails` has to end with an error, `sh terminal-1` and
//! the `sh terminal-2` after it run at the same time, `sh viewer` goes on until Ctrl-C, `sh install` is what CI does before; what
//! names a feature of the build, as `sh relay`, is run where that is there. With `BEADLINE_RENEW_PICTURES` set
//! the pictures of the guide are made anew.

use crate::harness::{Ended, Place, Running, python, skip};
use crate::{own_analysis, own_consumer};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What no test can run: it would build all of Beadline, from the network.
const INSTALL: &str = "git clone https://github.com/beadline/beadline\ncargo install --path beadline\n";

/// A block of code of a page.
struct Block {
    line: usize,
    kind: String,
    code: String,
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn blocks(page: &str) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut open: Option<Block> = None;
    for (number, line) in page.lines().enumerate() {
        match (line.strip_prefix("```"), &mut open) {
            (Some(_), Some(_)) => blocks.extend(open.take()),
            (Some(kind), None) => {
                open = Some(Block { line: number + 1, kind: kind.to_owned(), code: String::new() });
            }
            (None, Some(block)) => {
                block.code += line;
                block.code.push('\n');
            }
            (None, None) => (),
        }
    }
    assert!(open.is_none(), "a block of code has no end");
    blocks
}

/// Every Rust block of the guide is a part of one of these, which are compiled.
fn examples() -> String {
    let text = |name: &str| fs::read_to_string(root().join("examples").join(name)).unwrap();
    text("own_consumer.rs") + &text("own_analysis.rs")
}

/// A page of the guide, the place where its commands run, and the Python of `tests/setup`, if that is there.
struct Reader<'a> {
    page: &'a str,
    place: Place,
    python: Option<PathBuf>,
}

impl Reader<'_> {
    fn command(&self, program: &str, flag: &str, code: &str) -> Command {
        let mut command = self.place.foreign(program, [flag, code]);
        let beadline = Path::new(env!("CARGO_BIN_EXE_beadline")).parent().unwrap();
        let mut directories = vec![beadline.to_owned(), beadline.join("examples")];
        directories.extend(self.python.iter().filter_map(|python| python.parent()).map(Path::to_owned));
        directories.extend(std::env::split_paths(&std::env::var_os("PATH").unwrap_or_default()));
        let path: OsString = std::env::join_paths(directories).unwrap();
        command.env("PATH", path).env("HOME", self.place.path(""));
        command
    }

    fn start(&self, block: &Block) -> Running {
        let words = format!("{}:{}", self.page, block.line);
        let command = if block.kind.starts_with("python") {
            self.command("python3", "-c", &block.code)
        } else {
            self.command("bash", "-c", &format!("set -euo pipefail\n{}", block.code))
        };
        Running::start(&words, command)
    }

    fn run(&self, block: &Block, first_terminal: &mut Option<Running>) {
        match block.kind.as_str() {
            "sh install" => assert_eq!(block.code, INSTALL, "CI builds and installs in another way"),
            "sh" | "python" => drop(self.start(block).wait().exits(0)),
            "sh fails" => {
                let ended: Ended = self.start(block).wait();
                assert!(matches!(ended.code(), Some(2 | 3)), "{}:{} should fail", self.page, block.line);
            }
            "sh viewer" => {
                let code = format!("timeout --preserve-status --signal=INT 3 {}", block.code);
                drop(self.start(&Block { kind: "sh".to_owned(), code, line: block.line }).wait().exits(0));
            }
            "sh terminal-1" => *first_terminal = Some(self.start(block)),
            "sh terminal-2" | "python terminal-2" => {
                self.start(block).wait().exits(0);
                first_terminal.take().expect("a first terminal").wait().exits(0);
            }
            "rust" => {
                assert!(examples().contains(&block.code), "{}:{} is another", self.page, block.line);
            }
            "text" | "toml" => (),
            other => panic!("{}:{}: nobody runs a block of `{other}`", self.page, block.line),
        }
    }

    /// Each picture of the guide that a page shows is what its commands have made.
    fn compare_pictures(&self, text: &str) {
        for piece in text.split("img/guide/").skip(1) {
            let name = piece.split(['"', ')']).next().unwrap();
            let (made, shown) = (self.place.path(name), root().join("docs/img/guide").join(name));
            assert!(made.exists(), "{}: no command makes {name}", self.page);
            if std::env::var_os("BEADLINE_RENEW_PICTURES").is_some() {
                fs::copy(&made, &shown).unwrap();
            }
            assert!(
                shown.exists(),
                "{name} is missing in docs/img/guide: BEADLINE_RENEW_PICTURES=1 makes it"
            );
        }
    }
}

/// Leaves the words out of the first line of `block` that name a feature of the build; false if this one has it not.
fn is_built(block: &mut Block) -> bool {
    let features = [("relay", cfg!(feature = "relay")), ("remote", cfg!(feature = "remote"))];
    let found = features.iter().find(|(feature, _)| block.kind.contains(&format!(" {feature}")));
    let Some((feature, is_there)) = found else { return true };
    block.kind = block.kind.replace(&format!(" {feature}"), "");
    *is_there
}

fn read(page: &str) {
    let text = fs::read_to_string(root().join(page)).unwrap();
    let mut blocks = blocks(&text);
    blocks.retain_mut(is_built);
    let uses_python = |block: &Block| block.kind.starts_with("python");
    let python = if blocks.iter().any(uses_python) { python() } else { None };
    let reader = Reader { page, place: Place::new(), python };
    let mut first_terminal = None;
    for block in &blocks {
        if uses_python(block) && reader.python.is_none() {
            // a run that waits for it would wait in vain
            first_terminal = None;
            skip(&format!("{page}:{} needs the Python of `tests/setup`", block.line));
        } else {
            reader.run(block, &mut first_terminal);
        }
    }
    assert!(first_terminal.is_none(), "{page}: a first terminal without a second");
    reader.compare_pictures(&text);
}

#[test]
fn readme() {
    read("README.md");
}

#[test]
fn first_run() {
    read("docs/guide/1-first-run.md");
}

#[test]
fn watch() {
    read("docs/guide/2-watch.md");
}

#[test]
fn analyse() {
    read("docs/guide/3-analyse.md");
}

#[test]
fn record() {
    read("docs/guide/4-record.md");
}

#[test]
fn share() {
    read("docs/guide/5-share.md");
}

#[test]
fn sweep() {
    read("docs/guide/6-sweep.md");
}

#[test]
fn any_chain() {
    read("docs/guide/7-any-chain.md");
}

#[test]
fn elsewhere() {
    read("docs/guide/8-elsewhere.md");
}

#[test]
fn own_consumer() {
    // without it the run in the first terminal would wait for ever
    if own_consumer::example().is_some() && own_analysis::example().is_some() {
        read("docs/guide/9-own-consumer.md");
    }
}

#[test]
fn stability() {
    read("docs/guide/11-stability.md");
}

#[test]
fn heat() {
    read("docs/guide/12-heat.md");
}

#[test]
fn questions() {
    read("docs/guide/10-questions.md");
}

/// Every page is read by a test, and every page that is named is there.
#[test]
fn links_lead_somewhere() {
    for entry in fs::read_dir(root().join("docs/guide")).unwrap() {
        let path = entry.unwrap().path();
        let text = fs::read_to_string(&path).unwrap();
        for target in text.split("](").skip(1).filter_map(|piece| piece.split([')', '#']).next()) {
            let is_page = !target.starts_with("http") && !target.is_empty();
            let found = path.parent().unwrap().join(target);
            assert!(!is_page || found.exists(), "{}: {target} is not there", path.display());
        }
    }
}

/// What shells and `man` are given is theirs to understand.
#[test]
fn completions_and_pages_are_made_for_all_commands() {
    let place = Place::new();
    let script = place.run("completions bash").exits(0).stdout();
    place.write("beadline.bash", &script);
    let check = place.foreign("bash", ["-n", "beadline.bash"]);
    Running::start("bash -n", check).wait().exits(0);
    place.run("man --out pages").exits(0);
    let page = place.read("pages/beadline-run.1");
    assert!(page.starts_with(".ie") && page.contains("resume"), "{page}");
    place.run("man --out pages").exits(2);
    place.run("man --out pages --force").exits(0);
    place.run("man no-such-command").exits(2);
}
