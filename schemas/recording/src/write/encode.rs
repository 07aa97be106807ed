//! From frames and summaries to protobuf messages.

use crate::proto;
use schemas::chain::{Chain, Wall};
use schemas::frame::Frame;
use schemas::summary::Summary;
use schemas::term::Term;

/// Longest `ChainState` without its doubles: tags, varints, time.
pub(crate) const STATE_HEAD_BYTES: u64 = 11 + 11 + 9 + 3 * 6;

/// Frames states as `ChainState` messages, equal byte for byte to what prost generates, with one copy of
/// each double. Keeps its buffer, so that nothing is allocated or cleared from frame to frame.
#[derive(Debug, Default)]
pub(crate) struct StateEncoder {
    bytes: Vec<u8>,
    length: usize,
}

impl StateEncoder {
    /// The message of `frame`, until the next call; without its number if it is a state between frames.
    pub(crate) fn encode(&mut self, frame: &Frame<'_>, is_frame: bool) -> &[u8] {
        self.length = 0;
        if is_frame {
            self.put(&[0x08]);
            self.put_varint(frame.frame);
        }
        if frame.step != 0 {
            self.put(&[0x10]);
            self.put_varint(frame.step);
        }
        if frame.time_s.to_bits() != 0 {
            self.put(&[0x19]);
            self.put(&frame.time_s.to_le_bytes());
        }
        self.put_doubles(0x22, frame.u_m);
        self.put_doubles(0x2a, frame.v_m_s);
        self.put_doubles(0x32, frame.extra);
        self.last()
    }

    /// The message encoded last.
    pub(crate) fn last(&self) -> &[u8] {
        self.bytes.get(..self.length).unwrap_or_default()
    }

    /// The next `count` bytes of the buffer, to be overwritten.
    fn take(&mut self, count: usize) -> &mut [u8] {
        let start = self.length;
        self.length += count;
        if self.bytes.len() < self.length {
            self.bytes.resize(self.length, 0);
        }
        &mut self.bytes[start..self.length]
    }

    fn put(&mut self, bytes: &[u8]) {
        self.take(bytes.len()).copy_from_slice(bytes);
    }

    fn put_varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            let [low, ..] = value.to_le_bytes();
            self.put(&[low | 0x80]);
            value >>= 7;
        }
        let [low, ..] = value.to_le_bytes();
        self.put(&[low]);
    }

    /// A packed field of doubles, absent if there are none.
    fn put_doubles(&mut self, tag: u8, values: &[f64]) {
        if values.is_empty() {
            return;
        }
        self.put(&[tag]);
        self.put_varint(8 * values.len() as u64);
        let (chunks, _) = self.take(8 * values.len()).as_chunks_mut::<8>();
        // the optimiser makes one memcpy of this
        for (bytes, value) in chunks.iter_mut().zip(values) {
            *bytes = value.to_le_bytes();
        }
    }
}

/// The `Summary` message of `frame`.
pub(crate) fn summary(frame: &Frame<'_>, summary: &Summary) -> proto::Summary {
    proto::Summary {
        frame: frame.frame,
        step: frame.step,
        time_s: frame.time_s,
        kinetic_j: summary.energy.kinetic_j,
        potential_j: summary.energy.potential_j,
        total_j: summary.energy.total_j(),
        relative_drift: summary.relative_drift,
        front_bead: summary.front_bead,
        dissipated_j: summary.dissipated_j,
        driven_j: summary.driven_j,
        impurity: summary
            .impurities
            .iter()
            .map(|bead| proto::summary::Impurity {
                bead: bead.bead,
                displacement_m: bead.u_m,
                velocity_m_s: bead.v_m_s,
            })
            .collect(),
    }
}

/// The `Chain` message of a resolved chain.
pub(crate) fn chain(chain: &Chain) -> proto::Chain {
    let damping = chain.damping.as_ref().map_or([0.0; 2], |damping| damping.wall_coefficient);
    proto::Chain {
        mass_kg: chain.mass_kg.clone(),
        stiffness: chain.stiffness.clone(),
        rest_overlap_m: chain.rest_overlap_m.clone(),
        alpha: chain.law.alpha(),
        rest_force_n: chain.rest_force_n.clone(),
        left_wall: wall(chain.walls.left, damping[0]).filter(|_| !chain.is_ring),
        right_wall: wall(chain.walls.right, damping[1]),
        damping: chain.damping.as_ref().map(|damping| damping.coefficient.clone()).unwrap_or_default(),
        damping_exponent: chain
            .damping
            .as_ref()
            .map_or(0.0, |damping| damping.kind.exponent(chain.law.alpha())),
        terms: chain.terms.iter().map(|of| term(of, chain.is_ring)).collect(),
        on_site: chain.sites.linear_n_per_m.clone(),
        on_site_cubic: chain.sites.cubic_n_per_m3.clone(),
        drag: chain.sites.drag_n_s_per_m.clone(),
        resonator_mass_kg: chain.sites.resonator_kg.clone(),
        resonator_stiffness: chain.sites.resonator_n_per_m.clone(),
        ring: wall(chain.walls.left, damping[0]).filter(|_| chain.is_ring),
        damping_power: chain
            .damping
            .as_ref()
            .and_then(|damping| damping.kind.raised(chain.law.alpha()))
            .map_or(0.0, |law| law.alpha()),
    }
}

fn term(term: &Term, is_ring: bool) -> proto::chain::Term {
    let (kind, parameter) = term.law.named();
    let [first, right_wall] = term.wall_stiffness;
    let (left_wall, ring) = if is_ring { (0.0, first) } else { (first, 0.0) };
    let stiffness = term.stiffness.clone();
    proto::chain::Term { kind: kind.to_owned(), parameter, stiffness, left_wall, right_wall, ring }
}

/// The wall, if there is one.
fn wall(wall: Wall, damping: f64) -> Option<proto::chain::Wall> {
    let Wall { is_there, stiffness, rest_overlap_m, rest_force_n, .. } = wall;
    is_there.then_some(proto::chain::Wall { stiffness, rest_overlap_m, rest_force_n, damping })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::decode::{self, StateLengths};
    use prost::Message;

    /// `SplitMix64`: any seed will do.
    struct Random(u64);

    impl Random {
        fn next(&mut self) -> u64 {
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            z ^ (z >> 31)
        }

        /// Small and large numbers alike.
        fn number(&mut self) -> u64 {
            let shift = self.next() % 65;
            self.next().checked_shr(u32::try_from(shift).unwrap_or(0)).unwrap_or(0)
        }

        /// Every kind of double: ordinary, ±0, subnormal, infinite, NaN with any payload.
        fn doubles(&mut self, count: u64) -> Vec<f64> {
            let special = [0.0, -0.0, f64::MIN_POSITIVE / 2.0, f64::INFINITY, f64::NEG_INFINITY];
            (0..count)
                .map(|_| match self.next() % 8 {
                    0 => special[usize::try_from(self.next() % 5).unwrap_or(0)],
                    1 => f64::from_bits(0x7ff0_0000_0000_0001 | self.next()),
                    _ => f64::from_bits(self.next()),
                })
                .collect()
        }
    }

    #[test]
    fn the_hot_path_equals_the_generated_encoder_byte_for_byte() {
        let mut random = Random(1);
        let mut encoder = StateEncoder::default();
        for round in 0..2000 {
            let beads = if round % 100 == 0 { 3000 } else { 1 + random.next() % 40 };
            let extra = beads * (random.next() % 3);
            let (u_m, v_m_s, extra) = (random.doubles(beads), random.doubles(beads), random.doubles(extra));
            // −0 is no time, and prost would drop it, unlike protobuf's own encoders
            let time_s = random.doubles(1)[0] + 0.0;
            let (frame, step) = (random.number(), random.number());
            let is_frame = !random.next().is_multiple_of(4);
            let state = Frame { frame, step, time_s, u_m: &u_m, v_m_s: &v_m_s, extra: &extra, active: None };
            let encoded = encoder.encode(&state, is_frame);
            let frame = is_frame.then_some(frame);
            let generated = proto::ChainState {
                frame,
                step,
                time_s,
                displacement_m: u_m.clone(),
                velocity_m_s: v_m_s.clone(),
                extra: extra.clone(),
            };
            assert_eq!(encoded, generated.encode_to_vec());
            assert!(encoded.len() as u64 <= STATE_HEAD_BYTES + 8 * (2 * beads + extra.len() as u64));

            let lengths = StateLengths { beads: u_m.len(), extra: extra.len() };
            let mut doubles = Vec::new();
            let head = decode::state(encoded, lengths, &mut doubles).expect("decodes");
            assert_eq!((head.frame, head.step), (frame, step));
            assert_eq!(head.time_s.to_bits(), time_s.to_bits());
            let bits = |values: &[f64]| values.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&doubles), bits(&[u_m, v_m_s, extra].concat()));
        }
    }
}
