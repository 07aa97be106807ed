//! What a program does to files, from a trace of its system calls.

use crate::harness::{Place, Running};
use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};

/// Every call that changes a file, a name or a place in a file, or syncs.
const CALLS: &str = "openat,open,creat,write,pwrite64,writev,pwritev,pwritev2,lseek,fsync,fdatasync,sync_file_range,\
    ftruncate,truncate,fallocate,rename,renameat,renameat2,link,linkat,symlink,symlinkat,unlink,unlinkat,mkdir,\
    mkdirat,rmdir,copy_file_range,sendfile,splice";

/// A change of a file or of a name, or a sync.
#[derive(Debug, Clone)]
pub(super) enum Operation {
    Create(PathBuf),
    MakeDirectory(PathBuf),
    Write {
        path: PathBuf,
        at: usize,
        bytes: Vec<u8>,
    },
    Resize {
        path: PathBuf,
        length: usize,
    },
    Rename {
        from: PathBuf,
        to: PathBuf,
    },
    Remove(PathBuf),
    /// Of a file, or of the names in a directory.
    Sync {
        path: PathBuf,
        /// Only the operations before this one had been made when it began.
        begun: usize,
    },
}

/// Runs `beadline` with these words and returns its operations below `directory`, with paths relative to it.
pub(super) fn trace(place: &Place, words: &str, directory: &Path) -> Vec<Operation> {
    let file = place.path("trace");
    let filter = format!("trace=?{}", CALLS.replace(',', ",?"));
    let mut before = vec!["-f", "-y", "-xx", "-s", "100000000", "-o", file.to_str().unwrap(), "-e", &filter];
    before.push(env!("CARGO_BIN_EXE_beadline"));
    let command = place.foreign("strace", before.into_iter().chain(words.split(' ')));
    Running::start(words, command).wait().exits(0);
    let mut reader = Reader { directory, places: HashMap::new(), operations: Vec::new() };
    let mut begun: HashMap<&str, (String, usize)> = HashMap::new();
    for line in fs::read_to_string(&file).unwrap().lines() {
        let (thread, rest) = line.split_once(' ').unwrap();
        let rest = rest.trim_start();
        if let Some(first) = rest.strip_suffix("<unfinished ...>") {
            begun.insert(thread, (first.trim_end().to_owned(), reader.operations.len()));
        } else if let Some((_, second)) = rest.split_once(" resumed>") {
            let (first, begun) = begun.remove(thread).unwrap();
            reader.read(&(first + second), begun);
        } else {
            reader.read(rest, reader.operations.len());
        }
    }
    reader.operations
}

struct Reader<'a> {
    directory: &'a Path,
    /// Where in a file the next write goes, by descriptor and path.
    places: HashMap<(String, PathBuf), usize>,
    operations: Vec<Operation>,
}

impl Reader<'_> {
    /// Reads a call that is `CALL(ARGUMENTS) = RESULT`; signals and exits are none.
    fn read(&mut self, text: &str, begun: usize) {
        let Some((call, rest)) = text.split_once('(') else { return };
        let Some((arguments, result)) = rest.rsplit_once(" = ") else { return };
        let Some(arguments) = arguments.trim_end().strip_suffix(')') else { return };
        // what failed changed nothing
        let Ok(result) = result.split(['<', ' ']).next().unwrap_or_default().parse::<usize>() else { return };
        let arguments: Vec<&str> = arguments.split(", ").collect();
        let number = |at: usize| arguments[at].parse::<usize>().unwrap();
        let operation = match call {
            "openat" => {
                let Some(path) = self.below(&joined(&arguments[..2])) else { return };
                let has = |flag| arguments[2].contains(flag);
                if !has("O_WRONLY") && !has("O_RDWR") || has("O_TMPFILE") {
                    return;
                }
                assert!(!has("O_APPEND"), "{text}");
                self.places.insert((result.to_string(), path.clone()), 0);
                if has("O_CREAT") {
                    self.operations.push(Operation::Create(path.clone()));
                }
                if !has("O_TRUNC") {
                    return;
                }
                Operation::Resize { path, length: 0 }
            }
            "lseek" | "write" | "pwrite64" | "fsync" | "fdatasync" | "ftruncate" => {
                let (descriptor, path) = descriptor(arguments[0]);
                let Some(path) = self.below(&path) else { return };
                let place = self.places.entry((descriptor, path.clone())).or_default();
                match call {
                    "lseek" => {
                        *place = result;
                        return;
                    }
                    "write" | "pwrite64" => {
                        let at = if call == "write" { *place } else { number(3) };
                        let bytes = unhex(arguments[1])[..result].to_vec();
                        if call == "write" {
                            *place += result;
                        }
                        Operation::Write { path, at, bytes }
                    }
                    "ftruncate" => Operation::Resize { path, length: number(1) },
                    _ => Operation::Sync { path, begun },
                }
            }
            "mkdir" | "unlink" | "rmdir" => {
                let path = PathBuf::from(string(arguments[0]));
                let Some(path) = self.below(&path) else { return };
                if call == "mkdir" { Operation::MakeDirectory(path) } else { Operation::Remove(path) }
            }
            "rename" | "renameat" | "renameat2" => {
                let (from, to) = match call {
                    "rename" => (string(arguments[0]).into(), string(arguments[1]).into()),
                    _ => (joined(&arguments[..2]), joined(&arguments[2..4])),
                };
                let (Some(from), Some(to)) = (self.below(&from), self.below(&to)) else { return };
                Operation::Rename { from, to }
            }
            _ => {
                let directory = self.directory.to_str().unwrap();
                let is_ours = arguments.iter().any(|word| string(word).contains(directory));
                assert!(!is_ours, "what does this do to a file? {text}");
                return;
            }
        };
        self.operations.push(operation);
    }

    /// The path relative to the directory, if it is in it. Paths are relative to the directory's parent.
    fn below(&self, path: &Path) -> Option<PathBuf> {
        let path = self.directory.parent()?.join(path);
        path.strip_prefix(self.directory).ok().map(Path::to_owned)
    }
}

/// `AT_FDCWD<DIRECTORY>` and `"PATH"`.
fn joined(arguments: &[&str]) -> PathBuf {
    descriptor(arguments[0]).1.join(string(arguments[1]))
}

/// `NUMBER<PATH>`; after a path that the file does not have any more there is `(deleted)`.
fn descriptor(argument: &str) -> (String, PathBuf) {
    let (number, path) = argument.split_once('<').unwrap_or((argument, ""));
    let path = if path.ends_with("(deleted)") { "" } else { path };
    (number.to_owned(), string(path).into())
}

/// A quoted string, or a path after `<`.
fn string(argument: &str) -> String {
    String::from_utf8(unhex(argument)).unwrap()
}

/// The bytes that are written as `\x…` in `text`.
fn unhex(text: &str) -> Vec<u8> {
    let bytes = text.split("\\x").skip(1);
    bytes.map(|byte| u8::from_str_radix(&byte[..2], 16).unwrap()).collect()
}
