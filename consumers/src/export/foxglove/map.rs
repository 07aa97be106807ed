//! The space-time map of the velocities as images.

use super::colour;
use crate::export::Excerpt;
use crate::pulses::VelocityMap;
use schemas::foxglove::{RawImage, timestamp};
use schemas::frame::Frame;
use schemas::recording::log_time_ns;

/// The map of a part of a run: beads across, time down.
pub(super) struct SpaceTime {
    map: VelocityMap,
    first_step: u64,
    begin_s: f64,
    scale_m_s: f64,
}

impl SpaceTime {
    pub(super) fn new(excerpt: &Excerpt, scale_m_s: f64) -> Self {
        let (first_step, last_step) = excerpt.steps();
        let map = VelocityMap::new(excerpt.beads.len(), last_step - first_step);
        Self { map, first_step, begin_s: excerpt.begin_s(), scale_m_s }
    }

    pub(super) fn push(&mut self, excerpt: &Excerpt, frame: &Frame<'_>) {
        let (u_m, v_m_s) = excerpt.of(frame);
        self.map.push(&Frame { step: frame.step - self.first_step, u_m, v_m_s, ..*frame });
    }

    /// The velocities (m/s), and the same as colours.
    pub(super) fn images(&mut self) -> [RawImage; 2] {
        self.map.fill_rows();
        let cells = self.map.cells();
        let values = cells.iter().flat_map(|v| v.to_le_bytes()).collect();
        #[expect(clippy::cast_possible_truncation, reason = "seven digits are enough for a colour")]
        let scale = self.scale_m_s as f32;
        let colours = cells.iter().flat_map(|v| colour::of(*v, scale)).collect();
        [self.image("32FC1", 4, values), self.image("rgb8", 3, colours)]
    }

    fn image(&self, encoding: &str, cell_bytes: u32, data: Vec<u8>) -> RawImage {
        // at most VelocityMap::MAX_SIDE
        let side = |cells: usize| u32::try_from(cells).unwrap_or(u32::MAX);
        let width = side(self.map.columns());
        RawImage {
            timestamp: Some(timestamp(log_time_ns(self.begin_s))),
            frame_id: "space-time".into(),
            width,
            height: side(self.map.rows()),
            encoding: encoding.into(),
            step: width * cell_bytes,
            data,
        }
    }
}
