//! From protobuf messages to states, in any valid encoding.

use crate::proto;
use prost::Message;
use schemas::manifest::RunManifest;

/// Numbers of doubles in the arrays of a state.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StateLengths {
    /// Values in displacement and in velocity.
    pub(crate) beads: usize,
    /// Values in extra.
    pub(crate) extra: usize,
}

impl StateLengths {
    /// Lengths of the states of the run `manifest`.
    pub(crate) fn of(manifest: &RunManifest) -> Self {
        let per_bead = 2 + manifest.physics.extra_per_bead();
        let beads = manifest.frame_doubles() / per_bead;
        Self { beads, extra: manifest.frame_doubles() - 2 * beads }
    }
}

/// A state without its arrays.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StateHead {
    pub(crate) frame: Option<u64>,
    pub(crate) step: u64,
    pub(crate) time_s: f64,
}

/// Decodes a `ChainState`, its arrays `[u | v | extra]` into `doubles`.
///
/// Messages of our writer are parsed here, with one copy of each double; prost parses every other valid encoding of
/// the same message.
pub(crate) fn state(
    message: &[u8],
    lengths: StateLengths,
    doubles: &mut Vec<f64>,
) -> Result<StateHead, String> {
    match canonical(message, lengths) {
        Some((head, arrays)) => {
            doubles.resize(2 * lengths.beads + lengths.extra, 0.0);
            let mut rest = doubles.as_mut_slice();
            for array in arrays {
                let (values, after) = rest.split_at_mut_checked(array.len()).ok_or("arrays")?;
                for (value, bytes) in values.iter_mut().zip(array) {
                    *value = f64::from_le_bytes(*bytes);
                }
                rest = after;
            }
            Ok(head)
        }
        None => general(message, lengths, doubles),
    }
}

/// Decodes step and frame only; the arrays may be of any length.
pub(crate) fn head(message: &[u8]) -> Result<StateHead, String> {
    if let Some(head) = canonical_of_any_length(message) {
        return Ok(head);
    }
    let state = decode(message)?;
    Ok(StateHead { frame: state.frame, step: state.step, time_s: state.time_s })
}

/// The head of a `ChainState` whose arrays have these `lengths`. The arrays are not copied if our writer wrote them.
pub(crate) fn checked_head(message: &[u8], lengths: StateLengths) -> Result<StateHead, String> {
    match canonical(message, lengths) {
        Some((head, _)) => Ok(head),
        None => general(message, lengths, &mut Vec::new()),
    }
}

/// Longest `Summary` (bytes) that is read of the run `manifest`: a few times the size in any encoding. An entry takes
/// at least two bytes in a message, and many times that in memory.
pub(crate) fn longest_summary(manifest: &RunManifest) -> usize {
    1024 + 128 * manifest.physics.impurities.len()
}

/// Frame, step and time of a `Summary`, whose first fields are those of a state; none if `message` is neither a
/// summary of our writer nor a valid one.
pub(crate) fn summary_head(mut message: &[u8]) -> Option<StateHead> {
    let whole = message;
    let head = canonical_head(&mut message)?;
    // kinetic_j follows, or all numbers are 0
    if message.first().is_none_or(|tag| *tag >= 0x21) {
        return Some(head);
    }
    let proto::Summary { frame, step, time_s, .. } = proto::Summary::decode(whole).ok()?;
    Some(StateHead { frame: Some(frame), step, time_s })
}

/// True if `message` is a state with arrays of these lengths, encoded as our writer does.
pub(crate) fn is_canonical(message: &[u8], lengths: StateLengths) -> bool {
    canonical(message, lengths).is_some()
}

/// The head of a state with arrays of any length. Nothing may follow the arrays: it could repeat the head.
fn canonical_of_any_length(message: &[u8]) -> Option<StateHead> {
    let mut rest = message;
    let head = canonical_head(&mut rest)?;
    for tag in [0x22, 0x2a, 0x32] {
        if take_tag(&mut rest, tag) {
            let length = usize::try_from(varint(&mut rest)?).ok()?;
            rest = rest.get(length..).filter(|_| length.is_multiple_of(8))?;
        }
    }
    rest.is_empty().then_some(head)
}

type Doubles<'a> = &'a [[u8; 8]];

fn canonical(message: &[u8], lengths: StateLengths) -> Option<(StateHead, [Doubles<'_>; 3])> {
    let mut rest = message;
    let head = canonical_head(&mut rest)?;
    let u_m = packed(&mut rest, 0x22, lengths.beads)?;
    let v_m_s = packed(&mut rest, 0x2a, lengths.beads)?;
    let extra = packed(&mut rest, 0x32, lengths.extra)?;
    rest.is_empty().then_some((head, [u_m, v_m_s, extra]))
}

fn canonical_head(rest: &mut &[u8]) -> Option<StateHead> {
    let frame = if take_tag(rest, 0x08) { Some(varint(rest)?) } else { None };
    let step = if take_tag(rest, 0x10) { varint(rest)? } else { 0 };
    let time_s = if take_tag(rest, 0x19) {
        let (bytes, after) = rest.split_first_chunk::<8>()?;
        *rest = after;
        f64::from_le_bytes(*bytes)
    } else {
        0.0
    };
    Some(StateHead { frame, step, time_s })
}

fn take_tag(rest: &mut &[u8], tag: u8) -> bool {
    match rest.split_first() {
        Some((first, after)) if *first == tag => {
            *rest = after;
            true
        }
        _ => false,
    }
}

/// A varint of at most nine bytes; longer ones are left to prost.
fn varint(rest: &mut &[u8]) -> Option<u64> {
    let mut value = 0;
    for shift in (0..63).step_by(7) {
        let (byte, after) = rest.split_first()?;
        *rest = after;
        value |= u64::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            return Some(value);
        }
    }
    None
}

/// A packed field of exactly `count` doubles, absent if there are none.
fn packed<'a>(rest: &mut &'a [u8], tag: u8, count: usize) -> Option<Doubles<'a>> {
    if count == 0 {
        return Some(&[]);
    }
    if !take_tag(rest, tag) || usize::try_from(varint(rest)?).ok()? != count.checked_mul(8)? {
        return None;
    }
    let (bytes, after) = rest.split_at_checked(count.checked_mul(8)?)?;
    *rest = after;
    Some(bytes.as_chunks::<8>().0)
}

fn decode(message: &[u8]) -> Result<proto::ChainState, String> {
    proto::ChainState::decode(message).map_err(|error| format!("a state that is no ChainState: {error}"))
}

pub(crate) fn general(
    message: &[u8],
    lengths: StateLengths,
    doubles: &mut Vec<f64>,
) -> Result<StateHead, String> {
    let state = decode(message)?;
    let arrays = [
        ("displacement_m", &state.displacement_m, lengths.beads),
        ("velocity_m_s", &state.velocity_m_s, lengths.beads),
        ("extra", &state.extra, lengths.extra),
    ];
    doubles.clear();
    for (name, values, expected) in arrays {
        if values.len() != expected {
            let (step, found) = (state.step, values.len());
            return Err(format!(
                "the state of step {step} has {found} values of {name} instead of {expected}"
            ));
        }
        doubles.extend_from_slice(values);
    }
    Ok(StateHead { frame: state.frame, step: state.step, time_s: state.time_s })
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENGTHS: StateLengths = StateLengths { beads: 2, extra: 0 };

    #[test]
    fn other_valid_encodings_are_read_too() {
        // fields in reverse order, the velocities not packed, an unknown field, a step in two parts
        let mut message = vec![0x29];
        message.extend(1.5_f64.to_le_bytes());
        message.push(0x29);
        message.extend((-2.5_f64).to_le_bytes());
        message.extend([0x22, 16]);
        message.extend(0.25_f64.to_le_bytes());
        message.extend((-0.0_f64).to_le_bytes());
        message.extend([0x19]);
        message.extend(1e-6_f64.to_le_bytes());
        message.extend([0x10, 0x85, 0x00]);
        message.extend([0x98, 0x06, 0x01]);
        let mut doubles = Vec::new();
        let decoded = state(&message, LENGTHS, &mut doubles).expect("valid");
        assert_eq!((decoded.frame, decoded.step, decoded.time_s), (None, 5, 1e-6));
        assert_eq!(doubles, [0.25, -0.0, 1.5, -2.5]);
        assert!(doubles[1].is_sign_negative());
        assert_eq!(head(&message).expect("valid").step, 5);
    }

    #[test]
    fn a_step_that_is_said_again_after_the_arrays_counts() {
        let mut message = proto::ChainState {
            step: 7,
            displacement_m: vec![1.0, 2.0],
            velocity_m_s: vec![0.0; 2],
            ..Default::default()
        }
        .encode_to_vec();
        assert_eq!(head(&message).expect("valid").step, 7);
        message.extend([0x10, 9]);
        assert_eq!(head(&message).expect("valid").step, 9);
        assert_eq!(state(&message, LENGTHS, &mut Vec::new()).expect("valid").step, 9);
    }

    #[test]
    fn wrong_lengths_are_named() {
        let message = proto::ChainState {
            step: 7,
            displacement_m: vec![0.0; 3],
            velocity_m_s: vec![0.0; 2],
            ..Default::default()
        };
        let error = state(&message.encode_to_vec(), LENGTHS, &mut Vec::new()).expect_err("too long");
        assert_eq!(error, "the state of step 7 has 3 values of displacement_m instead of 2");
    }
}
