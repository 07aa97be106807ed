//! The space-time map of the velocities as images.

use super::colour;
use crate::Excerpt;
use consumers::space_time::{Extent, Picture, singles};
use recording::foxglove::{RawImage, timestamp};
use recording::log_time_ns;
use schemas::frame::Frame;

/// The map of a part of a run: beads across, time down.
pub(super) struct SpaceTime {
    map: Picture<f32>,
    begin_s: f64,
    scale_m_s: f64,
}

impl SpaceTime {
    pub(super) fn new(excerpt: &Excerpt, scale_m_s: f64) -> Self {
        let (first_step, last_step) = excerpt.steps();
        let extent = Extent { places: excerpt.beads.clone(), steps: first_step..=last_step };
        Self { map: Picture::new(extent), begin_s: excerpt.begin_s(), scale_m_s }
    }

    pub(super) fn push(&mut self, frame: &Frame<'_>) {
        self.map.push(frame.step, singles(frame.v_m_s.iter().copied()));
    }

    pub(super) fn gap(&mut self) {
        self.map.gap();
    }

    /// The velocities (m/s), NaN where nothing is known; and the same as colours, grey there.
    pub(super) fn images(&self) -> [RawImage; 2] {
        let values = self.map.cells().flat_map(|v| v.unwrap_or(f32::NAN).to_le_bytes()).collect();
        let colour = |v: Option<f32>| v.map_or(colour::NOTHING, |v| colour::of(v.into(), self.scale_m_s));
        let colours = self.map.cells().flat_map(colour).collect();
        [self.image("32FC1", 4, values), self.image("rgb8", 3, colours)]
    }

    fn image(&self, encoding: &str, cell_bytes: u32, data: Vec<u8>) -> RawImage {
        // at most Cell::MOST
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
