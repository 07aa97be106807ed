use super::*;
use crate::resimulation::Resimulation;
use crate::resimulation::tests::{Broken, Item, Script, manifest, script, states};

/// Everything that a source says, up to its end and the error after it, if there is one; but for which beads rest, as some say more than others.
fn events(mut source: impl FrameSource<Error = ResimulationError<Broken>>) -> Vec<String> {
    let mut events = Vec::new();
    loop {
        let (event, is_end) = match source.receive() {
            Ok(Received::Frame(frame)) => (format!("{:?}", Frame { active: None, ..frame }), false),
            Ok(Received::Missed { from, to }) => (format!("missed {from} to {to}"), false),
            Ok(Received::End(reason)) => (format!("end {reason}"), true),
            Err(error) => (format!("error {error}"), false),
        };
        events.push(event);
        if is_end {
            return events;
        }
    }
}

/// So little that every bound is met.
const TIGHT: [Limits; 3] = [
    Limits { stretch_steps: 1, stretch_doubles: 0, block_doubles: 0, waiting_doubles: 0 },
    Limits { stretch_steps: 25, stretch_doubles: 300, block_doubles: 200, waiting_doubles: 1000 },
    Limits { stretch_steps: 1000, stretch_doubles: 1 << 20, block_doubles: 1000, waiting_doubles: 0 },
];

/// Compares what one thread and several make of a source.
fn assert_same(make: impl Fn() -> Script) {
    let all = [Limits::default()].into_iter().chain(TIGHT);
    for limits in all {
        for threads in [1, 2, 5].into_iter().filter_map(NonZero::new) {
            for lend in [Lend::Frames, Lend::Steps] {
                let one = Resimulation::new(make(), lend).expect("same kernel");
                let one = one.ending_with_the_last_state();
                let several =
                    || ParallelResimulation::with_limits(make(), lend, threads, limits).expect("same kernel");
                assert_eq!(events(several()), events(one), "{limits:?} {threads} {lend:?}");
                let one = Resimulation::from_start(make(), lend).expect("same kernel");
                let one = one.ending_with_the_last_state();
                assert_eq!(
                    events(several().with_initial_state()),
                    events(one),
                    "{limits:?} {threads} {lend:?}"
                );
                let one = Resimulation::new(make(), lend).expect("same kernel").lending_from(37);
                let one = one.ending_with_the_last_state();
                assert_eq!(events(several().lending_from(37)), events(one), "{limits:?} {threads} {lend:?}");
            }
        }
    }
}

#[test]
fn several_threads_lend_what_one_does() {
    for publish in [1, 20] {
        let m = manifest(publish);
        for steps in [&[0, 100][..], &[0, 20, 40, 60, 80, 100], &[60, 80, 100], &[100], &[]] {
            assert_same(|| script(&m, steps));
        }
        let every: Vec<usize> = (0..=100).step_by(usize::try_from(publish).expect("small")).collect();
        assert_same(|| script(&m, &every));
    }
}

#[test]
fn several_threads_say_the_same_of_what_is_missing_or_wrong() {
    let m = manifest(10);
    let with = |at: usize, items: &[Item]| {
        let mut source = script(&m, &[0, 20, 50, 60, 100]);
        source.items.splice(at..at, items.iter().cloned());
        source
    };
    assert_same(|| with(0, &[Item::Missed(0, 3), Item::Missed(4, 5)]));
    assert_same(|| with(2, &[Item::Missed(3, 4)]));
    // an end before its time, with frames that were missed after the last state
    let unfinished = |reason| {
        let mut source = script(&m, &[0, 20]);
        source.items.splice(2.., [Item::Missed(3, 7), Item::End(reason)]);
        source
    };
    assert_same(|| unfinished(EndReason::Unfinished));
    assert_same(|| unfinished(EndReason::Stopped));
    for at in 0..6 {
        assert_same(|| with(at, &[Item::Broken]));
        assert_same(|| with(at, &[Item::Broken, Item::Broken, Item::End(EndReason::Unfinished)]));
    }
    for changed in 0..5 {
        assert_same(|| {
            let mut source = with(5, &[]);
            let Item::State(state) = &mut source.items[changed] else { unreachable!("a state") };
            state.v_m_s[3] = f64::from_bits(state.v_m_s[3].to_bits() ^ 1);
            source
        });
    }
}

/// A consumer that stops listening does not wait for work that is under way.
#[test]
fn it_can_be_dropped_at_any_time() {
    let m = manifest(1);
    for limits in TIGHT {
        for taken in [0, 1, 30] {
            let threads = NonZero::new(3).expect("three");
            let source = script(&m, &[0, 30, 100]);
            let mut source =
                ParallelResimulation::with_limits(source, Lend::Steps, threads, limits).expect("same kernel");
            for step in 0..taken {
                assert!(matches!(source.receive(), Ok(Received::Frame(frame)) if frame.step == step));
            }
        }
    }
    assert_eq!(states(&m).len(), 101);
}

/// A thread that panics does not leave the others waiting for room.
#[test]
#[should_panic(expected = "index")]
fn a_panic_of_a_thread_goes_on_where_its_states_are_awaited() {
    let m = manifest(1);
    for limits in TIGHT {
        let mut source = script(&m, &[0, 20, 40, 60, 80, 100]);
        let Item::State(state) = &mut source.items[2] else { unreachable!("a state") };
        state.v_m_s = crate::state::Padded::of(&state.v_m_s[..3]);
        let threads = NonZero::new(5).expect("five");
        let several = ParallelResimulation::with_limits(source, Lend::Steps, threads, limits);
        events(several.expect("same kernel"));
    }
}
