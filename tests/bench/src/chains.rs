//! Chains of every kind, one by one, against the loop that a user would write in C.

use super::{Bench, Floor, Rounds};
use crate::dynamics::Moments;
use crate::report::{Report, notice};
use anyhow::{Context as _, Error, bail};
use pulp::Arch;
use schemas::config::{Bonds, End, RunConfig};
use schemas::method::Method;
use schemas::presets::PRESETS;
use schemas::term::{Spring, TermLaw};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// Bead-steps of a measurement.
const BEAD_STEPS: u64 = 40_000_000;

/// The flags with which a user who wants a fast loop compiles it.
const FLAGS: [&str; 4] = ["-O3", "-march=native", "-fno-math-errno", "-ffp-contract=off"];

/// A chain that moves all of the time, and the word that the plain loop has for it.
#[derive(Debug, Clone, Copy)]
struct Kind {
    what: &'static str,
    word: &'static str,
    beads: u64,
    alpha: f64,
    floor: Floor,
}

const KINDS: [Kind; 12] = {
    const fn pressed(what: &'static str, beads: u64, floor: f64) -> Kind {
        Kind { what, word: "hertz", beads, alpha: 1.5, floor: Floor::AtLeast(floor) }
    }
    const fn bonds(what: &'static str, word: &'static str, beads: u64) -> Kind {
        Kind { what, word, beads, alpha: 1.0, floor: Floor::AtLeast(1.0) }
    }
    [
        pressed("pressed, N = 10", 10, 1.0),
        pressed("pressed, N = 20", 20, 1.0),
        pressed("pressed, N = 32", 32, 1.2),
        pressed("pressed, N = 64", 64, 1.2),
        pressed("pressed, N = 150", 150, 1.2),
        pressed("pressed, N = 200", 200, 1.4),
        pressed("pressed, N = 1000", 1000, 1.4),
        Kind {
            what: "pressed, α = 1.3, N = 200",
            word: "power",
            beads: 200,
            alpha: 1.3,
            floor: Floor::AtLeast(12.0),
        },
        bonds("ring of FPUT-α bonds, N = 32", "alpha", 32),
        bonds("ring of FPUT-α bonds, N = 1024", "alpha", 1024),
        bonds("ring of FPUT-β bonds, N = 32", "beta", 32),
        bonds("ring of FPUT-β bonds, N = 1024", "beta", 1024),
    ]
};

impl Kind {
    fn config(&self) -> RunConfig {
        let mut config = PRESETS[0].config();
        config.chain.impurities.clear();
        (config.chain.beads, config.chain.alpha) = (self.beads, self.alpha);
        config.integrator.method = Method::VelocityVerlet;
        let end = if self.word == "alpha" || self.word == "beta" {
            (config.chain.bead_mass_kg, config.chain.stiffness) = (1.0, 1.0);
            let bend = if self.word == "alpha" { Spring(2) } else { Spring(3) };
            let laws = [(TermLaw::Spring(Spring(1)), 1.0), (TermLaw::Spring(bend), 0.25)];
            config.chain.bonds = Some(Bonds::from_iter(laws));
            config.time.dt_s = Some(0.05);
            config.time.duration_s = 1e6;
            End::Periodic
        } else {
            config.load.precompression_n = 10.0;
            End::Fixed
        };
        (config.ends.left, config.ends.right) = (end, end);
        config.striker.velocity_m_s = 0.01;
        config
    }

    fn steps(&self) -> u64 {
        BEAD_STEPS / self.beads
    }
}

/// Each kind against the plain loop, if there is a C compiler.
pub(super) fn rows(bench: &Bench, report: &mut Report) -> Result<(), Error> {
    let plain = match compiled(bench.directory.path()) {
        Ok(plain) => plain,
        Err(error) => {
            notice(&format!("chains are not measured: {error:#}"));
            return Ok(());
        }
    };
    for kind in KINDS {
        let moments = Moments::all_moving(&kind.config(), kind.steps())?;
        let rounds =
            Rounds::alternate(bench.rounds, || Ok(moments.ours(Arch::new())), || kind.theirs(&plain))?;
        let per_bead_step = |time_s: f64| time_s / moments.bead_steps() * 1e9;
        let figure = format!("{:.2} ns a bead-step", per_bead_step(rounds.ours_s()));
        report.row(rounds.row(kind.what, "a plain loop in C", kind.floor, figure))?;
    }
    Ok(())
}

impl Kind {
    /// The time that the plain loop takes by its own clock.
    fn theirs(&self, plain: &Path) -> Result<Duration, Error> {
        let (beads, steps, alpha) =
            (self.beads.to_string(), self.steps().to_string(), self.alpha.to_string());
        let ended = Command::new(plain).args([self.word, &beads, &steps, &alpha]).output()?;
        let printed = String::from_utf8_lossy(&ended.stdout);
        let time = printed.split_whitespace().next().and_then(|word| word.parse().ok());
        match time {
            Some(time_s) if ended.status.success() => Ok(Duration::from_secs_f64(time_s)),
            _ => bail!("the plain loop of {} ended with {}: {printed}", self.what, ended.status),
        }
    }
}

/// The plain loop, compiled for this machine.
fn compiled(directory: &Path) -> Result<PathBuf, Error> {
    let (source, program) = (directory.join("plain.c"), directory.join("plain"));
    std::fs::write(&source, include_str!("../plain.c"))?;
    let ended = Command::new("cc").args(FLAGS).arg("-o").args([&program, &source]).arg("-lm").output();
    let ended = ended.context("a C compiler is needed, and `cc` cannot be started")?;
    if !ended.status.success() {
        bail!("`cc` says: {}", String::from_utf8_lossy(&ended.stderr));
    }
    Ok(program)
}
