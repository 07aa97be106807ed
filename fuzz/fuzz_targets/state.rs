//! Decoding a state: whatever the bytes are, the fast way and prost say the same.
//!
//! The first byte says how many beads and further values the state should have, the rest is the message.

#![no_main]

use libfuzzer_sys::fuzz_target;
use recording::fuzzing::{state, state_by_prost, state_step};

fuzz_target!(|bytes: &[u8]| {
    let Some((lengths, message)) = bytes.split_first() else { return };
    let (beads, extra_per_bead) = (usize::from(lengths & 0x1f) + 1, usize::from(lengths >> 5));
    let extra = beads * extra_per_bead;
    let (fast, slow) = (state(message, beads, extra), state_by_prost(message, beads, extra));
    match (&fast, &slow) {
        (Ok((step, doubles)), Ok((other_step, others))) => {
            assert_eq!(step, other_step);
            assert_eq!(doubles.len(), 2 * beads + extra);
            assert!(doubles.iter().zip(others).all(|(a, b)| a.to_bits() == b.to_bits()));
            assert_eq!(state_step(message).as_ref(), Ok(step));
        }
        (Err(_), Err(_)) => drop(state_step(message)),
        _ => panic!("the fast way says {fast:?}, prost {slow:?}"),
    }
});
