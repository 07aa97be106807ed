//! The points of the energy figures, by a sweep.

use crate::failure::Failure;
use crate::sweep::{self, Options};
use anyhow::anyhow;
use paper::{Reflected, refined_sweep, reflection_sweep};
use producer::sweep::Sweep;
use schemas::amounts::counted;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Computes the points that have no row yet, below `out`, `threads` at a time: those of the figures, and those between
/// them that show whether curves cross there. Nothing if `stop` was set.
pub(super) fn points(
    out: &Path,
    threads: usize,
    stop: &AtomicBool,
) -> Result<Option<Vec<Reflected>>, Failure> {
    let mut points = Vec::new();
    let mut next = Some(reflection_sweep());
    while let Some(text) = next {
        let Some(more) = points_of(&text, out, threads, stop)? else { return Ok(None) };
        points.extend(more);
        next = refined_sweep(&points);
    }
    Ok(Some(points))
}

/// The points of one sweep.
fn points_of(
    text: &str,
    out: &Path,
    threads: usize,
    stop: &AtomicBool,
) -> Result<Option<Vec<Reflected>>, Failure> {
    let no_files = |path: &Path| Err(std::io::Error::other(format!("{} is not read", path.display())));
    let sweep = Sweep::from_toml(text, Path::new("reflection.toml"), no_files, experiments::HOOKS)?;
    // rows of another version of this program stay beside these
    let identity = recording::hex(&sweep.identity()[..6]);
    let version = env!("CARGO_PKG_VERSION");
    let directory = out.join(format!("reflection-{identity}-{version}"));
    let outcome = sweep::compute(&sweep, &directory, &Options { threads, ..Options::default() }, stop)?;
    if stop.load(Ordering::Relaxed) {
        return Ok(None);
    }
    let path = directory.display();
    if let Some(index) = outcome.failed.first() {
        return Err(anyhow!("point {index} of the sweep in {path} failed; its row says why").into());
    }
    if outcome.missing > 0 {
        return Err(anyhow!("the sweep in {path} has no row of {}", counted(outcome.missing, "point")).into());
    }
    let columns = experiments::columns(&sweep);
    let mut points = Vec::new();
    sweep::each_row(&sweep, &directory, |row| {
        points.push(Reflected::of_row(&columns, &row.cells)?);
        Ok(())
    })?;
    Ok(Some(points))
}
