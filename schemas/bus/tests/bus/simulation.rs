//! Delivery in any order of events: the decisions of `bus::delivery`, as the product makes them, on a transport and a
//! clock that a seed decides. Producers are killed, stopped and succeeded; consumers come late, are slow, stuck, killed.
//!
//! `BEADLINE_SCHEDULES=1000000` tries so many, `BEADLINE_SEED=7` replays one and prints what happened.
#![allow(clippy::cast_possible_truncation, reason = "small numbers: streams, consumers, milliseconds")]
#![allow(clippy::struct_excessive_bools, reason = "independent facts")]

mod consumer;
mod producer;
mod transport;

use bus::Remedies;
use producer::Schedule;

/// What breaks a promise in the schedule of `seed`, with all that happened.
fn broken(seed: u64, remedies: Remedies) -> Option<String> {
    let run = |traced| {
        let mut schedule = Schedule::new(seed, remedies, traced);
        let broken = schedule.run().err();
        broken.map(|what| (what, schedule.world.trace()))
    };
    run(false)?;
    let (what, trace) = run(true)?;
    Some(format!("\n{trace}\n{what}; BEADLINE_SEED={seed} replays it"))
}

fn setting(name: &str) -> Option<u64> {
    std::env::var(name).ok().map(|value| value.parse().unwrap())
}

/// Who lives and holds the run back hears of every frame once; who was dropped, or wants what there is, hears exactly
/// what it missed; the end comes, with its reason; and nobody waits for the dead.
#[test]
fn in_any_order_of_events_delivery_keeps_its_promises() {
    let seeds = match setting("BEADLINE_SEED") {
        Some(seed) => seed..seed + 1,
        None => 0..setting("BEADLINE_SCHEDULES").unwrap_or(100_000),
    };
    for seed in seeds {
        if let Some(what) = broken(seed, Remedies::default()) {
            panic!("{what}");
        }
    }
}

#[test]
fn without_a_remedy_a_promise_is_broken() {
    let all = Remedies::default();
    for remedies in [
        Remedies { connect_on_join: false, ..all },
        Remedies { clean_while_blocked: false, ..all },
        Remedies { resend: false, ..all },
    ] {
        let seed = (0..20_000).find(|seed| broken(*seed, remedies).is_some());
        assert!(seed.is_some(), "{remedies:?} is not needed");
    }
}
