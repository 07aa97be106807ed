//! The one path of a frame: advance → publish → record.

mod together;

use crate::growth::{Growth, Lost};
use crate::integrator::Integrator;
use crate::state::ChainState;
use schemas::frame::{Active, EndReason, Frame, FrameSink};
use schemas::manifest::{Physics, RunManifest};
use schemas::summary::Drift;
use std::error::Error;
use std::ops::ControlFlow;
pub use together::Together;

/// Most steps, and steps of a bead, between two frames that are looked at, where nobody needs those between: some 10 ms.
const MOST_STEPS: u64 = 1000;
const MOST_BEAD_STEPS: u64 = 10_000_000;

/// Result of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RunOutcome {
    /// [`EndReason::Complete`] or, when the conductor ended it early, [`EndReason::Interrupted`].
    pub reason: EndReason,
    /// Frames published; with those that were left out, if nobody heard them.
    pub published_count: u64,
    /// Frames recorded; only the new ones if the run was resumed.
    pub recorded_count: u64,
    /// The last step reached.
    pub last_step: u64,
    /// ΔE/E of the last state ([`Drift`]).
    pub relative_drift: f64,
    /// The time from which on the last places of the run's numbers decide where beads are, if the conductor watches
    /// for it.
    pub lost: Option<Lost>,
    /// The largest ω·dt of a bead between its neighbours, if the conductor watches for it.
    pub stiffest_step: Option<f64>,
}

/// Why a run could not go on. Frames published and recorded before stay valid.
#[derive(Debug, thiserror::Error)]
pub enum RunError<P: Error + 'static, R: Error + 'static> {
    /// The publisher refused a frame.
    #[error("frame {frame} could not be published")]
    Publish {
        /// The frame.
        frame: u64,
        /// The publisher's error.
        source: P,
    },
    /// The recorder refused a frame.
    #[error("frame {frame} could not be recorded")]
    Record {
        /// The frame.
        frame: u64,
        /// The recorder's error.
        source: R,
    },
    /// The dynamics left the range of doubles.
    #[error("bead {bead} is not finite at step {step} (u = {u_m} m, v = {v_m_s} m/s): {why}")]
    NonFinite {
        /// The step.
        step: u64,
        /// The first such bead.
        bead: usize,
        /// Its displacement (m).
        u_m: f64,
        /// Its velocity (m/s).
        v_m_s: f64,
        /// The likely reason, and what to do ([`Physics::why_not_finite`]).
        why: &'static str,
    },
}

/// A conductor acts between frames and steps of a run: progress, pacing, a request to stop.
pub trait Conductor<P: FrameSink, R> {
    /// Called after each frame has been published (and recorded, if it was due); may take its time.
    /// `Break` ends the run early, with this frame as its last.
    fn after_frame(
        &mut self,
        frame: &Frame<'_>,
        publisher: &mut P,
        recorder: Option<&mut R>,
    ) -> ControlFlow<()>;

    /// True if somebody needs the frames that are not recorded. If nobody does, most of them are left out, since several steps at once are
    /// faster.
    fn hears_every_frame(&self, _publisher: &P) -> bool {
        true
    }

    /// Called between frames, from time to time, if there are steps between them. `Break` ends the run early,
    /// with the frame before as its last.
    fn between_steps(&mut self, _publisher: &mut P) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    /// True if the run is to be watched for chaos ([`Growth`]).
    fn watches_growth(&self) -> bool {
        false
    }

    /// True if the publisher refused a frame because the run is to end, which is no error.
    fn is_stop(&self, _error: &P::Error) -> bool {
        false
    }
}

/// Simulates `manifest`'s run, publishing each frame and recording those that are due.
///
/// When the run ends early its last frame is recorded too, so that a recording always ends with the
/// last state that anybody may have seen. Neither sink is closed.
///
/// # Errors
/// When a sink refuses a frame or a state is not finite.
pub fn run<P: FrameSink, R: FrameSink>(
    manifest: &RunManifest,
    publisher: &mut P,
    recorder: Option<&mut R>,
    conductor: &mut impl Conductor<P, R>,
) -> Result<RunOutcome, RunError<P::Error, R::Error>> {
    simulate(manifest, ChainState::initial(&manifest.physics), true, publisher, recorder, conductor)
}

/// Goes on with `manifest`'s run after `state`, a frame that was published before and recorded, if it was due.
/// Everything else is as in [`run`].
///
/// # Errors
/// As [`run`].
pub fn resume<P: FrameSink, R: FrameSink>(
    manifest: &RunManifest,
    state: ChainState,
    publisher: &mut P,
    recorder: Option<&mut R>,
    conductor: &mut impl Conductor<P, R>,
) -> Result<RunOutcome, RunError<P::Error, R::Error>> {
    simulate(manifest, state, false, publisher, recorder, conductor)
}

/// Simulates the run from `state` on. `state` is the first frame if it is `fresh`, else the frame before.
fn simulate<P: FrameSink, R: FrameSink>(
    manifest: &RunManifest,
    state: ChainState,
    fresh: bool,
    publisher: &mut P,
    recorder: Option<&mut R>,
    conductor: &mut impl Conductor<P, R>,
) -> Result<RunOutcome, RunError<P::Error, R::Error>> {
    let mut growth = if conductor.watches_growth() { Growth::of(&manifest.physics, &state) } else { None };
    let mut simulation = Simulation::new(Job { manifest, publisher, recorder, conductor }, state, fresh);
    let mut integrator = Integrator::new(&manifest.physics);
    let outcome = simulation.finish(&mut integrator, &mut growth)?;
    let stiffest_step = growth.as_ref().map(Growth::stiffest_step);
    Ok(RunOutcome { lost: growth.and_then(|growth| growth.lost()), stiffest_step, ..outcome })
}

/// A run to be made, and all who take part in it.
#[derive(Debug)]
pub struct Job<'a, P, R, C> {
    /// The run.
    pub manifest: &'a RunManifest,
    /// Gets each frame.
    pub publisher: &'a mut P,
    /// Gets the frames that are recorded.
    pub recorder: Option<&'a mut R>,
    /// Acts between frames.
    pub conductor: &'a mut C,
}

/// The outcome of a run, or the reason why it could not go on.
type Ended<P, R> = Result<RunOutcome, RunError<<P as FrameSink>::Error, <R as FrameSink>::Error>>;

/// A run under way: it looks at some of its states, whoever computes them.
struct Simulation<'a, P, R, C> {
    manifest: &'a RunManifest,
    publisher: &'a mut P,
    recording: Recording<'a, R>,
    conductor: &'a mut C,
    state: ChainState,
    /// The number of the frame that is to be looked at next, and of the first one.
    number: u64,
    first: u64,
    /// The step of that frame.
    next: u64,
    /// True if that frame has not been seen before.
    fresh: bool,
    /// Frames from one to the next if nobody hears those between.
    stride: u64,
    /// The last frame, once there are steps between frames, after which it is gone.
    last_looked_at: Option<ChainState>,
}

impl<'a, P: FrameSink, R: FrameSink, C: Conductor<P, R>> Simulation<'a, P, R, C> {
    fn new(job: Job<'a, P, R, C>, state: ChainState, fresh: bool) -> Self {
        let Job { manifest, publisher, recorder, conductor } = job;
        let number = manifest.frame_at(state.step);
        let last_frame = (!fresh && manifest.is_recorded(state.step)).then_some(number);
        Self {
            manifest,
            publisher,
            recording: Recording { recorder, count: 0, last_frame },
            conductor,
            number,
            first: if fresh { number } else { number + 1 },
            next: state.step,
            fresh,
            stride: stride(manifest),
            last_looked_at: None,
            state,
        }
    }

    /// All who took part.
    fn into_job(self) -> Job<'a, P, R, C> {
        let Self { manifest, publisher, recording: Recording { recorder, .. }, conductor, .. } = self;
        Job { manifest, publisher, recorder, conductor }
    }

    /// True if the state that has been reached is to be looked at.
    fn is_there(&self) -> bool {
        self.state.step == self.next
    }

    /// Steps to the next state that is to be looked at.
    fn steps_to_next(&self) -> u64 {
        self.next - self.state.step
    }

    /// True if the conductor ends the run between frames.
    fn is_stopped(&mut self) -> bool {
        self.conductor.between_steps(self.publisher).is_break()
    }

    /// Has all look at the state that has been reached; gives the outcome if the run ends there.
    fn look(
        &mut self,
        active: Option<Active>,
    ) -> Result<ControlFlow<RunOutcome>, RunError<P::Error, R::Error>> {
        let Self { manifest, publisher, recording, conductor, state, number, .. } = self;
        let frame = Frame { active, ..state.as_frame(manifest, *number) };
        let mut go_on = ControlFlow::Continue(());
        if self.fresh {
            match publisher.accept(&frame) {
                Ok(()) => {}
                Err(error) if conductor.is_stop(&error) => {
                    // some consumers may have got it
                    recording.take(&frame)?;
                    return Ok(ControlFlow::Break(self.outcome(EndReason::Interrupted, self.number)));
                }
                Err(source) => return Err(RunError::Publish { frame: *number, source }),
            }
            if manifest.is_recorded(frame.step) {
                recording.take(&frame)?;
            }
            go_on = conductor.after_frame(&frame, publisher, recording.recorder.as_deref_mut());
        }
        self.fresh = true;
        if state.step == manifest.physics.step_count {
            return Ok(ControlFlow::Break(self.outcome(EndReason::Complete, self.number + 1)));
        }
        if go_on.is_break() {
            recording.take(&frame)?;
            return Ok(ControlFlow::Break(self.outcome(EndReason::Interrupted, self.number + 1)));
        }
        let stride = if conductor.hears_every_frame(publisher) { 1 } else { self.stride };
        self.number = ((*number / stride + 1) * stride).min(manifest.frame_count() - 1); // integers
        self.next = manifest.step_of_frame(self.number);
        if self.next > frame.step + 1 {
            match &mut self.last_looked_at {
                Some(last) => last.copy_from(&frame),
                last => *last = Some(ChainState::of_frame(&frame)),
            }
        }
        Ok(ControlFlow::Continue(()))
    }

    /// Ends with the frame before the state that has been reached.
    fn give_up(&mut self) -> Ended<P, R> {
        // there are steps between frames, so there is a copy
        self.state = self.last_looked_at.take().unwrap_or_else(|| self.state.clone());
        let number = self.manifest.frame_at(self.state.step);
        self.recording.take(&self.state.as_frame(self.manifest, number))?;
        Ok(self.outcome(EndReason::Interrupted, number + 1))
    }

    /// Refuses the state that has been reached if bead `found` is not finite.
    fn check(&self, found: Option<usize>) -> Result<(), RunError<P::Error, R::Error>> {
        let Some(bead) = found else { return Ok(()) };
        let (u_m, v_m_s) = (self.state.u_m[bead], self.state.v_m_s[bead]);
        Err(RunError::NonFinite {
            step: self.state.step,
            bead,
            u_m,
            v_m_s,
            why: self.manifest.physics.why_not_finite(),
        })
    }

    /// Makes the rest of the run.
    fn finish(&mut self, integrator: &mut Integrator, growth: &mut Option<Growth>) -> Ended<P, R> {
        loop {
            if self.is_there() {
                self.check(integrator.first_non_finite(&self.state))?;
                if let ControlFlow::Break(outcome) = self.look(integrator.active(&self.state))? {
                    return Ok(outcome);
                }
            } else if self.is_stopped() {
                return self.give_up();
            }
            let watched = growth.as_ref().map_or(self.next, |growth| growth.next_before(self.next));
            integrator.advance(&mut self.state, watched);
            if let Some(growth) = growth {
                growth.look(&self.state, integrator.active(&self.state));
            }
        }
    }

    /// The outcome of frames up to number `end`, and of the present state.
    fn outcome(&self, reason: EndReason, end: u64) -> RunOutcome {
        RunOutcome {
            reason,
            published_count: end - self.first,
            recorded_count: self.recording.count,
            last_step: self.state.step,
            relative_drift: drift(&self.manifest.physics, &self.state),
            lost: None,
            stiffest_step: None,
        }
    }
}

/// The most frames, of those to the next recorded one, by which all recorded ones are reached, and after which progress is shown and stops are
/// noticed soon.
fn stride(manifest: &RunManifest) -> u64 {
    let stream = &manifest.provenance;
    let recorded = stream.record_every_steps / stream.publish_every_steps;
    let steps = (MOST_BEAD_STEPS / manifest.physics.beads).min(MOST_STEPS); // integers
    let most = recorded.min(steps / stream.publish_every_steps); // integers
    (1..=most).rev().find(|frames| recorded.is_multiple_of(*frames)).unwrap_or(1)
}

/// ΔE/E of `state`.
fn drift(physics: &Physics, state: &ChainState) -> f64 {
    let chain = physics.chain();
    let energy = chain.energy(&state.u_m, &state.v_m_s, &state.extra, &mut vec![0.0; chain.contact_count()]);
    let kept_j = energy.total_j() + physics.dissipated_j(&state.extra);
    Drift::new(physics, &chain).of(kept_j, physics.driven_j(&state.extra), &state.v_m_s)
}

/// The recorder, if there is one, and its progress.
struct Recording<'a, R> {
    recorder: Option<&'a mut R>,
    count: u64,
    last_frame: Option<u64>,
}

impl<R: FrameSink> Recording<'_, R> {
    /// Records `frame` unless it was the last one recorded.
    fn take<P: Error>(&mut self, frame: &Frame<'_>) -> Result<(), RunError<P, R::Error>> {
        let Some(recorder) = self.recorder.as_deref_mut() else { return Ok(()) };
        if self.last_frame == Some(frame.frame) {
            return Ok(());
        }
        recorder.accept(frame).map_err(|source| RunError::Record { frame: frame.frame, source })?;
        self.count += 1;
        self.last_frame = Some(frame.frame);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::config::StreamConfig;
    use schemas::manifest::Origin;
    use schemas::method::Method;
    use schemas::presets::PRESETS;
    use std::convert::Infallible;

    #[derive(Default)]
    struct Steps(Vec<u64>);

    impl FrameSink for Steps {
        type Error = Infallible;

        fn accept(&mut self, frame: &Frame<'_>) -> Result<(), Infallible> {
            self.0.push(frame.step);
            Ok(())
        }
    }

    /// Ends the run after the frame of a given number.
    struct StopAfter(u64);

    impl<P: FrameSink, R> Conductor<P, R> for StopAfter {
        fn after_frame(&mut self, frame: &Frame<'_>, _: &mut P, _: Option<&mut R>) -> ControlFlow<()> {
            if frame.frame >= self.0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        }
    }

    fn manifest() -> RunManifest {
        let mut config = PRESETS[2].config();
        config.stream = StreamConfig { publish_every_steps: 2, record_every_steps: 6 };
        // makes one step at a time, so that there is something between frames
        config.integrator.method = Method::Gear5;
        config.time.dt_s = Some(1e-6);
        config.time.duration_s = 15e-6;
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        RunManifest::new(&config, "run", origin).expect("valid")
    }

    fn conduct(conductor: &mut impl Conductor<Steps, Steps>) -> (Vec<u64>, Vec<u64>, RunOutcome) {
        let (mut publisher, mut recorder) = (Steps::default(), Steps::default());
        let outcome = run(&manifest(), &mut publisher, Some(&mut recorder), conductor).expect("runs");
        assert_eq!(outcome.published_count, publisher.0.len() as u64);
        assert_eq!(outcome.recorded_count, recorder.0.len() as u64);
        (publisher.0, recorder.0, outcome)
    }

    fn steps(stop_after: u64) -> (Vec<u64>, Vec<u64>, RunOutcome) {
        conduct(&mut StopAfter(stop_after))
    }

    #[test]
    fn frames_go_out_on_schedule_and_end_with_the_last_step() {
        let (published, recorded, outcome) = steps(u64::MAX);
        assert_eq!(published, [0, 2, 4, 6, 8, 10, 12, 14, 15]);
        assert_eq!(recorded, [0, 6, 12, 15]);
        assert_eq!((outcome.reason, outcome.last_step), (EndReason::Complete, 15));
    }

    #[test]
    fn an_interrupted_run_records_the_last_published_frame() {
        let (published, recorded, outcome) = steps(2);
        assert_eq!(published, [0, 2, 4]);
        assert_eq!(recorded, [0, 4]);
        assert_eq!((outcome.reason, outcome.last_step), (EndReason::Interrupted, 4));
    }

    /// Hears frames up to a step, and then those that are recorded.
    struct HearsUntil(u64, u64);

    impl<P: FrameSink, R> Conductor<P, R> for HearsUntil {
        fn after_frame(&mut self, frame: &Frame<'_>, _: &mut P, _: Option<&mut R>) -> ControlFlow<()> {
            self.1 = frame.step;
            ControlFlow::Continue(())
        }

        fn hears_every_frame(&self, _: &P) -> bool {
            self.1 < self.0
        }
    }

    #[test]
    fn frames_that_nobody_hears_are_left_out() {
        let conduct = |until| {
            let (mut published, mut recorded) = (Steps::default(), Steps::default());
            let outcome = run(&manifest(), &mut published, Some(&mut recorded), &mut HearsUntil(until, 0));
            (published.0, recorded.0, outcome.expect("runs"))
        };
        for (until, heard) in [(0, vec![0, 6, 12, 15]), (4, vec![0, 2, 4, 6, 12, 15])] {
            let (published, recorded, outcome) = conduct(until);
            assert_eq!((published, recorded), (heard, vec![0, 6, 12, 15]));
            assert_eq!(outcome, steps(u64::MAX).2, "the same bits");
        }
        let mut manifest = manifest();
        for (published, recorded, frames) in
            [(1, 100, 100), (1, 7000, 1000), (3, 3 * 1009, 1), (2, 4000, 500), (5000, 10_000, 1)]
        {
            manifest.provenance.publish_every_steps = published;
            manifest.provenance.record_every_steps = recorded;
            assert_eq!(stride(&manifest), frames, "{published}, {recorded}");
        }
    }

    /// Ends the run after this many unpublished steps.
    struct StopBetween(u64);

    impl<P: FrameSink, R> Conductor<P, R> for StopBetween {
        fn after_frame(&mut self, _: &Frame<'_>, _: &mut P, _: Option<&mut R>) -> ControlFlow<()> {
            ControlFlow::Continue(())
        }

        fn between_steps(&mut self, _: &mut P) -> ControlFlow<()> {
            self.0 -= 1;
            if self.0 == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        }
    }

    /// A frame that takes long to compute does not hold up the end of a run, and the frame before it is
    /// the last one recorded, with the bits that were published.
    #[test]
    fn a_stop_between_frames_ends_with_the_frame_before() {
        let (published, recorded, outcome) = conduct(&mut StopBetween(3));
        assert_eq!(published, [0, 2, 4]);
        assert_eq!(recorded, [0, 4]);
        assert_eq!((outcome.reason, outcome.last_step), (EndReason::Interrupted, 4));
    }

    /// A publisher that is told to stop while a consumer holds it back has perhaps delivered the frame to
    /// others: it is recorded.
    #[test]
    fn a_stop_while_publishing_records_the_frame_in_hand() {
        struct Full;
        #[derive(Debug, thiserror::Error)]
        #[error("stopped")]
        struct Stopped;
        impl FrameSink for Full {
            type Error = Stopped;
            fn accept(&mut self, frame: &Frame<'_>) -> Result<(), Stopped> {
                if frame.frame == 2 { Err(Stopped) } else { Ok(()) }
            }
        }
        struct Obeys;
        impl<R> Conductor<Full, R> for Obeys {
            fn after_frame(&mut self, _: &Frame<'_>, _: &mut Full, _: Option<&mut R>) -> ControlFlow<()> {
                ControlFlow::Continue(())
            }
            fn is_stop(&self, _: &Stopped) -> bool {
                true
            }
        }
        let mut recorder = Steps::default();
        let outcome = run(&manifest(), &mut Full, Some(&mut recorder), &mut Obeys).expect("no error");
        assert_eq!((outcome.reason, outcome.published_count), (EndReason::Interrupted, 2));
        assert_eq!(recorder.0, [0, 4]);
    }

    /// The steps published and recorded after frame `number`, until `conductor` ends the run.
    fn resumed(
        number: u64,
        conductor: &mut impl Conductor<Steps, Steps>,
    ) -> (Vec<u64>, Vec<u64>, RunOutcome) {
        let manifest = manifest();
        let (mut publisher, mut recorder) = (Steps::default(), Steps::default());
        let mut state = ChainState::initial(&manifest.physics);
        let mut integrator = Integrator::new(&manifest.physics);
        while state.step < manifest.step_of_frame(number) {
            integrator.step(&mut state);
        }
        let outcome = resume(&manifest, state, &mut publisher, Some(&mut recorder), conductor).expect("runs");
        assert_eq!(outcome.published_count, publisher.0.len() as u64);
        (publisher.0, recorder.0, outcome)
    }

    #[test]
    fn a_resumed_run_publishes_and_records_what_is_left() {
        let (published, recorded, outcome) = resumed(2, &mut StopAfter(u64::MAX));
        assert_eq!(published, [6, 8, 10, 12, 14, 15]);
        assert_eq!(recorded, [6, 12, 15]);
        assert_eq!((outcome.reason, outcome.last_step), (EndReason::Complete, 15));
        assert_eq!(outcome.relative_drift, steps(u64::MAX).2.relative_drift, "the same bits");
        let (published, recorded, outcome) = resumed(8, &mut StopAfter(0));
        assert_eq!((published, recorded), (vec![], vec![]));
        assert_eq!((outcome.reason, outcome.last_step), (EndReason::Complete, 15));
    }

    /// A run that is stopped before its first new frame ends with the frame that it began with, which is recorded
    /// unless it was recorded before.
    #[test]
    fn a_resumed_run_that_is_stopped_at_once_ends_where_it_began() {
        for (number, expected) in [(2, vec![4]), (3, vec![])] {
            let (published, recorded, outcome) = resumed(number, &mut StopBetween(1));
            assert_eq!((published, recorded), (vec![], expected));
            assert_eq!((outcome.reason, outcome.last_step), (EndReason::Interrupted, 2 * number));
        }
    }

    /// A stop at the last frame changes nothing: the run is complete.
    #[test]
    fn a_stop_at_the_last_frame_leaves_the_run_complete() {
        let (published, recorded, outcome) = steps(8);
        assert_eq!((published.len(), recorded.len()), (9, 4));
        assert_eq!(outcome.reason, EndReason::Complete);
    }
}
