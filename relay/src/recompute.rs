//! From one state that arrived to the next: every frame between, proven before anybody sees it.

use producer::integrator::Integrator;
use producer::resimulation::{Difference, OtherKernel, check_kernel, difference};
use producer::state::ChainState;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;

/// Most bytes of frames that wait for their proof; later ones are computed a second time.
const MOST_WAITING_BYTES: usize = 64 << 20;

/// Who gets the frames.
pub trait Proven {
    /// What goes wrong there.
    type Error: std::error::Error + 'static;

    /// Takes the next frame, which is proven.
    ///
    /// # Errors
    /// When it does not go on.
    fn accept(&mut self, frame: &Frame<'_>) -> Result<(), Self::Error>;

    /// Is called after each frame that is computed.
    ///
    /// # Errors
    /// When it does not go on.
    fn between(&mut self) -> Result<(), Self::Error>;
}

/// Why frames were not published.
#[derive(Debug, thiserror::Error)]
pub enum RecomputeError<E: std::error::Error + 'static> {
    /// A state does not follow from the one before.
    #[error(transparent)]
    Differs(Difference),
    /// Whoever takes the frames.
    #[error(transparent)]
    Sink(#[from] E),
}

/// The last proven state of a run, and what it leads to.
pub struct Recompute {
    manifest: RunManifest,
    proven: ChainState,
    /// Stands at `proven`; none if that did not come from it.
    integrator: Option<Integrator>,
    /// Frames that wait for their proof, `[u | v | extra]` of each.
    waiting: Vec<f64>,
    most_waiting: usize,
}

impl Recompute {
    /// Begins with a state that arrived.
    ///
    /// # Errors
    /// When the run was computed by another dynamics.
    pub fn begin(manifest: &RunManifest, first: &Frame<'_>) -> Result<Self, OtherKernel> {
        check_kernel(manifest)?;
        Ok(Self {
            manifest: manifest.clone(),
            proven: ChainState::of_frame(first),
            integrator: None,
            waiting: Vec::new(),
            most_waiting: MOST_WAITING_BYTES / size_of::<f64>(),
        })
    }

    /// How the first state of a run differs from the manifest's initial condition.
    pub fn initial_difference(&self) -> Option<Difference> {
        let initial = (self.proven.step == 0).then(|| ChainState::initial(&self.manifest.physics))?;
        difference(&initial, &self.proven.as_frame(&self.manifest, 0), None)
    }

    /// Goes on from a frame that arrived and was published as it is.
    pub fn believe(&mut self, frame: &Frame<'_>) {
        self.proven.copy_from(frame);
        self.integrator = None;
    }

    /// Computes all frames up to that of `target`, compares, and only then gives them away.
    ///
    /// # Errors
    /// When the computed state has other bits: then nobody got any of these frames.
    pub fn reach<P: Proven>(
        &mut self,
        target: &Frame<'_>,
        sink: &mut P,
    ) -> Result<(), RecomputeError<P::Error>> {
        self.publish_up_to(target.frame, Some(target), sink)
    }

    /// Computes all frames up to frame `last`, which no state proves.
    ///
    /// # Errors
    /// When they cannot be given away.
    pub fn run_on<P: Proven>(&mut self, last: u64, sink: &mut P) -> Result<(), RecomputeError<P::Error>> {
        self.publish_up_to(last, None, sink)
    }

    fn publish_up_to<P: Proven>(
        &mut self,
        last: u64,
        target: Option<&Frame<'_>>,
        sink: &mut P,
    ) -> Result<(), RecomputeError<P::Error>> {
        let manifest = &self.manifest;
        let from_step = self.proven.step;
        let first = manifest.frame_at(from_step) + 1;
        let state = &mut self.proven;
        let integrator = self.integrator.get_or_insert_with(|| Integrator::new(&manifest.physics));
        self.waiting.clear();
        for frame in first..=last {
            advance(integrator, state, manifest.step_of_frame(frame));
            if self.waiting.len() < self.most_waiting || frame == first {
                for values in [&state.u_m, &state.v_m_s, &state.extra] {
                    self.waiting.extend_from_slice(values);
                }
            }
            sink.between()?;
        }
        if let Some(found) = target.and_then(|target| difference(state, target, Some(from_step))) {
            return Err(RecomputeError::Differs(found));
        }
        let waiting = (first..).zip(self.waiting.chunks_exact(manifest.frame_doubles()));
        let mut given = None;
        for (frame, doubles) in waiting {
            let step = manifest.step_of_frame(frame);
            let place = (frame, step, manifest.physics.time_s(step));
            let frame = Frame::of_doubles(place, state.u_m.len(), doubles);
            sink.accept(&frame)?;
            given = Some(frame);
        }
        // what had no room is computed once more, now that it is proven
        let Some(given) = given.filter(|given| given.frame < last) else { return Ok(()) };
        let mut again = (ChainState::of_frame(&given), Integrator::new(&manifest.physics));
        for frame in given.frame + 1..=last {
            advance(&mut again.1, &mut again.0, manifest.step_of_frame(frame));
            sink.accept(&again.0.as_frame(manifest, frame))?;
        }
        Ok(())
    }
}

fn advance(integrator: &mut Integrator, state: &mut ChainState, step: u64) {
    while state.step < step {
        integrator.advance(state, step);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use schemas::config::{RunConfig, StreamConfig};
    use schemas::manifest::Origin;
    use schemas::method::Method;
    use schemas::presets::PRESETS;
    use std::convert::Infallible;

    fn manifest(method: Method) -> RunManifest {
        let mut config: RunConfig = PRESETS[0].config();
        config.integrator.method = method;
        config.time.duration_s = 400e-6;
        config.stream = StreamConfig { publish_every_steps: 2, record_every_steps: 2 };
        let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
        RunManifest::new(&config, "run", origin).unwrap()
    }

    /// All frames, one step after the other.
    fn frames(manifest: &RunManifest) -> Vec<ChainState> {
        let mut state = ChainState::initial(&manifest.physics);
        let mut integrator = Integrator::new(&manifest.physics);
        let mut all = vec![state.clone()];
        while state.step < manifest.physics.step_count {
            integrator.step(&mut state);
            if manifest.is_frame(state.step) {
                all.push(state.clone());
            }
        }
        all
    }

    #[derive(Default)]
    struct Taken(Vec<ChainState>);

    impl Proven for Taken {
        type Error = Infallible;

        fn accept(&mut self, frame: &Frame<'_>) -> Result<(), Infallible> {
            self.0.push(ChainState::of_frame(frame));
            Ok(())
        }

        fn between(&mut self) -> Result<(), Infallible> {
            Ok(())
        }
    }

    #[test]
    fn every_frame_between_two_states_comes_once_and_with_its_bits() {
        for method in [Method::Rkn4, Method::Gear5] {
            let manifest = manifest(method);
            let all = frames(&manifest);
            let last = all.len() - 1;
            for most_waiting in [0, 3 * manifest.frame_doubles(), usize::MAX] {
                let mut recompute = Recompute::begin(&manifest, &all[3].as_frame(&manifest, 3)).unwrap();
                recompute.most_waiting = most_waiting;
                let mut taken = Taken::default();
                recompute.reach(&all[40].as_frame(&manifest, 40), &mut taken).unwrap();
                recompute.reach(&all[60].as_frame(&manifest, 60), &mut taken).unwrap();
                recompute.run_on(last as u64, &mut taken).unwrap();
                assert_eq!(taken.0, all[4..], "{method:?}, {most_waiting}");
            }
        }
    }

    #[test]
    fn nobody_sees_a_frame_of_a_window_that_is_not_proven() {
        let manifest = manifest(Method::Rkn4);
        let all = frames(&manifest);
        let mut recompute = Recompute::begin(&manifest, &all[3].as_frame(&manifest, 3)).unwrap();
        let mut wrong = all[40].clone();
        wrong.v_m_s[2] = -wrong.v_m_s[2];
        let mut taken = Taken::default();
        let said = recompute.reach(&wrong.as_frame(&manifest, 40), &mut taken).unwrap_err().to_string();
        assert!(taken.0.is_empty() && said.contains("velocity of bead 2 at step 80"), "{said}");
    }

    #[test]
    fn the_first_state_of_a_run_is_proven_by_its_manifest() {
        let manifest = manifest(Method::Rkn4);
        let mut first = ChainState::initial(&manifest.physics);
        let begin = |first: &ChainState| {
            Recompute::begin(&manifest, &first.as_frame(&manifest, 0)).unwrap().initial_difference()
        };
        assert_eq!(begin(&first), None);
        first.u_m[7] = 1e-9;
        assert_eq!(begin(&first).map(|found| found.bead), Some(7));
    }
}
