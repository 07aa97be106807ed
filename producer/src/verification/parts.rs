//! Parts of one recording, one after the other.

use super::Verification;
use super::batches::advance;
use crate::integrator::Integrator;
use crate::resimulation::{Difference, check_kernel, difference};
use crate::state::ChainState;
use recording::BeginRecord;
use schemas::frame::EndReason;
use schemas::manifest::RunManifest;
use std::sync::atomic::AtomicBool;

/// Most steps, times the beads, that are always computed beyond the states of a file: some ten seconds.
const MOST_BEYOND: u64 = 1 << 34;

/// Most steps that are computed beyond the states of a file, per step that these cover.
const TIMES_COVERED: u64 = 1024;

/// True if so many steps before or after the states of a file of this run, which cover `covered` steps, are worth
/// computing: a false claim of a file about its length costs nothing.
pub(crate) fn is_affordable(steps: u64, covered: u64, run: &RunManifest) -> bool {
    steps <= covered.saturating_mul(TIMES_COVERED).saturating_add(MOST_BEYOND / run.physics.beads)
}

/// Beginning of a recording that does not begin with the run, or that continues another one.
#[derive(Debug, Clone, PartialEq)]
pub enum Follows {
    /// Its first state follows from the last state of the part before, or from the initial condition.
    Proven,
    /// It begins too many steps later to be computed.
    TooFar,
    /// The hashes agree; nothing can be recomputed.
    ByHash,
    /// It does not follow.
    Not(String),
    /// The caller asked to stop before the answer was known.
    Stopped,
    /// Its first state does not follow from the last state of the part before, or from the initial condition.
    Differs(Difference),
}

impl Follows {
    /// True if the beginning is proven.
    pub fn is_proven(&self) -> bool {
        *self == Self::Proven
    }
}

/// True if the first state of the recording `found` follows from the manifest's initial condition; none if it has no
/// state, or nothing can be recomputed. `stop` ends the computation, which is bounded by the steps that the file
/// covers.
pub fn follows_the_run(found: &Verification, stop: &AtomicBool) -> Option<Follows> {
    let run = &found.manifest;
    let (first, last) = (found.first.as_ref()?, found.last.as_ref()?);
    check_kernel(run).ok()?;
    if !is_affordable(first.step, last.step - first.step, run) {
        return Some(Follows::TooFar);
    }
    let mut state = ChainState::initial(&run.physics);
    let mut integrator = Integrator::new(&run.physics);
    if !advance(&mut integrator, &mut state, first.step, stop) {
        return Some(Follows::Stopped);
    }
    let frame = first.as_frame(run, run.frame_at(first.step));
    Some(difference(&state, &frame, None).map_or(Follows::Proven, Follows::Differs))
}

/// True if the recording `next` is the part that follows `before`. `stop` ends the computation.
pub fn follows(before: &Verification, next: &Verification, stop: &AtomicBool) -> Follows {
    let (run, other) = (&before.manifest, &next.manifest);
    if run.provenance.run_id != other.provenance.run_id || run.physics != other.physics {
        return Follows::Not("it is a part of another run".to_owned());
    }
    let BeginRecord { part, previous_state_hash, .. } = &next.begin;
    if before.begin.part.checked_add(1) != Some(*part) {
        return Follows::Not(format!("part {part} does not follow part {}", before.begin.part));
    }
    let (Some(last), Some(first)) = (&before.last, &next.first) else {
        return Follows::Not("one of the two parts has no state".to_owned());
    };
    if before.last_state_hash != *previous_state_hash {
        let said = previous_state_hash.as_deref().unwrap_or("none");
        let found = before.last_state_hash.as_deref().unwrap_or("none");
        return Follows::Not(format!("it follows a state of hash {said}, the part before ends with {found}"));
    }
    if first.step <= last.step {
        let (first, last) = (first.step, last.step);
        return Follows::Not(format!("it begins with step {first}, the part before ends with step {last}"));
    }
    if before.end != EndReason::Continued {
        return Follows::Not(format!("the part before does not go on: it ends `{}`", before.end));
    }
    let every = run.provenance.record_every_steps;
    let due = (last.step / every + 1).saturating_mul(every);
    if due < first.step {
        let (last, first) = (last.step, first.step);
        return Follows::Not(format!(
            "states are missing between step {last} and step {first}, from {due} on"
        ));
    }
    if check_kernel(run).is_err() {
        return Follows::ByHash;
    }
    let mut state = last.clone();
    let mut integrator = Integrator::new(&run.physics);
    if !advance(&mut integrator, &mut state, first.step, stop) {
        return Follows::Stopped;
    }
    let frame = first.as_frame(run, run.frame_at(first.step));
    difference(&state, &frame, Some(last.step)).map_or(Follows::Proven, Follows::Differs)
}
