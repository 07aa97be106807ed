//! Periodic orbits by the command, against the time that they may take.

use super::child::Process;
use super::{Bench, Floor, Rounds, timed};
use crate::report::Report;
use anyhow::Error;
use std::fs;
use std::time::Duration;

/// A breather in a pressed chain of 81 beads, heavy and light in turn: from the lowest mode above the gap.
const BREATHER: &str = "\
chain = { beads = 81, bead_mass_kg = 1.0, alpha = 1.5, stiffness = 1.0, masses = { pattern_kg = [1.0, 0.3] } }
ends = { left = 'fixed', right = 'fixed' }
load = { precompression_n = 1.0 }
orbit = { amplitude_m = 0.02, mode = { number = 42, displacement_m = 0.02 } }
";

/// A hundred orbits along its amplitude.
const BRANCH: &str =
    "continue = { key = 'orbit.amplitude_m', from = 0.02, to = 5.0, step = 0.002, most = 100 }\n";

/// A breather at a light bead of a chain so long that no matrix is made.
const LONG: &str = "\
chain = { beads = 2000, bead_mass_kg = 1.0, alpha = 1.5, stiffness = 1.0, impurities = [{ bead = 1000, mass_kg = 0.2 }] }
ends = { left = 'fixed', right = 'fixed' }
load = { precompression_n = 1.0 }
orbit = { amplitude_m = 0.2, mode = { number = 2000, displacement_m = 0.1 } }
";

pub(super) fn rows(bench: &Bench, report: &mut Report) -> Result<(), Error> {
    let directory = bench.directory.path();
    for (what, text, limit, most_s) in [
        ("a breather of 81 beads and its multipliers", BREATHER.to_owned(), "2 s", 2),
        ("a breather of 2000 beads and its largest multipliers", LONG.to_owned(), "5 s", 5),
        ("a branch of 100 of them", format!("{BREATHER}{BRANCH}"), "2 min", 120),
    ] {
        let (file, out) = (directory.join("orbit.toml"), directory.join("orbit"));
        fs::write(&file, text)?;
        let ours = || {
            if out.exists() {
                fs::remove_dir_all(&out)?;
            }
            let words =
                ["beadline".as_ref(), "orbit".as_ref(), file.as_path(), "--out".as_ref(), out.as_path()];
            timed(|| {
                // a branch of so many orbits has not come to its end
                let ended = Process::start(words)?.finish();
                if out.join("orbit.json").exists() { Ok(String::new()) } else { ended }
            })
        };
        let rounds = Rounds::alternate(bench.rounds.min(3), ours, || Ok(Duration::from_secs(most_s)))?; // integers
        let figure = format!("{:.2} s", rounds.ours_s());
        report.row(rounds.row(what, limit, Floor::AtMost(1.0), figure))?;
    }
    Ok(())
}
