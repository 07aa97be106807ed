//! Rows of results: whose they are, and whether they are in order.

use crate::results::row_messages::RowHead;
use schemas::manifest::RunManifest;

/// The ranges of missing rows that are kept; more are only counted.
const MOST_RANGES: usize = 20;

/// The rows of one topic.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RowsFound {
    /// How many there are.
    pub count: u64,
    /// Frame of the first one.
    pub first_frame: u64,
    /// Frame of the last one.
    pub last_frame: u64,
    /// Frames between those that have no row, from and up to; the first ranges.
    pub missing: Vec<(u64, u64)>,
    /// How many ranges there are.
    pub missing_count: u64,
}

impl RowsFound {
    /// Takes the next row, or says why it cannot be the next one.
    pub(super) fn take(&mut self, row: &RowHead, manifest: &RunManifest) -> Result<(), String> {
        let RowHead { frame, step, time_s } = *row;
        let is_frame = frame < manifest.frame_count() && manifest.step_of_frame(frame) == step;
        if !is_frame || time_s.to_bits() != manifest.physics.time_s(step).to_bits() {
            return Err(format!(
                "a row of frame {frame}, step {step}, at {time_s} s, which are not one frame of the run"
            ));
        }
        if self.count == 0 {
            self.first_frame = frame;
        } else if frame <= self.last_frame {
            return Err(format!("the row of frame {frame} after that of frame {}", self.last_frame));
        } else if frame > self.last_frame + 1 {
            self.missing_count += 1;
            if self.missing.len() < MOST_RANGES {
                self.missing.push((self.last_frame + 1, frame - 1));
            }
        }
        self.count += 1;
        self.last_frame = frame;
        Ok(())
    }
}
