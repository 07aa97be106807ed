//! The chain as a cloud of points.

use super::colour;
use crate::Excerpt;
use recording::foxglove::{
    NumericType, PackedElementField, PointCloud, Pose, Quaternion, Vector3, timestamp,
};
use recording::log_time_ns;
use schemas::frame::Frame;

/// Most points in a cloud.
const MOST_POINTS: usize = 2000;

/// Length of the whole chain in the picture; the velocity scale has the length 1.
const CHAIN_LENGTH: f64 = 10.0;

/// Name, offset and type of a point's fields.
const FIELDS: [(&str, u32, NumericType); 10] = [
    ("x", 0, NumericType::Float32),
    ("y", 4, NumericType::Float32),
    ("z", 8, NumericType::Float32),
    ("bead", 12, NumericType::Uint32),
    ("displacement_m", 16, NumericType::Float64),
    ("velocity_m_s", 24, NumericType::Float64),
    ("red", 32, NumericType::Uint8),
    ("green", 33, NumericType::Uint8),
    ("blue", 34, NumericType::Uint8),
    ("alpha", 35, NumericType::Uint8),
];

const POINT_BYTES: u32 = 36;

/// Rerun's name of the root of its scene, which alone it shows without transforms; others take any name.
const FRAME: &str = "tf#/";

/// The beads of `frame` along x, each as high as it is fast: its velocity in units of `scale_m_s`.
pub(super) fn of(excerpt: &Excerpt, frame: &Frame<'_>, scale_m_s: f64) -> PointCloud {
    let (u_m, v_m_s) = excerpt.of(frame);
    let last_bead = excerpt.manifest.physics.beads as f64 - 1.0;
    let mut data = Vec::new();
    for i in shown(v_m_s, MOST_POINTS) {
        let bead = excerpt.beads.start + i;
        let along = if last_bead > 0.0 { bead as f64 / last_bead - 0.5 } else { 0.0 };
        #[expect(clippy::cast_possible_truncation, reason = "a place on a screen")]
        let place = [(CHAIN_LENGTH * along) as f32, 0.0, (v_m_s[i] / scale_m_s) as f32];
        data.extend(place.iter().flat_map(|x| x.to_le_bytes()));
        data.extend(u32::try_from(bead).unwrap_or(u32::MAX).to_le_bytes());
        data.extend(u_m[i].to_le_bytes());
        data.extend(v_m_s[i].to_le_bytes());
        data.extend(colour::of(v_m_s[i], scale_m_s));
        data.push(u8::MAX);
    }
    let field = |(name, offset, kind): (&str, u32, NumericType)| PackedElementField {
        name: name.into(),
        offset,
        r#type: kind.into(),
    };
    PointCloud {
        timestamp: Some(timestamp(log_time_ns(frame.time_s))),
        frame_id: FRAME.into(),
        pose: Some(Pose {
            position: Some(Vector3::default()),
            orientation: Some(Quaternion { w: 1.0, ..Quaternion::default() }),
        }),
        point_stride: POINT_BYTES,
        fields: FIELDS.map(field).to_vec(),
        data,
    }
}

/// At most `most` of the indices of `values`, in order. Where there are more values, the least and the largest of each
/// of `most/2` stretches, so that no peak is lost.
fn shown(values: &[f64], most: usize) -> Vec<usize> {
    if values.len() <= most {
        return (0..values.len()).collect();
    }
    let stretches = most / 2;
    let mut indices = Vec::with_capacity(most);
    for stretch in 0..stretches {
        let begin = stretch * values.len() / stretches;
        let end = (stretch + 1) * values.len() / stretches;
        let (mut least, mut largest) = (begin, begin);
        for i in begin..end {
            if values[i] < values[least] {
                least = i;
            }
            if values[i] > values[largest] {
                largest = i;
            }
        }
        indices.extend([least.min(largest), least.max(largest)]);
    }
    indices.dedup();
    indices
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_extremes_of_each_stretch_are_shown() {
        let mut values = vec![0.0; 10_000];
        (values[1234], values[1235], values[9999]) = (5.0, -4.0, 1.0);
        let indices = shown(&values, 100);
        assert!(indices.len() <= 100 && indices.is_sorted(), "{indices:?}");
        assert!([1234, 1235, 9999].iter().all(|peak| indices.contains(peak)), "{indices:?}");
        assert_eq!(shown(&values[..7], 7), [0, 1, 2, 3, 4, 5, 6]);
    }
}
