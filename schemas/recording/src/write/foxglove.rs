//! Messages that Foxglove, Lichtblick and Rerun draw by themselves.

use crate::DescribedTopic;
use prost::Message;
pub use prost_types::Timestamp;

/// As prost generates them from `proto/foxglove`.
mod messages {
    #![allow(missing_docs, unreachable_pub, clippy::pedantic, reason = "generated code")]

    include!("../../proto/made/foxglove.rs");
}

pub use messages::log::Level;
pub use messages::packed_element_field::NumericType;
pub use messages::{Log, PackedElementField, PointCloud, Pose, Quaternion, RawImage, Vector3};

/// A message with a channel of its own.
pub trait FoxgloveMessage: Message {
    /// The channel `topic` of such messages.
    fn topic(topic: &str) -> DescribedTopic<'_>;
}

macro_rules! described {
    ($($message:ident),*) => {$(
        impl FoxgloveMessage for $message {
            fn topic(topic: &str) -> DescribedTopic<'_> {
                let descriptor = include_bytes!(concat!("../../proto/made/", stringify!($message), ".binpb"));
                DescribedTopic { topic, message: concat!("foxglove.", stringify!($message)), descriptor }
            }
        }
    )*};
}

described!(Log, PointCloud, RawImage);

/// The simulated time `time_ns`, from 0.
pub fn timestamp(time_ns: u64) -> Timestamp {
    // less than 1e9 each
    let seconds = i64::try_from(time_ns / 1_000_000_000).unwrap_or(i64::MAX);
    let nanos = i32::try_from(time_ns % 1_000_000_000).unwrap_or(0);
    Timestamp { seconds, nanos }
}
