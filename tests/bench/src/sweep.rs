//! A grid of reflected energies on all cores against one.

use super::child::Process;
use super::{Audience, Bench, Floor, Rounds, timed};
use anyhow::Error;
use std::fs;
use std::path::Path;
use std::time::Duration;

/// The grid of `beadline sweep --example` with shorter chains: how much an impurity reflects, over its mass
/// and the contact law.
const GRID: &str = include_str!("../grid.toml");

pub(super) fn rows(bench: &Bench, report: &mut dyn Audience) -> Result<(), Error> {
    let directory = bench.directory.path();
    let file = directory.join("grid.toml");
    fs::write(&file, GRID)?;
    let out = directory.join("sweep");
    // two workers, whatever there is: the floor is one for two
    let rounds = Rounds::alternate(bench.rounds, || sweep(&file, &out, "2"), || sweep(&file, &out, "1"))?;
    let figure = format!("{:.2} s", rounds.ours_s());
    report.row(rounds.row("sweep of reflected energies, 2 workers", "1 worker", Floor::AtLeast(1.9), figure))
}

/// All of the grid, from nothing to the tables.
fn sweep(file: &Path, out: &Path, workers: &str) -> Result<Duration, Error> {
    if out.exists() {
        fs::remove_dir_all(out)?;
    }
    let words = ["sweep".as_ref(), file, "--out".as_ref(), out, "--jobs".as_ref(), workers.as_ref()];
    timed(|| Process::start(words)?.finish())
}
