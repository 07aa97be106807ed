//! A grid of reflected energies on all cores against one, and what a point costs beside its dynamics.

use super::child::Process;
use super::{Bench, Floor, Rounds, timed};
use crate::report::Report;
use anyhow::Error;
use consumers::energies::{Energies, default_split_bead};
use consumers::pulses::Pulses;
use producer::integrator::Integrator;
use producer::state::ChainState;
use producer::sweep::{Hooks, Point, Sweep};
use schemas::manifest::{Origin, RunManifest};
use std::fs;
use std::hint::black_box;
use std::io::ErrorKind;
use std::path::Path;
use std::time::Duration;

/// Typical points of a large sweep: short runs of short chains.
const POINTS: &str = "\
[base]
preset = \"light-impurity\"
chain.beads = 150
chain.impurities = [{ bead = 50, mass_kg = 1e-3 }]
time.duration_s = 0.01
[grid]
\"chain.impurities[0].mass_kg\" = { from = 0.6e-3, to = 5e-3, count = 500 }
";

/// The grid of `beadline sweep --example` with shorter chains: how much an impurity reflects, over its mass
/// and the contact law.
const GRID: &str = include_str!("../grid.toml");

pub(super) fn rows(bench: &Bench, report: &mut Report) -> Result<(), Error> {
    let directory = bench.directory.path();
    let file = directory.join("grid.toml");
    fs::write(&file, GRID)?;
    let out = directory.join("sweep");
    // two workers, whatever there is: the floor is one for two
    let rounds = Rounds::alternate(bench.rounds, || sweep(&file, &out, "2"), || sweep(&file, &out, "1"))?;
    let figure = format!("{:.2} s", rounds.ours_s());
    report.row(rounds.row(
        "sweep of reflected energies, 2 workers",
        "1 worker",
        Floor::AtLeast(1.9),
        figure,
    ))?;
    fs::write(&file, POINTS)?;
    let no_files = |_: &Path| Err(ErrorKind::NotFound.into());
    let points = Sweep::from_toml(POINTS, &file, no_files, Hooks::NONE)?;
    for (looked, beside, floor) in
        [(true, "its run and what looks at it", Floor::AtMost(1.05)), (false, "its steps alone", Floor::Any)]
    {
        let alone = || timed(|| runs(&points, looked));
        let rounds = Rounds::alternate(bench.rounds, || sweep(&file, &out, "1"), alone)?;
        let figure = format!("{:.2} ms", 1e3 * rounds.ours_s() / points.point_count() as f64);
        report.row(rounds.row("a point of 150 beads, 1 worker", beside, floor, figure))?;
    }
    Ok(())
}

/// The runs of all points in this thread, with a state where a sweep has one, which its analyses look at if it is `looked` at.
fn runs(sweep: &Sweep, looked: bool) -> Result<(), Error> {
    let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
    for index in 0..sweep.point_count() {
        let Point { physics, config, .. } = sweep.point(index)?;
        let manifest = RunManifest::of(physics, &config, "point", origin.clone())?;
        let mut energies = Energies::new(&manifest, default_split_bead(&manifest));
        let threshold_m_s = Pulses::DEFAULT_THRESHOLD * Pulses::velocity_scale_m_s(&manifest);
        let mut pulses = Pulses::new(&manifest, threshold_m_s);
        let (mut state, mut integrator) =
            (ChainState::initial(&manifest.physics), Integrator::new(&manifest.physics));
        for number in 0..manifest.frame_count() {
            while state.step < manifest.step_of_frame(number) {
                integrator.advance(&mut state, manifest.step_of_frame(number));
            }
            let frame = state.as_frame(&manifest, number);
            if looked {
                energies.observe(&frame);
                black_box(pulses.observe(&frame));
            }
        }
        black_box((&state, energies.outcome()));
    }
    Ok(())
}

/// All of the grid, from nothing to the tables.
fn sweep(file: &Path, out: &Path, workers: &str) -> Result<Duration, Error> {
    if out.exists() {
        fs::remove_dir_all(out)?;
    }
    let words = [
        "beadline".as_ref(),
        "sweep".as_ref(),
        file,
        "--out".as_ref(),
        out,
        "--jobs".as_ref(),
        workers.as_ref(),
    ];
    timed(|| Process::start(words)?.finish())
}
