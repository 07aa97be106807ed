//! Rows of results: checks that they belong to the run and are in order.

use crate::results::row_messages::RowHead;
use schemas::manifest::RunManifest;

/// Largest number of ranges of missing rows that are kept; more are only counted.
const MOST_RANGES: usize = 20;

/// The rows of one topic.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RowsFound {
    /// Number of rows.
    pub count: u64,
    /// Frame of the first one.
    pub first_frame: u64,
    /// Frame of the last one.
    pub last_frame: u64,
    /// The first ranges of frames without a row between the first and the last row, from and up to.
    pub missing: Vec<(u64, u64)>,
    /// Number of these ranges.
    pub missing_count: u64,
}

impl RowsFound {
    /// Takes the next row, or returns the reason why it cannot be the next one.
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
