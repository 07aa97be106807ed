//! Recomputes steps that a source does not hold: those between recorded states, the frames before one
//! attached, the frames that were missed.
//!
//! A step is a pure function of the state before. So every state that a source delivers is the beginning of all that
//! follow, and proves all states computed since the one before.

mod parallel;

pub use parallel::{ParallelError, ParallelResimulation};

use crate::integrator::Integrator;
use crate::state::ChainState;
use schemas::frame::{EndReason, Frame, FrameSource, Received};
use schemas::manifest::{KERNEL_VERSIONS, RunManifest};
use schemas::method::{Feature, Method};
use serde::{Serialize, Serializer};
use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// States that a [`Resimulation`] lends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Lend {
    /// Every frame of the run.
    Frames,
    /// Every step of the run, also between frames.
    Steps,
}

impl Lend {
    /// True if the state of `step` is one of them.
    fn includes(self, step: u64, manifest: &RunManifest) -> bool {
        self == Self::Steps || manifest.is_frame(step)
    }

    /// The first of them after `step`, or `last` if that comes before it.
    fn next(self, step: u64, last: u64, manifest: &RunManifest) -> u64 {
        let next = match self {
            Self::Steps => step + 1,
            Self::Frames => manifest.step_of_frame(manifest.frame_at(step) + 1),
        };
        if next < last { next } else { last }
    }
}

/// A source that recomputes the states that its own source lacks.
///
/// It fills gaps from the state before them. It also fills the gap at the end, unless it is
/// [`ending_with_the_last_state`](Self::ending_with_the_last_state), and with [`Resimulation::from_start`] the frames
/// before the first; without it these stay missing. It compares each state of its source bit for bit with the computed
/// one.
#[derive(Debug)]
pub struct Resimulation<S> {
    source: S,
    lend: Lend,
    /// The first step that may be lent.
    first_step: u64,
    integrator: Integrator,
    /// The state lent last, none before the first.
    state: Option<ChainState>,
    /// The step of the last state that the source delivered.
    proven: Option<u64>,
    /// The state that the source has delivered and that is not lent yet.
    target: ChainState,
    next: Next,
    /// The frames that were missed since the last state.
    missed: Option<(u64, u64)>,
    /// True if nothing is recomputed after the last state.
    ends_with_last_state: bool,
    /// Ends the source when it is set.
    stop: Option<Arc<AtomicBool>>,
}

#[derive(Debug, Clone, Copy)]
enum Next {
    Unknown,
    /// Frames that cannot be computed or proven; then the end, if known.
    Missed {
        from: u64,
        to: u64,
        then: Option<EndReason>,
    },
    /// Steps up to the state that was delivered.
    Target,
    /// Steps up to the last frame that was missed, then the end.
    Tail(EndReason),
    End(EndReason),
}

/// Quantity of a bead that a double in a state holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// Displacement (m).
    Displacement,
    /// Velocity (m/s).
    Velocity,
    /// A value that the method carries, by its number.
    Extra(usize),
}

impl Serialize for Quantity {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Displacement => f.write_str("displacement"),
            Self::Velocity => f.write_str("velocity"),
            Self::Extra(number) => write!(f, "extra value {number}"),
        }
    }
}

/// A state that does not follow from the state before it.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error, Serialize)]
#[error(
    "the {quantity} of bead {bead} at step {step} (frame {frame}) is {found:e}, but {from} leads to {computed:e} there: \
     the state was changed, or was not computed by this dynamics",
    from = Origin(*from_step)
)]
pub struct Difference {
    /// The step of the state.
    pub step: u64,
    /// Its frame, or the frame before it.
    pub frame: u64,
    /// The step of the state from which it was computed; none for the initial condition.
    pub from_step: Option<u64>,
    /// The first bead that differs.
    pub bead: usize,
    /// Its quantity.
    pub quantity: Quantity,
    /// The value in the state.
    pub found: f64,
    /// The value computed.
    pub computed: f64,
}

/// Beginning of a computation, for messages.
struct Origin(Option<u64>);

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Some(step) => write!(f, "the state of step {step}"),
            None => f.write_str("the manifest's initial condition"),
        }
    }
}

/// Why states cannot be recomputed.
#[derive(Debug, thiserror::Error)]
pub enum ResimulationError<E: std::error::Error + 'static> {
    /// The source failed.
    #[error(transparent)]
    Source(E),
    /// The source delivered a state that does not follow from the one before.
    #[error(transparent)]
    Differs(Difference),
}

/// A run that this program's dynamics does not reproduce.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "the run was computed by {}: nothing is wrong with it, but its steps can only be recomputed by a Beadline with {}",
    .retired.map_or_else(
        || format!("kernel version {found}, this program has versions {} to {}", KERNEL_VERSIONS.start(), KERNEL_VERSIONS.end()),
        |(method, feature)| format!("{method} with {feature}, which this program does not have any more"),
    ),
    .retired.map_or_else(|| format!("version {found}"), |_| "both".to_owned())
)]
pub struct OtherKernel {
    /// The kernel version of the run.
    pub found: u32,
    /// The method and the feature that it no longer supports, where the version is not the reason.
    retired: Option<(Method, Feature)>,
}

/// Refuses a run that was computed by another dynamics.
///
/// # Errors
/// When it has another kernel version, or a method with a feature that this program no longer supports.
pub fn check_kernel(manifest: &RunManifest) -> Result<(), OtherKernel> {
    let physics = &manifest.physics;
    let (found, retired) = (physics.kernel_version, physics.retired());
    if !KERNEL_VERSIONS.contains(&found) {
        return Err(OtherKernel { found, retired: None });
    }
    match retired {
        Some(feature) => Err(OtherKernel { found, retired: Some((physics.method, feature)) }),
        None => Ok(()),
    }
}

impl<S: FrameSource> Resimulation<S> {
    /// Lends everything from the first state that `source` delivers.
    ///
    /// # Errors
    /// When the run was computed by another dynamics.
    pub fn new(source: S, lend: Lend) -> Result<Self, OtherKernel> {
        check_kernel(source.manifest())?;
        let physics = &source.manifest().physics;
        let (integrator, target) = (Integrator::new(physics), ChainState::initial(physics));
        Ok(Self {
            source,
            lend,
            first_step: 0,
            integrator,
            state: None,
            proven: None,
            target,
            next: Next::Unknown,
            missed: None,
            ends_with_last_state: false,
            stop: None,
        })
    }

    /// Lends everything from step 0, whenever the source begins.
    ///
    /// # Errors
    /// As [`Resimulation::new`].
    pub fn from_start(source: S, lend: Lend) -> Result<Self, OtherKernel> {
        let mut all = Self::new(source, lend)?;
        // the initial state is lent like one of the source's, and the source's is compared with it
        all.next = Next::Target;
        Ok(all)
    }

    /// Lends nothing before step `first_step`: earlier states of the source only serve to compute.
    #[must_use]
    pub fn lending_from(self, first_step: u64) -> Self {
        Self { first_step, ..self }
    }

    /// Computes nothing after the last state that the source delivers. For files: a false claim about the end costs
    /// nothing, and no state proves the claim.
    #[must_use]
    pub fn ending_with_the_last_state(self) -> Self {
        Self { ends_with_last_state: true, ..self }
    }

    /// Ends with [`EndReason::Stopped`] once `stop` is set, also between two states that are far apart.
    #[must_use]
    pub fn stopped_by(self, stop: Arc<AtomicBool>) -> Self {
        Self { stop: Some(stop), ..self }
    }

    /// The source.
    pub fn source(&self) -> &S {
        &self.source
    }

    /// Step of the last state of the source; everything lent up to it is proven.
    pub fn proven_step(&self) -> Option<u64> {
        self.proven
    }

    /// Waits for the next state that the source delivers.
    fn look_ahead(&mut self) -> Result<(), ResimulationError<S::Error>> {
        loop {
            match self.source.receive().map_err(ResimulationError::Source)? {
                Received::Frame(frame) => {
                    self.target.copy_from(&frame);
                    self.missed = None;
                    // the initial state was lent before
                    let Some(state) = self.state.as_ref().filter(|state| state.step == self.target.step)
                    else {
                        self.next = Next::Target;
                        return Ok(());
                    };
                    let found = difference(state, &frame, None);
                    self.prove(found)?;
                }
                Received::Missed { from, to } if self.state.is_none() => {
                    self.next = Next::Missed { from, to, then: None };
                    return Ok(());
                }
                Received::Missed { from, to } => self.missed = Some((from, to)),
                Received::End(reason) => {
                    self.next = match self.missed {
                        Some((from, to)) if self.ends_with_last_state => {
                            Next::Missed { from, to, then: Some(reason) }
                        }
                        _ => Next::Tail(reason),
                    };
                    return Ok(());
                }
            }
        }
    }

    /// Takes the state that the source delivered as proven, unless there is a difference.
    fn prove(&mut self, found: Option<Difference>) -> Result<(), ResimulationError<S::Error>> {
        self.proven = Some(self.target.step);
        // what comes after a state that is wrong is not trusted
        self.next = if found.is_some() { Next::End(EndReason::Unfinished) } else { Next::Unknown };
        found.map_or(Ok(()), |difference| Err(ResimulationError::Differs(difference)))
    }

    /// True if the present state is to be lent.
    fn is_lent(&self) -> bool {
        let step = self.state.as_ref().map_or(0, |state| state.step);
        step >= self.first_step && self.lend.includes(step, self.source.manifest())
    }

    /// Advances towards the target, by no more than to the next state that is lent, and proves the target when it is reached.
    fn advance(&mut self) -> Result<(), ResimulationError<S::Error>> {
        let Some(state) = &mut self.state else {
            self.state = Some(self.target.clone());
            return self.prove(None);
        };
        let manifest = self.source.manifest();
        self.integrator.advance(state, self.lend.next(state.step, self.target.step, manifest));
        if state.step < self.target.step {
            return Ok(());
        }
        let frame = self.target.as_frame(manifest, manifest.frame_at(self.target.step));
        let found = difference(state, &frame, self.proven);
        self.prove(found)
    }
}

impl<S: FrameSource> FrameSource for Resimulation<S> {
    type Error = ResimulationError<S::Error>;

    fn manifest(&self) -> &RunManifest {
        self.source.manifest()
    }

    fn receive(&mut self) -> Result<Received<'_>, Self::Error> {
        loop {
            if self.stop.as_ref().is_some_and(|stop| stop.load(Ordering::Relaxed)) {
                return Ok(Received::End(EndReason::Stopped));
            }
            match self.next {
                Next::Unknown => self.look_ahead()?,
                Next::Missed { from, to, then } => {
                    self.next = then.map_or(Next::Unknown, Next::End);
                    return Ok(Received::Missed { from, to });
                }
                Next::End(reason) => return Ok(Received::End(reason)),
                Next::Tail(reason) => {
                    let manifest = self.source.manifest();
                    let until = self.missed.map_or(0, |(_, to)| manifest.step_of_frame(to));
                    match &mut self.state {
                        Some(state) if state.step < until => {
                            self.integrator.advance(state, self.lend.next(state.step, until, manifest));
                            if self.is_lent() {
                                break;
                            }
                        }
                        _ => self.next = Next::End(reason),
                    }
                }
                Next::Target => {
                    self.advance()?;
                    if self.is_lent() {
                        break;
                    }
                }
            }
        }
        let manifest = self.source.manifest();
        let state = self.state.as_ref().unwrap_or(&self.target);
        let frame = state.as_frame(manifest, manifest.frame_at(state.step));
        Ok(Received::Frame(Frame { active: self.integrator.active(state), ..frame }))
    }
}

/// True if no bit differs. Compares all values: with vectors this is faster than a search for the first difference.
fn is_same(a: &[f64], b: &[f64]) -> bool {
    a.iter().zip(b).fold(
        0,
        #[inline(always)]
        |bits, (a, b)| bits | (a.to_bits() ^ b.to_bits()),
    ) == 0
}

/// The first double of `found` that differs from `computed`, a state computed from that of `from_step`.
pub fn difference(computed: &ChainState, found: &Frame<'_>, from_step: Option<u64>) -> Option<Difference> {
    let beads = computed.u_m.len();
    let arrays = [(&computed.u_m, found.u_m), (&computed.v_m_s, found.v_m_s), (&computed.extra, found.extra)];
    for (array, (computed, values)) in arrays.into_iter().enumerate() {
        if is_same(computed, values) {
            continue;
        }
        let differs = |(a, b): (&f64, &f64)| a.to_bits() != b.to_bits();
        if let Some(i) = computed.iter().zip(values).position(differs) {
            let quantity = match array {
                0 => Quantity::Displacement,
                1 => Quantity::Velocity,
                _ => Quantity::Extra(i / beads),
            };
            return Some(Difference {
                step: found.step,
                frame: found.frame,
                from_step,
                bead: i % beads,
                quantity,
                found: values[i],
                computed: computed[i],
            });
        }
    }
    None
}

#[cfg(test)]
mod tests;
