//! Our own messages of scalars in files for other programs.

use crate::proto::{self, DescribedTopic};
use crate::write::encode;
use prost::Message;
use schemas::frame::Frame;
use schemas::summary::Summary;

/// Encodes messages with flat, named numbers, which any tool that knows protobuf plots. Keeps its buffer.
#[derive(Debug, Default)]
pub struct Scalars {
    message: Vec<u8>,
}

impl Scalars {
    /// The channel of the summaries, as it is in recordings.
    pub const SUMMARY: DescribedTopic<'static> = proto::SUMMARY;

    /// The channel `topic` of the motion of one bead.
    pub fn motion_topic(topic: &str) -> DescribedTopic<'_> {
        let descriptor = include_bytes!("../../proto/made/bead_motion.binpb");
        DescribedTopic { topic, message: "beadline.v1.BeadMotion", descriptor }
    }

    /// The message of the summary of `frame`.
    pub fn summary(&mut self, frame: &Frame<'_>, summary: &Summary) -> &[u8] {
        self.encode(&encode::summary(frame, summary))
    }

    /// The message of the motion of `bead` in `frame`: displacement (m), velocity (m/s), overlap with the left and with the
    /// right neighbour (m).
    pub fn motion(&mut self, frame: &Frame<'_>, bead: u64, values: [f64; 4]) -> &[u8] {
        let [displacement_m, velocity_m_s, overlap_left_m, overlap_right_m] = values.map(Some);
        self.encode(&proto::BeadMotion {
            step: frame.step,
            time_s: frame.time_s,
            bead,
            displacement_m,
            velocity_m_s,
            overlap_left_m,
            overlap_right_m,
        })
    }

    fn encode(&mut self, message: &impl Message) -> &[u8] {
        self.message.clear();
        message.encode_raw(&mut self.message);
        &self.message
    }
}
