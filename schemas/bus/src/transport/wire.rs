//! The types that lie in shared memory, laid out as in C so that programs in any language can read them.
#![allow(
    unsafe_code,
    reason = "ZeroCopySend is an unsafe trait, and a slot is filled before it is initialised"
)]

use super::Ipc;
use crate::StreamId;
use iceoryx2::prelude::ZeroCopySend;
use iceoryx2::sample_mut::SampleMut;
use iceoryx2::sample_mut_uninit::SampleMutUninit;
use schemas::frame::{Active, Frame};
use schemas::manifest::RunId;
use std::collections::HashMap;
use std::fmt::Debug;
use std::mem::MaybeUninit;

/// Header of each frame and of each row of results.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, ZeroCopySend)]
#[type_name("beadline.StateHeader.v1")]
pub struct StateHeader {
    /// Id of the run.
    pub run_id: [u8; 16],
    /// Id of this publishing of the run: it differs for each run, replay and loop.
    pub stream_id: u64,
    /// Number of the frame.
    pub frame: u64,
    /// Number of the step.
    pub step: u64,
    /// Simulated time (s).
    pub time_s: f64,
    /// Bit 0: the last frame, a hint only. Bit 1: a row of results that is not its publisher's first.
    pub flags: u64,
    /// The first bead of a state that may differ from rest, and the bead behind the last one in the upper 32 bits; all others have
    /// displacements and velocities of 0. 0 if nobody says, and in other messages.
    pub active: u64,
}

/// [`StateHeader::flags`]: the last frame of the run, or the end of a stream of results.
pub const FLAG_LAST: u64 = 1;

/// [`StateHeader::flags`] of a row of results: its publisher had rows before this one, received or not.
pub const FLAG_FOLLOWS: u64 = 2;

impl StateHeader {
    /// Makes a header of `stream` that has no frame yet.
    pub(super) fn of(stream: StreamId) -> Self {
        Self { run_id: stream.run_id.0, stream_id: stream.stream_id, ..Self::default() }
    }

    pub(super) fn stream(&self) -> StreamId {
        StreamId { run_id: RunId(self.run_id), stream_id: self.stream_id }
    }

    /// The beads that may differ from rest among `beads`, if the header says so.
    pub(super) fn active(&self, beads: usize) -> Option<Active> {
        let part = |bits: u64| usize::try_from(bits & u64::from(u32::MAX)).ok();
        let active = Active { first: part(self.active)?, end: part(self.active >> 32)? };
        (self.active != 0 && active.first <= active.end && active.end <= beads).then_some(active)
    }
}

/// The number that says in a header which beads may differ from rest.
fn active_bits(active: Option<Active>) -> u64 {
    let bits = active.and_then(|active| {
        Some(u64::from(u32::try_from(active.first).ok()?) | u64::from(u32::try_from(active.end).ok()?) << 32)
    });
    bits.unwrap_or(0)
}

/// Request of a consumer: it asks to be connected, then confirms the connection.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, ZeroCopySend)]
#[type_name("beadline.JoinRequest.v1")]
pub struct JoinRequest {
    /// The id of the consumer's subscriber to `/state`, little-endian.
    pub subscriber_id: [u8; 16],
    /// [`JOIN_CONNECT`] or [`JOIN_READY`].
    pub phase: u64,
    /// Always 0.
    pub reserved: u64,
}

/// First request: connect to my subscribers.
pub const JOIN_CONNECT: u64 = 1;
/// Second request: I have received, and am ready.
pub const JOIN_READY: u64 = 2;

/// Answer of the producer to a request to join.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, ZeroCopySend)]
#[type_name("beadline.JoinAnswer.v1")]
pub struct JoinAnswer {
    /// Id of the run.
    pub run_id: [u8; 16],
    /// Id of this publishing of the run.
    pub stream_id: u64,
    /// First frame that is guaranteed to reach this consumer; only in the answer to [`JOIN_READY`].
    pub first_frame: u64,
    /// The request's phase.
    pub phase: u64,
    /// Always 0.
    pub reserved: u64,
}

/// Most bytes of a manifest on the blackboard; a longer manifest lies in a file, which the blackboard names.
pub(super) const MANIFEST_BYTES: usize = 64 * 1024 - 8 - 16 - 8;

/// The manifest as JSON; blackboard key 0.
#[repr(C)]
#[derive(Clone, Copy, ZeroCopySend)]
#[type_name("beadline.ManifestText.v1")]
pub struct ManifestText {
    /// Id of the run.
    pub run_id: [u8; 16],
    /// Id of this publishing of the run.
    pub stream_id: u64,
    /// Length of the manifest.
    pub length_bytes: u64,
    /// `length_bytes` bytes of UTF-8. For a manifest that does not fit: the name of its file in the root, then zeros.
    pub json: [u8; MANIFEST_BYTES],
}

impl Debug for ManifestText {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "ManifestText of {} bytes", self.length_bytes)
    }
}

/// Progress of a run; blackboard key 1, and key 2 for the stream before.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, ZeroCopySend)]
#[type_name("beadline.RunStatus.v1")]
pub struct RunStatus {
    /// Id of the run.
    pub run_id: [u8; 16],
    /// Id of this publishing of the run.
    pub stream_id: u64,
    /// 0 waiting for consumers, 1 running, 2 done, 3 interrupted, 4 failed.
    pub state: u64,
    /// Number of frames published; the last one is `first_frame + frames − 1`.
    pub frames: u64,
    /// Number of the first frame published.
    pub first_frame: u64,
    /// Step of the last frame.
    pub step: u64,
    /// Simulated time of the last frame (s).
    pub time_s: f64,
    /// Time of writing, nanoseconds since 1970-01-01 UTC.
    pub written_unix_ns: u64,
    /// Lossless consumers that are ready.
    pub lossless: u64,
    /// `latest` consumers.
    pub latest: u64,
    /// Lossless consumers dropped because they were stuck.
    pub evicted: u64,
    /// Process of the producer.
    pub pid: u64,
    /// The producer's iceoryx2 node, little-endian.
    pub node_id: [u8; 16],
    /// Time when the first frame was published, nanoseconds since 1970-01-01 UTC; 0 before that, and if it is not known.
    pub began_unix_ns: u64,
    /// Always 0.
    pub reserved: [u64; 3],
}

/// [`RunStatus::state`]: waiting for consumers.
pub const STATE_WAITING: u64 = 0;
/// [`RunStatus::state`]: running.
pub const STATE_RUNNING: u64 = 1;
/// [`RunStatus::state`]: reached its last step.
pub const STATE_DONE: u64 = 2;
/// [`RunStatus::state`]: asked to stop, and ended in order.
pub const STATE_INTERRUPTED: u64 = 3;
/// [`RunStatus::state`]: ended because of an error.
pub const STATE_FAILED: u64 = 4;

impl RunStatus {
    /// The last frame published, if there is one.
    pub fn last_frame(&self) -> Option<u64> {
        (self.frames > 0).then(|| self.first_frame.saturating_add(self.frames - 1))
    }

    pub(super) fn stream(&self) -> StreamId {
        StreamId { run_id: RunId(self.run_id), stream_id: self.stream_id }
    }
}

type Slot<T> = SampleMutUninit<Ipc, [MaybeUninit<T>], StateHeader>;

/// Fills a slot with `parts`, one after the other.
///
/// # Panics
/// Never: a slot of another length is the caller's bug, and only its common part is written in release.
pub(super) fn fill<T: Copy + Debug + ZeroCopySend>(
    mut slot: Slot<T>,
    header: StateHeader,
    parts: &[&[T]],
) -> SampleMut<Ipc, [T], StateHeader> {
    *slot.user_header_mut() = header;
    let mut rest = slot.payload_mut();
    for part in parts {
        let (head, tail) = rest.split_at_mut(part.len());
        head.write_copy_of_slice(part);
        rest = tail;
    }
    assert!(rest.is_empty(), "a slot is filled to its end");
    // SAFETY: the loop wrote every element up to `rest`, and `rest` is empty.
    unsafe { slot.assume_init() }
}

/// The slots of a publisher of states, each with the beads that may differ from rest in what was written into it last. Slots are used again
/// and again, and only their publisher writes into them, so that of beads at rest nothing need be written twice.
#[derive(Debug, Default)]
pub(super) struct Slots {
    written: HashMap<usize, Active>,
}

impl Slots {
    /// Fills a slot with `frame`.
    pub(super) fn fill(
        &mut self,
        mut slot: Slot<f64>,
        header: StateHeader,
        frame: &Frame<'_>,
    ) -> SampleMut<Ipc, [f64], StateHeader> {
        let beads = frame.u_m.len();
        let active = frame.moving();
        let before = self.written.insert(slot.payload_mut().as_ptr() as usize, active);
        let Some(before) = before else {
            let header = StateHeader { active: active_bits(frame.active), ..header };
            return fill(slot, header, &[frame.u_m, frame.v_m_s, frame.extra]);
        };
        *slot.user_header_mut() = StateHeader { active: active_bits(frame.active), ..header };
        let Active { first, end } = before.with(active);
        let (u_m, rest) = slot.payload_mut().split_at_mut(beads);
        let (v_m_s, extra) = rest.split_at_mut(beads);
        u_m[first..end].write_copy_of_slice(&frame.u_m[first..end]);
        v_m_s[first..end].write_copy_of_slice(&frame.v_m_s[first..end]);
        extra.write_copy_of_slice(frame.extra);
        // SAFETY: the slot has been filled to its end before, and nobody else writes into it.
        unsafe { slot.assume_init() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layouts_are_those_of_the_format_page() {
        assert_eq!(size_of::<StateHeader>(), 64);
        assert_eq!(size_of::<JoinRequest>(), 32);
        assert_eq!(size_of::<JoinAnswer>(), 48);
        assert_eq!(size_of::<RunStatus>(), 152);
        assert_eq!(size_of::<ManifestText>(), 64 * 1024);
        assert_eq!(std::mem::offset_of!(StateHeader, time_s), 40);
        assert_eq!(std::mem::offset_of!(StateHeader, active), 56);
        assert_eq!(std::mem::offset_of!(RunStatus, first_frame), 40);
        assert_eq!(std::mem::offset_of!(RunStatus, node_id), 104);
        assert_eq!(std::mem::offset_of!(RunStatus, began_unix_ns), 120);
        assert_eq!(std::mem::offset_of!(RunStatus, reserved), 128);
        assert_eq!(std::mem::offset_of!(JoinAnswer, first_frame), 24);
        assert_eq!(std::mem::offset_of!(ManifestText, json), 32);
    }

    #[test]
    fn streams_of_one_run_differ() {
        let run = RunId::random();
        assert_ne!(StreamId::new(run), StreamId::new(run));
    }
}
