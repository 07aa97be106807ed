//! Writes the corpus that the fuzz targets begin with: `corpus GOLDEN CORPUS`, see `fuzz/run`.

use hostile::corpus::{damaged, manifests, repacked, states};
use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

/// Recordings longer than this are not damaged: the fuzz targets take no more.
const MOST_BYTES: usize = 1 << 14;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let (Some(golden), Some(corpus)) = (arguments.next(), arguments.next()) else {
        return Err("usage: corpus GOLDEN CORPUS".into());
    };
    let mut count = 0;
    let mut write = |target: &str, bytes: &[u8]| -> Result<(), Box<dyn Error>> {
        let directory = corpus.join(target);
        fs::create_dir_all(&directory)?;
        fs::write(directory.join(format!("own-{count:04}")), bytes)?;
        count += 1;
        Ok(())
    };
    for (seed, path) in (0..).zip(recordings(&golden)?) {
        let bytes = fs::read(&path)?;
        for manifest in manifests(&bytes) {
            write("manifest", &manifest)?;
        }
        let beads = beads(&bytes).ok_or_else(|| format!("{}: no beads", path.display()))?;
        for state in states(&bytes, beads).iter().take(3) {
            write("state", state)?;
        }
        for copy in [bytes.clone(), repacked(&bytes, false)] {
            write("recording", &copy)?;
            for copy in damaged(&copy, seed).iter().filter(|copy| copy.len() <= MOST_BYTES) {
                write("recording", copy)?;
            }
        }
    }
    Ok(())
}

/// All recordings below a directory, in order.
fn recordings(directory: &Path) -> Result<Vec<PathBuf>, Box<dyn Error>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(directory)? {
        let path = entry?.path();
        if path.is_dir() {
            found.extend(recordings(&path)?);
        } else if path.extension().is_some_and(|end| end == "mcap" || end == "partial") {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

/// N, from the manifest's JSON.
fn beads(bytes: &[u8]) -> Option<usize> {
    let key = b"\"beads\":";
    let at = bytes.windows(key.len()).position(|window| window == key)?;
    let digits = bytes[at + key.len()..].iter().take_while(|byte| byte.is_ascii_digit());
    digits.map(|digit| char::from(*digit)).collect::<String>().parse().ok()
}
