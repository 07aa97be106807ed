//! Recomputation of every frame from one state that arrived to the next, in a thread of its own, proven before anybody
//! sees it.

use producer::integrator::Integrator;
use producer::resimulation::{Difference, OtherKernel, check_kernel, difference};
use producer::state::ChainState;
use schemas::frame::Frame;
use schemas::manifest::RunManifest;
use std::panic;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

/// Most bytes of frames in a window. One is filled, one waits, one is published and one is used again; frames that have no
/// room until they are proven are computed a second time.
const MOST_WINDOW_BYTES: usize = 16 << 20;

/// The first frame of a run as it arrived, and the frames that follow from it. It computes in the order of the
/// questions, while earlier frames are published.
pub struct Recompute {
    asks: Sender<Ask>,
    windows: Receiver<Result<Window, Difference>>,
    used: Sender<Vec<f64>>,
    stop: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

/// Successive frames.
#[derive(Debug)]
pub struct Window {
    first: u64,
    doubles: Vec<f64>,
    /// True if a state proves them.
    pub is_proven: bool,
    /// True if nothing is left to be computed.
    pub is_last: bool,
}

impl Window {
    /// Its frames, of the run of `manifest`.
    pub fn frames(&self, manifest: &RunManifest) -> impl Iterator<Item = Frame<'_>> {
        let beads = usize::try_from(manifest.physics.beads).unwrap_or(usize::MAX);
        (self.first..).zip(self.doubles.chunks_exact(manifest.frame_doubles())).map(
            move |(frame, doubles)| {
                let step = manifest.step_of_frame(frame);
                Frame::of_doubles((frame, step, manifest.physics.time_s(step)), beads, doubles)
            },
        )
    }
}

enum Ask {
    /// All frames up to this one, which this state proves, if there is one.
    Reach(u64, Option<ChainState>),
    /// Nothing: the next question goes on from here.
    Believe(ChainState),
}

impl Recompute {
    /// Begins with a frame that arrived.
    ///
    /// # Errors
    /// When the run was computed by another dynamics.
    pub fn begin(manifest: &RunManifest, first: &Frame<'_>) -> Result<Self, OtherKernel> {
        Self::with_windows(manifest, first, MOST_WINDOW_BYTES / size_of::<f64>())
    }

    fn with_windows(
        manifest: &RunManifest,
        first: &Frame<'_>,
        most_doubles: usize,
    ) -> Result<Self, OtherKernel> {
        check_kernel(manifest)?;
        let (asks, asked) = channel();
        let (found, windows) = sync_channel(1);
        let (used, free) = channel();
        let stop = Arc::new(AtomicBool::new(false));
        let mut computing = Computing {
            manifest: manifest.clone(),
            proven: ChainState::of_frame(first),
            integrator: None,
            most_doubles,
            found,
            free,
            stop: Arc::clone(&stop),
        };
        let thread = thread::spawn(move || while asked.recv().is_ok_and(|ask| computing.answer(ask)) {});
        Ok(Self { asks, windows, used, stop, thread: Some(thread) })
    }

    /// Asks for all frames up to `target`, which has arrived.
    pub fn reach(&self, target: &Frame<'_>) {
        self.ask(Ask::Reach(target.frame, Some(ChainState::of_frame(target))));
    }

    /// Asks for all frames up to frame `last`, which no state proves.
    pub fn run_on(&self, last: u64) {
        self.ask(Ask::Reach(last, None));
    }

    /// Goes on from a frame that arrived and was published as it is.
    pub fn believe(&self, frame: &Frame<'_>) {
        self.ask(Ask::Believe(ChainState::of_frame(frame)));
    }

    fn ask(&self, ask: Ask) {
        // a thread that is gone says so where windows are awaited
        let _ = self.asks.send(ask);
    }

    /// The next frames that were asked for, if there are some within this time.
    ///
    /// # Errors
    /// When a state that arrived does not follow from the one before: then nothing more comes.
    pub fn next(&mut self, patience: Duration) -> Result<Option<Window>, Difference> {
        match self.windows.recv_timeout(patience) {
            Ok(found) => found.map(Some),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => {
                if let Some(Err(panicked)) = self.thread.take().map(JoinHandle::join) {
                    panic::resume_unwind(panicked);
                }
                Ok(None)
            }
        }
    }

    /// Takes the memory of a window back.
    pub fn reuse(&self, window: Window) {
        let _ = self.used.send(window.doubles);
    }
}

impl Drop for Recompute {
    /// Nobody waits for the thread, which ends with the frame that it computes.
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
    }
}

/// Difference of the first state of a run from the initial condition of its manifest.
pub fn initial_difference(manifest: &RunManifest, first: &Frame<'_>) -> Option<Difference> {
    let initial = (first.step == 0).then(|| ChainState::initial(&manifest.physics))?;
    difference(&initial, first, None)
}

/// The last proven state of a run, in the thread.
struct Computing {
    manifest: RunManifest,
    proven: ChainState,
    /// Stands at `proven`; none if that did not come from it.
    integrator: Option<Integrator>,
    most_doubles: usize,
    found: SyncSender<Result<Window, Difference>>,
    free: Receiver<Vec<f64>>,
    stop: Arc<AtomicBool>,
}

impl Computing {
    /// Answers a question; false to stop.
    fn answer(&mut self, ask: Ask) -> bool {
        match ask {
            Ask::Reach(last, target) => self.reach(last, target.as_ref()).is_some(),
            Ask::Believe(state) => {
                (self.proven, self.integrator) = (state, None);
                true
            }
        }
    }

    /// Computes all frames up to `last`, compares, and only then gives them away; none if nobody wants more.
    fn reach(&mut self, last: u64, target: Option<&ChainState>) -> Option<()> {
        let Self { manifest, proven, most_doubles, found, free, stop, .. } = self;
        let integrator = self.integrator.get_or_insert_with(|| Integrator::new(&manifest.physics));
        let from_step = proven.step;
        let begin = |first| {
            let mut doubles = free.try_recv().unwrap_or_default();
            doubles.clear();
            Window { first, doubles, is_proven: target.is_some(), is_last: false }
        };
        let next = |integrator: &mut Integrator, state: &mut ChainState, frame| {
            advance(integrator, state, manifest.step_of_frame(frame));
            (!stop.load(Ordering::Relaxed)).then_some(())
        };
        let mut window = begin(manifest.frame_at(from_step) + 1);
        // the last one that had room
        let mut again = None;
        for frame in window.first..=last {
            next(integrator, proven, frame)?;
            if again.is_none() {
                window.push(proven);
                again = (window.doubles.len() >= *most_doubles).then(|| (frame, proven.clone()));
            }
        }
        if let Some(different) =
            target.and_then(|target| difference(proven, &target.as_frame(manifest, last), Some(from_step)))
        {
            let _ = found.send(Err(different));
            return None;
        }
        if let Some((frame, mut state)) = again {
            // the rest is computed once more, now that it is proven
            let mut integrator = Integrator::new(&manifest.physics);
            for frame in frame + 1..=last {
                if window.doubles.len() >= *most_doubles {
                    let full = std::mem::replace(&mut window, begin(frame));
                    found.send(Ok(full)).ok()?;
                }
                next(&mut integrator, &mut state, frame)?;
                window.push(&state);
            }
        }
        found.send(Ok(Window { is_last: true, ..window })).ok()
    }
}

impl Window {
    fn push(&mut self, state: &ChainState) {
        for values in [&state.u_m, &state.v_m_s, &state.extra] {
            self.doubles.extend_from_slice(values);
        }
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

    /// Everything that was asked for, up to the `count`th answer's end.
    fn taken(
        recompute: &mut Recompute,
        manifest: &RunManifest,
        count: usize,
    ) -> Result<Vec<ChainState>, Difference> {
        let (mut all, mut ends) = (Vec::new(), 0);
        while ends < count {
            let Some(window) = recompute.next(Duration::from_secs(1))? else { continue };
            all.extend(window.frames(manifest).map(|frame| ChainState::of_frame(&frame)));
            ends += usize::from(window.is_last);
            recompute.reuse(window);
        }
        Ok(all)
    }

    #[test]
    fn every_frame_between_two_states_comes_once_and_with_its_bits() {
        for method in [Method::Rkn4, Method::Gear5] {
            let manifest = manifest(method);
            let all = frames(&manifest);
            let last = all.len() - 1;
            for most_doubles in [0, 3 * manifest.frame_doubles(), usize::MAX] {
                let first = all[3].as_frame(&manifest, 3);
                let mut recompute = Recompute::with_windows(&manifest, &first, most_doubles).unwrap();
                recompute.reach(&all[40].as_frame(&manifest, 40));
                recompute.reach(&all[60].as_frame(&manifest, 60));
                recompute.run_on(last as u64);
                let found = taken(&mut recompute, &manifest, 3).unwrap();
                assert_eq!(found, all[4..], "{method:?}, {most_doubles}");
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
        recompute.reach(&wrong.as_frame(&manifest, 40));
        let said = taken(&mut recompute, &manifest, 1).unwrap_err().to_string();
        assert!(said.contains("velocity of bead 2 at step 80"), "{said}");
    }

    #[test]
    fn the_first_state_of_a_run_is_proven_by_its_manifest() {
        let manifest = manifest(Method::Rkn4);
        let mut first = ChainState::initial(&manifest.physics);
        let differs = |first: &ChainState| initial_difference(&manifest, &first.as_frame(&manifest, 0));
        assert_eq!(differs(&first), None);
        first.u_m[7] = 1e-9;
        assert_eq!(differs(&first).map(|found| found.bead), Some(7));
    }
}
