use super::*;
use schemas::config::StreamConfig;
use schemas::manifest::Origin;
use schemas::presets::PRESETS;

/// Delivers some states of a run, and what a test puts between them.
pub(super) struct Script {
    pub(super) manifest: RunManifest,
    pub(super) items: Vec<Item>,
    next: usize,
}

#[derive(Clone)]
pub(super) enum Item {
    State(ChainState),
    Missed(u64, u64),
    Broken,
    End(EndReason),
}

#[derive(Debug, thiserror::Error)]
#[error("broken")]
pub(super) struct Broken;

impl FrameSource for Script {
    type Error = Broken;

    fn manifest(&self) -> &RunManifest {
        &self.manifest
    }

    fn receive(&mut self) -> Result<Received<'_>, Broken> {
        // the end is repeated
        let item = self.items.get(self.next).or(self.items.last());
        self.next += 1;
        Ok(match item.expect("an end") {
            Item::State(state) => {
                Received::Frame(state.as_frame(&self.manifest, self.manifest.frame_at(state.step)))
            }
            Item::Missed(from, to) => Received::Missed { from: *from, to: *to },
            Item::Broken => return Err(Broken),
            Item::End(reason) => Received::End(*reason),
        })
    }
}

/// 30 beads over 100 steps, a frame every `publish` steps.
pub(super) fn manifest(publish: u64) -> RunManifest {
    let mut config = PRESETS[2].config();
    config.chain.beads = 30;
    config.stream = StreamConfig { publish_every_steps: publish, record_every_steps: publish };
    config.time.dt_s = Some(1e-6);
    config.time.duration_s = 100e-6;
    let origin = Origin { program: String::new(), host: String::new(), started_unix_ns: 0 };
    RunManifest::new(&config, "run", origin).expect("valid")
}

pub(super) fn states(manifest: &RunManifest) -> Vec<ChainState> {
    let mut state = ChainState::initial(&manifest.physics);
    let mut integrator = Integrator::new(&manifest.physics);
    let mut states = vec![state.clone()];
    while state.step < manifest.physics.step_count {
        integrator.step(&mut state);
        states.push(state.clone());
    }
    states
}

/// The states of `steps`, then an end.
pub(super) fn script(manifest: &RunManifest, steps: &[usize]) -> Script {
    let all = states(manifest);
    let mut items: Vec<Item> = steps.iter().map(|step| Item::State(all[*step].clone())).collect();
    items.push(Item::End(EndReason::Complete));
    Script { manifest: manifest.clone(), items, next: 0 }
}

/// Everything lent: frame, step and bits.
fn lent(mut source: Resimulation<Script>) -> Result<Vec<(u64, ChainState)>, Difference> {
    let mut lent = Vec::new();
    loop {
        match source.receive() {
            Ok(Received::Frame(frame)) => lent.push((frame.frame, ChainState::of_frame(&frame))),
            Ok(Received::End(reason)) => {
                assert_eq!(reason, EndReason::Complete);
                return Ok(lent);
            }
            Ok(Received::Missed { .. }) => unreachable!("gaps are bridged"),
            Err(ResimulationError::Differs(difference)) => {
                assert!(matches!(source.receive(), Ok(Received::End(EndReason::Unfinished))));
                return Err(difference);
            }
            Err(ResimulationError::Source(error)) => unreachable!("{error}"),
        }
    }
}

fn steps(lent: &[(u64, ChainState)]) -> Vec<(u64, u64)> {
    lent.iter().map(|(frame, state)| (*frame, state.step)).collect()
}

#[test]
fn a_sparse_source_lends_every_step() {
    let m = manifest(1);
    let all = lent(Resimulation::new(script(&m, &[0, 30, 60, 100]), Lend::Steps).expect("same kernel"));
    let expected: Vec<_> = states(&m).into_iter().map(|state| (state.step, state)).collect();
    assert_eq!(all.expect("nothing differs"), expected);
}

#[test]
fn steps_between_frames_belong_to_the_frame_before() {
    let m = manifest(40);
    let all = lent(Resimulation::new(script(&m, &[0, 40, 80, 100]), Lend::Steps).expect("same kernel"));
    let frames: Vec<_> = steps(&all.expect("nothing differs")).into_iter().map(|(frame, _)| frame).collect();
    let counts = [0, 1, 2, 3].map(|frame| frames.iter().filter(|found| **found == frame).count());
    assert_eq!(counts, [40, 40, 20, 1]);
}

#[test]
fn what_was_missed_is_recomputed() {
    let m = manifest(20);
    let mut source = script(&m, &[0, 20, 100]);
    source.items.insert(2, Item::Missed(2, 4));
    let all = lent(Resimulation::new(source, Lend::Frames).expect("same kernel")).expect("nothing differs");
    assert_eq!(steps(&all), [(0, 0), (1, 20), (2, 40), (3, 60), (4, 80), (5, 100)]);
    let all_states = states(&m);
    assert!(all.iter().all(|(_, state)| *state == all_states[usize::try_from(state.step).expect("small")]));
}

#[test]
fn what_was_missed_at_the_end_is_recomputed_too() {
    let m = manifest(20);
    let mut source = script(&m, &[0, 20]);
    source.items.insert(2, Item::Missed(2, 5));
    let all = lent(Resimulation::new(source, Lend::Frames).expect("same kernel")).expect("nothing differs");
    assert_eq!(steps(&all), [(0, 0), (1, 20), (2, 40), (3, 60), (4, 80), (5, 100)]);
    assert_eq!(all.last().map(|(_, state)| state), states(&m).last());
}

/// A file may claim any end: nothing is computed that no state proves.
#[test]
fn what_was_missed_after_the_last_state_of_a_file_stays_missing() {
    let m = manifest(20);
    let mut source = script(&m, &[0, 20]);
    source.items.insert(2, Item::Missed(2, 5));
    let mut source =
        Resimulation::new(source, Lend::Frames).expect("same kernel").ending_with_the_last_state();
    for step in [0, 20] {
        assert!(matches!(source.receive(), Ok(Received::Frame(frame)) if frame.step == step));
    }
    assert!(matches!(source.receive(), Ok(Received::Missed { from: 2, to: 5 })));
    assert!(matches!(source.receive(), Ok(Received::End(EndReason::Complete))));
    assert!(matches!(source.receive(), Ok(Received::End(EndReason::Complete))));
}

#[test]
fn what_is_missing_before_the_first_state_stays_missing() {
    let m = manifest(20);
    let mut source = script(&m, &[60]);
    source.items.insert(0, Item::Missed(0, 2));
    let mut source = Resimulation::new(source, Lend::Frames).expect("same kernel");
    assert!(matches!(source.receive(), Ok(Received::Missed { from: 0, to: 2 })));
    assert!(matches!(source.receive(), Ok(Received::Frame(frame)) if frame.step == 60));
    assert!(matches!(source.receive(), Ok(Received::End(EndReason::Complete))));
}

#[test]
fn who_comes_late_gets_what_was_before() {
    let m = manifest(20);
    for first in [0, 60] {
        let source = script(&m, &[first, 80, 100]);
        let all = lent(Resimulation::from_start(source, Lend::Frames).expect("same kernel"));
        let expected = [(0, 0), (1, 20), (2, 40), (3, 60), (4, 80), (5, 100)];
        assert_eq!(steps(&all.expect("nothing differs")), expected);
    }
}

#[test]
fn nothing_before_the_first_step_asked_for_is_lent() {
    let m = manifest(20);
    for (lend, expected) in
        [(Lend::Frames, vec![60, 80, 100]), (Lend::Steps, (41..=100).collect::<Vec<u64>>())]
    {
        let source = Resimulation::new(script(&m, &[20, 80, 100]), lend).expect("same kernel");
        let all = lent(source.lending_from(41)).expect("nothing differs");
        assert_eq!(all.iter().map(|(_, state)| state.step).collect::<Vec<_>>(), expected);
    }
}

#[test]
fn a_changed_double_is_named() {
    let m = manifest(10);
    for (change, quantity) in [
        ((|s: &mut ChainState| &mut s.u_m[7]) as fn(&mut ChainState) -> &mut f64, Quantity::Displacement),
        (|s| &mut s.v_m_s[7], Quantity::Velocity),
    ] {
        let mut source = script(&m, &[0, 50, 100]);
        let Item::State(state) = &mut source.items[1] else { unreachable!("a state") };
        let value = change(state);
        // the smallest change there is, also of a bead at rest
        *value = f64::from_bits(value.to_bits() ^ 1);
        let difference =
            lent(Resimulation::new(source, Lend::Frames).expect("same kernel")).expect_err("a change");
        assert_eq!((difference.step, difference.frame, difference.from_step), (50, 5, Some(0)));
        assert_eq!((difference.bead, difference.quantity), (7, quantity));
        assert!(difference.to_string().contains("bead 7 at step 50 (frame 5)"), "{difference}");
    }
}

#[test]
fn another_initial_state_is_named() {
    let m = manifest(10);
    let mut source = script(&m, &[0, 100]);
    let Item::State(state) = &mut source.items[0] else { unreachable!("a state") };
    state.v_m_s[0] = 4.0;
    let found = lent(Resimulation::from_start(source, Lend::Frames).expect("same kernel"));
    let difference = found.expect_err("the striker has 5 m/s");
    assert_eq!((difference.step, difference.from_step, difference.computed), (0, None, 5.0));
    assert!(difference.to_string().contains("initial condition"), "{difference}");
}

#[test]
fn another_dynamics_is_refused_by_name() {
    let mut m = manifest(10);
    m.physics.kernel_version = schemas::manifest::KERNEL_VERSION + 1;
    let source = Script { manifest: m, items: Vec::new(), next: 0 };
    let error = Resimulation::new(source, Lend::Frames).err().expect("another kernel");
    assert!(
        error.to_string().contains(&format!("version {}", schemas::manifest::KERNEL_VERSION + 1)),
        "{error}"
    );
}

/// A file may have two states that are years apart.
#[test]
fn a_stop_between_two_states_is_obeyed() {
    let mut far = manifest(1);
    let first = ChainState::initial(&far.physics);
    let step_count = schemas::manifest::MAX_STEPS;
    (far.physics.step_count, far.provenance.publish_every_steps) = (step_count, step_count);
    far.provenance.record_every_steps = step_count;
    let last = ChainState { step: step_count, ..first.clone() };
    let source = || Script {
        manifest: far.clone(),
        items: vec![Item::State(first.clone()), Item::State(last.clone()), Item::End(EndReason::Complete)],
        next: 0,
    };
    let two = std::num::NonZero::new(2).expect("not 0");
    let stop: Arc<AtomicBool> = Arc::default();
    let mut one =
        Resimulation::new(source(), Lend::Frames).expect("same kernel").stopped_by(Arc::clone(&stop));
    assert!(matches!(one.receive(), Ok(Received::Frame(frame)) if frame.step == 0));
    stop.store(true, Ordering::Relaxed);
    assert!(matches!(one.receive(), Ok(Received::End(EndReason::Stopped))));
    // its threads are on the way, and it lends nothing before the end
    let many = ParallelResimulation::new(source(), Lend::Frames, two).expect("same kernel");
    let mut many = many.lending_from(step_count).stopped_by(stop);
    assert!(matches!(many.receive(), Ok(Received::End(EndReason::Stopped))));
}
