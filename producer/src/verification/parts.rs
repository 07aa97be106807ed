//! Parts of one recording, one after the other.

use super::Verification;
use crate::integrator::Integrator;
use crate::resimulation::{Difference, check_kernel, difference};
use schemas::recording::BeginRecord;

/// How a recording goes on in another one.
#[derive(Debug, Clone, PartialEq)]
pub enum Follows {
    /// Its first state is what the last state of the part before leads to.
    Proven,
    /// As far as hashes tell; nothing can be recomputed.
    ByHash,
    /// It does not.
    Not(String),
    /// Its first state is not what the last state of the part before leads to.
    Differs(Difference),
}

impl Follows {
    /// Whether that is proven.
    pub fn is_proven(&self) -> bool {
        *self == Self::Proven
    }
}

/// Whether the recording `next` is the part that follows `before`.
pub fn follows(before: &Verification, next: &Verification) -> Follows {
    let (run, other) = (&before.manifest, &next.manifest);
    if run.provenance.run_id != other.provenance.run_id || run.physics != other.physics {
        return Follows::Not("it is a part of another run".to_owned());
    }
    let BeginRecord { part, previous_state_hash, .. } = &next.begin;
    if *part != before.begin.part + 1 {
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
    if check_kernel(run).is_err() {
        return Follows::ByHash;
    }
    let mut state = last.clone();
    let mut integrator = Integrator::new(&run.physics);
    while state.step < first.step {
        integrator.step(&mut state);
    }
    let frame = first.as_frame(run, run.frame_at(first.step));
    difference(&state, &frame, Some(last.step)).map_or(Follows::Proven, Follows::Differs)
}
