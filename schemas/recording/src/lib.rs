//! Recordings: runs as MCAP files.
//!
//! [`RecordingWriter`] is a frame sink and [`RecordingSource`] a frame source; [`RecordingInfo`] says what
//! a file holds, [`SpaceNeeded`] how much disk space one would take. [`ContactsWriter`] and
//! [`ContactsReader`] keep the space-time map of the contacts in the same kind of file. [`ForeignWriter`] writes
//! MCAP files for other people's programs.
//!
//! A file is written as `<name>.mcap.partial` in whole chunks, so that a crash leaves a valid
//! prefix, and becomes `<name>.mcap` when it is finished. Files come from other people: whatever the
//! bytes are, reading ends in a value or an error, within a memory of two chunks (each at most
//! [`MAX_RECORD_BYTES`], compressed and decompressed): the one that is read, and the next one,
//! decompressed meanwhile.
//!
//! Architecture invariants: nothing else imports `mcap`. No double passes through text, and none is
//! computed here: a frame keeps the bits with which it was accepted. `docs/FORMAT.md` describes every
//! byte.

mod error;
#[cfg(feature = "fuzzing")]
#[doc(hidden)]
pub mod fuzzing;
mod head;
mod proto;
mod read;
mod repair;
mod results;
mod write;

pub use error::{ReadError, WriteError};
pub use head::{BeginRecord, EndRecord, hex, state_hash};
pub use proto::DescribedTopic;
pub use read::contents::OtherRecords;
pub use read::encoded::{EncodedStates, SummaryChecker, SummaryDifference};
pub use read::info::{ChannelInfo, RecordingInfo};
pub use read::others::{CopyError, OtherChannels, OtherCopier, OtherMessage};
pub use read::records::MAX_RECORD_BYTES;
pub use read::salvage::{Damage, DamageKind, LostFrames, MOST_DAMAGES};
pub use read::source::RecordingSource;
pub use repair::audit::{Audit, Audited, RecordedState, RowsFound};
pub use repair::interrupted::{InterruptedRecording, ResumeError};
pub use results::contacts::{COMPRESSED, ContactsReader, ContactsRow, ContactsWriter, OPEN, TOUCHING};
pub use results::recorded_rows::RecordedRows;
pub use results::row_messages::{RecordedRow, RowMessages};
pub use write::channel_writer::{Compression, Finished, WriteOptions};
pub use write::disk::{DiskWatch, room_for};
pub use write::foreign::{ForeignChannel, ForeignWriter};
pub use write::foxglove;
pub use write::parts::{PartsWriter, Split, part_path};
pub use write::scalars::Scalars;
pub use write::space::SpaceNeeded;
pub use write::writer::RecordingWriter;

/// Profile of our files in the MCAP header.
pub const PROFILE: &str = "beadline";

/// Simulated time in ns from 0, as in the log and publish times of messages: rounded, so neighbours may
/// be equal.
pub fn log_time_ns(time_s: f64) -> u64 {
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates, NaN is 0")]
    let ns = (time_s * 1e9).round() as u64;
    ns
}
