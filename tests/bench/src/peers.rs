//! Programs that users run today: the same chain by LAMMPS, Numba and `numpy`, each on the same core as ours.

mod inputs;
mod piece;
mod program;

use super::{Bench, Floor, Ratio, Rounds, Row};
use crate::report::{Report, notice};
use anyhow::Error;
use piece::{Outcome, Piece};
use program::Program;
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};
use std::panic::resume_unwind;
use std::path::Path;
use std::thread;
use std::time::Duration;

/// Velocities may differ by this part of the striker's. Everybody rounds in a way of his own, and the late, weak
/// collisions around the impurity enlarge it: over the whole run to 1e-9 in Python, and to 1e-6 in LAMMPS, whose
/// positions have fewer digits for an overlap than displacements have.
const TOLERANCE: f64 = 1e-5;

/// A program to measure against, its name, and the requirement on our speed.
type Peer = (Program, &'static str, Floor);

/// Name of a simulation, the simulation, and its peers.
type Series = (&'static str, fn() -> Result<Piece, Error>, [Peer; 4]);

const SIMULATING: [Peer; 4] = [
    (Program::Lammps { states: "" }, "LAMMPS, gran/hertz/history", Floor::AtLeast(20.0)),
    (Program::Numba { loops: "fused" }, "Numba, one fused loop", Floor::AtLeast(4.0)),
    (Program::Numba { loops: "apart" }, "Numba, three loops", Floor::AtLeast(2.0)),
    (Program::NumPy, "NumPy", Floor::Any),
];

const WITH_OUTPUT: [Peer; 4] = [
    (Program::Lammps { states: "states.dump" }, "LAMMPS, dump custom as text", Floor::Any),
    (Program::Lammps { states: "states.bin" }, "LAMMPS, dump custom in binary", Floor::Any),
    (Program::Numba { loops: "fused" }, "Numba, one fused loop, numpy.save", Floor::Any),
    (Program::NumPy, "NumPy, numpy.save", Floor::Any),
];

/// The light-impurity run without output, and pieces of it with one state in 100 and with every state.
const SERIES: [Series; 3] = [
    ("the whole run, no output", Piece::whole, SIMULATING),
    ("one state in 100 recorded", Piece::one_in_100, WITH_OUTPUT),
    ("every state recorded", Piece::every_state, WITH_OUTPUT),
];

/// Every piece of the run against every program that is found.
pub(super) fn rows(bench: &Bench, report: &mut Report) -> Result<(), Error> {
    let found: Vec<_> = Program::ALL.into_iter().filter(|program| is_there(*program)).collect();
    if found.is_empty() {
        return Ok(());
    }
    let rounds = bench.rounds;
    let mut measure = || -> Result<(), Error> {
        stay_on_one_core()?;
        for (what, piece, peers) in SERIES {
            let (piece, directory) = (piece()?, tempfile::tempdir()?);
            inputs::write(directory.path(), &piece)?;
            let expected = piece.simulate(directory.path())?;
            for peer in peers.iter().filter(|peer| found.iter().any(|found| found.is_same_as(&peer.0))) {
                report.row(row(what, &piece, *peer, directory.path(), &expected, rounds)?)?;
            }
        }
        Ok(())
    };
    // a thread and what it starts share one core; the rest of the program keeps all of them
    thread::scope(|scope| {
        let measuring = thread::Builder::new().spawn_scoped(scope, &mut measure)?;
        measuring.join().unwrap_or_else(|panic| resume_unwind(panic))
    })
}

/// True if the program was found. Prints its version, or what is missing.
fn is_there(program: Program) -> bool {
    match program.version() {
        Ok(version) => notice(&format!("measuring against {version}")),
        Err(missing) => {
            notice(&format!("not measured: {missing}"));
            return false;
        }
    }
    true
}

fn stay_on_one_core() -> Result<(), Error> {
    let allowed = sched_getaffinity(None)?;
    let mut core = CpuSet::new();
    // the first ones have more to do with devices
    core.set((0..CpuSet::MAX_CPU).rfind(|core| allowed.is_set(*core)).unwrap_or(0));
    Ok(sched_setaffinity(None, &core)?)
}

fn row(
    what: &'static str,
    piece: &Piece,
    (program, against, floor): Peer,
    directory: &Path,
    expected: &Outcome,
    rounds: u32,
) -> Result<Row, Error> {
    let ours = || Ok(piece.simulate(directory)?.time);
    let theirs = || -> Result<Duration, Error> {
        let outcome = program.run(directory, piece)?;
        outcome.check(against, expected, TOLERANCE * piece.striker_m_s())?;
        Ok(outcome.time)
    };
    let rounds = Rounds::alternate(rounds, ours, theirs)?;
    let theirs_s = Ratio::of(rounds.theirs_s.iter().copied()).median;
    let millions = |time_s: f64| piece.bead_steps() / time_s / 1e6;
    let figure = format!("{:.0} against {:.1} M bead-steps/s", millions(rounds.ours_s()), millions(theirs_s));
    Ok(rounds.row(what, against, floor, figure))
}
