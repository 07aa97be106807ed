use super::*;
use crate::integrator::Integrator;
use crate::resimulation::{Lend, Resimulation};
use schemas::config::StreamConfig;
use schemas::manifest::Origin;
use schemas::presets::PRESETS;
use std::convert::Infallible;

/// Delivers the states of some steps of a run, and what a test puts between them.
struct Script {
    manifest: RunManifest,
    state: ChainState,
    integrator: Integrator,
    items: std::vec::IntoIter<Item>,
}

#[derive(Clone, Copy)]
enum Item {
    Step(u64),
    Missed(u64, u64),
    End(EndReason),
    Damage,
}

#[derive(Debug, thiserror::Error)]
#[error("damaged")]
struct Damaged;

impl FrameSource for Script {
    type Error = Damaged;

    fn manifest(&self) -> &RunManifest {
        &self.manifest
    }

    fn receive(&mut self) -> Result<Received<'_>, Damaged> {
        Ok(match self.items.next().expect("the end is the last that is asked for") {
            Item::Step(step) => {
                while self.state.step < step {
                    self.integrator.step(&mut self.state);
                }
                Received::Frame(self.state.as_frame(&self.manifest, self.manifest.frame_at(step)))
            }
            Item::Missed(from, to) => Received::Missed { from, to },
            Item::End(reason) => Received::End(reason),
            Item::Damage => return Err(Damaged),
        })
    }
}

/// 10 beads over 20 steps of 1 µs, a frame every 2 steps, a record every `record`.
fn script(record: u64, items: &[Item]) -> Script {
    let mut config = PRESETS[2].config();
    config.chain.beads = 10;
    config.stream = StreamConfig { publish_every_steps: 2, record_every_steps: record };
    config.time.dt_s = Some(1e-6);
    config.time.duration_s = 20e-6;
    let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
    let manifest = RunManifest::new(&config, "run", origin).expect("valid");
    Script {
        state: ChainState::initial(&manifest.physics),
        integrator: Integrator::new(&manifest.physics),
        items: Vec::from(items).into_iter(),
        manifest,
    }
}

fn steps(steps: impl IntoIterator<Item = u64>, end: Item) -> Vec<Item> {
    steps.into_iter().map(Item::Step).chain([end]).collect()
}

const COMPLETE: Item = Item::End(EndReason::Complete);

/// Keeps the frame and the step of each frame.
#[derive(Default)]
struct Kept(Vec<(u64, u64)>);

impl FrameSink for Kept {
    type Error = Infallible;

    fn accept(&mut self, frame: &Frame<'_>) -> Result<(), Infallible> {
        self.0.push((frame.frame, frame.step));
        Ok(())
    }
}

/// Ends the replay before the frame of a given number.
struct Before(u64);

impl Conductor<Kept> for Before {
    fn before_frame(&mut self, frame: &Frame<'_>, _: &mut Kept) -> ControlFlow<()> {
        if frame.frame >= self.0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

fn begin<S: FrameSource>(
    source: S,
    every_step: bool,
    window: Window,
) -> Result<Replay<S>, BeginError<S::Error>> {
    let manifest = published_manifest(source.manifest(), None, every_step);
    Replay::begin(source, manifest, window, || ControlFlow::Continue(()))
}

fn play<S: FrameSource>(
    source: S,
    every_step: bool,
    window: Window,
) -> (Vec<(u64, u64)>, ReplayOutcome<S::Error>) {
    let replay = begin(source, every_step, window).expect("begins");
    let (first, mut kept) = (replay.first_frame(), Kept::default());
    let outcome = replay.play(&mut kept, &mut Before(u64::MAX)).expect("never refused");
    assert_eq!((outcome.first_frame, outcome.published_count), (first, kept.0.len() as u64));
    assert_eq!(outcome.last_step, kept.0.last().map(|(_, step)| *step));
    (kept.0, outcome)
}

fn frames(numbers: impl IntoIterator<Item = u64>) -> Vec<(u64, u64)> {
    numbers.into_iter().map(|frame| (frame, 2 * frame)).collect()
}

#[test]
fn every_frame_is_published_also_of_a_sparse_recording() {
    let full = script(2, &steps((0..=20).step_by(2), COMPLETE));
    let (published, outcome) = play(full, false, Window::WHOLE);
    assert_eq!((published, outcome.reason), (frames(0..=10), EndReason::Complete));
    let sparse = script(10, &steps([0, 10, 20], COMPLETE));
    assert!(is_sparse(&sparse.manifest, &sparse.manifest));
    let (published, outcome) =
        play(Resimulation::new(sparse, Lend::Steps).expect("our kernel"), false, Window::WHOLE);
    assert_eq!((published, outcome.reason), (frames(0..=10), EndReason::Complete));
}

#[test]
fn each_step_can_be_a_frame() {
    let source = script(2, &steps((0..=20).step_by(2), COMPLETE));
    assert!(is_sparse(&source.manifest, &published_manifest(&source.manifest, None, true)));
    let source = Resimulation::new(source, Lend::Steps).expect("our kernel");
    let (published, _) = play(source, true, Window::WHOLE);
    assert_eq!(published, (0..=20).map(|step| (step, step)).collect::<Vec<_>>());
}

/// The window includes frames at its borders; where it ends before the recording, so does the stream.
#[test]
fn a_window_has_exactly_its_frames() {
    let time_s = |step| script(2, &[]).manifest.physics.time_s(step);
    let all = || script(2, &steps((0..=20).step_by(2), COMPLETE));
    let window = Window { from_s: time_s(4), until_s: time_s(10) };
    let (published, outcome) = play(all(), false, window);
    assert_eq!((published, outcome.reason), (frames(2..=5), EndReason::Interrupted));
    let window = Window { from_s: time_s(3), until_s: time_s(9) };
    assert_eq!(play(all(), false, window).0, frames(2..=4));
    let window = Window { from_s: time_s(19), until_s: time_s(20) };
    let (published, outcome) = play(all(), false, window);
    assert_eq!((published, outcome.reason), (frames([10]), EndReason::Complete));
    for window in
        [Window { from_s: time_s(5), until_s: time_s(5) }, Window { from_s: 1.0, until_s: f64::INFINITY }]
    {
        assert!(matches!(begin(all(), false, window), Err(BeginError::NoFrame(found)) if found == window));
    }
}

/// Frames missing at the beginning are like frames before an attachment. Elsewhere the replay breaks off, unless it is
/// over before.
#[test]
fn consumers_never_see_a_gap() {
    let late = [vec![Item::Missed(0, 2)], steps((6..=20).step_by(2), COMPLETE)].concat();
    assert_eq!(play(script(2, &late), false, Window::WHOLE).0, frames(3..=10));
    let hole = [steps([0, 2], Item::Missed(2, 4)), steps([10], COMPLETE)].concat();
    let (published, outcome) = play(script(2, &hole), false, Window::WHOLE);
    assert_eq!((published, outcome.reason), (frames(0..=1), EndReason::Failed));
    assert!(matches!(outcome.broken, Some(Broken::Missing { from: 2, to: 4 })));
    let window = Window { from_s: 0.0, until_s: 3e-6 };
    assert_eq!(play(script(2, &hole), false, window).1.reason, EndReason::Interrupted);
}

#[test]
fn a_replay_ends_as_its_recording_does() {
    for reason in [EndReason::Interrupted, EndReason::Failed, EndReason::Unfinished] {
        let source = script(2, &steps([0, 2], Item::End(reason)));
        assert_eq!(play(source, false, Window::WHOLE).1.reason, reason);
    }
    let (published, outcome) = play(script(2, &steps([0, 2], Item::Damage)), false, Window::WHOLE);
    assert_eq!((published, outcome.reason), (frames(0..=1), EndReason::Failed));
    assert!(matches!(outcome.broken, Some(Broken::Source(Damaged))));
}

#[test]
fn a_replay_can_be_stopped() {
    let all = || script(2, &steps((0..=20).step_by(2), COMPLETE));
    for stop in [0, 3] {
        let mut kept = Kept::default();
        let outcome = begin(all(), false, Window::WHOLE).expect("begins").play(&mut kept, &mut Before(stop));
        assert_eq!(outcome.expect("never refused").reason, EndReason::Interrupted);
        assert_eq!(kept.0, frames(0..stop));
    }
    // a stop that comes with the last frame changes nothing
    let source = script(2, &steps((0..=20).step_by(2), Item::End(EndReason::Stopped)));
    assert_eq!(play(source, false, Window::WHOLE).1.reason, EndReason::Complete);
    let manifest = all().manifest;
    let stopped =
        Replay::begin(all(), manifest, Window { from_s: 1e-5, ..Window::WHOLE }, || ControlFlow::Break(()));
    assert!(matches!(stopped, Err(BeginError::Stopped)));
}

#[test]
fn only_the_name_of_a_published_manifest_can_differ() {
    let recorded = script(10, &[]).manifest;
    assert_eq!(published_manifest(&recorded, None, false), recorded);
    let mut renamed = published_manifest(&recorded, "other".parse().ok(), false);
    assert_eq!(renamed.provenance.name.as_str(), "other");
    renamed.provenance.name = recorded.provenance.name.clone();
    assert_eq!(renamed, recorded);
}
