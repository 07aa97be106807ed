//! Producers that are killed at any moment, and go on as if nothing had been.

use crate::harness::{Place, Running, wait_until};
use bus::list_runs;
use recording::{RecordingInfo, RecordingSource};
use schemas::frame::{FrameSource, Received};
use std::fs;

/// A chain of 60 beads, 2,760 frames.
const CHAIN: &str = "run --preset homogeneous --beads 60 --duration 4e-3 --name run";

const FRAMES: u64 = 2760;

/// `SplitMix64`.
struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % end
    }
}

/// A moment in the life of a producer, told by what can be seen of it.
#[derive(Debug, Clone, Copy)]
enum Moment {
    /// There is a `.partial`, and something in it.
    FirstBytes,
    /// A frame is on the bus.
    Published(u64),
    /// The `.partial` has this many bytes.
    Written(u64),
    /// A frame is in the `.partial`.
    Recorded(u64),
}

impl Moment {
    fn random(number: u64, random: &mut Random) -> Self {
        // one in five near the end
        let frame = if random.below(5) == 0 { FRAMES - 1 - random.below(40) } else { random.below(FRAMES) };
        match number % 10 {
            0 => Self::FirstBytes,
            1..4 => Self::Published(frame),
            4..7 => Self::Written(random.below(1_100_000)),
            _ => Self::Recorded(frame),
        }
    }

    /// Waits until it has come, or the run has ended. What was in the file then, by its last step, if that is known.
    fn wait(self, place: &Place) -> Option<u64> {
        let partial = place.path("run.mcap.partial");
        let bytes = || fs::metadata(&partial).map_or(0, |found| found.len());
        let recorded = || RecordingInfo::read(&partial).ok().and_then(|info| info.last_step);
        let bus = place.bus();
        wait_until(&format!("{self:?}"), || {
            if place.path("run.mcap").exists() {
                return Some(None);
            }
            match self {
                Self::FirstBytes => (bytes() > 0).then_some(None),
                Self::Written(least) => (bytes() >= least.max(1)).then(recorded),
                Self::Recorded(frame) => recorded().filter(|step| *step >= frame).map(Some),
                Self::Published(frame) => {
                    let runs = list_runs(&bus).unwrap();
                    runs.iter().any(|run| run.frame >= Some(frame)).then(recorded)
                }
            }
        })
    }
}

/// Kills at a moment, and what was recorded before it is there. Whether the run had not ended by then.
fn kill(place: &Place, run: Running, moment: Moment) -> bool {
    let before = moment.wait(place);
    // by SIGKILL
    drop(run);
    let partial = place.path("run.mcap.partial");
    if !partial.exists() {
        return false;
    }
    let info = RecordingInfo::read(&partial).unwrap_or_else(|error| panic!("{moment:?}: {error}"));
    assert_eq!(info.damage, None, "{moment:?}");
    assert!(info.last_step >= before, "{moment:?}: {before:?} was there, {:?} is", info.last_step);
    if info.frames() > 0 {
        // killed between its end and its name, it is whole
        let (code, verdict) = if info.finished { (0, "proven") } else { (3, "proven as far as it goes") };
        let verified = place.run("verify run.mcap.partial").exits(code).stdout();
        assert!(verified.contains(verdict), "{moment:?}: {verified}");
    }
    true
}

/// Recovers what was left, proves it, and has the run go on from that, too.
fn recover(place: &Place, left: &RecordingInfo, expected: &str) {
    fs::create_dir(place.path("recovered")).unwrap();
    place.run("recover run.mcap.partial --out recovered/run.mcap");
    let found = RecordingInfo::read(&place.path("recovered/run.mcap")).unwrap();
    assert!(found.last_step >= left.last_step && found.frames() >= left.frames(), "{found:?}");
    place.run("verify recovered/run.mcap").exits(0);
    place.run("run --resume recovered/run.mcap").exits(0);
    let info = RecordingInfo::read(&place.path("recovered/run.mcap")).unwrap();
    assert_eq!(info.end.and_then(|end| end.last_state_hash).as_deref(), Some(expected));
}

/// The hash of the last state.
fn last_state(place: &Place) -> String {
    let info = RecordingInfo::read(&place.path("run.mcap")).unwrap();
    assert!(info.is_complete());
    assert_eq!(info.frames(), FRAMES);
    info.end.and_then(|end| end.last_state_hash).unwrap()
}

/// Every state: its frame and the bits of its doubles.
fn states(place: &Place) -> Vec<(u64, Vec<u64>)> {
    let mut source = RecordingSource::open(&place.path("run.mcap")).unwrap();
    let mut states = Vec::new();
    while let Received::Frame(frame) = source.receive().unwrap() {
        let doubles = [frame.u_m, frame.v_m_s].concat();
        states.push((frame.frame, doubles.into_iter().map(f64::to_bits).collect()));
    }
    states
}

/// What a kill leaves opens, is proven as far as it goes, and has all that was written before; and a run that is gone
/// on with ends as one that nobody killed.
#[test]
fn a_run_that_is_killed_at_any_moment_goes_on_to_the_same_end() {
    let whole = Place::new();
    whole.run(CHAIN).exits(0);
    let (expected, all) = (last_state(&whole), states(&whole));
    let mut random = Random(4);
    let (mut killed, mut empty) = (0, 0);
    for number in 0..50 {
        let moment = Moment::random(number, &mut random);
        let place = Place::new();
        // two thirds of a second
        let run = place.start(&format!("{CHAIN} --pace 0.006 --flush-period 0.01"));
        if !kill(&place, run, moment) {
            assert_eq!(last_state(&place), expected);
            continue;
        }
        killed += 1;
        // killed again while it goes on, also while it writes its recording again
        if number % 7 == 0 {
            let again = place.start("run --resume run.mcap.partial --pace 0.006 --flush-period 0.01");
            Moment::Recorded(random.below(FRAMES)).wait(&place);
            drop(again);
        }
        if place.path("run.mcap").exists() {
            assert_eq!(last_state(&place), expected, "{moment:?}");
            continue;
        }
        let info = RecordingInfo::read(&place.path("run.mcap.partial")).ok();
        empty += u64::from(info.as_ref().is_some_and(|info| info.frames() == 0));
        if number % 4 == 1
            && let Some(info) = info.filter(|info| info.frames() > 0)
        {
            recover(&place, &info, &expected);
        }
        place.run("run --resume run.mcap.partial").exits(0);
        assert_eq!(last_state(&place), expected, "{moment:?}");
        assert!(!place.path("run.mcap.partial").exists() && !place.path("run.mcap.interrupted").exists());
        if number % 5 == 0 {
            assert!(states(&place) == all, "{moment:?}: other states");
            place.run("verify run.mcap").exits(0);
        }
    }
    // on a busy machine some end before anybody looks
    assert!(killed >= 30, "{killed} of 50 were killed before their end");
    assert!(empty > 0, "none was killed before its first frame was written");
}

/// Frames are in the file when the flush period is over, also of a run that makes so few that no chunk gets full.
#[test]
fn a_slow_run_is_written_although_no_chunk_gets_full() {
    let place = Place::new();
    let run = place.start(&format!("{CHAIN} --pace 1e-4 --flush-period 0.02"));
    for frame in [1, 20, 60] {
        Moment::Recorded(frame).wait(&place);
        let run = place.wait_for_run("run", |_| true);
        assert!(run.frame < Some(2000), "{run:?}: too late to tell");
    }
    run.signal("INT");
    run.wait().exits(3);
}
